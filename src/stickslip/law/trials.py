"""Laws tried on the same stretches of the same records: each searched, each asked for records that it has not seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.law.drive import Sampled
from stickslip.law.search import Knob, Point, Problem, descend, rows_of
from stickslip.law.start import Shown, bounded, free_names, knob, nuisance_knobs, thinned
from stickslip.law.stretch import Motion, Stretch, attempted
from stickslip.law.surety import Evidence, Key, independent
from stickslip.laws.guessing import STIFF, STIFFEST
from stickslip.oscillator import Oscillator

Array = NDArray[np.float64]
Left = dict[Key, Array]
Tell = Callable[[], None]

LOOKS, FINALISTS = 4, 2  # starts that are looked at, and that are followed
ROUGHLY = 0.1  # of the misfit, lowered by less in a step before all that is unsure is turned
ENOUGH = 1e-3  # of the misfit: what a step lowers it less by tells no law from another
CONTENDING = 100.0  # times the least misfit of the others: a law beyond is not followed to its end
PASSES, FEW = 12, 3  # of a descent: of a law, and of one that stands near its end
TURNS = 24  # of the motion, after which a record tells laws apart no better
DETUNED = (0.01, 0.0025)  # steps in which a mount is tried, against what is stated
SILENT = 0.2  # of a channel's size, left by the best law: nothing is known of such a sensor
COARSE = 0.3  # of the calibration's error, by which a base's motion may be missed where laws are compared


@dataclass(frozen=True, eq=False)
class Trial:
    """A law at the end of its search."""

    name: str
    problem: Problem
    point: Point

    @property
    def system(self) -> Oscillator:
        """The oscillator with the law's values."""
        return self.problem.system(self.point.u)

    @property
    def law(self) -> Any:
        """With its values."""
        return self.system.law

    @property
    def mass(self) -> float:
        """What slides [kg]."""
        return self.system.mass

    @property
    def scales(self) -> Array:
        """Largest way [m] and speed [m/s] of every stretch (n, 2)."""
        return np.array([each.scales for each in self.problem.stretches])

    @property
    def count(self) -> int:
        """Parameters of the law."""
        return len(free_names(self.problem.oscillator, None))

    @property
    def stiff(self) -> bool:
        """Whether friction is there before the contact has moved by a noticeable part of the smallest stroke."""
        law = self.law
        stroke, fastest = self.scales.min(axis=0)
        if hasattr(law, "stiffness"):
            return bool(law.kinetic < STIFF * stroke * law.stiffness)
        return hasattr(law, "rate") and bool(fastest < STIFF * stroke * law.rate * law.kinetic)

    @property
    def left(self) -> Left:
        """What is left of each channel of each record [unit of the channel]."""
        return left_of(self.problem, self.point)

    @property
    def moved(self) -> float:
        """Sum of squares of how far what was stated had to move, in units of how unsure it is."""
        parts = zip(self.problem.stretches, self.point.residuals, strict=True)
        return sum(float(np.sum(values[rows_of(stretch.sensors)[-1].stop :] ** 2)) for stretch, values in parts)


def left_of(problem: Problem, point: Point) -> Left:
    """What is left of each channel of each record [unit of the channel]."""
    return {
        (sensor.channel.name, stretch.record): values[rows] * sensor.noise
        for stretch, values in zip(problem.stretches, point.residuals, strict=True)
        for sensor, rows in zip(stretch.sensors, rows_of(stretch.sensors), strict=True)
    }


def squares(left: Left) -> dict[Key, float]:
    """Mean square of each channel of each record."""
    return {key: float(np.mean(values**2)) for key, values in left.items()}


