"""How surely a record's sticks are read: mechanism, micro-slips and the transition's frequency under noise.

The thesis's case of 2.5 Hz, six cycles at 4 kHz, of a rigid contact, of compliant ones with two, one and no
micro-slips a stick, and of a state variable, seen by an accelerometer with white noise 40 and 25 dB below its
signal. Told are the share of the realisations whose mechanism is named rightly, refused or named wrongly; how far the
micro-slips found lie from the true ones, and how many are missed or false; and, of the transition's frequency, the
error, its size by the 95 % interval, and how often the interval holds the truth.

    python benchmarks/transition.py --draws 200

Beside them stand accelerations alone whose accelerometer is on a mount that nobody states, of 80 to 1000 Hz.
"""

from __future__ import annotations

import argparse
import math

import numpy as np

import stickslip as ss
from stickslip.contact.frequency_transition import transition_of
from stickslip.contact.microslip import microslips_of
from stickslip.contact.ringing import Ringing, find_ringing, mechanism_of

MASS, SPRING, CONTACT, KINETIC, FS, CYCLES = 2.42, 2310.0, 192000.0, 1.1, 4000.0, 6
LEVELS = (40, 25)  # dB
SAME = 3e-3  # s within which a micro-slip found is a true one
NAMED = {
    "rigid": "bare spikes",
    "two micro-slips": "double stick-slip",
    "one micro-slip": "double stick-slip",
    "no micro-slip": "oscillation without micro-slip",
    "state variable": "non-sinusoidal oscillation",
}
DAMPING = {"two micro-slips": 23.8635, "one micro-slip": 200.0, "no micro-slip": 320.0}


def simulated(name: str) -> tuple[ss.Record, ss.solve.Trajectory]:
    if name in DAMPING:
        law = ss.laws.CompliantContact(kinetic=KINETIC, stiffness=CONTACT, damping=DAMPING[name])
    elif name == "rigid":
        law = ss.laws.Coulomb(kinetic=KINETIC)
    else:
        law = ss.laws.SmoothStateVariable(KINETIC, rate=100.0, steepness=3000.0)
    drive = ss.drives.HarmonicBase(amplitude=0.6e-3 if name == "state variable" else 0.65e-3, frequency=2.5)
    run = ss.simulate(ss.Oscillator(mass=MASS, stiffness=SPRING, law=law, drive=drive), cycles=6 + CYCLES)
    return run.record(fs=FS).between(2.4, 2.4 + CYCLES / 2.5), run


def noisy(clean: ss.Record, level: float, seed: int) -> ss.Record:
    values = clean["a"]
    noise = np.random.default_rng(seed).normal(size=len(values)) * values.std() * 10 ** (-level / 20)
    return ss.Record.of({"a": values + noise}, fs=FS, start=clean.start)


def true_slips(run: ss.solve.Trajectory, begin: float, end: float) -> np.ndarray:
    """Times at which the contact slips within a stick: it holds again before a tenth of a cycle is over."""
    slips = [event.time for event in run.events if event.kind == "slip"]
    sticks = [event.time for event in run.events if event.kind == "microstick"]
    return np.array(
        [
            slip
            for slip in slips
            if begin < slip < end and min((stick for stick in sticks if stick > slip), default=math.inf) - slip < 0.04
        ]
    )


def slips_told(ringing: Ringing, true: np.ndarray) -> tuple[list[float], int, int]:
    """Errors of the times [s]; micro-slips missed within the windows looked at; false ones."""
    values = np.array([event.time for event in microslips_of(ringing).events])
    near = [float(np.abs(true - time).min()) if true.size else math.inf for time in values]
    errors = [each for each in near if each < SAME]
    inner = true[(true > values.min() - SAME) & (true < values.max() + SAME)] if values.size else true
    return errors, max(0, len(inner) - len(errors)), len(near) - len(errors)


def row(name: str, level: float, draws: int) -> str:
    clean, run = simulated(name)
    named, sd, inside, off = {"right": 0, "untold": 0, "wrong": 0}, [], [], []
    errors: list[float] = []
    missed = false = 0
    true = true_slips(run, clean.start, clean.start + clean.duration)
    for seed in range(draws):
        record = noisy(clean, level, seed)
        ringing = find_ringing(record, "a", question="the bench")
        answer = mechanism_of(ringing).name
        named["right" if answer == NAMED[name] else "untold" if answer.startswith("cannot") else "wrong"] += 1
        if name not in DAMPING:
            continue
        found = transition_of(ringing, None, None).frequency
        ratio = DAMPING[name] / (2 * math.sqrt(MASS * (SPRING + CONTACT)))
        frequency = math.sqrt((SPRING + CONTACT) / MASS * (1 - ratio**2)) / (2 * math.pi)
        off.append(found.value / frequency - 1)
        sd.append(found.sd / frequency)
        inside.append(found.interval[0] <= frequency <= found.interval[1])
        if name != "no micro-slip":
            told = slips_told(ringing, true)
            errors += told[0]
            missed, false = missed + told[1], false + told[2]
    words = f"{name:16}{level:4} dB  named " + " ".join(f"{key} {100 * n / draws:5.1f} %" for key, n in named.items())
    if off:
        worst = 100 * float(np.abs(off).max())
        rms = 100 * float(np.sqrt(np.mean(np.square(off))))
        words += f"  frequency off {rms:.3f} % rms, {worst:.2f} % most, sd told {100 * float(np.median(sd)):.3f} %, "
        words += f"intervals hold {100 * float(np.mean(inside)):.1f} %"
    if errors:
        far = 1e3 * float(np.max(errors))
        words += f"  micro-slips off {1e3 * float(np.sqrt(np.mean(np.square(errors)))):.3f} ms rms, {far:.2f} ms most, "
        words += f"missed {missed}, false {false} of {missed + len(errors)}"
    return words


def behind_a_mount(name: str, draws: int) -> str:
    """What is told of an acceleration alone at 40 dB through a mount that is not stated, and how surely."""
    _, run = simulated(name)
    told: dict[str, list[float]] = {}
    for seed in range(draws):
        rng = np.random.default_rng(seed)
        mount = ss.rig.Mount(80 * 12.5 ** rng.random(), 0.02 * 10 ** rng.random())
        seen = ss.Rig.perfect().having("a", mount=mount).measure(run, fs=FS, start=2.4)
        answer = mechanism_of(find_ringing(noisy(seen, LEVELS[0], seed), "a", question="the bench"))
        told.setdefault(answer.name, []).append(answer.probability)
    named = [f"{each} {len(sure)} ({np.mean(sure):.2f})" for each, sure in sorted(told.items())]
    return f"{name:16} behind a mount: " + ", ".join(named)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--mounts", type=int, default=20, help="realisations with a mount that is not stated")
    given = parser.parse_args()
    print(f"\nMechanisms, micro-slips and the transition: {given.draws} realisations each")
    for level in LEVELS:
        for name in NAMED:
            print("  " + row(name, level, given.draws), flush=True)
    for name in NAMED:
        print("  " + behind_a_mount(name, given.mounts), flush=True)


if __name__ == "__main__":
    main()
