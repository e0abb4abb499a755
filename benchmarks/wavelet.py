"""Wavelet maps against named peers, in one run: a million samples by 200 frequencies, on one thread.

Processor time, for other work on the machine must not count; candidates in turn, round by round, each after a first
round that is not counted (compilation, plans, first touch of memory). Beside every time stands the largest error of ten
rows over the row's largest value, away from the ends, against the transform without any short cut; peers normalise
differently, so each row may be scaled. PyWavelets, ssqueezepy and fCWT are compared where they are installed
(``pip install PyWavelets ssqueezepy fcwt``; fCWT also needs libfftw3f). ``make bench`` sets one thread, and
an allocator that keeps its memory, for all of them.
"""

from __future__ import annotations

import argparse
import importlib.util
import itertools
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.fft import fft, ifft, next_fast_len

from stickslip.signals.morlet import ridge_centre, transform

CENTRE, FS = 4.5, 4000.0
LOWEST, HIGHEST = 1.0, 800.0
ROWS = 10  # whose error is told
EDGE = 20_000  # samples at either end that are left out of the errors
# PyWavelets differences a table of the wavelet's integral, read without interpolation. Of the 2^12 points that it has
# by default, a wavelet of 1 Hz at 4 kHz repeats each eleven times, and hears tones of 364 Hz, ten times as loud as
# what it should hear. 2^18 cost as little and leave 0.3 in the lowest row, less in all others; more points cost time.
INTEGRAL_POINTS = 18  # as a power of two


def signal(count: int) -> np.ndarray:
    """Noise and a chirp."""
    t = np.arange(count) / FS
    return np.random.default_rng(0).normal(size=count) + np.sin(2 * np.pi * (2 * t + 3 * t**2))


def true_row(values: np.ndarray, scale: float) -> np.ndarray:
    size = next_fast_len(len(values) + int(10 * scale * FS))
    turn = 2 * np.pi * np.fft.fftfreq(size, 1 / FS)
    window = np.sqrt(scale) * np.exp(-0.5 * (scale * turn - CENTRE) ** 2)
    return np.asarray(ifft(fft(values, size) * window)[: len(values)])


def candidates(values: np.ndarray, scales: np.ndarray) -> dict[str, Callable[[], Any]]:
    """Each returns its map with the scales rising."""
    frequencies = CENTRE / (2 * np.pi * scales)
    found: dict[str, Callable[[], Any]] = {
        f"stickslip {kind}": lambda kind=kind: transform(
            values, FS, scales, centre=CENTRE, normalisation="energy", precision=kind
        )
        for kind in ("double", "single")
    }
    if importlib.util.find_spec("pywt"):
        import pywt

        name = f"cmor2.0-{CENTRE / (2 * np.pi)}"
        found["PyWavelets"] = lambda: pywt.cwt(
            values, scales * FS, name, 1 / FS, method="fft", precision=INTEGRAL_POINTS
        )[0]
    if importlib.util.find_spec("ssqueezepy"):
        import ssqueezepy

        for kind in ("float64", "float32"):
            wavelet = ssqueezepy.Wavelet(("morlet", {"mu": CENTRE, "dtype": kind}))
            taken = values.astype(kind)
            found[f"ssqueezepy {kind}"] = lambda wavelet=wavelet, taken=taken: ssqueezepy.cwt(
                taken, wavelet, scales=scales * FS, padtype="zero", astensor=False
            )[0]
    if importlib.util.find_spec("fcwt"):
        try:
            import fcwt
        except ImportError as error:  # libfftw3f is not there
            print(f"fCWT is left out: {error}")
        else:
            single = values.astype(np.float32)
            found["fCWT"] = lambda: _fcwt(fcwt, single, frequencies)
    return found


def _fcwt(fcwt: Any, single: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    """Its wavelet is of another width (sigma 2 pi for fb = 1): set to the same number of oscillations."""
    wavelet = fcwt.Morlet(CENTRE / (2 * np.pi))
    scales = fcwt.Scales(
        wavelet, fcwt.FCWT_LOGSCALES, int(FS), float(frequencies[-1]), float(frequencies[0]), len(frequencies)
    )
    out = np.zeros((len(frequencies), len(single)), dtype=np.complex64)
    fcwt.FCWT(wavelet, 1, False, False).cwt(single, scales, out)
    return out


def error(found: np.ndarray, values: np.ndarray, scales: np.ndarray) -> float:
    worst = 0.0
    for row in np.linspace(0, len(scales) - 1, ROWS).astype(int):
        true = true_row(values, float(scales[row]))[EDGE:-EDGE]
        got = np.asarray(found[row][EDGE:-EDGE], dtype=complex)
        best = min(
            np.abs(turned - np.vdot(true, turned) / np.vdot(true, true) * true).max()
            / np.abs(np.vdot(true, turned) / np.vdot(true, true) * true).max()
            for turned in (got, got.conj())
        )
        worst = max(worst, float(best))
    return worst


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--frequencies", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--together", type=int, default=40, help="frequencies of one call: not all fit into memory")
    given = parser.parse_args()
    values = signal(given.samples)
    scales = ridge_centre(CENTRE, "energy") / (2 * np.pi * np.geomspace(HIGHEST, LOWEST, given.frequencies))
    step = given.together
    calls = [scales[at : at + step] for at in range(0, len(scales), step)]
    peers = [candidates(values, some) for some in calls]
    seconds: dict[str, list[float]] = {name: [0.0] * given.rounds for name in peers[0]}
    errors: dict[str, float] = dict.fromkeys(peers[0], 0.0)
    for number, (some, runs) in itertools.product(range(given.rounds + 1), zip(calls, peers, strict=True)):
        for name, run in runs.items():
            began = time.process_time()
            found = run()
            if number:
                seconds[name][number - 1] += time.process_time() - began
            else:
                errors[name] = max(errors[name], error(found, values, some))
            del found
    base = {kind: statistics.median(seconds[f"stickslip {kind}"]) for kind in ("double", "single")}
    asked = f"{given.samples:,} samples at {FS:g} Hz by {given.frequencies} frequencies"
    print(f"\nMorlet, {asked} of {LOWEST:g} to {HIGHEST:g} Hz, one thread")
    print(f"  {'':22}{'processor':>11}{'over double':>13}{'over single':>13}{'error':>10}")
    for name in peers[0]:
        median = statistics.median(seconds[name])
        ratios = "".join(f"{median / base[kind]:13.1f}" for kind in ("double", "single"))
        print(f"  {name:22}{median:9.2f} s{ratios}{errors[name]:10.1g}")


if __name__ == "__main__":
    main()
