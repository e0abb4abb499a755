"""What a device is: inputs on one clock that stream in blocks, outputs that move the rig, and what is plugged in where.

Inputs are written as the columns of a file are: ``"ai0 [V] @ 500 mV/lbf"``."""

from __future__ import annotations

import importlib
import importlib.util
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, Field

from stickslip.arrays import Array
from stickslip.errors import ModelError, RecordError
from stickslip.files.expression import apply_sensitivity, channel_unit, split_spec
from stickslip.parameters import finite
from stickslip.record.channels import Channel, checked_name, described
from stickslip.settings import STRICT, nearest, quantity
from stickslip.units import parse_unit, parse_value

# the kinds of device, each with its module beside this one
DRIVERS = {"sim": "sim", "file": "replay", "sound": "sound", "ni": "ni", "ldaq": "ldaq", "serial": "serial"}

# what pip calls a package whose name is another
INSTALLED = {"serial": "pyserial"}


@dataclass(frozen=True)
class Input:
    """One channel that a device measures.

    Attributes
    ----------
    name : str
        Of the channel, as in a Record.
    unit : str
        SI unit of the samples.
    limit : float
        Largest reading of either sign [unit]; what reaches it is clipped.
    scale : float
        What one count of a block is worth [unit]; 1 where blocks hold values in SI.
    sensitivity : str
        Of the sensor, in words ("500 mV/lbf").
    serial : str
        Serial number of the sensor.
    terminal : str
        Where it is plugged in, as the device calls it.
    details : mapping
        What a calibration says, as ``Record.with_details`` takes it: delay, noise, mount ...

    Raises
    ------
    ModelError
        A range or a scale without meaning.
    RecordError
        A name or a unit that no channel can have.

    Examples
    --------
    >>> Input("x", "m", limit=12.7e-3, scale=2.5e-6).channel
    Channel(name='x', unit='m', quantity='displacement', ...)
    """

    name: str
    unit: str
    limit: float = math.inf
    scale: float = 1.0
    sensitivity: str = ""
    serial: str = ""
    terminal: str = ""
    details: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        described(checked_name(self.name), self.unit)
        finite("scale", self.scale, unit=self.unit, positive=True)
        if not self.limit > 0:
            raise ModelError(
                f"limit = {self.limit} of {self.name}", "a range is positive", "correct it, or leave it out"
            )

    @property
    def channel(self) -> Channel:
        """As a Record knows it."""
        quantity = described(self.name, self.unit)
        return Channel(self.name, self.unit, quantity, self.terminal, self.sensitivity, **self.details)


class Tone(NamedTuple):
    """A harmonic motion or force: amplitude [unit of the output], frequency [Hz], phase [rad] at its start."""

    amplitude: float
    frequency: float
    phase: float = 0.0


Signal = Tone | Array | None  # a tone until further notice, samples at the device's rate, or rest


