"""stickslip analyze, demo and impact: what driven records and a tap tell; fit and predict: by which law."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import stickslip as ss
from stickslip.cli import option
from stickslip.cli.records import (
    RIG_FILE,
    Places,
    answer_many,
    answer_together,
    answers,
    default_folder,
    files_of,
    folder_after,
    groups_of,
    name_left_out,
    on_twins,
    require_described,
    require_fits,
    rig_of,
    with_left_out,
)
from stickslip.cli.terminal import Output, complain, progress, publish
from stickslip.errors import ABSENT, INTERRUPTED, EstimateError
from stickslip.workers import processors

if TYPE_CHECKING:
    from stickslip import Record
    from stickslip.answers import Comparison, Findings, Predictions
    from stickslip.rig import RigSettings

twins_option = click.option(
    "--twins",
    type=click.IntRange(min=0),
    default=40,
    show_default=True,
    envvar="STICKSLIP_TWINS",
    show_envvar=True,
    metavar="N",
    help="Try the answers on N simulated rigs that may have written the record: their bias is taken off, and nothing "
    "is claimed that rigs without it show too. 0 for the quick answers, which are written first.",
)


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@option.constants()
@option.normal
@option.choice(
    "--method",
    ["auto", "fusion", "motion", "load", "smoother", "five-point", "F", "F1", "F2"],
    "How the friction is found: by all sensors together (fusion), by some, or by derivatives; auto says why.",
)
@twins_option
@option.many
@option.results("FILE-stickslip")
@option.reading
def analyze(files: tuple[str, ...], output: Output, method: str, twins: int, **options: Any) -> None:
    """Find the friction in one record or several.

    FILES that belong to one record are joined with +, as in x.mat+z.mat. A quoted pattern ("run_*.csv") stands for
    all files that fit. Several records are compared, with the normal load too where it is known.

    Of more than 20 records each is a row of one table, worked on by several processes, and an interrupted run goes on
    when it is called again.

    Results go into a folder: report.html to open in a browser, results.json, and the figures.

    \b
    stickslip analyze run.csv --channels "x=disp [mm]" --mass 3.08 --stiffness "1.19 N/mm"
    stickslip analyze "run_*.csv" --config rig.toml --normal "*250g*=2.45" --normal "*450g*=4.41"
    """
    places = Places.of(options)
    rig = rig_of(**options)
    groups = groups_of(*files)
    require_fits(options["normal"], groups)
    usual = default_folder(groups)
    if places.wanted(groups):
        chosen = click.get_current_context().get_parameter_source("twins") is not click.core.ParameterSource.DEFAULT
        query = {"method": method, "twins": twins if chosen else 0}
        answer_many("analyze", groups, rig, query, places, usual=usual, output=output)
        return
    with progress(2 * len(groups)) as tell:
        all_findings, refused = answers(
            groups,
            rig,
            lambda record: ss.analyze(record, rig=rig, method=method),
            tell,
            of_parts=lambda parts, say: ss.answers.analyze_blocks(parts, rig=rig, method=method, progress=say),
        )

    def together(findings: list[Findings]) -> Any:
        return with_left_out(ss.compare(findings) if len(findings) > 1 else findings[0], refused)

    name_left_out(refused)
    _deliver_sure(all_findings, twins, together, output.folder(usual), output)
    if all(findings.unanswered for findings in all_findings):
        raise SystemExit(1)


def _deliver_sure(
    all_findings: list[Findings],
    twins: int,
    together: Callable[[list[Findings]], Findings | Comparison],
    folder: Path | None,
    output: Output,
    **context: Any,
) -> None:
    """Deliver the results, tried on twins; the quick ones are written first, and stay where that is interrupted.

    Figures are drawn once, with what stays: they take longer than the quick answers do.
    """
    if not twins:
        output.deliver(together(all_findings), folder, **context)
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as beside:  # written here, while other processes look for the twins
        quick = beside.submit(publish, together(all_findings), folder, figures=False, **context)
        try:
            with progress(1) as tell:
                results = together([_tried(findings, twins, tell) for findings in all_findings])
            output.deliver(results, quick.result(), **context)
        except KeyboardInterrupt:
            if folder is None:
                raise
            complain(f"interrupted: {quick.result()} has the quick answers, not tried on twins, without figures.")
            sys.exit(INTERRUPTED)


def _tried(findings: Findings, twins: int, tell: Callable[..., None]) -> Findings:
    """The answers as their twins leave them; with a note of why, where the record has no twin."""

    def show_share(share: float) -> None:
        tell(f"trying the answers of {findings.name} on twins, {100 * share:.0f} %")

    show_share(0.0)
    return on_twins(findings, twins, processes=processors(), progress=show_share)


@click.command()
@option.path(
    "--output",
    "DIR",
    "Folder for the results.",
    callback=option.usable,
    default=Path("stickslip-demo"),
    show_default=True,
)
@option.json()
@option.everything
@twins_option
def demo(output: Path, as_json: bool, everything: bool, twins: int) -> None:
    """Analyse the bundled record of a simulated rig, with the true answers beside the estimates."""
    with progress(2) as tell:
        tell("reading the bundled record", 0)
        record = ss.datasets.demo()
        tell("analysing", 1)
        constants = {name: record.truth[name] for name in ("mass", "stiffness", "damping")}
        findings = ss.analyze(record, **constants)
    _deliver_sure([findings], twins, lambda parts: parts[0], output, Output(output, as_json, everything), form="csv")


@click.command()
@click.argument("file")
@click.option("--mass", metavar="VALUE", help="Moving mass in kg, which tells the contact's mode from the mounts'.")
@option.results("FILE-impact")
@option.reading
def impact(file: str, output: Output, **options: Any) -> None:
    """Which resonances does a hammer tap excite, and which sensor's mount are they?

    FILE holds the accelerometer (a) or the load cell (load), better both, and one tap on the mass while the base is
    held. The mounts that are found can be stated afterwards: --sensor "a.mount=125 Hz, 0.1".

    \b
    stickslip impact tap.csv --mass 2.42
    """
    rig = rig_of(**options)
    files = files_of(file, "a tap is one")
    with progress(1) as tell:
        tell(f"reading {file}", 0)
        record = require_described(ss.answers.read_mended(files, rig=rig))
        test = ss.balance.impact_test(record, mass=rig.mass)
    output.deliver(test, output.folder(folder_after(files[0], "impact")), record=record)


CURVES = (
    "coulomb", "viscous", "stribeck", "asymmetric", "tabulated", "dahl", "jenkins", "iwan", "maxwell", "aging", "slip",
)  # fmt: skip


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@option.constants()
@option.path(
    "--system",
    "SYSTEM.TOML",
    "File of the oscillator, as stickslip simulate reads it: its constants, and the drive where z is not recorded "
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
@option.results("FILE-fit")
@option.reading
def fit(
    files: tuple[str, ...],
    output: Output,
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
    folder = output.folder(default_folder(groups, "fit"))
    names = laws.split(",") if laws is not None else None
    given = {"--laws": laws, "--system": system}
    options = [word for name, value in given.items() if value is not None for word in (name, str(value))]
    count = f"{len(names) if names else 'six'} laws"
    with progress(2) as tell:
        tell("reading", 0)
        records = [ss.answers.read_mended(group, rig=rig) for group in groups]
        if len(records) == 1:
            require_described(records[0])
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
    output.deliver(result, folder, record=records, **context)


def _caused(error: ss.StickslipError, mistaken: Findings | None) -> ss.StickslipError:
    """The error, or the slip of the hand that shows in the records and is its likely cause."""
    if mistaken is None:
        return error
    value = f"{mistaken.name}: probably {mistaken.contradiction}"
    mended = " or ".join(ss.summary(mistaken).remedies)
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
@option.constants("Oscillating mass in kg; that of LAW unless given.")
@click.option(
    "--plain/--no-plain",
    default=True,
    show_default=True,
    help="Fit Coulomb friction and a damper to each record, to stand beside a richer law.",
)
@option.results("FILE-predicted")
@option.reading
def predict(law: Path, files: tuple[str, ...], output: Output, plain: bool, **options: Any) -> None:
    """Simulate a fitted law along other records, and say how much of them it follows.

    LAW is the folder that stickslip fit or joint wrote, its law.toml, or a file of a system as stickslip simulate reads
    it.
    FILES are records that the law was not fitted to. Unless columns are stated they are read by those of the record
    that it was, where a file has them. The base's motion z or the applied force drives the simulation as it was
    recorded, and the sensors read it as --config states them. Nothing is fitted to a record but how its motion begins
    and each sensor's zero. A joint is moved by its log's reference through its control loop, where the gains were
    stated, and by its torque from turn to turn. Several records are a table, one row a file.

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
    folder = output.folder(default_folder(groups, "predicted"))

    def together(predictions: list[Predictions]) -> Predictions:
        return replace(predictions[0], parts=tuple(part for one in predictions for part in one.parts))

    def ask(record: Record) -> Predictions:
        return ss.answers.predict(record, oscillator, rig=rig, plain=plain)

    answer_together(groups, rig, ask, together=together, folder=folder, output=output, reader=reader)
