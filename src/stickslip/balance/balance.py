"""The balance of forces on the mass: the rig's constants, what each channel adds, and the record with the friction.

A slider pulled through a spring at a constant speed: does it stick and slip, or swing?
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, Rows
from stickslip.balance.motion import is_measured
from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import Estimate, Result
from stickslip.record.record import RIG_UNITS, Record, StatedRig, Step
from stickslip.signals.derivatives import (
    LEAST,
    Filter,
    best_bandwidth,
    checked_bandwidth,
    differentiate,
    five_point_average,
    smooth,
)
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_along
from stickslip.statistics import mean_of_cycles

FRICTION = "the friction force"
ENDS = ("ground", "base")
SPAN = 24  # samples from an end within which averages and differences feel it

QUESTION = "stick-slip of a pulled slider"
FEWEST = 64  # samples
AWAY = 41  # samples of a running median, which takes bursts of wild readings away
DROP = 0.1  # of the usual swing: what a drop must reach to end a stick
NOISY = 8.0  # standard deviations of the noise: a drop is larger
SLOW = 2.0  # times as long as it falls, from which on a rise is a stick
FEW = 4  # samples of a rise


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
        fixed = "no channel z: the base is taken to be fixed, f = - k x - c v - m a"
        statements = ["f = k z - k x - c v - m a" if "z" in record else fixed]
        if "force" in record:
            statements.append("the applied force is added")
        measured = [name for name in ("v", "a") if name in record]
        if measured:
            statements.append(f"{' and '.join(measured)} as measured")
        if one_filter:
            statements.append(f"all channels smoothed to {width:.4g} Hz (-3 dB)")
        elif method == "smoother" and len(measured) < 2:
            statements.append(f"the velocity smoothed to {width:.4g} Hz (-3 dB)")
        elif method == "five-point":
            statements.append("derivatives by central differences and five-point averages")
        statements.append(f"contact against the {self.contact}")
        return statements


def known_constants(record: Record, **given: Any) -> dict[str, Any]:
    """The rig's constants as numbers, and its damper: as given, or as the friction was found with."""
    stated = {} if record.rig is None else record.rig.constants
    constants = {name: value for name, value in given.items() if value is not None}
    units = {name: unit for name, unit in RIG_UNITS.items() if name in constants}
    numbers = {name: Estimate.stated(name, constants[name], unit).value for name, unit in units.items()}
    return {**stated, **constants, **numbers}


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
    """What the load cell measures, less the inertia of its flange: the thesis's F2, or through its mount's inverse."""
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
    made = with_friction(record, force, np.sqrt(variance), replace(rig, method=name), notes)
    return made.with_details("friction", gain_sd=cell.gain_sd) if cell.gain_sd else made


def gains_unsure(record: Record, moved: str) -> tuple[float, float]:
    """How unsure the gains of a measured force and of its motion are stated to be; twins count those of a balance."""
    rig = record.rig
    balanced = Balance.of(rig) is not None and not is_measured(record, "friction")
    if balanced and rig is not None and rig.method != "F2":
        return 0.0, 0.0
    return record.channels["friction"].gain_sd, record.channels[moved].gain_sd


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


@dataclass(frozen=True, eq=False, repr=False)
class Pull(Result):
    """How a slider moves that is pulled through a spring.

    Attributes
    ----------
    loading_rate : Estimate
        How fast the force rises while it sticks [N/s]: spring times pulling speed.
    breakaway : Estimate
        Force at which it slips: its static friction, for it hardly accelerates yet.
    drop : Estimate
        By how much the force falls in a slip.
    frequency : Estimate
        Slips per second [Hz].
    rise_over_fall : Estimate
        How long the force rises, over how long it falls.
    regime : str
        "stick-slip", or "inertial": it swings about its steady sliding.
    slips : ndarray, shape (n,)
        When each slip begins [s].
    status : str
        "ok", or in words what to beware of.
    """

    loading_rate: Estimate
    breakaway: Estimate
    drop: Estimate
    frequency: Estimate
    rise_over_fall: Estimate
    regime: str
    slips: Array
    status: str


