"""The friction force from the motion: what is left of the balance of forces on the mass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.balance import (
    ALONE,
    FRICTION,
    Rig,
    as_measured,
    averaged_gain,
    felt,
    paths,
    stretch,
    with_friction,
    with_motion,
)
from stickslip.balance.fusion import fuse
from stickslip.balance.mass import mass_and_stiffness, stiffness_per_mass
from stickslip.balance.motion import is_measured, require_change, require_fit
from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import NORMAL_95, Constant, Estimate
from stickslip.record.record import Record, StatedRig, Step, require_record
from stickslip.signals.derivatives import (
    LEAST,
    METHODS,
    Filter,
    best_bandwidth,
    checked_bandwidth,
    differentiate,
    five_point_average,
    total_sd,
)
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_along

FUSIONS = {"fusion": ("x", "v", "a", "load"), "motion": ("x", "v", "a"), "load": ("x", "load")}
"""Methods that know how the sensors lie, and the channels that each uses, where they are there."""
THESIS = ("F", "F1", "F2")
INSTEAD = {"load": "motion", "F2": "F1"}  # what answers where there is no load cell
LOST = {
    "a": "without an accelerometer: reversals are seen through the displacement alone",
    "load": "without a load cell: the friction is only what is left of the motion",
}


def friction_force(
    record: Record,
    *,
    mass: Constant | None = None,
    stiffness: Constant | None = None,
    damping: Constant = 0.0,
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
        stated for these channels are taken out first, see :func:`~stickslip.signals.interpolate.without_delays`.
    mass : float, str, tuple or Estimate
        Moving mass m [kg]; or with its unit, ``"250 g"``, and with its standard uncertainty, ``"2.42 ± 0.02 kg"`` or
        ``(2.42, 0.02)``, which the friction does not feel: ``record.rig`` keeps it for the twins of a record. So may
        the next two.
    stiffness : float, str, tuple or Estimate
        Of the spring between mass and base, k [N/m].
    damping : float, str, tuple or Estimate
        Viscous damping c [N s/m].
    damper : {"ground", "base"}
        Where the damper's other end is fixed.
    method : {"smoother", "five-point", "fusion", "motion", "load", "F", "F1", "F2"}
        The first two: how derivatives are taken, see :func:`~stickslip.signals.derivatives.differentiate`. The
        next three put all sensors together by a Kalman smoother in which the friction wanders as much as the record
        says, sample by sample, and in which the mounts swing whose resonance is stated (``with_details("a",
        mount=(125, 0.1))``, and of a load cell ``inertia`` and ``discharge``): "fusion" with x, v, a and load where
        measured, "motion" without the load cell, "load" with x and load alone. ``friction_sd`` is then that of the
        smoother: two of it hold 93 to 97 % of the samples, if the mounts are right. Where the load cell or the
        accelerometer is missing, or at the end of its range, the others go on. With neither mass nor stiffness,
        "fusion" finds both from what the load cell measures, and "load" is the load cell alone: its reading through the
        inverse of its mount, less its flange's inertia. The last three are the thesis's
        (section 2.4): "F" is ``k z - k x - m a`` as read, "F1" its five-point average (A.1), "F2" the
        five-point average of the load cell less its flange's inertia (stated by ``with_details("load",
        inertia=0.05)``), for which neither mass nor stiffness is needed. Their ``friction_sd`` is that of noise: the
        swinging of mounts, 0.1 to 0.5 N on the thesis's rig, is not in it. A method that lacks a channel falls back,
        and the history says on what, and what is lost.
    contact : {"ground", "base"}
        What the mass slides on. The force on the mass is the same; what it is held against (x, or x - z) is not, and
        the questions that follow are told by the history.
    bandwidth : float or str, optional
        The smoother's frequency of -3 dB [Hz]; chosen from the record's noise when not given.

    Returns
    -------
    Record
        With ``friction`` [N], ``friction_sd`` [N], and ``v`` [m/s] and ``a`` [m/s^2] where they were not measured;
        ``friction_per_mass`` and ``friction_per_mass_sd`` [m/s^2] where neither mass nor stiffness is known, nor
        found.
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
    require_record(record)
    if method not in (*METHODS, *FUSIONS, *THESIS):
        methods = ", ".join((*METHODS, *FUSIONS, *THESIS))
        raise EstimateError(f"method = '{method}'", f"the friction is found by one of {methods}", "choose one of them")
    record = as_measured(record)
    requested, method = method, method if "load" in record else INSTEAD.get(method, method)
    require_change(record, "v", "a", "load", question=FRICTION)
    unknown = [name for name, value in (("mass", mass), ("stiffness", stiffness)) if value is None]
    constants = {"mass": mass, "stiffness": stiffness, "damping": damping, **dict.fromkeys(unknown, 1.0)}
    rig = Rig.stated(constants, damper, contact)
    if method == "F2" or (method == "load" and len(unknown) == 2):
        return felt(record, StatedRig(method, **{**asdict(rig), **dict.fromkeys(unknown)}))
    if method == "fusion" and len(unknown) == 2 and {"z", "load"} <= set(record):
        return _weighed(record, rig)
    if unknown:
        return _completed(record, rig, unknown, method, bandwidth)
    return _known(record, rig, method, requested, bandwidth)


def _known(record: Record, rig: Rig, method: str, requested: str, bandwidth: float | str | None) -> Record:
    """The friction force on a mass whose rig is known, by the method; another was `asked` where a channel lacks."""
    if method in FUSIONS:
        return _fused(record, rig, method, requested)
    if method in THESIS:
        return _balanced(record, rig, method, requested)
    return _smoothed(record, rig, method, bandwidth)


def _smoothed(record: Record, rig: Rig, method: str, bandwidth: float | str | None) -> Record:
    """The balance with derivatives by the smoother, or by differences and five-point averages."""
    record = _punctual(record)
    known = "a" in record
    if bandwidth is not None:
        width = checked_bandwidth(bandwidth, record.fs, len(record))
    else:
        width = best_bandwidth(record["v" if "v" in record and not known else "x"], record.fs)
    derive = Filter(method, record.fs, width)
    one_filter = method == "smoother" and (bandwidth is not None or not known)

    force, variance, change = np.zeros(len(record)), np.zeros(len(record)), 0.0
    for name, through, terms in paths(rig.terms(record), derive, one_filter=one_filter):
        noise = noise_along(record[name], record.fs, record.channels[name].noise)
        force += through.apply(record[name], terms)
        variance += (through.noise_gain(len(record), terms) * noise) ** 2
        change += through.inner_gain(terms, change=True) ** 2 * float(np.mean(noise**2))
    ratio = math.sqrt(change / np.mean(variance)) if variance.any() else 0.0
    sd = total_sd(force, np.sqrt(variance), derive if one_filter else None, ratio)

    stated = StatedRig(method, bandwidth=width if method == "smoother" else None, **asdict(rig))
    note = rig.words(record, method, width, one_filter=one_filter)
    return with_friction(with_motion(record, derive), force, sd, stated, note)


def _punctual(record: Record) -> Record:
    """The record, fit for a balance of forces, with the stated delays of what enters it taken out."""
    used = ["x", *(name for name in ("z", "v", "a", "force") if name in record)]
    record.require_clean(*used, question=FRICTION, samples=LEAST)
    require_fit(record, *({"force"} & set(record)), length="m", question=FRICTION)
    return without_delays(record, *used, question=FRICTION, samples=LEAST)


def _balanced(record: Record, rig: Rig, method: str, requested: str) -> Record:
    """The thesis's F, or F1: the balance of the forces as read, or its five-point average."""
    record = _punctual(record)
    derive = Filter("five-point", record.fs, 0.0)
    last = five_point_average if method == "F1" else np.asarray
    force, variance = np.zeros(len(record)), np.zeros(len(record))
    for name, terms in rig.terms(record).items():
        noise = noise_along(record[name], record.fs, record.channels[name].noise)
        force += last(derive.apply(record[name], terms))
        variance += (averaged_gain(len(record), derive, terms, last) * noise) ** 2
    notes = [
        *_lacking(record, requested, ("a", "load") if requested != method else ("a",)),
        *rig.words(record, "five-point", 0.0, one_filter=False),
        "averaged over five points" if method == "F1" else "as read",
    ]
    return with_friction(with_motion(record, derive), force, np.sqrt(variance), StatedRig(method, **asdict(rig)), notes)


