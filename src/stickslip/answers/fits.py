"""Which law, or which curve, the records of a rig follow; and what it makes of records that it has not seen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.answers.arm import Joint, axis_record
from stickslip.answers.findings import record_name
from stickslip.answers.preparation import normal_load, with_sensors
from stickslip.balance.force import friction_force
from stickslip.cycle.joint import regress_joint
from stickslip.cycle.sticks import Sticks, find_sticks
from stickslip.drives.kinds import HarmonicBase, Release
from stickslip.errors import UNNAMED, EstimateError, ModelError, RecordError, StickslipError
from stickslip.estimate import Estimate, Result
from stickslip.law.fit_curve import CurveFit, fit_curve
from stickslip.law.law import LawFit, Traces
from stickslip.law.start import CALIBRATION
from stickslip.law.verdict import LawComparison
from stickslip.law.which_law import compare_laws, fit_law
from stickslip.laws.coulomb import Coulomb
from stickslip.oscillator import Oscillator
from stickslip.record.record import RIG_UNITS, Record
from stickslip.rig.settings import RigSettings
from stickslip.settings import read_toml
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_level, quantisation_step
from stickslip.solve.tables import require_oscillator
from stickslip.statistics import follows
from stickslip.systems.file import read_system
from stickslip.units import dimensions

FRICTION = {"friction", "coefficient"}
BASE = HarmonicBase(0.0, frequency=1.0, contact="base")  # its motion is in the record
UNASKED = "stribeck"  # the curve of friction over the velocity, where nothing else can be fitted
LAW = Path("law") / "law.toml"  # in the folder of a fit


def fit_records(
    records: Sequence[Record],
    *,
    rig: RigSettings,
    curve: str | None = None,
    laws: Sequence[str] | None = None,
    system: object = None,
    calibration: float = CALIBRATION,
    progress: Callable[[float], object] | None = None,
) -> tuple[CurveFit | LawComparison, list[Record]]:
    """Which friction law, or which curve, do the records of a rig follow?

    Laws are compared by :func:`compare_laws` on the oscillator that the settings state; a curve is fitted by
    :func:`fit_curve` to friction, measured or left over by :func:`friction_force`. A record of friction without a
    displacement is fitted to a Stribeck curve where nothing else is asked.

    Parameters
    ----------
    records : sequence of Record
        Of one rig; a curve is fitted to one.
    rig : RigSettings
        Mass, spring, damper, what the mass slides on, and the normal load, which makes a force of a coefficient.
    curve : str, optional
        A curve's name, as :func:`fit_curve` knows it, instead of laws.
    laws : sequence of str, optional
        The laws to compare; all of them where left out.
    system : Oscillator, optional
        Its constants, damper and contact where the rig states none, and its drive where the base's motion is not
        recorded.
    calibration : float
        By what part gains may be wrong.
    progress : callable, optional
        Told the share that is done, 0 to 1.

    Returns
    -------
    (CurveFit or LawComparison, list of Record)
        The answer, and what it was found from: of a curve the record with its friction.

    Raises
    ------
    RecordError
        No motion of the mass, or neither friction nor a mass.
    ModelError
        Mass or spring is not known, a curve is asked of several records, or the system has several masses.

    Examples
    --------
    >>> import stickslip as ss
    >>> rig = ss.rig.rig_settings({"mass": "2.42 kg", "stiffness": 2310})
    >>> found, _ = fit_records([ss.datasets.demo()], rig=rig, curve="coulomb")
    >>> print(found.parameters["kinetic"])
    sliding friction 1.102 N (95 %: 1.100 to 1.104)
    """
    records = [with_sensors(record, rig) for record in records]
    curve = curve or _only_curve(records[0], has_law=bool(laws or system))
    if curve is not None:
        return _curve_of(records, curve, rig)
    comparison = compare_laws(records, _oscillator(rig, system), laws=laws, calibration=calibration, progress=progress)
    return _weighed(comparison, rig), list(records)


def _curve_of(records: Sequence[Record], curve: str, rig: RigSettings) -> tuple[CurveFit, list[Record]]:
    """The curve of one record, and the record with the friction that it was fitted to."""
    if len(records) > 1:
        raise ModelError(f"a curve and {len(records)} records", "a curve is fitted to one", "give one of them alone")
    friction = _with_friction(records[0], rig)
    return fit_curve(friction, curve=curve, contact=rig.contact, normal=_load(friction, rig)), [friction]


def _weighed(comparison: LawComparison, rig: RigSettings) -> LawComparison:
    """Forces, spring and damper no surer than the mass is stated, by whose inertia all of them are found."""
    share = rig.mass.sd / rig.mass.value if isinstance(rig.mass, Estimate) else 0.0
    if not share:
        return comparison
    parameters = comparison.fit.parameters
    weighed = {name: one.widened(share) if "mass" in dimensions(one.unit) else one for name, one in parameters.items()}
    return replace(comparison, fit=replace(comparison.fit, parameters=weighed))


def _only_curve(record: Record, *, has_law: bool) -> str | None:
    """The curve of a record that holds friction and velocity alone, unless laws were asked for."""
    if not has_law and "x" not in record and FRICTION & set(record):
        return UNASKED
    if not {"x", "v"} & set(record):
        raise RecordError(
            f"no motion of the mass (the record has {', '.join(record)})",
            "a law is fitted to the displacement x or the velocity v of the mass",
            'name its column, as in channels={"x": "COLUMN [mm]"}',
            kind=UNNAMED,
        )
    return None


def _load(record: Record, rig: RigSettings) -> float | None:
    """The normal load as measured, or as the settings state it for the record's files."""
    files = [file["name"] for step in record.history for file in step.arguments.get("files", ())]
    load = normal_load(record, rig, " + ".join(files), [])
    return None if load is None else load.value


