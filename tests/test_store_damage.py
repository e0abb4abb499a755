"""Whatever one file of a map on disk has become, the sweep that goes on there ends with the same bytes, or says so."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from stickslip import Coulomb, HarmonicForce, Oscillator, StickslipError, sweep

pytest.importorskip("zarr")
pytest.importorskip("pyarrow")
SLIDER = Oscillator(mass=1, stiffness=1, law=Coulomb(0.5), drive=HarmonicForce(1.0, frequency=0.127))
GRID = {"kinetic": [0.3, 0.6], "frequency": [0.1, 0.127]}
SETTINGS: dict[str, Any] = {"measures": ["events", "amplitude"], "settle": 3, "cycles": 2, "engine": "serial"}
MAP, EVENTS = "map.zarr", "map.zarr.events"


def run(folder: Path) -> Any:
    return sweep(SLIDER, GRID, store=folder / MAP, **SETTINGS)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    run(folder)
    assert {name.partition("/")[0] for name in contents(folder)} == {MAP, EVENTS}
    return folder


def delete(path: Path) -> None:
    path.unlink()


def empty(path: Path) -> None:
    path.write_bytes(b"")


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-7])


def flip(path: Path, at: float = 0.5) -> None:
    held = bytearray(path.read_bytes())
    held[int(at * len(held))] ^= 4
    path.write_bytes(held)


def flip_first(path: Path) -> None:
    flip(path, 0.0)


def make_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def make_folder_of_notes(path: Path) -> None:
    make_folder(path)
    (path / "notes.txt").write_text("mine")


@pytest.mark.parametrize("harm", [delete, empty, truncate, flip, flip_first, make_folder])
def test_every_file_in_turn_is_mended(whole: Path, tmp_path: Path, harm: Callable[[Path], None]) -> None:
    before = contents(whole)
    shutil.copytree(whole, tmp_path / "harmed")
    for name in before:
        harm(tmp_path / "harmed" / name)
        assert run(tmp_path / "harmed").attrs["status"] == "complete"
        assert contents(tmp_path / "harmed") == before, name


def test_a_folder_of_notes_in_a_files_place_is_left_alone(whole: Path, tmp_path: Path) -> None:
    shutil.copytree(whole, tmp_path / "harmed")
    name = next(name for name in contents(whole) if name.startswith(f"{MAP}/amplitude/c/"))
    make_folder_of_notes(tmp_path / "harmed" / name)
    with pytest.raises(StickslipError, match=name.rpartition("/")[2]) as told:
        run(tmp_path / "harmed")
    assert str(told.value).count(".\n") == 0
    assert (tmp_path / "harmed" / name / "notes.txt").read_text() == "mine"
