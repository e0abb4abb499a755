"""A long run tells how far it is, and Ctrl-C leaves what was done."""

from __future__ import annotations

import itertools
import json
import signal
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.solve import kernel
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


def test_a_greater_question_ends_with_its_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """The steady state is not sought on from a run that was cut."""
    march, calls = kernel.march, itertools.count()

    def stopped(*arguments: Any) -> Any:
        if next(calls) == 1:
            raise KeyboardInterrupt
        return march(*arguments)

    monkeypatch.setattr(kernel, "march", stopped)
    with pytest.raises(KeyboardInterrupt):
        ss.steady_state(RIGID)
