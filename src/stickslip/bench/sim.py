"""A virtual rig in real time or faster: any system and law, sensors that lie, faults on demand."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args

import numpy as np
from pydantic import BaseModel, Field

from stickslip.arrays import Array, Mask
from stickslip.bench.device import Block, Input, Limits, Listening, Output, Signal, Tone, output_of
from stickslip.bench.march import March, Shaken
from stickslip.compiled import waiting
from stickslip.drives.kinds import Drive, HarmonicBase, HarmonicForce, Release
from stickslip.errors import ModelError, StickslipError
from stickslip.laws.compliant import CompliantContact
from stickslip.oscillator import Oscillator
from stickslip.rig.rig import Rig
from stickslip.rig.sensor import Sensor
from stickslip.settings import STRICT, checked, quantity
from stickslip.signals.response import NODES, TURN, follow, gauss
from stickslip.solve.tables import System
from stickslip.systems.file import read_system, scenario_case

NAME, NEEDS = "sim", ""
PRESETS = {"air-track": Rig.air_track, "linear-bearing": Rig.linear_bearing, "perfect": Rig.perfect}
BLOCK = 0.02  # s of samples in a block: short of what an eye sees as late
REHEARSED = 3.0  # s of the motion: of the thesis's slider the last kernel was compiled 2.4 s after it began
BUFFER = 10.0  # s of samples that the device holds for who reads late; older ones are lost, as in a real one
RAMP = 0.25  # s in which a shaker goes over from one motion to another
LOOSE = 30.0  # times its own noise: what a sensor picks up whose shield is off
STRETCH = 1 << 15  # samples of coloured noise made at a time; below fs / STRETCH it is white

REHEARSING = threading.Lock()  # `waiting` is of the whole process

FaultKind = Literal["drop", "saturation", "cable", "noise"]
FAULTS: tuple[str, ...] = get_args(FaultKind)


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong, from an instant on.

    Attributes
    ----------
    kind : str
        "drop": nothing is delivered; "saturation": the amplifier is set a thousand times too high, so that readings
        stand at the range's end; "cable": the plug is pulled, and only the amplifier's noise is left; "noise": the
        shield is off, and it is thirty times its own.
    at, duration : float
        When, and for how long [s].
    channel : str
        Of which input; a drop is of all.

    Raises
    ------
    ModelError
        A fault of an input without its name.
    """

    kind: str
    at: float
    duration: float = math.inf
    channel: str = ""

    def __post_init__(self) -> None:
        if self.kind not in FAULTS:
            raise ModelError(f"a fault '{self.kind}'", f"there are {', '.join(FAULTS)}", "name one of them")
        if (self.kind == "drop") == bool(self.channel):
            raise ModelError(
                f"a {self.kind} of '{self.channel}'",
                "a drop is of all inputs, every other fault of one",
                "correct channel=",
            )

    def rows(self, times: Array) -> Mask:
        """At which instants it is there."""
        return (times >= self.at) & (times < self.at + self.duration)


def air_track() -> Oscillator:
    """The slider of the thesis's air track (section 3.2, with a contact that gives way), moved at 2.5 Hz."""
    law = CompliantContact(1.1, stiffness=192000, damping=23.9)
    damping = 2 * 0.0008 * math.sqrt(2310 * 2.42)  # section 2.2
    return Oscillator(mass=2.42, stiffness=2310, damping=damping, law=law, drive=HarmonicBase(0.65e-3, frequency=2.5))


