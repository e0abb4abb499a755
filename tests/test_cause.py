"""A late sensor against a contact that gives way, on simulated records of each."""

from __future__ import annotations

from functools import cache

import pytest

import stickslip as ss
from rigs import CASES, LAG, RIG, SETTLED, measured, told
from stickslip.errors import EstimateError, RecordError


@cache
def seen(frequency: float, soft: bool, late: bool) -> ss.Record:
    """What the rig reads of a rigid or a compliant contact, by displacement sensors that are late or not."""
    amplitude, kinetic = CASES[frequency]
    law = ss.laws.CompliantContact(kinetic, stiffness=192000, damping=23.9) if soft else ss.laws.Coulomb(kinetic)
    slider = ss.Oscillator(law=law, drive=ss.drives.HarmonicBase(amplitude, frequency=frequency), **RIG)
    rig = ss.Rig()
    for name in ("x", "z"):
        rig = rig.having(name, lag=LAG if late else 0.0)
    record = rig.measure(ss.simulate(slider, duration=SETTLED + 2), fs=4000, rng=1, start=SETTLED)
    record = record.with_details("load", mount=(250.0, 0.05), inertia=0.05, discharge=50.0)
    return record.with_details("a", mount=(125.0, 0.1))


@cache
def answered(frequency: float, soft: bool, late: bool) -> ss.contact.Cause:
    return ss.contact.lag_or_compliance(seen(frequency, soft, late))


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize(("frequency", "soft"), [(2.5, True), (5.61, True), (8.7, True), (8.7, False), (11.1, False)])
def test_each_cause_is_told_from_the_others(frequency: float, soft: bool, late: bool) -> None:
    answer = answered(frequency, soft, late)
    names = {(True, True): "both", (True, False): "contact compliance", (False, True): "sensor lag"}
    assert answer.cause == names.get((soft, late), answer.cause)
    if not soft and not late:
        assert answer.cause in ("neither", "cannot be told")
    assert answer.lag.includes(LAG if late else 0.0)
    if soft:
        assert answer.stiffness is not None
        assert answer.stiffness.value == pytest.approx(192000, rel=0.12)
        assert "gives way" in answer.reason


def test_a_lag_would_pass_for_a_third_of_the_transition_speed() -> None:
    answer = answered(8.7, True, True)
    assert 0.22 < answer.mimicked < 0.4
    assert "would pass for" in answer.reason


def test_a_stated_delay_is_no_lag() -> None:
    record = seen(8.7, True, True)
    for name in ("x", "z"):
        record = record.with_details(name, delay=LAG)
    assert ss.contact.lag_or_compliance(record).cause == "contact compliance"


def test_the_friction_alone_tells_it_less_surely() -> None:
    record = seen(8.7, True, True)
    bare = ss.Record.of({name: record[name] for name in ("x", "load")}, fs=4000)
    bare = bare.with_details("load", mount=(250.0, 0.05), inertia=0.05, discharge=50.0)
    cause = ss.contact.lag_or_compliance(bare)
    assert cause.cause == "both"
    assert cause.lag.includes(LAG)
    assert "mount is not stated" in ss.contact.lag_or_compliance(bare.with_details("load", mount=None)).status


@pytest.mark.parametrize("frequency", [2.5, pytest.param(5.61, marks=pytest.mark.soak), 8.7])
def test_stiffness_and_give_hold_the_truth(frequency: float) -> None:
    """By the fitted contact where friction was found by the balance of forces, else as far as a damper leaves it."""
    give = CASES[frequency][1] / 192000
    record = told(measured(frequency, seconds=2.0)[0])
    fused = ss.friction_force(record, method="fusion", **RIG)
    for each in (record, fused):
        cause = ss.contact.lag_or_compliance(each)
        assert cause.cause == "contact compliance"
        assert cause.stiffness is not None
        assert cause.stiffness.includes(192000)
        assert cause.give.includes(give)
        assert cause.give.includes(cause.give.value)
        assert f"{1e6 * cause.give.value:.3g} µm" in cause.reason
    assert cause.stiffness == ss.contact_stiffness(fused)
    assert "a damper in the contact" in ss.contact.lag_or_compliance(record).stiffness.status  # type: ignore[union-attr]


def test_the_answer_is_printed() -> None:
    answer = answered(8.7, True, False)
    assert str(answer).startswith(f"{answer.cause}: {answer.reason}")


def test_of_a_long_record_the_middle_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stickslip.contact.cause.MOST", 4000)
    cause = ss.contact.lag_or_compliance(seen(8.7, True, False))
    assert cause.cause == "contact compliance"
    assert "the 1 s in the middle of 2 s" in cause.reason


def test_a_rigid_contact_that_sticks_tells_nothing() -> None:
    assert answered(2.5, False, True).cause == "cannot be told"


def test_what_it_needs() -> None:
    record = seen(8.7, True, False)
    with pytest.raises(RecordError, match="friction"):
        ss.contact.lag_or_compliance(ss.Record.of({"x": record["x"]}, fs=4000))
    with pytest.raises(EstimateError, match="reversals"):
        ss.contact.lag_or_compliance(record.rows(0, 400))
