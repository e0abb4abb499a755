"""Steady sliding under a harmonic drive, in closed form: what a stated motion needs, and when it can not go on.

Numbers as they stand in a table: can they all be true of one steady sliding motion?
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array, Complex, Rows
from stickslip.consistent.checks import HOLDS, UNTOLD, Check, compared, untold
from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import Constant, Estimate
from stickslip.units import parse_uncertain

POINTS = 1024  # of a period
ROUNDS = 400
ENOUGH = 1e-9  # of the amplitude: where the harmonics no longer change
RELAXED = 0.3  # share of a round's change that is taken
APART = 1e-6  # of resonance, where Den Hartog's V is infinite

UNITS = {
    "mass": "kg",
    "stiffness": "N/m",
    "damping": "N s/m",
    "forcing frequency": "Hz",
    "base amplitude": "m",
    "amplitude": "m",
    "sliding friction": "N",
    "contact stiffness": "N/m",
    "transition speed": "m/s",
}
NEEDED = ("mass", "stiffness", "forcing frequency", "base amplitude", "amplitude", "sliding friction")
EXACT = ("forcing frequency",)  # not measured by a calibrated sensor
Values = Mapping[str, float]
Stated = Mapping[str, Constant]


def sliding_boundary(ratio: ArrayLike, *, damping_ratio: float = 0.0) -> Array:
    r"""Friction over the drive's force up to which a rigid contact slides without a stop.

    Den Hartog's boundary of 1931, with Shaw's damper (1986): :math:`r_b = V / \sqrt{H^2 + (S + G)^2}`.

    Parameters
    ----------
    ratio : array_like, shape (n,)
        Forcing frequency over the natural one.
    damping_ratio : float
        Of the damper, over the critical one.

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> sliding_boundary([1.0]).round(4)  # pi/4 at resonance
    array([0.7854])
    """
    return np.array([Slider(1.0, 1.0, float(b), 2 * damping_ratio).boundary() for b in np.atleast_1d(ratio)])


@dataclass(frozen=True)
class Slider:
    """A mass that slides without stops, all in SI; `angular` is the forcing frequency [rad/s].

    A `contact` of infinite stiffness is rigid.
    """

    mass: float
    stiffness: float
    angular: float
    damping: float = 0.0
    contact: float = math.inf

    def loss(self, amplitude: float, friction: float) -> float:
        """What friction and damper take from a cycle [J] of harmonic motion."""
        slid = max(0.0, amplitude - friction / self.contact)
        return 4 * friction * slid + math.pi * self.damping * self.angular * amplitude**2

    def drive(self, amplitude: float, friction: float) -> float:
        r"""Amplitude [N] of the harmonic force that keeps up a sliding motion of this amplitude [m].

        With a rigid contact Den Hartog's, :math:`P V = \sqrt{(k X + G F)^2 + (H F)^2}`. With an elastic one the
        friction turns round at :math:`t = 0`, where :math:`x = X`, :math:`\dot x = 0`, and follows the contact,
        :math:`F - K (X - x)`, until it has; its harmonics move the mass by
        :math:`x_n = -F_n / (k - m n^2 w^2 + i c n w)`, and both conditions at the turn leave one fundamental.
        """
        if math.isinf(self.contact):
            gain, lag, lead = self._den_hartog()[:3]
            return math.hypot(self.stiffness * amplitude + lead * friction, lag * friction) / gain
        order = np.arange(3, POINTS // 4, 2)
        below = self._impedance(order)
        x = amplitude * np.cos(2 * np.pi * np.arange(POINTS) / POINTS)
        spectrum = np.zeros(POINTS // 2 + 1, dtype=complex)
        moved, felt = spectrum.copy(), spectrum
        for _ in range(ROUNDS):
            felt = 2 * np.fft.rfft(self._felt(x, amplitude, friction)) / POINTS
            step = -felt[order] / below - moved[order]
            moved[order] += RELAXED * step
            # x = X and x' = 0 at the turn
            moved[1] = amplitude - moved.real[order].sum() - 1j * (order * moved.imag[order]).sum()
            x = np.fft.irfft(moved * POINTS / 2, POINTS)
            if np.abs(step).max() < ENOUGH * amplitude:
                break
        return abs(complex(self._impedance(1) * moved[1] + felt[1]))

    def boundary(self) -> float:
        r"""Friction over drive beyond which a rigid contact stops on its way (Den Hartog 1931; Shaw 1986).

        :math:`r_b = V / \sqrt{H^2 + (S + G)^2}`; pi/4 at resonance.
        """
        gain, lag, lead, least = self._den_hartog()
        return gain / math.hypot(lag, least + lead)

    def _impedance(self, order: int | Rows) -> Complex:
        w = self.angular * np.asarray(order)
        return np.asarray(self.stiffness - self.mass * w**2 + 1j * self.damping * w)

    def _den_hartog(self) -> tuple[float, float, float, float]:
        """V, H, G and S: the motion is ``X k/P = -G r + sqrt(V^2 - H^2 r^2)``, and slides if ``X k/F > S``."""
        natural = math.sqrt(self.stiffness / self.mass)
        b, z = self.angular / natural, self.damping / (2 * math.sqrt(self.stiffness * self.mass))
        if abs(b - 1) < APART and z < APART:
            b = 1 + APART
        d, end = math.sqrt(1 - min(z, 0.999) ** 2), math.pi / b
        below = math.cosh(z * end) + math.cos(d * end)
        lead = (math.sinh(z * end) - z / d * math.sin(d * end)) / below
        lag = math.sin(d * end) / (d * b * below)
        gain = 1 / math.hypot(1 - b * b, 2 * z * b)
        # x' = - X b sin bt + F q(t) over the half cycle from x = X, in units of k and the natural frequency
        poles = np.array([complex(-z, d), complex(-z, -d)])
        turns = np.stack([1 + np.exp(poles * end), poles * (1 + np.exp(poles * end))])
        shares = np.linalg.solve(turns, np.array([-2.0, 0.0]))
        at = end * np.concatenate([np.geomspace(1e-5, 1e-2, 50), np.linspace(0.01, 1 - 1e-5, 4000)])
        rate = (np.exp(np.outer(at, poles)) @ (shares * poles)).real
        start, speed = float(shares.sum().real), float((shares * poles).sum().real)
        q = b * (1 + start) * np.sin(b * at) - speed * np.cos(b * at) + rate
        return gain, lag, lead, float(np.max(q / (b * np.sin(b * at))))

    def _felt(self, x: Array, amplitude: float, friction: float) -> Array:
        """The friction over a period: the contact lets go once it has turned round."""
        back = np.minimum.accumulate(friction - self.contact * (amplitude - x[: len(x) // 2]))
        back = np.maximum(back, -friction)
        return np.concatenate([back, -back])


@dataclass(frozen=True)
class _Number:
    value: float
    sd: float


def stated_checks(stated: Stated, tolerance: float) -> list[Check]:
    """Whether stated numbers of a steady sliding motion fit each other."""
    unknown = [name for name in stated if name not in UNITS]
    if unknown:
        raise ModelError(f"'{unknown[0]}'", f"a stated value is one of {', '.join(UNITS)}", "correct the name")
    missing = [name for name in NEEDED if name not in stated]
    if missing:
        raise EstimateError(
            f"no {', '.join(missing)}", f"a motion is checked by {', '.join(NEEDED)} at least", "state them too"
        )
    numbers = {name: _number(name, value, tolerance) for name, value in stated.items()}
    return [_energy(numbers), _friction(numbers), _boundary(numbers), _transition(numbers)]


def _number(name: str, value: Constant, tolerance: float) -> _Number:
    """Value and deviation: as stated, or the rounding of a text's last digit and the tolerance of what is measured."""
    unit = UNITS[name]
    if isinstance(value, Estimate):
        return _checked(name, value.value, value.sd)
    (number, sd), rounding = parse_uncertain(value, unit), 0.0
    if sd or isinstance(value, tuple):
        return _checked(name, number, sd)
    if isinstance(value, str) and (digits := re.match(r"\s*[-+]?\d*\.?(\d*)", value)):
        scale, _ = parse_uncertain(re.sub(r"^\s*[-+]?[\d.]+(?:[eE][-+]?\d+)?", "1", value), unit)
        exponent = re.match(r"\s*[-+]?[\d.]+[eE]([-+]?\d+)", value)
        rounding = scale * 10.0 ** (-len(digits[1]) + int(exponent[1] if exponent else 0)) / math.sqrt(12)
    measured = 0.0 if name in EXACT else tolerance * abs(number)
    return _checked(name, number, math.hypot(rounding, measured))


