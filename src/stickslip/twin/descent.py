"""The rig nearest to a record, of one law, by Levenberg's and Marquardt's descent; and those that its fit leaves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import EstimateError, StickslipError
from stickslip.statistics import correlation_time
from stickslip.twin.belief import BENT, EXCESS, HELD, NUDGE, POWER, SPEED, Belief, Fit, levelled

QUESTION = "the twin of a record"
# Of the descent: in a narrow valley; elsewhere the first two do nearly all of it. At most so many times as many of a
# law that explains x, as long as one gains more of chi-squared than tells a law from another by chance in a hundred:
# 20 alone ended 74 above the floor where a damping was let go of, the mass 64 standard deviations off (seed 311101 of
# benchmarks/twins.py). A law that does not explain x goes on straining its constants, and away from what is true.
PASSES, LONGER, TELLING = 20, 5, 6.6
FAR = 2.0  # times what a law leaves, or noise, beyond which another is of the wrong kind
# Of a step, over the noise, tried in turn. Newton's step halved leads out of a bent valley: of a damped contact's
# stiffness, damping and deflection it ended 79 of chi-squared above the floor, 5 % too stiff and sure of it.
DAMPINGS = tuple(10.0**power for power in range(8))
LEARNS = 0.5  # of what was left, that a step leaves at most where its slopes are learned from it and not taken anew
# Chi-squared below which a pass gains nothing. As a share of what is left, 1e-4 stopped in the valley of a damped
# contact's stiffness, 13 above its floor; 1e-3, in bristles' (seed 911).
SETTLED = 0.1
BENDS = 1.0  # chosen: of the logarithm of a curve's speed or exponent, beyond which no value is a line in them
LITTLE = 0.01  # of a standard deviation: a step so small that a value is linear in it


def misfit(belief: Belief) -> float:
    """What the simulated displacement leaves of the measured one, and constants that are off [m^2].

    Infinite where the rig can not be followed.
    """
    try:
        residual = belief.residual
    except StickslipError:
        return math.inf
    off = sum(((belief.values[name] - middle) / sd) ** 2 for name, (middle, sd) in belief.priors.items())
    with np.errstate(over="ignore"):  # a step that leads far away
        return float(residual @ residual) + belief.noise**2 * off


def refined(belief: Belief, passes: int = PASSES) -> Belief:
    """The belief whose displacement is nearest to the record's, where that is near; else as it was begun."""
    belief, fresh = descended(belief, passes)
    return belief if fresh else linearised(belief)


def descended(belief: Belief, passes: int, *, roughly: bool = False) -> tuple[Belief, bool]:
    """The nearest after so many passes, and whether its slopes were taken just there; roughly, noise is an end."""
    belief, fresh, taken = linearised(belief), True, 1
    while not (roughly and belief.like_noise):
        before, moved = misfit(belief), _downhill(belief)
        if moved is not None and misfit(moved) < LEARNS * before:
            belief, fresh = _updated_by_broyden(belief, moved), False
            continue
        gained = 0.0 if moved is None else _chi_squared_gained(belief, moved)
        ended, longer = fresh and gained < SETTLED, gained > TELLING and explains(belief) and not roughly
        if moved is not None:
            belief, fresh = moved, False
        if ended or taken >= passes * (LONGER if longer else 1):
            break
        belief, fresh, taken = linearised(belief), True, taken + 1
    return belief, fresh


def explains(belief: Belief) -> bool:
    """Whether it leaves hardly more of the displacement than noise would."""
    return math.isfinite(misfit(belief)) and belief.over_noise**2 < FAR


def _chi_squared_gained(before: Belief, after: Belief) -> float:
    """By how much less chi-squared is, of as many independent samples as a belief has that was linearised."""
    assert before.fit is not None
    return before.fit.freedom * math.log(misfit(before) / misfit(after))


def _downhill(belief: Belief) -> Belief | None:
    """Nearer to the record by its own slopes; None where no step leads nearer, however damped."""
    fit = belief.fit
    assert fit is not None
    before = misfit(belief)
    moved = (belief.by(fit.names, _damped_step(belief, fit, damping)) for damping in DAMPINGS)
    return next((nearer for nearer in moved if misfit(nearer) < before), None)


