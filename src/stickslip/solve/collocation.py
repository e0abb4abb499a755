"""A long implicit step where a contact is stiff: collocation at Radau's points, compiled, without allocation.

The step is a polynomial of degree `STAGES` that satisfies the rates at each point (Hairer and Wanner, Solving Ordinary
Differential Equations II, section IV.8). What decays much faster than the step is damped, not followed. Drive signals
are known beforehand; their values, exits and the arguments of sleeping functions are fitted by the same polynomial.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import NDArray

from stickslip.compiled import compiled
from stickslip.solve.roots import NOISE, NONE, first_rise
from stickslip.solve.taylor import advance, awake, set_tones, waking

EXACT = {"error_model": "numpy"}
STAGES = 9
WIDTH = STAGES + 1
NEWTON = 12  # most iterations
ROUNDING = 1e-11  # most that rounding may leave of Newton's method


@cache
def method() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Radau's points in (0, 1], their matrix, and the fit of values at them by powers of w = 2 u - 1."""
    inner = (Legendre.basis(STAGES) - Legendre.basis(STAGES - 1)).roots()  # Radau's right points; the last is 1
    points = (np.sort(inner.real) + 1) / 2
    points[-1] = 1.0
    basis = [Legendre.basis(j) for j in range(STAGES)]
    values = np.column_stack([part(2 * points - 1) for part in basis])
    areas = np.column_stack([part.integ(lbnd=-1)(2 * points - 1) / 2 for part in basis])
    matrix = np.ascontiguousarray(np.linalg.solve(values.T, areas.T).T)
    fit = np.linalg.inv(np.vander(2 * np.concatenate([[0.0], points]) - 1, WIDTH, increasing=True))[:, 1:]
    return points, matrix, np.ascontiguousarray(fit)


def room(nodes: int, size: int, physical: int) -> tuple[NDArray[Any], ...]:
    """Work arrays: stages, their rates, slopes and nodes, the equations and their right side, nodes, a state."""
    unknown = STAGES * physical
    return (
        np.zeros((STAGES, size)), np.zeros((STAGES, physical)), np.zeros((STAGES, physical, physical)),
        np.zeros((STAGES, nodes)), np.zeros((unknown, unknown)), np.zeros(unknown), np.zeros(2 * nodes),
        np.zeros(size),
    )  # fmt: skip


@compiled(**EXACT)
def solve(a, b):
    """Gauss's elimination with row pivots, in place; whether it could."""
    count = len(b)
    for k in range(count):
        best = k
        for i in range(k + 1, count):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if not abs(a[best, k]) > 0.0:
            return False
        if best != k:
            for j in range(k, count):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            b[k], b[best] = b[best], b[k]
        for i in range(k + 1, count):
            factor = a[i, k] / a[k, k]
            if factor != 0.0:
                for j in range(k + 1, count):
                    a[i, j] -= factor * a[k, j]
                b[i] -= factor * b[k]
    for k in range(count - 1, -1, -1):
        for j in range(k + 1, count):
            b[k] -= a[k, j] * b[j]
        b[k] /= a[k, k]
    return True


@compiled(**EXACT)
def _slopes(rates, numbers, mode, stage, physical, face, big, value, slope, every, work, moved):
    """Rates at a stage, their derivatives by differences, and the values of all nodes."""
    rates(numbers, mode, stage, 1.0, work)
    for j in range(physical):
        value[j] = work[2 * j + 1]
    for j in range(len(every)):
        every[j] = work[2 * j]
    speed = 0.0
    for i in range(len(stage)):
        moved[i] = stage[i]
        speed += face[i] * stage[i]
    for d in range(physical):
        # friction may follow the logarithm of the velocity against the counter-face
        step = 1e-7 * abs(stage[1] - speed) + 1e-13 * big[1] if d == 1 else 1e-7 * abs(stage[d]) + 1e-10 * big[d]
        if step == 0.0:
            step = 1e-14
        moved[d] = stage[d] + step
        step = moved[d] - stage[d]
        rates(numbers, mode, moved, 1.0, work)
        moved[d] = stage[d]
        for j in range(physical):
            slope[j, d] = (work[2 * j + 1] - value[j]) / step


