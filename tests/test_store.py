"""A map on disk: kills, damage, other settings, two writers and full disks lose nothing and are told."""

from __future__ import annotations

import errno
import os
import shutil
import signal
import socket
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from stickslip import Oscillator, simulate, sweep
from stickslip.drives import HarmonicForce
from stickslip.errors import ModelError, SolveError
from stickslip.laws import Coulomb
from stickslip.maps.crowd import run_block
from stickslip.maps.store import Store
from stickslip.maps.sweep import planned
from stickslip.solve import Trajectory

pytest.importorskip("zarr")
SLIDER = Oscillator(mass=1, stiffness=1, law=Coulomb(0.5), drive=HarmonicForce(1.0, frequency=0.127))
GRID = {"kinetic": np.linspace(0.1, 1.2, 9), "frequency": np.linspace(0.1, 0.2, 8)}
SETTINGS: dict[str, Any] = {"measures": ["stops", "amplitude"], "settle": 20, "cycles": 5, "engine": "serial"}


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "map.zarr"
    sweep(SLIDER, GRID, store=path, **SETTINGS)
    return path


def test_a_map_on_disk_is_the_one_in_memory(whole: Path) -> None:
    import xarray

    kept = xarray.open_zarr(whole, consolidated=False)
    asked = sweep(SLIDER, GRID, **SETTINGS)
    assert bool(kept.done.all())
    assert set(asked.data_vars) == set(kept.data_vars) - {"done"}
    for name in asked.data_vars:
        np.testing.assert_array_equal(kept[name].values, asked[name].values)
        assert kept[name].attrs["units"] == asked[name].attrs["units"]
    assert kept.attrs["checksum"] == asked.attrs["checksum"]


@pytest.mark.parametrize("kills", [1, pytest.param(3, marks=pytest.mark.soak)])
def test_killed_at_random_it_goes_on_and_ends_with_the_same_bytes(whole: Path, tmp_path: Path, kills: int) -> None:
    path = tmp_path / "map.zarr"
    script = tmp_path / "run.py"
    script.write_text(
        textwrap.dedent(f"""
        import sys, time
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from test_store import GRID, SETTINGS, SLIDER
        from stickslip import sweep
        from stickslip.maps.store import Store
        keep = Store.keep
        def slowly(store, *block):
            keep(store, *block)
            print("kept", flush=True)
            time.sleep(0.005)
        Store.keep = slowly
        sweep(SLIDER, GRID, store={str(path)!r}, **SETTINGS)
    """)
    )
    chance = np.random.default_rng(7)
    for _ in range(kills):
        run = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
        assert run.stdout is not None
        assert run.stdout.readline() == "kept\n"
        time.sleep(chance.uniform(0, 0.1))
        run.send_signal(signal.SIGKILL)
        run.wait()
        run.stdout.close()
    subprocess.run([sys.executable, str(script)], check=True, capture_output=True)
    assert files(path) == files(whole)


