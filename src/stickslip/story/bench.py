"""A rig told: plan of an experiment, simulated record with its truth, what commissioning found, a whole experiment."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from stickslip.answers.experiment import ExperimentPlan
from stickslip.answers.findings import record_name
from stickslip.bench.calibration import Calibration
from stickslip.bench.response import ModalFit
from stickslip.bench.runs import Proposal, run_list
from stickslip.bench.steps import STEPS, BenchStep, Commissioned
from stickslip.bench.through import Tour
from stickslip.estimate import Estimate, Result, stands
from stickslip.figures.style import Plate, captioned
from stickslip.figures.traces import plot_calibrations, plot_plan, plot_response
from stickslip.files.write import require_form, write_record
from stickslip.laws.guessing import family_of
from stickslip.record.record import Record
from stickslip.story.findings import of_comparison, of_findings, plain
from stickslip.story.fit import of_laws
from stickslip.story.friction import of_sticks
from stickslip.story.story import Caution, Line, Story, Table, doubts, interval_of, logged, sentence, value_of

# What leads: of which step, and which of its numbers; the rest stands in the tables.
LEADING = (
    ("stick", "contact stiffness"), ("stick", "coupled frequency"), ("free", "natural frequency"),
    ("free", "damping ratio"), ("free", "lead of a over x"), ("discharge", "discharge time constant"),
    ("tap", "frequency of the mount of the accelerometer"), ("tap", "frequency of the mount of the load cell"),
)  # fmt: skip


def of_record(record: Record, *, form: str = "csv") -> Story:
    """A record, with what is true of it and what is wrong with it; its folder holds it too, in `form`."""
    require_form(form)
    faults = [str(fault) for fault in record.check()]
    true = [(name, f"{value:.6g}") for name, value in record.truth.items() if name != "events"]

    def write(folder: Path) -> None:
        write_record(record, folder / f"record.{form}")

    return Story.of_record(
        record_name(record),
        record,
        headline=[repr(record)],
        faults=faults,
        tables=[*([Table("What is true", ("what is true", "SI"), true)] if true else []), *logged(record)],
        data=lambda: {"fs": record.fs, "truth": dict(record.truth), "faults": faults},
        write=write,
    )


def of_plan(plan: ExperimentPlan, *, needs: Sequence[tuple[str, str]] = ()) -> Story:
    """Every setup with its accuracy, and the least that is enough for what is needed."""
    rows = [
        [f"{setup.fs:g}", ", ".join(setup.sensors), *(str(setup.accuracy[question]) for question in plan.questions)]
        for setup in plan.setups
    ]
    errors = f"Root-mean-square errors of {plan.draws} record{'s' * (plan.draws > 1)} at each rate."
    return Story(
        "Plan of an experiment",
        ["; ".join(_enough(plan, *need) for need in needs)] * bool(needs),
        notes=plan.refusals,
        tables=[Table("What each setup tells", ("fs [Hz]", "sensors", *plan.questions), rows, errors)],
        draw=lambda: [captioned("bench", "plan", partial(plot_plan, plan))],
        data=plan.to_dict,
    )


def _enough(plan: ExperimentPlan, question: str, error: str) -> str:
    setup = plan.enough(question, error)
    choice = f"{', '.join(setup.sensors)} at {setup.fs:g} Hz" if setup else "none of these"
    return f"{question} within {error}: {choice}"


def of_commissioned(done: Commissioned) -> Story:
    """The constants first; a table of the steps, and one of every number."""
    known = done.known
    constants = known.constants
    own = [*(constants.estimates if constants else ()), *([known.damping] if known.damping else [])]
    lines = [Line.of(estimate, done.true_value(estimate.name)) for estimate in own]
    lines += [Line.of(estimate, done.true_value(estimate.name, step)) for step, estimate in _leading(done)]

    def write(folder: Path) -> None:
        (folder / "rig.toml").write_text(known.toml(), encoding="utf-8")

    return Story(
        "Commissioning",
        [_headline(done)],
        _cautions(done),
        lines,
        tables=_tables(done),
        settings=_settings(done),
        draw=lambda: _plates(done),
        data=lambda: dict(plain(done.to_dict())),
        write=write,
    )


def _cautions(done: Commissioned) -> list[Caution]:
    """Why steps were refused, and what speaks against their numbers, at those that lead where it is theirs."""
    cautions = [Caution(f"{_title(name)} {why}") for name, why in done.refused.items()]
    leading = list(_leading(done))
    for name, result in done.results.items():
        flagged = [one for step, one in leading if step == name and not stands(one.status)]
        if flagged:
            cautions += doubts(flagged)
        elif not stands(status := str(getattr(result, "status", "ok"))):
            cautions.append(Caution(f"{_title(name)} {status}."))
    return cautions


def _headline(done: Commissioned) -> str:
    known = done.known
    constants = known.constants
    answered = f"{len(done.results)} step{'s' * (len(done.results) != 1)} answered"
    refused = f", {len(done.refused)} refused" if done.refused else ""
    if constants is None:
        return f"{answered}{refused}."
    mass, spring = constants.estimates
    damper = f" and a damper of {value_of(known.damping)}" if known.damping else ""
    return f"The rig is a mass of {value_of(mass)} on a spring of {value_of(spring)}{damper}: {answered}{refused}."


def _leading(done: Commissioned) -> Iterator[tuple[str, Estimate]]:
    for step, name in LEADING:
        for estimate in done.results[step].estimates if step in done.results else ():
            if estimate.name == name:
                yield step, estimate


def _title(name: str) -> str:
    return next((step.title for step in STEPS if step.name == name), name)


def _tables(done: Commissioned) -> list[Table]:
    asked = [step for step in STEPS if step.name in done.results or step.name in done.refused]
    rows = [[step.title, step.todo, _short(done, step)] for step in asked]
    tables = [Table("What was done", ("question", "at the rig", "answer"), rows)]
    truth = any(done.true_value(estimate.name, name) is not None for name, estimate in _numbers(done))
    heads = ("step", "quantity", "value", "95 % interval", *(["true value"] if truth else []))
    cells = [
        [
            name,
            estimate.name,
            value_of(estimate),
            interval_of(estimate),
            *([_true(done, name, estimate)] if truth else []),
        ]
        for name, estimate in _numbers(done)
    ]
    return [*tables, Table("Which number did each step find?", heads, cells, folded=True)]


def _numbers(done: Commissioned) -> Iterable[tuple[str, Estimate]]:
    return ((name, estimate) for name, result in done.results.items() for estimate in result.estimates)


def _true(done: Commissioned, step: str, estimate: Estimate) -> str:
    true = done.true_value(estimate.name, step)
    return "–" if true is None else value_of(estimate, true)


def _short(done: Commissioned, step: BenchStep) -> str:
    """The first numbers of a step, in a cell."""
    if step.name in done.refused:
        return f"refused: {done.refused[step.name]}"
    result = done.results[step.name]
    numbers = "; ".join(f"{estimate.name} {value_of(estimate)}" for estimate in _first(result))
    return numbers if stands(str(getattr(result, "status", "ok"))) else f"not to be trusted: {numbers}"


def _first(result: Result) -> tuple[Estimate, ...]:
    return tuple(estimate for estimate in result.estimates if estimate.known)[:3]


def _settings(done: Commissioned) -> dict[str, str]:
    """What rig.toml says, as it is written there: a key for each value; the log's as a person reads them."""
    return dict(_flat({key: value for key, value in done.known.settings().items() if key != "log"})) | _logged(done)


