"""The way of a record through the rooms of the house, as it is run: ``python tools/walks.py [--show]``.

A walk is the order in which functions are entered for the first time; a stay is a stretch of it in one room. A call goes
upwards where the room that is called stands on a higher floor than the one that calls.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import stickslip as ss

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = Path(str(ss.__file__)).parent


def floors() -> list[list[str]]:
    """The rooms of each floor, from the top down, as the import-linter's contract has them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    return [[room.strip() for room in layer.split("|")] for layer in layers]


class Walk:
    """The rooms entered, in order, and the calls that go upwards."""

    def __init__(self) -> None:
        self.rooms: list[str] = []
        self.upwards: dict[str, None] = {}
        self._entered: set[CodeType] = set()
        self._height = {room: -number for number, floor in enumerate(floors()) for room in floor}

    @property
    def stays(self) -> list[str]:
        return [room for room, _ in itertools.groupby(self.rooms)]

    @contextmanager
    def followed(self) -> Iterator[None]:
        """Follow what is called meanwhile."""
        sys.setprofile(self._called)
        try:
            yield
        finally:
            sys.setprofile(None)

    def _called(self, frame: FrameType, event: str, _: Any) -> None:
        room = room_of(frame.f_code) if event == "call" else ""
        if not room or frame.f_code in self._entered:
            return
        self._entered.add(frame.f_code)
        self.rooms.append(room)
        caller = next(filter(None, map(room_of, callers(frame))), room)
        if self._height.get(caller, 0) < self._height.get(room, 0):
            self.upwards[f"{caller} -> {room} ({frame.f_code.co_qualname})"] = None


def room_of(code: CodeType) -> str:
    """The folder of the package, or the file beside them, that a function stands in; empty outside."""
    path = Path(code.co_filename)
    if not path.is_relative_to(PACKAGE) or code.co_name == "<module>":
        return ""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def callers(frame: FrameType) -> Iterator[CodeType]:
    while frame.f_back is not None:
        frame = frame.f_back
        yield frame.f_code


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--show", action="store_true", help="name the rooms, too")
    show = parser.parse_args().show
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "demo.csv"
        record = ss.datasets.demo()
        rig = {name: record.truth[name] for name in ("mass", "stiffness", "damping")}
        ss.write_record(record, file)
        findings = ss.analyze(record, **rig)
        walks: dict[str, Callable[[], Any]] = {
            "file to friction loops": lambda: ss.friction_loops(ss.friction_force(ss.read_record(file), **rig)),
            "findings to page": lambda: ss.report(findings, Path(folder) / "report.html"),
        }
        for name, run in walks.items():
            run()  # once unseen, for what is imported and compiled at first
            walk = Walk()
            with walk.followed():
                run()
            print(f"{name}: {len(walk.stays)} stays in {len(set(walk.stays))} rooms, {len(walk.upwards)} calls upwards")
            print(*walk.upwards, " > ".join(walk.stays), sep="\n") if show else None


if __name__ == "__main__":
    main()
