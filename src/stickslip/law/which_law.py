"""One friction law fitted to records, the exact engine in the loop; several, and what the records say of each."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import Doubt, Estimate
from stickslip.law.law import LawFit, answered, explained, keyed, remainders, surety, teller, valued
from stickslip.law.search import Knob, Point, Problem, Profile, descend, rows_of
from stickslip.law.start import (
    CALIBRATION,
    EXPONENT,
    Shown,
    best_start,
    better_start,
    bounded,
    free_names,
    knob,
    nuisance_knobs,
    require_apart,
    seen_damping,
    seen_profile,
    thinned_out,
    too_few,
    usual_nuisance,
    value_of,
    with_own_gains,
)
from stickslip.law.stretch import Stretch, channels_of
from stickslip.law.trials import (
    LOOK,
    PASSES,
    Search,
    Seen,
    Trial,
    evidence_of,
    like,
    seen_by,
    squares,
    unexplained,
    weighed,
    with_static,
)
from stickslip.law.verdict import (
    CALIBRATIONS,
    SUPPORTED,
    Candidate,
    LawComparison,
    Misfit,
    Remainder,
    Standing,
    concluded,
    damper_found,
    doubt_of,
    standings,
    undescribed,
    unexplained_part,
)
from stickslip.laws.guessing import Hypothesis, contained, hypotheses, hypothesis_of
from stickslip.laws.surfaces import RoughSurface
from stickslip.oscillator import Oscillator
from stickslip.record.record import Record, require_record
from stickslip.units import dimensions

STIFFEST = 1e-5  # of the stroke: what a contact gives way at least
UNEVEN = 0.1  # of its mean, that a surface strays
WORK = 24.0  # calls of progress after which most of a fit is taken to be done
CALLS = 40.0  # of progress that the trial of a law is taken for
BEYOND = 9.0  # times the noise, squared, that a law leaves whose misfit is no chance: pairs leave 1, rough surfaces 100
# times as wide as chance, by unit: so 95 % of intervals held on the first 39 rigs of `benchmarks/servo_laws.py --first
# 6000`, of a contact's damping on the first 59
STRAY, STRAYS = 1.25, {"N s/m": 2.5, "m/s": 4.0, "s/m": 4.0}
# the same with a sensor of force, where the law leaves more than noise: 33 of 44 intervals held on rough surfaces, and
# 42 so, on the 18 sets of `benchmarks/laws.py --draws 3 --first 70000`
ROUGHER = 1.5


def fit_law(
    record: Record | Sequence[Record],
    oscillator: Oscillator,
    *,
    free: Sequence[str] | None = None,
    nuisance: Sequence[str] | None = None,
    channels: Sequence[str] | None = None,
    law: Any = None,
    intervals: bool = True,
    progress: Callable[[float], object] | None = None,
) -> LawFit:
    r"""Which parameters of a friction law explain what the sensors read?

    The oscillator is simulated exactly, its motion passed through the sensors as their channels state them (delay,
    mount, inertia, discharge), and the parameters p are those for which

    .. math:: \chi^2(p) = \sum_{c, t} \left(\frac{y_c(t) - \hat y_c(t; p)}{\sigma_c}\right)^2

    is least over channels c and instants t, sigma the noise; what may jump is not asked in the sampling interval
    before and after an event. Each record's displacement, velocity and memory at its first slide are fitted with them,
    as are an offset of each channel and what its mount still rings with. Static friction, Stribeck speed, contact
    stiffness and rate, in which chi squared has several valleys, are tried at values spread over their range before the
    descent. The intervals are the sandwich's, which hold when what is left is correlated; where a parameter is hardly
    seen they are the likelihood's, and may be open to one side.

    Parameters
    ----------
    record : Record or sequence of Record
        With x or v, and what else was measured: a, load, friction. The base's motion z drives the oscillator where it
        was measured, or a periodic force; otherwise the oscillator's own drive does, from the first sample on.
    oscillator : Oscillator
        Mass, spring and damper; the law with values to start from.
    free : sequence of str, optional
        Parameters to fit, as :meth:`Oscillator.having` names them; all the law's that are not zero where left out.
        Empty: only the starts are fitted, to predict another record.
    nuisance : sequence of str, optional
        What else is not known well: "mass", "stiffness", "damping", a sensor's "x.gain" or "x.delay", its mount's
        "a.frequency" or "a.damping". Where left out: the damper, which may be anything from zero on, the spring and all
        gains, of several records the base's too, which are trusted to 0.5 %, the delays of x and z, to 50 us, and the
        mounts that are stated, to 1 % of their frequency and 10 % of their damping ratio; with nothing free, nothing.
        The intervals then are no narrower than 0.5 % of the base's gain or the applied force's leave them, and, where
        no sensor feels the force, of the mass. Empty: all is as stated.
    channels : sequence of str, optional
        Channels to explain; all that were measured where left out.
    law : str, type or law, optional
        The law to fit: its name, its class, or an instance with the values to start from; the oscillator's own where
        left out. The class ``RoughSurface``: the oscillator's own on a surface whose friction is not the same
        everywhere: its forces are multiplied by a profile along the surface, which is fitted too; it is Coulomb's or
        the CompliantContact, and its sliding friction the mean of the profile, as sure as that mean is for another part
        of the surface.
    intervals : bool
        Whether to ask how sure the parameters are; without, the fit is quicker.
    progress : callable, optional
        Called with the share of the work that is done, 0 to 1.

    Returns
    -------
    LawFit

    Raises
    ------
    RecordError
        A channel is missing or broken.
    EstimateError
        No motion above the noise, no sliding, or sliding at one speed alone.
    ModelError
        A law that is not known or whose start can not be guessed; a parameter that the oscillator does not have, or is
        named twice; a channel that is not fitted.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(
    ...     mass=2.42, stiffness=2310, law=ss.laws.Coulomb(1.1), drive=ss.drives.HarmonicBase(1.1e-3, frequency=8.7)
    ... )
    >>> rig = ss.Rig.perfect("x", "z").having("x", white=1e-6)
    >>> record = rig.measure(ss.simulate(slider, cycles=20), fs=2000, rng=1)
    >>> fit = fit_law(record.rows(2000, len(record)), slider.having(kinetic=1.0))
    >>> bool(abs(fit.law.kinetic / 1.1 - 1) < 0.01)
    True
    """
    require_record(record)
    records = [record] if isinstance(record, Record) else list(record)
    if not records:
        raise EstimateError("no record", "a law is fitted to one record at least", "give one")
    tell = teller(progress, WORK)
    shown = [Shown.of(one, channels_of(one, channels), oscillator) for one in records]
    rough = law is RoughSurface
    begun = _begun(None if rough else law, oscillator, records)
    names = free_names(begun[0], free)
    stated, own_gains = nuisance is not None or not intervals, nuisance is None and bool(names)
    if nuisance is None:
        nuisance = usual_nuisance(begun[0], names, shown) if names else ()
    require_apart(begun[0], names, nuisance, shown)
    if isinstance(law, str | type) and EXPONENT not in (*names, *nuisance):
        nuisance = (*nuisance, EXPONENT)

    def searched(shown: Sequence[Shown]) -> tuple[Problem, Point]:
        stretches = [_sliding_stretch(motion, number) for number, motion in enumerate(shown)]
        start = better_start(begun[0], names, shown)
        if names:
            seen = [seen_damping(oscillator, shown).damping] if "damping" in nuisance else []
            start = best_start([start, *begun[1:]], names, stretches, [oscillator.damping, *seen], tell)
        profile = seen_profile(shown, value_of(start, "kinetic")) if rough else None
        problem = _posed(start, names, nuisance, stretches, profile)
        point = _descended(problem, tell)
        if free is None and not rough and not _explains(problem, point):
            guessed = isinstance(law, str | type)
            return _from_simpler(problem, point, records, shown, guessed=guessed, tell=tell)
        return problem, point

    problem, point = searched(with_own_gains(shown, CALIBRATION) if own_gains else shown)
    if _astray(problem, point):
        problem, point = searched(shown)
    sure = surety(problem, point, tell) if intervals else None
    if progress:
        progress(1.0)
    fit = answered(problem, point, sure, shown)
    fit = fit.doubted(*remainders(fit.status))
    return fit if stated else _calibrated(fit, records, CALIBRATION)


def _begun(law: Any, oscillator: Oscillator, records: Sequence[Record]) -> list[Oscillator]:
    """The oscillator with the law's values where the search begins: as given, or as the friction suggests them."""
    if law is None:
        return [oscillator]
    kind = hypothesis_of(law)
    guesses = kind.guesses(Seen.of(records, oscillator)) if isinstance(law, str | type) else [law]
    return [replace(oscillator, law=guess) for guess in guesses]


