"""Rigs under servo drives, by an integrator of our own with nothing of the engine in it: six laws, rough surfaces,
counts, gains and dampers that are not what is stated.

Runge's and Kutta's steps with bisected turns for a rigid contact; contacts with a memory are stepped twenty times as
finely. Between two steps the base moves along a parabola through what it is at their ends and middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

import stickslip as ss

STEPS = 8  # in a sample, of a rigid contact
FINER = 25  # times as many with a memory
LAWS = ("Coulomb", "static", "Stribeck", "compliant", "state variable", "LuGre")
DRIVES = ("sines", "chirp", "stairs")
WAVES = 12  # that a rough surface is made of


@dataclass(frozen=True)
class Servo:
    """A mass on a spring whose base a servo moves, and what its owner states.

    Attributes
    ----------
    law : str
        Of LAWS.
    numbers : mapping of str to float
        Mass, stiffness, damping, the law's parameters, and the mean of the sliding friction along the way.
    stated : mapping of str to float
        Mass, stiffness and damping as stated.
    records : tuple of Record
        What its sensors wrote.
    """

    law: str
    numbers: dict[str, float]
    stated: dict[str, float]
    records: tuple[ss.Record, ...]


@numba.njit(cache=True)
def _level(x, rough):  # type: ignore[no-untyped-def]
    """Friction at a place over its mean."""
    total = 1.0
    for k in range(rough.shape[0]):
        total += rough[k, 0] * np.cos(rough[k, 1] * x + rough[k, 2])
    return total


@numba.njit(cache=True)
def _passed(x, rough):  # type: ignore[no-untyped-def]
    """Mean of the friction over its level along the way, and the way."""
    total, way = 0.0, 0.0
    for i in range(x.shape[0] - 1):
        step = abs(x[i + 1] - x[i])
        total, way = total + step * _level((x[i] + x[i + 1]) / 2, rough), way + step
    return total / way, way


@numba.njit(cache=True)
def _between(z, i, share):  # type: ignore[no-untyped-def]
    """The base between three instants half a step apart."""
    a, b, c = z[2 * i], z[2 * i + 1], z[2 * i + 2]
    return a + share * (-3 * a + 4 * b - c) + 2 * share * share * (a - 2 * b + c)


@numba.njit(cache=True)
def _rigid(p, z, h, rough):  # type: ignore[no-untyped-def]
    m, k, c, kinetic, static, fall = p[:6]
    count = z.shape[0] // 2
    out = np.zeros(count)
    x, v, way, stuck = z[0], 0.0, 0.0, True

    def pull(z_now, x):  # type: ignore[no-untyped-def]
        return k * (z_now - x)

    for i in range(count):
        out[i] = x
        gone = 0.0
        while gone < 1.0 - 1e-12:
            bears = static * _level(x, rough)
            if stuck:
                if abs(pull(_between(z, i, 1.0), x)) <= bears:
                    break
                low, high = gone, 1.0
                for _ in range(50):
                    middle = (low + high) / 2
                    over = abs(pull(_between(z, i, middle), x)) > bears
                    low, high = (low, middle) if over else (middle, high)
                gone, stuck = high, False
                way = 1.0 if pull(_between(z, i, high), x) > 0 else -1.0
                continue
            low, high, last = gone, 1.0, False
            for attempt in range(50):
                end = high if attempt == 0 else (low + high) / 2
                dt = (end - gone) * h
                xs, vs, ax, av = x, v, 0.0, 0.0
                for stage in range(4):
                    share = gone + (end - gone) * (0.0, 0.5, 0.5, 1.0)[stage]
                    friction = kinetic + (static - kinetic) * np.exp(-((vs / fall) ** 2)) if fall > 0 else kinetic
                    force = pull(_between(z, i, share), xs) - c * vs - way * friction * _level(xs, rough)
                    weight = (1.0, 2.0, 2.0, 1.0)[stage] / 6
                    ax, av = ax + weight * vs, av + weight * force / m
                    ahead = (0.5, 0.5, 1.0, 0.0)[stage] * dt
                    xs, vs = x + ahead * vs, v + ahead * force / m
                new_x, new_v = x + dt * ax, v + dt * av
                if attempt == 0:
                    if new_v * way >= 0:
                        x, v, gone, last = new_x, new_v, 1.0, True
                        break
                    continue
                low, high = (low, end) if new_v * way < 0 else (end, high)
                if new_v * way < 0:
                    low, high = low, end
            if last:
                break
            x, v, gone = new_x, 0.0, min(1.0, high + 1e-12)
            now = pull(_between(z, i, gone), x)
            stuck = abs(now) <= static * _level(x, rough)
            way = way if stuck else (1.0 if now > 0 else -1.0)
    return out


@numba.njit(cache=True)
def _remembering(p, z, h, rough, kind):  # type: ignore[no-untyped-def]
    """Contacts with a memory: a spring that slides (3), friction that lags (4), bristles (5)."""
    m, k, c, kinetic, static, fall, contact, loss, rate, steep = p
    count = z.shape[0] // 2
    out = np.zeros(count)
    x, v, y = z[0], 0.0, 0.0
    for i in range(count):
        out[i] = x
        level = _level(x, rough)
        xs, vs, ys = x, v, y
        sx, sv, sy = 0.0, 0.0, 0.0
        for stage in range(4):
            z_now = _between(z, i, (0.0, 0.5, 0.5, 1.0)[stage])
            if kind == 3:  # y is the contact's deflection, at most what the level bends it by
                friction = contact * ys + loss * vs
                full = kinetic * level
                bent = abs(ys) >= full / contact and ys * vs > 0
                friction = min(max(friction, -full), full) if not bent else (full if ys > 0 else -full)
                dy = 0.0 if bent else vs
                # in slip it stays at its full deflection, whatever its damper adds
                if not bent and abs(contact * ys + loss * vs) >= full:
                    dy = vs
            elif kind == 4:
                friction = ys
                dy = kinetic * rate * (kinetic * level * np.tanh(steep * vs) - ys)
            else:
                bears = (kinetic + (static - kinetic) * np.exp(-((vs / fall) ** 2))) * level
                dy = vs - contact * abs(vs) * ys / bears
                friction = contact * ys + loss * dy
            a = (k * (z_now - xs) - c * vs - friction) / m
            weight = (1.0, 2.0, 2.0, 1.0)[stage] / 6
            sx, sv, sy = sx + weight * vs, sv + weight * a, sy + weight * dy
            ahead = (0.5, 0.5, 1.0, 0.0)[stage] * h
            xs, vs, ys = x + ahead * vs, v + ahead * a, y + ahead * dy
        x, v, y = x + h * sx, v + h * sv, y + h * sy
        if kind == 3:
            full = kinetic * level / contact
            y = min(max(y, -full), full)
    return out


def base(kind: str, time: np.ndarray, natural: float, size: float, chance: np.random.Generator) -> np.ndarray:
    """A servo's motion [m] below and about a natural frequency [Hz], of deviation `size`."""
    if kind == "sines":
        tones = natural * chance.uniform(0.25, 1.5, int(chance.integers(2, 5)))
        moved = sum(
            chance.uniform(0.4, 1.0) * np.sin(2 * np.pi * f * time + chance.uniform(0, 2 * np.pi)) for f in tones
        )
    elif kind == "chirp":
        low, high = natural * chance.uniform(0.2, 0.5), natural * chance.uniform(1.0, 2.0)
        moved = np.sin(2 * np.pi * (low * time + (high - low) * time**2 / (2 * time[-1])))
    else:
        step = chance.uniform(0.6, 1.5) / natural
        edges = np.arange(0, time[-1] + step, step) + 0.1 * step
        levels = np.cumsum(np.append(0.0, chance.choice([-1.0, 1.0, 1.0, -1.5, 2.0], len(edges))))
        levels -= np.linspace(0, levels[-1], len(levels))
        width = chance.uniform(0.08, 0.25) * step
        moved = sum(d * (1 + np.tanh((time - t) / width)) / 2 for d, t in zip(np.diff(levels), edges, strict=True))
    moved = moved - moved.mean()
    return size * moved / moved.std()


