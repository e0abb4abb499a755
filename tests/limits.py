"""A call in a process of its own, with a limit of processor time and of memory: what hostile input is tried in.

The processes are forked from one that has imported the package already, so that a case costs what it does and not what
it takes to start Python.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import resource
import sys
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import forkserver
from pathlib import Path
from typing import Any

import pytest

SECONDS = 20  # of processor time
PATIENCE = 600.0  # s by the clock, for one that waits for ever: another program's load must not be taken for it
BYTES = 1_000_000_000
ADDRESSES = 4 * BYTES  # what may be reserved: thread stacks and arenas are, and are never touched

_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload(["warm", "limits"])


@dataclass(frozen=True)
class Outcome:
    """How a call ended: its exit code, what it printed, its largest memory in bytes.

    The code is below zero where it took too much processor time, and None where it waited for ever.
    """

    code: int | None
    out: str
    err: str
    peak: int

    def is_civil(self) -> bool:
        """Whether it ended by itself, within its memory, without a traceback and without a terminal's escape codes."""
        told = self.out + self.err
        return self.code in (0, 1, 2) and self.peak <= BYTES and "Traceback" not in told and "\x1b" not in told


def program(*words: object, folder: Path) -> Outcome:
    """``stickslip`` with these words, in this folder."""
    return limited(_program, [str(word) for word in words], folder=folder)


def limited(call: Callable[..., object], *arguments: Any, folder: Path) -> Outcome:
    """A function that can be pickled, called in this folder; an exception that it lets out is a traceback in `err`."""
    with contextlib.chdir(Path(__file__).parent):  # where the server looks for what it preloads, silent if in vain
        forkserver.ensure_running()
    with tempfile.TemporaryDirectory() as place:
        process = _FORKS.Process(target=_within_limits, args=(call, arguments, str(folder), place))
        process.start()
        process.join(PATIENCE)
        stopped = process.is_alive()
        if stopped:
            process.kill()
            process.join()
        out, err, peak = ((Path(place) / name) for name in ("out", "err", "peak"))
        return Outcome(
            code=None if stopped else process.exitcode,
            out=out.read_text("utf-8", "replace") if out.exists() else "",
            err=err.read_text("utf-8", "replace") if err.exists() else "",
            peak=int(peak.read_text()) if peak.exists() else 0,
        )


def civil(outcome: Outcome) -> Outcome:
    """The outcome, asserted to be an answer or one sentence."""
    if not outcome.is_civil():
        pytest.fail(f"exit {outcome.code}, {outcome.peak / 1e6:.0f} MB\n{outcome.out[-2000:]}\n{outcome.err[-4000:]}")
    return outcome


def _program(words: list[str]) -> None:
    from stickslip.cli.program import main

    main(words, prog_name="stickslip")


def _within_limits(call: Callable[..., object], arguments: tuple[Any, ...], folder: str, place: str) -> None:
    assert "warm" in sys.modules, "imported in each case anew"
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.chdir(folder)
    code = 0
    with open(f"{place}/out", "wb", 0) as out, open(f"{place}/err", "wb", 0) as err, open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
        os.dup2(out.fileno(), 1)
        os.dup2(err.fileno(), 2)
        sys.stdout, sys.stderr = (os.fdopen(number, "w", encoding="utf-8", closefd=False) for number in (1, 2))
        try:
            call(*arguments)
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        except BaseException:  # noqa: BLE001  (whatever gets out is what the test looks for)
            traceback.print_exc()
            code = 70
        with contextlib.suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
    Path(place, "peak").write_text(str(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024))
    os._exit(code)