@compiled(**EXACT)
def settle(rates, numbers, mode, state, h, scheme, physical, face, big, tolerance, work):
    """Newton's method for the stages, which hold the drive's signals and a guess: the last change, or infinity.

    Where rounding keeps it above the tolerance (a small velocity between large forces), the change tells by how much.
    """
    _, matrix, _ = scheme
    stages, value, slope, every, a, b, one, moved = work
    change, before = math.inf, math.inf
    for iteration in range(NEWTON):
        for i in range(STAGES):
            _slopes(rates, numbers, mode, stages[i], physical, face, big, value[i], slope[i], every[i], one, moved)
        for i in range(STAGES):
            for j in range(physical):
                row, total = i * physical + j, 0.0
                for m in range(STAGES):
                    total += matrix[i, m] * value[m, j]
                    for d in range(physical):
                        a[row, m * physical + d] = -h * matrix[i, m] * slope[m, j, d]
                a[row, row] += 1.0
                b[row] = stages[i, j] - state[j] - h * total
        if not solve(a, b):
            return math.inf
        change = 0.0
        for i in range(STAGES):
            for j in range(physical):
                stages[i, j] -= b[i * physical + j]
                change = max(change, abs(b[i * physical + j]) / max(big[j], 1e-300))
        if change <= max(1e-2 * tolerance, 1e-15):
            return change
        if not change < math.inf or (iteration > 3 and change > 0.5 * before):
            break
        before = change
    return max(change, before) if max(change, before) <= max(tolerance, ROUNDING) else math.inf


@compiled(**EXACT)
def fitted(values, column, start, fit, c):
    """Powers of w of the polynomial through a start and the values at the stages."""
    for k in range(WIDTH):
        total = 0.0
        for i in range(STAGES):
            total += fit[k, i] * (values[i, column] - start)
        c[k] = total
    c[0] += start


@compiled(**EXACT)
def growth(c, size, big, tolerance):
    """Step in units of this one at which the last two Chebyshev terms of every entry are its tolerance."""
    last, before = 0.0, 0.0
    for i in range(size):
        scale = max(big[i], abs(at(c[i], 1.0)))
        if scale > 0.0:
            last = max(last, abs(c[i, STAGES]) / scale)
            before = max(before, abs(c[i, STAGES - 1]) / scale)
    last, before = last / 2.0 ** (STAGES - 1), before / 2.0 ** (STAGES - 2)
    if not last + before < math.inf:
        return 0.0
    grow = math.log(5.0)
    if last > 0.0:
        grow = min(grow, math.log(tolerance / last) / STAGES)
    if before > 0.0:
        grow = min(grow, math.log(tolerance / before) / (STAGES - 1))
    return 0.9 * math.exp(grow)


@compiled(**EXACT)
def at(c, w):
    """A polynomial of w."""
    total = 0.0
    for k in range(STAGES, -1, -1):
        total = total * w + c[k]
    return total


@compiled(**EXACT)
def leap(
    rates, numbers, scheme, tones, face, mode, time, state, h, unit, s, width, physical, big, tolerance, poly, work
):
    """A step of length h as polynomials of w, and the length of the next in units of h; 0 where it failed.

    `s` is the Taylor series at the start in units of `unit`: the drive's signals are polynomials, or tones.
    """
    points, _, fit = scheme
    stages, size = work[0], len(state)
    for i in range(STAGES):
        advance(s, width, size, width - 1, points[i] * h / unit, stages[i])
        set_tones(tones, time + points[i] * h, stages[i])
        for j in range(physical):
            stages[i, j] = state[j]
    change = settle(rates, numbers, mode, state, h, scheme, physical, face, big, tolerance, work)
    if change == math.inf:
        return 0.0
    for j in range(size):
        fitted(stages, j, state[j], fit, poly[j])
    return growth(poly, size, big, max(tolerance, 10.0 * change))


@compiled(**EXACT)
def _fitted_node(node, size, s, width, fit, work, c):
    """Powers of w of any kept node."""
    fitted(work[0] if node < size else work[3], node, s[node * width], fit, c)


@compiled(**EXACT)
def landing(mode, exits, guards, scheme, s, width, size, big, asleep, work, c, noise):
    """Where a leap ends, as w, and by which exit (-1 where by none): an exit, or a sleeping function that wakes."""
    node, _, _, _, bound, _, scale = exits
    kind, argument, mind = guards
    fit, end, leaving = scheme[2], 1.0, -1
    for g in range(mind[mode], mind[mode + 1]):
        start = s[argument[g] * width]
        if not awake(kind[g], start, asleep):
            _fitted_node(argument[g], size, s, width, fit, work, c)
            level, sign = waking(kind[g], start, asleep)
            for k in range(WIDTH):
                c[k] *= sign
            c[0] += level
            noise[0] = 0.0
            w = first_rise(c, noise, WIDTH, 0, 1.0, -1.0, 1.0)
            end = end if w == NONE else min(end, w)
    for e in range(bound[mode], bound[mode + 1]):
        _fitted_node(node[e], size, s, width, fit, work, c)
        most = big[node[e]] if node[e] < size else 0.0
        for k in range(WIDTH):
            c[k] *= scale[e]
            most = max(most, abs(c[k]))
        noise[0] = NOISE * most
        if at(c, -1.0) >= -noise[0]:  # too near for a leap
            return -1.0, -1
        w = first_rise(c, noise, WIDTH, 0, 1.0, -1.0, end)
        if w != NONE and (w < end or leaving < 0):
            end, leaving = w, e
    return end, leaving