def sensors_behind(record: Record) -> list[str]:
    """The sensors whose mounts are in the friction of a record, the load cell first."""
    method = "" if record.rig is None else record.rig.method
    by_cell = method in (ALONE, "F2") or ("friction" in record and record.channels["friction"].source == "load")
    sensors = ("load",) if by_cell else FUSIONS.get(method, ("a",))
    return [name for name in ("load", "a") if name in sensors and is_measured(record, name)]


def _lacking(record: Record, requested: str, wanted: Sequence[str]) -> list[str]:
    """What is lost for want of channels, for the history."""
    return [f"{LOST[name]} ({requested} asked for)" for name in wanted if name in LOST and name not in record]


def _weighed(record: Record, rig: Rig) -> Record:
    """The friction force by all sensors, with mass and stiffness from what the load cell measures."""
    mass, stiffness = mass_and_stiffness(record, damping=rig.damping, damper=rig.damper, contact=rig.contact)
    made = _fused(record, replace(rig, mass=mass.value, stiffness=stiffness.value), "fusion", "fusion")
    sd = np.sqrt(made["friction_sd"] ** 2 + (mass.sd * made["a"]) ** 2 + (stiffness.sd * stretch(made)) ** 2)
    note = f"m = {mass.value:.5g} kg and k = {stiffness.value:.5g} N/m from what the load cell measures"
    return _less_sure(made, sd, note)


