"""When does a contact take hold, and when does it let go? To a part of a sample, from its friction and its velocity."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array, Rows, stretches
from stickslip.balance.force import FUSIONS
from stickslip.balance.likely_contact import sliding_level
from stickslip.balance.motion import slid_on
from stickslip.record.record import Record

HELD = 0.9  # share of the sliding friction below which the contact certainly holds
LEAST = 4  # samples of one hold from which its spring is told
BEFORE, AFTER = (-20, -3), (4, 20)  # samples before a hold and after it that tell the sliding friction there
SURE = 4.0  # standard deviations that a reversal of the velocity, and the friction's fall in it, must have
ALIKE = 8.0  # samples over which the friction's error keeps
FEW = 4  # holds
LONGEST = 400  # samples in which a hold ends after the friction was last below its limit
SHORT = 8.0  # samples of a hold below which others are likely missed


@dataclass(frozen=True)
class Hold:
    """One hold of the contact.

    Attributes
    ----------
    begin, end : float
        When the velocity turns and the contact takes hold, and when the friction reaches its limit and it lets go [s].
    begin_sd, end_sd : float
        Standard deviations of both [s].
    """

    begin: float
    end: float
    begin_sd: float
    end_sd: float


@dataclass(frozen=True, eq=False)
class Trace:
    """Friction and velocity of a contact with their standard deviations, from all its sensors together."""

    friction: Array
    friction_sd: Array
    velocity: Array
    velocity_sd: Array
    fs: float
    start: float

    @classmethod
    def of(cls, record: Record) -> Trace:
        """From a record to which the friction was added with its band."""
        sd = record["v_sd"] if "v_sd" in record else np.full(len(record), record.channels["v"].noise or 0.0)
        return cls(record["friction"], record["friction_sd"], record["v"], sd, record.fs, record.start)


@dataclass(frozen=True, eq=False)
class Spring:
    """How the friction follows the motion while the contact holds: K x + c v.

    `rest` is what that leaves of the friction, `miss` by how much it misses the sliding friction at a hold's begin [N].
    """

    stiffness: float
    damping: float
    rest: float
    miss: float
    travel: Array

    def carried(self, trace: Trace, rows: slice, core: slice) -> Array:
        """The friction in some samples, carried on from those in which the contact certainly holds."""
        follows = [self.stiffness * self.travel[part] + self.damping * trace.velocity[part] for part in (rows, core)]
        return np.asarray(follows[0] + np.mean(trace.friction[core] - follows[1]))


def find_holds(trace: Trace) -> tuple[Hold, ...]:
    """When does the contact hold?

    It takes hold where its velocity turns, at the sliding friction, and from then on the friction falls: there a
    cubic through four samples of the velocity crosses zero. While it holds the friction follows a spring and a damper,
    the same in all holds, found by least squares; it lets go where that friction, carried on, reaches the
    friction with which it then slides. So neither time depends on how the smoother rounds the friction's corners.

    Parameters
    ----------
    trace : Trace

    Returns
    -------
    tuple of Hold
        Those that begin and end in the record; none, if fewer than four are resolved.
    """
    level, middle = sliding_level(trace.friction, trace.velocity)
    trace = replace(trace, friction=trace.friction - middle)
    turns = np.flatnonzero(trace.velocity[:-1] * trace.velocity[1:] < 0)
    turns = turns[(turns > -BEFORE[0]) & (turns < len(trace.velocity) - AFTER[1])]
    cores = _cores(trace, level, turns)
    if len(cores) < FEW:
        return ()
    spring = _spring(trace, cores)
    return tuple(_hold_at_each_turn(trace, spring, level, turns, dict(cores)))


def _cores(trace: Trace, level: float, turns: Rows) -> list[tuple[int, slice]]:
    """For each turn of the velocity out of sliding, the samples after it in which the contact certainly holds."""
    begins, ends = stretches(np.abs(trace.friction) < HELD * level)
    first_and_core: dict[int, tuple[int, slice]] = {}
    for turn in turns:
        at = int(np.searchsorted(ends, turn, side="right"))
        side = math.copysign(1.0, trace.velocity[turn])
        # the friction is where it slides to that side, and falls after the turn
        if at == len(begins) or side * trace.friction[turn] < HELD * HELD * level:
            continue
        first, last = max(int(begins[at]), turn + 1), int(ends[at])
        if last - first >= LEAST and last < len(trace.velocity) and at not in first_and_core:
            between = trace.velocity[turn + 1 : first + 1] * side
            if np.all(between <= 0):
                first_and_core[at] = (int(turn), slice(first, last))
    return list(first_and_core.values())


def _spring(trace: Trace, cores: list[tuple[int, slice]]) -> Spring:
    """K and c of all holds together, each with its own rest; those fitting thrice worse than most are left out."""
    travel = np.concatenate([[0.0], np.cumsum((trace.velocity[1:] + trace.velocity[:-1]) / 2)]) / trace.fs
    parts = [
        (np.column_stack([_centred(travel[rows]), _centred(trace.velocity[rows])]), _centred(trace.friction[rows]))
        for _, rows in cores
    ]
    for _ in range(2):
        designs, forces = zip(*parts, strict=True)
        answer, *_ = np.linalg.lstsq(np.vstack(designs), np.concatenate(forces), rcond=None)
        rests = np.array([np.sqrt(np.mean((force - design @ answer) ** 2)) for design, force in parts])
        parts = [part for part, rest in zip(parts, rests, strict=True) if rest <= 3 * np.median(rests)]
    spring = Spring(float(answer[0]), float(answer[1]), float(np.median(rests)), 0.0, travel)
    misses = [
        _sliding(trace, 1.0, turn + BEFORE[0], turn + BEFORE[1], 0, 0.0)
        - spring.carried(trace, slice(turn, turn + 1), rows)[0]
        for turn, rows in cores
    ]
    return replace(spring, miss=float(np.median(np.abs(misses))))


def _centred(values: Array) -> Array:
    return np.asarray(values - values.mean())


def _hold_at_each_turn(
    trace: Trace, spring: Spring, level: float, turns: Rows, cores: dict[int, slice]
) -> Iterator[Hold]:
    """Hold after hold; turns of the velocity within one are passed over."""
    free = 0  # where the last hold ended, in samples
    for turn in turns:
        if turn < free:
            continue
        side = math.copysign(1.0, trace.velocity[turn])
        before = _sliding(trace, side, turn + BEFORE[0], turn + BEFORE[1], free, level)
        if side * trace.friction[turn] < HELD * HELD * before:
            continue
        begin, slope = _crossing(trace.velocity, turn)
        hold = _end(trace, spring, int(turn), {1.0: before, -1.0: level}, cores.get(int(turn)))
        if hold is None or slope == 0:
            continue
        end, end_sd = hold
        begin_sd = float(trace.velocity_sd[turn]) / abs(slope * trace.fs)
        yield Hold(trace.start + begin / trace.fs, trace.start + end / trace.fs, begin_sd, end_sd / trace.fs)
        free = math.ceil(end)


def _sliding(trace: Trace, side: float, first: int, last: int, free: float, level: float) -> float:
    """The sliding friction in some samples, as far as they lie in one slip."""
    part = side * trace.friction[max(first, math.ceil(free) + 2) : last]
    return float(part.mean()) if len(part) >= 3 else level


def _crossing(values: Array, row: int) -> tuple[float, float]:
    """Where the cubic through four samples crosses zero between the middle ones, in samples, and its slope there."""
    a, b, c, d = values[row - 1 : row + 3]
    cubic = np.array([(d - a) / 6 + (b - c) / 2, (a + c) / 2 - b, c - b / 2 - a / 3 - d / 6, b])
    at = b / (b - c)
    for _ in range(3):  # Newton
        slope = float(np.polyval(np.polyder(cubic), at))
        at = float(np.clip(at - np.polyval(cubic, at) / slope, 0.0, 1.0)) if slope else at
    return row + at, float(np.polyval(np.polyder(cubic), at))


def _end(
    trace: Trace, spring: Spring, turn: int, limits: dict[float, float], core: slice | None
) -> tuple[float, float] | None:
    """When the hold after a turn ends, in samples, and its standard deviation; None if there is no hold, or no end.

    `limits` is the sliding friction to either side of the velocity before the turn.
    """
    side = math.copysign(1.0, trace.velocity[turn])
    near = slice(turn, min(len(trace.velocity), (core.stop if core else turn) + LONGEST))
    known = core or slice(turn, turn + 1)
    carried = side * spring.carried(trace, near, known)
    if core is None:
        carried += limits[1.0] - carried[0]
    turned = side * trace.velocity[near] < -SURE * trace.velocity_sd[near]
    stuck = np.flatnonzero(turned & (limits[1.0] - carried > SURE * trace.friction_sd[near]))
    if not len(stuck):
        return None
    begun = int(stuck[0])
    end, doubt = math.nan, 0.0
    for _ in range(2):
        over = np.flatnonzero((carried[begun:] >= limits[1.0]) | (-carried[begun:] >= limits[-1.0]))
        if not len(over) or over[0] == 0:
            return None
        row = begun + int(over[0])
        way = math.copysign(1.0, carried[row])
        slope = way * float(carried[row] - carried[row - 1])
        end = turn + row - (way * float(carried[row]) - limits[way]) / slope
        first, last = math.ceil(end) + AFTER[0], math.ceil(end) + AFTER[1]
        limits = {**limits, way: _sliding(trace, side * way, first, last, 0, limits[way])}
        there = float(np.median(trace.friction_sd[first:last]) * math.sqrt(ALIKE / (AFTER[1] - AFTER[0])))
        alone = spring.rest * math.sqrt(min(1.0, ALIKE / (known.stop - known.start)))
        doubt = math.hypot(alone, there, spring.miss / 2) / slope
    return end, doubt


def fused_holds(record: Record, contact: str | None) -> tuple[tuple[Hold, ...], tuple[str, ...]]:
    """The holds of a contact whose friction was found by all sensors together; and what is lost where it was not."""
    rig = record.rig
    unseen = "onsets are told to the threshold only and micro-slips not at all"
    if "friction" not in record or rig is None or rig.method not in FUSIONS:
        return (), (f'{unseen}: for them call friction_force(record, ..., method="fusion") first',)
    if slid_on(record, contact) == "base":
        return (), (
            f"{unseen}: the contact is on the moving base, and the sensors together tell what rubs on the ground",
        )
    holds = find_holds(Trace.of(record))
    if not holds:
        return (), (
            f"{unseen}: the contact's holds are shorter than four samples at {record.fs:g} Hz, or there are none",
        )
    cell = "load" in record and rig.method != "motion"
    lost = [] if cell else ["without a load cell onsets are three to ten times less sure"]
    shortest = record.fs * min(hold.end - hold.begin for hold in holds)
    if shortest < SHORT:
        lost.append(f"holds last {shortest:.0f} samples at {record.fs:g} Hz, and shorter ones are missed")
    return holds, (*lost, *rig.lost)
