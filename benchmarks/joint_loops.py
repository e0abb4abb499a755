"""How often do a joint's intervals hold where its controller is a computer: held, late, and with an encoder of its own?

Joints of a third integrator: Runge and Kutta's fourth order at 20 kHz, at rest as long as friction bears the torque.
A PD controller at 1 kHz reads counts of 10 to 16 bit, computes for none to three of its periods, and holds its
output; logged are counts and reference at its own instants, at 100 Hz to 1 kHz. Its kp is stated, and its kd or not;
"speed": it damps the measured speed in place of the error's; "torque": what it sets is logged, with noise, as where
it also integrates its error ("torque of a PID"), is limited ("saturated"), or the motor cogs ("cogging"); "PID": it
integrates its error and logs no torque, "PI of the speed": it integrates that of a speed in proportion to the error, as
drives do. "M1" to "M6": a load test by a pendulum, of a servo that rubs by that law of Duclusaud and others (2024,
arXiv:2410.08650), with its torque or by its controller; printed is too which laws the logs leave. Counted are the
numbers that stand without a grave doubt. With --predict the first half of each log tells the joint, and moves it along
the second: of the kinds without a torque inside its loop, of the others by the torque.

    python benchmarks/joint_loops.py --draws 40 --first 70000
    python benchmarks/joint_loops.py --draws 40 --first 120000 --kinds "kd unknown,kd stated,torque" --predict
    python benchmarks/joint_loops.py --draws 20 --first 310000 --kinds M1,M2,M3,M4,M5,M6
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numba
import numpy as np

import stickslip as ss
from stickslip.answers.arm import Joint
from stickslip.cycle.joint import LAWS

FINE, CONTROL = 20_000, 1_000  # steps and periods of the controller in a second
SECONDS = 30
KINDS = (
    "kd unknown", "kd stated", "speed", "torque", "speed with kd stated", "torque of a PID", "saturated", "cogging",
    "PID", "PI of the speed", "M1", "M2", "M3", "M4", "M5", "M6",
)  # fmt: skip
LOGGED = ("torque", "torque of a PID", "saturated", "cogging")  # kinds whose torque is
OF_SPEED = ("speed", "speed with kd stated", "PI of the speed")
STATED = ("kd stated", "speed with kd stated", "PID")
TOLD = ("level", "forward", "back", "load", "viscous", "inertia", "sine", "cosine", "damping", "delay")

PLAIN = np.zeros(8)  # friction that takes nothing of the motor's torque, and does not fall
# Servos as they were identified elsewhere (Rhoban's bam, 2024 to 2026; what came out at none there is a tenth of its
# like): inertia, Coulomb friction, its excess at rest, load part (M3, M4) and its excess, parts of the motor's and of
# gravity's torque (M5, M6), their excesses, those of their squares, Stribeck speed and exponent, viscous friction, and
# gravity's torque of a payload that it carries well.
SERVOS = {
    "MX-64": (0.0123, 0.0561, 0.0819, 0.117, 0.05, 0.311, 0.02, 0.188, 0.014, 0.0069, 0.01, 2.6, 1.0, 0.0253, 1.0),
    "MX-106": (0.026, 0.1134, 0.122, 0.108, 0.2, 0.198, 0.022, 0.199, 0.087, 0.01, 1e-4, 1.75, 1.14, 0.0507, 1.5),
    "XL-320": (0.0012, 0.0108, 0.016, 0.221, 0.05, 0.02, 0.158, 0.01, 0.245, 0.0036, 0.0047, 2.3, 1.7, 0.0072, 0.15),
    "XL-330": (0.0026, 0.0023, 0.002, 0.252, 0.05, 0.231, 0.26, 0.01, 0.152, 0.0056, 0.0038, 0.115, 1.0, 0.0185, 0.1),
    "STS3215": (0.0216, 0.0533, 0.0111, 0.208, 0.05, 0.045, 0.244, 0.01, 0.142, 0.0076, 0.0034, 0.44, 3.0, 0.0282, 0.8),
    "eRob80:50": (0.362, 3.26, 0.32, 0.063, 0.02, 0.0357, 0.02, 0.0038, 0.041, 0.0019, 0.0016, 2.83, 1.8, 1.4, 12.0),
    "eRob80:100": (1.135, 4.83, 5.23, 0.148, 0.05, 0.0489, 0.02, 0.01, 0.0512, 0.0027, 0.0026, 2.03, 3.0, 9.7, 15.0),
}  # fmt: skip

ALONE = ("forward", "back", "load", "viscous", "inertia", "sine")  # what is asked of the laws M1 to M6


@numba.njit(cache=True)
def accelerated(p, law, q, v, side, torque):  # type: ignore[no-untyped-def]
    """Acceleration while it slides to a side; `law`: what friction takes of the motor's torque, and what falls."""
    inertia, forward, back, share, viscous, sine, cosine, cogs, poles = p
    weight = sine * np.sin(q) + cosine * np.cos(q)
    level = (forward if side > 0 else back) + abs(share * weight + law[0] * torque)
    if law[6] > 0:
        excess = law[1] + abs(law[2] * weight + law[3] * torque)
        if weight * torque > 0:  # they push against each other: the smaller one is driven
            excess += law[4] * weight**2 if abs(torque) > abs(weight) else law[5] * torque**2
        level += excess * np.exp(-((abs(v) / law[6]) ** law[7]))
    return (torque - weight - cogs * np.sin(poles * q) - viscous * v - side * level) / inertia


