"""A law's expressions as the operations of a tape: one node for equal formulas, and what rounds each sum of them.

Masses that contacts hold are bound to the counter-face's motion, and the contacts share the force through M. Of n
degrees of freedom, contacts along the rows T of (m, n) hold m. With S = (T M^-1 T')^-1 and U = M^-1 T' S, the masses
move by v -> (1 - U T) v + U w, w the speeds at which the contacts hold.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.arrays import Array
from stickslip.errors import ModelError
from stickslip.laws.curved import Expression
from stickslip.solve import taylor
from stickslip.solve.taylor import Guards, Sums

Form = tuple[dict[int, float], float]  # weights of nodes, and a constant
WHOLE = 1e-15  # a share this close to a whole number is one: a mass that is held has no part in the motion


def combined(terms: Iterable[tuple[float, Form]]) -> Form:
    """A weighted sum of linear forms."""
    weights: dict[int, float] = {}
    constant = 0.0
    for factor, (part, value) in terms:
        constant += factor * value
        for node, weight in part.items():
            weights[node] = weights.get(node, 0.0) + factor * weight
    if 0.0 in weights.values():
        weights = {node: weight for node, weight in weights.items() if weight != 0.0}
    return weights, constant


class Bound:
    """How n masses move that some contacts hold, as linear forms; `rows` are these contacts' directions (m, n)."""

    def __init__(self, mass: Array, inverse: Array, rows: Array) -> None:
        self.mass, self.inverse, self.rows = mass, inverse, rows
        self.count, self.degrees = rows.shape
        if not self.count:
            return
        whole = self.count == self.degrees  # nothing is free
        self.share: Array = np.asarray(np.linalg.inv(rows @ inverse @ rows.T), dtype=np.float64)
        self.spread = rows.T @ np.linalg.inv(rows @ rows.T) if whole else inverse @ rows.T @ self.share
        free = np.zeros_like(mass) if whole else np.eye(self.degrees) - self.spread @ rows
        self.free = np.where(np.abs(free - np.rint(free)) < WHOLE, np.rint(free), free)

    def friction(self, force: Sequence[Form], acceleration: Sequence[Form]) -> list[Form]:
        """Forces of the contacts that hold, by the forces on the masses and the accelerations of the counter-face."""
        if not self.count:
            return []
        if self.count < self.degrees:
            return _through(
                self.share,
                [
                    combined([*zip(row, force, strict=True), (-1.0, own)])
                    for row, own in zip(self.rows @ self.inverse, acceleration, strict=True)
                ],
            )
        forced = _through(self.mass @ self.spread, acceleration)
        rest = [combined([(1.0, push), (-1.0, own)]) for push, own in zip(force, forced, strict=True)]
        return _through(self.spread.T, rest)

    def speed(self, speeds: Sequence[Form]) -> list[Form]:
        """Velocity of each mass, by the speeds at which the contacts hold."""
        own: list[Form] = [({self.degrees + i: 1.0}, 0.0) for i in range(self.degrees)]
        return self._joined(own, speeds)

    def acceleration(self, force: Sequence[Form], acceleration: Sequence[Form]) -> list[Form]:
        """Acceleration of each mass."""
        return self._joined(_through(self.inverse, force), acceleration)

    def _joined(self, own: Sequence[Form], bound: Sequence[Form]) -> list[Form]:
        if not self.count:
            return list(own)
        return _through(np.hstack([self.free, self.spread]), [*own, *bound])


def _through(matrix: Array, forms: Sequence[Form]) -> list[Form]:
    return [combined(zip(map(float, row), forms, strict=True)) for row in matrix]


