"""Write the file that the README's commands run on: some cycles of the bundled simulated rig, as a logger writes them.

python tools/make_example.py          writes examples/rig.csv; examples/rig.toml beside it says what the columns are
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import stickslip as ss
from stickslip.units import GRAVITY

FOLDER = Path(__file__).resolve().parents[1] / "examples"
ROWS, EVERY = 12_000, 2  # of the bundled record: six seconds, at 1000 Hz


def written(path: Path) -> Path:
    """Every second row of the record's first half, in the units of its instruments."""
    record = ss.datasets.demo()
    columns = {
        "t [s]": record.time, "plate [mm]": 1e3 * record["x"], "base [mm]": 1e3 * record["z"],
        "acc [g]": record["a"] / GRAVITY, "cell [N]": record["load"],
    }  # fmt: skip
    rows = np.column_stack(list(columns.values()))[:ROWS:EVERY]
    forms = ["%.3f", "%.4f", "%.4f", "%.4f", "%.3f"]
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt=forms)
    return path


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    print(written(FOLDER / "rig.csv"))
