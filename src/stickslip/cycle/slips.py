"""How the friction rings after a slip begins, alike in both directions or not; how it swings while it slides.

A motion cut at its reversals: in each stroke the contact first holds, then breaks away, then slides one way.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.motion import (
    AUDIBLE,
    CREEP,
    Motion,
    contact_motion,
    definite_speed,
    find_cycles,
    is_measured,
    motion_channels,
    require_fit,
)
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import FEW, NORMAL_95, Doubt, Estimate, Result, Status
from stickslip.record.record import Record
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_along
from stickslip.statistics import FEW_CYCLES, mean_of_cycles, student

QUESTION = "the ringing after slip begins"
SOON = 4  # after slip begins: a quarter of the stroke
DEGREES = (4, 6, 8)  # of polynomials that are not the ring; the last is taken off before its line is looked for
SLOW, STIFF = DEGREES[0], DEGREES[-1]
MIXED = 0.02  # of the frequency: polynomials that change it by more are said to
FASTER = 5.0  # cycles in that quarter: a slower ring is not told from the polynomial
LEAST = 48  # samples in which a ring can be told
SAMPLES = 5  # a cycle, at least
MOST = 60  # strokes of a direction looked at, evenly chosen: their mode is known well enough
PARTS = 20  # in which strokes are left out in turn, at most
LOUD = 0.03  # of the sliding friction: a ring of a smaller amplitude is none
EXPLAINED = 0.25  # of what the polynomial leaves: a mode that explains less is none
ALIKE = 0.25  # of the strongest line's frequency: a mode that is farther off is another
PADDED = 4  # times the samples of the spectrum

RESOLVED = 3.0  # standard deviations: of 1000 records without friction one shows as much
FAST = 0.5  # of a stroke's largest speed, above which it certainly slides
NEAR = 0.9  # of the sliding friction: at this much the contact is about to slip
FALL = 0.05  # of the sliding friction by which it falls after its first peak, at least
HELD = 0.5  # of the sliding friction: a contact that moves before it bears so much gives way, it does not slip
MANY = 200  # strokes looked at, evenly chosen: their mean is known well enough
SHORT = 0.7  # of the usual travel: shorter strokes belong to the start or the end of a run
SLIPPED = 3.0  # times the speed that may be rest
STEADY = 0.3  # of the sliding friction: one that swings by more is no friction to be quoted
UNSURE = 0.2  # of the noise's variance, by which what is taken off may be wrong (95 %)
QUARTILE = 0.6744897501960817  # of the normal distribution


@dataclass(frozen=True, eq=False, repr=False)
class SlipRinging(Result):
    """How the friction rings after a slip begins.

    Attributes
    ----------
    forward, back : Estimate or None
        Frequency [Hz]; None where a direction does not ring.
    damping_forward, damping_back : Estimate or None
        Damping ratio; about zero where the ring goes on, negative where it grows.
    amplitude_forward, amplitude_back : Estimate or None
        At the breakaway, or the first peak after it, over the sliding friction.
    difference : Estimate or None
        Frequency forward less back [Hz].
    verdict : str
        "higher forward", "higher back", "no difference can be told", "forward alone" or "back alone".
    status : str
        "ok", or in words what to beware of.
    """

    forward: Estimate | None
    back: Estimate | None
    damping_forward: Estimate | None
    damping_back: Estimate | None
    amplitude_forward: Estimate | None
    amplitude_back: Estimate | None
    difference: Estimate | None
    verdict: str
    status: str


def slip_ringing(record: Record, *, contact: str | None = None) -> SlipRinging:
    r"""At which frequency does a measured friction ring once a slip has begun, and is it the same in both directions?

    A contact that gives way, or the rig that holds it, is let go when the slip begins, and rings about the sliding
    friction: :math:`f(t) = q(t) + \mathrm{Re}\, c\, e^{pt}`, with a polynomial q for the friction's own course, in the
    quarter of the stroke after the breakaway. One pole p is fitted to all strokes of a direction by least squares,
    with c and q of each stroke eliminated (variable projection; Golub and Pereyra 1973), from the strongest line of
    them all. The frequency :math:`\mathrm{Im}\, p / 2\pi` and the damping ratio :math:`-\mathrm{Re}\, p / |p|` are
    the means of what they are beside polynomials of degree 4, 6 and 8, as sure as these agree and as the answers
    without some of the strokes do (jackknife). A direction rings where the mode explains a quarter of the swings or
    more, by 3 % of the sliding friction at least. The interval of the difference follows from both intervals (MOVER;
    Zou and Donner 2008).

    Parameters
    ----------
    record : Record
        With ``friction`` that was measured, and ``x`` (or ``theta``, or ``v``).
    contact : {"ground", "base"}, optional
        What the mass slides on; the ground, when not given.

    Returns
    -------
    SlipRinging

    Raises
    ------
    RecordError
        A channel is missing, broken or too short; or friction came from a balance, whose smoothing rings by itself.
    EstimateError
        No stroke in which the contact slides, or "no ringing" after the slips of either direction.

    Examples
    --------
    >>> import stickslip as ss
    >>> time = np.arange(8000) / 1000
    >>> since, way = np.mod(time + 0.5, 1.0), np.sign(np.cos(np.pi * time))
    >>> ring = np.where(way > 0, np.cos(2 * np.pi * 47 * since), np.cos(2 * np.pi * 54 * since))
    >>> friction = way * (2 + 0.6 * np.exp(-since / 0.1) * ring)
    >>> ringing = slip_ringing(ss.Record.of({"x": np.sin(np.pi * time) / np.pi, "friction": friction}, fs=1000))
    >>> round(ringing.forward.value, 1), round(ringing.back.value, 1), ringing.verdict
    (47.0, 54.0, 'higher back')
    """
    record.require("friction", question=QUESTION)
    if not is_measured(record, "friction"):
        raise RecordError(
            "friction came from a balance of forces",
            f"{QUESTION} needs one that was measured: smoothing rings itself",
            "give the load cell's channel as friction",
        )
    strokes = find_strokes(record, contact=contact, question=QUESTION)
    ringing = ringing_of(strokes.strokes, record.fs)
    if ringing is None:
        raise EstimateError(
            f"no ringing: the friction of {len(strokes.strokes)} strokes swings about its level by less than "
            f"{100 * LOUD:.0f} % of it, or in each stroke otherwise",
            f"{QUESTION} needs {FASTER:g} cycles at least in the quarter of a stroke after the breakaway",
            "sample faster, or look at the map",
        )
    return ringing


def ringing_of(strokes: Sequence[Stroke], fs: float) -> SlipRinging | None:
    """How the friction of some strokes rings; None where it does not."""
    own = {way: [stroke for stroke in strokes if stroke.way == way] for way in (1, -1)}
    forward, back = _direction(own[1], "forward", fs), _direction(own[-1], "back", fs)
    if forward is None and back is None:
        return None
    difference = None if forward is None or back is None else _difference(forward[0], back[0])
    (f, z, a), (g, y, b) = forward or (None, None, None), back or (None, None, None)
    flags = [part.status for part in (f, g) if part is not None and part.status != "ok"]
    verdict = ("back alone" if f is None else "forward alone") if difference is None else _verdict(difference)
    return SlipRinging(f, g, z, y, a, b, difference, verdict, flags[0] if flags else "ok")


def _verdict(difference: Estimate) -> str:
    low, high = difference.interval
    return "higher forward" if low > 0 else "higher back" if high < 0 else "no difference can be told"


def _difference(forward: Estimate, back: Estimate) -> Estimate:
    """Forward less back, its interval by both intervals' halves in squares."""
    value = forward.value - back.value
    (low, high), (under, over) = forward.interval, back.interval
    below = math.hypot(forward.value - low, over - back.value)
    above = math.hypot(high - forward.value, back.value - under)
    flags = [estimate.status for estimate in (forward, back) if estimate.status != "ok"]
    name, method = "ringing after slip begins, forward less back", "difference of both directions"
    interval, sd = (value - below, value + above), math.hypot(forward.sd, back.sd)
    return Estimate(name, value, interval, sd, "Hz", method, flags[0] if flags else "ok")


