"""A unit is parsed once, at the door; inside, everything is SI.

Common laboratory spellings are read from a table, everything else by pint (imported only then).
"""

from __future__ import annotations

import collections
import functools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ModelError, RecordError

GRAVITY = 9.80665  # m/s^2, standard gravity (CGPM 1901)
POUND_FORCE = 4.4482216152605  # N
INCH = 0.0254  # m
MISMATCH = "another quantity"  # the kind of error where a unit is one of something else
NOTHING = 1e-12  # what is smaller is rounding, in every unit that has prefixes
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
_PREFIXED = ("m", "m/s", "m/N", "N", "N m", "N s/m", "s", "Pa", "J", "V")
_STIFF = 1e6  # N/m, from which a stiffness has a prefix
_READABLE = ("N", "N m", "N s/m", "V")  # a few hundredths of these are read more easily than thousandths
LONGEST = 40  # characters of a unit; "kg m^2/A/s^2.5" has 14
LONGEST_VALUE = 100  # characters of a number with its unit
_LETTER = "A-Za-zÀ-ÖØ-öø-ÿΑ-ω_°%‰ΩÅ"  # no digits but 0 to 9: pint reads a raised one as a power
_POWER = r"-?(?:[1-9](?:\.5)?|0?\.5)|\([1-9]/2\)"
_TERM = rf"[{_LETTER}][{_LETTER}0-9]*(?:\^(?:{_POWER}))?"
_CHAIN = rf"{_TERM}(?:[ /]{_TERM})*"
_UNIT = re.compile(rf"(1/)?({_CHAIN})(?:/\(({_CHAIN})\))?")  # of all that pint would evaluate, only this reaches it
_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
PLUS_MINUS = r"(?:±|\+/-|\+-)"
_SI_TERM = re.compile(r"([A-Za-z]+)(?:\^([0-9]))?")
_BASES = {  # of what laws are made of: to ask pint takes a second, the first time
    "kg": {"mass": 1}, "m": {"length": 1}, "s": {"time": 1}, "N": {"mass": 1, "length": 1, "time": -2}, "rad": {},
}  # fmt: skip
_SPREAD = re.compile(rf"({_NUMBER})\s*(%?)\s*(.*)")  # behind the sign
_BRACKETED = re.compile(r"\((.*)\)\s*(.*)")  # (2.42 ± 0.02) kg
_CONCISE = re.compile(r"([-+]?[0-9]+\.?([0-9]*))\(([0-9]*\.?[0-9]+)\)(?:[eE]([-+]?[0-9]+))?\s*(.*)")  # 2.42(2) kg


@dataclass(frozen=True)
class Unit:
    """A unit as written, and what turns its numbers into SI: ``si_value = scale * value + zero``.

    Attributes
    ----------
    text : str
        The unit as the user or the file wrote it.
    scale : float
        Factor to SI.
    si : str
        Name of the SI unit, spelled in one way throughout ("m/s^2", "N s/m", "1").
    zero : float
        What a reading of nothing is in SI: of a temperature in Celsius 273.15 K.

    Raises
    ------
    RecordError
        The scale is 0 or not finite.
    """

    text: str
    scale: float
    si: str
    zero: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.scale) or self.scale == 0:
            raise RecordError(
                f"unit '{self.text}' is {self.scale:g} {self.si}",
                "a unit is a finite part or multiple of its SI unit",
                "correct the unit or the sensitivity",
            )


def _prefixed(base: str, si: str, scale: float, prefixes: str) -> dict[str, tuple[float, str]]:
    factors = {"": 1.0, "k": 1e3, "M": 1e6, "c": 1e-2, "d": 1e-1, "m": 1e-3, "u": 1e-6, "n": 1e-9}
    return {p + base: (factors[p] * scale, si) for p in ["", *prefixes]}


