"""Viscous and dry friction of one pendulum's free decay, by its whole waveform with sin x for the spring."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stickslip.decay.answer import DecayFit, beginning, spring_of
from stickslip.decay.candidates import Fitted
from stickslip.decay.choice import COLOURED, Candidate, lack_of_fit
from stickslip.decay.motions import Restoring, free_decay
from stickslip.decay.release import RingDown
from stickslip.decay.which_motion import SWING, DecayMotion, choice_of, told, whichever
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate
from stickslip.record.record import Step

PLAIN = ("both", "static")
BEYOND = f"swings beyond {SWING:g} rad are left out"
SURE = 3.0  # standard deviations of the noise by which a bracket is widened


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
    choice, zero = choice_of(ring_down, restoring=restoring, candidates=PLAIN)
    chosen = choice.chosen
    later = zero > ring_down.release
    large = (BEYOND,) if later and abs(ring_down.amplitude) >= SWING else ()
    status = told(ring_down, "; ".join(filter(None, [*large, choice.seen_beside(*PLAIN) or lack_of_fit(chosen)])))
    fitted = chosen.fitted
    blocks, model = fitted.blocks, f"{fitted.motion.words}, spring sin x"
    kind = "white" if chosen.noise.whiteness >= COLOURED else "correlated"
    choices = [each.choice for each in motions]
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
        static_displacement=_static(chosen, ring_down),
        dry_force=None if spring is None else dry.scaled(spring, "N m", "dry friction"),
        damping_ratio_any=whichever(choices, damping, "damping_ratio") if choices else None,
        dry_displacement_any=whichever(choices, dry, "dry_displacement") if choices else None,
        half_cycles=(fitted.half_cycles,),
        alternatives=(((fitted.half_cycles,), 1.0),),
        model=model,
        noise=kind,
        noise_level=_level(chosen),
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
        plain = chosen.estimate(parameter, name=name, unit=unit, factor=factor)
        low, high = plain.interval
        value, interval = plain.value + offset, (low + offset, high + offset)
        return replace(plain, value=value, interval=interval, status=status, method=method, checks=checks)

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


def _level(candidate: Candidate) -> float:
    """Standard deviation of a sample."""
    fitted = candidate.fitted
    return math.sqrt(fitted.cost / max(1, len(fitted.residual) - fitted.jacobian.shape[1]))


def _static(candidate: Candidate, ring_down: RingDown) -> Estimate:
    """Static friction lies between the pull where it stayed and the pull where it last turned, sin x each."""
    fitted = candidate.fitted
    error = SURE * _level(candidate) / math.sqrt(max(1.0, ring_down.fs / ring_down.frequency / 2))
    low = max(_pull(fitted, fitted.half_cycles) - error, 0.0) if ring_down.stopped else 0.0
    high = _pull(fitted, fitted.half_cycles - 1) + error
    status = "ok" if ring_down.stopped else "the mass does not come to rest in the record: only an upper bound"
    return Estimate(
        "static friction displacement",
        (low + high) / 2,
        (low, high),
        (high - low) / math.sqrt(12),
        ring_down.unit,
        "between where it stayed and where it last turned",
        status,
    )


def _pull(fitted: Fitted, half_cycles: int) -> float:
    """Torque over the stiffness at the turning point after so many half cycles."""
    period = 2 * math.pi / fitted.value("angular_frequency")
    later = fitted.value("release") + (half_cycles + 2) * period  # a half cycle below 2.5 rad takes less
    at = free_decay([later], fitted.parameters, restoring=fitted.blocks.restoring, half_cycles=half_cycles)[0][0]
    return abs(math.sin(float(at) - fitted.value("rest")))
