"""Public record sets by name: address, checksum, licence, citation."""

from __future__ import annotations

import functools
import hashlib
import os
import tomllib
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from stickslip.errors import RecordError

FOLDER_VARIABLE = "STICKSLIP_DATA"


@dataclass(frozen=True)
class Dataset:
    """A record set on this machine."""

    name: str
    folder: Path
    files: tuple[Path, ...]


def names() -> list[str]:
    """The names of the sets."""
    return list(_catalogue())


def fetch(name: str) -> Dataset:
    """The set `name`, from the folder that STICKSLIP_DATA names."""
    folder = Path(os.environ[FOLDER_VARIABLE]) / name
    files = {folder / file: about["sha256"] for file, about in _catalogue()[name]["files"].items()}
    for path, expected in files.items():
        if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != expected:
            raise RecordError(f"{path} is absent or altered", "the set has to be whole", f"mend {folder}")
    return Dataset(name, folder, tuple(files))


@functools.cache
def _catalogue() -> dict[str, Any]:
    return tomllib.loads(resources.files("stickslip").joinpath("data/datasets.toml").read_text("utf-8"))
