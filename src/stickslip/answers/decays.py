"""Everything that is asked of a free decay, together: the releases, the decrements, the whole waveform."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Protocol, cast

import numpy as np

from stickslip.answers.findings import BY_DECREMENTS, Comparison, Findings, Inquiry, record_name, require_several
from stickslip.answers.mistakes import mistakes_of_decay
from stickslip.decay.answer import DecayFit, rig_units
from stickslip.decay.choice import COLOURED, Choice
from stickslip.decay.decrement import Decrement, decrement
from stickslip.decay.extremes import EnvelopeDecay, extreme_decay, hilbert_decay, linear_decrement, log_decrement
from stickslip.decay.fit_decay import LEFT_OVER, fit_decay
from stickslip.decay.motions import Restoring
from stickslip.decay.release import Releases, find_releases
from stickslip.decay.start import SEEN
from stickslip.decay.which_motion import PLAIN, DecayMotion, choose_motion, whichever
from stickslip.errors import EstimateError, StickslipError
from stickslip.estimate import Constant, Doubt, Estimate, Result, Status, doubts_of
from stickslip.record.record import Record, require_record
from stickslip.statistics import disagreement, weighted_mean
from stickslip.units import parse_constant

EXTREMES = "extremes alone"
LOST = 0.1  # of the motion: a fit that leaves more of it does not follow it
NEARER = 8.0  # times less left than by viscous and dry friction: an Iwan chain left 14, two unsound clocks 3 and 4
CLEAR = 1e-3  # p-value below which a motion's rejection is no chance of one true motion in twenty
CHANCE = 0.01  # of a record without dry friction to be told to have some
ONE_IN_100 = 2.33 / 1.96  # by which the lower end of 95 % lies farther off where one in a hundred lies beyond it
DENIED = Doubt("the record speaks against viscous and dry friction, which the decrements take for granted", "denied")
METHODS = ("thesis", "waveform", "all")
OLDER: dict[str, Callable[..., EnvelopeDecay]] = {
    "logarithmic decrement": log_decrement, "linear decrement": linear_decrement, EXTREMES: extreme_decay,
    "Hilbert envelope": hilbert_decay,
}  # fmt: skip
FOR_PENDULUMS = {EXTREMES: partial(extreme_decay, restoring="pendulum")}
COURSE = ("frequency", "static_displacement", "bias", "release_time", "amplitude")
SHARED = ("damping_ratio", "dry_displacement", "frequency")
OF_ALL_AT_ONCE = (*SHARED, "static_displacement", "damping_ratio_any", "dry_displacement_any")
ASKED = ("channel", "restoring", "mass", "stiffness")
UNLIKE = 0.01  # chance with which records of one oscillator are called unlike


class BothFrictions(Protocol):
    """What every answer tells."""

    @property
    def damping_ratio(self) -> Estimate: ...
    @property
    def dry_displacement(self) -> Estimate: ...
    @property
    def frequency(self) -> Estimate: ...
    @property
    def model(self) -> str: ...
    @property
    def status(self) -> str: ...
    @property
    def estimates(self) -> tuple[Estimate, ...]: ...


@dataclass(frozen=True, eq=False, repr=False)
class Decay(Result):
    """What a free decay tells of its damping, by every way of asking.

    Attributes
    ----------
    releases : Releases
        Where something is let go.
    waveform : DecayFit or None
        By the whole waveform.
    thesis : Decrement or None
        By the decrements of the extremes.
    motion : DecayMotion or None
        Which motion it was, of all those that a decay may follow.
    older : mapping of str to EnvelopeDecay
        What the older methods say, for comparison.
    mass, stiffness : float or None
        Of the oscillator, where stated.
    refusal : StickslipError or None
        Why it could not be read from the whole waveform, where that was asked in vain.
    """

    releases: Releases
    waveform: DecayFit | None = None
    thesis: Decrement | None = None
    motion: DecayMotion | None = None
    older: Mapping[str, EnvelopeDecay] = field(default_factory=dict)
    mass: float | None = None
    stiffness: float | None = None
    refusal: StickslipError | None = None

    @property
    def best(self) -> BothFrictions:
        """The surest answer: of the whole waveform where there is one; of a pendulum without one, of its extremes.

        Where the record speaks against viscous and dry friction and for another of the motions tried, of that one.
        """
        told = () if self.motion is None or self.against >= CLEAR else (self.motion,)
        if told and (self.waveform is None or told[0].choice.status == "ok"):
            return told[0]
        swings = cast(BothFrictions | None, self.older.get(EXTREMES))  # of extremes alone, and they tell both
        answers = (self.waveform, self.thesis, self.motion, swings)
        best = next((answer for answer in answers if answer is not None), None)
        assert best is not None
        return best

    @property
    def against(self) -> float:
        """How likely a record like this is if viscous and dry friction are the motion: the greatest p-value of them."""
        tried = () if self.motion is None else self.motion.choice.candidates
        return max((candidate.p_value for candidate in tried if candidate.name in PLAIN), default=1.0)

    @property
    def course(self) -> DecayFit | DecayMotion | None:
        """What followed the record best: it tells when and from where it swings, and where it rests.

        Viscous and dry friction, but of a record that speaks against them the motion that was chosen.
        """
        return self.motion if self.waveform is None or self.against < CLEAR else self.waveform

    @property
    def rest(self) -> float:
        """Where the spring is at rest, in the record's zero."""
        rest = next((answer.bias.value for answer in (self.course, self.thesis) if answer is not None), None)
        return self.releases.ring_downs[0].rest if rest is None else rest

    @property
    def whichever(self) -> tuple[Estimate, ...]:
        """Damping ratio and dry friction with the intervals that hold whichever motion not rejected it was, if any."""
        fit = self.waveform if self.waveform is not None and self.waveform.motions else self.motion
        both = () if fit is None else (fit.damping_ratio_any, fit.dry_displacement_any)
        return tuple(estimate for estimate in both if estimate is not None)

    @property
    def viscous_residual(self) -> float | None:
        """What viscous damping alone leaves of the motion, over what it leaves together with dry friction (RMS)."""
        tried = () if self.motion is None else self.motion.choice.candidates
        fits = {candidate.name: candidate.fitted for candidate in tried}
        if not {"viscous", "both"} <= set(fits) or fits["both"].cost == 0:
            return None
        return math.sqrt(fits["viscous"].cost / fits["both"].cost)

    @property
    def dry_force(self) -> Estimate | None:
        """The dry friction as a force, where the mass or the stiffness is stated."""
        dry = self.whichever[1] if self.denied and self.whichever else self.best.dry_displacement
        return None if dry.interval == (0.0, 0.0) else self.as_force(dry, "dry friction force")

    def as_force(self, displacement: Estimate, name: str) -> Estimate | None:
        """A displacement of the spring as its force, where the mass or the stiffness is stated."""
        spring = self.stiffness
        if spring is None and self.mass is not None:
            spring = self.mass * (2 * math.pi * self.best.frequency.value) ** 2
        if spring is None:
            return None
        unit, word = ("N m", "torque") if displacement.unit == "rad" else ("N", "force")
        return displacement.scaled(spring, unit, name.replace("force", word))

    @property
    def rubs(self) -> bool:
        """Whether there is dry friction: records without it would show as much in fewer than one of a hundred.

        Every motion tried that has none is spoken against so clearly; where none was tried, the interval says it.
        """
        dry = self.best.dry_displacement
        fits = self.waveform.motions if self.waveform is not None and self.waveform.motions else ()
        tried = [fit.choice for fit in fits or ([] if self.motion is None else [self.motion])]
        without = [
            len(tried) * min(choice.candidate(candidate.name).p_value for choice in tried)
            for candidate in (tried[0].candidates if tried else ())
            if "dry_displacement" not in candidate.fitted.motion.terms
        ]
        if without:
            return dry.interval[0] > 0 and max(without) < CHANCE
        return dry.value - ONE_IN_100 * (dry.value - dry.interval[0]) > 0

    @property
    def denied(self) -> bool:
        """Whether the record speaks against viscous and dry friction, or all of its noise, and for no other motion."""
        negative = self.best.dry_displacement.interval[1] < 0
        unlike = bool(self.strays) and self.motion is not None and self.motion.choice.lack_of_fit < CLEAR
        return self.best is not self.motion and (self.against < CLEAR or negative or unlike)

    @property
    def undecided(self) -> bool:
        """Whether viscous and dry friction show dry friction, and a motion without any is not spoken against."""
        sure = self.best is self.waveform and self.best.dry_displacement.interval[0] > 0
        return sure and bool(self.whichever) and not self.denied and not self.rubs

    @property
    def strays(self) -> tuple[Doubt, ...]:
        """That viscous and dry friction leave much more than the record's own noise, where they do.

        What is left is then the noise of every motion tried, and speaks weakly against each.
        """
        status = "ok" if self.waveform is None else self.waveform.status
        return tuple(doubt for doubt in doubts_of(status) if doubt.kind == LEFT_OVER)

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every number found: those that are quoted, then the same by other ways."""
        return (*self.quoted, *self.beside)

    @property
    def quoted(self) -> tuple[Estimate, ...]:
        """The best answer's numbers, each once: of whichever motion, where its own hang on what is not shown."""
        force = self.dry_force
        quoted = [] if force is None or self.undecided else [force]
        if self.motion is not None and self.course is self.motion:
            terms = self.motion.terms if self.best is self.motion else ()
            quoted += [*terms, *(getattr(self.motion, name) for name in COURSE), *self.whichever]
        elif self.waveform is None:
            quoted += self.best.estimates
        else:
            quoted += [estimate for estimate in self.waveform.estimates if estimate is not self.waveform.dry_force]
            quoted += [] if self.waveform.motions else self.whichever
        return tuple(estimate for estimate in quoted if not any(estimate is other for other in self._others))

    @property
    def beside(self) -> tuple[Estimate, ...]:
        """What is not quoted, and what the decrements say where they are not the best answer."""
        more = () if self.thesis is None or self.best is self.thesis else self.thesis.estimates
        # of another motion they may be off by ten deviations
        denied = [DENIED] if self.against < CLEAR or self.strays else []
        decrements = (
            replace(estimate, name=f"{estimate.name}{BY_DECREMENTS}", status=Status(estimate.status, *denied))
            for estimate in more
        )
        return (*self._others, *decrements)

    @property
    def _others(self) -> tuple[Estimate, ...]:
        """What is not quoted of the motion's numbers and those of whichever motion it was, where there are both."""
        if not self.whichever or self.best is self.thesis:
            return ()
        if self.undecided or self.denied:
            return self.best.damping_ratio, self.best.dry_displacement
        return (self.whichever[0],)

    @property
    def comparisons(self) -> tuple[Estimate, ...]:
        """What the older methods say, each with what it gets wrong; not to be relied on."""
        by_extremes = self.waveform is None and self.thesis is None and self.motion is None
        return tuple(
            replace(estimate, name=f"{estimate.name}, {name}", method=f"for comparison: {fit.bias}", status="ok")
            for name, fit in self.older.items()
            if name != EXTREMES or not by_extremes
            for estimate in (fit.damping_ratio, fit.dry_displacement)
            if estimate is not None
        )


