"""Chapter 6 of the thesis: what its tables do not say. The tables themselves are judged with the chapters."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip.decay import extremes as ex
from stickslip_thesis import chapter6
from stickslip_thesis.printed import given

GIVEN = given()
TRUE = np.round(chapter6.extremes(GIVEN), 5)
BETA = GIVEN["errors"]["rate"]
RANDOM = chapter6.measured_extremes(GIVEN, "random")


def test_beta_is_the_quotient_and_not_the_printed_product() -> None:
    zeta = 0.2 / (2 * np.sqrt(10))
    quotient, product = (np.exp(-np.pi * beta) for beta in (zeta / np.sqrt(1 - zeta**2), zeta * np.sqrt(1 - zeta**2)))
    assert round(-quotient + (1 + quotient) * 0.02, 5) == TRUE[1]
    assert round(-product + (1 + product) * 0.02, 5) != TRUE[1]


def test_the_effective_bound_as_printed_does_not_give_its_tables() -> None:
    errors = np.round(TRUE - RANDOM + 1e-12, 4)
    held = ex.effective_rate_bound(RANDOM, errors=errors, i=2, m=1)
    printed = held * np.exp(-np.pi * ex.rate(RANDOM, i=2, m=1))  # equation 6.25 without e^m in the denominator
    assert round(held, 4) == 0.0047
    assert round(printed, 4) == 0.0042


def test_bias_spoils_the_sums_and_not_the_differences() -> None:
    x = np.array(TRUE) + 0.005
    assert ex.rate(x[:3], i=0, m=1, form="plain") == pytest.approx(0.08242, abs=1e-4)
    assert ex.rate(x, i=0, m=10, form="plain") == pytest.approx(0.02805, abs=1e-5)
    assert ex.rate(x, i=1, m=9) == pytest.approx(ex.rate(TRUE, i=1, m=9), abs=1e-12)
    assert ex.offset(x, BETA) == pytest.approx(0.005, abs=1e-4)


@pytest.mark.parametrize("m", [1, 2, 3, 4, 5, 6, 7])
def test_the_exact_bound_is_reached_and_never_passed(m: int) -> None:
    error, x = 0.005, RANDOM
    beta = ex.rate(x, i=2, m=m)
    worst = ex.rate_worst(x, i=2, m=m, error=error)
    first_order = ex.rate_bound(x, i=2, m=m, error=error)
    assert 1 < worst / first_order < 1.025  # equation 6.16 is a little too small
    rng = np.random.default_rng(m)
    moved = x + error * rng.choice([-1.0, 1.0], (4000, len(x)))
    off = np.abs(np.array([ex.rate(each, i=2, m=m) for each in moved]) - beta)
    assert off.max() == pytest.approx(worst, rel=1e-9)
    dry = ex.dry(x, beta)[1]
    dry_off = np.abs(np.array([ex.dry(each, ex.rate(each, i=2, m=m))[1] for each in moved]) - dry)
    assert dry_off.max() == pytest.approx(ex.dry_worst(x, i=2, m=m, error=error), rel=1e-9)
    inner = x + error * rng.uniform(-1, 1, (4000, len(x)))
    inside = np.abs(np.array([ex.dry(each, ex.rate(each, i=2, m=m))[1] for each in inner]) - dry)
    assert inside.max() <= dry_off.max()


def test_the_quoted_exact_bound() -> None:
    assert ex.rate_worst(RANDOM, i=2, m=7, error=0.005) == pytest.approx(0.006113, abs=5e-7)
    assert ex.rate_bound(RANDOM, i=2, m=7, error=0.005) == pytest.approx(0.005968, abs=5e-7)


def test_the_bound_of_four_extremes_is_that_of_their_rate() -> None:
    x = RANDOM
    beta = ex.rate(x, i=2, m=1)
    dry, alpha = float(ex.dry(x, beta)[1]), ex.rate_bound(x, i=2, m=1, error=0.005)
    by_rate = ex.dry_bound(x, i=2, beta=beta, dry_displacement=dry, error=0.005, rate_error=alpha)
    span = abs(x[2] - x[1]) + 2 * dry  # equation 6.19
    assert (1 + span / abs(x[3] - x[1])) * 0.005 == pytest.approx(by_rate, rel=1e-12)


def test_table_6_8_was_computed_from_a_rate_cut_off() -> None:
    x = chapter6.measured_extremes(GIVEN, "sampling")
    assert round(ex.rate(x, i=2, m=7), 5) == 0.03238
    assert round(float(ex.dry(x, 0.0323)[1]), 4) == 0.0196
    assert round(0.0323 - BETA, 4) == 0.0007


def test_an_error_of_table_6_3_is_larger_than_its_bound() -> None:
    off = np.abs(TRUE - RANDOM)
    assert off[1] == pytest.approx(0.00502, abs=1e-9)  # printed as .0050, of a bound of .005
    assert np.delete(off, 1).max() < GIVEN["errors"]["bounds"]["random"]
