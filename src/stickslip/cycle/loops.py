"""How much friction does a contact have, in which direction, and how does it change with speed?"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array, Mask, Rows
from stickslip.balance.balance import gains_unsure
from stickslip.balance.motion import (
    AUDIBLE,
    CREEP,
    PHASES,
    Cycles,
    Motion,
    away_from,
    contact_motion,
    find_cycles,
    motion_channels,
    require_fit,
)
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Doubt, Estimate, Result, Status
from stickslip.record.record import Record, require_record
from stickslip.signals.interpolate import without_delays
from stickslip.statistics import FEW_CYCLES, least_squares, mean_of_cycles, mean_uncertainty, student

NO_SLOPE = "no slope"  # the kind of doubt where the motion does not tell how friction changes with speed
DRIFTING = "drifting"  # the kind of doubt where friction changes along the record
DRIFTS, SURELY = 0.05, 4.0  # of the level, and deviations of the line: of 240 rigs of steady friction one was told more
LEAST_SPREAD = 0.1  # of the sliding speed about its mean, below which no slope against speed can be told
ONE_WAY = Doubt(
    "it slides one way alone: what a zero of x, z or the force is off counts as friction",
    "one way",
    lesser=True,
)
DRIVES = "friction drives the motion: the sign of the force or of the displacement is wrong, or a drive is not read"
BRANCHES = ("back, slowing down", "forward, slowing down", "back, speeding up", "forward, speeding up")
BRANCH_BINS, FEW_BINS = 50, 8  # means of equal count along the speed, in which a branch's line is sought


@dataclass(frozen=True, eq=False)
class Curve:
    """Friction against velocity, in bins of velocity.

    Attributes
    ----------
    velocity : ndarray, shape (k,)
        Bin centres, bins without samples left out.
    friction : ndarray, shape (k,)
        Mean over the cycles of each cycle's mean in the bin.
    low, high : ndarray, shape (k,)
        95 % interval of `friction` from the scatter between cycles; NaN where one cycle alone visits the bin.
    count : ndarray, shape (k,)
        Cycles that visit the bin.
    """

    velocity: Array
    friction: Array
    low: Array
    high: Array
    count: Rows


@dataclass(frozen=True, eq=False, repr=False)
class Loops(Result):
    """Friction over the cycles of a motion.

    Attributes
    ----------
    level : Estimate
        Magnitude of the sliding friction, the mean of `forward` and `back`.
    forward, back : Estimate
        Its magnitude in either direction, positive where it opposes the motion.
    offset : Estimate
        Half of `forward` less `back`: a constant force in the record (a drift, a tilt), or an uneven contact.
    slope : Estimate
        Change of the sliding friction's magnitude with speed, negative where friction falls with speed: along a curve,
        the slope of the line nearest to it over the speeds at which it slides.
    energy_per_cycle : Estimate
        ``closed integral of f dx`` [J].
    frequency : Estimate
        Cycles per second [Hz].
    phase_grid : ndarray, shape (p,)
        Phase of the mean cycle, 0 to 1.
    displacement, velocity, friction : ndarray, shape (p,)
        The mean cycle.
    scatter : ndarray, shape (p,)
        Standard deviation of the friction between cycles.
    curve : Curve
        Friction against velocity.
    cycles : ndarray, shape (m,)
        Time [s] at which each cycle begins.
    unit : str
        Of the displacement, "m" or "rad".
    status : str
        "ok", or in words what to beware of.
    """

    level: Estimate
    forward: Estimate
    back: Estimate
    offset: Estimate
    slope: Estimate
    energy_per_cycle: Estimate
    frequency: Estimate
    phase_grid: Array
    displacement: Array
    velocity: Array
    friction: Array
    scatter: Array
    curve: Curve
    cycles: Array
    unit: str
    status: str


def friction_loops(
    record: Record, *, contact: str | None = None, frequency: float | str | None = None, bins: int = 40
) -> Loops:
    r"""How much friction, forward and back, over each cycle, and how does it change with speed?

    Per cycle, sliding forward (back), the level is the median of the friction in which every sample counts by its
    speed, so by the way it covers: ``forward = weighted median of f, weights |v|`` where ``|v|`` is above what its
    noise and creep reach and away from the jumps at a reversal, which differentiation blurs. A stuck contact, a
    reversal and single artefacts so have no say. The energy is :math:`\oint f\,dx` by trapezoids. The slope is that
    of ``f = sign(v) (F + s |v|) + offset`` by least squares. Every value is found per cycle; the interval is
    Student's t on the scatter between cycles. The slope's is widened to what its four branches allow (forward and back,
    speeding up and slowing down): to Student's t on their spread, and to how their friction strays from a line.

    Parameters
    ----------
    record : Record
        With ``friction`` and ``x`` (or ``theta``, or ``v``); ``z`` for a contact on the base. Delays stated for them
        are taken out first.
    contact : {"ground", "base"}, optional
        What the mass slides on, the loops being over the displacement against it; as :func:`friction_force` was told,
        or the ground, when not given.
    frequency : float or str, optional
        Forcing frequency [Hz]; found from the record when not given.
    bins : int
        Bins of velocity, over both directions.

    Returns
    -------
    Loops

    Raises
    ------
    RecordError
        A channel is missing, broken or too short, or the units of friction and motion do not belong together.
    EstimateError
        No motion, no complete cycle, or no sliding in one of the directions.

    Examples
    --------
    >>> t = np.arange(5000) / 500
    >>> v = np.cos(2 * np.pi * t)
    >>> noise = np.random.default_rng(0).normal(0, 0.05, t.size)
    >>> record = Record.of({"x": np.sin(2 * np.pi * t) / (2 * np.pi), "friction": 1.5 * np.sign(v) + noise}, fs=500)
    >>> loops = friction_loops(record)
    >>> round(loops.level.value, 2), round(loops.energy_per_cycle.value, 2)  # 4 * 1.5 N over 1 / (2 pi) m
    (1.5, 0.95)
    """
    require_record(record)
    question = "friction loops"
    record.require_clean("friction", question=question)
    if not isinstance(bins, (int, np.integer)) or bins < 2:
        raise EstimateError(f"bins = {bins}", "a curve has two bins at least, a whole number", "leave it at 40")
    record = without_delays(record, *motion_channels(record, contact), "friction", question=question)
    motion = contact_motion(record, contact=contact, question=question)
    require_fit(record, "friction", length=motion.unit, question=question)
    cycles = find_cycles(record, motion, frequency=frequency)
    friction, unit = record["friction"], record.channels["friction"].unit
    sliding = sliding_parts(motion, cycles)
    label = cycles.labels(len(friction))
    magnitudes = _magnitudes(friction, motion, sliding, label, len(cycles.edges) - 1, unit)
    gain, stretched = gains_unsure(record, motion_channels(record, contact)[0])
    magnitudes = {key: told.widened(gain) for key, told in magnitudes.items()}
    both = math.hypot(gain, stretched)
    energy = _energy(friction, motion, cycles).widened(both)
    folded = cycles.folded(friction)
    return Loops(
        **magnitudes,
        slope=_slope(friction, motion, sliding, label, unit).widened(both),
        energy_per_cycle=energy,
        frequency=cycles.frequency,
        phase_grid=np.arange(PHASES) / PHASES,
        displacement=cycles.folded(motion.displacement).mean(axis=0),
        velocity=cycles.folded(motion.velocity).mean(axis=0),
        friction=folded.mean(axis=0),
        scatter=folded.std(axis=0, ddof=1) if len(folded) > 1 else np.zeros(PHASES),
        curve=_curve(friction, motion, cycles, label, bins),
        cycles=motion.start + cycles.edges[:-1] / motion.fs,
        unit=motion.unit,
        status=_status(cycles, magnitudes, energy),
    )


def sliding_parts(motion: Motion, cycles: Cycles) -> Mask:
    """Where the contact slides, away from reversals if there is sliding left there."""
    threshold = max(CREEP * cycles.peak, AUDIBLE * motion.noise)
    fast = np.abs(motion.velocity) > threshold
    clear = fast & away_from(~fast, motion.blur)
    return clear if clear.sum() > fast.sum() / 2 else fast


def _magnitudes(
    friction: Array, motion: Motion, sliding: Mask, label: Rows, count: int, unit: str
) -> dict[str, Estimate]:
    """The friction forward and back, half of their sum, and half of their difference."""
    forward, back = (levels_of(sign, friction, motion, sliding & (label >= 0), label, count) for sign in (1.0, -1.0))
    wanted = {
        "forward": ("sliding friction forward", forward),
        "back": ("sliding friction back", back),
        "level": ("sliding friction", (forward + back) / 2),
        "offset": ("friction offset", (forward - back) / 2),
    }
    how = "speed-weighted median, mean of cycles"
    slides = {key: bool(np.isfinite(values).any()) for key, (_, values) in wanted.items()}
    if slides["forward"] != slides["back"]:
        wanted["level"] = ("sliding friction", forward if slides["forward"] else back)
    magnitudes = {
        key: mean_of_cycles(name, values, unit=unit, method=how)
        if slides[key] or key == "level"
        else Estimate(name, math.nan, (math.nan, math.nan), math.nan, unit, how, Status(ONE_WAY))
        for key, (name, values) in wanted.items()
    }
    if slides["forward"] != slides["back"]:
        magnitudes |= {key: replace(told, status=Status(told.status, ONE_WAY)) for key, told in magnitudes.items()}
    magnitudes["level"] = _drifting(magnitudes["level"], wanted["level"][1])
    level, off = magnitudes["level"].within(0.0, otherwise=DRIVES), magnitudes["offset"]
    aside = f"a zero of x, z or the force is off by {abs(off.value):.3g} {unit}, more than the friction"
    why = aside if level.known and level.interval[0] > 0 else DRIVES
    return magnitudes | {"level": level} | {s: magnitudes[s].within(0.0, otherwise=why) for s in ("forward", "back")}


def _drifting(level: Estimate, values: Array) -> Estimate:
    """With a lesser doubt where the level of the cycles rises or falls along the record, by a line through them."""
    values = values[np.isfinite(values)]
    count = len(values)
    if count < FEW_CYCLES:
        return level
    line = least_squares(np.column_stack([(np.arange(count) + 0.5) / count - 0.5, np.ones(count)]), values)
    change = float(line.coefficients[0])
    if abs(change) < max(DRIFTS * level.value, SURELY * float(line.sd[0])):
        return level
    share = 100 * abs(change) / abs(level.value - change / 2)
    words = f"friction {'rises' if change > 0 else 'falls'} by {share:.0f} % over the record"
    return replace(level, status=Status(level.status, Doubt(words, DRIFTING, lesser=True)))


def levels_of(sign: float, friction: Array, motion: Motion, sliding: Mask, label: Rows, count: int) -> Array:
    """Magnitude of the friction to one side, per cycle; NaN where a cycle does not slide that way."""
    chosen = sliding & (sign * motion.velocity > 0)
    levels = np.full(count, np.nan)
    filled = np.flatnonzero(np.bincount(label[chosen], minlength=count))
    values, weights, cycle = sign * friction[chosen], np.abs(motion.velocity[chosen]), label[chosen]
    order = np.lexsort((values, cycle))
    values, weights, cycle = values[order], weights[order], cycle[order]
    starts, ends = (np.searchsorted(cycle, filled, side=side) for side in ("left", "right"))
    total = np.concatenate([[0.0], np.cumsum(weights)])
    middle = np.searchsorted(total, (total[starts] + total[ends]) / 2) - 1
    levels[filled] = values[np.clip(middle, starts, ends - 1)]
    return levels


def _energy(friction: Array, motion: Motion, cycles: Cycles) -> Estimate:
    work = np.concatenate([[0.0], np.cumsum((friction[1:] + friction[:-1]) / 2 * np.diff(motion.displacement))])
    per_cycle = np.diff(np.interp(cycles.edges, np.arange(len(work)), work))
    energy = mean_of_cycles("energy per cycle", per_cycle, unit="J", method="closed integral of f dx, mean of cycles")
    return energy.within(0.0, otherwise=DRIVES)


def _slope(friction: Array, motion: Motion, sliding: Mask, label: Rows, unit: str) -> Estimate:
    """Slope of the sliding friction's magnitude against speed, per cycle, levels forward and back left free."""
    chosen = sliding & (label >= 0)
    # both directions of a cycle are groups of their own: within them, magnitude against speed
    group = 2 * label[chosen] + (motion.velocity[chosen] > 0)
    speed = np.abs(motion.velocity[chosen])
    magnitude = friction[chosen] * np.sign(motion.velocity[chosen])
    counts = np.bincount(group)
    present = np.maximum(counts, 1)
    speed_about = speed - (np.bincount(group, speed) / present)[group]
    magnitude_about = magnitude - (np.bincount(group, magnitude) / present)[group]
    cycle = label[chosen]
    power = np.bincount(cycle, speed_about**2)
    product = np.bincount(cycle, speed_about * magnitude_about)
    slopes = product[power > 0] / power[power > 0]
    spread = math.sqrt(float(power.sum()) / len(speed)) / float(speed.mean())
    per_speed = "N s/m" if motion.unit == "m" else "N m s/rad"
    slope = mean_of_cycles(
        "slope of friction against speed",
        slopes,
        unit=per_speed,
        method="least squares per cycle, mean of cycles",
        checks=(f"sliding speed varies by {100 * spread:.0f} % about its mean",),
    )
    if spread < LEAST_SPREAD:
        steady = Doubt("the sliding speed hardly varies: no slope can be told", NO_SLOPE)
        return replace(slope, status=Status(steady))
    ahead = np.minimum(np.arange(len(sliding)) + motion.blur, len(sliding) - 1)
    behind = np.maximum(np.arange(len(sliding)) - motion.blur, 0)
    faster = np.sign(motion.velocity) * (motion.velocity[ahead] - motion.velocity[behind]) > 0
    return _widened(slope, _branch_slopes(speed, magnitude, 2 * faster[chosen] + (motion.velocity[chosen] > 0)))


