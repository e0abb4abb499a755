"""A law's expressions as the operations of a tape: one node for equal formulas, and what rounds each sum of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError
from stickslip.laws.curved import Expression
from stickslip.solve import taylor
from stickslip.solve.bound import Form, combined
from stickslip.solve.taylor import Guards, Sums

Scaled = tuple[int, float]  # a node and a factor


class Operations:
    """Nodes of one mode's tape; equal formulas share a node."""

    def __init__(self, size: int, symbols: Mapping[str, Form]) -> None:
        self.size, self.symbols = size, symbols
        self.rows: list[tuple[int, int, int, float, Form]] = []
        self.known: dict[Any, int] = {}

    def put(self, kind: int, left: int = 0, right: int = 0, power: float = 0.0, form: Form = ({}, 0.0)) -> int:
        """A node's number; a new one only where no equal one is there."""
        key = (kind, left, right, power, tuple(sorted(form[0].items())), form[1])
        if key not in self.known:
            self.known[key] = self.size + len(self.rows)
            self.rows.append((kind, left, right, power, form))
        return self.known[key]

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
