"""Which friction law is it: several laws fitted to the same records, and what the records say of each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import NORMAL_95, Doubt, Estimate
from stickslip.law.law import LawFit, answered, surety, teller
from stickslip.law.search import descend
from stickslip.law.start import CALIBRATION, Shown, require_apart, seen_damping, too_few, usual_nuisance
from stickslip.law.stretch import Stretch, channels_of
from stickslip.law.trials import (
    PASSES,
    Seen,
    Trial,
    evidence_of,
    resumed,
    searched,
    squares,
    tuned,
    unexplained,
    weighed,
    with_static,
)
from stickslip.law.verdict import (
    CALIBRATIONS,
    LEFT,
    Candidate,
    Evidence,
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
from stickslip.laws.guessing import Hypothesis, hypotheses, hypothesis_of
from stickslip.oscillator import Oscillator
from stickslip.record.record import Record, require_record
from stickslip.units import dimensions

Array = NDArray[np.float64]

CALLS = 40.0  # of progress that the trial of a law is taken for
LOOK = 2  # passes of a descent after which it is seen how the sensors' mounts swing
RETUNED = 8  # times that mounts and law are found in turn
# times as wide as chance, by unit: so 95 % of intervals held on the first 39 rigs of `benchmarks/servo_laws.py --first
# 6000`, of a contact's damping on the first 59
STRAY, STRAYS = 1.25, {"N s/m": 2.5, "m/s": 4.0, "s/m": 4.0}


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
    systems = [oscillator, *([seen_damping(oscillator, shown)] if "damping" in known else [])]
    search = _Search(kinds, _seen(records, systems), known, calibration, teller(progress, CALLS * len(kinds)))
    trials, looked = search.trials(shown)
    rests = search.seen[-1][1].rests  # of the balance with the likelier damper
    misfits = [
        Misfit(trial.name, trial.count, squares(trial.left), trial.stiff, trial.moved) for trial in trials.values()
    ]
    evidence = evidence_of(min(trials.values(), key=lambda trial: trial.point.chi2), looked.shown)
    ranking, confidence = standings(
        misfits, evidence, likely=rests.probabilities(calibration, CALIBRATIONS * calibration)
    )
    best, final = search.settled(trials[ranking[0].name], looked, evidence, rests.fall)
    fit = search.fitted(best, final, rests.fall)
    doubt, confidence = doubt_of(fit, oscillator, calibration), min(confidence, evidence.supported)
    if doubt:
        ranking, confidence = undescribed(ranking), 0.0
        fit = _flagged(fit, "none of the laws tried describes these records")
    rigid = _excess(fit) if best.name == "Stribeck" else rests.fall
    fit = _calibrated(fit, records, calibration)
    if progress:
        progress(1.0)
    candidates = tuple(_candidate(one, trials[one.name], fit, first=one is ranking[0]) for one in ranking)
    if not doubt:
        candidates = tuple(one.worded(fit, first=one is candidates[0]) for one in candidates)
    worries: list[Doubt | str] = [*looked.worries]
    worries += filter(None, [too_few(final, best.count), unexplained_part(fit)])
    answer = concluded(candidates, confidence, fit, rigid, calibration, records, doubt, worries)
    damper = () if doubt else damper_found(fit, oscillator.damping)
    return replace(answer, verdict=" ".join([answer.verdict, *damper]))


class _Looked(NamedTuple):
    """The records after a first look: as they are compared, and before their mounts were moved."""

    shown: Sequence[Shown]
    stated: Sequence[Shown] | None  # None where no law could be looked at
    worries: tuple[str, ...]


class _Search(NamedTuple):
    """What stays the same while laws are searched: their starts, what is fitted beside them, and who is told."""

    kinds: Sequence[tuple[Hypothesis, list[Any]]]
    seen: Sequence[tuple[Oscillator, Seen]]
    known: Sequence[str]
    calibration: float
    tell: Callable[[], None]

    def stretch(self, evidence: Evidence | None) -> Callable[[Shown, int], Stretch]:
        """How a record is weighed: by its noise and calibration, and by evidence where there is some."""
        return lambda shown, number: weighed(shown, number, self.calibration, evidence)

    def tried(
        self, shown: Sequence[Shown], evidence: Evidence | None, passes: int, before: Mapping[str, Trial]
    ) -> dict[str, Trial]:
        """Every law searched, or its search taken up again."""
        stretches = [self.stretch(evidence)(motion, number) for number, motion in enumerate(shown)]
        trials: dict[str, Trial] = {}
        for kind, given in self.kinds:
            name = kind.name
            least = min((one.point.chi2 for one in {**before, **trials}.values()), default=math.inf)
            trial = resumed(before[name], stretches, least, passes, self.tell) if name in before else None
            if trial is None:
                begun = [replace(system, law=law) for system, seen in self.seen for law in given or kind.guesses(seen)]
                begun += _continued(kind, trials)
                trial = searched(name, begun, stretches, self.known, self.calibration, least, passes, self.tell)
            if trial is not None:
                trials[name] = trial
        return trials

    def trials(self, shown: Sequence[Shown]) -> tuple[dict[str, Trial], _Looked]:
        """Every law at the end of its search; a first look tells which channels count, how much, and their mounts."""
        rough, looked, evidence = self.tried(shown, None, LOOK, {}), _Looked(shown, None, ()), None
        if rough:
            nearest = min(rough.values(), key=lambda trial: trial.point.chi2)
            silent = unexplained(nearest, shown)
            stated = [replace(one, channels=tuple(n for n in one.channels if n not in silent)) for one in shown]
            worries = tuple(
                f"{name} is left out: the best law leaves {100 * share:.0f} % of it, and no mount or delay of its "
                "sensor is stated"
                for name, share in silent.items()
            )
            looked = _Looked(tuned(stated, nearest, self.stretch(None), self.tell), stated, worries)
            evidence = evidence_of(nearest, looked.shown)
        trials = self.tried(looked.shown, evidence, PASSES, {} if looked.worries else rough)
        if not trials:
            raise EstimateError(
                "no law can be simulated along these records",
                "a search starts from a motion that exists",
                "check mass= and stiffness=, or give laws with their values",
            )
        return trials, looked

    def settled(
        self, best: Trial, looked: _Looked, evidence: Evidence, rigid: Estimate | None
    ) -> tuple[Trial, Sequence[Shown]]:
        """The best law, with the records' mounts by the law that was found, not by the first look."""
        if best.name == "static" and rigid is not None:
            best = with_static(best, rigid.value)
        shown, stretch = looked.shown, self.stretch(evidence)
        for _ in range(0 if looked.stated is None else RETUNED):
            before, shown = shown, tuned(looked.stated or (), best, stretch, self.tell)
            if [motion.record.channels for motion in before] == [motion.record.channels for motion in shown]:
                break
            stretches = [stretch(motion, number) for number, motion in enumerate(shown)]
            best = resumed(best, stretches, math.inf, PASSES, self.tell) or best
        return best, shown

    def fitted(self, best: Trial, shown: Sequence[Shown], rigid: Estimate | None) -> LawFit:
        """The best law's fit to all readings, with the static friction that the releases tell."""
        whole = [weighed(motion, number, self.calibration, whole=True) for number, motion in enumerate(shown)]
        fit = _fit(best, shown, whole, self.tell)
        return fit if best.name != "static" or rigid is None else _with_static(fit, rigid)