@dataclass(frozen=True)
class Sim:
    """A virtual rig on the desk.

    Attributes
    ----------
    system : Oscillator or Structure
        What moves; the slider of the air track where left out.
    start : mapping
        Its state when the device is opened.
    rig : Rig
        The sensors, and the clock of the unit.
    fs : float
        Sampling rate that the unit states [Hz].
    fast : bool
        Whether it goes as fast as it is read, and not by the clock.
    faults : tuple of Fault
        What goes wrong, and when.
    shaker : Output
        The limits of what moves base or mass; its name and unit do not matter.
    seed : int
        Of the sensors' noise.
    name : str
        What it is called.
    stated : bool
        Whether its inputs state what a calibration of the sensors would say.

    Raises
    ------
    ModelError
        A rate that is not positive, a fault of a sensor that is not there, or a sensor of what the system has not.

    Examples
    --------
    >>> with Sim(fast=True).open() as stream:
    ...     block = stream.read()
    >>> block.first, block.samples.shape
    (0, (4, 80))
    """

    system: System = field(default_factory=air_track)
    start: Mapping[str, float | str] = field(default_factory=dict, hash=False)
    rig: Rig = field(default_factory=Rig)
    fs: float = 4000.0
    fast: bool = False
    faults: tuple[Fault, ...] = ()
    shaker: Output = field(default_factory=lambda: Output("base", "m"))
    seed: int = 1
    name: str = "sim"
    stated: bool = False

    kind = NAME

    def __post_init__(self) -> None:
        known = {sensor.channel: sensor for sensor in self.rig.sensors}
        for fault in self.faults:
            if fault.channel and fault.channel not in known:
                raise ModelError(
                    f"a {fault.kind} of '{fault.channel}'", f"the rig has {', '.join(known)}", "choose one of them"
                )
            sensor = known.get(fault.channel)
            if fault.kind == "saturation" and sensor and math.isinf(sensor.digitiser.limit):
                raise ModelError(
                    f"a saturation of {fault.channel}", "its sensor has no range", "give the digitiser a limit"
                )
            if fault.kind == "noise" and sensor and not (sensor.noise.white or sensor.noise.band):
                raise ModelError(f"noise of {fault.channel}", "its sensor has none", "give the sensor noise")

    @property
    def model(self) -> str:
        """What is simulated."""
        system = self.system
        law = type(system.law).__name__ if isinstance(system, Oscillator) else f"{len(system.contacts)} contacts"
        return f"virtual rig: {type(system).__name__}, {law}, {type(system.drive).__name__}, seed {self.seed}"

    @cached_property
    def inputs(self) -> tuple[Input, ...]:
        """One for each sensor of what the system has."""
        march = March(self.system, self.start)
        march.ahead(0.0)
        units = {label: unit for label, (_, _, unit) in march.legs[0].sensed.items()}
        units = {"z": "m", "force": "N"} | units
        sensors = [sensor for sensor in self.rig.sensors if sensor.source in units]
        if not sensors:
            raise ModelError(
                f"sensors of {', '.join(s.source for s in self.rig.sensors)}",
                f"the motion has {', '.join(units)}",
                "choose sensors of these",
            )
        return tuple(_input(sensor, units[sensor.source], self.stated) for sensor in sensors)

    @cached_property
    def outputs(self) -> tuple[Output, ...]:
        """The base, or a force on the mass; none where the counter-face alone moves."""
        motion = self.system.drive.motion()
        limits = replace(self.shaker, highest=min(self.shaker.highest, self.fs / 2))  # what samples could say
        base, force = replace(limits, name="base", unit="m"), replace(limits, name="force", unit="N")
        if isinstance(self.system.drive, Release):
            return (base, replace(force, stroke=math.inf))
        return (force,) if motion.force else (base,) if motion.base else ()

    def open(self) -> SimStream:
        """Begin to move and to measure.

        Returns
        -------
        SimStream
        """
        if not self.fast:
            self.rehearse({})
        return SimStream(self)

    def rehearse(self, drive: Mapping[str, Signal]) -> None:
        """Compile what its motion needs, moved as in `drive`, and wait for it."""
        rehearsal = SimStream(replace(self, fast=True))
        with REHEARSING, waiting():
            for output, signal in drive.items():
                rehearsal.drive(output, signal)
            while rehearsal.sent < REHEARSED * self.fs and rehearsal.read() is not None:
                pass


def _input(sensor: Sensor, unit: str, stated: bool) -> Input:
    details = sensor.certificate if stated else {}
    limit, serial = sensor.digitiser.limit, f"simulated {sensor.channel}"
    return Input(sensor.channel, unit, limit, 1.0, sensor.sensitivity, serial, sensor.source, details)


