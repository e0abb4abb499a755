"""Several releases, or noise that is not white: the likelihood of all of them together, and its profile.

All releases share the first three parameters of the motion: frequency, damping ratio, dry friction. Each has its own
rest position, amplitude and time of release, and where counts are fitted its own noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stickslip.decay.noise import Noise, Objective, extreme, minimise, solve
from stickslip.decay.profile import last_swing
from stickslip.decay.waveform import Array, Blocks

SHARED = 3
WORSE = 20.0  # minus twice the log likelihood by which a number of half cycles may be worse and still count


@dataclass(frozen=True, eq=False)
class Release:
    """One release: its blocks, its fits in white noise by number of half cycles, and its noise."""

    blocks: Blocks
    fits: Array
    noise: Noise


@dataclass(frozen=True, eq=False)
class Candidate:
    """The best fit for a number of half cycles of each release.

    `p` holds the shared parameters and then those of each release, `places` where each release's are.
    """

    half_cycles: tuple[int, ...]
    p: Array
    value: float
    curvature: Array
    objective: Objective
    places: tuple[Array, ...]

    def motion(self, number: int) -> Array:
        """The six parameters of a release's motion."""
        return np.asarray(self.p[self.places[number]][:6])

    def possible(self, p: Array) -> bool:
        """Whether no release's last half cycle is shorter than nothing at these parameters."""
        motions = zip(self.places, self.half_cycles, strict=True)
        return all(n == 1 or last_swing(p[at][:6], n)[0] > 0 for at, n in motions)


def candidates(releases: list[Release]) -> list[Candidate]:
    """The likeliest numbers of half cycles, and every one that differs in one release and is nearly as likely."""
    best = _fitted(releases, tuple(int(each.fits[np.argmin(each.fits[:, 1]), 0]) for each in releases))
    found = {best.half_cycles: best}
    for number, release in enumerate(releases):
        for n in sorted({*release.fits[:, 0].astype(int), *_neighbours(release)}):
            tried = (*best.half_cycles[:number], int(n), *best.half_cycles[number + 1 :])
            if n >= 1 and tried not in found:
                found[tried] = _fitted(releases, tried, best.p)
    possible = [each for each in found.values() if math.isfinite(each.value) and each.possible(each.p)] or [best]
    least = min(each.value for each in possible)
    return [each for each in possible if each.value <= least + WORSE]


def _neighbours(release: Release) -> set[int]:
    """Where least squares are not the likelihood, its neighbours may be the likeliest."""
    n = int(release.fits[np.argmin(release.fits[:, 1]), 0])
    p = release.fits[np.argmin(release.fits[:, 1]), 3:]
    rests = p[5] + n * math.pi / (p[0] * math.sqrt(1 - p[1] ** 2)) < release.blocks.total * release.blocks.dt
    return {n - 2, n - 1, n + 1, n + 2} if rests and release.noise.kind != "white" else set()


def _fitted(releases: list[Release], half_cycles: tuple[int, ...], start: Array | None = None) -> Candidate:
    places, size = [], SHARED
    for each in releases:
        own = 3 + each.noise.extra
        places.append(np.r_[np.arange(SHARED), np.arange(size, size + own)])
        size += own
    fresh, farthest = np.zeros(size), np.full(size, 1.0)
    weight = np.zeros(size)
    for release, at in zip(releases, places, strict=True):
        row = release.fits[np.argmin(release.fits[:, 1])]
        own = np.r_[row[3:], [math.log(release.noise.level)] * release.noise.extra]
        share = 1.0 / release.noise.level**2 * np.ones(len(own))
        fresh[at] += share * own
        weight[at] += share
        w, span = row[3], abs(row[7])
        farthest[at[:6]] = (0.1 * w, 0.1, 0.3 * span, span, 0.5 * span, 0.5 / w)
    objectives = [each.noise.objective(n) for each, n in zip(releases, half_cycles, strict=True)]

    def objective(p: Array) -> tuple[float, Array, Array]:
        total, slope, curvature = 0.0, np.zeros(size), np.zeros((size, size))
        for each, at in zip(objectives, places, strict=True):
            value, down, bend = each(p[at])
            if not math.isfinite(value):
                return math.inf, slope, np.eye(size)
            total += value
            slope[at] += down
            curvature[np.ix_(at, at)] += bend
        return total, slope, curvature

    p, value, curvature = minimise(objective, fresh / weight if start is None else start, farthest)
    return Candidate(half_cycles, p, value, curvature, objective, tuple(places))


def unlike(releases: list[Release], found: list[Candidate]) -> float:
    """p-value of the releases sharing frequency, damping ratio and dry friction: what sharing costs is chi-square."""
    from scipy.special import chdtrc

    if len(releases) == 1:
        return 1.0
    alone = sum(min(each.value for each in candidates([release])) for release in releases)
    cost = min(each.value for each in found) - alone
    return float(chdtrc(SHARED * (len(releases) - 1), max(cost, 0.0)))


def ends(found: list[Candidate], level: float, count: int) -> Array:
    """Ends (count, 2) of the profile likelihood of the first parameters, by the best candidate at each end."""
    answer = np.empty((count, 2))
    for which in range(count):
        for column, side in enumerate((-1, 1)):
            reached: list[float] = []
            beyond: list[float] = []
            for each in found:
                if each.value >= level:
                    continue
                p = extreme(each.objective, each.p, each.value, which, side, level)
                if p is None:
                    aim = np.eye(len(each.p))[which]
                    reached.append(
                        each.p[which] + side * math.sqrt((level - each.value) * solve(each.curvature, aim)[which])
                    )
                else:
                    (reached if each.possible(p) else beyond).append(p[which])
            answer[which, column] = side * max((side * each for each in reached or beyond), default=math.inf)
    return answer
