"""Friction from all sensors together: a smoother that knows how each of them lies."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array, Mask, Rows
from stickslip.balance.balance import Balance
from stickslip.record.channels import Channel
from stickslip.record.flaws import saturated
from stickslip.record.record import Record
from stickslip.signals.derivatives import LEAST, Filter, best_bandwidth
from stickslip.signals.kalman import Motion, Seen, Smoothed, log_likelihood, smooth_motion, surprises
from stickslip.signals.noise import local_noise, noise_along

POOL = 12.0  # samples over which the unrest of the friction is averaged
FIRST = 0.05  # share of the friction's size by which it may change in a sample, before anything is known
CALMEST = 1e-9  # share of the force's size below which the friction's wandering is none
FINEST = 1e-6  # of a sensor's range: a sensor without noise would leave the filter no digits
CALM = 1e-4  # share of the sliding friction by which friction strays from a holding contact in a sample
PLACES = {"x": 0, "v": 1, "load": 2}  # of what a sensor reads in the state
BLOCK, OVERLAP = 1 << 15, 1 << 11  # samples smoothed at a time, and those beside them that settle the ends


@dataclass(frozen=True)
class _Search:
    """How the wandering of the friction is found, and how sure the friction then is.

    The smoother's deviation is that of a friction whose every step is chance. It is not: it stays while the contact
    slides and follows it while it holds, and the half of the variance that chance would add between the readings
    is not there. So the deviation is `narrower` times that, and, where the wandering still falls when the passes end,
    goes with the power `falling` of what it falls by. Both were set on simulated rigs; there the band then holds 93
    to 97 % of the samples.
    """

    passes: int
    narrower: float
    falling: float


WITH_LOAD, WITHOUT = _Search(4, 0.63, 0.25), _Search(6, 0.70, 0.0)


@dataclass(frozen=True, eq=False)
class Fused:
    """Friction [N] with its standard deviation, velocity [m/s] with its own, and acceleration [m/s^2].

    `lost` says, sentence by sentence, which readings could not be used.
    """

    friction: Array
    friction_sd: Array
    velocity: Array
    velocity_sd: Array
    acceleration: Array
    lost: tuple[str, ...] = ()


def fuse(record: Record, balance: Balance, sensors: Sequence[str]) -> Fused:
    """What friction do all the sensors together tell?

    The state is the mass's displacement and velocity, the friction, and what swings in each sensor's mount; the
    friction wanders. How much it wanders is found sample by sample, from the record: the variance q of its steps is
    multiplied, pass by pass, by what the steps' score has over what it should have, both averaged over a few samples.
    So it wanders freely where the contact sticks or turns, and hardly where it slides.

    Parameters
    ----------
    record : Record
        Delays taken out; z and force are taken as known, after smoothing.
    balance : Balance
    sensors : sequence of str
        Of "x", "v", "a" and "load", those to use.

    Returns
    -------
    Fused
    """
    known, lost = _readable(record, sensors)
    candidates = [
        _smoothed(record.rows(rows.start, rows.stop), balance, {n: v[rows] for n, v in known.items()}, inside)
        for rows, inside in _blocks(len(record))
    ]
    parts = (np.concatenate(part) for part in zip(*candidates, strict=True))
    friction, friction_sd, velocity, velocity_sd, acceleration = parts
    return Fused(friction, friction_sd, velocity, velocity_sd, acceleration, lost)


def _blocks(size: int) -> Iterator[tuple[slice, slice]]:
    """Rows to smooth together, and which of them are kept."""
    for first in range(0, size, BLOCK):
        low, high = max(0, first - OVERLAP), min(size, first + BLOCK + OVERLAP)
        yield slice(low, high), slice(first - low, min(size, first + BLOCK) - low)


def _readable(record: Record, sensors: Sequence[str]) -> tuple[dict[str, Array], tuple[str, ...]]:
    """What each sensor read, NaN where it was clipped; and what is lost by that, in words."""
    known, lost = {}, []
    for name in sensors:
        values = np.array(record[name])
        missing = ~np.isfinite(values)
        cut = np.zeros(len(values), dtype=bool)
        cut[~missing] = saturated(values[~missing])
        for mask, what in ((missing, "missing"), (cut, "at the end of its range")):
            if mask.any():
                lost.append(f"{name} is {what} in {mask.sum()} of {len(values)} samples, which are left to the others")
        values[cut] = np.nan
        known[name] = values
    return known, tuple(lost)


def _push(record: Record, balance: Balance) -> tuple[Array, float]:
    """What the base and the applied force do to the mass [N], and how far that strays, as variance per second."""
    push = np.array(record["force"]) if "force" in record else np.zeros(len(record))
    if "z" not in record:
        return push, 0.0
    terms = {0: balance.stiffness, 1: balance.damping if balance.damper == "base" else 0.0}
    noise = noise_along(record["z"], record.fs, record.channels["z"].noise)
    smoother = Filter("smoother", record.fs, best_bandwidth(record["z"], record.fs))
    variance = smoother.inner_gain(terms) ** 2 * float(np.mean(noise**2))
    # its error keeps for 1 / (2 pi bandwidth), within which the mass gathers speed from it
    return push + smoother.apply(record["z"], terms), variance / (math.pi * smoother.bandwidth)


@dataclass(frozen=True, eq=False)
class Sensed:
    """What the sensors read of a stretch, less what the push adds to them at once, and what they are."""

    readings: Array
    noise: Array
    push: Array
    stray: float
    step: float
    force: float

    @classmethod
    def of(cls, record: Record, known: Mapping[str, Array], model: _Model, balance: Balance) -> Sensed:
        """From what is known of a record's channels, NaN where nothing is."""
        push, stray = _push(record, balance)
        noise = np.array([_noise(values, record, name) for name, values in known.items()])
        spans = np.array([np.nanmax(values) - np.nanmin(values) for values in known.values()])
        noise = np.maximum(noise, FINEST * spans) ** 2
        readings = np.column_stack(list(known.values())) - push[:, None] * model.direct
        force = float(np.nanstd(push - balance.stiffness * known["x"])) or 1.0
        return cls(readings, noise, push, stray, 1 / record.fs, force)


