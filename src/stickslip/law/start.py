"""Where a fit of a law begins: what the record shows of motion and friction, and which values are tried."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, Rows
from stickslip.balance.motion import driving
from stickslip.errors import UNNAMED, EstimateError, ModelError, RecordError
from stickslip.law.driven import DriveFrom, as_driven, measured_drive
from stickslip.law.search import ABOVE, OF_MOUNTS, OF_SENSORS, Knob, Point, Problem, Profile, descend
from stickslip.law.stretch import Sensor, Stretch
from stickslip.oscillator import Oscillator
from stickslip.parameters import find
from stickslip.record.record import Record
from stickslip.settings import nearest
from stickslip.signals.derivatives import LEAST, differentiate
from stickslip.signals.noise import noise_level, quantisation_step
from stickslip.solve.tables import require_oscillator

FAST = 0.5  # of the largest speed: then the contact slides for certain
TURNED = 0.1  # of the largest speed, beyond which a motion has turned
UNTURNED, STEADY = 0.005, 0.1  # of the samples that noise may carry through zero; of the largest speed, a stop's
EDGE = 0.02  # of the record at its ends, where a derivative is poor
FINEST = 1e-5  # of a channel's range: noise below it is not asked for
AUDIBLE = 2.0  # times its noise that a motion must stray
CALIBRATION = 0.005  # by which gains and springs are wrong, if nothing is known
DELAYED = 5e-5  # s by which a stated delay is wrong
MOUNTED = {"frequency": 0.01, "damping": 0.1}  # parts by which what is stated of a mount is wrong: it is hard to tap
FARTHEST = 10.0  # times that: a law that does not fit turned a mount by e^5, and to follow its swing took 6 GB
EXPONENT = "exponent"  # of the fall with speed: where nobody has stated it, it is fitted within what its law says
VISCOUS = {"viscous", "slope"}  # parameters of laws that a viscous damper can not be told from
GRID = {"stiffness": (0.25, 1.0, 4.0, 64.0), "rate": (0.4, 1.0, 2.5), "steepness": (1.0,), "lag": (0.3, 1.0, 3.0)}
EXCESS = (0.04, 0.15, 0.25, 0.4)  # of static over kinetic friction
BELOW = 0.99  # of a static friction that is held: where the kinetic starts at most
SPEEDS = (0.03, 0.1, 0.3)  # of the largest speed
THIN = 1000.0  # readings of a channel that a first look takes
FINALISTS = 3
KNOTS, BENT = 17, 0.03  # of a surface's profile, and how stiff it is


@dataclass(frozen=True, eq=False)
class Shown:
    """What one record shows before any law is fitted: motion, where it slides, and the friction's level."""

    record: Record
    channels: tuple[str, ...]
    displacement: Array
    velocity: Array
    late: float
    felt: Array
    level: float
    drive: DriveFrom

    @classmethod
    def of(cls, record: Record, channels: Sequence[str], oscillator: Oscillator) -> Shown:
        """Displacement and velocity by x or v; the level of the load, the friction, or the balance of forces."""
        require_oscillator(oscillator, "a law is fitted")
        name = next((name for name in ("x", "v") if name in record), None)
        if name is None:
            raise RecordError(
                f"a record of {', '.join(record)}",
                "a law is fitted to a motion: displacement x or velocity v",
                'name its column, as in channels={"x": "COLUMN [mm]"}, or integrate the acceleration first',
                kind=UNNAMED,
            )
        record.require_clean(*channels, name, question="a fitted law", samples=2 * LEAST)
        values, late = record[name], record.channels[name].delay
        noise = record.channels[name].noise or noise_level(values, record.fs)
        if not np.std(values) > AUDIBLE * noise:
            raise EstimateError(
                f"{name} strays by {np.std(values):.3g} {record.channels[name].unit} in noise of {noise:.3g}",
                "a law is fitted to motion above the noise",
                "drive harder, or measure with less noise",
            )
        if name == "x":
            velocity = differentiate(values, record.fs).values
            displacement = values - _middle(record, values, velocity)
        else:
            velocity = values
            displacement = np.cumsum(values - values.mean()) / record.fs
        felt = _felt(as_driven(record, oscillator.drive), velocity, oscillator)
        drive = measured_drive(record, oscillator.drive)
        return cls(record, tuple(channels), displacement, velocity, late, felt, _level(felt, velocity), drive)

    @property
    def fastest(self) -> float:
        """Largest speed [m/s] away from the ends."""
        cut = max(1, int(EDGE * len(self.velocity)))
        return float(np.abs(self.velocity[cut:-cut]).max())

    def slides(self) -> Rows:
        """Rows in which the mass moves fast, away from the ends."""
        cut = max(1, int(EDGE * len(self.velocity)))
        rows = np.flatnonzero(np.abs(self.velocity) > FAST * self.fastest)
        return rows[(rows >= cut) & (rows < len(self.velocity) - cut)]

    @property
    def turns(self) -> Rows:
        """Rows at which the motion has turned."""
        return _turns(self.velocity, self.fastest)

    def turned(self, first: int, count: int) -> int:
        """The row at which the motion has turned so many times after a first one; the last row where it has not."""
        after = self.turns[self.turns > first]
        return int(after[count]) if len(after) > count else len(self.velocity) - 1

    def require_sliding(self) -> None:
        """Refuse a motion that can not tell friction from an offset."""
        rows, velocity = self.slides(), self.velocity
        if len(rows) == 0:
            raise EstimateError(
                "the mass does not slide away from the record's ends",
                "a law is fitted to sliding",
                "give a longer record, or drive harder",
            )
        cut = max(1, len(velocity) // 50)
        inner = velocity[cut:-cut]
        low, high = sorted(abs(end) for end in np.quantile(inner, (UNTURNED, 1 - UNTURNED)))
        if np.quantile(inner, UNTURNED) * np.quantile(inner, 1 - UNTURNED) > 0 and low > STEADY * high:
            raise EstimateError(
                f"the mass slides one way at {low:.3g} to {high:.3g} m/s without a stop",
                "friction is told from an offset where the motion stops or turns",
                "let it turn: drive the base to and fro, or let it stick and slip",
            )

    def stretch(self, number: int, rows: tuple[int, int]) -> Stretch:
        """The stretch between two rows, the mass sliding at the first."""
        record = self.record
        span = (rows[0] / record.fs - self.late, rows[1] / record.fs - self.late)
        sensors = tuple(Sensor.of(record, name, span, self.noise(name)) for name in self.channels)
        start = {"x": float(self.displacement[rows[0]]), "v": float(self.velocity[rows[0]])}
        scales = np.array([np.ptp(self.displacement) / 2, self.fastest])
        return Stretch(number, span, sensors, self.drive, start, scales)

    def noise(self, name: str) -> float:
        """Standard deviation of a channel's noise, as stated or as found, its counts' included."""
        stated, values = self.record.channels[name].noise, self.record[name]
        counts = quantisation_step(values) / math.sqrt(12)
        level = noise_level(values, self.record.fs) if stated is None else math.hypot(stated, counts)
        return max(level, counts, FINEST * float(np.ptp(values)), 1e-300)


def with_own_gains(shown: Sequence[Shown], gain_sd: float) -> list[Shown]:
    """What records show where each base's gain may be off in its own way; one gain alone scales all that is fitted."""
    if len(shown) == 1:
        return list(shown)
    return [replace(motion, drive=motion.drive.calibrated(gain_sd)) for motion in shown]


def too_few(shown: Sequence[Shown], count: int) -> str:
    """What to say where a law has more parameters than the records have strokes; nothing where it has not."""
    strokes = sum(len(motion.turns) + 1 for motion in shown)
    if strokes >= count:
        return ""
    many = f"{strokes} stroke{'s' * (strokes > 1)} from one reversal to the next"
    return f"{many} for {count} parameters: give a record of more cycles"


def _turns(velocity: Array, fastest: float) -> Rows:
    moving = np.flatnonzero(np.abs(velocity) > TURNED * fastest)
    return np.asarray(moving[1:][np.diff(np.sign(velocity[moving])) != 0])


def _middle(record: Record, values: Array, velocity: Array) -> float:
    """Where the spring is at rest: about the middle of whole cycles; of a motion that creeps one way, as measured."""
    fast = velocity[np.abs(velocity) > FAST * np.abs(velocity).max()]
    if np.min(fast) < 0 < np.max(fast):
        turns = _turns(velocity, float(np.abs(fast).max()))
        there_and_back = slice(turns[0], turns[(len(turns) - 1) // 2 * 2]) if len(turns) > 2 else slice(None)
        return float(values[there_and_back].mean())
    return float(np.mean(record.samples.get("z", 0.0)))


def _felt(record: Record, velocity: Array, oscillator: Oscillator) -> Array:
    """Friction [N] as a sensor feels it, or as the balance of forces has it."""
    measured = _friction_of(record)
    return _balance(record, velocity, oscillator) - oscillator.damping * velocity if measured is None else measured


def _friction_of(record: Record) -> Array | None:
    """Friction [N] as a sensor feels it, where there is one."""
    return next((record[name] for name in ("load", "friction") if name in record), None)


def _balance(record: Record, velocity: Array, oscillator: Oscillator) -> Array:
    """What spring and inertia leave for friction and damper [N]."""
    acceleration = record["a"] if "a" in record else differentiate(velocity, record.fs).values
    place = record["x"] if "x" in record else np.cumsum(velocity) / record.fs
    pull = oscillator.stiffness * (record.samples.get("z", 0.0) - place) + record.samples.get("force", 0.0)
    return np.asarray(pull - oscillator.mass * acceleration)


def seen_damping(oscillator: Oscillator, shown: Sequence[Shown]) -> Oscillator:
    """With the damper that the balance of forces shows in fast sliding, beside a friction of one level."""
    columns, values = [], []
    for number, motion in enumerate(shown):
        record, rows = as_driven(motion.record, oscillator.drive), motion.slides()
        left, measured = _balance(record, motion.velocity, oscillator)[rows], _friction_of(record)
        stretched = motion.velocity[rows]
        if oscillator.damper == "base" and "z" in record:
            stretched = stretched - np.gradient(record["z"])[rows] * record.fs
        level = np.sign(motion.velocity[rows]) if measured is None else np.zeros(len(rows))
        offsets = np.zeros((len(rows), len(shown)))
        offsets[:, number] = 1.0
        columns.append(np.column_stack([stretched, level, offsets]))
        values.append(left if measured is None else left - measured[rows])
    solution = np.linalg.lstsq(np.vstack(columns), np.concatenate(values), rcond=None)[0]
    return oscillator.having(damping=max(0.0, float(solution[0])))


def _level(felt: Array, velocity: Array) -> float:
    fast = np.abs(velocity) > FAST * np.abs(velocity).max()
    forward, back = (felt[fast & (side * velocity > 0)] for side in (1, -1))
    if len(forward) and len(back):
        return float(np.median(forward) - np.median(back)) / 2
    return float(abs(np.median(felt[fast])))


def free_names(oscillator: Oscillator, free: Sequence[str] | None) -> tuple[str, ...]:
    """The parameters to fit: those asked for, or all of the law that have a value."""
    if free is not None:
        for name in free:
            find(oscillator, name)
        return tuple(free)
    names = []
    law: Any = oscillator.law
    chosen = getattr(law, "chosen", ())
    for field in fields(law):
        value = getattr(law, field.name)
        if isinstance(value, int | float) and not isinstance(value, bool) and value and field.name not in chosen:
            alone = find(oscillator, field.name) == (("law", field.name),)
            names.append(field.name if alone else f"law.{field.name}")
    if not names:
        raise ModelError(
            f"{type(oscillator.law).__name__} has no number to fit",
            "a law is fitted by its parameters",
            "name those to fit in free=, or take another law",
        )
    return tuple(names)


def require_apart(
    oscillator: Oscillator, names: Sequence[str], nuisance: Sequence[str], shown: Sequence[Shown]
) -> None:
    """Refuse a gain or delay of what is not fitted, a parameter of the drive, and one that is named twice."""
    channels = list(dict.fromkeys(name for motion in shown for name in motion.channels))
    taken: set[object] = set()
    for name in (*names, *nuisance):
        head, _, tail = name.rpartition(".")
        sensor = _of_sensor(name)
        if sensor and head not in (*channels, *(_delayed(shown) if tail == "delay" else [])):
            raise ModelError(
                f"the {tail} of '{head}'",
                f"the channels that are fitted are {', '.join(channels)}",
                nearest(head, channels),
            )
        places: set[object] = {name} if sensor else set(find(oscillator, name))
        if not sensor and find(oscillator, name)[0][0] == "drive":
            raise ModelError(
                f"'{name}' of the drive",
                "a law is fitted under the drive as it was measured, or as it is given",
                "leave it out of free= and nuisance=",
            )
        if taken & places:
            raise ModelError(
                f"'{name}' is named twice", "a parameter is fitted once", "leave it out of free= or nuisance="
            )
        taken |= places


def _of_sensor(name: str) -> bool:
    """Whether a name is a sensor's gain or delay, or its mount's frequency or damping."""
    head, _, tail = name.rpartition(".")
    return head not in ("", "law", "drive") and "." not in head and tail in OF_SENSORS


def value_of(oscillator: Oscillator, name: str) -> float:
    """The present value of a parameter."""
    part = oscillator
    for word in find(oscillator, name)[0]:
        part = getattr(part, word)
    return float(part)  # type: ignore[arg-type]


def usual_nuisance(oscillator: Oscillator, names: Sequence[str], shown: Sequence[Shown]) -> tuple[str, ...]:
    """What nobody knows well beside a law's parameters `names`: the damper, the spring, and how sensors are calibrated.

    The damper stays as stated where the law itself has a viscous part to fit.
    """
    channels = dict.fromkeys(name for motion in shown for name in motion.channels)
    viscous = VISCOUS & {name.rpartition(".")[2] for name in names}
    usual = [
        *(["damping"] if not viscous else []),
        *(["stiffness"] if oscillator.stiffness > 0 else []),
        *(f"{name}.gain" for name in channels),
        *(f"{name}.delay" for name in _delayed(shown) if len(channels) > 1),
        *(f"{name}.{kind}" for name in channels if _mounted(shown, name) for kind in OF_MOUNTS),
    ]
    return tuple(name for name in usual if name not in names)


def _delayed(shown: Sequence[Shown]) -> list[str]:
    """The channels whose delay is found beside a law: the mass's displacement, and the motion or force that drives it.

    Of all channels one is not late after the others.
    """
    driven = [name for motion in shown if (name := driving(motion.record))]
    return list(dict.fromkeys([*("x" for motion in shown if "x" in motion.channels), *driven]))


def _mounted(shown: Sequence[Shown], name: str) -> bool:
    """Whether a mount of a channel's sensor is stated."""
    return any(name in motion.channels and motion.record.channels[name].mount for motion in shown)


def nuisance_knob(
    oscillator: Oscillator, name: str, stretches: Sequence[Stretch], calibration: float = CALIBRATION
) -> Knob:
    """How what is not known well is turned: a damper anywhere from zero on, all else near what is stated."""
    tail = name.rpartition(".")[2]
    if _of_sensor(name) and tail in MOUNTED:
        return Knob(name, tail, 1.0, MOUNTED[tail], most=FARTHEST, prior=1.0)
    if _of_sensor(name):
        calibrated = Knob(name, tail, 1.0, 0.01, prior=max(calibration, 1e-9) / 0.01)
        return calibrated if tail == "gain" else Knob(name, tail, 0.0, 1e-4, prior=DELAYED / 1e-4)
    if name == EXPONENT and name in _between(oscillator):
        low, high = _between(oscillator)[name]
        value = value_of(oscillator, name)
        middle, most = math.log(math.sqrt(low * high) / value), math.log(high / value)
        return Knob(name, "within", value, most=most, prior=(most - middle) / 2, mean=middle)
    if name == "damping":
        fastest = max(float(stretch.scales[1]) for stretch in stretches)
        return Knob(name, "positive", oscillator.damping, _level_of(oscillator) / fastest)
    turned = knob(oscillator, name)
    return turned._replace(prior=calibration) if name == "stiffness" and turned.kind == "log" else turned


def nuisance_knobs(
    oscillator: Oscillator, names: Sequence[str], stretches: Sequence[Stretch], calibration: float = CALIBRATION
) -> list[Knob]:
    """Those of what is not known well; an amplifier is set anew for each record, so that each has gains of its own."""
    names = [name for name in names if name != EXPONENT or name in _between(oscillator)]
    knobs = [nuisance_knob(oscillator, name, stretches, calibration) for name in names]
    if len(stretches) == 1:
        return knobs
    gains = [turned for turned in knobs if turned.kind == "gain"]
    own = [turned._replace(stretch=j) for turned in gains for j in range(len(stretches))]
    return [turned for turned in knobs if turned.kind != "gain"] + own


def _between(oscillator: Oscillator) -> Mapping[str, tuple[float, float]]:
    """Of the law's numbers that are chosen, between which values they are known to be."""
    return getattr(oscillator.law, "between", {})


def _level_of(oscillator: Oscillator) -> float:
    """A force [N] of the size of the friction."""
    return float(getattr(oscillator.law, "kinetic", 0.0)) or 1.0


def knob(oscillator: Oscillator, name: str) -> Knob:
    """How a parameter is turned."""
    head, _, tail = name.rpartition(".")
    value = value_of(oscillator, name)
    if tail == "static":
        kinetic = value_of(oscillator, f"{head}.kinetic" if head else "kinetic")
        return Knob(name, "above", max(0.0, value / kinetic - 1), ABOVE)
    if value > 0:
        return Knob(name, "log", value)
    return Knob(name, "linear", value, abs(value) or 1.0)


def stiffest(oscillator: Oscillator, stretches: Sequence[Stretch], share: float) -> float:
    """The contact [N/m] that gives way by a share of the stroke under the sliding friction."""
    return value_of(oscillator, "kinetic") / (share * max(float(stretch.scales[0]) for stretch in stretches))


def bounded(turned: Knob, oscillator: Oscillator, stretches: Sequence[Stretch], share: float) -> Knob:
    """The knob; a contact gets no stiffer than next to rigid, where it would cost much and tell nothing."""
    slides = getattr(oscillator.law, "kinetic", 0.0) > 0
    if turned.kind != "log" or turned.name not in ("law.stiffness", "law.damping") or not slides:
        return turned
    most = stiffest(oscillator, stretches, share)
    if turned.name == "law.damping":
        most = 2 * math.sqrt(most * oscillator.mass)
    return turned._replace(origin=min(most, turned.origin), most=max(0.0, math.log(most / turned.origin)))


def better_start(oscillator: Oscillator, names: Sequence[str], shown: Sequence[Shown]) -> Oscillator:
    """The law with its forces, as far as they are free, scaled to the friction that the records show."""
    level = float(np.median([motion.level for motion in shown]))
    if "kinetic" not in names or not level > 0:
        return oscillator
    static = getattr(oscillator.law, "static", None)
    if static is None:
        return oscillator.having(kinetic=level)
    if not {"static", "law.static"} & set(names):
        return oscillator.having(kinetic=min(level, BELOW * static))
    return oscillator.having(kinetic=level, static=static * level / value_of(oscillator, "kinetic"))


def trials(oscillator: Oscillator, names: Sequence[str], fastest: float) -> Iterator[Oscillator]:
    """The values a search begins with: as given, and spread where the misfit has several valleys."""
    choices: list[list[tuple[str, float]]] = []
    for name in names:
        last = name.rpartition(".")[2]
        if name == last and name in ("mass", "stiffness", "damping"):
            continue
        if last in GRID:
            choices.append([(name, factor * value_of(oscillator, name)) for factor in GRID[last]])
        if last == "static":
            level = value_of(oscillator, name.replace("static", "kinetic"))
            choices.append([(name, level * (1 + excess)) for excess in EXCESS])
        if last == "speed":
            choices.append([(name, share * fastest) for share in SPEEDS])
    yield oscillator
    for chosen in itertools.product(*choices) if choices else ():
        yield oscillator.having(**dict(chosen))


def thinned(stretch: Stretch) -> Stretch:
    """The stretch with fewer readings, and a drive that is taken as measured, for a first look."""
    sensors = []
    for sensor in stretch.sensors:
        rows = slice(None, None, max(1, int(len(sensor.time) / THIN)))
        sensors.append(replace(sensor, time=sensor.time[rows], readings=sensor.readings[rows]))
    return replace(stretch, sensors=tuple(sensors), drive=stretch.drive.as_measured())


def thinned_out(problem: Problem) -> Problem:
    """The problem with fewer readings."""
    return replace(problem, stretches=tuple(map(thinned, problem.stretches)))


def best_start(
    systems: Sequence[Oscillator],
    names: Sequence[str],
    stretches: Sequence[Stretch],
    dampers: Sequence[float],
    tell: Callable[[], None],
) -> Oscillator:
    """The values from which the search descends lowest, on a part of the readings; of the damper, where several are
    given, it is turned too. Of one system its values are spread; of several they are."""
    few = [thinned(stretch) for stretch in stretches]
    looked: list[tuple[float, int, Problem, Point]] = []
    fastest = max(float(stretch.scales[1]) for stretch in stretches)
    spread = systems if len(systems) > 1 else [*trials(systems[0], names, fastest)]
    begun = [trial.having(damping=damping) for damping in dampers for trial in spread]
    for number, trial in enumerate(begun):
        tell()
        problem = Problem.of(trial, few, ())
        point = descend(problem, problem.begin(np.zeros(0)), passes=2)
        looked.append((point.chi2, number, problem, point))
    looked.sort(key=lambda attempt: attempt[:2])
    ends = []
    for _, number, problem, point in looked[:FINALISTS]:
        knobs = [knob(problem.oscillator, name) for name in names]
        knobs += [nuisance_knob(problem.oscillator, "damping", few)] * (len(dampers) > 1)
        turned = replace(problem, knobs=tuple(knobs))
        end = descend(turned, replace(point, u=np.zeros(len(knobs))), passes=12, tell=tell)
        ends.append((end.chi2, number, turned, end))
    _, _, problem, point = min(ends, key=lambda attempt: attempt[:2])
    return problem.system(point.u)


def seen_profile(shown: Sequence[Shown], level: float) -> Profile:
    """The friction along the surface, as it was felt in sliding forward and back."""
    span = max(float(np.abs(motion.displacement).max()) for motion in shown)
    places = np.linspace(-span, span, KNOTS)
    columns, values = [], []
    for motion in shown:
        rows = motion.slides()
        side = np.sign(motion.velocity[rows])
        columns.append(np.maximum(0.0, 1 - np.abs(motion.displacement[rows, None] - places) / (places[1] - places[0])))
        values.append((motion.felt[rows] - np.mean(motion.felt)) * side / level)
    design, wanted = np.vstack(columns), np.concatenate(values)
    # where no slide was fast the profile goes on as it is beside
    bends = np.diff(np.eye(KNOTS), 2, axis=0) * BENT * math.sqrt(len(wanted))
    heights = np.linalg.lstsq(np.vstack([design, bends]), np.append(wanted, np.zeros(len(bends))), rcond=None)[0]
    return Profile(tuple(np.clip(heights, 0.5, 2.0).tolist()), float(places[1] - places[0]))
