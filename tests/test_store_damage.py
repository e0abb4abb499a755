"""Whatever one file of a map on disk has become, the sweep that goes on there ends with the same bytes, or says so."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from stickslip import Oscillator, StickslipError, sweep
from stickslip.drives import HarmonicForce
from stickslip.errors import ModelError
from stickslip.laws import Coulomb

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


def test_a_system_without_locks_and_open_folders_keeps_the_same_map(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.delattr(os, "O_DIRECTORY")
    run(tmp_path)
    assert contents(tmp_path) == contents(whole)
    assert sorted(os.listdir(tmp_path)) == [MAP, EVENTS]


def test_a_map_laid_out_by_another_process_at_the_same_time_is_taken_up(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the look whether it is there and the rename: the other's stays."""
    rename = os.rename

    def late(draft: Path, path: Path) -> None:
        if path == tmp_path / MAP:
            monkeypatch.setattr(os, "rename", rename)
            shutil.copytree(whole / MAP, tmp_path / MAP)
        rename(draft, path)

    monkeypatch.setattr(os, "rename", late)
    run(tmp_path)
    assert contents(tmp_path) == contents(whole)


def test_nobody_elses_file_in_a_map_is_touched(whole: Path, tmp_path: Path) -> None:
    shutil.copytree(whole, tmp_path / "harmed")
    mine = tmp_path / "harmed" / MAP / "thesis.partial.txt"
    other = tmp_path / "harmed" / MAP / "half.of.partial"
    mine.write_text("mine")
    other.write_text("mine")
    for name in (f"{MAP}/zarr.json", f"{MAP}/amplitude/zarr.json"):
        delete(tmp_path / "harmed" / name)
    run(tmp_path / "harmed")
    assert mine.read_text() == other.read_text() == "mine"


def test_the_map_of_another_plan_is_refused_also_where_its_metadata_are_gone(whole: Path, tmp_path: Path) -> None:
    shutil.copytree(whole, tmp_path / "harmed")
    delete(tmp_path / "harmed" / MAP / "zarr.json")
    before = contents(tmp_path / "harmed")
    with pytest.raises(ModelError, match=r"is not a map of ours, or its zarr\.json is damaged"):
        sweep(SLIDER, GRID, store=tmp_path / "harmed" / MAP, **{**SETTINGS, "cycles": 3})
    assert contents(tmp_path / "harmed") == before