def _checked(name: str, value: float, sd: float) -> _Number:
    if not (math.isfinite(value) and math.isfinite(sd) and sd >= 0) or value < 0 or (name in NEEDED and value == 0):
        raise ModelError(f"{name} = {value} +- {sd}", f"a {name} is positive", "correct it")
    return _Number(value, sd)


def _sd(of: Callable[[Values], float], numbers: Mapping[str, _Number]) -> float:
    """Deviation of what follows from the numbers, each moved by its own."""
    centre = {name: number.value for name, number in numbers.items()}
    moved = [
        (of({**centre, name: number.value + number.sd}) - of({**centre, name: number.value - number.sd})) / 2
        for name, number in numbers.items()
        if number.sd > 0
    ]
    return float(np.linalg.norm([number for number in moved if math.isfinite(number)])) if moved else 0.0


def _slider(values: Values) -> Slider:
    return Slider(
        values["mass"],
        values["stiffness"],
        2 * math.pi * values["forcing frequency"],
        values.get("damping", 0.0),
        values.get("contact stiffness", math.inf),
    )


def _centre(numbers: Mapping[str, _Number]) -> dict[str, float]:
    return {name: number.value for name, number in numbers.items()}


def _energy(numbers: Mapping[str, _Number]) -> Check:
    r"""Friction can not take more than the base gives: :math:`4 F (X - F/K) + \pi c w X^2 \le \pi k Z X`."""

    def loss(v: Values) -> float:
        return _slider(v).loss(v["amplitude"], v["sliding friction"])

    def given(v: Values) -> float:
        return math.pi * v["stiffness"] * v["base amplitude"] * v["amplitude"]

    at = _centre(numbers)
    most = math.pi * at["stiffness"] * at["base amplitude"] / 4
    return compared(
        "energy",
        loss(at),
        given(at),
        sd=_sd(lambda v: loss(v) - given(v), numbers),
        unit="J",
        bound=True,
        holds="friction takes no more from a cycle than the base can give",
        fails=f"friction takes more from a cycle than the base can give at any phase: against {most:.3g} N or more "
        "(pi k Z / 4) it can not slide on",
    )


