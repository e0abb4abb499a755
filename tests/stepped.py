"""Rigs by an integrator of our own with nothing of the engine in it: fixed Runge-Kutta steps, bisected turns.

What is tried on the engine's twins is drawn here, so that a fault of the engine is no truth of a test.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

import stickslip as ss

STEPS = 16  # in a sample: the displacement is then right to 1e-9 of its amplitude
KINDS = ("Coulomb", "static", "Stribeck", "compliant", "LuGre", "state variable", "viscous", "none")
SOFT = ("compliant", "LuGre", "state variable")  # contacts that do not stick: no stops are counted of them
STILL = 1e-4  # of the base's velocity: where the state variable's backbone turns over


@dataclass(frozen=True)
class Rig:
    """A mass on a spring, its base shaken or `pulled` at a speed, against a friction (kinetic + drop
    exp(-(|v|/speed)^exponent)) sgn v + slope v, a spring, or a memory.

    A contact that gives way has a damping `loss` [N s/m]; in slip its spring relaxes as that lets it. LuGre's bristles
    have that stiffness and damping and fall along the same curve; the state variable's force follows Coulomb's at the
    `rate` [1/s]. The forces of a rigid contact stray by a share `rough` along the surface.
    """

    kind: str
    mass: float
    stiffness: float
    damping: float
    amplitude: float
    frequency: float
    kinetic: float = 0.0
    static: float = 0.0
    slope: float = 0.0
    speed: float = 0.0
    contact: float = 0.0
    loss: float = 0.0
    rate: float = 0.0
    exponent: float = 1.0
    rough: float = 0.0
    pulled: float = 0.0

    def friction(self, speed: float) -> float:
        """At a steady speed, the slope left out: what "sliding friction" is at the mean speed at which it slides."""
        if not self.speed:
            return self.kinetic
        return self.kinetic + (self.static - self.kinetic) * np.exp(-((speed / self.speed) ** self.exponent))

    @property
    def stated(self) -> dict[str, float]:
        """What its user knows."""
        return {"mass": self.mass, "stiffness": self.stiffness, "damping": self.damping}


@numba.njit(cache=True)
def along(x, amplitude, rough):  # type: ignore[no-untyped-def]
    """Friction at a place over its mean, which strays by a share: three waves along the surface."""
    place = x / amplitude if rough else x
    return 1 + rough * np.sqrt(2 / 3) * (np.sin(7 * place) + np.sin(17 * place + 1) + np.sin(29 * place + 2))


def passed(x: np.ndarray, rig: Rig) -> float:
    """Mean of the friction over its level along the way that a rig went."""
    return float(np.average(along((x[1:] + x[:-1]) / 2, rig.amplitude, rig.rough), weights=np.abs(np.diff(x))))


@numba.njit(cache=True)
def based(t, p):  # type: ignore[no-untyped-def]
    """Where the base is."""
    return p[3] * np.sin(p[4] * t) + p[14] * t


@numba.njit(cache=True)
def _accelerated(t, x, v, way, p):  # type: ignore[no-untyped-def]
    m, k, c, amplitude, _, kinetic, static, slope, speed = p[:9]
    drop = (static - kinetic) * np.exp(-((abs(v) / speed) ** p[11])) if speed > 0 else 0.0
    dry = (kinetic + drop) * along(x, amplitude, p[12])
    return (k * (based(t, p) - x) - c * v - way * dry - slope * v) / m


@numba.njit(cache=True)
def _step(t, x, v, way, h, p):  # type: ignore[no-untyped-def]
    a1 = _accelerated(t, x, v, way, p)
    a2 = _accelerated(t + h / 2, x + h / 2 * v, v + h / 2 * a1, way, p)
    a3 = _accelerated(t + h / 2, x + h / 2 * (v + h / 2 * a1), v + h / 2 * a2, way, p)
    a4 = _accelerated(t + h, x + h * (v + h / 2 * a2), v + h * a3, way, p)
    return x + h * v + h * h / 6 * (a1 + a2 + a3), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


@numba.njit(cache=True)
def _rigid(p, samples, settle, h, steps):  # type: ignore[no-untyped-def]
    """Displacement, velocity and acceleration at each sample; time stuck, and stops."""
    k, amplitude, static = p[1], p[3], p[6]
    out = np.zeros((3, samples))
    x, v, t, way, stuck, held, stops = 0.0, 0.0, 0.0, 0, True, 0.0, 0
    for number in range((settle + samples - 1) * steps + 1):
        row = number // steps - settle
        if number % steps == 0 and row >= 0:
            out[0, row], out[1, row] = x, v
            out[2, row] = 0.0 if stuck else _accelerated(t, x, v, way, p)
        left = h
        while left > 1e-15 * h:
            if stuck:
                pull, bears = k * (based(t + left, p) - x), static * along(x, amplitude, p[12])
                if abs(pull) <= bears:
                    held += left if row >= 0 else 0.0
                    t, left = t + left, 0.0
                    continue
                low, high = 0.0, left  # the instant at which the pull passes what the contact bears
                for _ in range(60):
                    middle = (low + high) / 2
                    over = abs(k * (based(t + middle, p) - x)) > bears
                    low, high = (low, middle) if over else (middle, high)
                held += high if row >= 0 else 0.0
                t, left, stuck, way = t + high, left - high, False, 1 if pull > 0 else -1
                continue
            new_x, new_v = _step(t, x, v, way, left, p)
            if new_v * way >= 0 or p[5] + p[6] == 0.0:
                x, v, t, left = new_x, new_v, t + left, 0.0
                continue
            low, high = 0.0, left  # the instant at which it turns
            for _ in range(60):
                middle = (low + high) / 2
                turned = _step(t, x, v, way, middle, p)[1] * way < 0
                low, high = (low, middle) if turned else (middle, high)
            x, v = _step(t, x, v, way, high, p)[0], 0.0
            t, left = t + high, left - high
            pull = k * (based(t, p) - x)
            stuck = abs(pull) <= static * along(x, amplitude, p[12])
            stops += 1 if stuck and row >= 0 else 0
            way = way if stuck else (1 if pull > 0 else -1)
    return out, held, stops


@numba.njit(cache=True)
def _compliant(p, samples, settle, h, steps):  # type: ignore[no-untyped-def]
    """The same of a contact that is a spring beside a damper until it slides; no sticks are counted."""
    m, k, c, amplitude, w, kinetic, stiffness, loss = p[0], p[1], p[2], p[3], p[4], p[5], p[9], p[13]
    relaxed = np.exp(-h * stiffness / loss) if loss > 0 else 0.0  # of the deflection in slip, what a step leaves
    out = np.zeros((3, samples))
    x, v, t, y, f = 0.0, 0.0, 0.0, 0.0, 0.0
    for number in range((settle + samples - 1) * steps + 1):
        a = (k * (amplitude * np.sin(w * t) - x) - c * v - f) / m
        row = number // steps - settle
        if number % steps == 0 and row >= 0:
            out[0, row], out[1, row], out[2, row] = x, v, a
        half_v = v + h / 2 * a  # leap-frog: the contact is clipped at what it bears
        x += h * half_v
        f = stiffness * (y + h * half_v) + loss * half_v
        if abs(f) < kinetic:
            y += h * half_v
        else:
            f = np.sign(f) * kinetic
            y = f / stiffness + (y - f / stiffness) * relaxed
        t += h
        v = (half_v + h / 2 * (k * (amplitude * np.sin(w * t) - x) - f) / m) / (1 + h / 2 * c / m)
    return out, 0.0, 0


@numba.njit(cache=True)
def _remembering(p, samples, settle, h, steps):  # type: ignore[no-untyped-def]
    """The same of a friction that remembers: its own equation solved exactly in each step, at the step's velocity."""
    m, k, c, amplitude, w, kinetic, static, _, speed, stiffness, rate, exponent = p[:12]
    out, loss = np.zeros((3, samples)), p[13]
    x, v, t, f, friction = 0.0, 0.0, 0.0, 0.0, 0.0
    for number in range((settle + samples - 1) * steps + 1):
        a = (k * (amplitude * np.sin(w * t) - x) - c * v - friction) / m
        row = number // steps - settle
        if number % steps == 0 and row >= 0:
            out[0, row], out[1, row], out[2, row] = x, v, a
        half_v = v + h / 2 * a
        x += h * half_v
        t += h
        if stiffness > 0:  # f' = stiffness (v - |v| f / level)
            level = kinetic + (static - kinetic) * np.exp(-((abs(half_v) / speed) ** exponent))
            towards, quick = level * np.sign(half_v), stiffness * abs(half_v) / level
        else:
            towards, quick = kinetic * np.tanh(half_v / (STILL * amplitude * w)), rate
        before, f = f, towards + (f - towards) * np.exp(-quick * h)
        friction = f + (loss * (f - before) / (h * stiffness) if loss else 0.0)  # the bristles' own damper
        v = (half_v + h / 2 * (k * (amplitude * np.sin(w * t) - x) - friction) / m) / (1 + h / 2 * c / m)
    return out, 0.0, 0


