"""What is said of several friction laws that were fitted to the same records."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.estimate import Doubt, Estimate, Result, Status
from stickslip.law.law import LawFit
from stickslip.law.standing import CALIBRATIONS, MISFIT, Standing, times
from stickslip.laws.guessing import family_of
from stickslip.oscillator import Oscillator
from stickslip.record.record import Record, Step

BAD = 0.3  # of a channel's own size: a law that leaves more beyond the noise describes little
REMAINDER = "remainder"  # the kind of doubt where the best law leaves more than noise
LEFT = 0.05  # of it: so much comes of more than the chance that an interval knows
FAR = 6.0  # of how unsure a gain or a spring is, beyond which it is no calibration's error: 5 came of 3 % of roughness


class Remainder(NamedTuple):
    """The channel of which a law leaves the largest share beyond the noise, that share, and times its noise."""

    channel: str
    share: float
    over: float

    @classmethod
    def of(cls, left: Mapping[str, float], noise: Mapping[str, float], sizes: Mapping[str, float]) -> Remainder:
        """By each channel's root mean square left, its noise and its deviation."""
        shares = {
            name: math.sqrt(max(0.0, rms**2 - noise[name] ** 2)) / max(sizes[name], 1e-300)
            for name, rms in left.items()
        }
        worst = max(shares, key=lambda name: shares[name])
        return cls(worst, shares[worst], left[worst] / max(noise[worst], 1e-300))

    @classmethod
    def of_fit(cls, fit: LawFit) -> Remainder:
        """What a fitted law leaves."""
        return cls.of(fit.residual, fit.noise, _sizes(fit))

    @property
    def explained(self) -> bool:
        """Whether no more is left than noise."""
        return self.share <= LEFT and self.over <= MISFIT

    def __str__(self) -> str:
        return f"leaves {100 * self.share:.{0 if self.share > LEFT else 2}f} % of {self.channel}"


def _sizes(fit: LawFit) -> dict[str, float]:
    """Deviation of each channel."""
    return {name: float(np.std(np.concatenate([part.measured[name] for part in fit.traces]))) for name in fit.residual}


@dataclass(frozen=True, eq=False)
class Candidate:
    """One law that was tried.

    Attributes
    ----------
    standing : Standing
        How it stands among the others.
    oscillator : Oscillator
        With the law's fitted values.
    left : mapping of str to float
        Root mean square of what it leaves of each channel [unit of the channel].
    """

    standing: Standing
    oscillator: Oscillator
    left: Mapping[str, float]

    @property
    def name(self) -> str:
        """Of the law."""
        return self.standing.name

    def worded(self, fit: LawFit, *, first: bool) -> Candidate:
        """The law with what it leaves, where that is more than calibrations and noise are; `fit` is the first one's."""
        remainder = Remainder.of(self.left, fit.noise, _sizes(fit))
        if not self.standing.kept or remainder.share <= LEFT:
            return self
        how = "best of those tried" if first else "not rejected"
        return replace(self, standing=replace(self.standing, verdict=f"{how}, {remainder}"))


@dataclass(frozen=True, eq=False, repr=False)
class LawComparison(Result):
    """What records say of several friction laws.

    Attributes
    ----------
    candidates : tuple of Candidate
        The laws tried, the best one first.
    law : str or None
        The law, where the records leave one alone.
    family : str or None
        "rigid", "compliant", "state variable" or "LuGre", where the records leave one alone.
    kept : tuple of str
        The laws that are not rejected.
    confidence : float
        Probability that the true law is among those kept, were it among the laws tried.
    verdict : str
        The answer, in a sentence or two for a report.
    fit : LawFit
        The best law's fit to all records, with intervals.
    excess : Estimate or None
        By what part static friction exceeds the kinetic, where a rigid contact is the best.
    status : str
        "ok", or why the answer should not be trusted.
    checks : tuple of str
        What was checked, with the numbers.
    history : tuple of Step
        How it was found.
    """

    candidates: tuple[Candidate, ...]
    law: str | None
    family: str | None
    kept: tuple[str, ...]
    confidence: float
    verdict: str
    fit: LawFit
    excess: Estimate | None
    status: str
    checks: tuple[str, ...]
    history: tuple[Step, ...]

    @property
    def best(self) -> Candidate:
        """The law that stands first."""
        return self.candidates[0]

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The best law's parameters."""
        return (*self.fit.estimates, *([self.excess] if self.excess else []))

    def __repr__(self) -> str:
        return f"{self.verdict}\n{super().__repr__()}"

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "verdict": self.verdict,
            "law": self.law,
            "family": self.family,
            "not_rejected": list(self.kept),
            "confidence": self.confidence,
            "status": self.status,
            "checks": list(self.checks),
            "laws": [_plain(candidate) for candidate in self.candidates],
            "estimates": [estimate.to_dict() for estimate in self.estimates],
            "history": [step.to_dict() for step in self.history],
        }


def _plain(candidate: Candidate) -> dict[str, Any]:
    standing = candidate.standing
    values = {"misfit": standing.misfit, "criterion": standing.criterion}
    law = candidate.oscillator.law
    return {
        "name": standing.name, "family": standing.family, "verdict": standing.verdict, "kept": standing.kept,
        **{key: value if math.isfinite(value) else None for key, value in values.items()},
        "values": {key: value for key, value in vars(law).items() if isinstance(value, float)},
        "left": dict(candidate.left),
    }  # fmt: skip


