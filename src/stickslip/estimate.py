"""An answer that carries how sure it is: value, interval, unit, method, status, checks."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stickslip.units import prefixed

NORMAL_95 = 1.959963984540054  # two-sided 95 % quantile of the normal distribution
MOST_DECIMALS = 6  # printed in the plain unit


@dataclass(frozen=True)
class Estimate:
    """A number found in a record, with its 95 % interval.

    Attributes
    ----------
    name : str
        What was estimated, in the field's words ("sliding friction").
    value : float
        The estimate, in `unit`.
    interval : tuple of float
        Low and high end of the 95 % interval.
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

    Examples
    --------
    >>> print(Estimate.normal("sliding friction", 1.318, sd=0.004, unit="N", method="median of 18 half cycles"))
    sliding friction 1.318 N (95 %: 1.310 to 1.326)
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

    @classmethod
    def normal(
        cls, name: str, value: float, *, sd: float, unit: str, method: str, quantile: float = NORMAL_95, **more: Any
    ) -> Estimate:
        """An estimate whose interval is ``value -+ quantile * sd`` (pass Student's quantile for few samples)."""
        value, sd = float(value), float(sd)
        return cls(name, value, (value - quantile * sd, value + quantile * sd), sd, unit, method, **more)

    def scaled(self, factor: float, unit: str, name: str | None = None) -> Estimate:
        """The same estimate in another unit, or of a quantity proportional to it."""
        ends = sorted(factor * end for end in self.interval)
        return Estimate(
            name or self.name,
            factor * self.value,
            (ends[0], ends[1]),
            abs(factor) * self.sd,
            unit,
            self.method,
            self.status,
            self.checks,
        )

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
        ends = max(low, self.interval[0]), min(high, self.interval[1])
        outside = not low <= self.value <= high
        if not outside and ends == self.interval:
            return self
        if ends[0] > ends[1] or (outside and not math.isfinite(self.sd)):
            bound = f"below {low:g}" if self.value < low else f"above {high:g}"
            return self.unknown(otherwise or f"the record gives a value {bound} {self.unit}, which can not be")
        return replace(self, value=min(max(self.value, low), high), interval=ends)

    def includes(self, value: float) -> bool:
        """Whether the 95 % interval holds `value`."""
        return self.interval[0] <= value <= self.interval[1]

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; what is not finite becomes ``None``."""
        numbers = [x if math.isfinite(x) else None for x in (self.value, *self.interval, self.sd)]
        return {
            "name": self.name, "value": numbers[0], "interval": numbers[1:3], "sd": numbers[3], "unit": self.unit,
            "method": self.method, "status": self.status, "checks": list(self.checks),
        }  # fmt: skip

    def __str__(self) -> str:
        spread = self.sd if self.sd > 0 else self.interval[1] - self.interval[0]
        numbers, unit, digits = np.array([self.value, *self.interval]), self.unit, decimals(spread, self.value)
        form = f".{digits}f"
        if digits > MOST_DECIMALS:  # zeros to be counted: a prefix, or an exponent where the unit has none
            factor, unit = prefixed(numbers, unit)
            numbers, digits = factor * numbers, decimals(factor * spread, factor * self.value)
            largest = np.abs(numbers[np.isfinite(numbers)]).max(initial=0.0)
            exponent = digits > MOST_DECIMALS and largest > 0
            form = f".{max(0, digits + math.floor(math.log10(largest)))}e" if exponent else f".{digits}f"
        value, low, high = (f"{number:{form}}" for number in numbers)
        flag = "" if self.status == "ok" else f" [{self.status}]"
        return f"{self.name} {value}{'' if unit == '1' else f' {unit}'} (95 %: {low} to {high}){flag}"


class Result:
    """An answer made of estimates and arrays, which prints as its estimates."""

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every number found."""
        return tuple(value for value in vars(self).values() if isinstance(value, Estimate))

    def __repr__(self) -> str:
        status = getattr(self, "status", "ok")
        flag = "" if status == "ok" else f" [{status}]"
        return "\n  ".join([f"{getattr(self, 'name', type(self).__name__)}{flag}:", *map(str, self.estimates)])


def decimals(sd: float, value: float) -> int:
    """Decimals worth printing: one significant digit of the uncertainty, four of an exact value, seven at most."""
    scale = max(sd, abs(value) * 1e-6) if sd > 0 and math.isfinite(sd) else abs(value) * 1e-3
    return 3 if scale <= 0 or not math.isfinite(scale) else min(12, max(0, -math.floor(math.log10(scale))))