def marched(rig: Rig, samples: int, settle: int, fs: float, steps: int) -> tuple[np.ndarray, float, int]:
    """Displacement, velocity and acceleration at each sample, after `settle` others; time stuck [s], and stops."""
    p = np.array([
        rig.mass, rig.stiffness, rig.damping, rig.amplitude, 2 * np.pi * rig.frequency, rig.kinetic,
        max(rig.static, rig.kinetic), rig.slope, rig.speed, rig.contact, rig.rate,
        rig.exponent, rig.rough, rig.loss, rig.pulled,
    ])  # fmt: skip
    march = {"compliant": _compliant, "LuGre": _remembering, "state variable": _remembering}.get(rig.kind, _rigid)
    return march(p, samples, settle, 1 / (fs * steps), steps)


def _written(values: np.ndarray, gain: float, level: float, rng: np.random.Generator, *, dirty: bool) -> np.ndarray:
    """A sensor's: with noise and a gain; a dirty one with an offset, a drift, and counts of 12 bits, too."""
    own = gain * values + level * rng.standard_normal(len(values))
    if not dirty:
        return own
    size = float(np.ptp(values))
    own += size * (rng.uniform(-0.2, 0.2) + rng.uniform(-0.02, 0.02) * np.linspace(0, 1, len(values)))
    count = 1.5 * size / 4096
    return count * np.round(own / count)