def _direction(strokes: Sequence[Stroke], side: str, fs: float) -> tuple[Estimate, Estimate, Estimate] | None:
    """Frequency, damping ratio and amplitude of the strokes of one direction; None where they do not ring alike."""
    chosen = strokes[:: len(strokes) // MOST + 1]
    cuts = [values for stroke in chosen if len(values := _after(stroke)) >= LEAST]
    start = _strongest([_swings(values, STIFF) for values in cuts], fs)
    if start is None or 2 * len(cuts) <= len(chosen):
        return None
    swings = [_swings(values, SLOW) for values in cuts]
    turn = 2 * math.pi * start
    mode = _mode(swings, np.array([-0.03 * turn, turn]), fs)
    total = sum(float(swing @ swing) for swing in swings)
    amplitudes = [_amplitude(swing, mode.x, fs) for swing in swings]
    if (
        abs(mode.x[1] / turn - 1) > ALIKE
        or float(mode.fun @ mode.fun) > (1 - EXPLAINED) * total
        or np.median(amplitudes) < LOUD
    ):
        return None
    parts = np.array_split(np.arange(len(swings)), min(len(swings), PARTS))
    rest = [[swing for row, swing in enumerate(swings) if row not in part] for part in parts if len(parts) > 1]
    without = [_ring_of(_mode(others, mode.x, fs).x) for others in rest]
    degrees = np.array(
        [_ring_of(_mode([_swings(values, degree) for values in cuts], mode.x, fs, degree).x) for degree in DEGREES]
    )
    frequency, damping = _averaged(degrees, np.reshape(without, (-1, 2)), len(cuts), side)
    name, method = f"amplitude of that ringing over the friction, {side}", "where each slip begins, mean of strokes"
    amplitude = mean_of_cycles(name, amplitudes, unit="1", method=method)
    return frequency, damping, amplitude


def _averaged(degrees: Array, without: Array, count: int, side: str) -> list[Estimate]:
    """Frequency and damping ratio, as sure as the answers agree: those of the polynomials, those without some strokes.

    The two parts of the interval are added in squares; the second is a jackknife's.
    """
    parts = len(without)
    sd = np.sqrt((parts - 1) / parts * ((without - without.mean(axis=0)) ** 2).sum(axis=0)) if parts else [math.inf] * 2
    mean, spread = degrees.mean(axis=0), degrees.std(axis=0, ddof=1)
    quantile = student(max(parts - 1, 1))
    crude = f"only {count} stroke{'s' * (count > 1)} a direction: the interval is crude"
    status = Status(*([Doubt(crude, FEW, lesser=True)] if count < FEW_CYCLES else []))
    low, high = degrees[:, 0].min(), degrees[:, 0].max()
    if spread[0] > max(sd[0], MIXED * mean[0]):
        ends = f"{low:.4g} to {high:.4g} Hz by what is taken for it"
        status = Status(f"the friction's own course takes part of the ring: {ends}")
    checks = (f"{count} strokes", f"{low:.4g} to {high:.4g} Hz beside polynomials of degree {SLOW} to {STIFF}")
    swings = []
    for row, (what, unit) in enumerate((("ringing after slip begins", "Hz"), ("damping ratio of that ringing", "1"))):
        half = math.hypot(quantile * sd[row], 2 * spread[row])
        method = "one decaying mode in all strokes, least squares; jackknife over strokes, and polynomials"
        value, interval, wide = float(mean[row]), (mean[row] - half, mean[row] + half), math.hypot(sd[row], spread[row])
        swings.append(Estimate(f"{what}, {side}", value, interval, wide, unit, method, status, checks))
    return swings


def _ring_of(parameters: Array) -> tuple[float, float]:
    """Frequency [Hz] and damping ratio of a pole."""
    decay, turn = map(float, parameters)
    return turn / (2 * math.pi), -decay / math.hypot(decay, turn)


def _after(stroke: Stroke) -> Array:
    """The friction in the quarter of the stroke after its breakaway, over the sliding friction."""
    soon = (len(stroke.friction) - stroke.slip) // SOON
    return stroke.friction[stroke.slip : stroke.slip + soon] / stroke.level


@functools.lru_cache(maxsize=64)
def _slow(count: int, degree: int) -> Array:
    """Polynomials over some samples, orthonormal."""
    return np.asarray(np.linalg.qr(np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, count), degree))[0])


