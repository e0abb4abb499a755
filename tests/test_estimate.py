"""An Estimate: what it refuses to be, and how it is read."""

import math

import pytest

from stickslip import Estimate
from stickslip.errors import EstimateError
from stickslip.story.story import interval_of, value_of


def estimate(value, low, high, *, sd=1.0, unit="N", status="ok"):
    return Estimate("friction", value, (low, high), sd, unit, "by hand", status)


@pytest.mark.parametrize(
    ("value", "low", "high"), [(7121, 4226, 4999), (0.3, 0.31, 0.4), (-1, 0, math.inf), (0.5, 1, 0)]
)
def test_a_value_outside_its_interval_can_not_be_built(value, low, high):
    with pytest.raises(EstimateError, match=r"friction of .* N .*95 %"):
        estimate(value, low, high)


@pytest.mark.parametrize(
    ("value", "low", "high"),
    [
        (1, 1, 1),
        (0.0, 1e-18, 0.3),
        (1 + 1e-15, 0, 1),
        (math.nan, math.nan, math.nan),
        (math.nan, -math.inf, math.inf),
        (-math.inf, -math.inf, -math.inf),
        (math.inf, 3, math.inf),
        (2, math.nan, 3),
    ],
)
def test_what_lies_inside_but_for_rounding_or_is_not_known_can(value, low, high):
    assert estimate(value, low, high).interval == (low, high)


def test_it_is_a_number():
    found = estimate(1.318, 1.310, 1.326, sd=0.004)
    assert float(found) == 1.318
    assert f"{found:.3f}" == "1.318"
    assert f"{found:8.2f}" == "    1.32"
    assert f"{found}" == str(found) == "friction 1.318 N (95 %: 1.310 to 1.326)"


@pytest.mark.parametrize("sd", [0.0024, 1e3, math.inf, math.nan, 0.0])
def test_its_digits_are_those_of_its_interval_whatever_its_deviation(sd):
    found = estimate(0.0968, 0.0922, 0.1015, sd=sd)
    assert str(found) == "friction 0.097 N (95 %: 0.092 to 0.102)"
    assert float(value_of(found).split()[0]) == pytest.approx(0.0968, abs=5e-4)
    assert interval_of(found) == "0.092 to 0.102 N"


@pytest.mark.parametrize(
    ("found", "words", "cell"),
    [
        (estimate(0.0, 0.0, 0.3), "friction below 0.30 N (95 %)", "below 0.30 N"),
        (estimate(0.0, -0.3, 0.0), "friction above -0.30 N (95 %)", "above -0.30 N"),
        (estimate(7121, 4226, math.inf, sd=math.inf), "friction 7121 N (95 %: at least 4226)", "at least 4 kN"),
        (estimate(7121, -math.inf, 9000, sd=math.inf), "friction 7121 N (95 %: at most 9000)", "at most 9.0 kN"),
        (estimate(math.inf, 4226, math.inf), "friction at least 4226.000 N (95 %)", "at least 4.226 kN"),
        (estimate(3.0, -math.inf, math.inf, sd=math.inf), "friction 3.000 N (95 %: unknown)", "unknown"),
        (estimate(3.0, math.nan, math.nan, sd=math.nan), "friction 3.000 N (95 %: unknown)", "unknown"),
        (estimate(math.nan, -math.inf, math.inf, status="why"), "friction unknown [why]", "unknown"),
        (estimate(-math.inf, -math.inf, -math.inf), "friction -inf N (95 %: -inf to -inf)", "no scatter"),
        (estimate(0.0, 0.0, 0.0), "friction 0.000 N (95 %: 0.000 to 0.000)", "no scatter"),
    ],
)
def test_an_end_that_is_none_is_told_in_words(found, words, cell):
    assert str(found) == words
    assert interval_of(found) == cell


def test_a_bound_of_a_plain_number_has_no_unit():
    assert str(estimate(0.0, 0.0, 0.07, unit="1")) == "friction below 0.07 (95 %)"


def test_what_has_no_value_keeps_its_reason_and_no_interval_is_made_up() -> None:
    friction = Estimate.normal("friction", 5.0, sd=0.1, unit="N", method="")
    assert friction.unknown("the sign is wrong").within(0.0).status == "the sign is wrong"
    loose = Estimate.normal("friction", 5.0, sd=math.nan, unit="N", method="")
    assert all(math.isnan(end) for end in loose.within(0.0).interval)


def test_what_can_not_be_is_told_without_a_unit_where_it_has_none() -> None:
    ratio = Estimate.normal("ratio", 0.5, sd=0.01, unit="1", method="").within(1.0)
    assert ratio.status == "the record gives a value below 1, which can not be"
