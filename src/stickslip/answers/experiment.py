"""Which sensors, and how many samples a second, for which accuracy: an experiment tried on the virtual rig."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.force import friction_force
from stickslip.balance.lag import sensor_delay
from stickslip.contact.contact import contact_stiffness
from stickslip.cycle.loops import friction_loops
from stickslip.drives.kinds import HarmonicBase
from stickslip.errors import ModelError, StickslipError
from stickslip.estimate import plain
from stickslip.oscillator import Oscillator
from stickslip.parameters import finite
from stickslip.record.record import Record
from stickslip.rig.rig import Rig, Shaker
from stickslip.solve.trajectory import Trajectory
from stickslip.units import parse_value, prefixed

RATES = (1000.0, 2000.0, 4000.0)
SPARED = ("a", "load")  # sensors that an experiment may do without
UNITS = {"delay": "s", "friction": "N", "sliding friction": "N", "contact stiffness": "N/m"}
EDGE = 0.05  # of a record at each end, where a smoother has one side only


@dataclass(frozen=True)
class Accuracy:
    """How far off an answer is, over all draws.

    Attributes
    ----------
    error : float
        Root-mean-square error [unit]; NaN where no draw was answered.
    bias : float
        Mean error [unit]: of a trace, of its level.
    unit : str
        SI unit.
    truth : float
        The true value; of the friction's trace, its level in sliding.
    answered : int
        Draws that were answered.
    refusal : str
        Why the others were not.
    """

    error: float
    bias: float
    unit: str
    truth: float
    answered: int
    refusal: str

    def within(self, error: float, draws: int) -> bool:
        """Whether every draw was answered, with an error [unit] of so much at most."""
        return self.answered == draws and self.error <= error

    def __str__(self) -> str:
        if not self.answered:
            return "-"
        factor, unit = prefixed(self.error, self.unit)
        two = float(f"{factor * self.error:.2g}")
        return f"{two:.10g} {unit}" + (f" in {self.answered}" if self.refusal else "")


@dataclass(frozen=True)
class Setup:
    """Sensors and a sampling rate, with what they can tell.

    Attributes
    ----------
    fs : float
        Sampling rate [Hz].
    sensors : tuple of str
        Their channels.
    accuracy : mapping of str to Accuracy
        By question.
    """

    fs: float
    sensors: tuple[str, ...]
    accuracy: Mapping[str, Accuracy]

    def __str__(self) -> str:
        answers = "; ".join(f"{question} {accuracy}" for question, accuracy in self.accuracy.items())
        return f"{', '.join(self.sensors)} at {self.fs:g} Hz: {answers}"


@dataclass(frozen=True)
class ExperimentPlan:
    """What each setup of an experiment can tell.

    Attributes
    ----------
    setups : tuple of Setup
        By sampling rate, the fewest sensors first.
    draws : int
        Records tried of each.
    seed : int
        From which chance came.
    """

    setups: tuple[Setup, ...]
    draws: int
    seed: int

    @property
    def questions(self) -> tuple[str, ...]:
        """What was asked of every record."""
        return tuple(self.setups[0].accuracy)

    @property
    def refusals(self) -> tuple[str, ...]:
        """Why draws were not answered: each reason once, with its question."""
        reasons = [f"{name}: {answer.refusal}" for setup in self.setups for name, answer in setup.accuracy.items()]
        return tuple(dict.fromkeys(reason for reason in reasons if not reason.endswith(": ")))

    def enough(self, question: str, error: float | str) -> Setup | None:
        """The setup of least rate, and then of fewest sensors, whose error is within a limit; None where none is.

        Parameters
        ----------
        question : str
            One of those in :attr:`Setup.accuracy`.
        error : float or str
            Largest root-mean-square error [SI], or with its unit: ``"10 mN"``.

        Returns
        -------
        Setup or None

        Raises
        ------
        ModelError
            No setup asks that question.
        """
        if question not in self.questions:
            names = ", ".join(self.questions)
            raise ModelError(f"no question is called '{question}'", f"there are {names}", "choose one")
        limit = parse_value(error, UNITS[question])
        return next((setup for setup in self.setups if setup.accuracy[question].within(limit, self.draws)), None)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; what is not finite becomes ``None``."""
        return {"draws": self.draws, "seed": self.seed, "setups": plain(self.setups)}


