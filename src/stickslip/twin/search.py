"""Which rig would have written a record: the simplest law that leaves of x what noise would."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from stickslip.balance.motion import driving, is_measured, lacking
from stickslip.drives.kinds import HarmonicBase
from stickslip.errors import StickslipError
from stickslip.law.driven import DriveFrom, Tones, possible_drives
from stickslip.laws.coulomb import LinearSlope
from stickslip.oscillator import Oscillator
from stickslip.record.flaws import saturated
from stickslip.record.record import Record
from stickslip.rig.rig import Rig
from stickslip.rig.sensor import Digitiser, MeasuredNoise, Mount, Noise, Sensor
from stickslip.signals.noise import density_beside, noise_level, quantisation_step
from stickslip.statistics import least_squares
from stickslip.twin.belief import (
    BENT,
    DAMPER,
    DRIVE,
    EXCESS,
    GAIN,
    GIVE,
    HELD,
    KINETIC,
    LATE,
    LOSS,
    MASS,
    POWER,
    RATE,
    SLIDES,
    SLIPS,
    SLOPE,
    SPEED,
    SPRING,
    Belief,
    levelled,
)
from stickslip.twin.descent import FAR, QUESTION, SETTLED, descended, explains, misfit, refined, slope_of
from stickslip.workers import Map

# How many starts, cycles and passes: by trial on the rigs of benchmarks/twins.py with Stribeck's curve, constants half
# a per cent off, and with LuGre's bristles (seeds 621 and 622), of which every one but two was then led to its noise.
STARTS = 9  # of a grid, that are led over a first cycle: some end in a valley of their own
KEPT = 4  # of them, the nearest, that are led further; one where a value is held: its valley is the same (seed 911)
SAME = 0.01  # of its size, by which a part may differ between two searches that came to the same end
HORIZONS = (1.0, 3.0)  # cycles over which a start is led to the record before it is over more
STEPS = 4  # passes of it over each
LEAST = 50  # samples
SEARCHED = 4000  # samples in which it is searched where a law's valley lies
SENSED = ("x", "z", "force", "v", "a", "load")  # channels that a virtual rig writes
STEADY = 0.1  # of x that may be beside the harmonics: of a transient a wrong law leaves some tenth, which is no noise
LAWS = 3  # that are tried beside the simplest
CLOSE = 6.6  # chi-squared by which one law leads another, one in a hundred by chance
SLIPPED = 11.0  # chi-squared from which a constant, or the clock of x, may be off: one in a thousand by chance
# From which it is off, and no law will do: none of 19 rigs as stated came so far (benchmarks/twins.py, seed 260103),
# each of four with a wrong gain, delay or spring did, or strayed (seed 260105).
CERTAIN = 30.0
# What may be off at once: x over what moved it, the spring over the mass, and its clock. Of three Coulomb rigs with
# constants and gains half a per cent off one was told static friction for two of them (seed 5501).
SEVERAL = (LATE, GAIN, SPRING)
# Chosen: more than calibration leaves a gain or a constant off by is a mistake, and several are not made at once. Of
# two rigs with static friction whose x was 2 ms late, gains 17 and 23 % off without any explained it nearly as well.
CALIBRATED = 0.03
CHANCE = 0.01  # that a part which is not there is believed in
# Where the search for a part begins: static over sliding friction less 1; deflection before slip over the largest
# displacement; Stribeck speed over the largest speed. The nearest of them is taken.
EXCESSES = (0.02, 0.1, 0.25, 0.5, 0.8)
STATIC = 0.25  # of them, where it is searched beside a slip: of a record 2 ms late all but the first ended alike
DEFLECTIONS = (0.0003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3)
LOSSES = (0.02, 0.1, 0.5)  # of a contact: its damping over the root of its stiffness times the mass
# Of bristles, with how much softer they are than a spring that does as they do: each is searched by itself, since from
# one grid the weakly damped were led on alone, and of eight rigs two were six and ten times too stiff (seed 351501);
# without the last one ended 50 of chi-squared above its floor (seed 351601).
DAMPED = ((0.1, 1.0), (0.5, 3.0), (1.0, 8.0), (2.0, 3.0))
SPEEDS = (0.03, 0.1, 0.3, 1.0)
STRETCHES = (0.5, 2.0, 4.0, 8.0)  # times the static friction above the sliding one, at which it is seen what else moves
RATES = (2.0, 5.0, 12.0, 30.0, 80.0)  # at which friction follows, over the largest speed over the largest displacement
LEVELS = (0.8, 0.9, 1.0)  # of the friction that a law without a fall in speed would have


def believe(record: Record, *, mapped: Map = map) -> Belief:
    r"""Which rig would have written this record?

    The law is the simplest that the record leaves possible. It begins as :math:`f = f_k\,\mathrm{sgn}\,v + s\,v`, by
    least squares where the mass slides faster than a fifth of its largest speed; its values, the state in which the
    record begins, and the constants within their stated uncertainty are moved to where the simulated displacement is
    nearest to the measured one, by Levenberg's and Marquardt's method. A part that does not stand out of chance (one in
    a hundred) is left out; a static friction above the sliding one, a contact that gives way or a friction that falls
    as Stribeck's does is believed in where it leaves less of the displacement than chance would (by an F test, at one
    in a hundred for all of them together).

    Parameters
    ----------
    record : Record
        With x, what moved it (z or force), and the friction by :func:`~stickslip.friction_force` from a stated mass and
        spring.
    mapped : callable, optional
        As `map`, where several processes try the laws.

    Returns
    -------
    Belief

    Raises
    ------
    EstimateError
        There is no balance of forces behind the friction, or nothing in the record tells what moved the mass.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(mass=2.0, stiffness=800, law=ss.laws.Coulomb(1.0),
    ...                        drive=ss.drives.HarmonicBase(4e-3, frequency=2.0))
    >>> record = ss.Rig.perfect("x", "z").having("x", white=1e-6).measure(ss.simulate(slider, cycles=8), fs=1000, rng=1)
    >>> belief = believe(ss.friction_force(record, mass=2.0, stiffness=800))
    >>> bool(abs(belief.kinetic - 1.0) < 0.01), len(belief.twin(np.random.default_rng(1))) == len(record)
    (True, True)
    """
    if (lacks := lacking(record, QUESTION)) is not None:
        raise lacks
    stated = record.rig
    assert stated is not None
    assert stated.mass is not None
    assert stated.stiffness is not None
    oscillator = Oscillator(
        mass=stated.mass,
        stiffness=stated.stiffness,
        damping=stated.damping,
        damper=stated.damper,
        law=LinearSlope(0.0, slope=0.0),
    )
    drives = possible_drives(record, HarmonicBase(0.0, frequency=1.0, contact=stated.contact))
    simple = min((_linear(record, oscillator, drive) for drive in drives), key=misfit)
    belief = _without_chance(_richer(_without_chance(simple, SLOPE, KINETIC), simple.as_stated(), mapped), SLOPE)
    belief = _with_slips(belief, mapped)
    measured = _with_measured_noise(belief)  # which, slow, weighs less against what is stated of the constants
    return belief if measured is belief else _refined_on(measured, record)


def _linear(record: Record, oscillator: Oscillator, drive: DriveFrom) -> Belief:
    """The nearest with a friction that is linear in speed."""
    unsure, contact = _unsure(record, drive), record.rig.contact if record.rig is not None else "ground"
    start = {"x": float(record["x"][0]), "v": float(record["v"][0])}
    values = {**start, **dict.fromkeys(unsure, 0.0), **_sliding(record, contact)}
    begun = Belief(record, oscillator, values, drive, Rig(tuple(_sensors(record))), unsure)
    # where the sensor has an offset, the rest position is nearer to its mean than to its zero
    begun = min(begun, begun.at(x=values["x"] - float(record["x"].mean())), key=misfit)
    if not math.isfinite(misfit(begun)):  # a slope that falls so far that the motion grows beyond all numbers
        begun = begun.at(**{SLOPE: 0.0})
    led = _descended_along(begun, [record.rows(0, samples) for samples in _horizons(record)])
    return refined(replace(led, record=record))


def _without_chance(belief: Belief, *parts: str) -> Belief:
    """Without those parts, asked in turn, that chance would have shown too."""
    for part in parts:
        if part in belief.values and not _significant(belief, part):
            belief = refined(belief.without(part))
    return belief


def _significant(belief: Belief, part: str) -> bool:
    """Whether a value is further from zero than chance would bring it."""
    from scipy.special import stdtrit  # half a second, where nothing else of an analysis loads it

    fit = belief.fit
    if fit is None or part not in fit.names:
        return False
    return abs(belief.values[part]) > float(stdtrit(fit.freedom, 1 - CHANCE / 2)) * fit.sd(part)


def _richer(simple: Belief, stated: Belief, mapped: Map) -> Belief:
    """With the parts that leave the least of the displacement, where that is less than chance would leave.

    A contact without them, all constants as `stated`, is led along beside them with what may be off by more: x late by
    1 % of a cycle has looked like 8 times the static friction. What that leaves is known of the laws after it.
    """
    record = simple.record
    laws = _search(_candidates(simple), record, mapped, contained=simple)
    static = sorted(mapped(partial(_refined_on, record=record), _with_static(simple)), key=misfit)
    laws += _distinct(static)
    # their chances say nothing of each other: each counts as many independent samples as its own residual has
    best = _simplest([law for law in laws if _p_value(simple, law) < CHANCE] or [simple])
    slips = _slips_beside(best, stated, mapped) if {EXCESS, GIVE} & best.values.keys() else []
    if GIVE in (give := best).values:
        damped = [replace(law, held="") for law in _search(_damped_candidates(give), record, mapped)]
        laws += _distinct(sorted(mapped(partial(_refined_on, record=record), damped), key=misfit))
        best = _simplest([law for law in laws if GIVE in law.values])
        laws += _search(_softer_candidates(give), record, mapped, best=min([best, *slips], key=misfit))
        best = _simplest([law for law in laws if {GIVE, RATE} & law.values.keys()])
    known = min([best, *slips], key=misfit)
    if SPEED in best.values:
        laws += _search(_stribeck_candidates(best), record, mapped, best=known)
    elif GIVE in best.values:
        laws += _search(_falling_candidates(best), record, mapped, best=known)
    nearest = min(laws, key=misfit)
    if nearest.held and not _as_likely(best, nearest):  # the search had ended in another valley than the nearest one
        laws.append(best := _refined_on(replace(nearest, held=""), record))
    return replace(best, rivals=(*(law for law in laws if law is not best and _as_likely(law, best)), *slips))


def _slips_beside(best: Belief, stated: Belief, mapped: Map) -> list[Belief]:
    """A contact without richer parts and one constant off, or the clock of x; where that does not do, several."""
    begun = [_with_slip(stated, name) for name in SLIPS]
    slips = [law for law in mapped(partial(_descended_beside, beside=best), begun) if law is not None]
    nearest = min([best, *slips], key=misfit)
    if any(_as_likely(slip, nearest) for slip in slips):
        return slips
    several = _descended_beside(_with_slip(stated, *SEVERAL), best)
    if several is None or any(abs(math.expm1(several.values[name])) > CALIBRATED for name in (GAIN, SPRING)):
        return slips
    return [*slips, _without_chance(several, *SEVERAL)]


def _with_slips(belief: Belief, mapped: Map) -> Belief:
    """The same beside what no law explains: a constant, or the clock of x, or several, off by more than was stated.

    Where x asks for it, it is a rival; where it leaves so much less that nothing else will do, it is believed in.
    """
    slips = [law for law in belief.rivals if law.slipped]
    # beside one slip that explains x by itself, what a law that does not would leave with it is not asked
    more = explains(belief) or not any(explains(law) for law in slips if len(law.slipped) == 1)
    asked = [_with_slip(belief, name) for name in SLIPS if more and _score_favours(belief, name)]
    refine = partial(_refined_on, record=belief.record)
    ends = list(mapped(refine, asked))
    # a static friction that was not seen for the slip, or has been taken for a curve
    rigid = [end for end in ends if SPEED in end.values or (EXCESS not in end.values and not explains(end))]
    ends += mapped(refine, [_static_of(end) for end in rigid if GIVE not in end.values])
    slips, rivals = [*ends, *slips], [*belief.rivals, *ends]
    nearest = _simplest([belief, *slips])
    freedom = 0.0 if nearest.fit is None else nearest.fit.freedom
    # x tells a spring that is off from a mass that is by rounding alone: the first of those that are as near
    alike = [law for law in [belief, *slips] if len(law.values) == len(nearest.values)]
    nearest = next(law for law in alike if freedom * math.log(misfit(law) / misfit(nearest)) <= SETTLED)
    best = nearest if freedom * math.log(misfit(belief) / misfit(nearest)) > CERTAIN else belief
    return replace(best, rivals=tuple(law for law in rivals if law is not best and _as_likely(law, best)))


def _static_of(belief: Belief) -> Belief:
    """The same with a static friction of a rigid contact, and no curve."""
    start = {EXCESS: STATIC * belief.kinetic, SLOPE: 0.0, **belief.values}
    return replace(belief, values={name: value for name, value in start.items() if name not in (SPEED, POWER)})


def _with_slip(belief: Belief, *names: str) -> Belief:
    """The same with constants, or the clock of x, off by as much as x asks for."""
    unsure = {other: sd for other, sd in belief.unsure.items() if other not in names}
    values = {KINETIC: belief.values.get(KINETIC, 0.0), **dict.fromkeys(names, 0.0)}
    return replace(belief.at(**values), unsure=unsure)


def _score_favours(belief: Belief, name: str) -> bool:
    """Whether x would be nearer with that constant off, than chance brings it (a score test)."""
    fit = belief.fit
    if name in belief.unsure or fit is None:
        return False
    column = levelled(slope_of(belief.at(**{name: 0.0}), name))
    column -= fit.jacobian @ (fit.gain @ column)
    return float(column @ belief.residual) ** 2 > SLIPPED * float(column @ column) * fit.weight


def _search(
    families: list[list[Belief]],
    record: Record,
    mapped: Map,
    *,
    contained: Belief | None = None,
    best: Belief | None = None,
) -> list[Belief]:
    """The nearest of each family and others as near, over the whole record where its beginning allows them.

    Beside a law that all families contain, and the best that is known.
    """
    horizons = [record.rows(0, samples) for samples in _horizons(record)]
    # what a process is sent is short: with the whole record and its slopes 200 starts were 3 GB
    families = [[replace(begun, record=horizons[0], fit=None) for begun in family] for family in families]
    families = _advanced(families, _evaluated, mapped)
    families = _advanced([family[:STARTS] for family in families], partial(_descended, passes=1), mapped)
    families = [family[: 1 if family[0].held else KEPT] for family in families]
    for beginning in horizons:  # starts that have come to one valley go on as one
        step = partial(_descended_on, record=beginning)
        families = [_distinct(family) for family in _advanced(families, step, mapped)]
        known = (law and replace(law, record=beginning, fit=None) for law in (contained, best))
        if not (families := _promising(families, *known)):
            return []
    families = _advanced(families, _with_slope, mapped)
    nearest = [law for family in families for law in _minima(family)]
    least: float = min(misfit(law) for law in nearest)
    return list(mapped(partial(_refined_on, record=record), [law for law in nearest if misfit(law) <= FAR * least]))


def _advanced(families: list[list[Belief]], step: Callable[[Belief], Belief], mapped: Map) -> list[list[Belief]]:
    """All families a step further, each with its nearest first; in one round, so that no process waits for another."""
    moved = iter(mapped(step, [begun for family in families for begun in family]))
    return [sorted(itertools.islice(moved, len(family)), key=misfit) for family in families]


def _promising(families: list[list[Belief]], contained: Belief | None, best: Belief | None) -> list[list[Belief]]:
    """Those that may still come to something.

    What leaves no less than the law that all of them contain, where one is certain to, is on its way back to that law:
    on a rigid contact a stiffness goes on rising, for half of a search. What leaves far more than another that explains
    x is of the wrong kind.
    """
    nearest = min((family[0] for family in families), key=misfit)
    limits = [FAR * misfit(law) for law in (nearest, best) if law is not None and explains(law)]
    if contained is not None and nearest.fit is not None and math.isfinite(misfit(nearest)):
        gained = nearest.fit.freedom * math.log(misfit(contained) / misfit(nearest))
        limits += [misfit(contained)] if gained > CERTAIN else []
    kept = ([law for law in family if misfit(law) <= min(limits, default=math.inf)] for family in families)
    return [family for family in kept if family]


def _evaluated(begun: Belief) -> Belief:
    """The same, with what it leaves of its record."""
    misfit(begun)
    return begun


def _descended_on(begun: Belief, record: Record) -> Belief:
    """The nearest over so much of a record."""
    return _descended(replace(begun, record=record), STEPS)


def _with_slope(led: Belief) -> Belief:
    """With a slope against speed, where it was led without."""
    return led if SLOPE in led.values else _descended(led.at(**{SLOPE: 0.0}), STEPS)


def _distinct(family: list[Belief]) -> list[Belief]:
    """One of each end to which the searches of a family have come, the nearest first."""
    apart: list[Belief] = []
    for belief in family:
        if not any(_same_minimum(belief, other) for other in apart):
            apart.append(belief)
    return apart


def _minima(family: list[Belief]) -> list[Belief]:
    """Of one family's ends the nearest, and others as near."""
    best, *others = family
    return [best, *(other for other in others if _as_likely(other, best) and not _same_minimum(other, best))]


