"""Where a channel's samples can not be what the sensor met: rows, found from the samples alone.

Each finder takes finite samples, shape (n,), and gives runs of rows, first and last included. They are made for
records of friction, where a stuck mass rests on plateaus, a friction force is a square wave, a sensor has steps and a
decay ends at rest: none of these is a fault.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from stickslip.arrays import Array, Mask, stretches

Runs = tuple[tuple[int, int], ...]

EXACT = 1e-9  # relative to the range: equal but for the rounding of a unit's factor
MANY = 20_000  # samples that show a level of noise, or a grid
CUBIC = np.array([1, -4, 6, -4, 1]) / 6  # a sample minus the cubic through its four neighbours
CUBIC_GAIN = float(np.sqrt(np.sum(CUBIC**2)))
MOVED = 3e-5  # of the range: noise that is smaller may leave equal samples equal
ENOUGH = 400  # plateaus looked at: more of them make a verdict no surer
SHORTEST_TREND = 64  # samples from which a slow trend can be told from the motion
TRAVEL = 12.0  # rise in amplitudes from which a trend is travel: eight steps of a pulled block rise by 19
BRIDGED = 16  # rows that may be filled however fast the signal: half the order of the autoregression that does it
FEW_LEVELS = 12  # steps of a sensor across the whole motion below which its shape is lost


def runs_of(mask: Mask) -> Runs:
    """First and last row of each stretch where `mask` holds.

    Examples
    --------
    >>> runs_of(np.array([True, False, True, True]))
    ((0, 0), (2, 3))
    """
    return tuple((int(first), int(end) - 1) for first, end in zip(*stretches(mask), strict=True))


def rows_of(runs: Runs, n: int) -> Mask:
    """The mask of `n` rows that `runs` cover."""
    mask = np.zeros(n, dtype=bool)
    for first, last in runs:
        mask[first : last + 1] = True
    return mask


def held_over(values: Array, lost: Mask) -> Array:
    """The values with the last one before held over lost ones: one interpolated would leave the sensor's levels."""
    last = np.maximum.accumulate(np.where(lost, 0, np.arange(len(values))))
    filled: Array = np.where(lost[last], values[~lost][0], values[last])
    return filled


def constant(values: Array) -> bool:
    """Whether a sensor reads one value throughout, where it reads at all."""
    there = values[np.isfinite(values)]
    return len(there) > 0 and bool(np.ptp(there) <= 1e-12 * np.max(np.abs(there)))


def quantum(values: Array) -> float:
    """Step between the sensor's levels, or 0 where the samples lie on no common grid."""
    few = values[:: 1 + len(values) // MANY]
    levels = np.unique(few)
    step = _grid(levels)
    # samples off any grid in part are so in all; a grid seen in part must hold in all, or be looked for there
    if len(few) == len(values) or (step == 0 and len(levels) >= 3):
        return step
    if step > 0:
        multiples = (values - values[0]) / step
        if float(np.max(np.abs(multiples - np.round(multiples)))) < 0.02:
            return step
    return _grid(np.unique(values))


def _grid(levels: Array) -> float:
    if len(levels) < 3:
        return 0.0
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-12 * np.max(np.abs(levels[[0, -1]]))]
    if not len(gaps):
        return 0.0
    step = float(np.median(gaps[gaps < 1.5 * np.min(gaps)]))
    multiples = gaps / step
    return step if float(np.max(np.abs(multiples - np.round(multiples)))) < 0.02 else 0.0


