"""Mistakes in how a record or its rig was stated, each with what would mend it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from stickslip.consistent.checks import MILLISECONDS, Check, Slip
from stickslip.consistent.contradictions import Consistency
from stickslip.cycle.loops import Loops
from stickslip.errors import RecordError
from stickslip.record.record import Record
from stickslip.rig.settings import RigSettings
from stickslip.signals.noise import quantisation_step

LATEST = 0.1  # of a record's length: a sensor that is said to be later, and tells of no cycle, is late by milliseconds
SHORTEST_DELAY = 0.05  # s: a true delay of more than a cycle is shorter than this, where the motion is fast
HALF_TURN = math.pi  # rad: what swings farther, and is called an angle in rad, is one in degrees
WHOLE_TURN = 2 * math.pi  # rad: what turns farther without a unit is as likely in degrees, or in counts of an encoder
BITS = range(8, 25)  # of an encoder, whose counts are this power of two's part of a turn
ALIKE = 1e-4  # by which a step may miss a count's: counts of 360 degrees and of 2 pi rad are 10 % apart at the nearest
BALANCED = ("balance", "energy")  # checks that a wrong mass, spring or sensor fails
MOVES = "acceleration"  # of the check that a wrong unit of a, or of x, fails
FAR = 2.0  # times by which two sides that should be one differ, from which no force is given
NEAR = 0.1  # by which a ratio of frequencies may miss the one that a slip makes


def slipped(slips: Sequence[Slip]) -> str:
    """What one slip of the hand would explain, in words; nothing without one."""
    return f"something is stated wrongly: probably {' or '.join(slip.words for slip in slips)}" if slips else ""


def untrue(consistency: Consistency | None) -> str:
    """What of channels and constants can not all be true, in words; a clipped sensor says so itself."""
    failed = consistency.failed if consistency is not None else ()
    if any("range" in check.name for check in failed):
        return ""
    apart = [check.sentence for check in failed if any(word in check.name for word in BALANCED)]
    if apart:
        return f"the record and the rig's constants contradict each other: {apart[0]}"
    apart = [check.sentence for check in failed if MOVES in check.name and _far(check)]
    return f"the record contradicts itself: {apart[0]}" if apart else ""


def _far(check: Check) -> bool:
    """Whether two sides are so far apart that no force is worth a headline."""
    return bool(check.right) and not 1 / FAR < check.left / check.right < FAR


def hopeless(consistency: Consistency | None) -> str:
    """What of channels and constants can not all be true, where it is so far off that no force is worth a headline."""
    failed = consistency.failed if consistency is not None else ()
    return untrue(consistency) if any(_far(c) for c in failed if any(w in c.name for w in (*BALANCED, MOVES))) else ""


def mistakes(record: Record, rig: RigSettings, consistent: Consistency | None, loops: Loops | None) -> tuple[Slip, ...]:
    """What one slip of the hand would explain, the likeliest first; none where nothing speaks for one."""
    late = _late(record, rig, loops)
    return (late,) if late is not None else consistent.slips if consistent is not None else ()


def _late(record: Record, rig: RigSettings, loops: Loops | None) -> Slip | None:
    """Milliseconds taken for seconds, of a delay that lasts longer than a cycle, or much of the record."""
    period = 1 / loops.frequency.value if loops is not None else LATEST * record.duration
    stated = {name: channel.delay for name, channel in record.channels.items()}
    stated |= {name: sensor.delay for name, sensor in rig.sensors.items() if "delay" in sensor.model_fields_set}
    far = {name: late for name, late in stated.items() if abs(late) > max(period, SHORTEST_DELAY)}
    if not far:
        return None
    late = next(iter(far.values()))
    cycles = f" ({abs(late) / period:.3g} cycles of the motion)" if loops is not None else ""
    mistake = f"the delay of {' and '.join(far)}, {late:.4g} s{cycles}, is in ms, not in s"
    return Slip(mistake, delays={name: MILLISECONDS * late for name, late in far.items()})


def missing(record: Record, rig: RigSettings) -> tuple[str, ...]:
    """What must be stated before a friction force can be found; nothing where one is read or found."""
    if not {"friction", "load", "force"}.isdisjoint(record) or "x" not in record:
        return ()
    return tuple(name for name in ("mass", "stiffness") if getattr(rig, name) is None)


def mistakes_of_decay(
    channel: str, swing: float, frequency: float, mass: float | None, stiffness: float | None
) -> tuple[Slip, ...]:
    """An angle in degrees, and what a frequency that mass and stiffness contradict would explain.

    Parameters
    ----------
    channel : str
        What was measured.
    swing : float
        Its amplitude in SI.
    frequency : float
        Of the oscillation [Hz].
    mass, stiffness : float or None
        As stated, in SI.

    Returns
    -------
    tuple of Slip
        The likeliest first.
    """
    if channel == "theta" and swing > HALF_TURN:
        mistake = f"theta, which swings {swing:.3g} rad to each side, is in degrees, not in rad"
        return (Slip(mistake, {channel: (channel, math.pi / 180)}),)
    return tuple(_of_frequency(frequency, mass, stiffness))


def _of_frequency(frequency: float, mass: float | None, stiffness: float | None) -> Iterator[Slip]:
    if not mass or not stiffness or not math.isfinite(frequency):
        return
    ratio = frequency * 2 * math.pi / math.sqrt(stiffness / mass)
    for slip, expected in (
        (Slip("the stiffness is in N/mm, not in N/m", constants={"stiffness": 1e3}), 1e3**0.5),
        (Slip("the mass is in g, not in kg", constants={"mass": 1e-3}), 1e3**0.5),
        (Slip("the time is in ms, not in s", clock=MILLISECONDS), MILLISECONDS),
    ):
        if abs(ratio / expected - 1) < NEAR:
            yield slip


def called(record: Record, name: str) -> str:
    """A channel by its column's name in the file; where it came from none by its own."""
    column = record.channels[name].column
    return name if column in ("", "array") else column


def require_angle(record: Record) -> None:
    """Refuse an angle without a unit that is none in rad: by an encoder's count, or as it turns too far.

    Raises
    ------
    RecordError
        The unit has to be stated: which one, and how.

    Examples
    --------
    >>> swung = Record.of({"theta": np.round(60 * np.sin(np.arange(500) / 50) / 0.087890625) * 0.087890625}, fs=100)
    >>> require_angle(swung)  # its unit is that of Record.of: rad
    """
    for name in ("theta", "reference"):
        if name not in record or not record.channels[name].assumed:
            continue
        column, step = called(record, name), quantisation_step(record[name])
        low, high = float(np.min(record[name])), float(np.max(record[name]))
        if high - low <= WHOLE_TURN and not any(abs(step * 2**bits / 360 - 1) < ALIKE for bits in BITS):
            continue
        kind, remedy = "degrees", f'--units "{column}=deg", or =rad where it is'
        if step == 1:
            kind, remedy = (
                "counts of an encoder",
                f'--channels "{name}={column} / 4096 [turn]", by its counts in a turn',
            )
        raise RecordError(
            f"{column} runs from {low:.4g} to {high:.4g}{f', in steps of {step:.4g}' if step else ''}, without a unit",
            f"an angle in rad hardly does: it is in {kind}",
            f"state its unit: {remedy}",
        )
