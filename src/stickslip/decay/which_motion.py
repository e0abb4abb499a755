"""Which motion does a record's free decay follow?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from stickslip.arrays import Array
from stickslip.decay.candidates import ALWAYS, Fitted, rigid
from stickslip.decay.choice import Candidate, Choice, choose, choose_fitted, interval_of, kept_by_all, lack_of_fit
from stickslip.decay.motions import MOTIONS, RESTORING, Restoring, free_decay
from stickslip.decay.release import CLIPPED, LOST, RingDown, find_releases
from stickslip.decay.start import BLOCKS
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Estimate, Result, Status
from stickslip.record.record import Record

PLAIN = {"viscous", "dry", "both", "static"}  # motions that viscous and dry friction together hold
SWING = 2.5  # rad, above which a pendulum lingers near its top and its phase can not be held
COARSE = 0.5  # of a digitiser's step: less noise than this, the counts' own included, does not blur it
TAIL = 2.0  # periods at rest that are kept
SURE = 3.0  # standard deviations of the noise by which a bracket is widened
NO_REST = "the mass does not come to rest in the record: only an upper bound"
TERMS = {
    "damping_ratio": ("damping ratio", "1"),
    "dry_displacement": ("dry friction displacement", "{}"),
    "quadratic": ("quadratic damping", "1/{}"),
    "rise": ("rise of friction towards rest", "1"),
    "stribeck_speed": ("Stribeck speed", "{}/s"),
    "micro_slip": ("micro-slip at the first amplitude", "1"),
    "exponent": ("exponent of micro-slip", "1"),
    "curvature": ("curvature of the spring", "1/{}^2"),
    "presliding": ("pre-sliding displacement", "{}"),
    "relaxation": ("contact damping over contact stiffness", "s"),
}  # names and units of a motion's terms, {} the displacement's


@dataclass(frozen=True, eq=False, repr=False)
class DecayMotion(Result):
    """Which motion a free decay follows, and what it says of its friction.

    Attributes
    ----------
    damping_ratio, dry_displacement, frequency : Estimate
        Damping ratio, dry friction over the stiffness [m or rad] and undamped natural frequency [Hz] if the motion is
        `model`; exactly zero where it has no such term.
    static_displacement, bias, release_time, amplitude : Estimate
        Bracket of the static friction over the stiffness, rest position, time of release (of the first turn where the
        motion is under way) and amplitude from the rest position then, if that is the motion.
    damping_ratio_any, dry_displacement_any : Estimate
        Damping ratio and dry friction with the interval that holds whichever candidate not rejected is the motion: the
        model's form counted.
    model : str
        The simplest candidate that the record does not speak against, by its name.
    candidates : tuple of (str, str, str)
        Name, words and verdict of all that were tried.
    choice : Choice
        Their fits.
    status : str
        "ok", or in words what to beware of.
    terms : tuple of Estimate
        Every term of `model`, as quadratic damping ``q`` [1/m] (:func:`~stickslip.decay.motions.free_decay` has the
        equation), but for the shape of one too faint to show it.
    """

    damping_ratio: Estimate
    dry_displacement: Estimate
    frequency: Estimate
    static_displacement: Estimate
    bias: Estimate
    release_time: Estimate
    amplitude: Estimate
    damping_ratio_any: Estimate
    dry_displacement_any: Estimate
    model: str
    candidates: tuple[tuple[str, str, str], ...]
    choice: Choice
    status: str
    terms: tuple[Estimate, ...] = ()


def choose_motion(
    record: Record,
    *,
    channel: str | None = None,
    restoring: Restoring = "linear",
    candidates: tuple[str, ...] = tuple(MOTIONS),
) -> DecayMotion:
    """Which motion does a free decay follow: viscous, dry, both, or one that a thesis leaves out?

    The candidates are viscous damping, dry friction, both, both with static above kinetic friction, quadratic (air)
    damping without and with dry friction, friction that rises towards rest (Stribeck), a spring that is not straight,
    and a joint in micro-slip. Each is fitted to the whole waveform and tested against every term that it lacks, so that
    a true one is rejected once in twenty. The simplest that is not rejected is the model. All that are not rejected
    give a second interval, beside the statistical one: a friction that the record can not tell apart may bias an
    estimate by far more than its noise. Where all are rejected, those that leave at most twice the best residual give
    it.

    Parameters
    ----------
    record : Record
        With one release in ``x`` or ``theta``; of several the first is taken.
    channel : str, optional
        Which of them.
    restoring : {"linear", "pendulum"}
        The spring's law: x, or sin x (`theta` in rad from the vertical; swings above 2.5 rad are left out).
    candidates : tuple of str
        Names in ``stickslip.decay.motions.MOTIONS``.

    Returns
    -------
    DecayMotion

    Raises
    ------
    RecordError
        A channel is missing or broken.
    EstimateError
        No free decay, one that is not a displacement (of a pendulum: an angle), or a spring or a candidate of no known
        name.

    Examples
    --------
    >>> from stickslip.decay.motions import free_decay
    >>> t, rng = np.arange(600) / 50, np.random.default_rng(1)
    >>> x, _, _ = free_decay(t, [6.28, 0.02, 0.02, 0, 1, 0.3, 0, 0, 0, 0, 0.5, 0])
    >>> choice = choose_motion(Record.of({"x": x + 1e-3 * rng.standard_normal(t.size)}, fs=50))
    >>> choice.model, choice.dry_displacement.includes(0.02), choice.dry_displacement_any.includes(0.02)
    ('both', True, True)
    """
    releases = find_releases(record, channel=channel)
    motion = motion_of(releases.ring_downs[0], restoring=restoring, candidates=candidates)
    if len(releases.ring_downs) == 1:
        return motion
    several = f"the first of {len(releases.ring_downs)} releases alone was read"
    return replace(motion, status=several if motion.status == "ok" else f"{motion.status}; {several}")


def named(candidates: str | tuple[str, ...] | None) -> tuple[str, ...]:
    """The names of the candidates asked for: all, some, or none."""
    if candidates is None:
        return ()
    return tuple(MOTIONS) if candidates == "all" else (candidates,) if isinstance(candidates, str) else candidates


def motion_of(
    ring_down: RingDown, *, restoring: Restoring = "linear", candidates: tuple[str, ...] = tuple(MOTIONS)
) -> DecayMotion:
    """:func:`choose_motion` of one release that was found already."""
    choice, zero = choice_of(ring_down, restoring=restoring, candidates=candidates)
    return _answer(choice, ring_down, zero)


def choice_of(
    ring_down: RingDown,
    *,
    restoring: Restoring,
    candidates: tuple[str, ...] = tuple(MOTIONS),
    fitted: Mapping[str, Fitted] = MappingProxyType({}),
) -> tuple[Choice, float]:
    """The choice among the candidates, and the record's time [s] at its zero; all may have been `fitted` before.

    Raises
    ------
    EstimateError
        No displacement, a pendulum without an angle, an unknown spring or candidate, or fewer than four sound extremes.
    """
    if restoring not in RESTORING:
        raise EstimateError(
            f"restoring = '{restoring}'", f"the spring is one of {', '.join(RESTORING)}", "choose one of them"
        )
    if restoring == "pendulum" and ring_down.unit != "rad":
        raise EstimateError(
            f"channel '{ring_down.channel}' in {ring_down.unit}",
            "a pendulum is read from an angle in rad, theta",
            "divide a displacement by the pendulum's length, or leave restoring= out",
        )
    if ring_down.order:
        raise EstimateError(
            f"channel '{ring_down.channel}'",
            "the choice among motions is made on a displacement",
            "record or integrate the displacement, or use fit_decay(record)",
        )
    rows, start = _begin(ring_down, restoring)
    zero = ring_down.first + rows.start / ring_down.fs
    if {*candidates, *ALWAYS} <= fitted.keys():
        return choose_fitted(fitted, candidates), zero
    size = max(1, int(2 * math.pi / start[0] * ring_down.fs / BLOCKS))
    count = (rows.stop - rows.start) // size
    samples = ring_down.samples[rows.start : rows.start + count * size]
    times = np.arange(count * size) / ring_down.fs
    choice = choose(
        times.reshape(count, size).mean(axis=1),
        samples.reshape(count, size).mean(axis=1),
        fs=ring_down.fs,
        start=start,
        counts=np.full(count, float(size)),
        restoring=restoring,
        candidates=candidates,
        weights=(1 / _alike(ring_down)[rows.start : rows.start + count * size]).reshape(count, size).sum(axis=1),
    )
    return choice, zero


def _alike(ring_down: RingDown) -> Array:
    """How many samples are one reading, at each sample: equal ones in a row; of a coarse digitiser all those at rest.

    Its error does not average out where the mass rests.
    """
    begins = np.flatnonzero(np.diff(ring_down.samples, prepend=np.nan))
    lengths = np.diff(np.append(begins, len(ring_down.samples)))
    alike = np.repeat(lengths, lengths).astype(float)
    if ring_down.noise < COARSE * ring_down.step:
        for rest in (ring_down.hold, ring_down.tail):
            alike[rest] = max(1, len(alike[rest]))
    return alike


def _begin(ring_down: RingDown, restoring: Restoring) -> tuple[slice, Array]:
    """The rows that are fitted, and where the search begins, with times from the first of them."""
    turns = np.asarray(ring_down.turns)
    sizes = np.abs(ring_down.samples[turns] - ring_down.rest)
    first = 0
    if restoring == "pendulum":
        first = int(np.argmax(sizes < SWING))
    first = max(first, _unclipped(ring_down))
    turns, sizes = turns[first:], sizes[first:]
    if len(turns) < 4:
        raise EstimateError(
            f"{len(turns)} sound extremes", "a motion is chosen from four at least", "give a longer record"
        )
    later = np.diff(turns[len(turns) // 2 :] if len(turns) > 8 else turns)
    w = math.pi * ring_down.fs / float(np.median(later))
    fall, less = np.polyfit(sizes[:-1], sizes[1:], 1)
    fall = float(np.clip(fall, 0.3, 0.9999))
    dry = float(np.clip(-less / (1 + fall), 1e-6 * sizes[0], 0.3 * sizes[0]))
    damping = -math.log(fall) / math.pi
    is_held = ring_down.held and first == 0
    period = 2 * math.pi / w
    release = (ring_down.release - ring_down.first) if is_held else turns[0] / ring_down.fs
    begin = max(0, int((release - period / 2) * ring_down.fs)) if is_held else int(turns[0])
    stop = ring_down.stop - ring_down.first + TAIL * period
    end = min(len(ring_down.samples), int(stop * ring_down.fs) + 1)
    amplitude = float(ring_down.samples[turns[0]] - ring_down.rest)
    start = np.array([w, damping, dry, ring_down.rest, amplitude, release - begin / ring_down.fs])
    return slice(begin, end), start


def _unclipped(ring_down: RingDown) -> int:
    """Number of the first extreme after the last that the instrument cut off."""
    cut = np.flatnonzero(~ring_down.sound[:-1])
    return int(cut[-1]) + 1 if len(cut) else 0


def status_of(ring_down: RingDown, worry: str) -> str:
    """What was left out of the record and what to beware of, or "ok"."""
    left_out = [CLIPPED] if _unclipped(ring_down) else []
    left_out += [LOST] if LOST in ring_down.marks else []
    return Status(*left_out, worry)


def whichever(choices: Sequence[Choice], estimate: Estimate, parameter: str) -> Estimate:
    """An estimate with the interval that holds whichever of the candidates not rejected is the motion.

    What viscous and dry friction would make of it does not count where the record speaks against both.
    """
    kept, (low, high) = kept_by_all(choices), estimate.interval
    ends, value, status = interval_of(choices, parameter), estimate.value, estimate.status
    if PLAIN & set(kept):
        ends = min(low, ends[0]), max(high, ends[1])
    else:
        nearest = [choice.chosen.estimate(parameter).value for choice in choices]
        value, status = float(np.clip(np.mean(nearest), *ends)), Status(*(choice.status for choice in choices))
    return replace(
        estimate,
        value=value,
        name=f"{estimate.name}, whichever motion",
        interval=ends,
        sd=(ends[1] - ends[0]) / (2 * NORMAL_95),
        method="all candidates not rejected",
        status=status,
        checks=(f"candidates: {', '.join(kept)}",),
    )


def beginning(released: bool) -> tuple[str, str]:
    """What the time and the amplitude are called where a fit begins."""
    return ("release time", "amplitude at release") if released else ("time of the first turn", "first amplitude")


def static_between(candidate: Candidate, ring_down: RingDown) -> Estimate:
    """Static friction lies between the pull where it stayed and the pull where it last turned, each over the stiffness.

    Both are places of the candidate's motion, which hold where it leaves noise alone.
    """
    fitted, turns = candidate.fitted, candidate.fitted.half_cycles
    error = SURE * candidate.level / math.sqrt(max(1.0, ring_down.fs / ring_down.frequency / 2))
    if not fitted.motion.stops and fitted.value("presliding") > 0:  # it rings where a rigid contact would stay
        error += fitted.value("presliding")
        fitted = replace(fitted, parameters=rigid(fitted.parameters))
        turns = fitted.blocks.motion(fitted.parameters)[2]
    low = max(_pull(fitted, turns) - error, 0.0) if ring_down.stopped else 0.0
    high = _pull(fitted, turns - 1) + error
    status = "" if ring_down.stopped else NO_REST
    return static_in(low, high, ring_down.unit, Status(status, lack_of_fit(candidate)))


def static_in(low: float, high: float, unit: str, status: str) -> Estimate:
    """Static friction that is anywhere between two displacements alike."""
    middle, sd = (low + high) / 2, (high - low) / math.sqrt(12)
    method = "between where it stayed and where it last turned"
    return Estimate("static friction displacement", middle, (low, high), sd, unit, method, status)


def _pull(fitted: Fitted, half_cycles: int) -> float:
    """Force of the spring over its stiffness at the turning point after so many half cycles."""
    period = 2 * math.pi / fitted.value("angular_frequency")
    later = fitted.value("release") + (half_cycles + 2) * period  # a half cycle below 2.5 rad takes less
    at = free_decay([later], fitted.parameters, restoring=fitted.blocks.restoring, half_cycles=half_cycles)[0][0]
    away = float(at) - fitted.value("rest")
    straight = math.sin(away) if fitted.blocks.restoring == "pendulum" else away
    return abs(straight + fitted.value("curvature") * away**3)


def _answer(choice: Choice, ring_down: RingDown, zero: float) -> DecayMotion:
    """`zero` [s] is the record's time at the candidates' zero."""
    chosen, unit = choice.chosen, ring_down.unit
    status = status_of(ring_down, "" if choice.status == "ok" else choice.status)
    begins, far = beginning(ring_down.held and zero <= ring_down.release)

    def course(parameter: str, name: str, unit: str, **shift: float) -> Estimate:
        return replace(chosen.estimate(parameter, name=name, unit=unit, **shift), status=status)

    damping = chosen.estimate("damping_ratio", name="damping ratio")
    dry = chosen.estimate("dry_displacement", name="dry friction displacement", unit=unit)
    return DecayMotion(
        damping,
        dry,
        course("angular_frequency", "natural frequency", "Hz", factor=1 / (2 * math.pi)),
        static_between(chosen, ring_down),
        course("rest", "rest position", unit),
        course("release", begins, "s", offset=zero),
        course("amplitude", far, unit),
        whichever((choice,), damping, "damping_ratio"),
        whichever((choice,), dry, "dry_displacement"),
        choice.model,
        tuple((candidate.name, candidate.fitted.motion.words, candidate.verdict) for candidate in choice.candidates),
        choice,
        status,
        _terms(chosen, unit),
    )


def _terms(chosen: Candidate, unit: str) -> tuple[Estimate, ...]:
    """Every term of a motion that has an interval."""
    terms = []
    for parameter in chosen.fitted.motion.terms:
        name, per = TERMS[parameter]
        scale = abs(chosen.fitted.value("amplitude")) ** chosen.fitted.value("exponent")
        factor = scale if parameter == "micro_slip" else 1.0
        estimate = chosen.estimate(parameter, name=name, unit=per.format(unit), factor=factor)
        terms.append(estimate.within(0.0) if parameter == "relaxation" else estimate)  # a contact drives nothing
    return tuple(term for term in terms if term.sd > 0)