def _swings(values: Array, degree: int) -> Array:
    slow = _slow(len(values), degree)
    return np.asarray(values - slow @ (slow.T @ values))


def _strongest(swings: Sequence[Array], fs: float) -> float | None:
    """Frequency [Hz] of the strongest line of all strokes together."""
    if not swings:
        return None
    longest = max(map(len, swings))
    powers = np.sum([np.abs(np.fft.rfft(swing, PADDED * longest)) ** 2 for swing in swings], axis=0)
    frequencies = np.fft.rfftfreq(PADDED * longest, 1 / fs)
    allowed = (frequencies >= FASTER * fs / longest) & (frequencies <= fs / SAMPLES)
    if not allowed.any() or powers[allowed].max() == 0:
        return None
    return float(frequencies[allowed][powers[allowed].argmax()])


def _waves(parameters: Array, count: int, fs: float, degree: int = SLOW) -> Array:
    """Cosine and sine of a decaying mode, 1 at their largest, less what a polynomial takes of them."""
    end = count - 1 if parameters[0] > 0 else 0  # where a trial of the search that grows is 1, so that none overflows
    wave = np.exp(complex(*parameters) * (np.arange(count) - end) / fs)
    columns, slow = np.column_stack([wave.real, wave.imag]), _slow(count, degree)
    return np.asarray(columns - slow @ (slow.T @ columns))