def _descended_beside(begun: Belief, beside: Belief) -> Belief | None:
    """The nearest over the whole record; None once it is left behind by another law."""
    for samples in _horizons(beside.record):
        record = beside.record.rows(0, samples)
        begun = _descended_on(begun, record)
        if misfit(begun) > FAR * misfit(replace(beside, record=record)):
            return None
    return _refined_on(begun, beside.record)


def _simplest(laws: list[Belief]) -> Belief:
    """The law that leaves the least, where each value that it has more spares what chance would."""
    nearest = min(laws, key=misfit)
    freedom = nearest.fit.freedom if nearest.fit is not None else 1.0
    return min(laws, key=lambda law: freedom * math.log(misfit(law)) + CLOSE * len(law.values))


def _as_likely(law: Belief, best: Belief) -> bool:
    """Whether a law leaves no more than chance would, were it the one that wrote the record."""
    return best.fit is not None and best.fit.freedom * math.log(misfit(law) / misfit(best)) < CLOSE


def _same_minimum(one: Belief, other: Belief) -> bool:
    """Whether two searches have come to the same end."""
    parts = one.values.keys() - one.unsure.keys()
    return all(abs(one.values[part] - other.values[part]) < SAME * one.size(part) for part in parts)


def _refined_on(begun: Belief, record: Record) -> Belief:
    """The nearest over a whole record."""
    begun = replace(begun, record=record)
    try:
        return refined(begun)
    except StickslipError:
        return begun


