"""The mode behind a frequency response, beside pyFRF and sdypy-EMA (``pip install pyFRF sdypy-EMA``).

``python benchmarks/response.py [--draws 6]``: a slider pushed by a sweep of a minute, damping ratio 0.0008, and by
noise, 0.02; both channels carry 0.1 % of noise. pyFRF averages spectra of Hann windows an eighth of the record long; of
the poles that sdypy-EMA fits to its H1 in orders up to 20 the median of those within 2 % of the true frequency counts.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
import pyFRF
from sdypy import EMA

import stickslip as ss
from stickslip import bench

FS, SECONDS, MASS, STIFFNESS = 200, 60.0, 2.42, 2310.0
NATURAL = math.sqrt(STIFFNESS / MASS) / math.tau
SD = 1e-3  # of the noise, as a part of each channel's deviation


def record_of(kind: str, ratio: float, seed: int) -> ss.Record:
    """The slider, pushed."""
    chance, time = np.random.default_rng([seed, 5]), np.arange(round(FS * SECONDS) + 2) / FS
    swept = np.sin(math.tau * (1.5 * time + 18.5 * time**2 / (2 * SECONDS)))
    force = (
        swept * np.clip(np.minimum(time, SECONDS - time), 0, 1) if kind == "sweep" else chance.normal(size=len(time))
    )
    slider = ss.Oscillator(
        mass=MASS,
        stiffness=STIFFNESS,
        damping=2 * ratio * math.sqrt(MASS * STIFFNESS),
        law=ss.laws.Coulomb(0.0),
        drive=ss.drives.Recorded(0.5 * force, FS, on="force"),
    )
    record = ss.Rig.perfect("x", "force").measure(ss.simulate(slider, duration=SECONDS), fs=FS)
    for name in ("x", "force"):
        sd = SD * float(np.std(record[name]))
        noisy = record[name] + sd * chance.standard_normal(len(record))
        record = record.with_channel(name, noisy, unit=record.channels[name].unit).with_details(name, noise=sd)
    return record


def beside(record: ss.Record) -> float:
    """The damping ratio by both other programs."""
    size = 2 * len(record) // 16
    spectra = pyFRF.FRF(
        FS,
        exc=record["force"],
        resp=record["x"],
        resp_type="d",
        window="hann",
        nperseg=size,
        noverlap=size // 2,
        fft_len=size,
    )
    response = np.atleast_2d(np.squeeze(spectra.get_H1()))
    model = EMA.Model(response, np.squeeze(spectra.get_f_axis()), lower=2, upper=12, pol_order_high=20)
    model.get_poles(show_progress=False)
    poles = [pair for row in zip(model.pole_freq, model.pole_xi, strict=True) for pair in zip(*row, strict=True)]
    near = [ratio for frequency, ratio in poles if abs(frequency / NATURAL - 1) < 0.02 and ratio > 0]
    return float(np.median(near)) if near else math.nan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=6)
    for kind, ratio in (("sweep", 0.0008), ("noise", 0.02)):
        ours, theirs, held = [], [], 0
        for seed in range(parser.parse_args().draws):
            record = record_of(kind, ratio, seed)
            fit = bench.modal_fit(record, channels=("force", "x"))
            ours.append(abs(fit.damping_ratio.value / ratio - 1))
            held += fit.damping_ratio.includes(ratio)
            theirs.append(beside(record) / ratio - 1)
        print(
            f"{kind}, damping ratio {ratio}: modal_fit off by {np.median(ours):.2%} (median), {held} of {len(ours)} "
            f"intervals hold; by both others off by {np.median(theirs):+.1%}, {min(theirs):+.1%} to {max(theirs):+.1%}"
        )


if __name__ == "__main__":
    main()