def _with_friction(record: Record, rig: RigSettings) -> Record:
    """The record with friction: measured, or what the motion leaves of the forces where the mass is known."""
    if FRICTION & set(record):
        return record
    if rig.mass is None:
        raise RecordError(
            f"neither friction nor a mass (the record has {', '.join(record)})",
            "a curve is fitted to friction: measured, or what the motion leaves of the forces on a known mass",
            'name its column, as in channels={"friction": "COLUMN [N]"}, or give mass= and stiffness= '
            "(0 where there is no spring)",
        )
    stated = {name: value for name in ("damping", "damper", "contact") if (value := getattr(rig, name)) is not None}
    return friction_force(record, mass=rig.mass, stiffness=rig.stiffness, **stated)


def _oscillator(rig: RigSettings, system: object) -> Oscillator:
    """The oscillator as it is given, or as the settings state it; where its base moved is in the record."""
    if system is not None:
        if not isinstance(system, Oscillator):
            raise ModelError("a system of several masses", "a law is fitted to an oscillator of one", "give such a one")
        return with_stated(system, rig)
    constants = {name: getattr(rig, name) for name in ("mass", "stiffness")}
    if missing := [name for name, value in constants.items() if value is None]:
        raise ModelError(
            f"no {' and no '.join(missing)}",
            "a law is fitted by simulating the oscillator",
            f"give {' and '.join(f'{name}=' for name in missing)}",
        )
    drive = BASE if rig.contact == "base" else Release()
    numbers = {name: float(value or 0.0) for name, value in {**constants, "damping": rig.damping}.items()}
    return Oscillator(**numbers, damper=rig.damper, law=Coulomb(1.0), drive=drive)


def with_stated(system: Oscillator, rig: RigSettings) -> Oscillator:
    """The oscillator with what the settings state of it in front."""
    names = ("mass", "stiffness", "damping", "damper", "contact")
    stated = {name: getattr(rig, name) for name in names if name in rig.model_fields_set}
    stated = {n: float(v) if n in RIG_UNITS else v for n, v in stated.items() if v is not None}
    if "contact" in stated and not hasattr(system.drive, "contact"):
        if stated.pop("contact") == "base" and not isinstance(system.drive, Release):
            raise ModelError(
                f"contact = 'base' under a {type(system.drive).__name__}",
                "a base is what the drive moves",
                "leave contact= out, or give a drive of the base",
            )
        stated |= {"drive": BASE} if rig.contact == "base" else {}
    return system.having(**stated)


