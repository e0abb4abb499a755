"""Which law, or which curve, the records of a rig follow: what its settings make of them, fitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from stickslip.answers.preparation import normal_load, with_sensors
from stickslip.balance.force import friction_force
from stickslip.drives.kinds import HarmonicBase, Release
from stickslip.errors import ModelError, RecordError
from stickslip.law.fit_curve import CurveFit, fit_curve
from stickslip.law.start import CALIBRATION
from stickslip.law.which_law import LawComparison, compare_laws
from stickslip.laws.coulomb import Coulomb
from stickslip.oscillator import Oscillator
from stickslip.record.record import RIG_UNITS, Record
from stickslip.rig.settings import RigSettings

FRICTION = {"friction", "coefficient"}
BASE = HarmonicBase(0.0, frequency=1.0, contact="base")  # its motion is in the record
UNASKED = "stribeck"  # the curve of friction over the velocity, where nothing else can be fitted


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
    curve = curve or _only_curve(records[0], asked=bool(laws or system))
    if curve is not None and len(records) > 1:
        raise ModelError(f"a curve and {len(records)} records", "a curve is fitted to one", "give one of them alone")
    if curve is not None:
        friction = _with_friction(records[0], rig)
        return fit_curve(friction, curve=curve, contact=rig.contact, normal=_load(friction, rig)), [friction]
    found = compare_laws(records, _oscillator(rig, system), laws=laws, calibration=calibration, progress=progress)
    return found, list(records)


def _only_curve(record: Record, *, asked: bool) -> str | None:
    """The curve of a record that holds friction and velocity alone, unless laws were asked for."""
    if not asked and "x" not in record and FRICTION & set(record):
        return UNASKED
    if not {"x", "v"} & set(record):
        raise RecordError(
            f"no motion of the mass (the record has {', '.join(record)})",
            "a law is fitted to the displacement x or the velocity v of the mass",
            'name its column, as in channels={"x": "COLUMN [mm]"}',
        )  # fmt: skip
    return None


def _load(record: Record, rig: RigSettings) -> float | None:
    """The normal load as measured, or as the settings state it for the record's files."""
    files = [file["name"] for step in record.history for file in step.arguments.get("files", ())]
    return normal_load(record, rig, " + ".join(files), [])


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
        )  # fmt: skip
    told = {name: value for name in ("damping", "damper", "contact") if (value := getattr(rig, name)) is not None}
    return friction_force(record, mass=rig.mass, stiffness=rig.stiffness, **told)


def _oscillator(rig: RigSettings, system: object) -> Oscillator:
    """The oscillator as it is given, or as the settings state it; where its base moved is in the record."""
    if system is not None:
        if not isinstance(system, Oscillator):
            raise ModelError("a system of several masses", "a law is fitted to an oscillator of one", "give such a one")
        return with_stated(system, rig)
    constants = {name: getattr(rig, name) for name in ("mass", "stiffness")}
    if missing := [name for name, value in constants.items() if value is None]:
        raise ModelError(
            f"no {' and no '.join(missing)}", "a law is fitted by simulating the oscillator",
            f"give {' and '.join(f'{name}=' for name in missing)}",
        )  # fmt: skip
    drive = BASE if rig.contact == "base" else Release()
    numbers = {name: float(value or 0.0) for name, value in {**constants, "damping": rig.damping}.items()}
    return Oscillator(**numbers, damper=rig.damper, law=Coulomb(1.0), drive=drive)


def with_stated(system: Oscillator, rig: RigSettings) -> Oscillator:
    """The oscillator with what the settings state of it in front."""
    words = ("mass", "stiffness", "damping", "damper", "contact")
    stated = {name: getattr(rig, name) for name in words if name in rig.model_fields_set}
    stated = {n: float(v) if n in RIG_UNITS else v for n, v in stated.items() if v is not None}
    if "contact" in stated and not hasattr(system.drive, "contact"):
        if stated.pop("contact") == "base" and not isinstance(system.drive, Release):
            raise ModelError(
                f"contact = 'base' under a {type(system.drive).__name__}", "a base is what the drive moves",
                "leave contact= out, or give a drive of the base",
            )  # fmt: skip
        stated |= {"drive": BASE} if rig.contact == "base" else {}
    return system.having(**stated)
