"""Forms and expressions of laws as text, in Python's writing or C's."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping

from stickslip.errors import ModelError
from stickslip.laws.base import Row
from stickslip.laws.curved import Expression

OPERATORS = {"sum": "+", "product": "*", "quotient": "/"}
MARKS = re.compile(r"(?<=\*)(?=/)|(?<=/)(?=\*)|(?<=-)(?=-)")  # within what opens or ends a comment in C or XML


def one_line(text: str) -> str:
    """A text as one line of signs that can be printed: what no line comment and no literal ends at."""
    return " ".join("".join(sign if sign.isprintable() else " " for sign in text).split())


def remark(text: str) -> str:
    """A text as it may stand in a comment of any of the languages.

    Examples
    --------
    >>> remark("of a curve */ evil(); /* -->")
    'of a curve * / evil(); / * - ->'
    """
    return MARKS.sub(" ", one_line(text)).rstrip("\\")


def quoted(text: str) -> str:
    """A text as a string of TOML, which is one of JSON too.

    Examples
    --------
    >>> print(quoted('a sieve of 6"'))
    "a sieve of 6\\""
    """
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def written(form: Expression | Row, *, names: Mapping[str, str] | None = None, c: bool = False) -> str:
    """A linear form or an expression, its symbols by other names where given.

    Examples
    --------
    >>> from stickslip.laws.curved import exp, symbol
    >>> written(1.0 + 0.5 * exp(-(symbol("v") / 0.1)))
    '1.0 + 0.5 * exp(-1.0 * (v / 0.1))'
    >>> written({"x": 2.0, "anchor": -2.0, "1": 0.5}, names={"anchor": "m[0]"}, c=True)
    '2.0 * x - 2.0 * m[0] + 0.5'
    """
    called = (names or {}).get
    if not isinstance(form, Expression):
        return _form(form, lambda name: called(name, name) or name)
    return _expression(form, lambda name: called(name, name) or name, c)


def _number(value: float) -> str:
    if not math.isfinite(value):
        raise ModelError(f"a number {value} of the law", "what is written is finite", "correct the law's values")
    return repr(float(value))


def _form(form: Row, named: Callable[[str], str]) -> str:
    terms = [(float(value), "" if name == "1" else named(name)) for name, value in form.items() if value != 0]
    text = ""
    for value, name in terms:
        size = f"{_number(abs(value))} * {name}" if name and abs(value) != 1 else name or _number(abs(value))
        sign = "-" if value < 0 else "+"
        text += f" {sign} {size}" if text else size if value > 0 else f"-{size}"
    return text or "0.0"


def _expression(form: Expression, named: Callable[[str], str], c: bool) -> str:
    if form.kind == "number":
        return f"({_number(form.value)})" if form.value < 0 else _number(form.value)
    if form.kind == "symbol":
        return named(form.name)
    if form.kind == "power":
        base = _expression(form.parts[0], named, c)
        return f"pow({base}, {float(form.value)!r})" if c else f"({base})**{float(form.value)!r}"
    if form.kind in OPERATORS:
        left, right = (_expression(part, named, c) for part in form.parts)
        if form.kind != "sum" and form.parts[0].kind == "sum":
            left = f"({left})"
        if form.parts[1].kind in (("sum",) if form.kind == "sum" else OPERATORS):  # in the order of the tree
            right = f"({right})"
        if left.startswith("(-") and left.endswith(")") and form.parts[0].kind == "number":
            left = left[1:-1]
        return f"{left} {OPERATORS[form.kind]} {right}"
    return f"{form.kind}({', '.join(_expression(part, named, c) for part in form.parts)})"
