"""Best fit and profile likelihood where the likelihood is more than a sum of squares: other noise, several releases.

An objective gives minus twice the log likelihood at some parameters, half its downhill slope, and half its curvature
(Gauss and Newton's part). The steps are those of :mod:`stickslip.decay.profile`, which does the same for the plain case
in compiled form.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Objective = Callable[[Array], tuple[float, Array, Array]]

CLOSE = 1e-4  # what minus twice the log likelihood may still fall
STEPS = 60
PATIENCE = 10  # steps after which an end should be near


def solve(curvature: Array, right: Array, extra: float = 0.0) -> Array:
    """Solution of (curvature + extra diag(curvature)) x = right, its rows and columns brought to one scale first."""
    scale = 1 / np.sqrt(np.maximum(np.diag(curvature), 1e-300))
    scaled = curvature * np.outer(scale, scale) + (extra + 1e-13) * np.eye(len(scale))
    return np.asarray(scale * np.linalg.solve(scaled, scale * right))


def minimise(objective: Objective, start: Array, farthest: Array) -> tuple[Array, float, Array]:
    """Parameters, value and curvature at the minimum, from `start` in steps no longer than `farthest` each."""
    p, extra = start.copy(), 0.0
    value, slope, curvature = objective(p)
    for _ in range(STEPS):
        step = solve(curvature, slope, extra)
        step *= min(1.0, float(np.min(farthest / np.maximum(np.abs(step), 1e-300))))
        fall = float(step @ slope)
        now, next_slope, next_curvature = objective(p + step)
        if now <= value:
            p = p + step
            value, slope, curvature, extra = now, next_slope, next_curvature, 0.1 * extra if extra > 1e-3 else 0.0
            if fall < CLOSE:
                break
        else:
            extra = max(4 * extra, 1e-3)
            if fall < CLOSE or extra > 1e6:
                break
    return p, value, curvature


def extreme(objective: Objective, best: Array, value: float, which: int, side: int, level: float) -> Array | None:
    """Where a parameter is extreme (`side` +1, -1) among all that reach `level`; None if that is not found."""
    p = best.copy()
    aim = np.zeros(len(p))
    aim[which] = 1.0
    for count in range(STEPS):
        now, slope, curvature = objective(p)
        step, across = solve(curvature, slope), solve(curvature, aim)
        room = max(level - now + float(step @ slope), 0.0)
        whole = np.sqrt((level - value) * across[which])
        step = step + side * np.sqrt(room / across[which]) * across
        move = abs(step[which])
        shorter = 1.0 / (1 + count // 6)  # lest it jump about
        p = p + step * min(shorter, 2 * whole / max(move, 1e-300))
        if not np.all(np.isfinite(p)) or (count >= PATIENCE and now - level > level - value):
            return None
        if move < 5e-3 * whole and abs(now - level) < 0.05 * (level - value):
            return np.asarray(p)
    return None