def _friction(numbers: Mapping[str, _Number]) -> Check:
    """The friction under which this base keeps up this amplitude."""
    at = _centre(numbers)
    needed = _needed(at)
    name = "friction that base and amplitude ask for"
    if not math.isfinite(needed):
        return compared(
            name,
            at["sliding friction"],
            0.0,
            sd=numbers["sliding friction"].sd or at["sliding friction"] * 1e-3,
            unit="N",
            holds="none",
            fails="no friction keeps this amplitude so small, or allows one so large",
        )
    sd = math.hypot(_needed_sd(needed, numbers), numbers["sliding friction"].sd)
    share = at["sliding friction"] / needed - 1
    contact = "an elastic" if "contact stiffness" in at else "a rigid"
    return compared(
        name,
        at["sliding friction"],
        needed,
        sd=sd,
        unit="N",
        holds=f"the stated friction keeps up the stated motion on {contact} contact",
        fails=f"friction, base amplitude and amplitude can not all be true: on {contact} contact this motion needs "
        f"{needed:.3g} N, and {abs(100 * share):.0f} % {'more' if share > 0 else 'less'} is stated",
    )


def _short(values: Values) -> float:
    """What the drive that the motion needs is above the one that the base gives [N]."""
    given = values["stiffness"] * values["base amplitude"]
    return _slider(values).drive(values["amplitude"], values["sliding friction"]) - given