def plan_experiment(
    run: Trajectory,
    *,
    rig: Rig | None = None,
    rates: Sequence[float] = RATES,
    draws: int = 10,
    seed: int = 1,
    start: float = 0.0,
    shaker: Shaker | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> ExperimentPlan:
    """Which sensors, and how many samples a second, are needed for which accuracy?

    The rig measures the motion again and again, each time with noise of its own, at each rate, with and without the
    accelerometer and the load cell. Every record is asked what a rig is built for, its sensors stated as a calibration
    would (:meth:`Rig.stated`), and the answers are held against the truth: how late the displacement is
    (:func:`sensor_delay`), the friction at each moment (:func:`friction_force`) and its level (:func:`friction_loops`),
    the contact's stiffness (:func:`contact_stiffness`).

    Parameters
    ----------
    run : Trajectory
        The motion to be measured, of an Oscillator, from :func:`simulate`.
    rig : Rig, optional
        The sensors; those of the thesis's air track where left out.
    rates : sequence of float
        Sampling rates [Hz].
    draws : int
        Records of each rate; an error is known to 1 in sqrt(2 draws).
    seed : int
        Where chance comes from: the same seed gives the same plan.
    start : float
        Instant of the run [s] at which the records begin.
    shaker : Shaker, optional
        What is to move the base: a motion beyond its stroke, its frequencies or its force is refused.
    progress : callable, optional
        Called with words and the share that is done.

    Returns
    -------
    ExperimentPlan

    Raises
    ------
    ModelError
        The run is not of an Oscillator, the rig does not sense x, the shaker can not move it so, or a number has no
        meaning.

    Examples
    --------
    >>> import stickslip as ss
    >>> contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    >>> drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
    >>> slider = ss.Oscillator(mass=2.42, stiffness=2310, damping=0.12, law=contact, drive=drive)
    >>> plan = plan_experiment(ss.simulate(slider, cycles=6), rates=[2000], draws=2, start=0.4)
    >>> plan.enough("friction", 0.02).sensors
    ('x', 'z', 'load')
    """
    rig = rig or Rig()
    _require_sensed(run, rig)
    _require_reach(run, shaker)
    _require_some(draws, rates)
    setups = []
    for number, fs in enumerate(sorted(rates)):
        tried: dict[tuple[str, ...], list[dict[str, _Answer]]] = {}
        for draw in range(draws):
            record = rig.measure(run, fs=fs, rng=np.random.default_rng([seed, number, draw]), start=start)
            for sensors in _choices(record):
                if progress is not None:
                    share = (number * draws + draw) / (len(rates) * draws)
                    progress(f"{', '.join(sensors)} at {fs:g} Hz, draw {draw + 1} of {draws}", share)
                known = rig.stated(replace(record, samples={name: record[name] for name in sensors}))
                tried.setdefault(sensors, []).append(_Trial(known, rig, run, start + rig.offset).answers())
        for sensors, answers in tried.items():
            accuracies = {key: _accuracy([answer[key] for answer in answers], UNITS[key]) for key in answers[0]}
            setups.append(Setup(float(fs), sensors, accuracies))
    return ExperimentPlan(tuple(setups), draws, seed)


def _require_sensed(run: Trajectory, rig: Rig) -> None:
    if not isinstance(run.system, Oscillator):
        raise ModelError("a run of several masses", "an experiment is planned for one mass", "simulate an Oscillator")
    if "x" not in (sensor.channel for sensor in rig.sensors):
        raise ModelError("a rig that does not sense x", "every question needs the displacement", "add a sensor for x")


def _require_reach(run: Trajectory, shaker: Shaker | None) -> None:
    """Refuse a motion of the base that the shaker can not make, with the spring at its largest stretch."""
    system, drive = run.system, run.system.drive
    # a mass that stands still, as a stick leaves it, pulls with the amplitude
    if shaker is not None and isinstance(system, Oscillator) and isinstance(drive, HarmonicBase):
        shaker.require(drive.frequency, drive.amplitude, pull=system.stiffness * drive.amplitude)


def _require_some(draws: int, rates: Sequence[float]) -> None:
    if draws < 1 or not len(rates):
        raise ModelError(f"{draws} draws of {len(rates)} rates", "one of each is needed at least", "give more")
    for fs in rates:
        finite("fs", fs, unit="Hz", positive=True)


def _choices(record: Record) -> Iterator[tuple[str, ...]]:
    """The channels to go on with: without those that may be spared, without one of them, with all."""
    spared = [name for name in SPARED if name in record]
    for without in (spared, *([name] for name in spared[: 2 * len(spared) - 2]), *([[]] if spared else [])):
        yield tuple(name for name in record if name not in without)


@dataclass(frozen=True)
class _Answer:
    """A true value; and what was answered less that, as its mean and mean square, or why there is no answer."""

    truth: float
    mean: float = math.nan
    square: float = math.nan
    refusal: str = ""


@dataclass(frozen=True, eq=False)
class _Trial:
    """One record of a run, with some of the rig's sensors; `begin` [s] is when it begins in the run."""

    record: Record
    rig: Rig
    run: Trajectory
    begin: float

    def answers(self) -> dict[str, _Answer]:
        """By question, of those whose truth is known."""
        truth = self.record.truth
        level = truth.get("sliding friction", math.nan)
        answers = {}
        if math.isfinite(late := self._lag("a") - self._lag("x")):
            answers["delay"] = (
                _answer_of(late, lambda: sensor_delay(self.record).delay.value - late)
                if "a" in self.record
                else _Answer(late, refusal="it needs an accelerometer")
            )
        answers["friction"] = _answer_of(level, self._trace)
        if "sliding friction" in truth:
            answers["sliding friction"] = _answer_of(level, lambda: friction_loops(self.force).level.value - level)
        if "contact stiffness" in truth:
            stiff = truth["contact stiffness"]
            answers["contact stiffness"] = _answer_of(stiff, lambda: contact_stiffness(self.force).value - stiff)
        return answers

    @functools.cached_property
    def force(self) -> Record:
        """With the friction by all of its sensors together."""
        constants = {name: self.record.truth[name] for name in ("mass", "stiffness", "damping")}
        return friction_force(self.record, method="fusion", **constants)

    def _lag(self, channel: str) -> float:
        return next((sensor.lag for sensor in self.rig.sensors if sensor.channel == channel), math.nan)

    def _trace(self) -> Array:
        """The friction less the true one at each moment, but for the ends, where a smoother has one side only."""
        force = self.force
        inside = slice(round(EDGE * len(force)), round((1 - EDGE) * len(force)))
        times = self.begin + force.time[inside] / (1 + self.rig.rate)
        return np.asarray(force["friction"][inside] - self.run.sample(times, ("friction",))[0][0])


def _answer_of(truth: float, error: Callable[[], Array | float]) -> _Answer:
    try:
        errors = error()
    except StickslipError as refusal:
        return _Answer(truth, refusal=str(refusal))
    return _Answer(truth, float(np.mean(errors)), float(np.mean(np.square(errors))))


def _accuracy(answers: Sequence[_Answer], unit: str) -> Accuracy:
    known = [answer for answer in answers if not answer.refusal]
    refusal = next((answer.refusal for answer in answers if answer.refusal), "")
    error = math.sqrt(np.mean([answer.square for answer in known])) if known else math.nan
    bias = float(np.mean([answer.mean for answer in known])) if known else math.nan
    return Accuracy(error, bias, unit, answers[0].truth, len(known), refusal)
