"""Friction from all sensors together: a smoother that knows how each of them lies."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.record.channels import Channel
from stickslip.record.record import Record
from stickslip.signals.differentiate import differentiate, noise_along, smooth
from stickslip.signals.kalman import Motion, Seen, Smoothed, log_likelihood, smooth_motion

Array = NDArray[np.float64]

PASSES = 6
POOL = 12.0  # samples over which the unrest of the friction is averaged
FIRST = 0.05  # share of the friction's size by which it may change in a sample, before anything is known
LEAST = 1e-9  # share of the force's size below which the friction's wandering is none
FINEST = 1e-6  # of a sensor's range: a sensor without noise would leave the filter no digits
CALM = 1e-4  # share of the sliding friction by which friction strays from a holding contact in a sample
PLACES = {"x": 0, "v": 1, "load": 2}  # of what a sensor reads in the state
BLOCK, OVERLAP = 1 << 15, 1 << 11  # samples smoothed at a time, and those beside them that settle the ends


@dataclass(frozen=True)
class Balance:
    """m a = k (z - x) - c (v - dz/dt or 0) + P - f."""

    mass: float
    stiffness: float
    damping: float
    damper: str


@dataclass(frozen=True, eq=False)
class Fused:
    """Friction [N] with its standard deviation, velocity [m/s] with its own, and acceleration [m/s^2]."""

    friction: Array
    friction_sd: Array
    velocity: Array
    velocity_sd: Array
    acceleration: Array


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
    push = _push(record, balance)
    values, sd = [], []
    for rows, inside in _blocks(len(record)):
        known = _smoothed(record.rows(rows.start, rows.stop), balance, sensors, push[rows])
        values.append(known.values[:, inside])
        # q found by the passes still falls where the friction is calm, and the deviation goes with its fourth root
        sd.append((np.sqrt(known.variance) * _excess(known) ** 0.25)[:, inside])
    displacement, velocity, friction = np.concatenate(values, axis=1)
    _, velocity_sd, friction_sd = np.concatenate(sd, axis=1)
    force = push - balance.stiffness * displacement - balance.damping * velocity - friction
    return Fused(friction, friction_sd, velocity, velocity_sd, force / balance.mass)


def _blocks(size: int) -> Iterator[tuple[slice, slice]]:
    """Rows to smooth together, and which of them are kept."""
    for first in range(0, size, BLOCK):
        low, high = max(0, first - OVERLAP), min(size, first + BLOCK + OVERLAP)
        yield slice(low, high), slice(first - low, min(size, first + BLOCK) - low)


def _push(record: Record, balance: Balance) -> Array:
    """What the base and the applied force do to the mass [N]."""
    push = np.array(record["force"]) if "force" in record else np.zeros(len(record))
    if "z" in record:
        push = push + balance.stiffness * smooth(record["z"], record.fs).values
        if balance.damper == "base" and balance.damping:
            push = push + balance.damping * differentiate(record["z"], record.fs).values
    return push


@dataclass(frozen=True, eq=False)
class Sensed:
    """What the sensors read of a stretch, less what the push adds to them at once, and what they are."""

    readings: Array
    noise: Array
    push: Array
    step: float
    force: float

    @classmethod
    def of(cls, record: Record, sensors: Sequence[str], push: Array, model: _Model, stiffness: float) -> Sensed:
        """From a record's channels."""
        readings = np.column_stack([record[name] for name in sensors]) - push[:, None] * model.direct
        noise = [float(np.mean(noise_along(record[n], record.fs, record.channels[n].noise) ** 2)) for n in sensors]
        force = float(np.std(push - stiffness * record["x"])) or 1.0
        noise = np.maximum(noise, (FINEST * np.ptp(readings, axis=0)) ** 2)
        return cls(readings, noise, push, 1 / record.fs, force)