_TABLE: dict[str, tuple[float, str]] = {
    "1": (1.0, "1"), "": (1.0, "1"), "-": (1.0, "1"), "%": (0.01, "1"), "FS": (1.0, "1"), "dimensionless": (1.0, "1"),
    **_prefixed("m", "m", 1.0, "kcdmun"), "micron": (1e-6, "m"), "microns": (1e-6, "m"), "meter": (1.0, "m"),
    "in": (INCH, "m"), "inch": (INCH, "m"), "mil": (INCH / 1000, "m"), "ft": (12 * INCH, "m"),
    **_prefixed("m/s", "m/s", 1.0, "kcdmun"), "in/s": (INCH, "m/s"), "inch/s": (INCH, "m/s"), "km/h": (1 / 3.6, "m/s"),
    **_prefixed("m/s^2", "m/s^2", 1.0, "cmu"),
    "g0": (GRAVITY, "m/s^2"), "g_0": (GRAVITY, "m/s^2"), "gn": (GRAVITY, "m/s^2"), "gal": (0.01, "m/s^2"),
    "G": (GRAVITY, "m/s^2"),
    **_prefixed("N", "N", 1.0, "kMcdmu"), "lbf": (POUND_FORCE, "N"), "kip": (1000 * POUND_FORCE, "N"),
    "kgf": (GRAVITY, "N"), "gf": (GRAVITY / 1000, "N"),
    "N/m": (1.0, "N/m"), "N/mm": (1e3, "N/m"), "kN/m": (1e3, "N/m"), "N/um": (1e6, "N/m"),
    "lbf/in": (POUND_FORCE / INCH, "N/m"),
    "N s/m": (1.0, "N s/m"), "kN s/m": (1e3, "N s/m"), "N s/mm": (1e3, "N s/m"), "kg/s": (1.0, "N s/m"),
    **_prefixed("g", "kg", 1e-3, "km"), "t": (1e3, "kg"), "lbm": (0.45359237, "kg"),
    "rad": (1.0, "rad"), "mrad": (1e-3, "rad"), "deg": (math.pi / 180, "rad"), "degree": (math.pi / 180, "rad"),
    "degrees": (math.pi / 180, "rad"), "°": (math.pi / 180, "rad"), "rev": (2 * math.pi, "rad"),
    "rad/s": (1.0, "rad/s"), "deg/s": (math.pi / 180, "rad/s"), "rpm": (math.pi / 30, "rad/s"),
    "N m": (1.0, "N m"), "Nm": (1.0, "N m"), "mNm": (1e-3, "N m"), "mN m": (1e-3, "N m"),
    "N m/rad": (1.0, "N m/rad"), "Nm/rad": (1.0, "N m/rad"), "mN m/rad": (1e-3, "N m/rad"),
    "mNm/rad": (1e-3, "N m/rad"), "N m/deg": (180 / math.pi, "N m/rad"), "1/s": (1.0, "1/s"),
    "rev/s": (2 * math.pi, "rad/s"), "rev/min": (math.pi / 30, "rad/s"), "rad/s^2": (1.0, "rad/s^2"),
    "N m s/rad": (1.0, "N m s/rad"), "Nm s/rad": (1.0, "N m s/rad"), "N m/(rad/s)": (1.0, "N m s/rad"),
    "mNm s/rad": (1e-3, "N m s/rad"), "mN m s/rad": (1e-3, "N m s/rad"),
    "kg m^2": (1.0, "kg m^2"), "kgm^2": (1.0, "kg m^2"), "kg cm^2": (1e-4, "kg m^2"), "g cm^2": (1e-7, "kg m^2"),
    "N m/A": (1.0, "N m/A"), "Nm/A": (1.0, "N m/A"), "mNm/A": (1e-3, "N m/A"), "mN m/A": (1e-3, "N m/A"),
    "N/A": (1.0, "N/A"), "N cm": (0.01, "N m"), "kgf cm": (0.01 * GRAVITY, "N m"),
    "ozf in": (POUND_FORCE / 16 * INCH, "N m"), "oz in": (POUND_FORCE / 16 * INCH, "N m"),
    "V/N": (1.0, "V/N"), "V/m": (1.0, "V/m"), "V/Pa": (1.0, "V/Pa"),
    "V s^2/m": (1.0, "V s^2/m"), "V s/m": (1.0, "V s/m"),
    **_prefixed("Pa", "Pa", 1.0, "kMmu"), "bar": (1e5, "Pa"), "mbar": (1e2, "Pa"), "psi": (6894.757293168361, "Pa"),
    **_prefixed("s", "s", 1.0, "mun"), "sec": (1.0, "s"), "min": (60.0, "s"), "h": (3600.0, "s"),
    **_prefixed("Hz", "Hz", 1.0, "kM"),
    **_prefixed("V", "V", 1.0, "mu"), "volt": (1.0, "V"), "volts": (1.0, "V"), **_prefixed("A", "A", 1.0, "m"),
}  # fmt: skip

# Temperatures on scales of their own, where a temperature is wanted: elsewhere they are no multiple of an SI unit.
_SCALES = {
    **dict.fromkeys(("°C", "degC", "celsius", "Celsius"), (1.0, 273.15)),
    **dict.fromkeys(("°F", "degF"), (5 / 9, 459.67 * 5 / 9)),
}  # fmt: skip

