"""A stretch of a record as a fit of a law sees it: what drove the rig, what each sensor read and would have read."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from stickslip.arrays import Array, Index
from stickslip.drives.kinds import Release
from stickslip.errors import ModelError, SolveError
from stickslip.law.driven import DriveFrom
from stickslip.oscillator import Oscillator
from stickslip.record.channels import Channel
from stickslip.record.record import Record
from stickslip.signals.response import Response, leak, resonance, respond, ring
from stickslip.solve.sensitivity import Sensitivity
from stickslip.solve.simulate import simulate
from stickslip.solve.trajectory import Trajectory

SENSED = {"x": "x", "v": "v", "a": "a", "friction": "friction", "load": "friction"}  # of a channel, in the run
JUMPS = ("a", "friction")
RTOL = 1e-9  # of curved laws
JUMPED = 1e-6  # of the largest jump, below which one is rounding
NODES = 3  # of the quadrature through a mount, which turns little between two samples
GLIDE, HEAVY = 0.5, 1e9  # s and kg: a mass that slides on at a steady speed until the law has no memory of before


class Motion:
    """What sensors feel of a run: those that ask for the same instants share the answer."""

    def __init__(self, run: Trajectory, outputs: tuple[str, ...]) -> None:
        self.run, self.breaks = run, run.starts
        self.outputs = {False: tuple(name for name in outputs if name not in JUMPS), True: outputs}
        self.known: dict[tuple[bytes, bool], tuple[dict[str, Array], Index]] = {}

    def __call__(self, at: Array, source: str) -> tuple[dict[str, Array], Index]:
        """Values of an output and its like by name (forces cost more), and how many events each instant has passed."""
        key = at.tobytes(), source in JUMPS
        if key not in self.known:
            outputs = self.outputs[key[1]]
            values, piece = self.run.sample(np.clip(at, 0.0, self.run.duration), outputs)
            passed = np.searchsorted(self.run.event_pieces, piece, side="right")
            self.known[key] = dict(zip(outputs, values, strict=True)), passed
        return self.known[key]


def clear(passed: Index) -> Array:
    """Of each reading whether none of the events that it has passed is beside it, in the interval on either side.

    Where friction jumps there, a reading that is on the other side of the jump by a hundredth of its interval outweighs
    all others: one of 1,300, at 400 to 800 times its noise, held the search back and left Coulomb's law out on 3 of 40
    pairs of records whose gains were 0.5 % off.
    """
    between = np.diff(passed) == 0
    return np.append(True, between) * np.append(between, True).astype(np.float64)


@dataclass(frozen=True, eq=False)
class Sensor:
    """One channel over one stretch.

    Attributes
    ----------
    channel : Channel
        What is known of the sensor.
    rows : slice
        Rows of the record that are read.
    time : ndarray (n,)
        Instant [s] from the stretch's start that each row is of, the stated delay taken out.
    readings : ndarray (n,)
        What was read.
    noise : float
        Its standard deviation.
    """

    channel: Channel
    rows: slice
    time: Array
    readings: Array
    noise: float

    @classmethod
    def of(cls, record: Record, name: str, span: tuple[float, float], noise: float) -> Sensor:
        """The rows of a channel whose instants lie in a span of the record's clock."""
        channel = record.channels[name]
        first = max(0, math.ceil((span[0] + channel.delay) * record.fs - 1e-9))
        last = min(len(record), math.floor((span[1] + channel.delay) * record.fs + 1e-9) + 1)
        time = np.arange(first, last) / record.fs - channel.delay - span[0]
        return cls(channel, slice(first, last), time, record[name][first:last], noise)

    def remounted(self, frequency: float = 1.0, damping: float = 1.0) -> Sensor:
        """The sensor, its mount's resonance and damping ratio so many times those that it has."""
        if (frequency, damping) == (1.0, 1.0) or self.channel.mount is None:
            return self
        stated = self.channel.mount
        return replace(self, channel=replace(self.channel, mount=(frequency * stated[0], damping * stated[1])))

    @cached_property
    def known(self) -> Array:
        """Orthonormal columns (n, q) of what is free in any reading: an offset, and what the mount still rings with."""
        columns = [np.ones(len(self.time))]
        for pole in self.response.poles:
            if pole.imag >= 0:
                ringing = np.exp(pole * self.time)
                columns += [ringing.real, ringing.imag] if pole.imag > 0 else [ringing.real]
        known, triangle = np.linalg.qr(np.column_stack(columns))
        sizes = np.abs(np.diag(triangle))
        return np.asarray(known[:, sizes > 1e-6 * sizes[0]])

    def predicted(self, run: Motion, late: float) -> tuple[Array, Index | None]:
        """What it would read of a run, but for its gain and what is `known`; `late` [s] beyond the stated delay.

        Of what may jump from one sample to the next, also how many events of the run each sample has passed.
        """
        source, inertia = SENSED[self.channel.name], self.channel.inertia

        def sensed(at: Array) -> Array:
            values, _ = run(at, "a" if inertia else source)
            return values[source] + inertia * values["a"] if inertia else values[source]

        at = self.time - late
        if self.response.poles:
            return respond(sensed, breaks=run.breaks, times=at, response=self.response, nodes=NODES), None
        return sensed(at), run(at, source)[1] if source in JUMPS else None

    def changed(self, motion: Sensitivity, late: float) -> Array:
        """Derivatives of what it would read (n, K): a jump that comes later has left out its own impulse."""
        source, inertia = SENSED[self.channel.name], self.channel.inertia

        def sensed(at: Array) -> Array:
            inside = np.clip(at, 0.0, motion.run.duration)
            felt = motion.sample(inside, source)
            return felt + inertia * motion.sample(inside, "a") if inertia else felt

        at = self.time - late
        if not self.response.poles:
            return sensed(at).T
        changed = respond(sensed, breaks=motion.run.starts, times=at, response=self.response, nodes=NODES)
        jumps = motion.jumps(source) + (inertia * motion.jumps("a") if inertia else 0.0)
        jumped = np.flatnonzero(np.abs(jumps) > JUMPED * np.abs(jumps).max(initial=0.0))
        struck = motion.run.starts[1:][jumped], -jumps[jumped, None] * motion.later[1:][jumped]
        filter_ = np.array(self.response.poles), np.array(self.response.residues)
        ring(filter_, at, struck, np.empty(len(changed), dtype=complex), changed.T)
        return changed.T

    @cached_property
    def response(self) -> Response:
        """Of its mount and its discharge."""
        return _response(self.channel)

    def less_known(self, values: Array, passed: Index | None) -> Array:
        """Values less what is `known`, columns where there are several; an offset is that of the `clear` readings."""
        if passed is None:
            return np.asarray(values - self.known @ (self.known.T @ values))
        own = clear(passed)
        return np.asarray(values - own @ values / max(1.0, own.sum()))

    def freed(self, values: Array, passed: Index | None) -> Array:
        """The same in units of the noise; readings that are not `clear` count nothing, and the others for them."""
        left = self.less_known(values, passed) / self.noise
        if passed is None:
            return left
        own = clear(passed)
        return np.asarray((left.T * own).T * math.sqrt(len(own) / max(1.0, own.sum())))


