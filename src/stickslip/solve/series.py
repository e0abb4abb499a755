"""Taylor coefficients as straight-line code: written for the structure of one system, compiled, and kept on disk.

A tape is a list of nodes; node j is a function of earlier ones (Jorba and Zou, Experimental Mathematics 14, 2005).
Its first nodes are the entries of the state, whose coefficient k + 1 is the coefficient k of their rate over k + 1.
Its numbers (weights, constants, exponents) are arguments of the code: laws that differ by them alone share it.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.compiled import generated
from stickslip.errors import ModelError
from stickslip.solve.taylor import ASINH, EXP, LINEAR, LOG, POWER, PRODUCT, QUOTIENT, SLOPE, SQUARE, TANH

Number = tuple[int, ...]
VARIABLE = re.compile(r"\b[dexqr]\d+\b|\b[dexqr]\d+(?=_)")  # that a :class:`_Writer` names
HEAD = '''"""Taylor coefficients of one kind of system; written by `stickslip.solve.series`."""

from stickslip.compiled import pointer
from stickslip.solve.taylor import CODE, STILL, value


@pointer(CODE, error_model="numpy", fastmath={"contract"})
def series(q, mode, y, h, s):
'''


# Curved nodes of all modes, each some 0.7 s of compiling at the highest order; of the package's own laws rate and state
# with a slip law, which has a mode that creeps, has the most, 29.
MOST = 44


class Nodes(NamedTuple):
    """A tape: of each node its operation, operands, exponent, first weight and constant; the weights and their nodes;
    the first node of each mode; and node and factor of each state entry's rate, by mode."""

    kinds: NDArray[np.int64]
    left: NDArray[np.int64]
    right: NDArray[np.int64]
    power: NDArray[np.float64]
    low: NDArray[np.int64]
    weights: NDArray[np.float64]
    terms: NDArray[np.int64]
    constant: NDArray[np.float64]
    first: NDArray[np.int64]
    rate: NDArray[np.int64]
    factor: NDArray[np.float64]

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


def expansion(nodes: Nodes, kept: tuple[Number, ...], order: int) -> tuple[int, NDArray[np.float64]]:
    """Address of compiled code that fills a work array with coefficients 0 .. `order`, and its numbers.

    Raises a ModelError where the law has so many curved nodes that compiling would not end soon.

    It takes the numbers, the mode, the state, the unit of time and the work array; coefficient k of node j stands at
    j (order + 1) + k. The state's are complete, other nodes lack the last (but have that of order 0).
    """
    if (count := curved_nodes(nodes)) > MOST:
        raise ModelError(
            f"a law of {count} different products, quotients and functions in all its modes",
            f"each is compiled as a series; more than {MOST} would take minutes",
            "write the curve with fewer, or as a table of points (Tabulated)",
        )
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


def curved_nodes(nodes: Nodes) -> int:
    """How many nodes of a tape are more than a weighted sum."""
    return int(np.count_nonzero(nodes.kinds != LINEAR))


@cache
def _compiled(structure: Structure, order: int, stride: int) -> int:
    return int(generated(source(structure, order, stride)).series.address)


def source(structure: Structure, order: int, stride: int) -> str:
    """The text of the module that :func:`expansion` compiles."""
    modes: dict[tuple[str, ...], list[int]] = {}
    for mode in range(len(structure.rate)):
        modes.setdefault(tuple(_Writer(structure, mode, order).lines()), []).append(mode)
    text = [f"    b = {stride} * mode"]
    for lines, having in modes.items():
        text.append(f"    if {' or '.join(f'mode == {mode}' for mode in having)}:")
        # Names of its own: numba goes through all code again for each variable that two branches assign,
        # which took as long as all the rest of compiling.
        text.extend("        " + VARIABLE.sub(rf"\g<0>of{having[0]}", line) for line in lines)
    return HEAD + "\n".join(text) + "\n"


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
        """A number of the mode, read once: each reading would take the compiler as long as an operation."""
        if place not in self.read:
            self.read.add(place)
            self.text.append(f"q{place} = q[b + {place}]")
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
        return self.integral(EXP, j, k, a, j)

    def tanh(self, j: int, k: int, a: int, b: int) -> str | None:
        return self.integral(TANH, j, k, a, b)

    def integral(self, kind: int, j: int, k: int, a: int, b: int) -> str | None:
        """A function whose derivative is b a'."""
        if k == 0:
            return f"value({kind}, {self.at(a, 0)}, 0.0)"
        terms = [_times(self.multiple(a, i), self.at(b, k - i)) for i in _inward(1, k)]
        return _times(_sum(terms), repr(1 / k))

    def slope(self, j: int, k: int, a: int, b: int) -> str | None:
        if k == 0:  # 1 - tanh^2 where it loses nothing: it is cheaper
            square = self.at(b, 0)
            return f"1.0 - {square} if {square} < 0.5 else value({SLOPE}, {self.at(a, 0)}, 0.0)"
        return _times("-1.0", self.at(b, k))

    def power(self, j: int, k: int, a: int, b: int) -> str | None:
        exponent, base = self.number(1, j), self.at(a, 0)
        if k == 0:
            self.inverse(j, f"1.0 / {base} if {base} > STILL else 0.0")
            return f"value({POWER}, {base}, {exponent})"
        rising = _sum(_times(self.multiple(a, k - i), self.at(j, i)) for i in _inward(0, k - 1))
        own = _sum(_times(self.at(a, k - i), self.multiple(j, i)) for i in _inward(1, k - 1))
        return _times(_difference(_times(exponent, rising), own), f"(r{j} * {1 / k!r})")

    def log(self, j: int, k: int, a: int, b: int) -> str | None:
        """The logarithm and the inverse hyperbolic sine: functions whose derivative is a' / b."""
        if k == 0:
            self.inverse(j, f"1.0 / {self.at(b, 0)}")
            return f"value({self.tape.kinds[self.begin + j]}, {self.at(a, 0)}, 0.0)"
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
