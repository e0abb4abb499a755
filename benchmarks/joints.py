"""How often do the intervals of a joint's friction hold, on joints of an integrator of our own (`tests/joints.py`)?

Seven servos' published parameters as centres, encoders of 8 to 16 bit, 50 Hz to 1 kHz, gravity, currents with noise;
with the torque measured to 1 %, or by the controller's kp alone, known to 1 %, its kd unknown; with play between motor
and link, which both have an encoder, or ("link alone", "motor alone", "motor alone with its play stated": of joints
that have play) one of them; with a torque that comes late; with friction that falls with the speed ("stribeck":
counted where a fall is told). Counted are the numbers that stand without a grave doubt.

    python benchmarks/joints.py --draws 100 --first 1000
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import joints
import stickslip as ss
from stickslip.cycle.joint_fit import SURELY

TOLD = (
    "level", "static", "stribeck_speed", "forward", "back", "load", "viscous", "inertia", "damping", "backlash",
    "warming", "thinning",
)  # fmt: skip

PLAYING = ("play", "play without gravity")
STATED = "motor alone with its play stated"  # to a tenth
ALONE = ("link alone", "motor alone", STATED)
LATE = "late"  # by one of joints.LATE, and without the reference
FALLS = {"stribeck": True, "stribeck without": False}  # friction that falls with the speed, or none that does
IDLE = "idle temperature"  # of joints whose friction does not follow it
KINDS = ("torque", "controller", "torque alone", LATE, *FALLS, "warming", IDLE, *PLAYING, *ALONE)


ALSO = {"backlash": "play", "warming": "warming", "thinning": "thinning"}


def idle(record: ss.Record, seed: int) -> np.ndarray:
    """A temperature [K] that warms up, wanders, or swings, in counts of 0.1 K."""
    chance, share = np.random.default_rng([seed, 9]), np.linspace(0, 1, len(record))
    if seed % 3 == 0:
        hot = chance.uniform(3, 25) * (1 - np.exp(-share / chance.uniform(0.2, 2)))
    elif seed % 3 == 1:
        hot = np.cumsum(chance.standard_normal(len(record))) * 5 / np.sqrt(len(record))
    else:
        hot = chance.uniform(2, 8) * np.sin(2 * np.pi * chance.uniform(0.5, 4) * share + chance.uniform(0, 6))
    return np.round(hot / 0.1) * 0.1 + 300


def truths(joint: joints.Joint, time: np.ndarray) -> dict[str, float]:
    """The true values under the names of the answer."""
    true = joint.truth
    return {
        **{name: true[name] for name in ("forward", "back", "load", "viscous", "inertia")},
        "damping": true["kd"] - true["kp"] * joints.PERIOD / 2,
        "level": joint.level(time),
        "static": joint.static(time),
        "stribeck_speed": true["fall"],
        **{name: true.get(of, 0.0) for name, of in ALSO.items()},
    }  # fmt: skip


Found = tuple[ss.cycle.JointFriction, ss.cycle.JointBacklash | None]


def asked(joint: joints.Joint, kind: str, seed: int) -> Found:
    """What is said of one joint, and of its play."""
    record, written = joint.record, dict(joint.record.samples)
    if kind in ("motor alone", STATED):
        written["theta"] = written["motor"] / joint.truth["ratio"]
    left_out = {"torque alone": "reference", **dict.fromkeys(ALONE, "motor")}.get(kind)
    if left_out is not None:
        del written[left_out]
        units = {name: record.channels[name].unit for name in written}
        record = ss.Record.of(written, fs=record.fs, units=units).with_details("force", gain_sd=joints.GAIN)
    if kind == LATE:
        record = joints.delayed(joint, float(np.random.default_rng([seed, 10]).choice(joints.LATE)))
    if kind == IDLE:
        record = record.with_channel("temperature", idle(record, seed), unit="K")
    given = {"kp": joint.kp} if kind == "controller" else {}
    if kind == STATED:
        off = 1 + 0.1 * np.random.default_rng([seed, 11]).standard_normal()
        given["play"] = (off * joint.truth["play"], 0.1 * joint.truth["play"])
    regression = ss.cycle.regress_joint(record, **given)
    if kind in PLAYING:
        with contextlib.suppress(ss.errors.EstimateError):
            return regression, ss.cycle.joint_backlash(record, joint=regression)
    return regression, None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=100, help="joints of each kind")
    parser.add_argument("--first", type=int, default=1000, help="seed of the first")
    parser.add_argument("--kinds", default=",".join(KINDS), help="which, with commas")
    parser.add_argument("--misses", action="store_true", help="print each interval that does not hold")
    options = parser.parse_args()
    for kind in options.kinds.split(","):
        held: dict[str, list[float]] = {name: [] for name in TOLD}
        wide: dict[str, list[float]] = {name: [] for name in TOLD}
        changes: dict[str, list[tuple[bool, bool]]] = {"warming": [], "thinning": []}
        refused, spent, claims, lines = 0, list[float](), list[tuple[bool, bool]](), list[bool]()
        for seed in range(options.first, options.first + options.draws):
            joint = joints.drawn(
                seed,
                torque=kind != "controller",
                play=kind in PLAYING + ALONE,
                loaded=kind != "play without gravity",
                warming=kind == "warming",
                stribeck=FALLS.get(kind),
            )
            if kind in ALONE and not joint.truth["play"]:
                continue
            begun = time.process_time()
            try:
                found, teeth = asked(joint, kind, seed)
            except ss.StickslipError as error:
                refused += 1
                if options.misses:
                    print(f"{seed} {joint.servo}: {error}")
                continue
            spent.append(time.process_time() - begun)
            true = truths(joint, found.time)
            if teeth is not None:
                claims.append((true["backlash"] > 0, teeth.claimed))
            if kind in FALLS and found.static is None:
                lines.append(found.level.includes(true["level"]))
                continue
            for name in TOLD:
                estimate = getattr(teeth if name == "backlash" else found, name, None)
                if estimate is None or not estimate.known or not ss.estimate.stands(estimate.status):
                    continue
                held[name].append(estimate.includes(true[name]))
                if name in changes:
                    changes[name].append((true[name] != 0, abs(estimate.value) > SURELY * estimate.sd))
                if true[name]:
                    wide[name].append((estimate.interval[1] - estimate.interval[0]) / 2 / abs(true[name]))
                if options.misses and not held[name][-1] and name in ("level", "load", "backlash"):
                    print(f"{seed} {joint.servo} {joint.record.fs:.0f} Hz: {true[name]:.4g}, {estimate}")
        print(f"{kind}: {len(spent)} of {len(spent) + refused} answered, {np.mean(spent):.2f} s each")
        for name in TOLD:
            if held[name]:
                half = f", half width {np.median(wide[name]):.1%}" if wide[name] else ""
                print(f"  {name:9} held {np.mean(held[name]):6.1%} of {len(held[name])}{half}")
        if kind in FALLS:
            print(
                f"  a fall is told of {len(spent) - len(lines)} of {len(spent)}; "
                f"of the others the level held {np.mean(lines):.1%}"
            )
        for name in ("warming", "thinning"):
            if changes[name]:
                claimed = (
                    [sure for there, sure in changes[name] if there],
                    [s for there, s in changes[name] if not there],
                )
                print(
                    f"  {name} claimed of {sum(claimed[0])} of {len(claimed[0])}, where there is none of "
                    f"{sum(claimed[1])} of {len(claimed[1])}"
                )
        for there in (True, False) if claims else ():
            rightly = [claimed for play, claimed in claims if play == there]
            print(f"  play claimed of {sum(rightly)} of {len(rightly)} joints with{'' if there else 'out'} any")


if __name__ == "__main__":
    main()