def analyze_decay(
    record: Record,
    *,
    method: str = "all",
    channel: str | None = None,
    mass: Constant | None = None,
    stiffness: Constant | None = None,
    restoring: Restoring = "linear",
) -> Findings:
    """How much viscous and how much dry friction does a free decay show, by every way of asking?

    The releases (:func:`find_releases`), the whole waveform (:func:`fit_decay`), the decrements of the extremes
    (:func:`decrement`), which motion it was (:func:`choose_motion`) and, for comparison, what older methods say. A
    question that can not be answered becomes a note while another can.

    Parameters
    ----------
    record : Record
        With ``x``, ``theta``, ``v`` or ``a`` of something that was let go.
    method : {"all", "waveform", "thesis"}
        Which questions are asked: all, those of the whole waveform, or the decrements alone.
    channel : str, optional
        Which channel; the first of these when left out.
    mass, stiffness : float, str, tuple or Estimate, optional
        Mass [kg] or stiffness [N/m] (of an angle: kg m^2, N m/rad), for the dry friction as a force.
    restoring : {"linear", "pendulum"}
        The spring's law: x, or sin x of a pendulum's angle. The decrements hold for x alone: a pendulum's extremes are
        read by :func:`extreme_decay`.

    Returns
    -------
    Findings
        With :class:`~stickslip.answers.Decay` as ``decay``.

    Raises
    ------
    EstimateError
        None of the questions could be answered; the sentence says why.
    RecordError
        A channel that is missing or broken.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(mass=1.0, stiffness=10.0, damping=0.2, law=ss.laws.Coulomb(0.2))
    >>> run = ss.simulate(slider, duration=40.0, start={"x": 1.0})
    >>> findings = analyze_decay(run.record(fs=100), method="thesis", stiffness=10.0)
    >>> round(findings.decay.best.damping_ratio.value, 3), round(findings.decay.dry_force.value, 2)
    (0.032, 0.2)
    """
    require_record(record)
    _require_method(method, restoring)
    releases = find_releases(record, channel=channel)
    first = releases.ring_downs[0]
    # a hold before the release is no drift
    faults = tuple(fault for fault in record.check() if (fault.kind, fault.channel) != ("drift", first.channel))
    inquiry, constants = Inquiry(list(releases.notes)), _constants(first.channel, mass=mass, stiffness=stiffness)
    way: dict[str, Any] = {"channel": first.channel, "restoring": restoring}
    decay = _by_every_way(record, releases, inquiry, method, way, constants)
    slips = mistakes_of_decay(
        first.channel, abs(first.amplitude), decay.best.frequency.value, decay.mass, decay.stiffness
    )
    notes, settings = tuple(dict.fromkeys(inquiry.notes)), {"method": method, **way, **constants}
    results = {"decay": decay, "slips": slips}
    return Findings(record_name(record), record, faults, notes=notes, settings=settings, results=results)