def stilled(unit: Any, degrees: int, stuck: Mapping[int, tuple[Array, Any]]) -> Any:
    """The state with the velocities of some contacts told, but for the rounding of its own terms: (B, N, N).

    Of each contact its direction and, as rows (B, N), the velocity that it is left. One degree of freedom after the
    other takes the velocity that the rest leave it, contacts that see the fewest first. No projection: that would mix
    in the rounding of velocities that a contact does not see, and rounding must not decide what follows.
    """
    still, speeds = unit.copy(), slice(degrees, 2 * degrees)
    for c in sorted(stuck, key=lambda c: int(np.count_nonzero(stuck[c][0]))):
        tangent, speed = stuck[c]
        left = speed - tangent @ still[:, speeds]
        p = degrees + int(np.argmax(np.abs(left[0, speeds])))
        if abs(left[0, p]) > 1e-12 * np.max(np.abs(tangent)):
            taken = -left / left[:, p, None]
            taken[:, p] = -1.0
            still += still[:, :, p, None] * taken[:, None]
    return still


Scaled = tuple[int, float]  # a node and a factor


class Operations:
    """Nodes of one mode's tape; equal formulas share a node."""

    def __init__(self, size: int, symbols: Mapping[str, Form]) -> None:
        self.size, self.symbols = size, symbols
        self.rows: list[tuple[int, int, int, float, Form]] = []
        self.known: dict[Any, int] = {}

    def put(self, kind: int, left: int = 0, right: int = 0, power: float = 0.0, form: Form = ({}, 0.0)) -> int:
        """A node's number; a new one only where no equal one is there."""
        weights = sorted(form[0].items())  # in whatever order a law has written them: one code serves all
        key = (kind, left, right, power, tuple(weights), form[1])
        known = self.known.get(key)
        if known is None:
            known = self.known[key] = self.size + len(self.rows)
            self.rows.append((kind, left, right, power, (dict(weights), form[1])))
        return known

    def node(self, form: Form) -> int:
        """The node that has a linear form's value."""
        weights, constant = form
        if constant == 0.0 and len(weights) == 1 and next(iter(weights.values())) == 1.0:
            return next(iter(weights))
        return self.put(taylor.LINEAR, form=form)

    def scaled(self, form: Form) -> Scaled:
        """A linear form as a node and a factor: a multiple of a node needs none of its own."""
        weights, constant = form
        if constant == 0.0 and len(weights) == 1:
            return next(iter(weights.items()))
        return self.node(form), 1.0

    def form(self, expression: Expression) -> Form:
        """An expression as a linear form of nodes."""
        kind, parts = expression.kind, expression.parts
        if kind == "number":
            return {}, expression.value
        if kind == "symbol":
            if expression.name not in self.symbols:
                raise ModelError(
                    f"a law speaks of '{expression.name}'",
                    f"the state has {', '.join(self.symbols)}",
                    "correct the law",
                )
            return self.symbols[expression.name]
        forms = [self.form(part) for part in parts]
        if kind == "sum":
            return combined((1.0, form) for form in forms)
        if kind == "product":
            return self.product(*forms)
        if kind == "quotient":
            return self.quotient(*forms)
        if kind == "power":
            return self.power(forms[0], expression.value)
        return self.function(kind, forms[0])

    def product(self, a: Form, b: Form) -> Form:
        """a b; a number only scales."""
        if not a[0] or not b[0]:
            return combined([(a[1], b)] if not a[0] else [(b[1], a)])
        (left, one), (right, other) = self.scaled(a), self.scaled(b)
        if left == right:
            return {self.put(taylor.SQUARE, left): one * other}, 0.0
        return {self.put(taylor.PRODUCT, min(left, right), max(left, right)): one * other}, 0.0

    def quotient(self, a: Form, b: Form) -> Form:
        """a / b."""
        if not b[0]:
            return combined([(1 / b[1], a)])
        (over, one), (under, other) = self.scaled(a), self.scaled(b)
        return {self.put(taylor.QUOTIENT, over, under): one / other}, 0.0

    def power(self, base: Form, exponent: float) -> Form:
        """base ** exponent; whole exponents are products."""
        if not base[0]:
            return {}, float(base[1] ** exponent)
        if exponent == int(exponent) and 0 <= exponent <= 64:
            result: Form = ({}, 1.0)
            square, left = base, int(exponent)
            while left:
                result = self.product(result, square) if left % 2 else result
                left //= 2
                square = self.product(square, square) if left else square
            return result
        return {self.put(taylor.POWER, self.node(base), power=exponent): 1.0}, 0.0

    def function(self, kind: str, of: Form) -> Form:
        """A function, with the node its derivative needs."""
        if not of[0]:
            return {}, float(getattr(math, kind)(of[1]))
        at = self.node(of)
        if kind == "sqrt":
            return self.power(of, 0.5)
        if kind == "exp":
            return {self.put(taylor.EXP, at): 1.0}, 0.0
        if kind == "log":
            return {self.put(taylor.LOG, at, at): 1.0}, 0.0
        if kind == "asinh":
            root = self.power(combined([(1.0, self.product(of, of)), (1.0, ({}, 1.0))]), 0.5)
            return {self.put(taylor.ASINH, at, self.node(root)): 1.0}, 0.0
        known = self.known.get((taylor.TANH, at))
        if known is None:
            known = self.known[(taylor.TANH, at)] = self.put(taylor.TANH, at, power=float(at))
            slope = self.put(taylor.SLOPE, at, self.put(taylor.SQUARE, known))
            row = self.rows[known - self.size]
            self.rows[known - self.size] = (row[0], row[1], slope, row[3], row[4])
        return {known: 1.0}, 0.0


