"""A constant of a rig, and a channel's gain, with how sure they are: what is read, and where it goes."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip.errors import ModelError, RecordError
from stickslip.estimate import Estimate
from stickslip.units import parse_uncertain

WRITTEN = [
    ("2.42 ± 0.02 kg", 2.42, 0.02),
    ("2.42 +- 0.02 kg", 2.42, 0.02),
    ("2.42+/-0.02kg", 2.42, 0.02),
    ("(2.42 ± 0.02) kg", 2.42, 0.02),
    ("2420 g ± 0.02 kg", 2.42, 0.02),
    ("2.42 kg ± 1 %", 2.42, 0.0242),
    ("2.42 ± 1% kg", 2.42, 0.0242),
    ("2.42(2) kg", 2.42, 0.02),
    ("2.42(0.02) kg", 2.42, 0.02),
    ("242(2)e-2", 2.42, 0.02),
    ("2.42 ± .02", 2.42, 0.02),
    ("2.42 kg", 2.42, 0.0),
    ("2.42 ± 0 kg", 2.42, 0.0),
    (2.42, 2.42, 0.0),
    ((2.42, 0.02), 2.42, 0.02),
    (("2420 g", "20 g"), 2.42, 0.02),
]
REFUSED = [
    ("2.42 ± -0.02 kg", "finite and not negative"),
    ((2.42, -0.02), "finite and not negative"),
    ("2.42 kg ± 3 N", "'N' is measured in N; this quantity is measured in kg"),
    ("0 kg ± 1 %", "a per cent of 0 is no uncertainty"),
    ("2.42 ± nan kg", "a number behind it"),
    ((2.42, float("nan")), "not a finite number"),
    ("2.42 ± inf kg", "a number behind it"),
    ("2.42 ± 1e999 %", "finite and not negative"),
    ("± 0.02 kg", "a value stands before the sign"),
    ((None, 0.02), "not a finite number"),
    ("2.42 kg ±", "a number behind it"),
    ("2420 g ± 20", "stands a number with one, or per cent"),
    ("2.42 kg ± 1 % kg", "stands a number with one, or per cent"),
    ((2.42, 0.02, 0.01), "a pair is a value and its uncertainty"),
    ("2.42 ± 0.02 ± 0.01 kg", "is not known"),
    ("(2.42)", "not a finite number"),
]


@pytest.mark.parametrize(("stated", "value", "sd"), WRITTEN)
def test_a_value_and_its_standard_uncertainty_are_read_as_they_are_written(stated, value, sd):
    assert parse_uncertain(stated, "kg") == pytest.approx((value, sd), rel=1e-12)


@pytest.mark.parametrize(("stated", "told"), REFUSED)
def test_an_uncertainty_that_has_no_meaning_is_one_sentence(stated, told):
    with pytest.raises(RecordError) as caught:
        parse_uncertain(stated, "kg")
    assert told in str(caught.value)


def test_an_estimate_is_a_constant_as_sure_as_it_is():
    found = Estimate.normal("mass", 2.42, sd=0.02, unit="kg", method="scales")
    assert Estimate.stated("mass", found, "kg").sd == 0.02
    with pytest.raises(ModelError, match="a stiffness is measured in N/m"):
        Estimate.stated("stiffness", found, "N/m")
    with pytest.raises(ModelError, match="not a finite number"):
        Estimate.stated("mass", found.unknown("it never moved"), "kg")


@given(st.floats(-1e6, 1e6), st.floats(0, 1e6), st.sampled_from(["±", "+-", "+/-"]))
def test_what_is_written_is_read(value, sd, sign):
    assert parse_uncertain(f"{value!r} {sign} {sd!r} N/m", "N/m") == (value, sd)


@given(st.text("0123456789.±+-/()% ekgmN\n", max_size=300))
def test_any_text_is_read_or_one_sentence(text):
    with contextlib.suppress(RecordError):
        value, sd = parse_uncertain(text, "kg")
        assert abs(value) < float("inf")
        assert 0 <= sd < float("inf")
