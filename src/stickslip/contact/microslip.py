"""Micro-slips: how often, when and for how long does a sticking contact give way a little?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.contact.frequency_transition import heard_mode
from stickslip.contact.mechanisms import UNTOLD, not_one_mode, too_fast
from stickslip.contact.ringing import Ringing, Window, find_ringing
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Estimate, Result, Status
from stickslip.record.record import Record
from stickslip.signals.pieces import Piece
from stickslip.statistics import mean_of_cycles

Array = NDArray[np.float64]

QUESTION = "micro-slips"
ASTRAY = 0.27  # of a cycle of the ring: the cuts may lie so far from where a micro-slip begins and ends
STEPS = (0.03, 0.008, 0.002)  # of the same: the search goes from coarse to fine


@dataclass(frozen=True)
class MicroSlip:
    """One micro-slip.

    Attributes
    ----------
    time : float
        When it begins [s].
    duration : float
        How long it lasts [s].
    stick : int
        Number of the stick it lies in.
    """

    time: float
    duration: float
    stick: int


@dataclass(frozen=True, eq=False, repr=False)
class MicroSlips(Result):
    """The micro-slips of a record.

    Attributes
    ----------
    per_stick : Estimate
        How many in one stick, mean of the sticks.
    events : tuple of MicroSlip
        In order.
    counts : tuple of int
        How many in each stick.
    kind : str
        "double stick-slip" where most sticks hold a micro-slip; "no micro-slips", or "some sticks slip";
        "cannot be told from this record" where the sticks swing, but not as one mode.
    status : str
        "ok", or in words what to beware of.
    """

    per_stick: Estimate
    events: tuple[MicroSlip, ...]
    counts: tuple[int, ...]
    kind: str
    status: str


def find_microslips(
    record: Record, *, channel: str = "a", mass: Constant | None = None, stiffness: Constant | None = None
) -> MicroSlips:
    """How many times does the contact slip by a little within each stick, when, and for how long?

    While a compliant contact sticks it rings with the mass; where the friction limit cuts a swing off, the mass slips
    until it stops again (thesis chapters 4 and 5: micro-slip; with the slip from one stick to the next it makes double
    stick-slip). There the acceleration follows the drive alone, a parabola, and not the ring: the cuts between them are
    found by dynamic programming, as in :func:`transition`. Begin and end are where ring, line and ring fit best that
    meet without a jump, for friction reaches its limit and leaves it without one. The begin is a kink and told to a
    sample or two; the end is smoother and less sure.

    Parameters
    ----------
    record : Record
        With an acceleration; see :func:`transition`.
    channel : str
        The acceleration.
    mass, stiffness : float, str, tuple or Estimate, optional
        Oscillating mass [kg] and spring [N/m]: with ``x`` and ``z``, to take a stated mount out of the acceleration.

    Returns
    -------
    MicroSlips

    Raises
    ------
    EstimateError
        "no transition": no stick.
    RecordError
        A channel that is missing or not finite, a broken clock.

    Examples
    --------
    >>> import stickslip as ss
    >>> case = ss.scenarios.get("THESIS compliant 2.5Hz fk=1.1 Ky=192000 z.0174(k+Ky)")
    >>> record = ss.simulate(case.system, cycles=8).record(fs=4000).between(1.0, 3.2)
    >>> found = find_microslips(record)
    >>> found.kind, round(found.per_stick.value)
    ('double stick-slip', 2)
    """
    return microslips_of(find_ringing(record, channel, question=QUESTION, mass=mass, stiffness=stiffness))


def microslips_of(ringing: Ringing) -> MicroSlips:
    """The micro-slips of sticks that are cut into pieces already."""
    if ringing.silent:
        raise EstimateError(
            "no transition: the sticks do not ring",
            "a micro-slip interrupts the ringing of a contact, and a mass at rest shows none",
            "the mechanism tells what the sticks are like",
        )
    heard_mode(ringing)  # what cuts no ring off is no micro-slip
    if too_fast(ringing):
        raise EstimateError(
            f"no transition: {too_fast(ringing)}",
            "a micro-slip interrupts a ringing that is told",
            "record at a higher rate, or give x or v beside it, that sticks are told from",
        )
    counts = tuple(len(window.glides) for window in ringing.windows)
    events = []
    for number, window in enumerate(ringing.windows):
        for piece in window.glides:
            begin, end = _edges(window, piece, ringing.pole / ringing.fs)
            events.append(MicroSlip(ringing.time(window, begin), (end - begin) / ringing.fs, number))
    astray = not_one_mode(ringing)
    per_stick = mean_of_cycles(
        "micro-slips per stick", [float(count) for count in counts], unit="1",
        method="cuts between rings of one mode, by dynamic programming",
    ).within(0.0)  # fmt: skip
    blurred = "without a load cell whose mount is stated, one may be missed or seen twice" if ringing.blurred else ""
    status = Status(ringing.status, astray, blurred)
    per_stick = replace(per_stick, status=per_stick.status if status == "ok" else status)
    return MicroSlips(per_stick, tuple(events), counts, UNTOLD if astray else _kind(counts), status)


def _kind(counts: Sequence[int]) -> str:
    """What sticks that hold so many micro-slips each are called."""
    share = sum(count > 0 for count in counts) / len(counts)
    return "double stick-slip" if share > 0.5 else "some sticks slip" if share > 0 else "no micro-slips"


def _edges(window: Window, glide: Piece, pole: complex) -> tuple[float, float]:
    """Rows where a micro-slip begins and ends: where a ring, a line and a ring that meet leave the least."""
    number, cycle = window.pieces.index(glide), 2 * math.pi / pole.imag
    low, high = window.pieces[number - 1].first, window.pieces[number + 1].last
    rows, values = np.arange(low, high, dtype=float), window.values[low:high]
    begin, end, reach = float(glide.first), float(glide.last), ASTRAY * cycle
    for step in STEPS:
        away = np.arange(-reach, reach + step * cycle / 2, step * cycle)
        tried = [
            (_left(rows, values, first, last, pole), first, last)
            for first in begin + away if first >= low + 2
            for last in end + away if first + 1 <= last <= high - 2
        ]  # fmt: skip
        if tried:
            _, begin, end = min(tried)
        reach = step * cycle
    return begin, end


def _left(rows: Array, values: Array, begin: float, end: float, pole: complex) -> float:
    """Sum of squares, but for a constant, that the ring, the line and the next ring leave."""
    first, second = np.searchsorted(rows, (begin, end))
    before, after = np.exp(pole * (rows[:first] - begin)), np.exp(pole * (rows[second:] - end))
    design = np.zeros((4, len(rows)))  # level and slope where the line begins; what each ring has of its own
    design[0, :first], design[0, first:second], design[0, second:] = before.real, 1.0, after.real
    design[1, first:second], design[1, second:] = rows[first:second] - begin, (end - begin) * after.real
    design[2, :first], design[3, second:] = before.imag, after.imag
    along = design @ values
    return -float(along @ np.linalg.lstsq(design @ design.T, along, rcond=None)[0])
