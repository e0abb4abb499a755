"""Which questions are asked of a record, in which order; and records side by side."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from stickslip.config import RigSettings
from stickslip.errors import EstimateError, ModelError, StickslipError
from stickslip.estimate import NORMAL_95, Estimate, Result
from stickslip.identify.force import friction_force
from stickslip.identify.loops import Loops, friction_loops
from stickslip.identify.motion import is_measured, slid_on
from stickslip.identify.regression import Regression, regress_friction
from stickslip.identify.sticks import Sticks, find_sticks
from stickslip.record.record import Record, Step
from stickslip.signals.delay import without_delays
from stickslip.signals.repair import (
    fill_gaps,
    fill_missing,
    remove_drift,
    remove_spikes,
    repair_clock,
    restore_clipped,
)
from stickslip.statistics import student

if TYPE_CHECKING:
    from stickslip.record.check import Fault

Answer = TypeVar("Answer")

USED = ("x", "z", "v", "a", "theta", "friction", "load", "force")  # channels that a question may take
CONSTANTS = ("mass", "stiffness", "damping", "damper")  # of the balance of forces


@dataclass(frozen=True, eq=False, repr=False)
class Findings(Result):
    """What a record says about its friction.

    Attributes
    ----------
    name : str
        The record's name: its file, or what the caller called it.
    record : Record
        The record, with the channel ``friction`` where it could be found.
    faults : tuple of Fault
        What the check-up found in the record as it was given.
    loops, sticks, regression, asymmetric : Loops, Sticks, Regression, Regression or None
        The answers to the questions that could be asked; `asymmetric` lets both directions differ.
    normal : float or None
        Normal load [N] on the contact, where stated or measured.
    notes : tuple of str
        What could not be asked, and why; what was assumed.
    settings : mapping
        The constants and choices that the answers rest on.
    """

    name: str
    record: Record
    faults: tuple[Fault, ...] = ()
    loops: Loops | None = None
    sticks: Sticks | None = None
    regression: Regression | None = None
    asymmetric: Regression | None = None
    normal: float | None = None
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def level(self) -> Estimate | None:
        """The sliding friction: from the loops, or the Coulomb term of the regression."""
        if self.loops is not None:
            return self.loops.level
        return self.regression.coulomb if self.regression is not None else None

    @property
    def coefficient(self) -> Estimate | None:
        """Sliding friction over the normal load, where both are known."""
        if self.level is None or self.normal is None or self.level.unit != "N":
            return None
        return self.level.scaled(1 / self.normal, "1", "friction coefficient")

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every number found, in the order of asking."""
        level = [self.coefficient] if self.coefficient is not None else []
        answers = (self.loops, self.regression, self.asymmetric, self.sticks)
        found = [*level, *(estimate for answer in answers if answer is not None for estimate in answer.estimates)]
        first: dict[str, Estimate] = {}
        for estimate in found:
            first.setdefault(estimate.name, estimate)
        return tuple(first.values())

    def true_value(self, estimate: Estimate) -> float | None:
        """The true value of what was estimated, where the record is simulated and tells it."""
        true = self.record.truth.get(estimate.name)
        return None if true is None else float(true)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON: settings, estimates, faults, notes and history."""
        told = {
            "name": self.name,
            "settings": dict(self.settings),
            "normal_load": self.normal,
            "estimates": [estimate.to_dict() for estimate in self.estimates],
            "regression_residual": None if self.regression is None else self.regression.residual,
            "truth": dict(self.record.truth),
            "faults": [str(fault) for fault in self.faults],
            "notes": list(self.notes),
            "history": [step.to_dict() for step in self.record.history],
        }
        return {key: plain(value) for key, value in told.items()}


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """Several records side by side.

    Attributes
    ----------
    findings : tuple of Findings
        One per record.
    coefficient : Estimate or None
        Slope of the line through the origin: friction over normal load.
    line : tuple of Estimate or None
        Slope and friction at no load of a straight line, where three loads or more allow it.
    notes : tuple of str
        What could not be compared, and why.
    """

    findings: tuple[Findings, ...]
    coefficient: Estimate | None = None
    line: tuple[Estimate, Estimate] | None = None
    notes: tuple[str, ...] = ()

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The fitted coefficient, and the line where there is one."""
        return (*([self.coefficient] if self.coefficient is not None else []), *(self.line or ()))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "comparison": {"estimates": [e.to_dict() for e in self.estimates], "notes": list(self.notes)},
            "records": [findings.to_dict() for findings in self.findings],
        }


