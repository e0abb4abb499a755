"""When an output of a motion crosses a level: events of one's own, and runs that end by them.

Between two events every output is smooth, and on each cell a polynomial of degree `ORDER` to rounding: fitted at
Chebyshev's points, it tells every crossing, two within a cell included. Where an output jumps over the level, as
friction does at an event, that instant is one too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from stickslip.errors import ModelError
from stickslip.solve.tables import Array
from stickslip.solve.trajectory import Trajectory

ORDER = 14  # of the polynomials: a cell turns by a radian or so, and its terms fall as 1 / 14!
ROUNDING = 1e-13  # of the largest value: a polynomial that stays farther from the level than this does not touch it
TRIED = 4.0  # periods of the first of the spans, each twice the one before, in which a run's end is looked for


def crossings(run: Trajectory, channel: str, *, level: float = 0.0, side: int = 0, contact: int = 0) -> Array:
    """When does an output cross a level?

    Parameters
    ----------
    run : Trajectory
        Any run.
    channel : str
        A name that :meth:`Trajectory.sample` knows: "x", "v", "friction", "slip", the law's memory ...
    level : float
        In the output's unit.
    side : int
        +1: where it rises, -1: where it falls, 0: both.
    contact : int
        Which row, of an output that has several: of a structure's displacement or contact, counted from 0.

    Returns
    -------
    ndarray
        Instants [s], increasing.

    Raises
    ------
    ModelError
        The side is none of the three, or the output has no such row.
    SolveError
        The system has no such output.

    Examples
    --------
    >>> from stickslip import Oscillator, laws, simulate
    >>> decay = simulate(Oscillator(mass=1, stiffness=4, law=laws.Coulomb(1.0)), duration=10, start={"x": 1.25})
    >>> crossings(decay, "x").round(6).tolist()  # x = 0.25 + cos 2 t falls, then rises on -0.25 + 0.5 ...
    [0.911738, 2.617994]
    """
    if side not in (-1, 0, 1) or not np.isfinite(level):
        raise ModelError(
            f"side = {side}, level = {level}", "side is -1, 0 or +1, the level a finite number", "correct it"
        )
    begins, widths = run.cells
    points = np.cos(np.pi * (np.arange(ORDER + 1) + 0.5) / (ORDER + 1))[::-1]
    times = begins[:, None] + widths[:, None] * (points + 1) / 2
    values, _ = run.sample(np.maximum.accumulate(np.minimum(times.ravel(), run.duration)), (channel,))
    if not 0 <= contact < len(values):
        raise ModelError(f"contact = {contact}", f"'{channel}' has {len(values)} rows, from 0", "correct it")
    series = np.polynomial.chebyshev.chebfit(points, values[contact].reshape(-1, ORDER + 1).T - level, ORDER)
    instants = [*_within(series, begins, widths, side), *_jumped(series, begins, side)]
    return np.unique(np.array(instants, dtype=np.float64))


def _within(series: Array, begins: Array, widths: Array, side: int) -> list[float]:
    """Instants at which a cell's polynomial crosses zero."""
    instants = []
    largest = np.abs(series).sum(axis=0)
    near = np.abs(series[0]) <= np.abs(series[1:]).sum(axis=0) + ROUNDING * np.max(largest, initial=0.0)
    for j in np.flatnonzero(near & (largest > 0)):
        own = np.trim_zeros(series[:, j], "b")
        roots = np.polynomial.chebyshev.chebroots(own) if len(own) > 1 else np.empty(0)
        real = np.sort(roots.real[(np.abs(roots.imag) < 1e-9) & (np.abs(roots.real) <= 1.0)])
        edges = np.concatenate([[-1.0], (real[1:] + real[:-1]) / 2, [1.0]])
        signs = np.sign(np.polynomial.chebyshev.chebval(edges, own))
        for root, before, after in zip(real, signs, signs[1:], strict=False):
            if before * after < 0 and side * after >= 0:
                instants.append(float(begins[j] + widths[j] * (root + 1) / 2))
    return instants


def _jumped(series: Array, begins: Array, side: int) -> list[float]:
    """Instants between two cells at which the output goes from one side of zero to the other at once."""
    signs = (-1.0) ** np.arange(len(series))
    ends, starts = series.sum(axis=0)[:-1], (signs @ series)[1:]
    floor = ROUNDING * np.max(np.abs(series).sum(axis=0), initial=0.0)
    over = (ends * starts < 0) & (np.minimum(np.abs(ends), np.abs(starts)) > floor) & (side * starts >= 0)
    return [float(instant) for instant in begins[1:][over]]


def stopped(march: Callable[[float], Trajectory], stop: Mapping[str, float], span: float, scale: float) -> Trajectory:
    """A run to where an output first crosses its level, or over the whole span [s]; `march` runs a time [s].

    The spans looked into grow, each twice the one before: what is marched in vain is as long as the run itself.
    """
    tried = min(span, TRIED * scale)
    while True:
        run = march(tried)
        instants = [crossings(run, name, level=level) for name, level in stop.items()]
        first = min((float(own[own > 0][0]) for own in instants if np.any(own > 0)), default=np.inf)
        if np.isfinite(first):
            return replace(march(first), status="stopped")
        if tried >= span or run.status != "complete":
            return run
        tried = min(span, 2 * tried)
