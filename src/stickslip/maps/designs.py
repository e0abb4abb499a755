"""Points spread over ranges of parameters, and which parameter an answer depends on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import Estimate

DESIGNS = ("sobol", "random")
KINDS = ("first", "total")  # the indices, in the order of _indices
RESAMPLES = 400  # of the bootstrap: a standard deviation from it is good to 4 %

Array = NDArray[np.float64]


def design(
    bounds: Mapping[str, tuple[float, float]], *, count: int, kind: str = "sobol", seed: int = 0
) -> list[dict[str, float]]:
    """Which points tell how an answer depends on several parameters?

    Parameters
    ----------
    bounds : mapping
        Lowest and highest value by parameter.
    count : int
        Of a Sobol design the number of base samples, a power of two: it has ``count * (k + 2)`` points for k
        parameters, as :func:`sensitivity` needs them. Of a random one the number of points.
    kind : {"sobol", "random"}
        Saltelli's extension of Sobol's sequence (Saltelli et al. 2010), or independent uniform numbers.
    seed : int
        The same seed, the same points.

    Returns
    -------
    list of dict
        A grid for :func:`sweep`.

    Raises
    ------
    ModelError
        A range has no width, the kind is unknown, or the count is none.

    Examples
    --------
    >>> points = design({"kinetic": (0.5, 1.5), "mass": (1.0, 2.0)}, count=8)
    >>> len(points), sorted(points[0])
    (32, ['kinetic', 'mass'])
    """
    names = list(bounds)
    ranges = np.array([tuple(bounds[name]) for name in names], dtype=np.float64).reshape(len(names), -1)
    if not names or ranges.shape[1] != 2 or not np.all(ranges[:, 0] < ranges[:, 1]) or not np.all(np.isfinite(ranges)):
        raise ModelError(
            f"bounds = {dict(bounds)}", "each parameter has a lowest and a higher finite value", "give both"
        )
    if kind not in DESIGNS:
        raise ModelError(f"no design is called '{kind}'", f"there are {', '.join(DESIGNS)}", "choose one of them")
    if not (isinstance(count, int | np.integer) and count >= 1):
        raise ModelError(f"count = {count}", "a design has one point at least", "raise count=")
    if kind == "random":
        rows = np.random.default_rng(seed).uniform(ranges[:, 0], ranges[:, 1], (count, len(names)))
    elif count & (count - 1):
        raise ModelError(f"count = {count}", "a Sobol design has a power of two base samples", "take 64, 128, 256 ...")
    else:
        rows = _saltelli(ranges, count=count, seed=seed)
    return [dict(zip(names, map(float, row), strict=True)) for row in rows]


def sensitivity(atlas: Any, *, variable: str, seed: int = 0) -> dict[str, dict[str, Estimate]]:
    """How much of an answer's variance is each parameter's?

    Sobol's indices: the share of the variance that a parameter has alone ("first") and with all others together
    ("total"), estimated as in Saltelli et al. 2010 (Computer Physics Communications 181, table 2, b and f), with
    intervals by a bootstrap over the base samples.

    Parameters
    ----------
    atlas : xarray.Dataset
        A sweep over the points of a Sobol :func:`design`.
    variable : str
        Which of its variables.
    seed : int
        Of the bootstrap that gives the intervals.

    Returns
    -------
    dict
        By parameter, the Estimates "first" and "total" with their 95 % intervals.

    Raises
    ------
    EstimateError
        The sweep was not over a Sobol design, the answer is not known at every point, or it is the same at all.

    Examples
    --------
    >>> from stickslip import scenarios, sweep
    >>> points = design({"kinetic": (0.1, 0.4), "mass": (0.9, 1.1)}, count=16)
    >>> atlas = sweep(scenarios.forced(0.6, 0.2), points, measures=["energy"], settle=40, cycles=4)
    >>> shares = sensitivity(atlas, variable="energy")
    >>> shares["kinetic"]["total"].value > shares["mass"]["total"].value
    True
    """
    names = [str(name) for name in atlas.coords]
    answers = np.asarray(atlas[variable].values, dtype=np.float64) if variable in atlas else np.zeros(0)
    if atlas.sizes.keys() != {"point"} or not len(answers) or not _is_sobol(atlas, names):
        raise EstimateError(
            f"{len(answers)} points of '{variable}' over {', '.join(names)}",
            "the indices need the points of a Sobol design",
            "sweep over design(...)",
        )
    if not np.all(np.isfinite(answers)) or np.ptp(answers) == 0:
        raise EstimateError(
            f"{variable} is not known at every point, or the same at all",
            "a share of a variance needs one",
            "narrow the bounds, or ask another",
        )
    rows = answers.reshape(-1, len(names) + 2)
    rng = np.random.default_rng(seed)
    again = [_indices(rows[rng.integers(len(rows), size=len(rows))]) for _ in range(RESAMPLES)]
    values, sds = _indices(rows), np.std(again, axis=0, ddof=1)
    return {
        name: {kind: _share(f"{kind} Sobol index of {name}", values[i, j], sds[i, j]) for i, kind in enumerate(KINDS)}
        for j, name in enumerate(names)
    }


def _saltelli(ranges: Array, *, count: int, seed: int) -> Array:
    """For each base sample a row of A, A but for each parameter in turn from B, and B's row."""
    from scipy.stats import qmc

    parameters = len(ranges)
    base = qmc.Sobol(2 * parameters, seed=seed).random(count)  # rng=seed is another stream: kept stores have this one
    a, b = base[:, None, :parameters], base[:, None, parameters:]
    swapped = np.where(np.eye(parameters, dtype=bool), b, a)
    unit = np.concatenate((a, swapped, b), axis=1).reshape(-1, parameters)
    return np.asarray(ranges[:, 0] + unit * (ranges[:, 1] - ranges[:, 0]), dtype=np.float64)


def _indices(rows: Array) -> Array:
    """First and total indices, a column for each parameter, of answers in a row for each base sample."""
    from scipy.stats import sobol_indices

    parts = {"f_A": rows[:, 0], "f_B": rows[:, -1], "f_AB": rows.T[1:-1, None]}
    shares = sobol_indices(func=parts, n=len(rows))
    return np.stack((np.ravel(shares.first_order), np.ravel(shares.total_order)))


def _is_sobol(atlas: Any, names: list[str]) -> bool:
    """Whether the points are Saltelli's: a row of A, A but for each parameter in turn from B, and B's row."""
    base, rest = divmod(atlas.sizes["point"], len(names) + 2)
    if rest or base < 2 or base & (base - 1):
        return False
    rows = np.column_stack([atlas[name].values for name in names]).reshape(base, len(names) + 2, len(names))
    ours = np.eye(len(names), dtype=bool)
    return bool(np.all(rows[:, 1:-1] == np.where(ours, rows[:, -1:], rows[:, :1])))


def _share(name: str, value: float, sd: float) -> Estimate:
    return Estimate.normal(name, value, sd=sd, unit="1", method="Saltelli's design, bootstrap")
