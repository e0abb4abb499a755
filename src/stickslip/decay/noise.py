r"""What the noise of a decay's record is, and the likelihood that goes with it.

* Quantised: the digitiser's step q is not small beside the noise. A count y says that the signal plus noise lay between
  y - q/2 and y + q/2: the likelihood of a sample is ``Phi(b) - Phi(a)``, a, b = (y -+ q/2 - x) / sigma, sigma unknown.
* Coloured: white noise and drift, of power ``S(f) = s^2 (1 + (f_c / f)^k)``, k = 1, 2 or 4. The cosine transform makes
  both nearly independent from one frequency to the next; s, f_c and k are those of restricted maximum likelihood.

Best fit and profile likelihood where the likelihood is more than a sum of squares: other noise, several releases.

An objective gives minus twice the log likelihood at some parameters, half its downhill slope, and half its curvature
(Gauss and Newton's part). The steps are those of :mod:`stickslip.decay.profile`, which does the same for the plain case
in compiled form.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.compiled import FAST, compiled
from stickslip.decay.profile import log_determinant, moved
from stickslip.decay.profile import solve as cholesky
from stickslip.decay.start import variance
from stickslip.decay.waveform import Blocks, normal_equations, sample_motion
from stickslip.errors import EstimateError

STEEPEST = 0.9  # damping ratio
FINEST = 0.02  # of the step: less noise than this is not told from it
LOOSE = 1.0  # what holds the logarithm of a noise that counts do not show
STEEPNESSES = (1, 2, 4)  # of the drift's power, a power of 1/f: flicker, a walk, a line
CORNERS = 30  # trial corners of the drift's spectrum
GAINED = 2.7  # minus twice the log likelihood that drift must gain before it is believed
COARSE = 0.7  # of the step: noise, the counts' own included, below which counts are not a sum of white noises
PRECISION = 1e-7  # of the range: a residual below it is rounding, and of no colour
SHORT = 24  # blocks in which drift is not told from the motion
SURE = 9.0  # standard deviations from which a count tells nothing
SLOW = 6  # cosines over the record, of half a cycle up, that a drift is sought by
SHARP = 0.05  # of the step: a noise no less than that, for a count near a step would weigh too much
WANDERS = 1e-3  # chance of a record of counts without drift to be told to drift
KINDS = ("white", "quantised", "coloured")
Objective = Callable[[Array], tuple[float, Array, Array]]

CLOSE = 1e-4  # what minus twice the log likelihood may still fall
STEPS = 60  # at most, of a fit or onto an end
LEAP = 10.0  # times what lies between best and level: a step that goes so far beyond it is halved
PATIENCE = 10  # steps after which an end should be near


@dataclass(frozen=True, eq=False)
class Noise:
    """The noise of one release.

    Attributes
    ----------
    kind : {"white", "quantised", "coloured"}
        Which likelihood.
    level : float
        Standard deviation of the white noise of a sample.
    words : str
        All of it, in words.
    objective : callable
        The likelihood for a number of half cycles.
    told_by : float
        How many cosines tell its drift, where it has one.
    """

    kind: str
    level: float
    words: str
    objective: Callable[[int], Objective]
    told_by: float = math.inf

    @property
    def extra(self) -> int:
        """Parameters beside the motion's six: the noise itself, where counts are fitted."""
        return int(self.kind == "quantised")