def analyze(
    record: Record,
    *,
    rig: RigSettings | None = None,
    mass: float | str | None = None,
    stiffness: float | str | None = None,
    damping: float | str | None = None,
    damper: str | None = None,
    contact: str | None = None,
    method: str = "smoother",
) -> Findings:
    """Ask a record every question about friction that its channels allow.

    In this order: the check-up; the friction force (as measured, or from the force balance
    ``f = k z - k x - c v - m a``); the friction loops; sticks and slips; the regression of an applied force on
    acceleration, velocity and direction. A question that can not be answered becomes a note, not an error.

    Parameters
    ----------
    record : Record
        Displacement ``x`` [m] with `mass` and `stiffness`, or a measured ``friction`` or ``load`` [N], or an
        applied ``force`` [N].
    rig : RigSettings, optional
        The rig's constants, as :func:`read_rig` returns them; the arguments below go before it.
    mass, stiffness, damping : float or str, optional
        Oscillating mass [kg], spring [N/m], viscous damping [N s/m]; or text with a unit ("250 g").
    damper, contact : {"ground", "base"}, optional
        What the damper ends on, and what the mass slides on; the ground unless stated.
    method : {"smoother", "five-point"}
        How displacement is differentiated.

    Returns
    -------
    Findings

    Raises
    ------
    EstimateError
        None of the questions could be answered; the sentence says why.
    ModelError
        A constant that has no meaning.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.arange(4000) / 500
    >>> v = np.cos(2 * np.pi * time)
    >>> rng = np.random.default_rng(1)
    >>> friction = 1.5 * np.sign(v) + rng.normal(0, 0.01, time.size)
    >>> record = Record.of({"x": np.sin(2 * np.pi * time) / (2 * np.pi), "friction": friction}, fs=500)
    >>> round(analyze(record).level.value, 2)
    1.5
    """
    given = {"mass": mass, "stiffness": stiffness, "damping": damping, "damper": damper, "contact": contact}
    rig = _settings(rig, {key: value for key, value in given.items() if value is not None})
    asked = _Asked([], [])
    faults = tuple(record.check())
    known = [each for each in USED if each in record]
    whole = asked.ask("Stated delays", lambda: without_delays(record, *known)) if known else record
    whole = _with_friction(whole or record, rig, method, asked)
    contact = slid_on(whole, rig.contact if "contact" in rig.model_fields_set else None)
    loops = sticks = regression = asymmetric = None
    if "friction" in whole and _moves(whole):
        loops = asked.ask("Friction loops", lambda: friction_loops(whole, contact=contact))
    if _moves(whole):
        sticks = asked.ask("Sticks and slips", lambda: find_sticks(whole, contact=contact))
    if _moves(whole) and "force" in whole:
        regression = asked.ask("Regression", lambda: regress_friction(whole))
        if regression is not None:
            asymmetric = asked.ask("Asymmetric regression", lambda: regress_friction(whole, symmetric=False))
    name = record_name(record)
    if all(answer is None for answer in (loops, sticks, regression)):
        raise _nothing(name, record, asked.refusals)
    return Findings(
        name, whole, faults, loops, sticks, regression, asymmetric,
        normal=_normal_load(record, rig, name, asked.notes), notes=tuple(asked.notes),
        settings={**_balanced(whole), "contact": contact},
    )  # fmt: skip


