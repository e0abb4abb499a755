"""Micro-slips: how often, when and for how long does a sticking contact give way a little?"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.contact.frequency_transition import heard_mode
from stickslip.contact.ringing import PENALTY, UNTOLD, Ringing, Window, find_ringing, not_one_mode, too_fast
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Estimate, Result, Status
from stickslip.record.record import Record
from stickslip.signals.pieces import RING, Piece
from stickslip.statistics import mean_of_cycles

QUESTION = "micro-slips"
ASTRAY = 0.27  # of a cycle of the ring: the cuts may lie so far from where a micro-slip begins and ends
STEPS = (0.03, 0.008, 0.002)  # of the same: the search goes from coarse to fine
FLOOR = 0.001  # of the acceleration's standard deviation: rings about the drive's slow line fit to 1e-4 without noise
SHOWING = 0.4  # of a cycle: a ring over a line shows its mode where it lasts as long,
RING_SAMPLES = 10  # and has as many samples
THROUGH = 4.0  # variances that one ring through two may leave: 0.7 to 1.1 of 9 sticks of a rig, 140 through a slip
MODE_RINGS = 24  # the longest of them that show it together
# of the sticks, that hold as many: of 100 rigs at each noise (benchmarks/microslips.py) false ones never did
ALIKE = 0.9
SWING = (1.0, 1.8)  # cycles after the beginning of a ring: the second tip, and where the ring after it is over
LASTING = np.geomspace(0.01, 0.5, 40)  # of a cycle: micro-slips that are tried
SPARE = 1.1  # times that: of 15 slips of up to 1.1 times it 2 were missed, of 90 of up to 1.5 none (1 % noise)
SEEN = 2 * PENALTY + 4 * math.sqrt(2 * PENALTY)  # variances: passes 2 PENALTY, with noise, in 98 of 100


@dataclass(frozen=True)
class MicroSlip:
    """One micro-slip.

    Attributes
    ----------
    time : float
        When it begins [s].
    duration : float
        How long it lasts [s].
    stick : int
        Number of the stick it lies in.
    """

    time: float
    duration: float
    stick: int


@dataclass(frozen=True, eq=False, repr=False)
class MicroSlips(Result):
    """The micro-slips of a record.

    Attributes
    ----------
    per_stick : Estimate
        How many in one stick, mean of the sticks.
    events : tuple of MicroSlip
        In order.
    counts : tuple of int
        How many in each stick.
    shortest : float
        How long one has to last to be seen, in 98 of 100, even in the second swing of a stick [s]; NaN where none is.
    kind : str
        "double stick-slip" where most sticks hold a micro-slip; "no micro-slips", or "some sticks slip";
        "cannot be told from this record" where the sticks swing, but not as one mode.
    status : str
        "ok", or in words what to beware of.
    """

    per_stick: Estimate
    events: tuple[MicroSlip, ...]
    counts: tuple[int, ...]
    shortest: float
    kind: str
    status: str


def find_microslips(
    record: Record, *, channel: str = "a", mass: Constant | None = None, stiffness: Constant | None = None
) -> MicroSlips:
    """How many times does the contact slip by a little within each stick, when, and for how long?

    While a compliant contact sticks it rings with the mass; where the friction limit cuts a swing off, the mass slips
    until it stops again (thesis chapters 4 and 5: micro-slip; with the slip from one stick to the next it makes double
    stick-slip). There the acceleration follows the drive alone, a parabola, and not the ring: the cuts between them are
    found by dynamic programming, as in :func:`transition`. Begin and end are where ring, line and ring fit best that
    meet without a jump, for friction reaches its limit and leaves it without one. The begin is a kink and told to a
    sample or two; the end is smoother and less sure.

    Parameters
    ----------
    record : Record
        With an acceleration; see :func:`transition`.
    channel : str
        The acceleration.
    mass, stiffness : float, str, tuple or Estimate, optional
        Oscillating mass [kg] and spring [N/m]: with ``x`` and ``z``, to take a stated mount out of the acceleration.

    Returns
    -------
    MicroSlips

    Raises
    ------
    EstimateError
        "no transition": no stick.
    RecordError
        A channel that is missing or not finite, a broken clock.

    Examples
    --------
    >>> import stickslip as ss
    >>> case = ss.scenarios.get("THESIS compliant 2.5Hz fk=1.1 Ky=192000 z.0174(k+Ky)")
    >>> record = ss.simulate(case.system, cycles=8).record(fs=4000).between(1.0, 3.2)
    >>> slips = find_microslips(record)
    >>> slips.kind, round(slips.per_stick.value)
    ('double stick-slip', 2)
    """
    return microslips_of(find_ringing(record, channel, question=QUESTION, mass=mass, stiffness=stiffness))


def microslips_of(ringing: Ringing) -> MicroSlips:
    """The micro-slips of sticks that are cut into pieces already."""
    if ringing.silent:
        raise EstimateError(
            "no transition: the sticks do not ring",
            "a micro-slip interrupts the ringing of a contact, and a mass at rest shows none",
            "the mechanism tells what the sticks are like",
        )
    heard_mode(ringing)  # what cuts no ring off is no micro-slip
    if too_fast(ringing):
        raise EstimateError(
            f"no transition: {too_fast(ringing)}",
            "a micro-slip interrupts a ringing that is told",
            "record at a higher rate, or give x or v beside it, that sticks are told from",
        )
    windows, pole, variance = _without_seams(ringing)
    counts = tuple(len(window.glides) for window in windows)
    events = []
    for number, window in enumerate(windows):
        for piece in window.glides:
            begin, end = _edges(window, piece, pole)
            events.append(MicroSlip(ringing.time(window, begin), (end - begin) / ringing.fs, number))
    astray, shortest = not_one_mode(ringing), _shortest_seen(windows, pole, variance) / ringing.fs
    per_stick = mean_of_cycles(
        "micro-slips per stick",
        [float(count) for count in counts],
        unit="1",
        method="cuts between rings of one mode, by dynamic programming",
        checks=(f"those are counted that last {1e3 * shortest:.2g} ms or longer",) if math.isfinite(shortest) else (),
    ).within(0.0)
    blurred = "without a load cell whose mount is stated, one may be missed or seen twice" if ringing.blurred else ""
    usual = sum(count == int(np.median(counts)) for count in counts) / len(counts)
    uneven = "sticks differ in their number: noise, or a swing that is near to slip, may hide or make one"
    status = Status(ringing.status, astray, blurred, uneven if usual < ALIKE else "")
    per_stick = replace(per_stick, status=per_stick.status if status == "ok" else status)
    return MicroSlips(per_stick, tuple(events), counts, shortest, UNTOLD if astray else _kind(counts), status)


def _shortest_seen(windows: Sequence[Window], pole: complex, variance: float) -> float:
    """How many samples a micro-slip in the second swing has to last that the noise hides it in 2 of 100.

    A ring A cos(phi) cut off at -phi0 of its tip holds A cos(phi0) for tan(phi0)/omega, until the mass stops, and rings
    on from there: that motion is made, and what a ring over a line leaves of it weighed as the cuts are.
    """
    cycle = 2 * math.pi / pole.imag
    rings = [window.values[p.first : p.last] for window in windows for p in window.rings]
    rings = [values for values in rings if len(values) > cycle / 2]
    if not rings:
        return math.nan
    amplitude = float(np.median([np.abs(values[: math.ceil(cycle / 2)]).max() for values in rings]))
    rows = np.arange(SWING[1] * cycle)
    for duration in LASTING * cycle:
        seen = _over_line(amplitude * _cut_off(rows, SWING[0] * cycle, duration, pole), pole, free=True)
        if float(seen @ seen) > SEEN * variance:
            return float(SPARE * duration)
    return math.nan


def _cut_off(rows: Array, tip: float, duration: float, pole: complex) -> Array:
    """A ring of amplitude 1 at its beginning whose swing with its tip at row `tip` a micro-slip cuts off."""
    begin = tip - math.atan(pole.imag * duration) / pole.imag
    level, end = np.exp(pole.real * begin) * math.cos(pole.imag * (tip - begin)), begin + duration
    after = level * np.exp(pole.real * (rows - end)) * np.cos(pole.imag * (rows - end))
    before = np.exp(pole.real * rows) * np.cos(pole.imag * (rows - tip))
    return np.asarray(np.where(rows < begin, before, np.where(rows < end, level, after)))


def _without_seams(ringing: Ringing) -> tuple[tuple[Window, ...], complex, float]:
    """The windows without the glides that one ring through them makes needless, their mode, the variance about rings.

    The cuts take a ring to swing about zero. It swings about the drive's slow acceleration of the held mass, 0.5 % of
    the ring, and in a record of little noise a cut is cheaper than that misfit. With a line under each ring, and the
    mode that then fits best, a glide stays where it spares what two more pieces must.
    """
    windows, pole = ringing.windows, ringing.pole / ringing.fs
    variance = max(ringing.noise, FLOOR * float(ringing.record[ringing.channel].std())) ** 2
    least = max(RING_SAMPLES, SHOWING * 2 * math.pi / pole.imag)
    rings = [window.values[p.first + 1 : p.last - 1] for window in windows for p in window.rings]
    long = sorted((values for values in rings if len(values) >= least), key=len)[-MODE_RINGS:]
    if not long:  # the mode of the cuts may be a wrong one, which cuts each ring in two: one through both shows it
        through = [w.values[b.first + 1 : a.last - 1] for w in windows for b, a in itertools.pairwise(w.rings)]
        shown = [(values, *_refined([values], pole)) for values in through]
        long = [values for values, _, left in shown if left <= THROUGH * variance]
    if not long:
        return windows, pole, variance
    pole, left = _refined(long, pole)
    variance = max(variance, left)
    joined = (_joined(window.values, list(window.pieces), pole, variance) for window in windows)
    return tuple(replace(window, pieces=tuple(p)) for window, p in zip(windows, joined, strict=True)), pole, variance


def _refined(rings: Sequence[Array], pole: complex) -> tuple[complex, float]:
    """The mode that rings over lines show together, from near `pole`, and the mean square that they leave."""
    from scipy import optimize

    def residuals(parameters: Any) -> Any:
        return np.concatenate([_over_line(values, complex(*parameters)) for values in rings])

    fit: Any = optimize.least_squares
    best = fit(residuals, [pole.real, pole.imag], x_scale=0.1 * pole.imag, method="lm")
    return complex(*best.x), float(np.mean(best.fun**2))


def _over_line(values: Array, pole: complex, *, free: bool = False) -> Array:
    """What a ring and a line leave of the values; of a `free` mode, what its small change leaves, too."""
    rows = np.arange(len(values))
    wave = np.exp(pole * rows)
    design = np.column_stack([wave.real, wave.imag, np.ones(len(rows)), rows])
    fitted = np.linalg.lstsq(design, values, rcond=None)[0]
    if free:
        change = rows * wave * complex(fitted[0], -fitted[1])
        design = np.column_stack([design, change.real, change.imag])
        fitted = np.linalg.lstsq(design, values, rcond=None)[0]
    return np.asarray(values - design @ fitted)


def _joined(values: Array, pieces: list[Piece], pole: complex, variance: float) -> list[Piece]:
    """Ring, glide and ring made one ring, where the glide spares too little; the least needed first."""

    def left(first: int, last: int) -> float:
        return float(np.sum(_over_line(values[first:last], pole, free=True) ** 2))

    while len(pieces) > 3:  # glide, ring, glide: nothing is left to join
        spared = {}
        for number in range(2, len(pieces) - 2, 2):
            before, glide, after = pieces[number - 1 : number + 2]
            first, last = before.first + 1, after.last - 1
            parts = left(first, glide.first) + left(glide.last, last)
            spared[number] = (left(first, last) - parts) / variance
        number = min(spared, key=lambda row: spared[row])
        if spared[number] > 2 * PENALTY:
            break
        pieces[number - 1 : number + 2] = [Piece(pieces[number - 1].first, pieces[number + 1].last, RING)]
    return pieces


def _kind(counts: Sequence[int]) -> str:
    """What sticks that hold so many micro-slips each are called."""
    share = sum(count > 0 for count in counts) / len(counts)
    return "double stick-slip" if share > 0.5 else "some sticks slip" if share > 0 else "no micro-slips"


def _edges(window: Window, glide: Piece, pole: complex) -> tuple[float, float]:
    """Rows where a micro-slip begins and ends: where a ring, a line and a ring that meet leave the least."""
    number, cycle = window.pieces.index(glide), 2 * math.pi / pole.imag
    low, high = window.pieces[number - 1].first, window.pieces[number + 1].last
    rows, values = np.arange(low, high, dtype=float), window.values[low:high]
    begin, end, reach = float(glide.first), float(glide.last), ASTRAY * cycle
    for step in STEPS:
        away = np.arange(-reach, reach + step * cycle / 2, step * cycle)
        pairs = itertools.product(begin + away, end + away)
        # rows are fractional here: a micro-slip of less than a sample would fit what noise does between two
        inside = [(first, last) for first, last in pairs if low + 2 <= first and first + 1 <= last <= high - 2]
        tried = [(_left(rows, values, first, last, pole), first, last) for first, last in inside]
        if tried:
            _, begin, end = min(tried)
        reach = step * cycle
    return begin, end


def _left(rows: Array, values: Array, begin: float, end: float, pole: complex) -> float:
    """Sum of squares, but for a constant, that the ring, the line and the next ring leave."""
    first, second = np.searchsorted(rows, (begin, end))
    before, after = np.exp(pole * (rows[:first] - begin)), np.exp(pole * (rows[second:] - end))
    design = np.zeros((4, len(rows)))  # level and slope where the line begins; what each ring has of its own
    design[0, :first], design[0, first:second], design[0, second:] = before.real, 1.0, after.real
    design[1, first:second], design[1, second:] = rows[first:second] - begin, (end - begin) * after.real
    design[2, :first], design[3, second:] = before.imag, after.imag
    along = design @ values
    return -float(along @ np.linalg.lstsq(design @ design.T, along, rcond=None)[0])
