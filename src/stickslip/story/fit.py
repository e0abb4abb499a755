"""A fitted law, or several compared, in sentences, on a page and in a folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from stickslip.law.fit_curve import CurveFit
from stickslip.law.law import LawFit
from stickslip.law.which_law import LawComparison
from stickslip.parameters import unit
from stickslip.plot.law import law_plates
from stickslip.record.record import Record
from stickslip.story import page
from stickslip.story.folder import check_folder, results_folder, write_figures
from stickslip.story.law_files import write_law
from stickslip.story.summary import Line, Summary
from stickslip.story.words import doubts, interval_of, leading, number, value_of

LOUD = 0.3  # of the friction, that a curve leaves for noise


def fit_summary(result: LawComparison | LawFit | CurveFit, *, records: Sequence[Record], name: str) -> Summary:
    """What is told of a fit: the verdict, the parameters, how each law stands.

    Parameters
    ----------
    result : LawComparison, LawFit or CurveFit
        What :func:`compare_laws`, :func:`fit_law` or :func:`fit_curve` returned.
    records : sequence of Record
        What it was fitted to.
    name : str
        Title of the page.

    Returns
    -------
    Summary

    Examples
    --------
    >>> import stickslip as ss
    >>> record = ss.friction_force(ss.datasets.demo(), mass=2.42, stiffness=2310)
    >>> fit_summary(ss.fit_curve(record, curve="coulomb"), records=[record], name="demo").headline[0]
    'The friction follows the curve "coulomb": f = kinetic sign(v) + offset.'
    """
    lines = [
        Line(each.name, value_of(each), interval_of(each), None, each.method, each.status, each.checks)
        for each in result.estimates
    ]
    first = records[0]
    settings = {
        "records": str(len(records)), "sampling rate": f"{first.fs:g} Hz",
        "length": ", ".join(f"{record.duration:g} s" for record in records),
    }  # fmt: skip
    first_said = list(dict.fromkeys(words for record in records for words in leading(record.check())))
    told = result.status == "ok" or (isinstance(result, LawComparison) and result.status in result.verdict)
    unsaid = [each for each in result.estimates if each.status not in result.status]
    cautions = [*([] if told else [f"{result.status}."]), *doubts(unsaid)]
    if isinstance(result, CurveFit):
        headline = [*first_said, *_curve_told(result)]
        return Summary(name, headline, cautions, lines=lines, settings=settings,
                       channels=list(first.channels.values()), history=first.history)  # fmt: skip
    if isinstance(result, LawFit):
        return Summary(name, [*first_said, *_law_told(result)], cautions, lines=lines, notes=list(result.checks),
                       settings=settings, channels=list(first.channels.values()), history=first.history)  # fmt: skip
    verdicts = [(each.name, f"{each.standing.verdict} ({_values(each.oscillator.law)})") for each in result.candidates]
    return Summary(
        name, [*first_said, result.verdict], cautions, lines=lines, notes=[*result.checks, *result.fit.checks],
        settings=settings, verdicts=verdicts, channels=list(first.channels.values()), history=result.history,
    )  # fmt: skip


def _curve_told(found: CurveFit) -> Iterator[str]:
    follows = "the friction follows" if found.follows else "the friction does not follow"
    if found.follows and found.unexplained > LOUD:
        follows = f"as far as its noise lets it be seen, {follows}"
    yield f'{follows[0].upper()}{follows[1:]} the curve "{found.curve}": {found.formula}.'
    left = f"{found.unexplained:.1%} of the friction, {number(found.residual, found.residual / 100, found.unit)}"
    what = "It leaves" if found.follows else "The best of that kind leaves"
    yield f"{what} {left} root mean square; {found.model_error:.1%} is no noise."


def _law_told(found: LawFit) -> Iterator[str]:
    how = "fitted to" if found.parameters else "as it was given, predicts"
    surface = " on a rough surface" if found.surface == "rough" else ""
    yield f"The law {type(found.law).__name__}{surface}, {how} {', '.join(found.misfit)}: {_values(found.law)}."
    yield f"It leaves {', '.join(f'{times:.3g} times the noise of {name}' for name, times in found.misfit.items())}."


def _values(law: object) -> str:
    told = {key: value for key, value in vars(law).items() if isinstance(value, float)}
    return ", ".join(f"{key} {number(value, abs(value) / 1000, unit(law, key))}" for key, value in told.items())


def publish_fit(
    result: LawComparison | LawFit | CurveFit, *, folder: str | Path, records: Sequence[Record], name: str = "Fit"
) -> Path:
    """Write ``report.html``, ``results.json``, the figures and the law for other programs into a folder.

    The folder appears when all is written. An earlier one of ours is replaced; a folder that holds anything else is
    left alone.

    Parameters
    ----------
    result : LawComparison, LawFit or CurveFit
        What :func:`compare_laws`, :func:`fit_law` or :func:`fit_curve` returned.
    folder : path
        The folder to make.
    records : sequence of Record
        What it was fitted to.
    name : str
        Title of the page.

    Returns
    -------
    Path

    Raises
    ------
    ModelError
        The folder holds something that is not ours.
    RecordError
        The folder can not be written.

    Examples
    --------
    >>> import tempfile
    >>> import stickslip as ss
    >>> record = ss.friction_force(ss.datasets.demo(), mass=2.42, stiffness=2310)
    >>> found = ss.fit_curve(record, curve="coulomb")
    >>> folder = publish_fit(found, folder=Path(tempfile.mkdtemp()) / "fit", records=[record])
    >>> sorted(path.name for path in folder.iterdir())
    ['figures', 'law', 'report.html', 'results.json']
    """
    folder = Path(folder)
    check_folder(folder)
    section = page.section(fit_summary(result, records=records, name=name), law_plates(result), png=True)
    with results_folder(folder, fit_numbers(result)) as draft:
        (draft / "report.html").write_text(page.render([section]), encoding="utf-8")
        (draft / "figures").mkdir()
        write_figures(draft / "figures", "", section.plates)
        write_law(draft, result, records)
    return folder


def fit_numbers(result: LawComparison | LawFit | CurveFit) -> dict[str, object]:
    """A fit as plain data for JSON: SI numbers, None where a number does not exist.

    Parameters
    ----------
    result : LawComparison, LawFit or CurveFit
        What :func:`compare_laws`, :func:`fit_law` or :func:`fit_curve` returned.

    Returns
    -------
    dict

    Examples
    --------
    >>> import stickslip as ss
    >>> record = ss.friction_force(ss.datasets.demo(), mass=2.42, stiffness=2310)
    >>> fit_numbers(ss.fit_curve(record, curve="coulomb"))["curve"]
    'coulomb'
    """
    if isinstance(result, LawComparison | LawFit):
        return result.to_dict()
    return {
        "curve": result.curve, "formula": result.formula, "residual": result.residual,
        "unexplained": result.unexplained, "model_error": result.model_error, "follows": result.follows,
        "unit": result.unit, "status": result.status,
        "estimates": [each.to_dict() for each in result.estimates],
    }  # fmt: skip
