"""Several records of free decays together: shared friction where they are alike, their scatter where they are not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from stickslip.answers.asked import Asked
from stickslip.answers.findings import Comparison, Findings, require_several
from stickslip.decay.answer import DecayFit
from stickslip.decay.fit_decay import fit_decay
from stickslip.decay.which_motion import whichever
from stickslip.estimate import Estimate
from stickslip.statistics import disagreement, weighted_mean

SHARED = ("damping_ratio", "dry_displacement", "frequency")
OF_ALL_AT_ONCE = (*SHARED, "static_displacement", "damping_ratio_any", "dry_displacement_any")
ASKED = ("channel", "restoring", "mass", "stiffness")
CHANCE = 0.01  # with which records of one oscillator are called unlike


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
        Its results are ``damping_ratio``, ``dry_displacement``, ``frequency`` and ``dry_force`` of all records: of the
        joint fit, or the means over the records with intervals that hold their scatter; ``joint``, the
        :class:`~stickslip.decay.DecayFit` to all releases with one frequency and one friction, or None where the
        records are not alike or can not be fitted together; what it alone gives, ``static_displacement``,
        ``damping_ratio_any`` and ``dry_displacement_any`` (whichever motion it was); and ``apart``, by how many times
        what their own intervals allow the records differ, of each quantity in which they are not alike.

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
    apart, asked = _apart(findings), Asked()
    ways = {key: [each.settings.get(key) for each in findings] for key in ASKED}
    mixed = [key for key, values in ways.items() if len(set(values)) > 1]
    joint = None
    if mixed:
        said = "; ".join(f"{key} is {' and '.join(map(str, dict.fromkeys(ways[key])))}" for key in mixed)
        asked.notes.append(f"The records are not fitted together: {said}.")
    elif not apart and all(each.decay.best is each.decay.waveform for each in findings):
        way = {key: values[0] for key, values in ways.items()}
        joint = asked.ask("All records at once", lambda: _jointly(findings, way))
    status = f"the records differ in {' and '.join(apart)}" if apart else "ok"
    shared: dict[str, Estimate | None] = {
        name: weighted_mean(each, of="records", status=status) for name, each in _shared(findings).items()
    }
    dry = None if mixed else shared.get("dry_displacement")
    force = None if dry is None else findings[0].decay.as_force(dry, "dry friction force")
    if joint is not None:
        shared = {name: getattr(joint, name) for name in OF_ALL_AT_ONCE}
        force = force if joint.dry_force is None else replace(joint.dry_force, name="dry friction force")
    results = {"dry_force": force, **dict.fromkeys(OF_ALL_AT_ONCE), **shared, "joint": joint, "apart": apart}
    return Comparison(tuple(findings), tuple(asked.notes), results=results)


def _jointly(findings: Sequence[Findings], way: dict[str, Any]) -> DecayFit:
    """All releases at once, with the intervals that hold whichever motion no record speaks against."""
    joint = fit_decay([each.record for each in findings], **way)
    waveforms = [each.decay.waveform for each in findings]
    motions = [() if each is None else each.motions for each in waveforms]
    if not all(motions):
        return joint
    choices = [motion.choice for each in motions for motion in each]
    either = {f"{name}_any": whichever(choices, getattr(joint, name), name) for name in SHARED[:2]}
    return replace(joint, **either)  # type: ignore[arg-type]


def _shared(findings: Sequence[Findings]) -> dict[str, list[Estimate]]:
    """What records of one oscillator share, of each record; not what stands in different units."""
    found = {name: [getattr(each.decay.best, name) for each in findings] for name in SHARED}
    return {name: each for name, each in found.items() if len({estimate.unit for estimate in each}) == 1}


def _apart(findings: Sequence[Findings]) -> dict[str, float]:
    """The shared quantities in which the records differ by more than chance."""
    from scipy.special import chdtri

    freedom = len(findings) - 1
    most = math.sqrt(float(chdtri(freedom, CHANCE / len(SHARED))) / freedom)
    gaps = {each[0].name: disagreement(each) for each in _shared(findings).values()}
    return {name: gap for name, gap in gaps.items() if gap > most}