def _noise(values: Array, record: Record, name: str) -> float:
    """Root mean square of a sensor's noise, where it reads."""
    stated, there = record.channels[name].noise, values[np.isfinite(values)]
    return stated if stated is not None else float(np.sqrt(np.mean(local_noise(there, record.fs) ** 2)))


def _smoothed(record: Record, balance: Balance, known: Mapping[str, Array], inside: slice) -> tuple[Array, ...]:
    """Friction, velocity and acceleration of one block of the record, as in :class:`Fused`."""
    known = {name: values for name, values in known.items() if np.isfinite(values).sum() >= LEAST}
    search = WITH_LOAD if "load" in known else WITHOUT
    model = _Model.of([record.channels[name] for name in known], balance)
    sensed = Sensed.of(record, known, model, balance)
    motion, seen = _steps([model], np.zeros(len(record), dtype=np.intp), sensed)
    forms = np.eye(3, len(motion.start))
    unknown = np.full(len(record), (FIRST * sensed.force) ** 2)
    for _ in range(search.passes - 1):
        smoothed = smooth_motion(motion, seen, unknown=unknown, forms=forms[:0])
        unknown = unknown * _excess(smoothed)
        unknown = np.maximum(unknown, max(float(np.median(unknown)), (CALMEST * sensed.force) ** 2))
    smoothed = smooth_motion(motion, seen, unknown=unknown, forms=forms)
    falling = np.minimum(_excess(smoothed), 1.0) ** search.falling
    _, velocity_sd, friction_sd = np.sqrt(smoothed.variance)
    displacement, velocity, friction = smoothed.values
    force = sensed.push - balance.stiffness * displacement - balance.damping * velocity - friction
    terms = friction, search.narrower * falling * friction_sd, velocity, velocity_sd, force / balance.mass
    return tuple(values[inside] for values in terms)


