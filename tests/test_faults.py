"""Every step of every write fails, or is the last of a killed process: old or new stands, and no file of others' goes.

A step is what changes the disk: opening for writing, a write, a sync, a rename, a link, a folder made or removed. A
kill is a step from which on nothing happens any more: no step that follows, no tidying up.
"""

from __future__ import annotations

import asyncio
import io
import json
import os
import shutil
import sys
import types
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from starlette.exceptions import HTTPException

import stickslip as ss
from stickslip import Record, StickslipError, read_record, whole, write_record
from stickslip.lab.data import Uploads
from stickslip.lab.jobs import Jobs
from stickslip.story import folder as folder_module
from stickslip.story.folder import publish

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.symlink")


class Killed(BaseException):
    """The process is no more."""


class Steps:
    """Counts the steps of a run on a disk, and lets one of them be a fault or the last."""

    def __init__(self) -> None:
        self.watched: Path | None = None
        self.count, self.last, self.kill = 0, 0, False
        self.tried: list[str] = []

    def heard(self, event: str, arguments: tuple[Any, ...]) -> None:
        """What Python tells of itself (see PEP 578)."""
        if self.watched is None:
            return
        if event == "open" and arguments[2] & WRITING:
            self.step(f"open {arguments[0]}", arguments[0])
        elif event in CHANGES:
            self.step(f"{event} {arguments[0]}", arguments[0])

    def step(self, name: str, path: Any) -> None:
        """One step more, which fails if it is the one."""
        if self.watched is None or not isinstance(path, str | os.PathLike):
            return
        if not os.fspath(path).startswith(str(self.watched)):
            return
        self.count += 1
        self.tried.append(name)
        if self.kill and self.count >= self.last:
            raise Killed(name)
        if self.count == self.last:
            raise OSError(28, "No space left on device", os.fspath(path))


STEPS = Steps()
sys.addaudithook(STEPS.heard)


