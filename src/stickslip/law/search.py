"""Least squares with the engine in the loop: a law's parameters for all stretches, a start for each."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array, Index
from stickslip.balance.motion import DRIVES
from stickslip.errors import ModelError
from stickslip.law.driven import Sampled
from stickslip.law.stretch import Motion, Sensor, Stretch, attempted, clear, remembered
from stickslip.laws.surfaces import RoughSurface
from stickslip.oscillator import Oscillator
from stickslip.solve.sensitivity import sensitivity
from stickslip.solve.trajectory import Trajectory

Start = Mapping[str, float | str]

STEP = 1e-5  # of a coordinate, of which one is a natural change of the parameter
PASSES = 40
DAMPED, MOST_DAMPED = 1e-3, 1e8
SETTLED = 1e-2  # of chi squared, and of its share, by which a step that is the last one lowers it
SHARE = 1e-6
KEPT = 0.5  # of what a step was to lower: by less the derivatives are found anew
BOLDEST, FURTHEST = 0.7, 7.0  # of a logarithm, in one step and in all
BOLDER = 2.0  # of static friction's tenths, in one step
OF_MOUNTS = ("frequency", "damping")  # over those stated
OF_SENSORS = ("gain", "delay", *OF_MOUNTS)
ABOVE = 0.1  # static friction counts by its excess over the kinetic, in tenths of that


class Knob(NamedTuple):
    """A parameter that is turned: its name, how a coordinate makes its value, and from where."""

    name: str
    kind: str  # "log", "within" (its bounds), "linear", "positive", "above" (the kinetic), one OF_SENSORS, or "profile"
    origin: float
    scale: float = 1.0
    most: float = math.inf  # of a coordinate
    prior: float = math.inf  # standard deviation of a coordinate, as far as it is known beforehand
    stretch: int | None = None  # the one that it holds for; all where left out
    mean: float = 0.0  # of a coordinate, as it is known beforehand

    def value(self, u: float) -> float:
        """The parameter at a coordinate; of an "above" the excess over the kinetic level, as a share of it."""
        if self.kind in ("log", "within", *OF_MOUNTS):
            return self.origin * math.exp(max(-200.0, min(200.0, self.scale * u)))
        moved = self.origin + self.scale * u
        return max(0.0, moved) if self.kind in ("above", "positive") else moved

    @property
    def channel(self) -> str:
        """Of what is a sensor's, whose."""
        return self.name.partition(".")[0]

    @property
    def least(self) -> float:
        """The least coordinate that has a meaning."""
        if self.kind in ("within", *OF_MOUNTS):
            return 2 * self.mean - self.most
        return -self.origin / self.scale if self.kind in ("above", "positive") else -math.inf


@dataclass(frozen=True, eq=False)
class Profile:
    """Friction along the surface over its level, at equal distances [m] around the middle of the motion."""

    values: Sequence[float]
    length: float

    def under(self, law: Any, values: Sequence[float]) -> RoughSurface:
        """A law on this surface, of other values."""
        return RoughSurface(
            law, share=0.0, length=self.length, span=self.length * len(values), values=tuple(map(float, values))
        )


@dataclass(frozen=True, eq=False)
class Point:
    """Where a search stands.

    Attributes
    ----------
    u : ndarray (p,)
        Coordinate of each knob.
    starts : tuple of ndarray
        Displacement, velocity and memory at each stretch's start, as coordinates of its scales, and by how much its
        drive is off.
    stretches : tuple of Stretch
        As they are read there, each sensor on its mount as the knobs have it.
    raw : tuple of tuple of ndarray
        What each sensor of each stretch would read with a gain of one.
    passed : tuple
        How many events of its run each row has passed, where its reading may jump.
    runs : tuple of Trajectory
        The motion of each stretch.
    residuals : tuple of ndarray
        Of each stretch, measured less predicted in units of the noise, less what is free in any reading; then how far
        the drive is off, and after the first how far sensors are off their calibration, in units of how unsure that is.
    chi2 : float
        Their sum of squares.
    """

    u: Array
    starts: tuple[Array, ...]
    stretches: tuple[Stretch, ...]
    raw: tuple[tuple[Array, ...], ...]
    passed: tuple[tuple[Index | None, ...], ...]
    runs: tuple[Trajectory, ...]
    residuals: tuple[Array, ...]
    chi2: float


