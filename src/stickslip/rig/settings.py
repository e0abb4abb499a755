"""rig.toml: a rig's constants, channel map and habits, written down once for all its files.

Which channel a column of a file may be is told by its name, in the words of several languages, and by its unit."""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, Field, PlainSerializer, PlainValidator

from stickslip.errors import ModelError, RecordError
from stickslip.estimate import Estimate
from stickslip.printing import printable
from stickslip.record.channels import VOCABULARY, Channel
from stickslip.record.metadata import Log
from stickslip.record.record import RIG_UNITS, Record
from stickslip.settings import STRICT, checked, quantity, read_toml, toml_lines
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
REPAIRS = ("clock", "gaps", "missing", "spikes", "clipping", "drift")
LOAD = "normal load"
READING = ("channels", "units", "fs", "time", "delimiter", "decimal")  # options that read_record has too


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


def _row_range(value: object) -> object:
    if not re.fullmatch(r"\s*(-?\d+)?\s*:\s*(-?\d+)?\s*", str(value)):
        raise ValueError("rows are written FIRST:LAST, either of which may be left out")
    return value


def _repair(value: object) -> object:
    word, colon, channel = str(value).partition(":")
    if word not in REPAIRS or bool(colon) != bool(channel):
        raise ValueError(f"a repair is one of {', '.join(REPAIRS)}, for one channel alone as in drift:x")
    return value


def _one_or_many(value: object) -> object:
    return value if isinstance(value, Mapping) else {"*": value}


def _constant(name: str, *, positive: bool = False) -> PlainValidator:
    """A constant of the rig: a number where it is exact, an Estimate where its uncertainty is stated."""

    unit = RIG_UNITS.get(name, "N")

    def read(value: Any) -> float | Estimate:
        if isinstance(value, bool):
            raise ValueError(f"a number in {unit}, or text like '2.5 {unit}', is needed")
        try:
            constant = Estimate.stated(name, value, unit)
        except ModelError as error:
            raise ValueError(printable(f"{error.value}; {error.rule}")) from error
        if constant.value < 0 or (positive and constant.value == 0):
            raise ValueError(f"it should be greater than {'' if positive else 'or equal to '}0")
        return constant if constant.sd else constant.value

    return PlainValidator(read)


AS_PAIR = PlainSerializer(lambda value: (value.value, value.sd) if isinstance(value, Estimate) else value)


class SensorSettings(BaseModel):
    """What is known of one sensor; see :class:`Channel`.

    Attributes
    ----------
    delay : float
        Time [s] by which it is late.
    noise : float or None
        Standard deviation of its noise, in the SI unit of its channel.
    mount : (float, float) or None
        Resonance [Hz] and damping ratio of what it stands on.
    inertia : float
        Mass [kg] between the contact and a load cell.
    discharge : float or None
        Time constant [s] with which a piezoelectric sensor forgets.
    gain_sd : float
        Standard deviation of its gain, relative to it: "1 %".
    """

    model_config = STRICT

    delay: Annotated[float, quantity("s")] = 0.0
    noise: Annotated[float, Field(ge=0)] | None = None
    mount: tuple[Annotated[float, quantity("Hz"), Field(gt=0)], Annotated[float, Field(ge=0)]] | None = None
    inertia: Annotated[float, quantity("kg"), Field(ge=0)] = 0.0
    discharge: Annotated[float, quantity("s"), Field(gt=0)] | None = None
    gain_sd: Annotated[float, quantity("1"), Field(ge=0, lt=1)] = 0.0


class ShakerSettings(BaseModel):
    """What moves the base, and how far it can; see :class:`stickslip.rig.Shaker`.

    Attributes
    ----------
    stroke : float
        Largest amplitude of the displacement [m].
    lowest, highest : float
        Frequencies [Hz] between which its motion is a sine.
    velocity : float or None
        Largest velocity [m/s].
    force : float or None
        Largest force [N].
    moving_mass : float
        Of armature, table and base [kg].
    """

    model_config = STRICT

    stroke: Annotated[float, quantity("m"), Field(gt=0)]
    lowest: Annotated[float, quantity("Hz"), Field(ge=0)] = 0.0
    highest: Annotated[float, quantity("Hz"), Field(gt=0)] | None = None
    velocity: Annotated[float, quantity("m/s"), Field(gt=0)] | None = None
    force: Annotated[float, quantity("N"), Field(gt=0)] | None = None
    moving_mass: Annotated[float, quantity("kg"), Field(ge=0)] = 0.0