@dataclass(frozen=True)
class Output:
    """Something that a device moves: the base by a shaker, or a force on the mass.

    Attributes
    ----------
    name : str
        "base" or "force".
    unit : str
        Of what it sets: m or N.
    stroke : float
        Largest value of either sign [unit].
    lowest, highest : float
        Frequencies [Hz] between which a tone may lie.
    acceleration : float
        Largest acceleration of a base [m/s^2]: the shaker's force over the mass that it moves.

    Examples
    --------
    >>> Output("base", "m", stroke=5e-3, highest=50.0).require(Tone(1e-3, 2.5))
    >>> Output("base", "m", stroke=5e-3, highest=50.0).require(Tone(8e-3, 2.5))
    Traceback (most recent call last):
    stickslip.errors.ModelError: an amplitude of 0.008 m at the base; its stroke is 0.005 m; ask for less.
    """

    name: str
    unit: str
    stroke: float = math.inf
    lowest: float = 0.0
    highest: float = math.inf
    acceleration: float = math.inf

    def require(self, signal: Signal, *, fs: float = math.nan) -> None:
        """Refuse what the shaker can not do.

        Parameters
        ----------
        signal : Tone, ndarray or None
            What is asked.
        fs : float
            Rate of samples [Hz].

        Raises
        ------
        ModelError
            Beyond the stroke, the frequencies, or the acceleration.
        """
        if signal is None:
            return
        if isinstance(signal, Tone):
            self._require_tone(signal)
            return
        values = np.asarray(signal, dtype=np.float64)
        if values.ndim != 1 or len(values) < 4 or not np.all(np.isfinite(values)):
            raise ModelError("a signal", "it is a row of four finite numbers at least", "correct its samples")
        self._require_within(float(np.max(np.abs(values))), float(np.max(np.abs(np.diff(values, 2)))) * fs**2)

    def _require_tone(self, tone: Tone) -> None:
        finite("amplitude", tone.amplitude, unit=self.unit)
        finite("frequency", tone.frequency, unit="Hz", positive=True)
        if not self.lowest <= tone.frequency <= self.highest:
            raise ModelError(
                f"{tone.frequency:g} Hz at the {self.name}",
                f"it goes from {self.lowest:g} to {self.highest:g} Hz",
                "ask for another frequency",
            )
        self._require_within(tone.amplitude, tone.amplitude * (2 * math.pi * tone.frequency) ** 2)

    def _require_within(self, value: float, acceleration: float) -> None:
        if value > self.stroke:
            raise ModelError(
                f"an amplitude of {value:g} {self.unit} at the {self.name}",
                f"its stroke is {self.stroke:g} {self.unit}",
                "ask for less",
            )
        if self.unit == "m" and acceleration > self.acceleration:
            raise ModelError(
                f"an acceleration of {acceleration:g} m/s^2 at the {self.name}",
                f"its force is enough for {self.acceleration:g} m/s^2",
                "ask for less",
            )


class Block(NamedTuple):
    """Samples that came together.

    Attributes
    ----------
    first : int
        Counter of the first sample since the device was opened. Lost samples count: a gap shows as a jump.
    clock : float
        When the last sample came, by this computer's monotonic clock [s].
    samples : ndarray (channels, n)
        Counts or values; ``samples * scale`` of each input is in SI.
    """

    first: int
    clock: float
    samples: NDArray[Any]

    @property
    def after(self) -> int:
        """Counter of the sample that follows."""
        return self.first + int(self.samples.shape[1])


class Stream(Protocol):
    """An open device; it closes as a context manager ends."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *raised: object) -> None: ...

    def read(self, timeout: float = 1.0) -> Block | None:
        """The next samples: an empty block where none came within `timeout` [s], None when no more will come."""

    def drive(self, output: str, signal: Signal) -> None:
        """Move an output from now on: by a tone, by samples at the device's rate, or not at all."""


class Listening:
    """An open device that is read and moves nothing, as most are; what derives from it reads, and may hold a port."""

    device: Any  # the one that is open

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        """Nothing is held."""

    def drive(self, output: str, signal: Signal) -> None:
        """It moves nothing: refuses every output."""
        output_of(self.device, output)


class Device(Protocol):
    """Something that measures.

    Attributes
    ----------
    name : str
        What the user calls it.
    kind : str
        Its driver.
    model : str
        What it is, with its serial number, in words.
    fs : float
        Sampling rate [Hz] that it states.
    inputs : tuple of Input
        In the order of a block's rows.
    outputs : tuple of Output
        What it can move.
    """

    @property
    def name(self) -> str: ...

    @property
    def kind(self) -> str: ...

    @property
    def model(self) -> str: ...

    @property
    def fs(self) -> float: ...

    @property
    def inputs(self) -> tuple[Input, ...]: ...

    @property
    def outputs(self) -> tuple[Output, ...]: ...

    def open(self) -> Stream:
        """Begin to measure; the counter starts at 0. What is not there raises OSError or a ModelError."""


def in_si(device: Device, block: Block) -> Array:
    """A block's samples in SI (channels, n)."""
    scales = np.array([one.scale for one in device.inputs])
    return np.asarray(block.samples * scales[:, None], dtype=np.float64)


def output_of(device: Device, name: str) -> Output:
    """The output of that name, or a refusal that lists what there is.

    Raises
    ------
    ModelError
        The device has no such output.
    """
    for output in device.outputs:
        if output.name == name:
            return output
    known = ", ".join(output.name for output in device.outputs) or "none"
    raise ModelError(f"{device.name} has no output '{name}'", f"its outputs: {known}", "name one of them")


