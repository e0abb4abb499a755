"""Taylor series: their coefficients as straight-line code, written for one system, compiled, and kept on disk.

A tape is a list of nodes; node j is a function of earlier ones (Jorba and Zou, Experimental Mathematics 14, 2005).
Its first nodes are the entries of the state, whose coefficient k + 1 is the coefficient k of their rate over k + 1.
Its numbers (weights, constants, exponents) are arguments of the code: laws that differ by them alone share it.

What a step may do is compiled without allocation: its length, what sleeps in it, the exits it passes. Time is measured
in the last step's length h, so that coefficients neither grow nor vanish with the order. Exits are polynomials of the
same series: their first root in a step is found with the certificate of `roots`, so that two crossings within one
step are two.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array, Index, Mask
from stickslip.compiled import Intrinsic, compiled, generated
from stickslip.solve.roots import NOISE, NONE, UNSURE, first_rise

# No references are counted: each named array would cost two atomic operations a call.
OPTIONS = {"error_model": "numpy", "_nrt": False, "fastmath": {"contract"}}
EXACT = {"error_model": "numpy", "_nrt": False}

LINEAR, PRODUCT, SQUARE, QUOTIENT, POWER, EXP, TANH, SLOPE, LOG, ASINH = range(10)
GROWTH = 6.0  # longest step in units of the one before
STILL = 1e-10  # a power's base below this is zero: there the power is not analytic

Number = tuple[int, ...]
HEAD = '''"""Taylor coefficients of one kind of system; written by `stickslip.solve.taylor`."""

from stickslip.compiled import pointer
from stickslip.solve.straight import CODE, straight

'''
SHELL = """
@pointer(CODE, error_model="numpy")
def series(q, mode, y, h, s):"""

coded: Any = Intrinsic("stickslip.solve.straight", "coded")


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
    crossing: Mask
    polished: Mask
    carried: Mask
    reset: Array
    first: Index


class Guards(NamedTuple):
    """Functions that fall asleep (exponentials, powers near 0), their arguments' nodes, and the first of each mode."""

    kind: Index
    argument: Index
    first: Index


class Step(NamedTuple):
    """The series of a Taylor step: coefficient k of node j stands at j (order + 1) + k of `s`; and room for the
    polynomial of an exit with the noise of each coefficient, and for a state."""

    s: Array
    c: Array
    noise: Array
    before: Array
    order: int


def room(nodes: int, order: int, size: int) -> Step:
    """Room for the series of so many nodes, of a state of so many entries."""
    return Step(np.zeros(nodes * (order + 1)), np.zeros(order + 1), np.zeros(order + 1), np.zeros(size), order)


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
    """Step in units of h at which the last two terms of every entry are its tolerance; `s` as in `Step`, `big` (N,)."""
    width = order + 1
    last, before = 0.0, 0.0
    for i in range(len(big)):
        j = i * width
        if not abs(s[j + order - 1]) + abs(s[j + order]) < math.inf:  # no number: a larger one would hide it
            return math.nan
        # what begins at zero is measured by a thousandth of its first terms, too
        scale = max(big[i], 1e-3 * (abs(s[j + 1]) + abs(s[j + 2])))
        if scale > 0.0:
            inverse = 1.0 / scale
            last = max(last, abs(s[j + order]) * inverse)
            before = max(before, abs(s[j + order - 1]) * inverse)
    if not (last + before < math.inf):
        return math.nan
    # both: one alone may vanish by parity; term n goes with the n-th power of the step
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
    s, c, noise, order = step.s, step.c, step.noise, step.order
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
    """When an exit ends the mode, in units of h [s], up to u; infinite where it does not, -1 where nothing is proved.

    `big` (N,) is what each entry of the state is measured by.
    """
    s, c, noise, order = step.s, step.c, step.noise, step.order
    node, scale, size = exits.node[e], exits.factor[e], len(big)
    row, rates = len(sums.constant) - len(exits.node) + e, mode * size
    j, low = node * (order + 1), 0
    top = order if node < size else order - 1
    floor = _exit_noise(sums, row, rates, 0, h, big, step)
    # Below: shown by the coefficients alone, at a fraction of the cost.
    if scale * s[j] < -floor and surely_below(s, j, top, scale, 0.0, u):
        return math.inf
    # Tie: leading coefficients within their noise are zeros; the first that is not decides (rules of roots).
    while abs(scale * s[j + low]) <= floor:
        low += 1
        if low > top:
            return math.inf
        floor = _exit_noise(sums, row, rates, low, h, big, step)
    if scale * s[j + low] > 0.0:
        return math.inf if exits.crossing[e] else 0.0
    # Root: the first, in units of the step, the zeros at the start divided out.
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


