"""When a joint surely slides, the windows within its strokes by which its torque is weighed, and its columns."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from stickslip.arrays import Array, Mask, Rows, stretches
from stickslip.balance.motion import away_from
from stickslip.errors import EstimateError
from stickslip.signals.derivatives import convolved, differentiate, five_point_difference, smooth
from stickslip.signals.interpolate import band_limited
from stickslip.signals.noise import noise_level, quantisation_step
from stickslip.statistics import BINS

# of a stroke's length, that the window has on either side: with 0.15 the accelerations of an axis fall out
SHARE = 0.08
SHORTEST = 4  # samples of the window on either side
REACH = 2  # samples that a difference adds to it
NOISY = 4.0  # deviations of the velocity's noise, below which it may be at rest
SLOW = 0.05  # of its fast speed (90 %): slower, static friction that falls with the speed would be taken for Coulomb's
SLOWER = 0.02  # where that fall is asked for
NARROW = 0.3  # of the window, near the ends of strokes
GRAVITY = ("sine", "cosine", "load")  # terms whose columns are made about a load part and gravity's torque
DERIVATIVES = ("inertia", "viscous", "uneven")  # terms in which the counts of an encoder are noise
# Terms of a torque of so many periods along the way; the last two as it grows along it, or is of a little more periods.
COGS = ("cogging, sine", "cogging, cosine", "growing, sine", "growing, cosine")
TOGETHER = 0.995  # correlation of motor and link: an encoder that wraps, or the motor of another joint, has less
DRAWS = 4  # of an encoder's errors
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
        rough = five_point_difference(values, order) * self.fs**order
        return convolved(rough, self.weights)[self.half : self.half + len(values)]

    def at(self, values: Array, rows: Rows, order: int = 0) -> Array:
        """The same at some rows: no other is computed."""
        rough = five_point_difference(values, order) * self.fs**order
        windows = np.lib.stride_tricks.sliding_window_view(rough, 2 * self.half + 1)
        return np.asarray(windows[rows - self.half] @ self.weights)

    def within(self, side: Array) -> Mask:
        """Where it lies within one stroke."""
        broken = (side == 0) | np.append(False, np.diff(side) != 0)
        within = away_from(broken, self.half + REACH)
        within[: self.half + REACH] = within[len(side) - self.half - REACH :] = False
        return within

    def noise_of_derivative(self, order: int) -> float:
        """Standard deviation of a derivative for white noise of unit standard deviation."""
        impulse = np.zeros(len(self.weights) + 8)
        impulse[len(impulse) // 2] = 1.0
        return float(np.linalg.norm(self.apply(impulse, order)))


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
    near : ndarray of bool or None
        Rows near the ends of strokes, of a narrower window: there it slides slowly.
    narrow : Window or None
        Theirs.
    """

    side: Array
    window: Window
    rows: Rows
    slowest: float
    near: Mask | None = None
    narrow: Window | None = None

    @cached_property
    def weights(self) -> Array:
        """By which each row counts: a narrower window leaves more of the noise."""
        if self.near is None or self.narrow is None:
            return np.ones(len(self.rows))
        return np.where(self.near, math.sqrt(self.narrow.half / self.window.half), 1.0)

    def at(self, values: Array, order: int = 0) -> Array:
        """The derivative of that order at the rows, smoothed and weighed: no other row is computed."""
        if self.near is None or self.narrow is None:
            return self.window.at(values, self.rows, order)
        smoothed = np.empty(len(self.rows))
        smoothed[~self.near] = self.window.at(values, self.rows[~self.near], order)
        smoothed[self.near] = self.narrow.at(values, self.rows[self.near], order)
        return smoothed * self.weights


class Teeth(NamedTuple):
    """How a motor stands against its link, whose teeth have play.

    Attributes
    ----------
    lead : ndarray, shape (n,)
        By how much the motor is ahead: half of the play, to the side on which the teeth carry.
    carry : ndarray of bool
        Where they surely do.
    unsure : ndarray
        Standard deviation of gravity's torque, by that of the play.
    """

    lead: Array
    carry: Mask
    unsure: Array


