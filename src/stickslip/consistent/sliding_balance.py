"""Steady sliding under a harmonic drive, in closed form: what a stated motion needs, and when it can not go on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POINTS = 1024  # of a period
ROUNDS = 400
ENOUGH = 1e-9  # of the amplitude: where the harmonics no longer change
RELAXED = 0.3  # share of a round's change that is taken
APART = 1e-6  # of resonance, where Den Hartog's V is infinite


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

    def _impedance(self, order: int | NDArray[np.intp]) -> NDArray[np.complex128]:
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
