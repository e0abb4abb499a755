"""The balance of torques of a joint as columns over the instants at which it slides, and an instrument for each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import away_from, stretches
from stickslip.errors import EstimateError
from stickslip.signals.derivatives import differentiate, five_point_difference
from stickslip.signals.noise import quantisation_step

Array = NDArray[np.float64]

SHARE = (
    0.08  # of a stroke's length, that the window has on either side: with 0.15 the accelerations of an axis fall out
)
SHORTEST = 4  # samples of the window on either side
REACH = 2  # samples that a difference adds to it
NOISY = 4.0  # deviations of the velocity's noise, below which it may be at rest
SLOW = 0.05  # of its fast speed (90 %): slower, static friction that falls with the speed would be taken for Coulomb's
APART = 4  # rows in the window's half: nearer ones tell the same


@dataclass(frozen=True)
class Window:
    """A smoothing window of compact support, so that nothing beyond a stroke enters what is told within it.

    The kernel is ``(1 - (t/T)^2)^4``: the balance is weighed by functions that vanish with three derivatives at their
    ends (the modulating functions of Shinbrot, 1957), so that derivatives fall on the window and not on the noise.

    Attributes
    ----------
    half : int
        Samples on either side.
    fs : float
        Sampling rate [Hz].
    """

    half: int
    fs: float

    @cached_property
    def weights(self) -> Array:
        """The kernel, of sum one."""
        shape = (1 - (np.arange(-self.half, self.half + 1) / (self.half + 1)) ** 2) ** 4
        return np.asarray(shape / shape.sum())

    def apply(self, values: Array, order: int = 0) -> Array:
        """The derivative of that order, smoothed."""
        from scipy.signal import fftconvolve

        return np.asarray(fftconvolve(five_point_difference(values, order) * self.fs**order, self.weights, mode="same"))

    @cached_property
    def noise_of_acceleration(self) -> float:
        """Standard deviation of a second derivative for white noise of unit standard deviation."""
        impulse = np.zeros(len(self.weights) + 8)
        impulse[len(impulse) // 2] = 1.0
        return float(np.linalg.norm(self.apply(impulse, 2)))


@dataclass(frozen=True)
class Sliding:
    """When a joint slides, and which way.

    Attributes
    ----------
    side : ndarray, shape (n,)
        1 forward, -1 back, 0 at rest or too slow to be told from it.
    window : Window
        As wide as its strokes allow.
    rows : ndarray of int
        Instants whose window lies within one stroke.
    slowest : float
        Speed below which it may be at rest.
    """

    side: Array
    window: Window
    rows: NDArray[np.intp]
    slowest: float


def sliding(position: Array, fs: float) -> Sliding:
    """When does a joint surely slide?

    Where its speed is above four deviations of its noise, a twentieth of its fast speed, and one encoder count in half
    a window: slower, the error of the counts is a slope and no noise.
    """
    velocity = differentiate(position, fs)
    speed = np.abs(velocity.values)
    slowest = max(NOISY * float(np.median(velocity.sd)), SLOW * float(np.quantile(speed, 0.9)))
    begins, ends = stretches(speed > slowest)
    lengths = ends - begins
    if not len(lengths):
        raise EstimateError(
            "the joint never moves faster than its encoder's noise", "friction is told from sliding", "move it farther"
        )
    half = max(SHORTEST, int(SHARE * float(lengths @ lengths) / float(lengths.sum())))
    slowest = max(slowest, quantisation_step(position) * fs / half)
    side = np.where(speed > slowest, np.sign(velocity.values), 0.0)
    broken = (side == 0) | np.append(False, np.diff(side) != 0)
    within = away_from(broken, half + REACH)
    within[: half + REACH] = within[len(side) - half - REACH :] = False
    return Sliding(side, Window(half, fs), np.flatnonzero(within)[:: max(1, half // APART)], slowest)


@dataclass(frozen=True)
class Log:
    """What a joint's log tells, as it enters the balance.

    Attributes
    ----------
    position : ndarray, shape (n,)
        Of the joint.
    reference : ndarray or None
        What its controller was told, which knows nothing of the encoder's noise.
    sliding : Sliding
        When it slides.
    """

    position: Array
    reference: Array | None
    sliding: Sliding

    def columns(
        self, terms: tuple[str, ...], load: float, pull: tuple[float, float], *, steered: bool = False
    ) -> Array:
        r"""The balance's columns at the rows.

        Of :math:`\tau = J \ddot q + F_v \dot q + F_u |\dot q| \pm F_c + g_s \sin q + g_c \cos q +
        \mathrm{sgn}(\dot q) \mu |g| - k_d \dot e`, linear about a load part `load` and gravity's torque `pull`.

        Parameters
        ----------
        terms : tuple of str
            Of inertia, viscous, uneven, forward, back, coulomb (both alike), sine, cosine, load, damping.
        load : float
            The load part about which gravity's columns are linear.
        pull : (float, float)
            Gravity's sine and cosine part.
        steered : bool
            From the reference in place of the position: the instruments.
        """
        position = self.reference if steered and self.reference is not None else self.position
        side, window = self.sliding.side, self.sliding.window
        carried = pull[0] * np.sin(position) + pull[1] * np.cos(position)
        stronger = 1 + load * side * np.sign(carried)
        made = {
            "inertia": lambda: window.apply(position, 2),
            "viscous": lambda: window.apply(position, 1),
            "uneven": lambda: window.apply(side * five_point_difference(position, 1) * window.fs),
            "forward": lambda: window.apply(np.maximum(side, 0.0)),
            "back": lambda: window.apply(np.minimum(side, 0.0)),
            "coulomb": lambda: window.apply(side),
            "sine": lambda: window.apply(np.sin(position) * stronger),
            "cosine": lambda: window.apply(np.cos(position) * stronger),
            "load": lambda: window.apply(side * np.abs(carried)),
            "damping": lambda: self._error_rate(steered),
        }
        return np.column_stack([made[term]()[self.sliding.rows] for term in terms])

    def _error_rate(self, steered: bool) -> Array:
        """How the error of the position changes; its instrument is what inertia makes of the reference."""
        window, fs = self.sliding.window, self.sliding.window.fs
        if self.reference is None:
            raise EstimateError("no channel reference", "a controller follows one", "name the column of the reference")
        if steered:
            return window.apply(five_point_difference(self.reference, 1) * fs, 2)
        return window.apply(self.position - self.reference, 1)
