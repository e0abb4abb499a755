"""Whether the delay of an accelerometer holds, of records filtered before they are sampled and of records that are not.

    python benchmarks/raw_delays.py [--draws 15] [--seed 1]

Rigs of four kinds by an integrator of our own, of 200 to 5000 Hz, noise of 0 to 1 % of each range, half of them with
whole samples in a cycle, half with an accelerometer that is late. Each is sampled as it is and behind a filter: one
without phase at 0.4 of the rate, or Butterworth's of eighth order at 0.3 of it. A line a kind tells how many intervals
hold the truth, the median half width, the median error, both in samples, and how many name a mount that is none.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy.signal import butter, fftconvolve, firwin, sosfilt

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import stepped
import stickslip as ss

KINDS = ("Coulomb", "static", "Stribeck", "compliant")
FINE = 20  # instants to a sample of the record
MOST = 16384  # samples


def sampled(kind: str, rng: np.random.Generator) -> tuple[dict[str, ss.Record], float]:
    """One motion as two records, raw and filtered, and how late their accelerometer is, in samples."""
    rig = stepped.drawn(kind, rng)
    fs = float(
        np.clip(np.exp(rng.uniform(np.log(200), np.log(5000))), 30 * rig.frequency, min(5000, 800 * rig.frequency))
    )
    if rng.random() < 0.5:
        fs = round(fs / rig.frequency) * rig.frequency
    samples = min(MOST, round(rng.uniform(10, 40) * fs / rig.frequency))
    late = round(rng.uniform(-3, 3) * FINE) if rng.random() < 0.5 else 0
    room = 60 * FINE
    settle = round(20 * fs / rig.frequency) * FINE
    steps = 8 if rig.kind in stepped.SOFT else 2
    (x, _, a), _, _ = stepped.marched(rig, samples * FINE + 2 * room, settle, fs * FINE, steps)
    smooth = np.append(0.0, np.append(np.diff(x, 2), 0.0)) * (fs * FINE) ** 2  # knows when a jumps between instants
    if rng.random() < 0.5:
        taps = firwin(40 * FINE + 1, 0.4 * 2 / FINE)
        filtered = [fftconvolve(channel, taps, mode="same") for channel in (x, smooth)]
    else:
        sections = butter(8, 0.3 * 2 / FINE, output="sos")
        filtered = [sosfilt(sections, channel) for channel in (x, smooth)]
    rows = room + FINE * np.arange(samples)
    levels = [0.0 if rng.random() < 0.1 else 10 ** rng.uniform(-4, -2) for _ in "xa"]
    noise = [level * rng.standard_normal(samples) for level in levels]
    records = {}
    for way, (x_, a_) in {"raw": (x, a), "filtered": filtered}.items():
        pairs = zip("xa", (x_[rows], a_[rows - late]), noise, strict=True)
        records[way] = ss.Record.of({name: values + np.ptp(values) * own for name, values, own in pairs}, fs=fs)
    return records, late / FINE


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=15)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-v", "--verbose", action="store_true")
    given = parser.parse_args()
    for kind in KINDS:
        rows: dict[str, list[tuple[float, ...]]] = {"raw": [], "filtered": []}
        for draw in range(given.draws):
            records, late = sampled(kind, np.random.default_rng([given.seed, KINDS.index(kind), draw]))
            for way, record in records.items():
                try:
                    lag = ss.balance.sensor_delay(record)
                except ss.errors.EstimateError as error:
                    print(kind, draw, way, error)
                    continue
                error = lag.delay.value * record.fs - late
                half = (lag.delay.interval[1] - lag.delay.interval[0]) / 2 * record.fs
                mount = lag.mount_frequency is not None
                rows[way].append((lag.delay.includes(late / record.fs), half, abs(error), mount))
                if given.verbose:
                    print(kind, draw, way, f"{record.fs:.0f} Hz, {len(record)} samples", rows[way][-1], lag, flush=True)
        for way, told in rows.items():
            held, half, error, mounts = np.array(told, dtype=float).T
            print(
                f"{kind:10s} {way:9s} holds {int(held.sum())} of {len(held)}; half width {np.median(half):.4f}, error "
                f"{np.median(error):.4f} samples; mounts {int(mounts.sum())}",
                flush=True,
            )


if __name__ == "__main__":
    main()