# What a bare symbol means depends on what is measured: pint reads "g" as gram, "G" as gauss, "lb" as mass.
_BY_QUANTITY = {
    ("g", "m/s^2"): "g0", ("lb", "N"): "lbf", ("lbs", "N"): "lbf", ("kg", "N"): "kgf", ("lb", "kg"): "lbm",
    ("mg", "m/s^2"): "mg0", ("rpm", "Hz"): "rpm_turns", ("rev/min", "Hz"): "rpm_turns",
}  # fmt: skip
_TABLE["mg0"] = (GRAVITY / 1000, "m/s^2")
_TABLE["rpm_turns"] = (1 / 60, "Hz")  # of a frequency, turns are counted; of a rate of rotation, radians
_SIGNS = str.maketrans({"μ": "u", "µ": "u", "²": "^2", "³": "^3", "·": " "})


def _normal(text: str) -> str:
    text = text.strip().translate(_SIGNS).replace("**", "^")
    text = re.sub(r"\s+per\s+", "/", re.sub(r"(?<=[A-Za-z])\.(?=[A-Za-z]|$)", " ", text)).strip()  # N.m, in.
    text = re.sub(r"(?<=[A-Za-z])2\b", "^2", text)  # m/s2
    text = re.sub(r"\bsec(s|onds?)?\b", "s", text)
    text = re.sub(r"/\s*s\s*/\s*s\b", "/s^2", text)
    return re.sub(r"\s*\*\s*|\s+", " ", text).replace(" /", "/").replace("/ ", "/")


def parse_unit(text: str, expect: str | None = None) -> Unit:
    """Read a unit, as an instrument or a person writes it.

    Parameters
    ----------
    text : str
        The unit: ``"mm"``, ``"m/s2"``, ``"g"``, ``"N s/m"``, ``"500 mV/lbf"`` has its own reader,
        :func:`parse_value`.
    expect : str, optional
        The SI unit that the quantity is measured in. It settles symbols with two meanings ("g" is gravity for
        an acceleration, gram for a mass) and is enforced.

    Returns
    -------
    Unit

    Raises
    ------
    RecordError
        The unit is unknown, is no multiple of an SI unit (dB; degC, unless "K" is expected), or measures
        something else than expected.

    Examples
    --------
    >>> parse_unit("mm").scale, parse_unit("g", expect="m/s^2").scale
    (0.001, 9.80665)
    """
    name = _normal(text) if len(text) <= LONGEST else text
    if expect is not None:
        name = _BY_QUANTITY.get((name, expect), name)
    if name not in _TABLE and re.fullmatch(r"[A-Z][a-z]{2,}", name):  # a word: Volts, Newtons
        name = name.lower()
    if expect == "K" and text.strip() in _SCALES:
        return Unit(text, _SCALES[text.strip()][0], "K", _SCALES[text.strip()][1])
    known = _TABLE.get(name) or _by_pint(name)
    if known is None:
        raise RecordError(
            f"unit '{text if len(text) <= LONGEST else f'{text[:LONGEST]}...'}' is not known",
            "a unit is written like mm, m/s^2, g, N, lbf or deg, and is a multiple of an SI unit",
            "correct it in the file's header or in channels= or units=",
        )
    scale, si = known
    if expect is not None and si != expect:
        raise RecordError(
            f"unit '{text}' is measured in {si}",
            f"this quantity is measured in {expect}",
            "correct the unit or the channel's name",
            kind=MISMATCH,
        )
    return Unit(text, scale, si)


def parse_value(text: str | float, expect: str) -> float:
    """Read a number with a unit ("250 g", "1191 N/m") into SI; a bare number is SI already.

    Parameters
    ----------
    text : str or float
        The number, with or without its unit.
    expect : str
        The SI unit of the quantity ("kg", "N/m", "N s/m", "V/N").

    Returns
    -------
    float

    Raises
    ------
    RecordError
        Not a finite number, or a unit that measures something else.

    Examples
    --------
    >>> parse_value("250 g", "kg"), parse_value("1.2 N/mm", "N/m"), parse_value(3, "kg"), parse_value("150 rpm", "Hz")
    (0.25, 1200.0, 3.0, 2.5)
    """
    stated = str(text).strip()
    match = re.fullmatch(rf"({_NUMBER})\s*(.*)", stated) if len(stated) <= LONGEST_VALUE else None
    if match and re.match(r",\d", match[2]):
        raise RecordError(
            f"'{stated}' has a decimal comma",
            "a number is written with a point",
            f"write {stated.replace(',', '.', 1)}",
        )
    unit = parse_unit(match[2], expect) if match and match[2] else Unit(expect, 1.0, expect)
    value = float(match[1]) * unit.scale + unit.zero if match else math.nan
    if not math.isfinite(value):
        raise RecordError(
            f"'{stated[:LONGEST_VALUE]}' is not a finite number",
            f"a number in {expect} is needed",
            f"write it like '2.5 {expect}'",
        )
    return value


