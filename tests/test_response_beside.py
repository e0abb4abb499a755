"""H1, H2 and coherence beside those of pyFRF, by the same segments of the same samples."""

from __future__ import annotations

import numpy as np
import pytest

import stickslip as ss
from stickslip import bench

pyfrf = pytest.importorskip("pyFRF", reason="pyFRF is not installed: pip install pyFRF")

FS, SECONDS, SEGMENT = 200, 120.0, 8.0


def shaken() -> ss.Record:
    """A slider pushed by noise, both channels noisy."""
    chance = np.random.default_rng(8)
    drive = ss.drives.Recorded(chance.standard_normal(round(FS * SECONDS) + 2), FS, on="force")
    slider = ss.Oscillator(mass=2.42, stiffness=2310, damping=12.0, law=ss.laws.Coulomb(0.0), drive=drive)
    record = ss.Rig.perfect("x", "force").measure(ss.simulate(slider, duration=SECONDS), fs=FS)
    return ss.Record.of(
        {name: record[name] + 0.05 * np.std(record[name]) * chance.standard_normal(len(record)) for name in record},
        fs=FS,
    )


def test_both_find_the_same() -> None:
    record = shaken()
    ours = bench.frequency_response(record, channels=("force", "x"), segment=SEGMENT)
    size = round(SEGMENT * FS)
    theirs = pyfrf.FRF(
        FS,
        exc=record["force"],
        resp=record["x"],
        resp_type="d",
        window="hann",
        nperseg=size,
        noverlap=size // 2,
        fft_len=size,
    )
    lines = np.round(ours.frequency * SEGMENT).astype(int)
    kept = (ours.frequency > 1.0) & (ours.frequency < 40.0)
    for mine, other in (
        (ours.h1, theirs.get_H1()),
        (ours.h2, theirs.get_H2()),
        (ours.coherence, theirs.get_coherence()),
    ):
        # theirs takes no mean off, and fills the last segment up with zeros
        assert np.abs(mine / np.squeeze(other)[lines] - 1)[kept].max() < 0.005
