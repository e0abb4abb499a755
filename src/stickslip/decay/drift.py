"""How likely drift of a 1/f spectrum is beside white noise: restricted maximum likelihood at trial corners."""

from __future__ import annotations

import math

from stickslip.compiled import FAST, compiled
from stickslip.decay.profile import log_determinant, solve


@compiled(**FAST)
def restricted(left, jacobian, tones, corner, work):
    """Minus twice the restricted log likelihood, but for a constant, of noise of power ``s^2 (1 + corner / f)``; s^2.

    Parameters
    ----------
    left : ndarray (n,)
        Cosine transform of the residual.
    jacobian : ndarray (6, n)
        That of the motion's derivatives.
    tones : ndarray (n,)
        Frequencies [Hz].
    work : ndarray (3, 6, 6)
        Scratch.
    """
    curvature, factor, slope, step = work[0], work[1], work[2, 0], work[2, 1]
    for j in range(6):
        slope[j] = 0.0
        for k in range(6):
            curvature[j, k] = 0.0
    squares, power = 0.0, 0.0
    for i in range(left.shape[0]):
        here = 1.0 + corner / tones[i]
        power += math.log(here)
        squares += left[i] * left[i] / here
        for j in range(6):
            weighted = jacobian[j, i] / here
            slope[j] += weighted * left[i]
            for k in range(j + 1):
                curvature[j, k] += weighted * jacobian[k, i]
    for j in range(6):
        for k in range(j):
            curvature[k, j] = curvature[j, k]
    freedom = left.shape[0] - 6
    if solve(curvature, slope, step, factor, 1e-13):
        for j in range(6):
            squares -= slope[j] * step[j]
    squares /= freedom
    return freedom * math.log(squares) + power + log_determinant(curvature, factor), squares
