"""Everything that is asked of a tribometer's record, and of several tests: coefficients by every definition."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from stickslip.answers.findings import Comparison, Findings, Inquiry, record_name, require_several
from stickslip.cycle.onset import Breakaway, breakaway
from stickslip.cycle.tribometer import DEFINITIONS, Coefficients, friction_coefficients
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Estimate, stands
from stickslip.record.record import Record, Step, require_record
from stickslip.rig.settings import RigSettings
from stickslip.statistics import mean_of_cycles


def analyze_tribometer(
    record: Record,
    *,
    normal: Constant | None = None,
    frequency: float | str | None = None,
    rig: RigSettings | None = None,
) -> Findings:
    """Ask a tribometer's record for its coefficient of friction by every definition in use.

    Parameters
    ----------
    record : Record
        Strokes to and fro, as :func:`~stickslip.cycle.friction_coefficients` takes them: ``friction`` [N] with ``x`` or
        ``v``, and ``normal`` [N] where the load was measured. A force called ``load`` or ``force`` is the friction
        where no other is.
    normal, frequency : optional
        The load and the strokes' frequency, as there.
    rig : RigSettings, optional
        States the load of a record of this name, where nothing else does.

    Returns
    -------
    Findings
        Its results: ``tribometer``, ``wear_in`` where it is told, and ``static``, the coefficient at breakaway, or a
        note of why it is not told.

    Raises
    ------
    RecordError, ModelError, EstimateError
        As of :func:`~stickslip.cycle.friction_coefficients`.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(40000) / 1000
    >>> v = 2e-3 * np.pi * 2 * np.cos(2 * np.pi * 2 * t)
    >>> friction = 3.0 * np.sign(v) + np.random.default_rng(0).normal(0, 0.02, t.size)
    >>> test = Record.of({"x": 2e-3 * np.sin(2 * np.pi * 2 * t), "friction": friction}, fs=1000)
    >>> analyze_tribometer(test, normal="10 N").tribometer.by_energy.includes(0.3)
    True
    """
    require_record(record)
    faults, inquiry = tuple(record.check()), Inquiry()
    if "friction" not in record and (felt := next((name for name in ("load", "force") if name in record), None)):
        step = Step("analyze_tribometer", {"friction": felt}, f"the friction is the {felt}")
        record = record.with_channel("friction", record[felt], unit="N", source=felt, step=step)
    if normal is None and rig is not None and "normal" not in record:
        normal = rig.normal_load(record_name(record))
    coefficients = friction_coefficients(record, normal=normal, frequency=frequency)
    away = inquiry.ask("Breakaway", partial(breakaway, record), aside=True)
    static = inquiry.ask("The static coefficient", partial(_static, coefficients, away), aside=True) if away else None
    results = {"tribometer": coefficients, "static": static, "wear_in": coefficients.wear_in}
    load = "measured" if coefficients.measured else f"{coefficients.load.value:.4g} N, stated"
    return Findings(
        record_name(record), record, faults, notes=tuple(inquiry.notes), settings={"normal load": load}, results=results
    )


def _static(coefficients: Coefficients, away: Breakaway) -> Estimate:
    """The static coefficient, of what the contact bears either way before it slips."""
    ways = [way for way in (away.forward, away.back) if way is not None and way.known]
    if len(ways) < 2 or not all(stands(way.status) for way in ways):
        raise EstimateError(
            "breakaway is not told both ways", "the static coefficient is of both", "sample it more often at reversals"
        )
    ends = zip(*(way.interval for way in ways), strict=True)
    low, high = (sum(end) / 2 / coefficients.load.value for end in ends)
    value = sum(way.value for way in ways) / 2 / coefficients.load.value
    sd = sum(way.sd for way in ways) / 2 / coefficients.load.value
    return Estimate("coefficient of friction, static", value, (low, high), sd, "1", ways[0].method).within(0.0)


def compare_tribometers(findings: Sequence[Findings]) -> Comparison:
    """The coefficients of several tests, and their mean over the tests by every definition.

    Parameters
    ----------
    findings : sequence of Findings
        Two or more, of :func:`analyze_tribometer`.

    Returns
    -------
    Comparison
        Its results: ``plateau``, ``by_stroke``, ``by_cycle`` and ``by_energy``, each the mean over the tests, its
        interval Student's t on the scatter between them, which is in no test's own interval.

    Raises
    ------
    EstimateError
        Fewer than two tests.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(20000) / 1000
    >>> x, v = 2e-3 * np.sin(4 * np.pi * t), np.cos(4 * np.pi * t)
    >>> tests = [Record.of({"x": x, "friction": force * np.sign(v)}, fs=1000) for force in (2.9, 3.0, 3.1)]
    >>> compare_tribometers([analyze_tribometer(test, normal=10.0) for test in tests]).plateau.includes(0.3)
    True
    """
    require_several(findings)
    results = {}
    for name in DEFINITIONS:
        coefficients = [getattr(one.tribometer, name) for one in findings]
        values = [one.value for one in coefficients]
        results[name] = mean_of_cycles(coefficients[0].name, values, unit="1", method="mean over the tests", of="test")
    return Comparison(tuple(findings), results=results)