def _less_sure(record: Record, sd: Array, note: str) -> Record:
    """A friction found with constants that are themselves found: its standard deviation, and what to say first."""
    last = record.history[-1]
    history = (*record.history[:-1], replace(last, outcome=f"{note}; {last.outcome}"))
    made = record.with_channel("friction_sd", sd, unit="N", source="friction_force")
    noise = float(np.median(sd))
    made = made.with_channel("friction", record["friction"], unit="N", source="friction_force", noise=noise)
    return replace(made, history=history)


def _completed(record: Record, rig: Rig, unknown: Sequence[str], method: str, bandwidth: float | str | None) -> Record:
    """The friction force with the mass or the stiffness from the record; per mass, with neither."""
    others = [*(["damping"] if rig.damping else []), *(["an applied force"] if "force" in record else [])]
    if others and len(unknown) == 2:
        raise ModelError(
            f"{' and '.join(others)} without mass and stiffness",
            "of forces only ratios can be found where no mass and no stiffness is known",
            f"give the mass or the stiffness, or leave {' and '.join(others)} out",
        )
    if "mass" in unknown and rig.stiffness == 0:
        raise ModelError("stiffness = 0 and no mass", "the mass is found from how a spring moves it", "give the mass")
    used = ["x", *(name for name in ("z", "a", "force") if name in record)]
    record.require_clean(*used, question=FRICTION)
    require_fit(record, *({"force"} & set(record)), length="m", question=FRICTION)
    punctual = without_delays(record, question=FRICTION, samples=LEAST)
    known = punctual["force"] if "force" in record else np.zeros(len(punctual))
    if rig.damping:
        across = -stretch(punctual) if rig.damper == "base" else punctual["x"]
        known = known - rig.damping * differentiate(across, record.fs).values
    over = {"stretched": known / rig.stiffness} if "mass" in unknown else {"resisting": -known / rig.mass}
    per_mass = stiffness_per_mass(punctual, contact=rig.contact, **(over if others else {}))
    if per_mass.value <= 0:
        raise EstimateError(
            f"k/m = {per_mass.value:.3g} 1/s^2 where it slides",
            "a spring pulls back: no mass or stiffness can be found with a sensor of the wrong sign",
            "correct the signs of x, z and a, or give mass and stiffness",
        )
    if len(unknown) == 2:
        return _per_mass(record, rig, per_mass, method, bandwidth)
    moving = rig.stiffness / per_mass.value if "mass" in unknown else rig.mass
    made = _known(record, replace(rig, mass=moving, stiffness=per_mass.value * moving), method, method, bandwidth)
    unsure = made["a"] if "mass" in unknown else per_mass.value * stretch(made)
    sd = np.hypot(made["friction_sd"], moving * per_mass.sd / per_mass.value * np.abs(unsure))
    return _less_sure(made, sd, _ratio(per_mass))


