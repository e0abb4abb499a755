"""Records side by side, and their friction against the normal load."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from stickslip.answers.findings import Comparison, Findings, require_several
from stickslip.estimate import NORMAL_95, Estimate
from stickslip.law.load import LATE
from stickslip.statistics import student


def compare(findings: Sequence[Findings]) -> Comparison:
    """Friction of several records side by side, and against the normal load where it is known.

    The coefficient is the slope of ``f = mu N`` by least squares; with three loads or more a line ``f = mu N + f0`` is
    fitted beside it. Their intervals are Student's t on the scatter about the line, or what the records' own intervals
    allow where that is wider.

    Parameters
    ----------
    findings : sequence of Findings
        Two or more.

    Returns
    -------
    Comparison

    Raises
    ------
    EstimateError
        Fewer than two records.

    Examples
    --------
    >>> import numpy as np
    >>> from stickslip import Record, analyze
    >>> rng, time = np.random.default_rng(1), np.arange(4000) / 500
    >>> def slide(load):
    ...     friction = 0.3 * load * np.sign(np.cos(2 * np.pi * time)) + rng.normal(0, 0.01, time.size)
    ...     x = np.sin(2 * np.pi * time) / (2 * np.pi)
    ...     return Record.of({"x": x, "friction": friction, "normal": np.full(time.size, load)}, fs=500)
    >>> round(compare([analyze(slide(load)) for load in (2.0, 4.0, 8.0)]).coefficient.value, 2)
    0.3
    """
    require_several(findings)
    results, notes = against_load(findings)
    return Comparison(tuple(findings), notes, results=results)


class Slid(Protocol):
    """What is known of one record's friction and load."""

    @property
    def name(self) -> str: ...
    @property
    def level(self) -> Estimate | None: ...
    @property
    def normal(self) -> float | None: ...


def against_load(findings: Sequence[Slid]) -> tuple[dict[str, Estimate | None], tuple[str, ...]]:
    """The coefficient and the line of friction against the normal load; and what could not be used."""
    known = [f for f in findings if f.normal is not None and f.level is not None and f.level.unit == "N"]
    left_out = {
        "The normal load of {} is not known; state it to fit the coefficient.": [f for f in findings if not f.normal],
        "No friction level was found for {}.": [f for f in findings if f.level is None],
        "The friction of {} is a torque: it is not set against a normal load.": [
            f for f in findings if f.level is not None and f.level.unit != "N"
        ],
    }
    notes = [words.format(", ".join(f.name for f in those)) for words, those in left_out.items() if those]
    results: dict[str, Estimate | None] = dict.fromkeys(("coefficient", "slope", "offset"))
    if len(known) < 2:
        return results, tuple(notes)
    loads = np.array([f.normal for f in known], dtype=float)
    levels, sds = (np.array([getattr(f.level, key) for f in known]) for key in ("value", "sd"))
    over = f"over {len(known)} records"
    (slope,) = _line(loads[:, None], levels, sds)
    scatter = math.sqrt(float(np.sum((levels - slope["value"] * loads) ** 2)) / (len(known) - 1))
    coefficient = Estimate.normal(
        "friction coefficient", **slope, unit="1", method=f"slope through the origin {over}",
        checks=(f"scatter about the line {scatter:.3g} N",),
    )  # fmt: skip
    if len(np.unique(loads)) >= 3:
        rise, rest = _line(np.column_stack([loads, np.ones_like(loads)]), levels, sds)
        way = f"straight line {over}"
        tilt = Estimate.normal("slope of the line", **rise, unit="1", method=way)
        offset = Estimate.normal("friction at no load", **rest, unit="N", method=way)
        if not offset.includes(0.0):
            coefficient = replace(coefficient, status="the line misses the origin: see friction at no load")
        results["slope"] = tilt.within(0.0, otherwise="friction falls with the load")
        results["offset"] = offset.within(0.0, otherwise=LATE)
    else:
        notes.append("Fewer than three loads: whether the line passes through the origin can not be told.")
    return {**results, "coefficient": coefficient}, tuple(notes)


def _line(design: NDArray[np.float64], levels: NDArray[np.float64], sds: NDArray[np.float64]) -> list[dict[str, float]]:
    """Coefficients by least squares; each varies as the scatter about the line says, or as `sds` do if that is more."""
    free = len(levels) - design.shape[1]
    inverse = np.linalg.pinv(design)
    found = inverse @ levels
    scatter = np.sqrt(np.sum((levels - design @ found) ** 2) / free * np.sum(inverse**2, axis=1))
    # a record of one cycle has no sd of its own: the scatter alone speaks for it
    own = np.sqrt(inverse**2 @ np.where(np.isfinite(sds), sds, 0.0) ** 2)
    sd = np.maximum(scatter, own * NORMAL_95 / student(free))
    return [{"value": v, "sd": s, "quantile": student(free)} for v, s in zip(found, sd, strict=True)]
