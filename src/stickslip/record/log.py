"""What was written down beside a measurement: the surface and what was done to it, the air, the load, a remark."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from stickslip.errors import RecordError
from stickslip.units import parse_value

ZERO_CELSIUS = 273.15  # K
CELSIUS = ("°C", "degC", "celsius")
NUMBERS = {"run_in": "1", "temperature": "K", "humidity": "1", "normal": "N"}  # unit of those that are no words
TITLES = {
    "surface": "Surfaces", "lubrication": "Lubrication", "run_in": "Run-in cycles", "cleaning": "Cleaning",
    "temperature": "Temperature", "humidity": "Relative humidity", "normal": "Normal load", "operator": "Operator",
    "remark": "Remark", "photo": "Photo",
}  # fmt: skip


@dataclass(frozen=True)
class Log:
    """The log of an experiment: what no sensor reads, and friction depends on.

    Every entry may be left out. Numbers may be given as text with their unit.

    Attributes
    ----------
    surface : str
        Materials and finish ("steel on steel, ground, 400-grit paper").
    lubrication : str
        "dry", or the lubricant.
    run_in : float or None
        Cycles of sliding before the measurement.
    cleaning : str
        How the surfaces were cleaned.
    temperature : float or None
        Of the contact or the air around it [K]; "23 °C" is understood.
    humidity : float or None
        Relative humidity of the air, from 0 to 1; "45 %" is understood.
    normal : float or None
        Normal load [N].
    operator, remark : str
        Who measured, and what they saw.
    photo : str
        Name of a picture's file; it is not opened.

    Raises
    ------
    RecordError
        A value without meaning.

    Examples
    --------
    >>> log = Log(surface="steel on steel", temperature="23 °C", humidity="45 %", run_in=9000)
    >>> log.temperature, log.humidity
    (296.15, 0.45)
    >>> dict(log.rows())["Temperature"]
    '23 °C'
    """

    surface: str = ""
    lubrication: str = ""
    run_in: float | str | None = None
    cleaning: str = ""
    temperature: float | str | None = None
    humidity: float | str | None = None
    normal: float | str | None = None
    operator: str = ""
    remark: str = ""
    photo: str = ""

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            if name in NUMBERS:
                object.__setattr__(self, name, None if value is None else _number(name, value))
            elif not isinstance(value, str):
                raise RecordError(f"{name} = {value!r} in the log", "it is told in words", "pass a text")

    @classmethod
    def of(cls, entries: Mapping[str, Any]) -> Log:
        """The log with these entries by name.

        Raises
        ------
        RecordError
            An entry that a log does not have, or a value without meaning.
        """
        known = [field.name for field in fields(cls)]
        if strange := [str(name) for name in entries if name not in known]:
            raise RecordError(f"'{strange[0][:40]}' in the log", f"a log has {', '.join(known)}", "choose one of them")
        return cls(**entries)

    def entries(self) -> dict[str, Any]:
        """What was written down, by name."""
        empty = Log()
        named = {field.name: getattr(self, field.name) for field in fields(self)} if self != empty else {}
        return {name: value for name, value in named.items() if value not in ("", None)}

    def rows(self) -> list[tuple[str, str]]:
        """What was written down, as a person reads it: title and value."""
        return [(TITLES[name], _text(name, value)) for name, value in self.entries().items()]


def _number(name: str, value: Any) -> float:
    step = f"correct {name} of the log"
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise RecordError(f"{name} = {value!r} in the log", "it is a number, or a text with its unit", step)
    number = _kelvin(value) if name == "temperature" else parse_value(value, NUMBERS[name])
    if not (math.isfinite(number) and number >= 0 and (name != "humidity" or number <= 1)):
        rule = "relative humidity is from 0 to 100 %" if name == "humidity" else "it is finite and not below zero"
        raise RecordError(f"{name} = {value!r} in the log", rule, step)
    return number


def _kelvin(value: float | str) -> float:
    """A temperature in K; on its own scale where Celsius is written behind it."""
    text = str(value).strip()
    for unit in CELSIUS:
        if text.endswith(unit):
            return parse_value(text.removesuffix(unit).strip(), "1") + ZERO_CELSIUS
    return parse_value(value, "K")


def _text(name: str, value: Any) -> str:
    match name:
        case "temperature":
            return f"{value - ZERO_CELSIUS:.4g} °C"
        case "humidity":
            return f"{100 * value:.3g} %"
        case "normal":
            return f"{value:.4g} N"
        case "run_in":
            return f"{value:.10g}"
    return str(value)
