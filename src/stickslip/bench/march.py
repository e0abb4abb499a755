"""A simulated motion that goes on for as long as it is asked, in legs that each start where the last one ended.

A leg of a periodic drive is whole periods long, and its start is counted in periods: after hours the phase is still
that of the first one. What moves the system may be changed at any instant.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stickslip.arrays import Array
from stickslip.drives.kinds import Drive, Motion
from stickslip.errors import ModelError
from stickslip.laws.curved import CurvedLaw
from stickslip.laws.stribeck import TimeDelay
from stickslip.oscillator import Oscillator
from stickslip.solve.assembly import table_of
from stickslip.solve.curved import run_curved
from stickslip.solve.simulate import opening, run, stops_of
from stickslip.solve.tables import System
from stickslip.solve.tape import tape
from stickslip.solve.trajectory import Trajectory

LEG = 0.25  # s, at the least: a leg costs about a millisecond whatever its length, and a change of drive throws it away
BUDGET = 100_000  # events in a period
RTOL = 1e-10  # of curved laws: far below any sensor
KEPT = 1.0  # s of legs that are kept behind: more than any sensor lags


class Leg(NamedTuple):
    """A part of the motion: its start and end [s], and the run in it, whose time 0 is the start.

    What of it can be sensed stands by name: the run's output, which row of that, and the unit.
    """

    begin: float
    end: float
    run: Trajectory
    sensed: Mapping[str, tuple[str, int, str]]


@dataclass(frozen=True, eq=False)
class Later:
    """A drive as it goes on after `passed` [s]."""

    drive: Drive
    passed: float

    def motion(self) -> Motion:
        """The same signals, with their values at that time."""
        motion, t = self.drive.motion(), self.passed
        start = {name: value for name, value in _values(motion, t).items() if name in motion.start}
        tones = tuple((c, s, omega, math.remainder(phase + omega * t, math.tau)) for c, s, omega, phase in motion.tones)
        knots = motion.knots
        if knots is not None:
            at = int(np.searchsorted(knots[:, 0], t, side="right")) - 1
            first = [0.0, *(start[name] for name in motion.knotted)]
            rest = knots[at + 1 :] - np.eye(1, knots.shape[1])[0] * t
            knots = np.vstack([first, rest])
        return replace(motion, start=start, tones=tones, knots=knots, end=motion.end - t)


@dataclass(frozen=True, eq=False)
class Shaken:
    """Samples that move the base or press on the mass, by cubic pieces, and the last one held after them.

    Attributes
    ----------
    samples : ndarray
        Four at least [m or N].
    fs : float
        Their rate [Hz].
    on : str
        "base" or "force".
    contact : str
        What the mass rubs on.
    """

    samples: Array
    fs: float
    on: str = "base"
    contact: str = "ground"

    def motion(self) -> Motion:
        """Value and derivatives, set anew at every sample."""
        from scipy.interpolate import CubicSpline

        times = np.arange(len(self.samples)) / self.fs
        c = CubicSpline(times, self.samples, bc_type="clamped").c  # it starts and ends at rest
        columns = np.column_stack([times[:-1], self.samples[:-1], c[2], 2 * c[1], 6 * c[0]])
        knots = np.vstack([columns, [times[-1], self.samples[-1], 0.0, 0.0, 0.0]])
        names = ("z0", "z1", "z2", "z3")
        rates = {"z0": {"z1": 1.0}, "z1": {"z2": 1.0}, "z2": {"z3": 1.0}, "z3": {}}
        start, row = dict(zip(names, map(float, knots[0, 1:]), strict=True)), {"z0": 1.0}
        base, force = (row, {}) if self.on == "base" else ({}, row)
        face = base if self.contact == "base" else {}
        return Motion(rates, start, force=force, base=base, face=face, knots=knots, knotted=names)


def _values(motion: Motion, time: float) -> dict[str, float]:
    """The signals of a drive at an instant: knots start them anew, and their rates are linear in themselves and 1."""
    from scipy.linalg import expm

    turning = {name for cosine, sine, *_ in motion.tones for name in (cosine, sine)}
    values, since = {name: v for name, v in motion.start.items() if name not in turning}, 0.0
    if motion.knots is not None:
        row = motion.knots[int(np.searchsorted(motion.knots[:, 0], time, side="right")) - 1]
        values |= dict(zip(motion.knotted, map(float, row[1:]), strict=True))
        since = float(row[0])
    names = (*values, "1")
    flow = np.array([[motion.rates.get(name, {}).get(other, 0.0) for other in names] for name in names])
    moved = expm(flow * (time - since)) @ np.array([*values.values(), 1.0])
    known = dict(zip(values, map(float, moved[:-1]), strict=True))
    for cosine, sine, omega, phase in motion.tones:
        known |= {cosine: math.cos(phase + omega * time), sine: math.sin(phase + omega * time)}
    return known


class March:
    """The motion of a system, from time 0 on.

    Parameters
    ----------
    system : Oscillator or Structure
    start : mapping
        State at time 0, as `simulate` takes it.

    Raises
    ------
    ModelError
        A law that remembers its past in more than its state.

    Examples
    --------
    >>> from stickslip.drives.kinds import HarmonicBase
    >>> from stickslip.laws.coulomb import Coulomb
    >>> march = March(Oscillator(mass=1, stiffness=4, law=Coulomb(0.1), drive=HarmonicBase(1.0, frequency=0.1)), {})
    >>> march.ahead(1000.0)
    >>> march.values("z", np.array([999.0, 1000.0])).round(9).tolist()
    [0.809016994, 1.0]
    """

    def __init__(self, system: System, start: Mapping[str, float | str]) -> None:
        if isinstance(system, Oscillator) and isinstance(system.law, TimeDelay):
            raise ModelError(
                "a law with a delay",
                "a motion goes on from its state, and this law asks for its past",
                "use another law",
            )
        self.legs: list[Leg] = []
        self.plan: list[tuple[float, Drive]] = []  # what moves the system, from when on
        self._begin(system, 0.0)
        self.state, self.mode = opening(self.table, start)

    @property
    def end(self) -> float:
        """Time [s] up to which the motion is known."""
        return self.legs[-1].end if self.legs else 0.0

    @property
    def over(self) -> bool:
        """Whether the drive was recorded no longer."""
        return not self.plan and self.end >= self.origin + self.drive_ends * (1 - 1e-12)

    def ahead(self, time: float) -> None:
        """Go on until the motion is known at a time [s], or the drive ends."""
        while self.end <= time and not self.over:
            self._leg()
        while len(self.legs) > 1 and self.legs[0].end < time - KEPT:
            del self.legs[0]

    def change(self, plan: Sequence[tuple[float, Drive]]) -> None:
        """Move the system otherwise: drives, each from its instant [s] on; what was known after the first is void."""
        first = plan[0][0]
        while len(self.legs) > 1 and self.legs[-1].begin >= first:
            del self.legs[-1]
        self.plan = list(plan)
        self._switch()

    def values(self, label: str, times: Array) -> Array:
        """What was, at increasing instants [s] that are known: "x", "a", "friction", of a structure "x1" ..."""
        out = np.zeros(len(times))
        for number, leg in enumerate(self.legs):
            last = number == len(self.legs) - 1
            first = 0 if number == 0 else int(np.searchsorted(times, leg.begin))
            rows = slice(first, len(times) if last else int(np.searchsorted(times, leg.end)))
            if rows.start >= rows.stop:
                continue
            labelled = leg.sensed.get(label)
            if labelled is not None:  # a base that stands still is at 0
                local = np.clip(times[rows] - leg.begin, 0.0, leg.run.duration)
                out[rows] = leg.run.sample(local, (labelled[0],))[0][labelled[1]]
        return out

    def breaks(self, first: float, last: float) -> Array:
        """Instants in (first, last) at which the acceleration may jump."""
        starts = [leg.begin + leg.run.starts for leg in self.legs if leg.begin < last and leg.end > first]
        instants = np.concatenate(starts) if starts else np.empty(0)
        return instants[(instants > first) & (instants < last)]

    def _begin(self, system: System, at: float) -> None:
        """A drive begins; everything is counted from here."""
        self.system, self.origin, self.laps = system, at, 0
        self.table: Any = _tables(system)
        self.motion: Motion = self.table.motion
        self.drive_ends = self.motion.end

    def _leg(self) -> None:
        """One more."""
        motion, passed = self.motion, self.end - self.origin
        period = motion.period
        if math.isfinite(period):
            laps = max(1, math.ceil(LEG / period))
            span, begin = (float(laps), 0.0), self.origin + self.laps * period
            self.laps += laps
            end = self.origin + self.laps * period
        else:
            span, begin = (0.0, min(LEG, self.drive_ends - passed)), self.end
            end = begin + span[1]
            if (motion.tones or motion.knots is not None) and passed > 0:
                self.table = _tables(replace(self.system, drive=Later(self.system.drive, passed)))
        known = self._run(span)
        self.legs.append(Leg(begin, end, known, _sensed(known)))
        self.state, self.mode = known.end()
        if not math.isfinite(period):
            self._set_signals(_values(motion, end - self.origin))
        if self.plan and self.plan[0][0] < end:
            self._switch()

    def _run(self, span: tuple[float, float]) -> Trajectory:
        table = self.table
        if isinstance(self.system, Oscillator) and isinstance(self.system.law, CurvedLaw):
            course = (span, stops_of(table, *span))
            return run_curved(table, self.state, self.mode, course=course, budget=BUDGET, rtol=RTOL)
        return run(self.system, table, self.state, self.mode, span=span, budget=BUDGET)

    def _switch(self) -> None:
        """The first drive of the plan takes over, at its instant within or right after the last leg."""
        at, drive = self.plan.pop(0)
        if self.legs:
            leg = self.legs[-1]
            self.legs[-1] = leg._replace(end=at)
            physical, piece = leg.run.sample([min(at - leg.begin, leg.run.duration)], ("state",))
            mode, known = int(leg.run.modes[piece[0]]), physical[:, 0]
        else:
            mode, known = self.mode, self.state[: self.table.physical]
        self._begin(replace(self.system, drive=drive), at)
        self.state, self.mode = opening(self.table, {})[0], mode
        self.state[: self.table.physical] = known
        self._set_signals(self.motion.start)

    def _set_signals(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self.state[self.table.names.index(name)] = value


def _tables(system: System) -> Any:
    if isinstance(system, Oscillator) and isinstance(system.law, CurvedLaw):
        return tape(system)
    return table_of(system)


def _sensed(run: Trajectory) -> dict[str, tuple[str, int, str]]:
    moved = {"z": bool(run.table.motion.base), "force": bool(run.table.motion.force)}
    return {
        label: (name, row, unit)
        for name in ("x", "v", "a", "friction", "z", "force")
        if moved.get(name, True)
        for row, (label, unit) in enumerate(zip(run.labels(name), run.units(name), strict=True))
    }