def find_noise(blocks: Blocks, fits: Array, samples: Array, step: float, kind: str | None = None) -> Noise:
    """What the noise of a release is, from its fits in white noise, or the likelihood of the kind that is asked for.

    Raises
    ------
    EstimateError
        Counts are asked for where no step is seen, or drift in a record too short to tell it.
    """
    if kind == "quantised" and not step > 0:
        raise EstimateError(
            "noise = 'quantised'", "no step of a digitiser is seen in the samples", "leave noise= out, or choose white"
        )
    row = fits[np.argmin(fits[:, 1])]
    least = variance(fits, blocks)
    level = math.sqrt(least * blocks.size)
    counts = blocks._replace(means=samples, size=1, total=len(samples))  # each sample a block
    left = _left(counts, int(row[0]), row[3:]) if step > 0 else math.inf
    coarse = kind is None and left < COARSE * step
    drifts = coarse and _wanders(counts, row, step, left)
    if kind == "quantised" or (coarse and not drifts):
        words = f"counts of {step:.3g}"
        return Noise("quantised", max(left, 0.3 * step), words, lambda n: quantised(counts, n, step))
    if kind == "coloured" and len(blocks.means) <= SHORT:
        raise EstimateError(
            f"noise = 'coloured' of {len(blocks.means)} blocks",
            f"drift is told from {SHORT + 1} on",
            "leave noise= out",
        )
    rounded = kind is None and level <= PRECISION * float(np.ptp(blocks.means))
    if kind != "white" and len(blocks.means) > SHORT and not rounded:
        _, _, power, gain = drift(blocks, int(row[0]), row[3:])
        if drifts or kind == "coloured" or gain > GAINED:
            smooth = _refined(blocks, int(row[0]), row[3:], power)
            corner, white, power, _ = drift(blocks, int(row[0]), smooth)
            label = f"white, and drift that outweighs it below {corner:.3g} Hz"
            level, slow = math.sqrt(white * blocks.size), float(np.sum(frequencies(blocks) < corner))
            return Noise("coloured", level, label, lambda n: coloured(blocks, n, power), slow)
    return Noise("white", level, "white", lambda n: white_noise(blocks, n, least))


def _left(counts: Blocks, n: int, p: Array) -> float:
    """Standard deviation of the samples from a motion; the blocks' would take a count's steady error for more."""
    values, jacobian = counts.motion(p, n)
    counts.leave_out_release(p, values, jacobian)
    return float(np.sqrt(np.mean((counts.means - values) ** 2)))


def _refined(blocks: Blocks, n: int, p: Array, power: Array) -> Array:
    """One step from least squares to the best fit in noise of this power."""
    _, slope, curvature = coloured(blocks, n, power)(p)
    return np.asarray(p + solve(curvature, slope))


def white_noise(blocks: Blocks, n: int, variance: float) -> Objective:
    """The likelihood in white noise whose blocks have this variance."""
    work = np.empty((3, 7, 6))

    def objective(p: Array) -> tuple[float, Array, Array]:
        slope, curvature = np.zeros(6), np.eye(6)
        if not (abs(p[1]) < STEEPEST and p[0] > 0):
            return math.inf, slope, curvature
        squares = normal_equations(p, n, blocks, curvature, slope, work)
        return float(squares) / variance, slope / variance, curvature / variance

    return objective


def quantised(counts: Blocks, n: int, step: float) -> Objective:
    """The likelihood of counts, of six parameters of the motion and the logarithm of the noise.

    Counts can not tell less noise than a small share of their step from none: that much is added to it.
    """
    samples = counts.means
    values, jacobian, work = np.empty(len(samples)), np.empty((6, len(samples))), np.empty((3, 7, 6))
    least = FINEST * step

    def objective(p: Array) -> tuple[float, Array, Array]:
        slope, curvature = np.empty(7), np.empty((7, 7))
        if not (abs(p[1]) < STEEPEST and p[0] > 0 and p[6] < 700):
            return math.inf, slope, curvature
        sample_motion(p[:6], n, counts, values, jacobian, work)
        counts.leave_out_release(p, values, jacobian)
        level = math.hypot(math.exp(p[6]), least)
        total = add_counts(values, jacobian, samples, step, level, slope, curvature)
        share, off = (math.exp(p[6]) / level) ** 2, p[6] - math.log(least)
        slope[6] *= share
        curvature[6] *= share
        curvature[:, 6] *= share
        slope[6] -= LOOSE * off
        curvature[6, 6] += LOOSE
        return float(total) + LOOSE * off**2, slope, curvature

    return objective