def parse_uncertain(stated: str | float | Sequence[str | float], expect: str) -> tuple[float, float]:
    """Read a number and its standard uncertainty, in the ways of writing of the GUM (7.2.2), into SI.

    Parameters
    ----------
    stated : str, float or pair
        "2.42 ± 0.02 kg" (also ``+-`` and ``+/-``), "(2.42 ± 0.02) kg", "2.42 kg ± 20 g", "2.42 kg ± 1 %",
        "2.42(2) kg"; a pair of value and uncertainty; or what :func:`parse_value` reads, which is exact.
    expect : str
        The SI unit of the quantity.

    Returns
    -------
    tuple of float
        The value and its standard deviation, 0 of an exact one.

    Raises
    ------
    RecordError
        As :func:`parse_value`; or an uncertainty that is negative, without its value, or a part of zero.

    Examples
    --------
    >>> parse_uncertain("2.42 ± 0.02 kg", "kg"), parse_uncertain("2310(5) N/m", "N/m"), parse_uncertain("250 g", "kg")
    ((2.42, 0.02), (2310.0, 5.0), (0.25, 0.0))
    """
    if isinstance(stated, str) and len(stated) <= LONGEST_VALUE:
        return _apart(stated.strip(), expect)
    if isinstance(stated, str) or not isinstance(stated, Sequence):
        return parse_value(stated, expect), 0.0
    if len(stated) != 2:
        raise _uncertain(stated, expect, "a pair is a value and its uncertainty")
    value, sd = (parse_value(number, expect) for number in stated)
    return value, _checked_sd(sd, stated, expect)


def _apart(stated: str, expect: str) -> tuple[float, float]:
    """:func:`parse_uncertain` of a text."""
    value, *spread = (part.strip() for part in re.split(PLUS_MINUS, _spelled_out(stated), maxsplit=1))
    if not spread:
        return parse_value(stated, expect), 0.0
    number = _SPREAD.fullmatch(spread[0])
    if not value or number is None:
        raise _uncertain(stated, expect, "a value stands before the sign, and a number behind it")
    bare, (size, percent, unit) = re.fullmatch(_NUMBER, value), number.groups()
    if not bare and bool(unit) == bool(percent):
        raise _uncertain(stated, expect, "behind a value with a unit stands a number with one, or per cent")
    level = parse_value(f"{value} {unit}" if bare else value, expect)
    if percent and level == 0:
        raise _uncertain(stated, expect, "a per cent of 0 is no uncertainty")
    sd = float(size) / 100 * abs(level) if percent else parse_value(f"{size} {unit}", expect)
    return level, _checked_sd(sd, stated, expect)


def _spelled_out(stated: str) -> str:
    """Of "2.42(2) kg" and "(2.42 ± 0.02) kg" "2.42 ± 0.02 kg"; any other text as it is."""
    if concise := _CONCISE.fullmatch(stated):
        digits, decimals, last, power, unit = concise.groups(default="0")
        places = 0 if "." in last else len(decimals)
        return f"{digits}e{power} ± {last}e{int(power) - places} {unit}"
    bracketed = _BRACKETED.fullmatch(stated)
    return " ".join(bracketed.groups()) if bracketed else stated


def _checked_sd(sd: float, stated: object, expect: str) -> float:
    if not 0 <= sd < math.inf:
        raise _uncertain(stated, expect, "an uncertainty is a standard deviation, finite and not negative")
    return sd


def _uncertain(stated: object, expect: str, rule: str) -> RecordError:
    return RecordError(f"'{str(stated)[:LONGEST_VALUE]}'", rule, f"write it like '2.5 ± 0.1 {expect}'")


def parse_constant(name: str, text: str | float, expect: str) -> float:
    """:func:`parse_value` of a constant of a rig; a mistake is told with the constant's name.

    Examples
    --------
    >>> parse_constant("lever", "6 cm", "m")
    0.06
    """
    try:
        value = parse_value(text, expect)
    except RecordError as error:
        raise ModelError(f"{name} = {text!r}", f"{error.value}; {error.rule}", f"correct the {name}") from error
    if not value > 0:
        raise ModelError(f"{name} = {text!r}", f"a {name} is positive", f"correct the {name}")
    return value