def _smoothed(record: Record, balance: Balance, sensors: Sequence[str], push: Array) -> Smoothed:
    """One block of the record."""
    model = _Model.of([record.channels[name] for name in sensors], balance)
    sensed = Sensed.of(record, sensors, push, model, balance.stiffness)
    motion, seen = _steps([model], np.zeros(len(push), dtype=np.intp), sensed)
    forms = np.eye(3, len(motion.start))
    unknown = np.full(len(push), (FIRST * sensed.force) ** 2)
    for _ in range(PASSES - 1):
        known = smooth_motion(motion, seen, unknown=unknown, forms=forms)
        unknown = unknown * _excess(known, most=math.inf)
        unknown = np.maximum(unknown, max(float(np.median(unknown)), (LEAST * sensed.force) ** 2))
    return smooth_motion(motion, seen, unknown=unknown, forms=forms)


@dataclass(frozen=True, eq=False)
class Held:
    """A record in parts of which the contact holds; elsewhere the friction may do as it likes.

    Within the step in which the contact takes hold or lets go the friction bends: such a step is taken in halves, each
    with its own change of the friction.
    """

    model: _Model
    sensed: Sensed
    regime: NDArray[np.intp]  # 0: slides, 1: holds, 2: half a step beside a stick
    unknown: Array

    @classmethod
    def of(
        cls, record: Record, balance: Balance, sensors: Sequence[str], holds: NDArray[np.bool_], level: float
    ) -> Held:
        """`holds` is true for each step from a sample to the next within a stick; `level` [N] is the sliding friction.

        Between sticks nothing is taken over from what was found of the friction: it would lean on its own choice.
        """
        push = _push(record, balance)
        model = _Model.of([record.channels[name] for name in sensors], balance)
        sensed = Sensed.of(record, sensors, push, model, balance.stiffness)
        bends = ~holds & (np.append(holds[1:], False) | np.append(False, holds[:-1]))
        rows = np.repeat(np.arange(len(holds)), 1 + bends)
        second = np.append(False, rows[1:] == rows[:-1])
        readings = np.where(second[:, None], np.nan, sensed.readings[rows])
        halved = np.interp(rows + second / 2, np.arange(len(holds)), sensed.push)
        unknown = np.where(holds, (CALM * level) ** 2, level**2)[rows]
        return cls(model, replace(sensed, readings=readings, push=halved), (holds + 2 * bends)[rows], unknown)

    def log_likelihood(self, stiffness: float, damping: float) -> float:
        """Of all readings, were the contact so stiff [N/m] and damped [N s/m]."""
        models = [self.model, self.model.held(stiffness, damping), replace(self.model, share=0.5)]
        motion, seen = _steps(models, self.regime, self.sensed)
        return log_likelihood(motion, seen, unknown=self.unknown)


def _excess(known: Smoothed, most: float = 1.0) -> Array:
    """What the steps' variance is over what it was taken to be, averaged over a few samples; `most` at most."""
    from scipy.ndimage import gaussian_filter1d

    ratio = gaussian_filter1d(known.score**2, POOL) / gaussian_filter1d(known.information, POOL)
    return np.asarray(np.minimum(ratio, most))


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
        start[0] = readings[0, 0]
        doubt[:3] = ranges[0] ** 2 + noise, (ranges[0] / step / 10) ** 2, (10 * force) ** 2
        return start, doubt


def _steps(models: Sequence[_Model], regime: NDArray[np.intp], sensed: Sensed) -> tuple[Motion, Seen]:
    """The motion from sample to sample, by the model of each sample's regime."""
    transitions, spreads, pushed, changed = (
        np.array(part) for part in zip(*(model.step(sensed.step) for model in models), strict=True)
    )
    inputs = sensed.push[:, None] * pushed[regime]
    inputs[:-1] += np.diff(sensed.push)[:, None] * changed[regime[:-1]]
    start, doubt = models[0].start(sensed.step, sensed.readings, sensed.noise[0], sensed.force)
    motion = Motion(transitions, spreads, models[0].rows, sensed.noise, start, doubt)
    return motion, Seen(sensed.readings, inputs, regime)