# ---- records that the law has not seen


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(Result):
    """One record as a law predicts it.

    Attributes
    ----------
    record : Record
        What was measured, its sensors as stated.
    fit : LawFit
        The law as it was given, with what it predicts as ``traces``; the start of the motion alone was fitted.
    follows : mapping of str to float
        Of each channel how much the prediction follows [%], see :func:`predict`.
    plain : mapping of str to float
        The same of Coulomb's friction and a viscous damper, fitted to this very record; empty where the law is that, or
        where these could not be fitted.
    sticks : tuple of Sticks
        Stops as measured and as predicted, by the same question over the same time; empty where it can not be asked.
    how : str
        Of a joint, what moved it.
    """

    record: Record
    fit: LawFit
    follows: Mapping[str, float]
    plain: Mapping[str, float]
    sticks: tuple[Sticks, ...]
    how: str = ""

    @property
    def name(self) -> str:
        """Of the record."""
        return record_name(self.record) + self.how

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Stops per cycle and share of the time that sticks, as measured and as predicted."""
        return tuple(estimate for stuck in self.sticks for estimate in (stuck.per_cycle, stuck.share))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        units = {name: self.record.channels[name].unit for name in self.follows}
        traces = self.fit.traces[0]
        return {
            "name": self.name,
            "channels": {
                name: {
                    "follows": value, "plain": self.plain.get(name), "residual": self.fit.residual[name],
                    "noise": self.fit.noise[name], "unit": units[name], "from": float(traces.time[name][0]),
                    "to": float(traces.time[name][-1]),
                } for name, value in self.follows.items()
            },
            "stops": {
                which: {"per cycle": stuck.per_cycle.to_dict(), "share": stuck.share.to_dict()}
                for which, stuck in zip(("measured", "predicted"), self.sticks, strict=False)
            },
        }  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Predictions(Result):
    """Records as a law predicts them.

    Attributes
    ----------
    oscillator : Oscillator or Joint
        The law on its oscillator, as given; or the joint.
    parts : tuple of Prediction
        One for each record; of a joint's one inside its control loop, and one by its torque.
    notes : tuple of str
        What was left out, and why.
    """

    oscillator: Oscillator | Joint
    parts: tuple[Prediction, ...]
    notes: tuple[str, ...] = ()

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Of all records."""
        return tuple(estimate for part in self.parts for estimate in part.estimates)

    @property
    def least(self) -> Mapping[str, float]:
        """Of each channel the least that is followed in any record [%]."""
        names = dict.fromkeys(name for part in self.parts for name in part.follows)
        return {name: min(part.follows[name] for part in self.parts if name in part.follows) for name in names}

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        law = self.oscillator.law
        return {
            "law": type(law).__name__,
            "values": {key: value for key, value in vars(law).items() if isinstance(value, float)},
            "follows": dict(self.least),
            "records": [part.to_dict() for part in self.parts],
            "notes": list(self.notes),
        }


def read_fitted(path: str | Path, *, rig: RigSettings | None = None) -> Oscillator | Joint:
    """The oscillator with its law as a fit wrote it, or the joint as its log told it.

    Parameters
    ----------
    path : path
        The folder of a fit's or a joint's results, its ``law.toml``, or any file of a system.
    rig : RigSettings, optional
        Mass, spring, damper and contact, for a file that holds a law alone.

    Returns
    -------
    Oscillator or Joint

    Raises
    ------
    ModelError
        The file can not be read, holds a system of several masses, or a law alone and the settings lack the mass.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "law.toml"
    >>> _ = path.write_text("[law]\\nname = 'Coulomb'\\nkinetic = 1.1")
    >>> read_fitted(path, rig=RigSettings(mass=2.42, stiffness=2310)).law
    Coulomb(kinetic=1.1, static=None)
    """
    path = Path(path)
    if path.is_dir():  # of a joint's results, or where the law itself lies, no less than of a fit's
        files = (path / LAW, path / "joint" / LAW.name, path / LAW.name)
        path = next((file for file in files if file.is_file()), files[0])
    values, _ = read_toml(path, what="a fitted law is")
    if rig is not None and rig.mass is not None and rig.stiffness is not None:
        if "system" not in values:
            stated = {name: float(value) for name in RIG_UNITS if (value := getattr(rig, name)) is not None}
            drive = {"name": "HarmonicBase", "amplitude": 0.0, "frequency": 1.0, "contact": rig.contact}
            whole = {"system": {**stated, "damper": rig.damper}, "drive": drive, **values}
            return require_oscillator(read_system(whole).system, "a record is predicted")
    elif "joint" in values:
        return Joint.read(values["joint"])
    return require_oscillator(read_system(path).system, "a record is predicted")