def _branch_slopes(speed: Array, magnitude: Array, branch: Rows) -> list[Estimate]:
    """Slope of each branch of the loop, its interval from how the friction strays from a line along the speed."""
    slopes = []
    for number in range(4):
        chosen = np.flatnonzero(branch == number)
        bins = min(BRANCH_BINS, len(chosen) // 4)
        if bins < FEW_BINS or np.ptp(speed[chosen]) == 0:
            continue
        rows = chosen[np.argsort(speed[chosen])]
        starts = np.arange(bins) * len(rows) // bins
        counts = np.diff(np.append(starts, len(rows)))
        abscissa, ordinate = (np.add.reduceat(values[rows], starts) / counts for values in (speed, magnitude))
        line = least_squares(np.column_stack([abscissa - abscissa.mean(), np.ones(bins)]), ordinate)
        slopes.append(line.estimate(0, BRANCHES[number], "", ""))
    return slopes


def _widened(slope: Estimate, branches: list[Estimate]) -> Estimate:
    """The slope as surely as the branches of the loop agree on it.

    Friction that changes with position, or a contact that turns round elastically, repeats in every cycle: the scatter
    between cycles does not know of it. A branch's line, or the other branches, do.
    """
    if len(branches) < 2:
        return slope
    values = np.array([branch.value for branch in branches])
    apart = student(len(values) - 1) * float(values.std(ddof=1)) / math.sqrt(len(values))
    astray = float(np.mean([branch.interval[1] - branch.value for branch in branches]))
    slopes = ", ".join(f"{branch.name} {branch.value:.3g}" for branch in branches)
    half = max(apart, astray)
    if half <= slope.interval[1] - slope.value:
        return replace(slope, checks=(*slope.checks, slopes))
    wide = (slope.value - half, slope.value + half)
    lost = wide[0] <= 0 <= wide[1] and not slope.includes(0.0)
    sentence = "friction changes along the way as much as with speed: no slope can be told"
    status = Status(Doubt(sentence, NO_SLOPE)) if lost else slope.status
    return replace(slope, interval=wide, sd=half / NORMAL_95, status=status, checks=(*slope.checks, slopes))


def _curve(friction: Array, motion: Motion, cycles: Cycles, label: Rows, bins: int) -> Curve:
    reach = min(cycles.peak * 1.05, float(np.abs(motion.velocity).max()))
    edges = np.linspace(-reach, reach, bins + 1)
    place = np.searchsorted(edges, motion.velocity, side="right") - 1
    chosen = (label >= 0) & (place >= 0) & (place < bins)
    cell = label[chosen] * bins + place[chosen]
    shape = (len(cycles.edges) - 1, bins)
    count = np.bincount(cell, minlength=shape[0] * bins).reshape(shape)
    total = np.bincount(cell, friction[chosen], minlength=shape[0] * bins).reshape(shape)
    visited = count.any(axis=0)
    rows = []
    for number in np.flatnonzero(visited):
        seen = count[:, number] > 0
        means = total[seen, number] / count[seen, number]
        sd, freedom = mean_uncertainty(means)
        half = student(freedom) * sd if len(means) > 1 else math.nan
        rows.append((means.mean(), means.mean() - half, means.mean() + half, len(means)))
    middle, low, high, visits = (np.array(column) for column in zip(*rows, strict=True))
    return Curve(((edges[1:] + edges[:-1]) / 2)[visited], middle, low, high, visits.astype(np.intp))


def _status(cycles: Cycles, levels: dict[str, Estimate], energy: Estimate) -> str:
    doubts = [levels["level"].status] if levels["level"].known and levels["level"].status != "ok" else []
    if cycles.status != "ok":
        doubts.append(cycles.status)
    if not (levels["level"].known and energy.known):
        doubts.append(DRIVES)
    return Status(*doubts)
