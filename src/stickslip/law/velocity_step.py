"""Rate-and-state friction, fitted to a step of the driving velocity."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import FAST, compiled
from stickslip.errors import EstimateError
from stickslip.law.data import Samples
from stickslip.law.family import Family
from stickslip.laws.rate_state import RateState

Array = NDArray[np.float64]

LEAST_STEP = 1.2  # ratio of the two speeds
LEAST_WAY = 1.5  # times the way from its first reading to its last, from which on a displacement goes to and fro
STALLED = 1e5  # times the fastest rate's time, in one sample
RATIOS = (0.5, 1.0, 1.5)  # b over a, to begin with
DISTANCES = 8  # ways of renewal to begin with, from that of a few samples to that after the step
STIFFNESSES = 6  # to begin with: friction follows the step within the record, or within a few samples
UNITS = {
    "friction": "1", "direct": "1", "evolution": "1", "rate_dependence": "1", "distance": "m", "stiffness": "N/m",
    "trend": "1/m",
}  # fmt: skip


@compiled(**FAST)
def _rates(z, w, drive, ratio, distance, stiffness, slip):
    """Rates of the logarithms of speed and age, both over those before the step; time in units of 1/V1."""
    way = np.exp(z)
    dw = -way * (z + w) / distance if slip else (np.exp(-w) - way) / distance
    return stiffness * (drive - way) - ratio * dw, dw


@compiled(**FAST)
def _response(time, step_time, speed, after, ratio, distance, stiffness, slip, out):
    """Friction over a, less that before a step of the drive from `speed` to `after` (a ratio), by Runge and Kutta."""
    z = w = 0.0
    now = step_time
    for i in range(len(time)):
        if time[i] <= step_time:
            out[i] = 0.0
            continue
        left = (time[i] - now) * speed
        now = time[i]
        while left > 0:
            fastest = (stiffness + (1 + ratio) / distance) * max(after, np.exp(z)) + np.exp(-w) / distance
            if not fastest * left < STALLED:  # speeds without bound: the slider runs away from its spring
                out[i:] = np.nan
                return
            h = min(left, 0.2 / fastest)  # far inside what is stable: errors of 1e-6
            a1, b1 = _rates(z, w, after, ratio, distance, stiffness, slip)
            a2, b2 = _rates(z + h / 2 * a1, w + h / 2 * b1, after, ratio, distance, stiffness, slip)
            a3, b3 = _rates(z + h / 2 * a2, w + h / 2 * b2, after, ratio, distance, stiffness, slip)
            a4, b4 = _rates(z + h * a3, w + h * b3, after, ratio, distance, stiffness, slip)
            z += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            w += h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
            left -= h
        out[i] = z + ratio * w


def velocity_step(samples: Samples, *, law: str, normal: float) -> Family:
    r"""Friction by the aging or the slip law behind a spring whose far end changes its speed once.

    With :math:`z = \ln(v/V_1)` and :math:`w = \ln(V_1\theta/D_c)`, friction is
    :math:`N[\mu_0 + a z + b w]`, its spring says :math:`\dot f = k (V - v)`, so
    :math:`\dot z = (k/aN)(V - v) - (b/a)\dot w`; slip goes on steadily before the step.
    The instant of the step, first taken from the drive's displacement, is fitted too.
    """
    step_time, before, after = step_of(samples)
    ways = (samples.displacement - samples.displacement[0])[:, None]

    def columns(some: Samples, logs: Array) -> Array:
        ratio, distance, stiffness, since = np.exp(logs)
        out = np.empty(len(some.time))
        _response(
            some.time, some.time[0] + since, before, after / before, ratio, distance, stiffness, law == "slip", out
        )
        return np.column_stack([out, np.ones(len(out)), ways])

    def parameters(c: Array, shape: Array) -> dict[str, float]:
        a, b = c[0] / normal, c[0] / normal * shape[0]
        return {
            "friction": c[1] / normal, "direct": a, "evolution": b, "rate_dependence": a - b, "distance": shape[1],
            "stiffness": c[0] * shape[2], "trend": c[2] / normal,
        }  # fmt: skip

    def made(found: dict[str, float]) -> RateState:
        values = {name: found[name] for name in ("friction", "direct", "evolution", "distance")}
        return RateState(normal, reference=before, law=law, **values)

    def starts(some: Samples) -> tuple[Array, Array, Array, Array]:
        slid, grain = float(np.ptp(ways)), after * float(np.median(np.diff(some.time)))
        lengths = np.log(np.geomspace(4 * grain, slid / 4, DISTANCES))
        stiff = np.log(np.geomspace(4 / slid, 1 / (2 * grain), STIFFNESSES))
        return np.log(RATIOS), lengths, stiff, np.log([step_time - some.time[0]])

    formula = (
        f"f = normal (friction + direct ln(v/V1) + evolution ln(V1 age/distance) + trend x), the {law} law, behind a "
        f"spring of that stiffness, V1 = {before:.3g} m/s, then {after:.3g} m/s"
    )
    return Family(formula, "t", columns, parameters, UNITS, made, starts)


def step_of(samples: Samples) -> tuple[float, float, float]:
    """Time of the drive's step, and its speed before and after: the two straight lines that its displacement follows.

    Raises
    ------
    EstimateError
        One speed alone, or a motion that does not go one way.
    """
    time, x = samples.time - samples.time[0], samples.displacement
    best, least = (0.0, 0.0, 0.0), np.inf
    low, high = time[-1] * 0.005, time[-1] * 0.995
    for _ in range(6):  # a search of the corner, each time ten times finer
        grid = np.linspace(low, high, 25)
        for corner in grid:
            lines = np.column_stack([np.ones(len(x)), time, np.maximum(time - corner, 0)])
            found = np.linalg.lstsq(lines, x, rcond=None)[0]
            left = x - lines @ found
            if float(left @ left) < least:
                best, least = (float(corner), float(found[1]), float(found[1] + found[2])), float(left @ left)
        width = 1.5 * (grid[1] - grid[0])
        low, high = max(best[0] - width, 0.0), min(best[0] + width, time[-1])
    corner, before, after = best
    if np.ptp(x) > LEAST_WAY * abs(x[-1] - x[0]):
        raise EstimateError(
            "the displacement goes to and fro", "a velocity step goes forward: steady sliding one way, then faster or "
            "slower the same way", "give such a record, or fit a curve over the speed, as stribeck",
        )  # fmt: skip
    if min(before, after) <= 0 or max(before, after) < LEAST_STEP * min(before, after):
        raise EstimateError(
            f"the driving speed goes from {before:.3g} to {after:.3g} m/s",
            f"a velocity step goes forward, and changes the speed {LEAST_STEP:g} times at least",
            "give a record with x of the drive before and after a step, both forward",
        )
    return samples.time[0] + corner, before, after
