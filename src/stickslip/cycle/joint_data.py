"""What is asked of a joint's log: its torque while it slides, and the columns that may explain it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import require_fit
from stickslip.cycle.joint_columns import Log, Sliding, sliding
from stickslip.errors import EstimateError, ModelError, RecordError
from stickslip.estimate import Constant, Estimate
from stickslip.record.record import Record, Step, require_record
from stickslip.signals.interpolate import without_delays
from stickslip.statistics import LeastSquares

Array = NDArray[np.float64]

QUESTION = "the friction of a joint"
LEAST = 200  # samples
ROWS = 20  # instants at which it slides


@dataclass(frozen=True)
class JointData:
    """What is regressed: the torque at the rows, and what was stated, each with its standard deviation's column."""

    logs: tuple[Log, ...]
    torque: Array
    terms: tuple[str, ...]
    source: str
    raw: Array
    known: Array
    unsure: tuple[Array, ...] = ()
    stated: dict[str, Estimate] = field(default_factory=dict)

    @property
    def followed(self) -> bool:
        """Whether every log has the reference, whose columns are the instruments."""
        return all(log.reference is not None for log in self.logs)

    def columns(
        self, terms: tuple[str, ...], load: float, pull: tuple[float, float], *, steered: bool = False
    ) -> Array:
        """The columns of all logs, one below the other."""
        return np.concatenate([log.columns(terms, load, pull, steered=steered) for log in self.logs])

    def model(self, fit: LeastSquares, terms: tuple[str, ...], pull: tuple[float, float]) -> Array:
        """What a fit, of these logs or of others, makes of the torque."""
        share = float(fit.coefficients[terms.index("load")]) if "load" in terms else 0.0
        bare = tuple(term for term in terms if term != "load")
        columns = self.columns(bare, share, pull)
        return np.asarray(self.known + columns @ fit.coefficients[[terms.index(term) for term in bare]])


def pooled(data: Sequence[JointData]) -> JointData:
    """Several logs as one."""
    first = data[0]
    joined = {name: np.concatenate([getattr(one, name) for one in data]) for name in ("torque", "raw", "known")}
    unsure = tuple(np.concatenate(columns) for columns in zip(*(one.unsure for one in data), strict=True))
    logs = tuple(log for one in data for log in one.logs)
    return JointData(logs, terms=first.terms, source=first.source, unsure=unsure, stated=first.stated, **joined)


def joint_data(record: Record, gravity: bool | None, **given: Constant | None) -> tuple[Record, JointData]:
    """The record with its torque, and what is asked of it under what is stated."""
    require_record(record)
    constants = _constants(record, **given)
    record = _torqued(record, constants)
    return record, _data_of(record, constants, turning(record) if gravity is None else gravity)


def turning(record: Record) -> bool:
    return "theta" in record or "x" not in record


def _constants(record: Record, **given: Constant | None) -> dict[str, Estimate]:
    """The stated constants, in the units of the motion."""
    torque = "N m" if turning(record) else "N"
    stiff, damped, heavy = ("N m/rad", "N m s/rad", "kg m^2") if turning(record) else ("N/m", "N s/m", "kg")
    units = {"inertia": heavy, "kp": stiff, "kd": damped, "torque_constant": f"{torque}/A"}
    stated = {name: Estimate.stated(name, value, units[name]) for name, value in given.items() if value is not None}
    for name, constant in stated.items():
        if constant.value < 0 or (constant.value == 0 and name != "kd") or not math.isfinite(constant.value):
            raise ModelError(
                f"{name} = {constant.value:g} {constant.unit}", f"a joint's {name} is positive", f"correct {name}="
            )
    return stated


def _torqued(record: Record, constants: dict[str, Estimate]) -> Record:
    """The record with a torque, from a current where it has none; delays taken out."""
    position = "theta" if turning(record) else "x"
    used = [name for name in (position, "reference", "force", "current") if name in record]
    record.require_clean(position, *used, question=QUESTION, samples=LEAST)
    record = without_delays(record, *used, question=QUESTION, samples=LEAST)
    if "force" not in record and "current" in record and "torque_constant" in constants:
        constant = constants["torque_constant"]
        step = Step("regress_joint", {"torque_constant": constant.value}, "torque of the current")
        unit = "N m" if turning(record) else "N"
        record = record.with_channel(
            "force", constant.value * record["current"], unit=unit, source="current", step=step
        )
    if "force" in record:
        require_fit(record, "force", length="rad" if position == "theta" else "m", question=QUESTION)
        return record
    if not ("reference" in record and "kp" in constants):
        lacks = "the current's torque_constant" if "current" in record else "kp" if "reference" in record else "force"
        raise RecordError(
            f"no torque: the record has {', '.join(record)}, and {lacks} is missing",
            f"{QUESTION} needs a torque: measured, of a current with its constant, or of a controller with its gains",
            "name the column of the torque (force=), give --torque-constant of a current, or --kp with the reference",
        )
    return record


def _data_of(record: Record, constants: dict[str, Estimate], gravity: bool) -> JointData:
    position = record["theta" if turning(record) else "x"]
    followed = "reference" in record
    reference = record["reference"] if followed else None
    if np.ptp(position) == 0:
        raise EstimateError("the position never changes", f"{QUESTION} needs motion", "check the column")
    slides = sliding(position, record.fs)
    _refuse_still(slides, record)
    log = Log(position, reference, slides)
    window, rows = slides.window, slides.rows
    terms = ["viscous", "forward", "back", *(("sine", "cosine", "load") if gravity else ())]
    known, unsure = np.zeros(len(rows)), []
    if "inertia" in constants:
        column = window.apply(position, 2)[rows]
        known, unsure = known + constants["inertia"].value * column, [constants["inertia"].sd * column]
    else:
        terms.insert(0, "inertia")
    if "force" in record:
        raw = record["force"]
        torque = window.apply(raw)[rows]
        scale = constants.get("torque_constant") if record.channels["force"].source == "current" else None
        source = "current" if scale else "force"
    else:
        assert reference is not None
        scale, source = constants["kp"], "reference"
        raw = scale.value * (reference - position)
        torque = window.apply(raw)[rows]
        if "kd" in constants:
            rate = window.apply(reference - position, 1)[rows]
            raw = raw + constants["kd"].value * window.apply(reference - position, 1)
            torque, unsure = torque + constants["kd"].value * rate, [*unsure, constants["kd"].sd * rate]
        else:
            terms.append("damping")
    if scale is not None:
        unsure.append(scale.sd / scale.value * torque)
    gain_sd = max((record.channels[name].gain_sd for name in ("force", "current") if name in record), default=0.0)
    unsure.append(gain_sd * torque)
    return JointData((log,), torque, tuple(terms), source, np.asarray(raw), known, tuple(unsure), constants)


def _refuse_still(slides: Sliding, record: Record) -> None:
    """Refuse a log that does not slide both ways for long enough."""
    ways = [int(np.sum(slides.side[slides.rows] == side)) for side in (1, -1)]
    if min(ways) >= ROWS // 2 and sum(ways) >= ROWS:
        return
    raise EstimateError(
        f"it slides steadily faster than {slides.slowest:.2g} rad/s at {ways[0]} instants forward and {ways[1]} back",
        f"friction is told from gravity by strokes both ways, {ROWS // 2} instants each at least",
        "swing it back and forth, farther or faster, through the same places",
    )
