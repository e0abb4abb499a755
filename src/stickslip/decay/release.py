"""Where in a record is something released, and how does it swing until it comes to rest?"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from stickslip.arrays import Array, Mask, Rows
from stickslip.decay.start import SEEN, Run, Swings, bounds_of, free_decays
from stickslip.errors import ABSENT, UNNAMED, EstimateError, RecordError
from stickslip.estimate import Status
from stickslip.record.check import in_words
from stickslip.record.flaws import clipped, spikes
from stickslip.record.record import Record
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_level, quantisation_step
from stickslip.signals.pieces import extreme

QUESTION = "free decay"
ORDERS = {"x": 0, "theta": 0, "v": 1, "a": 2}  # derivative of the displacement that a channel is, in order of choice
DRIVEN = ("z", "force")  # channels that must not move in a free decay
LEAST = 24  # samples from which a noise level can be told
UNEVEN = 0.015  # change of the half cycles over the decay, beyond which the spring is not linear
FEW = 5_000  # samples that show whether values repeat
EVEN = 0.5  # of the median gap between levels: less is no digitiser's
DRIFTS = 0.003  # of the first swing: a rise of the rest position that matters
HELD = 1.5  # times the last turn of another release: friction does not hold a mass there
FLUSH = 0.03  # of a half cycle before the first turn: a record that begins there begins with the release
HOLDS = (0.5, 0.3)  # of a half cycle before a release, in which a hold must be flat
BENT = 0.5  # of the bend after a release: what bends so much before it is no hold
PARTS = 8  # of a period, by which a rest is watched
STRAYED = 4.0  # standard deviations of their means
STAYS = 1e-4  # of the first swing, by which a rest may move
STANDS_OFF = 0.02  # of the record's range: a spike that may be taken for an extreme
LOST = "an extreme was lost, and what lies beyond it is left out"
CAUGHT = "the motion stopped before it had died away: it was caught, or held where friction is greater"
CLIPPED = "clipped swings are left out"
WINDOW = 0.8  # radians on either side of an extreme that the local fit uses
CERTAIN = 3.0  # standard deviations taken as the bound of a noise
HIGHEST = 4.0  # the same for the largest of several samples


@dataclass(frozen=True, eq=False)
class RingDown:
    """One release and what follows it: hold, motion, tail.

    Attributes
    ----------
    channel : str
        What was measured: ``x``, ``theta``, ``v`` or ``a``.
    order : int
        Derivative of the displacement that it is: 0, 1 or 2.
    unit : str
        Its SI unit.
    fs : float
        Sampling rate [Hz].
    first : float
        Time in the record [s] of the first of `samples`.
    samples : ndarray, shape (n,)
        Hold, motion and tail as recorded, stated delays taken out.
    release, stop : float
        Times in the record [s], to a few samples, at which the motion begins and ends; the ends of `samples` where
        these are not in the record.
    held, stopped : bool
        Whether the release, and the coming to rest, are in the record.
    frequency : float
        Of the oscillation, roughly [Hz].
    rest : float
        Where the extremes are centred: the spring's zero, roughly.
    amplitude : float
        First extreme from `rest`, with its sign.
    noise, step : float
        Standard deviation of the broadband noise; step of the digitiser, 0 where none is seen.
    turns : ndarray of int, shape (k,)
        Rows of the alternating extremes; the release is the first where `held`, the rest the last where `stopped`.
    sound : ndarray of bool, shape (k,)
        Which extremes can be trusted: not cut off by the instrument.
    notes : tuple of str
        What to beware of.
    """

    channel: str
    order: int
    unit: str
    fs: float
    first: float
    samples: Array
    release: float
    stop: float
    held: bool
    stopped: bool
    frequency: float
    rest: float
    amplitude: float
    noise: float
    step: float
    turns: Rows
    sound: Mask
    notes: tuple[str, ...] = ()

    @property
    def marks(self) -> frozenset[str]:
        """Which of `CAUGHT`, `CLIPPED` and `LOST` its notes hold."""
        return frozenset({CAUGHT, CLIPPED, LOST}.intersection(self.notes))

    @property
    def status(self) -> str:
        """ "ok", or what to beware of."""
        return Status(*self.notes)

    @property
    def unevenness(self) -> float:
        """By what part the first half cycles are longer than the middle ones; 0 where that is within their error."""
        turns = self.turns[self.sound]
        gaps = np.diff(turns[1:-1] if len(turns) > 6 else turns)
        some = max(1, len(gaps) // 8)
        middle = gaps[len(gaps) // 2 :][: 2 * some]  # the last turns are too lopsided for their instants to be told
        if len(gaps) < 4:
            return 0.0
        early, late = float(gaps[:some].mean()), float(middle.mean())
        return early / late - 1 if abs(early / late - 1) >= max(UNEVEN, 4 / (some * early)) else 0.0

    @property
    def isochronous(self) -> bool:
        """Whether the half cycles are as long after the middle as at the beginning: the spring is linear."""
        return self.unevenness == 0

    @property
    def time(self) -> Array:
        """Times in the record [s] of the samples."""
        return self.first + np.arange(len(self.samples)) / self.fs

    @property
    def hold(self) -> slice:
        """Rows before the motion."""
        return slice(0, self._row(self.release))

    @property
    def motion(self) -> slice:
        """Rows of the motion."""
        return slice(self._row(self.release), self._row(self.stop) + 1)

    @property
    def tail(self) -> slice:
        """Rows after the motion."""
        return slice(self._row(self.stop) + 1, len(self.samples))

    def _row(self, time: float) -> int:
        return min(max(0, round((time - self.first) * self.fs)), len(self.samples) - 1)


@dataclass(frozen=True, eq=False)
class Releases:
    """The free decays of a record.

    Attributes
    ----------
    ring_downs : tuple of RingDown
        In order of time, one at least.
    notes : tuple of str
        What to beware of, of the record as a whole.
    """

    ring_downs: tuple[RingDown, ...]
    notes: tuple[str, ...] = ()

    @property
    def status(self) -> str:
        """ "ok", or what to beware of."""
        return Status(*self.notes)

    def __repr__(self) -> str:
        lines = [
            f"{ring_down.release:.4g} to {ring_down.stop:.4g} s: {len(ring_down.turns)} extremes"
            f" at {ring_down.frequency:.4g} Hz from {ring_down.amplitude:.3g} {ring_down.unit}"
            + ("" if ring_down.stopped else ", still moving at the end")
            for ring_down in self.ring_downs
        ]
        return "\n  ".join([f"{len(lines)} release{'s' * (len(lines) > 1)}:", *lines])


def find_releases(record: Record, *, channel: str | None = None) -> Releases:
    """Where is something let go, and where does it come to rest?

    Turning points are sought in block means of twelve to the half cycle, where the channel turns back by five standard
    deviations of their noise (one and a half steps of a digitiser). A free decay is a chain of swings from one turning
    point to the next that keep pace (each half cycle takes 0.7 to 1.4 times as long as the one before) and do not grow.
    Motion begins a quarter of a cycle before the first swing's middle and ends a quarter after the last one's; before
    lies the hold, after it the tail. A hand's slow pull keeps no pace and belongs to neither.

    Parameters
    ----------
    record : Record
        With ``x`` [m] or ``theta`` [rad], ``v`` [m/s] or ``a`` [m/s^2]. Stated delays are taken out first.
    channel : str, optional
        Which of them; the first of these that the record has when left out.

    Returns
    -------
    Releases

    Raises
    ------
    RecordError
        No such channel, a value that is no number, a broken clock, spikes, or fewer than 24 samples.
    EstimateError
        No free decay: nothing moves, nothing swings back (overdamped), the oscillation grows, stays or beats, or
        something drives it.

    Examples
    --------
    >>> t = np.arange(4000) / 400
    >>> swing = np.exp(-0.5 * t) * (np.cos(15 * t) + 0.5 / 15 * np.sin(15 * t))
    >>> record = Record.of({"x": np.concatenate([np.ones(200), swing])}, fs=400.0)
    >>> releases = find_releases(record)
    >>> round(releases.ring_downs[0].release, 2), round(releases.ring_downs[0].frequency, 1)
    (0.5, 2.4)
    """
    record, name = _prepared(record, channel)
    values = record[name]
    _refuse_spikes(values, name)
    grid = quantisation_step(values)
    noise, step = _noise(record, name, grid), _step(values, grid)
    swings = Swings.of(values, noise, step, record.fs)
    runs = free_decays(swings, ORDERS[name])
    unsound = np.zeros(len(values), dtype=bool)
    for first, last in clipped(values, plateaus=name != "x", step=grid):
        unsound[first : last + 1] = True
    released = tuple(
        _ring_down(record, name, swings, run, (noise, step), unsound, bounds_of(swings, runs, number, len(values)))
        for number, run in enumerate(runs)
    )
    kept = _as_let_go(released)
    many = (f"{len(kept)} releases in one record, each on its own",) if len(kept) > 1 else ()
    less = len(released) - len(kept)
    lost = (f"{less} short motion{'s' * (less > 1)} that something caught left out",) if less else ()
    return Releases(kept, (*many, *lost, *dict.fromkeys(note for ring_down in kept for note in ring_down.notes)))


def _as_let_go(ring_downs: tuple[RingDown, ...]) -> tuple[RingDown, ...]:
    """The releases, each up to where something caught it: friction holds no mass where another release went on."""
    longest = max(ring_downs, key=lambda ring_down: len(ring_down.turns))
    if longest.order > 0 or not longest.stopped:
        return ring_downs
    turned = abs(float(longest.samples[longest.turns[-2]]) - longest.rest)
    kept = []
    for ring_down in ring_downs:
        stayed = abs(float(ring_down.samples[ring_down.turns[-1]]) - longest.rest)
        if ring_down.stopped and stayed > HELD * turned + SEEN * ring_down.noise:
            last = int(ring_down.turns[-2])
            ring_down = replace(
                ring_down,
                samples=ring_down.samples[: last + 1],
                stop=ring_down.first + last / ring_down.fs,
                stopped=False,
                turns=ring_down.turns[:-1],
                sound=ring_down.sound[:-1],
                notes=(*ring_down.notes, CAUGHT),
            )
        if len(ring_down.turns) >= 4 or ring_down is longest:
            kept.append(ring_down)
    return tuple(kept)


def _prepared(record: Record, channel: str | None) -> tuple[Record, str]:
    present = [name for name in ORDERS if name in record]
    if channel is None and not present:
        raise RecordError(
            f"the record has {', '.join(record)}",
            "a free decay is read from x, theta, v or a",
            'name the column when reading: channels={"x": "COLUMN [unit]"}',
            kind=UNNAMED,
        )
    name = present[0] if channel is None else channel
    if name not in ORDERS:
        raise RecordError(
            f"channel {name} is not a motion",
            f"a free decay is read from {', '.join(ORDERS)}",
            "choose one of them",
            kind=ABSENT,
        )
    record.require(name, question=QUESTION, kind=ABSENT)
    record.require_clean(name, question=QUESTION, samples=LEAST)
    record = without_delays(record, name, question=QUESTION, samples=LEAST)
    for driven in DRIVEN:
        if driven in record and np.isfinite(record[driven]).all():
            span, noise = float(np.ptp(record[driven])), _noise(record, driven)
            if span > 12 * noise and span > (0.02 * float(np.ptp(record[name])) if driven == "z" else 0.0):
                raise EstimateError(
                    f"channel {driven} moves by {span:.3g} {record.channels[driven].unit}",
                    "a free decay has nothing that drives it",
                    "give a record with the drive at rest, or ask friction_loops(record)",
                )
    return record, name


def _refuse_spikes(values: Array, name: str) -> None:
    """Refuse spikes that would be taken for turning points."""
    least = STANDS_OFF * float(np.ptp(values)) if name != "a" else math.inf  # an acceleration jumps at every turn
    off = np.abs(values[1:-1] - (values[2:] + values[:-2]) / 2)
    least = max(least / 2, 8 * float(np.median(off)))
    if not np.any(off > least):
        return
    high = tuple(run for run in spikes(values) if np.max(off[max(0, run[0] - 1) : run[1]]) > least)
    if high:
        raise RecordError(
            f"channel {name} has spikes ({in_words(high)})",
            "a free decay would take them for extremes",
            f'replace them with remove_spikes(record, "{name}")',
        )


def _noise(record: Record, name: str, grid: float | None = None) -> float:
    known = record.channels[name].noise
    return known if known is not None else noise_level(record[name], record.fs, step=grid)


def _step(values: Array, grid: float) -> float:
    """Step of the digitiser; where its levels were rounded to be written, their median gap.

    A motion without noise that came to rest has few levels too, but they lie at all distances.
    """
    few = values[:: 1 + len(values) // FEW]
    levels = np.unique(values) if grid == 0 and len(np.unique(few)) < 0.9 * len(few) else few[:0]
    if 2 < len(levels) < len(values) / 6:
        gaps = np.diff(levels)
        least, usual = np.quantile(gaps, [0.1, 0.5])
        return float(usual) if least > EVEN * usual else 0.0
    return grid


def _ring_down(
    record: Record,
    name: str,
    swings: Swings,
    run: Run,
    noise_step: tuple[float, float],
    unsound: Mask,
    bounds: tuple[int, int],
) -> RingDown:
    """One release: where its motion begins and ends, how far hold and tail reach beyond, and where it turns."""
    values, order, (noise, step) = record[name], ORDERS[name], noise_step
    middles, levels = swings.middles[run.first : run.end], swings.levels[run.first : run.end + 1]
    gaps = np.diff(middles)
    half = float(np.median(gaps))
    release, stop = middles[0] - gaps[0] / 2, middles[-1] + gaps[-1] / 2
    rest = _centre(levels)
    near = max(SEEN * noise, 1.5 * step, 0.02 * abs(levels[0] - rest))
    turned = not run.inside and (release >= 0 or (release > -0.25 * half and _flat_start(values, half, noise)))
    ends = stop + half <= bounds[1] - 1 or bounds[1] < len(values)
    start = max(0, round(release))
    held = turned and (order > 0 or start <= FLUSH * half or _flat_before(values, start, half, noise))
    end = min(round(stop), len(values) - 1)
    hold = _reach(values[min(bounds[0], start) : start + 1][::-1], near) if held else 1
    tail = _reach(values[end : max(bounds[1], end + 1)], near) if ends else len(values) - end
    stopped = ends and (order > 0 or tail >= half / 2)
    first, last = max(0, start + 1 - hold), end + (tail if stopped or not ends else 1)
    if order == 0:
        part, least = max(1, round(2 * half / PARTS)), (noise, STAYS * abs(float(levels[0]) - rest))
        first += _strayed(values[first:start][::-1], part, least)
        last -= _strayed(values[end + 1 : last], part, least)
    begun = [start] if turned or run.inside else []
    over = [end] if stop <= len(values) - 1 - half / 8 else []
    turns = [*begun, *_inner_turns(values, middles, levels), *over]
    if order == 2 and turned:  # what was held jumps
        turns[0] = _extreme(values, start, middles[0], upwards=levels[1] <= levels[0])
    rows = np.array([row for row in turns if first <= row < last], dtype=np.intp)
    sound = ~unsound[rows]
    notes = (
        *_notes(values[rows], sound, order, run, noise, record.channels[name].unit),
        *([CAUGHT] if ends and not stopped and not run.parted else []),
    )
    return RingDown(
        name,
        order,
        record.channels[name].unit,
        record.fs,
        record.start + first / record.fs,
        values[first:last],
        record.start + start / record.fs,
        record.start + end / record.fs,
        bool(held),
        bool(stopped),
        record.fs / (2 * half),
        rest,
        float(values[rows[0]] - rest),
        noise,
        step,
        rows - first,
        sound,
        notes,
    )


def _inner_turns(values: Array, middles: Array, levels: Array) -> list[int]:
    """Rows of the extremes between the middles of neighbouring swings."""
    tops = levels[1:-1] > levels[:-2]
    return [_extreme(values, a, b, upwards=up) for (a, b), up in zip(pairwise(middles), tops, strict=True)]


def _extreme(values: Array, first: float, last: float, *, upwards: bool) -> int:
    return int(extreme(values, round(first), round(last), 1.0 if upwards else -1.0))


def _centre(levels: Array) -> float:
    """What alternating extremes are centred on: the mean of their running means, which cancel a steady decrement."""
    if len(levels) < 3:
        return float(levels.mean())
    return float(np.mean((levels[:-2] + 2 * levels[1:-1] + levels[2:]) / 4))


def _reach(values: Array, near: float) -> int:
    """For how many rows `values` stay near the first few, itself one of them."""
    level = float(np.median(values[: max(1, min(8, len(values)))]))
    away = np.flatnonzero(np.abs(values[1:] - level) > near)
    return 1 + int(away[0]) if len(away) else len(values)


def _strayed(samples: Array, size: int, least: tuple[float, float]) -> int:
    """How many samples at the end of a rest have left its level by `least` (noise, and at all).

    Means over `size` of them tell.
    """
    count = len(samples) // size
    if count < 4:
        return 0
    means = samples[: count * size].reshape(count, size).mean(axis=1)
    near = max(STRAYED * least[0] / math.sqrt(size), least[1])
    away = np.abs(means - np.median(means[: count // 2])) > near
    kept = 0 if away.all() else int(np.flatnonzero(~away)[-1]) + 1
    return 0 if kept in (0, count) else len(samples) - size * max(kept - 1, count // 4)


def _flat_start(values: Array, half: float, noise: float) -> bool:
    """Whether a record begins at an extreme: the parabola through its first samples has its top there, not before."""
    count = min(max(5, round(half / 6)), len(values))
    along = np.arange(count, dtype=float)
    bend, slope, _ = np.polyfit(along, values[:count], 2)
    if bend == 0:
        return False
    doubt = 2 * noise * 14 / (2 * abs(bend) * count**1.5)  # standard deviations of the slope at a parabola's end
    return bool(-slope / (2 * bend) > -1 - min(doubt, 0.05 * half))


def _flat_before(values: Array, start: int, half: float, noise: float) -> bool:
    """Whether nothing moves before a release: a swing that only turns there bends before as it does after."""
    for share in HOLDS:
        reach = min(start, round(share * half))
        if reach < 2:
            return False
        rows = np.arange(start - reach, min(start + reach + 1, len(values)))
        bend = 1 - np.cos(math.pi / half * (rows - start))
        design = np.column_stack([np.ones(len(rows)), bend * (rows < start), bend * (rows > start)])
        inverse = np.linalg.inv(design.T @ design)
        solution = inverse @ design.T @ values[rows]
        if abs(solution[1]) + 2 * noise * math.sqrt(inverse[1, 1]) < BENT * abs(solution[2]):
            return True
    return False


def _notes(levels: Array, sound: Mask, order: int, run: Run, noise: float, unit: str) -> tuple[str, ...]:
    notes = []
    if not sound.all():
        notes.append(f"{int(np.sum(~sound))} extremes are clipped and left out")
    between = (levels[:-2] + 2 * levels[1:-1] + levels[2:]) / 4
    if order == 0 and len(between) >= 6:
        pairs = (between[:-1] + between[1:]) / 2
        along = np.linspace(-0.5, 0.5, len(pairs))
        rise = float(along @ pairs / (along @ along))
        swing = abs(levels[0] - levels[1])
        fall = 1 - abs(levels[1] - levels[2]) / swing
        if abs(rise) > max(max(DRIFTS, fall**3 / 4) * swing, 4 * noise):  # uneven swings leave a trend of their own
            notes.append(f"the rest position drifts by {rise:.2g} {unit}: the extremes alone are off by as much")
    if run.parted:
        notes.append(LOST)
    return tuple(notes)


def locate(ring_down: RingDown, how: str) -> tuple[Array, Array, Array, Array]:
    """Times [s in the record], values, standard deviations and largest errors of a decay's extremes.

    Parameters
    ----------
    ring_down : RingDown
        As :func:`~stickslip.decay.release.find_releases` gives it.
    how : {"fit", "sample"}
        By least squares on the samples near each extreme, ``X + c (cos w t - 1)`` with a c of its own on either side,
        for friction makes the curvature jump at a turn; or the largest sample.
    """
    turns = ring_down.turns.astype(float)
    if how == "fit":
        turns = np.array([_turn(ring_down, number) for number in range(len(turns))])
        even = _evenly_spaced(turns, ring_down)
        fits = np.array([_fitted(ring_down, number, turn) for number, turn in enumerate(even)])
    else:
        fits = np.array([_sampled(ring_down, number) for number in range(len(turns))])
        turns = fits[:, 0]
    times = ring_down.first + turns / ring_down.fs
    quantised = ring_down.step if ring_down.noise < ring_down.step else 0.0
    sd = np.sqrt(fits[:, 2] ** 2 + quantised**2 / 12)
    return times, fits[:, 1], sd, fits[:, 3] + quantised / 2


def _sampled(ring_down: RingDown, number: int) -> tuple[float, float, float, float]:
    """Row, value, standard deviation and bound of the largest sample near an extreme."""
    turn, half = int(ring_down.turns[number]), ring_down.fs / ring_down.frequency / 2
    reach = max(1, round(half / 4))
    first = max(0, turn - reach)
    part = ring_down.samples[first : turn + reach + 1]
    top = (number % 2 == 0) == (ring_down.amplitude > 0)  # the last extreme may lie on the side of the one before
    row = first + int(np.argmax(part) if top else np.argmin(part))
    value = float(ring_down.samples[row])
    bend = abs(value - float(ring_down.samples[ring_down.turns[max(0, number - 1)]])) / 2 or abs(ring_down.amplitude)
    missed = bend * (math.pi / half) ** 2 / 8  # of a top between two samples
    # the noise alone of a digitiser is its step's twelfth
    noise = math.sqrt(max(0.0, ring_down.noise**2 - ring_down.step**2 / 12))
    return row, value, math.hypot(noise, missed / math.sqrt(3)), HIGHEST * noise + missed


def _half(ring_down: RingDown) -> float:
    """Samples in half a cycle."""
    return ring_down.fs / ring_down.frequency / 2


def _window(ring_down: RingDown, turn: float) -> Rows:
    reach = max(2.0, WINDOW / math.pi * _half(ring_down))
    return np.arange(max(0, math.ceil(turn - reach)), min(len(ring_down.samples), math.floor(turn + reach) + 1))


def _turn(ring_down: RingDown, number: int) -> float:
    """Row, with its fraction, of an extreme by a local fit; of the release and the stop as they were found."""
    turn, turning = float(ring_down.turns[number]), math.pi / _half(ring_down)
    if _at_rest(ring_down, number):
        return turn
    if ring_down.order == 2:  # the last sample before the jump at a turn is the largest
        return _sampled(ring_down, number)[0] + 0.5
    first = turn
    for _ in range(4):
        rows = _window(ring_down, turn)
        bend = np.cos(turning * (rows - turn)) - 1
        shift = np.sin(turning * (rows - turn))
        columns = (np.ones(len(rows)), bend * (rows < turn), bend * (rows > turn), shift)
        solution = np.linalg.lstsq(np.column_stack(columns), ring_down.samples[rows], rcond=None)[0]
        mean = (solution[1] + solution[2]) / 2
        step = float(solution[3] / (mean * turning)) if mean else 0.0
        turn += min(max(step, -0.1 * _half(ring_down)), 0.1 * _half(ring_down))
        if abs(step) < 1e-4:
            break
    return turn if abs(turn - first) < _half(ring_down) / 4 else first


def _at_rest(ring_down: RingDown, number: int) -> str:
    """On which side of this extreme nothing moves."""
    if ring_down.held and number == 0:
        return "before"
    return "after" if ring_down.stopped and number == len(ring_down.turns) - 1 else ""


def _evenly_spaced(turns: Array, ring_down: RingDown) -> Array:
    """The turns on one even spacing, each counting by its amplitude: where noise hides a turn, its neighbours tell.

    Of a spring that is not linear the later half alone, where the amplitude is small.
    """
    if len(turns) < 4:
        return turns
    number = np.arange(len(turns))
    weights = np.abs(ring_down.samples[ring_down.turns] - ring_down.rest)
    weights[[0, -1]] *= 1e-3  # release and stop are known less well than turns
    weights[~ring_down.sound] *= 1e-3
    first = 0 if ring_down.isochronous else len(turns) // 2
    line = np.polyfit(number[first:], turns[first:], 1, w=weights[first:])
    return np.concatenate([turns[:first], np.polyval(line, number[first:])])


def _fitted(ring_down: RingDown, number: int, turn: float) -> tuple[float, float, float, float]:
    """Row, value, standard deviation and bound of an extreme by a local fit at its instant."""
    rows, turning, still = _window(ring_down, turn), math.pi / _half(ring_down), _at_rest(ring_down, number)
    if ring_down.order == 2:
        rows = rows[rows < turn]
    bend = np.cos(turning * (rows - turn)) - 1
    columns = [np.ones(len(rows))]
    columns += [bend * (rows < turn)] if still != "before" else []
    if ring_down.order == 2:
        columns += [np.sin(turning * (rows - turn))]
    elif still != "after":
        columns += [bend * (rows > turn)]
    design = np.column_stack(columns)
    if len(rows) <= design.shape[1]:
        return _sampled(ring_down, number)
    solution = np.linalg.lstsq(design, ring_down.samples[rows], rcond=None)[0]
    residual = ring_down.samples[rows] - design @ solution
    spread = float(np.sqrt(np.linalg.pinv(design.T @ design)[0, 0]))
    noise = max(ring_down.noise, float(np.sqrt(residual @ residual / (len(rows) - design.shape[1]))))
    return turn, float(solution[0]), noise * spread, CERTAIN * noise * spread
