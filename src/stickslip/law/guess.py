"""What records say of sliding and friction before any law is tried on them.

Which rigid law it is, by the friction around rest: whether it falls at a release, or with the speed, or not.

A simulated motion carries what a rough surface did to one stroke into the next, so that one level of friction can feign
a static one. The friction that all sensors tell together does not: what it is at a release, and slowly sliding, is held
against its level in the same stroke.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.force import friction_force
from stickslip.drives.kinds import Release
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Estimate
from stickslip.law.drive import as_driven, face_of
from stickslip.laws.guessing import LEAST_EXCESS, Observed
from stickslip.oscillator import Oscillator
from stickslip.record.record import Record

Array = NDArray[np.float64]

FAST = 0.3  # of the largest speed, above which friction is that of sliding
SLOW = 0.05  # of it, below which the contact may hold
EDGE = 24  # samples at either end that a smoother knows less of

CREEPING, AT_REST = 0.08, 0.02  # of the largest speed: hardly sliding, and not at all
NOISY = 4.0  # deviations of the velocity, below which it may be at rest
HELD = 0.4  # of a radian of the motion that a contact holds at least, for a release to be told
LEAST, FEW = 24, 8  # samples of a hold, and of slow sliding
CORNER, AFTER = 3, 15  # samples after a release within which a sudden fall is blurred, and is over
ROUNDED = 0.01  # of the level, that smoothing alone makes of a corner
GAINS = 1.0  # calibrations by which the level at rest, told by the springs, is off that in sliding
EXCESSES = np.linspace(0.0, 0.6, 121)[1:]
FALLS = np.geomspace(0.03, 1.0, 16)  # Stribeck speed over the largest speed


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
                "friction (fit_curve, --curve)"
                if still
                else "correct the signs of the channels, or mass= and stiffness=",
            )
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


@dataclass(frozen=True, eq=False)
class Rests:
    """Friction around rest, over its level in fast sliding.

    Attributes
    ----------
    falls : ndarray (n,)
        Of each release: by how much the friction falls at once.
    rises : ndarray (q,)
        Of each start and each end of a stroke: by how much it is larger in slow sliding.
    shapes : ndarray (q, 16)
        Mean of ``exp(-(v/v_s)^2)`` there, for each v_s of FALLS.
    strays : ndarray
        Of each stroke: standard deviation in fast sliding.
    """

    falls: Array
    rises: Array
    shapes: Array
    strays: Array

    @classmethod
    def of(cls, speed: Array, friction: Array, *, fs: float, frequency: float, unsure: float) -> Rests:
        """Those of one record; `unsure` [m/s] is the speed's deviation, `frequency` [rad/s] the motion's."""
        top = float(np.abs(speed).max())
        still = max(AT_REST * top, NOISY * unsure)
        falls, rises, shapes, strays = [], [], [], []
        ended = None
        for first, last in _strokes(speed, still, FAST * top):
            side = np.sign(speed[(first + last) // 2])
            fast = side * speed[first:last] > FAST * top
            sliding = side * friction[first:last]
            level = float(np.median(sliding[fast]))
            if not level > 0:
                continue
            strays.append(float(np.std(sliding[fast])) / level)
            swift = np.flatnonzero(side * speed[first:last] > CREEPING * top)
            begins, ends = (first, first + int(swift[0])), (first + int(swift[-1]) + 1, last)
            whole = (ended is not None, last < len(speed) - LEAST)
            for (a, b), seen in zip((begins, ends), whole, strict=True):
                if seen and b - a >= FEW and still < CREEPING * top:
                    rises.append(float(side * friction[a:b].mean()) / level - 1)
                    shapes.append(np.exp(-((speed[a:b, None] / (FALLS * top)) ** 2)).mean(axis=0))
            held = first - (first if ended is None else ended)
            if held >= max(LEAST, HELD / frequency * fs) and first + LEAST <= len(speed):
                falls.append(_fall(side * friction[first - held // 2 : first + LEAST], held // 2) / level)
            ended = last
        return cls(np.array(falls), np.array(rises), np.array(shapes).reshape(-1, len(FALLS)), np.array(strays))

    @classmethod
    def together(cls, parts: Sequence[Rests]) -> Rests:
        """Those of several records."""
        names = ("falls", "rises", "shapes", "strays")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    @property
    def fall(self) -> Estimate | None:
        """By what the friction falls at once when the contact lets go; of two releases at least."""
        if len(self.falls) < 2:
            return None
        value, sd = _middle(self.falls, self.strays)
        sd = float(np.hypot(sd, ROUNDED))
        ends = (max(0.0, value - NORMAL_95 * sd), max(0.0, value) + NORMAL_95 * sd)
        words = f"fall of the friction as the contact lets go, median of {len(self.falls)} releases"
        return Estimate("excess of static friction", max(0.0, value), ends, sd, "1", words)

    def probabilities(self, calibration: float, least: float) -> dict[str, float]:
        r"""How probable each rigid law is, its parameters averaged over what they may be.

        With J the fall at a release and R the rise in slow sliding, both over the level: Coulomb has J = R = 0; static
        friction that exceeds by e has J = e, R = 0; a Stribeck curve J = 0, :math:`R = e \exp(-(v/v_s)^2)`. An excess
        below `least` is not asked for. What was not seen speaks for none.
        """
        fall, rise, shape = 0.0, 0.0, np.ones(len(FALLS))
        sharp, slow = np.inf, np.inf
        if self.fall is not None:
            fall, sharp = float(np.median(self.falls)), self.fall.sd
        if len(self.rises) > 1:
            scatter = max(float(np.std(self.rises, ddof=1)), float(np.median(self.strays)))
            slow = float(np.hypot(scatter / len(self.rises) ** 0.5, max(ROUNDED, GAINS * calibration)))
            rise, shape = float(self.rises.mean()), self.shapes.mean(axis=0)
        asked = EXCESSES[np.greater(EXCESSES, least)]
        flat, still = _likely(rise / slow), _likely(fall / sharp)
        found = {
            "Coulomb": still * flat,
            "static": flat * _likely((fall - asked) / sharp),
            "Stribeck": still * _likely((rise - np.outer(asked, shape)) / slow),
        }
        total = sum(found.values())
        return {name: each / total if total > 0 else 1 / len(found) for name, each in found.items()}


def _likely(strays: Array | float) -> float:
    """The mean likelihood of Gaussian strays."""
    return float(np.mean(np.exp(-np.square(strays) / 2)))


def _middle(values: Array, strays: Array) -> tuple[float, float]:
    """The median, and how unsure: neither surer than the values agree nor than the friction strays in sliding."""
    scatter = max(float(np.median(np.abs(values - np.median(values)))) / 0.6745, float(np.median(strays)))
    return float(np.median(values)), 1.25 * scatter / float(np.sqrt(len(values)))


def _strokes(speed: Array, still: float, fast: float) -> list[tuple[int, int]]:
    """First and last row of each slide in which the mass becomes fast."""
    moving = np.concatenate([[0], (np.abs(speed) > still).astype(int), [0]])
    edges = np.flatnonzero(np.diff(moving))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if np.abs(speed[a:b]).max() > fast]


def _fall(friction: Array, held: int) -> float:
    """By what the friction is less after a release than the line that it followed until then; the release is searched.

    `held` is the row from which on it surely slides.
    """
    best, found = np.inf, 0.0
    for release in range(held // 2, held + 1):
        rows = np.arange(max(0, release - held // 2), release) - release
        after = friction[release + CORNER : release + AFTER]
        slope, end = np.polyfit(rows, friction[release + rows], 1)
        left = np.concatenate([friction[release + rows] - end - slope * rows, after - after.mean()])
        cost = float(left @ left) / len(left)
        if cost < best:
            best, found = cost, float(end - after.mean())
    return found