class _Order(NamedTuple):
    """A motion that begins once it is rehearsed."""

    output: str
    signal: Signal
    rehearsal: threading.Thread


class SimStream(Listening):
    """The virtual rig, running."""

    def __init__(self, device: Sim) -> None:
        self.device, self.sent, self.moving = device, 0, ""
        self.ordered: _Order | None = None
        self.rate = device.fs * (1 + device.rig.rate)
        self.march = March(device.system, device.start)
        self.march.ahead(0.0)
        names = {one.name for one in device.inputs}
        chance = np.random.default_rng(device.seed)
        seeds = [np.random.default_rng(chance.integers(2**63)) for _ in device.rig.sensors]
        pairs = zip(device.rig.sensors, seeds, strict=True)
        wanted = [(sensor, rng) for sensor, rng in pairs if sensor.channel in names]
        self.readings = [_Reading(sensor, self.march, self.rate, rng) for sensor, rng in wanted]
        self.began = time.monotonic()

    def read(self, timeout: float = 1.0) -> Block | None:
        """The next samples; see :class:`Stream`. A block that a drop touches is lost whole, as it is in a real unit."""
        device, size = self.device, max(1, round(BLOCK * self.device.fs))
        if self.ordered is not None and not self.ordered.rehearsal.is_alive():
            order, self.ordered = self.ordered, None
            self._move(order.output, order.signal)
        if not device.fast:
            size = self._due(size, timeout)
        times = self._time(self.sent + np.arange(size))
        if size:
            self.march.ahead(float(times[-1]))
        if self.march.over:
            times = times[times <= self.march.end]
            if size and not len(times):
                return None
        samples = np.array([reading.at(times, device.faults) for reading in self.readings])
        first, self.sent = self.sent, self.sent + len(times)
        clock = self.began + self.sent / device.fs if device.fast else time.monotonic()
        if any(fault.kind == "drop" and fault.rows(times).any() for fault in device.faults):
            return Block(self.sent, clock, samples[:, :0])
        return Block(first, clock, samples)

    def drive(self, output: str, signal: Signal) -> None:
        """Move the base or the mass otherwise from the next sample on; it goes over smoothly, in `RAMP` seconds.

        Before anything was read the clock begins anew, once all is compiled. Later a unit that keeps time goes on as
        before until what the new motion needs is compiled, and what is ordered meanwhile takes its place. Samples are
        moved to from where the base stands, begin when it is there, and the last one is held. See :class:`Stream`.
        """
        device = self.device
        output_of(device, output).require(signal, fs=device.fs)
        if self.moving and output != self.moving:
            raise ModelError(
                f"a signal for the {output} while the {self.moving} moves",
                "one output moves at a time",
                "stop it first",
            )
        self.moving = output if signal is not None else ""
        if self.sent and not device.fast:
            self.ordered = _Order(output, signal, threading.Thread(target=self._rehearse, args=(output, signal)))
            self.ordered.rehearsal.daemon = True
            self.ordered.rehearsal.start()
            return
        if not device.fast:
            device.rehearse({output: signal})
            self.began = time.monotonic()
        self._move(output, signal)

    def _rehearse(self, output: str, signal: Signal) -> None:
        with suppress(StickslipError):  # who reads is told
            self.device.rehearse({output: signal})

    def _move(self, output: str, signal: Signal) -> None:
        """Go over to another motion, from the next sample on."""
        device = self.device
        now, label = float(self._time(self.sent)), {"base": "z", "force": "force"}[output]
        self.march.ahead(now + RAMP)
        times = np.arange(round(RAMP * device.fs) + 1) / device.fs
        before, over, end = self.march.values(label, now + times), _smooth(times / times[-1]), float(times[-1])
        motion = device.system.drive.motion()
        contact = "base" if motion.base and motion.face else "ground"
        drive, first = _driven(signal, times, Shaken(np.zeros(4), device.fs, output, contact))
        ramp = Shaken((1 - over) * before + over * first, device.fs, output, contact)
        self.march.change([(now, ramp), (now + end, drive)])

    def _time(self, count: Any) -> Any:
        """When samples are taken [s]; the unit's clock may be fast and begin late."""
        return self.device.rig.offset + count / self.rate

    def _due(self, size: int, timeout: float) -> int:
        """How many samples have come since the last block, waiting for them; what was left for too long is lost."""
        until = time.monotonic() + timeout
        while True:
            there = int((time.monotonic() - self.began) * self.rate) - self.sent
            if there >= size or time.monotonic() >= until:
                break
            time.sleep(min(max(0.0, (size - there) / self.rate), max(0.0, until - time.monotonic())))
        buffered = round(BUFFER * self.device.fs)
        if there > buffered:
            self.sent += there - buffered
        return max(0, min(there, 10 * size))


