"""Masses that contacts hold: their motion is bound to the counter-face's, and the contacts share the force through M.

Of n degrees of freedom, contacts along the rows T of (m, n) hold m. With S = (T M^-1 T')^-1 and U = M^-1 T' S, the
masses move by v -> (1 - U T) v + U w, w the speeds at which the contacts hold.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from stickslip.solve.tables import Array

Form = tuple[dict[int, float], float]  # weights of nodes, and a constant
WHOLE = 1e-15  # a share this close to a whole number is one: a mass that is held has no part in the motion


def combined(terms: Iterable[tuple[float, Form]]) -> Form:
    """A weighted sum of linear forms."""
    weights: dict[int, float] = {}
    constant = 0.0
    for factor, (part, value) in terms:
        constant += factor * value
        for node, weight in part.items():
            weights[node] = weights.get(node, 0.0) + factor * weight
    return {node: weight for node, weight in weights.items() if weight != 0.0}, constant


class Bound:
    """How n masses move that some contacts hold, as linear forms; `rows` are these contacts' directions (m, n)."""

    def __init__(self, mass: Array, inverse: Array, rows: Array) -> None:
        self.mass, self.inverse, self.rows = mass, inverse, rows
        self.count, self.degrees = rows.shape
        whole = self.count == self.degrees  # nothing is free
        self.share: Array = np.asarray(np.linalg.inv(rows @ inverse @ rows.T), dtype=np.float64)
        self.spread = rows.T @ np.linalg.inv(rows @ rows.T) if whole else inverse @ rows.T @ self.share
        free = np.zeros_like(mass) if whole else np.eye(self.degrees) - self.spread @ rows
        self.free = np.where(np.abs(free - np.rint(free)) < WHOLE, np.rint(free), free)

    def friction(self, force: Sequence[Form], acceleration: Sequence[Form]) -> list[Form]:
        """Forces of the contacts that hold, by the forces on the masses and the accelerations of the counter-face."""
        if self.count < self.degrees:
            return _through(self.share, [
                combined([*zip(row, force, strict=True), (-1.0, own)])
                for row, own in zip(self.rows @ self.inverse, acceleration, strict=True)
            ])  # fmt: skip
        forced = _through(self.mass @ self.spread, acceleration)
        rest = [combined([(1.0, push), (-1.0, own)]) for push, own in zip(force, forced, strict=True)]
        return _through(self.spread.T, rest)

    def speed(self, speeds: Sequence[Form]) -> list[Form]:
        """Velocity of each mass, by the speeds at which the contacts hold."""
        own: list[Form] = [({self.degrees + i: 1.0}, 0.0) for i in range(self.degrees)]
        return self._joined(own, speeds)

    def acceleration(self, force: Sequence[Form], acceleration: Sequence[Form]) -> list[Form]:
        """Acceleration of each mass."""
        return self._joined(_through(self.inverse, force), acceleration)

    def _joined(self, own: Sequence[Form], bound: Sequence[Form]) -> list[Form]:
        if not self.count:
            return list(own)
        return _through(np.hstack([self.free, self.spread]), [*own, *bound])


def _through(matrix: Array, forms: Sequence[Form]) -> list[Form]:
    return [combined(zip(map(float, row), forms, strict=True)) for row in matrix]


def stilled(unit: Any, degrees: int, held: Mapping[int, tuple[Array, Any]]) -> Any:
    """The state with the velocities of some contacts told, but for the rounding of its own terms: (B, N, N).

    Of each contact its direction and, as rows (B, N), the velocity that it is left. One degree of freedom after the
    other takes the velocity that the rest leave it, contacts that see the fewest first. No projection: that would mix
    in the rounding of velocities that a contact does not see, and rounding must not decide what follows.
    """
    still, speeds = unit.copy(), slice(degrees, 2 * degrees)
    for c in sorted(held, key=lambda c: int(np.count_nonzero(held[c][0]))):
        tangent, speed = held[c]
        left = speed - tangent @ still[:, speeds]
        p = degrees + int(np.argmax(np.abs(left[0, speeds])))
        if abs(left[0, p]) > 1e-12 * np.max(np.abs(tangent)):
            taken = -left / left[:, p, None]
            taken[:, p] = -1.0
            still += still[:, :, p, None] * taken[:, None]
    return still