def _horizons(record: Record) -> list[int]:
    """Samples over which a belief is led to a record: ever more cycles, up to its whole beginning."""
    signs = np.sign(record["v"][np.abs(record["v"]) > SLIDES * float(np.max(np.abs(record["v"])))])
    cycle = 2 * len(record) / max(1, int(np.count_nonzero(np.diff(signs))))
    end = min(len(record), SEARCHED)
    return [*(round(cycles * cycle) for cycles in HORIZONS if LEAST <= cycles * cycle < end), end]


def _descended_along(begun: Belief, horizons: list[Record]) -> Belief:
    """The nearest over a few samples, then over more: far ahead, a belief that is not near yet loses its way."""
    for record in horizons:
        begun = _descended_on(begun, record)
    return begun


def _descended(begun: Belief, passes: int) -> Belief:
    """Nearer, by so many passes; as it was of a law that can not be followed."""
    try:
        return descended(begun, passes, roughly=True)[0]
    except StickslipError:
        return begun


def _candidates(simple: Belief) -> list[list[Belief]]:
    """Beginnings of the richer laws, of each a grid, with the constants as stated: a wrong law strains them."""
    record, simple = simple.record, simple.as_stated()
    furthest, fastest = (float(np.max(np.abs(record[name]))) for name in "xv")
    # a slope is what static friction, and dry friction through a spring, look like to a fit without them
    level = float(np.mean(np.abs(record["friction"])[np.abs(record["v"]) > SLIDES * fastest]))
    levels = [share * level for share in LEVELS]
    levels += [simple.values[KINETIC]] if KINETIC in simple.values else []
    static = [{KINETIC: level, EXCESS: excess * level, SLOPE: 0.0} for level in levels for excess in EXCESSES]
    give = [
        {KINETIC: level, GIVE: math.log(level / (share * furthest)), BENT: 0.0, SLOPE: 0.0}
        for share in DEFLECTIONS
        for level in levels
    ]
    falls = [
        {**start, SPEED: math.log(share * fastest), POWER: power}
        for share in SPEEDS
        for power in (0.0, 0.7)
        for start in static
    ]
    rigid, compliant, falling = ([simple.at(**start) for start in starts] for starts in (static, give, falls))
    return [rigid, compliant, [begun.without(SLOPE) for begun in falling]]  # beside it a slope would lead astray