def concluded(
    candidates: tuple[Candidate, ...],
    confidence: float,
    fit: LawFit,
    excess_: Estimate | None,
    calibration: float,
    records: Sequence[Record],
    doubt: str,
    worries: Sequence[Doubt | str],
) -> LawComparison:
    ranking = [law.standing for law in candidates]
    kept = [law for law in ranking if law.kept]
    families = list(dict.fromkeys(law.family for law in kept))
    excess_ = excess_ if ranking[0].family == "rigid" else None
    checks = tuple(f"{law.name}: misfit {times(law.misfit)} the least" for law in ranking)
    step = Step(
        "compare_laws",
        {"laws": [law.name for law in candidates], "calibration": calibration},
        f"{', '.join(law.name for law in kept)} not rejected",
    )
    return LawComparison(
        candidates, kept[0].name if len(kept) == 1 and not doubt else None,
        families[0] if len(families) == 1 and not doubt else None,
        tuple(law.name for law in kept), confidence,
        f"None of the laws tried describes these records: {doubt}." if doubt
        else " ".join(_sentences(ranking, families, excess_, calibration, confidence, Remainder.of_fit(fit))),
        fit, excess_, Status(doubt) if doubt else Status(*worries), checks,
        (*records[0].history, step),
    )  # fmt: skip


def doubt_of(fit: LawFit, stated: Oscillator, calibration: float) -> str:
    """Why even the best law is none for these records; nothing where it is."""
    shares = {estimate: estimate.value for name, estimate in fit.parameters.items() if "gain" in name.split(".")}
    if "stiffness" in fit.parameters and stated.stiffness > 0:
        shares[fit.parameters["stiffness"]] = fit.parameters["stiffness"].value / stated.stiffness
    far = [estimate for estimate, share in shares.items() if abs(math.log(share)) > FAR * calibration > 0]
    if far:
        values = ", ".join(f"the {estimate.name} comes out as {estimate.value:.3g}" for estimate in far)
        return (
            f"{values}, where calibrations are off by {100 * calibration:.2g} %: check mass=, stiffness= and the "
            "channels' units"
        )
    remainder = Remainder.of_fit(fit)
    if remainder.share <= BAD:
        return ""
    return f"even the best law {remainder}: the friction may follow none of those tried"


def _sentences(
    laws: Sequence[Standing],
    families: Sequence[str],
    excess_: Estimate | None,
    calibration: float,
    confidence: float,
    remainder: Remainder,
) -> Iterator[str]:
    """The verdict, to be pasted into a report."""
    best = laws[0]
    if len(laws) == 1:  # nothing was compared: how well it explains the records is all there is to say
        yield f"{best.name}, the only law tried, {remainder}, {times(remainder.over)} the noise of {remainder.channel}."
        return
    kept = [law.name for law in laws if law.kept]
    rivals = [law for law in laws if law.family != best.family and not law.limit]
    limits = [law.name for law in laws if law.limit]
    if len(families) > 1:
        yield (
            f"These records can not tell {_either(kept)} apart: what they leave over differs too little. "
            "A record in which the contact sticks and slips, with a load cell, would tell more."
        )
    else:
        clauses = []
        if rivals:
            least = min(law.misfit for law in rivals) / best.misfit
            larger = f"the misfit of any other family tried is at least {times(least)} as large"
            clauses.append(larger if least > 1 else "another family leaves no less where the records tell most")
        if limits:
            clauses.append(
                f"{_either(limits)} would have to be so stiff that {'they are' if limits[1:] else 'it is'} rigid"
            )
        rivalry = "; ".join(clauses) or "no law of another family was tried"
        fits = f"{kept[0][:1].upper()}{kept[0][1:]} fits best: the" if len(kept) == 1 else "The"
        many = f", {times(remainder.over)} its noise" if remainder.share <= LEFT else ""
        lead = fits if remainder.explained else f"The best of those tried {remainder}{many}. Among them the"
        yield f"{lead} friction is {family_of(best.name).said}: {rivalry}."
    if best.family == "rigid" and len(families) == 1 and excess_ is not None:
        low, high = excess_.interval
        exceeds = (
            f"by {100 * excess_.value:.1f} % (95 %: {100 * low:.1f} % to {100 * high:.1f} %)"
            if math.isfinite(high)
            else f"by {100 * low:.1f} % or more"
            if low > 0
            else "by what can not be told"
        )
        if len(kept) > 1:
            yield (
                f"Within it {_either(kept)} can not be told apart: static friction exceeds the kinetic {exceeds}, "
                f"where calibrations within {100 * calibration:.2g} % hide {100 * CALIBRATIONS * calibration:.2g} %."
            )
        elif best.name == "Coulomb" or kept == ["Coulomb"]:
            most = f"{100 * high:.1f} % at most"
            yield f"One level of friction explains it: static friction exceeds the kinetic by {most}."
        else:
            falls = "at once" if kept == ["static"] else "with the speed, along a Stribeck curve"
            yield f"Static friction exceeds the kinetic {exceeds} and falls {falls}."
    if len(kept) == 1:
        yield f"Confidence {100 * confidence:.1f} %."


def _either(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1])] * (len(names) > 1) + [names[-1]])


def unexplained_part(fit: LawFit) -> Doubt | str:
    """What even the best law leaves, where that is more than calibrations and noise are."""
    remainder = Remainder.of_fit(fit)
    if remainder.share <= LEFT:
        return ""
    return Doubt(f"the best of those tried {remainder}: the friction may follow none of them", REMAINDER)


def damper_found(fit: LawFit, stated: float) -> Iterator[str]:
    """The damper that was found, where it is not the stated one."""
    damping = fit.parameters.get("damping")
    if damping is not None and not damping.includes(stated):
        yield f"With it goes a {damping}, where {stated:.4g} N s/m is stated."
