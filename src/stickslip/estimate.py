"""An answer that carries how sure it is: value, interval, unit, method, status, checks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from stickslip.errors import EstimateError, ModelError, RecordError
from stickslip.printing import html_table
from stickslip.units import parse_uncertain, prefixed

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

NORMAL_95 = 1.959963984540054  # two-sided 95 % quantile of the normal distribution
MOST_DECIMALS = 6  # printed in the plain unit
UNKNOWN, FEW = "unknown", "few"
UNTRIED = "untried"  # the kind of doubt of an answer that rigs without what it claims would give too
UNSTATED = "unstated"  # the kind of doubt where nobody said what a sensor makes of the motion
ROUNDING = 1e-12  # of the largest number, by which arithmetic alone may put a value beside its interval


@dataclass(frozen=True)
class Doubt:
    """Why an answer should not be trusted, or not to its last digit.

    Attributes
    ----------
    words : str
        What people read.
    kind : str
        What code asks for.
    lesser : bool
        Whether the number stands all the same.
    count, of : int, str
        How many of what the answer rests on, where that is few ("only 5 cycles").
    """

    words: str
    kind: str = ""
    lesser: bool = False
    count: int = 0
    of: str = ""

    @classmethod
    def few(cls, count: int, of: str) -> Doubt:
        """An interval that rests on few of anything."""
        return cls(f"only {count} {of}{'s' * (count > 1)}: the interval is crude", FEW, True, count, of)


class Status(str):
    """ "ok", or in words why an answer should not be trusted; behind the words stand the doubts, for code to ask.

    Examples
    --------
    >>> status = Status(Doubt.few(5, "cycle"), "the base moves")
    >>> status
    'only 5 cycles: the interval is crude; the base moves'
    >>> sorted(kinds(status)), stands(status), stands(Status())
    (['', 'few'], False, True)
    """

    doubts: tuple[Doubt, ...]

    def __new__(cls, *reasons: Doubt | str) -> Self:
        """All doubts, each once; "ok" without any."""
        doubts = tuple(dict.fromkeys(doubt for reason in reasons for doubt in doubts_of(reason)))
        status = super().__new__(cls, "; ".join(doubt.words for doubt in doubts) or "ok")
        status.doubts = doubts
        return status

    def __reduce__(self) -> tuple[Any, ...]:
        return Status, self.doubts


def doubts_of(reason: Doubt | str) -> tuple[Doubt, ...]:
    """The doubts behind a status, or behind words that are one doubt."""
    if isinstance(reason, Doubt):
        return (reason,)
    if isinstance(reason, Status):
        return reason.doubts
    return () if reason in ("", "ok") else (Doubt(reason),)


def kinds(status: str) -> frozenset[str]:
    """The kinds of doubt behind a status."""
    return frozenset(doubt.kind for doubt in doubts_of(status))


def stands(status: str) -> bool:
    """Whether the number stands: there is no doubt, or lesser ones only."""
    return all(doubt.lesser for doubt in doubts_of(status))


class Plain:
    """What JSON tells as the fields that it has."""

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; what is not finite becomes ``None``."""
        return dict(plain(vars(self)))