def blocks(stream: Stream, *, count: int | None = None, patience: float = 10.0) -> Iterator[Block]:
    """The blocks of an open stream, to its end or until the counter has passed `count` samples.

    Parameters
    ----------
    stream : Stream
    count : int, optional
        Samples wanted, lost ones included; the last block is cut there.
    patience : float
        Time without a sample [s] after which the device is given up.

    Yields
    ------
    Block
        None of them empty.

    Raises
    ------
    RecordError
        The device sends nothing more.
    """
    heard = time.monotonic()
    while True:
        block = stream.read(min(1.0, patience))
        if block is None:
            return
        if block.samples.shape[1]:
            heard = time.monotonic()
            if count is not None and block.after >= count:
                kept = block.samples[:, : max(0, count - block.first)]
                if kept.shape[1]:
                    yield block._replace(samples=kept)
                return
            yield block
        elif time.monotonic() - heard > patience:
            raise RecordError(
                f"no sample for {patience:g} s",
                "a device that measures sends samples",
                "check cable, power and trigger",
            )


def driver(kind: str) -> ModuleType:
    """The module of a driver.

    Raises
    ------
    ModelError
        No driver has that name.
    """
    if kind not in DRIVERS:
        raise ModelError(
            f"no device is of the kind '{kind}'", f"there are {', '.join(DRIVERS)}", nearest(kind, DRIVERS)
        )
    return importlib.import_module(f"stickslip.bench.{DRIVERS[kind]}")


def vendors(package: str) -> ModuleType:
    """A vendor's package, or a sentence that says how to install it."""
    try:
        return importlib.import_module(package)
    except (ImportError, OSError) as error:
        remedy = f"install it with: pip install {_installed(package)}"
        if isinstance(error, OSError):
            remedy = "the package is there: install the library behind it, of the system or the vendor"
        raise ModelError(
            f"the package {package} can not be imported ({error})", "this device is reached through it", remedy
        ) from error


def _installed(package: str) -> str:
    """What pip calls a package: its own name, where nothing else is listed."""
    root = package.partition(".")[0]
    return INSTALLED.get(root, root)


def find_device(
    name: str, tables: Mapping[str, Mapping[str, Any]] | None = None, *, folder: Path | None = None
) -> Device:
    """The device of that name in the tables ``[devices.NAME]`` of a rig's file, or of that kind with nothing said.

    Parameters
    ----------
    name : str
        Of a table, or a kind of device.
    tables : mapping
        Settings by name; ``kind`` in them is the driver, the table's own name where left out.
    folder : Path, optional
        Where the rig's file lies: paths in the tables start there.

    Returns
    -------
    Device

    Raises
    ------
    ModelError
        No such device, a setting without meaning, or a package that is missing.

    Examples
    --------
    >>> find_device("rig", {"rig": {"kind": "sim", "fs": 2000}}).fs
    2000.0
    """
    tables = tables or {}
    settings = dict(tables.get(name, {}))
    if name not in tables and name not in DRIVERS:
        known = (*tables, *DRIVERS)
        step = nearest(name, known) + ("" if tables else f", or [devices.{name}] stands in a file that was not named")
        raise ModelError(f"no device is called '{name}'", f"there are {', '.join(known)}", step)
    return driver(settings.pop("kind", name)).build(name, settings, folder or Path())  # type: ignore[no-any-return]


class Found(NamedTuple):
    """What a driver tells of itself: its kind, what it is for, what is there, and what is missing, in words."""

    kind: str
    about: str
    there: Sequence[str]
    missing: str


def devices() -> tuple[Found, ...]:
    """Every kind of device: what is there now, or which package is missing.

    Examples
    --------
    >>> [found.missing for found in devices() if found.kind == "sim"]
    ['']
    """
    return tuple(map(_driver, DRIVERS))


def _there(package: str) -> bool:
    """Whether a package can be imported, without importing it."""
    try:
        return importlib.util.find_spec(package) is not None
    except ValueError:  # it was looked for already, in vain
        return False


