"""The balance of forces on the mass: the rig's constants, what each channel adds, and the record with the friction."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import is_measured
from stickslip.errors import ModelError
from stickslip.estimate import Estimate
from stickslip.record.record import RIG_UNITS, Record, StatedRig, Step
from stickslip.signals.delay import without_delays
from stickslip.signals.derivatives import (
    LEAST,
    Filter,
    best_bandwidth,
    checked_bandwidth,
    differentiate,
    five_point_average,
    noise_along,
)

Array = NDArray[np.float64]

FRICTION = "the friction force"
ENDS = ("ground", "base")
SPAN = 24  # samples from an end within which averages and differences feel it


@dataclass(frozen=True)
class Balance:
    """m a = k (z - x) - c (v - dz/dt or 0) + P - f."""

    mass: float
    stiffness: float
    damping: float
    damper: str

    @classmethod
    def of(cls, rig: StatedRig | None) -> Balance | None:
        """The one by which the friction was found; None where mass or stiffness was not known."""
        if rig is None or rig.mass is None or rig.stiffness is None:
            return None
        return cls(rig.mass, rig.stiffness, rig.damping, rig.damper)

    def pull(self, record: Record) -> Array:
        """What spring, applied force and a damper to the base do to the mass [N]; not what its own velocity does."""
        pull = np.array(record["force"]) if "force" in record else np.zeros(len(record))
        if "z" in record:
            pull += self.stiffness * record["z"]
            if self.damper == "base" and self.damping:
                pull += self.damping * differentiate(record["z"], record.fs).values
        return np.asarray(pull - self.stiffness * record["x"])


@dataclass(frozen=True)
class Rig(Balance):
    """A balance of forces, what the mass slides on, and how sure the constants are, where that is stated."""

    contact: str
    sd: Mapping[str, float] = field(default_factory=dict, hash=False)

    @classmethod
    def stated(cls, constants: Mapping[str, Any], damper: str, contact: str) -> Rig:
        """The constants with their units read; refused where they have no meaning."""
        known = {name: Estimate.stated(name, constants[name], unit) for name, unit in RIG_UNITS.items()}
        for name, constant in known.items():
            if constant.value < 0 or (name == "mass" and constant.value == 0):
                raise ModelError(
                    f"{name} = {constants[name]}",
                    "a mass is positive, a stiffness or damping not negative",
                    f"state the rig's {name} in {RIG_UNITS[name]}",
                )
        for word, end in (("damper", damper), ("contact", contact)):
            if end not in ENDS:
                raise ModelError(f"{word} = '{end}'", f"a {word} goes to the {' or the '.join(ENDS)}", "choose one")
        sd = {name: constant.sd for name, constant in known.items() if constant.sd}
        return cls(damper=damper, contact=contact, sd=sd, **{name: float(constant) for name, constant in known.items()})

    def terms(self, record: Record) -> dict[str, dict[int, float]]:
        """Per channel, the coefficient of each order of its derivative in the friction force."""
        velocity = ("v", 0) if "v" in record else ("x", 1)
        acceleration = ("a", 0) if "a" in record else (velocity[0], velocity[1] + 1)
        terms: dict[str, dict[int, float]] = {"x": {0: -self.stiffness}}
        for (name, order), constant in ((velocity, self.damping), (acceleration, self.mass)):
            terms.setdefault(name, {})[order] = -constant
        if "z" in record:
            terms["z"] = {0: self.stiffness, 1: self.damping if self.damper == "base" else 0.0}
        if "force" in record:
            terms["force"] = {0: 1.0}
        return terms

    def words(self, record: Record, method: str, width: float, *, one_filter: bool) -> list[str]:
        """What was assumed and how derivatives were taken, for the history."""
        said = [
            "f = k z - k x - c v - m a"
            if "z" in record
            else "no channel z: the base is taken to be fixed, f = - k x - c v - m a"
        ]
        if "force" in record:
            said.append("the applied force is added")
        measured = [name for name in ("v", "a") if name in record]
        if measured:
            said.append(f"{' and '.join(measured)} as measured")
        if one_filter:
            said.append(f"all channels smoothed to {width:.4g} Hz (-3 dB)")
        elif method == "smoother" and len(measured) < 2:
            said.append(f"the velocity smoothed to {width:.4g} Hz (-3 dB)")
        elif method == "five-point":
            said.append("derivatives by central differences and five-point averages")
        said.append(f"contact against the {self.contact}")
        return said


def known_constants(record: Record, **given: Any) -> dict[str, Any]:
    """The rig's constants as numbers, and its damper: as given, or as the friction was found with."""
    stated = {} if record.rig is None else record.rig.constants
    told = {name: value for name, value in given.items() if value is not None}
    numbers = {name: Estimate.stated(name, told[name], unit).value for name, unit in RIG_UNITS.items() if name in told}
    return {**stated, **told, **numbers}


def paths(
    terms: Mapping[str, Mapping[int, float]], derive: Filter, *, one_filter: bool
) -> Iterator[tuple[str, Filter, dict[int, float]]]:
    """Which channel goes through which filter, with which coefficients."""
    unchanged = replace(derive, method="five-point")  # passes order 0 unchanged
    for name, orders in terms.items():
        if one_filter or derive.method == "five-point":
            yield name, derive, dict(orders)
            continue
        # Apart, for the smoother would smooth order 0 too; odd derivatives do not correlate with the sample itself.
        yield name, unchanged, {0: orders.get(0, 0.0)}
        if any(orders.get(order) for order in (1, 2)):
            yield name, derive, {order: c for order, c in orders.items() if order}


