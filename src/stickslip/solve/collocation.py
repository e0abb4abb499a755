"""A long implicit step where a contact is stiff: collocation at Radau's points, compiled, without allocation.

The step is a polynomial of degree `STAGES` that satisfies the rates at each point (Hairer and Wanner, Solving Ordinary
Differential Equations II, section IV.8). What decays much faster than the step is damped, not followed. Drive signals
are known beforehand; their values, exits and the arguments of sleeping functions are fitted by the same polynomial.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Legendre

from stickslip.arrays import Array
from stickslip.compiled import compiled
from stickslip.solve.roots import NOISE, NONE, UNSURE, first_rise
from stickslip.solve.taylor import (
    EXACT,
    Exits,
    Guards,
    Sums,
    advance,
    awake,
    coded,
    turn,
    waking,
)

STAGES = 9  # Radau's: exact to order 17, near the 14 and 18 of the Taylor steps that a leap replaces
WIDTH = STAGES + 1
NEWTON = 12  # most iterations
ROUNDING = 1e-11  # most that rounding may leave of Newton's method


class Scheme(NamedTuple):
    """Radau's points in (0, 1], their matrix, and the fit of values at them by powers of w = 2 u - 1."""

    points: Array
    matrix: Array
    fit: Array


class Model(NamedTuple):
    """A curved system as the march reads it: code of its Taylor coefficients by address, with their numbers, what
    rounds, exits, what may sleep, the drive's tones and period [s], the tolerance of a step and its order."""

    series: int
    numbers: Array
    sums: Sums
    exits: Exits
    guards: Guards
    tones: Array
    period: float
    tolerance: float
    order: int


class Implicit(NamedTuple):
    """A curved system as leaps read it: also code of the rates alone, the method, for each degree of freedom
    the velocity that goes with the counter-face, and entries that are no signals."""

    model: Model
    rates: int
    scheme: Scheme
    faces: Array
    physical: int


class Stages(NamedTuple):
    """Work arrays of a leap: its stages, their rates, slopes and nodes, the equations and their right side, nodes and
    rates of one state, and a state."""

    values: Array
    rates: Array
    slopes: Array
    nodes: Array
    matrix: Array
    right: Array
    one: Array
    moved: Array


@cache
def method() -> Scheme:
    """The collocation of `STAGES` points."""
    inner = (Legendre.basis(STAGES) - Legendre.basis(STAGES - 1)).roots()  # Radau's right points; the last is 1
    points = (np.sort(inner.real) + 1) / 2
    points[-1] = 1.0
    basis = [Legendre.basis(j) for j in range(STAGES)]
    values = np.column_stack([part(2 * points - 1) for part in basis])
    areas = np.column_stack([part.integ(lbnd=-1)(2 * points - 1) / 2 for part in basis])
    matrix = np.ascontiguousarray(np.linalg.solve(values.T, areas.T).T)
    fit = np.linalg.inv(np.vander(2 * np.concatenate([[0.0], points]) - 1, WIDTH, increasing=True))[:, 1:]
    return Scheme(points, matrix, np.ascontiguousarray(fit))


def room(nodes: int, size: int, physical: int) -> Stages:
    """Room for a leap of a system of so many nodes and entries."""
    unknown = STAGES * physical
    return Stages(
        values=np.zeros((STAGES, size)),
        rates=np.zeros((STAGES, physical)),
        slopes=np.zeros((STAGES, physical, physical)),
        nodes=np.zeros((STAGES, nodes)),
        matrix=np.zeros((unknown, unknown)),
        right=np.zeros(unknown),
        one=np.zeros(2 * nodes),
        moved=np.zeros(size),
    )


@compiled(**EXACT)
def solve(a, b):
    """Gauss's elimination with row pivots, in place: a is (n, n), b (n,) becomes the solution; whether it could."""
    count = len(b)
    for k in range(count):
        # Pivot: the column's largest; where that is zero or no number there is no solution.
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
        # Eliminate below; many factors are zero, as entries do not all depend on one another.
        for i in range(k + 1, count):
            factor = a[i, k] / a[k, k]
            if factor != 0.0:
                for j in range(k + 1, count):
                    a[i, j] -= factor * a[k, j]
                b[i] -= factor * b[k]
    # Substitute back.
    for k in range(count - 1, -1, -1):
        for j in range(k + 1, count):
            b[k] -= a[k, j] * b[j]
        b[k] /= a[k, k]
    return True