def _damped_step(belief: Belief, fit: Fit, damping: float = DAMPINGS[0]) -> Array:
    """Gauss's and Newton's step, damped as Levenberg's and Marquardt's, and within the values' reach."""
    reach = np.array([belief.reach(name) for name in fit.names])
    seen = fit.normal * np.outer(reach, reach)
    pulled = seen @ ((fit.gain @ belief.residual - fit.pull) / reach)
    # what x hardly tells holds the others back no more; never below rounding, which leaves nothing of noise
    least = damping * max(belief.noise**2, float(np.finfo(float).eps * np.trace(seen)))
    damped = seen + least * np.eye(len(reach))
    step, free = np.zeros(len(reach)), np.ones(len(reach), dtype=bool)
    while True:
        step[free] = np.linalg.solve(damped[np.ix_(free, free)], pulled[free])
        out = [belief.pinned(name, towards) for name, towards in zip(fit.names, step, strict=True)]
        if not (free & out).any():
            return np.asarray(reach * step / max(1.0, float(np.max(np.abs(step)))))
        free &= ~np.array(out)  # a value that would leave where it may be stays, and the others go without it
        step[~free] = 0.0


def _updated_by_broyden(before: Belief, moved: Belief) -> Belief:
    """With slopes that the step has shown, and no simulation more: Broyden's rule, each value by what it moves."""
    fit = before.fit
    assert fit is not None
    scale = np.sum(fit.jacobian**2, axis=0)
    step = np.array([moved.values[name] - before.values[name] for name in fit.names])
    missed = before.residual - moved.residual - fit.jacobian @ step
    return _fitted(moved, fit.names, fit.jacobian + np.outer(missed, scale * step / (scale @ step**2)))


def linearised(belief: Belief) -> Belief:
    """With how its values follow from x, in their neighbourhood."""
    residual = belief.residual
    try:
        slopes = belief.tangents()
    except StickslipError:  # neighbours that are solved unlike
        slopes = {}
    slopes = {name: slopes[name] if name in slopes else slope_of(belief, name) for name in belief.values}
    # what moves nothing can not be told, and what is at its end would hold the others back
    names = tuple(
        name
        for name, slope in slopes.items()
        if slope.any()
        and name != belief.held
        and not belief.pinned(name, float(slope @ residual))
        # a stick feels an excess of none by its square alone: along a slope of rounding it was drawn to 4e8 N
        and not (name == EXCESS and not belief.values[name] and _is_unseen(belief, name, slope))
    )
    if not names:
        raise EstimateError("a displacement that nothing moves", f"{QUESTION} moves as its law does", "see the record")
    return _fitted(belief, names, levelled(np.column_stack([slopes[name] for name in names])))


def _is_unseen(belief: Belief, name: str, slope: Array) -> bool:
    """Whether a value as large as any moves x by less than its noise, by its slope."""
    return belief.size(name) * float(np.linalg.norm(levelled(slope))) < belief.noise


def _fitted(belief: Belief, names: tuple[str, ...], jacobian: Array) -> Belief:
    """With what x tells of its values, by their slopes."""
    residual = belief.residual
    independent = len(residual) / correlation_time(residual)
    freedom = max(1.0, independent - len(names))
    weight = float(residual @ residual) / freedom
    # what is known beforehand counts against the sensor's noise: a misfit must not hold values to it
    known = [belief.priors.get(name, (0.0, math.inf)) for name in names]
    prior = np.array([belief.noise**2 / sd**2 for _, sd in known])
    scale = np.sqrt(np.sum(jacobian**2, axis=0) + prior)
    unit = jacobian / scale
    seen = unit.T @ unit
    inverse = np.linalg.pinv(seen + np.diag(prior / scale**2))
    covariance = inverse @ (weight * seen + np.diag(belief.noise**2 * prior / scale**2)) @ inverse
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    inverse /= np.outer(scale, scale)
    pull = inverse @ (prior * [belief.values[n] - middle for n, (middle, _) in zip(names, known, strict=True)])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    normal = jacobian.T @ jacobian + np.diag(prior)
    return replace(belief, fit=Fit(names, jacobian, inverse @ jacobian.T, pull, normal, root, weight, freedom))