def _flat(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{key}.")
        else:
            yield before + key, ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def _plates(done: Commissioned) -> list[Plate]:
    sensors = {result.channel: result for result in done.results.values() if isinstance(result, Calibration)}
    plates = []
    sweep = done.results.get("sweep")
    if isinstance(sweep, ModalFit) and sweep.response is not None:
        plates.append(captioned("bench", "frequency-response", partial(plot_response, sweep)))
    if sensors:
        plates.append(captioned("bench", "calibration", partial(plot_calibrations, sensors)))
    return plates


def of_tour(tour: Tour) -> Story:
    """One page, as a lab would hand it in."""
    driven = [
        replace(of_findings(finding), title=f"The base at {run.frequency:g} Hz")
        for finding, run in zip(tour.comparison.findings, tour.runs, strict=True)
    ]
    parts = [
        replace(of_commissioned(tour.commissioned), title="The rig"),
        *driven,
        replace(of_findings(tour.decay), title="A free decay over the contact"),
        replace(of_laws(tour.laws), title="Which law is it?"),
        *(replace(of_findings(finding), title=finding.name.capitalize()) for finding in tour.squeaks.findings),
    ]

    def write(folder: Path) -> None:
        (folder / "rig.toml").write_text(tour.commissioned.known.toml(), encoding="utf-8")
        if tour.proposals:
            (folder / "next.toml").write_text(run_list(tour.proposals).toml(), encoding="utf-8")

    return Story(
        "Dry friction of an air-track slider",
        _abstract(tour),
        lines=_lines(tour),
        tables=[_runs(tour), _next(tour)] if tour.proposals else [_runs(tour)],
        parts=parts,
        settings=_logged(tour.commissioned),
        data=lambda: dict(plain(_data(tour))),
        write=write,
    )


def _abstract(tour: Tour) -> list[str]:
    """What was done and found, a sentence each."""
    known = tour.commissioned.known
    constants = known.require_constants()
    contact = _of(tour.laws.estimates, "contact stiffness")
    level = _of(tour.laws.estimates, "sliding friction")
    first = "None of the laws tried describes the friction"
    if tour.laws.family is not None:
        first = f"The friction is {family_of(tour.laws.candidates[0].name).said}"
    sentences = [
        f"{first}"
        + (f": it slides at {value_of(level)}" if level else "")
        + (f", and before it slides gives way like a spring of {value_of(contact)}." if contact else "."),
        f"The rig, commissioned from nothing, is a mass of {value_of(constants.mass)} on a spring of "
        f"{value_of(constants.stiffness)} with a damping ratio of {_ratio(tour)}.",
        _stuck_runs(tour),
        *_squeaked(tour),
    ]
    if tour.proposals:
        sentences.append(_advice(tour.proposals[0]))
    return sentences


def _of(estimates: tuple[Estimate, ...], name: str) -> Estimate | None:
    return next((estimate for estimate in estimates if estimate.name == name and estimate.known), None)


def _ratio(tour: Tour) -> str:
    free = tour.commissioned.results.get("free")
    ratio = _of(free.estimates, "damping ratio") if free is not None else None
    return value_of(ratio) if ratio is not None else "unknown size"


def _stuck_runs(tour: Tour) -> str:
    """Which runs stuck, and which only held as they turned round."""
    runs = [
        f"at {run.frequency:g} Hz {of_sticks(finding)}"
        for finding, run in zip(tour.comparison.findings, tour.runs, strict=True)
        if finding.sticks is not None
    ]
    return sentence(f"{'; '.join(runs)}.") if runs else "Whether the contact sticks is not told by any run."


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
        estimate = _of(tour.laws.estimates, name)
        if estimate is not None:
            lines.append(Line.of(estimate, truth.get(key), name=f"{name}, by the law"))
    stick = done.results.get("stick")
    for name in ("contact stiffness", "coupled frequency"):
        estimate = _of(stick.estimates, name) if stick is not None else None
        if estimate is not None:
            lines.append(Line.of(estimate, truth.get(name), name=f"{name}, by ringing"))
    return lines


def _runs(tour: Tour) -> Table:
    """Every run in a row."""
    names = ("sliding friction", "stuck share of the time", "contact stiffness")
    rows = []
    for finding, run in zip(tour.comparison.findings, tour.runs, strict=True):
        estimates = tuple(finding.estimates)
        cells = [value_of(one) if (one := _of(estimates, name)) else "–" for name in names]
        cells.append(_static_over_sliding(_of(estimates, "static over sliding friction")))
        rows.append([f"{run.frequency:g} Hz", f"{1e3 * run.amplitude:g} mm", run.why, *cells])
    of_contact = ("sliding friction", "contact holds", "contact stiffness", "static over sliding")
    heads = ("base", "amplitude", "what for", *of_contact)
    note = (
        "Each run has its own section below, with intervals and figures. The contact holds in its sticks, and briefly "
        "as it turns round; –: not asked, or not told by that run."
    )
    return Table("What the runs tell", heads, rows, note)


def _static_over_sliding(ratio: Estimate | None) -> str:
    """The ratio; where it may be 1, what it lies below."""
    if ratio is None or not ratio.known:
        return "–"
    low, high = ratio.interval
    return value_of(ratio) if low > 1 else f"below {high:.3g}" if math.isfinite(high) else "–"


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


def _logged(done: Commissioned) -> dict[str, str]:
    log = done.known.rig.log
    return dict(log.rows()) if log is not None else {}


def _data(tour: Tour) -> dict[str, object]:
    return {
        "rig": tour.commissioned.to_dict(),
        "runs": [run.model_dump() for run in tour.runs],
        "records": [of_findings(finding).data() for finding in tour.comparison.findings],
        "decay": of_findings(tour.decay).data(),
        "laws": tour.laws.to_dict(),
        "squeaks": of_comparison(tour.squeaks).data(),
        "next": [vars(proposal) for proposal in tour.proposals],
        "truth": dict(tour.truth),
    }