def weighed(
    shown: Shown, number: int, calibration: float, evidence: Evidence | None = None, *, whole: bool = False
) -> Stretch:
    """What a record shows from its first slide on, each channel counted by its noise and its calibration's error; by
    evidence, where there is some."""
    first, last = int(shown.slides()[0]), len(shown.record) - 1
    if not whole:
        last = min(last, shown.turned(first, TURNS))
    every = shown.stretch(number, (first, last))
    stretch = every if whole else thinned(every)
    sensors = tuple(
        replace(each, noise=evidence.weight((each.channel.name, number), len(each.time)) if evidence
                else math.hypot(each.noise, calibration * float(np.std(each.readings))))
        for each in stretch.sensors
    )  # fmt: skip
    drive = stretch.drive
    if isinstance(drive, Sampled) and not whole:
        drive = drive.coarser(COARSE * calibration)
    return replace(stretch, sensors=sensors, drive=drive)


def searched(
    name: str,
    starts: Sequence[Oscillator],
    stretches: Sequence[Stretch],
    known: Sequence[str],
    calibration: float,
    least: float,
    passes: int,
    tell: Tell,
) -> Trial | None:
    """The law from the start from which it descends lowest; None where the engine refuses all of them.

    Of many starts those are followed whose first look is best, and a law that stays far above the `least` misfit of
    the others not to its very end.
    """
    problems = [Problem.of(system, stretches, ()) for system in starts]
    begun = [(problem.begin(np.zeros(0)), problem) for problem in problems]
    looks = []
    for point, still in sorted(begun, key=lambda each: each[0].chi2)[:LOOKS]:
        looks.append((descend(still, point, passes=2, share=ENOUGH, tell=tell), still))
    ends = []
    for look, still in sorted(looks, key=lambda each: each[0].chi2)[:FINALISTS]:
        if not math.isfinite(look.chi2):
            continue
        own = [_knob(still.oscillator, name, stretches) for name in free_names(still.oscillator, None)]
        # a damper that is far off would be made up for by the gains, were they free from the first
        few = nuisance_knobs(still.oscillator, [name for name in known if name == "damping"], stretches, calibration)
        first = replace(still, knobs=(*own, *few))
        begin = first.at(np.zeros(len(first.knobs)), look.starts)
        ends.append((first, descend(first, begin, passes=FEW, share=ROUGHLY, tell=tell)))
    if not ends:
        return None
    first, point = min(ends, key=lambda each: each[1].chi2)
    others = [name for name in known if name != "damping"]
    problem = replace(first, knobs=(*first.knobs, *nuisance_knobs(first.oscillator, others, stretches, calibration)))
    whole = problem.at(np.append(point.u, np.zeros(len(problem.knobs) - len(point.u))), point.starts)
    point = descend(problem, whole, passes=FEW, share=ENOUGH, tell=tell)
    if point.chi2 < CONTENDING * least:
        point = descend(problem, point, passes=passes, share=ENOUGH, tell=tell)
    return Trial(name, problem, point) if math.isfinite(point.chi2) else None


def _knob(oscillator: Oscillator, name: str, stretches: Sequence[Stretch]) -> Knob:
    return bounded(knob(oscillator, name), oscillator, stretches, STIFFEST)


def resumed(trial: Trial, stretches: Sequence[Stretch], least: float, passes: int, tell: Tell) -> Trial | None:
    """A search taken up again where it stood, on stretches that have changed a little; None where it can not be."""
    problem = replace(trial.problem, stretches=tuple(stretches))
    point = problem.at(trial.point.u, trial.point.starts)
    if point.chi2 < CONTENDING * least:
        point = descend(problem, point, passes=passes, share=ENOUGH, tell=tell)
    return replace(trial, problem=problem, point=point) if math.isfinite(point.chi2) else None


def with_static(trial: Trial, excess: float) -> Trial:
    """The law whose static friction exceeds the kinetic by what the releases tell, turned no more.

    The misfit jumps with it, and a rough surface moves its valley.
    """
    system = trial.system
    static = system.law.kinetic * (1 + excess)  # type: ignore[union-attr]
    left = [j for j, each in enumerate(trial.problem.knobs) if each.name != "static"]
    knobs = tuple(trial.problem.knobs[j]._replace(origin=trial.problem.knobs[j].value(trial.point.u[j])) for j in left)
    problem = replace(trial.problem, oscillator=system.having(static=static), knobs=knobs)
    return replace(trial, problem=problem, point=problem.at(np.zeros(len(knobs)), trial.point.starts))


