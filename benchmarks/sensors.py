"""Is a sensor that fails named by the live view within two cycles, and none that is sound?

``python benchmarks/sensors.py [--rigs 100] [--first 1]`` watches simulated rigs that differ in everything, first with
sound sensors, then with each fault in each channel. Mass, spring and gains are off by 0.3 %, as after commissioning.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from commission import random_rig

import stickslip as ss
from stickslip.bench import Cycle, Fault, Monitor, Sim, Tone, blocks

CYCLES, BEFORE = 25, 8  # watched of a sound rig; before something fails
STATED = 0.003  # standard deviation of mass, spring and gains, as parts
FAULTS = {"flat": "cable", "noisy": "noise", "clipped": "saturation"}  # what is to be named, and what makes it so
LATE = 4e-3  # s by which a late channel comes later than stated


def driven(seed: int) -> tuple[Sim, dict[str, float], float]:
    """A rig whose base moves so far that the mass slides for a part of each cycle; what is stated of it; its period."""
    chance = np.random.default_rng([20261126, seed])
    bench = random_rig(seed, float(chance.choice([1000.0, 2000.0, 4000.0, 8000.0])))
    system = bench.system
    natural = math.sqrt(system.stiffness / system.mass) / math.tau
    frequency = float(natural * chance.uniform(0.3, 2.2))
    # the base's motion that would slide the mass against its friction, and 1.3 to 3 times as far
    least = system.law.kinetic / system.stiffness * max(1.0, (frequency / natural) ** 2 - 1.0)
    amplitude = float(least * chance.uniform(1.3, 3.0))
    moved = replace(system, drive=ss.drives.HarmonicBase(amplitude, frequency=frequency))
    constants = {"mass": system.mass, "stiffness": system.stiffness, "damping": system.damping}
    stated = {name: value * (1 + STATED * chance.standard_normal()) for name, value in constants.items()}
    rig = bench.rig.having("x", limit=0.1).having("z", limit=0.1).having("a", limit=100.0)  # no motion passes it
    for sensor in rig.sensors:
        rig = rig.having(sensor.channel, gain=float(chance.normal(1, STATED)))
    return Sim(system=moved, rig=rig, fs=bench.fs, fast=True, seed=seed, stated=True), stated, 1 / frequency


def watched(
    device: Sim, constants: dict[str, float], seconds: float, then: tuple[float, Tone] | None = None
) -> Iterator[Cycle]:
    """Every cycle that the live view tells; the base may go over to another motion at an instant."""
    monitor = Monitor(device, constants)
    with device.open() as stream:
        if then:
            for block in blocks(stream, count=round(then[0] * device.fs)):
                yield from monitor.feed(block)
            stream.drive("base", then[1])
        for block in blocks(stream, count=round(seconds * device.fs)):
            yield from monitor.feed(block)


def failing(device: Sim, channel: str, kind: str, at: float) -> Sim:
    """The same, of which a channel fails at an instant; one that is late is so from the beginning."""
    if kind != "late":
        return replace(device, faults=(Fault(FAULTS[kind], at, channel=channel),))
    (sensor,) = [sensor for sensor in device.rig.sensors if sensor.channel == channel]
    late = replace(device, rig=device.rig.having(channel, lag=sensor.lag + LATE))
    vars(late)["inputs"] = device.inputs  # its certificate is that of before
    return late


def named(device: Sim, constants: dict[str, float], channel: str, kind: str, period: float) -> tuple[float, set[str]]:
    """Periods from the failure, or from the first whole cycle, to its naming, and which others were named wrongly."""
    at, wrong, cycles = BEFORE * period, set(), math.inf
    for number, cycle in enumerate(watched(failing(device, channel, kind, at), constants, (BEFORE + 6) * period)):
        end = cycle.first / device.fs + cycle.period
        since = number + 1 if kind == "late" else (end - at) / period
        for flaw in cycle.flaws:
            if flaw.channel == channel and since > 0:
                cycles = min(cycles, since)
            elif flaw.kind != "late" and flaw.channel != channel:
                wrong.add(f"{flaw.channel} {flaw.kind}")
    return cycles, wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rigs", type=int, default=100)
    parser.add_argument("--first", type=int, default=1)
    asked = parser.parse_args()
    sound, told, cycles = Counter(), Counter(), 0
    for seed in range(asked.first, asked.first + asked.rigs):
        device, constants, period = driven(seed)
        flaws: Counter[str] = Counter()
        tone = device.system.drive
        chance = np.random.default_rng([20261127, seed])
        other = Tone(tone.amplitude * chance.uniform(1.0, 1.5), tone.frequency * chance.uniform(0.8, 1.3))
        for cycle in watched(device, constants, CYCLES * period, (CYCLES / 2 * period, other)):
            cycles += 1
            flaws.update(f"{flaw.channel} {flaw.kind}" for flaw in cycle.flaws)
        for name, count in flaws.items():
            print(f"rig {seed}, {1 / period:.2f} Hz, is sound: {name} said in {count} cycles", flush=True)
        sound[bool(flaws)] += 1
        for kind in (*FAULTS, "late"):
            for channel in ("x", "a", "load") if kind == "late" else ("x", "z", "a", "load"):
                after, wrong = named(device, constants, channel, kind, period)
                told[kind, "within 2" if after <= 2 else "later" if after < math.inf else "never"] += 1
                if after > 2 or wrong:
                    print(
                        f"rig {seed}, {1 / period:.2f} Hz: {channel} {kind} after {after:.1f} cycles; {sorted(wrong)}",
                        flush=True,
                    )
    print(f"sound rigs: something said of {sound[True]} of {sound.total()}, {cycles} cycles")
    for (kind, when), count in sorted(told.items()):
        print(f"{kind:8s} {when:9s} {count}")


if __name__ == "__main__":
    main()
