"""The channel grammar: ``"-200 * (F + 0.115) [N] ± 1 %"`` is a sum of columns times numbers, plus a number, in a unit;
behind it may stand how sure the gain is.
"""

from __future__ import annotations

import ast
import difflib
import math
import re
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from stickslip.errors import ABSENT, RecordError
from stickslip.record.channels import VOCABULARY
from stickslip.units import MISMATCH, PLUS_MINUS, Unit, parse_unit, parse_value

ACCELERATION = re.compile(r"(^|_)acc(\d|_|[xyz]|$)|accel|beschl", re.IGNORECASE)  # names whose "g" is gravity
LONGEST = 500  # characters; a linear combination needs fewer, and the parser's recursion stays shallow


@dataclass(frozen=True)
class Linear:
    """``offset + sum(scale * column)``."""

    scales: Mapping[str, float]
    offset: float = 0.0

    def plain(self) -> str | None:
        """The one column that this is, unscaled and not shifted, or None."""
        return next(iter(self.scales)) if list(self.scales.values()) == [1.0] and self.offset == 0 else None

    def __add__(self, other: Linear) -> Linear:
        scales = dict(self.scales)
        for name, scale in other.scales.items():
            scales[name] = scales.get(name, 0.0) + scale
        return Linear(scales, self.offset + other.offset)

    def __mul__(self, factor: float) -> Linear:
        return Linear({name: scale * factor for name, scale in self.scales.items()}, self.offset * factor)


@dataclass(frozen=True)
class Spec:
    """A channel as asked for: the arithmetic, the unit of its result, the sensitivity, and how sure they are."""

    text: str
    arithmetic: str
    unit: str | None
    sensitivity: str
    gain_sd: float = 0.0


def split_spec(text: str) -> Spec:
    """Take ``"ARITHMETIC [UNIT] @ SENSITIVITY ± PERCENT"`` apart; all but the arithmetic may be missing."""
    before, gain_sd = split_gain(text) if len(text) <= LONGEST else (text, 0.0)
    match = re.fullmatch(r"\s*(.*?)\s*(?:\[([^\[\]]*)\]\s*)?(?:@\s*([^@\[\]]+?)\s*)?", before, re.DOTALL)
    if match is None or not match[1] or len(text) > LONGEST:
        raise RecordError(
            f"'{text[:60]}' names no column",
            "a channel is written 'COLUMN [unit]', 'COLUMN * 2.5 + 1 [unit]' or 'COLUMN [V] @ 500 mV/lbf'",
            "correct it in channels=",
        )
    return Spec(before, match[1], match[2], match[3] or "", gain_sd)


def times(text: str, factor: float, *, unit: str | None = None) -> str:
    """A channel as asked for, times a factor, in another `unit` where one is given.

    Examples
    --------
    >>> times("acc [g] ± 1 %", -1.0), times("F + 2 [N]", 1.0), times("acc [g]", 1.0, unit="m")
    ('-1 * (acc) [g] ± 1 %', 'F + 2 [N]', 'acc [m]')
    """
    spec = split_spec(text)
    text = text.replace(f"[{spec.unit}]", f"[{unit}]", 1) if unit and spec.unit else text
    return text if factor == 1 else text.replace(spec.arithmetic, f"{factor:.14g} * ({spec.arithmetic})", 1)


def shifted(text: str, by: float, channel: str) -> str:
    """A channel as asked for, less a zero `by` in SI; empty where a sensitivity stands between.

    Examples
    --------
    >>> shifted("acc [g]", 0.980665, "a"), shifted("F [N]", -2.0, "load")
    ('(acc) - 0.1 [g]', '(F) + 2 [N]')
    """
    spec = split_spec(text)
    if "@" in text:
        return ""
    off = by / (channel_unit(spec.unit, channel).scale if spec.unit else 1.0)
    return text.replace(spec.arithmetic, f"({spec.arithmetic}) {'-' if off > 0 else '+'} {abs(off):.6g}", 1)


def split_gain(text: str) -> tuple[str, float]:
    """What stands before the uncertainty of a gain, and that as a part of it; ``a +- b`` is arithmetic."""
    match = re.fullmatch(rf"(.*){PLUS_MINUS}\s*([^\[\]@]*)", text, re.DOTALL)
    if match is None or not ("%" in match[2] or re.search(r"\]\s*$|@", match[1])):
        return text, 0.0
    try:
        sd = parse_value(match[2], "1") if "%" in match[2] else math.nan
    except RecordError:
        sd = math.nan
    if not 0 <= sd < 1:
        raise RecordError(
            f"'{text[:60]}'",
            "how sure a gain is is its standard deviation, from 0 to 100 % of it",
            "write it like 'COLUMN [unit] ± 1 %'",
        )
    return match[1], sd