class Slopes(NamedTuple):
    """Derivatives of a stretch's predictions in units of the noise: by the knobs, and by its own start."""

    shared: Array
    own: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """Stretches of records, and what is turned to explain them."""

    oscillator: Oscillator
    stretches: tuple[Stretch, ...]
    knobs: tuple[Knob, ...]
    entries: tuple[Start, ...]  # mode and memory at each start
    scales: tuple[Array, ...]  # of displacement, velocity and memory at each start
    profile: Profile | None = None

    @classmethod
    def of(
        cls, oscillator: Oscillator, stretches: Sequence[Stretch], knobs: Sequence[Knob], profile: Profile | None = None
    ) -> Problem:
        """The start's memory is that of steady sliding."""
        entries, scales = [], []
        law = profile.under(oscillator.law, profile.values) if profile else oscillator.law
        for stretch in stretches:
            slip = stretch.start["v"] - stretch.face_speed(oscillator)
            entry = remembered(law, slip, stretch.start["x"])
            entries.append(entry)
            memory = [abs(float(value)) or 1.0 for name, value in entry.items() if name != "mode"]
            scales.append(np.array([*stretch.scales, *memory]))
        return cls(oscillator, tuple(stretches), tuple(knobs), tuple(entries), tuple(scales), profile)

    def system(self, u: Array) -> Oscillator:
        """The oscillator at coordinates of the knobs."""
        inner = (*OF_SENSORS, "profile")
        changes = {k.name: k.value(c) for k, c in zip(self.knobs, u, strict=True) if k.kind not in inner}
        for knob in self.knobs:
            if knob.kind == "above":
                excess = changes.pop(knob.name)
                kinetic = knob.name.replace("static", "kinetic")
                changes[knob.name] = (1 + excess) * changes.get(kinetic, getattr(self.oscillator.law, "kinetic", 1.0))
        system = self.oscillator.having(**changes)
        if self.profile is None:
            return system
        values = [knob.value(c) for knob, c in zip(self.knobs, u, strict=True) if knob.kind == "profile"]
        return replace(system, law=self.profile.under(system.law, values or self.profile.values))

    def sensor_knobs(self, u: Array, kind: str, j: int) -> dict[str, float]:
        """Gains or delays by channel, in stretch j."""
        return {
            knob.channel: knob.value(c)
            for knob, c in zip(self.knobs, u, strict=True)
            if knob.kind == kind and knob.stretch in (None, j)
        }

    def delays(self, u: Array, j: int) -> dict[str, float]:
        """By how much each sensor of stretch j comes later than stated, after the drive: one that is late is others
        that are early, as no start is stated."""
        late = self.sensor_knobs(u, "delay", j)
        names = [sensor.channel.name for sensor in self.stretches[j].sensors]
        return {name: late.get(name, 0.0) - sum(late.get(drive, 0.0) for drive in DRIVES) for name in names}

    def mounted(self, u: Array, j: int) -> Stretch:
        """Stretch j, its sensors on mounts as the knobs have them."""
        by_kind = [self.sensor_knobs(u, kind, j) for kind in OF_MOUNTS]
        if not any(by_kind):
            return self.stretches[j]
        sensors = self.stretches[j].sensors
        turned = tuple(s.remounted(*(knobs.get(s.channel.name, 1.0) for knobs in by_kind)) for s in sensors)
        return replace(self.stretches[j], sensors=turned)

    def begin(self, u: Array) -> Point:
        """The point with the starts as estimated, the drive as measured."""
        return self.at(u, self.own(self.begin_states()))

    def begin_states(self) -> list[Array]:
        """Displacement, velocity and memory at each stretch's start as estimated, as coordinates."""
        states = []
        for stretch, entry, scale in zip(self.stretches, self.entries, self.scales, strict=True):
            memory = [float(value) for name, value in entry.items() if name != "mode"]
            states.append(np.array([stretch.start["x"], stretch.start["v"], *memory]) / scale)
        return states

    def own(self, starts: Sequence[Array]) -> tuple[Array, ...]:
        """Starts of the same stretches with another trust in the drive, which is off in as many ways as it may be."""
        own = []
        for start, scale, stretch in zip(starts, self.scales, self.stretches, strict=True):
            wanted = len(scale) + len(stretch.drive.unsure)
            own.append(np.pad(start[:wanted], (0, max(0, wanted - len(start)))))
        return tuple(own)

    def held(self, point: Point) -> tuple[Problem, Point]:
        """The same with the gains of the bases as stated, and a point of it: the drive as measured."""
        problem = replace(self, stretches=tuple(replace(one, drive=one.drive.held()) for one in self.stretches))
        states = [start[: len(scale)] for start, scale in zip(point.starts, self.scales, strict=True)]
        return problem, problem.at(point.u, problem.own(states))

    def at(self, u: Array, starts: tuple[Array, ...]) -> Point:
        """Simulate all stretches; chi squared is infinite where the engine refuses."""
        raw, passed, runs, residuals = [], [], [], []
        nowhere = Point(u, starts, (), (), (), (), (), math.inf)
        try:
            system = self.system(u)
        except ModelError:
            return nowhere
        stretches = tuple(self.mounted(u, j) for j in range(len(self.stretches)))
        for j, stretch in enumerate(stretches):
            delays, gains = self.delays(u, j), self.sensor_knobs(u, "gain", j)
            off = starts[j][len(self.scales[j]) :]
            run = attempted(stretch, system, self.start(j, starts[j]), off)
            if run is None:
                return nowhere
            runs.append(run)
            read = stretch.told(run, delays)
            raw.append(tuple(values for values, _ in read))
            passed.append(tuple(events for _, events in read))
            left = [
                sensor.freed(sensor.readings - gains.get(sensor.channel.name, 1.0) * values, events)
                for sensor, (values, events) in zip(stretch.sensors, read, strict=True)
            ]
            residuals.append(np.concatenate([*left, -off / stretch.drive.unsure]))
        residuals[0] = np.append(residuals[0], self._trust() @ ([knob.mean for knob in self.knobs] - u))
        chi2 = sum(float(r @ r) for r in residuals)
        chi2 = chi2 if math.isfinite(chi2) else math.inf
        return Point(u, starts, stretches, tuple(raw), tuple(passed), tuple(runs), tuple(residuals), chi2)

    def _trust(self) -> Array:
        """Rows that hold what is known beforehand to it, over the coordinates."""
        known = [j for j, knob in enumerate(self.knobs) if math.isfinite(knob.prior)]
        return np.asarray(np.eye(len(self.knobs))[known] / np.array([self.knobs[j].prior for j in known])[:, None])

    def start(self, j: int, coordinates: Array) -> Start:
        """The state at the start of stretch j."""
        names = ("x", "v", *(name for name in self.entries[j] if name != "mode"))
        values = coordinates[: len(self.scales[j])] * self.scales[j]
        return {**dict(zip(names, map(float, values), strict=True)), "mode": self.entries[j]["mode"]}

    def slopes(self, point: Point) -> list[Slopes] | None:
        """Derivatives by the knobs and by each stretch's own start; None where the engine refuses a neighbour."""
        moving = [k for k, knob in enumerate(self.knobs) if knob.kind not in OF_SENSORS]
        system, tangents = self.system(point.u), []
        for j, stretch in enumerate(point.stretches):
            changed = self._changed(point, j, moving, system)
            if changed is None:
                return None
            gains = self.sensor_knobs(point.u, "gain", j)
            size, rows = len(point.starts[j]), rows_of(stretch.sensors)
            count = rows[-1].stop + len(stretch.drive.unsure)
            shared, own = np.zeros((count, len(self.knobs))), np.zeros((count, size))
            motion = stretch.motion(point.runs[j])
            for s, (sensor, part) in enumerate(zip(stretch.sensors, rows, strict=True)):
                gain = gains.get(sensor.channel.name, 1.0)
                columns = sensor.freed(gain * changed[s], point.passed[j][s])
                shared[part, moving], own[part] = columns[:, : len(moving)], columns[:, len(moving) :]
                for k, knob in enumerate(self.knobs):
                    whose = (sensor.channel.name, *DRIVES)
                    if knob.kind in OF_SENSORS and knob.channel in whose and knob.stretch in (None, j):
                        shared[part, k] = self._sensed(point, (j, s, k), motion, gain, point.residuals[j][part])
            own[rows[-1].stop :, len(self.scales[j]) :] = np.diag(1 / np.array(stretch.drive.unsure))
            tangents.append(Slopes(shared, own))
        trust = self._trust()
        shared, own = tangents[0]
        tangents[0] = Slopes(np.vstack([shared, trust]), np.vstack([own, np.zeros((len(trust), own.shape[1]))]))
        return tangents

    def _sensed(self, point: Point, at: tuple[int, int, int], motion: Motion, gain: float, left: Array) -> Array:
        """Derivative of what sensor s of stretch j would read by knob k, which is its own; `left` are its residuals."""
        j, s, k = at
        knob, sensor, passed = self.knobs[k], point.stretches[j].sensors[s], point.passed[j][s]
        if knob.kind == "gain":
            return sensor.freed(knob.scale * point.raw[j][s], passed)
        moved = point.u + STEP * np.eye(len(self.knobs))[k]
        if knob.kind in OF_MOUNTS:
            sensor = sensor.remounted(**{knob.kind: knob.value(moved[k]) / knob.value(point.u[k])})
        read, _ = sensor.predicted(motion, self.delays(moved, j)[sensor.channel.name])
        return np.asarray((left - sensor.freed(sensor.readings - gain * read, passed)) / STEP)

    def _changed(self, point: Point, j: int, moving: Sequence[int], system: Oscillator) -> list[Array] | None:
        """Derivatives of what the sensors of stretch j would read: by the knobs that move the mass, and its start."""
        nearby = []
        for k in moving:
            moved = point.u.copy()
            moved[k] += STEP
            try:
                nearby.append(self.system(moved))
            except ModelError:
                return None
        if hasattr(system.law, "rates"):
            return self._differences(point, j, nearby, system)
        stretch, size = point.stretches[j], len(self.scales[j])
        off = point.starts[j][size:]
        neighbours, scaled = [stretch.driven(neighbour, off) for neighbour in nearby], []
        if isinstance(stretch.drive, Sampled):
            scaled = [1 / (1 + float(share)) for share in off]
        else:
            neighbours += [stretch.driven(system, off + STEP * unit) for unit in np.eye(len(off))]
        names = ("x", "v", *(name for name in self.entries[j] if name != "mode"))
        starts = dict(zip(names, map(float, self.scales[j]), strict=True))
        motion = sensitivity(
            point.runs[j], neighbours, step=STEP, starts=starts, scaled=scaled, outputs=stretch.outputs
        )
        begin, end = len(nearby), len(nearby) + len(off)
        order = [*range(begin), *range(end, len(motion.flow)), *range(begin, end)]
        delays = self.delays(point.u, j)
        return [sensor.changed(motion, delays.get(sensor.channel.name, 0.0))[:, order] for sensor in stretch.sensors]

    def _differences(
        self, point: Point, j: int, nearby: Sequence[Oscillator], system: Oscillator
    ) -> list[Array] | None:
        """As `_changed`, of a curved law: forward differences of its motion."""
        stretch, start, size = point.stretches[j], point.starts[j], len(self.scales[j])
        beside = [(neighbour, start) for neighbour in nearby] + [
            (system, start + STEP * unit) for unit in np.eye(len(start))
        ]
        delays, columns = self.delays(point.u, j), []
        for moved, begun in beside:
            run = attempted(stretch, moved, self.start(j, begun), begun[size:])
            if run is None:
                return None
            read = stretch.told(run, delays)
            columns.append(
                [
                    # a jump that has crossed a sample has no slope
                    (near - raw) / STEP * (1.0 if here is None or there is None else here == there)
                    for (near, there), raw, here in zip(read, point.raw[j], point.passed[j], strict=True)
                ]
            )
        return [np.column_stack(parts) for parts in zip(*columns, strict=True)]


