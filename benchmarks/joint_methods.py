"""A joint's friction by several ways, on the same simulated joints (`tests/joints.py`) with the torque measured.

Ours, and plain regression as it is commonly done: positions low-passed to and fro at 10 Hz, differentiated, and
inertia, viscous and Coulomb friction and gravity by least squares over the samples faster than a twentieth of the
fastest, with the intervals that white residuals would have. Of the second half of each log the torque is predicted by
the first.

    python benchmarks/joint_methods.py --draws 60 --first 1000
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import joints
import stickslip as ss
from stickslip.cycle.joint_fit import joint_data
from stickslip.estimate import NORMAL_95

TOLD = ("level", "viscous", "inertia")
CUT, SLOW = 10.0, 0.05  # Hz; of the fastest speed
Answer = tuple[dict[str, tuple[float, float, float]], float]  # value and interval of each number, and what is missed


def plain_columns(record: ss.Record) -> np.ndarray:
    """Acceleration, speed, direction and gravity as columns."""
    cut = min(CUT, 0.4 * record.fs)
    q = sosfiltfilt(butter(4, cut, fs=record.fs, output="sos"), record["theta"])
    v = np.gradient(q, 1 / record.fs)
    return np.column_stack([np.gradient(v, 1 / record.fs), v, np.sign(v), np.sin(q), np.cos(q)])


def plainly(record: ss.Record, halves: list[ss.Record]) -> Answer:
    """Least squares over all samples that move, as if these were independent."""

    def fitted(part: ss.Record) -> tuple[np.ndarray, np.ndarray]:
        columns, torque = plain_columns(part), part["force"]
        moves = np.abs(columns[:, 1]) > SLOW * np.abs(columns[:, 1]).max()
        found, *_ = np.linalg.lstsq(columns[moves], torque[moves], rcond=None)
        left = torque[moves] - columns[moves] @ found
        covariance = np.linalg.inv(columns[moves].T @ columns[moves]) * (left @ left) / (moves.sum() - len(found))
        return found, np.sqrt(np.diag(covariance))

    values, sds = fitted(record)
    told = dict(zip(("inertia", "viscous", "level"), zip(values, sds, strict=False), strict=False))
    _, data = joint_data(halves[1], None)
    slides = data.logs[0].sliding
    predicted = slides.window.apply(plain_columns(halves[1]) @ fitted(halves[0])[0])[slides.rows]
    missed = np.linalg.norm(data.torque - predicted) / np.linalg.norm(data.torque - data.torque.mean())
    return {name: (v, v - NORMAL_95 * sd, v + NORMAL_95 * sd) for name, (v, sd) in told.items()}, float(missed)


def ours(record: ss.Record, halves: list[ss.Record]) -> Answer:
    """As `stickslip joint` does it."""
    regression = ss.cycle.regress_joint(record)
    missed = ss.cycle.regress_joint_logs(halves).predictions[1].error
    return {name: (getattr(regression, name).value, *getattr(regression, name).interval) for name in TOLD}, missed


METHODS: dict[str, Callable[[ss.Record, list[ss.Record]], Answer]] = {"ours": ours, "plain regression": plainly}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=60, help="joints")
    parser.add_argument("--first", type=int, default=1000, help="seed of the first")
    options = parser.parse_args()
    rows: dict[str, list[list[float]]] = {name: [] for name in METHODS}
    for seed in range(options.first, options.first + options.draws):
        joint = joints.drawn(seed, torque=True)
        half = len(joint.record) // 2
        halves = [joint.record.rows(0, half), joint.record.rows(half, 2 * half)]
        try:
            time_of_rows = ss.cycle.regress_joint(joint.record).time
            answers, spent = {}, {}
            for name, method in METHODS.items():
                begun = time.process_time()
                answers[name] = method(joint.record, halves)
                spent[name] = time.process_time() - begun
        except ss.StickslipError:  # one way alone would be another set of joints
            continue
        true = {**joint.truth, "level": joint.level(time_of_rows)}
        for name, (told, missed) in answers.items():
            errors = [abs(told[key][0] / true[key] - 1) for key in TOLD]
            held = [told[key][1] <= true[key] <= told[key][2] for key in TOLD]
            rows[name].append([*errors, *held, missed, spent[name]])
    print(f"{len(rows['ours'])} of {options.draws} joints; of level, viscous, inertia:")
    for name, told in rows.items():
        table = np.array(told, dtype=float)
        errors = ", ".join(f"{each:.1%}" for each in np.median(table[:, :3], axis=0))
        held = ", ".join(f"{each:.0%}" for each in table[:, 3:6].mean(axis=0))
        missed = f"{np.median(table[:, 6]):.1%} (worst tenth {np.quantile(table[:, 6], 0.9):.1%})"
        print(f"  {name}: off by {errors} (medians); held {held}; missed {missed}; {table[:, 7].mean():.2f} s")


if __name__ == "__main__":
    main()
