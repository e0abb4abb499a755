"""Where the search for a law's parameters begins: from the friction as the motion tells it, the engine left out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.force import friction_force
from stickslip.drives.kinds import Release
from stickslip.errors import EstimateError
from stickslip.law.drive import as_driven, face_of
from stickslip.law.releases import Rests
from stickslip.laws.compliant import CompliantContact
from stickslip.laws.coulomb import Coulomb
from stickslip.laws.lugre import LuGre
from stickslip.laws.smooth_state import SmoothStateVariable
from stickslip.laws.stribeck import Stribeck
from stickslip.oscillator import Oscillator
from stickslip.record.record import Record

Array = NDArray[np.float64]

FAST = 0.3  # of the largest speed, above which friction is that of sliding
SLOW = 0.05  # of it, below which the contact may hold
LEAST_EXCESS = 0.03  # of the static friction over the kinetic, at a start
EDGE = 24  # samples at either end that a smoother knows less of
STIFFEST, SOFTEST = 3000.0, 3.0  # of a contact against the spring that its friction bends over the stroke
SPEEDS = (0.02, 0.3)  # of the largest speed: where a Stribeck curve falls
RATES = (2.0, 80.0)  # of the oscillation's angular frequency, at which friction follows
STEEPEST = 60.0  # over the largest speed: a backbone's slope
LIGHT = 0.02  # damping of a contact over sqrt(stiffness * mass): a hundredth of the critical
GRID = 16


@dataclass(frozen=True, eq=False)
class Seen:
    """Sliding and friction of all records, end to end.

    Attributes
    ----------
    slip, speed, friction : ndarray (n,)
        Way [m] from one sample to the next, velocity [m/s] and friction [N] at the contact.
    step : ndarray (n,)
        Time [s] to the next sample.
    level : float
        Friction of fast sliding [N].
    frequency : float
        Angular frequency [rad/s] of the motion: speed over displacement.
    rests : Rests
        Friction around rest.
    mass : float
        What slides [kg].
    """

    slip: Array
    speed: Array
    friction: Array
    step: Array
    level: float
    frequency: float
    rests: Rests
    mass: float

    @classmethod
    def of(cls, records: Sequence[Record], oscillator: Oscillator) -> Seen:
        """What the sensors of the records say together of sliding and friction."""
        slips, speeds, frictions, steps, ways, rests = [], [], [], [], [], []
        for record in records:
            told = _told(as_driven(record, oscillator.drive), oscillator)
            inner = slice(EDGE, -EDGE)
            face, speed = face_of(oscillator.drive, told)
            x, v = told["x"] - face, told["v"] - speed
            slips.append(np.diff(x, append=x[-1])[inner])
            speeds.append(v[inner])
            frictions.append(told["friction"][inner])
            steps.append(np.full(len(slips[-1]), 1 / told.fs))
            ways.append(x[inner] - x[inner].mean())
            rests.append(_rests(told, speeds[-1], frictions[-1], ways[-1]))
        speed, friction = np.concatenate(speeds), np.concatenate(frictions)
        fast = np.abs(speed) > FAST * np.abs(speed).max()
        level = float(np.median((friction * np.sign(speed))[fast]))
        if not level > 0:
            still = not any({"z", "force"} & set(record) for record in records) and oscillator.drive == Release()
            raise EstimateError(
                f"friction of {level:.3g} N while it slides" + (", the base taken to be at rest" if still else ""),
                "friction opposes the velocity",
                "give the base's motion as channel z, or the drive; where the motion is imposed, fit a curve of "
                "friction (fit_curve, --curve)" if still
                else "correct the signs of the channels, or mass= and stiffness=",
            )  # fmt: skip
        way = float(np.std(np.concatenate(ways)))
        return cls(np.concatenate(slips), speed, friction, np.concatenate(steps), level, float(np.std(speed)) / way,
                   Rests.together(rests), oscillator.mass)  # fmt: skip

    @property
    def fastest(self) -> float:
        """The largest speed [m/s]."""
        return float(np.abs(self.speed).max())

    def left(self, told: Array) -> float:
        """Mean square of what a told friction leaves."""
        return float(np.mean((self.friction - told) ** 2))


def _rests(told: Record, speed: Array, friction: Array, way: Array) -> Rests:
    unsure = float(np.median(told["v_sd"])) if "v_sd" in told else 0.0
    frequency = float(np.std(speed)) / max(float(np.std(way)), 1e-300)
    return Rests.of(speed, friction, fs=told.fs, frequency=frequency, unsure=unsure)


def _told(record: Record, oscillator: Oscillator) -> Record:
    method = "fusion" if {"a", "load"} & set(record) else "smoother"
    return friction_force(
        record, mass=oscillator.mass, stiffness=oscillator.stiffness, damping=oscillator.damping,
        damper=oscillator.damper, method=method, contact=getattr(oscillator.drive, "contact", "ground"),
    )  # fmt: skip


def coulomb(seen: Seen) -> list[Any]:
    """The level of fast sliding."""
    return [Coulomb(seen.level)]


def static(seen: Seen) -> list[Any]:
    """What friction reaches at a release, or at rest, over the level."""
    fall = seen.rests.fall
    excess = _excess(seen) if fall is None else max(LEAST_EXCESS, fall.value)
    return [Coulomb(seen.level, static=seen.level * (1 + excess))]


def _excess(seen: Seen) -> float:
    slow = np.abs(seen.speed) < SLOW * seen.fastest
    reached = float(np.quantile(np.abs(seen.friction[slow]), 0.9)) if slow.sum() > EDGE else seen.level
    return max(LEAST_EXCESS, min(1.0, reached / seen.level - 1))


def stribeck(seen: Seen) -> list[Any]:
    """The curves that the sliding friction fits best, of three falls that differ: its likelihood has several tops."""
    sliding = np.abs(seen.speed) > 0.2 * SLOW * seen.fastest
    speed, friction = np.abs(seen.speed[sliding]), (seen.friction * np.sign(seen.speed))[sliding]
    tried = []
    for fall in seen.fastest * np.geomspace(*SPEEDS, GRID):
        columns = np.column_stack([np.ones(len(speed)), np.exp(-((speed / fall) ** 2))])
        (level, excess), left, *_ = np.linalg.lstsq(columns, friction, rcond=None)
        static = float(level + max(LEAST_EXCESS * level, excess))
        tried.append((float(left[0]) if len(left) else np.inf, Stribeck(float(level), static, speed=float(fall))))
    best = min(range(GRID), key=lambda i: tried[i][0])
    apart = dict.fromkeys((best, max(0, best - GRID // 3), min(GRID - 1, best + GRID // 3)))
    return [tried[i][1] for i in apart]


def compliant(seen: Seen) -> list[Any]:
    """The spring that the friction bends where it turns, and what is left of it in phase with the speed."""
    stiffest = 2 * seen.level * STIFFEST / float(np.ptp(np.cumsum(seen.slip)))
    stiffness = np.geomspace(stiffest * SOFTEST / STIFFEST, stiffest, 2 * GRID)
    force = _elastoplastic(seen, stiffness)
    tried = []
    for k, told in zip(stiffness, force.T, strict=True):
        held = np.abs(told) < seen.level * (1 - 1e-9)
        damping = _share(seen.speed[held], (seen.friction - told)[held])
        told = np.where(held, told + damping * seen.speed, told)
        # a number that is zero is not fitted: a loss that the friction does not show is begun small
        damping = max(damping, LIGHT * math.sqrt(float(k) * seen.mass))
        tried.append((seen.left(told), CompliantContact(seen.level, stiffness=float(k), damping=damping)))
    return [min(tried, key=lambda each: each[0])[1]]


def _share(column: Array, values: Array) -> float:
    power = float(column @ column)
    return float(column @ values) / power if power > 0 else 0.0


def _elastoplastic(seen: Seen, stiffness: Array) -> Array:
    """Force of springs that yield at the level, one column each."""
    force = np.empty((len(seen.slip), len(stiffness)))
    now = np.zeros(len(stiffness))
    for row, slip in zip(force, seen.slip, strict=True):
        row[:] = now
        now = np.clip(now + stiffness * slip, -seen.level, seen.level)
    return force


def state_variable(seen: Seen) -> list[Any]:
    """The rate and steepness whose lagging backbone follows the friction best."""
    from scipy.signal import lfilter

    step, tried = float(seen.step[0]), []
    for steepness in np.geomspace(3.0, STEEPEST, GRID) / seen.fastest:
        backbone = np.tanh(steepness * seen.speed)
        for rate in seen.frequency * np.geomspace(*RATES, GRID):
            kept = np.exp(-rate * step)
            lagging = lfilter([1 - kept], [1, -kept], backbone)
            level = _share(lagging, seen.friction)
            tried.append((seen.left(level * lagging), level, rate, steepness))
    _, level, rate, steepness = min(tried)
    level = max(level, 0.1 * seen.level)
    return [SmoothStateVariable(level, rate=float(rate) / level, steepness=float(steepness))]


def lugre(seen: Seen) -> list[Any]:
    """The bristles whose bending under the measured sliding follows the friction best."""
    contact = compliant(seen)[0]
    mesh = np.meshgrid(
        contact.stiffness * np.array([1.0, 1.5, 2.5]), seen.fastest * np.geomspace(*SPEEDS, 6),
        np.array([LEAST_EXCESS, 0.1, 0.2, 0.35, 0.6]),
    )  # fmt: skip
    stiffness, speed, excess = (values.ravel() for values in mesh)
    force = _bristles(seen, stiffness, speed, excess)
    best = int(np.argmin(np.mean((force - seen.friction[:, None]) ** 2, axis=0)))
    static = seen.level * (1 + float(excess[best]))
    return [
        LuGre(seen.level, static, speed=float(speed[best]), stiffness=float(stiffness[best]), damping=contact.damping)
    ]


def _bristles(seen: Seen, stiffness: Array, speed: Array, excess: Array) -> Array:
    """Force of bristles without damping, one column each; an implicit step, since sliding bends them stiffly."""
    force = np.empty((len(seen.slip), len(stiffness)))
    now = np.zeros(len(stiffness))
    levels = seen.level * (1 + excess * np.exp(-((seen.speed[:, None] / speed) ** 2)))
    for row, slip, level in zip(force, seen.slip, levels, strict=True):
        row[:] = now
        now = (now + stiffness * slip) / (1 + stiffness * abs(slip) / level)
    return force


GUESSES: dict[str, Callable[[Seen], list[Any]]] = {
    "Coulomb": coulomb,
    "static": static,
    "Stribeck": stribeck,
    "compliant": compliant,
    "state variable": state_variable,
    "LuGre": lugre,
}