def _posed(
    oscillator: Oscillator,
    names: Sequence[str],
    nuisance: Sequence[str],
    stretches: Sequence[Stretch],
    profile: Profile | None = None,
) -> Problem:
    """What is turned, from the oscillator's values; on a rough surface its profile in place of its level."""
    names = [name for name in names if profile is None or name != "kinetic"]
    knobs = [bounded(knob(oscillator, name), oscillator, stretches, STIFFEST) for name in names]
    knobs += nuisance_knobs(oscillator, nuisance, stretches)
    heights = enumerate(profile.values if profile else ())
    knobs += [Knob(f"profile {j}", "profile", height, 0.01, prior=UNEVEN / 0.01) for j, height in heights]
    return Problem.of(oscillator, stretches, knobs, profile)


def _explains(problem: Problem, point: Point) -> bool:
    """Whether no channel is left with more than noise."""
    return explained(
        math.sqrt(float(np.mean(values[rows] ** 2)))
        for stretch, values in zip(problem.stretches, point.residuals, strict=True)
        for rows in rows_of(stretch.sensors)
    )


def _from_simpler(
    problem: Problem,
    point: Point,
    records: Sequence[Record],
    shown: Sequence[Shown],
    *,
    guessed: bool,
    tell: Callable[[], None],
) -> tuple[Problem, Point]:
    """Where a search ends that begins at those of the simpler laws which the law contains, where that is lower.

    A law next to rigid, or with a curve that is next to none, has valleys of its own: a compliant contact left 6 times
    the noise of a record of another compliant contact, bristles 32 times that of a rigid one, which they contain. Where
    the search began at values that were given, the ones that the friction suggests are tried as well.
    """
    asked = problem.oscillator
    kind = hypothesis_of(asked.law)
    simpler = contained(kind)
    if not simpler:
        return problem, point
    inner = [one for name, one in hypotheses().items() if name in simpler]
    nuisance = [turned.name for turned in problem.knobs if turned.name not in free_names(asked, None)]
    nuisance = list(dict.fromkeys(nuisance))
    stated = [asked, *([seen_damping(asked, shown)] if "damping" in nuisance else [])]
    own = [] if guessed else [kind]
    search = Search([(one, []) for one in (*inner, *own)], seen_by(records, stated), nuisance, CALIBRATION, tell)
    trials = search.tried(shown, None, PASSES, {})
    trial = search.no_worse(kind, [], None, trials, PASSES) if guessed else trials.get(kind.name)
    law = None if trial is None else like(asked, trial.law)
    if trial is None or law is None:
        return problem, point
    system = replace(trial.system, law=law)
    other = _posed(system, free_names(system, None), nuisance, problem.stretches)
    end = descend(other, other.begin(np.zeros(len(other.knobs))), tell=tell)
    return (other, end) if end.chi2 < point.chi2 else (problem, point)


