"""How does friction grow with the load, and what would it be under another one?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Estimate, Result, Status
from stickslip.parameters import finite
from stickslip.statistics import student
from stickslip.units import parse_value

Array = NDArray[np.float64]

LEAST_REACH = 1.05  # ratio of the largest load to the smallest
LATE = "the line goes below zero, which no friction does: it begins late, or grows by more than the load"
FAR = 0.5  # of the range of loads: further outside it the line is not known to hold


@dataclass(frozen=True, eq=False, repr=False)
class LoadLine(Result):
    """Friction against load: a straight line.

    Attributes
    ----------
    coefficient : Estimate
        Friction per load, the slope of the line.
    adhesion : Estimate
        Friction [N] without load: adhesion, or a preload; zero at least, and without a value where the line surely goes
        below, friction beginning late.
    coefficients : tuple of Estimate
        Friction over load, of each load alone; alike where the adhesion is none.
    loads : ndarray, shape (n,)
        Loads [N].
    line : ndarray, shape (2,)
        Where the line meets no load [N], be it below zero, and its slope.
    covariance : ndarray, shape (2, 2)
        Of these.
    quantile : float
        Of Student's t, for 95 %.
    status : str
        "ok", or in words what to beware of.
    """

    coefficient: Estimate
    adhesion: Estimate
    coefficients: tuple[Estimate, ...]
    loads: Array
    line: Array
    covariance: Array
    quantile: float
    status: str

    def friction(self, load: float | str) -> Estimate:
        """The friction under another load.

        Parameters
        ----------
        load : float or str
            Load [N].

        Returns
        -------
        Estimate
            Flagged where the load is further outside those measured than half their range.
        """
        newtons = finite("load", parse_value(load, "N"), unit="N")
        row = np.array([1.0, newtons])
        low, high = self.loads.min(), self.loads.max()
        outside = max(low - newtons, newtons - high)
        far = (
            f"{newtons:.3g} N is far from the loads measured, {low:.3g} to {high:.3g} N"
            if outside > FAR * (high - low)
            else "ok"
        )
        return Estimate.normal(
            f"friction under {newtons:.3g} N", float(row @ self.line),
            sd=math.sqrt(float(row @ self.covariance @ row)), unit="N", method="line through friction over load",
            quantile=self.quantile, status=far,
        ).within(0.0, otherwise=LATE)  # fmt: skip


def friction_over_load(levels: Sequence[Estimate], *, loads: Sequence[float | str]) -> LoadLine:
    r"""How does friction depend on the load?

    The line :math:`F = F_0 + \mu N` by least squares, each friction by the width of its interval; where they scatter
    about the line more than these allow, the intervals are wider by as much. Amontons's law is a line through zero: it
    holds where the interval of :math:`F_0` does.

    Parameters
    ----------
    levels : sequence of Estimate
        Sliding friction [N] under each load, as of :func:`friction_loops` (``.level``) or :func:`fit_curve`.
    loads : sequence of float or str
        The loads [N].

    Returns
    -------
    LoadLine

    Raises
    ------
    EstimateError
        Fewer than two loads that differ, or not one friction for each.

    Examples
    --------
    >>> levels = [Estimate.normal("friction", f, sd=0.01, unit="N", method="") for f in (0.62, 1.19)]
    >>> line = friction_over_load(levels, loads=[2.0, 4.0])
    >>> print(line.friction(3.0))
    friction under 3 N 0.905 N (95 %: 0.891 to 0.919)
    """
    weights = np.array([finite("loads", parse_value(load, "N"), unit="N") for load in loads])
    if len(levels) != len(weights) or len(levels) < 2:
        raise EstimateError(
            f"{len(levels)} frictions, {len(weights)} loads",
            "a line needs a friction for each of two loads at least",
            "give one of each",
        )
    if weights.min() <= 0 or weights.max() < LEAST_REACH * weights.min():
        raise EstimateError(
            f"loads from {weights.min():.3g} to {weights.max():.3g} N",
            f"they are above zero, and the largest is {LEAST_REACH:g} times the smallest at least",
            "give records under loads that differ",
        )
    values = np.array([level.value for level in levels])
    sds = np.array([(level.interval[1] - level.interval[0]) / 2 / NORMAL_95 for level in levels])
    sds = np.maximum(sds, 1e-9 * np.abs(values).max())
    columns = np.column_stack([np.ones(len(weights)), weights]) / sds[:, None]
    covariance = np.linalg.inv(columns.T @ columns)
    line = covariance @ (columns.T @ (values / sds))
    freedom = len(values) - 2
    left = values / sds - columns @ line
    excess = float(left @ left) / freedom if freedom else 1.0
    quantile = student(freedom) if excess > 1 else NORMAL_95
    covariance = covariance * max(1.0, excess)
    method = f"line through friction under {len(values)} loads"
    checks = (f"frictions stray from the line by {math.sqrt(excess):.2g} times their deviations",) if freedom else ()
    named = (("friction without load", "N", LATE), ("coefficient of friction", "1", "friction falls with the load"))
    adhesion, coefficient = (
        Estimate.normal(
            name, line[row], sd=math.sqrt(covariance[row, row]), unit=unit, method=method, quantile=quantile,
            checks=checks,
        ).within(0.0, otherwise=why)
        for row, (name, unit, why) in enumerate(named)
    )  # fmt: skip
    ratios = tuple(
        level.scaled(1 / float(load), "1", f"friction over load of {load:.3g} N")
        for level, load in zip(levels, weights, strict=True)
    )
    doubtful = [level.status for level in levels if level.status != "ok"]
    status = Status(*doubtful)
    return LoadLine(coefficient, adhesion, ratios, weights, line, covariance, quantile, status)