def test_what_is_done_is_not_run_again(whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from stickslip.maps import engines

    def refuse(plan: Any, number: int) -> Any:
        raise AssertionError(f"block {number} is there already")

    monkeypatch.setattr(engines, "run_block", refuse)
    before = files(whole)
    sweep(SLIDER, GRID, store=whole, **SETTINGS)
    assert files(whole) == before


def test_a_damaged_block_is_run_again(whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "map.zarr"
    shutil.copytree(whole, path)
    chunk = max((path / "amplitude" / "c").rglob("*"), key=lambda at: at.is_file())
    bytes_ = bytearray(chunk.read_bytes())
    bytes_[-6] ^= 1
    chunk.write_bytes(bytes_)
    sweep(SLIDER, GRID, store=path, **SETTINGS)
    assert files(path) == files(whole)


def test_a_map_that_is_there_needs_no_room(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=200))
    assert sweep(SLIDER, GRID, store=whole, **SETTINGS).attrs["status"] == "complete"
    with pytest.raises(ModelError, match="the disk has 2e-07 GB"):
        sweep(SLIDER, GRID, store=tmp_path / "map.zarr", **SETTINGS)


def test_other_settings_are_refused_by_name(whole: Path) -> None:
    before = files(whole)
    with pytest.raises(ModelError, match=r"cycles = 5 \(asked: 6\)"):
        sweep(SLIDER, GRID, store=whole, **{**SETTINGS, "cycles": 6})
    assert files(whole) == before


def longer_than(limit: float) -> Callable[[Trajectory], float]:
    def share(run: Trajectory) -> float:
        return float(sum(event.time > limit for event in run.events))

    return share


HELD = {"stick", "microstick"}


def held(run: Trajectory, part: float = 1.0) -> float:
    return part * sum(event.kind in HELD or event.kind in {"stick", "microstick", "still"} for event in run.events)


def checksum(measure: Callable[..., float]) -> str:
    return planned(SLIDER, GRID, measures=[measure], cycles=1, settle=0, start=None).checksum


def test_the_checksum_knows_all_that_decides_a_measure(monkeypatch: pytest.MonkeyPatch) -> None:
    assert checksum(longer_than(1.0)) == checksum(longer_than(1.0)) != checksum(longer_than(5.0))
    assert checksum(named(partial(held, part=2.0))) != checksum(named(partial(held, part=3.0)))
    before = checksum(held)
    with monkeypatch.context() as patch:
        patch.setattr(held, "__defaults__", (2.0,))
        assert checksum(held) != before
    with monkeypatch.context() as patch:
        patch.setitem(globals(), "HELD", {"stick"})
        assert checksum(held) != before
    assert checksum(held) == before


def named(measure: Any) -> Callable[..., float]:
    measure.__name__ = "held"
    return measure  # type: ignore[no-any-return]


def test_the_checksum_is_the_same_in_every_process() -> None:
    code = "from test_store import *; print(checksum(held), checksum(named(partial(held, part=2.0))))"
    told = {
        subprocess.run(
            [sys.executable, "-c", code],
            check=True,
            capture_output=True,
            text=True,
            cwd=Path(__file__).parent,
            env={**os.environ, "PYTHONHASHSEED": seed},
        ).stdout
        for seed in ("1", "2")
    }
    assert told == {f"{checksum(held)} {checksum(named(partial(held, part=2.0)))}\n"}


def test_another_system_is_refused(whole: Path) -> None:
    with pytest.raises(ModelError, match="mass=2"):
        sweep(SLIDER.having(mass=2), GRID, store=whole, **SETTINGS)


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ModelError, match="is not a map of ours"):
        sweep(SLIDER, GRID, store=tmp_path, **SETTINGS)
    with pytest.raises(ModelError, match="is not a map of ours"):
        sweep(SLIDER, GRID, store=tmp_path / "notes.txt", **SETTINGS)
    assert files(tmp_path) == {"notes.txt": b"mine"}


def test_two_writers_are_refused(whole: Path) -> None:
    fcntl = pytest.importorskip("fcntl")
    handle = os.open(whole, os.O_RDONLY)
    fcntl.flock(handle, fcntl.LOCK_EX)
    try:
        with pytest.raises(
            SolveError, match=r"another process is writing .*map\.zarr; a map has one writer; wait for it"
        ):
            sweep(SLIDER, GRID, store=whole, **SETTINGS)
    finally:
        os.close(handle)


def test_a_map_that_another_laid_in_its_place_is_left_alone(whole: Path, tmp_path: Path) -> None:
    """A store that somebody removed under its writer, and began anew, has the new writer alone."""
    path = tmp_path / "map.zarr"
    plan = planned(SLIDER, GRID, measures=["stops", "amplitude"], settle=20, cycles=5, start=None)
    other = planned(SLIDER.having(mass=2.0), GRID, measures=["stops", "amplitude"], settle=20, cycles=5, start=None)
    first = Store(path, plan)
    path.rename(tmp_path / "removed")
    with Store(path, other) as second:
        second.keep(0, run_block(other, 0)[0])
        before = files(path)
        with pytest.raises(SolveError, match=r"map\.zarr .*; another process is writing there.*name another path"):
            first.keep(0, run_block(plan, 0)[0])
        assert files(path) == before
    first.__exit__(None, None, None)


