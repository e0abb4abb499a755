"""Motions with a known answer that several test files share: a mass on a spring over dry friction, in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]


def stick_slip(
    fs: float,
    duration: float,
    *,
    mass: float = 3.0,
    stiffness: float = 1200.0,
    damping: float = 0.7,
    friction: float = 1.0,
    amplitude: float = 1.8e-3,
    frequency: float = 1.0,
) -> dict[str, Array]:
    """Exact t, x, v, a, z and friction f of ``m a + c (v - z') + k (x - z) = -f``: Coulomb's law against the ground.

    The base moves as ``amplitude sin(2 pi frequency t)``; each sliding piece is the sum of two exponentials and the
    forced motion, ended where the velocity first returns to zero; each stuck piece ends where the spring wins.
    """
    w = 2 * np.pi * frequency
    drive = amplitude * (stiffness + 1j * w * damping)
    forced = drive / (stiffness - mass * w**2 + 1j * w * damping)
    roots = np.roots([mass, damping, stiffness])
    t = np.arange(round(duration * fs)) / fs
    out = {name: np.zeros(t.size) for name in "xvaf"}
    ahead = np.arange(1, 4001) / (4000 * frequency)

    def push(time: Array | float, place: float) -> Array:
        return np.imag(drive * np.exp(1j * w * np.asarray(time))) - stiffness * place

    now, x = 0.0, 0.0
    while now < t[-1]:
        pushes = np.abs(push(now + ahead, x)) > friction
        if not pushes.any():
            here = t >= now
            out["x"][here], out["f"][here] = x, push(t[here], x)
            break
        first = int(np.argmax(pushes))
        before = now + ahead[first - 1] if first else now
        if abs(push(before, x)) < friction:
            freed = brentq(lambda s, x=x: abs(push(s, x)) - friction, before, now + ahead[first], xtol=1e-15)
        else:
            freed = now
        here = (t >= now) & (t < freed)
        out["x"][here], out["f"][here] = x, push(t[here], x)
        sign = float(np.sign(push(freed + 1e-9, x)))
        start = forced * np.exp(1j * w * freed)
        rest = [x + sign * friction / stiffness - start.imag, -np.imag(1j * w * start)]
        free = np.linalg.solve(np.array([[1, 1], roots]), np.array(rest, dtype=complex))

        def motion(time, order, free=free, freed=freed, sign=sign):  # type: ignore[no-untyped-def]
            decay = sum(c * r**order * np.exp(r * (time - freed)) for c, r in zip(free, roots, strict=True))
            wave = np.imag((1j * w) ** order * forced * np.exp(1j * w * time))
            return np.real(decay) + wave - (sign * friction / stiffness if order == 0 else 0)

        speed = motion(freed + ahead, 1) * sign
        turn = int(np.flatnonzero((speed[:-1] >= 0) & (speed[1:] < 0))[0])
        stop = brentq(motion, freed + ahead[turn], freed + ahead[turn + 1], args=(1,), xtol=1e-15)
        here = (t >= freed) & (t < stop)
        for order, name in enumerate("xva"):
            out[name][here] = motion(t[here], order)
        out["f"][here] = sign * friction
        now, x = float(stop), float(motion(stop, 0))
    return {"t": t, **out, "z": amplitude * np.sin(w * t)}


def free_decay(
    *,
    damping_ratio: float = 0.0316,
    dry: float = 0.02,
    static: float | None = None,
    amplitude: float = 1.0,
    per_cycle: float = 100.0,
    hold: float = 0.25,
    tail: float = 1.0,
    order: int = 0,
) -> tuple[Array, float, Array]:
    """Exact displacement (or its derivative), sampling rate and extremes of a mass released over dry friction.

    Of ``x'' + 2 zeta w x' + w^2 x = -w^2 dry sign(x')`` from `amplitude`, of 1 Hz were it undamped; `hold` and `tail`
    are in cycles. It stops at the first extreme within `static` (`dry` unless given), or below 1e-4 of the first.
    """
    w, z = 2 * np.pi, damping_ratio
    wd, beta = w * np.sqrt(1 - z**2), z / np.sqrt(1 - z**2)
    fade = np.exp(-np.pi * beta)
    extremes = [amplitude]
    while abs(extremes[-1]) > max(dry if static is None else static, 1e-4 * abs(amplitude)):
        extremes.append(-fade * extremes[-1] + np.sign(extremes[-1]) * (1 + fade) * dry)
    turns = np.array(extremes)
    cycle = 2 * np.pi / wd
    fs = per_cycle / cycle
    halves = len(turns) - 1
    t = np.arange(-round(hold * per_cycle), round((halves / 2 + tail) * per_cycle)) / fs
    number = np.clip(np.floor(2 * t / cycle), 0, halves - 1).astype(int)
    since = t - number * cycle / 2
    side, reach = np.sign(turns[number]), np.abs(turns[number]) - dry
    shape = np.exp(-z * w * since)
    if order == 0:
        moving = side * (dry + reach * shape * (np.cos(wd * since) + beta * np.sin(wd * since)))
        return np.where(t <= 0, amplitude, np.where(t >= halves * cycle / 2, turns[-1], moving)), fs, turns
    if order == 1:
        moving = -side * reach * shape * np.sin(wd * since) * w**2 / wd
    else:
        moving = -side * reach * shape * w**2 * (np.cos(wd * since) - beta * np.sin(wd * since))
    return np.where((t <= 0) | (t >= halves * cycle / 2), 0.0, moving), fs, turns