def _with_static(simple: Belief) -> list[Belief]:
    """The linear law where it ended, with more and more static friction: over the whole record, constants as found.

    Of a record that begins at rest, and breaks away once, the grid above was led over its beginning to no static
    friction, a thousand of chi-squared behind this (static 1.27 times the sliding one, constants half a per cent off).
    """
    kinetic = simple.values.get(KINETIC, 0.0)
    level = {SLOPE: simple.slope, KINETIC: kinetic}
    return [simple.at(**{**level, EXCESS: excess * kinetic}) for excess in EXCESSES if kinetic > 0]


def _damped_candidates(give: Belief) -> list[list[Belief]]:
    """Beginnings of a contact that has a damping, too.

    First beside a stiffness that suits it: moved at once, it was led back to none, a stiffness 25 % too large.
    """
    return [[replace(give.as_stated().at(**{LOSS: loss}), held=LOSS)] for loss in LOSSES]


def _softer_candidates(give: Belief) -> list[list[Belief]]:
    """Beginnings of what else may look like a contact that gives way: bristles, or a friction that lags."""
    furthest, fastest = (float(np.max(np.abs(give.record[name]))) for name in "xv")
    bristles = [begun for excess in EXCESSES[1:4] for begun in _bristles(give, excess)]
    # led from no damping, bristles 30 to 360 % too stiff passed for noise: four rigs of an independent integrator
    damped = [
        [begun.at(**{LOSS: loss, GIVE: begun.values[GIVE] - math.log(softer)}) for begun in bristles]
        for loss, softer in DAMPED
    ]
    # x may tell bristles from a spring, and nothing of how their friction falls
    level = [_slid(give).at(**{KINETIC: part * give.values[KINETIC]}) for part in LEVELS]
    rates = [math.log(rate * fastest / furthest) for rate in RATES]
    lags = [_slid(give).without(GIVE).at(**{RATE: rate}) for rate in rates]
    return [level, bristles, *damped, lags]


