"""A motion cut at its reversals: in each stroke the contact first holds, then breaks away, then slides one way."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import (
    AUDIBLE,
    CREEP,
    Motion,
    contact_motion,
    definite_speed,
    find_cycles,
    motion_channels,
    require_fit,
)
from stickslip.errors import EstimateError
from stickslip.record.record import Record
from stickslip.signals.interpolate import without_delays

Array = NDArray[np.float64]

FAST = 0.5  # of a stroke's largest speed, above which it certainly slides
NEAR = 0.9  # of the sliding friction: at this much the contact is about to slip
FALL = 0.05  # of the sliding friction by which it falls after its first peak, at least
HELD = 0.5  # of the sliding friction: a contact that moves before it bears so much gives way, it does not slip
MOST = 200  # strokes looked at, evenly chosen: their mean is known well enough
SHORT = 0.7  # of the usual travel: shorter strokes belong to the start or the end of a run
SLIPPED = 3.0  # times the speed that may be rest


@dataclass(frozen=True, eq=False)
class Stroke:
    """From one reversal to the next, with friction and displacement positive in the direction that it goes.

    Friction is that about the middle of both directions (see :class:`Strokes`).

    Attributes
    ----------
    way : int
        1 forward, -1 back.
    first : int
        Row of the record at the reversal.
    friction, displacement : ndarray
        From the reversal on.
    level : float
        Sliding friction of the stroke [N]: the median where it is fast.
    slip : int
        Row, from the reversal, where it breaks away: of the largest friction before it moves; of a contact that gives
        way before, of the first peak of the friction once that is near its level.
    rests : bool
        Whether it does not move before.
    """

    way: int
    first: int
    friction: Array
    displacement: Array
    level: float
    slip: int
    rests: bool


@dataclass(frozen=True, eq=False)
class Strokes:
    """The whole strokes of a motion, and the motion.

    Their friction is told from `offset`, half-way between that of both directions: the zero of a sensor may be off, a
    rig may slope, and a contact whose directions differ breaks away about that middle too.
    """

    strokes: tuple[Stroke, ...]
    motion: Motion
    unit: str
    offset: float

    def to(self, way: int) -> list[Stroke]:
        """Those that go forward (1) or back (-1)."""
        return [stroke for stroke in self.strokes if stroke.way == way]


def find_strokes(record: Record, *, contact: str | None, question: str) -> Strokes:
    """Cut a record at the reversals of its motion; strokes that never reach their sliding friction are left out."""
    record.require_clean("friction", question=question)
    record = without_delays(record, *motion_channels(record, contact), "friction", question=question)
    motion = contact_motion(record, contact=contact, question=question)
    require_fit(record, "friction", length=motion.unit, question=question)
    slow = max(CREEP * find_cycles(record, motion).peak, AUDIBLE * motion.noise)
    noise = record.channels["friction"].noise or 0.0
    friction, velocity = record["friction"], motion.velocity
    ways = _ways(velocity, definite_speed(motion), slow)
    ways = ways[:: len(ways) // MOST // 2 * 2 + 1]  # an odd step: both directions in turn
    offset = _middle(friction, velocity, ways)
    strokes = []
    for first, last, way in ways:
        force, speed = way * (friction[first:last] - offset), way * velocity[first:last]
        level = _level(force, speed)
        broke = _breakaway(force, speed, level, slow, max(FALL * level, AUDIBLE * noise))
        if broke is not None:
            strokes.append(Stroke(way, first, force, way * motion.displacement[first:last], level, *broke))
    if not strokes:
        raise EstimateError(
            "no stroke from one reversal to the next in which the contact slides",
            f"{question} needs a contact that turns round and slides",
            "give a longer record, or one with more motion",
        )
    travels = np.array([np.ptp(stroke.displacement) for stroke in strokes])
    whole = [stroke for stroke, way in zip(strokes, travels, strict=True) if way > SHORT * np.median(travels)]
    return Strokes(tuple(whole), motion, record.channels["friction"].unit, offset)


def _level(force: Array, speed: Array) -> float:
    return float(np.median(force[speed > FAST * speed.max()]))


def _middle(friction: Array, velocity: Array, ways: list[tuple[int, int, int]]) -> float:
    """Half-way between the sliding friction of both directions."""
    levels: dict[int, list[float]] = {1: [], -1: []}
    for first, last, way in ways:
        levels[way].append(_level(friction[first:last], way * velocity[first:last]))
    return sum(float(np.median(level)) for level in levels.values()) / 2 if all(levels.values()) else 0.0


def _ways(velocity: Array, definite: float, slow: float) -> list[tuple[int, int, int]]:
    """First row, row after the last, and direction of each stroke; it begins where the one before came to rest."""
    moving = np.flatnonzero(np.abs(velocity) > definite)
    signs = np.sign(velocity[moving])
    turns = np.flatnonzero(signs[1:] != signs[:-1])
    starts = []
    for before, after in zip(moving[turns], moving[turns + 1], strict=True):
        way = int(np.sign(velocity[after]))
        starts.append((before + int(np.argmax(way * velocity[before : after + 1] > -slow)), way))
    return [(first, last, way) for (first, way), (last, _) in pairwise(starts)]


def _breakaway(force: Array, speed: Array, level: float, slow: float, fall: float) -> tuple[int, bool] | None:
    """Row where a stroke breaks away, and whether it rests until then; None where it bears no friction."""
    moved = int(np.argmax(speed > SLIPPED * slow))
    if level <= 0 or moved < 2:
        return None
    if force[moved] > HELD * level:
        before = moved // 2
        return before + int(np.argmax(force[before : moved + 1])), True
    near = np.flatnonzero(force >= NEAR * level)
    if not len(near):
        return None
    highest = np.maximum.accumulate(force[near[0] :])
    fallen = np.flatnonzero(highest - force[near[0] :] > fall)
    last = int(fallen[0]) + 1 if len(fallen) else len(highest)
    return int(near[0]) + int(np.argmax(force[near[0] : near[0] + last])), False