def _needed(values: Values) -> float:
    from scipy.optimize import brentq

    def short(friction: float) -> float:
        return _short({**values, "sliding friction": friction})

    grid = np.linspace(0.0, 1.2 * values["stiffness"] * values["base amplitude"], 13)
    over = [short(float(number)) for number in grid]
    rising = [j for j in range(len(grid) - 1) if over[j] * over[j + 1] <= 0]
    if not rising:
        return math.nan
    near = min(rising, key=lambda j: abs(grid[j] - values["sliding friction"]))
    return float(brentq(short, grid[near], grid[near + 1], xtol=1e-6 * grid[-1]))


def _needed_sd(needed: float, numbers: Mapping[str, _Number]) -> float:
    """Deviation of the friction needed, from that of everything else."""
    there = {**numbers, "sliding friction": _Number(needed, 0.0)}
    step = 1e-3 * needed or 1e-9
    slopes = [_short({**_centre(there), "sliding friction": needed + sign * step}) for sign in (-1, 1)]
    slope = (slopes[1] - slopes[0]) / (2 * step)
    return _sd(_short, there) / abs(slope) if slope else math.inf


def _boundary(numbers: Mapping[str, _Number]) -> Check:
    """Den Hartog's boundary of sliding without stops."""

    def share(v: Values) -> float:
        return v["sliding friction"] / (v["stiffness"] * v["base amplitude"])

    def least(v: Values) -> float:
        return _slider({**v, "contact stiffness": math.inf}).boundary()

    at = _centre(numbers)
    check = compared(
        "sliding without stops",
        share(at),
        least(at),
        sd=_sd(lambda v: share(v) - least(v), numbers),
        unit="1",
        bound=True,
        holds="a rigid contact slides without stops (Den Hartog)",
        fails="a rigid contact stops on its way (Den Hartog): this is no motion of sliding alone",
    )
    elastic = "contact stiffness" in at and share(at) < math.pi / 4
    if check.verdict != HOLDS and elastic:
        sentence = "a rigid contact would stop on its way (Den Hartog); an elastic one may slide on"
        return Check(check.name, check.left, check.right, "1", check.discrepancy, UNTOLD, sentence)
    return check


def _transition(numbers: Mapping[str, _Number]) -> Check:
    r"""Thesis, equation (3.4): :math:`V_s = 2 w \sqrt{X r - r^2}`, r = F/K."""
    name = "transition speed"
    if not {"contact stiffness", "transition speed"} <= set(numbers):
        return untold(name, "no contact stiffness or no transition speed is stated")

    def follows(v: Values) -> float:
        r = v["sliding friction"] / v["contact stiffness"]
        return 4 * math.pi * v["forcing frequency"] * math.sqrt(max(0.0, v["amplitude"] * r - r * r))

    at = _centre(numbers)
    return compared(
        name,
        at["transition speed"],
        follows(at),
        sd=_sd(lambda v: v["transition speed"] - follows(v), numbers),
        unit="m/s",
        holds="it is what friction, amplitude and contact stiffness say (thesis, 3.4)",
        fails="it is not what friction, amplitude and contact stiffness say (thesis, 3.4)",
    )


def what_fails(checks: Sequence[Check]) -> str:
    """ "ok", or the sentences of what fails."""
    failed = [f"{check.name}: {check.sentence}" for check in checks if check.verdict == "fails"]
    return f"not all can be true: {'; '.join(failed)}" if failed else "ok"