def slope_of(belief: Belief, name: str) -> Array:
    """How the displacement changes with one value, by a difference forward: a part at zero has no other side."""
    step = NUDGE * belief.size(name)
    if name in (HELD, BENT) and belief.values[name] > 0:  # the contact bears no more than all
        step = -step
    try:
        moved = belief.at(**{name: belief.values[name] + step}).moved
    except StickslipError:  # an exit that is a tangency just there
        step /= 3
        moved = belief.at(**{name: belief.values[name] + step}).moved
    return np.asarray((moved - belief.moved) / step)


def within_ends(belief: Belief, fit: Fit, step: Array) -> Belief:
    """The rig a step of its fit away; of what would leave its end, others make up as much as x lets them.

    Cut to its end alone, a static friction that the sliding one makes up for left twins with half as much of both.
    """
    low, high = np.array([belief.ends(name) for name in fit.names]).T - [belief.values[name] for name in fit.names]
    covariance = fit.root @ fit.root.T
    for _ in fit.names:
        sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        beyond = np.divide(step - np.clip(step, low, high), sd, out=np.zeros(len(sd)), where=sd > 0)
        furthest = int(np.argmax(np.abs(beyond)))
        if not beyond[furthest]:
            break
        others = covariance[furthest] / covariance[furthest, furthest]
        step = step - beyond[furthest] * sd[furthest] * others
        covariance = covariance - np.outer(covariance[furthest], others)
        covariance[furthest] = covariance[:, furthest] = 0.0
    return belief.by(fit.names, step)


def linear_ends(belief: Belief, value: Callable[[Belief], float], deviations: float) -> tuple[float, float]:
    """The ends of a value of rigs so many standard deviations of the linear fit away, the way that tells the most."""
    middle, fit = value(belief), belief.fit
    if fit is None or not math.isfinite(middle) or not deviations:
        return middle, middle
    slopes = np.array([value(belief.by(fit.names, LITTLE * step)) - middle for step in fit.root.T])
    if not (norm := float(np.linalg.norm(slopes))) > 0:  # what is not moved at all, or undefined nearby
        return middle, middle
    rigs = [_displaced(belief, fit, side * slopes / norm, deviations) for side in (-1, 1)]
    ends = sorted(_along_line(belief, rig, value) for rig in rigs)
    return ends[0], ends[1]


def _along_line(belief: Belief, rig: Belief, value: Callable[[Belief], float]) -> float:
    """A value of a rig, by the line through a nearer one where the curve of its friction is of another speed.

    Of friction that hardly falls x tells neither its speed nor its kinetic part, and both together well: a factor of
    25 in the speed alone made 0.07 N of 10.6 N of a Dahl contact.
    """
    moved = {name: rig.values[name] - known for name, known in belief.values.items()}
    far = max((abs(moved[name]) for name in (SPEED, POWER) if name in moved), default=0.0)
    if far <= BENDS:
        return value(rig)
    part = BENDS / far
    nearer = belief.at(**{name: belief.values[name] + part * step for name, step in moved.items()})
    return value(belief) + (value(nearer) - value(belief)) / part


def _displaced(belief: Belief, fit: Fit, way: Array, deviations: float) -> Belief:
    """The rig so many standard deviations away; where a value comes to its end, the others go on without it.

    A contact's stiffness went on as if its damping became less than none.
    """
    step, root, free = np.zeros(len(fit.names)), fit.root, np.ones(len(fit.names), dtype=bool)
    ends = [belief.ends(name) for name in fit.names]
    values = np.array([belief.values[name] for name in fit.names])
    while True:
        ahead = deviations * root @ way
        room = np.array([high if go > 0 else low for (low, high), go in zip(ends, ahead, strict=True)]) - values - step
        shares = np.divide(room, ahead, out=np.full(len(ahead), math.inf), where=free & (ahead != 0))
        share, first = max(0.0, float(shares.min())), int(shares.argmin())
        step = step + min(1.0, share) * ahead
        if share >= 1:
            return belief.by(fit.names, step)
        held, free[first] = root[first] / float(np.linalg.norm(root[first])), False
        deviations *= math.sqrt(1 - share**2)
        root, way = root - np.outer(root @ held, held), way - held * float(way @ held)
        way = way / (float(np.linalg.norm(way)) or 1.0)