def evidence_of(trial: Trial, shown: Sequence[Shown]) -> Evidence:
    """How much each channel counts: the error of a model tells at most one story from one reversal to the next."""
    left = trial.left
    counts = {
        key: min(float(min(TURNS, max(1, len(shown[key[1]].turns)))), independent(values))
        for key, values in left.items()
    }
    return Evidence(counts, {key: shown[key[1]].noise(key[0]) for key in left}, squares(left))


def unexplained(trial: Trial, shown: Sequence[Shown]) -> dict[str, float]:
    """Shares of the channels of which even the best law leaves much, where nothing is stated of the sensor.

    The motion itself, x or v, always counts.
    """
    found: dict[str, float] = {}
    for (name, number), values in trial.left.items():
        channel, readings = shown[number].record.channels[name], shown[number].record[name]
        size = max(float(np.std(readings)), 1e-300)
        share = float(np.std(values)) / size
        noise = shown[number].noise(name) / size
        told = channel.mount or channel.delay or channel.discharge or channel.inertia
        if name not in "xv" and not told and share > math.hypot(SILENT, noise):
            found[name] = max(share, found.get(name, 0.0))
    return found


def tuned(shown: Sequence[Shown], trial: Trial, stretch: Callable[[Shown, int], Stretch], tell: Tell) -> list[Shown]:
    """The records with each mount's resonance where a law leaves least, within what a calibration is off."""
    mounts = {
        name: each.record.channels[name].mount for each in shown for name in each.channels
        if each.record.channels[name].mount
    }  # fmt: skip
    best, motions = list(shown), _motions(trial)
    for name, mount in mounts.items():
        assert mount is not None
        tried: dict[float, tuple[float, list[Shown]]] = {}
        for step in DETUNED:
            middle = min(tried, key=lambda share: tried[share][0]) if tried else 1.0
            for share in {middle + turns * step for turns in (-2, -1, 0, 1, 2)} - set(tried):
                tell()
                moved = [_remounted(each, name, (share * mount[0], mount[1])) for each in best]
                left = [_unread(trial, motions, stretch(each, j), j, name) for j, each in enumerate(moved)]
                tried[share] = math.fsum(left), moved
        best = min(tried.items(), key=lambda each: (each[1][0], each[0]))[1][1]
    return best


def _motions(trial: Trial) -> list[Motion | None]:
    """What happens in each stretch at the end of a search."""
    found = []
    for j, stretch in enumerate(trial.problem.stretches):
        start = trial.point.starts[j]
        off = start[len(trial.problem.scales[j]) :]
        run = attempted(stretch, trial.system, trial.problem.start(j, start), off)
        found.append(None if run is None else stretch.motion(run))
    return found


def _unread(trial: Trial, motions: Sequence[Motion | None], stretch: Stretch, j: int, name: str) -> float:
    """Mean square of what a motion leaves of a sensor's readings, its gain whatever it may be."""
    motion = motions[j]
    sensors = [sensor for sensor in stretch.sensors if sensor.channel.name == name]
    if motion is None or not sensors:
        return 0.0
    late = trial.problem.sensor_knobs(trial.point.u, "delay", j).get(name, 0.0)
    told, read = (sensors[0].freed(each) for each in (sensors[0].predicted(motion, late)[0], sensors[0].readings))
    return float(
        sensors[0].noise ** 2 * np.mean((read - told * (float(told @ read) / max(float(told @ told), 1e-300))) ** 2)
    )


def _remounted(shown: Shown, name: str, mount: tuple[float, float]) -> Shown:
    if name not in shown.record:
        return shown
    return replace(shown, record=shown.record.with_details(name, mount=mount))