@compiled(**EXACT)
def _slopes(implicit, mode, i, big, stages):
    """Rates at stage i, their derivatives by differences, and the values of all nodes; `big` (N,) is what each entry of
    the state is measured by."""
    rates = coded(implicit.rates)
    numbers, physical = implicit.model.numbers, implicit.physical
    stage, value, slope, nodes = stages.values[i], stages.rates[i], stages.slopes[i], stages.nodes[i]
    work, moved = stages.one, stages.moved
    # a series of order one: value and rate of each node side by side
    rates(numbers, mode, stage, 1.0, work)
    for j in range(physical):
        value[j] = work[2 * j + 1]
    for j in range(len(nodes)):
        nodes[j] = work[2 * j]
    degrees = len(implicit.faces)
    for j in range(len(stage)):
        moved[j] = stage[j]
    for d in range(physical):
        # friction may follow the logarithm of the velocity against the counter-face, or its direction
        if degrees <= d < 2 * degrees:
            step = 1e-7 * abs(stage[d] - _faced(implicit.faces[d - degrees], stage)) + 1e-13 * big[d]
        else:
            step = 1e-7 * abs(stage[d]) + 1e-10 * big[d]
        # an entry that is zero and always was
        if step == 0.0:
            step = 1e-14
        moved[d] = stage[d] + step
        # by what the entry has really moved: the sum was rounded
        step = moved[d] - stage[d]
        rates(numbers, mode, moved, 1.0, work)
        moved[d] = stage[d]
        for j in range(physical):
            slope[j, d] = (work[2 * j + 1] - value[j]) / step


@compiled(**EXACT)
def settle(implicit, mode, state, h, big, stages):
    """Newton's method for the stages, which hold the drive's signals and a guess: the last change, or infinity.

    Where rounding keeps it above the tolerance (a small velocity between large forces), the change tells by how much.
    `state` is (N,), `h` the step [s], `big` (N,) what each entry is measured by.
    """
    matrix, physical, tolerance = implicit.scheme.matrix, implicit.physical, implicit.model.tolerance
    a, b, change, before = stages.matrix, stages.right, math.inf, math.inf
    for iteration in range(NEWTON):
        for i in range(STAGES):
            _slopes(implicit, mode, i, big, stages)
        # Equations: Y_i - y - h sum_m a_im f(Y_m) = 0, with the derivative I - h a_im f'(Y_m).
        for i in range(STAGES):
            for j in range(physical):
                row, total = i * physical + j, 0.0
                for m in range(STAGES):
                    total += matrix[i, m] * stages.rates[m, j]
                    for d in range(physical):
                        a[row, m * physical + d] = -h * matrix[i, m] * stages.slopes[m, j, d]
                a[row, row] += 1.0
                b[row] = stages.values[i, j] - state[j] - h * total
        # Step, and its largest change in units of each entry.
        if not solve(a, b):
            return math.inf
        change = 0.0
        for i in range(STAGES):
            for j in range(physical):
                moved = abs(b[i * physical + j]) / max(big[j], 1e-300)
                if not moved < math.inf:  # no number: a larger one would hide it
                    return math.inf
                stages.values[i, j] -= b[i * physical + j]
                change = max(change, moved)
        # done: the next change would be smaller still, by far
        if change <= max(1e-2 * tolerance, 1e-15):
            return change
        # no longer halved: rounding is all that is left, or the guess was too far off
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
def growth(c, big, tolerance):
    """Step in units of this one at which the last two Chebyshev terms of every entry are its tolerance; `c` is
    (N, WIDTH), `big` (N,)."""
    last, before = 0.0, 0.0
    for i in range(len(big)):
        scale = max(big[i], abs(at(c[i], 1.0)))
        if scale > 0.0:
            last = max(last, abs(c[i, STAGES]) / scale)
            before = max(before, abs(c[i, STAGES - 1]) / scale)
    # the power w^n has 2^(n-1) times the coefficient of T_n; two terms, as one alone may vanish by parity
    last, before = last / 2.0 ** (STAGES - 1), before / 2.0 ** (STAGES - 2)
    if not last + before < math.inf:
        return 0.0
    grow = math.log(5.0)
    # term n goes with the n-th power of the step; at most five times as long, less a tenth for safety
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
def _faced(face, state):
    """The counter-face's velocity."""
    total = 0.0
    for i in range(len(state)):
        total += face[i] * state[i]
    return total