def _require_method(method: str, restoring: Restoring) -> None:
    if method not in METHODS:
        raise EstimateError(f"method = '{method}'", f"it is {', '.join(METHODS)}", "choose one of them")
    if restoring == "pendulum" and method == "thesis":
        raise EstimateError(
            "method = 'thesis' of a pendulum",
            "the decrements of the extremes hold for a linear spring",
            "choose method = 'waveform', or ask extreme_decay(record)",
        )


def _by_every_way(
    record: Record, releases: Releases, inquiry: Inquiry, method: str, way: dict[str, Any], constants: dict[str, Any]
) -> Decay:
    """What the whole waveform, the decrements and the older methods say, as far as `method` asks them."""
    linear, displaced = way["restoring"] == "linear", releases.ring_downs[0].order == 0
    waveform = thesis = motion = refusal = None
    if method != "thesis":
        waveform, motion, refusal = _by_waveform(record, inquiry, way, constants, displaced=displaced)
    if method != "waveform" and linear:
        thesis = inquiry.ask("The decrements", partial(decrement, record, channel=way["channel"]))
    refusals = inquiry.refusals[-1:]
    methods = {} if method != "all" or not displaced else OLDER if linear else FOR_PENDULUMS
    answers = {
        name: inquiry.ask(name.capitalize(), partial(older, record, channel=way["channel"]))
        for name, older in methods.items()
    }
    older = {name: answer for name, answer in answers.items() if answer is not None}
    if waveform is None and thesis is None and motion is None and (linear or not older):
        raise refusals[0]
    return Decay(releases, waveform, thesis, motion, older, refusal=refusal, **constants)


