"""What a Taylor step may do: its length, what sleeps in it, the exits it passes. Compiled, without allocation.

The coefficients come from code written for the system (`series`). Time is measured in the last step's length h, so
that coefficients neither grow nor vanish with the order.

Exits are polynomials of the same series: their first root in a step is found with the certificate of `roots`, so that
two crossings within one step are two.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from stickslip.compiled import compiled
from stickslip.solve.roots import NOISE, NONE, UNSURE, first_rise

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# No references are counted: each named array would cost two atomic operations a call.
OPTIONS = {"error_model": "numpy", "_nrt": False, "fastmath": {"contract"}}
EXACT = {"error_model": "numpy", "_nrt": False}

LINEAR, PRODUCT, SQUARE, QUOTIENT, POWER, EXP, TANH, SLOPE, LOG, ASINH = range(10)
GROWTH = 6.0  # longest step in units of the one before
STILL = 1e-10  # a power's base below this is zero: there the power is not analytic

ROW = types.float64[::1]
CODE = types.void(ROW, types.int64, ROW, types.float64, ROW)  # what fills in coefficients, see `series.expansion`


@intrinsic
def coded(_context: Any, address: Any) -> Any:
    """The function of the kind `CODE` at an address: a number is passed in no time, a function's type is not."""
    kind = types.FunctionType(CODE)

    def made(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        function = cgutils.create_struct_proxy(kind)(context, builder)
        function.c_addr = builder.inttoptr(arguments[0], cgutils.voidptr_t)
        function.py_addr = function.jit_addr = cgutils.voidptr_t(None)
        return function._getvalue()

    return kind(address), made


class Sums(NamedTuple):
    """What rounds each rate (by mode and entry) and each exit: sizes of the weights of a sum of nodes, from `first` on,
    and of its constant."""

    first: Index
    weight: Array
    node: Index
    constant: Array


class Exits(NamedTuple):
    """Node of each exit and its factor, the mode behind it, whether it is crossed; whether its instant is polished (a
    release), and whether the state is carried over by a matrix (speeds told to the last digit, memory made anew); the
    first exit of each mode."""

    node: Index
    factor: Array
    target: Index
    crossing: NDArray[np.bool_]
    polished: NDArray[np.bool_]
    carried: NDArray[np.bool_]
    reset: Array
    first: Index


class Guards(NamedTuple):
    """Functions that fall asleep (exponentials, powers near 0), their arguments' nodes, and the first of each mode."""

    kind: Index
    argument: Index
    first: Index


class Step(NamedTuple):
    """The series of a Taylor step: coefficient k of node j stands at j (order + 1) + k of `s`; and room for the
    polynomial of an exit with the noise of each coefficient."""

    s: Array
    c: Array
    noise: Array
    order: int


def room(nodes: int, order: int) -> Step:
    """Room for the series of so many nodes."""
    return Step(np.zeros(nodes * (order + 1)), np.zeros(order + 1), np.zeros(order + 1), order)


@compiled(**OPTIONS)
def value(kind, at, power):
    """A function's value: the coefficient of order 0."""
    if kind == EXP:
        return math.exp(at)
    if kind == TANH:
        return math.tanh(at)
    if kind == SLOPE:  # of tanh: 1 - tanh^2 without its cancellation
        fall = math.exp(-2.0 * abs(at))
        return 4.0 * fall / (1.0 + fall) ** 2
    if kind == LOG:
        return math.log(at) if at > 0.0 else math.nan
    if kind == ASINH:
        return math.asinh(at)
    return at**power if at > STILL else (0.0 if power > 0.0 else math.nan)


@compiled(**EXACT)
def _rate_noise(sums, row, k, h, step):
    """Noise of coefficient k > 0 of a state entry: what rounds the sum that is its rate."""
    s, width = step.s, step.order + 1
    total = sums.constant[row] if k == 1 else 0.0
    for t in range(sums.first[row], sums.first[row + 1]):
        total += sums.weight[t] * abs(s[sums.node[t] * width + k - 1])
    return NOISE * total * h / k


@compiled(**EXACT)
def _exit_noise(sums, row, rates, k, h, big, step):
    """Noise of coefficient k of an exit; the rates' sums of its mode begin at row `rates`."""
    s, width = step.s, step.order + 1
    total = NOISE * 1e-2 * sums.constant[row] if k == 0 else 0.0
    for t in range(sums.first[row], sums.first[row + 1]):
        i = sums.node[t]
        if i >= len(big):
            noise = NOISE * abs(s[i * width + k])
        else:
            noise = NOISE * 1e-2 * big[i] if k == 0 else _rate_noise(sums, rates + i, k, h, step)
        total += sums.weight[t] * noise
    return total


@compiled(**EXACT)
def surely_below(s, start, top, sign, level, u):
    """Whether sign * polynomial stays below a level up to u, by its coefficients alone."""
    total, power = sign * s[start] - level, 1.0
    for k in range(1, top + 1):
        power *= u
        total += max(sign * s[start + k], 0.0) * power
    return total < 0.0


@compiled(**EXACT)
def length(s, order, big, tolerance):
    """Step in units of h at which the last two terms of every entry are its tolerance."""
    width = order + 1
    last, before = 0.0, 0.0
    for i in range(len(big)):
        j = i * width
        scale = max(big[i], 1e-3 * (abs(s[j + 1]) + abs(s[j + 2])))
        if scale > 0.0:
            inverse = 1.0 / scale
            last = max(last, abs(s[j + order]) * inverse)
            before = max(before, abs(s[j + order - 1]) * inverse)
        elif s[j + 1] != s[j + 1]:
            return math.nan
    if not (last + before < math.inf):
        return math.nan
    grow = math.log(GROWTH)
    if last > 0.0:
        grow = min(grow, math.log(tolerance / last) / order)
    if before > 0.0:
        grow = min(grow, math.log(tolerance / before) / (order - 1))
    return math.exp(grow)


@compiled(**EXACT)
def awake(kind, at, asleep):
    """Whether a function's series knows of what is ahead: it is no saturated exponential and no power of nothing."""
    if kind == POWER:
        return False
    return (abs(at) < 0.5 * asleep + 0.25) if kind == TANH else at > -asleep - 0.25


@compiled(**EXACT)
def waking(kind, at, asleep):
    """Distance of zero from where a sleeping function wakes, and the sign of its argument's way there."""
    if kind == POWER:
        return (-2.0 * STILL, 1.0) if at <= STILL else (0.5 * STILL, -1.0)
    if kind == TANH:
        return 0.5 * asleep, (-1.0 if at > 0.0 else 1.0)
    return asleep, 1.0


@compiled(**EXACT)
def woken(kind, a, u, asleep, step):
    """The step, shortened to where a sleeping function wakes: its series does not know of it until then; -1: unsure."""
    s, c, noise, order = step
    level, sign = waking(kind, s[a], asleep)
    if surely_below(s, a, order - 1, sign, -level, u):
        return u
    power = 1.0
    for k in range(order):
        c[k], noise[k] = sign * s[a + k] * power, 0.0
        power *= u
    c[0] += level
    at = first_rise(c, noise, order, 0, 1.0, 0.0, 1.0)
    if at == UNSURE:
        return -1.0
    return u if at == NONE else u * at


@compiled(**OPTIONS)
def advance(s, order, u, state):
    """The state at u by Horner's rule."""
    for i in range(len(state)):
        j = i * (order + 1)
        total = s[j + order]
        for k in range(order - 1, -1, -1):
            total = total * u + s[j + k]
        state[i] = total


@compiled(**EXACT)
def resolved(s, start, top, floor, u):
    """The step, shortened until the last two terms are small beside the largest, or below a floor.

    A velocity that has just left zero is far below the tolerance: whether it returns must not hang on that.
    """
    while True:
        largest, power = abs(s[start]), 1.0
        for k in range(1, top - 1):
            power *= u
            largest = max(largest, abs(s[start + k]) * power)
        if not (abs(s[start + top - 1]) + abs(s[start + top]) * u) * power * u > max(1e-3 * largest, floor):
            return u
        u *= 0.8


@compiled(**EXACT)
def due(sums, exits, mode, h, big, step):
    """An exit that ends a mode at once, by its value alone; -1 where there is none."""
    for e in range(exits.first[mode], exits.first[mode + 1]):
        row = len(sums.constant) - len(exits.node) + e
        floor = _exit_noise(sums, row, mode * len(big), 0, h, big, step)
        if not exits.crossing[e] and exits.factor[e] * step.s[exits.node[e] * (step.order + 1)] > floor:
            return e
    return -1


@compiled(**EXACT)
def rise(sums, exits, e, mode, h, u, big, step):
    """When an exit ends the mode, in units of h, up to u; infinite where it does not, -1 where nothing is proved."""
    s, c, noise, order = step
    node, scale, size = exits.node[e], exits.factor[e], len(big)
    row, rates = len(sums.constant) - len(exits.node) + e, mode * size
    j, low = node * (order + 1), 0
    top = order if node < size else order - 1
    floor = _exit_noise(sums, row, rates, 0, h, big, step)
    if scale * s[j] < -floor and surely_below(s, j, top, scale, 0.0, u):
        return math.inf
    while abs(scale * s[j + low]) <= floor:
        low += 1
        if low > top:
            return math.inf
        floor = _exit_noise(sums, row, rates, low, h, big, step)
    if scale * s[j + low] > 0.0:
        return math.inf if exits.crossing[e] else 0.0
    power = 1.0
    for k in range(top + 1):
        c[k] = scale * s[j + k] * power
        noise[k] = floor * power
        power *= u
    at = first_rise(c, noise, top + 1, low, 1.0, 0.0, 1.0)
    if at == UNSURE:
        return -1.0
    return math.inf if at == NONE else at * u


@compiled(**EXACT)
def set_tones(tones, time, state):
    """The drive's tones by the clock."""
    for j in range(len(tones)):
        angle = tones[j, 2] * time + tones[j, 3]
        state[int(tones[j, 0])], state[int(tones[j, 1])] = math.cos(angle), math.sin(angle)


@compiled(**EXACT)
def turn(tones, before, ahead, state):
    """The drive's tones a time `ahead` [s] after a state: turned, because far from zero a clock tells no phase."""
    for j in range(len(tones)):
        c, s = int(tones[j, 0]), int(tones[j, 1])
        angle, length = tones[j, 2] * ahead, 1.5 - 0.5 * (before[c] * before[c] + before[s] * before[s])
        cosine, sine = length * math.cos(angle), length * math.sin(angle)
        state[c], state[s] = cosine * before[c] - sine * before[s], sine * before[c] + cosine * before[s]
