"""A friction curve written as text: ``"3 / (1 + 1.42 * v) + 1"`` is a function of the sliding speed v.

Forms and expressions of laws as text, in Python's writing or C's.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from stickslip.errors import ModelError
from stickslip.laws import curved
from stickslip.laws.base import Row
from stickslip.laws.curved import FUNCTIONS, Expression, lifted

LONGEST = 300  # characters
DEEPEST = 60  # levels of the tree: it is walked by recursion here, where it is written and where it is solved
SIGNS = re.compile(r"[\w.+\-*/() ]*", re.ASCII)
_GRAMMAR = f"a curve is made of numbers, the speed v [m/s], + - * / **, brackets and {', '.join(FUNCTIONS)}"

OPERATORS = {"sum": "+", "product": "*", "quotient": "/"}
MARKS = re.compile(r"(?<=\*)(?=/)|(?<=/)(?=\*)|(?<=-)(?=-)")  # within what opens or ends a comment in C or XML


@dataclass(frozen=True)
class Formula:
    """A curve over the sliding speed, as a :class:`FrictionCurve` takes it, from its text.

    Attributes
    ----------
    text : str
        Numbers, the speed ``v`` [m/s], ``+ - * / **``, brackets, and the functions exp, log, tanh, asinh, sqrt; kept as
        its tree is written, so that what leaves with a law is the arithmetic and nothing that stood beside it.

    Raises
    ------
    ModelError
        The text is no such formula.

    Examples
    --------
    >>> popp = Formula("3 / (1 + 1.42 * v) + 1 + 0.1 * v**2")
    >>> round(popp(lifted(1.0)).at(), 6)
    2.339669
    >>> Formula("((1.5)+v*2)").text
    '1.5 + v * 2'
    """

    text: str

    def __post_init__(self) -> None:
        if len(self.text) > LONGEST:
            raise self._refused(f"of {len(self.text)} characters")
        if foreign := SIGNS.sub("", self.text):
            raise self._refused(f"has {foreign[0]!a}")
        tree = self._tree()
        if _depth(tree) > DEEPEST:
            raise self._refused(f"is more than {DEEPEST} levels deep")
        try:
            rest = self(lifted(0.0))
        except OverflowError as error:  # of a whole number
            raise self._refused("has a number beyond all range") from error
        try:
            rest.at()
        except ModelError as error:
            raise self._refused("has no value at rest") from error
        object.__setattr__(self, "text", ast.unparse(tree))

    def __call__(self, speed: Expression) -> Expression:
        """The curve at a speed."""
        return lifted(self._value(self._tree(), speed))

    def _tree(self) -> ast.expr:
        try:
            return ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:  # of the parser, by its depth
            raise self._refused("can not be read") from error

    def _value(self, node: ast.expr, speed: Expression) -> Expression | float:
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
            value = float(node.value)
            if math.isfinite(value):
                return value
        if isinstance(node, ast.Name) and node.id == "v":
            return speed
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            inner = self._value(node.operand, speed)
            return -inner if isinstance(node.op, ast.USub) else inner
        if isinstance(node, ast.BinOp):
            return self._joined(node, speed)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS:
            arguments = [self._value(part, speed) for part in node.args]
            if len(arguments) == 1 and not node.keywords:
                return lifted(getattr(curved, node.func.id)(*arguments))
        raise self._refused(f"has '{ast.unparse(node)}'")

    def _joined(self, node: ast.BinOp, speed: Expression) -> Expression | float:
        left, right = lifted(self._value(node.left, speed)), self._value(node.right, speed)
        match node.op:
            case ast.Add():
                return left + right
            case ast.Sub():
                return left - right
            case ast.Mult():
                return left * right
            case ast.Div():
                return left / right
            case ast.Pow() if isinstance(right, float):
                return left**right
            case ast.Pow() if not _has_speed(node.right):
                return left ** lifted(right).at()
        raise self._refused(f"has '{ast.unparse(node)}'")

    def _refused(self, what: str) -> ModelError:
        return ModelError(
            f"the curve {self.text[:60]!a} {what}", _GRAMMAR, "correct it, as in 1.0 + 0.5 * exp(-v / 0.1)"
        )


def _has_speed(node: ast.expr) -> bool:
    return any(isinstance(part, ast.Name) and part.id == "v" for part in ast.walk(node))


def _depth(tree: ast.expr) -> int:
    """Levels of the operations, without recursion."""
    depth, level = 0, [tree]
    while level:
        depth += 1
        level = [part for node in level for part in ast.iter_child_nodes(node) if isinstance(part, ast.expr)]
    return depth


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