def seated(position: Array, least: Array, most: Array, play: float) -> tuple[Array, Mask]:
    """On which side teeth carry, and where they surely do, by the bounds of their torque.

    Where it changes its sign the motor crosses the play, while the link may stay: until it has gone by all of it.
    """
    sure = np.where(np.minimum(least, most) > 0, 1.0, np.where(np.maximum(least, most) < 0, -1.0, 0.0))
    side, carry = np.zeros(len(position)), np.zeros(len(position), dtype=bool)
    last, begin, crosses = 0.0, float(position[0]), True
    for row, (place, now) in enumerate(zip(position, sure, strict=True)):
        if now not in (0.0, last):
            last, begin, crosses = now, float(place), True
        if crosses:
            begin = min(begin, place) if last > 0 else max(begin, place)
            crosses = last * (place - begin) < play
        side[row], carry[row] = last, not crosses and now == last
    return side, carry


def sliding(position: Array, fs: float, *, slowly: bool = False, carry: Mask | None = None) -> Sliding:
    """When does a joint surely slide, and where `carry` tells so, with its teeth seated?

    Where its speed is above four deviations of its noise, a twentieth of its fast speed, and one encoder count in half
    a window: slower, the error of the counts is a slope and no noise. With `slowly` the ends of strokes are seen too,
    by narrower windows.
    """
    velocity = differentiate(position, fs)
    speed, fast = np.abs(velocity.values), SLOWER if slowly else SLOW
    slowest = max(NOISY * float(np.median(velocity.sd)), fast * float(np.quantile(speed, 0.9)))
    begins, ends = stretches(speed > slowest)
    lengths = ends - begins
    if not len(lengths):
        raise EstimateError(
            "the joint never moves faster than its encoder's noise", "friction is told from sliding", "move it farther"
        )
    window = Window(max(SHORTEST, int(SHARE * float(lengths @ lengths) / float(lengths.sum()))), fs)
    count = quantisation_step(position) * fs
    side = np.where(speed > max(slowest, count / window.half), np.sign(velocity.values), 0.0)
    if carry is not None:
        side = np.where(carry, side, 0.0)
    slides = Sliding(side, window, _apart(window.within(side), window), max(slowest, count / window.half))
    if not slowly:
        return slides
    narrow = Window(max(SHORTEST, round(NARROW * window.half)), fs)
    slow = narrow.within(np.where(speed > max(slowest, count / narrow.half), side, 0.0)) & ~window.within(side)
    rows = np.concatenate([slides.rows, _apart(slow, narrow)])
    order, near = np.argsort(rows, kind="stable"), np.arange(len(rows)) >= len(slides.rows)
    return replace(slides, rows=rows[order], near=near[order], narrow=narrow)


def encoder_errors(position: Array, fs: float) -> list[Array]:
    """What an encoder's counts and noise may have made of its position, drawn a few times.

    The counts of a slow motion are no white noise: they are made again, of the smoothed motion, from other zeros. What
    is noisier than these alone has white noise beside.
    """
    count, place, chance = quantisation_step(position), smooth(position, fs).values, np.random.default_rng(0)
    power = noise_level(position, fs) ** 2
    errors = []
    for zero in (np.arange(DRAWS) + 0.5) / DRAWS * count:
        counted = np.round((place + zero) / count) * count - zero if count else place
        beside = max(power - noise_level(counted, fs) ** 2, 0.0)
        errors.append(counted - place + math.sqrt(beside) * chance.standard_normal(len(place)))
    return errors