def _wanders(counts: Blocks, row: Array, step: float, left: float) -> bool:
    """Whether counts drift beside their likeliest motion, whichever number of half cycles near that of `row` it has.

    Counts know of no drift: of those that drifted half of the 95 % intervals missed, by up to 28 deviations.
    """
    start, n, span = np.r_[row[3:], math.log(max(left, 0.3 * step))], int(row[0]), abs(row[7])
    farthest = np.array([0.1 * row[3], 0.1, 0.3 * span, span, 0.5 * span, 0.5 / row[3], 1.0])
    # least squares of coarse counts may begin a half cycle or two away
    near = (number for number in (n, n - 1, n + 1, n - 2, n + 2) if number > 0)
    fits = ((number, minimise(quantised(counts, number, step), start, farthest)[0]) for number in near)
    return all(_score(counts, number, p, step) < WANDERS for number, p in fits)


def _score(counts: Blocks, n: int, p: Array, step: float) -> float:
    """p-value of the slow cosines' score beside that of the motion and the noise (Rao's test)."""
    from scipy.special import chdtrc

    values, jacobian = counts.motion(p[:6], n)
    counts.leave_out_release(p, values, jacobian)
    along = (np.arange(counts.total) + 0.5) / counts.total
    rows = np.vstack([np.cos(math.pi * np.outer(np.arange(1, SLOW + 1), along)), jacobian])
    slope, curvature = np.empty(len(rows) + 1), np.empty((len(rows) + 1, len(rows) + 1))
    add_counts(values, rows, counts.means, step, max(math.exp(p[6]), SHARP * step), slope, curvature)
    whole, alone = slope @ solve(curvature, slope), slope[SLOW:] @ solve(curvature[SLOW:, SLOW:], slope[SLOW:])
    return float(chdtrc(SLOW, max(0.0, whole - alone)))


def _transformed(blocks: Blocks, n: int, p: Array) -> tuple[Array, Array]:
    """Cosine transforms of the residual and the Jacobian."""
    from scipy.fft import dct

    whole = blocks.total // blocks.size
    values, jacobian = blocks.motion(p, n)
    blocks.leave_out_release(p, values, jacobian)
    residual = dct((blocks.means - values)[:whole], norm="ortho")
    return np.asarray(residual), np.asarray(dct(jacobian[:, :whole], norm="ortho"))


def frequencies(blocks: Blocks) -> Array:
    """Of the cosines [Hz]; the constant counts as half the lowest."""
    whole = blocks.total // blocks.size
    steps = np.arange(whole, dtype=float)
    steps[0] = 0.5
    return np.asarray(steps / (2 * whole * blocks.size * blocks.dt))


def coloured(blocks: Blocks, n: int, power: Array) -> Objective:
    """The likelihood in noise of this power at each cosine."""

    def objective(p: Array) -> tuple[float, Array, Array]:
        if not (abs(p[1]) < STEEPEST and p[0] > 0):
            return math.inf, np.zeros(6), np.eye(6)
        residual, jacobian = _transformed(blocks, n, p)
        weighted = jacobian / power
        return float(residual @ (residual / power)), weighted @ residual, weighted @ jacobian.T

    return objective


def drift(blocks: Blocks, n: int, p: Array) -> tuple[float, float, Array, float]:
    """Corner [Hz] of the drift, the white power, that at each cosine, and what the drift gains, by REML."""
    residual, jacobian = _transformed(blocks, n, p)
    tones, work = frequencies(blocks), np.empty((3, 6, 6))

    def judged(corner: float, steepness: int) -> tuple[float, float]:
        cost, squares = restricted(residual, jacobian, tones**steepness, corner**steepness, work)
        return float(cost), float(squares)

    corners = np.geomspace(0.1 * tones[1], 2 * tones[-1], CORNERS)
    costs = np.array([[judged(place, steepness)[0] for place in corners] for steepness in STEEPNESSES])
    row, best = np.unravel_index(np.argmin(costs), costs.shape)
    corner, steepness = float(corners[best]), STEEPNESSES[row]
    if 0 < best < CORNERS - 1:  # a parabola through three costs
        below, here, above = costs[row, best - 1 : best + 2]
        shift = 0.5 * (below - above) / (below - 2 * here + above)
        corner *= float((corners[1] / corners[0]) ** shift)
    cost, squares = judged(corner, steepness)
    return corner, squares, squares * (1 + (corner / tones) ** steepness), judged(0.0, steepness)[0] - cost