def _seen(records: Sequence[Record], systems: Sequence[Oscillator]) -> list[tuple[Oscillator, Seen]]:
    """What the records show by each of several dampers; one that leaves no friction is none."""
    seen, refused = [], None
    for system in systems:
        try:
            seen.append((system, Seen.of(records, system)))
        except EstimateError as error:
            refused = error
    if refused and not seen:
        raise refused
    return seen


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
    # channels counted by their calibration leave a sum of squares that is small, and by far more than it can settle
    point = descend(problem, begun, passes=PASSES, settled=0.0, tell=tell)
    with np.errstate(all="ignore"):  # of a parameter without effect
        fit = answered(problem, point, surety(problem, point, tell), shown)
    noise = {name: max(motion.noise(name) for motion in shown if name in motion.channels) for name in fit.residual}
    checks = tuple(
        f"{name} is left with {left / noise[name]:.3g} times its noise" for name, left in fit.residual.items()
    )
    fit = replace(fit, noise=noise, checks=checks)
    remainder = Remainder.of_fit(fit)
    if remainder.share > LEFT:
        doubt = f"the interval does not count that the law misses {100 * remainder.share:.0f} % of {remainder.channel}"
        fit = _flagged(fit, doubt)
    return fit


def _flagged(fit: LawFit, status: str) -> LawFit:
    """The fit with a reason why its parameters should not be trusted, where none is told yet."""
    return replace(fit, parameters={key: one.doubted(status) for key, one in fit.parameters.items()})


def _calibrated(fit: LawFit, records: Sequence[Record], calibration: float) -> LawFit:
    """The fit no surer than the measured base is calibrated, by which all motion scales, and than the mass is weighed.

    What of a parameter is a length goes with the motion, and what is a mass with what slides, as its unit has them.
    Without a sensor of force it is the mass that makes forces of motions, and intervals are as wide besides as they had
    to be where the truth was known: what is left over is mostly no noise.
    """
    driven = any(name in record for record in records for name in ("z", "force"))
    felt = any(name in record for record in records for name in ("load", "friction"))
    parameters = dict(fit.parameters)
    for key, one in fit.parameters.items():
        moved, weighed = (part in dimensions(one.unit) for part in ("length", "mass"))
        if moved or weighed:
            unsure = math.hypot(driven and moved, not felt and weighed)
            parameters[key] = _widened(one, unsure * calibration, 1.0 if felt else STRAYS.get(one.unit, STRAY))
    return replace(fit, parameters=parameters)


def _widened(estimate: Estimate, share: float, times: float) -> Estimate:
    """The estimate, unsure by a share of its value besides, and so many times as unsure."""
    more, (low, high) = share * abs(estimate.value), estimate.interval
    ends = (estimate.value - low, high - estimate.value)
    below, above = (times * math.hypot(end, NORMAL_95 * more) for end in ends)
    interval = (max(min(0.0, low), estimate.value - below), estimate.value + above)
    return replace(estimate, interval=interval, sd=times * math.hypot(estimate.sd, more))


def _continued(kind: Hypothesis, before: Mapping[str, Trial]) -> list[Oscillator]:
    """Where else a search begins: at the ends of simpler laws' searches, with the damper of the one that left least."""
    if not before:
        return []
    nearest = min(before.values(), key=lambda trial: trial.point.chi2)
    stated = nearest.problem.oscillator.having(damping=nearest.system.damping)
    return [replace(stated, law=law) for law in kind.continued(before)]


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
