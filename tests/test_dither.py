"""Dither: the smallest that removes stick-slip, and the averaged law with its limits."""

from __future__ import annotations

import math
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from scripts import loaded
from stickslip.estimate import stands
from stickslip.maps.dither import averaged_friction, longest_stick

BELT = ss.Oscillator(mass=1, stiffness=1, law=ss.laws.Coulomb(1.0, static=1.5), drive=ss.drives.Belt(0.5), damping=0.02)
FREQUENCY = 5.0


@pytest.fixture(scope="module")
def found() -> ss.maps.Dither:
    return ss.dither(BELT, frequency=FREQUENCY)


def sticks(amplitude: float, *, start: dict[str, float] | None = None) -> float:
    """Longest stick of the belt's mass with a dither, in its periods, counted from the events of a run."""
    system = BELT.having(drive=ss.drives.Dithered(BELT.drive, amplitude, FREQUENCY))
    run = ss.simulate(system, duration=600.0, start=start)
    lengths = [p.duration for p in run.pieces if p.mode == "stuck" and p.start > 300]
    return max(lengths, default=0.0) * FREQUENCY


def test_the_dither_found_removes_sticks_and_less_does_not(found: ss.maps.Dither) -> None:
    low, high = found.amplitude.interval
    assert found.amplitude.value == high
    assert 0 < high - low <= 0.07 * high
    assert sticks(high) < 1
    assert sticks(1.1 * high, start={"x": 1.2}) < 1
    assert sticks(0.6 * low) >= 1
    assert found.sticks[0] > 10 * found.sticks[1]
    assert found.system.drive == ss.drives.Dithered(BELT.drive, high, FREQUENCY)
    assert found.speed == pytest.approx(2 * math.pi * FREQUENCY * high)


def test_the_answer_scales_with_the_units(found: ss.maps.Dither) -> None:
    """Lengths by L, times by T, forces by F: the same number of the same dither."""
    length, time, force = 1e-3, 1e-2, 7.0
    small = ss.Oscillator(
        mass=force * time**2 / length,
        stiffness=force / length,
        law=ss.laws.Coulomb(force, static=1.5 * force),
        drive=ss.drives.Belt(0.5 * length / time),
        damping=0.02 * force * time / length,
    )
    other = ss.dither(small, frequency=FREQUENCY / time)
    assert other.amplitude.value == pytest.approx(length * found.amplitude.value, rel=1e-6)


def test_a_force_on_the_mass_does_what_a_shaken_face_does() -> None:
    """In the face's frame the mass feels -m times its acceleration; a free harmonic slider has no other spring felt."""
    slider = ss.Oscillator(1, 1, ss.laws.Coulomb(0.8), ss.drives.HarmonicForce(1.0, 0.6 / (2 * math.pi)))
    face, force = (ss.dither(slider, frequency=6.0, on=on) for on in ("face", "force"))
    assert force.amplitude.value == pytest.approx(face.amplitude.value * (2 * math.pi * 6.0) ** 2, rel=0.05)
    assert force.amplitude.unit == "N"


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.9])
def test_the_averaged_law_is_the_closed_form(share: float) -> None:
    known = {0.1: 0.063768560858519848, 0.25: 0.16086124651033249, 0.5: 1 / 3, 0.9: 0.71286741374258746}
    assert ss.maps.dithered_friction(share, speed=1.0) == pytest.approx(known[share], rel=1e-14)
    assert ss.maps.dithered_friction(-2 * share, speed=2.0) == pytest.approx(-known[share], rel=1e-14)
    assert ss.maps.dithered_friction(3.0, speed=2.0) == 1.0


def test_the_averaged_law_holds_where_inertia_is_more_than_friction() -> None:
    """Its error falls with the dither's inertia over the friction; below it the law says too little."""
    slider, frequency = ss.Oscillator(1, 1, ss.laws.Coulomb(1.0)), 50.0
    off = []
    for inertia in (0.5, 2.0, 10.0, 50.0):
        rows = averaged_friction(slider, frequency=frequency, speed=inertia / (2 * math.pi * frequency))
        off.append(np.max(np.abs(rows[:, 1] - rows[:, 2])))
    assert off[0] > 0.15
    assert off[-1] < 0.002
    assert np.all(np.diff(off) < 0)


def test_a_ring_says_where_to_dither() -> None:
    """An octave above the ring of a compliant contact, or faster; the dither moves as far as the contact gives."""
    contact = ss.laws.CompliantContact(1.1, stiffness=192000.0, damping=23.9)
    slider = ss.Oscillator(2.42, 2310, contact, ss.drives.HarmonicBase(0.65e-3, frequency=2.5))
    record = ss.simulate(slider, cycles=8).record(fs=4000).between(1.0, 3.2)
    rings = ss.contact.transition(record, mass=2.42, stiffness=2310)
    dithered = ss.dither(slider, transition=rings, cycles=12)
    assert dithered.frequency > 1.9 * rings.frequency.value
    assert dithered.amplitude.value == pytest.approx(1.1 / 192000, rel=0.2)
    assert dithered.sticks[1] * dithered.frequency < 1
    assert any("rings at 45" in check for check in dithered.checks)


