"""What a run can be asked: to stop, to go on, when it crosses a level, what it took, how exact it is."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import stickslip as ss
from stickslip import drives, laws, solve

FORCED = ss.Oscillator(1.0, 1.0, laws.Coulomb(0.4, static=0.5), drives.HarmonicForce(1.0, 0.09), 0.02)
CURVED = FORCED.having(law=laws.Stribeck(0.4, 0.5, speed=0.3))
SHAKEN = ss.Oscillator(
    1.0, 1.0, laws.CompliantContact(0.4, 50.0, 0.5), drives.HarmonicBase(0.9, 0.09, contact="base"), 0.02
)
BELT = ss.Oscillator(1.0, 1.0, laws.Coulomb(1.0, static=1.5), drives.Dithered(drives.Belt(0.2), 0.01, 1.7))
RECORDED = FORCED.having(drive=drives.Recorded(np.sin(np.arange(80) / 4.0), fs=2.0, on="force"))


@pytest.mark.parametrize(
    "system", [FORCED, CURVED, SHAKEN, BELT, RECORDED], ids=["force", "curved", "base", "belt", "record"]
)
@pytest.mark.parametrize("share", [0.31, 0.62])
def test_a_run_goes_on_from_what_was_kept_of_it(system: ss.Oscillator, share: float) -> None:
    whole = ss.simulate(system, duration=30.0)
    time = 30.0 * share
    kept = json.loads(json.dumps(whole.restart(time)))
    rest = ss.simulate(system.having(drive=drives.Later(system.drive, time)), duration=30.0 - time, start=kept)
    later = [event for event in whole.events if event.time > time]
    assert [event[1:] for event in rest.events if event.time > 0] == [event[1:] for event in later]
    np.testing.assert_allclose(
        [event.time + time for event in rest.events if event.time > 0], [event.time for event in later], atol=1e-9
    )
    times = np.linspace(0, rest.duration, 50)
    x, y = rest.sample(times, ("x",))[0], whole.sample(np.minimum(times + time, 30.0), ("x",))[0]
    np.testing.assert_allclose(x, y, atol=1e-9)


def test_a_mass_that_is_held_on_a_shaken_face_goes_on_from_every_instant() -> None:
    """The velocity of a face of two tones is a sum, and rounds as it is added: no slip in a mode that holds."""
    face = drives.MultiTone([(0.7, 0.31, 0.4), (0.8, 0.4384, 0.0)], on="face")
    system = ss.Oscillator(1.0, 1.0, laws.LinearSlope(3.0, slope=0.1), face, 0.05)
    whole = ss.simulate(system, duration=60.0)
    times = np.linspace(1.0, 59.0, 200)
    held = times[whole.modes[whole.sample(times, ("x",))[1]] == whole.table.index("stuck")]
    assert len(held) > 10
    for time in held.tolist():
        later = system.having(drive=drives.Later(face, time))
        rest = ss.simulate(later, duration=60.0 - time, start=whole.restart(time))
        assert rest.state(60.0 - time)["x"] == pytest.approx(whole.state(60.0)["x"], abs=1e-9)


def test_crossings_of_a_free_motion() -> None:
    """x = cos 2 t crosses 1/2 wherever 2 t is pi/3 from a whole turn, and touches 1 without crossing it."""
    run = ss.simulate(ss.Oscillator(1.0, 4.0, laws.Coulomb(0.0)), duration=10.0, start={"x": 1.0})
    truth = np.sort([(2 * math.pi * n + sign * math.pi / 3) / 2 for n in range(5) for sign in (-1, 1)])
    truth = truth[(truth > 0) & (truth < 10)]
    np.testing.assert_allclose(solve.crossings(run, "x", level=0.5), truth, atol=1e-12)
    np.testing.assert_allclose(solve.crossings(run, "x", level=0.5, side=-1), truth[::2], atol=1e-12)
    assert len(solve.crossings(run, "x", level=1.0 + 1e-9)) == 0
    near = solve.crossings(run, "x", level=1.0 - 1e-10)
    np.testing.assert_allclose(np.diff(near[1:3]), math.acos(1 - 1e-10), rtol=1e-4)  # two within one cell


def test_a_jump_of_friction_crosses_too() -> None:
    run = ss.simulate(FORCED, cycles=6)
    events = [event.time for event in run.events if event.kind == "reversal"]
    assert events
    crossed = solve.crossings(run, "friction")
    assert all(np.min(np.abs(crossed - time)) < 1e-12 for time in events)


@pytest.mark.parametrize("system", [FORCED, CURVED])
def test_a_run_stops_where_it_is_told(system: ss.Oscillator) -> None:
    whole = ss.simulate(system, duration=40.0)
    first = solve.crossings(whole, "x", level=-0.3)[0]
    run = ss.simulate(system, duration=40.0, stop={"x": -0.3, "v": 50.0})
    assert run.status == "stopped"
    assert run.duration == pytest.approx(first, abs=1e-9)
    assert run.state(run.duration)["x"] == pytest.approx(-0.3, abs=1e-11)
    assert ss.simulate(system, duration=10.0, stop={"x": 1e3}).status == "complete"


def test_the_tolerance_holds_for_the_end() -> None:
    for rtol in (1e-6, 1e-9):
        run = ss.simulate(CURVED, cycles=10, rtol=rtol)
        error = solve.global_error(run)
        assert np.max(error.along) < rtol
        assert error.events < rtol * run.duration
    with pytest.raises(ss.errors.ModelError, match="rounding"):
        solve.global_error(ss.simulate(FORCED, cycles=2))


def test_what_a_run_took() -> None:
    statistics = solve.statistics(ss.simulate(FORCED, cycles=10))
    assert statistics.events >= 10
    assert statistics.pieces > statistics.events
    assert 0 < statistics.slowest_exit <= 1
    curved = solve.statistics(ss.simulate(CURVED, cycles=10))
    assert curved.steps > curved.events
    assert math.isnan(curved.slowest_exit)


def test_what_has_no_meaning_is_refused() -> None:
    run = ss.simulate(FORCED, cycles=1)
    with pytest.raises(ss.errors.ModelError, match="side"):
        solve.crossings(run, "x", side=2)
    with pytest.raises(ss.errors.ModelError, match="rows"):
        solve.crossings(run, "x", contact=1)
    with pytest.raises(ss.errors.ModelError, match="recorded"):
        drives.Later(RECORDED.drive, 100.0)