def drawn(law: str, chance: np.random.Generator) -> Servo:
    """A rig of a law, by chance: x and z alone, one to three records of 1 to 3 s, and what is wrong with each."""
    mass, natural = np.exp(chance.uniform(np.log([0.3, 2.0]), np.log([10.0, 8.0])))
    stiffness = mass * (2 * np.pi * natural) ** 2
    true = 2 * np.exp(chance.uniform(np.log(0.003), np.log(0.08))) * np.sqrt(stiffness * mass)
    size = 10 ** chance.uniform(-3.3, -2.3)
    kinetic = stiffness * size * chance.uniform(0.15, 0.6)
    speed = 2 * np.pi * natural * size
    static = kinetic * chance.uniform(1.1, 1.5)
    contact = stiffness * np.exp(chance.uniform(np.log(8.0), np.log(60.0)))
    loss = 2 * chance.uniform(0.01, 0.05) * np.sqrt((stiffness + contact) * mass)
    numbers = {
        "mass": mass, "stiffness": stiffness, "damping": true, "kinetic": kinetic,
        "static": static if law in ("static", "Stribeck", "LuGre") else kinetic,
        "fall": speed * chance.uniform(0.05, 0.3) if law in ("Stribeck", "LuGre") else 0.0,
        "contact": contact, "loss": loss, "rate": 2 * np.pi * natural * chance.uniform(2.0, 8.0) / kinetic,
        "steep": chance.uniform(8.0, 30.0) / speed,
    }  # fmt: skip
    p = np.array(list(numbers.values()))
    fs = float(np.clip(60 * natural, 200, 1000))
    rough_share, waves = chance.choice([0.0, 0.01, 0.03]), chance.standard_normal((WAVES, 3))
    rough = np.column_stack([
        rough_share * waves[:, 0] * np.sqrt(1 / WAVES), np.abs(waves[:, 1]) * 6 / size, 10 * waves[:, 2]
    ])  # fmt: skip
    remembers = LAWS.index(law) >= 3
    steps = STEPS * FINER if remembers else STEPS
    records, passed = [], []
    bits = int(chance.choice([12, 16]))
    for _ in range(int(chance.integers(1, 4))):
        settle, seconds = 1.0, chance.uniform(5, 9) / natural
        seconds = float(np.clip(seconds, 0.8, 3.0))
        count = round((settle + seconds) * fs)
        fine = np.arange(2 * count * steps + 1) / (2 * fs * steps)
        z = base(str(chance.choice(DRIVES)), fine, natural, size, chance)
        march = (
            _remembering(p, z, 1 / (fs * steps), rough, LAWS.index(law))
            if remembers
            else _rigid(p, z, 1 / (fs * steps), rough)
        )
        x, z = march[::steps], z[:: 2 * steps][: len(march[::steps])]
        first = round(settle * fs)
        passed.append(_passed(x[first:], rough))
        noise = size * 10 ** chance.uniform(-3.7, -2.7)
        written = {}
        for name, values in (("x", x[first:]), ("z", z[first:])):
            count_size = 8 * size / 2**bits
            read = (1 + 0.005 * chance.standard_normal()) * values + noise * chance.standard_normal(len(values))
            written[name] = np.round(read / count_size) * count_size
        records.append(ss.Record.of(written, fs=fs))
    stated = {
        "mass": mass * (1 + 0.005 * chance.standard_normal()),
        "stiffness": stiffness * (1 + 0.005 * chance.standard_normal()),
        "damping": true * np.exp(chance.uniform(np.log(0.1), np.log(10.0))),
    }
    means, ways = np.array(passed).T
    numbers["level"] = kinetic * float(means @ ways / ways.sum())
    return Servo(
        law,
        {name: float(value) for name, value in numbers.items()},
        {name: float(value) for name, value in stated.items()},
        tuple(records),
    )