def _constants(channel: str, **stated: Constant | None) -> dict[str, Any]:
    """Mass and stiffness where stated, in SI."""
    units = rig_units(channel)
    known = {name: Estimate.stated(name, value, units[name]) for name, value in stated.items() if value is not None}
    return {name: parse_constant(name, float(constant), units[name]) for name, constant in known.items()}


def _by_waveform(
    record: Record, inquiry: Inquiry, way: dict[str, Any], constants: dict[str, Any], *, displaced: bool
) -> tuple[DecayFit | None, DecayMotion | None, StickslipError | None]:
    """The whole waveform, and of a displacement which motion it was; the latter alone where nothing fits the former."""
    fit = partial(fit_decay, record, **way, **constants)
    waveform = inquiry.ask("Which motion", partial(fit, candidates="all")) if displaced else None
    waveform = waveform or inquiry.ask("The whole waveform", fit)
    if waveform is None:
        refusal = inquiry.refusals[-1]
        return None, inquiry.ask("Which motion", partial(choose_motion, record, **way)) if displaced else None, refusal
    motion = waveform.motions[0] if waveform.motions else None
    waveform = inquiry.ask("The whole waveform", partial(_followed, waveform, way["restoring"]))
    if waveform is not None:
        return waveform, motion, None
    # a clock that can not be trusted leaves a motion that is neither kept nor followed down to the noise
    likely = motion is not None and _is_followed(motion.choice)
    return None, motion if likely else None, inquiry.refusals[-1]