def record(
    rig: Rig,
    rng: np.random.Generator,
    *,
    noise: float = 1e-3,
    cycles: int = 10,
    off: float = 0.0,
    felt: bool = False,
    dirty: bool | None = None,
) -> ss.Record:
    """What its sensors write of it: x and z with noise (a share of the base's amplitude), dirty where gains are off
    and nothing else is said; `felt`, an accelerometer and a load cell beside them."""
    fs = float(np.clip(400 * rig.frequency, 200, 5000))
    cycle = fs / rig.frequency
    samples, settle = round(cycles * cycle), round(30 * cycle)
    (x, v, a), held, stops = marched(rig, samples, settle, fs, 20 * STEPS if rig.kind in SOFT else STEPS)
    time = (settle + np.arange(samples)) / fs
    z = rig.amplitude * np.sin(2 * np.pi * rig.frequency * time) + rig.pulled * time
    true = {"x": x, "z": z}
    levels = dict.fromkeys("xz", noise * (rig.amplitude or rig.pulled / rig.frequency))
    if felt:
        true |= {"a": a, "load": rig.stiffness * (z - x) - rig.damping * v - rig.mass * a}
        levels |= {name: noise * float(np.ptp(true[name])) for name in ("a", "load")}
    gains = 1 + off * rng.standard_normal(len(true))
    dirt = off > 0 if dirty is None else dirty
    written = {
        name: _written(values, gain, levels[name], rng, dirty=dirt)
        for gain, (name, values) in zip(gains, true.items(), strict=True)
    }
    fast = np.abs(v)[np.abs(v) > 0.2 * np.abs(v).max()]
    level = rig.friction(float(fast.mean()))
    about = fast - fast.mean()
    slope = rig.slope + float(about @ [rig.friction(speed) for speed in fast] / (about @ about))
    power = [rig.friction(abs(one)) * abs(one) + rig.slope * one * one for one in v]
    truth: dict[str, Any] = {
        "sliding friction": level, "slope of friction against speed": slope,
        "stuck share of the time": held * fs / samples, "stops per cycle": stops / cycles,
        "static over sliding friction": max(1.0, rig.static / level) if rig.kinetic else np.nan,
        "energy per cycle": float(np.mean(power)) / rig.frequency,
    }  # fmt: skip
    return ss.Record.of(written, fs=fs, truth=truth)


def drawn(kind: str, rng: np.random.Generator) -> Rig:
    """A rig of a kind, by chance: 0.1 to 20 kg, 0.2 to 15 Hz, shaken below to above its resonance."""
    mass, natural = np.exp(rng.uniform(np.log([0.1, 0.5]), np.log([20.0, 12.0])))
    stiffness = mass * (2 * np.pi * natural) ** 2
    frequency, amplitude = natural * rng.uniform(0.3, 1.6), 10 ** rng.uniform(-3.5, -2.3)
    damping = 2 * rng.uniform(0.001, 0.03) * np.sqrt(stiffness * mass)
    begun = Rig(kind, mass, stiffness, damping, amplitude, frequency)
    pull = stiffness * amplitude  # what shakes it: friction of a share of it lets it move
    kinetic, more = {}, {}
    if kind not in ("viscous", "none"):
        kinetic = {"kinetic": pull * rng.uniform(0.1, 0.6)}
    if kind in ("static", "Stribeck", "LuGre"):
        more["static"] = kinetic["kinetic"] * rng.uniform(1.1, 1.6)
    if kind == "LuGre":
        more["exponent"] = 2.0
    if kind in ("Stribeck", "LuGre"):
        more["speed"] = rng.uniform(0.05, 0.3) * amplitude * 2 * np.pi * frequency
    if kind == "viscous":
        more["slope"] = rng.uniform(0.1, 0.5) * np.sqrt(stiffness * mass)
    if kind in ("compliant", "LuGre"):
        more["contact"] = stiffness * rng.uniform(5, 50)
    if kind == "state variable":
        more["rate"] = 2 * np.pi * frequency * rng.uniform(3, 30)
    return Rig(**{**vars(begun), **kinetic, **more})