@dataclass(frozen=True, eq=False)
class Held:
    """A record in parts of which the contact holds; elsewhere the friction may do as it likes.

    Within the step in which the contact takes hold or lets go the friction bends: such a step is taken in halves, each
    with its own change of the friction.
    """

    model: _Model
    sensed: Sensed
    regime: Rows  # 0: slides, 1: holds, 2: half a step beside a stick
    unknown: Array

    @classmethod
    def of(cls, record: Record, balance: Balance, sensors: Sequence[str], holds: Mask, level: float) -> Held:
        """`holds` is true for each step from a sample to the next within a stick; `level` [N] is the sliding friction.

        Between sticks nothing is taken over from what was found of the friction: it would lean on its own choice. The
        base's smoothing error is slow, and within a stick no more than a constant: it makes nothing less sure here.
        """
        known, _ = _readable(record, sensors)
        known = {name: values for name, values in known.items() if np.isfinite(values).sum() >= LEAST}
        model = _Model.of([record.channels[name] for name in known], balance)
        sensed = Sensed.of(record, known, model, balance)
        bends = ~holds & (np.append(holds[1:], False) | np.append(False, holds[:-1]))
        rows = np.repeat(np.arange(len(holds)), 1 + bends)
        second = np.append(False, rows[1:] == rows[:-1])
        readings = np.where(second[:, None], np.nan, sensed.readings[rows])
        halved = np.interp(rows + second / 2, np.arange(len(holds)), sensed.push)
        unknown = np.where(holds, (CALM * level) ** 2, level**2)[rows]
        sensed = replace(sensed, readings=readings, push=halved, stray=0.0)
        return cls(model, sensed, (holds + 2 * bends)[rows], unknown)

    def log_likelihood(self, stiffness: float, damping: float) -> float:
        """Of all readings, were the contact so stiff [N/m] and damped [N s/m]."""
        motion, seen = self._motion(stiffness, damping)
        return log_likelihood(motion, seen, unknown=self.unknown)

    def misfit(self, stiffness: float, damping: float) -> Array:
        """Each sensor's mean square surprise while the contact holds: 1 where all is as stated."""
        motion, seen = self._motion(stiffness, damping)
        surprise = surprises(motion, seen, unknown=self.unknown)[self.regime == 1]
        return np.asarray(np.nanmean(surprise**2, axis=0))

    def _motion(self, stiffness: float, damping: float) -> tuple[Motion, Seen]:
        models = [self.model, self.model.held(stiffness, damping), replace(self.model, share=0.5)]
        return _steps(models, self.regime, self.sensed)


def _excess(smoothed: Smoothed) -> Array:
    """What the steps' variance is over what it was taken to be, averaged over a few samples."""
    reach = round(4 * POOL)
    weight = np.exp(-0.5 * (np.arange(-reach, reach + 1) / POOL) ** 2)
    score, information = (
        np.convolve(np.pad(values, reach, mode="reflect"), weight, mode="valid")
        for values in (smoothed.score**2, smoothed.information)
    )
    return np.asarray(score / information)


