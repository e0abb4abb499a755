"""Friction from all sensors together: a smoother that knows how each of them lies."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.record.channels import Channel
from stickslip.record.record import Record
from stickslip.signals.differentiate import differentiate, noise_along, smooth
from stickslip.signals.kalman import Motion, Smoothed, smooth_motion

Array = NDArray[np.float64]

PASSES = 6
POOL = 12.0  # samples over which the unrest of the friction is averaged
FIRST = 0.05  # share of the friction's size by which it may change in a sample, before anything is known
LEAST = 1e-9  # share of the force's size below which the friction's wandering is none
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
    parts = []
    for rows, inside in _blocks(len(record)):
        parts.append((inside, _smoothed(record.rows(rows.start, rows.stop), balance, sensors, push[rows])))
    displacement, velocity, friction = np.concatenate([part.values[:, inside] for inside, part in parts], axis=1)
    # q found by the passes still falls where the friction is calm, and the deviation goes with its fourth root
    sd = np.concatenate([(np.sqrt(part.variance) * _excess(part) ** 0.25)[:, inside] for inside, part in parts], axis=1)
    force = push - balance.stiffness * displacement - balance.damping * velocity - friction
    return Fused(friction, sd[2], velocity, sd[1], force / balance.mass)


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


def _smoothed(record: Record, balance: Balance, sensors: Sequence[str], push: Array) -> Smoothed:
    """One block of the record."""
    model = _Model.of([record.channels[name] for name in sensors], balance)
    readings = np.column_stack([record[name] for name in sensors]) - push[:, None] * model.direct
    noise = [float(np.mean(noise_along(record[name], record.fs, record.channels[name].noise) ** 2)) for name in sensors]
    force = float(np.std(push - balance.stiffness * record["x"])) or 1.0
    motion, inputs = model.steps(1 / record.fs, readings, np.array(noise), force, push)
    forms = np.eye(3, len(motion.start))
    unknown = np.full(len(push), (FIRST * force) ** 2)
    for _ in range(PASSES - 1):
        known = smooth_motion(motion, readings=readings, inputs=inputs, unknown=unknown, forms=forms)
        unknown = unknown * _excess(known, most=math.inf)
        unknown = np.maximum(unknown, max(float(np.median(unknown)), (LEAST * force) ** 2))
    return smooth_motion(motion, readings=readings, inputs=inputs, unknown=unknown, forms=forms)


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
    rates: Array  # what makes the doubt of a mount's velocity from that of its place [1/s]

    @classmethod
    def of(cls, channels: Sequence[Channel], balance: Balance) -> _Model:
        size = 3 + sum(2 * (c.mount is not None) + (c.discharge is not None) for c in channels)
        flow, push, rates = np.zeros((size, size)), np.zeros(size), np.zeros(size)
        flow[0, 1], push[1] = 1.0, 1 / balance.mass
        flow[1, :3] = -np.array([balance.stiffness, balance.damping, 1.0]) / balance.mass
        rows, direct, at = [], [], 3
        for channel in channels:
            weight = 1.0 if channel.name == "a" else channel.inertia
            row, at_once = weight * flow[1], weight * push[1]
            if channel.name in PLACES:
                row = row + np.eye(size)[PLACES[channel.name]]
            if channel.mount is not None:
                w, ratio = 2 * math.pi * channel.mount[0], channel.mount[1]
                flow[at, at + 1], flow[at + 1], push[at + 1] = 1.0, w * w * row, w * w * at_once
                flow[at + 1, at : at + 2] -= w * w, 2 * ratio * w
                rates[at], rates[at + 1] = 1.0, w
                row, at_once, at = np.eye(size)[at], 0.0, at + 2
            if channel.discharge is not None:
                flow[at] = row / channel.discharge
                flow[at, at] -= 1 / channel.discharge
                push[at], rates[at] = at_once / channel.discharge, 1.0
                row, at = row - np.eye(size)[at], at + 1
            rows.append(row)
            direct.append(at_once)
        return cls(flow, push, np.array(rows), np.array(direct), rates)

    def steps(self, step: float, readings: Array, noise: Array, force: float, push: Array) -> tuple[Motion, Array]:
        """The motion from sample to sample; the push and the friction change linearly in between."""
        from scipy.linalg import expm

        size = len(self.push)
        wide = np.zeros((size + 4, size + 4))
        wide[:size, :size], wide[:size, size], wide[size, size + 1] = self.flow, self.push, 1 / step
        wide[:size, size + 2] = np.eye(size)[2] / step
        whole = expm(wide * step)
        inputs = np.outer(push, whole[:size, size])
        inputs[:-1] += np.outer(np.diff(push), whole[:size, size + 1])
        swing = float(np.ptp(readings[:, 0])) + math.sqrt(noise[0])
        start, doubt = np.zeros(size), np.zeros(size)
        start[0] = readings[0, 0]
        doubt[:3] = swing**2, (swing / step / 10) ** 2, (10 * force) ** 2
        doubt[3:] = (self.rates[3:] * 10 * max(force, force * float(np.max(np.abs(self.push[1]))))) ** 2
        transition, spread = whole[:size, :size], whole[:size, size + 2]
        return Motion(transition, spread, self.rows, noise, start, doubt), inputs