def _is_followed(choice: Choice) -> bool:
    """Whether the motion chosen is kept, follows down to the noise, or far nearer than viscous and dry friction do."""
    chosen, fits = choice.chosen, {candidate.name: candidate.fitted for candidate in choice.candidates}
    nearer = "both" in fits and chosen.fitted.cost * NEARER**2 < fits["both"].cost
    return chosen.kept or chosen.whiteness >= COLOURED or nearer


def _followed(fit: DecayFit, restoring: Restoring) -> DecayFit:
    """The fit, where it follows the motion; refused where it leaves much of it."""
    residual, moved = np.concatenate(fit.residual), np.concatenate(fit.measured) - fit.bias.value
    share = float(np.linalg.norm(residual) / np.linalg.norm(moved))
    if share > LOST and float(np.std(residual)) > SEEN * fit.ring_downs[0].noise:
        straight = restoring == "linear" and fit.channel == "theta"
        raise EstimateError(
            f"the fit leaves {100 * share:.0f} % of the motion",
            "a waveform is read where the clock is even and the spring is the one that was chosen",
            ('choose restoring="pendulum" of a pendulum, ' if straight else "") + "mend the clock, or trust the "
            "extremes, which need none",
        )
    return fit


# ---- several records together


def compare_decays(findings: Sequence[Findings]) -> Comparison:
    """What do several records of one oscillator's free decay say together?

    Where damping ratio, dry friction and frequency of the records agree within their own intervals (chi-square of the
    weighted deviations from their mean, at one in a hundred for the three together), all releases are fitted at once by
    :func:`fit_decay`: they share these three, and the static friction lies in every record's bracket. Records that do
    not agree are not fitted together: their means are given, with intervals that hold the scatter (Student's t).

    Parameters
    ----------
    findings : sequence of Findings
        What :func:`analyze_decay` returned of two records or more, asked in the same way.

    Returns
    -------
    Comparison
        Its results are ``damping_ratio``, ``dry_displacement``, ``frequency`` and ``dry_force`` of all records;
        ``joint``, the :class:`~stickslip.decay.DecayFit` to all releases, or None; what it alone gives,
        ``static_displacement``, ``damping_ratio_any`` and ``dry_displacement_any`` (whichever motion it was); and
        ``apart``, of each quantity in which the records are not alike, by how many times what their own intervals
        allow they differ.

    Raises
    ------
    EstimateError
        Fewer than two records.

    Examples
    --------
    >>> import numpy as np
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(mass=1.0, stiffness=10.0, damping=0.2, law=ss.laws.Coulomb(0.2))
    >>> rng, found = np.random.default_rng(1), []
    >>> for start in (1.0, 0.8):
    ...     x = ss.simulate(slider, duration=20.0, start={"x": start}).record(fs=50)["x"]
    ...     record = ss.Record.of({"x": x + 1e-3 * rng.standard_normal(x.size)}, fs=50)
    ...     found.append(ss.analyze_decay(record, method="waveform"))
    >>> together = compare_decays(found)
    >>> together.joint.dry_displacement.includes(0.02), together.apart
    (True, {})
    """
    require_several(findings)
    apart, log = _apart(findings), Inquiry()
    ways = {key: list(dict.fromkeys(finding.settings.get(key) for finding in findings)) for key in ASKED}
    mixed = any(len(values) > 1 for values in ways.values())
    joint = _at_once(findings, ways, log) if mixed or not apart else None
    status = f"the records differ in {' and '.join(apart)}" if apart else "ok"
    shared: dict[str, Estimate | None] = {
        name: weighted_mean(estimates, of="records", status=status) for name, estimates in _shared(findings).items()
    }
    dry = None if mixed else shared.get("dry_displacement")
    force = None if dry is None else findings[0].decay.as_force(dry, "dry friction force")
    if joint is not None:
        shared = {name: getattr(joint, name) for name in OF_ALL_AT_ONCE}
        force = force if joint.dry_force is None else replace(joint.dry_force, name="dry friction force")
    results = {"dry_force": force, **dict.fromkeys(OF_ALL_AT_ONCE), **shared, "joint": joint, "apart": apart}
    return Comparison(tuple(findings), tuple(log.notes), results=results)


