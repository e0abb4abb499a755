"""What records say of sliding and friction before any law is tried on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.force import friction_force
from stickslip.drives.kinds import Release
from stickslip.errors import EstimateError
from stickslip.law.drive import as_driven, face_of
from stickslip.law.releases import Rests
from stickslip.laws.guessing import LEAST_EXCESS, Observed
from stickslip.oscillator import Oscillator
from stickslip.record.record import Record

Array = NDArray[np.float64]

FAST = 0.3  # of the largest speed, above which friction is that of sliding
SLOW = 0.05  # of it, below which the contact may hold
EDGE = 24  # samples at either end that a smoother knows less of


@dataclass(frozen=True, eq=False)
class Seen(Observed):
    """Sliding and friction of all records, and how friction stands around rest.

    Attributes
    ----------
    rests : Rests
        Friction around rest.
    """

    rests: Rests

    @classmethod
    def of(cls, records: Sequence[Record], oscillator: Oscillator) -> Seen:
        """What the sensors of the records say together of sliding and friction."""
        slips, speeds, frictions, steps, ways, rests = [], [], [], [], [], []
        for record in records:
            told = _told(as_driven(record, oscillator.drive), oscillator)
            inner = slice(EDGE, -EDGE)
            face, speed = face_of(oscillator.drive, told)
            x, v = told["x"] - face, told["v"] - speed
            slips.append(np.diff(x, append=x[-1])[inner])
            speeds.append(v[inner])
            frictions.append(told["friction"][inner])
            steps.append(np.full(len(slips[-1]), 1 / told.fs))
            ways.append(x[inner] - x[inner].mean())
            rests.append(_rests(told, speeds[-1], frictions[-1], ways[-1]))
        speed, friction = np.concatenate(speeds), np.concatenate(frictions)
        fast = np.abs(speed) > FAST * np.abs(speed).max()
        level = float(np.median((friction * np.sign(speed))[fast]))
        if not level > 0:
            still = not any({"z", "force"} & set(record) for record in records) and oscillator.drive == Release()
            raise EstimateError(
                f"friction of {level:.3g} N while it slides" + (", the base taken to be at rest" if still else ""),
                "friction opposes the velocity",
                "give the base's motion as channel z, or the drive; where the motion is imposed, fit a curve of "
                "friction (fit_curve, --curve)" if still
                else "correct the signs of the channels, or mass= and stiffness=",
            )  # fmt: skip
        way, around = float(np.std(np.concatenate(ways))), Rests.together(rests)
        return cls(
            np.concatenate(slips), speed, friction, np.concatenate(steps), level,
            _excess(speed, friction, level, around), float(np.std(speed)) / way, oscillator.mass, around,
        )  # fmt: skip


def _excess(speed: Array, friction: Array, level: float, rests: Rests) -> float:
    """By what part friction exceeds the level at a release, or at rest where there is none."""
    if rests.fall is not None:
        return max(LEAST_EXCESS, rests.fall.value)
    slow = np.abs(speed) < SLOW * float(np.abs(speed).max())
    reached = float(np.quantile(np.abs(friction[slow]), 0.9)) if slow.sum() > EDGE else level
    return max(LEAST_EXCESS, min(1.0, reached / level - 1))


def _rests(told: Record, speed: Array, friction: Array, way: Array) -> Rests:
    unsure = float(np.median(told["v_sd"])) if "v_sd" in told else 0.0
    frequency = float(np.std(speed)) / max(float(np.std(way)), 1e-300)
    return Rests.of(speed, friction, fs=told.fs, frequency=frequency, unsure=unsure)


def _told(record: Record, oscillator: Oscillator) -> Record:
    method = "fusion" if {"a", "load"} & set(record) else "smoother"
    return friction_force(
        record, mass=oscillator.mass, stiffness=oscillator.stiffness, damping=oscillator.damping,
        damper=oscillator.damper, method=method, contact=getattr(oscillator.drive, "contact", "ground"),
    )  # fmt: skip