def _per_mass(record: Record, rig: Rig, per_mass: Estimate, method: str, bandwidth: float | str | None) -> Record:
    """The friction per mass, where neither mass nor stiffness is known."""
    method = "motion" if method in FUSIONS else method  # a force says nothing of a motion whose mass is not known
    made = _known(record, replace(rig, stiffness=per_mass.value), method, method, bandwidth)  # of a mass of 1 kg
    last = made.history[-1]
    note = "neither mass nor stiffness is known: the friction per mass is all that can be said"
    outcome = f"{note}; {_ratio(per_mass)}; {last.outcome}"
    step = Step("friction_force", {**last.arguments, "mass": None, "stiffness": None}, outcome)
    sd = np.hypot(made["friction_sd"], per_mass.sd * np.abs(stretch(made)))
    kept = {name: made[name] for name in made if name not in ("friction", "friction_sd")}
    bare = replace(made, samples=kept, channels={name: made.channels[name] for name in kept}, history=made.history[:-1])
    bare = bare.with_channel("friction_per_mass_sd", sd, unit="m/s^2", source="friction_force")
    bare = bare.with_channel("friction_per_mass", made["friction"], unit="m/s^2", source="friction_force", step=step)
    return bare if made.rig is None else replace(bare, rig=replace(made.rig, mass=None, stiffness=None))


def _ratio(ratio: Estimate) -> str:
    return f"k/m = {ratio.value:.5g} +- {NORMAL_95 * ratio.sd:.2g} 1/s^2 from how it slides"


def _fused(record: Record, rig: Rig, method: str, requested: str) -> Record:
    """The friction force by a smoother that knows the sensors."""
    record.require("x", question=FRICTION)
    sensors = [name for name in FUSIONS[method] if name in record]
    used = [*sensors, *(name for name in ("z", "force") if name in record)]
    whole = [name for name in used if name not in ("a", "load")]  # where these are silent the others speak
    record.require_clean(*whole, question=FRICTION, samples=LEAST)
    require_fit(record, *({"force", "load"} & set(used)), length="m", question=FRICTION)
    record = without_delays(record, *used, question=FRICTION, samples=LEAST)
    fusion = fuse(record, rig, sensors)
    swinging = [f"{name} on a mount of {mount[0]:g} Hz" for name in sensors if (mount := record.channels[name].mount)]
    notes = [
        *_lacking(record, requested, FUSIONS[requested]),
        f"{', '.join(sensors)} together by a Kalman smoother",
        ", ".join(swinging) or "no mounts stated",
        *fusion.lost,
        f"contact against the {rig.contact}",
    ]
    made = record
    if "v" not in record:
        noise = float(np.median(fusion.velocity_sd))
        made = made.with_channel("v_sd", fusion.velocity_sd, unit="m/s", source="friction_force")
        made = made.with_channel("v", fusion.velocity, unit="m/s", source="friction_force", noise=noise)
    if "a" not in record:
        made = made.with_channel("a", fusion.acceleration, unit="m/s^2", source="friction_force")
    stated = StatedRig(method, lost=fusion.lost, **asdict(rig))
    return with_friction(made, fusion.friction, fusion.friction_sd, stated, notes)