def descend(
    problem: Problem,
    point: Point,
    *,
    passes: int = PASSES,
    settled: float = SETTLED,
    share: float = SHARE,
    enough: float = -math.inf,
    tell: Callable[[], None] | None = None,
) -> Point:
    """Levenberg and Marquardt's descent, each stretch's start eliminated from the common step; no lower than `enough`.

    Those of a curved law cost ten steps: after one that brought what was foretold they are mended by it (Broyden's
    secants) instead of found anew, but for the last step.
    """
    damping, slopes, fresh, curved = DAMPED, None, False, hasattr(problem.oscillator.law, "rates")
    for _ in range(passes):
        if tell:
            tell()
        if slopes is None:
            slopes, fresh = problem.slopes(point) if point.raw else None, True
        if slopes is None:
            return point
        while damping < MOST_DAMPED:
            shared, own = _bounded(problem.knobs, point, slopes, damping)
            moved = tuple(s + d for s, d in zip(point.starts, own, strict=True))
            tried = problem.at(_inside(problem.knobs, point.u, shared), moved)
            if tried.chi2 < point.chi2 or not fresh:
                break
            damping *= 10
        if tried.chi2 <= enough:
            return tried
        lowered = point.chi2 - tried.chi2
        mended, foretold = secant(slopes, point, tried) if lowered > 0 else (None, math.inf)
        trusted = curved and lowered > KEPT * foretold
        if (fresh or (trusted and share > SHARE)) and lowered < max(settled, share * point.chi2):
            return tried if lowered > 0 else point
        slopes, fresh = mended if trusted else None, False
        if lowered > 0:
            damping, point = max(1e-9, damping / 10), tried
    return point


