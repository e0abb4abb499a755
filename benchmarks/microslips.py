"""Micro-slips of rigs by another integrator, told by the acceleration alone, under noise of 0 to 3 %.

    python benchmarks/microslips.py [--rigs 100] [--seed 1]

Contacts that give way before they slide are drawn by chance about the thesis's case of 2.5 Hz (friction, contact
stiffness, damping of the ring) and stepped by the fixed steps of ``tests/stepped.py``, which knows nothing of the
engine. The truth is where its contact is stretched to what it bears. Told are, at each noise, how many micro-slips
that last as long as the answer says it takes are found, how many shorter ones, how many are found where none is, and
in how many rigs the mean count differs from the truth among those that the answer counts.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import stepped
import stickslip as ss
from stickslip.contact.mechanisms import UNTOLD
from stickslip.contact.microslip import microslips_of
from stickslip.contact.ringing import find_ringing

MASS, SPRING, FREQUENCY, AMPLITUDE = 2.42, 2310.0, 2.5, 0.65e-3
FS, STEPS, SETTLE, CYCLES = 4000, 100, 3, 6
NEAR = 4e-3  # s within which a micro-slip found is a true one
SHORT = 0.03  # s: what slips longer goes from one stick to the next
NOISES = (0.0, 0.003, 0.01, 0.03)


def drawn(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations at `FS`, and begin and end of each time that the contact slips."""
    kinetic, contact = rng.uniform(1.05, 1.3), 192e3 * np.exp(rng.uniform(-0.7, 0.4))
    damping = 10 ** rng.uniform(1.0, 2.4)  # of the mass: its ring dies so
    p = np.array([MASS, SPRING, damping, AMPLITUDE, 2 * np.pi * FREQUENCY, kinetic, 0, 0, 0, contact, 0])
    cycle = round(FS / FREQUENCY)
    rows, settle = CYCLES * cycle * STEPS // 10, SETTLE * cycle * STEPS // 10
    x, v, a = stepped._compliant(p, rows, settle, 1 / (FS * STEPS), 10)[0]
    time = (settle + np.arange(rows)) * 10 / (FS * STEPS)
    stretched = SPRING * (AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * time) - x) - damping * v - MASS * a
    slipping = (np.abs(stretched) >= kinetic * (1 - 1e-9)).astype(int)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], slipping, [0]]))).reshape(-1, 2)
    return a[:: STEPS // 10], edges * 10 / (FS * STEPS)


def main() -> None:
    """Draw, ask, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=100, help="at each noise")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    for number, noise in enumerate(NOISES):
        long, short, false, unlike, untold = [], [], 0, 0, 0
        for seed in np.random.SeedSequence([given.seed, number]).spawn(given.rigs):
            rng = np.random.default_rng(seed)
            clean, slips = drawn(rng)
            values = clean + noise * clean.std() * rng.standard_normal(len(clean))
            record = ss.Record.of({"a": values}, fs=FS)
            try:
                ringing = find_ringing(record, "a", question="the bench")
                answer = microslips_of(ringing)
            except ss.errors.EstimateError:
                untold += 1
                continue
            if answer.kind == UNTOLD or answer.status != "ok":
                untold += 1
                continue
            times = np.array([event.time for event in answer.events])
            within, shorter, used = 0, 0, np.zeros(len(times), dtype=bool)
            for window in ringing.windows:
                first, last = (ringing.time(window, row) for row in (window.pieces[0].last, window.pieces[-1].first))
                for begin, end in slips:
                    if first < begin and end < last - NEAR and end - begin < SHORT:
                        near = np.abs(times - begin) < NEAR
                        used |= near
                        (long if end - begin >= answer.shortest else short).append(near.any())
                        within, shorter = within + 1, shorter + (end - begin < answer.shortest and not near.any())
            false += int((~used).sum())
            unlike += len(times) != within - shorter
        told = given.rigs - untold
        print(f"noise {100 * noise:3.1f} %: {given.rigs} rigs, {untold} not told; found {sum(long)} of {len(long)} "
              f"that last long enough, {sum(short)} of {len(short)} shorter ones; {false} where none is; "
              f"counts right in {told - unlike} of {told}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