@compiled(**EXACT)
def leap(implicit, mode, unit, state, big, h, poly, work):
    """A step of length h [s] as polynomials of w, and the length of the next in units of h; 0 where it failed.

    `unit` is that of the Taylor series [s]: the drive's signals are polynomials, or tones. `state` and `big` are (N,),
    `poly` (N, WIDTH).
    """
    step, stages, scheme, model = work.step, work.stages, implicit.scheme, implicit.model
    # Guess: the drive's signals are true at each stage, masses and memory as they are now.
    for i in range(STAGES):
        advance(step.s, step.order, scheme.points[i] * h / unit, stages.values[i])
        turn(model.tones, state, scheme.points[i] * h, stages.values[i])
        for j in range(implicit.physical):
            stages.values[i, j] = state[j]
        # the slip of now, however fast the counter-face: friction may follow the logarithm of it
        for j in range(len(implicit.faces)):
            face = implicit.faces[j]
            stages.values[i, len(implicit.faces) + j] += _faced(face, stages.values[i]) - _faced(face, state)
    change = settle(implicit, mode, state, h, big, stages)
    if change == math.inf:
        return 0.0
    # Polynomials, of the signals too: exits and outputs are forms of all.
    for j in range(len(state)):
        fitted(stages.values, j, state[j], scheme.fit, poly[j])
    return growth(poly, big, max(model.tolerance, 10.0 * change))


@compiled(**EXACT)
def _fitted_node(node, size, fit, work):
    """Powers of w of any kept node, in the room for an exit."""
    step, stages = work.step, work.stages
    fitted(stages.values if node < size else stages.nodes, node, step.s[node * (step.order + 1)], fit, step.c)


@compiled(**EXACT)
def landing(implicit, mode, big, work):
    """Where a leap ends, as w from -1 to 1, and by which exit (-1 where by none): an exit, or a sleeping function that
    wakes; from -1 to -1 where that is not proved. `big` is (N,)."""
    model, fit, step = implicit.model, implicit.scheme.fit, work.step
    exits, guards = model.exits, model.guards
    c, noise, size, asleep = step.c, step.noise, len(big), 4.0 - math.log(model.tolerance)
    end, leaving = 1.0, -1
    # Wake: the stages do not know what a sleeping function does once it is awake.
    for g in range(guards.first[mode], guards.first[mode + 1]):
        start = step.s[guards.argument[g] * (step.order + 1)]
        if not awake(guards.kind[g], start, asleep):
            _fitted_node(guards.argument[g], size, fit, work)
            level, sign = waking(guards.kind[g], start, asleep)
            for k in range(WIDTH):
                c[k] *= sign
            c[0] += level
            noise[0] = 0.0
            w = first_rise(c, noise, WIDTH, 0, 1.0, -1.0, 1.0)
            if w == UNSURE:
                return -1.0, -1
            end = end if w == NONE else min(end, w)
    # Exit: the first rise of any, no later than the end so far.
    for e in range(exits.first[mode], exits.first[mode + 1]):
        node = exits.node[e]
        _fitted_node(node, size, fit, work)
        # the rounding of the fit goes with the largest of entry and terms
        most = big[node] if node < size else 0.0
        for k in range(WIDTH):
            c[k] *= exits.factor[e]
            most = max(most, abs(c[k]))
        noise[0] = NOISE * most
        if at(c, -1.0) >= -noise[0]:  # too near for a leap
            return -1.0, -1
        w = first_rise(c, noise, WIDTH, 0, 1.0, -1.0, end)
        if w == UNSURE:
            return -1.0, -1
        if w != NONE and (w < end or leaving < 0):
            end, leaving = w, e
    return end, leaving
