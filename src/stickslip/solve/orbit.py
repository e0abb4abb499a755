"""A motion that repeats, and what it does: amplitude, events, stops, stability."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import ModelError
from stickslip.estimate import Estimate
from stickslip.oscillator import Structure
from stickslip.solve.poincare import extent
from stickslip.solve.trajectory import Event, Trajectory


@dataclass(frozen=True, eq=False)
class SteadyState:
    """A periodic orbit, or why there is none.

    Attributes
    ----------
    status : str
        "unique" (isolated and stable; from other starts there may be others), "unstable", "grazing" (an
        exit is met at a tangent: no derivative, no multipliers), "not unique" (a family of orbits: a
        multiplier is 1), "rest" (held all the time), "unbounded" (the amplitude grows without end),
        "quasi-periodic" (several frequencies without a common period), "chaotic" (neighbours part for good), "not
        periodic" (no orbit found, and neither of these).
    period : float
        Period [s]; of several periods of the drive where `order` is above 1.
    order : int
        Period over the drive's; 1 for a self-excited orbit.
    orbit : Trajectory
        One period, from phase zero of the drive; of a motion that does not repeat, as much of it.
    multipliers : ndarray of complex
        Eigenvalues of the map over one period, largest first; saltation at events included.
    exponent : Estimate or None
        Largest Lyapunov exponent [1/s] of a motion that does not repeat.
    frequencies : tuple of float
        Basic frequencies [Hz] of a quasi-periodic motion, the drive's first.
    lines : ndarray (n, 2) or None
        Strongest lines of its displacement: frequency [Hz] and amplitude [m].
    """

    status: str
    period: float
    order: int
    orbit: Trajectory
    multipliers: NDArray[np.complex128]
    exponent: Estimate | None = None
    frequencies: tuple[float, ...] = ()
    lines: NDArray[np.float64] | None = None

    @property
    def rotation_numbers(self) -> tuple[float, ...]:
        """The other basic frequencies over the first: irrational where the motion is quasi-periodic."""
        return tuple(frequency / self.frequencies[0] for frequency in self.frequencies[1:])

    @property
    def amplitude(self) -> float:
        """Largest displacement from zero [m]."""
        return self.largest("x")

    @property
    def events(self) -> tuple[Event, ...]:
        """The changes of mode within one period."""
        return self.orbit.events

    @property
    def stops(self) -> tuple[int, int]:
        """Sticks per period of the only contact, as :meth:`stops_at` counts them."""
        return self.stops_at(self._only_contact("stops"))

    @property
    def transition_speed(self) -> float:
        """V_s of the thesis [m/s], of the only contact, as :meth:`transition_speed_at` finds it."""
        return self.transition_speed_at(self._only_contact("transition_speed"))

    def stops_at(self, contact: int = 0) -> tuple[int, int]:
        """Sticks per period at a contact: normal (motion goes on in the other direction) and abnormal (in the same).

        A reversal without time at rest is no stop. In a compliant contact microsticks are counted. The time that a
        contact is lifted off counts for nothing.

        Parameters
        ----------
        contact : int
            Which one, from 0.

        Returns
        -------
        tuple of int
            Normal and abnormal stops.
        """
        parts = [part for part in self._modes_at(contact) if part.kind not in ("flight", "landing")]
        sides = [part.side for j, part in enumerate(parts) if j == 0 or part is not parts[j - 1]]
        if len(sides) > 1 and parts[0] is parts[-1]:
            sides.pop()
        moving = [j for j, side in enumerate(sides) if side]
        if not moving:
            return 0, 0
        turned = sides[moving[0] :] + sides[: moving[0] + 1]
        counts = [0, 0]
        for j in range(1, len(turned) - 1):
            if not turned[j]:
                after = next(side for side in turned[j + 1 :] if side)
                before = next(side for side in reversed(turned[:j]) if side)
                counts[int(before * after > 0)] += 1
        return counts[0], counts[1]

    def transition_speed_at(self, contact: int = 0) -> float:
        """Largest speed at which a microstick of a contact goes over into slip [m/s]; nan without microsticks.

        Parameters
        ----------
        contact : int
            Which one, from 0.

        Returns
        -------
        float
        """
        table, parts = self.orbit.table, self._modes_at(contact)
        form = np.atleast_2d(table.outputs["slip"])[contact]
        speeds = [
            abs(float(form @ self.orbit.states[j + 1]))
            for j in range(len(parts) - 1)
            if parts[j].kind == "microstick" and parts[j + 1].kind == "slip"
        ]
        return max(speeds, default=math.nan)

    def _modes_at(self, contact: int) -> list[Any]:
        """The mode of a contact in each piece of the orbit."""
        modes = self.orbit.table.modes
        if not isinstance(self.orbit.system, Structure):
            every: list[Any] = [modes]
        else:
            every = [[mode.parts[c] for mode in modes] for c in range(len(self.orbit.system.contacts))]  # type: ignore[attr-defined]
        if not 0 <= contact < len(every):
            raise ModelError(f"contact {contact}", f"the system has {len(every)}, counted from 0", "name one of them")
        return [every[contact][m] for m in self.orbit.modes]

    def _only_contact(self, question: str) -> int:
        count = len(self.orbit.system.contacts) if isinstance(self.orbit.system, Structure) else 1
        if count != 1:
            raise ModelError(
                f"{question} of {count} contacts", "each contact has its own", f"ask {question}_at(contact) of one"
            )
        return 0

    def largest(self, output: str, *, points: int = 65) -> float:
        """Largest modulus of an output over the orbit.

        Parameters
        ----------
        output : str
            As in :meth:`Trajectory.sample`.
        points : int
            Instants looked at in each piece before the largest is refined.

        Returns
        -------
        float
        """
        ends = np.append(self.orbit.starts, self.orbit.duration)
        inner = np.linspace(0.0, 1.0, points)[:-1] * (1 - 1e-12)
        times = np.append((ends[:-1, None] + np.diff(ends)[:, None] * inner).ravel(), self.orbit.duration)
        times = np.unique(np.concatenate([times, np.maximum(ends[1:] * (1 - 1e-13), 0.0)]))
        values, _ = self.orbit.sample(times, (output,))
        best = int(np.argmax(np.max(np.abs(values), axis=0)))
        low, high = times[max(best - 1, 0)], times[min(best + 1, len(times) - 1)]
        top = float(np.max(np.abs(values[:, best])))
        for _ in range(12):
            grid = np.linspace(low, high, 33)
            fine = np.max(np.abs(self.orbit.sample(grid, (output,))[0]), axis=0)
            peak = int(np.argmax(fine))
            top = max(top, float(fine[peak]))
            low, high = grid[max(peak - 1, 0)], grid[min(peak + 1, 32)]
        return top


def alike(one: SteadyState, other: SteadyState) -> bool:
    """Whether two steady motions are one: alike in status, order and modes, and the state of one at some period of the
    drive is that of the other."""
    if (one.status, one.order) != (other.status, other.order):
        return False
    if one.status == "rest":
        return True  # a set of equilibria counts once
    if cycle_of(one) != cycle_of(other):
        return False
    shape = one.orbit.table.physical
    points = other.orbit.section() if one.order > 1 else other.orbit.states[:1, :shape]
    gaps = np.abs(points - one.orbit.states[0, :shape])
    return bool(np.any(np.all(gaps <= 1e-8 * extent(one.orbit), axis=1)))


def cycle_of(orbit: SteadyState) -> tuple[str, ...]:
    """The modes around the orbit, wherever phase zero falls among them."""
    modes = [orbit.orbit.table.modes[m].name for m in orbit.orbit.modes]
    if len(modes) > 1 and modes[0] == modes[-1]:
        modes.pop()
    return min(tuple(modes[j:] + modes[:j]) for j in range(len(modes)))