@numba.njit(cache=True)
def march(p, law, gains, loop, reference, slope, steps):  # type: ignore[no-untyped-def]
    """Angles at every `steps` instants; `loop`: periods of delay, whether kd is of the speed, a count, a limit."""
    kp, kd, ki = gains
    late, of_speed, count, most = int(loop[0]), loop[1] > 0, loop[2], loop[3]
    dt, held = 1.0 / FINE, FINE // CONTROL
    angle = np.zeros((len(reference) - 1) // steps)
    taken = np.zeros(len(angle))
    waiting = np.zeros(late + 1)
    q, v, torque, rests, wound = reference[0], 0.0, 0.0, True, 0.0
    for i in range(len(angle) * steps):
        if i % held == 0:
            waiting[:-1] = waiting[1:]
            read = np.round(q / count) * count
            asked = kp * (reference[i] - read) + kd * ((0.0 if of_speed else slope[i]) - v)
            if abs(asked + wound) < most:
                wound += ki * (asked if of_speed else reference[i] - read) / CONTROL
            waiting[-1] = min(max(asked + wound, -most), most)
            torque = waiting[0]
        if i % steps == 0:
            angle[i // steps], taken[i // steps] = q, torque
        if rests:
            free = accelerated(p, law, q, 0.0, 0.0, torque)
            side = 1.0 if free > 0 else -1.0
            if accelerated(p, law, q, 0.0, side, torque) * side <= 0:
                continue
        else:
            side = 1.0 if v > 0 else -1.0
        a1 = accelerated(p, law, q, v, side, torque)
        v2 = v + dt / 2 * a1
        a2 = accelerated(p, law, q + dt / 2 * v, v2, side, torque)
        v3 = v + dt / 2 * a2
        a3 = accelerated(p, law, q + dt / 2 * v2, v3, side, torque)
        v4 = v + dt * a3
        a4 = accelerated(p, law, q + dt * v3, v4, side, torque)
        q, v = q + dt / 6 * (v + 2 * v2 + 2 * v3 + v4), v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        rests = v * side <= 0
        if rests:
            v = 0.0
    return angle, taken


def reference(time: np.ndarray, chance: np.random.Generator) -> np.ndarray:
    """Two sines, five, a chirp, or strokes between rests."""
    about, size, kind = chance.uniform(-0.8, 0.8), chance.uniform(0.5, 1.3), chance.integers(4)
    if kind == 0:
        slow, fast = chance.uniform(0.1, 0.3), chance.uniform(0.5, 1.6)
        turned = np.sin(2 * np.pi * slow * time) + chance.uniform(0.15, 0.5) * np.sin(2 * np.pi * fast * time + 1)
    elif kind == 1:
        tones = np.exp(chance.uniform(np.log(0.1), np.log(2.5), 5))
        parts = zip(chance.uniform(0.4, 1, 5) / tones**0.7, tones, chance.uniform(0, 6.28, 5), strict=True)
        turned = sum(a * np.sin(2 * np.pi * f * time + p) for a, f, p in parts)
    elif kind == 2:
        last = chance.uniform(1, 3)
        turned = np.sin(2 * np.pi * (0.1 * time + (last - 0.1) * time**2 / 2 / time[-1])) / (1 + time / time[-1])
    else:
        turned, now, place = np.zeros_like(time), 0.0, 0.0
        while now < time[-1]:
            lasts, rests, begins, place = *chance.uniform((0.5, 0.2), (2.5, 1.0)), place, chance.uniform(-1, 1)
            here = (time >= now) & (time <= now + lasts + rests)
            share = np.clip((time[here] - now) / lasts, 0, 1)
            turned[here] = begins + (place - begins) * (1 - np.cos(np.pi * share)) / 2
            now += lasts + rests
    return np.asarray(about + size * turned / np.abs(turned).max())


def drawn(seed: int, kind: str) -> tuple[ss.Record, dict[str, float]]:
    """A log by chance, and the truth."""
    chance = np.random.default_rng([seed, KINDS.index(kind)])
    inertia = np.exp(chance.uniform(np.log(0.002), np.log(0.5)))
    swing, ratio = 2 * np.pi * chance.uniform(2.5, 8), chance.uniform(0.2, 0.9)
    kp, kd = inertia * swing**2, 2 * ratio * inertia * swing
    level = kp * np.exp(chance.uniform(np.log(0.003), np.log(0.03)))
    forward, back = level * chance.uniform(0.85, 1.15, 2)
    viscous, weight, tilt = level * chance.uniform(0.05, 0.6), level * chance.uniform(1, 8), chance.uniform(-3.1, 3.1)
    share, late = chance.uniform(0.05, 0.25), int(chance.integers(0, 4))
    fs, count = int(chance.choice([100, 125, 200, 250, 500, 1000])), 2 * np.pi / 2 ** int(chance.integers(10, 17))
    fine = np.arange(SECONDS * FINE + 1) / FINE
    told = reference(fine, chance)
    slope, pulls = np.gradient(told, fine), (weight * np.cos(tilt), weight * np.sin(tilt))
    cogs = (level * chance.uniform(0.1, 0.5), float(chance.integers(7, 60))) if kind == "cogging" else (0.0, 0.0)
    ki = 0.0
    if kind in ("PID", "torque of a PID"):
        ki = kp * swing * ratio * chance.uniform(0.1, 0.4)
    elif kind == "PI of the speed":
        ki = swing * chance.uniform(0.05, 0.3)
    p = np.array([inertia, forward, back, share, viscous, *pulls, *cogs])
    loop = np.array([late, kind in OF_SPEED, count, np.inf], dtype=float)
    angle, taken = march(p, PLAIN, (kp, kd, ki), loop, told, slope, FINE // fs)
    if kind == "saturated":
        loop[3] = chance.uniform(0.6, 0.95) * np.abs(taken).max()
        angle, taken = march(p, PLAIN, (kp, kd, ki), loop, told, slope, FINE // fs)
    delay = (late + 0.5) / CONTROL  # of what is held, half of its time
    names = ("inertia", "forward", "back", "load", "viscous", "sine", "cosine")
    truth = {**dict(zip(names, p.tolist(), strict=False)), "kp": kp, "kd": kd, "delay": delay}
    truth["damping"] = -kp * delay + (kd if kind not in OF_SPEED else 0.0)
    logged = {"theta": np.round(angle / count) * count, "reference": told[: -1 : FINE // fs]}
    if kind in LOGGED:
        logged["force"] = taken + 0.01 * np.abs(taken).max() * chance.standard_normal(len(taken))
        truth["delay"] = -0.5 / CONTROL  # what is set at an instant acts half of a period later, on average
        return ss.Record.of(logged, fs=fs, units={"reference": "rad", "force": "N m"}), truth
    return ss.Record.of(logged, fs=fs, units={"reference": "rad"}), truth


def pendulum(time: np.ndarray, chance: np.random.Generator) -> np.ndarray:
    """Six seconds each, in turn: swings that grow faster, two tones, and a lift to the side that sinks again."""
    turned = np.zeros_like(time)
    for number in range(int(np.ceil(time[-1] / 6))):
        here = (time >= 6 * number) & (time < 6 * number + 6)
        t, size, pace = time[here] - 6 * number, chance.uniform(0.8, 1.4), chance.uniform(0.8, 1.2)
        if number % 4 == 0:
            moved = np.sin((0.9 * pace * t) ** 2)
        elif number % 4 == 1:
            moved = np.sin(pace * t) + 0.32 * np.sin(5 * pace * t) * np.sin(2 * pace * t)
        else:
            up, down = np.clip(t / 3, 0, 1), np.clip((t - 3) / 3, 0, 1)
            moved = 1.3 * (3 * up**2 - 2 * up**3 - (0.2 if number % 4 == 2 else 1.0) * (3 * down**2 - 2 * down**3))
        back = np.where(t > 5.2, (1 + np.cos(np.pi * (t - 5.2) / 0.8)) / 2, 1.0)
        turned[here] = size * chance.choice([-1, 1]) * moved * back
    return turned


def loaded(seed: int, model: int) -> tuple[ss.Record, dict[str, float]]:
    """A log of 24 s of a pendulum whose servo rubs by one of the laws M1 to M6, and the truth."""
    chance = np.random.default_rng([seed, 100 + model])
    servo = np.array(SERVOS[str(chance.choice(list(SERVOS)))])
    drawn = servo * np.exp(chance.uniform(-0.4, 0.4, len(servo)))
    inertia, level, excess, load, more, motor, gravity, motors, gravitys, *squares, speed, _, viscous, weight = drawn
    share, law = 0.0, PLAIN.copy()
    if model in (3, 4):
        share = law[0] = load
    elif model > 4:
        share, law[0] = gravity, motor
    if model not in (1, 3):
        falling = {2: (0.0, 0.0), 4: (more, more)}.get(model, (gravitys, motors))
        law[1:] = excess, *falling, *(squares if model == 6 else (0.0, 0.0)), speed, servo[12]
    weight *= chance.uniform(0.35, 1.1)
    inertia += weight / 9.81 * chance.uniform(0.1, 0.2)
    swing, fs = 2 * np.pi * chance.uniform(3, 6), int(chance.choice([100, 200, 500]))
    kp, kd = inertia * swing**2, 2 * chance.uniform(0.3, 0.9) * inertia * swing
    count, late = 2 * np.pi / 2 ** int(chance.integers(8, 17)), int(chance.integers(0, 3))
    fine = np.arange(24 * FINE + 1) / FINE
    told = pendulum(fine, chance)
    p = np.array([inertia, level, level, share, viscous, weight, 0.0, 0.0, 0.0])
    loop = np.array([late, 0.0, count, np.inf])
    angle, taken = march(p, law, (kp, kd, 0.0), loop, told, np.gradient(told, fine), FINE // fs)
    truth = {"inertia": inertia, "forward": level, "back": level, "viscous": viscous, "sine": weight, "cosine": 0.0}
    truth |= {"load": share + law[0], "delay": -0.5 / CONTROL}
    logged = {"theta": np.round(angle / count) * count, "reference": told[: -1 : FINE // fs]}
    if chance.random() < 0.5:
        logged["force"] = taken + 0.01 * np.abs(taken).max() * chance.standard_normal(len(taken))
        return ss.Record.of(logged, fs=fs, units={"reference": "rad", "force": "N m"}), truth
    truth |= {"kp": kp, "delay": (late + 0.5) / CONTROL, "damping": kd - kp * (late + 0.5) / CONTROL}
    return ss.Record.of(logged, fs=fs, units={"reference": "rad"}), truth


def missed(record: ss.Record, given: dict[str, float]) -> tuple[float, float]:
    """What of the place in a log's second half is missed by the joint of its first [%], and by a plain law."""
    halves = [record.rows(first, first + len(record) // 2) for first in (0, len(record) // 2)]
    joint = Joint.of(ss.cycle.regress_joint(halves[0], **given), "")
    (part,) = ss.answers.predict(halves[1], joint).parts
    return 100 - part.follows["theta"], 100 - part.plain.get("theta", np.nan)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=40, help="joints of each kind")
    parser.add_argument("--first", type=int, default=70000, help="seed of the first")
    parser.add_argument("--kinds", default=",".join(KINDS), help="which, with commas")
    parser.add_argument("--predict", action="store_true", help="move the joint of a log's first half along the second")
    options = parser.parse_args()
    for kind in options.kinds.split(","):
        held: dict[str, list[tuple[bool, float]]] = {name: [] for name in TOLD}
        refused, begun, misses, left = 0, time.process_time(), [], Counter[tuple[str, ...]]()
        for seed in range(options.first, options.first + options.draws):
            record, truth = loaded(seed, int(kind[1])) if kind in LAWS else drawn(seed, kind)
            try:
                kd = {"kd": truth["kd"]} if kind in STATED else {}
                given = {} if "force" in record else {"kp": truth["kp"], **kd}
                if options.predict:
                    misses.append(missed(record, given))
                    continue
                joint = ss.cycle.regress_joint(record, **given)
            except ss.StickslipError:
                refused += 1
                continue
            left[joint.laws] += 1
            place = record["theta"][np.rint(joint.time * record.fs).astype(int)]
            carried = np.abs(truth["sine"] * np.sin(place) + truth["cosine"] * np.cos(place))
            truth["level"] = (truth["forward"] + truth["back"]) / 2 + truth["load"] * float(carried.mean())
            for name in ALONE if kind in LAWS else TOLD:
                estimate = getattr(joint, name)
                if estimate is not None and estimate.known and ss.estimate.stands(estimate.status):
                    half = (estimate.interval[1] - estimate.interval[0]) / 2
                    held[name].append((estimate.includes(truth[name]), half / (abs(truth[name]) or np.nan)))
        spent = (time.process_time() - begun) / options.draws
        print(f"{kind}: {options.draws - refused} of {options.draws} answered, {spent:.1f} s each, rig included")
        for name, share in zip(("the place", "by a plain law"), np.array(misses).T, strict=False):
            low, high = np.nanquantile(share, (0.5, 0.9))
            print(f"  missed of {name}: {low:.2f} % median, {high:.2f} % worst tenth")
        for laws, count in left.items() if kind in LAWS else ():
            print(f"  {count} leave {laws[0]}, {', '.join(laws[1:])}{'' if kind in laws else ': WRONG'}")
        for name, told in held.items():
            if told:
                holds, half = np.array(told).T
                print(f"  {name:8} held {int(holds.sum())} of {len(told)}, half width {np.median(half):.2%}")


if __name__ == "__main__":
    main()
