"""Motions that never repeat: their exponent tells chaos from what is quasi-periodic, and that has its frequencies.

A drive of several tones without a common period forces a motion with all of their frequencies; a torus beside one tone
has one of its own. Lines of a spectrum tell them, by a window of Blackman and Harris (Harris, Proc. IEEE 66, 1978).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from stickslip.solve.exponents import growth
from stickslip.solve.orbit import SteadyState
from stickslip.solve.poincare import Table, beat, beats, carried_on, derivative, extent
from stickslip.solve.simulate import opening
from stickslip.solve.tables import Array, System
from stickslip.solve.tape import Tape
from stickslip.solve.trajectory import Trajectory

COUNTED, COUNTED_CURVED = 500, 125  # beats over which neighbours are followed; of a curved law each takes five runs
PARTED = 20.0  # e-foldings by which neighbours part, or come together, before that is more than a torus's drift
LOOKED, POINTS = 256, 64  # beats of a spectrum, and points in the period of the fastest tone
FAINT, NEAR = 1e-4, 2.0  # of the largest line; bins, within which two lines are one
MOST = 32  # lines kept
STILL = 1e-9  # of its displacement: what moves by no more has no lines
LASTING = 0.02  # of a bin, and of its size, by which a torus's line may differ from one look to the next
RETURN = 1e-9  # of the motion's size: a return this close, from beat to beat, is one


def aperiodic(system: System, table: Table, state: Array, mode: int) -> SteadyState:
    """What a motion does that was not found to repeat: "chaotic", "quasi-periodic", or "not periodic" where neither is
    seen: its neighbours come together, and it only repeats later than was looked."""
    orbit = beats(system, table, state, mode, 1)
    none = np.full(table.physical, np.nan, dtype=np.complex128)
    found = SteadyState("not periodic", math.nan, 0, orbit, none)
    count = COUNTED_CURVED if isinstance(table, Tape) else COUNTED
    exponent = growth(system, table, state, mode, cycles=count)
    parted = exponent.value * count * beat(table)
    if parted > PARTED and exponent.interval[0] > 0:
        return replace(found, status="chaotic", exponent=exponent)
    known = tuple(omega / (2 * math.pi) for _, _, omega, _ in table.motion.tones)
    tonal = not math.isfinite(table.motion.period) and len(known) > 1
    if parted < -PARTED and not tonal:
        return replace(found, exponent=exponent)
    lines, again = [], (state, mode)
    for _ in range(1 if tonal else 2):
        motion = beats(system, table, *again, LOOKED)
        again = carried_on(motion)
        lines.append(spectrum(motion, max(known)))
    basic = known if tonal else (*known, *_own(lines, known[0], 1 / motion.duration))
    status = "quasi-periodic" if len(basic) > 1 else "not periodic"
    return replace(found, status=status, exponent=exponent, lines=lines[-1], frequencies=basic)


def tonal(system: System, table: Table, start: Mapping[str, float | str], counts: tuple[int, int]) -> SteadyState:
    """What tones without a period of their own leave: beside a belt, or beside each other.

    `counts` are the beats of the transient, and those after which nothing is expected to repeat any more.
    """
    (transient, patience), (state, mode) = counts, opening(table, start)
    laps, count = 0, transient
    while laps < patience:
        motion = beats(system, table, state, mode, count)
        before = state, mode
        state, mode = carried_on(motion)
        laps += count
        if len(motion.modes) == 1 and table.modes[motion.modes[0]].friction is None:
            none = np.full(table.physical, np.nan, dtype=np.complex128)
            return SteadyState("rest", math.nan, 0, motion, none)
        orbit = _returned(system, table, before, motion, count) if len(table.motion.tones) == 1 else None
        if orbit is not None:
            return orbit
        if len(table.motion.tones) > 1 and laps >= 4 * transient:
            break  # these never repeat: what is forgotten by now is forgotten
        count = laps
    return aperiodic(system, table, state, mode)


def _returned(
    system: System, table: Table, before: tuple[Array, int], motion: Trajectory, count: int
) -> SteadyState | None:
    """The orbit that ends a motion of so many beats, where it is now what it was some beats ago."""
    times = np.arange(count + 1) * beat(table)
    points = motion.sample(np.minimum(times, motion.duration), ("state",))[0][: table.physical]
    size = extent(motion)
    gaps = np.max(np.abs(points - points[:, -1:]) / np.where(size > 0, size, 1.0)[:, None], axis=0)
    alike = np.flatnonzero(gaps[:-1] <= RETURN)
    if not len(alike):
        return None
    order = count - int(alike[-1])
    if count - order:
        before = carried_on(beats(system, table, *before, count - order))
    orbit = beats(system, table, *before, order)
    state, mode = carried_on(orbit)
    gap = np.abs(state - before[0])[: table.physical] / np.where(size > 0, size, 1.0)
    if np.max(gap) > RETURN or mode != before[1]:
        return None
    multipliers = np.linalg.eigvals(derivative(orbit, mode)[0]).astype(np.complex128)
    multipliers = multipliers[np.argsort(-np.abs(multipliers))]
    return SteadyState("unique" if abs(multipliers[0]) < 1 else "unstable", orbit.duration, order, orbit, multipliers)


def spectrum(motion: Trajectory, fastest: float) -> Array:
    """Lines of the displacement, strongest first: frequency [Hz] and amplitude [m]; `fastest` is the fastest tone."""
    from scipy.signal.windows import blackmanharris

    count = min(int(POINTS * fastest * motion.duration), 2**18)
    x = motion.sample(np.arange(count) * (motion.duration / count), ("x",))[0][0]
    if np.ptp(x) <= STILL * np.max(np.abs(x)):
        return np.empty((0, 2))
    window = blackmanharris(count, sym=False)
    size = 2 * np.abs(np.fft.rfft((x - np.mean(x)) * window)) / np.sum(window)
    inner = np.arange(2, len(size) - 1)
    peaks = inner[(size[inner] > size[inner - 1]) & (size[inner] >= size[inner + 1])]
    peaks = peaks[size[peaks] > FAINT * np.max(size[peaks], initial=0.0)]
    peaks = peaks[np.argsort(-size[peaks])][:MOST]
    # the window's own top is a parabola of the logarithm to a thousandth of a bin
    low, top, high = (np.log(size[peaks + j]) for j in (-1, 0, 1))
    off = 0.5 * (low - high) / (low - 2 * top + high)
    return np.column_stack([(peaks + off) / motion.duration, np.exp(top - 0.25 * (low - high) * off)])


def _own(lines: list[Array], tone: float, bin_: float) -> tuple[float, ...]:
    """Frequency of the strongest line that is no multiple of a tone, where it lasts: a beginning fades or grows."""
    strongest = []
    for part in lines:
        beside = np.abs(part[:, 0] - tone * np.round(part[:, 0] / tone)) > NEAR * bin_
        strongest.append(part[np.argmax(beside)] if np.any(beside) else np.full(2, np.nan))
    (before, was), (after, now) = strongest
    return (float(after),) if abs(after - before) < LASTING * bin_ and abs(now - was) < LASTING * was else ()
