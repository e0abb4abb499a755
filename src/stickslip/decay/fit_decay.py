"""How much viscous and how much dry friction does a free decay show, by its whole waveform?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.decay.answer import (
    DecayFit,
    Release,
    constants,
    ends_together,
    fit_pendulum,
    fit_together,
    spring_of,
    unlike,
)
from stickslip.decay.candidates import ALWAYS
from stickslip.decay.choice import Choice
from stickslip.decay.motions import Restoring
from stickslip.decay.noise import KINDS, find_noise
from stickslip.decay.profile import last_swing
from stickslip.decay.release import CLIPPED, LOST, Releases, RingDown, find_releases
from stickslip.decay.start import Search, roughness, variance, weights
from stickslip.decay.which_motion import NO_REST, DecayMotion, beginning, motion_of, named, static_in, whichever
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Doubt, Estimate, Status
from stickslip.record.record import Record, Step, require_record
from stickslip.signals.interpolate import without_delays
from stickslip.statistics import student

LEFT_OVER = "residual"  # the kind of doubt where the model leaves more than noise
UNLIKE = 2.0  # times the noise that the residual may be before the model is doubted
UNSHARED = "unshared"  # kind of doubt: the releases have no friction and frequency in common
APART = 1e-3  # p-value of sharing friction and frequency, below which releases are not one experiment
SHORT = 0.15  # of a half cycle: a hold so short can not be told from the turn of a swing
AFTER = 0.08  # of a half cycle, within which the first turn is known
DOUBTED = 0.01  # likelihood below which a number of half cycles does not widen the static friction's bracket


def fit_decay(
    record: Record | Sequence[Record],
    *,
    channel: str | None = None,
    mass: Constant | None = None,
    stiffness: Constant | None = None,
    noise: str | None = None,
    restoring: Restoring = "linear",
    candidates: str | tuple[str, ...] | None = None,
) -> DecayFit:
    r"""How much viscous and how much dry friction does a free decay show?

    The exact motion under both (thesis, chapter 6), half cycle by half cycle,

    .. math:: x = b + s_i [x_k + d_i E(t - t_0 - i T)], \quad d_{i+1} = e^{-\pi\beta} d_i - 2 x_k, \quad
              \beta = \zeta / \sqrt{1 - \zeta^2},

    with :math:`E(\tau) = e^{-\zeta\omega\tau}(\cos\omega_d\tau + \beta\sin\omega_d\tau)` and
    :math:`T = \pi/\omega_d`, is fitted to the whole record by least squares: hold, motion and rest. Unknown are the
    damping ratio, the dry friction, the frequency, the rest position, the amplitude and the time of release. The number
    of half cycles is not guessed: every number that may be is fitted, and each parameter's estimate is their mean by
    likelihood. The intervals are those of the profile likelihood, the best number at each point. In white noise that
    reaches the Cramer-Rao bound, while the decrement of the extremes lies at 13 times it (median over 288 conditions).

    The noise is told from the record: white; counts of a digitiser whose step is not small beside the noise, fitted by
    the probability of each count's interval; or white and drift, of a power like 1/f, 1/f^2 or 1/f^4, by restricted
    maximum likelihood, which counts that drift take too.
    Several releases are fitted together: they share frequency and friction, and narrow the static friction's bracket.

    A pendulum's spring is ``sin x``: with ``restoring="pendulum"`` its motion is integrated, and the intervals are
    those of linear propagation with the noise of the residual.

    Another motion leaves a residual larger than the noise, and the status says so. With ``candidates="all"`` other
    motions are fitted too (see :func:`choose_motion`), and beside each interval, which holds if this is the motion,
    stands the one that holds whichever of those not rejected it is: ``damping_ratio_any``, ``dry_displacement_any``.

    The record is reduced to means over a fortieth of a period first, which costs 0.15 % of the accuracy and makes the
    time of a fit independent of the sampling rate. The model's means are exact.

    Parameters
    ----------
    record : Record or sequence of Record
        One release or several (see :func:`find_releases`), with displacement ``x`` or angle ``theta``, velocity ``v``
        or acceleration ``a``. A stated delay is taken out first.
    channel : {"x", "theta", "v", "a"}, optional
        The channel to fit; the first of these that the record has.
    mass, stiffness : float, str, tuple or Estimate, optional
        Mass [kg] or stiffness [N/m] (of an angle: kg m^2, N m/rad), for the dry friction as a force.
    noise : {"white", "quantised", "coloured"}, optional
        The noise's kind; told from the record when not given.
    restoring : {"linear", "pendulum"}
        The spring's law: x, or sin x of one release of an angle ``theta`` [rad].
    candidates : "all" or tuple of str, optional
        Other motions that a displacement may have followed, by their names in :func:`choose_motion`; none when left
        out, which is quicker.

    Returns
    -------
    DecayFit

    Raises
    ------
    RecordError
        The channel is missing, broken or too short.
    EstimateError
        No free decay (see :func:`find_releases`), fewer than two swings, a noise that the record does not have, a
        pendulum that is no single angle, or candidates of no known name or for a channel that is no displacement.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(mass=1.0, stiffness=1000.0, damping=2.0, law=ss.laws.Coulomb(0.5))
    >>> run = ss.simulate(slider, duration=4.0, start={"x": 0.01})
    >>> noise = np.random.default_rng(1).normal(0, 2e-5, 2000)
    >>> record = Record.of({"x": run.record(fs=500)["x"][:2000] + noise}, fs=500)
    >>> decay = fit_decay(record, mass=1.0)
    >>> decay.damping_ratio.includes(2.0 / 2 / math.sqrt(1000)), decay.dry_force.includes(0.5)
    (True, True)
    >>> found = fit_decay(record, candidates=("both", "quadratic"))
    >>> found.damping_ratio_any.includes(found.damping_ratio.value)
    True
    """
    require_record(record)
    if noise is not None and noise not in KINDS:
        raise EstimateError(f"noise = '{noise}'", f"it is one of {', '.join(KINDS)}", "choose one, or leave it out")
    records = [record] if isinstance(record, Record) else list(record)
    groups = _releases_of(records, channel)
    ring_downs = [ring_down for group in groups for ring_down in group.ring_downs]
    others = named(candidates)
    asked = ring_downs if others else ()
    motions = tuple(motion_of(ring_down, restoring=restoring, candidates=others) for ring_down in asked)
    known = constants(mass, stiffness, ring_downs[0].channel)
    history = tuple(step for record in records for step in record.history)
    notes = tuple(dict.fromkeys(note for group in groups for note in group.notes))
    if restoring != "linear":
        return fit_pendulum(
            ring_downs, restoring=restoring, noise=noise, motions=motions, known=known, notes=notes, history=history
        )
    sources = [record for record, those in zip(records, groups, strict=True) for _ in those.ring_downs]
    ring_downs = [_described(ring_down, source) for ring_down, source in zip(ring_downs, sources, strict=True)]
    releases = [_release(ring_down, noise) for ring_down in ring_downs]
    motion = _alone(releases[0]) if len(releases) == 1 and releases[0].noise.kind == "white" else _together(releases)
    return _answer(ring_downs, releases, motion, motions, known, notes, history)


def _releases_of(records: list[Record], channel: str | None) -> list[Releases]:
    """The releases of each record, all of one channel."""
    if not records:
        raise EstimateError("no record", "a decay is fitted to one record at least", "pass a record, or several")
    groups = [find_releases(record, channel=channel) for record in records]
    names = {ring_down.channel for group in groups for ring_down in group.ring_downs}
    if len(names) > 1:
        raise EstimateError(
            f"channels {', '.join(sorted(names))}", "releases are fitted together by one channel", "choose channel="
        )
    return groups


def _described(ring_down: RingDown, record: Record) -> RingDown:
    """What the model describes: no clipped swings; a velocity or an acceleration from before its first extreme."""
    cut = np.flatnonzero(~ring_down.sound[:-1])
    if len(cut):
        later = _from(ring_down, int(ring_down.turns[cut[-1] : cut[-1] + 2].mean()))
        return replace(later, held=False, notes=(*later.notes, CLIPPED))
    if ring_down.order == 0:
        return _from_motion(ring_down)
    record = without_delays(record, ring_down.channel)
    first = round((ring_down.first - record.start) * record.fs)
    before = min(first, round(record.fs / ring_down.frequency))
    samples = np.concatenate([record[ring_down.channel][first - before : first], ring_down.samples])
    turns = ring_down.turns + before
    return replace(ring_down, first=ring_down.first - before / record.fs, samples=samples, turns=turns)


def _from(ring_down: RingDown, first: int) -> RingDown:
    """The ring-down from row `first` on."""
    kept = ring_down.turns >= first
    samples, turns = ring_down.samples[first:], ring_down.turns[kept] - first
    begin = ring_down.first + first / ring_down.fs
    return replace(ring_down, first=begin, samples=samples, turns=turns, sound=ring_down.sound[kept])


def _from_motion(ring_down: RingDown) -> RingDown:
    """From after the first turn where no hold before it is seen: what the model held there, the record did not."""
    half, before = ring_down.fs / ring_down.frequency / 2, ring_down.hold.stop
    if ring_down.turns[0] != before or (ring_down.held and before >= SHORT * half):
        return ring_down
    return _from(ring_down, before + round(AFTER * half))


def _release(ring_down: RingDown, noise: str | None) -> Release:
    """One release: its blocks, its fits in white noise, its noise."""
    samples = np.ascontiguousarray(ring_down.samples)
    search = Search()
    blocks = search.blocks(samples, 1 / ring_down.fs, ring_down.order)
    fits = search.candidates(blocks, ring_down.turns) if blocks else np.empty((0, 9))
    if blocks is None or not len(fits):
        raise EstimateError(
            f"channel {ring_down.channel} shows no oscillation that decays",
            "at least two swings are needed, the first the largest",
            "give the record of a release that is less than critically damped",
        )
    return Release(blocks, fits, find_noise(blocks, fits, samples, ring_down.step, noise))


@dataclass(frozen=True, eq=False)
class _Motion:
    """Six parameters of the first release, their spread and their 95 % ends, and every candidate with its weight."""

    values: Array
    spread: Array
    ends: Array
    candidates: tuple[tuple[tuple[int, ...], float], ...]
    motions: tuple[tuple[Array, ...], ...]  # of each candidate, the six parameters of each release
    alike: float = 1.0  # p-value of the releases sharing what they are taken to share


def _alone(release: Release) -> _Motion:
    blocks, fits = release.blocks, release.fits
    share = weights(fits, blocks)
    best = fits[np.argmax(share)]
    ends = Search().intervals(blocks, fits)
    _, jacobian = blocks.motion(best[3:], int(best[0]))
    covariance = np.asarray(variance(fits, blocks) * np.linalg.pinv(jacobian @ jacobian.T), dtype=np.float64)
    return _mean(fits[:, 3:], share, covariance, ends, [(int(n),) for n in fits[:, 0]], [(row[3:],) for row in fits])


def _together(releases: list[Release]) -> _Motion:
    fits = fit_together(releases)
    least = min(fit.value for fit in fits)
    share = np.exp(-0.5 * np.array([fit.value - least for fit in fits]))
    best = fits[int(np.argmax(share))]
    covariance = np.asarray(np.linalg.pinv(best.curvature)[:6, :6], dtype=np.float64)
    limits = ends_together(fits, least + student(best.freedom(releases)) ** 2, 6)
    motions = [tuple(fit.motion(k) for k in range(len(releases))) for fit in fits]
    rows = np.array([fit.p[:6] for fit in fits])
    mean = _mean(rows, share / share.sum(), covariance, limits, [fit.half_cycles for fit in fits], motions)
    return replace(mean, alike=unlike(releases, fits))


def _mean(
    rows: Array,
    share: Array,
    covariance: Array,
    ends: Array,
    half_cycles: list[tuple[int, ...]],
    motions: list[tuple[Array, ...]],
) -> _Motion:
    """The mean of the candidates by likelihood, the likeliest first."""
    values = share @ rows
    spread = np.sqrt(np.diag(covariance) + share @ (rows - values) ** 2)
    order = np.argsort(-share)
    # a candidate too unlikely for the interval, or one without a possible end, still has its share in the mean
    ends = np.column_stack([np.minimum(ends[:, 0], values), np.maximum(ends[:, 1], values)])
    shares = tuple((half_cycles[k], float(share[k])) for k in order)
    return _Motion(values, spread, ends, shares, tuple(motions[k] for k in order))


def _answer(
    ring_downs: list[RingDown],
    releases: list[Release],
    motion: _Motion,
    motions: tuple[DecayMotion, ...],
    known: tuple[float | None, float | None],
    notes: tuple[str, ...],
    history: tuple[Step, ...],
) -> DecayFit:
    name, unit, order = ring_downs[0].channel, ring_downs[0].unit, ring_downs[0].order
    length, zero = ("rad" if name == "theta" else "m"), "sensor offset" if order else "rest position"
    half_cycles, likelihood = motion.candidates[0]
    motions_first = zip(releases, half_cycles, motion.motions[0], strict=True)
    fitted = [release.blocks.motion(p, n)[0] for release, n, p in motions_first]
    choices = [motion.choice for motion in motions]
    unlike = f"the releases do not share one friction and frequency (p = {motion.alike:.1g}): fit each alone"
    doubts = (Doubt(unlike, UNSHARED),) if motion.alike < APART else _misfit(releases, fitted)
    status = Status(*_left_out(ring_downs), *doubts, *_seen_beside(choices))
    many = ", ".join(map(str, half_cycles))
    checks = (f"{many} half cycles" + ("" if likelihood > 0.995 else f" (likelihood {likelihood:.2f})"),)
    noise = "; ".join(dict.fromkeys(release.noise.words for release in releases))
    method = f"whole waveform, noise {noise}, profile likelihood"
    starts, first = [ring_down.first for ring_down in ring_downs], ring_downs[0]
    begins, far = beginning(first.held if first.order == 0 else float(motion.values[5]) > -1 / first.fs)

    def estimate(index: int, label: str, unit: str, factor: float = 1.0, offset: float = 0.0) -> Estimate:
        low, high = (float(factor * end + offset) for end in motion.ends[index])
        value, spread = float(factor * motion.values[index] + offset), float(factor * motion.spread[index])
        return Estimate(label, value, (low, high), spread, unit, method, status, checks)

    damping, dry = estimate(1, "damping ratio", "1"), estimate(2, "dry friction displacement", length)
    spring = spring_of(known, float(motion.values[0]))
    frequency = estimate(0, "natural frequency", "Hz", 1 / (2 * math.pi))
    step = Step("fit_decay", {"channel": name}, f"{many} half cycles of {frequency.value:.6g} Hz, noise {noise}")
    return DecayFit(
        damping_ratio=damping,
        dry_displacement=dry,
        frequency=frequency,
        bias=estimate(3, zero, unit).within(*map(float, (first.samples.min(), first.samples.max()))),  # swung about
        release_time=estimate(5, begins, "s", offset=starts[0]),
        amplitude=estimate(4, far, length),
        static_displacement=_static(ring_downs, releases, motion, Status(*doubts)),
        dry_force=None if spring is None else dry.scaled(spring, "N m" if name == "theta" else "N", "dry friction"),
        damping_ratio_any=whichever(choices, damping, "damping_ratio") if choices else None,
        dry_displacement_any=whichever(choices, dry, "dry_displacement") if choices else None,
        half_cycles=half_cycles,
        alternatives=motion.candidates,
        model="viscous and dry friction",
        noise=noise,
        noise_level=releases[0].noise.level,
        channel=name,
        ring_downs=tuple(ring_downs),
        time=tuple(start + release.blocks.centres for start, release in zip(starts, releases, strict=True)),
        measured=tuple(release.blocks.means for release in releases),
        fitted=tuple(fitted),
        status=status,
        notes=notes,
        history=(*history, step),
        motions=motions,
    )


def _left_out(ring_downs: list[RingDown]) -> list[str]:
    """What of the releases is not fitted, in words."""
    cut = any(CLIPPED in ring_down.marks or not ring_down.sound.all() for ring_down in ring_downs)
    lost = any(LOST in ring_down.marks for ring_down in ring_downs)
    return [doubt for doubt, applies in ((CLIPPED, cut), (LOST, lost)) if applies]


def _seen_beside(choices: list[Choice]) -> list[str]:
    """Of the first release that shows another motion than viscous and dry friction, which one, in words."""
    return [doubt for choice in choices if (doubt := choice.seen_beside(*ALWAYS))][:1]


def _misfit(releases: list[Release], fitted: list[Array]) -> tuple[Doubt, ...]:
    """Doubt where the residual is much more than the record's own noise from block to block."""
    worst = 0.0
    for release, values in zip(releases, fitted, strict=True):
        residual = release.blocks.means - values
        counted = release.noise.level if release.noise.kind == "quantised" else 0.0
        floor = max(float(roughness(release.blocks.means)), counted, 1e-12 * float(np.ptp(values)))
        if release.blocks.order < 2:
            worst = max(worst, math.sqrt(float(residual @ residual) / release.blocks.freedom) / floor)
    if worst <= UNLIKE:
        return ()
    doubt = f"the residual is {worst:.2g} times the noise: drift, or another motion (see choose_motion)"
    return (Doubt(doubt, LEFT_OVER),)