def parse_range(text: str, expect: str) -> tuple[float, float]:
    """LOW:HIGH as two numbers in SI, each as :func:`parse_value` reads it.

    Examples
    --------
    >>> parse_range("500:8 kHz", "Hz")
    (500.0, 8000.0)
    """
    try:
        low, high = (parse_value(end, expect) for end in text.split(":"))
    except (RecordError, ValueError) as error:
        raise ModelError(
            f"'{text}' is no range", f"a range is written LOW:HIGH in {expect}", "write it as in 500:8000"
        ) from error
    return low, high


def prefixed(values: Array | float, unit: str) -> tuple[float, str]:
    """Factor and unit that bring the largest of `values` between 1 and 1000.

    Examples
    --------
    >>> prefixed(np.array([0.002, -0.011]), "m")
    (1000.0, 'mm')
    """
    finite = np.abs(np.atleast_1d(values)[np.isfinite(np.atleast_1d(values))])
    peak = float(finite.max()) if finite.size else 0.0
    plain = unit not in _PREFIXED and not (unit == "N/m" and peak >= _STIFF)
    if plain or peak < NOTHING or (unit in _READABLE and 0.01 <= peak < 1):
        return 1.0, spelled(unit)
    size, prefix = next(((s, p) for s, p in _PREFIXES if peak >= s), _PREFIXES[-1])
    return (1.0, unit) if size == 1.0 or (unit == "s" and size > 1) else (1.0 / size, prefix + unit)


def spelled(unit: str) -> str:
    """A unit as it is printed: "m/s²"."""
    return unit.replace("^2", "²").replace("^3", "³")


@functools.lru_cache(maxsize=1024)  # a file of many strange units keeps no more of them
def _by_pint(name: str) -> tuple[float, str] | None:
    """Factor and SI unit of names with powers; None for anything else."""
    import pint

    match = _UNIT.fullmatch(name) if len(name) <= LONGEST else None
    if match is None:
        return None
    registry = _registry()
    try:
        units = registry.UnitsContainer(_powers(*match.groups()))
        zero, one = (registry.Quantity(value, units).to_base_units() for value in (0.0, 1.0))
    except (pint.errors.PintError, OverflowError):
        return None
    scale = float(one.magnitude)
    if zero.magnitude != 0 or not math.isfinite(scale) or scale == 0:  # degC and dB have no factor
        return None
    for si, dimension in _dimensions().items():
        if dimension == one.dimensionality and si != "rad":
            return scale, si
    si = f"{one.units:~C}".replace("**", "^").replace("*", " ") or "1"
    return (scale, si) if si == "1" or _UNIT.fullmatch(si) else None  # what is written is read again


def dimensions(unit: str) -> Mapping[str, float]:
    """The powers of mass, length and time in an SI unit, without those that are zero.

    Examples
    --------
    >>> dimensions("N s/m")
    {'mass': 1, 'time': -1}
    """
    above, _, below = unit.partition("/")
    terms = [(sign, *term) for sign, part in ((1, above), (-1, below)) for term in _SI_TERM.findall(part)]
    if any(name not in _BASES for _, name, _ in terms):
        of = _registry().Quantity(1.0, unit.replace(" ", "*")).dimensionality
        return {name.strip("[]"): power for name, power in of.items()}
    powers = collections.Counter[str]()
    for sign, name, power in terms:
        powers.update({base: sign * size * int(power or 1) for base, size in _BASES[name].items()})
    return {base: power for base, power in powers.items() if power}


def _powers(reciprocal: str | None, chain: str, below: str | None) -> dict[str, float]:
    """The power of each of pint's names in ``chain/(below)``, or in ``1/chain/(below)``."""
    registry, powers = _registry(), collections.defaultdict[str, float](float)
    for terms, sign in ((f"{'/' if reciprocal else ' '}{chain}", 1), (f" {below}" if below else "", -1)):
        for joint, name, power in re.findall(rf"([ /])([^ /^]+)(?:\^({_POWER}))?", terms):
            halves = re.fullmatch(r"\((\d)/2\)", power)
            size = float(halves[1]) / 2 if halves else float(power or 1)
            powers[registry.get_name(name)] += sign * size * (-1 if joint == "/" else 1)
    return powers


@functools.cache
def _registry():  # type: ignore[no-untyped-def]  # pint's registry type exists only once pint is imported
    import pint

    return pint.UnitRegistry()


@functools.cache
def _dimensions() -> dict[str, object]:
    registry = _registry()
    names = dict.fromkeys(si for _, si in _TABLE.values() if si not in ("1", "rad", "rad/s"))
    return {si: registry.Quantity(1.0, si.replace(" ", "*")).dimensionality for si in names}
