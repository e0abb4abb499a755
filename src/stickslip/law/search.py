"""Least squares with the engine in the loop: a law's parameters for all stretches, a start for each."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError
from stickslip.law.stretch import Sensor, Stretch, attempted, remembered
from stickslip.laws.rough import RoughSurface
from stickslip.oscillator import Oscillator

Array = NDArray[np.float64]
Start = Mapping[str, float | str]

STEP = 1e-5  # of a coordinate, of which one is a natural change of the parameter
PASSES = 40
DAMPED, MOST_DAMPED = 1e-3, 1e8
SETTLED = 1e-2  # of chi squared, and of its share, by which a step that is the last one lowers it
SHARE = 1e-6
BOLDEST, FURTHEST = 0.7, 7.0  # of a logarithm, in one step and in all
BOLDER = 2.0  # of static friction's tenths, in one step
TRUSTED = {"gain": 0.02, "delay": 5e-5, "profile": 0.1}  # how far off a calibration is, or a surface from its mean
ABOVE = 0.1  # static friction counts by its excess over the kinetic, in tenths of that


class Knob(NamedTuple):
    """A parameter that is turned: its name, how a coordinate makes its value, and from where."""

    name: str
    kind: str  # "log", "linear", "above" (the kinetic level), a sensor's "gain" or "delay", or of the "profile"
    origin: float
    scale: float = 1.0
    most: float = math.inf  # of a coordinate

    def value(self, u: float) -> float:
        """The parameter at a coordinate; of an "above" the excess over the kinetic level, as a share of it."""
        if self.kind == "log":
            return self.origin * math.exp(max(-200.0, min(200.0, u)))
        moved = self.origin + self.scale * u
        return max(0.0, moved) if self.kind == "above" else moved

    @property
    def least(self) -> float:
        """The least coordinate that has a meaning."""
        return -self.origin / self.scale if self.kind == "above" else -math.inf


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
    raw : tuple of tuple of ndarray
        What each sensor of each stretch would read with a gain of one.
    pieces : tuple
        The pieces of its run that each row falls in, where its reading may jump.
    residuals : tuple of ndarray
        Of each stretch, measured less predicted in units of the noise, less what is free in any reading; then how far
        the drive is off, and after the first how far sensors are off their calibration, in units of how unsure that is.
    chi2 : float
        Their sum of squares.
    """

    u: Array
    starts: tuple[Array, ...]
    raw: tuple[tuple[Array, ...], ...]
    pieces: tuple[tuple[NDArray[np.int64] | None, ...], ...]
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
        cls,
        oscillator: Oscillator,
        stretches: Sequence[Stretch],
        knobs: Sequence[Knob],
        profile: Profile | None = None,
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
        changes = {k.name: k.value(c) for k, c in zip(self.knobs, u, strict=True) if k.kind not in TRUSTED}
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

    def sensor_knobs(self, u: Array, kind: str) -> dict[str, float]:
        """Gains or delays by channel."""
        return {k.name.rpartition(".")[0]: k.value(c) for k, c in zip(self.knobs, u, strict=True) if k.kind == kind}

    def begin(self, u: Array) -> Point:
        """The point with the starts as estimated."""
        starts = []
        for stretch, entry, scale in zip(self.stretches, self.entries, self.scales, strict=True):
            memory = [float(value) for name, value in entry.items() if name != "mode"]
            state = np.array([stretch.start["x"], stretch.start["v"], *memory]) / scale
            starts.append(np.append(state, np.zeros(len(stretch.drive.unsure))))
        return self.at(u, tuple(starts))

    def own(self, starts: Sequence[Array]) -> tuple[Array, ...]:
        """Starts of the same stretches with another trust in the drive: the states alone, the drive as measured."""
        return tuple(
            np.append(start[: len(scale)], np.zeros(len(stretch.drive.unsure)))
            for start, scale, stretch in zip(starts, self.scales, self.stretches, strict=True)
        )

    def at(self, u: Array, starts: tuple[Array, ...]) -> Point:
        """Simulate all stretches; chi squared is infinite where the engine refuses."""
        raw, pieces, residuals = [], [], []
        try:
            system = self.system(u)
        except ModelError:
            return Point(u, starts, (), (), (), math.inf)
        delays, gains = self.sensor_knobs(u, "delay"), self.sensor_knobs(u, "gain")
        for j, stretch in enumerate(self.stretches):
            off = starts[j][len(self.scales[j]) :]
            run = attempted(stretch, system, self.start(j, starts[j]), off)
            if run is None:
                return Point(u, starts, (), (), (), math.inf)
            told = stretch.told(run, delays)
            raw.append(tuple(values for values, _ in told))
            pieces.append(tuple(piece for _, piece in told))
            left = [
                sensor.freed(sensor.readings - gains.get(sensor.channel.name, 1.0) * values)
                for sensor, values in zip(stretch.sensors, raw[-1], strict=True)
            ]
            residuals.append(np.concatenate([*left, -off / stretch.drive.unsure]))
        residuals[0] = np.append(residuals[0], -self._trust() @ u)
        chi2 = sum(float(r @ r) for r in residuals)
        return Point(u, starts, tuple(raw), tuple(pieces), tuple(residuals), chi2 if math.isfinite(chi2) else math.inf)

    def _trust(self) -> Array:
        """Rows that hold sensors to their calibration, over the coordinates."""
        rows = [
            k.scale / TRUSTED[k.kind] * (np.arange(len(self.knobs)) == j)
            for j, k in enumerate(self.knobs)
            if k.kind in TRUSTED
        ]
        return np.array(rows).reshape(len(rows), len(self.knobs))

    def start(self, j: int, coordinates: Array) -> Start:
        """The state at the start of stretch j."""
        names = ("x", "v", *(name for name in self.entries[j] if name != "mode"))
        values = coordinates[: len(self.scales[j])] * self.scales[j]
        return {**dict(zip(names, map(float, values), strict=True)), "mode": self.entries[j]["mode"]}

    def slopes(self, point: Point) -> list[Slopes] | None:
        """Forward differences; None where the engine refuses a neighbour."""
        gains = self.sensor_knobs(point.u, "gain")
        shared: list[list[Array]] = [[] for _ in self.stretches]
        own: list[list[Array]] = [[] for _ in self.stretches]
        for k, knob in enumerate(self.knobs):
            if knob.kind == "gain":
                for j, stretch in enumerate(self.stretches):
                    told = [
                        sensor.freed(values * knob.scale * (sensor.channel.name == knob.name.rpartition(".")[0]))
                        for sensor, values in zip(stretch.sensors, point.raw[j], strict=True)
                    ]
                    shared[j].append(np.concatenate([*told, np.zeros(len(stretch.drive.unsure))]))
                continue
            if knob.kind == "delay":
                for j in range(len(self.stretches)):
                    shared[j].append(self._later(point, j, knob, gains))
                continue
            moved = point.u.copy()
            moved[k] += STEP
            near = self.at(moved, point.starts)
            if not near.raw:
                return None
            for j in range(len(self.stretches)):
                shared[j].append(self._difference(point, near, j, gains))
        for m in range(max(map(len, point.starts))):
            starts = tuple(s + STEP * (np.arange(len(s)) == m) for s in point.starts)
            near = self.at(point.u, starts)
            if not near.raw:
                return None
            for j, start in enumerate(point.starts):
                if m < len(start):
                    own[j].append(self._difference(point, near, j, gains))
        trust = self._trust()
        found = []
        for j, (a, b) in enumerate(zip(shared, own, strict=True)):
            size = len(b[0])
            left, right = np.column_stack(a) if a else np.zeros((size, 0)), np.column_stack(b)
            if j == 0:
                left, right = np.vstack([left, trust]), np.vstack([right, np.zeros((len(trust), right.shape[1]))])
            found.append(Slopes(left, right))
        return found

    def _later(self, point: Point, j: int, knob: Knob, gains: Mapping[str, float]) -> Array:
        """What a delay changes: the slope over time, where the reading does not jump."""
        columns = []
        for sensor, values, piece in zip(self.stretches[j].sensors, point.raw[j], point.pieces[j], strict=True):
            name, slope = sensor.channel.name, np.zeros(len(values))
            if name == knob.name.rpartition(".")[0]:
                slope = -knob.scale * gains.get(name, 1.0) * np.gradient(values, sensor.time)
                if piece is not None:
                    slope[np.gradient(piece) != 0] = 0.0
            columns.append(sensor.freed(slope))
        return np.concatenate([*columns, np.zeros(len(self.stretches[j].drive.unsure))])

    def _difference(self, point: Point, near: Point, j: int, gains: Mapping[str, float]) -> Array:
        columns = []
        for s, sensor in enumerate(self.stretches[j].sensors):
            change = (near.raw[j][s] - point.raw[j][s]) / STEP
            here, there = point.pieces[j][s], near.pieces[j][s]
            if here is not None and there is not None:
                change = np.where(here == there, change, 0.0)  # a jump that has crossed a sample has no slope
            columns.append(sensor.freed(gains.get(sensor.channel.name, 1.0) * change))
        unsure = self.stretches[j].drive.unsure
        off = (near.starts[j] - point.starts[j])[len(self.scales[j]) :] / STEP
        return np.concatenate([*columns, off / unsure])


