"""Can everything that a record says be true at once? If not: what, and which channel it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stickslip.balance.balance import known_constants
from stickslip.balance.motion import is_measured, require_change
from stickslip.consistent.checks import FAILS, ONE_SLIP, Check, Slip, mixups, slip_check
from stickslip.consistent.forced_checks import (
    Seen,
    acceleration_check,
    energy_check,
    forces_check,
    identity_check,
    momentum_check,
    stops_check,
    velocity_check,
)
from stickslip.consistent.sensor_checks import cycle_checks, range_checks, sampling_check, silence_checks, silent
from stickslip.consistent.stated import Stated, stated_checks, what_fails
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Result
from stickslip.record.record import Record
from stickslip.signals.delay import without_delays

QUESTION = "the consistency of a record"
USED = ("x", "z", "v", "a", "load", "force")
FORCED = (acceleration_check, velocity_check, forces_check, energy_check, momentum_check, identity_check, stops_check)


@dataclass(frozen=True, eq=False, repr=False)
class Consistency(Result):
    """What must be true if everything stated is.

    Attributes
    ----------
    checks : tuple of Check
        In the order of asking.
    status : str
        "ok", or what can not all be true.
    slips : tuple of Slip
        What would make the channels agree, the likeliest first.
    """

    checks: tuple[Check, ...]
    status: str
    slips: tuple[Slip, ...] = ()

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that fail."""
        return tuple(check for check in self.checks if check.verdict == FAILS)

    @property
    def slip(self) -> str:
        """The one slip of the hand (a sign, two cables, a unit) that would make the channels agree; else empty."""
        return next((check.sentence for check in self.failed if check.name == ONE_SLIP), "")

    def __getitem__(self, name: str) -> Check:
        """The check of that name."""
        named = [check for check in self.checks if check.name == name]
        if not named:
            names = ", ".join(check.name for check in self.checks)
            raise EstimateError(f"no check '{name}'", f"there are {names}", "choose one of them")
        return named[0]

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {"checks": [check.to_dict() for check in self.checks], "status": self.status}

    def __repr__(self) -> str:
        return "\n  ".join([f"Consistency [{'ok' if self.status == 'ok' else 'not ok'}]:", *map(str, self.checks)])


def consistency(
    record: Record | Stated,
    *,
    mass: Constant | None = None,
    stiffness: Constant | None = None,
    damping: Constant | None = None,
    damper: str | None = None,
    tolerance: float = 0.01,
) -> Consistency:
    r"""Can everything that a record, or a row of a table, says be true at once?

    Of a record, over whole cycles, from the harmonics of each: is the acceleration that of the displacement; do the
    forces balance at the forcing frequency; does friction take what the base gives (closed integrals of ``k z dx``,
    of the load cell over x, and of the damper); is the mean force zero; does the identity :math:`\oint f (\dddot x +
    w^2 \dot x)\,dt = 0` hold, true of every friction law under a harmonic drive; can the mass slide without stops
    under this friction, or stop (Den Hartog's boundary; :math:`F \le \pi k Z / 4` for any contact); is a sensor at
    the end of its range; is a reversal sampled densely enough; do the channels belong to the same cycle. Where it does
    not add up, every sign, exchange and unit of one channel is tried that would make it.

    Of stated values: friction against what the base can give, against what the amplitude asks for, Den Hartog's
    boundary, and the transition speed (thesis, 3.4). A text's last digit tells its rounding: "0.51 mm" is rounded
    by 0.003 mm.

    Parameters
    ----------
    record : Record or mapping
        With ``x`` and what else was measured of z, v, a, load, force; stated delays, mounts and discharge are taken
        out. Or "mass", "stiffness", "damping", "forcing frequency", "base amplitude", "amplitude", "sliding friction",
        "contact stiffness", "transition speed", each a number in SI, a text with its unit, an Estimate, or (value,
        standard deviation).
    mass, stiffness, damping : float, str, tuple or Estimate, optional
        Of the rig; as :func:`~stickslip.friction_force` was told, where not given. For a record only.
    damper : {"ground", "base"}, optional
        Where the damper's other end is fixed.
    tolerance : float
        Share by which each sensor's calibration, and each stated constant, may be off (one standard deviation).

    Returns
    -------
    Consistency

    Raises
    ------
    RecordError
        No displacement, or a broken clock.
    EstimateError
        Stated values that do not make a motion, or a tolerance that is none.
    ModelError
        A stated value without meaning.

    Examples
    --------
    >>> row = {"mass": 2.42, "stiffness": 2310, "forcing frequency": 5.61, "base amplitude": "0.51 mm",
    ...        "amplitude": "0.49 mm", "sliding friction": "1.06 N", "contact stiffness": 201e3}
    >>> [check.name for check in consistency(row).failed]
    ['energy', 'friction that base and amplitude ask for', 'sliding without stops']
    """
    if not 0 < tolerance < 0.5:
        raise EstimateError(f"tolerance = {tolerance}", "a share between 0 and 0.5", "leave it at 0.01")
    if isinstance(record, Mapping):
        checks = tuple(stated_checks(record, tolerance))
        return Consistency(checks, what_fails(checks))
    rig = known_constants(record, mass=mass, stiffness=stiffness, damping=damping, damper=damper)
    record.require_clean("x", question=QUESTION)
    require_change(record, "x", question=QUESTION)
    measured = [name for name in USED if name in record and is_measured(record, name)]
    unheard = silent(record, measured)
    names = [name for name in measured if name not in unheard]
    record = without_delays(record, *names, question=QUESTION)
    seen = Seen.of(record, names, rig, tolerance, QUESTION)
    checks = (
        *silence_checks(record, unheard),
        *range_checks(record, names),
        *(check(seen) for check in FORCED),
        sampling_check(record, seen),
        *cycle_checks(record, seen),
    )
    slips: tuple[Slip, ...] = ()
    if any(check.verdict == FAILS for check in checks):
        slips = mixups(seen.balance)
        checks = (*checks, *slip_check(seen.balance, slips))
    return Consistency(checks, what_fails(checks), slips)