def _driver(kind: str) -> Found:
    module = driver(kind)
    about = str(module.__doc__).partition("\n")[0]
    if module.NEEDS and not _there(module.NEEDS):
        return Found(kind, about, (), f"{module.NEEDS}: pip install {_installed(module.NEEDS)}")
    listed: Callable[[], Sequence[str]] = module.listed
    try:
        return Found(kind, about, tuple(listed()), "")
    except ModelError as error:
        return Found(kind, about, (), str(error))


def _wire(value: Any) -> Any:
    return {"at": value} if isinstance(value, str) else value


class Wire(BaseModel):
    """One input: a text, or a table with what else is known.

    Attributes
    ----------
    at : str
        Where, in which unit it is read, and the sensor's sensitivity: ``"ai0 [V] @ 500 mV/lbf"``.
    range : str or None
        Largest reading of either sign, in the unit in which it is read: ``"10 V"``.
    serial : str
        Serial number of the sensor.
    """

    model_config = STRICT

    at: Annotated[str, Field(min_length=1)]
    range: str | None = None
    serial: str = ""


class Limits(BaseModel):
    """What an output can do at most."""

    model_config = STRICT

    stroke: Annotated[float, quantity("m"), Field(gt=0)] | None = None
    lowest: Annotated[float, quantity("Hz"), Field(ge=0)] | None = None
    highest: Annotated[float, quantity("Hz"), Field(gt=0)] | None = None
    acceleration: Annotated[float, quantity("m/s^2"), Field(gt=0)] | None = None

    @property
    def stated(self) -> dict[str, float]:
        """Those that are known, as an :class:`Output` takes them."""
        return {name: value for name in Limits.model_fields if (value := getattr(self, name)) is not None}


class Mover(Limits):
    """One output: where, what a volt is worth there, and its limits."""

    at: Annotated[str, Field(min_length=1)]
    sensitivity: str = "1 m/V"


Wires = Annotated[dict[str, Annotated[Wire, BeforeValidator(_wire)]], Field(min_length=1)]


def inputs(wires: Mapping[str, Wire], *, unit: str, count: float = 1.0, limit: float = math.inf) -> tuple[Input, ...]:
    """The inputs of a table of wires.

    Parameters
    ----------
    wires : mapping of str to Wire
        By channel.
    unit : str
        In which they are read where nothing is said ("V").
    count : float
        What one number of a block is worth in that unit.
    limit : float
        Largest reading in it, where nothing is said.

    Returns
    -------
    tuple of Input

    Raises
    ------
    ModelError
        An unknown unit, or one that does not fit the channel.

    Examples
    --------
    >>> from stickslip.bench.device import Wire
    >>> one, = inputs({"load": Wire(at="ai0 [V] @ 500 mV/N", range="5 V")}, unit="V")
    >>> one.scale, one.limit, one.terminal
    (2.0, 10.0, 'ai0')
    """
    return tuple(_input(name, wire, unit, count, limit) for name, wire in wires.items())


def _input(name: str, wire: Wire, unit: str, count: float, limit: float) -> Input:
    spec = split_spec(wire.at)
    measured = parse_unit(spec.unit or unit) if spec.sensitivity else channel_unit(spec.unit or unit, name)
    final = apply_sensitivity(spec.sensitivity, measured, name) if spec.sensitivity else measured
    scale = final.scale * count
    if final.zero:
        raise ModelError(f"{name} in {final.text}", "an input is wired by a factor", "give K, or volts")
    if scale <= 0 or not math.isfinite(scale):
        raise ModelError(f"a sensitivity of {spec.sensitivity} of {name}", "it is positive and finite", "correct it")
    reading = parse_value(wire.range, measured.si) / measured.scale if wire.range else limit
    details = {"gain_sd": spec.gain_sd} if spec.gain_sd else {}
    return Input(name, final.si, reading * final.scale, scale, spec.sensitivity, wire.serial, spec.arithmetic, details)


def columns(wires: Sequence[Input]) -> list[int]:
    """The columns, from 0, of inputs whose places are numbers: "#2", "2"."""
    places = [one.terminal.removeprefix("#") for one in wires]
    if not all(place.isdigit() and int(place) > 0 for place in places):
        raise ModelError(
            f"inputs at {', '.join(one.terminal for one in wires)}",
            "they are numbers of columns, from 1",
            'write "#2 [mm]"',
        )
    return [int(place) - 1 for place in places]
