"""What every forked case would do first, done once in the process that it is forked from: imports, numba's start."""

from __future__ import annotations

import importlib
import pkgutil

import numpy as np

import stickslip
from stickslip.signals.pieces import turning_points

LATE = (
    "h5py",
    "jinja2",
    "matplotlib.figure",
    "pandas",
    "pint",
    "pyarrow.parquet",
    "pytest",
    "scipy.ndimage",
    "scipy.optimize",
    "scipy.signal",
    "scipy.stats",
    "xarray",
)
ROOMS = (module.name for module in pkgutil.walk_packages(stickslip.__path__, "stickslip."))

for name in (*LATE, *ROOMS):
    if not name.endswith(("__main__", "gpu", "cuda")):
        importlib.import_module(name)
turning_points(np.zeros(3), 1.0, np.empty(3, dtype=np.intp))
