"""What a chapter starts from, as the page shows it: in words and units, with the remarks of given.toml."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip.units import prefixed, spelled
from stickslip_thesis.printed import HERE, Given

WITHOUT_UNITS = ("decay", "errors", "schematic", "inertial")  # sections whose equations have none
UNITS = {
    "mass": "kg", "stiffness": "N/m", "spring": "N/m", "damping": "N s/m", "contact_damping": "N s/m", "kinetic": "N",
    "friction": "N", "heavy": "N", "light": "N", "load": "N", "blow": "N", "release": "m", "resolution": "m",
    "amplitude": "m", "base": "m", "forced_base": "m", "dry": "m", "estimated_dry": "m", "speed": "m/s",
    "mounting_frequency": "Hz", "reflector": "Hz", "microphone": "m", "room": "dB", "radiator": "m^2",
    "gravity": "m/s^2", "fs": "Hz", "frequency": "Hz", "forced": "Hz", "transition": "Hz", "phase": "rad",
    "slider": "kg", "radius": "m", "face": "m^2", "distance": "m", "delay": "s",
    "natural": "rad/s", "rate": "1/(N s)", "steepness": "s/m", "constant": "s", "hold": "s", "lag": "s",
}  # fmt: skip
LETTERS = {
    "fs": "sampling rate", "dry": "dry displacement", "estimated_dry": "estimated dry displacement",
    "kinetic": "kinetic friction", "static": "static friction", "base": "amplitude of the base",
    "forced_base": "amplitude of the base, forced", "forced": "frequency, forced",
    "natural": "natural angular frequency", "steps": "steps between the extremes",
    "heavy": "heavier load", "light": "lighter load", "reflector": "bending of the reflector's beam",
    "microphone": "distance of the microphone", "room": "level of the room", "radiator": "area of the radiator",
    "mounting_share": "share of the mounting", "mounting_frequency": "frequency on the mounting",
}  # fmt: skip


@dataclass(frozen=True)
class Start:
    """A section of given.toml: what it is, and quantity, value and remark of each entry."""

    name: str
    about: str
    rows: tuple[tuple[str, str, str], ...]


def starts(given: Given) -> list[Start]:
    """The sections as they are shown.

    Examples
    --------
    >>> starts({"discharge": {"constant": 50.0}})[0].rows
    (('constant', '50 s', ''),)
    """
    notes = remarks()
    return [
        Start(_words(name), notes.get((name, ""), ""), tuple(
            (words, value, notes.get((name, key), "")) for key, held in values.items()
            for words, value in _entries(name, key, held, contact="spring" in values)
        ))
        for name, values in given.items()
    ]  # fmt: skip


def _entries(section: str, key: str, value: Any, *, contact: bool) -> Iterator[tuple[str, str]]:
    """Words and value of an entry; beside a spring, stiffness is that of the contact."""
    if isinstance(value, Mapping):
        for inner, held in value.items():
            yield f"{_words(key)}: {_words(inner)}", _told(section, inner, held)
    else:
        yield "contact stiffness" if contact and key == "stiffness" else _words(key), _told(section, key, value)


def _told(section: str, key: str, value: float | Sequence[float]) -> str:
    unit = "1" if section in WITHOUT_UNITS else UNITS.get(key, "1")
    values = np.atleast_1d(np.asarray(value, dtype=float))
    factor, name = prefixed(values, unit)
    return ", ".join(f"{each:.7g}" for each in factor * values) + ("" if name == "1" else f" {spelled(name)}")


def _words(key: str) -> str:
    words = LETTERS.get(key, key.replace("_", " "))
    return re.sub(r"([a-z])(\d)", r"\1 \2", words)


@functools.cache
def remarks() -> Mapping[tuple[str, str], str]:
    """The remarks of given.toml by section and key; that of a section by an empty key."""
    found, section, above = {}, "", ""
    for line in (HERE / "given.toml").read_text("utf-8").splitlines():
        code, _, remark = (part.strip() for part in line.partition("#"))
        key = re.match(r"\[?(\w+)", code)
        if key is None:
            above = remark
            continue
        if code.startswith("["):
            section = key[1]
        found[section, "" if code.startswith("[") else key[1]] = "; ".join(part for part in (remark, above) if part)
        above = ""
    return found
