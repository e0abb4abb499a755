"""The speed at which sliding begins after a turn, and the frequency of the held mass, on the thesis's rig."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

import stickslip as ss
from rigs import CASES, RIG, SETTLED, measured, motion, told
from stickslip.errors import EstimateError, RecordError

METHODS = ("contact", "curve", "equation")
ROUGH = 0.03


@cache
def found(frequency: float, rough: float = 0.0) -> ss.contact.TransitionSpeed:
    return ss.contact.transition_speed(balanced(frequency, rough))


@cache
def balanced(frequency: float, rough: float = 0.0) -> ss.Record:
    return ss.friction_force(told(measured(frequency, rough, seconds=2.0)[0]), method="fusion", **RIG)


@cache
def true_speed(frequency: float, rough: float) -> float:
    """Mean speed at the begins of sliding in the record."""
    amplitude, kinetic = CASES[frequency]
    law: object = ss.laws.CompliantContact(kinetic, stiffness=192000, damping=23.9)
    if rough:
        law = ss.laws.RoughSurface(law, share=rough, length=2e-4, span=2e-3, seed=4)  # type: ignore[arg-type]
    drive = ss.drives.HarmonicBase(amplitude, frequency=frequency)
    run = ss.simulate(ss.Oscillator(law=law, drive=drive, **RIG), duration=SETTLED + 2)  # type: ignore[arg-type]
    begins = [event.time for event in run.events if event.kind == "slip" and event.time > SETTLED]
    return float(np.mean([abs(run.state(time)["v"]) for time in begins]))


@pytest.mark.parametrize(("frequency", "rough"), [(8.7, 0.0), (11.1, 0.0), (8.7, ROUGH), (11.1, ROUGH)])
def test_the_fitted_contact_tells_the_speed_at_which_sliding_begins(frequency: float, rough: float) -> None:
    speed, truth = found(frequency, rough).speed, true_speed(frequency, rough)
    assert speed.value == pytest.approx(truth, rel=2e-3)
    assert abs(speed.value - truth) < 3.5 * speed.sd


@pytest.mark.parametrize(("frequency", "rough"), [(8.7, 0.0), (11.1, 0.0), (8.7, ROUGH), (11.1, ROUGH)])
def test_the_others_are_biased_as_they_say(frequency: float, rough: float) -> None:
    answer, truth = found(frequency, rough), true_speed(frequency, rough)
    assert answer.curve is not None
    assert answer.equation is not None
    assert abs(answer.curve.value / truth - 1) < 0.01
    assert answer.curve.includes(truth)
    assert 0.02 < answer.equation.value / truth - 1 < 0.055
    assert any("lag" in check for check in answer.curve.checks)
    assert any("damping" in check for check in answer.equation.checks)


def test_in_stick_slip_curve_and_contact_agree() -> None:
    """Out of sliding the contact lets go past its fastest: each turn's speed falls again before the slip begins."""
    answer = found(2.5)
    run = motion(2.5)
    slips = [event.time for event in run.events if event.kind == "slip" and event.time > SETTLED]
    fastest = max(abs(run.state(time)["v"]) for time in slips)  # after a micro-slip it is slower
    assert answer.contact is not None
    assert answer.curve is not None
    assert answer.contact.value == pytest.approx(fastest, rel=2e-3)
    assert answer.curve.includes(fastest)
    assert answer.curve.value == pytest.approx(fastest, rel=0.02)


def test_equation_3_4_is_the_thesis_s() -> None:
    """From a motion that is a sine, its numbers put in by hand."""
    turn, amplitude, level, stiffness = 2 * math.pi * 8.7, 0.485e-3, 1.06, 181000.0
    phase = turn * np.arange(40_000) / 4000
    x, v = amplitude * np.sin(phase), turn * amplitude * np.cos(phase)
    after = np.where(v > 0, amplitude + x, amplitude - x)  # way since the turn
    friction = np.sign(v) * np.clip(stiffness * after - level, -level, level)
    record = ss.Record.of({"x": x, "v": v, "friction": friction}, fs=4000)
    answer = ss.contact.transition_speed(record, method="equation")
    deflection = level / stiffness
    assert answer.speed.value == pytest.approx(2 * turn * math.sqrt(amplitude * deflection - deflection**2), rel=5e-3)
    assert answer.curve is not None
    assert answer.curve.value == pytest.approx(answer.speed.value, rel=0.02)
    assert answer.contact is None
    assert "friction_force" in answer.status


