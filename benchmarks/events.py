"""When the virtual rig's contact holds and slips, and its friction with its band: error and coverage of each figure.

The thesis's air-track rig, its four motions, each draw with its own noise (and, with ``--rough 0.03``, its own
surface). Told are the onsets of holds and slips by all sensors and by motion sensors alone (missed, false, root mean
square error, and that over the stated deviation), the micro-slips in a stick, and the root mean square error of the
friction with the share of its samples that the band of two deviations holds, also with every sensor stated 1 to 2 %,
its mount's damping 30 %, and its delay 20 us wrong. With ``--keep FILE`` every draw is written down as it is done,
and a second call goes on from there.

    python benchmarks/events.py --draws 200 --keep events.jsonl
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from rig import FS, LAG, MOTIONS, RIG, SECONDS, SETTLED, measured, motion, rms

import stickslip as ss
from stickslip.cycle.sticks import StickEvent

NEAR = 3e-3  # s: an onset that is further from every true one is false
ENDS = 0.05  # s at the record's ends that do not count
WRONG = {
    "a": {"mount": (127.5, 0.13)},
    "load": {"mount": (255.0, 0.065), "inertia": 0.055},
    "x": {"delay": LAG + 20e-6},
    "z": {"delay": LAG + 20e-6},
}
Figures = dict[str, Any]


def onsets(events: tuple[StickEvent, ...]) -> dict[str, list[tuple[float, float]]]:
    """(time, sd) of each onset of a hold, and of each of a slip: a micro-slip is both, at its end and its begin."""
    found: dict[str, list[tuple[float, float]]] = {"hold": [], "slip": []}
    for event in events:
        begin, end = (event.time, event.time_sd), (event.time + event.duration, event.duration_sd)
        if event.kind == "microslip":
            found["slip"].append(begin)
            found["hold"].append(end)
        else:
            found["slip" if event.kind == "slip" else "hold"].append(begin)
    return found


def compared(ours: list[tuple[float, float]], true: np.ndarray) -> Figures:
    """What of the true onsets is missed, what of ours is false, the errors [s], and the errors over their sd."""
    inside = np.array([onset for onset in ours if ENDS < onset[0] < SECONDS - ENDS])
    apart = inside[:, :1] - true
    hits = np.abs(apart).min(axis=0) < NEAR
    nearest = np.abs(apart).argmin(axis=0)[hits]
    errors = apart[nearest, np.flatnonzero(hits)]
    return {
        "true": len(true),
        "missed": int(np.sum(~hits)),
        "false": int(np.sum(np.abs(apart).min(axis=1) > NEAR)),
        "square": float(np.mean(errors**2)),
        "scaled": float(np.mean((errors / inside[nearest, 1]) ** 2)),
    }


def told(record: ss.Record, run: ss.solve.Trajectory, method: str) -> Figures:
    """Friction and onsets by a method, against the run's own."""
    found = ss.friction_force(record, method=method, **RIG)
    inside = slice(200, -200)
    true = run.sample(SETTLED + found.time[inside], ("friction",))[0][0]
    off = np.abs(found["friction"][inside] - true)
    sticks = ss.find_sticks(found)
    figures: Figures = {
        "square": float(np.mean(off**2)), "band": float(np.mean(off < 2 * found["friction_sd"][inside])),
        "microslips": sticks.microslips.value if sticks.microslips else 0.0,
    }  # fmt: skip
    kinds = {"hold": ("stick", "microstick"), "slip": ("slip",)}
    for which, ours in onsets(sticks.events).items():
        times = np.array([event.time - SETTLED for event in run.events if event.kind in kinds[which]])
        figures[which] = compared(ours, times[(times > ENDS) & (times < SECONDS - ENDS)])
    return figures


def draw(frequency: float, rough: float, seed: int) -> Figures:
    record, run = measured(frequency, rough, seed), motion(frequency, rough, seed if rough else 0)
    wrong = record
    for name, details in WRONG.items():
        wrong = wrong.with_details(name, **details)
    return {
        "all": told(record, run, "fusion"),
        "motion": told(record, run, "motion"),
        "wrong": told(wrong, run, "fusion"),
    }


def kept(path: Path | None) -> dict[tuple[float, float, int], Figures]:
    lines = path.read_text("utf-8").splitlines() if path and path.exists() else []
    rows = [json.loads(line) for line in lines]
    return {(row["frequency"], row["rough"], row["seed"]): row["figures"] for row in rows}


def run_all(draws: int, rough: float, path: Path | None) -> dict[tuple[float, float, int], Figures]:
    found, begin = kept(path), time.perf_counter()
    for seed in range(draws):
        for frequency in MOTIONS:
            if (frequency, rough, seed) in found:
                continue
            found[frequency, rough, seed] = draw(frequency, rough, seed)
            if path:
                line = {"frequency": frequency, "rough": rough, "seed": seed, "figures": found[frequency, rough, seed]}
                with path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(line) + "\n")
        if seed % 10 == 9:
            print(f"draw {seed + 1} of {draws}, {time.perf_counter() - begin:.0f} s", file=sys.stderr, flush=True)
    return found


def tell(found: dict[tuple[float, float, int], Figures], rough: float) -> None:
    print(
        f"records of {SECONDS:g} s at {FS:g} Hz, roughness {rough:g}; of the onsets: missed and false in % of the true,"
    )
    print("rms error [ms], and that over the stated deviation")
    print("motion    sensors draws | friction rms [N]  largest  band %  worst | hold onsets          | slip onsets")
    for frequency in MOTIONS:
        for sensors in ("all", "motion", "wrong"):
            rows = [each[sensors] for key, each in found.items() if key[:2] == (frequency, rough)]
            if not rows:
                continue
            off = np.sqrt([row["square"] for row in rows])
            band = 100 * np.array([row["band"] for row in rows])
            words = [_onsets([row[which] for row in rows]) for which in ("hold", "slip")]
            micro = np.mean([row["microslips"] for row in rows])
            print(
                f"{frequency:5g} Hz  {sensors:>7} {len(rows):4d}  |     {rms(off):10.4f} {off.max():9.4f} "
                f"{band.mean():7.1f} {band.min():6.1f} | {words[0]} | {words[1]} | {micro:.3f} micro-slips a stick"
            )


def _onsets(rows: list[Figures]) -> str:
    total = sum(row["true"] for row in rows)
    missed, false = (100 * sum(row[key] for row in rows) / total for key in ("missed", "false"))
    error, scaled = (np.sqrt(np.mean([row[key] for row in rows])) for key in ("square", "scaled"))
    return f"{missed:4.2f} {false:4.2f} {1e3 * error:6.3f} {scaled:4.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=5, help="records a motion")
    parser.add_argument("--rough", type=float, default=0.0, help="share by which the friction fluctuates")
    parser.add_argument("--keep", type=Path, help="file in which every draw is written down")
    asked = parser.parse_args()
    tell(run_all(asked.draws, asked.rough, asked.keep), asked.rough)


if __name__ == "__main__":
    main()