def _falling_candidates(give: Belief) -> list[list[Belief]]:
    """The same as bristles whose friction falls by so much: x hardly tells it, but their stiffness follows from it."""
    speeds = SPEEDS[1:3]  # from beyond these the search of one rig ended where friction hardly falls (seed 281129)
    return [[replace(begun, held=EXCESS) for begun in _bristles(give, excess, speeds)] for excess in EXCESSES[2:]]


def _slid(give: Belief) -> Belief:
    """The same in a record that begins as it slides."""
    sliding = give.as_stated().without(SLOPE).without(BENT)
    sliding = sliding if HELD in give.values else sliding.without(LOSS)  # a spring's and not bristles'
    return sliding.at(**{HELD: float(np.sign(give.record["v"][0]))})


def _bristles(give: Belief, excess: float, speeds: tuple[float, ...] = SPEEDS) -> list[Belief]:
    """Beginnings with so much more static friction, that falls at ever higher speeds."""
    fastest = float(np.max(np.abs(give.record["v"])))
    levels = [part * give.values[KINETIC] for part in LEVELS]
    return [
        _slid(give).at(**{KINETIC: level, EXCESS: excess * level, SPEED: math.log(share * fastest)})
        for level in levels
        for share in speeds
    ]


def _stribeck_candidates(best: Belief) -> list[list[Belief]]:
    """The same with more and with less static friction: where it falls at small speeds, x may not tell how far."""
    excess = max(best.values[EXCESS], EXCESSES[1] * best.values[KINETIC])
    return [[replace(best.at(**{EXCESS: part * excess}), held=EXCESS)] for part in STRETCHES]


