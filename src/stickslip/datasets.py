"""Record sets by name: the public ones with address, checksum, licence and citation, and the bundled demonstration.

A set that other people measured is fetched from its public address and checked against the sha256 of the file that the
project's tests were written on. A set whose owner states no licence is known by name and address, and never fetched.
The environment variable ``STICKSLIP_DATA`` names a folder that holds the sets, each in a folder of its name; with it
set, nothing is fetched.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import sys
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import RecordError, package
from stickslip.record.channels import Channel, described
from stickslip.record.record import Record, Step

FOLDER_VARIABLE = "STICKSLIP_DATA"


@dataclass(frozen=True)
class SetFile:
    """One file of a set.

    Attributes
    ----------
    sha256 : str
        What its content must hash to.
    url : str
        The address of exactly that version, where one is known.
    """

    sha256: str
    url: str = ""


@dataclass(frozen=True)
class Source:
    """Where a record set comes from and what it may be used for.

    Attributes
    ----------
    name, title : str
        Name to fetch it by, and what it holds in words.
    address : str
        The owner's page.
    licence : str
        The owner's licence; empty where none is stated.
    citation : str
        Whom to cite.
    files : mapping of str to SetFile
        Checksum and address of each file.
    contents : str
        Columns, units and the rig's constants, where its owner tells them.
    """

    name: str
    title: str
    address: str
    licence: str
    citation: str
    files: Mapping[str, SetFile]
    contents: str = ""

    @property
    def fetchable(self) -> bool:
        """Whether the licence allows the set to be fetched for you."""
        return bool(self.licence)

    def __str__(self) -> str:
        licence = self.licence or "none stated, so the set is not fetched"
        parts = (f"{self.name}: {self.title}", self.contents, f"from {self.address}", f"licence {licence}")
        return "\n  ".join([*(part for part in parts if part), f"cite {self.citation}"])


@dataclass(frozen=True)
class Dataset:
    """A record set on this machine, every file with the checksum it should have.

    Attributes
    ----------
    name : str
        Name of the set.
    folder : Path
        Where its files are.
    files : tuple of Path
        The files.
    licence, citation, address : str
        As stated by the owner; see :func:`info`.
    """

    name: str
    folder: Path
    files: tuple[Path, ...]
    licence: str
    citation: str
    address: str


def names() -> list[str]:
    """The names of the public record sets.

    Returns
    -------
    list of str

    Examples
    --------
    >>> "frame_base_excited" in names()
    True
    """
    return list(_catalogue())


def info(name: str) -> Source:
    """Where a set comes from: page, licence, citation, files with checksums.

    Parameters
    ----------
    name : str
        One of :func:`names`.

    Returns
    -------
    Source

    Raises
    ------
    RecordError
        No set has that name.

    Examples
    --------
    >>> info("frame_base_excited").licence
    'GPL-3.0'
    >>> info("emps").fetchable
    False
    """
    catalogue = _catalogue()
    if name not in catalogue:
        raise RecordError(f"record set '{name}'", f"the sets are {', '.join(catalogue)}", "choose one of them")
    return catalogue[name]


def fetch(name: str, *, files: Iterable[str] | None = None) -> Dataset:
    """A public record set on this machine: found in the local folder or the cache, else fetched.

    Every file is checked against its sha256, wherever it comes from. When something has to be fetched, the licence
    and the citation are shown on the error stream.

    Parameters
    ----------
    name : str
        One of :func:`names`.
    files : iterable of str, optional
        These files alone; all that have an address (in a local folder: all) where left out.

    Returns
    -------
    Dataset

    Raises
    ------
    RecordError
        The set or file is unknown, has no licence that allows fetching, is absent or altered in the local folder, can
        not be reached, or arrives with another checksum.

    Examples
    --------
    >>> fetch("frame_base_excited").files  # doctest: +SKIP
    """
    source = info(name)
    unknown = [file for file in files or () if file not in source.files]
    if unknown:
        raise RecordError(
            f"record set {name} has no file '{unknown[0]}'", f"it holds {', '.join(source.files)}", "choose among these"
        )
    local = os.environ.get(FOLDER_VARIABLE)
    if local:
        wanted = list(source.files if files is None else files)
        folder = Path(local) / name
        paths = [_checked(folder / file, source) for file in wanted]
    else:
        wanted = [file for file, about in source.files.items() if about.url] if files is None else list(files)
        folder, paths = _fetched(source, wanted)
    return Dataset(name, folder, tuple(paths), source.licence, source.citation, source.address)


def demo() -> Record:
    """The bundled record of a simulated rig, with the true answers in ``record.truth``.

    A mass on a spring whose other end is driven harmonically, with dry friction against the ground that is higher at
    rest than in motion: it stops twice per cycle. Displacement, base displacement, acceleration and a load cell in the
    friction path are sampled with the noise and the counts of real sensors.

    Returns
    -------
    Record
        Channels ``x``, ``z`` [m], ``a`` [m/s^2] and ``load`` [N]. ``truth`` holds the rig (``mass`` [kg],
        ``stiffness`` [N/m], ``damping`` [N s/m]), the answers under the names of the estimates ("sliding friction" [N],
        "stuck share of the time", "stops per cycle", "energy per cycle" [J], ...), and ``sticks``: start and end [s]
        of each.

    Examples
    --------
    >>> record = demo()
    >>> list(record), record.fs, record.truth["sliding friction"]
    (['x', 'z', 'a', 'load'], 2000.0, 1.1)
    """
    about = json.loads(_bundled("demo.json").read_text("utf-8"))
    with _bundled("demo.npz").open("rb") as stream, np.load(stream, allow_pickle=False) as counts:
        samples = {name: counts[name] * sensor["step"] for name, sensor in about["sensors"].items()}
    channels = {
        name: Channel(name, sensor["unit"], described(name, sensor["unit"]), sensor["words"], noise=sensor["noise"])
        for name, sensor in about["sensors"].items()
    }
    history, truth = tuple(Step(**step) for step in about["history"]), about["truth"]
    static = dict.fromkeys(("static friction forward", "static friction back"), truth["static friction"])
    ratio = truth["static friction"] / truth["sliding friction"]
    truth = {**truth, **static, "static over sliding friction": ratio}
    return Record(samples, channels, about["fs"], 0.0, history, truth=truth)


def _fetched(source: Source, files: list[str]) -> tuple[Path, list[Path]]:
    without = [file for file in files if not source.files[file].url]
    if not source.fetchable or without:
        what = f"file '{without[0]}' of set {source.name}" if source.fetchable else f"record set {source.name}"
        why = "no address of that version is known" if source.fetchable else "its owner states no licence"
        raise RecordError(
            f"{what} is not fetched: {why}",
            "a set is fetched where its licence allows it and its address is known",
            f"get it from {source.address} and point {FOLDER_VARIABLE} at a folder that holds {source.name}/",
        )
    pooch = package("pooch", extra="io", rule=f"fetching {source.name} needs it", error=RecordError)
    folder = Path(pooch.os_cache("stickslip")) / source.name
    registry = {file: f"sha256:{source.files[file].sha256}" for file in files}
    store = pooch.create(folder, base_url="", registry=registry, urls={file: source.files[file].url for file in files})
    if not all((folder / file).is_file() for file in files):
        print(source, file=sys.stderr)
    return folder, [_fetch_one(store, file, source) for file in files]


def _fetch_one(store: Any, file: str, source: Source) -> Path:
    try:
        return Path(store.fetch(file))
    except ValueError as error:  # pooch: the checksum differs
        raise RecordError(
            f"{source.files[file].url} does not have the sha256 {source.files[file].sha256[:12]}...",
            "a fetched file is exactly the one that was referenced",
            f"look at {source.address}: the owner may have changed it",
        ) from error
    except OSError as error:  # not reachable, refused, or the cache can not be written
        raise RecordError(
            f"{source.files[file].url} could not be fetched ({type(error).__name__})",
            "fetching needs the network and a cache that can be written",
            f"try again, or point {FOLDER_VARIABLE} at a folder that holds {source.name}/",
        ) from error


def _checked(path: Path, source: Source) -> Path:
    if not path.is_file():
        raise RecordError(
            f"{path} is not there",
            f"{FOLDER_VARIABLE} names a folder that holds the sets by name",
            f"unset it to fetch the set, or get it from {source.address}",
        )
    if hashlib.sha256(path.read_bytes()).hexdigest() != source.files[path.name].sha256:
        raise RecordError(
            f"{path} does not have the sha256 {source.files[path.name].sha256[:12]}...",
            "a file of a set is exactly the one that was referenced",
            f"get it again from {source.address}",
        )
    return path


@functools.cache
def _catalogue() -> dict[str, Source]:
    tables = tomllib.loads(_bundled("datasets.toml").read_text("utf-8"))
    return {
        name: Source(
            name,
            table["title"],
            table["page"],
            table["licence"],
            table["citation"],
            {file: SetFile(**about) for file, about in table["files"].items()},
            table.get("contents", ""),
        )
        for name, table in tables.items()
    }


def _bundled(file: str) -> Any:
    return resources.files("stickslip").joinpath("data", file)
