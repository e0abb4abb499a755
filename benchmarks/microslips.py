"""Micro-slips of rigs by another integrator, told by the acceleration alone, under noise of 0 to 3 %.

    python benchmarks/microslips.py [--rigs 100] [--seed 1]

Contacts that give way before they slide are drawn by chance about the thesis's case of 2.5 Hz (friction of 1.2 to
1.34 N, contact dampers of 40 to 170 N s/m) and marched in fixed steps, with nothing of the engine. The truth is where a
contact of spring and damper reaches what it bears. Told are, at each noise, how many micro-slips that last as long as
the answer says it takes are found, how many shorter ones, how many are found where none is, and in how many rigs the
count differs from the truth among those that the answer counts.
"""

from __future__ import annotations

import argparse

import numba
import numpy as np

import stickslip as ss
from stickslip.contact.microslip import microslips_of
from stickslip.contact.ringing import UNTOLD, find_ringing

MASS, SPRING, FREQUENCY, AMPLITUDE = 2.42, 2310.0, 2.5, 0.65e-3
CONTACT = 192e3
FS, FINER, STEPS, SETTLE, CYCLES = 4000, 10, 20, 3, 6
NEAR = 4e-3  # s within which a micro-slip found is a true one
SHORT = 0.03  # s: what slips longer goes from one stick to the next
NOISES = (0.0, 0.003, 0.01, 0.03)


@numba.njit
def _stepped(p, rows, settle, h, steps):  # type: ignore[no-untyped-def]
    """Acceleration at each row, and whether the contact slips: a spring and a damper side by side up to a friction."""
    m, k, amplitude, w, kinetic, contact, loss = p
    a_out, slips = np.zeros(rows), np.zeros(rows)
    x, v, y, way = 0.0, 0.0, 0.0, 0.0
    for number in range((settle + rows) * steps):
        bears = contact * y + loss * v
        if way == 0.0 and abs(bears) >= kinetic:
            way = 1.0 if bears > 0 else -1.0
        creeps = (way * kinetic - contact * y) / loss
        if way != 0.0 and way * creeps >= way * v:  # the deflection would outrun the mass: it holds again
            way = 0.0
        friction = bears if way == 0.0 else way * kinetic
        a = (k * (amplitude * np.sin(w * number * h) - x) - friction) / m
        row = number // steps - settle
        if number % steps == 0 and row >= 0:
            a_out[row], slips[row] = a, abs(way)
        y += h * (v + h / 2 * a if way == 0.0 else creeps)
        v += h * a
        x += h * v
    return a_out, slips


def drawn(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations at `FS`, and begin and end of each time that the contact slips."""
    kinetic, loss = rng.uniform(1.2, 1.34), rng.uniform(40.0, 170.0)
    p = np.array([MASS, SPRING, AMPLITUDE, 2 * np.pi * FREQUENCY, kinetic, CONTACT, loss])
    cycle = round(FS / FREQUENCY) * FINER
    a, slips = _stepped(p, CYCLES * cycle, SETTLE * cycle, 1 / (FS * FINER * STEPS), STEPS)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], slips.astype(int), [0]]))).reshape(-1, 2)
    return a[::FINER], edges / (FS * FINER)


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
        print(
            f"noise {100 * noise:3.1f} %: {given.rigs} rigs, {untold} not told; found {sum(long)} of {len(long)} "
            f"that last long enough, {sum(short)} of {len(short)} shorter ones; {false} where none is; "
            f"counts right in {told - unlike} of {told}",
            flush=True,
        )


if __name__ == "__main__":
    main()