@dataclass(frozen=True)
class Estimate(Plain):
    """A number found in a record, with its 95 % interval.

    It counts as its value (``float(level)``, ``f"{level:.3f}"``); printed, it has the digits that its interval leaves.

    Attributes
    ----------
    name : str
        What was estimated, in the field's words ("sliding friction").
    value : float
        The estimate, in `unit`.
    interval : tuple of float
        Low and high end of the 95 % interval, the value between them; infinite where an end is open, NaN where it is
        not known.
    sd : float
        Standard deviation of the estimate.
    unit : str
        SI unit.
    method : str
        How it was found, in words short enough for a table.
    status : str
        ``"ok"``, or in words why it should not be trusted.
    checks : tuple of str
        What was checked, with the numbers.

    Raises
    ------
    EstimateError
        A value outside its own interval.

    Examples
    --------
    >>> level = Estimate.normal("sliding friction", 1.318, sd=0.004, unit="N", method="median of 18 half cycles")
    >>> print(level)
    sliding friction 1.318 N (95 %: 1.310 to 1.326)
    >>> float(level), f"{level:.1f}"
    (1.318, '1.3')
    >>> print(Estimate("contact stiffness", 7121, (4226, math.inf), math.inf, "N/m", "likelihood"))
    contact stiffness 7121 N/m (95 %: at least 4226)
    >>> print(Estimate("viscous damping", 0.0, (0.0, 0.3), 0.15, "N s/m", "likelihood"))
    viscous damping below 0.30 N s/m (95 %)
    >>> print(Estimate.normal("energy in a cycle", 1.2e-7, sd=2e-8, unit="J", method="mean of cycles"))
    energy in a cycle 120 nJ (95 %: 81 to 159)
    >>> print(Estimate.normal("memory", 1.2e-7, sd=2e-8, unit="m s/N", method="slope"))
    memory 1.2e-07 m s/N (95 %: 8.1e-08 to 1.6e-07)
    """

    name: str
    value: float
    interval: tuple[float, float]
    sd: float
    unit: str
    method: str
    status: str = "ok"
    checks: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        low, high = self.interval
        finite = [abs(number) for number in (low, self.value, high) if math.isfinite(number)]
        rounding = ROUNDING * max(finite, default=0.0)
        if self.value < low - rounding or self.value > high + rounding or low > high:
            raise EstimateError(
                f"a {self.name} of {self.value:.6g} {self.unit} with a 95 % interval of {low:.6g} to {high:.6g}",
                "an estimate lies within its own interval",
                "take both from one method; report this if stickslip made it",
            )

    @classmethod
    def normal(
        cls, name: str, value: float, *, sd: float, unit: str, method: str, quantile: float = NORMAL_95, **more: Any
    ) -> Estimate:
        """An estimate whose interval is ``value -+ quantile * sd`` (pass Student's quantile for few samples)."""
        value, sd = float(value), float(sd)
        return cls(name, value, (value - quantile * sd, value + quantile * sd), sd, unit, method, **more)

    @classmethod
    def stated(cls, name: str, constant: Constant, unit: str) -> Estimate:
        """A constant as a person states it, with its standard uncertainty; without one it is exact, its `sd` 0.

        Raises
        ------
        ModelError
            No finite number, another unit, or an uncertainty without meaning.

        Examples
        --------
        >>> mass = Estimate.stated("mass", "2.42 ± 0.02 kg", "kg")
        >>> mass.value, mass.sd, Estimate.stated("stiffness", 2310, "N/m").sd
        (2.42, 0.02, 0.0)
        """
        step = f"correct the {name}, written like '2.5 ± 0.1 {unit}'"
        if isinstance(constant, Estimate) and constant.unit != unit:
            raise ModelError(f"{name} = {constant}", f"a {name} is measured in {unit}", step)
        try:
            pair = (constant.value, constant.sd) if isinstance(constant, Estimate) else constant
            value, sd = parse_uncertain(pair, unit)
        except RecordError as error:
            raise ModelError(f"{name}: {error.value}", error.rule, step) from error
        return cls.normal(name, value, sd=sd, unit=unit, method="stated")

    def scaled(self, factor: float, unit: str, name: str | None = None) -> Estimate:
        """The same estimate in another unit, or of a quantity proportional to it."""
        ends = sorted(factor * end for end in self.interval)
        interval, sd = (ends[0], ends[1]), abs(factor) * self.sd
        return replace(self, name=name or self.name, value=factor * self.value, interval=interval, sd=sd, unit=unit)

    def widened(self, share: float, times: float = 1.0) -> Estimate:
        """The same estimate, unsure by a share of its value besides, and so many times as unsure.

        Examples
        --------
        >>> print(Estimate.normal("friction coefficient", 0.3, sd=0.003, unit="1", method="").widened(0.02))
        friction coefficient 0.300 (95 %: 0.287 to 0.313)
        """
        if not self.known or (share, times) == (0.0, 1.0):
            return self
        more = share * abs(self.value)
        below, above = (times * math.hypot(end - self.value, NORMAL_95 * more) for end in self.interval)
        floor = 0.0 if self.interval[0] >= 0 else -math.inf  # what can not fall below zero does not by being less sure
        interval = max(floor, self.value - below), self.value + above
        return replace(self, interval=interval, sd=times * math.hypot(self.sd, more))

    @property
    def known(self) -> bool:
        """Whether it has a value; where it has none that is possible, the value is NaN and the status says why."""
        return math.isfinite(self.value)

    def unknown(self, why: str) -> Estimate:
        """The same estimate without a value, and the reason as its status."""
        return replace(self, value=math.nan, interval=(math.nan, math.nan), sd=math.nan, status=why)

    def within(self, low: float = -math.inf, high: float = math.inf, *, otherwise: str = "") -> Estimate:
        """The same estimate of a quantity that can not lie outside `low` to `high`.

        The interval is cut to what is possible, and the value moves to the nearest of it. Where nothing of the interval
        is possible, or an interval without ends leaves the value to chance, it is not known; `otherwise` says why.

        Examples
        --------
        >>> friction = Estimate.normal("sliding friction", -0.1, sd=0.1, unit="N", method="")
        >>> friction.within(0.0).value, friction.within(0.0).known
        (0.0, True)
        >>> friction.scaled(10, "N").within(0.0, high=5.0).includes(-0.1), friction.within(0.2).known
        (False, False)
        """
        if not self.known or any(map(math.isnan, self.interval)):  # nothing to cut; the status says why
            return self
        ends = max(low, self.interval[0]), min(high, self.interval[1])
        outside = not low <= self.value <= high
        if not outside and ends == self.interval:
            return self
        if ends[0] > ends[1] or (outside and not math.isfinite(self.sd)):
            bound = f"below {low:g}" if self.value < low else f"above {high:g}"
            unit = "" if self.unit == "1" else f" {self.unit}"
            return self.unknown(otherwise or f"the record gives a value {bound}{unit}, which can not be")
        return replace(self, value=min(max(self.value, low), high), interval=ends)

    def includes(self, value: float) -> bool:
        """Whether the 95 % interval holds `value`."""
        return self.interval[0] <= value <= self.interval[1]

    def doubted(self, status: str) -> Estimate:
        """The same with this status, where it has none of its own yet."""
        return replace(self, status=status) if self.status == "ok" else self

    @property
    def spread(self) -> float:
        """The standard deviation that the interval amounts to, on the side that is closed; without any, `sd`."""
        low, high = self.interval
        if math.isfinite(high - low):
            return (high - low) / (2 * NORMAL_95)
        closed = [abs(self.value - end) for end in self.interval if math.isfinite(end)]
        return closed[0] / NORMAL_95 if closed and math.isfinite(closed[0]) and closed[0] > 0 else self.sd

    @property
    def is_bound(self) -> bool:
        """Whether all that is told is a bound: the value is not finite, or zero and the end of its own interval."""
        low, high = self.interval
        return low < high and (not math.isfinite(self.value) or (self.value == 0.0 and 0.0 in self.interval))

    def between(self, number: Callable[[float], str]) -> str:
        """The 95 % interval in words, its ends written by `number`; an end that is none is not written."""
        low, high = self.interval
        if math.isnan(low + high):  # also of both ends open: infinity less infinity
            return UNKNOWN
        if low < high and (math.isinf(low) or math.isinf(high)):
            return f"at least {number(low)}" if math.isinf(high) else f"at most {number(high)}"
        if self.is_bound:
            return f"below {number(high)}" if low == 0 else f"above {number(low)}"
        return f"{number(low)} to {number(high)}"

    @property
    def cells(self) -> tuple[str, str, str]:
        """Name, value and 95 % interval as text, with the digits that the interval leaves."""
        write, unit = self._written()
        known, between = math.isfinite(self.value), self.between(write)
        value = f"{write(self.value)}{unit}" if known else UNKNOWN
        return self.name, value, between if between == UNKNOWN else f"{between}{unit}"

    def _repr_html_(self) -> str:
        return table_of("", [self])

    def __float__(self) -> float:
        return self.value

    def __format__(self, form: str) -> str:
        return format(self.value, form) if form else str(self)

    def __str__(self) -> str:
        write, unit = self._written()
        flag = "" if self.status == "ok" else f" [{self.status}]"
        known = self.between(write)
        if math.isnan(self.value):
            return f"{self.name} {UNKNOWN}{flag}"
        if self.is_bound:
            return f"{self.name} {known}{unit} (95 %){flag}"
        return f"{self.name} {write(self.value)}{unit} (95 %: {known}){flag}"

    def _written(self) -> tuple[Callable[[float], str], str]:
        """How its numbers are written, and the unit behind them."""
        numbers, unit, digits = np.array([self.value, *self.interval]), self.unit, decimals(self.spread, self.value)
        factor, form = 1.0, f".{digits}f"
        if digits > MOST_DECIMALS:  # zeros to be counted: a prefix, or an exponent where the unit has none
            factor, unit = prefixed(numbers, unit)
            digits = decimals(factor * self.spread, factor * self.value)
            largest = factor * np.abs(numbers[np.isfinite(numbers)]).max(initial=0.0)
            exponent = digits > MOST_DECIMALS and largest > 0
            form = f".{max(0, digits + math.floor(math.log10(largest)))}e" if exponent else f".{digits}f"
        return (lambda number: f"{factor * number:{form}}"), "" if unit == "1" else f" {unit}"