@dataclass(frozen=True, eq=False)
class _Model:
    """Mass, friction and mounts as s' = flow s + push P; sensors as rows over s, and what P adds to them at once."""

    flow: Array
    push: Array
    rows: Array
    direct: Array
    scales: Array  # (sensors, states): what a mount's state may be, in units of its sensor's range
    share: float = 1.0  # of a sample that a step takes

    @classmethod
    def of(cls, channels: Sequence[Channel], balance: Balance) -> _Model:
        size = 3 + sum(2 * (c.mount is not None) + (c.discharge is not None) for c in channels)
        flow, push, scales = np.zeros((size, size)), np.zeros(size), np.zeros((len(channels), size))
        flow[0, 1], push[1] = 1.0, 1 / balance.mass
        flow[1, :3] = -np.array([balance.stiffness, balance.damping, 1.0]) / balance.mass
        rows, direct, at = [], [], 3
        for j, channel in enumerate(channels):
            weight = 1.0 if channel.name == "a" else channel.inertia
            row, at_once = weight * flow[1], weight * push[1]
            if channel.name in PLACES:
                row = row + np.eye(size)[PLACES[channel.name]]
            if channel.mount is not None:
                w, ratio = 2 * math.pi * channel.mount[0], channel.mount[1]
                flow[at, at + 1], flow[at + 1], push[at + 1] = 1.0, w * w * row, w * w * at_once
                flow[at + 1, at : at + 2] -= w * w, 2 * ratio * w
                scales[j, at : at + 2] = 1.0, w
                row, at_once, at = np.eye(size)[at], 0.0, at + 2
            if channel.discharge is not None:
                flow[at] = row / channel.discharge
                flow[at, at] -= 1 / channel.discharge
                push[at], scales[j, at] = at_once / channel.discharge, 1.0
                row, at = row - np.eye(size)[at], at + 1
            rows.append(row)
            direct.append(at_once)
        return cls(flow, push, np.array(rows), np.array(direct), scales)

    def held(self, stiffness: float, damping: float) -> _Model:
        """The same where the contact holds: the friction follows a spring and a damper, f' = K v + c v'."""
        flow, push = self.flow.copy(), self.push.copy()
        flow[2], push[2] = damping * self.flow[1], damping * self.push[1]
        flow[2, 1] += stiffness
        return replace(self, flow=flow, push=push)

    def step(self, length: float) -> tuple[Array, Array, Array, Array]:
        """Over one step: T, r, and what the push does at its start and by its change, both linear in between."""
        from scipy.linalg import expm

        length, size = self.share * length, len(self.push)
        wide = np.zeros((size + 4, size + 4))
        wide[:size, :size], wide[:size, size], wide[size, size + 1] = self.flow, self.push, 1 / length
        wide[:size, size + 2] = np.eye(size)[2] / length
        whole = expm(wide * length)[:size]
        return whole[:, :size], whole[:, size + 2], whole[:, size], whole[:, size + 1]

    def start(self, step: float, readings: Array, noise: float, force: float) -> tuple[Array, Array]:
        """The state before the first reading, as good as unknown, and its variances."""
        ranges = np.nanmax(readings, axis=0) - np.nanmin(readings, axis=0)
        start, doubt = np.zeros(len(self.push)), (ranges @ self.scales) ** 2
        start[0] = readings[np.isfinite(readings[:, 0]).argmax(), 0]
        doubt[:3] = ranges[0] ** 2 + noise, (ranges[0] / step / 10) ** 2, (10 * force) ** 2
        return start, doubt


def _steps(models: Sequence[_Model], regime: Rows, sensed: Sensed) -> tuple[Motion, Seen]:
    """The motion from sample to sample, by the model of each sample's regime."""
    transitions, spreads, pushed, changed = (
        np.array(part) for part in zip(*(model.step(sensed.step) for model in models), strict=True)
    )
    inputs = sensed.push[:, None] * pushed[regime]
    inputs[:-1] += np.diff(sensed.push)[:, None] * changed[regime[:-1]]
    start, doubt = models[0].start(sensed.step, sensed.readings, sensed.noise[0], sensed.force)
    drift = np.zeros(len(start))
    drift[1] = sensed.stray * (sensed.step * models[0].push[1] ** 2)
    motion = Motion(transitions, spreads, models[0].rows, sensed.noise, start, doubt, drift)
    return motion, Seen(sensed.readings, inputs, regime)
