"""Counting along an event log: what the pieces of a motion add up to. Compiled, for whole logs and piece by piece."""

from __future__ import annotations

from stickslip.compiled import OPTIONS, compiled

# What is counted, and what is remembered from piece to piece.
NORMAL, ABNORMAL, HELD, SHORT, FASTEST, REACH, WORK, SIDE, STOPPED, LONGEST, UNDERWAY, MICRO = range(12)
ENTRIES = 12
PART = 0.1  # of the longest slip: a shorter one is a micro-slip
SLIP, STICK, MICROSTICK = 0, 1, 2  # kinds of a mode


@compiled(**OPTIONS)
def note(kind, side, begin, length, path, speed, sums):
    """Add one piece: its kind and side, when it begins [s] after the measured time does, how long it lasts, how far
    the contact slips in it [m], and how fast at its start [m/s]."""
    counted = begin >= 0.0
    if kind == SLIP:
        if sums[STOPPED] > 0.0:
            if counted and sums[SIDE] != 0.0:
                sums[NORMAL if sums[SIDE] * side < 0.0 else ABNORMAL] += 1.0
            if counted and sums[MICRO] > 0.0:
                sums[FASTEST] = max(sums[FASTEST], speed)
        elif sums[SIDE] * side < 0.0:
            _end_slip(counted, sums)
        sums[SIDE], sums[STOPPED], sums[MICRO] = side, 0.0, 0.0
        sums[UNDERWAY] += path
        return
    if sums[STOPPED] == 0.0:
        _end_slip(counted, sums)
    sums[STOPPED], sums[MICRO] = 1.0, 1.0 if kind == MICROSTICK else 0.0
    sums[HELD] += max(0.0, length + min(begin, 0.0))


@compiled(**OPTIONS)
def _end_slip(counted, sums):
    if sums[UNDERWAY] > 0.0:
        if counted and sums[UNDERWAY] < PART * sums[LONGEST]:
            sums[SHORT] += 1.0
        sums[LONGEST] = max(sums[LONGEST], sums[UNDERWAY])
    sums[UNDERWAY] = 0.0


@compiled(**OPTIONS)
def tally(kinds, sides, modes, begins, lengths, paths, speeds, sums):
    """Add a whole log; `kinds` and `sides` are by mode."""
    for j in range(modes.shape[0]):
        m = modes[j]
        note(kinds[m], sides[m], begins[j], lengths[j], paths[j], speeds[j], sums)
