"""What a fit of viscous and dry friction to a free decay answers.

Viscous and dry friction of one pendulum's free decay, by its whole waveform with sin x for the spring.

Several releases, or noise that is not white: the likelihood of all of them together, and its profile.

All releases share the first three parameters of the motion: frequency, damping ratio, dry friction. Each has its own
rest position, amplitude and time of release, and where counts are fitted its own noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.decay.candidates import ALWAYS
from stickslip.decay.choice import COLOURED, Candidate, lack_of_fit
from stickslip.decay.motions import Restoring
from stickslip.decay.noise import LOOSE, Noise, Objective, extreme, minimise, solve
from stickslip.decay.profile import last_swing
from stickslip.decay.release import RingDown
from stickslip.decay.waveform import Blocks
from stickslip.decay.which_motion import (
    SWING,
    DecayMotion,
    beginning,
    choice_of,
    static_between,
    status_of,
    whichever,
)
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Estimate, Result
from stickslip.record.record import Step

BEYOND = f"swings beyond {SWING:g} rad are left out"

SHARED = 3
FEWEST = 8.0  # degrees of freedom of counts or a drift that tell little: of 400 intervals 3 held 99 %, 5 98.5 %, 8 96 %
WORSE = 20.0  # minus twice the log likelihood by which a number of half cycles may be worse and still count


@dataclass(frozen=True, eq=False, repr=False)
class DecayFit(Result):
    """Viscous and dry friction of a free decay.

    Attributes
    ----------
    damping_ratio : Estimate
        Viscous damping over the critical one.
    dry_displacement : Estimate
        Dry friction over the stiffness [m or rad]: half the width of the band in which the mass can rest.
    frequency : Estimate
        Undamped natural frequency [Hz].
    bias : Estimate
        Of the first release, as the two that follow: rest position in the record's zero [m or rad]; for velocity and
        acceleration the sensor's offset.
    release_time : Estimate
        When the mass was let go [s]. Where the motion is under way when the record begins, or its first swings are left
        out, the turn that it is fitted from, and named so.
    amplitude : Estimate
        From the rest position [m or rad], at that time.
    static_displacement : Estimate
        Static friction over the stiffness [m or rad]: the interval from where the mass stayed to where it last turned,
        in all releases.
    dry_force : Estimate or None
        Dry friction [N or N m], where the stiffness or the mass is known.
    damping_ratio_any, dry_displacement_any : Estimate or None
        The same two with the interval that holds whichever of the candidates not rejected is the motion: the model's
        form counted. None where no candidates were asked for.
    half_cycles : tuple of int
        Half cycles until rest of each release, the likeliest number.
    alternatives : tuple of (tuple of int, float)
        Every number of half cycles (of each release) that may be, with its weight by likelihood.
    model : str
        The motion fitted, in words.
    noise : str
        The noise found, in words; where releases differ, of each.
    noise_level : float
        Its standard deviation a sample in the first release, in the channel's unit.
    channel : str
        The channel fitted.
    ring_downs : tuple of RingDown
        The releases found: hold, motion and tail.
    time, measured, fitted : tuple of ndarray
        For each release: time [s] of each block's centre, the block means and those of the model.
    status : str
        "ok", or in words what to beware of.
    notes : tuple of str
        What was noticed when the releases were sought.
    history : tuple of Step
        What was done to the records, and this fit.
    motions : tuple of DecayMotion
        Which motion each release followed, of the candidates asked for.
    """

    damping_ratio: Estimate
    dry_displacement: Estimate
    frequency: Estimate
    bias: Estimate
    release_time: Estimate
    amplitude: Estimate
    static_displacement: Estimate
    dry_force: Estimate | None
    damping_ratio_any: Estimate | None
    dry_displacement_any: Estimate | None
    half_cycles: tuple[int, ...]
    alternatives: tuple[tuple[tuple[int, ...], float], ...]
    model: str
    noise: str
    noise_level: float
    channel: str
    ring_downs: tuple[RingDown, ...]
    time: tuple[Array, ...]
    measured: tuple[Array, ...]
    fitted: tuple[Array, ...]
    status: str
    notes: tuple[str, ...]
    history: tuple[Step, ...]
    motions: tuple[DecayMotion, ...] = ()

    @property
    def residual(self) -> tuple[Array, ...]:
        """Measured minus fitted block means of each release."""
        return tuple(m - f for m, f in zip(self.measured, self.fitted, strict=True))


def rig_units(channel: str) -> dict[str, str]:
    """Units of mass and stiffness: of an angle those of a moment of inertia, and of a torque over the angle."""
    return {"mass": "kg m^2", "stiffness": "N m/rad"} if channel == "theta" else {"mass": "kg", "stiffness": "N/m"}


def constants(mass: Constant | None, stiffness: Constant | None, name: str) -> tuple[float | None, float | None]:
    """Mass and stiffness as numbers, in the units of the channel."""
    values = []
    for (word, unit), given in zip(rig_units(name).items(), (mass, stiffness), strict=True):
        value = None if given is None else Estimate.stated(word, given, unit).value
        if value is not None and not (math.isfinite(value) and value > 0):
            raise EstimateError(f"{word} = {given}", f"a {word} is positive", f"correct {word}=, or leave it out")
        values.append(value)
    return values[0], values[1]


def spring_of(known: tuple[float | None, float | None], angular_frequency: float) -> float | None:
    """The stiffness that is stated, or that of the stated mass; None where neither is."""
    mass, stiffness = known
    return stiffness if stiffness is not None or mass is None else mass * angular_frequency**2


def fit_pendulum(
    ring_downs: list[RingDown],
    *,
    restoring: Restoring,
    noise: str | None,
    motions: tuple[DecayMotion, ...],
    known: tuple[float | None, float | None],
    notes: tuple[str, ...],
    history: tuple[Step, ...],
) -> DecayFit:
    """:func:`~stickslip.decay.fit_decay.fit_decay` of a pendulum: ``x'' = -w^2 sin x - 2 zeta w v - w^2 x_k sgn v``.

    Parameters
    ----------
    ring_downs : list of RingDown
        One release of an angle.
    restoring : {"pendulum"}
        The spring's law.
    noise : str or None
        No kind can be asked for: the residual tells.
    motions : tuple of DecayMotion
        Which motion it was, where other candidates were asked for.
    known : tuple of (float or None)
        Moment of inertia [kg m^2] and stiffness of the small swings [N m/rad], where stated.
    notes, history : tuple
        What was noticed in the record, and what was done to it.

    Raises
    ------
    EstimateError
        Several releases, a noise that is asked for, or what :func:`choice_of` refuses.
    """
    ring_down = _only(ring_downs, noise)
    before = {candidate.name: candidate.fitted for motion in motions for candidate in motion.choice.candidates}
    choice, zero = choice_of(ring_down, restoring=restoring, candidates=ALWAYS, fitted=before)
    chosen = choice.chosen
    later = zero > ring_down.release
    large = (BEYOND,) if later and abs(ring_down.amplitude) >= SWING else ()
    status = status_of(ring_down, "; ".join(filter(None, [*large, choice.seen_beside(*ALWAYS) or lack_of_fit(chosen)])))
    fitted = chosen.fitted
    blocks, model = fitted.blocks, f"{fitted.motion.words}, spring sin x"
    kind = "white" if chosen.noise.whiteness >= COLOURED else "correlated"
    choices = [motion.choice for motion in motions]
    estimate = _estimator(chosen, status, kind)
    begins, far = beginning(ring_down.held and not later)
    damping = estimate("damping_ratio", "damping ratio", "1")
    dry = estimate("dry_displacement", "dry friction displacement", "rad")
    frequency = estimate("angular_frequency", "natural frequency", "Hz", 1 / (2 * math.pi))
    spring = spring_of(known, fitted.value("angular_frequency"))
    done = f"{fitted.half_cycles} half cycles of {frequency.value:.6g} Hz, spring sin x, noise {kind}"
    return DecayFit(
        damping_ratio=damping,
        dry_displacement=dry,
        frequency=frequency,
        bias=estimate("rest", "rest position", "rad"),
        release_time=estimate("release", begins, "s", offset=zero),
        amplitude=estimate("amplitude", far, "rad"),
        static_displacement=static_between(chosen, ring_down),
        dry_force=None if spring is None else dry.scaled(spring, "N m", "dry friction"),
        damping_ratio_any=whichever(choices, damping, "damping_ratio") if choices else None,
        dry_displacement_any=whichever(choices, dry, "dry_displacement") if choices else None,
        half_cycles=(fitted.half_cycles,),
        alternatives=(((fitted.half_cycles,), 1.0),),
        model=model,
        noise=kind,
        noise_level=chosen.level,
        channel=ring_down.channel,
        ring_downs=(ring_down,),
        time=(zero + blocks.times,),
        measured=(blocks.values,),
        fitted=(blocks.values - fitted.residual / np.sqrt(blocks.weights),),
        status=status,
        notes=notes,
        history=(*history, Step("fit_decay", {"channel": ring_down.channel, "restoring": restoring}, done)),
        motions=motions,
    )


def _estimator(chosen: Candidate, status: str, noise: str) -> Callable[..., Estimate]:
    """What makes an Estimate of a parameter, by its name."""
    method, checks = f"whole waveform, spring sin x, noise {noise}", (f"{chosen.fitted.half_cycles} half cycles",)

    def estimate(parameter: str, name: str, unit: str, factor: float = 1.0, offset: float = 0.0) -> Estimate:
        plain = chosen.estimate(parameter, name=name, unit=unit, factor=factor, offset=offset)
        return replace(plain, status=status, method=method, checks=checks)

    return estimate


def _only(ring_downs: list[RingDown], noise: str | None) -> RingDown:
    """The one release that is fitted."""
    if len(ring_downs) > 1:
        raise EstimateError(
            f"{len(ring_downs)} releases", "a pendulum's are fitted one at a time", "cut one out: record.between(a, b)"
        )
    if noise is not None:
        raise EstimateError(f"noise = '{noise}'", "a pendulum's is told from its residual", "leave noise= out")
    return ring_downs[0]


@dataclass(frozen=True, eq=False)
class Release:
    """One release: its blocks, its fits in white noise by number of half cycles, and its noise."""

    blocks: Blocks
    fits: Array
    noise: Noise


@dataclass(frozen=True, eq=False)
class Together:
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

    def freedom(self, releases: list[Release]) -> float:
        """Degrees of freedom that tell the noise: of drift, the cosines that it outweighs the white noise at; of
        counts, what the information on the noise's logarithm is worth.

        Of n samples it is 2 n, but of coarse counts only those near a step tell: a few, to which six parameters are
        fitted as well, so that the noise looks less than it is.
        """
        total = 0.0
        for release, at in zip(releases, self.places, strict=True):
            own = min(release.blocks.freedom, max(release.noise.told_by, FEWEST))
            if release.noise.extra:
                own = min(own, max((self.curvature[at[6], at[6]] - LOOSE) / 2 - 6, FEWEST))
            total += own
        return total

    def possible(self, p: Array) -> bool:
        """Whether no release's last half cycle is shorter than nothing at these parameters."""
        motions = zip(self.places, self.half_cycles, strict=True)
        return all(n == 1 or last_swing(p[at][:6], n)[0] > 0 for at, n in motions)


