"""stickslip fit, and stickslip predict, which asks other records of the law that was fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli.records import (
    RIG_FILE,
    answer_together,
    constants_options,
    default_folder,
    groups_of,
    reading_options,
    result_options,
    rig_of,
)
from stickslip.cli.terminal import complain, deliver, progress
from stickslip.errors import ABSENT, EstimateError

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.answers import Findings, Predictions
    from stickslip.rig import RigSettings


CURVES = (
    "coulomb", "viscous", "stribeck", "asymmetric", "tabulated", "dahl", "jenkins", "iwan", "maxwell", "aging", "slip",
)  # fmt: skip


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@constants_options()
@click.option(
    "--system",
    type=click.Path(path_type=Path),
    metavar="SYSTEM.TOML",
    help="File of the oscillator, as stickslip simulate reads it: its constants, and the drive where z is not recorded "
    "(a base at a known amplitude and frequency, a belt, a ramp). It starts with the first sample, whatever its time.",
)
@click.option(
    "--laws",
    metavar="LIST",
    help="The laws to compare, with commas: Coulomb, static, Stribeck, compliant, state variable, LuGre (which "
    "are tried unless others are given), or any class of stickslip.laws, as Dahl.",
)
@click.option("--calibration", type=float, default=0.005, show_default=True, help="By what part gains may be wrong.")
@click.option(
    "--curve",
    type=click.Choice(CURVES),
    metavar="NAME",
    help="Fit a curve of friction instead: coulomb, viscous, stribeck, asymmetric, tabulated over the velocity, dahl, "
    "jenkins, iwan, maxwell over the displacement, aging, slip after a step of the speed. Friction is measured, or "
    "found from the motion, the force and --mass. The choice where a file holds friction and no displacement.",
)
@result_options("FILE-fit")
@reading_options
def fit(
    files: tuple[str, ...],
    output: Path | None,
    as_json: bool,
    everything: bool,
    laws: str | None,
    calibration: float,
    curve: str | None,
    system: Path | None,
    **rig_options: Any,
) -> None:
    """Find which friction law it is, with its parameters.

    FILES are records of one rig, best at several excitations: displacement or velocity of the mass, the base's motion
    z, and what else was measured (acceleration, load cell). Files that belong to one record are joined with +, as in
    x.mat+z.mat. Each law is simulated exactly and fitted to all records at once; told is which laws are kept, being
    not rejected, how sure that is, and the best law's parameters.

    Results go into a folder: report.html to open in a browser, results.json, and the figures.

    \b
    stickslip fit run_2.5Hz.csv run_8.7Hz.csv --mass 2.42 --stiffness 2310 --laws "Coulomb,compliant,LuGre"
    stickslip fit sweep.csv --channels "v=speed [mm/s]" --channels "friction=F [N]" --curve stribeck
    """
    rig = rig_of(**rig_options)
    groups = groups_of(*files)
    _require_one_question(groups, curve, has_law=laws is not None or system is not None)
    folder = output or (None if as_json else default_folder(groups, "fit"))
    names = laws.split(",") if laws is not None else None
    given = {"--laws": laws, "--system": system}
    options = [word for name, value in given.items() if value is not None for word in (name, str(value))]
    count = f"{len(names) if names else 'six'} laws"
    with progress(2) as tell:
        tell("reading", 0)
        records = [ss.answers.read_mended(group, rig=rig) for group in groups]
        tell("fitting", 1)
        mistaken = None if curve is not None else ss.answers.stated_wrongly(records, rig=rig)
        try:
            result, records = ss.answers.fit_records(
                records,
                rig=rig,
                curve=curve,
                laws=names,
                system=_oscillator(system),
                calibration=calibration,
                progress=lambda share: tell(f"fitting and comparing {count}, {100 * share:.0f} %", 1 + share),
            )
        except ss.StickslipError as error:
            raise _caused(error, mistaken) from error
    context: dict[str, Any] = {} if mistaken is None else {"mistaken": mistaken, "options": options}
    deliver(result, folder, as_json=as_json, everything=everything, record=records, **context)


def _caused(error: ss.StickslipError, mistaken: Findings | None) -> ss.StickslipError:
    """The error, or the slip of the hand that shows in the records and is its likely cause."""
    if mistaken is None:
        return error
    value = f"{mistaken.name}: probably {mistaken.contradiction}"
    mended = ss.summary(mistaken).remedy
    return EstimateError(
        value, "no law is fitted until that is mended", f"begin with {mended}" if mended else "mend it"
    )


def _require_one_question(groups: list[list[Path]], curve: str | None, *, has_law: bool) -> None:
    if curve is not None and has_law:
        raise click.BadParameter(
            "a curve or laws are fitted, not both; leave one out", param_hint="--curve, --laws, --system"
        )
    if curve is not None and len(groups) > 1:
        raise click.BadParameter(f"a curve is fitted to one record, not to {len(groups)}", param_hint="FILES")


def _oscillator(file: Path | None) -> object:
    """The system of a file; whether it is of one mass is for the fit to say."""
    return None if file is None else ss.systems.read_system(file).system


def _fitted_reading(law: Path, rig: RigSettings) -> dict[str, Any]:
    """How the record was read that the law was fitted to; nothing where the rig names columns itself."""
    file = (law / "law" if law.is_dir() else law.parent) / RIG_FILE
    if rig.channels or not file.is_file():
        return {}
    complain(f"columns by {file}, of files that have them")
    stated = rig.reading()
    return {name: value for name, value in ss.rig.read_rig(file).reading().items() if value and not stated[name]}


def _read(files: Sequence[Path], rig: RigSettings, names: Sequence[str], *, fitted: Mapping[str, Any]) -> Record:
    """The record by the columns of the fit, by its own where it has none of that name."""
    try:
        return ss.answers.read_mended(files, rig=rig.model_copy(update=fitted), names=names)
    except ss.errors.RecordError as error:
        if not fitted or error.kind != ABSENT:
            raise
    return ss.answers.read_mended(files, rig=rig, names=names)


@click.command()
@click.argument("law", type=click.Path(path_type=Path, exists=True), metavar="LAW")
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@constants_options("Oscillating mass in kg; that of LAW unless given.")
@click.option(
    "--plain/--no-plain",
    default=True,
    show_default=True,
    help="Fit Coulomb friction and a damper to each record, to stand beside a richer law.",
)
@result_options("FILE-predicted")
@reading_options
def predict(
    law: Path, files: tuple[str, ...], output: Path | None, as_json: bool, everything: bool, plain: bool, **options: Any
) -> None:
    """Simulate a fitted law along other records, and say how much of them it follows.

    LAW is the folder that stickslip fit wrote, its law/law.toml, or a file of a system as stickslip simulate reads it.
    FILES are records that the law was not fitted to. Unless columns are stated they are read by those of the record
    that it was, where a file has them. The base's motion z or the applied force drives the simulation as it was
    recorded, and the sensors read it as --config states them. Nothing is fitted to a record but how its motion begins
    and each sensor's zero. Several records are a table, one row a file.

    Told is of each channel 100 (1 - |y - yhat| / |y - mean y|) %, the fit of system identification.

    Results go into a folder: report.html to open in a browser, results.json, and the figures.

    \b
    stickslip fit slow.csv --mass 2.42 --stiffness 2310 --damping 0.12
    stickslip predict slow-fit fast.csv
    """
    rig = rig_of(**options)
    reader = partial(_read, fitted=_fitted_reading(law, rig))
    oscillator = ss.answers.read_fitted(law, rig=rig)
    groups = groups_of(*files)
    folder = output or (None if as_json else default_folder(groups, "predicted"))

    def together(predictions: list[Predictions]) -> Predictions:
        return replace(predictions[0], parts=tuple(part for one in predictions for part in one.parts))

    def ask(record: Record) -> Predictions:
        return ss.answers.predict(record, oscillator, rig=rig, plain=plain)

    answer_together(
        groups, rig, ask, together=together, folder=folder, as_json=as_json, everything=everything, reader=reader
    )