class Nodes(NamedTuple):
    """A tape: of each node its operation, operands, exponent, first weight and constant; the weights and their nodes;
    the first node of each mode; and node and factor of each state entry's rate, by mode."""

    kinds: Index
    left: Index
    right: Index
    power: Array
    low: Index
    weights: Array
    terms: Index
    constant: Array
    first: Index
    rate: Index
    factor: Array

    @property
    def most(self) -> int:
        """Nodes of the mode that has most."""
        return int(np.max(np.diff(self.first)))


class Structure(NamedTuple):
    """A tape without its numbers, and the nodes whose coefficients are kept, by mode."""

    kinds: Number
    left: Number
    right: Number
    low: Number
    terms: Number
    first: Number
    rate: tuple[Number, ...]
    kept: tuple[Number, ...]


def expansion(nodes: Nodes, kept: tuple[Number, ...], order: int) -> tuple[int, Array]:
    """Address of compiled code that fills a work array with coefficients 0 .. `order`, and its numbers.

    It takes the numbers, the mode, the state, the unit of time and the work array; coefficient k of node j stands at
    j (order + 1) + k. The state's are complete, other nodes lack the last (but have that of order 0).
    """
    low = nodes.low
    parts = [
        np.concatenate([nodes.weights[low[a] : low[b]], nodes.constant[a:b], nodes.power[a:b], nodes.factor[mode]])
        for mode, (a, b) in enumerate(itertools.pairwise(nodes.first))
    ]
    numbers = np.zeros((len(parts), max(map(len, parts))))
    for row, part in zip(numbers, parts, strict=True):
        row[: len(part)] = part
    columns = (nodes.kinds, nodes.left, nodes.right, low, nodes.terms, nodes.first)
    rate = tuple(map(tuple, nodes.rate.tolist()))
    structure = Structure._make([*(tuple(column.tolist()) for column in columns), rate, kept])
    return _compiled(structure, order, numbers.shape[1]), numbers.ravel()


@cache
def _compiled(structure: Structure, order: int, stride: int) -> int:
    return int(generated(source(structure, order, stride)).series.address)


def source(structure: Structure, order: int, stride: int) -> str:
    """The text of the module that :func:`expansion` compiles."""
    modes: dict[tuple[str, ...], list[int]] = {}
    for mode in range(len(structure.rate)):
        modes.setdefault(tuple(_Writer(structure, mode, order).lines()), []).append(mode)
    text, choice = [HEAD], []
    for lines, having in modes.items():
        text.append('mode_{} = straight("""\n{}\n""")\n'.format(having[0], "\n".join(lines)))
        choice.append(f"    if {' or '.join(f'mode == {mode}' for mode in having)}:")
        choice.append(f"        mode_{having[0]}(q[{stride} * mode :], y, h, s)")
    return "\n".join([*text, SHELL, *choice, ""])