def _at_once(findings: Sequence[Findings], ways: Mapping[str, Sequence[Any]], log: Inquiry) -> DecayFit | None:
    """The fit to all records, where each was best told by its waveform; a note of why, where they were asked unlike."""
    if mixed := {key: values for key, values in ways.items() if len(values) > 1}:
        differ = "; ".join(f"{key} is {' and '.join(map(str, values))}" for key, values in mixed.items())
        log.notes.append(f"The records are not fitted together: {differ}.")
    elif all(finding.decay.best is finding.decay.waveform for finding in findings):
        way = {key: values[0] for key, values in ways.items()}
        return log.ask("All records at once", lambda: _jointly(findings, way))
    return None


def _jointly(findings: Sequence[Findings], way: dict[str, Any]) -> DecayFit:
    """All releases at once, with the intervals that hold whichever motion no record speaks against."""
    joint = fit_decay([finding.record for finding in findings], **way)
    waveforms = [finding.decay.waveform for finding in findings]
    motions = [() if waveform is None else waveform.motions for waveform in waveforms]
    if not all(motions):
        return joint
    choices = [motion.choice for own in motions for motion in own]
    either = {f"{name}_any": whichever(choices, getattr(joint, name), name) for name in SHARED[:2]}
    return replace(joint, **either)  # type: ignore[arg-type]


def _shared(findings: Sequence[Findings]) -> dict[str, list[Estimate]]:
    """What records of one oscillator share, of each record; not what stands in different units."""
    shared = {name: [getattr(finding.decay.best, name) for finding in findings] for name in SHARED}
    return {name: several for name, several in shared.items() if len({estimate.unit for estimate in several}) == 1}


def _apart(findings: Sequence[Findings]) -> dict[str, float]:
    """The shared quantities in which the records differ by more than chance."""
    from scipy.special import chdtri

    freedom = len(findings) - 1
    most = math.sqrt(float(chdtri(freedom, UNLIKE / len(SHARED))) / freedom)
    gaps = {estimates[0].name: disagreement(estimates) for estimates in _shared(findings).values()}
    return {name: gap for name, gap in gaps.items() if gap > most}
