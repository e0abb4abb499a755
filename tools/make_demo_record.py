"""Make the bundled demonstration record: a thesis-like rig in stick-slip, seen by sensors with noise and counts.

    python tools/make_demo_record.py            writes src/stickslip/data/demo.npz and demo.json

The rig: a mass on a spring whose other end moves harmonically, a light viscous damper and a dry contact to the ground.

    m x'' = k (z - x) - c x' - f,    f = f_k sign(x') in motion,  |f| <= f_s at rest,    z = Z sin(2 pi F t)

Between events the motion is smooth; scipy's solve_ivp finds the events (a stop, a breakaway). Mass, stiffness, damping
ratio, base amplitude and sensor resolution are those of Liang's thesis (sections 2.2 and 3.6, table 3.3).
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

DATA = Path(__file__).resolve().parents[1] / "src" / "stickslip" / "data"


@dataclass(frozen=True)
class Rig:
    """The rig's constants, SI."""

    mass: float = 2.42
    stiffness: float = 2310.0
    damping_ratio: float = 0.0008
    kinetic: float = 1.1
    static: float = 1.2
    amplitude: float = 0.65e-3
    frequency: float = 2.5

    @property
    def damping(self) -> float:
        return 2 * self.damping_ratio * math.sqrt(self.stiffness * self.mass)

    def base(self, t: float | NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(self.amplitude * np.sin(2 * math.pi * self.frequency * np.asarray(t)))

    def spring(self, t: float, x: float) -> float:
        return float(self.stiffness * (self.base(t) - x))


@dataclass(frozen=True)
class Piece:
    """The motion between two events: sliding forward (+1), back (-1), or stuck (0)."""

    direction: int
    start: float
    end: float
    states: NDArray[np.float64]  # x, v at `times`
    times: NDArray[np.float64]
    first: float  # x at both ends [m]; the mass is at rest there
    last: float


@dataclass(frozen=True)
class Sensor:
    """One recorded channel: Gaussian noise [unit], then rounding to counts of `step` [unit]."""

    unit: str
    noise: float
    step: float
    words: str


SENSORS = {
    "x": Sensor("m", 1e-6, 2.5e-6, "LVDT on the mass, 2.5 um counts"),
    "z": Sensor("m", 1e-6, 2.5e-6, "LVDT on the base, 2.5 um counts"),
    "a": Sensor("m/s^2", 0.04, 1e-3, "accelerometer on the mass, 1 mm/s^2 counts"),
    "load": Sensor("N", 2e-3, 2e-4, "load cell in the friction path, 0.2 mN counts"),
}


def simulate(rig: Rig, times: NDArray[np.float64], settle: float) -> list[Piece]:
    """The pieces of motion from rest, sampled at `times`; those before `settle` are run through but not sampled."""
    t, x, direction = 0.0, 0.0, 0
    pieces = []
    while t < times[-1]:
        piece = _run_piece(rig, direction, t, x, times[times >= settle])
        pieces.append(piece)
        t, x = piece.end, piece.last
        direction = _next_direction(rig, direction, t, x)
    return [piece for piece in pieces if piece.end > settle]


def _run_piece(rig: Rig, direction: int, t: float, x: float, times: NDArray[np.float64]) -> Piece:
    def rates(t: float, state: NDArray[np.float64]) -> list[float]:
        if direction == 0:
            return [0.0, 0.0]
        force = rig.spring(t, state[0]) - rig.damping * state[1] - direction * rig.kinetic
        return [state[1], force / rig.mass]

    def stops(t: float, state: NDArray[np.float64]) -> float:
        return float(direction * state[1])

    def breaks_away(t: float, state: NDArray[np.float64]) -> float:
        return rig.static - abs(rig.spring(t, state[0]))

    event = breaks_away if direction == 0 else stops
    event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
    end = times[-1] + 1 / rig.frequency
    options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-14, "max_step": 0.01 / rig.frequency}
    run = solve_ivp(rates, (t, end), [x, 0.0], events=event, dense_output=True, **options)
    inside = times[(times >= t) & (times < run.t[-1])]
    states = run.sol(inside) if len(inside) else np.empty((2, 0))
    return Piece(direction, t, float(run.t[-1]), states, inside, x, float(run.y[0, -1]))


