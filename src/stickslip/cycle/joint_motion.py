"""Which motion would tell all of a joint's friction?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError
from stickslip.parameters import finite
from stickslip.record.record import Record, require_record
from stickslip.signals.derivatives import differentiate

Array = NDArray[np.float64]

WITHIN = 0.95  # of the range that the log has
SLOW, FAST, STROKE = 0.2, 0.9, 0.5  # of its fastest speed: the speed of each part of the motion
CREEP = 0.002  # of it, before a joint breaks away: at 0.01 the torque rose too fast in 40 of 42 simulated joints
CYCLES, RESTS = (2, 6), 10  # slow and fast ones, and how often it creeps away
PAUSE, CREEPS = 0.5, 3.0  # s
THIRD = 1.8  # speed of 0.6 cos(w t) + 0.4 cos(3 w t) over w, at most


def telling_motion(record: Record, *, fs: float = 200.0) -> Record:
    """Which motion would tell all of a joint's friction, within the range and the speed that its log has?

    Slow swings through the whole range (Coulomb friction, gravity, and friction that grows with it), fast ones of two
    tones (viscous friction and inertia), then strokes from rests out of which it creeps (breakaway).

    Parameters
    ----------
    record : Record
        A log of the joint, with ``theta`` (or ``x``): where it may go, and how fast.
    fs : float
        Samples of the motion in a second [Hz].

    Returns
    -------
    Record
        With ``reference``, to be written by :func:`write_record` and followed by the controller.

    Raises
    ------
    EstimateError
        The log does not move.

    Examples
    --------
    >>> t = np.arange(2000) / 100
    >>> log = Record.of({"theta": 0.5 + 0.8 * np.sin(2 * t)}, fs=100)
    >>> motion = telling_motion(log)
    >>> bool(0.5 - 0.8 < motion["reference"].min() < motion["reference"].max() < 0.5 + 0.8)
    True
    """
    require_record(record)
    finite("fs", fs, unit="Hz")
    name = "theta" if "theta" in record else "x"
    record.require_clean(name, question="a motion that tells friction", samples=200)
    low, high = np.quantile(record[name], [0.005, 0.995])
    fastest = float(np.quantile(np.abs(differentiate(record[name], record.fs).values), 0.99))
    if not (high > low and fastest > 0):
        raise EstimateError("the joint never moves in this log", "its range and speed bound the motion", "move it once")
    size = WITHIN * float(high - low) / 2
    moved = np.concatenate(_parts(size, fastest, fs)) + float(low + high) / 2
    unit = record.channels[name].unit
    return Record.of({"reference": moved}, fs=fs, units={"reference": unit})


def _parts(size: float, fastest: float, fs: float) -> list[Array]:
    """Swings about zero, each from an extreme on, and strokes between rests, joined by strokes."""
    rate = SLOW * fastest / size
    slow = size * np.cos(rate * np.arange(0, CYCLES[0] * 2 * np.pi / rate, 1 / fs))
    rate = FAST * fastest / (THIRD * size)
    turned = rate * np.arange(0, CYCLES[1] * 2 * np.pi / rate, 1 / fs)
    fast = size * (0.6 * np.cos(turned) + 0.4 * np.cos(3 * turned))
    parts, place = [_stroke(0.0, size, fastest, fs), slow, fast, _stroke(size, 0.0, fastest, fs)], 0.0
    for number in range(RESTS):
        way = 1.0 if place <= 0 else -1.0
        crept = place + way * CREEP * fastest * CREEPS
        goal = way * size * (0.5 + 0.4 * number / RESTS)
        parts += [
            np.full(round(PAUSE * fs), place), np.linspace(place, crept, round(CREEPS * fs)),
            _stroke(crept, goal, fastest, fs),
        ]  # fmt: skip
        place = goal
    return parts


def _stroke(start: float, goal: float, fastest: float, fs: float) -> Array:
    """From one place to another with the least jerk (Flash and Hogan 1985)."""
    share = np.linspace(0, 1, max(2, round(1.875 * abs(goal - start) / (STROKE * fastest) * fs)))
    return np.asarray(start + (goal - start) * (10 * share**3 - 15 * share**4 + 6 * share**5))