def _driven(signal: Signal, times: Array, shaken: Shaken) -> tuple[Drive, Array]:
    """What moves an output after a ramp over `times`, and what it would do, or be, during the ramp."""
    if signal is None:
        return shaken, np.zeros(len(times))
    if not isinstance(signal, Tone):
        samples = np.asarray(signal, dtype=np.float64)
        return replace(shaken, samples=samples), np.full(len(times), samples[0])
    turn = math.tau * signal.frequency
    first = signal.amplitude * np.cos(turn * times + signal.phase)
    phase = math.remainder(turn * float(times[-1]) + signal.phase, math.tau)
    if shaken.on == "force":
        return HarmonicForce(signal.amplitude, signal.frequency, phase), first
    return HarmonicBase(signal.amplitude, signal.frequency, phase, shaken.contact), first


def _smooth(share: Array) -> Array:
    """From 0 to 1 without a jump in speed or acceleration."""
    return share**3 * (10 - 15 * share + 6 * share**2)


class _Reading:
    """One sensor, read on and on: its filter and its noise go on from block to block."""

    def __init__(self, sensor: Sensor, march: March, fs: float, rng: np.random.Generator) -> None:
        self.sensor, self.march, self.fs, self.rng = sensor, march, fs, rng
        self.response = sensor.response
        self.noise = np.empty(0)
        self.poles, self.residues = np.array(self.response.poles), np.array(self.response.residues)
        self.states = np.zeros((1, len(self.poles)), dtype=complex)
        self.known, self.began = 0.0, float(self._sensed(np.zeros(1))[0])  # before 0 it was what it is at 0

    def at(self, times: Array, faults: Sequence[Fault]) -> Array:
        """What it writes at the instants that follow."""
        sensor, count = self.sensor, len(times)
        if not count:
            return np.empty(0)
        readings, noise = sensor.gain * self._filtered(times - sensor.lag), self._noise(count)
        for fault in faults:
            if fault.channel == sensor.channel:
                rows = fault.rows(times)
                readings[rows] *= {"cable": 0.0, "saturation": 1000.0}.get(fault.kind, 1.0)
                noise[rows] *= LOOSE if fault.kind == "noise" else 1.0
        written = sensor.digitiser.counts(readings + noise)
        written[sensor.digitiser.lost(count, fs=self.fs, rng=self.rng)] = np.nan
        return written

    def _sensed(self, times: Array) -> Array:
        values = self.march.values(self.sensor.source, times)
        mass = self.sensor.mount.mass if self.sensor.mount else 0.0
        return values + mass * self.march.values("a", times) if mass else values

    def _filtered(self, times: Array) -> Array:
        """The motion through mount and discharge: the convolution goes on where the last block's ended."""
        response, after = self.response, np.maximum(times, 0.0)
        direct = self._sensed(after) if response.direct or not len(self.poles) else np.zeros(len(times))
        if not len(self.poles):
            return response.direct * direct
        out = np.zeros(len(times))
        coming = times > self.known
        if coming.any():
            out[coming] = self._convolved(times[coming])
        out += self.began * np.exp(-response.leak * after)
        return out + response.direct * (direct - self.began)

    def _convolved(self, times: Array) -> Array:
        """What the poles answer, by quadrature between samples and breaks; times count from the last one known."""
        local = np.append(0.0, times - self.known)
        pieces = max(1, math.ceil(float(np.max(np.abs(self.poles))) / self.fs / TURN))
        finer = local[:-1, None] + np.diff(local)[:, None] * (np.arange(pieces) / pieces)
        inside = self.march.breaks(self.known, float(times[-1])) - self.known
        edges = np.sort(np.concatenate([finer.ravel(), local[-1:], inside]))
        rule = gauss(NODES)
        at = edges[:-1, None] + np.diff(edges)[:, None] * rule[0]
        forced = self._sensed(self.known + at.ravel()).reshape(at.shape) - self.began
        out, factors = np.zeros(len(times)), np.empty(NODES, dtype=complex)
        ends = np.searchsorted(edges, local[1:])
        follow((self.poles, self.residues, self.states[0]), edges, ends, forced, rule, factors, out)
        self.known = float(times[-1])
        return out

    def _noise(self, count: int) -> Array:
        noise = self.sensor.noise
        if not (noise.corner or noise.band):
            return noise.white * self.rng.standard_normal(count)
        while len(self.noise) < count:
            self.noise = np.append(self.noise, noise.samples(STRETCH, fs=self.fs, rng=self.rng))
        taken, self.noise = self.noise[:count], self.noise[count:]
        return taken


