"""The friction force from the motion: what is left of the balance of forces on the mass."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError, ModelError
from stickslip.identify.fusion import Balance, fuse
from stickslip.identify.motion import is_measured, require_fit
from stickslip.record.record import Record, Step
from stickslip.signals.delay import without_delays
from stickslip.signals.differentiate import (
    LEAST,
    METHODS,
    Filter,
    best_bandwidth,
    checked_bandwidth,
    noise_along,
    total_sd,
)
from stickslip.units import parse_value

Array = NDArray[np.float64]

QUESTION = "the friction force"
ENDS = ("ground", "base")
FUSIONS = {"fusion": ("x", "v", "a", "load"), "motion": ("x", "v", "a"), "load": ("x", "load")}
"""Methods that know how the sensors lie, and the channels that each uses, where they are there."""


def friction_force(
    record: Record,
    *,
    mass: float | str,
    stiffness: float | str,
    damping: float | str = 0.0,
    damper: str = "ground",
    method: str = "smoother",
    contact: str = "ground",
    bandwidth: float | str | None = None,
) -> Record:
    """How large is the friction force on the mass, at each moment?

    The balance of forces (thesis, section 2.4, with a damper and an applied force P)

    ``f = k z - k x - c v - m a + P``

    with the friction f positive where it opposes positive velocity. With ``damper="base"`` the damper sits between
    mass and base and ``c (v - dz/dt)`` stands for ``c v``. Without a channel z the base is taken to be fixed; without a
    channel ``force`` nothing is applied. What is not measured of v and a is differentiated, a from v if that is
    measured, else from x.

    With the smoother, and a not measured, every term passes the same low-pass, so that the result is the true force
    through that low-pass (``1 / (1 + lambda (2 - 2 cos w)^3)``, its bandwidth in the history) and noise: a jump of the
    friction is spread over half a cycle of the bandwidth. Where a is measured, the measured channels are used as they
    are, and v alone is smoothed, unless a bandwidth is given. With ``method="five-point"`` v and a are differenced and
    averaged as in the thesis's Appendix A, and x and z used as they are.

    Parameters
    ----------
    record : Record
        With ``x`` [m], and z, v, a, force [N] where measured. What an earlier call derived is derived afresh. Delays
        stated for these channels are taken out first, see :func:`~stickslip.signals.delay.without_delays`.
    mass : float or str
        Moving mass m [kg], or with its unit: ``"250 g"``.
    stiffness : float or str
        Of the spring between mass and base, k [N/m].
    damping : float or str
        Viscous damping c [N s/m].
    damper : {"ground", "base"}
        Where the damper's other end is fixed.
    method : {"smoother", "five-point", "fusion", "motion", "load"}
        The first two: how derivatives are taken, see :func:`~stickslip.signals.differentiate.differentiate`. The
        others put all sensors together by a Kalman smoother in which the friction wanders as much as the record
        says, sample by sample, and in which the mounts swing whose resonance is stated (``with_details("a",
        mount=(125, 0.1))``, and of a load cell ``inertia`` and ``discharge``): "fusion" with x, v, a and load where
        measured, "motion" without the load cell, "load" with x and load alone. ``friction_sd`` is then that of the
        smoother; it covers 94 % of the samples and more at two deviations, if the mounts are right.
    contact : {"ground", "base"}
        What the mass slides on. The force on the mass is the same; what it is held against (x, or x - z) is not, and
        the questions that follow are told by the history.
    bandwidth : float or str, optional
        The smoother's frequency of -3 dB [Hz]; chosen from the record's noise when not given.

    Returns
    -------
    Record
        With ``friction`` [N], ``friction_sd`` [N], and ``v`` [m/s] and ``a`` [m/s^2] where they were not measured.
        ``friction_sd`` is the standard deviation of each value: each channel's noise (stated for the channel, or
        estimated, varying in time where it does) through the whole filter from that channel to the force, and the
        smoothing bias (what a second pass would change). Errors of m, k, c and sensitivities are not in it.

    Raises
    ------
    RecordError
        A channel that is missing, not finite, on a broken clock or shorter than 24 samples; a force in N m.
    ModelError
        A constant that is not finite, a mass that is not positive, or an unknown damper or contact.
    EstimateError
        An unknown method, or a bandwidth that the record does not allow.

    Examples
    --------
    >>> t = np.arange(3000) / 1000
    >>> x = 1e-3 * np.sin(10 * t)  # m a + k x + f = 0 with m = 2, k = 100: f = (2 * 100 - 100) x
    >>> record = friction_force(Record.of({"x": x}, fs=1000.0), mass=2.0, stiffness=100.0)
    >>> bool(np.allclose(record["friction"][100:-100], 100 * x[100:-100], atol=1e-4))
    True
    """
    rig = _Rig.stated({"mass": mass, "stiffness": stiffness, "damping": damping}, damper, contact)
    record = _as_measured(record)
    if method in FUSIONS:
        return _fused(record, rig, method)
    if method not in METHODS:
        methods = ", ".join((*METHODS, *FUSIONS))
        raise EstimateError(f"method = '{method}'", f"the friction is found by one of {methods}", "choose one of them")
    used = ["x", *(name for name in ("z", "v", "a", "force") if name in record)]
    record.require_clean(*used, question=QUESTION, samples=LEAST)
    require_fit(record, *({"force"} & set(record)), length="m", question=QUESTION)
    record = without_delays(record, *used, question=QUESTION, samples=LEAST)
    known = "a" in record
    if bandwidth is not None:
        width = checked_bandwidth(bandwidth, record.fs, len(record))
    else:
        width = best_bandwidth(record["v" if "v" in record and not known else "x"], record.fs)
    derive = Filter(method, record.fs, width)
    one_filter = method == "smoother" and (bandwidth is not None or not known)

    force, variance, change = np.zeros(len(record)), np.zeros(len(record)), 0.0
    for name, through, terms in _paths(rig.balance(record), derive, one_filter):
        noise = noise_along(record[name], record.fs, record.channels[name].noise)
        force += through.apply(record[name], terms)
        variance += (through.noise_gain(len(record), terms) * noise) ** 2
        change += through.inner_gain(terms, change=True) ** 2 * float(np.mean(noise**2))
    ratio = math.sqrt(change / np.mean(variance)) if variance.any() else 0.0
    sd = total_sd(force, np.sqrt(variance), derive if one_filter else None, ratio)

    step = Step(
        "friction_force",
        {**asdict(rig), "method": method, "bandwidth": width if method == "smoother" else None},
        "; ".join(rig.words(record, method, width, one_filter)),
    )
    made = _with_motion(record, derive)
    made = made.with_channel("friction_sd", sd, unit="N", source="friction_force")
    return made.with_channel(
        "friction", force, unit="N", source="friction_force", noise=float(np.median(sd)), step=step
    )


def _fused(record: Record, rig: _Rig, method: str) -> Record:
    """The friction force by a smoother that knows the sensors."""
    needed = ["x", "load"] if method == "load" else ["x"]
    record.require(*needed, question=QUESTION)
    sensors = [name for name in FUSIONS[method] if name in record]
    used = [*sensors, *(name for name in ("z", "force") if name in record)]
    record.require_clean(*used, question=QUESTION, samples=LEAST)
    require_fit(record, *({"force", "load"} & set(used)), length="m", question=QUESTION)
    record = without_delays(record, *used, question=QUESTION, samples=LEAST)
    found = fuse(record, Balance(rig.mass, rig.stiffness, rig.damping, rig.damper), sensors)
    swinging = [f"{name} on a mount of {mount[0]:g} Hz" for name in sensors if (mount := record.channels[name].mount)]
    words = f"{', '.join(sensors)} together by a Kalman smoother; {', '.join(swinging) or 'no mounts stated'}"
    step = Step("friction_force", {**asdict(rig), "method": method}, f"{words}; contact against the {rig.contact}")
    made = record
    if "v" not in record:
        noise = float(np.median(found.velocity_sd))
        made = made.with_channel("v", found.velocity, unit="m/s", source="friction_force", noise=noise)
    if "a" not in record:
        made = made.with_channel("a", found.acceleration, unit="m/s^2", source="friction_force")
    made = made.with_channel("friction_sd", found.friction_sd, unit="N", source="friction_force")
    noise = float(np.median(found.friction_sd))
    return made.with_channel("friction", found.friction, unit="N", source="friction_force", noise=noise, step=step)


@dataclass(frozen=True)
class _Rig:
    mass: float
    stiffness: float
    damping: float
    damper: str
    contact: str

    @classmethod
    def stated(cls, constants: Mapping[str, float | str], damper: str, contact: str) -> _Rig:
        units = {"mass": "kg", "stiffness": "N/m", "damping": "N s/m"}
        values = {name: parse_value(constants[name], unit) for name, unit in units.items()}
        for name, value in values.items():
            if value < 0 or (name == "mass" and value == 0):
                raise ModelError(
                    f"{name} = {constants[name]}",
                    "a mass is positive, a stiffness or damping not negative",
                    f"state the rig's {name} in {units[name]}",
                )
        for word, end in (("damper", damper), ("contact", contact)):
            if end not in ENDS:
                raise ModelError(f"{word} = '{end}'", f"a {word} goes to the {' or the '.join(ENDS)}", "choose one")
        return cls(damper=damper, contact=contact, **values)

    def balance(self, record: Record) -> dict[str, dict[int, float]]:
        """Per channel, the coefficient of each order of its derivative in the friction force."""
        velocity = ("v", 0) if "v" in record else ("x", 1)
        acceleration = ("a", 0) if "a" in record else (velocity[0], velocity[1] + 1)
        terms: dict[str, dict[int, float]] = {"x": {0: -self.stiffness}}
        for (name, order), constant in ((velocity, self.damping), (acceleration, self.mass)):
            terms.setdefault(name, {})[order] = -constant
        if "z" in record:
            terms["z"] = {0: self.stiffness, 1: self.damping if self.damper == "base" else 0.0}
        if "force" in record:
            terms["force"] = {0: 1.0}
        return terms

    def words(self, record: Record, method: str, width: float, one_filter: bool) -> list[str]:
        """What was assumed and how derivatives were taken, for the history."""
        said = [
            "f = k z - k x - c v - m a"
            if "z" in record
            else "no channel z: the base is taken to be fixed, f = - k x - c v - m a"
        ]
        if "force" in record:
            said.append("the applied force is added")
        measured = [name for name in ("v", "a") if name in record]
        if measured:
            said.append(f"{' and '.join(measured)} as measured")
        if one_filter:
            said.append(f"all channels smoothed to {width:.4g} Hz (-3 dB)")
        elif method == "smoother" and len(measured) < 2:
            said.append(f"the velocity smoothed to {width:.4g} Hz (-3 dB)")
        elif method == "five-point":
            said.append("derivatives by central differences and five-point averages")
        said.append(f"contact against the {self.contact}")
        return said


def _paths(
    balance: Mapping[str, Mapping[int, float]], derive: Filter, one_filter: bool
) -> Iterator[tuple[str, Filter, dict[int, float]]]:
    """Which channel goes through which filter, with which coefficients."""
    as_measured = replace(derive, method="five-point")  # passes order 0 unchanged
    for name, terms in balance.items():
        if one_filter or derive.method == "five-point":
            yield name, derive, dict(terms)
            continue
        # Apart, for the smoother would smooth order 0 too; odd derivatives do not correlate with the sample itself.
        yield name, as_measured, {0: terms.get(0, 0.0)}
        if any(terms.get(order) for order in (1, 2)):
            yield name, derive, {order: c for order, c in terms.items() if order}


def _as_measured(record: Record) -> Record:
    """The record without what an earlier balance made, which would be taken for measured."""
    measured = {name: record[name] for name in record if is_measured(record, name)}
    return replace(record, samples=measured) if measured else record


def _with_motion(record: Record, derive: Filter) -> Record:
    """The record with v and a, each differentiated where it was not measured."""
    source, order = ("v", 0) if "v" in record else ("x", 1)
    wanted = {"v": (source, order), "a": (source, order + 1)}
    made = record
    for (name, (origin, times)), unit in zip(wanted.items(), ("m/s", "m/s^2"), strict=True):
        if name not in record:
            noise = noise_along(record[origin], record.fs, record.channels[origin].noise)
            level = derive.inner_gain({times: 1.0}) * float(np.sqrt(np.mean(noise**2)))
            values = derive.apply(record[origin], {times: 1.0})
            made = made.with_channel(name, values, unit=unit, source="friction_force", noise=level)
    return made