@pytest.mark.skipif(sys.platform == "win32", reason="its locks are not flock's")
def test_a_disk_without_locks_has_one_writer_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lock is a file then, which names its process; that of a process which is gone counts for nothing."""
    import fcntl

    def refused(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refused)
    path = tmp_path / "map.zarr"
    plan = planned(SLIDER, GRID, measures=["stops"], settle=2, cycles=2, start=None)
    with Store(path, plan) as kept:
        with pytest.raises(SolveError, match="another process is writing"):
            Store(path, plan)
        kept.keep(0, run_block(plan, 0)[0])
    gone = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True
    ).stdout
    (tmp_path / "map.zarr.lock").write_text(f"{gone.strip()} {socket.gethostname()}")
    with Store(path, plan) as kept:
        assert len(kept.missing) == len(plan.blocks) - 1
    assert not (tmp_path / "map.zarr.lock").exists()


def test_a_full_disk_is_one_sentence_and_the_map_goes_on(whole: Path, tmp_path: Path) -> None:
    import zarr.storage._local as local

    path, put, left = tmp_path / "map.zarr", local._put, [60]

    def filling(*given: Any, **named: Any) -> Any:
        left[0] -= 1
        if left[0] < 0:
            raise OSError(28, "No space left on device")
        return put(*given, **named)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(local, "_put", filling)
        with pytest.raises(SolveError, match=r"No space left on device.*call again"):
            sweep(SLIDER, GRID, store=path, **SETTINGS)
    sweep(SLIDER, GRID, store=path, **SETTINGS)
    assert files(path) == files(whole)


def test_every_event_is_kept_beside_the_map(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path, grid = tmp_path / "map.zarr", {"kinetic": [0.3, 0.6], "frequency": [0.1, 0.127]}
    swept = sweep(SLIDER, grid, measures=["events", "stops"], settle=3, cycles=2, store=path)
    folder = tmp_path / "map.zarr.events"
    kept = parquet.read_table(folder).to_pandas()
    for j, kinetic in enumerate(grid["kinetic"]):
        for k, frequency in enumerate(grid["frequency"]):
            run = simulate(SLIDER.having(kinetic=kinetic, frequency=frequency), cycles=5)
            own = kept[(kept.kinetic == j) & (kept.frequency == k)]
            late = [event for event in run.events if event.time >= 3 / frequency]
            assert [tuple(row) for row in own[list(late[0]._fields)].itertuples(index=False)] == late
            assert int(swept.events[j, k]) == len(late) > 0
    before, part = files(folder), folder / "00000000.parquet"
    part.unlink()
    sweep(SLIDER, grid, measures=["events", "stops"], settle=3, cycles=2, store=path)
    assert files(folder) == before
    part.write_bytes(part.read_bytes()[:-1] + b"?")
    sweep(SLIDER, grid, measures=["events", "stops"], settle=3, cycles=2, store=path)
    assert files(folder) == before
    other = sweep(SLIDER, {"kinetic": [0.3]}, measures=["events"], settle=3, cycles=2, store=path.with_suffix(".b"))
    assert files(folder) == before
    assert len(parquet.read_table(tmp_path / "map.b.events")) == int(other.events.sum())
    shutil.rmtree(path)
    with pytest.raises(ModelError, match=r"map\.zarr\.events is there, but its map .* is not"):
        sweep(SLIDER, {"kinetic": [0.3]}, measures=["events"], settle=3, cycles=2, store=path)
    assert files(folder) == before
    assert not path.exists()


def test_a_sweep_that_can_not_begin_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    numba_cuda = pytest.importorskip("numba.cuda")
    monkeypatch.setattr(numba_cuda, "is_available", lambda: False)
    with pytest.raises(ModelError, match="finds no NVIDIA GPU"):
        sweep(SLIDER, GRID, store=tmp_path / "map.zarr", **{**SETTINGS, "engine": "cuda"})
    assert not list(tmp_path.iterdir())


def test_the_cluster_gives_the_same_bytes(whole: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    path = tmp_path / "map.zarr"
    sweep(SLIDER, GRID, store=path, **{**SETTINGS, "engine": "dask"})
    assert files(path) == files(whole)


def test_workers_that_die_are_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    from stickslip.maps import engines

    def deadly(run: Trajectory) -> float:
        os._exit(1)

    monkeypatch.setattr(engines, "DEATHS", 0)
    with pytest.raises(SolveError, match="workers of the cluster died of one block"):
        sweep(SLIDER, {"kinetic": [0.5]}, measures=[deadly], settle=0, cycles=1, engine="dask")


def test_a_scheduler_that_is_not_there_is_one_sentence_at_once() -> None:
    pytest.importorskip("distributed")
    with pytest.raises(ModelError, match=r"no Dask scheduler answers at 127\.0\.0\.1:9; its port is closed"):
        sweep(SLIDER, GRID, **{**SETTINGS, "engine": "dask://127.0.0.1:9"})