def secant(slopes: Sequence[Slopes], point: Point, tried: Point) -> tuple[list[Slopes], float]:
    """Derivatives mended by what a step has changed, the larger ones the more; and by how much chi squared was to fall.

    Where a jump has crossed a sample the change tells nothing of them.
    """
    mended, foretold, moved = [], point.chi2, tried.u - point.u
    for j, (a, b) in enumerate(slopes):
        went = tried.starts[j] - point.starts[j]
        guessed = a @ moved + b @ went
        wrong = point.residuals[j] - tried.residuals[j] - guessed
        foretold -= float(np.sum((point.residuals[j] - guessed) ** 2))
        row = 0
        for here, there, values in zip(point.passed[j], tried.passed[j], point.raw[j], strict=True):
            if here is not None and there is not None:
                wrong[row : row + len(values)] *= clear(here) * clear(there) * (here == there)
            row += len(values)
        weights = np.sum(a * a, axis=0) * moved, np.sum(b * b, axis=0) * went
        power = float(weights[0] @ moved + weights[1] @ went) or 1.0
        mended.append(Slopes(a + np.outer(wrong, weights[0] / power), b + np.outer(wrong, weights[1] / power)))
    return mended, foretold


def _bounded(
    knobs: Sequence[Knob], point: Point, slopes: Sequence[Slopes], damping: float
) -> tuple[Array, list[Array]]:
    """The step of what is free to move: a knob that is to go beyond its limit goes up to it, and the rest with it."""
    least, most = (np.array([getattr(knob, end) for knob in knobs]) - point.u for end in ("least", "most"))
    free, fixed = np.ones(len(knobs), dtype=bool), np.zeros(len(knobs))
    while True:
        left = [r - a @ fixed for (a, _), r in zip(slopes, point.residuals, strict=True)]
        shared, own = step([Slopes(a * free, b) for a, b in slopes], left, damping)
        beyond = free & ((shared < least) | (shared > most))
        if not beyond.any():
            return np.where(free, shared, fixed), own
        fixed = np.where(beyond, np.clip(shared, least, most), fixed)
        free &= ~beyond