@compiled(**FAST)
def mills(a: float) -> float:
    """Probability beyond a >= 0 over the density there, of the normal law."""
    if a < 30.0:
        return 0.5 * math.erfc(a / math.sqrt(2.0)) * math.exp(0.5 * a * a) * math.sqrt(2.0 * math.pi)
    return (1.0 - 1.0 / (a * a)) / a


@compiled(**FAST)
def add_counts(
    values: Array, jacobian: Array, counts: Array, step: float, level: float, slope: Array, curvature: Array
) -> float:
    """Minus twice the log likelihood of counts; half its slope and curvature, the last for the noise's logarithm.

    log(Phi(b) - Phi(a)) is concave in (a, b), so the curvature is positive. `values` and `counts` are (n,), `jacobian`
    (k, n), `slope` (k + 1,), `curvature` (k + 1, k + 1); `step` and `level`, the noise, are in the counts' unit.
    """
    total, size = 0.0, jacobian.shape[0]
    for k in range(size + 1):
        slope[k] = 0.0
        for j in range(size + 1):
            curvature[k, j] = 0.0
    for i in range(values.shape[0]):
        a, b = (counts[i] - 0.5 * step - values[i]) / level, (counts[i] + 0.5 * step - values[i]) / level
        if a < -SURE and b > SURE:
            continue
        # Mirror: a + b >= 0, so that a is the nearer end, and the density there the larger one.
        side = 1.0
        if a + b < 0.0:
            a, b, side = -b, -a, -1.0
        # Probability over the density at a: by Mills's ratio in the tail, where both alone would underflow.
        fade = math.exp(-0.5 * (b - a) * (b + a))
        if a >= 0.0:
            share = mills(a) - fade * mills(b)
        else:
            density = math.exp(-0.5 * a * a) / math.sqrt(2.0 * math.pi)
            share = 0.5 * (math.erf(b / math.sqrt(2.0)) - math.erf(a / math.sqrt(2.0))) / max(density, 1e-300)
        # Densities at a and b over the probability: slopes of its logarithm; minus its second derivatives.
        low = 1.0 / share
        high = fade * low
        total += a * a + math.log(2.0 * math.pi) - 2.0 * math.log(share)
        aa, bb, ab = low * (low - a), high * (high + b), -low * high
        # a and b fall with the value and, in size, with the noise
        d_value = -side / level
        s_value, s_noise = (high - low) * d_value, -(high * b - low * a)
        c_value = (aa + 2.0 * ab + bb) / (level * level)
        c_mixed = -d_value * ((aa + ab) * a + (ab + bb) * b)
        c_noise = aa * a * a + 2.0 * ab * a * b + bb * b * b
        for k in range(size):
            slope[k] += s_value * jacobian[k, i]
            curvature[size, k] += c_mixed * jacobian[k, i]
            for j in range(k + 1):
                curvature[k, j] += c_value * jacobian[k, i] * jacobian[j, i]
        slope[size] += s_noise
        curvature[size, size] += c_noise
    for k in range(size + 1):
        for j in range(k):
            curvature[j, k] = curvature[k, j]
    return total


