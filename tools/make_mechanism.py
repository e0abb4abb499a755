"""Make src/stickslip/data/mechanism.json: what the sticks of simulated contacts are like, and how to tell them apart.

Records of a rigid contact, of a compliant one and of friction with a state variable are simulated with random
parameters, noise is added, and ``features`` of the sticks are taken: ``--draw N --seed S FILE`` appends N of them to a
file, one JSON object a line. ``--fit FILES`` fits multinomial logistic regression with a small ridge on three quarters,
prints how it does on the fourth, and writes the weights fitted to all.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

import stickslip as ss
from stickslip.contact.ringing import COLUMNS, FASTEST, columns, features, find_ringing

MASS, STIFFNESS, AMPLITUDE = 2.42, 2310.0, 0.65e-3
NAMES = ("bare spikes", "oscillation without micro-slip", "double stick-slip", "non-sinusoidal oscillation")
KINDS = ("rigid", "compliant", "compliant", "compliant", "state", "state")  # how often each is drawn
NEAR = 0.7  # of the draws lie about the thesis's case of 2.5 Hz, the others far around it
TARGET = Path(__file__).resolve().parents[1] / "src" / "stickslip" / "data" / "mechanism.json"
RIDGE = 0.02


def law_of(kind: str, kinetic: float, rng: np.random.Generator, *, near: bool) -> Any:
    """A law with random parameters; `near` those of the thesis, or far around them."""
    if kind == "rigid":
        return ss.laws.Coulomb(kinetic=kinetic)
    if kind == "state":
        rate, steepness = rng.uniform(60, 220) / kinetic, 10 ** rng.uniform(3.2, 3.8)
        if near:
            rate, steepness = rng.uniform(80, 125), rng.uniform(2200, 4000)
        return ss.laws.SmoothStateVariable(kinetic, rate=rate, steepness=steepness)
    decades, ratio = rng.uniform(1.5, 2.4), 10 ** rng.uniform(-2.2, -0.45)
    if near:
        decades, ratio = rng.uniform(1.85, 2.0), rng.choice([rng.uniform(0.01, 0.08), rng.uniform(0.08, 0.28)])
    contact = STIFFNESS * 10**decades
    return ss.laws.CompliantContact(
        kinetic=kinetic, stiffness=contact, damping=2 * ratio * math.sqrt(MASS * (STIFFNESS + contact))
    )


def truth(kind: str, run: ss.solve.Trajectory, after: float, cycles: float) -> str | None:
    """The name of what was simulated; None where some sticks hold micro-slips and some do not."""
    if kind != "compliant":
        return NAMES[0] if kind == "rigid" else NAMES[3]
    slips = sum(event.kind == "slip" and event.time > after for event in run.events)
    per_stick = (slips / cycles - 2) / 2  # but for two slips a cycle, all are micro-slips
    return NAMES[1] if per_stick < 0.1 else NAMES[2] if per_stick > 0.6 else None


def draw(number: int, seed: int, file: Path) -> None:
    rng = np.random.default_rng(seed)
    with file.open("a", encoding="utf-8") as lines:
        for _ in range(number):
            kind, near = KINDS[rng.integers(len(KINDS))], bool(rng.random() < NEAR)
            frequency = rng.uniform(2.3, 2.7) if near else rng.uniform(1.5, 3.5)
            fs = 4000.0 if near else float(rng.choice([2000, 4000, 8000]))
            share = rng.uniform(0.65, 0.9) if near else rng.uniform(0.55, 0.9)
            law, level = law_of(kind, share * STIFFNESS * AMPLITUDE, rng, near=near), rng.uniform(22, 50)
            drive = ss.drives.HarmonicBase(amplitude=AMPLITUDE, frequency=frequency)
            try:
                run = ss.simulate(ss.Oscillator(mass=MASS, stiffness=STIFFNESS, law=law, drive=drive), cycles=10)
                clean = run.record(fs=fs).between(6 / frequency, 10 / frequency)["a"]
                noisy = clean + rng.normal(size=len(clean)) * clean.std() * 10 ** (-level / 20)
                ringing = find_ringing(ss.Record.of({"a": noisy}, fs=fs), "a", question="a draw")
            except ss.StickslipError:  # it never sticks, or it never slips
                continue
            name = truth(kind, run, 6 / frequency, 4)
            found = features(ringing)
            if name is not None and (ringing.silent or found["frequency"] < FASTEST):
                lines.write(json.dumps({"name": name, "features": found, "level": level}) + "\n")
                lines.flush()


def fit(files: Sequence[Path]) -> None:
    rows = [json.loads(line) for file in files for line in file.read_text("utf-8").splitlines()]
    inputs = np.array([columns(row["features"]) for row in rows])
    kinds = np.array([NAMES.index(row["name"]) for row in rows])
    tested = np.arange(len(rows)) % 4 == 0
    centre, sd = inputs.mean(axis=0), inputs.std(axis=0)
    scaled = np.column_stack([(inputs - centre) / sd, np.ones(len(inputs))])
    probability = np.exp(_log_probability(_weights(scaled[~tested], kinds[~tested]), scaled[tested]))
    right = probability.argmax(axis=1) == kinds[tested]
    print(f"{len(rows)} records, of each kind {np.bincount(kinds).tolist()}")
    print(f"tested on {tested.sum()}: {right.mean():.1%} right")
    sure = probability.max(axis=1)
    for low, high in ((0.0, 0.8), (0.8, 0.95), (0.95, 1.01)):
        these = (sure >= low) & (sure < high)
        if these.any():
            mean = sure[these].mean()
            share = right[these].mean()
            print(f"  said {low:.2f} to {min(high, 1):.2f}: {these.sum()}, mean {mean:.3f}, right {share:.3f}")
    told = {
        "names": NAMES, "columns": COLUMNS, "mean": centre.tolist(), "sd": sd.tolist(), "records": len(rows),
        "weights": _weights(scaled, kinds).tolist(),
        "centres": [inputs[kinds == kind].mean(axis=0).tolist() for kind in range(len(NAMES))],
        "spreads": [np.maximum(inputs[kinds == kind].std(axis=0), 0.1 * sd).tolist() for kind in range(len(NAMES))],
    }  # fmt: skip
    TARGET.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    print(f"wrote {TARGET}")


def _log_probability(weights: np.ndarray, scaled: np.ndarray) -> np.ndarray:
    score = scaled @ weights.T
    return score - logsumexp(score, axis=1, keepdims=True)


def _weights(scaled: np.ndarray, kinds: np.ndarray) -> np.ndarray:
    shape = (len(NAMES), scaled.shape[1])
    share = np.bincount(kinds, minlength=len(NAMES)) / len(kinds)
    balance = 1 / (len(NAMES) * share[kinds])  # each kind counts the same, however often it was drawn

    def loss(flat: np.ndarray) -> tuple[float, np.ndarray]:
        weights = flat.reshape(shape)
        log = _log_probability(weights, scaled)
        error = np.exp(log)
        error[np.arange(len(kinds)), kinds] -= 1
        ridge = RIDGE * np.sum(weights[:, :-1] ** 2)
        slope = (error * balance[:, None]).T @ scaled / len(kinds)
        slope[:, :-1] += 2 * RIDGE / len(kinds) * weights[:, :-1]
        return -float(np.mean(balance * log[np.arange(len(kinds)), kinds])) + ridge / len(kinds), slope.ravel()

    return np.asarray(minimize(loss, np.zeros(shape[0] * shape[1]), jac=True, method="L-BFGS-B").x).reshape(shape)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draw", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--fit", action="store_true")
    parser.add_argument("files", nargs="+", type=Path)
    given = parser.parse_args()
    if given.fit:
        fit(given.files)
    else:
        draw(given.draw, given.seed, given.files[0])