GRAVITY = 9.80665  # m/s^2


ADDED = Estimate.stated("mass", (0.5, 1e-4), "kg")


class CommissionSettings(BaseModel):
    """What is at hand when a rig is commissioned; see :func:`stickslip.bench.commission`.

    Attributes
    ----------
    weights : tuple of float
        On the load cell and on the spring, one after another [N].
    gauges : tuple of float
        Displacements by gauge blocks, one after another [m].
    turns : tuple of float
        Accelerations that the accelerometer is turned to in gravity, one after another [m/s^2].
    weights_sd, gauges_sd : float
        How sure they are, as a part of them: "0.01 %".
    added : float or Estimate
        Mass that is put on for the second free vibration [kg].
    """

    model_config = STRICT

    weights: tuple[Annotated[float, quantity("N")], ...] = (0.0, 2.0, 4.0, 6.0, 8.0, 6.0, 4.0, 2.0, 0.0)
    gauges: tuple[Annotated[float, quantity("m")], ...] = (0.0, 2e-3, 4e-3, 6e-3, 8e-3, 6e-3, 4e-3, 2e-3, 0.0)
    turns: tuple[Annotated[float, quantity("m/s^2")], ...] = (0.0, *(GRAVITY, 0.0, -GRAVITY, 0.0) * 2)
    weights_sd: Annotated[float, quantity("1"), Field(ge=0, lt=1)] = 0.0
    gauges_sd: Annotated[float, quantity("1"), Field(ge=0, lt=1)] = 0.0
    added: Annotated[float | Estimate, _constant("mass", positive=True), AS_PAIR] = ADDED


def _log(value: Any) -> Log:
    """The experiment's log, from a table of entries."""
    if isinstance(value, Log):
        return value
    if not isinstance(value, Mapping):
        raise ValueError("a log is a table of entries: surface, lubrication, temperature ...")
    try:
        return Log.of(value)
    except RecordError as error:
        raise ValueError(printable(f"{error.value}; {error.rule}")) from error


class RigSettings(BaseModel):
    """What is known of a rig before any record is read; every entry may be left out.

    Attributes
    ----------
    mass, stiffness, damping : float, Estimate or None
        Oscillating mass [kg], spring [N/m], viscous damping [N s/m] of the suspension (not of the contact); an Estimate
        where how sure it is is stated, as in "3.08 ± 0.01 kg".
    damper : {"ground", "base"}
        What the viscous damper ends on: the ground, or the moving base beside the spring.
    contact : {"ground", "base"}
        What the mass slides on.
    channels : dict of str to str
        Name in the record -> column, with arithmetic and unit ("vir * 35.1507 [N]").
    fs : float or None
        Sampling rate [Hz], for a file that states none.
    units : dict of str to str
        Unit of a column, where its header states none.
    sensors : dict of str to SensorSettings
        What is known of the sensor of a channel: its lag, its noise, the mount that it stands on.
    normal : dict of str to float or Estimate
        Normal load [N] by file name or pattern ("*250g*"); a single one holds for every file.
    repair : tuple of str
        Repairs made to every record after reading, in the order given: clock, gaps, missing, spikes, clipping,
        drift; see :func:`mend`.
    devices : dict of str to dict
        What measures it, by name: the table that a driver takes, ``kind`` among it.
    time : str or None
        The column that holds the time, where its header does not say so.
    delimiter, decimal : str or None
        Of text files, where they can not be told from the file.
    rows : str or None
        Rows to keep of each file, as "FIRST:LAST".
    log : Log or None
        What was written down beside the measurements: surfaces, lubrication, air, load. What a file says of itself
        goes before it.
    shaker : ShakerSettings or None
        What moves the base.
    commission : CommissionSettings or None
        What is at hand when the rig is commissioned.

    Examples
    --------
    >>> rig = RigSettings(mass="250 g", stiffness=1191, normal={"*250g*": "2.45 N"})
    >>> rig.mass, rig.normal_load("s_b_250g_x.mat").value, rig.normal_load("other.csv")
    (0.25, 2.45, None)
    """

    model_config = STRICT

    mass: Annotated[float | Estimate, _constant("mass", positive=True), AS_PAIR] | None = None
    stiffness: Annotated[float | Estimate, _constant("stiffness"), AS_PAIR] | None = None
    damping: Annotated[float | Estimate, _constant("damping"), AS_PAIR] | None = None
    damper: Literal["ground", "base"] = "ground"
    contact: Literal["ground", "base"] = "ground"
    channels: dict[str, str] = Field(default_factory=dict)
    fs: Annotated[float, quantity("Hz"), Field(gt=0)] | None = None
    units: dict[str, str] = Field(default_factory=dict)
    sensors: dict[str, SensorSettings] = Field(default_factory=dict)
    normal: Annotated[
        dict[str, Annotated[float | Estimate, _constant(LOAD, positive=True), AS_PAIR]], BeforeValidator(_one_or_many)
    ] = Field(default_factory=dict)
    repair: tuple[Annotated[str, BeforeValidator(_repair)], ...] = ()
    devices: dict[str, dict[str, Any]] = Field(default_factory=dict)
    time: Annotated[str, Field(min_length=1)] | None = None
    delimiter: Annotated[str, Field(min_length=1)] | None = None
    decimal: Literal[".", ","] | None = None
    rows: Annotated[str, BeforeValidator(_row_range)] | None = None
    log: Annotated[Log, PlainValidator(_log), PlainSerializer(lambda log: log.entries())] | None = None
    shaker: ShakerSettings | None = None
    commission: CommissionSettings | None = None

    def logged(self, record: Record) -> Record:
        """The record with the log; what it says of itself stays."""
        if self.log is None:
            return record
        own = record.log.entries() if record.log is not None else {}
        return record.with_log({**self.log.entries(), **own})

    def normal_load(self, name: str) -> Estimate | None:
        """The normal load stated for a file of this name; the first pattern that fits decides.

        A name with folders before it fits by its last part too.
        """
        names = (name, name.rpartition("/")[2])
        fits = (load for pattern, load in self.normal.items() if any(fnmatch.fnmatch(name, pattern) for name in names))
        return next((Estimate.stated(LOAD, load, "N") for load in fits), None)

    def reading(self) -> dict[str, Any]:
        """What ``read_record`` is told of the files, None where nothing is."""
        return {name: getattr(self, name) or None for name in READING}

    def row_range(self) -> tuple[int, int | None] | None:
        """`rows` as the pair (first, last), last excluded."""
        if self.rows is None:
            return None
        first, last = self.rows.split(":")
        return int(first or 0), int(last) if last.strip() else None