def fit_together(releases: list[Release]) -> list[Together]:
    """The likeliest numbers of half cycles, and every one that differs in one release and is nearly as likely.

    Least squares of coarse counts may begin several half cycles away: neighbours are tried until none is likelier.
    """
    best = _fitted(releases, tuple(int(release.fits[np.argmin(release.fits[:, 1]), 0]) for release in releases))
    fits, before = {best.half_cycles: best}, None
    while best is not before:
        before = best
        for number, release in enumerate(releases):
            for n in sorted({*release.fits[:, 0].astype(int), *_neighbours(release, best, number)}):
                tried = (*before.half_cycles[:number], int(n), *before.half_cycles[number + 1 :])
                if n >= 1 and tried not in fits:
                    fits[tried] = _fitted(releases, tried, before.p)
        possible = [fit for fit in fits.values() if math.isfinite(fit.value) and fit.possible(fit.p)] or [best]
        best = min(possible, key=lambda fit: fit.value)
    return [fit for fit in possible if fit.value <= best.value + WORSE]


def _neighbours(release: Release, best: Together, number: int) -> set[int]:
    """Where least squares are not the likelihood, the neighbours of the best may be the likeliest."""
    n, p = best.half_cycles[number], best.motion(number)
    rests = p[5] + n * math.pi / (p[0] * math.sqrt(1 - p[1] ** 2)) < release.blocks.total * release.blocks.dt
    return {n - 2, n - 1, n + 1, n + 2} if rests and release.noise.kind != "white" else set()