def _mode(swings: Sequence[Array], start: Array, fs: float, degree: int = SLOW) -> Any:
    """The one pole whose rings leave least of all strokes."""
    from scipy.optimize import least_squares

    counts = set(map(len, swings))  # most strokes are as long as their neighbours

    def left(parameters: Array) -> Array:
        bases = {count: np.linalg.qr(_waves(parameters, count, fs, degree))[0] for count in counts}
        return np.concatenate([swing - (basis := bases[len(swing)]) @ (basis.T @ swing) for swing in swings])

    return least_squares(left, start, x_scale=[start[1], start[1]], method="lm", max_nfev=60)


def _amplitude(swings: Array, parameters: Array, fs: float) -> float:
    """Of the mode where the slip begins."""
    largest = np.linalg.norm(np.linalg.lstsq(_waves(parameters, len(swings), fs), swings, rcond=None)[0])
    return float(largest * math.exp(-max(parameters[0], 0.0) * (len(swings) - 1) / fs))


@dataclass(frozen=True, eq=False)
class Stroke:
    """From one reversal to the next, with friction and displacement positive in the direction that it goes.

    Friction is that about the middle of both directions (see :class:`Strokes`).

    Attributes
    ----------
    way : int
        1 forward, -1 back.
    first : int
        Row of the record at the reversal.
    friction, displacement : ndarray
        From the reversal on.
    level : float
        Sliding friction of the stroke [N]: the median where it is fast.
    slip : int
        Row, from the reversal, where it breaks away: of the largest friction before it moves; of a contact that gives
        way before, of the first peak of the friction once that is near its level.
    rests : bool
        Whether it does not move before.
    """

    way: int
    first: int
    friction: Array
    displacement: Array
    level: float
    slip: int
    rests: bool