def _apart(within: Mask, window: Window) -> Rows:
    """Rows that tell something of their own."""
    return np.flatnonzero(within)[:: max(1, window.half // APART)]


def places(place: Array) -> Rows:
    """Which of `BINS` along the way each row is at."""
    reach = float(np.ptp(place))
    along = (place - place.min()) * (BINS / reach if reach else 0.0)
    return np.asarray(np.minimum(along, BINS - 1), dtype=np.intp)


@dataclass(frozen=True)
class Log:
    """What a joint's log tells, as it enters the balance.

    Attributes
    ----------
    position : ndarray, shape (n,)
        Of the joint, behind its gear.
    reference : ndarray or None
        What its controller was told, which knows nothing of the encoder's noise.
    sliding : Sliding
        When it slides.
    lead : ndarray
        By how much the motor is ahead of the link; zeros where one encoder tells of both.
    temperature : ndarray or None
        Of the joint [K], where it was logged.
    about : float
        Temperature at which the friction is told [K].
    torque : ndarray or None
        As it was measured, or as a controller makes it of its error.
    error : ndarray or None
        Of a controller whose torque is not measured: how far the position is from the reference.
    cogs : (float, float)
        Periods in a radian of a torque that a motor's teeth, or a gear's, make along the way, and the middle of that.
    damped : float
        By what that controller damps its error [N m s/rad], where that is regressed.
    bodies : ndarray or None
        What a robot's bodies take of the torque, where a URDF tells it.
    ahead : ndarray or float
        By how much what the encoder tells of is ahead of the link, by the play of the teeth between.
    noise : ndarray, shape (3, 3)
        ``E'E`` of the encoder's noise E in the columns of `DERIVATIVES`; none where the reference knows nothing of it.
    borne : (ndarray, ndarray) or None
        What the gear's teeth bear at the rows, by the motion and by the reference: the mean of the motor's torque and
        of gravity's, smoothed and weighed; None where friction grows with gravity's torque alone.
    """

    position: Array
    reference: Array | None
    sliding: Sliding
    lead: Array
    temperature: Array | None = None
    about: float = 0.0
    torque: Array | None = None
    error: Array | None = None
    cogs: tuple[float, float] = (0.0, 0.0)
    damped: float = 0.0
    bodies: Array | None = None
    ahead: Array | float = 0.0
    noise: Array = field(default_factory=lambda: np.zeros((len(DERIVATIVES), len(DERIVATIVES))))
    borne: tuple[Array, Array] | None = None

    @property
    def link(self) -> Array:
        """The place of the link, on which gravity acts."""
        return np.asarray(self.position - self.ahead)

    @property
    def turned(self) -> Array:
        """The motion of motor and link, half of each."""
        return np.asarray(self.position + self.lead / 2)

    def columns(
        self, terms: tuple[str, ...], load: float, pull: tuple[float, float], *, steered: bool = False
    ) -> Array:
        r"""The balance's columns at the rows.

        Of :math:`\tau = J \ddot q + F_v \dot q + F_u |\dot q| \pm F_c + g_s \sin q + g_c \cos q +
        \mathrm{sgn}(\dot q) \mu |g| - k_d \dot e + (\pm b + b_v \dot q)(T - \bar T) - d \dot\tau`,
        linear about a load part `load` and gravity's torque `pull`.

        Parameters
        ----------
        terms : tuple of str
            Of inertia, viscous, uneven, forward, back, coulomb (both alike), sine,
            cosine, load, damping, warming and thinning (Coulomb and viscous friction per kelvin), late (by how much
            the torque is), borne (friction per torque of the bodies), wound (torque per sum of a controller's
            error), and of `COGS`.
        load : float
            The load part about which gravity's columns are linear.
        pull : (float, float)
            Gravity's sine and cosine part.
        steered : bool
            From the reference in place of the position: the instruments.
        """
        position, turned = self.link, self.turned
        if steered and self.reference is not None:
            position, turned = self.reference - self.ahead, self.reference
        side, at, fs = self.sliding.side, self.sliding.at, self.sliding.window.fs
        carried = pull[0] * np.sin(position) + pull[1] * np.cos(position)
        warmer = 0.0 if self.temperature is None else self.temperature - self.about
        along = self.position - self.cogs[1]
        teeth = 2 * np.pi * self.cogs[0] * along
        stronger = 1 + load * side * np.sign(carried) if self.borne is None else 1.0
        made = {
            "inertia": lambda: at(turned, 2),
            "viscous": lambda: at(turned, 1),
            "uneven": lambda: at(side * five_point_difference(turned, 1) * fs),
            "forward": lambda: at(np.maximum(side, 0.0)),
            "back": lambda: at(np.minimum(side, 0.0)),
            "coulomb": lambda: at(side),
            "sine": lambda: at(np.sin(position) * stronger),
            "cosine": lambda: at(np.cos(position) * stronger),
            "load": lambda: at(side * np.abs(carried)) if self.borne is None else self._rubbed(steered),
            "damping": lambda: self._error_rate(steered),
            "warming": lambda: at(side * warmer),
            "thinning": lambda: at(five_point_difference(turned, 1) * fs * warmer),
            "late": lambda: self._torque_rate(steered),
            "wound": lambda: at(np.cumsum(np.zeros_like(turned) if self.error is None else self.error) / fs),
            # at its own place, of the instruments too: a reference that is ahead passes other teeth
            COGS[0]: lambda: at(np.sin(teeth)),
            COGS[1]: lambda: at(np.cos(teeth)),
            COGS[2]: lambda: at(along * np.sin(teeth)),
            COGS[3]: lambda: at(along * np.cos(teeth)),
            "borne": lambda: at(side * np.abs(np.zeros_like(position) if self.bodies is None else self.bodies)),
        }
        for term in terms:
            if term not in GRAVITY and (term, steered) not in self.kept:
                self.kept[term, steered] = made[term]()
        return np.column_stack([made[term]() if term in GRAVITY else self.kept[term, steered] for term in terms])

    @cached_property
    def kept(self) -> dict[tuple[str, bool], Array]:
        """Columns that stay the same about any load part and any gravity."""
        return {}

    def _rubbed(self, steered: bool) -> Array:
        """What the teeth bear, against the motion."""
        assert self.borne is not None
        return np.asarray(self.sliding.side[self.sliding.rows] * np.abs(self.borne[steered]))

    def _error_rate(self, steered: bool) -> Array:
        """How the error of the position changes; its instrument is what inertia makes of the reference."""
        slides = self.sliding
        if self.reference is None or self.error is None:
            raise EstimateError("no channel reference", "a controller follows one", "name the column of the reference")
        if steered:
            return slides.at(five_point_difference(self.reference, 1) * slides.window.fs, 2)
        return -slides.at(self.error, 1)

    def _torque_rate(self, steered: bool) -> Array:
        """How much more torque is told by one that comes late; its instrument is what inertia makes of the reference.

        Of a controller whose damping is regressed beside, that has what its gain makes of it in its own column.
        """
        slides = self.sliding
        if self.error is None or self.reference is None:
            return -slides.at(np.zeros_like(self.position) if self.torque is None else self.torque, 1)
        order = 2 if self.damped else 1
        if steered:
            return slides.at(five_point_difference(self.reference, order) * slides.window.fs**order, 2)
        assert self.torque is not None
        return self.damped * slides.at(self.error, 2) if self.damped else slides.at(self.torque, 1)

    def noisy(self) -> Log:
        """With the noise that its encoder makes of its columns."""
        errors = encoder_errors(self.turned, self.sliding.window.fs)
        drawn = [replace(self, position=error, lead=np.zeros_like(error)) for error in errors]
        columns = [one.columns(DERIVATIVES, 0.0, (0.0, 0.0)) for one in drawn]
        return replace(self, noise=np.mean([made.T @ made for made in columns], axis=0))

    def quiet(self) -> Log:
        """With the motion freed of its noise, beyond a stroke: that would bend a fit, but less than noise a prediction.

        Within a short window the counts of an encoder are accelerations: of 95 joints they were what the worst tenth of
        predictions missed, 17 % of the torque; without them that is 8 %.
        """
        fs = self.sliding.window.fs
        link, motor = (smooth(motion, fs).values for motion in (self.position, self.position + self.lead))
        error = None if self.error is None else smooth(self.error, fs).values
        return replace(self, position=link, lead=motor - link, error=error)

    def unshared(self, inertia: float, viscous: float) -> tuple[Array, Array]:
        """Standard deviations of the torque at the rows, as nobody knows what of these is the motor's, none to all."""
        apart = self.lead / math.sqrt(12)  # of half of it, an evenly spread share leaves that
        accelerated, moved = (self.sliding.at(apart, order) for order in (2, 1))
        return inertia * accelerated, viscous * moved


def motor_lead(link: Array, motor: Array) -> Array | None:
    """By how much a motor is ahead of its link, the gear's ratio found beside; None where they do not turn together."""
    if np.ptp(link) == 0 or np.ptp(motor) == 0 or abs(np.corrcoef(link, motor)[0, 1]) < TOGETHER:
        return None
    ratio, offset = np.polyfit(link, motor, 1)
    return np.asarray((motor - offset) / ratio - link)


def later(values: Array | None, count: float) -> Array:
    """Samples read so many of them later; beyond the ends the last one stays."""
    assert values is not None
    rows = np.arange(len(values), dtype=float) + count
    inside = (rows >= 0) & (rows <= len(rows) - 1)
    read = np.full(len(rows), values[-1])
    read[rows < 0] = values[0]
    read[inside] = band_limited(values, rows[inside])
    return read
