"""A long run tells how far it is, and Ctrl-C leaves what was done."""

from __future__ import annotations

import itertools
import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import SolveError
from stickslip.solve import kernel, march
from stickslip.solve.refusal import held_back

RIGID = ss.Oscillator(
    mass=2.42, stiffness=2310, law=ss.laws.Coulomb(1.1), drive=ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
)
DITHER = ss.drives.MultiTone([(0.65e-3, 2.5, 0.0), (1e-5, 31.0, 0.0)])
LONG = {
    "many events": RIGID.having(drive=DITHER),
    "one piece": ss.Oscillator(mass=1, stiffness=1e6, law=ss.laws.Coulomb(1.0), drive=ss.drives.Belt(10.0)),
    "recorded base": RIGID.having(drive=ss.drives.Recorded(1e-3 * np.cos(np.arange(2_000_000) / 50), fs=1000.0)),
    "curved law": RIGID.having(law=ss.laws.LuGre(1.1, 1.3, speed=1e-3, stiffness=2e5, damping=20.0)),
}
SCRIPT = """
import json, signal, sys
sys.path.insert(0, sys.argv[1])
import stickslip as ss
from test_interrupt import LONG

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs are born deaf to it

def tell(share):
    print(share, flush=True)

run = ss.simulate(LONG[sys.argv[2]], duration=float(sys.argv[3]), progress=tell)
print(json.dumps([run.status, run.duration, len(run.modes), run.state(run.duration - 1e-6)]), flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to one process alone")
@pytest.mark.parametrize(
    ("name", "duration"), [("many events", 1e6), ("one piece", 1e6), ("recorded base", 1999.0), ("curved law", 1e6)]
)
def test_a_real_signal_leaves_what_was_done(name: str, duration: float) -> None:
    command = [sys.executable, "-c", SCRIPT, __file__.rsplit("/", 1)[0], name, str(duration)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert 0 < float(process.stdout.readline()) < 0.9
        process.send_signal(signal.SIGINT)
        *_, last = process.communicate()[0].splitlines()
    status, done, pieces, state = json.loads(last)
    assert status == "interrupted"
    assert 0 < done < duration
    assert pieces >= 1
    # what is there is what the same run, not interrupted, has; it ends with an event, which has two sides
    whole = ss.simulate(LONG[name], duration=done)
    assert whole.state(done - 1e-6) == pytest.approx(state, rel=1e-8, abs=1e-12)


@pytest.mark.parametrize(("times", "ended"), [(1, True), (2, False)])
def test_a_first_ctrl_c_within_a_chunk_waits_for_its_end(times: int, ended: bool) -> None:
    """numba answered one that came while it handed functions over with a TypeError."""
    done = []

    def chunk() -> None:
        with held_back():
            for _ in range(times):
                signal.raise_signal(signal.SIGINT)
            done.append("all of it")

    with pytest.raises(KeyboardInterrupt):
        chunk()
    assert bool(done) is ended
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_progress_rises_to_one() -> None:
    for system in (RIGID, LONG["curved law"]):
        shares: list[float] = []
        run = ss.simulate(system, cycles=3, progress=shares.append)
        assert run.status == "complete"
        assert shares == sorted(shares)
        assert shares[-1] == 1.0


@pytest.mark.parametrize("name", ["many events", "one piece", "curved law"])
def test_a_long_run_is_heard_of(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every chunk comes back to Python, and an interrupted run ends where its last piece does."""
    shares: list[float] = []

    def stop(share: float) -> None:
        shares.append(share)
        if len(shares) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr("stickslip.solve.simulate.PACE", 0.0)
    run = ss.simulate(LONG[name], duration=1e5, progress=stop)
    assert run.status == "interrupted"
    assert run.starts[-1] + run.durations[-1] == pytest.approx(run.duration, rel=1e-15)
    assert run.duration == pytest.approx(1e5 * shares[-1], rel=1e-9)
    assert not any(event.time > run.duration for event in run.events)


@pytest.fixture
def heard() -> Iterator[None]:
    """A shell's background job is deaf to Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def struck(heard: None, monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Ctrl-C while the chunk of this number is marched, counted from 0."""

    def strike(number: int) -> None:
        calls = itertools.count()
        for module in (kernel, march):
            monkeypatch.setattr(module, "march", partial(marched, module.march, calls, number))

    def marched(follow: Callable[..., Any], calls: Iterator[int], number: int, *arguments: Any) -> Any:
        if next(calls) == number:
            signal.raise_signal(signal.SIGINT)
        return follow(*arguments)

    return strike


@pytest.mark.parametrize("name", ["many events", "curved law"])
@pytest.mark.parametrize("ask", [ss.steady_state, partial(ss.simulate, duration=2e3)])
def test_a_greater_question_ends_with_its_run(ask: Any, name: str, struck: Callable[[int], None]) -> None:
    """Nothing is asked of a run that was cut, and Ctrl-C is not lost where nobody looks at the status."""
    struck(2)
    with pytest.raises(KeyboardInterrupt):
        ask(LONG[name])


def test_ctrl_c_before_a_refusal_is_heard(heard: None) -> None:
    """Who goes on after a refusal, as a search does, would else go on for ever."""

    def refused() -> None:
        with held_back():
            signal.raise_signal(signal.SIGINT)
            raise SolveError("too many events", "a period has some", "look at the law")

    with pytest.raises(KeyboardInterrupt):
        refused()