def mend(record: Record, *, repairs: Sequence[str]) -> Record:
    """The record after repairs, made in the order given and each logged in its history.

    Parameters
    ----------
    record : Record
        As read.
    repairs : sequence of str
        ``clock`` (:func:`repair_clock`), ``gaps`` (:func:`fill_gaps`), ``missing`` (:func:`fill_missing`), ``spikes``
        (:func:`remove_spikes`), ``clipping`` (:func:`restore_clipped`), ``drift`` (:func:`remove_drift`). The last
        four take a channel, as in ``drift:x``; without one they mend the channels in which the check-up finds
        that fault.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        A repair that can not be made.
    ModelError
        A repair that is not known.

    Examples
    --------
    >>> import numpy as np
    >>> wave = np.sin(0.2 * np.arange(400))
    >>> wave[100:103] = np.nan
    >>> mended = mend(Record.of({"x": wave}, fs=100.0), repairs=["missing"])
    >>> bool(np.isfinite(mended["x"]).all()), mended.history[-1].action
    (True, 'fill_missing')
    """
    from stickslip.config import rig_settings

    for repair in rig_settings({"repair": list(repairs)}, source="the call").repair:
        word, _, channel = repair.partition(":")
        if word in _WHOLE:
            record = _WHOLE[word](record)
            continue
        kind, function = _PER_CHANNEL[word]
        found = [fault.channel for fault in record.check() if fault.kind == kind and fault.channel is not None]
        for name in [channel] if channel else dict.fromkeys(found):
            record = function(record, name)
    return record


