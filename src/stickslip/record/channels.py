"""The channel vocabulary: the names that every question asked of a Record understands."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from numbers import Real

from stickslip.errors import RecordError

UNSTATED = " (no unit stated, "  # how a channel's source tells it


@dataclass(frozen=True)
class Quantity:
    """What a channel of the vocabulary measures, and the SI units it may be kept in (the first is usual)."""

    words: str
    units: tuple[str, ...]


VOCABULARY: dict[str, Quantity] = {
    "x": Quantity("displacement", ("m",)),
    "z": Quantity("base displacement", ("m",)),
    "v": Quantity("velocity", ("m/s",)),
    "a": Quantity("acceleration", ("m/s^2",)),
    "friction": Quantity("friction force, positive against positive velocity", ("N", "N m")),
    "coefficient": Quantity("coefficient of friction, positive against positive velocity", ("1",)),
    "load": Quantity("load cell", ("N", "N m")),
    "force": Quantity("applied force", ("N", "N m")),
    "normal": Quantity("normal force", ("N",)),
    "theta": Quantity("angle", ("rad",)),
    "reference": Quantity("position that a controller is told to reach", ("rad", "m")),
    "motor": Quantity("position of a motor before its gear (unit 1: in counts)", ("rad", "m", "1")),
    "current": Quantity("motor current", ("A",)),
    "bodies": Quantity("torque that the bodies of a robot take of a joint's", ("N m", "N")),
    "temperature": Quantity("temperature", ("K",)),
    "sound": Quantity("sound pressure (unit 1: not calibrated)", ("Pa", "1")),
    "y": Quantity("displacement in the normal direction", ("m",)),
    "normal_acceleration": Quantity("acceleration in the normal direction", ("m/s^2",)),
    "torsion_velocity": Quantity("angular velocity in torsion", ("rad/s",)),
}

RULES = {  # of a channel's details: what each is, and what to pass
    "delay": ("a delay is a finite time in seconds", "pass a number"),
    "noise": ("noise is a standard deviation in {unit}, zero or more", "pass a number, or None where it is not known"),
    "gain_sd": ("the standard deviation of a gain is a part of it, from 0 to 1", "pass a number: 0.01 is 1 %"),
    "mount": ("a mount is a resonance in Hz and a damping ratio", "pass two numbers: (125.0, 0.1)"),
    "inertia": ("an inertia is a mass in kg", "pass a number"),
    "discharge": ("a discharge is a positive time constant in seconds", "pass a number, or None"),
}


@dataclass(frozen=True)
class Channel:
    """What is known of one channel beside its samples.

    What makes no sense is refused with a RecordError: words that are no text, a delay that is not finite, a noise
    or a deviation below zero, a unit that does not fit the vocabulary.

    Attributes
    ----------
    name : str
        Key in the Record; a word of the vocabulary, or any other identifier.
    unit : str
        SI unit of the samples.
    quantity : str
        What it measures, in words.
    source : str
        The column it came from, with the arithmetic applied ("vir * 35.1507 [N]"); the function that made it
        for a computed channel.
    sensitivity : str
        The sensor's sensitivity, as given ("500 mV/lbf"); already applied to the samples.
    delay : float
        Time [s] by which the samples lag what they measure; not yet applied.
    noise : float or None
        Standard deviation [unit] of the channel's noise where known; otherwise estimated when needed.
    mount : tuple of (float, float), or None
        Resonance [Hz] and damping ratio of what the sensor stands on, where it matters.
    inertia : float
        Mass [kg] between the contact and a load cell, whose inertia the cell measures too.
    discharge : float or None
        Time constant [s] with which a piezoelectric sensor forgets; None: it does not.
    gain_sd : float
        Standard deviation of its gain, relative to it: 0.01 of a calibration good to 1 %; 0 is exact.
    assumed : bool
        Whether nobody stated its unit, and the usual one of its kind was taken.
    """

    name: str
    unit: str
    quantity: str = ""
    source: str = ""
    sensitivity: str = ""
    delay: float = 0.0
    noise: float | None = None
    mount: tuple[float, float] | None = None
    inertia: float = 0.0
    discharge: float | None = None
    gain_sd: float = 0.0
    assumed: bool = False

    @property
    def column(self) -> str:
        """The column that it came from, as a channel map names it."""
        return self.source.partition(UNSTATED)[0]

    def __post_init__(self) -> None:
        described(checked_name(self.name), self.unit)
        for detail in ("unit", "quantity", "source", "sensitivity"):
            value = getattr(self, detail)
            if not isinstance(value, str) or (detail == "unit" and not value):
                raise RecordError(
                    f"{detail} = {value!r} of channel {self.name}", f"the {detail} is stated in words", "pass a text"
                )
        fine = {
            "delay": _is_finite(self.delay),
            "noise": self.noise is None or (_is_finite(self.noise) and self.noise >= 0),
            "gain_sd": _is_finite(self.gain_sd) and 0 <= self.gain_sd < 1,
            "mount": self.mount is None or _is_mount(self.mount),
            "inertia": _is_finite(self.inertia),
            "discharge": self.discharge is None or (_is_finite(self.discharge) and self.discharge > 0),
        }
        for detail, (rule, step) in RULES.items():
            if not fine[detail]:
                value = f"{detail} = {getattr(self, detail)!r} of channel {self.name}"
                raise RecordError(value, rule.format(unit=self.unit), step)


def _is_mount(value: object) -> bool:
    if not (isinstance(value, tuple) and len(value) == 2 and all(map(_is_finite, value))):
        return False
    return bool(value[0] > 0 and value[1] >= 0)


def _is_finite(value: object) -> bool:
    return type(value) is not bool and isinstance(value, Real) and math.isfinite(value)


def checked_name(name: str) -> str:
    """`name`, if it can name a channel."""
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        raise RecordError(
            f"channel name '{name}'",
            "a channel is named by letters, digits and _",
            f"use one of {', '.join(VOCABULARY)} or a word of your own",
        )
    return name


def described(name: str, unit: str) -> str:
    """The quantity in words, after checking that the vocabulary's unit fits the name."""
    quantity = VOCABULARY.get(name)
    if quantity is None:
        return name
    if unit not in quantity.units:
        raise RecordError(
            f"channel {name} is given in {unit}",
            f"{name} is {quantity.words}, in {' or '.join(quantity.units)}",
            "correct the unit, or give the channel another name",
        )
    return quantity.words
