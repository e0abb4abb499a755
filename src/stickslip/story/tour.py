"""The whole experiment told: the answer first, then rig, runs, law and squeaks, each with its own section behind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from stickslip.answers.findings import Findings
from stickslip.bench.runs import Proposal, run_list
from stickslip.bench.through import Tour
from stickslip.estimate import Estimate
from stickslip.story.bench import of_commissioned
from stickslip.story.findings import of_comparison, of_findings, plain
from stickslip.story.fit import of_laws
from stickslip.story.story import Line, Story, Table
from stickslip.story.words import value_of


def of_tour(tour: Tour) -> Story:
    """One page, as a lab would hand it in."""
    driven = [
        replace(of_findings(each), title=f"The base at {run.frequency:g} Hz")
        for each, run in zip(tour.comparison.findings, tour.runs, strict=True)
    ]
    parts = [
        replace(of_commissioned(tour.commissioned), title="The rig"),
        *driven,
        replace(of_findings(tour.decay), title="A free decay over the contact"),
        replace(of_laws(tour.laws), title="Which law is it?"),
        *(replace(of_findings(each), title=each.name.capitalize()) for each in tour.squeaks.findings),
    ]

    def write(folder: Path) -> None:
        (folder / "rig.toml").write_text(tour.commissioned.known.toml(), encoding="utf-8")
        if tour.proposals:
            (folder / "next.toml").write_text(run_list(tour.proposals).toml(), encoding="utf-8")

    return Story(
        "Dry friction of an air-track slider", _abstract(tour), lines=_lines(tour), tables=_tables(tour),
        parts=parts, settings=_settings(tour), data=lambda: dict(plain(_data(tour))), write=write,
    )  # fmt: skip


def _abstract(tour: Tour) -> list[str]:
    """What was done and found, a sentence each."""
    known = tour.commissioned.known
    constants = known.require_constants()
    contact = _of(tour.laws.estimates, "contact stiffness")
    level = _of(tour.laws.estimates, "sliding friction")
    first = tour.laws.verdict.partition(":")[0].partition(". ")[0].rstrip(".")
    told = [
        f"{first}"
        + (f": it slides at {value_of(level)}" if level else "")
        + (f", and before it slides gives way like a spring of {value_of(contact)}." if contact else "."),
        f"The rig, commissioned from nothing, is a mass of {value_of(constants.mass)} on a spring of "
        f"{value_of(constants.stiffness)} with a damping ratio of {_ratio(tour)}.",
        _held(tour),
        *_squeaked(tour),
    ]
    if tour.proposals:
        told.append(_advice(tour.proposals[0]))
    return told


def _of(estimates: tuple[Estimate, ...], name: str) -> Estimate | None:
    return next((estimate for estimate in estimates if estimate.name == name and estimate.known), None)


def _ratio(tour: Tour) -> str:
    free = tour.commissioned.results.get("free")
    ratio = _of(free.estimates, "damping ratio") if free is not None else None
    return value_of(ratio) if ratio is not None else "unknown size"


def _held(tour: Tour) -> str:
    """Which runs stuck."""
    stuck = [
        f"{run.frequency:g} Hz ({value_of(share)} of the time)"
        for each, run in zip(tour.comparison.findings, tour.runs, strict=True)
        if (share := _share(each)) is not None and share.interval[0] > 0
    ]
    free = len(tour.runs) - len(stuck)
    if not stuck:
        return "The contact never sticks in the runs measured."
    return f"It sticks at {', '.join(stuck)}{f'; in the other {free} runs it slides throughout' if free else ''}."


def _share(findings: Findings) -> Estimate | None:
    return _of(tuple(findings.estimates), "stuck share of the time")


def _squeaked(tour: Tour) -> list[str]:
    conditions = getattr(tour.squeaks, "conditions", ())
    return [f"The {condition.name} {condition.answer}." for condition in conditions]


def _advice(first: Proposal) -> str:
    return (
        f"To tell {first.pair[0]} from {first.pair[1]} friction still better, measure {first.frequency:g} Hz with "
        f"{1e3 * first.amplitude:.3g} mm next: there they differ most."
    )


def _lines(tour: Tour) -> list[Line]:
    """The numbers that a reader looks for, with the truth beside."""
    done, truth = tour.commissioned, tour.truth
    constants = done.known.require_constants()
    lines = [Line.of(estimate, truth.get(estimate.name)) for estimate in constants.estimates]
    if done.known.damping is not None:
        lines.append(Line.of(done.known.damping, truth.get("damping of the suspension")))
    for name, key in (("sliding friction", "kinetic friction"), ("contact stiffness", "contact stiffness")):
        each = _of(tour.laws.estimates, name)
        if each is not None:
            lines.append(Line.of(each, truth.get(key), name=f"{name}, by the law"))
    stick = done.results.get("stick")
    for name in ("contact stiffness", "coupled frequency"):
        each = _of(stick.estimates, name) if stick is not None else None
        if each is not None:
            lines.append(Line.of(each, truth.get(name), name=f"{name}, by ringing"))
    return lines


def _tables(tour: Tour) -> list[Table]:
    return [_runs(tour), _next(tour)] if tour.proposals else [_runs(tour)]


def _runs(tour: Tour) -> Table:
    """Every run in a row."""
    names = ("sliding friction", "stuck share of the time", "contact stiffness", "static over sliding friction")
    rows = []
    for each, run in zip(tour.comparison.findings, tour.runs, strict=True):
        cells = [value_of(one) if (one := _of(tuple(each.estimates), name)) else "–" for name in names]
        rows.append([f"{run.frequency:g} Hz", f"{1e3 * run.amplitude:g} mm", run.why, *cells])
    heads = ("base", "amplitude", "what for", "sliding friction", "stuck", "contact stiffness", "static over sliding")
    note = "Each run has its own section below, with intervals and figures; –: not asked, or not told by that run."
    return Table("What the runs tell", heads, rows, note)


def _next(tour: Tour) -> Table:
    rows = [
        [f"{p.frequency:g} Hz", f"{1e3 * p.amplitude:.3g} mm", f"{p.pair[0]} from {p.pair[1]}", f"{p.separation:.3g}"]
        for p in tour.proposals
    ]
    note = (
        "By how many standard deviations of a sample's noise two laws differ there, after what refitting could take "
        "up. next.toml holds these runs: stickslip acquire --runs next.toml."
    )
    return Table("What to measure next", ("base", "amplitude", "tells", "by"), rows, note, folded=True)


def _settings(tour: Tour) -> dict[str, str]:
    log = tour.commissioned.known.rig.log
    return dict(log.rows()) if log is not None else {}


def _data(tour: Tour) -> dict[str, object]:
    return {
        "rig": tour.commissioned.to_dict(),
        "runs": [run.model_dump() for run in tour.runs],
        "records": [of_findings(each).data() for each in tour.comparison.findings],
        "decay": of_findings(tour.decay).data(),
        "laws": tour.laws.to_dict(),
        "squeaks": of_comparison(tour.squeaks).data(),
        "next": [vars(proposal) for proposal in tour.proposals],
        "truth": dict(tour.truth),
    }