def flat(modes: list[Operations]) -> tuple[NDArray[Any], ...]:
    """The nodes of all modes, one after the other."""
    blank: tuple[int, int, int, float, Form] = (taylor.LINEAR, 0, 0, 0.0, ({}, 0.0))
    kinds, left, right, power, forms = zip(*(row for m in modes for row in [blank] * m.size + m.rows), strict=True)
    weights = np.array([weight for form, _ in forms for weight in form.values()], dtype=np.float64)
    low = [0, *itertools.accumulate(len(form) for form, _ in forms)]
    index = [node for form, _ in forms for node in form]
    first = [0, *itertools.accumulate(m.size + len(m.rows) for m in modes)]
    whole = (np.array(column, dtype=np.int64) for column in (kinds, left, right, low, index, first))
    kinds_, left_, right_, low_, index_, first_ = whole
    constant = np.array([value for _, value in forms])
    return kinds_, left_, right_, np.array(power), low_, weights, index_, constant, first_


def guards_of(modes: list[Operations]) -> Guards:
    """The nodes whose series may know nothing of what is ahead: what they are, and of what; and the first by mode."""
    kinds = (taylor.EXP, taylor.TANH, taylor.POWER)
    guarded = [[row[:2] for row in mode.rows if row[0] in kinds] for mode in modes]
    pairs = np.array([row for rows in guarded for row in rows], dtype=np.int64).reshape(-1, 2)
    return Guards(pairs[:, 0].copy(), pairs[:, 1].copy(), np.cumsum([0, *map(len, guarded)]))


def sums_of(modes: list[Operations], rates: Any, exits: Any) -> Sums:
    """What rounds each rate (by mode and entry) and each exit: sizes of the weights of a sum, and their nodes."""
    low, weights, constant = [0], list[float](), list[float]()
    index: list[int] = []
    for kind in (rates, exits):
        for mode, pairs in zip(modes, kind, strict=True):
            for node, factor in pairs:
                row = mode.rows[node - mode.size] if node >= mode.size else None
                form = row[4] if row and row[0] == taylor.LINEAR else ({} if node < 0 else {node: 1.0}, 0.0)
                weights.extend(abs(factor * weight) for weight in form[0].values())
                index.extend(form[0])
                low.append(len(weights))
                constant.append(abs(factor * form[1]))
    return Sums(np.array(low), np.array(weights), np.array(index, dtype=np.int64), np.array(constant))