@dataclass(frozen=True, eq=False)
class Stretch:
    """What all sensors read between two instants, and how the motion may have begun.

    Attributes
    ----------
    record : int
        Number of the record.
    span : tuple of (float, float)
        First and last instant [s] on the record's clock.
    sensors : tuple of Sensor
        What was read.
    drive : callable
        The drive from an instant on.
    start : mapping
        Displacement and velocity at the first instant, as estimated from the record.
    scales : ndarray (2,)
        Half the displacement's range [m] and the largest speed [m/s] of the record.
    """

    record: int
    span: tuple[float, float]
    sensors: tuple[Sensor, ...]
    drive: DriveFrom
    start: Mapping[str, float]
    scales: Array

    def run(self, oscillator: Oscillator, start: Mapping[str, float | str], off: Array) -> Trajectory:
        """The motion from a start on, to the last instant that a sensor read, under a drive that is `off`."""
        return simulate(self.driven(oscillator, off), duration=self.end, start=start, rtol=RTOL)

    @cached_property
    def end(self) -> float:
        """Instant [s] from the start that a sensor read last."""
        return max(float(sensor.time[-1]) for sensor in self.sensors)

    def driven(self, oscillator: Oscillator, off: Array) -> Oscillator:
        """The oscillator under the stretch's drive, which is `off`."""
        return replace(oscillator, drive=self.drive(self.span[0], self.span[0] + self.end, off))

    def told(self, run: Trajectory, delays: Mapping[str, float]) -> list[tuple[Array, Index | None]]:
        """What each sensor would read of a run, as :meth:`Sensor.predicted`; `delays` [s] by channel."""
        motion = self.motion(run)
        return [sensor.predicted(motion, delays.get(sensor.channel.name, 0.0)) for sensor in self.sensors]

    def motion(self, run: Trajectory) -> Motion:
        """What the sensors feel of a run."""
        return Motion(run, self.outputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Of a run that the sensors ask for."""
        outputs = {SENSED[sensor.channel.name] for sensor in self.sensors}
        outputs |= {"a"} if any(sensor.channel.inertia for sensor in self.sensors) else set()
        return tuple(sorted(outputs))

    def face_speed(self, oscillator: Oscillator) -> float:
        """Velocity [m/s] of the counter-face at the first instant."""
        motion = self.drive(*self.span).motion()
        rates = {"1": 1.0, **motion.start}
        slopes = {name: sum(c * rates[n] for n, c in row.items()) for name, row in motion.rates.items()}
        return sum(c * slopes.get(name, 0.0) for name, c in motion.face.items())


def remembered(law: object, speed: float, place: float) -> dict[str, float | str]:
    """Mode and memory of a law after sliding steadily at a speed [m/s], at a place [m]."""
    glider = Oscillator(mass=HEAVY, stiffness=0.0, law=law, drive=Release())  # type: ignore[arg-type]
    run = simulate(glider, duration=GLIDE, start={"v": speed}, rtol=RTOL)
    last = run.state(GLIDE)
    law_places = getattr(law, "places", ())
    memory: dict[str, float | str] = {"mode": run.table.modes[int(last["mode"])].name}
    for name in run.table.names[2 : run.table.physical]:
        memory[name] = last[name] + (place - last["x"] if name in law_places else 0.0)
    return memory


def attempted(
    stretch: Stretch, oscillator: Oscillator, start: Mapping[str, float | str], off: Array
) -> Trajectory | None:
    """The run, or None where the engine refuses such values."""
    try:
        return stretch.run(oscillator, start, off)
    except (SolveError, ModelError):
        return None


def _response(channel: Channel) -> Response:
    mount = resonance(*channel.mount) if channel.mount else Response()
    return mount.then(leak(channel.discharge)) if channel.discharge else mount


def channels_of(record: Record, wanted: Sequence[str] | None) -> tuple[str, ...]:
    """The channels to fit: those asked for, or all that were measured."""
    if wanted is not None:
        record.require(*wanted, question="a fitted law")
        if strange := [name for name in wanted if name not in SENSED]:
            raise ModelError(
                f"channels = {', '.join(wanted)}",
                f"a law explains {', '.join(SENSED)}; z and force drive the motion",
                f"leave {' and '.join(strange)} out",
            )
        if not wanted:
            raise ModelError("channels = []", "a law explains one channel at least", "name one, or leave channels= out")
        return tuple(wanted)
    names = [name for name in ("x", "v", "a", "load") if name in record]
    if not {"a", "load"} & set(names) and "friction" in record:
        names.append("friction")
    return tuple(names)