class _Writer:
    """Writes the coefficients of one mode, each as a variable of its own; those known to vanish have none."""

    def __init__(self, structure: Structure, mode: int, order: int) -> None:
        self.tape, self.mode, self.order = structure, mode, order
        self.begin, self.end = structure.first[mode : mode + 2]
        self.size = len(structure.rate[mode])
        self.weights = structure.low[self.end] - structure.low[self.begin]
        self.text: list[str] = []
        self.read: set[int] = set()
        self.named: dict[tuple[int, int], str] = {}
        self.multiples: dict[tuple[int, int], str] = {}
        self.writers: dict[int, Callable[[int, int, int, int], str | None]] = {
            LINEAR: self.linear, PRODUCT: self.product, SQUARE: self.square, QUOTIENT: self.quotient, EXP: self.exp,
            TANH: self.tanh, SLOPE: self.slope, POWER: self.power, LOG: self.log, ASINH: self.log,
        }  # fmt: skip

    def lines(self) -> list[str]:
        """The code."""
        rates = self.tape.rate[self.mode]
        for i in range(self.size):
            self.name(i, 0, f"y[{i}]")
            if rates[i] >= 0:
                self.text.append(f"d{i} = h * {self.number(2, i)}")
        for k in range(self.order + 1):
            for i in range(self.size):
                if k and self.at(rates[i], k - 1):
                    self.name(i, k, f"{self.at(rates[i], k - 1)} * (d{i} * {1 / k!r})")
            if k < max(self.order, 1):
                for j in range(self.size, self.end - self.begin):
                    g = self.begin + j
                    a, b = self.tape.left[g], self.tape.right[g]
                    self.name(j, k, self.writers[self.tape.kinds[g]](j, k, a, b))
        for j in (*range(self.size), *self.tape.kept[self.mode]):
            for k in range(self.order + 1 if j < self.size else max(self.order, 1)):
                self.text.append(f"s[{j * (self.order + 1) + k}] = {self.at(j, k) or 0.0}")
        return self.text

    def number(self, column: int, j: int) -> str:
        """The constant (column 0), the exponent (1) or the factor (2) that belongs to a node."""
        return self.loaded(self.weights + column * (self.end - self.begin) + j)

    def loaded(self, place: int) -> str:
        """A number of the mode, read once."""
        if place not in self.read:
            self.read.add(place)
            self.text.append(f"q{place} = q[{place}]")
        return f"q{place}"

    def name(self, j: int, k: int, text: str | None) -> None:
        """Coefficient k of node j is this text."""
        if text:
            self.named[j, k] = f"x{j}_{k}"
            self.text.append(f"x{j}_{k} = {text}")

    def at(self, j: int, k: int) -> str | None:
        """The variable of coefficient k of node j; None where it vanishes."""
        return self.named.get((j, k))

    def multiple(self, j: int, k: int) -> str | None:
        """k times coefficient k of node j: a derivative's."""
        if k > 1 and self.at(j, k) and (j, k) not in self.multiples:
            self.multiples[j, k] = f"e{j}_{k}"
            self.text.append(f"e{j}_{k} = {float(k)} * {self.at(j, k)}")
        return self.multiples.get((j, k), self.at(j, k))

    def inverse(self, j: int, text: str) -> None:
        """What node j divides by, once."""
        self.text.append(f"r{j} = {text}")

    def linear(self, j: int, k: int, a: int, b: int) -> str | None:
        low = self.tape.low[self.begin]
        g = self.begin + j
        terms = [
            f"{self.loaded(t - low)} * {self.at(self.tape.terms[t], k)}"
            for t in range(self.tape.low[g], self.tape.low[g + 1])
            if self.at(self.tape.terms[t], k)
        ]
        return _sum([self.number(0, j), *terms] if k == 0 else terms)

    def product(self, j: int, k: int, a: int, b: int) -> str | None:
        return _sum(_times(self.at(a, i), self.at(b, k - i)) for i in _inward(0, k))

    def square(self, j: int, k: int, a: int, b: int) -> str | None:
        pairs = _sum(_times(self.at(a, i), self.at(a, k - i)) for i in reversed(range((k + 1) // 2)))
        middle = _times(self.at(a, k // 2), self.at(a, k // 2)) if k % 2 == 0 else None
        return _sum([_times("2.0", pairs), middle])

    def quotient(self, j: int, k: int, a: int, b: int) -> str | None:
        if k == 0:
            self.inverse(j, f"1.0 / {self.at(b, 0)}")
        rest = _sum(_times(self.at(j, i), self.at(b, k - i)) for i in _inward(0, k - 1))
        return _times(_difference(self.at(a, k), rest), f"r{j}")

    def exp(self, j: int, k: int, a: int, b: int) -> str | None:
        return self.integral("exp", j, k, a, j)

    def tanh(self, j: int, k: int, a: int, b: int) -> str | None:
        return self.integral("tanh", j, k, a, b)

    def integral(self, function: str, j: int, k: int, a: int, b: int) -> str | None:
        """A function whose derivative is b a'."""
        if k == 0:
            return f"{function}({self.at(a, 0)})"
        terms = [_times(self.multiple(a, i), self.at(b, k - i)) for i in _inward(1, k)]
        return _times(_sum(terms), repr(1 / k))

    def slope(self, j: int, k: int, a: int, b: int) -> str | None:
        if k == 0:  # 1 - tanh^2 where it loses nothing: it is cheaper
            square, fall = self.at(b, 0), f"exp(-2.0 * fabs({self.at(a, 0)}))"
            return f"1.0 - {square} if {square} < 0.5 else 4.0 * {fall} / ((1.0 + {fall}) * (1.0 + {fall}))"
        return _times("-1.0", self.at(b, k))

    def power(self, j: int, k: int, a: int, b: int) -> str | None:
        exponent, base = self.number(1, j), self.at(a, 0)
        if k == 0:
            self.inverse(j, f"1.0 / {base} if {base} > {STILL} else 0.0")
            return f"power({base}, {exponent}) if {base} > {STILL} else (0.0 if {exponent} > 0.0 else nan)"
        rising = _sum(_times(self.multiple(a, k - i), self.at(j, i)) for i in _inward(0, k - 1))
        own = _sum(_times(self.at(a, k - i), self.multiple(j, i)) for i in _inward(1, k - 1))
        return _times(_difference(_times(exponent, rising), own), f"(r{j} * {1 / k!r})")

    def log(self, j: int, k: int, a: int, b: int) -> str | None:
        """The logarithm and the inverse hyperbolic sine: functions whose derivative is a' / b."""
        if k == 0:
            self.inverse(j, f"1.0 / {self.at(b, 0)}")
            at = self.at(a, 0)
            return f"asinh({at})" if self.tape.kinds[self.begin + j] == ASINH else f"log({at}) if {at} > 0.0 else nan"
        rest = _sum(_times(self.multiple(j, i), self.at(b, k - i)) for i in _inward(1, k - 1))
        return _times(_difference(self.at(a, k), _times(rest, repr(1 / k))), f"r{j}")


def _inward(low: int, high: int) -> list[int]:
    """Orders from the middle outwards: what is computed last is added last."""
    return sorted(range(low, high + 1), key=lambda i: abs(2 * i - low - high))


def _times(a: str | None, b: str | None) -> str | None:
    return f"{a} * {b}" if a and b else None


def _difference(a: str | None, b: str | None) -> str | None:
    return f"({a or 0.0} - {b})" if b else a


def _sum(terms: Iterable[str | None]) -> str | None:
    """A sum in brackets; a long one in two halves that need not wait for each other."""
    addends = [term for term in terms if term]
    if len(addends) > 5:
        early = addends[:-2]
        addends = [f"({' + '.join(early[::2])})", f"({' + '.join(early[1::2])})", *addends[-2:]]
    return f"({' + '.join(addends)})" if addends else None