def _p_value(simple: Belief, richer: Belief) -> float:
    """Probability that the richer law leaves so much less by chance alone, for as many laws as are tried."""
    from scipy.special import fdtrc  # as above

    less, more = simple.fit, richer.fit
    if less is None or more is None:  # a law that could not be followed explains nothing
        return 1.0
    added = len(more.names) - len(less.names)
    gained = misfit(simple) / misfit(richer) - 1
    if added < 1 or gained <= 0:
        return 1.0
    return min(1.0, LAWS * float(fdtrc(added, more.freedom, gained * more.freedom / added)))


def _unsure(record: Record, drive: DriveFrom) -> dict[str, float]:
    """Standard deviation of each constant that may be off: as stated, and as the drive was measured."""
    rig, gains, moves = record.rig, {name: record.channels[name].gain_sd for name in record}, driving(record)
    assert rig is not None
    stated = {MASS: ("mass", rig.mass), SPRING: ("stiffness", rig.stiffness), DAMPER: ("damping", 1.0)}
    unsure = {part: rig.sd[name] / scale for part, (name, scale) in stated.items() if rig.sd.get(name) and scale}
    if gains["x"]:
        unsure[GAIN] = gains["x"]
    drives = dict(zip(DRIVE, drive.unsure, strict=False))
    if moves and gains[moves] and drives:  # the first way in which a drive may be off is its size
        drives[DRIVE[0]] = math.hypot(drives[DRIVE[0]], gains[moves])
    return {**unsure, **drives}


