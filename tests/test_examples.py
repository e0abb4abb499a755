"""Every example of the package says what it prints."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

import stickslip

pytestmark = pytest.mark.figures  # what is documented, as it is
PACKAGE = Path(stickslip.__file__).parent
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
WITH_EXAMPLES = sorted(file for file in PACKAGE.rglob("*.py") if ">>>" in file.read_text("utf-8"))


@pytest.mark.parametrize(
    "file",
    [pytest.param(file, marks=[pytest.mark.loudness] * (file.stem == "sound")) for file in WITH_EXAMPLES],
    ids=[str(file.relative_to(PACKAGE)) for file in WITH_EXAMPLES],
)
def test_the_examples_run(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    results = doctest.testmod(importlib.import_module(".".join(parts).removesuffix(".__init__")), optionflags=FLAGS)
    assert results.failed == 0, f"{results.failed} of {results.attempted} examples failed; see above"