_WHOLE: dict[str, Callable[[Record], Record]] = {"clock": repair_clock, "gaps": fill_gaps}
_PER_CHANNEL: dict[str, tuple[str, Callable[[Record, str], Record]]] = {
    "missing": ("missing", fill_missing),
    "spikes": ("spike", remove_spikes),
    "clipping": ("clipped", restore_clipped),
    "drift": ("drift", remove_drift),
}


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
    >>> rng, time = np.random.default_rng(1), np.arange(4000) / 500
    >>> def slide(load):
    ...     friction = 0.3 * load * np.sign(np.cos(2 * np.pi * time)) + rng.normal(0, 0.01, time.size)
    ...     x = np.sin(2 * np.pi * time) / (2 * np.pi)
    ...     return Record.of({"x": x, "friction": friction, "normal": np.full(time.size, load)}, fs=500)
    >>> round(compare([analyze(slide(load)) for load in (2.0, 4.0, 8.0)]).coefficient.value, 2)
    0.3
    """
    if len(findings) < 2:
        raise EstimateError(f"{len(findings)} record", "a comparison needs two or more", "give several files")
    known = [f for f in findings if f.normal is not None and f.level is not None and f.level.unit == "N"]
    left_out = {
        "The normal load of {} is not known; state it to fit the coefficient.": [f for f in findings if not f.normal],
        "No friction level was found for {}.": [f for f in findings if f.level is None],
        "The friction of {} is a torque: it is not set against a normal load.": [
            f for f in findings if f.level is not None and f.level.unit != "N"
        ],
    }
    notes = [words.format(", ".join(f.name for f in those)) for words, those in left_out.items() if those]
    if len(known) < 2:
        return Comparison(tuple(findings), notes=tuple(notes))
    loads = np.array([f.normal for f in known], dtype=float)
    levels, sds = (np.array([getattr(f.level, key) for f in known]) for key in ("value", "sd"))
    over = f"over {len(known)} records"
    (slope,) = _line(loads[:, None], levels, sds)
    scatter = math.sqrt(float(np.sum((levels - slope["value"] * loads) ** 2)) / (len(known) - 1))
    coefficient = Estimate.normal(
        "friction coefficient", **slope, unit="1", method=f"slope through the origin {over}",
        checks=(f"scatter about the line {scatter:.3g} N",),
    )  # fmt: skip
    line = None
    if len(np.unique(loads)) >= 3:
        slope, offset = _line(np.column_stack([loads, np.ones_like(loads)]), levels, sds)
        line = (
            Estimate.normal("slope of the line", **slope, unit="1", method=f"straight line {over}"),
            Estimate.normal("friction at no load", **offset, unit="N", method=f"straight line {over}"),
        )
        if not line[1].includes(0.0):
            coefficient = replace(coefficient, status="the line misses the origin: see friction at no load")
    else:
        notes.append("Fewer than three loads: whether the line passes through the origin can not be told.")
    return Comparison(tuple(findings), coefficient, line, tuple(notes))


def record_name(record: Record) -> str:
    """The names of the files that the record was last read from; of the first record, where two were joined."""
    own = (step.arguments for step in record.history if step.arguments.get("record") != "b")
    reads = [arguments["files"] for arguments in own if arguments.get("files")]
    if reads:
        return " + ".join(file["name"] for file in reads[-1])
    return "simulated record" if record.truth else "record"


@dataclass(frozen=True)
class _Asked:
    """What came of the questions so far: notes in words, and the errors behind those that failed."""

    notes: list[str]
    refusals: list[StickslipError]

    def ask(self, question: str, answer: Callable[[], Answer]) -> Answer | None:
        try:
            return answer()
        except ModelError:
            raise
        except StickslipError as error:
            self.notes.append(f"{question}: {error}")
            self.refusals.append(error)
            return None


def _settings(rig: RigSettings | None, given: Mapping[str, Any]) -> RigSettings:
    from stickslip.config import rig_settings

    return rig_settings({**(rig.model_dump(exclude_unset=True) if rig is not None else {}), **given}, source="the call")


def _balanced(record: Record) -> dict[str, Any]:
    """The constants and the method behind the friction force, where it comes from a balance of forces."""
    if "friction" not in record or is_measured(record, "friction"):
        return {}
    told = [step.arguments for step in record.history if step.action == "friction_force"][-1:]
    return {key.replace("method", "differentiation"): made[key] for made in told for key in (*CONSTANTS, "method")}


def _with_friction(record: Record, rig: RigSettings, method: str, asked: _Asked) -> Record:
    """The record with its friction force, where there is a way to it."""
    if is_measured(record, "friction"):
        unused = [key for key in CONSTANTS if key in rig.model_fields_set and getattr(rig, key) is not None]
        if unused:
            asked.notes.append(f"The friction was measured: {' and '.join(unused)} as stated {_are(unused)} not used.")
        return record
    if "x" in record and rig.mass is not None and rig.stiffness is not None:
        balanced = asked.ask(
            "Friction force",
            lambda: friction_force(
                record, mass=rig.mass or 0.0, stiffness=rig.stiffness or 0.0, damping=rig.damping or 0.0,
                damper=rig.damper, contact=rig.contact, method=method,
            ),
        )  # fmt: skip
        if balanced is not None and rig.damping is None:
            asked.notes.append("No damping was stated: viscous damping of the suspension, if any, counts as friction.")
        if balanced is not None:
            return balanced
    if "friction" in record:
        return record
    if "load" in record and "force" not in record:
        asked.notes.append(
            "The load cell's reading is taken as the friction force; inertia between both is part of it."
        )
        step = Step("analyze", {"friction": "load"}, "the load cell's reading taken as the friction force")
        return record.with_channel(
            "friction", record["load"], unit=record.channels["load"].unit, source="load", step=step
        )
    lacking = _lacking(record, rig)
    if lacking and "force" not in record:
        asked.notes.append(
            f"Friction force: without a measured friction or load it needs {' and '.join(lacking)}, not given."
        )
    return record


def _are(words: Sequence[str]) -> str:
    return "is" if len(words) == 1 else "are"


def _lacking(record: Record, rig: RigSettings) -> list[str]:
    missing = [key for key in ("mass", "stiffness") if getattr(rig, key) is None]
    return missing if "x" in record else ["a displacement x", *missing]


def _nothing(name: str, record: Record, refusals: list[StickslipError]) -> EstimateError:
    value = f"{name} answers no question about friction"
    if refusals:
        return EstimateError(f"{value}: {refusals[0].value}", refusals[0].rule, refusals[0].next_step)
    return EstimateError(
        f"{value}: its channels are {', '.join(f'{c.name} [{c.unit}]' for c in record.channels.values())}",
        "a displacement x or velocity v is needed, and a force, or mass and stiffness to find it",
        'name the columns, as in channels={"x": "COLUMN [mm]"}',
    )


def _moves(record: Record) -> bool:
    return any(name in record for name in ("x", "v", "theta"))


def _normal_load(record: Record, rig: RigSettings, name: str, notes: list[str]) -> float | None:
    """The normal load as measured, by its magnitude, or as stated for the file."""
    if "normal" in record:
        finite = record["normal"][np.isfinite(record["normal"])]
        mean = float(finite.mean()) if len(finite) else 0.0
        if mean < 0:
            notes.append(f"The normal load reads {mean:.4g} N: its magnitude is taken.")
        if mean:
            return abs(mean)
        notes.append("The channel normal tells no load: it holds " + ("zeros." if len(finite) else "no numbers."))
    loads = (rig.normal_load(part) for part in [*name.split(" + "), name])
    return next((load for load in loads if load is not None), None)


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


def plain(value: Any) -> Any:
    """Plain JSON data of anything that settings, truth or history may hold; a number not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)