def pulled_slider(record: Record, *, channel: str = "load") -> Pull:
    r"""Does a slider that is pulled through a spring stick and slip, and how fast is the spring loaded meanwhile?

    While it sticks, the spring's force rises at :math:`\dot F = k V`. Every rise, from a minimum of the force to the
    next maximum, is fitted by a line; the rate is the mean of the lines, by how long each lasts. Where the force rises
    for twice as long as it falls, or longer, the slider sticks and slips; else it swings about its steady sliding, as
    its inertia lets it, and its rises are those of a wave. Minima and maxima are those of the smoothed force.

    Parameters
    ----------
    record : Record
        With the force in the spring, over time.
    channel : str
        The force.

    Returns
    -------
    Pull

    Raises
    ------
    RecordError
        The channel is missing, broken or too short.
    EstimateError
        The force does not rise and drop three times.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> force = 0.3 + 0.1 * (t % 0.5) + 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    >>> slider = pulled_slider(Record.of({"load": force}, fs=1000))
    >>> slider.regime, round(slider.loading_rate.value, 2)
    ('stick-slip', 0.1)
    """
    from scipy.ndimage import median_filter

    record.require_clean(channel, question=QUESTION, samples=FEWEST)
    record = without_delays(record, channel, question=QUESTION)
    unit = record.channels[channel].unit
    calm = smooth(median_filter(record[channel], AWAY), record.fs)
    tops, bottoms = _turns(calm.values, float(np.median(calm.sd)))
    if len(tops) < 3:
        raise EstimateError(
            f"{channel} rises and drops {len(tops)} times by more than its noise",
            f"{QUESTION} needs three slips",
            "give a longer record",
        )
    falls = (bottoms - tops) / record.fs
    rises = (tops[1:] - bottoms[:-1]) / record.fs
    method = "how long the force rises over how long it falls"
    shape = mean_of_cycles("rise over fall", rises / falls.mean(), unit="1", method=method)
    sticks = shape.value > SLOW
    rate = _rate(record[channel], record.fs, bottoms[:-1], tops[1:], f"{unit}/s")
    if not sticks:
        rate = replace(rate, status="it swings and does not stick: the rises are those of a wave")
    levels = calm.values
    every = mean_of_cycles("period", np.diff(tops) / record.fs, unit="s", method="from slip to slip")
    frequency = Estimate(
        "slips per second",
        1 / every.value,
        (1 / every.interval[1], _over(every.interval[0])),
        every.sd / every.value**2,
        "Hz",
        "mean time from slip to slip",
        every.status,
        every.checks,
    ).within(0.0, record.fs / 2)
    return Pull(
        rate,
        mean_of_cycles("force at breakaway", levels[tops], unit=unit, method="largest force before each slip, mean"),
        mean_of_cycles("drop of the force", levels[tops] - levels[bottoms], unit=unit, method="in each slip, mean"),
        frequency,
        shape,
        "stick-slip" if sticks else "inertial",
        record.start + tops / record.fs,
        rate.status,
    )


def _over(value: float) -> float:
    return 1 / value if value > 0 else math.inf


def _turns(force: Array, noise: float) -> tuple[Rows, Rows]:
    """Maxima of the force, each followed by a drop that counts, and the minima after them.

    A drop after which the force does not rise as much again is cut by the end of the record, and left out.
    """
    from scipy.signal import find_peaks

    _, peaks = find_peaks(force, prominence=NOISY * noise)
    if not len(peaks["prominences"]):
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    usual = float(np.quantile(peaks["prominences"], 0.9))
    counts = max(NOISY * noise, DROP * usual)
    tops = find_peaks(force, prominence=counts)[0]
    edges = np.append(tops, len(force))
    bottoms = [high + int(np.argmin(force[high:next_])) for high, next_ in zip(tops, edges[1:], strict=True)]
    if bottoms and force[-1] - force[bottoms[-1]] < counts:  # it may fall on beyond the end
        tops, bottoms = tops[:-1], bottoms[:-1]
    return tops, np.array(bottoms, dtype=np.intp)


def _rate(force: Array, fs: float, lows: Rows, highs: Rows, unit: str) -> Estimate:
    """Mean slope of the rises, by how long each lasts."""
    kept = [(low, high) for low, high in zip(lows, highs, strict=True) if high - low >= FEW]
    if not kept:
        raise EstimateError(
            f"the force rises within {FEW} samples", f"{QUESTION} needs rises that last longer", "sample faster"
        )
    slopes = np.array([fs * np.polyfit(np.arange(high - low), force[low:high], 1)[0] for low, high in kept])
    weights = np.array([high - low for low, high in kept], dtype=float)
    weights /= weights.mean()
    mean = float(np.mean(weights * slopes))
    how = "line through each rise, mean by how long it lasts"
    return mean_of_cycles("loading rate", mean + weights * (slopes - mean), unit=unit, method=how)