class _Fault(BaseModel):
    model_config = STRICT

    kind: FaultKind
    at: Annotated[float, quantity("s"), Field(ge=0)]
    duration: Annotated[float, quantity("s"), Field(gt=0)] | None = None
    channel: str = ""


class _Settings(BaseModel):
    """A table ``[devices.NAME]`` of kind "sim"."""

    model_config = STRICT

    system: str | dict[str, Any] | None = None
    rig: Literal["air-track", "linear-bearing", "perfect"] = "air-track"
    sensors: dict[str, dict[str, float | str]] = Field(default_factory=dict)
    fs: Annotated[float, quantity("Hz"), Field(gt=0)] = 4000.0
    fast: bool = False
    faults: list[_Fault] = Field(default_factory=list)
    shaker: Limits = Field(default_factory=Limits)
    seed: Annotated[int, Field(ge=0)] = 1
    stated: bool = False


def listed() -> Sequence[str]:
    """It is always there."""
    return (f"any system file or scenario, with the sensors of {', '.join(PRESETS)}",)


def build(name: str, settings: Mapping[str, Any], folder: Path) -> Sim:
    """A virtual rig from the table of a rig's file.

    Parameters
    ----------
    name : str
        What it is called.
    settings : mapping
        system (a file, a scenario's name, or its tables), rig (preset of sensors), sensors (changes by channel), fs,
        fast, faults, shaker, seed, stated.
    folder : Path
        Where a system's file is looked for.

    Returns
    -------
    Sim

    Raises
    ------
    ModelError
        A setting without meaning.

    Examples
    --------
    >>> build("rig", {"fs": "2 kHz", "sensors": {"x": {"lag": 0.0}}}, Path()).fs
    2000.0
    """
    given = checked(_Settings, settings, source=f"devices.{name}")
    rig = PRESETS[given.rig]()
    for channel, changes in given.sensors.items():
        rig = rig.having(channel, **changes)
    faults = tuple(Fault(f.kind, f.at, f.duration or math.inf, f.channel) for f in given.faults)
    system, start = _system(given.system, folder)
    base = Output("base", "m", **given.shaker.stated)
    return Sim(system, start, rig, given.fs, given.fast, faults, base, given.seed, name, given.stated)


def _system(given: str | dict[str, Any] | None, folder: Path) -> tuple[System, Mapping[str, float | str]]:
    if given is None:
        return air_track(), {}
    inner = isinstance(given, dict) or given.endswith(".toml")
    case = read_system(given if isinstance(given, dict) else folder / given) if inner else scenario_case(str(given))
    return case.system, case.start