COLUMNS = ("value", "low", "high", "sd", "unit", "method", "status")  # of a table of estimates
Constant = float | str | tuple[float, float] | Estimate  # of a rig, as a person states it


class Result:
    """An answer made of estimates and arrays, which prints as its estimates."""

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every number found."""
        return tuple(value for value in vars(self).values() if isinstance(value, Estimate))

    def to_pandas(self) -> pd.DataFrame:
        """Every number found as a DataFrame: a row each, in SI, by its name.

        Returns
        -------
        pandas.DataFrame
            Columns ``value``, ``low``, ``high`` (95 %), ``sd``, ``unit``, ``method`` and ``status``.
        """
        import pandas as pd

        names = [estimate.name for estimate in self.estimates]
        rows = [(e.value, *e.interval, e.sd, e.unit, e.method, str(e.status)) for e in self.estimates]
        return pd.DataFrame(rows, index=pd.Index(names, name="quantity"), columns=COLUMNS)

    def to_xarray(self) -> xr.Dataset:
        """The same as an xarray Dataset over ``quantity``."""
        dataset: xr.Dataset = self.to_pandas().to_xarray()
        return dataset

    def _repr_html_(self) -> str:
        return table_of(self._titled, self.estimates)

    @property
    def _titled(self) -> str:
        status = getattr(self, "status", "ok")
        return f"{getattr(self, 'name', type(self).__name__)}{'' if status == 'ok' else f' [{status}]'}"

    def __repr__(self) -> str:
        return "\n  ".join([f"{self._titled}:", *map(str, self.estimates)])


def table_of(title: str, estimates: Iterable[Estimate]) -> str:
    """Estimates as a table in HTML; what speaks against some of them stands once, below."""
    reasons: dict[str, int] = {}
    rows = []
    for estimate in estimates:
        marks = [str(reasons.setdefault(doubt.words, len(reasons) + 1)) for doubt in doubts_of(estimate.status)]
        rows.append((*estimate.cells, " ".join(marks), estimate.method))
    notes = [f"{n} {reason}" for reason, n in reasons.items()]
    return html_table(title, ("quantity", "value", "95 % interval", "", "method"), rows, notes)


def plain(value: Any) -> Any:
    """What an answer holds as plain data for JSON; a number that is not finite becomes ``None``."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, tuple | list | np.ndarray):
        return [plain(entry) for entry in value]
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    return value


def decimals(sd: float, value: float) -> int:
    """Decimals worth printing: one significant digit of the uncertainty, four of an exact value, seven at most."""
    scale = max(sd, abs(value) * 1e-6) if sd > 0 and math.isfinite(sd) else abs(value) * 1e-3
    return 3 if scale <= 0 or not math.isfinite(scale) else min(12, max(0, -math.floor(math.log10(scale))))