def rig_toml(settings: Mapping[str, Any]) -> Iterator[str]:
    """The lines of a rig.toml: plain values first, then the tables.

    Parameters
    ----------
    settings : mapping
        Keys as in :class:`RigSettings`.

    Yields
    ------
    str

    Examples
    --------
    >>> print(*rig_toml({"mass": "2.42 kg", "channels": {"x": "plate [mm]"}}), sep="\\n")
    mass = "2.42 kg"
    <BLANKLINE>
    [channels]
    x = "plate [mm]"
    """
    return toml_lines(settings, levels=9)  # deeper than any


def rig_settings(values: Mapping[str, Any], *, source: str = "the settings", lines: Sequence[str] = ()) -> RigSettings:
    """Check settings given as plain data; the first fault found is told in one sentence.

    Parameters
    ----------
    values : mapping
        Keys as in :class:`RigSettings`.
    source : str
        Where they come from, for the message.
    lines : sequence of str
        The text they were read from, so that the message can name the line.

    Returns
    -------
    RigSettings

    Raises
    ------
    ModelError
        An unknown key, or a value that has no meaning.

    Examples
    --------
    >>> rig_settings({"mass": "250 g"}).mass
    0.25
    """
    return checked(RigSettings, values, source=source, lines=lines)


def read_rig(path: str | Path) -> RigSettings:
    """Read a rig's constants and channel map from a TOML file.

    Parameters
    ----------
    path : path
        A file such as::

            mass = "3.08 ± 0.01 kg"   # with its standard uncertainty; a bare number is exact, and SI
            stiffness = 1191
            damper = "base"
            [channels]
            x = "x [mm]"
            [sensors.a]
            mount = ["125 Hz", 0.1]   # what it stands on: resonance and damping ratio
            [normal]
            "*250g*" = "2.45 N"
            [log]
            surface = "steel on steel"
            temperature = "23 °C"

    Returns
    -------
    RigSettings

    Raises
    ------
    ModelError
        The file can not be read, is not TOML, has a key that is not known or a value without meaning.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "rig.toml"
    >>> _ = path.write_text("mass = 3.0799\\nstiffness = '1.191 N/mm'")
    >>> read_rig(path).stiffness
    1191.0
    """
    path = Path(path)
    values, lines = read_toml(path, what="a rig's settings are")
    return rig_settings(values, source=path.name, lines=lines)