def predict(
    records: Record | Sequence[Record],
    oscillator: Oscillator | Joint,
    *,
    rig: RigSettings | None = None,
    plain: bool = True,
    progress: Callable[[float], object] | None = None,
) -> Predictions:
    r"""How much of a record does a law explain that was fitted to others?

    The oscillator is simulated along the record, driven as the record was (its base's motion z or its applied force;
    else by the oscillator's own drive), and its motion read by the sensors as their channels state them. Fitted to the
    record are the displacement, velocity and memory at its first slide, an offset of each channel and, within its
    noise, the drive; no parameter of the law. Told is of each channel y, with the prediction :math:`\hat y`, the fit
    of system identification (one less the normalised root of the mean square; Ljung, System Identification, 1999,
    section 16.4):

    .. math:: 100 \left(1 - \frac{|y - \hat y|}{|y - \bar y|}\right) \%

    100 % is the record itself, 0 % no better than its mean, and below zero worse than that. What noise hides no law
    follows: the residual over the noise, ``fit.misfit``, is 1 where nothing but noise is left.

    A joint, as :func:`read_fitted` reads it from a joint's folder, is moved from the log's first sample on by the
    reference through its control loop, where its gain was stated, and by the torque that was measured, from each turn
    of the log on: nothing is fitted to that.

    Parameters
    ----------
    records : Record or sequence of Record
        As :func:`fit_law` takes them.
    oscillator : Oscillator or Joint
        With its law, as fitted.
    rig : RigSettings, optional
        What is stated of this rig goes before the oscillator's own constants; its sensors are the channels'.
    plain : bool
        Whether Coulomb's friction with a viscous damper is fitted to each record, to stand beside a richer law.
    progress : callable, optional
        Called with the share of the work that is done, 0 to 1.

    Returns
    -------
    Predictions

    Raises
    ------
    RecordError
        A channel is missing or broken.
    EstimateError
        No record, no motion above the noise, or no sliding.
    ModelError
        A system of several masses.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(
    ...     mass=2.42, stiffness=2310, law=ss.laws.Coulomb(1.1), drive=ss.drives.HarmonicBase(1.1e-3, frequency=8.7)
    ... )
    >>> bench = ss.Rig.perfect("x", "z").having("x", white=1e-6)
    >>> record = bench.measure(ss.simulate(slider, cycles=20), fs=2000, rng=1).rows(2000, 4000)
    >>> predict(record, slider).least["x"] > 99
    True
    >>> predict(record, slider.having(kinetic=0.8)).least["x"] < 95
    True
    """
    records = [records] if isinstance(records, Record) else list(records)
    if not records:
        raise EstimateError("no record", "a prediction is held against one record at least", "give one")
    if rig is not None:
        records = [with_sensors(record, rig) for record in records]
    if not isinstance(oscillator, Joint):
        require_oscillator(oscillator, "a record is predicted")
        oscillator = oscillator if rig is None else with_stated(oscillator, rig)
    parts = list[Prediction]()
    for number, record in enumerate(records):
        if isinstance(oscillator, Joint):
            parts += _moved(record, oscillator, plain=plain)
        else:
            parts.append(_predicted(record, oscillator, plain=plain))
        if progress:
            progress((number + 1) / len(records))
    return Predictions(oscillator, tuple(parts))


def _predicted(record: Record, oscillator: Oscillator, *, plain: bool) -> Prediction:
    """One record."""
    fit = fit_law(record, oscillator, free=[], intervals=False)
    baseline = _plain_follows(record, oscillator) if plain and oscillator.law != _coulomb(oscillator) else {}
    return Prediction(record, fit, _follows(fit), baseline, _stops(record, fit, oscillator))


def _coulomb(oscillator: Oscillator) -> Coulomb:
    """One level of friction, the law's own where it has one to begin at."""
    level = getattr(oscillator.law, "kinetic", None)
    return Coulomb(level if isinstance(level, float) and level > 0 else 1.0)


