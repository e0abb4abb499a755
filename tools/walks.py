"""The ways through the rooms of the house, as they are run: ``python tools/walks.py`` names the rooms in order.

A walk is the order in which functions are entered for the first time; a stay is a stretch of it in one room. What
everybody holds in hand (a Record, an Estimate: the rooms on the floor of `record` and below) is no stay. A call goes
upwards where the room called stands above the room that calls.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import stickslip as ss

sys.path.insert(0, str(Path(__file__).parent))

from measure import floors

PACKAGE = Path(str(ss.__file__)).parent
HEIGHT = {room: -number for number, floor in enumerate(floors()) for room in floor}


def walk(run: Callable[[], Any]) -> tuple[list[str], list[str]]:
    """The rooms in which `run` stays, and its calls upwards."""
    rooms: list[str] = []
    upwards: list[str] = []
    entered: set[CodeType] = set()

    def called(frame: FrameType, event: str, _: Any) -> None:
        room = room_of(frame.f_code) if event == "call" and frame.f_code not in entered else ""
        if not room:
            return
        entered.add(frame.f_code)
        caller = next((place for code in callers(frame) if (place := room_of(code))), room)
        if HEIGHT[caller] < HEIGHT[room]:
            upwards.append(f"{caller} -> {room}: {frame.f_code.co_qualname}")
        if HEIGHT[room] > HEIGHT["record"]:
            rooms.append(room)

    run()  # once unseen, for what is imported, compiled and remembered at first
    sys.setprofile(called)
    try:
        run()
    finally:
        sys.setprofile(None)
    return [room for room, _ in itertools.groupby(rooms)], upwards


def room_of(code: CodeType) -> str:
    """The folder of the package, or the file beside them, in which a function stands; empty outside."""
    path = Path(code.co_filename)
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py") if path.is_relative_to(PACKAGE) else ""


def callers(frame: FrameType) -> Iterator[CodeType]:
    while frame.f_back is not None:
        frame = frame.f_back
        yield frame.f_code


def walks(folder: Path) -> dict[str, tuple[list[str], list[str]]]:
    """The two ways that every record goes, of the bundled one; what they write goes into a folder."""
    record, file = ss.datasets.demo(), folder / "demo.csv"
    rig = {name: record.truth[name] for name in ("mass", "stiffness", "damping")}
    ss.write_record(record, file)
    findings = ss.analyze(record, **rig)
    return {
        "file to friction loops": walk(lambda: ss.friction_loops(ss.friction_force(ss.read_record(file), **rig))),
        "findings to page": walk(lambda: ss.report(findings, folder / "report.html")),
    }


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        for title, (stays, up) in walks(Path(scratch)).items():
            print(f"{title}, {len(stays)} stays, {len(up)} upwards:", " > ".join(stays), *up, sep="\n  ")