def _next_direction(rig: Rig, direction: int, t: float, x: float) -> int:
    spring = rig.spring(t, x)
    if direction == 0 or abs(spring) > rig.static:
        return 1 if spring > 0 else -1
    return 0


def friction(rig: Rig, piece: Piece) -> NDArray[np.float64]:
    """The friction force [N] at the piece's times: kinetic in motion, what the spring asks for at rest."""
    if piece.direction:
        return np.full(len(piece.times), piece.direction * rig.kinetic)
    return np.asarray(rig.stiffness * (rig.base(piece.times) - piece.states[0]))


def measure(rig: Rig, pieces: list[Piece], seed: int) -> dict[str, NDArray[np.int16]]:
    """What the sensors write, in counts."""
    t, x, v = (np.concatenate(part) for part in zip(*[(p.times, *p.states) for p in pieces], strict=True))
    f = np.concatenate([friction(rig, piece) for piece in pieces])
    a = (rig.stiffness * (rig.base(t) - x) - rig.damping * v - f) / rig.mass
    rng = np.random.default_rng(seed)
    true = {"x": x, "z": rig.base(t), "a": a, "load": f}
    return {
        name: np.rint((true[name] + rng.normal(0, sensor.noise, len(t))) / sensor.step).astype(np.int16)
        for name, sensor in SENSORS.items()
    }


def answers(rig: Rig, pieces: list[Piece], first: float, last: float) -> dict[str, object]:
    """The true answers over the recorded span (a whole number of cycles), by the names of the estimates."""
    cycles = (last - first) * rig.frequency
    sticks = [(max(p.start, first), min(p.end, last), p.start) for p in pieces if p.direction == 0 and p.start < last]
    slid = sum(_distance(piece, first, last) for piece in pieces if piece.direction)
    level = dict.fromkeys(("sliding friction", "sliding friction forward", "sliding friction back"), rig.kinetic)
    return {
        "mass": rig.mass,
        "stiffness": rig.stiffness,
        "damping": rig.damping,
        **level,
        "friction offset": 0.0,
        "slope of friction against speed": 0.0,
        "energy per cycle": rig.kinetic * slid / cycles,
        "forcing frequency": rig.frequency,
        "stuck share of the time": sum(end - start for start, end, _ in sticks) / (last - first),
        "stops per cycle": sum(began >= first for *_, began in sticks) / cycles,
        "static friction": rig.static,
        "sticks": [[round(start - first, 7), round(end - first, 7)] for start, end, _ in sticks],
    }


def _distance(piece: Piece, first: float, last: float) -> float:
    if piece.start >= first and piece.end <= last:
        return abs(piece.last - piece.first)
    return float(np.ptp(piece.states[0])) if len(piece.times) else 0.0  # cut by the record's end: what was sampled


def make(
    rig: Rig, *, fs: float = 2000.0, cycles: int = 30, settle: int = 10, seed: int = 20251
) -> tuple[dict[str, NDArray[np.int16]], dict[str, object]]:
    """Counts of each channel, and what goes with them."""
    first = settle / rig.frequency
    times = first + np.arange(round(cycles / rig.frequency * fs)) / fs
    pieces = simulate(rig, times, first)
    last = first + len(times) / fs
    settings = {"fs": fs, "cycles": cycles, "settle": settle, "seed": seed, **asdict(rig)}
    outcome = "simulated with scipy solve_ivp (DOP853 with events), then sensor noise and counts"
    about = {
        "fs": fs,
        "sensors": {name: asdict(sensor) for name, sensor in SENSORS.items()},
        "history": [{"action": "tools/make_demo_record.py", "arguments": settings, "outcome": outcome}],
        "truth": answers(rig, pieces, first, last),
    }
    return measure(rig, pieces, seed), about


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=DATA, help="where demo.npz and demo.json go")
    folder = parser.parse_args().folder
    counts, about = make(Rig())
    np.savez_compressed(folder / "demo.npz", **counts)
    (folder / "demo.json").write_text(json.dumps(about, indent=1) + "\n", "utf-8")
    size = (folder / "demo.npz").stat().st_size
    print(f"{len(counts['x'])} samples of {', '.join(counts)} in {size / 1024:.0f} kB; truth {about['truth']}")


if __name__ == "__main__":
    main()
