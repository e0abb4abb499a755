"""Laws tried on the same stretches of the same records: each searched, each asked for records that it has not seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.force import friction_force
from stickslip.drives.kinds import Release
from stickslip.errors import EstimateError
from stickslip.law.data import FAST, Rests
from stickslip.law.driven import Sampled, as_driven, face_of
from stickslip.law.search import Knob, Point, Problem, descend, rows_of
from stickslip.law.start import EXPONENT, Shown, bounded, free_names, knob, nuisance_knobs, thinned, value_of
from stickslip.law.stretch import Sensor, Stretch
from stickslip.law.verdict import Evidence, Key, independent
from stickslip.laws.guessing import LEAST_EXCESS, STIFF, STIFFEST, Hypothesis, Observed
from stickslip.oscillator import Oscillator
from stickslip.record.record import Record

Left = dict[Key, Array]
Tell = Callable[[], None]

LOOKS, FINALISTS = 4, 2  # starts that are looked at, and that are followed
ROUGHLY = 0.1  # of the misfit, lowered by less in a step before all that is unsure is turned
ENOUGH = 1e-3  # of the misfit: what a step lowers it less by tells no law from another
CONTENDING = 100.0  # times the least misfit of the others: a law beyond is not followed to its end
# Times the misfit of a law that it contains, above which a search is not taken up again but begun where that one ends.
# On 4 rigid rigs of 4 LuGre's, resumed at 12 to 20 times, ended far above that; on a compliant one, at 5 times, below.
LED_ON = 10.0
NO_WORSE = 1.01  # times a law's misfit, that one which contains it may end with: a descent settles within that
PASSES, LAST_PASSES = 12, 3  # of a descent: of a law, and of one that stands near its end
LOOK = 2  # passes of a descent after which it is seen how the sensors' mounts swing
TURNS = 24  # of the motion, after which a record tells laws apart no better
SILENT = 0.2  # of a channel's size, left by the best law: nothing is known of such a sensor
COARSE = 0.3  # of the calibration's error, by which a base's motion may be missed where laws are compared
FIRST = ("damping", EXPONENT)  # what is far off would be made up for by the gains, were they free from the first
SCATTERED = 0.3  # of its scatter while it slides, chosen: what of a friction may be none; of a wrong sign it is many
SLOW = 0.05  # of the largest speed, below which the contact may hold
EDGE = 24  # samples at either end that a smoother knows less of


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
        return np.array([stretch.scales for stretch in self.problem.stretches])

    @property
    def count(self) -> int:
        """Parameters of the law."""
        return len(free_names(self.problem.oscillator, None))

    @property
    def stiff(self) -> bool:
        """Whether friction is there before the contact has moved by a noticeable part of the smallest stroke."""
        law = self.law
        stroke, fastest = self.scales.min(axis=0)
        if not hasattr(law, "kinetic"):
            return False
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

    def noise(sensor: Sensor) -> float:
        if evidence is None:
            return math.hypot(sensor.noise, calibration * float(np.std(sensor.readings)))
        return evidence.weight((sensor.channel.name, number), len(sensor.time))

    sensors = tuple(replace(sensor, noise=noise(sensor)) for sensor in stretch.sensors)
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
    for point, still in sorted(begun, key=lambda pair: pair[0].chi2)[:LOOKS]:
        looks.append((descend(still, point, passes=2, share=ENOUGH, tell=tell), still))
    ends = []
    for look, still in sorted(looks, key=lambda pair: pair[0].chi2)[:FINALISTS]:
        if not math.isfinite(look.chi2):
            continue
        own = [_knob(still.oscillator, name, stretches) for name in free_names(still.oscillator, None)]
        few = nuisance_knobs(still.oscillator, [name for name in known if name in FIRST], stretches, calibration)
        first = replace(still, knobs=(*own, *few))
        begin = first.at(np.zeros(len(first.knobs)), look.starts)
        ends.append((first, descend(first, begin, passes=LAST_PASSES, share=ROUGHLY, tell=tell)))
    if not ends:
        return None
    first, point = min(ends, key=lambda pair: pair[1].chi2)
    others = [name for name in known if name not in FIRST]
    problem = replace(first, knobs=(*first.knobs, *nuisance_knobs(first.oscillator, others, stretches, calibration)))
    whole = problem.at(np.append(point.u, np.zeros(len(problem.knobs) - len(point.u))), point.starts)
    point = descend(problem, whole, passes=LAST_PASSES, share=ENOUGH, tell=tell)
    if point.chi2 < CONTENDING * least:
        point = descend(problem, point, passes=passes, share=ENOUGH, tell=tell)
    return Trial(name, problem, point) if math.isfinite(point.chi2) else None


def _knob(oscillator: Oscillator, name: str, stretches: Sequence[Stretch]) -> Knob:
    return bounded(knob(oscillator, name), oscillator, stretches, STIFFEST)


def resumed(trial: Trial, stretches: Sequence[Stretch], most: float, passes: int, tell: Tell) -> Trial | None:
    """A search taken up again where it stood, on stretches that have changed a little; None where it can not be.

    Where it stands above the `most` misfit that it may have, it is not led on.
    """
    problem = replace(trial.problem, stretches=tuple(stretches))
    point = problem.at(trial.point.u, trial.point.starts)
    if point.chi2 < most:
        point = descend(problem, point, passes=passes, share=ENOUGH, tell=tell)
    return replace(trial, problem=problem, point=point) if math.isfinite(point.chi2) else None


@dataclass(frozen=True, eq=False)
class Search:
    """What stays the same while laws are searched.

    Attributes
    ----------
    kinds : sequence of (Hypothesis, list)
        The laws, the simplest first, and the values to start from where they are given.
    seen : sequence of (Oscillator, Seen)
        What the records show, by each damper that may be.
    known : sequence of str
        What is fitted beside each law.
    calibration : float
        By what part gains and the spring may be wrong.
    tell : callable
        Called as the work goes on.
    """

    kinds: Sequence[tuple[Hypothesis, list[Any]]]
    seen: Sequence[tuple[Oscillator, Seen]]
    known: Sequence[str]
    calibration: float
    tell: Tell

    def stretch(self, evidence: Evidence | None) -> Callable[[Shown, int], Stretch]:
        """How a record is weighed: by its noise and calibration, and by evidence where there is some."""
        return lambda shown, number: weighed(shown, number, self.calibration, evidence)

    def known_of(self, given: list[Any]) -> list[str]:
        """What is fitted beside a law; the exponent of one with values is as it was given."""
        return [name for name in self.known if not given or name != EXPONENT]

    def tried(
        self, shown: Sequence[Shown], evidence: Evidence | None, passes: int, before: Mapping[str, Trial]
    ) -> dict[str, Trial]:
        """Every law searched, or its search taken up again; anew where it ends above one that it contains."""
        stretches = [self.stretch(evidence)(motion, number) for number, motion in enumerate(shown)]
        trials: dict[str, Trial] = {}
        for kind, given in self.kinds:
            name = kind.name
            least = min((one.point.chi2 for one in {**before, **trials}.values()), default=math.inf)
            inner = (LED_ON * trials[simpler].point.chi2 for simpler in kind.contains if simpler in trials)
            most = min([CONTENDING * least, *inner])
            trial = resumed(before[name], stretches, most, passes, self.tell) if name in before else None
            if trial is None:
                begun = [replace(one, law=law) for one, seen in self.seen for law in given or kind.guesses(seen)]
                begun += self._continued(kind, given, trials)
                known = self.known_of(given)
                trial = searched(name, begun, stretches, known, self.calibration, least, passes, self.tell)
            if passes > LOOK:
                trial = self.no_worse(kind, given, trial, trials, passes)
            if trial is not None:
                trials[name] = trial
        for kind, given in reversed(self.kinds) if passes > LOOK else ():
            if kind.name in trials:
                trials[kind.name] = self.from_richer(kind, given, trials, passes)
        return trials

    def no_worse(
        self, kind: Hypothesis, given: list[Any], trial: Trial | None, before: Mapping[str, Trial], passes: int
    ) -> Trial | None:
        """The trial, or where it is above a law that it contains, one that begins where that one ends."""
        inner = sorted((before[name] for name in kind.contains if name in before), key=_misfit)
        for simpler in inner:
            if trial is not None and trial.point.chi2 <= NO_WORSE * inner[0].point.chi2:
                break
            begun = self._simpler(given, {simpler.name: simpler}, kind.next_to or kind.continued)
            known = self.known_of(given)
            ends = [extended(kind.name, simpler, law, known, passes, self.tell) for law in begun]
            trial = min((one for one in (trial, *ends) if one is not None), key=_misfit, default=None)
        return trial

    def from_richer(self, kind: Hypothesis, given: list[Any], trials: Mapping[str, Trial], passes: int) -> Trial:
        """The trial, or where it is above a law that contains it, one that begins where that one ends.

        Coulomb's law, begun at a damper twice the true one, was left out for a static friction that exceeds by 1 %. Not
        of curved laws, whose passes cost ten times another's.
        """
        trial = trials[kind.name]
        richer = [trials[one.name] for one, _ in self.kinds if kind.name in one.contains and one.name in trials]
        nearest = min(richer, key=_misfit, default=trial)
        if hasattr(trial.law, "rates") or trial.point.chi2 <= NO_WORSE * nearest.point.chi2:
            return trial
        asked = trial.problem.oscillator
        shared = {name: value_of(nearest.system, name) for name in free_names(asked, None)}
        end = extended(kind.name, nearest, asked.having(**shared).law, self.known_of(given), passes, self.tell)
        return min((one for one in (trial, end) if one is not None), key=_misfit)

    def _continued(self, kind: Hypothesis, given: list[Any], before: Mapping[str, Trial]) -> list[Oscillator]:
        """Where else a search begins: where those of simpler laws end, with the damper of the one that left least."""
        if not before:
            return []
        nearest = min(before.values(), key=_misfit)
        stated = nearest.problem.oscillator.having(damping=nearest.system.damping)
        return [replace(stated, law=law) for law in self._simpler(given, before, kind.continued)]

    def _simpler(
        self, given: list[Any], before: Mapping[str, Trial], starts: Callable[[Mapping[str, Trial]], list[Any]]
    ) -> list[Any]:
        """The law next to simpler ones where their searches end; of one with values such as it is."""
        begun = starts(before)
        if not given:
            return begun
        asked = replace(self.seen[0][0], law=given[0])
        return [same for law in begun if (same := like(asked, law)) is not None]


def _misfit(trial: Trial) -> float:
    return trial.point.chi2


def like(asked: Oscillator, law: Any) -> Any | None:
    """A law with all that is not fitted as in the one that was asked for; None where it has other parameters."""
    names, own = free_names(asked, None), vars(asked.law)
    if type(law) is not type(asked.law) or free_names(replace(asked, law=law), None) != names:
        return None
    fitted = {name.removeprefix("law.") for name in names}
    begun: Any = law  # else it would be narrowed to the protocol of laws, which are no dataclasses to the checker
    return replace(begun, **{field.name: own[field.name] for field in fields(begun) if field.name not in fitted})


def extended(name: str, simpler: Trial, law: Any, known: Sequence[str], passes: int, tell: Tell) -> Trial | None:
    """A law searched from where a simpler one ends: its motions, dampers, springs and gains; None where it can not be.

    From the stated ones a richer law may descend into another valley than the one that the simpler law has found.
    """
    before = simpler.problem
    kept = [j for j, turned in enumerate(before.knobs) if turned.name in known and turned.name != EXPONENT]
    oscillator = replace(before.oscillator, law=law)
    own = [_knob(oscillator, one, before.stretches) for one in free_names(oscillator, None)]
    own += nuisance_knobs(oscillator, [one for one in known if one == EXPONENT], before.stretches)
    problem = Problem.of(oscillator, before.stretches, (*own, *(before.knobs[j] for j in kept)))
    starts = []
    for start, scale, now in zip(simpler.point.starts, before.scales, problem.begin_states(), strict=True):
        starts.append(np.concatenate([start[:2], now[2:], start[len(scale) :]]))
    point = problem.at(np.append(np.zeros(len(own)), simpler.point.u[kept]), tuple(starts))
    trial = Trial(name, problem, point)
    # a curved law next to rigid says what the simpler one says, and each pass costs ten times another law's: it is
    # led on only where a few passes bring it away from there
    limit = trial.stiff and hasattr(law, "rates")
    enough = NO_WORSE * simpler.point.chi2 if limit else -math.inf
    if limit and point.chi2 > enough:
        point = descend(problem, point, passes=LAST_PASSES, share=ENOUGH, enough=enough, tell=tell)
        trial = replace(trial, point=point)
    if point.chi2 > enough and not (limit and trial.stiff):
        point = descend(problem, point, passes=passes, share=ENOUGH, enough=enough, tell=tell)
    return replace(trial, point=point) if math.isfinite(point.chi2) else None


def with_static(trial: Trial, excess: float) -> Trial:
    """The law whose static friction exceeds the kinetic by what the releases tell, turned no more.

    The misfit jumps with it, and a rough surface moves its valley.
    """
    system = trial.system
    static = system.law.kinetic * (1 + excess)  # type: ignore[union-attr]
    left = [j for j, knob in enumerate(trial.problem.knobs) if knob.name != "static"]
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
    silent: dict[str, float] = {}
    for (name, number), values in trial.left.items():
        channel, readings = shown[number].record.channels[name], shown[number].record[name]
        size = max(float(np.std(readings)), 1e-300)
        share = float(np.std(values)) / size
        noise = shown[number].noise(name) / size
        stated = channel.mount or channel.delay or channel.discharge or channel.inertia
        if name not in "xv" and not stated and share > math.hypot(SILENT, noise):
            silent[name] = max(share, silent.get(name, 0.0))
    return silent


# ---- what records say of sliding and friction before any law is tried on them


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
            balanced = _balanced(as_driven(record, oscillator.drive), oscillator)
            inner = slice(EDGE, -EDGE)
            face, speed = face_of(oscillator.drive, balanced)
            x, v = balanced["x"] - face, balanced["v"] - speed
            slips.append(np.diff(x, append=x[-1])[inner])
            speeds.append(v[inner])
            frictions.append(balanced["friction"][inner])
            steps.append(np.full(len(slips[-1]), 1 / balanced.fs))
            ways.append(x[inner] - x[inner].mean())
            # of a fall of 20 % that an accelerometer sees the sensors together leave between nothing and 19 %
            forces = None if "load" in record else _balanced_forces(balanced, oscillator)[inner]
            rests.append(_rests(balanced, speeds[-1], frictions[-1], ways[-1], forces))
        speed, friction = np.concatenate(speeds), np.concatenate(frictions)
        fast = np.abs(speed) > FAST * np.abs(speed).max()
        level = float(np.median((friction * np.sign(speed))[fast]))
        if not level > 0:
            raise _without_friction(records, oscillator, level, float(np.std(friction[fast])))
        way, around = float(np.std(np.concatenate(ways))), Rests.together(rests)
        excess, turns = _excess(speed, friction, level, around), float(np.std(speed)) / way
        slip, step = np.concatenate(slips), np.concatenate(steps)
        return cls(slip, speed, friction, step, level, excess, turns, oscillator.mass, around)


def _without_friction(records: Sequence[Record], oscillator: Oscillator, level: float, scatter: float) -> EstimateError:
    """Why no law is compared where nothing opposes the motion: there is no dry friction, or the balance is wrong."""
    why = f"friction of {level:.3g} N while it slides"
    if abs(level) < SCATTERED * scatter:
        return EstimateError(
            f"{why}, which scatters by {scatter:.3g} N",
            "beside the damper that is stated no dry friction is seen",
            "correct damping= if there should be some; 'stickslip analyze' says what would have been seen",
        )
    if not any({"z", "force"} & set(record) for record in records) and oscillator.drive == Release():
        return EstimateError(
            f"{why}, the base taken to be at rest",
            "friction opposes the velocity",
            "give the base's motion as channel z, or the drive; where the motion is imposed, fit a curve of friction "
            "(fit_curve, --curve)",
        )
    remedy = "correct the signs of the channels, or mass=, stiffness= and damping="
    return EstimateError(why, "friction opposes the velocity", remedy)


def seen_by(records: Sequence[Record], systems: Sequence[Oscillator]) -> list[tuple[Oscillator, Seen]]:
    """What the records show by each of several dampers; one that leaves no friction is none."""
    seen, refused = [], None
    for system in systems:
        try:
            seen.append((system, Seen.of(records, system)))
        except EstimateError as error:
            refused = refused or error  # of the damper as it was stated
    if refused and not seen:
        raise refused
    return seen


def _excess(speed: Array, friction: Array, level: float, rests: Rests) -> float:
    """By what part friction exceeds the level at a release, or at rest where there is none."""
    if rests.fall is not None:
        return max(LEAST_EXCESS, rests.fall.value)
    slow = np.abs(speed) < SLOW * float(np.abs(speed).max())
    reached = float(np.quantile(np.abs(friction[slow]), 0.9)) if slow.sum() > EDGE else level
    return max(LEAST_EXCESS, min(1.0, reached / level - 1))


def _balanced_forces(record: Record, oscillator: Oscillator) -> Array:
    """How large the forces are whose balance the friction is [N]: a gain that is off moves it by its share of one."""
    springs = [oscillator.stiffness * (record[name] - record[name].mean()) for name in "xz" if name in record]
    return np.asarray(np.linalg.norm([oscillator.mass * np.gradient(record["v"]) * record.fs, *springs], axis=0))


def _rests(record: Record, speed: Array, friction: Array, way: Array, forces: Array | None) -> Rests:
    unsure = float(np.median(record["v_sd"])) if "v_sd" in record else 0.0
    frequency = float(np.std(speed)) / max(float(np.std(way)), 1e-300)
    width = record.rig.bandwidth if record.rig else None
    blur = math.ceil(record.fs / (2 * width)) if width else 1
    return Rests.of(speed, friction, fs=record.fs, frequency=frequency, unsure=unsure, blur=blur, balanced=forces)


def _balanced(record: Record, oscillator: Oscillator) -> Record:
    method = "fusion" if {"a", "load"} & set(record) else "smoother"
    constants = {name: getattr(oscillator, name) for name in ("mass", "stiffness", "damping", "damper")}
    return friction_force(record, **constants, method=method, contact=getattr(oscillator.drive, "contact", "ground"))