@dataclass(frozen=True, eq=False)
class Strokes:
    """The whole strokes of a motion, and the motion.

    Their friction is told from `offset`, half-way between that of both directions: the zero of a sensor may be off, a
    rig may slope, and a contact whose directions differ breaks away about that middle too.
    """

    strokes: tuple[Stroke, ...]
    motion: Motion
    unit: str
    offset: float

    def to(self, way: int) -> list[Stroke]:
        """Those that go forward (1) or back (-1)."""
        return [stroke for stroke in self.strokes if stroke.way == way]


class Cut(NamedTuple):
    """A motion cut at its reversals: of each stroke the rows from the first to before the last, the way, the level."""

    motion: Motion
    friction: Array
    ways: list[tuple[int, int, int]]
    levels: Array
    offset: float
    slow: float


def cut_at_reversals(record: Record, *, contact: str | None, question: str) -> Cut:
    """Where the strokes of a motion begin and end, and the middle of the friction both ways."""
    record.require_clean("friction", question=question)
    record = without_delays(record, *motion_channels(record, contact), "friction", question=question)
    motion = contact_motion(record, contact=contact, question=question)
    require_fit(record, "friction", length=motion.unit, question=question)
    slow = max(CREEP * find_cycles(record, motion).peak, AUDIBLE * motion.noise)
    friction, velocity = record["friction"], motion.velocity
    ways = _ways(velocity, definite_speed(motion), slow)
    ways = ways[:: len(ways) // MANY // 2 * 2 + 1]  # an odd step: both directions in turn
    forces = np.array([_level(friction[first:last], way * velocity[first:last]) for first, last, way in ways])
    signs = np.array([way for _, _, way in ways])
    offset = _middle(forces, signs)
    levels = signs * (forces - offset)
    _require_resolved(levels, record.channels["friction"].unit, question)
    return Cut(motion, friction, ways, levels, offset, slow)


def find_strokes(record: Record, *, contact: str | None, question: str) -> Strokes:
    """Cut a record at the reversals of its motion; strokes that never reach their sliding friction are left out."""
    motion, friction, ways, levels, offset, slow = cut_at_reversals(record, contact=contact, question=question)
    noise, velocity = record.channels["friction"].noise or 0.0, motion.velocity
    strokes = []
    for (first, last, way), level in zip(ways, levels, strict=True):
        force, speed = way * (friction[first:last] - offset), way * velocity[first:last]
        broke = _breakaway(force, speed, level, slow, max(FALL * level, AUDIBLE * noise))
        if broke is not None:
            strokes.append(Stroke(way, first, force, way * motion.displacement[first:last], level, *broke))
    if not strokes:
        raise EstimateError(
            "no stroke from one reversal to the next in which the contact slides",
            f"{question} needs a contact that turns round and slides",
            "give a longer record, or one with more motion",
        )
    travels = np.array([np.ptp(stroke.displacement) for stroke in strokes])
    whole = [stroke for stroke, way in zip(strokes, travels, strict=True) if way > SHORT * np.median(travels)]
    return Strokes(tuple(whole), motion, record.channels["friction"].unit, offset)


def _level(force: Array, speed: Array) -> float:
    return float(np.median(force[speed > FAST * speed.max()]))


def _middle(forces: Array, signs: Array) -> float:
    """Half-way between the sliding friction of both directions."""
    ways = [forces[signs == way] for way in (1, -1)]
    return sum(float(np.median(way)) for way in ways) / 2 if all(map(len, ways)) else 0.0


def _require_resolved(levels: Array, unit: str, question: str) -> None:
    """Refuse strokes whose sliding friction may as well be none: what comes before it would be a ratio to noise."""
    if not len(levels):
        return  # that there is no stroke says more
    level, sd = float(np.mean(levels)), float(np.std(levels)) / math.sqrt(len(levels))
    if level <= RESOLVED * sd:
        raise EstimateError(
            f"a sliding friction of {level:.2g} {unit}, unsure by {sd:.2g} {unit} over {len(levels)} strokes",
            f"{question} needs a sliding friction {RESOLVED:g} times as large as it is unsure",
            "give more cycles, a larger load, or a force channel with less noise",
        )


def _ways(velocity: Array, definite: float, slow: float) -> list[tuple[int, int, int]]:
    """First row, row after the last, and direction of each stroke; it begins where the one before came to rest."""
    moving = np.flatnonzero(np.abs(velocity) > definite)
    signs = np.sign(velocity[moving])
    turns = np.flatnonzero(signs[1:] != signs[:-1])
    if not len(turns):  # one that never turns round rests between its slips
        moves = np.concatenate([[0], np.cumsum(np.abs(velocity) > slow)])
        turns = np.flatnonzero(moves[moving[1:]] - moves[moving[:-1] + 1] < np.diff(moving) - 1)
    starts = []
    for before, after in zip(moving[turns], moving[turns + 1], strict=True):
        way = int(np.sign(velocity[after]))
        was = np.sign(velocity[before])
        starts.append((before + int(np.argmax(was * velocity[before : after + 1] < slow)), way))
    return [(first, last, way) for (first, way), (last, _) in pairwise(starts)]


def _breakaway(force: Array, speed: Array, level: float, slow: float, fall: float) -> tuple[int, bool] | None:
    """Row where a stroke breaks away, and whether it rests until then; None where it bears no friction."""
    moved = int(np.argmax(speed > SLIPPED * slow))
    if level <= 0 or moved < 2:
        return None
    if force[moved] > HELD * level:
        # a stick's first half holds what the stop leaves ringing; a face that is moved on passes rest without a stick
        before = min(moved // 2, moved - int(np.argmax(speed[moved::-1] <= 0)))
        return before + int(np.argmax(force[before : moved + 1])), True
    near = np.flatnonzero(force >= NEAR * level)
    if not len(near):
        return None
    highest = np.maximum.accumulate(force[near[0] :])
    fallen = np.flatnonzero(highest - force[near[0] :] > fall)
    last = int(fallen[0]) + 1 if len(fallen) else len(highest)
    return int(near[0]) + int(np.argmax(force[near[0] : near[0] + last])), False


def sliding_swing(record: Record, strokes: Sequence[Stroke], side: str) -> Estimate | None:
    """Median deviation of the friction from its median while it slides, as a normal law's, less that of its noise."""
    noise, squares, noises = _noise(record), [], []
    for stroke in strokes:
        speed = np.gradient(stroke.displacement)
        rows = stroke.slip + np.flatnonzero(speed[stroke.slip :] > FAST * speed.max())
        if len(rows):
            friction = stroke.friction[rows]
            swing = float(np.median(np.abs(friction - np.median(friction)))) / QUARTILE
            noises.append((float(np.median(noise[stroke.first + rows])) / stroke.level) ** 2)
            squares.append((swing / stroke.level) ** 2 - noises[-1])
    if not squares:
        return None
    method = "median deviation from the median, less the noise"
    square = mean_of_cycles(f"swing of the friction while sliding {side}", squares, unit="1", method=method)
    half = UNSURE * float(np.mean(noises))
    low, high = square.interval
    estimate = _root(replace(square, interval=(low - half, high + half), sd=float(np.hypot(square.sd, half / 2))))
    swings = f"the friction swings by {100 * estimate.value:.0f} % of its level while it slides: a vibration of the rig"
    status = f"{swings} or a faulty record, no steady friction"
    return replace(estimate, status=status) if estimate.value >= STEADY else estimate


def _noise(record: Record) -> Array:
    """Standard deviation of the friction's noise at each sample: as its balance tells it, as stated, or as it shows."""
    if "friction_sd" in record and not is_measured(record, "friction"):
        return record["friction_sd"]
    return noise_along(record["friction"], record.fs, record.channels["friction"].noise)


def _root(square: Estimate) -> Estimate:
    """The square root of an estimate that can not be below zero."""
    possible = square.within(0.0, otherwise="its noise is larger than all that the friction swings by")
    low, high = (float(np.sqrt(end)) for end in possible.interval)
    value, sd = float(np.sqrt(possible.value)), (high - low) / (2 * NORMAL_95)
    return replace(possible, value=value, interval=(low, high), sd=sd)