def averaged_gain(size: int, derive: Filter, terms: Mapping[int, float], last: Callable[[Array], Array]) -> Array:
    """Standard deviation of each of `size` values for white noise of unit standard deviation."""
    rows = np.linalg.norm(last(derive.apply(np.eye(min(size, 2 * SPAN)), terms)), axis=1)
    return rows if size <= len(rows) else np.insert(rows, SPAN, np.full(size - len(rows), rows[SPAN]))


def as_measured(record: Record) -> Record:
    """The record without what an earlier balance made, which would be taken for measured."""
    measured = {name: record[name] for name in record if is_measured(record, name)}
    return replace(record, samples=measured) if measured else record


def with_motion(record: Record, derive: Filter) -> Record:
    """The record with v and a, each differentiated where it was not measured."""
    source, order = ("v", 0) if "v" in record else ("x", 1)
    wanted = {"v": (source, order), "a": (source, order + 1)}
    made = record
    for (name, (origin, times)), unit in zip(wanted.items(), ("m/s", "m/s^2"), strict=True):
        if name not in record:
            noise = noise_along(record[origin], record.fs, record.channels[origin].noise)
            level = derive.inner_gain({times: 1.0}) * float(np.sqrt(np.mean(noise**2)))
            values = derive.apply(record[origin], {times: 1.0})
            made = made.with_channel(name, values, unit=unit, source="friction_force", noise=level)
    return made


def with_friction(record: Record, force: Array, sd: Array, rig: StatedRig, notes: Sequence[str]) -> Record:
    """The record with the friction, its standard deviation at each sample, and how it was found."""
    arguments = {name: value for name, value in asdict(rig).items() if name not in ("lost", "sd")}
    arguments |= {"sd": dict(rig.sd)} if rig.sd else {}
    step = Step("friction_force", arguments, "; ".join(notes))
    made = record.with_channel("friction_sd", sd, unit="N", source="friction_force")
    noise = float(np.median(sd))
    made = made.with_channel("friction", force, unit="N", source="friction_force", noise=noise, step=step)
    return replace(made, rig=rig)


def stretch(record: Record) -> Array:
    """Of the spring between mass and base [m]."""
    return record["z"] - record["x"] if "z" in record else -record["x"]


ALONE = "load cell alone"
BEYOND = 2.0  # times its mount's frequency up to which a load cell's reading is followed


def felt(record: Record, rig: StatedRig) -> Record:
    """What the load cell feels, less the inertia of its flange: the thesis's F2, or through its mount's inverse."""
    method, cell = rig.method, record.channels["load"]
    source = next((name for name in ("a", "v", "x") if name in record), "") if cell.inertia else ""
    used = ["load", *([source] if source else [])]
    record.require_clean(*used, question=FRICTION, samples=LEAST)
    record = without_delays(record, *used, question=FRICTION, samples=LEAST)
    terms = {"load": {0: 1.0}, **({source: {"avx".index(source): -cell.inertia}} if source else {})}
    if method == "F2":
        derive = dict.fromkeys(terms, Filter("five-point", record.fs, 0.0))
        notes = ["the load cell, averaged over five points"]
    else:
        derive, notes = _unmounted(record, terms)
    force, variance = np.zeros(len(record)), np.zeros(len(record))
    for name, orders in terms.items():
        noise = noise_along(record[name], record.fs, record.channels[name].noise)
        part = derive[name].apply(record[name], orders)
        if method == "F2":
            force += five_point_average(part)
            variance += (averaged_gain(len(record), derive[name], orders, five_point_average) * noise) ** 2
        else:
            force += part
            variance += (derive[name].noise_gain(len(record), orders) * noise) ** 2
    if source:
        notes.append(f"less {cell.inertia:g} kg times the acceleration from {source}")
    elif cell.inertia:
        notes.append(f"no motion: the inertia of {cell.inertia:g} kg of its flange is left in")
    if cell.discharge is not None:
        notes.append(f"its discharge of {cell.discharge:g} s is left in")
    name = ALONE if method == "load" else method  # no balance of forces stands behind it
    return with_friction(record, force, np.sqrt(variance), replace(rig, method=name), notes)


def _unmounted(record: Record, terms: dict[str, dict[int, float]]) -> tuple[dict[str, Filter], list[str]]:
    """The filters of a load cell alone and of what its flange does; its mount's inverse is added to its terms."""
    mount = record.channels["load"].mount
    width = {name: best_bandwidth(record[name], record.fs) for name in terms}
    if mount is not None:
        angular = 2 * math.pi * mount[0]
        terms["load"] |= {1: 2 * mount[1] / angular, 2: angular**-2}
        width["load"] = checked_bandwidth(min(BEYOND * mount[0], 0.4 * record.fs), record.fs, len(record))
    notes = [f"the load cell alone, smoothed to {width['load']:.4g} Hz (-3 dB)"]
    if mount is not None:
        notes.append(f"less what its mount of {mount[0]:g} Hz adds")
    return {name: Filter("smoother", record.fs, pair) for name, pair in width.items()}, notes
