"""Records with and without planted faults: what the check-up and the repairs are tested on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.signal import butter, sosfiltfilt

from stickslip import Record

Array = NDArray[np.float64]

FS, ROWS = 1000.0, 6000
TIME = np.arange(ROWS) / FS


@dataclass(frozen=True)
class Damaged:
    """A clean record, the same with one fault, and which fault that is."""

    name: str
    clean: Record
    record: Record
    kind: str
    channel: str | None
    rows: tuple[tuple[int, int], ...]


# ---- clean signals: what friction rigs write when nothing is wrong


@cache
def base_excited() -> tuple[Array, Array, Array, Array]:
    """Displacement, velocity, acceleration, friction of a mass on a spring with a shaken end that sticks twice a cycle.

    m = 1 kg, k = (2 pi 5)^2 N/m, Coulomb friction, small steps of time with the velocity stopped where it changes sign.
    """
    fine = 20
    step, stiffness, limit = 1 / FS / fine, (2 * np.pi * 5) ** 2, 2.2
    base = 5e-3 * np.sin(2 * np.pi * 1.5 * np.arange(ROWS * fine) * step)
    x = v = 0.0
    rows = np.empty((4, ROWS))
    for n, z in enumerate(base):
        spring = stiffness * (z - x)
        stuck = v == 0.0 and abs(spring) <= limit
        friction = spring if stuck else limit * np.sign(v if v else spring)
        acceleration = spring - friction
        fresh = v + step * acceleration
        v = 0.0 if v * fresh < 0 else fresh
        x += step * v
        if n % fine == 0:
            rows[:, n // fine] = x, v, acceleration, friction
    return tuple(rows)  # type: ignore[return-value]


def dry_decay() -> Array:
    """Free vibration that dry friction ends: half cycles about alternating centres, then rest [m]."""
    centre, amplitude, cycle = 0.4e-3, 8e-3, 2 * np.pi * 4
    start, sign, x = 0.0, 1.0, np.zeros(ROWS)
    half = np.pi / cycle
    while amplitude > centre:
        inside = (start <= TIME) & (start + half > TIME)
        x[inside] = sign * (centre + (amplitude - centre) * np.cos(cycle * (TIME[inside] - start)))
        amplitude, start, sign = amplitude - 2 * centre, start + half, -sign
    x[start <= TIME] = sign * amplitude
    return x


def pulled_block(peaks: int = 14) -> tuple[Array, Array]:
    """Displacement in steps and spring force in saw teeth of a block pulled by a spring [m], [N]."""
    tooth = ROWS / peaks
    phase = np.arange(ROWS) % tooth / tooth
    slip = np.clip((phase - 0.9) / 0.1, 0, 1)
    moved = np.floor(np.arange(ROWS) / tooth) + 0.5 * (1 - np.cos(np.pi * slip))
    return 1e-3 * moved, 20 + 8 * (np.arange(ROWS) / tooth - moved)


def quantised(values: Array, levels: float) -> Array:
    """The values as an instrument with this many levels across their range would write them."""
    step = np.ptp(values) / levels
    return step * np.round(values / step)


def noisy(values: Array, share: float, rng: np.random.Generator) -> Array:
    """The values with white noise, its standard deviation a share of their range."""
    return values + share * np.ptp(values) * rng.normal(size=len(values))


def clean_signals(seed: int = 0) -> dict[str, tuple[str, Array]]:
    """Name of the signal: channel it is kept in, samples."""
    rng = np.random.default_rng(seed)
    phase, f = rng.uniform(0, 2 * np.pi), rng.uniform(2.3, 6.1)
    sine = 4e-3 * np.sin(2 * np.pi * f * TIME + phase)
    x, v, a, friction = base_excited()
    ringdown = 5e-3 * np.exp(-1.5 * TIME) * np.cos(2 * np.pi * 7.3 * TIME)
    steps, teeth = pulled_block()
    compliant = np.clip(2.6 * 3 * np.sin(2 * np.pi * 1.3 * TIME), -3, 3)
    band = sosfiltfilt(butter(4, 40, fs=FS, output="sos"), rng.normal(size=ROWS))
    return {
        "sine": ("x", sine),
        "sine, noise": ("x", noisy(sine, 0.01, rng)),
        "sine, LVDT steps": ("x", quantised(noisy(sine, 0.002, rng), 60)),
        "sine, steps without noise": ("z", quantised(sine, 200)),
        "sum of sines": ("a", np.sin(2 * np.pi * 3 * TIME) + 0.6 * np.sin(2 * np.pi * 11.7 * TIME + phase)),
        "chirp": ("x", 1e-3 * np.sin(2 * np.pi * (1 * TIME + 4 * TIME**2))),
        "ring-down": ("x", ringdown),
        "ring-down, noise": ("a", noisy(ringdown, 0.004, rng)),
        "ring-down, counts": ("theta", quantised(ringdown, 500)),
        "dry decay to rest": ("x", dry_decay()),
        "dry decay, noise": ("x", noisy(dry_decay(), 0.003, rng)),
        "dry decay, counts": ("theta", quantised(dry_decay(), 120)),
        "sticking": ("x", x),
        "sticking, noise": ("x", noisy(x, 0.004, rng)),
        "sticking, LVDT steps": ("x", quantised(noisy(x, 0.001, rng), 90)),
        "sticking, velocity": ("v", v),
        "sticking, velocity, noise": ("v", noisy(v, 0.01, rng)),
        "sticking, acceleration, noise": ("a", noisy(a, 0.01, rng)),
        "square wave": ("friction", 3 * np.sign(np.sin(2 * np.pi * 2 * TIME + 0.3))),
        "square wave, noise": ("force", noisy(3 * np.sign(np.sin(2 * np.pi * 2 * TIME + 0.3)), 0.01, rng)),
        "square wave, load cell": (
            "load",
            quantised(noisy(3 * np.sign(np.sin(2 * np.pi * 2 * TIME)), 0.004, rng), 300),
        ),
        "friction of a sticking mass": ("friction", friction),
        "friction of a sticking mass, noise": ("load", noisy(friction, 0.01, rng)),
        "compliant contact": ("friction", compliant),
        "compliant contact, load cell": ("load", noisy(compliant, 0.006, rng)),
        "pulled block": ("x", steps),
        "pulled block, laser": ("x", quantised(noisy(steps, 0.0005, rng), 2000)),
        "pulled block, force": ("force", noisy(teeth, 0.01, rng)),
        "white noise": ("sound", rng.normal(size=ROWS)),
        "white noise, 12 bit": ("a", quantised(rng.normal(size=ROWS), 400)),
        "noise of a band": ("y", band),
        "random walk": ("x", np.cumsum(rng.normal(size=ROWS))),
        "ramp, noise": ("x", noisy(5e-3 * TIME, 0.002, rng)),
        "two levels": ("trigger", (np.sin(2 * np.pi * 3 * TIME) > 0).astype(float)),
        "rest, noise": ("x", 1e-6 * rng.normal(size=ROWS)),
        "swept velocity": ("v", cumulative_trapezoid(band, dx=1 / FS, initial=0)),
    }


def clean_records(seed: int = 0) -> dict[str, Record]:
    """Records in which nothing is wrong, by name."""
    records = {name: Record.of({channel: s}, fs=FS) for name, (channel, s) in clean_signals(seed).items()}
    sine = records["sine, noise"]
    # stamps rounded by the instrument, kept by hand: still the same uniform clock
    records["stamps in ms at 300 Hz"] = replace(sine, fs=300.0, stamps=np.round(np.arange(ROWS) / 300.0, 3))
    records["stamps in ms at 2.6 kHz"] = replace(sine, fs=2600.0, stamps=np.round(np.arange(ROWS) / 2600.0, 3))
    return records


# ---- damage


def damaged_records(seed: int = 0) -> Iterator[Damaged]:
    """Every kind of fault in several signals that could hide it."""
    clean, rng = clean_records(seed), np.random.default_rng(1000 + seed)
    for kind, (plant, names) in PLANTS.items():
        for name in names:
            record = clean[name]
            (channel,) = record
            values, rows = plant(record[channel], rng)
            spoilt = replace(record, samples={channel: values})
            yield Damaged(f"{kind} in {name}", record, spoilt, kind.split(",")[0], channel, rows)
    for kind, spoil in CLOCKS.items():
        for name in ("sine, noise", "sticking, LVDT steps", "square wave, noise"):
            spoilt, rows = spoil(clean[name], rng)
            yield Damaged(f"{kind} in {name}", clean[name], spoilt, kind.split(",")[0], None, rows)


def _somewhere(values: Array, length: int, rng: np.random.Generator) -> int:
    """First row of a stretch of `length`, away from the ends, in which the signal moves."""
    starts = np.arange(300, len(values) - 300 - length)
    calm = np.convolve(values, np.ones(25) / 25, "same")
    moved = np.minimum(*(np.abs(v[starts + length] - v[starts]) for v in (calm, values)))
    return int(rng.choice(starts[moved > np.quantile(moved, 0.8)]))


def _missing(values: Array, rng: np.random.Generator) -> tuple[Array, tuple[tuple[int, int], ...]]:
    first = _somewhere(values, 15, rng)
    return np.where((np.arange(ROWS) >= first) & (np.arange(ROWS) < first + 15), np.nan, values), ((first, first + 14),)


def _infinite(values: Array, rng: np.random.Generator) -> tuple[Array, tuple[tuple[int, int], ...]]:
    rows = np.sort(rng.choice(np.arange(100, 5900, 10), 4, replace=False))
    spoilt = values.copy()
    spoilt[rows] = np.inf
    return spoilt, tuple((int(row), int(row)) for row in rows)


def _constant(values: Array, rng: np.random.Generator) -> tuple[Array, tuple[tuple[int, int], ...]]:
    return np.full(ROWS, float(values[rng.integers(ROWS)])), ((0, ROWS - 1),)


def _clipped(low: float, high: float) -> Callable[..., tuple[Array, tuple[tuple[int, int], ...]]]:
    def plant(values: Array, rng: np.random.Generator) -> tuple[Array, tuple[tuple[int, int], ...]]:
        middle = np.median(values)
        half = min(values.max() - middle, middle - values.min())
        spoilt = np.clip(values, middle - low * half, middle + high * half)
        return spoilt, _runs(spoilt != values)

    return plant


def _frozen(length: int) -> Callable[..., tuple[Array, tuple[tuple[int, int], ...]]]:
    def plant(values: Array, rng: np.random.Generator) -> tuple[Array, tuple[tuple[int, int], ...]]:
        first = _somewhere(values, length, rng)
        spoilt = values.copy()
        spoilt[first : first + length] = values[first]
        return spoilt, ((first, first + length - 1),)

    return plant


def _spike(values: Array, rng: np.random.Generator) -> tuple[Array, tuple[tuple[int, int], ...]]:
    rows = np.sort(rng.choice(np.arange(100, 5900, 50), 5, replace=False))
    spoilt = values.copy()
    spoilt[rows] += rng.choice([-1, 1], 5) * rng.uniform(0.5, 1.5, 5) * np.ptp(values)
    return spoilt, tuple((int(row), int(row)) for row in rows)


def _drift(shape: Callable[[Array], Array]) -> Callable[..., tuple[Array, tuple[tuple[int, int], ...]]]:
    def plant(values: Array, rng: np.random.Generator) -> tuple[Array, tuple[tuple[int, int], ...]]:
        drifted = values + rng.uniform(0.5, 1.5) * np.ptp(values) * shape(TIME / TIME[-1])
        return _on_grid(drifted, values), ((0, ROWS - 1),)

    return plant


def _on_grid(values: Array, like: Array) -> Array:
    """The values on the grid that an instrument put `like` on, if it did."""
    levels = np.unique(like)
    step = float(np.min(np.diff(levels)))
    return step * np.round(values / step) if len(levels) < ROWS / 5 else values


def _coarse(values: Array, rng: np.random.Generator) -> tuple[Array, tuple[tuple[int, int], ...]]:
    return quantised(values, rng.uniform(5, 9)), ((0, ROWS - 1),)


def _runs(mask: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    rows = np.flatnonzero(mask)
    return tuple((int(g[0]), int(g[-1])) for g in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1))


SMOOTH = ("sine", "sine, noise", "sine, LVDT steps", "sum of sines", "ring-down", "ring-down, noise", "chirp")
STICKY = ("sticking, noise", "sticking, LVDT steps", "dry decay, noise")
ROUGH = ("white noise", "white noise, 12 bit", "noise of a band")
FORCES = ("square wave, noise", "friction of a sticking mass, noise", "pulled block, force")

PLANTS = {
    "missing": (_missing, ("sine", "sticking, LVDT steps", "square wave, noise", "white noise")),
    "missing, infinite": (_infinite, ("sine, noise", "dry decay to rest", "pulled block, force")),
    "constant": (_constant, ("sine", "sticking, noise", "square wave, load cell")),
    "clipped, both": (_clipped(0.75, 0.75), (*SMOOTH, *ROUGH)),
    "clipped, top": (_clipped(np.inf, 0.6), (*SMOOTH, "white noise")),
    "clipped, bottom": (_clipped(0.6, np.inf), ("sine", "sum of sines", "white noise, 12 bit")),
    "clipped, little": (_clipped(0.92, 0.92), ("sine", "sine, noise", "sine, LVDT steps")),
    "frozen": (_frozen(40), (*SMOOTH, "sticking, noise", "ramp, noise", *ROUGH, *FORCES)),
    "frozen, short": (_frozen(12), ("sine", "white noise", "square wave, noise")),
    "spike": (_spike, (*SMOOTH, *STICKY, *FORCES, "ramp, noise", "pulled block, laser")),
    "drift, straight": (_drift(lambda u: u), ("sine", "sine, noise", "sine, LVDT steps", "sticking, noise")),
    "drift, bent": (_drift(lambda u: u**2 - 0.4 * u), ("sine", "square wave, noise", "sum of sines")),
    "drift, falling": (_drift(lambda u: -u), ("sticking, LVDT steps", "friction of a sticking mass, noise")),
    "coarse": (_coarse, ("sine", "sine, noise", "sticking, noise", "dry decay, noise", "chirp")),
}  # fmt: skip


# ---- damaged clocks


def _stamped(record: Record, stamps: Array, keep: NDArray[np.bool_] | None = None) -> Record:
    keep = np.ones(len(record), dtype=bool) if keep is None else keep
    samples = {name: record[name][keep] for name in record}
    return replace(record, samples=samples, stamps=np.asarray(stamps)[keep])


Spoilt = tuple[Record, tuple[tuple[int, int], ...]]


def _held(record: Record, rng: np.random.Generator) -> Spoilt:
    """A host that reads the port every 62 ms or so, and stamps what it finds with the time of that."""
    host = np.cumsum(rng.normal(0.062, 0.004, 2000))
    stamps = np.round(host[np.searchsorted(host, TIME)], 3)
    return _stamped(record, stamps), ((0, ROWS - 1),)


def _gap(record: Record, rng: np.random.Generator) -> Spoilt:
    """Blocks of samples that were never written."""
    keep = np.ones(ROWS, dtype=bool)
    for first in np.sort(rng.choice(np.arange(200, 5800, 400), 4, replace=False)):
        keep[first : first + rng.integers(2, 30)] = False
    rows = np.flatnonzero(np.diff(np.flatnonzero(keep)) > 1)
    return _stamped(record, TIME, keep), tuple((int(row), int(row) + 1) for row in rows)


def _dropped(record: Record, rng: np.random.Generator) -> Spoilt:
    """One sample in two hundred lost."""
    keep = rng.uniform(size=ROWS) > 0.005
    keep[[0, -1]] = True
    rows = np.flatnonzero(np.diff(np.flatnonzero(keep)) > 1)
    return _stamped(record, TIME, keep), tuple((int(row), int(row) + 1) for row in rows)


def _jitter(record: Record, rng: np.random.Generator) -> Spoilt:
    """Even samples, stamped early or late by up to a third of the interval."""
    return _stamped(record, TIME + rng.uniform(-0.3, 0.3, ROWS) / FS), ((0, ROWS - 1),)


def _uneven_loop(record: Record, rng: np.random.Generator) -> Spoilt:
    """Right stamps of a loop that takes its time: the signal is sampled at uneven instants."""
    instants = np.cumsum(1 + 0.6 * (rng.uniform(size=ROWS) ** 4)) / FS
    instants = instants[instants < TIME[-1]]
    samples = {name: _on_grid(np.interp(instants, TIME, record[name]), record[name]) for name in record}
    return replace(record, samples=samples, stamps=instants), ((0, len(instants) - 1),)


def _back(record: Record, rng: np.random.Generator) -> Spoilt:
    """The host's clock is set back by a quarter of a second while recording."""
    row = int(rng.integers(1000, 5000))
    return _stamped(record, TIME - 0.25 * (np.arange(ROWS) > row)), ((row, row + 1),)


def _repeated(record: Record, rng: np.random.Generator) -> Spoilt:
    """Stamps that were not renewed for one sample."""
    rows = np.sort(rng.choice(np.arange(100, 5900, 20), 6, replace=False))
    stamps = TIME.copy()
    stamps[rows + 1] = stamps[rows]
    return _stamped(record, stamps), tuple((int(row), int(row) + 1) for row in rows)


def _lost_stamps(record: Record, rng: np.random.Generator) -> Spoilt:
    rows = np.sort(rng.choice(np.arange(100, 5900, 20), 5, replace=False))
    stamps = TIME.copy()
    stamps[rows] = np.nan
    return _stamped(record, stamps), tuple((int(row), int(row)) for row in rows)


CLOCKS = {
    "clock": _held, "gap": _gap, "gap, single samples": _dropped, "jitter": _jitter,
    "jitter, uneven loop": _uneven_loop, "backwards": _back, "repeated stamps": _repeated,
    "missing, stamps": _lost_stamps,
}  # fmt: skip