def _sliding(record: Record, contact: str) -> dict[str, float]:
    """Dry friction and slope against speed while it slides."""
    velocity = record["v"]
    if contact == "base" and "z" in record:
        velocity = velocity - np.gradient(record["z"]) * record.fs
    slides = np.abs(velocity) > SLIDES * float(np.max(np.abs(velocity)))
    columns = np.column_stack([np.sign(velocity), velocity, np.ones(len(velocity))])[slides]
    kinetic, slope, _ = least_squares(columns, record["friction"][slides]).coefficients
    return {KINETIC: max(0.0, float(kinetic)), SLOPE: float(slope)}


def _sensors(record: Record) -> list[Sensor]:
    """Sensors with the noise, counts, range, mount and delay of the record's own."""
    sensors = []
    for name in SENSED:
        if name in record and is_measured(record, name):
            channel, values = record.channels[name], record[name]
            step = quantisation_step(values)
            limit = float(np.max(np.abs(values))) if saturated(values).any() else np.inf
            mount = None if channel.mount is None else Mount(*channel.mount, mass=channel.inertia)
            level = noise_level(values, record.fs)  # counts are in what is measured, and not in what is stated
            white = math.sqrt(max(level**2 - step**2 / 12, 0.0)) if channel.noise is None else channel.noise
            discharge = np.inf if channel.discharge is None else channel.discharge
            digitiser = Digitiser(step=step, limit=limit)
            sensors.append(
                Sensor(
                    name, lag=channel.delay, mount=mount, discharge=discharge, noise=Noise(white), digitiser=digitiser
                )
            )
    return sensors


def _with_measured_noise(belief: Belief) -> Belief:
    """The same, the noise of x and of its drive as what is left of them beside the harmonics: slow, or with a hum.

    A law or a constant that is wrong leaves what repeats with each cycle of a steady motion, and so nothing there.
    Of a motion that is not steady the noise stays white.
    """
    if not isinstance(belief.drive, Tones):
        return belief
    beside = partial(density_beside, fs=belief.record.fs, frequency=belief.drive.tones[0][1])
    moved = levelled(belief.moved)
    own = beside(moved, white=0.0)
    if own is None or own[1] * float(own[0].sum()) > STEADY**2 * float(moved.var()):
        return belief
    rig = belief.rig
    left = {"x": belief.residual, driving(belief.record): belief.drive.beside}
    for sensor in rig.sensors:
        if sensor.channel in left:
            counts = sensor.digitiser.step**2 / 12  # which its twins have of their own
            noise = beside(left[sensor.channel], white=math.sqrt(sensor.noise.white**2 + counts))
            assert noise is not None
            density, spacing = np.maximum(noise[0] - 2 * counts / belief.record.fs, 0.0), noise[1]
            measured = MeasuredNoise(sensor.noise.white, density=density, spacing=spacing)
            rig = rig.having(sensor.channel, noise=measured)
    return replace(belief, rig=rig)