def roughness(values: Array) -> float:
    """Standard deviation of the broadband noise, from what a cubic through four neighbours does not explain."""
    if len(values) < 8:
        return 0.0
    rest = np.convolve(values, CUBIC, "valid")
    return float(1.4826 * np.median(np.abs(rest[:: 1 + len(rest) // MANY])) / CUBIC_GAIN)


def spikes(values: Array) -> Runs:
    """Single samples, or pairs, that stand off from both neighbours as nothing around them does.

    A sample is a spike where it differs from the line between its neighbours by 2.5 times the second largest step
    nearby, by eight robust standard deviations and by three times what one sample in twenty does, while the neighbours
    agree with each other. Where more than one sample in sixty stands off (each disturbs three such differences), they
    count as what the channel does, and none is found: such a channel has no spikes but a fault of its cable.
    """
    flags = np.zeros(len(values), dtype=bool)
    for width in (1, 2):
        flags |= _spikes(values, width)
    return runs_of(flags)


def _spikes(values: Array, width: int, reach: int = 10) -> Mask:
    n = len(values)
    mask = np.zeros(n, dtype=bool)
    if n < 2 * reach + width + 2:
        return mask
    before, after = values[: n - width - 1], values[width + 1 :]
    inner = np.stack([values[1 + k : n - width + k] for k in range(width)])
    weight = (np.arange(1, width + 1) / (width + 1))[:, None]
    offsets = inner - (before + weight * (after - before))
    height = np.min(np.abs(offsets), axis=0) * (np.ptp(np.sign(offsets), axis=0) == 0)
    scale = 1.4826 * float(np.median(np.abs(offsets[0] - np.median(offsets[0]))))
    common = 3 * float(np.quantile(np.abs(offsets[0]), 0.95))  # a sensor's steps, also where a repair blurred them
    threshold = max(8 * scale, common, 1.5 * quantum(values), EXACT * float(np.ptp(values)))
    steps = np.abs(np.diff(values))
    for i in np.flatnonzero((height > threshold) & (height > 3 * np.abs(after - before))):
        near = np.concatenate([steps[max(0, i - reach) : i], steps[i + width + 1 : i + width + 1 + reach]])
        # the second largest step: one edge of a square wave nearby hides no spike
        if len(near) >= reach and height[i] > 2.5 * np.partition(near, -2)[-2]:
            mask[i + 1 : i + 1 + width] = True
    return mask


def frozen(values: Array, shortest: int = 5) -> Runs:
    """Runs of one repeated value inside a signal that moves on behind it.

    Two signs, of which one is enough: the run ends with a jump that makes up for the motion missed; or the signal is
    rough on both sides, its samples seldom repeating, and still inside for longer than chance allows. A stuck mass
    shows neither: it comes to rest and leaves without a jump, and its noise goes on. Nor is a level frozen to which
    the signal returns, as Coulomb's friction does, with either sign.
    """
    span = float(np.ptp(values))
    still = np.abs(np.diff(values)) <= EXACT * span
    candidates = [(first, last + 1) for first, last in runs_of(still) if last + 2 - first >= shortest]
    if not candidates:
        return ()
    step = quantum(values)
    runs = [run for run in candidates if _is_frozen(values, still, run, step, span)]
    levels = np.array([abs(values[first]) for first, _ in candidates])
    lengths = np.array([last - first + 1 for first, last in candidates])
    near = max(0.5 * step, EXACT * span)

    def recurs(run: tuple[int, int]) -> bool:
        alike = (np.abs(levels - abs(values[run[0]])) <= near) & (lengths >= 0.5 * (run[1] - run[0] + 1))
        return int(np.sum(alike)) > 1

    return tuple(run for run in runs if not recurs(run))


def _is_frozen(values: Array, still: Mask, run: tuple[int, int], step: float, span: float) -> bool:
    first, last = run
    length = last - first + 1
    repeats = np.concatenate([still[max(0, first - 40) : first], still[last + 1 : last + 41]])
    chance = len(values) * float((np.sum(repeats) + 1) / (len(repeats) + 2)) ** (length - 1)
    if chance > 1e-3:  # as of most runs where a sensor's counts are coarse
        return False
    reach = max(8, min(length, 40))
    before, after = (np.abs(np.diff(side)) for side in (values[:first][-reach - 1 :], values[last + 1 :][: reach + 1]))
    if len(before) < 8 or len(after) < 8:
        return False
    nearest = max(float(np.max(before)), float(np.max(after)))
    jump = float(abs(values[last + 1] - values[last]))
    moving = min(float(np.mean(before)), float(np.mean(after))) > EXACT * span
    moving &= abs(float(values[first])) > EXACT * span  # the acceleration of a stuck mass is zero, until it is not
    made_up = 0.4 * length * float(np.median(after[:5]))
    if moving and jump > 5 * step and (jump > 3 * nearest or (jump > made_up and jump > 2.5 * float(np.max(after)))):
        return True
    sides = [values[max(0, first - 40) : first], values[last + 1 : last + 41]]
    turns = min(_turns(side) for side in sides)
    return turns > 0.35 and float(np.mean(repeats)) < 0.3 and chance < 1e-6


def _turns(values: Array) -> float:
    """Share of the steps that reverse the one before."""
    steps = np.diff(values)
    steps = steps[steps != 0]
    return float(np.mean(steps[1:] * steps[:-1] < 0)) if len(steps) > 4 else 0.0


def clipped(values: Array, *, plateaus: bool = False, step: float | None = None) -> Runs:
    """Runs at an extreme level that the signal would have passed had the instrument let it.

    A cut top is entered and left with a slope, so that parabolas through the samples before and after it rise above
    it; a stuck mass arrives at its plateau with the slope gone, and the parabola only just reaches it. In a signal
    that is mostly noise, a cut top is a level held more often than the next one. A level held to the last digit, where
    the sensor's noise moves all its other samples, was cut whatever its shape.

    Parameters
    ----------
    values : ndarray, shape (n,)
    plateaus : bool
        Whether the channel may have plateaus with sharp corners by nature (a force that saturates, a velocity
        that sticks): then both parabolas must also have the same top, in the middle of the run.
    step : float, optional
        Step between the sensor's levels where it is known already, 0 for none.
    """
    span = float(np.ptp(values))
    if len(values) < 16 or span == 0:
        return ()
    noise, step = roughness(values), quantum(values) if step is None else step
    if plateaus and (exact := saturated(values)).any():
        return runs_of(exact)
    top, bottom = (_clipped_top(side, noise, step, plateaus) for side in (values, -values))
    # an instrument that cuts one end off cuts the other too: there, less evidence is enough
    if top.any() != bottom.any():
        end = -values if top.any() else values
        return runs_of(top | bottom | _clipped_top(end, noise, step, plateaus, strictness=0.4))
    return runs_of(top | bottom)


def saturated(values: Array, shortest: int = 5) -> Mask:
    """Samples at an extreme that is held to the last digit, though noise moves the sensor's other samples.

    So a limit shows even in a force that has plateaus by nature, which are as noisy as the rest. Noise within a step
    between the sensor's levels moves nothing: there the turns of a motion are held to the last digit too.
    """
    mask = np.zeros(len(values), dtype=bool)
    span = float(np.ptp(values)) if len(values) else 0.0
    for end in (np.max(values), np.min(values)) if span > 0 else ():
        at = np.abs(values - end) <= EXACT * span
        if any(last - first + 1 >= shortest for first, last in runs_of(at)):
            mask |= at
    rest = values[~mask]
    if not mask.any() or len(rest) <= shortest or roughness(rest) <= max(MOVED * span, quantum(values)):
        return np.zeros_like(mask)
    return mask


def _clipped_top(values: Array, noise: float, step: float, plateaus: bool, strictness: float = 1.0) -> Mask:
    top, span = float(np.max(values)), float(np.ptp(values))
    exact = values >= top - EXACT * span
    count = int(np.sum(exact))
    if count >= 3 and _piled_up(values, count, noise):
        return exact
    if count >= 3 and max(last - first for first, last in runs_of(exact)) >= 2:
        level, mask, slack = top, exact, max(step, EXACT * span)
    else:
        spread = float(np.hypot(noise, step / np.sqrt(12)))
        level = float(np.median(values[values >= top - 6 * spread]))
        high = np.pad(values > level - 3 * spread, 2, mode="edge").astype(np.int8)
        calm = high[:-4] + high[1:-3] + high[2:-2] + high[3:-1] + high[4:] > 2  # the median of five
        # here the noise goes on at the top, as it does on a plateau: only twin parabolas tell
        mask, slack, plateaus = calm, 3 * spread, True
    plateau_runs = [run for run in runs_of(mask) if run[1] - run[0] >= 2]
    cut = _were_cut(values, plateau_runs, level, slack, plateaus, strictness)
    return mask if cut else np.zeros(len(values), dtype=bool)


def _piled_up(values: Array, count: int, noise: float) -> bool:
    """Whether noise stops at the top level: no two of its samples should be equal, or fewer than on the next level."""
    span = float(np.ptp(values))
    between = values[(values < np.max(values) - EXACT * span) & (values > np.min(values) + EXACT * span)]
    if len(between) < 0.2 * len(values):
        return False
    step = quantum(between)
    if step == 0:
        return len(np.unique(between)) > 0.98 * len(between) and _turns(np.diff(values)) > 0.4
    below = int(np.sum(between > np.max(between) - 0.5 * step))
    above = float(np.max(values) - np.max(between)) / step
    off_grid = abs(above - round(above)) > 0.1  # no level of the sensor, but where it was cut
    return noise > 0.02 * span and (off_grid or count > 1.5 * below + 4 * np.sqrt(below + 1.0))


def _were_cut(
    values: Array, runs: list[tuple[int, int]], level: float, slack: float, plateaus: bool, strictness: float
) -> bool:
    """Whether plateaus, taken together, cut off tops; no, where their approach is not resolved."""
    floor, sides = level - 0.5 * float(np.ptp(values)), []
    for first, last in runs[:: 1 + len(runs) // ENOUGH]:
        length = last - first + 1
        reach = max(4, length)
        before, after = values[max(0, first - reach) : first][::-1], values[last + 1 :][:reach]
        both = [_extrapolate(side, level, floor, length) for side in (before, after)]
        sides += [side for side in both if side is not None] if None not in both else []
    if not sides:
        return False
    heights, errors, drops, tops = np.array(sides).T
    pairs = heights.reshape(-1, 2)
    height = float(np.median(pairs.min(axis=1)))  # a stuck mass arrives with its slope gone, and may leave with one
    error = 1.2533 * float(np.sqrt(np.mean(errors**2) / len(heights)))
    cut = height > strictness * max(2 * slack, 5 * error, 0.08 * float(np.median(drops)))
    if cut and plateaus:
        alike = float(np.mean(pairs.max(axis=1) < 2 * pairs.min(axis=1)))
        cut = alike > 0.5 and float(np.mean((tops > 0.2) & (tops < 0.8))) > 0.5
    return bool(cut)


def _extrapolate(near: Array, level: float, floor: float, length: int) -> tuple[float, float, float, float] | None:
    """How far the parabola through the samples next to a plateau, nearest first, rises above it.

    Samples count up to the first below `floor`, and no more of them than a parabola can follow: where what it leaves
    is no noise but a curve, half of them are used. Gives height above the level and its standard error, drop of the
    level over the samples used, and distance of the parabola's top from the plateau's edge in lengths of the plateau
    (infinite where it has none).
    """
    low = np.flatnonzero(near < floor)
    near = near[: low[0]] if len(low) else near
    if len(near) < 3:
        return None
    scale = float(max(len(near), length))
    design, inverse = _parabola_before(len(near), scale)
    bend, slope, value = inverse @ (near - level)
    rest = near - level - design @ np.array([bend, slope, value])
    sd, drop = float(np.sqrt(rest @ rest / max(1, len(near) - 3))), float(level - near.min())
    if len(near) >= 12 and sd > 0.01 * drop and float(np.std(np.diff(rest))) < 0.5 * sd:
        return _extrapolate(near[: len(near) // 2], level, floor, length)
    middle = 0.5 * length / scale
    top = -slope / (2 * bend) if bend < 0 else np.inf
    reach = np.clip(top, 0.0, middle)
    point = np.array([reach**2, reach, 1.0])
    error = sd * float(np.linalg.norm(point @ inverse))
    return float(point @ (bend, slope, value)), error, drop, float(top * scale / length)


@lru_cache(maxsize=256)
def _parabola_before(rows: int, scale: float) -> tuple[Array, Array]:
    """Powers 2, 1, 0 of the way from an edge back over so many rows, in units of `scale`, and their inverse."""
    along = (-1.0 - np.arange(rows, dtype=np.float64)) / scale
    design = np.stack([along**2, along, np.ones(rows)], axis=1)
    return design, np.asarray(np.linalg.pinv(design))


def drift(values: Array) -> float:
    """Rise of the slow trend over the record, in amplitudes of the oscillation that it carries; 0 where none is.

    Only a channel that oscillates at least eight times can drift: a ramp or a creeping decay is motion. The trend is
    the mean over one period of the strongest oscillation, and counts where a parabola explains nine tenths of it.
    """
    period = _period(values)
    if period is None or len(values) < 8 * period:
        return 0.0
    rows, slow = _trend(values, period)
    along = _parabola(slow)
    explained = float(np.var(slow - along)) < 0.1 * float(np.var(slow))
    amplitude = np.sqrt(2) * float(np.std(values[np.round(rows).astype(int)] - slow))
    rise = float(np.ptp(along)) / amplitude if amplitude > 0 and explained else 0.0
    return rise if rise < TRAVEL else 0.0


def trend(values: Array) -> tuple[Array, Array]:
    """Rows (fractions allowed) and the mean around each over one period, taken twice, of the strongest oscillation."""
    return _trend(values, _period(values))


def _trend(values: Array, period: int | None) -> tuple[Array, Array]:
    period = min(period or max(1, len(values) // 50), len(values) // 4)
    slow = _running_mean(_running_mean(values, period), period)
    rows: Array = np.arange(len(slow), dtype=np.float64) + (period - 1)
    return rows, slow


def _parabola(values: Array) -> Array:
    """The parabola that fits equally spaced values best, from its three moments."""
    along = np.linspace(-1, 1, len(values))
    powers = [np.ones_like(along), along, along * along]
    moments = np.array([[one @ other for other in powers] for one in powers])
    value, slope, bend = np.linalg.solve(moments, [one @ values for one in powers])
    return np.asarray(value + along * (slope + bend * along))


def _period(values: Array) -> int | None:
    """Period in rows of the strongest oscillation about a parabola, or None where nothing oscillates."""
    if len(values) < SHORTEST_TREND or np.ptp(values) == 0:
        return None
    rest = values - _parabola(values)
    power = np.abs(np.fft.rfft(rest * np.hanning(len(rest)))) ** 2
    peak = int(np.argmax(power[4:])) + 4
    if np.sum(power[peak - 2 : peak + 3]) < 0.2 * np.sum(power):
        return None
    return max(2, round(len(values) / peak))


def bridgeable(values: Array) -> int:
    """Rows missing in a row that their surroundings still tell: a quarter of the strongest oscillation's period.

    Sixteen rows where that is shorter, or nothing oscillates.
    """
    lost = ~np.isfinite(values)
    if lost.all():
        return 0
    rows = np.arange(len(values))
    period = _period(np.interp(rows, rows[~lost], values[~lost]))
    return max(BRIDGED, (period or 0) // 4)


def missing(values: Array, longest: int | None = None) -> tuple[Runs, Runs, Runs]:
    """Runs of values that are not numbers: those that can be filled, longer ones, and those at an end of the record.

    Parameters
    ----------
    values : ndarray, shape (n,)
    longest : int, optional
        Rows of the longest run that can be filled; :func:`bridgeable` where left out.

    Examples
    --------
    >>> wave = np.sin(0.01 * np.arange(4000))
    >>> wave[100:110] = wave[500:1500] = wave[3990:] = np.nan
    >>> missing(wave)
    (((100, 109),), ((500, 1499),), ((3990, 3999),))
    """
    runs = runs_of(~np.isfinite(values))
    limit = (bridgeable(values) if longest is None else longest) if runs else 0
    inner = tuple(run for run in runs if run[0] > 0 and run[1] < len(values) - 1)
    short = tuple(run for run in inner if run[1] - run[0] < limit)
    return short, tuple(run for run in inner if run not in short), tuple(run for run in runs if run not in inner)


def _running_mean(values: Array, length: int) -> Array:
    total = np.cumsum(np.concatenate([[0.0], values]))
    mean: Array = (total[length:] - total[:-length]) / length
    return mean


def levels_used(values: Array) -> int | None:
    """Steps of the sensor across the whole motion, where they are too few to show its shape; else None."""
    step = quantum(values)
    levels = len(np.unique(values)) if 0 < float(np.ptp(values)) < 2 * FEW_LEVELS * step else 0
    if levels < 4 or len(values) < 8 * levels:
        return None
    steps = round(float(np.ptp(values)) / step)
    return steps if steps < FEW_LEVELS else None