def _static(ring_downs: list[RingDown], releases: list[Release], motion: _Motion, doubts: Status) -> Estimate:
    """Static friction lies between where the mass stayed and where it last turned, in every release."""
    low, high, rested = 0.0, math.inf, False
    for number, (ring_down, release) in enumerate(zip(ring_downs, releases, strict=True)):
        stayed, turned = [], []
        for (half_cycles, share), motions in zip(motion.candidates, motion.motions, strict=True):
            if share < DOUBTED:
                continue
            p, n = motions[number], half_cycles[number]
            swing, end = last_swing(p, n)
            half = math.pi / (p[0] * math.sqrt(1 - p[1] ** 2))
            # a velocity or an acceleration is cut where it ends: whether it rests there, its tail has told
            ended = release.blocks.order > 0 and ring_down.stopped
            rests = ended or p[5] + n * half < (release.blocks.total - 1) * release.blocks.dt
            level = release.noise.level / p[0] ** release.blocks.order  # as a displacement
            error = 3 * level / math.sqrt(max(1.0, half / release.blocks.dt))
            stayed.append(max(abs(float(end)) - error, 0.0) if rests else 0.0)
            turned.append(float(swing + p[2]) + error)
            rested |= rests
        low, high = max(low, min(stayed)), min(high, max(*turned, 0.0))
    status = "" if rested else NO_REST
    if low > high:
        low, high, status = high, low, "the releases disagree on it: it changes, or the model does not hold"
    return static_in(low, high, "rad" if ring_downs[0].channel == "theta" else "m", Status(status, doubts))