def _sliding_stretch(motion: Shown, number: int) -> Stretch:
    """A record from its first fast sliding to its end."""
    motion.require_sliding()
    return motion.stretch(number, (int(motion.slides()[0]), len(motion.record) - 1))


def _descended(problem: Problem, tell: Callable[[], None]) -> Point:
    """Where the search ends; that of a rough surface begins where one by a part of the readings ends."""
    point = problem.begin(np.zeros(len(problem.knobs)))
    if problem.profile:
        few = thinned_out(problem)
        first = descend(few, few.begin(point.u), tell=tell)
        states = zip(first.starts, point.starts, strict=True)
        point = problem.at(first.u, tuple(np.append(a, b[len(a) :]) for a, b in states))
    point = descend(problem, point, tell=tell)
    if not math.isfinite(point.chi2):
        raise EstimateError(
            f"{problem.oscillator.law!r} can not be simulated along this record",
            "the search starts from a motion that exists",
            "start from other values of the law",
        )
    return point


def compare_laws(
    record: Record | Sequence[Record],
    oscillator: Oscillator,
    *,
    laws: Sequence[Any] | None = None,
    nuisance: Sequence[str] | None = None,
    calibration: float = CALIBRATION,
    progress: Callable[[float], object] | None = None,
) -> LawComparison:
    r"""Which friction law is it?

    Each law is fitted to all records, the exact engine in the loop, from starts that the friction tells without any
    law and from the ends of the simpler laws' searches. A law's misfit is the mean square of what it leaves over the
    least that any law leaves, each channel by its own measure: the error of the model is larger than the noise, and its
    variance is what the best law leaves. The laws are ranked by Schwarz's criterion with that variance,

    .. math:: \sum_c n_c \log S_c + p \log \sum_c n_c

    S_c the mean square left of channel c, n_c the number of samples that tell a story of their own, p the number of
    parameters; how far springs, gains and delays had to move is added in units of how unsure they are. The odds between
    two families are exp(-C/4) where their best laws' criteria differ by C (the exponent would be C/2, did what laws
    leave over come of chance alone); another family is rejected where they are below 1 in 20. Rigid laws are told apart
    by the friction around rest, and an effect within three times the calibration's error is not told from it.

    Parameters
    ----------
    record : Record or sequence of Record
        As :func:`fit_law` takes them; several excitations tell laws apart that one does not.
    oscillator : Oscillator
        Mass, spring, damper, and the drive where the base's motion z was not measured. Its own law does not matter.
    laws : sequence, optional
        Names ("Coulomb", "static", "Stribeck", "compliant", "state variable", "LuGre", or of any class of
        :mod:`stickslip.laws`), classes, or laws with the values to start from. The first six where left out. A law that
        has no `hypotheses` of its own is begun at values of the size of what was seen, by its parameters' units.
    nuisance : sequence of str, optional
        What is fitted beside each law, as :func:`fit_law` takes it, and chooses it where left out.
    calibration : float
        By what part gains and the spring may be wrong, one standard deviation.
    progress : callable, optional
        Called with the share of the work that is done, 0 to 1; an exception from it, as Ctrl-C, ends the comparison.

    Returns
    -------
    LawComparison

    Raises
    ------
    EstimateError
        The records can not tell of a law: no sliding, no reversal, noise above the signal.
    ModelError
        A law that is not known, or none; a nuisance of no channel that is fitted, or of the drive.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(
    ...     mass=2.42, stiffness=2310, law=ss.laws.Coulomb(1.1), drive=ss.drives.HarmonicBase(1.1e-3, frequency=8.7)
    ... )
    >>> rig = ss.Rig.perfect("x", "z", "load").having("x", white=1e-6).having("load", white=2e-3)
    >>> record = rig.measure(ss.simulate(slider, cycles=12), fs=1000, rng=1, start=0.7)
    >>> compare_laws(record, slider, laws=["Coulomb", "compliant"]).family
    'rigid'
    """
    require_record(record)
    records = [record] if isinstance(record, Record) else list(record)
    if not records:
        raise EstimateError("no record", "laws are compared by one record at least", "give one")
    if not 0 < calibration < 1:
        raise ModelError(
            f"calibration = {calibration}", "it is a part of 1 above zero, as 0.01 for 1 %", "correct calibration="
        )
    kinds = _kinds(laws)
    shown = [Shown.of(one, channels_of(one, None), oscillator) for one in records]
    for motion in shown:
        motion.require_sliding()
    require_apart(oscillator, (), nuisance or (), shown)
    known = tuple(nuisance) if nuisance is not None else usual_nuisance(oscillator, (), shown)
    shown = with_own_gains(shown, calibration) if nuisance is None else shown
    systems = [oscillator, *([seen_damping(oscillator, shown)] if "damping" in known else [])]
    search = _Search(
        kinds, seen_by(records, systems), (*known, EXPONENT), calibration, teller(progress, CALLS * len(kinds))
    )
    trials, looked = search.trials(shown)
    rests = search.seen[-1][1].rests  # of the balance with the likelier damper
    misfits = [
        Misfit(trial.name, trial.count, squares(trial.left), trial.stiff, trial.moved) for trial in trials.values()
    ]
    evidence = evidence_of(min(trials.values(), key=lambda trial: trial.point.chi2), looked.shown)
    ranking, confidence = standings(
        misfits, evidence, likely=rests.probabilities(calibration, CALIBRATIONS * calibration)
    )
    best = trials[ranking[0].name]
    fit = search.fitted(best, looked.shown, rests.fall)
    supported = evidence.supported if Remainder.of_fit(fit).explained else SUPPORTED
    doubt, confidence = doubt_of(fit, oscillator, calibration), min(confidence, supported)
    if doubt:
        ranking, confidence = undescribed(ranking), 0.0
    unexplained_ = unexplained_part(fit)
    fit = fit.doubted(doubt or unexplained_)
    rigid = _excess(fit) if best.name == "Stribeck" and fit.parameters["speed"].interval[0] > 0 else rests.fall
    if not doubt:
        fit = _whichever(fit, [trials[one.name] for one in ranking[1:] if one.kept])
    fit = _widened(_calibrated(fit, records, calibration), records)
    if progress:
        progress(1.0)
    candidates = tuple(_candidate(one, trials[one.name], fit, first=one is ranking[0]) for one in ranking)
    if not doubt:
        candidates = tuple(one.worded(fit, first=one is candidates[0]) for one in candidates)
    worries: list[Doubt | str] = [*looked.worries]
    worries += [too_few(looked.shown, best.count), unexplained_]
    answer = concluded(candidates, confidence, fit, rigid, calibration, records, doubt, worries)
    damper = () if doubt else damper_found(fit, oscillator.damping)
    return replace(answer, verdict=" ".join([answer.verdict, *damper]))