def _inside(knobs: Sequence[Knob], u: Array, step: Array) -> Array:
    """Where a step leads, no further than is sensible, and no further than a parameter's own limit."""
    least = np.array([-FURTHEST if k.kind == "log" else k.least for k in knobs])
    most = np.array([min(k.most, FURTHEST) if k.kind == "log" else k.most for k in knobs])
    bold = np.array([{"log": BOLDEST, "within": BOLDEST, "above": BOLDER}.get(k.kind, np.inf) for k in knobs])
    return np.asarray(np.clip(u + np.clip(step, -bold, bold), least, most))


def step(slopes: Sequence[Slopes], residuals: Sequence[Array], damping: float) -> tuple[Array, list[Array]]:
    """The step of knobs and starts that would leave the least of the residuals, shortened by the damping."""
    size = slopes[0].shared.shape[1]
    normal, right, inner = np.zeros((size, size)), np.zeros(size), []
    for (a, b), r in zip(slopes, residuals, strict=True):
        square = b.T @ b
        bread = np.linalg.pinv(square + damping * np.diag(np.diag(square)), rcond=1e-14, hermitian=True)
        mixed, own = a.T @ b, b.T @ r
        normal += a.T @ a - mixed @ bread @ mixed.T
        right += a.T @ r - mixed @ bread @ own
        inner.append((bread, mixed, own))
    total = sum((np.sum(a * a, axis=0) for a, _ in slopes), np.zeros(size))
    shared = np.linalg.pinv(normal + damping * np.diag(total), rcond=1e-14, hermitian=True) @ right
    return shared, [bread @ (own - mixed.T @ shared) for bread, mixed, own in inner]


def without_starts(slopes: Sequence[Slopes]) -> list[Array]:
    """Derivatives by the knobs, less what each stretch's own start would take over."""
    left = []
    for a, b in slopes:
        sizes = np.linalg.norm(b, axis=0)
        basis, triangle = np.linalg.qr(b[:, sizes > 0] / sizes[sizes > 0])
        basis = basis[:, np.abs(np.diag(triangle)) > 1e-9]
        left.append(a - basis @ (basis.T @ a))
    return left


def rows_of(sensors: Sequence[Sensor]) -> list[slice]:
    """Where each sensor's residuals stand among those of its stretch."""
    edges = np.cumsum([0, *(len(sensor.time) for sensor in sensors)])
    return [slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]
