"""Which channel a column of a file may be: by its name, in the words of several languages, and by its unit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.record.channels import VOCABULARY, Channel
from stickslip.record.record import Record
from stickslip.units import prefixed

# The first word that stands in a column's name decides, where its unit fits; the narrower ones come first.
WORDS = (
    ("friction", r"fric|reib|frott|^f[rf]$"),
    ("normal", r"normal|^f?n$|clamp|preload|anpress"),
    ("z", r"base|table|shaker|ground|tisch|fuss|fuß|support|drive|stage|^z$"),
    ("load", r"load|cell|messdose|kraft|force|^f\d?$"),
    ("a", r"acc|beschl|^a[xyz]?$"),
    ("v", r"vel|speed|geschw|vitesse|^v[xyz]?$"),
    ("theta", r"angle|winkel|theta|phi|rot|ang"),
    ("sound", r"mic|sound|schall|mikro|press|noise"),
    ("x", r"disp|weg|pos|laser|lvdt|plate|mass|slider|schlitten|auslenk|dist|^[xsq]m?$"),
)
BY_UNIT = {"m": ("x", "z"), "m/s": ("v",), "m/s^2": ("a",), "N": ("load",), "N m": ("load",), "rad": ("theta",)}
WIDE = {"m": 0.2, "rad": 6.3}  # spans above which an unstated unit is a smaller one
SMALLER = {"m": "mm", "rad": "deg"}


@dataclass(frozen=True)
class Guess:
    """What a column may be.

    Attributes
    ----------
    name : str
        The channel that it was read as.
    column : str
        As it is called in a channel map.
    unit : str
        As the file states it, or a likely one; empty where it has none.
    channel : str
        What it may be; empty where nothing speaks for anything.
    why : str
        What speaks for it.
    span : float
        From its least to its greatest value, in `si`.
    si : str
        Unit in which it was read.
    stated : bool
        Whether the file states the unit.
    """

    name: str
    column: str
    unit: str
    channel: str
    why: str
    span: float
    si: str
    stated: bool

    @property
    def spanned(self) -> str:
        """Its span, in a readable unit where one is stated."""
        factor, unit = prefixed(self.span, self.si)
        return f"{factor * self.span:.4g} {unit}" if self.stated and unit != "1" else f"{self.span:.4g}"

    @property
    def words(self) -> str:
        """What it measures, in words."""
        return VOCABULARY[self.channel].words if self.channel else "nothing known"

    @property
    def text(self) -> str:
        """As it stands in a channel map."""
        return f"{self.column} [{self.unit}]" if self.unit else self.column


def guess_columns(record: Record) -> list[Guess]:
    """What the columns of a record that was read without a channel map may be.

    Parameters
    ----------
    record : Record
        From ``read_record(path)``.

    Returns
    -------
    list of Guess
        One a channel, in the file's order; no channel is guessed twice.

    Examples
    --------
    >>> from stickslip.record.record import Record
    >>> wave = 1e-3 * np.sin(np.arange(100.0))
    >>> units = {"Weg_Tisch": "mm", "plate": "mm", "acc": "m/s^2"}
    >>> record = Record.of(dict.fromkeys(units, wave), fs=100.0, units=units)
    >>> [(guess.name, guess.channel) for guess in guess_columns(record)]
    [('Weg_Tisch', 'z'), ('plate', 'x'), ('acc', 'a')]
    """
    taken: dict[str, tuple[str, str]] = {}
    for find in (_by_itself, _by_word, _by_unit):
        for channel in record.channels.values():
            if channel.name not in taken:
                guess = find(channel, {channel_taken for channel_taken, _ in taken.values()})
                if guess[0]:
                    taken[channel.name] = guess
    return [_guess(record, channel, *taken.get(channel.name, ("", ""))) for channel in record.channels.values()]


def _by_itself(channel: Channel, taken: set[str]) -> tuple[str, str]:
    return (channel.name, "its name") if channel.name in VOCABULARY else ("", "")


def _by_word(channel: Channel, taken: set[str]) -> tuple[str, str]:
    for name, pattern in WORDS:
        if name not in taken and _fits(channel, name) and re.search(pattern, channel.name.lower().strip("_")):
            return name, "its name"
    return "", ""


def _by_unit(channel: Channel, taken: set[str]) -> tuple[str, str]:
    if channel.column != channel.source:
        return "", ""
    free: Sequence[str] = [name for name in BY_UNIT.get(channel.unit, ()) if name not in taken]
    return (free[0], "its unit alone") if free else ("", "")


def _fits(channel: Channel, name: str) -> bool:
    return channel.unit in VOCABULARY[name].units or (channel.unit == "1" and "[" not in channel.source)


def _guess(record: Record, channel: Channel, name: str, why: str) -> Guess:
    finite = record[channel.name][np.isfinite(record[channel.name])]
    span = float(np.ptp(finite)) if len(finite) else 0.0
    source = channel.column or channel.name
    title, _, unit = source.partition(" [")
    stated = bool(unit)
    usual = VOCABULARY[name].units[0] if name else ""
    if not stated and usual:
        unit = SMALLER[usual] if span > WIDE.get(usual, float("inf")) else usual
    column = title if re.fullmatch(r"[A-Za-z_]\w*|#\d+", title) else f"`{title}`"
    return Guess(channel.name, column, unit.rstrip("]"), name, why, span, channel.unit, stated)