def test_loops_tell_it_crudely() -> None:
    answer = ss.contact.transition_speed(ss.friction_loops(balanced(8.7)))
    assert answer.method == "equation"
    assert answer.speed.value == pytest.approx(true_speed(8.7, 0.0), rel=0.1)
    assert "crude" in answer.status
    with pytest.raises(EstimateError, match="curve, equation"):
        ss.contact.transition_speed(ss.friction_loops(balanced(8.7)), method="contact")


def test_stick_slip_is_no_harmonic_sliding() -> None:
    assert "stops" in found(2.5).status


def test_the_held_mass_rings_as_its_contact_says() -> None:
    frequency = ss.contact.coupled_frequency(balanced(2.5))
    assert frequency.value == pytest.approx(math.sqrt((2310 + 192000) / 2.42) / (2 * math.pi), rel=5e-4)
    assert frequency.includes(math.sqrt((2310 + 192000) / 2.42) / (2 * math.pi))
    assert frequency.status == "ok"
    assert "agree" in frequency.checks[0]


def test_where_nothing_rings_the_contact_alone_speaks() -> None:
    frequency = ss.contact.coupled_frequency(balanced(8.7))
    assert frequency.value == pytest.approx(45.1, rel=5e-3)
    assert "no ringing" in frequency.checks[0]


def test_it_is_drawn_with_each_method() -> None:
    import matplotlib.pyplot as plt

    ax = ss.figures.plot_transition_speed(found(8.7))
    carried = next(line for line in ax.lines if line.get_label() == "carried on")
    by_curve = next(line for line in ax.lines if line.get_label() == "by the curve")
    assert carried.get_xdata()[-1] == by_curve.get_xdata()[0]  # the curve is seen to lead there
    assert {"by the contact", "by the curve", "by the equation"} <= set(ax.get_legend_handles_labels()[1])
    plt.close("all")


def test_what_it_lacks_is_said() -> None:
    with pytest.raises(RecordError, match="friction"):
        ss.contact.transition_speed(measured(8.7, 0.0, seconds=2.0)[0])
    with pytest.raises(EstimateError, match="contact, curve, equation"):
        ss.contact.transition_speed(balanced(8.7), method="eye")
    slow = balanced(8.7)
    few = ss.Record.of({name: slow[name][::16] for name in ("x", "v", "friction")}, fs=250)
    with pytest.raises(EstimateError, match="sample faster"):
        ss.contact.transition_speed(few)


def test_a_sensor_whose_zero_is_off_changes_no_speed() -> None:
    record = told(measured(8.7)[0])
    off = record.with_channel("x", record["x"] + 0.1e-3, unit="m").with_details("x", delay=record.channels["x"].delay)
    right, wrong = (
        ss.contact.transition_speed(ss.friction_force(each, method="fusion", **RIG)) for each in (record, off)
    )
    for one, other in ((right.contact, wrong.contact), (right.curve, wrong.curve), (right.equation, wrong.equation)):
        assert one is not None
        assert other is not None
        assert other.value == pytest.approx(one.value, rel=1e-4)
        assert other.sd == pytest.approx(one.sd, rel=0.02)


def test_a_contact_damped_beyond_ringing_is_refused() -> None:
    """Its square root of a negative number ended the whole analysis of a record at 1 kHz."""
    from stickslip.balance.balance import Rig
    from stickslip.contact.contact import _set_going

    known = np.array([1.13, 2.97, 71.5, np.log(20_000.0), 440.0])
    with pytest.raises(EstimateError, match="rings"):
        _set_going(known, Rig(mass=2.38, stiffness=2271.8, damping=0.12, damper="ground", contact="ground"))
