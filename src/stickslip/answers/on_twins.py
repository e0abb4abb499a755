"""An analysis tried on its twins: each answer as the rigs that the record may come from let it stand."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from stickslip.answers.findings import BY_FORCE, NOT_TRIED, Findings, flagged, without
from stickslip.balance.force import friction_force
from stickslip.compiled import waiting
from stickslip.consistent.checks import Slip
from stickslip.cycle.loops import Loops, friction_loops
from stickslip.cycle.onset import Breakaway, Presliding
from stickslip.cycle.sticks import Sticks, find_sticks
from stickslip.errors import StickslipError
from stickslip.estimate import UNTRIED, Estimate, Result, Status
from stickslip.record.record import Record, StatedRig
from stickslip.twin.belief import GAIN, LATE, MASS, SPRING, Belief
from stickslip.twin.search import CALIBRATED, believe
from stickslip.twin.trial import COMPLIANCE, GIVES, Trial, try_on_twins
from stickslip.workers import workers

Answer = TypeVar("Answer", Loops | None, Sticks | None, Breakaway | None)
CONSTANTS = {MASS: "mass", SPRING: "stiffness"}
UNTOLD = Estimate("compliance", math.nan, (math.nan, math.nan), math.nan, "m/N", "fit to x")
# Of each twin: static friction and a contact's stiffness are told by the fit to x, and a curve over speed not at all.
ASKED = (partial(friction_loops, bins=2), find_sticks)


def tried(
    findings: Findings,
    *,
    twins: int = 40,
    rng: int = 0,
    processes: int = 1,
    progress: Callable[[float], None] = lambda share: None,
) -> Findings:
    r"""What of an analysis holds on rigs that the record may come from, whose truth is known?

    The rig that the record is believed to come from (:func:`~stickslip.twin.believe`) writes so many records of its
    own, and is asked the same questions (:class:`~stickslip.twin.Trial`): the bias of each answer is taken off, its
    interval is what the twins' errors leave, and a static friction above the sliding one is claimed only where
    twins without it would not have shown it.

    Parameters
    ----------
    findings : Findings
        From :func:`~stickslip.analyze`, of a record whose friction came from a balance of forces.
    twins : int
        How many are asked, eight at least.
    rng : int
        Seed: the same one gives the same answers, by any number of processes.
    processes : int
        Processes that ask the twins. With more than one a script must begin under ``if __name__ == "__main__":``, as
        Python's `multiprocessing` says.
    progress : callable, optional
        Called with the share done.

    Returns
    -------
    Findings
        The same, its answers as the trial left them, with the :class:`~stickslip.twin.Trial` itself.

    Raises
    ------
    EstimateError
        The record has no twin: its friction was measured, or nothing in it tells what moved the mass.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(mass=0.54, stiffness=188, damping=0.136, law=ss.laws.Coulomb(0.0126),
    ...                        drive=ss.drives.HarmonicBase(0.289e-3, frequency=3.387))
    >>> rig = ss.Rig.perfect("x", "z").having("x", white=1e-7).having("z", white=1e-7)
    >>> record = rig.measure(ss.simulate(slider, duration=6), fs=1000, rng=1)
    >>> quick = ss.analyze(record, mass=0.54, stiffness=188, damping=0.136)
    >>> sure = ss.tried(quick, twins=10)
    >>> sure.breakaway.ratio.known  # what such a record says of static friction its twins without any say too
    False
    """
    findings = findings.having(**{key: without(findings.results.get(key), UNTRIED) for key in NOT_TRIED})
    answers = {estimate.name: estimate for estimate in findings.estimates}
    with waiting(), workers(processes, __name__, among=True) as mapped:  # they are ready when the rig is found
        belief = believe(findings.record, mapped=mapped)
        ask = partial(_ask, stated=belief.record.rig)
        trial = try_on_twins(belief, answers, ask, count=twins, rng=rng, progress=progress, mapped=mapped)
    answered = findings.having(**_as_tried(findings, trial), trial=trial)
    return replace(answered, notes=(*findings.notes, _note(trial)))


def _as_tried(findings: Findings, trial: Trial) -> dict[str, Any]:
    """The results that the trial leaves otherwise."""
    results: dict[str, Any] = {
        "loops": _with(findings.loops, trial.estimates),
        "sticks": _with(findings.sticks, trial.estimates),
        "breakaway": _with(findings.breakaway, trial.estimates),
        "presliding": findings.presliding if findings.stiffness is not None else _yields(findings.presliding, trial),
    }
    ratios = (rig.values[name] for rig in trial.slips for name in rig.slipped if name != LATE)
    off = max((abs(math.expm1(ratio)) for ratio in ratios), default=0.0)
    unsure = float(f"{off:.1g}") if off <= CALIBRATED else 0.0
    results["slipped"] = tuple(_slip(rig, findings.record, unsure) for rig in trial.slips)
    if trial.doubt is not None and trial.unlike:  # what was not tried rests on the same constants and channels
        results |= {key: flagged(results.get(key, findings.results.get(key)), trial.doubt) for key in BY_FORCE}
    return results


def _slip(rig: Belief, record: Record, unsure: float) -> Slip:
    """What of a record's channels and constants is to be stated otherwise, were it what this rig has off.

    Of gains and constants the motion tells the ratio alone: where calibration may have left it, all are `unsure`.
    """
    off = {name: rig.values[name] for name in rig.slipped}
    delays = {"x": record.channels["x"].delay + _rounded(rig.late)} if LATE in off else {}
    if unsure and off.keys() - {LATE}:
        return Slip(rig.slip, delays=delays, unsure=unsure)
    cure = {"x": ("x", 1 + _rounded(math.expm1(-off[GAIN])))} if GAIN in off else {}
    constants = {CONSTANTS[name]: 1 + _rounded(math.expm1(off[name])) for name in CONSTANTS if name in off}
    return Slip(rig.slip, cure, constants, delays=delays)


def _rounded(value: float) -> float:
    """To what of it may be told: it is written into a command."""
    return float(f"{value:.3g}")


def _note(trial: Trial) -> str:
    return (
        f"Tried on {trial.count} twins: simulated rigs with {trial.belief}, whose sensors have the noise and the "
        "counts of the record's. What the same questions get wrong of them is taken off, and the intervals are as wide "
        "as their errors."
    )


def _yields(quick: Presliding | None, trial: Trial) -> Presliding | None:
    """What a contact does before it slips, by the fit to x where it tells; not what rigid twins show too."""
    stiffness, power = trial.estimates.get(GIVES), trial.felt.get(COMPLIANCE)
    if trial.doubt is not None and trial.unlike:
        return None if quick is None else _telling("can not be told", trial.doubt.words)
    if stiffness is not None and stiffness.value > 0:
        why, low, high = f"a contact of {stiffness} leaves less of x than a rigid one", *stiffness.interval
        value, ends, sd = 1 / stiffness.value, (1 / high, 1 / low if low > 0 else math.inf), 1 / stiffness.value**2
        compliance = replace(UNTOLD, value=value, interval=ends, sd=stiffness.sd * sd, status=stiffness.status)
        return _telling("gives way", why, compliance, stiffness)
    if power is not None:
        compliance = replace(UNTOLD, value=0.0, interval=(0.0, power.felt), sd=power.felt / 2, status="ok")
        return _telling(
            "rigid", f"a contact softer than {1 / power.felt:.3g} N/m would have been seen in x", compliance
        )
    why = "a contact that gives way would not have moved x enough to be seen"
    return None if quick is None else _telling("can not be told", why)


def _telling(
    verdict: str, why: str, compliance: Estimate | None = None, stiffness: Estimate | None = None
) -> Presliding:
    """How a contact gives way, both directions alike."""
    compliance = replace(UNTOLD, status=Status(why)) if compliance is None else compliance
    forward, back = (replace(compliance, name=f"compliance {side}") for side in ("forward", "back"))
    status = "ok" if stiffness is None else stiffness.status
    return Presliding(stiffness, None, None, None, forward, back, verdict, why, status)


def _ask(record: Record, *, stated: StatedRig | None) -> dict[str, Estimate]:
    """The answers of a twin, found as those of its record were."""
    assert stated is not None  # it was believed in
    record = friction_force(record, method=stated.method, **stated.constants)
    answers: dict[str, Estimate] = {}
    for question in ASKED:
        try:
            result: Result = question(record, contact=stated.contact)
        except StickslipError:  # as of the record itself: a question without an answer is left out
            continue
        answers |= {estimate.name: estimate for estimate in result.estimates}
    return answers


def _with(answer: Answer, estimates: Mapping[str, Estimate]) -> Answer:
    """The answer with its numbers as tried."""
    if answer is None:
        return answer
    numbers = {key: value for key, value in vars(answer).items() if isinstance(value, Estimate)}
    changes: dict[str, Any] = {key: estimates[e.name] for key, e in numbers.items() if e.name in estimates}
    return replace(answer, **changes)
