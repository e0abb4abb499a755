"""Joints of robots under PD control, by an integrator of our own with nothing of the engine in it.

Moreau's time stepping: in each short step the dry friction takes off as much speed as it can, so that a joint comes to
rest and stays there as long as the friction bears the torque. Gravity, friction in proportion to the torque that
gravity puts on the joint, other friction either way, a controller at 1 kHz, encoder counts, currents with noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

import stickslip as ss

STEPS = 20_000  # a second at least
GAIN = 0.01  # by which the torque's gain and the stated kp are off
# Seven servos as they were identified elsewhere (models with load of Rhoban's bam, parameters of 2024 to 2026):
# armature [kg m^2], Coulomb friction [N m], share of the load, viscous friction [N m s/rad].
SERVOS = {
    "STS3215": (0.0234, 0.0519, 0.208, 0.0338), "MX-64": (0.0110, 0.0615, 0.117, 0.0148),
    "MX-106": (0.0248, 0.1134, 0.108, 0.0119), "XL-320": (0.00148, 0.0108, 0.221, 0.0078),
    "XL-330": (0.00258, 0.0022, 0.252, 0.0178), "eRob80:50": (0.334, 3.454, 0.0631, 1.217),
    "eRob80:100": (0.989, 4.832, 0.148, 7.395),
}  # fmt: skip

PLAY = np.radians([0.05, 1.5])  # of gears, from those of robots to those of toys
COLD = np.zeros(1)  # a temperature that never changes
WARMER = (3.0, 25.0)  # K, by which a joint warms up within its log
PERIOD = 1e-3  # s, for which the controller holds its output
LATE = (0.0, 3e-3, 8e-3, 15e-3, 30e-3)  # s, by which a torque comes late
RISES = (0.15, 1.2)  # of the sliding friction, by which that at rest is above it
FALLS = (0.03, 0.6)  # rad/s, within which it falls: harmonic drives' have 0.02 to 0.5


@dataclass(frozen=True)
class Joint:
    """A joint as it is, and what was logged of it.

    Attributes
    ----------
    servo : str
        Of SERVOS, whose numbers it has but for a factor.
    truth : mapping of str to float
        inertia, forward, back (Coulomb friction), load (part of gravity's torque), viscous, sine, cosine (gravity),
        kp, kd, static (over the sliding friction).
    record : Record
        theta, reference, and where it is measured force [N m], whose gain is off by what is stated; motor, its angle
        before the gear, where the teeth have play.
    kp : (float, float)
        As its owner states it, with the standard deviation of that.
    """

    servo: str
    truth: dict[str, float]
    record: ss.Record
    kp: tuple[float, float]

    def level(self, time: np.ndarray) -> float:
        """Mean of both directions' sliding friction [N m] at vanishing speed, under the mean load at some times."""
        place = self.record["theta"][np.rint(time * self.record.fs).astype(int)]
        load = np.abs(self.truth["sine"] * np.sin(place) + self.truth["cosine"] * np.cos(place))
        level = (self.truth["forward"] + self.truth["back"]) / 2 + self.truth["load"] * float(load.mean())
        return level + self.truth.get("warming", 0.0) * self.warmer(time)

    def static(self, time: np.ndarray) -> float:
        """That at rest [N m], under the same load."""
        rubs = (self.truth["forward"] + self.truth["back"]) / 2
        falling = rubs + self.truth["of_load"] * (self.level(time) - rubs)
        return self.level(time) + (self.truth["static"] - 1) * falling

    def warmer(self, time: np.ndarray) -> float:
        """By how much it was warmer at some times than in the mean of the log [K], of which the truth is told."""
        warm = self.record["temperature"] if "temperature" in self.record else np.zeros(len(self.record))
        return float(warm[np.rint(time * self.record.fs).astype(int)].mean() - warm.mean())


@numba.njit(cache=True)
def march(p, reference, slope, steps, count, control, heat=(COLD, 0.0, 0.0), falls=(2.0, 1.0)):  # type: ignore[no-untyped-def]
    """Angle and motor torque at each sample of a reference that is known at `steps` instants a sample.

    `heat` is a temperature at each sample, less its mean, and what Coulomb and viscous friction grow by per kelvin;
    `falls` the exponent by which static friction falls with the speed, and what part of that of the load does.
    """
    inertia, forward, back, share, viscous, sine, cosine, kp, kd, static, excess_speed = p
    exponent, of_load = falls
    warm, stronger, thicker = heat
    samples = (reference.shape[0] - 1) // steps
    dt = 1.0 / (control * steps)
    angle, torque = np.zeros(samples), np.zeros(samples)
    q, v, motor = reference[0], 0.0, 0.0
    for i in range(samples * steps):
        if i % count == 0:
            motor = kp * (reference[i] - q) + kd * (slope[i] - v)
        if i % steps == count // 2:  # in the middle of what the controller holds
            angle[i // steps], torque[i // steps] = q, motor
        load = sine * np.sin(q) + cosine * np.cos(q)
        hot = warm[i // steps] if len(warm) > 1 else 0.0
        level, borne = forward if v > 0 or (v == 0 and motor > load) else back, share * abs(load)
        excess = (static - 1) * (level + of_load * borne) * np.exp(-((abs(v) / excess_speed) ** exponent))
        level += borne + stronger * hot + excess
        free = v + dt * (motor - load - (viscous + thicker * hot) * v) / inertia
        most = dt * level / inertia
        v = free - most if free > most else free + most if free < -most else 0.0
        q += dt * v
    return angle, torque


@numba.njit(cache=True)
def march_slack(p, slack, reference, slope, steps, count, control):  # type: ignore[no-untyped-def]
    """Angles of motor and link, and motor torque, of a joint whose teeth have play: two masses, each rubbing.

    `slack` has the play [rad], and the link's share of inertia and of friction; the friction of the load is the
    link's. In each step the three impulses, of friction on either side and between the teeth (which do not bounce),
    are found in turn until they agree (Gauss and Seidel).
    """
    inertia, forward, back, share, viscous, sine, cosine, kp, kd, static, excess_speed = p
    play, heavy, rubs = slack
    samples = (reference.shape[0] - 1) // steps
    dt = 1.0 / (control * steps)
    jm, jl = inertia * (1 - heavy), inertia * heavy
    angle, link, torque = np.zeros(samples), np.zeros(samples), np.zeros(samples)
    q, x, v, w, motor = reference[0], reference[0], 0.0, 0.0, 0.0
    on_motor, on_link, teeth = 0.0, 0.0, 0.0
    for i in range(samples * steps):
        if i % count == 0:
            motor = kp * (reference[i] - q) + kd * (slope[i] - v)
        if i % steps == count // 2:
            angle[i // steps], link[i // steps], torque[i // steps] = q, x, motor
        load = sine * np.sin(x) + cosine * np.cos(x)
        level = (forward if w > 0 or (w == 0 and motor > load) else back) * rubs + share * abs(load)
        most_link = dt * level * (1 + (static - 1) * np.exp(-((w / excess_speed) ** 2)))
        level = (forward if v > 0 or (v == 0 and motor > load) else back) * (1 - rubs)
        most_motor = dt * level * (1 + (static - 1) * np.exp(-((v / excess_speed) ** 2)))
        free_v = v + dt * (motor - viscous * (1 - rubs) * v) / jm
        free_w = w + dt * (-load - viscous * rubs * w) / jl
        apart = q - x
        for _ in range(200):
            before_motor, before_link, before_teeth = on_motor, on_link, teeth
            # between the teeth: the motor leads by at most half of the play either way
            ahead = (free_v + on_motor / jm) - (free_w + on_link / jl)
            both = 1 / jm + 1 / jl
            push, pull = (ahead + (apart - play / 2) / dt) / both, (ahead + (apart + play / 2) / dt) / both
            teeth = push if push > 0 else pull if pull < 0 else 0.0
            on_motor = min(max(-jm * (free_v - teeth / jm), -most_motor), most_motor)
            on_link = min(max(-jl * (free_w + teeth / jl), -most_link), most_link)
            change = abs(on_motor - before_motor) + abs(on_link - before_link) + abs(teeth - before_teeth)
            if change <= 1e-9 * (most_motor + most_link):
                break
        v, w = free_v + (on_motor - teeth) / jm, free_w + (on_link + teeth) / jl
        q, x = q + dt * v, x + dt * w
    return angle, link, torque


def _reference(kind: str, time: np.ndarray, chance: np.random.Generator) -> np.ndarray:
    """What the joint is told [rad]: sines about a place, or stairs of minimum jerk with rests between."""
    about, size = chance.uniform(-1.0, 1.0), chance.uniform(0.4, 1.2)
    if kind == "sines":
        tones = np.exp(chance.uniform(np.log(0.15), np.log(1.2), 4))
        weights = chance.uniform(0.4, 1.0, 4) / np.sqrt(tones)
        phases = chance.uniform(0, 2 * np.pi, 4)
        moved = sum(w * np.sin(2 * np.pi * f * time + p) for w, f, p in zip(weights, tones, phases, strict=True))
        return about + size * moved / np.abs(moved).max()
    moved, now, place = np.empty_like(time), 0.0, about
    while now < time[-1]:
        last, lasts, rests = place, chance.uniform(0.4, 2.0), chance.uniform(0.1, 0.8)
        place = about + size * chance.uniform(-1, 1)
        here = (time >= now) & (time <= now + lasts + rests)
        share = np.clip((time[here] - now) / lasts, 0, 1)
        moved[here] = last + (place - last) * (10 * share**3 - 15 * share**4 + 6 * share**5)
        now += lasts + rests
    return moved


def _falling(truth: dict[str, float], chance: np.random.Generator, falls: bool) -> tuple[float, float]:
    """Sets by how much and within which speed friction falls; its exponent, and whether that of the load does."""
    truth["static"] = 1 + np.exp(chance.uniform(*np.log(RISES))) * falls
    truth["fall"] = np.exp(chance.uniform(*np.log(FALLS)))
    return float(chance.choice([1.0, 2.0])), float(chance.choice([0.0, 1.0]))


def delayed(joint: Joint, late: float) -> ss.Record:
    """The log of a joint whose torque comes late [s], its reference left out."""
    time, fs = np.arange(len(joint.record)) / joint.record.fs, joint.record.fs
    written = {
        "theta": joint.record["theta"],
        "force": np.interp(time - late, time, joint.record["force"]),
    }
    return ss.Record.of(written, fs=fs, units={"force": "N m"}).with_details("force", gain_sd=GAIN)


def drawn(
    seed: int,
    *,
    torque: bool,
    seconds: float = 30.0,
    loaded: bool = True,
    play: bool = False,
    warming: bool = False,
    stribeck: bool | None = None,
) -> Joint:
    """A joint by chance, about one of the seven servos; with the motor's torque logged, or positions alone.

    With `warming` it warms up, as one does that is switched on: Coulomb friction falls by up to 1.5 % per kelvin,
    viscous friction by up to 3 %, of a third of them neither; logged in counts of 0.1 or 1 K.
    With `stribeck` its friction falls with the speed by a part of its own, at a speed and with an exponent (1 or 2) of
    its own, that of the load or not; without (False), it is the same at rest.
    With `play` its teeth have some (a third of them none), and both the motor and the link have an encoder.
    """
    chance = np.random.default_rng([seed, torque, loaded])
    servo = str(chance.choice(list(SERVOS)))
    armature, coulomb, share, viscous = SERVOS[servo] * np.exp(chance.uniform(-0.4, 0.4, 4))
    inertia = armature * chance.uniform(1.0, 3.0)
    kp = inertia * (2 * np.pi * chance.uniform(3.0, 8.0)) ** 2
    carried = coulomb * chance.uniform(1.0, 8.0) if loaded else 0.0
    tilt = chance.uniform(-np.pi, np.pi)
    truth = {
        "inertia": inertia, "forward": coulomb * chance.uniform(0.9, 1.1), "back": coulomb * chance.uniform(0.9, 1.1),
        "load": share if loaded else 0.0, "viscous": viscous, "sine": carried * np.cos(tilt),
        "cosine": carried * np.sin(tilt), "kp": kp, "kd": 2 * chance.uniform(0.2, 0.8) * np.sqrt(kp * inertia),
        "static": float(chance.choice([1.0, 1.15, 1.4])), "fall": 0.02,
    }  # fmt: skip
    fs = float(np.exp(chance.uniform(np.log(50), np.log(1000))))
    steps = int(np.ceil(STEPS / fs))
    fine = np.arange(int(seconds * fs) * steps + 1) / (fs * steps)
    reference = _reference(str(chance.choice(["sines", "stairs"])), fine, chance)
    count = max(1, round(fs * steps * PERIOD))
    shape = (2.0, 1.0) if stribeck is None else _falling(truth, np.random.default_rng([seed, 8]), stribeck)
    p, way = np.array(list(truth.values())), np.gradient(reference, fine)
    written = {"reference": reference[count // 2 : -1 : steps]}
    if play:
        size = np.exp(chance.uniform(*np.log(PLAY))) * chance.choice([0.0, 1.0, 1.0])
        slack = np.array([size, *chance.uniform(0.3, 0.7, 2)])
        truth["play"], truth["ratio"] = slack[0], chance.uniform(20, 300)
        turned, angle, motor = march_slack(p, slack, reference, way, steps, count, fs)
        size = 2 * np.pi / 2 ** int(chance.integers(10, 15))
        written["motor"] = np.round(truth["ratio"] * turned / size) * size
    elif warming:
        heat = np.random.default_rng([seed, 7])
        at = np.arange(int(seconds * fs)) / fs
        hot = heat.uniform(*WARMER) * -np.expm1(-at / (seconds * heat.uniform(0.2, 2.0)))
        falls = heat.uniform(0, 1, 2) * (0.015 * coulomb, 0.03 * viscous) * heat.choice([0.0, 1.0, 1.0])
        truth["warming"], truth["thinning"] = -falls
        angle, motor = march(p, reference, way, steps, count, fs, (hot - hot.mean(), -falls[0], -falls[1]))
        written["temperature"] = 298.15 + np.round(hot / (step := heat.choice([0.1, 0.1, 1.0]))) * step
    else:
        angle, motor = march(p, reference, way, steps, count, fs, falls=shape)
    truth["exponent"], truth["of_load"] = shape
    size = 2 * np.pi / 2 ** int(chance.integers(8, 17))
    written["theta"] = np.round(angle / size) * size
    if torque:
        noise = np.abs(motor).max() * 10 ** chance.uniform(-2.5, -1.5)
        written["force"] = (1 + GAIN * chance.standard_normal()) * motor + noise * chance.standard_normal(len(motor))
    units = {"reference": "rad", "force": "N m", "motor": "rad"}
    record = ss.Record.of(written, fs=fs, units={name: units[name] for name in units if name in written})
    if torque:
        record = record.with_details("force", gain_sd=GAIN)
    stated = kp * (1 + GAIN * chance.standard_normal()), GAIN * kp
    return Joint(servo, {name: float(value) for name, value in truth.items()}, record, stated)