def test_of_several_frequencies_the_smallest_amplitude_is_taken() -> None:
    dithered = ss.dither(BELT, frequency=[4.0, 8.0])
    assert dithered.frequency == 8.0
    assert [f for f, _ in dithered.tried] == [4.0, 8.0]
    assert dithered.amplitude.value == min(amplitude for _, amplitude in dithered.tried)


def test_the_longest_stick_is_put_together_across_pieces() -> None:
    run = ss.simulate(BELT, duration=60.0)
    events = [event for event in run.events if event.time > 20]
    lengths = [b.time - a.time for a, b in pairwise(events) if a.kind == "stick"]
    assert longest_stick(run, 20.0) == pytest.approx(max(lengths), rel=1e-9)


def unfollowed(low: float, high: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs with a dither between two amplitudes can not be followed."""
    module = sys.modules["stickslip.maps.dither"]

    def simulate(system: ss.Oscillator, **options: object) -> ss.solve.Trajectory:
        if low < getattr(system.drive, "amplitude", 0.0) < high:
            raise ss.errors.SolveError("chatter", "a law leaves every state in one direction", "check the law")
        return ss.simulate(system, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "simulate", simulate)


def test_a_run_that_failed_is_no_stick(found: ss.maps.Dither, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is not known below the answer stands in its interval and its doubt."""
    unfollowed(0.5 * found.amplitude.value, 2 * found.amplitude.value, monkeypatch)
    other = ss.dither(BELT, frequency=FREQUENCY)
    assert other.amplitude.value >= 2 * found.amplitude.value
    assert other.amplitude.interval[0] <= 0.5 * found.amplitude.value
    assert not stands(other.amplitude.status)
    assert stands(found.amplitude.status)
    assert np.any(np.isnan(other.scan[:, 1]))
    assert not np.any(np.isinf(other.scan))


def test_no_answer_rests_on_runs_that_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    unfollowed(0.0, math.inf, monkeypatch)
    with pytest.raises(ss.errors.SolveError, match="at 64 amplitudes a run could not be followed"):
        ss.dither(BELT, frequency=FREQUENCY)


def test_a_falling_curve_needs_the_dither_that_its_table_needs() -> None:
    """A table of the curve goes through the exact engine, and passes many lines in every period of the dither."""
    curve = ss.laws.Stribeck(1.0, 1.5, speed=0.1)
    falling = BELT.having(law=curve, drive=ss.drives.Belt(0.3))
    table = falling.having(law=ss.laws.Tabulated.of(curve.friction, np.linspace(0, 0.5, 101)))
    one, other = (ss.dither(system, frequency=FREQUENCY, cycles=20) for system in (falling, table))
    assert one.amplitude.value == pytest.approx(other.amplitude.value, rel=0.1)
    assert one.amplitude.value == pytest.approx(0.00108, rel=0.1)
    assert stands(one.amplitude.status)


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (lambda: ss.dither(BELT.having(law=ss.laws.Coulomb(1.0))), "nothing to remove"),
        (lambda: ss.dither(BELT.having(drive=ss.drives.HarmonicForce(0.5, 0.1))), "held all the time"),
        (lambda: ss.dither(BELT.having(drive=ss.drives.Release())), "nothing drives"),
        (lambda: ss.dither(BELT, frequency=0.01), "faster than the slow motion"),
        (lambda: ss.dither(BELT, frequency=0.3), "removes the stick"),
        (lambda: ss.dither(BELT, on="roof"), "face, base, force"),
        (lambda: ss.dither(BELT, cycles=1), "10 cycles"),
        (lambda: ss.dither(BELT.having(drive=ss.drives.Dithered(ss.drives.Belt(0.5), 1e-4, 5.0))), "dithered already"),
        (lambda: ss.maps.dithered_friction(0.1, speed=0.0), "dither moves"),
    ],
)
def test_bad_questions_are_refused_in_a_sentence(ask, told) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ss.StickslipError, match=told) as caught:
        ask()
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_the_figure_shows_law_and_runs(found: ss.maps.Dither) -> None:
    [plate] = ss.summary(found).plates
    assert "asin" in plate.svg()
    assert "smallest that does it" in plate.svg()


def test_random_systems_lose_their_sticks(tmp_path: Path) -> None:
    """The short form of benchmarks/dither.py, stopped and begun again."""
    bench = loaded("benchmarks/dither.py")
    first = bench.measured(2, tmp_path)
    lines = bench.measured(3, tmp_path)
    assert lines[:2] == first
    assert all(line.removed for line in lines)
    assert all(line.ratio <= 1.1 for line in lines)