class _Looked(NamedTuple):
    """The records after a first look, as they are compared."""

    shown: Sequence[Shown]
    worries: tuple[str, ...]


class _Search(Search):
    """Laws searched, the likeliest looked at more closely and fitted."""

    def trials(self, shown: Sequence[Shown]) -> tuple[dict[str, Trial], _Looked]:
        """Every law at the end of its search; a first look tells which channels count, and how much."""
        rough, looked, evidence = self.tried(shown, None, LOOK, {}), _Looked(shown, ()), None
        if rough:
            nearest = min(rough.values(), key=lambda trial: trial.point.chi2)
            silent = unexplained(nearest, shown)
            counted = [replace(one, channels=tuple(n for n in one.channels if n not in silent)) for one in shown]
            worries = tuple(
                f"{name} is left out: the best law leaves {100 * share:.0f} % of it, and no mount or delay of its "
                "sensor is stated"
                for name, share in silent.items()
            )
            looked = _Looked(counted, worries)
            evidence = evidence_of(nearest, looked.shown)
        trials = self.tried(looked.shown, evidence, PASSES, {} if looked.worries else rough)
        if not trials:
            raise EstimateError(
                "no law can be simulated along these records",
                "a search starts from a motion that exists",
                "check mass= and stiffness=, or give laws with their values",
            )
        return trials, looked

    def fitted(self, best: Trial, shown: Sequence[Shown], rigid: Estimate | None) -> LawFit:
        """The best law's fit to all readings, with the static friction that the releases tell."""
        best = best if best.name != "static" or rigid is None else with_static(best, rigid.value)
        whole = [weighed(motion, number, self.calibration, whole=True) for number, motion in enumerate(shown)]
        fit = _fit(best, shown, whole, self.tell)
        return fit if best.name != "static" or rigid is None else _with_static(fit, rigid)


