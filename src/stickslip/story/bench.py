"""A rig told: the plan of an experiment, a simulated record with its truth, and what commissioning found."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

from stickslip.answers.experiment import ExperimentPlan
from stickslip.answers.findings import record_name
from stickslip.bench.calibration import Calibration
from stickslip.bench.response import ModalFit
from stickslip.bench.steps import STEPS, BenchStep, Commissioned
from stickslip.estimate import Estimate, Result, stands
from stickslip.figures.bench import plot_calibrations, plot_plan, plot_response
from stickslip.figures.plate import Plate, plate
from stickslip.files.write import require_form, write_record
from stickslip.record.record import Record
from stickslip.story.findings import plain
from stickslip.story.story import Line, Story, Table, logged
from stickslip.story.words import Caution, interval_of, value_of

CAPTION = "Root-mean-square error against the sampling rate, for each choice of sensors."
# What leads: of which step, and which of its numbers; the rest stands in the tables.
LEADING = (
    ("stick", "contact stiffness"), ("stick", "coupled frequency"), ("free", "natural frequency"),
    ("free", "damping ratio"), ("free", "lead of a over x"), ("discharge", "discharge time constant"),
    ("tap", "frequency of the mount of the accelerometer"), ("tap", "frequency of the mount of the load cell"),
)  # fmt: skip
OFF_LINE = (
    "How far each level is off the straight line through all of them: scatter is how well the steps were set, a bow is "
    "a sensor that bends."
)
ANSWER = (
    "Averaged spectra, and the oscillator fitted line by line without their leakage: where a window is shorter than "
    "the resonance rings, H1 and H2 part and the coherence falls, and the fit is what to read."
)


def of_record(record: Record, *, form: str = "csv") -> Story:
    """A record, with what is true of it and what is wrong with it; its folder holds it too, in `form`."""
    require_form(form)
    faults = [str(fault) for fault in record.check()]
    true = [(name, f"{value:.6g}") for name, value in record.truth.items() if name != "events"]

    def write(folder: Path) -> None:
        write_record(record, folder / f"record.{form}")

    return Story.of_record(
        record_name(record), record, headline=[repr(record)], faults=faults,
        tables=[*([Table("What is true", ("what is true", "SI"), true)] if true else []), *logged(record)],
        data=lambda: {"fs": record.fs, "truth": dict(record.truth), "faults": faults}, write=write,
    )  # fmt: skip


def of_plan(plan: ExperimentPlan, *, needs: Sequence[tuple[str, str]] = ()) -> Story:
    """Every setup with its accuracy, and the least that is enough for what is needed."""
    rows = [
        [f"{setup.fs:g}", ", ".join(setup.sensors), *(str(setup.accuracy[question]) for question in plan.questions)]
        for setup in plan.setups
    ]
    errors = f"Root-mean-square errors of {plan.draws} record{'s' * (plan.draws > 1)} at each rate."
    return Story(
        "Plan of an experiment", ["; ".join(_enough(plan, *need) for need in needs)] * bool(needs), notes=plan.refusals,
        tables=[Table("What each setup tells", ("fs [Hz]", "sensors", *plan.questions), rows, errors)],
        draw=lambda: [plate("plan", partial(plot_plan, plan), "What each setup tells", CAPTION)], data=plan.to_dict,
    )  # fmt: skip


def _enough(plan: ExperimentPlan, question: str, error: str) -> str:
    setup = plan.enough(question, error)
    found = f"{', '.join(setup.sensors)} at {setup.fs:g} Hz" if setup else "none of these"
    return f"{question} within {error}: {found}"


def of_commissioned(done: Commissioned) -> Story:
    """The constants first; a table of the steps, and one of every number."""
    known, found = done.known, done.results
    constants = known.constants
    own = [*(constants.estimates if constants else ()), *([known.damping] if known.damping else [])]
    lines = [Line.of(estimate, done.true_value(estimate.name)) for estimate in own]
    lines += [Line.of(estimate, done.true_value(estimate.name, step)) for step, estimate in _leading(done)]
    cautions = [Caution(f"{_title(name)} {why}") for name, why in done.refused.items()]
    cautions += [
        Caution(f"{_title(name)} {status}.")
        for name, result in found.items()
        if not stands(status := str(getattr(result, "status", "ok")))
    ]

    def write(folder: Path) -> None:
        (folder / "rig.toml").write_text(known.toml(), encoding="utf-8")

    return Story(
        "Commissioning", [_headline(done)], cautions, lines, tables=_tables(done),
        settings=_settings(done), draw=lambda: _plates(done), data=lambda: dict(plain(done.to_dict())), write=write,
    )  # fmt: skip


def _headline(done: Commissioned) -> str:
    known = done.known
    constants = known.constants
    asked = f"{len(done.results)} step{'s' * (len(done.results) != 1)} answered"
    refused = f", {len(done.refused)} refused" if done.refused else ""
    if constants is None:
        return f"{asked}{refused}."
    mass, spring = constants.estimates
    damper = f" and a damper of {value_of(known.damping)}" if known.damping else ""
    return f"The rig is a mass of {value_of(mass)} on a spring of {value_of(spring)}{damper}: {asked}{refused}."


def _leading(done: Commissioned) -> Iterator[tuple[str, Estimate]]:
    for step, name in LEADING:
        for estimate in done.results[step].estimates if step in done.results else ():
            if estimate.name == name:
                yield step, estimate


def _title(name: str) -> str:
    return next((step.title for step in STEPS if step.name == name), name)


def _tables(done: Commissioned) -> list[Table]:
    rows = [
        [step.title, step.todo, _short(done, step)]
        for step in STEPS
        if step.name in done.results or step.name in done.refused
    ]
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
    return "; ".join(f"{estimate.name} {value_of(estimate)}" for estimate in _first(done.results[step.name]))


def _first(result: Result) -> tuple[Estimate, ...]:
    return tuple(estimate for estimate in result.estimates if estimate.known)[:3]


def _settings(done: Commissioned) -> dict[str, str]:
    settings = done.known.settings()
    flat = {key: str(value) for key, value in settings.items() if not isinstance(value, dict)}
    for name, table in settings.items():
        if isinstance(table, dict):
            flat |= {f"{name}.{key}": str(value) for key, value in table.items()}
    return flat


def _plates(done: Commissioned) -> list[Plate]:
    sensors = {result.channel: result for result in done.results.values() if isinstance(result, Calibration)}
    plates = []
    sweep = done.results.get("sweep")
    if isinstance(sweep, ModalFit) and sweep.response is not None:
        plates.append(plate("frequency-response", partial(plot_response, sweep), "The answer to the base", ANSWER))
    if sensors:
        plates.append(
            plate("calibration", partial(plot_calibrations, sensors), "How straight the sensors are", OFF_LINE)
        )
    return plates