@compiled(**FAST)
def restricted(residual: Array, jacobian: Array, tones: Array, corner: float, work: Array) -> tuple[float, float]:
    """Minus twice the restricted log likelihood, but for a constant, of noise of power ``s^2 (1 + corner / f)``; s^2.

    Parameters
    ----------
    residual : ndarray (n,)
        Cosine transform of the residual.
    jacobian : ndarray (6, n)
        That of the motion's derivatives.
    tones : ndarray (n,)
        Frequencies [Hz], or a power of them.
    corner : float
        Frequency [Hz], or that power of it, below which the drift outweighs the white noise.
    work : ndarray (3, 6, 6)
        Scratch.
    """
    curvature, factor, slope, step = work[0], work[1], work[2, 0], work[2, 1]
    for j in range(6):
        slope[j] = 0.0
        for k in range(6):
            curvature[j, k] = 0.0
    squares, power = 0.0, 0.0
    # Weigh: at s = 1 the cosines are independent, of power 1 + corner / f.
    for i in range(residual.shape[0]):
        here = 1.0 + corner / tones[i]
        power += math.log(here)
        squares += residual[i] * residual[i] / here
        for j in range(6):
            weighted = jacobian[j, i] / here
            slope[j] += weighted * residual[i]
            for k in range(j + 1):
                curvature[j, k] += weighted * jacobian[k, i]
    for j in range(6):
        for k in range(j):
            curvature[k, j] = curvature[j, k]
    # Best fit: what Gauss and Newton's step leaves; s^2 is its share of n - 6 degrees of freedom.
    freedom = residual.shape[0] - 6
    if cholesky(curvature, slope, step, factor, 1e-13):
        for j in range(6):
            squares -= slope[j] * step[j]
    # the profile over s; log det J'J is what REML adds for the six parameters
    squares /= freedom
    return freedom * math.log(squares) + power + log_determinant(curvature, factor), squares


def solve(curvature: Array, right: Array, extra: float = 0.0) -> Array:
    """Solution of (curvature + extra diag(curvature)) x = right, its rows and columns brought to one scale first."""
    scale = 1 / np.sqrt(np.maximum(np.diag(curvature), 1e-300))
    scaled = curvature * np.outer(scale, scale) + (extra + 1e-13) * np.eye(len(scale))
    return np.asarray(scale * np.linalg.solve(scaled, scale * right))


def minimise(objective: Objective, start: Array, farthest: Array) -> tuple[Array, float, Array]:
    """Parameters, value and curvature at the minimum, from `start` in steps no longer than `farthest` each."""
    p, trial, extra = start.copy(), start.copy(), 0.0
    value, slope, curvature = objective(p)
    for _ in range(STEPS):
        step = solve(curvature, slope, extra)
        step *= min(1.0, float(np.min(farthest / np.maximum(np.abs(step), 1e-300))))
        fall = float(step @ slope)
        moved(p, step, 1.0, trial)
        now, next_slope, next_curvature = objective(trial)
        if now <= value:
            p = trial.copy()
            value, slope, curvature, extra = now, next_slope, next_curvature, 0.1 * extra if extra > 1e-3 else 0.0
            if fall < CLOSE:
                break
        else:
            extra = max(4 * extra, 1e-3)
            if fall < CLOSE or extra > 1e6:
                break
    return p, value, curvature


def extreme(objective: Objective, best: Array, value: float, which: int, side: int, level: float) -> Array | None:
    """Where a parameter is extreme (`side` +1, -1) among all that reach `level`; None if that is not found."""
    p, last = best.copy(), best
    aim = np.zeros(len(p))
    aim[which] = 1.0
    for count in range(STEPS):
        now, slope, curvature = objective(p)
        if not now - level <= LEAP * (level - value):
            p = (p + last) / 2
            continue
        last = p.copy()
        with np.errstate(over="ignore"):
            step, across = solve(curvature, slope), solve(curvature, aim)
        if not np.all(np.isfinite(across)):  # nothing tells the parameter
            return None
        room = max(level - now + float(step @ slope), 0.0)
        whole = np.sqrt((level - value) * across[which])
        step = step + side * np.sqrt(room / across[which]) * across
        move = abs(step[which])
        shorter = 1.0 / (1 + count // 6)  # lest it jump about
        moved(p, step, min(shorter, 2 * whole / max(move, 1e-300)), p)
        if not np.all(np.isfinite(p)) or (count >= PATIENCE and now - level > level - value):
            return None
        if move < 5e-3 * whole and abs(now - level) < 0.05 * (level - value):
            return np.asarray(p)
    return None
