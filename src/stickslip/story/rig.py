"""What the virtual rig gives, told: a record with its truth, or the plan of an experiment."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from stickslip.answers.experiment import ExperimentPlan
from stickslip.answers.findings import record_name
from stickslip.figures.experiment import plot_plan
from stickslip.figures.plate import plate
from stickslip.files.write import require_form, write_record
from stickslip.record.record import Record
from stickslip.story.story import Story, Table, logged

CAPTION = "Root-mean-square error against the sampling rate, for each choice of sensors."


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
        [f"{setup.fs:g}", ", ".join(setup.sensors), *(str(setup.accuracy[each]) for each in plan.questions)]
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