def _excess(fit: LawFit) -> Estimate:
    """By what part the static friction of a fitted Stribeck curve exceeds the kinetic."""
    level, static = fit.parameters["kinetic"].value, fit.parameters["static"]
    low, high = (end / level - 1 for end in static.interval)
    value, ends, sd = static.value / level - 1, (max(0.0, low), high), static.sd / level
    return replace(static, name="excess of static friction", value=value, interval=ends, sd=sd, unit="1")


def _with_static(fit: LawFit, excess: Estimate) -> LawFit:
    """The fit with the static friction that the releases tell."""
    level = fit.parameters["kinetic"].value
    low, high = (level * (1 + end) for end in excess.interval)
    value, sd = level * (1 + excess.value), level * excess.sd
    static = replace(excess, name="static friction", value=value, interval=(low, high), sd=sd, unit="N")
    correlations = np.eye(len(fit.correlations) + 1)
    correlations[1:, 1:] = fit.correlations
    return replace(fit, parameters={"static": static, **fit.parameters}, correlations=correlations)


def _candidate(standing: Standing, trial: Trial, fit: LawFit, *, first: bool) -> Candidate:
    """A law that was tried; the first one as it was fitted to all readings."""
    if first:
        return Candidate(standing, fit.oscillator, fit.residual)
    return Candidate(standing, trial.system, _left(trial))


def _left(trial: Trial) -> dict[str, float]:
    """Root mean square of what is left of each channel."""
    by_channel: dict[str, list[float]] = {}
    for (name, _), square in squares(trial.left).items():
        by_channel.setdefault(name, []).append(square)
    return {name: math.sqrt(float(np.mean(values))) for name, values in by_channel.items()}