def _fitted(releases: list[Release], half_cycles: tuple[int, ...], start: Array | None = None) -> Together:
    places, size = [], SHARED
    for release in releases:
        own = 3 + release.noise.extra
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
    objectives = [release.noise.objective(n) for release, n in zip(releases, half_cycles, strict=True)]

    def objective(p: Array) -> tuple[float, Array, Array]:
        total, slope, curvature = 0.0, np.zeros(size), np.zeros((size, size))
        for misfit, at in zip(objectives, places, strict=True):
            value, down, bend = misfit(p[at])
            if not math.isfinite(value):
                return math.inf, slope, np.eye(size)
            total += value
            slope[at] += down
            curvature[np.ix_(at, at)] += bend
        return total, slope, curvature

    p, value, curvature = minimise(objective, fresh / weight if start is None else start, farthest)
    return Together(half_cycles, p, value, curvature, objective, tuple(places))


def unlike(releases: list[Release], fits: list[Together]) -> float:
    """p-value of the releases sharing frequency, damping ratio and dry friction: what sharing costs is chi-square."""
    from scipy.special import chdtrc

    if len(releases) == 1:
        return 1.0
    alone = sum(min(fit.value for fit in fit_together([release])) for release in releases)
    cost = min(fit.value for fit in fits) - alone
    return float(chdtrc(SHARED * (len(releases) - 1), max(cost, 0.0)))


def ends_together(fits: list[Together], level: float, count: int) -> Array:
    """Ends (count, 2) of the profile likelihood of the first parameters, by the best candidate at each end."""
    answer = np.empty((count, 2))
    for which in range(count):
        for column, side in enumerate((-1, 1)):
            reached: list[float] = []
            beyond: list[float] = []
            for fit in fits:
                if fit.value >= level:
                    continue
                p = extreme(fit.objective, fit.p, fit.value, which, side, level)
                if p is None:
                    aim = np.eye(len(fit.p))[which]
                    step = math.sqrt((level - fit.value) * solve(fit.curvature, aim)[which])
                    reached.append(fit.p[which] + side * step)
                else:
                    (reached if fit.possible(p) else beyond).append(p[which])
            answer[which, column] = side * max((side * end for end in reached or beyond), default=math.inf)
    return answer
