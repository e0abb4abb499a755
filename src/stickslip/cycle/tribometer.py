"""The coefficient of friction of a contact that slides to and fro, by the definitions in use, and how it wears in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Mask, Rows
from stickslip.balance.motion import Cycles, Motion, contact_motion, find_cycles, motion_channels, require_fit
from stickslip.cycle.loops import DRIVES, levels_of, sliding_parts
from stickslip.errors import UNNAMED, EstimateError, ModelError, RecordError
from stickslip.estimate import Constant, Doubt, Estimate, Result, Status
from stickslip.record.record import Record, require_record
from stickslip.signals.interpolate import without_delays
from stickslip.statistics import FEW_CYCLES, correlation_time, mean_of_cycles, student

QUESTION = "the coefficient of friction"
PLACES, ROWS = 64, 400  # of the map: along the stroke, and groups of cycles
FEWEST = 20  # cycles, from which on a wear-in is looked for
SURELY = 6.0  # deviations of its size: of 750 even series, alike by up to 0.9 from cycle to cycle, none came to 4.7
SHORTEST = 2.0  # cycles that a wear-in lasts at least: shorter it is one odd value
TIMES = 60  # tried
SETTLED = 5.0  # times its length, after which 0.7 % of a wear-in are left
WEARING = "wearing"  # kind of doubt: the coefficient still changes
# Twice the logarithm by which a line must be likelier: of 12,000 even series, alike by 0 to 1, none came to 25.
LIKELIER = 30.0
ALIKENESS = np.linspace(0.0, 1.0, 21)  # of neighbours, tried
ENDING = 0.1  # of the cycles, chosen: the first and the last, between which a change is told
SLIGHT, LASTS = 1e-3, 0.05  # of the mean, chosen: a change that is worth a word, and one that no state outlasts
DEFINITIONS = {  # of the coefficient, beside what each is of a cycle
    "plateau": "median while it slides, weighed by the way",
    "by_stroke": "mean of a whole stroke forward less that of one back, half of it",
    "by_cycle": "mean magnitude over all samples of a cycle",
    "by_energy": "energy of a cycle over load and way",
}
ALIKE, DIPS = 0.3, 0.5  # of the mean magnitude: an offset that leaves less than ALIKE keeps the force above 1 - ALIKE
LIFTED = 0.05  # of the load: what friction a contact pressed by less has, its ratio does not tell
LAST = 0.9  # of a stroke, past which its end is: there, what slides at all does
MOSTLY = 0.75  # of a stroke: friction that is 15 % higher at both ends looks like 0.87 of it
LEAST = 0.15  # of a stroke, chosen: what slides over less shows no plateau that its rounded corners leave
NOT_SLIDING = "not sliding"  # kinds of doubt: the contact gives way over most of its stroke
PARTLY = "partly sliding"
AMPLE = 1.1  # times the way over which friction turns round: noise, and samples, pass half of it a little early


@dataclass(frozen=True, eq=False, repr=False)
class WearIn(Result):
    """How the coefficient settles: ``mu(n) = final + change exp(-n / cycles)``.

    Attributes
    ----------
    final, change : Estimate
        The coefficient that it settles at, and by how much it lies above it in the first whole cycle of the record.
    cycles : Estimate
        Cycles in which the change falls to 37 %.
    fitted : ndarray, shape (m,)
        The coefficient of each cycle by it.
    """

    final: Estimate
    change: Estimate
    cycles: Estimate
    fitted: Array


@dataclass(frozen=True, eq=False, repr=False)
class Coefficients(Result):
    """The coefficient of friction by the definitions in use.

    Attributes
    ----------
    plateau : Estimate
        Kinetic: the friction while it slides, over the load (as :func:`friction_loops` tells its level).
    by_stroke, by_cycle, by_energy : Estimate
        By the mean of whole strokes, by the mean magnitude of a cycle, and by the energy of a cycle over load and way.
    load : Estimate
        The normal load [N].
    of_cycles : mapping of str to ndarray, shape (m,)
        Each of these of every cycle.
    time : ndarray, shape (m,)
        When each cycle begins [s].
    wear_in : WearIn or None
        How it settles; None where an even coefficient would have looked the same.
    position : ndarray, shape (p,)
        Places along the stroke [m or rad].
    cycle : ndarray, shape (g,)
        Number of the first cycle of each row of the map.
    forward, back : ndarray, shape (g, p)
        Friction over load at each place, positive where it opposes the motion; NaN where it was not met.
    unit : str
        Of the position.
    measured : bool
        Whether the load was measured, or stated.
    steady : int
        The first cycle of those that the means are of.
    first, last : Estimate or None
        Of a coefficient that surely rises or falls along the test: the plateau of the first tenth and of the last of
        these cycles, eight at least; None of an even one.
    status : str
        "ok", or in words what to beware of.
    """

    plateau: Estimate
    by_stroke: Estimate
    by_cycle: Estimate
    by_energy: Estimate
    load: Estimate
    of_cycles: Mapping[str, Array]
    time: Array
    wear_in: WearIn | None
    position: Array
    cycle: Array
    forward: Array
    back: Array
    unit: str
    measured: bool
    steady: int
    first: Estimate | None
    last: Estimate | None
    status: str


def friction_coefficients(
    record: Record, *, normal: Constant | None = None, frequency: float | str | None = None
) -> Coefficients:
    r"""How large is the coefficient of friction, by which definition, and how does it wear in?

    Of each cycle, with the load N of that cycle (of the plateau that of each sample, where it was measured):

    * plateau: the median of f while the contact slides, past the way over which it turns round, every sample weighed
      by its way, over N;
    * by stroke: :math:`(\bar f_\text{forward} - \bar f_\text{back}) / 2N`, means of whole strokes, so that an offset of
      the force is not in it, and a rounded corner at the reversal is;
    * by cycle: :math:`\overline{|f|} / N` of all samples, where an offset stays (ASTM G133 asks for a mean like this);
    * by energy: :math:`\oint f\,dx / (N \oint |dx|)` (Fouvry, Kapsa and Vincent, Wear 1995), the way by the sign of
      the smoothed velocity, so that noise of x is no way.

    Each is the mean of the cycles, its interval Student's t on the scatter between them, which knows that neighbours
    are alike, and on what the load and the force's gain are known to. A wear-in is
    ``final + change exp(-n / cycles)``, by least squares over the plateaus; it is told where an even coefficient would
    not look so, and then the definitions are of the cycles after five times its length, where eight remain. A
    coefficient that rises or falls along these is told where a line is surely likelier than an even one whose
    neighbours are alike, up to a random walk; the intervals are then of the scatter about lines.

    Parameters
    ----------
    record : Record
        With ``friction`` [N] and ``x`` (or ``v``); with ``normal`` [N] where the load was measured. Stated delays are
        taken out first.
    normal : float, str, tuple or Estimate, optional
        The load, for a record that has none, as "10 ± 0.2 N".
    frequency : float or str, optional
        Strokes to and fro in a second [Hz]; found from the record when not given.

    Returns
    -------
    Coefficients

    Raises
    ------
    RecordError
        A channel is missing or broken, or there is no load, or none that is positive.
    ModelError
        A stated load that is not positive.
    EstimateError
        No motion to and fro, or no cycle that slides both ways.

    Examples
    --------
    >>> t = np.arange(40000) / 1000
    >>> v = 2e-3 * np.pi * 2 * np.cos(2 * np.pi * 2 * t)
    >>> friction = 3.0 * np.sign(v) + np.random.default_rng(0).normal(0, 0.02, t.size)
    >>> stroke = Record.of({"x": 2e-3 * np.sin(2 * np.pi * 2 * t), "friction": friction}, fs=1000)
    >>> coefficients = friction_coefficients(stroke, normal="10 N")
    >>> coefficients.plateau.includes(0.3), coefficients.wear_in is None
    (True, True)
    """
    require_record(record)
    names = [*motion_channels(record, "ground"), "friction", *(["normal"] if "normal" in record else [])]
    record.require(*names, question=QUESTION, kind=UNNAMED)
    record.require_clean(*names, question=QUESTION)
    record = without_delays(record, *names, question=QUESTION)
    motion = contact_motion(record, contact="ground", question=QUESTION)
    require_fit(record, "friction", length="m", question=QUESTION)
    cycles = _from_turns(find_cycles(record, motion, frequency=frequency))
    label = cycles.labels(len(record))
    load, loads = _load(record, normal, label)
    friction = _without_drift(record["friction"], motion, cycles, label)
    forces = _forces(friction, motion, cycles, label)
    forces["by_cycle"] = _mean_magnitudes(record["friction"], label)
    even = friction
    if load.method != "stated":
        for _ in range(2):  # the zero, too, is told under one load
            zero = _levels(even, motion, cycles, label).zero
            even = _under_mean_load(friction, record["normal"], loads, label, zero)
    levels = _levels(even, motion, cycles, label)
    forces["plateau"] = levels.middle
    _refuse_magnitudes(record["friction"], forces, label)
    of_cycles = {name: values / loads for name, values in forces.items()}
    wear_in = fit_wear_in(of_cycles["plateau"])
    steady = _steady(wear_in, len(loads))
    relative = math.hypot(record.channels["friction"].gain_sd, load.sd / load.value)
    ends = _ends(of_cycles["plateau"], wear_in, steady, relative)
    status = Status(*_doubts(wear_in, steady, len(loads), ends), *([cycles.status] if cycles.status != "ok" else []))
    if wear_in is not None:
        wear_in = replace(wear_in, final=wear_in.final.widened(relative), change=wear_in.change.widened(relative))
    coefficients = {}
    for name, how in DEFINITIONS.items():
        values = of_cycles[name][steady:]
        scatter = values if ends is None else _without_slope(values)
        mean = mean_of_cycles(_called(name), scatter, unit="1", method=how)
        beside = math.hypot(relative, _unsure_work(friction, motion) if name == "by_energy" else 0.0)
        coefficients[name] = _beside(mean, beside, status)
    coefficients["plateau"] = _as_far_as_it_slides(coefficients["plateau"], levels.share)
    position, cycle, forward, back = _map(even, motion, label, loads)
    return Coefficients(
        **coefficients,
        load=load,
        of_cycles=of_cycles,
        time=motion.start + cycles.edges[:-1] / motion.fs,
        wear_in=wear_in,
        position=position,
        cycle=cycle,
        forward=forward,
        back=back,
        unit=motion.unit,
        measured=load.method != "stated",
        steady=steady,
        first=None if ends is None else ends[0],
        last=None if ends is None else ends[1],
        status=status,
    )


def _from_turns(cycles: Cycles) -> Cycles:
    """The cycles from where the motion turns forward on, so that each has one whole stroke either way.

    A median of two halves, a cycle apart, of a friction that wears is that of either of them.
    """
    if cycles.turns is not None:  # these begin there
        return cycles
    lengths = np.diff(cycles.edges)
    edges = cycles.edges - np.append(lengths, lengths[-1]) / 4
    inside = edges >= -0.5  # samples: a record may begin at a turn
    return replace(cycles, edges=edges[inside]) if np.sum(inside) > 1 else cycles


def _called(name: str) -> str:
    return f"coefficient of friction, {name.replace('_', ' ')}"


def _load(record: Record, normal: Constant | None, label: Rows) -> tuple[Estimate, Array]:
    """The load, and that of every cycle."""
    count = int(label.max()) + 1
    if "normal" in record and normal is None:
        whole = label >= 0
        loads = np.bincount(label[whole], np.abs(record["normal"][whole]), count) / np.bincount(label[whole])
        load = mean_of_cycles("normal load", loads, unit="N", method="measured, mean of cycles")
        sd = record.channels["normal"].gain_sd * load.value  # that it varies is in the coefficient of each cycle
        load = Estimate.normal("normal load", load.value, sd=sd, unit="N", method=load.method, checks=load.checks)
    elif normal is not None:
        load = replace(Estimate.stated("normal load", normal, "N"), method="stated")
        loads = np.full(count, load.value)
    else:
        raise RecordError(
            "no normal load: neither a channel normal nor a value",
            f"{QUESTION} is friction over load",
            "name its column (normal=), or state it: --normal '10 N'",
        )
    if not load.value > 0:
        wrong = ModelError if load.method == "stated" else RecordError
        raise wrong(f"a normal load of {load.value:g} N", "the load presses: it is positive", "check normal")
    return load, loads


def _forces(friction: Array, motion: Motion, cycles: Cycles, label: Rows) -> dict[str, Array]:
    """The friction of every cycle by each definition [N]."""
    count = len(cycles.edges) - 1
    means = []
    for sign in (1.0, -1.0):
        stroke = (label >= 0) & (sign * motion.velocity > 0)
        means.append(np.bincount(label[stroke], friction[stroke], count) / np.bincount(label[stroke], minlength=count))
    way, middle = np.diff(motion.displacement), (friction[1:] + friction[:-1]) / 2
    # to and fro with the smoothed velocity: noise of the position is no way, however many samples there are
    along = way * np.sign(motion.velocity[1:] + motion.velocity[:-1])
    work, length = (np.concatenate([[0.0], np.cumsum(steps)]) for steps in (middle * way, along))
    at = np.arange(len(work))
    per_cycle = [np.diff(np.interp(cycles.edges, at, values)) for values in (work, length)]
    return {
        "by_stroke": (means[0] - means[1]) / 2,
        "by_energy": per_cycle[0] / per_cycle[1],
    }


def _unsure_work(friction: Array, motion: Motion) -> float:
    """Standard deviation of the work, relatively: where between two samples the friction turns round nobody knows.

    Two of it are the most that this can be: of a test whose samples lie at its turns it is that in every cycle.
    """
    way, change = np.diff(motion.displacement), np.diff(friction)
    middle = (friction[1:] + friction[:-1]) / 2
    turns = friction[1:] * friction[:-1] < 0
    work = float(np.sum(np.abs(middle * way)))
    return float(np.sum(np.abs(change * way)[turns])) / (4 * work) if work else 0.0


def _mean_magnitudes(friction: Array, label: Rows) -> Array:
    """The mean magnitude of every cycle [N]."""
    whole = label >= 0
    return np.asarray(np.bincount(label[whole], np.abs(friction[whole])) / np.bincount(label[whole]))


class _Levels(NamedTuple):
    """Friction forward and back of every cycle [N], and over which part of each stroke the contact slides."""

    forward: Array
    back: Array
    share: float

    @property
    def middle(self) -> Array:
        """Of both ways."""
        return np.asarray((self.forward + self.back) / 2)

    @property
    def zero(self) -> Array:
        """Of the force, as it is half of what both ways differ by."""
        return np.asarray((self.forward - self.back) / 2)


def _levels(friction: Array, motion: Motion, cycles: Cycles, label: Rows) -> _Levels:
    """The median of the friction of every cycle while it slides past where it turns round."""
    slides, count = sliding_parts(motion, cycles) & (label >= 0), len(cycles.edges) - 1

    def medians(chosen: Mask) -> tuple[Array, Array]:
        forward, back = (levels_of(sign, friction, motion, chosen, label, count) for sign in (1.0, -1.0))
        return forward, back

    levels = medians(slides)
    share, turned = _turned(friction, motion, label, *levels)
    past = slides & turned
    enough = past.sum() > min(1.0, share) * slides.sum() / 2
    return _Levels(*(medians(past) if enough else levels), share)


def _turned(friction: Array, motion: Motion, label: Rows, forward: Array, back: Array) -> tuple[float, Mask]:
    """Over which part of each stroke the contact slides, and where the friction has turned round.

    That takes as much way as contact and holder give way by. What is still below the level there moves the median by
    its share of the way, in every cycle alike. A spring that gives way passes half of the level at three quarters of
    that way, where the contact slides over most of its stroke; and it gives back the work that it takes, so that of a
    stroke s a contact that gives way by w dissipates F (s - w).
    """
    whole, way, count = label >= 0, motion.displacement, len(forward)
    low, high, passed = np.full(count, np.inf), np.full(count, -np.inf), np.full((2, count), np.inf)
    np.minimum.at(low, label[whole], way[whole])
    np.maximum.at(high, label[whole], way[whole])
    ahead = motion.velocity > 0
    gone = np.where(ahead, way - low[label], high[label] - way)
    bears = np.where(ahead, 1.0, -1.0) * (friction - np.nan_to_num((forward - back) / 2)[label])
    stroke = high - low
    last, weight = whole & (gone > LAST * stroke[label]), np.abs(motion.velocity)
    share = 1.0  # where no sample lies at the end of a stroke it can not be told
    if weight[last].any():
        work, level = (float(np.average(bears[part], weights=weight[part])) for part in (whole, last))
        share = max(0.0, work / level) if level > 0 else 0.0
    if share < MOSTLY:
        return share, np.asarray(gone > AMPLE * (1 - share) * stroke[label])
    half = whole & (bears >= ((forward + back) / 4)[label])
    np.minimum.at(passed, (ahead[half].astype(int), label[half]), gone[half])
    return share, np.asarray(gone > AMPLE * float(np.median(passed)) / 0.75)


def _without_drift(friction: Array, motion: Motion, cycles: Cycles, label: Rows) -> Array:
    """The friction with its zero as it is in the mean: a zero that moves on from a stroke to the next looks like more
    friction, or less."""
    zero, middle = _levels(friction, motion, cycles, label).zero, (cycles.edges[1:] + cycles.edges[:-1]) / 2
    zero, middle = zero[np.isfinite(zero)], middle[np.isfinite(zero)]
    if len(zero) < FEW_CYCLES:
        return friction
    from scipy.interpolate import make_interp_spline

    moved = make_interp_spline(middle, zero, k=3)(np.arange(len(friction)))
    return np.asarray(friction - moved + zero.mean())


def _under_mean_load(friction: Array, normal: Array, loads: Array, label: Rows, zero: Array) -> Array:
    """The friction as under the mean load of its cycle, wherever along the stroke it is pressed; its zero as it is."""
    zero = np.nan_to_num(zero)[label]
    mean = loads[label]
    moved = zero + (friction - zero) * mean / np.maximum(np.abs(normal), LIFTED * mean)
    return np.where(label >= 0, moved, friction)


def _refuse_magnitudes(friction: Array, forces: Mapping[str, Array], label: Rows) -> None:
    """Refuse a force without its sign: alike both ways, and near none at every turn, as an offset never lets it be."""
    size = float(np.nanmedian(forces["by_cycle"]))
    side = 1.0 if np.median(friction) >= 0 else -1.0
    least = np.full(len(forces["by_cycle"]), np.inf)
    np.minimum.at(least, label[label >= 0], side * friction[label >= 0])
    if np.nanmean(forces["plateau"]) < ALIKE * size and -DIPS * size < float(np.median(least)) < DIPS * size:
        raise EstimateError(
            f"the force has the same sign both ways, {size:.3g} N in the mean",
            "friction turns round with the motion",
            "it was logged as a magnitude: give the force with its sign",
        )


def _beside(coefficient: Estimate, relative: float, status: str) -> Estimate:
    """The coefficient with what load and gain are known to, and with what is to be said of all of them."""
    widened = replace(coefficient.widened(relative), status=Status(coefficient.status, status))
    return widened.within(0.0, otherwise=DRIVES)


def _as_far_as_it_slides(plateau: Estimate, share: float) -> Estimate:
    """The plateau, with a doubt where the contact slides over a part of each stroke; unknown where over hardly any."""
    part = f"{100 * share:.0f} % of each stroke"
    if share < LEAST:
        words = f"the contact slides over no more than {part}: it gives way, and shows no plateau"
        return plateau.unknown(Status(Doubt(words, NOT_SLIDING)))
    if share < MOSTLY:
        words = f"the contact slides over {part}, by its work, and gives way over the rest: the end of each is told"
        return replace(plateau, status=Status(plateau.status, Doubt(words, PARTLY)))
    return plateau


def fit_wear_in(values: Array) -> WearIn | None:
    """How does a coefficient settle over the cycles; None where an even one would look the same?

    Parameters
    ----------
    values : ndarray, shape (m,)
        Of every cycle; NaN where one has none.

    Returns
    -------
    WearIn or None

    Examples
    --------
    >>> cycle = np.arange(400)
    >>> noise = np.random.default_rng(0).normal(0, 0.01, 400)
    >>> fit_wear_in(0.3 + noise) is None
    True
    >>> settled = fit_wear_in(0.3 + 0.1 * np.exp(-cycle / 50) + noise)
    >>> settled.final.includes(0.3), settled.cycles.includes(50)
    (True, True)
    """
    from scipy.optimize import curve_fit

    number = np.flatnonzero(np.isfinite(values)).astype(float)
    present = values[np.isfinite(values)]
    if len(present) < FEWEST or np.ptp(present) == 0:
        return None

    def settling(cycle: Array, final: float, change: float, cycles: float) -> Array:
        return np.asarray(final + change * np.exp(-cycle / cycles))

    begin = _first_guess(number, present)
    low, high = [-np.inf, -np.inf, SHORTEST], [np.inf, np.inf, number[-1]]
    try:
        best, covariance = curve_fit(settling, number, present, begin, bounds=(low, high))
    except RuntimeError:  # no end in its rounds: nothing that such a curve tells
        return None
    left = present - settling(number, *best)
    sds = np.sqrt(np.diag(covariance) * max(1.0, correlation_time(left)))
    if not (np.all(np.isfinite(sds)) and abs(best[1]) > SURELY * sds[1]):
        return None
    how, t = "least squares over the cycles", student(max(1.0, len(present) / max(1.0, correlation_time(left)) - 3))
    names = ("coefficient of friction, worn in", "wear-in, change of the coefficient", "wear-in, cycles")
    final, change, cycles = (
        Estimate.normal(name, value, sd=sd, unit="1", method=how, quantile=t)
        for name, value, sd in zip(names, best, sds, strict=True)
    )
    return WearIn(final, change, cycles.within(0.0), settling(np.arange(len(values), dtype=float), *best))


def _first_guess(number: Array, values: Array) -> tuple[float, float, float]:
    """The time that leaves least, of many; the rest is linear."""
    best, least = (float(values.mean()), 0.0, SHORTEST), math.inf
    for cycles in np.geomspace(1.5 * SHORTEST, number[-1] / 2, TIMES):
        design = np.column_stack([np.ones_like(number), np.exp(-number / cycles)])
        solution = np.linalg.lstsq(design, values, rcond=None)[0]
        left = float(np.linalg.norm(values - design @ solution))
        if left < least:
            best, least = (float(solution[0]), float(solution[1]), float(cycles)), left
    return best


def _steady(wear_in: WearIn | None, count: int) -> int:
    """The first cycle after the wear-in; the first of all where too few would remain."""
    after = 0 if wear_in is None else math.ceil(SETTLED * wear_in.cycles.value)
    return after if count - after >= FEW_CYCLES else 0


def changes(values: Array) -> bool:
    """Whether a coefficient surely rises or falls along its cycles: a line is likelier than an even one.

    Neighbours are alike as is likeliest for either (an autoregression of first order), up to a random walk, which seems
    to rise by itself.

    Examples
    --------
    >>> noise = np.random.default_rng(0).normal(0, 0.01, 400)
    >>> changes(0.3 + noise), changes(0.3 + np.cumsum(noise)), changes(0.3 + 1e-4 * np.arange(400) + noise)
    (False, False, True)
    """
    present = values[np.isfinite(values)]
    if len(present) < FEWEST:
        return False
    line = np.vander(np.arange(len(present)), 2, increasing=True)
    least = []
    for design in (line[:, :1], line):
        left = []
        for alike in ALIKENESS:
            told, shape = (one[1:] - alike * one[:-1] for one in (present, design))
            left.append(float(np.sum((told - shape @ np.linalg.lstsq(shape, told, rcond=None)[0]) ** 2)))
        least.append(min(left))
    return least[0] > least[1] * math.exp(LIKELIER / (len(present) - 1))


def _ends(values: Array, wear_in: WearIn | None, steady: int, relative: float) -> tuple[Estimate, Estimate] | None:
    """The coefficient of the first cycles and of the last; None where it is even, or still wears in."""
    if wear_in is not None:
        values = values - wear_in.fitted + wear_in.final.value if steady else values[:0]
    values = values[steady:]
    if not changes(values):
        return None
    some = max(FEW_CYCLES, round(ENDING * len(values)))
    ends = [
        mean_of_cycles(
            _called(f"{name} cycles"), _without_slope(part), unit="1", method=f"mean of the {name} {some} cycles"
        )
        for name, part in (("first", values[:some]), ("last", values[-some:]))
    ]
    slight = abs(ends[1].value - ends[0].value) < SLIGHT * ends[0].value
    return None if slight else (ends[0].widened(relative), ends[1].widened(relative))


def _without_slope(values: Array) -> Array:
    """What scatters about a line over the cycles, about its mean."""
    from scipy.signal import detrend

    present = values[np.isfinite(values)]
    return np.asarray(detrend(present) + present.mean())


def _doubts(wear_in: WearIn | None, steady: int, count: int, ends: tuple[Estimate, Estimate] | None) -> Iterator[Doubt]:
    rest = "the mean is not of a state that lasts"
    if wear_in is not None and not steady:
        yield Doubt(f"it is still wearing in after {count} cycles: {rest}", WEARING)
    if ends is not None and abs(ends[1].value - ends[0].value) > LASTS * max(end.value for end in ends):
        yield Doubt(f"it changes along the test: {rest}", WEARING)


def _map(friction: Array, motion: Motion, label: Rows, loads: Array) -> tuple[Array, Array, Array, Array]:
    """Friction over load along the stroke, of groups of cycles (Belin and Martin, Wear 1992, call it triboscopy)."""
    group = max(1, math.ceil(len(loads) / ROWS))
    rows = math.ceil(len(loads) / group)
    low, high = np.quantile(motion.displacement, [0.001, 0.999])
    place = np.clip(((motion.displacement - low) / (high - low) * PLACES).astype(int), 0, PLACES - 1)
    maps = []
    for sign in (1.0, -1.0):
        stroke = (label >= 0) & (sign * motion.velocity > 0)
        cell = label[stroke] // group * PLACES + place[stroke]
        count = np.bincount(cell, minlength=rows * PLACES)
        total = np.bincount(cell, sign * friction[stroke] / loads[label[stroke]], minlength=rows * PLACES)
        maps.append(np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(rows, PLACES))
    edges = np.linspace(low, high, PLACES + 1)
    return (edges[1:] + edges[:-1]) / 2, group * np.arange(rows, dtype=float), maps[0], maps[1]