def _plain_follows(record: Record, oscillator: Oscillator) -> Mapping[str, float]:
    """How much Coulomb's friction and a damper follow, both fitted to the record; nothing where they can not be."""
    try:
        simple = oscillator.having(law=_coulomb(oscillator))
        return _follows(fit_law(record, simple, free=["kinetic"], nuisance=["damping"], intervals=False))
    except StickslipError:  # a baseline is no answer: without it the prediction stands by itself
        return {}


def _follows(fit: LawFit) -> dict[str, float]:
    """Of each channel how much of the first record is followed [%]."""
    traces = fit.traces[0]
    return {name: follows(measured, traces.fitted[name]) for name, measured in traces.measured.items()}


def _moved(record: Record, joint: Joint, *, plain: bool) -> Iterator[Prediction]:
    """One log as a joint moves by it: inside its control loop, and by its torque, as far as it has what these take."""
    log = axis_record(record, axis=None if {"theta", "x"} & set(record) else joint.axis or None)
    log = without_delays(log, question="a prediction of a joint")
    if "force" not in log and "current" in log and joint.torque_constant:
        log = log.with_channel("force", joint.torque_constant * log["current"], unit="N m", source="current")
    ways = {True: "reference" in log and joint.kp > 0, False: "force" in log}
    if not any(ways.values()):
        raise RecordError(
            f"neither a torque nor a gain for a reference (the log has {', '.join(log)})",
            "a joint is moved by its torque, or by its reference through a controller whose gain was stated",
            "name the column of the torque, or give --kp (and --kd, of a log with its torque) to stickslip joint",
        )
    simple = _plainly(log, joint) if plain else None
    for loop in (way for way, there in ways.items() if there):
        fit = _traced(log, joint, loop=loop)
        beside = {} if simple is None else _follows(_traced(log, simple, loop=loop))
        how = ", inside its control loop" if loop else ", by its torque from turn to turn"
        yield Prediction(log, fit, _follows(fit), beside, _stops(log, fit), how if all(ways.values()) else "")


def _plainly(log: Record, joint: Joint) -> Joint | None:
    """The joint with Coulomb's friction and a damper, both of this very log; None where that tells none."""
    given = {"kp": joint.kp or None, "torque_constant": joint.torque_constant or None}
    try:
        own = regress_joint(log, **given, gravity=bool(joint.sine or joint.cosine))
    except StickslipError:
        return None
    return joint.plainly(own.level.value, own.viscous.value) if own.level.known and own.viscous.known else None


def _traced(log: Record, joint: Joint, *, loop: bool) -> LawFit:
    """What a log measured, and what the joint makes of it."""
    place = "theta" if "theta" in log else "x"
    fitted = dict(zip((place, "force"), joint.moved(log, loop=loop), strict=True))
    names = [place, *(["force"] if loop and "force" in log else [])]
    traces = Traces(*({name: of[name] for name in names} for of in (dict.fromkeys(names, log.time), log, fitted)))
    residual = {name: float(np.std(log[name] - fitted[name])) for name in names}
    noise = {name: max(noise_level(log[name], log.fs), quantisation_step(log[name]) / 12**0.5, 1e-12) for name in names}
    of: Any = joint  # of which a prediction asks its law alone
    return LawFit(of, {}, np.eye(0), noise, residual, 0.0, len(log), 0, (traces,), "even")


def _stops(record: Record, fit: LawFit, oscillator: Oscillator | None = None) -> tuple[Sticks, ...]:
    """Stops as measured and as predicted, told by the same channels of the motion over the same rows."""
    traces = fit.traces[0]
    name = next((name for name in ("x", "v", "theta") if name in traces.measured), None)
    if name is None:
        return ()
    # by the speed, as the motion alone tells it: a prediction has no noise of other sensors to weigh
    first = round((float(traces.time[name][0]) - record.start) * record.fs)
    rows = slice(first, first + len(traces.time[name]))
    base = {"z": record["z"][rows]} if "z" in record else {}
    contact = getattr(oscillator.drive, "contact", None) if base and oscillator else None
    stops = []
    try:
        for values in (traces.measured, traces.fitted):
            motion = Record.of({name: values[name], **base}, fs=record.fs)
            for channel in motion:
                motion = motion.with_details(channel, delay=record.channels[channel].delay)
            stops.append(find_sticks(motion, contact=contact, method="speed"))
    except StickslipError:  # too short, or without cycles: the channels are told without
        return ()
    return tuple(stops)