@pytest.fixture
def steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Steps:
    fsync, exchange, opened = os.fsync, whole.exchange, io.open

    def synced(handle: int) -> None:
        STEPS.step("fsync", os.readlink(f"/proc/self/fd/{handle}"))
        fsync(handle)

    def exchanged(one: Path, other: Path) -> bool:
        STEPS.step("exchange", one)
        return exchange(one, other)

    def opening(file: Any, *arguments: Any, **named: Any) -> Any:
        held = opened(file, *arguments, **named)
        if held.writable():
            write = held.write

            def writing(some: Any) -> int:
                write(some[: len(some) // 2])  # so a fault leaves a part
                held.flush()
                STEPS.step(f"write {file}", file)
                return len(some[: len(some) // 2]) + int(write(some[len(some) // 2 :]))

            held.write = writing
        return held

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(whole, "exchange", exchanged)
    monkeypatch.setattr(io, "open", opening)
    return STEPS


@contextmanager
def faulty(steps: Steps, folder: Path, last: int, *, kill: bool) -> Iterator[None]:
    """Steps in a folder, the last of which fails, or is the last of all."""
    steps.watched, steps.count, steps.last, steps.kill, steps.tried = folder, 0, last, kill, []
    try:
        yield
    finally:
        steps.watched = None


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def visible(folder: Path) -> dict[str, bytes]:
    return {name: held for name, held in contents(folder).items() if not name.startswith(".")}


def every_step(
    steps: Steps,
    base: Path,
    prepare: Callable[[Path], None],
    write: Callable[[Path], object],
    check: Callable[[Path, bool], None],
    *,
    kill: bool,
) -> None:
    """`write` in a folder made by `prepare`, a fault at every step in turn; `check` is told whether it went through."""
    last, through = 0, False
    while not through:
        last += 1
        folder = base / f"{last}"
        folder.mkdir()
        prepare(folder)
        try:
            with faulty(steps, folder, last, kill=kill):
                write(folder)
            through = steps.count < last
        except (StickslipError, HTTPException, Killed):
            pass
        check(folder, through)
        write(folder)  # by who knows nothing of it
        check(folder, True)
        assert not [name for name in os.listdir(folder) if name.startswith(".") and "stranger" not in name], (
            steps.tried[-1]
        )
        shutil.rmtree(folder)
    assert last > 5, "nothing was tried"


# Files

OLD, NEW = (Record.of({"x": np.arange(5.0) + k}, fs=10.0) for k in (0, 1))


@pytest.mark.parametrize("kill", [False, True])
@pytest.mark.parametrize("form", ["csv", "h5", "parquet"])
def test_a_record_is_the_old_one_or_the_new_one(steps: Steps, tmp_path: Path, form: str, kill: bool) -> None:
    def prepare(folder: Path) -> None:
        write_record(OLD, folder / f"slide.{form}")
        (folder / "notes.txt").write_text("mine")
        (folder / f".slide.{form}-stranger.part").mkdir()
        (folder / f".slide.{form}-stranger.part" / "mine").write_text("mine too")

    def check(folder: Path, through: bool) -> None:
        kept = read_record(folder / f"slide.{form}")
        assert kept.equals(NEW) or (kept.equals(OLD) and not through)
        assert (folder / "notes.txt").read_text() == "mine"
        mine = folder / f".slide.{form}-stranger.part"
        assert (mine / "mine").read_text() == "mine too"

    every_step(
        steps, tmp_path, prepare, lambda to: write_record(NEW, to / f"slide.{form}", overwrite=True), check, kill=kill
    )


def test_a_file_that_comes_while_a_record_is_written_is_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, sync = tmp_path / "slide.csv", whole.sync

    def meanwhile(draft: Path) -> None:
        sync(draft)
        path.write_text("mine")

    for links in (True, False):
        path.unlink(missing_ok=True)
        with monkeypatch.context() as patch:
            patch.setattr(whole, "sync", meanwhile)
            if not links:
                patch.setattr(os, "link", unlinked)
            with pytest.raises(StickslipError, match="is there already"):
                write_record(OLD, path)
        assert contents(tmp_path) == {"slide.csv": b"mine"}


def unlinked(*_: object, **__: object) -> None:
    raise OSError(95, "Operation not supported")


# Folders


class Drawn:
    """A figure that costs nothing."""

    name = "plan"

    def svg(self) -> str:
        return "<svg/>"

    def png(self) -> bytes:
        return b"PNG"


class Answers:
    """What publish needs of findings."""

    def __init__(self, name: str) -> None:
        self.name = name

    def to_dict(self) -> dict[str, str]:
        return {"name": self.name}


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages that cost nothing: what is tried is how they are written."""

    def told(results: Any) -> Any:
        clips = [SimpleNamespace(name="burst", wav=b"RIFF")]
        part = SimpleNamespace(title=results.name, plates=[Drawn()], clips=clips)
        return SimpleNamespace(part=part, data=results.to_dict, write=lambda draft: None)

    monkeypatch.setattr(folder_module, "summary", told)
    monkeypatch.setattr(folder_module, "sections", lambda story, png, figures: [story.part])
    monkeypatch.setattr(folder_module, "render", lambda stories, wording: f"<title>{stories[0].title}</title>")


def results_in(folder: Path) -> str | None:
    """Whose results a folder holds, all of them, or None."""
    if not (folder / "results.json").exists():
        return None
    data = json.loads((folder / "results.json").read_text())
    assert {*data["files"]} <= {*contents(folder)}
    assert (folder / "report.html").read_text() == f"<title>{data['name']}</title>"
    return str(data["name"])


@pytest.mark.parametrize("swaps", [True, False])
@pytest.mark.parametrize("kill", [False, True])
@pytest.mark.usefixtures("quick")
def test_results_are_the_old_ones_or_the_new_ones(
    steps: Steps, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kill: bool, swaps: bool
) -> None:
    if not swaps:  # as on a system that exchanges nothing: a kill between two renames hides the old until the next call
        monkeypatch.setattr(whole, "exchange", lambda one, other: False)

    def prepare(folder: Path) -> None:
        publish(Answers("old"), folder=folder / "results")  # type: ignore[arg-type]
        (folder / "notes.txt").write_text("mine")

    def write(folder: Path) -> None:
        publish(Answers("new"), folder=folder / "results")  # type: ignore[arg-type]

    def check(folder: Path, through: bool) -> None:
        hidden = {results_in(place) for place in folder.glob(".results-*.part/*")}
        name = results_in(folder / "results")
        assert name == "new" if through else name in ("old", "new") or (kill and not swaps and "old" in hidden)
        assert (folder / "notes.txt").read_text() == "mine"

    every_step(steps, tmp_path, prepare, write, check, kill=kill)


@pytest.mark.parametrize("kill", [False, True])
@pytest.mark.usefixtures("quick")
def test_new_results_are_there_whole_or_not_at_all(steps: Steps, tmp_path: Path, kill: bool) -> None:
    def write(folder: Path) -> None:
        publish(Answers("new"), folder=folder / "results")  # type: ignore[arg-type]

    def check(folder: Path, through: bool) -> None:
        assert results_in(folder / "results") in (("new",) if through else ("new", None))
        if not through:
            assert (folder / "results").exists() == (results_in(folder / "results") == "new")

    every_step(steps, tmp_path, lambda folder: None, write, check, kill=kill)


@pytest.mark.parametrize("links", [True, False])
@pytest.mark.parametrize("swaps", [True, False])
@pytest.mark.parametrize("there", [True, False])
@pytest.mark.usefixtures("quick")
def test_a_file_that_comes_while_results_are_made_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool, swaps: bool, links: bool
) -> None:
    place = tmp_path / "results"
    if there:
        publish(Answers("old"), folder=place)  # type: ignore[arg-type]

    def drawing(*_: object) -> None:
        (place / "figures").mkdir(parents=True, exist_ok=True)
        (place / "notes.txt").write_text("mine")
        (place / "figures" / "mine.svg").write_text("mine")
        (place / "link").symlink_to("notes.txt")
        (place / "sounds").mkdir(exist_ok=True)
        (place / "sounds" / "other.wav").write_text("mine")

    monkeypatch.setattr(folder_module, "write_figures", drawing)
    if not swaps:
        monkeypatch.setattr(whole, "exchange", lambda one, other: False)
    if not links:
        monkeypatch.setattr(os, "link", unlinked)
    publish(Answers("new"), folder=place)  # type: ignore[arg-type]
    assert results_in(place) == "new"
    assert os.listdir(tmp_path) == ["results"]
    for name in ("notes.txt", "figures/mine.svg", "link", "sounds/other.wav"):
        assert (place / name).read_text() == "mine"
    assert (place / "link").is_symlink()


@pytest.mark.parametrize("swaps", [True, False])
@pytest.mark.parametrize("kill", [False, True])
@pytest.mark.usefixtures("quick")
def test_a_file_that_came_is_kept_at_every_step(
    steps: Steps, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kill: bool, swaps: bool
) -> None:
    """Also one whose name a new result has, and one that comes at the last moment, when the others were counted."""
    if not swaps:
        monkeypatch.setattr(whole, "exchange", lambda one, other: False)
    carry, figures = whole._carry, folder_module.write_figures

    def prepare(folder: Path) -> None:
        publish(Answers("old"), folder=folder / "results")  # type: ignore[arg-type]

    def write(folder: Path) -> None:
        place = folder / "results"

        def meanwhile(*given: Any) -> None:
            figures(*given)
            with quiet(steps):
                (place / "figures" / "mine.svg").write_text("mine")

        def late(source: Path, target: Path, strangers: whole.Strangers) -> None:
            carry(source, target, strangers)
            if source == place:
                with quiet(steps):
                    (place / "late.txt").write_text("late")

        with monkeypatch.context() as patch:
            patch.setattr(folder_module, "write_figures", meanwhile)
            patch.setattr(whole, "_carry", late)
            publish(Answers("new"), folder=place)  # type: ignore[arg-type]

    def mend(folder: Path) -> None:
        """The next call: what it refuses, it has put right before."""
        with whole.workshop(folder / "results", folder_module._strangers):
            pass

    last, through = 0, False
    while not through:
        last += 1
        folder = tmp_path / str(last)
        folder.mkdir()
        prepare(folder)
        try:
            with faulty(steps, folder, last, kill=kill):
                write(folder)
            through = steps.count < last
        except (StickslipError, Killed):
            pass
        held = contents(folder)
        came = any("mine.svg" in name for name in held)
        late_came = any("late.txt" in name for name in held)
        mend(folder)
        assert results_in(folder / "results") in ("old", "new")
        kept = contents(folder / "results")
        assert kept.get("figures/mine.svg") == (b"mine" if came else None), steps.tried[-1]
        assert kept.get("late.txt") == (b"late" if late_came else None), steps.tried[-1]
        assert not [name for name in kept if "earlier" in name]
        assert os.listdir(folder) == ["results"]
    assert last > 20


@contextmanager
def quiet(steps: Steps) -> Iterator[None]:
    """What somebody else does is no step."""
    watched, steps.watched = steps.watched, None
    try:
        yield
    finally:
        steps.watched = watched


@pytest.mark.usefixtures("quick")
def test_no_file_of_others_is_replaced_by_a_result_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place, render = tmp_path / "results", folder_module.render

    def meanwhile(*given: Any) -> str:
        place.mkdir()
        (place / "report.html").write_text("mine")
        return str(render(*given))

    monkeypatch.setattr(folder_module, "render", meanwhile)
    publish(Answers("new"), folder=place)  # type: ignore[arg-type]
    assert results_in(place) == "new"
    assert (place / "earlier-report.html").read_text() == "mine"


def test_the_draft_of_a_living_process_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "slide.csv"
    with whole.whole_file(path) as draft:
        draft.write_text("first")
        write_record(OLD, path)
        assert draft.read_text() == "first"
    assert path.read_text() == "first"


# Locks


def test_a_lock_keeps_others_out_until_it_is_closed(tmp_path: Path) -> None:
    held = whole.locked(tmp_path)
    assert held is not None
    assert whole.locked(tmp_path) is None
    held.close()
    again = whole.locked(tmp_path)
    assert again is not None
    again.close()


def test_where_folders_have_no_locks_a_file_beside_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows; its module is made of what is here."""
    import fcntl

    def locking(handle: int, how: int, size: int) -> None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)

    windows = types.ModuleType("msvcrt")
    vars(windows).update(locking=locking, LK_NBLCK=1)
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", windows)
    folder = tmp_path / "map.zarr"
    folder.mkdir()
    held = whole.locked(folder)
    assert held is not None
    assert whole.locked(folder) is None
    assert sorted(os.listdir(tmp_path)) == ["map.zarr", "map.zarr.lock"]
    held.close()
    assert os.listdir(tmp_path) == ["map.zarr"]


def test_without_any_of_it_files_are_whole_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No locks, no folders that can be opened, no exchange, no links."""
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.delattr(os, "O_DIRECTORY")
    monkeypatch.setattr(os, "link", unlinked)
    write_record(OLD, tmp_path / "slide.csv")
    with pytest.raises(StickslipError, match="is there already"):
        write_record(NEW, tmp_path / "slide.csv")
    assert read_record(write_record(NEW, tmp_path / "slide.csv", overwrite=True)).equals(NEW)
    assert sorted(os.listdir(tmp_path)) == ["slide.csv", "slide.csv.json"]


# The lab


def require_room(refused: HTTPException, folder: Path) -> None:
    """The sentence asks for room, and nothing was left."""
    assert refused.status_code == 507
    assert not os.listdir(folder)


@pytest.mark.parametrize("kill", [False, True])
def test_an_upload_is_kept_whole_or_not_at_all(steps: Steps, tmp_path: Path, kill: bool) -> None:
    async def chunks() -> AsyncIterator[bytes]:
        yield b"a,b\n"
        yield b"1,2\n"

    last, through = 0, False
    while not through:
        last += 1
        folder = tmp_path / str(last)
        folder.mkdir()
        uploads = Uploads(folder, altogether=8)
        try:
            with faulty(steps, folder, last, kill=kill):
                upload = asyncio.run(uploads.receive(chunks(), label="a.csv"))
            through = steps.count < last
            assert upload.path.read_bytes() == b"a,b\n1,2\n"
        except HTTPException as refused:
            require_room(refused, folder)
        except Killed:
            continue
        if not through:
            asyncio.run(uploads.receive(chunks(), label="a.csv"))  # there is room for it: nothing is counted twice
    assert last > 2


def test_an_analysis_that_can_not_be_written_down_is_refused_and_leaves_nothing(steps: Steps, tmp_path: Path) -> None:
    last, through = 0, False
    while not through:
        last += 1
        folder = tmp_path / str(last)
        folder.mkdir()
        jobs = Jobs(folder)

        async def start(jobs: Jobs = jobs, last: int = last, folder: Path = folder) -> None:
            with faulty(steps, folder, last, kill=False):
                job = jobs.start({"question": "describe"}, names={})
            await jobs.cancel(job)

        try:
            asyncio.run(start())
            through = steps.count < last
        except HTTPException as refused:
            require_room(refused, folder)
    assert last > 2


# The store of a map


@pytest.mark.parametrize("stride", [4, pytest.param(1, marks=pytest.mark.soak)])
@pytest.mark.parametrize("kill", [False, True])
def test_a_map_goes_on_after_a_fault_at_any_step(steps: Steps, tmp_path: Path, kill: bool, stride: int) -> None:
    pytest.importorskip("zarr")
    pytest.importorskip("pyarrow")
    slider = ss.scenarios.forced(0.8, 0.5)

    def run(folder: Path) -> None:
        settings: dict[str, Any] = {"measures": ["events"], "settle": 1, "cycles": 1, "engine": "serial"}
        ss.sweep(slider, {"kinetic": [0.3]}, store=folder / "map.zarr", **settings)

    calm = tmp_path / "calm"
    calm.mkdir()
    run(calm)
    whole_ = contents(calm)
    last, through = 0, False
    while not through:
        last += stride
        folder = tmp_path / str(last)
        folder.mkdir()
        (folder / "notes.txt").write_text("mine")
        try:
            with faulty(steps, folder, last, kill=kill):
                run(folder)
            through = steps.count < last
        except (StickslipError, Killed):
            pass
        run(folder)
        assert contents(folder) == {**whole_, "notes.txt": b"mine"}, steps.tried[-1]
    assert last > 50