def descend(
    problem: Problem,
    point: Point,
    *,
    passes: int = PASSES,
    settled: float = SETTLED,
    share: float = SHARE,
    tell: Callable[[], None] | None = None,
) -> Point:
    """Levenberg and Marquardt's descent, each stretch's start eliminated from the common step."""
    damping = DAMPED
    for _ in range(passes):
        if tell:
            tell()
        slopes = problem.slopes(point) if point.raw else None
        if slopes is None:
            return point
        before = point.chi2
        while damping < MOST_DAMPED:
            shared, own = step(slopes, point.residuals, damping)
            moved = tuple(s + d for s, d in zip(point.starts, own, strict=True))
            tried = problem.at(_inside(problem.knobs, point.u, shared), moved)
            if tried.chi2 < point.chi2:
                damping, point = max(1e-9, damping / 10), tried
                break
            damping *= 10
        if before - point.chi2 < max(settled, share * before):
            return point
    return point


def _inside(knobs: Sequence[Knob], u: Array, step: Array) -> Array:
    """Where a step leads, no further than is sensible, and no further than a parameter's own limit."""
    least = np.array([-FURTHEST if k.kind == "log" else k.least for k in knobs])
    most = np.array([min(k.most, FURTHEST) if k.kind == "log" else k.most for k in knobs])
    bold = np.array([{"log": BOLDEST, "above": BOLDER}.get(k.kind, np.inf) for k in knobs])
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


def with_knobs(problem: Problem, knobs: Sequence[Knob]) -> Problem:
    """The same stretches, with other knobs."""
    return replace(problem, knobs=tuple(knobs))


def rows_of(sensors: Sequence[Sensor]) -> list[slice]:
    """Where each sensor's residuals stand among those of its stretch."""
    edges = np.cumsum([0, *(len(sensor.time) for sensor in sensors)])
    return [slice(int(a), int(b)) for a, b in itertools.pairwise(edges)]
