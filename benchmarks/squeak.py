"""Squeaks of the virtual rig: are bursts found, is their frequency right, and is the squeaking condition told?

    python benchmarks/squeak.py [count]

Each recording has a surface, a load and a noise of its own. The truth is read from the run without noise, at 40 kHz, by
other means than the search: a burst is where the envelope of the tip's acceleration rises from a valley, over a tenth
of its peak, in a run whose load is beyond the one at which steady sliding ceases to be stable; its frequency is the
mean of the instantaneous one, by power.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, find_peaks, hilbert, sosfiltfilt

import stickslip as ss

FINE = 40_000.0
BEGIN, END = 0.4, 1.4  # s of the run that is recorded, after it has settled
MARGIN = 0.05  # s
LIGHT, HEAVY = (0.8, 1.5), (2.4, 7.5)  # N: below and beyond the threshold of the wet rig, 1.80 N
BETWEEN = (1.5, 2.4)  # N: about the threshold, where a free ringing and a squeak hardly differ; counted by itself
THRESHOLD = 1.797  # N, of stability at 0.1 m/s


@dataclass
class Score:
    true: int = 0
    found: int = 0
    heard: int = 0
    right: int = 0
    frequencies: tuple[float, ...] = ()
    wrong_conditions: int = 0
    recordings: int = 0

    @property
    def recall(self) -> float:
        return self.heard / self.true

    @property
    def precision(self) -> float:
        return self.right / self.found


def case(number: int) -> tuple[str, float, float]:
    """Surface, load [N] and signal to noise [dB] of a recording: half of them squeak."""
    rng = np.random.default_rng(number)
    squeaks = number % 2 == 0
    surface = "wet" if squeaks else str(rng.choice(["dry", "wet"]))
    low, high = HEAVY if squeaks or (surface == "dry" and rng.random() < 0.5) else LIGHT
    return surface, float(rng.uniform(low, high)), float(rng.uniform(20, 40))


def true_bursts(run: ss.solve.Trajectory) -> list[tuple[float, float, float]]:
    """Begin, end [s] and frequency [Hz] of the bursts of a run that squeaks."""
    times = np.arange(0.2, run.duration, 1 / FINE)
    values = sosfiltfilt(butter(2, [250, 1200], "bandpass", fs=FINE, output="sos"), run.sample(times, ("a",))[0][1])
    envelope = sosfiltfilt(butter(2, 25, fs=FINE, output="sos"), np.abs(hilbert(values)))
    level = 20 * np.log10(np.maximum(envelope, 1e-3 * envelope.max()))
    peaks, _ = find_peaks(level, prominence=10)
    found = []
    for peak in peaks:
        below = level < level[peak] - 20
        higher = level > level[peak]
        first = max(np.flatnonzero(below[:peak] | higher[:peak]).max(initial=0), 0)
        last = peak + np.flatnonzero(below[peak:] | higher[peak:]).min(initial=len(level) - peak)
        for other in peaks[peaks != peak]:
            valley = min(other, peak) + int(np.argmin(level[min(other, peak) : max(other, peak)]))
            first, last = (max(first, valley), last) if other < peak else (first, min(last, valley))
        found.append((float(times[first]), float(times[last - 1]), frequency_of(values[first:last])))
    return found


def frequency_of(values: np.ndarray) -> float:
    """Mean of the instantaneous frequency by power [Hz]."""
    peak = np.argmax(np.abs(np.fft.rfft(values))) * FINE / len(values)
    wave = hilbert(sosfiltfilt(butter(2, [0.88 * peak, 1.12 * peak], "bandpass", fs=FINE, output="sos"), values))
    turning = np.diff(np.unwrap(np.angle(wave))) * FINE / (2 * np.pi)
    return float(np.average(turning, weights=np.abs(wave[1:]) ** 2))


def whole(begin: float, end: float) -> bool:
    """Whether a burst lies inside the record: of one that an end cuts nobody can tell how long it lasts."""
    return begin > BEGIN + MARGIN and end < END - MARGIN


def alike(first: tuple[float, float], second: tuple[float, float]) -> bool:
    """Whether two bursts share more than half of the longer one."""
    shared = min(first[1], second[1]) - max(first[0], second[0])
    return shared > 0.5 * max(first[1] - first[0], second[1] - second[0])


def around(count: int) -> tuple[Score, list[tuple[float, str]]]:
    """Score of `count` wet recordings under loads about the threshold at 30 dB, and what is told of each."""
    loads = np.linspace(*BETWEEN, count)
    told = []
    score = Score(recordings=count)
    for number, load in enumerate(loads):
        told.append((float(load), scored(score, "wet", float(load), 30.0, number, squeaks=bool(load > THRESHOLD))))
    return score, told


def measured(count: int, *, snr: float | None = None) -> Score:
    """Score of the recordings number 0 to `count`; all at one signal to noise if given."""
    score = Score(recordings=count)
    for number in range(count):
        surface, load, noise = case(number)
        scored(score, surface, load, snr or noise, number, squeaks=surface == "wet" and load > HEAVY[0])
    return score


def scored(score: Score, surface: str, load: float, snr: float, seed: int, *, squeaks: bool) -> str:
    """What is told of a recording; what is right and wrong of it is added to the score."""
    run = ss.simulate(ss.squeak.squeak_rig(surface, load), duration=END + 0.3)
    heard = ss.find_squeaks(ss.squeak.squeak_record(run, snr=snr, rng=seed).between(BEGIN, END))
    score.wrong_conditions += heard.squeaking != squeaks
    true = true_bursts(run) if squeaks else []
    found = [b for b in heard.of("squeak", "squeal") if whole(b.start, b.end)]
    pairs = [(b, each) for b in found for each in true if alike((b.start, b.end), each[:2])]
    inside = [each for each in true if whole(each[0], each[1])]
    everything = [(b.start, b.end) for b in heard.of("squeak", "squeal")]
    score.found += len(found)
    score.right += len({b.start for b, _ in pairs})
    score.true += len(inside)
    score.heard += sum(any(alike(each[:2], other) for other in everything) for each in inside)
    score.frequencies += tuple(abs(b.frequency / each[2] - 1) for b, each in pairs)
    return heard.answer


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 400
    noisy, clean = measured(count), measured(count // 2, snr=30.0)
    median, most, worst = 100 * np.quantile(noisy.frequencies, [0.5, 0.98, 1.0])
    print(f"{count} recordings, 20 to 40 dB: {noisy.true} bursts,")
    print(f"  recall {noisy.recall:.4f}, precision {noisy.precision:.4f},")
    print(f"  frequency off by {median:.2f} % (median), {most:.2f} % (98 of 100), {worst:.2f} % (largest)")
    print(f"conditions told wrong: {noisy.wrong_conditions}; at 30 dB {clean.wrong_conditions} of {clean.recordings}")
    near, told = around(max(10, count // 4))
    untold = [load for load, answer in told if answer == "can not be told"]
    wrong = [load for load, answer in told if load not in untold and (answer == "squeaks") != (load > THRESHOLD)]
    print(f"apart from these, {near.recordings} wet ones under {BETWEEN[0]} to {BETWEEN[1]} N, about the threshold:")
    worst = 100 * max(near.frequencies)
    print(f"  recall {near.recall:.4f}, precision {near.precision:.4f}; frequency off by {worst:.2f} % (largest)")
    for what, loads in (("not told", untold), ("told wrong", wrong)):
        print(f"  conditions {what}: {len(loads)}" + (f", of {min(loads):.3f} to {max(loads):.3f} N" if loads else ""))
