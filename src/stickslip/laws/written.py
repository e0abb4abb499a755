"""Forms and expressions of laws as text, in Python's writing or C's."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from stickslip.laws.base import Row
from stickslip.laws.curved import Expression

OPERATORS = {"sum": "+", "product": "*", "quotient": "/"}


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


def _form(form: Row, named: Callable[[str], str]) -> str:
    terms = [(float(value), "" if name == "1" else named(name)) for name, value in form.items() if value != 0]
    text = ""
    for value, name in terms:
        size = f"{abs(value)!r} * {name}" if name and abs(value) != 1 else name or repr(abs(value))
        sign = "-" if value < 0 else "+"
        text += f" {sign} {size}" if text else size if value > 0 else f"-{size}"
    return text or "0.0"


def _expression(form: Expression, named: Callable[[str], str], c: bool) -> str:
    if form.kind == "number":
        return repr(float(form.value)) if form.value >= 0 else f"({float(form.value)!r})"
    if form.kind == "symbol":
        return named(form.name)
    if form.kind == "power":
        base = _expression(form.parts[0], named, c)
        return f"pow({base}, {float(form.value)!r})" if c else f"({base})**{float(form.value)!r}"
    if form.kind in OPERATORS:
        left, right = (_expression(part, named, c) for part in form.parts)
        inner = ("sum",) if form.kind == "product" else ("sum", "product", "quotient")
        if form.kind != "sum":
            left = f"({left})" if form.parts[0].kind == "sum" else left
            right = f"({right})" if form.parts[1].kind in (*inner, "quotient") else right
        if left.startswith("(-") and left.endswith(")") and form.parts[0].kind == "number":
            left = left[1:-1]
        return f"{left} {OPERATORS[form.kind]} {right}"
    return f"{form.kind}({', '.join(_expression(part, named, c) for part in form.parts)})"