def linear(arithmetic: str, keys: Mapping[str, str], constants: Mapping[str, float]) -> Linear:
    """Read the arithmetic as a linear combination of columns.

    Parameters
    ----------
    arithmetic : str
        Numbers, column names (in backticks where they hold other characters than letters, digits and _),
        ``#3`` for the third column, ``+ - * /`` and brackets.
    keys : mapping of str to str
        The key of each column under every name that it may be called by.
    constants : mapping
        Numbers of the file that may be used by name.

    Raises
    ------
    RecordError
        A name that is neither column nor constant, a product of columns, a division by zero, anything else
        than arithmetic.
    """
    if arithmetic in keys:
        return Linear({keys[arithmetic]: 1.0})
    quoted: dict[str, str] = {}

    def placeholder(match: re.Match[str]) -> str:
        key = f"_column_{len(quoted)}"
        quoted[key] = match[1] or match[0]
        return f" {key} "

    source = re.sub(r"`([^`]+)`|#\d+", placeholder, arithmetic).strip()

    def named(placed: str) -> Linear:
        name = quoted.get(placed, placed)
        if name in keys:
            return Linear({keys[name]: 1.0})
        if name in constants:
            return Linear({}, float(constants[name]))
        raise unknown("column", name, dict.fromkeys([*keys.values(), *constants]))

    result = _walk(_parsed(source, arithmetic), arithmetic, named)
    if not all(math.isfinite(number) for number in (*result.scales.values(), result.offset)):
        raise _refusal(arithmetic, "its numbers are too large")
    if not result.scales:
        raise _refusal(arithmetic, "it names no column")
    return result


def unknown(kind: str, name: str, known: Iterable[str]) -> RecordError:
    """The error for a name that is not there: what there is, and the nearest spelling."""
    names = list(known)
    near = difflib.get_close_matches(name, names, 1) or [n for n in names if n.lower() == name.lower()]
    near = [one if kind != "column" or one.isidentifier() else f"`{one}`" for one in near]
    shown = ", ".join(names[:40]) + (f" and {len(names) - 40} more" if len(names) > 40 else "")
    return RecordError(
        f"there is no {kind} '{name}'",
        f"the file has {shown or 'none'}",
        f"did you mean '{near[0]}'" if near else "choose one of them, by name or by number as in '#2'",
        kind=ABSENT,
    )


def channel_unit(text: str, channel: str) -> Unit:
    """Read a unit for a channel: the vocabulary settles symbols with two meanings, and must be met.

    Outside of it the name of an acceleration settles "g", and need not be met.
    """
    accepted: tuple[str | None, ...] = ("m/s^2", None) if ACCELERATION.search(channel) else (None,)
    accepted = VOCABULARY[channel].units if channel in VOCABULARY else accepted
    refusals = []
    for expected in accepted:
        try:
            return parse_unit(text, expect=expected)
        except RecordError as error:
            refusals.append(error)
    first = refusals[0]
    step = first.next_step
    if channel == "friction" and first.kind == MISMATCH and parse_unit(text).si == "1":
        step = "a coefficient of friction is the channel coefficient, as in coefficient=COLUMN [1]"
    raise RecordError(f"channel {channel}: {first.value}", first.rule, step) from first


def apply_sensitivity(text: str, measured: Unit, channel: str) -> Unit:
    """The unit that a reading in `measured` has after a sensitivity such as "500 mV/lbf" or "2 mm/V"."""
    match = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^/]+)/\s*(.+)", text)
    if match is None or not math.isfinite(float(match[1])) or float(match[1]) == 0:
        raise RecordError(
            f"channel {channel}: sensitivity '{text}'",
            "a sensitivity is a number and two units",
            "write it like '500 mV/lbf' or '100 mV/g'",
        )
    value, upper, lower = float(match[1]), match[2].strip(), match[3].strip().strip("()")
    # A symbol of two meanings ("g", "lb") belongs to the channel, whichever side it stands on.
    if _measures(upper, measured):
        output = channel_unit(lower, channel)
        factor = output.scale / parse_unit(upper).scale / value  # inf where the product would be zero
    elif _measures(lower, measured):
        output = channel_unit(upper, channel)
        factor = value * output.scale / parse_unit(lower).scale
    else:
        raise RecordError(
            f"channel {channel}: a sensitivity of {text} on a reading in {measured.text}",
            "one of the sensitivity's units is that of the reading",
            "give the unit of the column before the @, as in 'ch1 [V] @ 500 mV/lbf'",
        )
    return Unit(f"{measured.text} @ {text}", measured.scale * factor, output.si)


def _measures(unit: str, reading: Unit) -> bool:
    try:
        return parse_unit(unit).si == reading.si
    except RecordError:
        return False


def _parsed(source: str, arithmetic: str) -> ast.expr:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # "1or 2" warns before it fails
            return ast.parse(source, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise _refusal(arithmetic, "it is not arithmetic; names with spaces go in backticks") from error


def _walk(node: ast.expr, arithmetic: str, named: Callable[[str], Linear]) -> Linear:
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool) and abs(value) < 1e300:
            return Linear({}, float(value))
        case ast.Name(id=name):
            return named(name)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _walk(operand, arithmetic, named) * -1.0
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _walk(operand, arithmetic, named)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as sign, right=right):
            second = _walk(right, arithmetic, named)
            return _walk(left, arithmetic, named) + (second if isinstance(sign, ast.Add) else second * -1.0)
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as op, right=right):
            first, second = _walk(left, arithmetic, named), _walk(right, arithmetic, named)
            if second.scales and (first.scales or isinstance(op, ast.Div)):
                raise _refusal(arithmetic, "it is not linear in the columns")
            if isinstance(op, ast.Div) and second.offset == 0:
                raise _refusal(arithmetic, "it divides by zero")
            if isinstance(op, ast.Div):
                return first * (1.0 / second.offset)
            return first * second.offset if first.scales else second * first.offset
    raise _refusal(arithmetic, f"'{ast.unparse(node)[:40]}' is not arithmetic on columns")


def _refusal(arithmetic: str, why: str) -> RecordError:
    return RecordError(
        f"'{arithmetic[:60]}' can not be a channel: {why}",
        "a channel is a sum of columns times numbers, plus a number",
        "write it like '-200 * (F + 0.115) [N]'",
    )
