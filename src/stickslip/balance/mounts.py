"""Resonances that sensors see: those of the mounts they stand on, from a forced motion."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.balance.balance import Balance, known_constants
from stickslip.balance.fusion import fuse
from stickslip.balance.lag import SensorDelay, sensor_delay
from stickslip.balance.mass import Lines
from stickslip.balance.motion import is_measured
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Estimate, Plain
from stickslip.record.record import Record, Step
from stickslip.signals.derivatives import LEAST
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_along, noise_level
from stickslip.signals.response import resonance

ACCELEROMETER, CELL = "mount of the accelerometer", "mount of the load cell"
COARSE = 12  # frequencies of each mount that the search begins with
STARTS = 4  # of them that are refined
TOLD = 30.0  # by how much a mount must lower the scaled sum of squares: two parameters by chance lower it by 2
FIRST_DAMPING = 0.07
# Variance of what is left without a mount, in that of noise and gains, from which there is something to explain: of a
# motion that is not periodic, with noise alone, 1.3 was left, and two mounts alike took it up.
NEEDED = 2.0
HEARD = 3.0  # standard deviations of its noise from which a line counts


@dataclass(frozen=True)
class Resonance(Plain):
    """Something that swings.

    Attributes
    ----------
    name : str
        "mount of the accelerometer", "mount of the load cell" or "coupled contact"; "resonance seen by a" where none of
        these, numbered where there are several.
    frequency : Estimate
        Undamped natural frequency [Hz].
    damping : Estimate
        Damping ratio.
    channels : tuple of str
        Which channels show it.
    evidence : str
        Why it bears its name.
    """

    name: str
    frequency: Estimate
    damping: Estimate
    channels: tuple[str, ...]
    evidence: str

    def __str__(self) -> str:
        frequency, damping = (
            str(number).replace(f" of the {self.name}", "") for number in (self.frequency, self.damping)
        )
        return f"{self.name}: {frequency}, {damping}; {self.evidence}"


@dataclass(frozen=True, eq=False)
class _MeanLines:
    """Mean lines of a forced motion: what the accelerometer and the load cell read, and what pulls the mass."""

    frequency: Array
    acceleration: Complex
    load: Complex
    pull: Complex
    sd: Array
    load_sd: Array
    mass: float
    inertia: float

    def misfit(self, accelerometer: tuple[float, float] | None, cell: tuple[float, float] | None) -> Array:
        """What the accelerometer reads beyond what the load cell lets expect, in standard deviations."""
        unit = np.ones(len(self.frequency), dtype=complex)
        swung = resonance(*accelerometer).at(self.frequency) if accelerometer else unit
        felt = resonance(*cell).at(self.frequency) if cell else unit
        share = self.inertia / self.mass
        friction = (self.load / felt - share * self.pull) / (1 - share)
        rest = self.acceleration - swung * (self.pull - friction) / self.mass
        sd = np.hypot(self.sd, np.abs(swung / felt) * self.load_sd / self.mass)
        return np.concatenate([rest.real / sd, rest.imag / sd])


def find_mounts(lines: Lines, record: Record, balance: Balance) -> tuple[Resonance, ...]:
    r"""Which mounts swing, if the accelerometer and the load cell are to tell one motion?

    With the pull :math:`p = k(z - x) - c\dot x + P` and :math:`\mu` the flange's mass over m, the friction is
    :math:`f = (L/H_l - \mu p)/(1 - \mu)` from the load cell's reading L, and the accelerometer reads
    :math:`H_a (p - f)/m`. Frequency and damping of both mounts are those that bring every line of the two readings
    together, by least squares. A mount is named only where the lines can not do without it.
    """
    return _swinging(_mean_lines(lines, record, balance))


def _swinging(means: _MeanLines) -> tuple[Resonance, ...]:
    """The mounts without which the lines would be further apart than noise and gains put them."""
    if len(means.frequency) < 8 or np.mean(means.misfit(None, None) ** 2) < NEEDED:
        return ()
    fits = {kinds: _fitted(means, kinds) for kinds in ("", "a", "l", "al")}
    best = fits["al"]
    scale = max(1.0, best.cost / max(1, 2 * len(means.frequency) - 4))
    shown = [k for k, other in (("a", "l"), ("l", "a")) if (fits[other].cost - best.cost) / scale > TOLD]
    kept = fits["".join(shown)]
    return tuple(resonance for kind in shown for resonance in _named(kept, kind, means))


def _mean_lines(lines: Lines, record: Record, balance: Balance) -> _MeanLines:
    """The mean lines, those that stand out of the noise in both readings."""
    s = 2j * np.pi * lines.frequency
    mean = {name: values.mean(axis=0) for name, values in lines.amplitudes.items()}
    nothing = np.zeros(len(s), dtype=complex)
    base = mean.get("z", nothing)
    driven = balance.damping * s * (mean["x"] - (base if balance.damper == "base" else 0.0))
    pull = balance.stiffness * (base - mean["x"]) - driven + mean.get("force", nothing)
    points = 2.0 * (len(lines.frequency) + 1) * lines.count * lines.worth
    level = {}
    for name in ("x", "z", "a", "load"):
        noise = noise_along(record[name], record.fs, record.channels[name].noise) if name in mean else np.zeros(1)
        level[name] = math.sqrt(2 * float(np.mean(noise**2)) / points)  # of the real part of a mean line
    pulled = balance.stiffness * math.hypot(level["x"], level["z"])
    off = _unsure(mean, record, balance)
    heard = (np.abs(mean["a"]) > HEARD * level["a"]) & (np.abs(mean["load"]) > HEARD * level["load"])
    heard &= lines.frequency < 0.4 * record.fs
    size = int(heard.sum())
    return _MeanLines(
        lines.frequency[heard],
        mean["a"][heard],
        mean["load"][heard],
        pull[heard],
        np.hypot(math.hypot(level["a"], pulled / balance.mass), off[heard]),
        np.full(size, level["load"]),
        balance.mass,
        record.channels["load"].inertia,
    )


def _unsure(mean: Mapping[str, Complex], record: Record, balance: Balance) -> Array:
    """By how much each line of the acceleration may be off by gains and constants that are as unsure as stated."""
    sd = record.rig.sd if record.rig is not None else {}
    gains = {name: record.channels[name].gain_sd * mean[name] for name in mean if name in record}
    stretch = mean["x"] - mean.get("z", 0.0)
    parts = [gains["a"], sd.get("mass", 0.0) / balance.mass * mean["a"], gains["load"] / balance.mass]
    parts += [balance.stiffness / balance.mass * gains[name] for name in ("x", "z") if name in gains]
    return np.asarray(np.linalg.norm([*parts, sd.get("stiffness", 0.0) / balance.mass * stretch], axis=0))


@dataclass(frozen=True, eq=False)
class _Fitted:
    kinds: str
    cost: float
    values: Array  # log frequency and log damping of each mount
    covariance: Array


def _fitted(balance: _MeanLines, kinds: str) -> _Fitted:
    """The best mounts of these kinds ("a", "l"), from a coarse search."""
    from itertools import product

    from scipy.optimize import least_squares

    def misfit(values: Array) -> Array:
        pairs = {kind: (np.exp(values[2 * j]), np.exp(values[2 * j + 1])) for j, kind in enumerate(kinds)}
        return balance.misfit(pairs.get("a"), pairs.get("l"))

    if not kinds:
        return _Fitted(kinds, float(np.sum(misfit(np.empty(0)) ** 2)), np.empty(0), np.empty((0, 0)))
    low, high = math.log(2 * balance.frequency[0]), math.log(2 * balance.frequency[-1])
    places = np.linspace(low, high, COARSE)
    damping = math.log(FIRST_DAMPING)
    grid = [np.array([[place, damping] for place in chosen]).ravel() for chosen in product(places, repeat=len(kinds))]
    grid.sort(key=lambda values: float(np.sum(np.abs(misfit(values)))))
    bounds = ([low - 1, math.log(1e-4)] * len(kinds), [high + 1, math.log(2.0)] * len(kinds))
    solve: Any = least_squares
    fits = [solve(misfit, start, bounds=bounds, x_scale=0.05) for start in grid[:STARTS]]
    best = min(fits, key=lambda fit: float(fit.cost))
    curved = best.jac.T @ best.jac
    scale = max(1.0, 2 * best.cost / max(1, len(best.fun) - len(best.x)))
    return _Fitted(kinds, float(2 * best.cost), best.x, scale * np.linalg.pinv(curved))


def _named(fit: _Fitted, kind: str, balance: _MeanLines) -> list[Resonance]:
    """The mount as a resonance, if its frequency lies among the lines."""
    at = 2 * fit.kinds.index(kind)
    frequency, damping = np.exp(fit.values[at : at + 2])
    if not balance.frequency[0] < frequency < balance.frequency[-1]:
        return []
    sd = np.sqrt(np.diag(fit.covariance))[at : at + 2]
    name, channel = (ACCELEROMETER, "a") if kind == "a" else (CELL, "load")
    method = f"{len(balance.frequency)} lines of acceleration and load, by least squares"
    other = "load" if kind == "a" else "a"
    return [
        Resonance(
            name,
            Estimate.normal(f"frequency of the {name}", frequency, sd=frequency * sd[0], unit="Hz", method=method),
            Estimate.normal(
                f"damping ratio of the {name}", damping, sd=damping * sd[1], unit="1", method=method
            ).within(0),
            (channel,),
            f"{channel} swings where {other} does not",
        )
    ]


LOUD = 0.09  # of the acceleration's standard deviation: noise that hides micro-slips
ROUNDED = 0.04  # of the same: by so much the smoother rounds the kinks off
SWINGS = 7.0  # what is left of the mounts lasts for samples, and counts as white noise so many times larger
COMPARED = 40_000  # samples in which the accelerometer is compared with the displacement
SAMPLED = 0.002  # of the same: what sampling makes of kinks, which between noise-free channels looks like a mount
APART = 0.1e-3  # s between x and a, taken for one instant, that spoils what both say together


@dataclass(frozen=True, eq=False)
class Acceleration:
    """A record whose acceleration can be asked about rings, and what speaks against it, "" where nothing does.

    `blurred` is true where a smoother made it without a load cell: what it leaves may look like a micro-slip, or, above
    `fastest` [Hz], like a mode.
    """

    record: Record
    doubt: str = ""
    blurred: bool = False
    fastest: float = math.inf


def acceleration_of_mass(
    record: Record, channel: str, *, mass: Constant | None, stiffness: Constant | None, question: str
) -> Acceleration:
    """The acceleration as read; from all sensors together where it is noisy or its mount stated, if the rig is known.

    The smoother of ``friction_force(method="fusion")`` knows the mounts. A load cell whose mount is not stated is left
    out. A mount that is neither stated nor taken out shows between displacement and acceleration.
    """
    mount, noise = record.channels[channel].mount, _noise_share(record, channel)
    swings = mount is not None and mount[0] < record.fs / 2
    rig = known_constants(record, mass=mass, stiffness=stiffness)
    known = {"mass", "stiffness"} <= set(rig) and {"x", "z"} <= set(record) and channel == "a"
    if known and (swings or noise > LOUD):
        return _fused(record, rig, question)
    if swings and mount is not None:
        return Acceleration(
            record,
            f"{channel} stands on a mount of {mount[0]:g} Hz, whose ringing is in it: give x, "
            "z, mass and stiffness to have it taken out",
        )
    return Acceleration(record, _mount_seen(record, channel) or _too_loud(channel, noise))


def _fused(record: Record, rig: dict[str, Any], question: str) -> Acceleration:
    """What all sensors together say of the acceleration, with the noise that this counts as."""
    balance = Balance(rig["mass"], rig["stiffness"], rig.get("damping", 0.0), rig.get("damper", "ground"))
    load = ["load"] if is_measured(record, "load") and record.channels["load"].mount is not None else []
    sensors = ["x", *(["v"] if is_measured(record, "v") else []), "a", *load]
    used = [*sensors, "z", *(["force"] if "force" in record else [])]
    record = without_delays(record, *used, question=question, samples=LEAST)
    compared = _compared(record)
    fusion = fuse(record, balance, sensors)
    sd, values = float(np.median(fusion.friction_sd)) / balance.mass, fusion.acceleration
    noise = max(SWINGS * sd, ROUNDED * float(values.std()))
    step = Step("acceleration_of_mass", {"sensors": sensors}, "by a smoother that knows the stated mounts")
    samples = {name: values for name, values in record.samples.items() if name != "a"}
    kept = replace(record, samples=samples, channels={n: c for n, c in record.channels.items() if n != "a"})
    made = kept.with_channel("a", values, unit="m/s^2", source="acceleration_of_mass", noise=noise, step=step)
    unstated = "" if record.channels["a"].mount is not None else _mount_of(compared, record.fs)
    doubt = "; ".join(filter(None, [_late(compared), unstated])) or _too_loud("a", noise / float(values.std()))
    mount = record.channels["a"].mount
    fastest = mount[0] / 2 if mount is not None and not load else math.inf
    return Acceleration(made, doubt, not load, fastest)


def _noise_share(record: Record, channel: str) -> float:
    values, stated = record[channel], record.channels[channel].noise
    return (noise_level(values, record.fs) if stated is None else stated) / float(values.std())


def _too_loud(channel: str, share: float) -> str:
    if share <= LOUD:
        return ""
    return (
        f"the noise of {channel} is {100 * share:.0f} % of its standard deviation, and from {100 * LOUD:.0f} % on "
        "hides rings and micro-slips: give x, z, mass and stiffness where they lack, or take a quieter record"
    )


def _compared(record: Record) -> SensorDelay | None:
    """The accelerometer against the displacement, where both were measured and follow one motion."""
    if not (is_measured(record, "a") and is_measured(record, "x")):
        return None
    part = record.rows(0, min(COMPARED, len(record)))
    noise = max(noise_level(part["a"], part.fs), SAMPLED * float(part["a"].std()))
    try:
        return sensor_delay(part.with_details("a", noise=noise))
    except EstimateError:  # the two can not be compared: nothing is said about the mount
        return None


def _mount_seen(record: Record, channel: str) -> str:
    return _mount_of(_compared(record), record.fs) if channel == "a" else ""


def _late(compared: SensorDelay | None) -> str:
    """In words: x and a, put together, are not of one instant."""
    if compared is None or abs(compared.delay.value) <= max(APART, 3 * compared.delay.sd):
        return ""
    first, second = ("x", "a") if compared.delay.value < 0 else ("a", "x")
    late = 1e3 * abs(compared.delay.value)
    return f"{first} comes {late:.2g} ms after {second}: state the delays of x, z and a"


def _mount_of(compared: SensorDelay | None, fs: float) -> str:
    """In words: a mount that shows though none was stated."""
    seen = compared.mount_frequency if compared is not None else None
    if seen is None or not seen.value < fs / 2:
        return ""
    return (
        f"a mount of {seen.value:.4g} Hz shows in a, and none is stated: state it, record.with_details('a', "
        "mount=(frequency, damping)), and give x, z, mass and stiffness to have it taken out"
    )
