"""Every example of the package says what it prints."""

from __future__ import annotations

import doctest
import importlib
import sys
from pathlib import Path

import pytest

import stickslip

PACKAGE = Path(stickslip.__file__).parent
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
WITH_EXAMPLES = sorted(file for file in PACKAGE.rglob("*.py") if ">>>" in file.read_text("utf-8"))


@pytest.mark.parametrize("file", WITH_EXAMPLES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_the_examples_run(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    if parts[-1] != "quality":  # loudness works for seconds at a second of sound: its own example is enough
        monkeypatch.setitem(sys.modules, "mosqito", None)
    results = doctest.testmod(importlib.import_module(".".join(parts).removesuffix(".__init__")), optionflags=FLAGS)
    assert results.failed == 0, f"{results.failed} of {results.attempted} examples failed; see above"
