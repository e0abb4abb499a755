"""The acceleration of the mass itself: less what the accelerometer's mount adds; or what speaks against a reading."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.balance.balance import Balance, known_constants
from stickslip.balance.fusion import fuse
from stickslip.balance.lag import SensorDelay, sensor_delay
from stickslip.balance.motion import is_measured
from stickslip.errors import EstimateError
from stickslip.record.record import Record, Step
from stickslip.signals.delay import without_delays
from stickslip.signals.derivatives import LEAST
from stickslip.signals.noise import noise_level
from stickslip.units import parse_value

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
    record: Record, channel: str, *, mass: float | str | None, stiffness: float | str | None, question: str
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
        return Acceleration(record, f"{channel} stands on a mount of {mount[0]:g} Hz, whose ringing is in it: give x, "
                                    "z, mass and stiffness to have it taken out")  # fmt: skip
    return Acceleration(record, _mount_seen(record, channel) or _too_loud(channel, noise))


def _fused(record: Record, rig: dict[str, Any], question: str) -> Acceleration:
    """What all sensors together say of the acceleration, with the noise that this counts as."""
    balance = Balance(
        parse_value(rig["mass"], "kg"), parse_value(rig["stiffness"], "N/m"),
        parse_value(rig.get("damping", 0.0), "N s/m"), rig.get("damper", "ground"),
    )  # fmt: skip
    load = ["load"] if is_measured(record, "load") and record.channels["load"].mount is not None else []
    sensors = ["x", *(["v"] if is_measured(record, "v") else []), "a", *load]
    used = [*sensors, "z", *(["force"] if "force" in record else [])]
    record = without_delays(record, *used, question=question, samples=LEAST)
    compared = _compared(record)
    fusion = fuse(record, balance, sensors)
    sd, values = float(np.median(fusion.friction_sd)) / balance.mass, fusion.acceleration
    noise = max(SWINGS * sd, ROUNDED * float(values.std()))
    step = Step("acceleration_of_mass", {"sensors": sensors}, "by a smoother that knows the stated mounts")
    kept = replace(
        record, samples={n: v for n, v in record.samples.items() if n != "a"},
        channels={n: c for n, c in record.channels.items() if n != "a"},
    )  # fmt: skip
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
        f"the noise of {channel} is {share:.0%} of its standard deviation, and from {LOUD:.0%} on hides rings and "
        "micro-slips: give x, z, mass and stiffness where they lack, or take a quieter record"
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