def _fit(trial: Trial, shown: Sequence[Shown], stretches: Sequence[Stretch], tell: Callable[[], None]) -> LawFit:
    """The law's parameters with their intervals, by all readings; of its misfit the noise alone is the measure."""
    problem = replace(trial.problem, stretches=tuple(stretches))
    begun = problem.at(trial.point.u, problem.own(trial.point.starts))

    def descended(problem: Problem, begun: Point) -> Point:
        # channels counted by their calibration leave a sum of squares that is small, and by far more than it can settle
        return descend(problem, begun, passes=PASSES, settled=0.0, tell=tell)

    point = descended(problem, begun)
    if _astray(problem, point):
        problem, begun = problem.held(begun)
        point = descended(problem, begun)

    def noise(name: str) -> float:
        return max(motion.noise(name) for motion in shown if name in motion.channels)

    with np.errstate(all="ignore"):  # of a parameter without effect
        return answered(problem, point, surety(problem, point, tell), shown, noise)


def _astray(problem: Problem, point: Point) -> bool:
    """Whether gains of bases are free, and more than noise is left, which draws them away from what is known of them.

    On a surface 3 % rough they came out up to 17 % off, where calibrations were off by 1 %, and the sliding friction of
    three such fits in three was told 6 % too low.
    """
    free = any(one.drive.gain_sd for one in problem.stretches)
    return free and point.chi2 > BEYOND * sum(len(residuals) for residuals in point.residuals)


def _whichever(fit: LawFit, others: Sequence[Trial]) -> LawFit:
    """The fit with intervals that hold whichever of the laws kept it is: each reaches as far about another's value.

    A law without static friction made up for it by a damper seven times the true one and gains three deviations off.
    """
    values = [
        {keyed(knob): valued(knob, u, trial.system) for knob, u in zip(trial.problem.knobs, trial.point.u, strict=True)}
        for trial in others
    ]
    parameters = dict(fit.parameters)
    for key, one in fit.parameters.items():
        apart = [0.0, *(other[key] - one.value for other in values if key in other)]
        low, high = one.interval
        parameters[key] = replace(one, interval=(max(min(0.0, low), low + min(apart)), high + max(apart)))
    return replace(fit, parameters=parameters)


def _calibrated(fit: LawFit, records: Sequence[Record], calibration: float) -> LawFit:
    """The fit no surer than the measured base is calibrated, by which all motion scales, and than the mass is weighed.

    What of a parameter is a length goes with the motion, and what is a mass with what slides, as its unit has them.
    Without a sensor of force it is the mass that makes forces of motions.
    """
    driven, felt = _measured(records, "z", "force"), _measured(records, "load", "friction")
    parameters = dict(fit.parameters)
    for key, one in fit.parameters.items():
        moved, weighed = (part in dimensions(one.unit) for part in ("length", "mass"))
        if unsure := math.hypot(driven and moved, not felt and weighed):
            parameters[key] = one.widened(unsure * calibration)
    return replace(fit, parameters=parameters)


def _widened(fit: LawFit, records: Sequence[Record]) -> LawFit:
    """The fit with intervals as wide as they had to be where the truth was known: what is left is mostly no noise."""
    felt = _measured(records, "load", "friction")
    with_force = 1.0 if explained(fit.misfit.values()) else ROUGHER
    parameters = dict(fit.parameters)
    for key, one in fit.parameters.items():
        if {"length", "mass"} & set(dimensions(one.unit)):
            parameters[key] = one.widened(0.0, with_force if felt else STRAYS.get(one.unit, STRAY))
    return replace(fit, parameters=parameters)


def _measured(records: Sequence[Record], *channels: str) -> bool:
    """Whether a record has one of some channels."""
    return any(name in record for record in records for name in channels)


def _kinds(laws: Sequence[Any] | None) -> list[tuple[Hypothesis, list[Any]]]:
    """The laws to try, and the values to start from where they are given."""
    kinds: dict[str, tuple[Hypothesis, list[Any]]] = {}
    for law in hypotheses() if laws is None else [laws] if isinstance(laws, str | type) else laws:
        kind = hypothesis_of(law)
        kinds.setdefault(kind.name, (kind, []))[1].extend([] if isinstance(law, str | type) else [law])
    if not kinds:
        raise ModelError("no law", "laws are compared by trying some", f"name some of {', '.join(hypotheses())}")
    order = list(hypotheses())
    return sorted(kinds.values(), key=lambda kind: order.index(kind[0].name) if kind[0].name in order else len(order))
