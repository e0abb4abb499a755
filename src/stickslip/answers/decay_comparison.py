"""Several records of free decays together: shared friction where they are alike, their scatter where they are not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from stickslip.answers.asked import Asked
from stickslip.answers.decays import DecayFindings
from stickslip.answers.findings import plain
from stickslip.decay.answer import DecayFit
from stickslip.decay.fit_decay import fit_decay
from stickslip.decay.which_motion import whichever
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, Result
from stickslip.statistics import disagreement, weighted_mean

SHARED = ("damping_ratio", "dry_displacement", "frequency")
ASKED = ("channel", "restoring", "mass", "stiffness")
CHANCE = 0.01  # with which records of one oscillator are called unlike


@dataclass(frozen=True, eq=False, repr=False)
class DecayComparison(Result):
    """Several records of free decays side by side, and what they say together.

    Attributes
    ----------
    findings : tuple of DecayFindings
        One per record.
    joint : DecayFit or None
        All releases of all records fitted at once, with one frequency and one friction; None where the records are not
        alike, or can not be fitted together.
    apart : mapping of str to float
        The quantities in which the records are not alike: by how many times what their own intervals allow they differ.
    means : tuple of Estimate
        Damping ratio, dry friction displacement and natural frequency as means over the records, with intervals that
        hold their scatter.
    dry_force : Estimate or None
        The dry friction as a force, where the mass or the stiffness is stated.
    notes : tuple of str
        What could not be asked, and why.
    """

    findings: tuple[DecayFindings, ...]
    joint: DecayFit | None
    apart: dict[str, float]
    means: tuple[Estimate, ...]
    dry_force: Estimate | None
    notes: tuple[str, ...] = ()

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """What holds for all records: of the joint fit, or the means."""
        force = () if self.dry_force is None else (self.dry_force,)
        if self.joint is None:
            return (*force, *self.means)
        either = (self.joint.damping_ratio_any, self.joint.dry_displacement_any)
        shared = (getattr(self.joint, name) for name in (*SHARED, "static_displacement"))
        return (*force, *shared, *(each for each in either if each is not None))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: what holds for all, and each record's own."""
        together = {
            "joint": self.joint is not None,
            "apart": self.apart,
            "estimates": [each.to_dict() for each in self.estimates],
            "half_cycles": None if self.joint is None else list(self.joint.half_cycles),
            "notes": list(self.notes),
        }
        return {"comparison": plain(together), "records": [each.to_dict() for each in self.findings]}


def compare_decays(findings: Sequence[DecayFindings]) -> DecayComparison:
    """What do several records of one oscillator's free decay say together?

    Where damping ratio, dry friction and frequency of the records agree within their own intervals (chi-square of the
    weighted deviations from their mean, at one in a hundred for the three together), all releases are fitted at once by
    :func:`fit_decay`: they share these three, and the static friction lies in every record's bracket. Records that do
    not agree are not fitted together: their means are given, with intervals that hold the scatter (Student's t).

    Parameters
    ----------
    findings : sequence of DecayFindings
        What :func:`analyze_decay` returned of two records or more, asked in the same way.

    Returns
    -------
    DecayComparison

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
    if len(findings) < 2:
        raise EstimateError(f"{len(findings)} record", "a comparison needs two or more", "give several files")
    apart, asked = _apart(findings), Asked()
    ways = {key: [each.settings.get(key) for each in findings] for key in ASKED}
    mixed = [key for key, values in ways.items() if len(set(values)) > 1]
    joint = None
    if mixed:
        said = "; ".join(f"{key} is {' and '.join(map(str, dict.fromkeys(ways[key])))}" for key in mixed)
        asked.notes.append(f"The records are not fitted together: {said}.")
    elif not apart and all(each.best is each.waveform for each in findings):
        way = {key: values[0] for key, values in ways.items()}
        joint = asked.ask("All records at once", lambda: _jointly(findings, way))
    status = f"the records differ in {' and '.join(apart)}" if apart else "ok"
    means = tuple(weighted_mean(each, of="records", status=status) for each in _shared(findings))
    dry = next((each for each in means if each.name == "dry friction displacement"), None)
    force = None if mixed or dry is None else findings[0].as_force(dry, "dry friction force")
    force = force if joint is None or joint.dry_force is None else replace(joint.dry_force, name="dry friction force")
    return DecayComparison(tuple(findings), joint, apart, means, force, tuple(asked.notes))


def _jointly(findings: Sequence[DecayFindings], way: dict[str, Any]) -> DecayFit:
    """All releases at once, with the intervals that hold whichever motion no record speaks against."""
    joint = fit_decay([each.record for each in findings], **way)
    motions = [() if each.waveform is None else each.waveform.motions for each in findings]
    if not all(motions):
        return joint
    choices = [motion.choice for each in motions for motion in each]
    either = {f"{name}_any": whichever(choices, getattr(joint, name), name) for name in SHARED[:2]}
    return replace(joint, **either)  # type: ignore[arg-type]


def _shared(findings: Sequence[DecayFindings]) -> list[list[Estimate]]:
    """What records of one oscillator share, of each record; not what stands in different units."""
    found = [[getattr(each.best, name) for each in findings] for name in SHARED]
    return [each for each in found if len({estimate.unit for estimate in each}) == 1]


def _apart(findings: Sequence[DecayFindings]) -> dict[str, float]:
    """The shared quantities in which the records differ by more than chance."""
    from scipy.special import chdtri

    freedom = len(findings) - 1
    most = math.sqrt(float(chdtri(freedom, CHANCE / len(SHARED))) / freedom)
    gaps = {each[0].name: disagreement(each) for each in _shared(findings)}
    return {name: gap for name, gap in gaps.items() if gap > most}
