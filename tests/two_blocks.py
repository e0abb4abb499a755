"""Two blocks on a belt by scipy alone: spring-coupled, each with its own static and sliding friction, unit masses.

The belt is so slow, and friction so large, that no block overtakes it: a block rests on it or slips back.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.arrays import Array


@dataclass(frozen=True)
class TwoBlocks:
    """As in Huang and Turcotte, Geophys. Res. Lett. 17 (1990), on a belt that moves."""

    coupling: float
    kinetic: tuple[float, float]
    static: tuple[float, float]
    speed: float

    @property
    def stiffness(self) -> Array:
        return np.array([[1 + self.coupling, -self.coupling], [-self.coupling, 1 + self.coupling]])

    @property
    def system(self) -> ss.Structure:
        """The same for the engine."""
        laws = [ss.laws.Coulomb(k, static=s) for k, s in zip(self.kinetic, self.static, strict=True)]
        contacts = [ss.Contact(law, row) for law, row in zip(laws, np.eye(2), strict=True)]
        drive = ss.drives.Belt(self.speed)
        return ss.Structure(np.eye(2), np.zeros((2, 2)), self.stiffness, contacts=contacts, drive=drive)

    def run(self, state: Array, slips: Array, duration: float) -> tuple[Array, Array, list[tuple[float, Array]]]:
        """State and slips at the end, and each instant and state at which the first block begins to slip."""
        t, begins = 0.0, list[tuple[float, Array]]()
        while True:
            t, state, block = self._next(t, state, slips, duration)
            if block is None:
                return state, slips, begins
            slips = slips.copy()
            slips[block] = not slips[block]
            if not slips[block]:
                state[2 + block] = self.speed
            elif block == 0:
                begins.append((t, state.copy()))

    def _next(self, t: float, state: Array, slips: Array, end: float) -> tuple[float, Array, int | None]:
        """The motion up to the next block that lets go or is caught; None at the end."""
        kinetic, static = np.array(self.kinetic), np.array(self.static)

        def rates(_: float, y: Array) -> Array:
            pull = -self.stiffness @ y[:2]
            return np.concatenate([y[2:], np.where(slips, pull + kinetic, 0.0)])

        def change(block: int):  # type: ignore[no-untyped-def]
            def event(_: float, y: Array) -> float:
                if slips[block]:
                    return float(y[2 + block] - self.speed)
                return float((self.stiffness @ y[:2])[block] - static[block])

            event.terminal, event.direction = True, 1.0  # type: ignore[attr-defined]
            return event

        events = [change(0), change(1)]
        done = solve_ivp(rates, (t, end), state, "DOP853", rtol=1e-11, atol=1e-13, events=events)
        block = next((b for b in (0, 1) if len(done.t_events[b])), None)
        return float(done.t[-1]), done.y[:, -1], block

    def exponent(self, *, laps: int, before: int, apart: float = 1e-7, at_once: int = 4) -> float:
        """The largest Lyapunov exponent, by a neighbour that is brought back ever again (Benettin et al. 1980).

        Over natural periods, as the engine has them; a difference turns to where it grows most `before` that.
        """
        time = at_once * 2 * np.pi
        own = np.array([0.1, -0.2, self.speed, self.speed]), np.array([False, False])
        other = own[0] + apart * np.array([1.0, -1.0, 0.0, 0.0]) / np.sqrt(2), own[1]
        grown = []
        for _ in range((before + laps) // at_once):
            own, other = self.run(*own, time)[:2], self.run(*other, time)[:2]
            distance = float(np.linalg.norm(other[0] - own[0]))
            grown.append(np.log(distance / apart) / time)
            other = own[0] + apart * (other[0] - own[0]) / distance, own[1]
        return float(np.mean(grown[before // at_once :]))

    def returns(self, duration: float) -> Iterator[tuple[float, float]]:
        """What the second block's place is when the first begins to slip, and when it does so again."""
        state = np.array([0.1, -0.2, self.speed, self.speed])
        begins = self.run(state, np.array([False, False]), duration)[2]
        places = [place[1] for _, place in begins]
        yield from pairwise(places)
