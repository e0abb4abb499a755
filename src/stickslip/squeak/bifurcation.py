"""How a vibration begins as a parameter changes, and whether it ends where it began."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stickslip.drives.kinds import Belt
from stickslip.errors import ModelError
from stickslip.squeak.cycles import LimitCycle, limit_cycle, separating_cycle
from stickslip.squeak.sliding import System
from stickslip.squeak.stability import stability
from stickslip.squeak.threshold import Threshold, critical_value, numbers

Array = NDArray[np.float64]

SMALL, HALF, LARGE = 1e-3, 0.5, 1.5  # `push`: mostly, close to the threshold, and where no small one lasts
LEAST = 3  # values of a parameter
UNTOLD = "cannot be told"
NEARBY = (1e-3, 1e-2)  # of the range: how far from the threshold the kind of the bifurcation is looked at
ROOT, JUMP = (0.35, 0.65), 0.2  # powers of the distance: an amplitude that starts like a root, and one that jumps


@dataclass(frozen=True, eq=False)
class CycleBranches:
    """Limit cycles over a parameter, followed up and down.

    Attributes
    ----------
    values : ndarray (K,)
        Of the parameter, rising.
    up, down : tuple of LimitCycle
        At each value, in the order of the values: each started from the motion at the value before, going up and going
        down, and from a small vibration where that had died away.
    threshold : Threshold or None
        Where steady sliding ceases to be stable; None where it does not.
    kind : str
        "supercritical" (the vibration ends where it began), "subcritical" (it lasts beside stable sliding too),
        "cannot be told".
    exponent : float
        Power of the distance from the threshold with which the amplitude starts: 1/2 for a smooth law, 0 where it
        jumps; nan where unknown.
    both : tuple of float or None
        Lowest and highest value at which vibration and stable sliding were both found.
    evidence : str
        Why it is called so.
    between : tuple of LimitCycle or None
        At each value the unstable cycle that separates the vibration from stable sliding: None where not both last, or
        where nothing but whether a contact just sticks or lifts separates them.
    """

    values: Array
    up: tuple[LimitCycle, ...]
    down: tuple[LimitCycle, ...]
    threshold: Threshold | None
    kind: str
    exponent: float
    both: tuple[float, float] | None
    evidence: str
    between: tuple[LimitCycle | None, ...]

    def amplitudes(self, direction: str = "up") -> Array:
        """Of the contact that slides to and fro most [m], (K,).

        Parameters
        ----------
        direction : {"up", "down", "between"}
            Of which way, or of the unstable cycles between: nan where there is none.

        Returns
        -------
        ndarray
        """
        if direction == "between":
            return np.array([math.nan if cycle is None else cycle.amplitude for cycle in self.between])
        return np.array([cycle.amplitude for cycle in (self.up if direction == "up" else self.down)])

    def __repr__(self) -> str:
        return f"CycleBranches({self.values[0]:g} to {self.values[-1]:g}): {self.kind}; {self.evidence}"


def limit_cycles(
    system: System,
    parameter: str | Callable[[float], System],
    *,
    values: ArrayLike,
    speed: float | None = None,
) -> CycleBranches:
    """How does the vibration begin as a parameter changes, and does it end where it began?

    The motion is followed up and down, each time from the one at the value before; where steady sliding is stable and a
    vibration lasts all the same, the bifurcation is subcritical. Where no small vibration lasts, going down begins with
    one that lifts or stops a contact. Close to the threshold it is looked at anew:
    at a thousandth and a hundredth of the range on either side of it.

    Parameters
    ----------
    system : Structure or Oscillator
        What slides.
    parameter : str or callable
        As in :func:`critical_value`.
    values : array_like
        Values of the parameter (K,), rising, at least three.
    speed : float, optional
        As in :func:`limit_cycle`.

    Returns
    -------
    CycleBranches

    Raises
    ------
    ModelError
        Values that do not rise, or as in :func:`limit_cycle`.

    Examples
    --------
    Friction that is larger at rest: a mass that sticks and slips goes on so at speeds at which it may slide as well.

    >>> from stickslip import Oscillator

    >>> from stickslip.drives import Belt

    >>> from stickslip.laws import Coulomb
    >>> block = Oscillator(1.0, 1.0, Coulomb(1.0, static=1.5), Belt(0.5), damping=0.1)
    >>> found = limit_cycles(block, "drive.speed", values=[0.3, 0.4, 0.5, 0.6])
    >>> {one.status for one in found.up}, [one.status for one in found.down], found.both
    ({'steady sliding'}, ['periodic', 'periodic', 'periodic', 'steady sliding'], (0.3, 0.5))
    """
    places = numbers("values", values)
    if places.ndim != 1 or len(places) < LEAST or np.any(np.diff(places) <= 0):
        few = places.ndim != 1 or len(places) < LEAST
        step = "give a row of them, as from np.linspace" if few else "sort them, and leave out what is there twice"
        raise ModelError(f"values = {values!r}", f"they are at least {LEAST} numbers that rise", step)

    def at(value: float) -> System:
        found = parameter(value) if callable(parameter) else system.having(**{parameter: value})
        return found if speed is None else found.having(drive=Belt(speed))

    up = _along(at, places, SMALL)
    down = _along(at, places[::-1], SMALL if any(one.vibrates for one in up) else LARGE)[::-1]
    lasting = [next(filter(_lasts_beside, two), None) for two in zip(down, up, strict=True)]
    beside = [float(v) for v, one in zip(places, lasting, strict=True) if one is not None]
    between = tuple(one and separating_cycle(at(float(v)), one) for v, one in zip(places, lasting, strict=True))
    ends, width = (float(places[0]), float(places[-1])), float(np.ptp(places))
    try:
        threshold = critical_value(at(ends[0]), at, between=ends)
    except ModelError:
        words = f"steady sliding is {'' if up[0].sliding.stable else 'un'}stable at every value"
        if beside:
            words += f"; a vibration lasts beside it from {beside[0]:.4g} to {beside[-1]:.4g}"
        both = (beside[0], beside[-1]) if beside else None
        return CycleBranches(places, up, down, None, UNTOLD, math.nan, both, words, between)
    return CycleBranches(places, up, down, threshold, *_called(at, threshold, beside, width), between)


def _lasts_beside(cycle: LimitCycle) -> bool:
    """Whether a vibration lasts where steady sliding is stable."""
    return cycle.sliding.stable and cycle.status in ("periodic", "not periodic")


def _along(at: Callable[[float], System], values: Array, push: float) -> tuple[LimitCycle, ...]:
    """The motions at values in turn, each from the one before where that vibrates."""
    found: list[LimitCycle] = []
    for value in values:
        found.append(_from(at(float(value)), found[-1] if found else None, push))
    return tuple(found)


def _from(system: System, before: LimitCycle | None, push: float) -> LimitCycle:
    """The limit cycle of a system, started from a motion of its neighbour: the same deviation from steady sliding."""
    if before is None or not before.vibrates:
        return limit_cycle(system, push=push)
    count = len(before.sliding.place)
    names = before.motion.table.names[: 2 * count]
    old, new = (np.append(one.place, np.zeros(count)) for one in (before.sliding, stability(system)))
    state = before.motion.states[0, : 2 * count] - old + new
    return limit_cycle(system, start=dict(zip(names, map(float, state), strict=True)))


def _called(
    at: Callable[[float], System], threshold: Threshold, beside: Sequence[float], width: float
) -> tuple[str, float, tuple[float, float] | None, str]:
    """Kind, exponent, range of both, and evidence: what lasts close to the threshold, beyond it and on the way back."""
    ahead = width if threshold.stable_below else -width
    beyond = [limit_cycle(at(threshold.value + share * ahead), push=HALF) for share in NEARBY]
    before = [threshold.value - share * ahead for share in NEARBY]
    back: list[LimitCycle] = []
    for value in before:
        back.append(_from(at(value), back[-1] if back else beyond[0], LARGE))
    near, far = (one.amplitude for one in beyond)
    exponent = math.log(far / near) / math.log(NEARBY[1] / NEARBY[0]) if near and far else math.nan
    begins = _begins(exponent, beyond[0])
    both = sorted([*beside, *(value for value, one in zip(before, back, strict=True) if _lasts_beside(one))])
    if both:
        words = f"{begins}; a vibration lasts beside stable sliding from {both[0]:.4g} to {both[-1]:.4g}"
        return "subcritical", exponent, (both[0], both[-1]), words
    if back[0].status == "steady sliding" and all(one.vibrates for one in beyond):
        words = f"{begins}; on the way back it has died away {abs(before[0] - threshold.value):.2g} past the threshold"
        return "supercritical", exponent, None, words
    return UNTOLD, exponent, None, f"{beyond[0].status} beyond the threshold, {back[0].status} before it"


def _begins(exponent: float, cycle: LimitCycle) -> str:
    """How the amplitude begins, in words."""
    if ROOT[0] < exponent < ROOT[1]:
        return f"the amplitude grows with the power {exponent:.2f} of the distance from the threshold"
    if abs(exponent) < JUMP:
        limit = "a contact lifts off" if any(cycle.separation_share) else "a contact sticks"
        bounded = any(cycle.separation_share + cycle.stick_share)
        return f"the amplitude jumps to {cycle.amplitude:.3g} m" + f": the motion grows until {limit}" * bounded
    return f"close to the threshold the amplitude changes with the power {exponent:.2f} of the distance"
