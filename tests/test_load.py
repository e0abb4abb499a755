"""Friction against load: the line of known points, other people's rigs, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from stickslip import Estimate
from stickslip.errors import EstimateError, ModelError
from stickslip.law import friction_over_load


def levels(*values: float, sd: float = 0.01) -> list[Estimate]:
    return [Estimate.normal("sliding friction", value, sd=sd, unit="N", method="") for value in values]


def test_a_line_is_found_and_foretells() -> None:
    line = friction_over_load(levels(1.3, 2.3, 3.3), loads=[2.0, 4.0, 6.0])
    assert line.coefficient.value == pytest.approx(0.5)
    assert line.adhesion.value == pytest.approx(0.3)
    assert line.friction("5 N").value == pytest.approx(2.8)
    assert [coefficient.value for coefficient in line.coefficients] == pytest.approx([0.65, 0.575, 0.55])
    # weighted least squares of three points: the variance in the middle is a third
    assert line.friction(4.0).sd == pytest.approx(0.01 / np.sqrt(3))
    assert "far from the loads" in line.friction(20.0).status


def test_intervals_hold_the_truth() -> None:
    rng, loads = np.random.default_rng(0), np.array([1.0, 2.0, 3.0, 5.0])
    lines = [friction_over_load(levels(*(0.1 + 0.3 * loads + rng.normal(0, 0.01, 4))), loads=loads) for _ in range(300)]
    for name, truth in (("coefficient", 0.3), ("adhesion", 0.1)):
        assert np.mean([getattr(line, name).includes(truth) for line in lines]) >= 0.93


def test_scatter_about_the_line_widens_it() -> None:
    straight = friction_over_load(levels(1.0, 2.0, 3.0), loads=[1, 2, 3])
    bent = friction_over_load(levels(1.0, 2.3, 3.0), loads=[1, 2, 3])
    assert bent.coefficient.sd > 5 * straight.coefficient.sd


def test_what_is_no_line_is_refused() -> None:
    with pytest.raises(EstimateError, match="1 frictions, 1 loads"):
        friction_over_load(levels(1.0), loads=[2.0])
    with pytest.raises(EstimateError, match="loads that differ"):
        friction_over_load(levels(1.0, 1.1), loads=[2.0, 2.0])
    with pytest.raises(ModelError, match="not negative"):
        friction_over_load(levels(1.0, 1.1), loads=[-2.0, 2.0])
