"""Which friction law is it: random rigs whose true law is known, and what `compare_laws` says of their records.

Six laws (rigid, static and kinetic, Stribeck, compliant, state variable, LuGre), each with parameters drawn at random
for each data set, on the thesis's air-track rig at 2.5, 8.7 and 11.1 Hz, 0.8 s of each. The sensors have their noise
and counts; their gains, their mounts' resonances and their delays are up to 1 % and 20 us away from what is stated;
the friction fluctuates by 3 % while it slides, within 10 ms. Told are the share of the data sets whose family is named
rightly, left open or named wrongly; the same of the rigid laws among themselves; how often the true law is among those
kept, by the confidence told; how often it is not where more than 95 % was told; how often intervals hold; and the time.

    python benchmarks/laws.py --draws 20 --keep laws.jsonl

With ``--keep FILE`` every data set is written down as it is done, and a second call goes on from there.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import stickslip as ss
from stickslip.signals.response import respond

Array = NDArray[np.float64]

LAWS = ("Coulomb", "static", "Stribeck", "CompliantContact", "StateVariable", "LuGre")
RIGID = ("Coulomb", "static", "Stribeck")
NAMES = dict(zip(LAWS, (*RIGID, "compliant", "state variable", "LuGre"), strict=True))
MOTIONS = {2.5: 0.65e-3, 8.7: 1.1e-3, 11.1: 2e-3}
"""Frequency [Hz] of the base, and its amplitude [m]."""
RIG = {"mass": 2.42, "stiffness": 2310.0, "damping": 0.1196}
FS, SECONDS, SETTLED = 4000.0, 0.8, 2.0
CORRELATED = 0.01  # s within which the friction fluctuates
KNOTS = 500.0  # Hz at which the fluctuation is laid out
SLOWEST = 5e-4  # m/s below which a law without sticks is taken to hold
SURE = 0.95
TOLD = (0.0, 0.9, 0.95, 0.98, 0.995, 1.0)  # ends of the confidences that are counted together


@dataclass(frozen=True)
class Condition:
    """What is wrong with the rig: relative error of the calibration, of the friction, and the noise over its own."""

    calibration: float = 0.01
    roughness: float = 0.03
    noise: float = 1.0


CONDITIONS = {
    "nominal": Condition(0.0, 0.0),
    "noise": Condition(0.0, 0.0, 10.0),
    "calibration": Condition(roughness=0.0),
    "roughness": Condition(calibration=0.0),
    "both": Condition(),
}


def drawn_law(name: str, chance: np.random.Generator) -> Any:
    """A law of a kind with parameters drawn at random, each data set its own."""
    kinetic = chance.uniform(0.85, 1.05)
    static = kinetic * chance.uniform(1.10, 1.35)
    speed = chance.uniform(2e-3, 8e-3)
    stiffness = 192000.0 * 2 ** chance.uniform(-1, 1)
    damping = 2 * 0.0174 * math.sqrt((RIG["stiffness"] + stiffness) * RIG["mass"]) * chance.uniform(0.5, 3)
    follows, steepness = chance.uniform(60, 200), chance.uniform(1600, 6300)
    laws = {
        "Coulomb": lambda: ss.laws.Coulomb(kinetic),
        "static": lambda: ss.laws.Coulomb(kinetic, static=static),
        "Stribeck": lambda: ss.laws.Stribeck(kinetic, static, speed=speed),
        "CompliantContact": lambda: ss.laws.CompliantContact(kinetic, stiffness=stiffness, damping=damping),
        "StateVariable": lambda: ss.laws.SmoothStateVariable(kinetic, rate=follows / kinetic, steepness=steepness),
        "LuGre": lambda: ss.laws.LuGre(kinetic, static, speed=speed, stiffness=stiffness, damping=damping),
    }
    return laws[name]()


def built_rig(condition: Condition, chance: np.random.Generator) -> tuple[ss.Rig, ss.Rig]:
    """The rig as it is, and as its owner believes it to be."""
    believed = ss.Rig()

    def off() -> float:
        return 1 + condition.calibration * float(chance.choice([-1, 1]))

    rig = believed
    for sensor in believed.sensors:
        noise = sensor.noise.white * condition.noise
        rig = rig.having(sensor.channel, gain=off(), white=noise)
        believed = believed.having(sensor.channel, white=noise)
        if sensor.mount:
            rig = rig.having(sensor.channel, frequency=sensor.mount.frequency * off())
        elif condition.calibration:
            rig = rig.having(sensor.channel, lag=sensor.lag + 20e-6 * float(chance.choice([-1, 1])))
    return rig, believed


def wandering(count: int, step: float, chance: np.random.Generator) -> Array:
    """A Gaussian series of unit deviation that is alike within CORRELATED seconds."""
    from scipy.ndimage import gaussian_filter1d

    series = gaussian_filter1d(chance.standard_normal(count), CORRELATED / 2 / step)
    return series / series.std()


def measured(law: Any, frequency: float, condition: Condition, rigs: tuple[ss.Rig, ss.Rig], seed: int) -> ss.Record:
    """A record of the rig, settled, with what its owner believes of the sensors stated in it."""
    rig, believed = rigs
    chance = np.random.default_rng(seed)
    length = SETTLED + SECONDS
    drive = ss.drives.HarmonicBase(MOTIONS[frequency], frequency=frequency)
    run = ss.simulate(ss.Oscillator(law=law, drive=drive, **RIG), duration=length, rtol=1e-9)
    record = rig.measure(run, fs=FS, rng=seed, start=SETTLED)
    if condition.roughness:
        record = _roughened(run, record, condition.roughness, rig, chance, seed)
    return believed.stated(record)


def _roughened(
    even: ss.solve.Trajectory, record: ss.Record, share: float, rig: ss.Rig, chance: np.random.Generator, seed: int
) -> ss.Record:
    """The record where the sliding friction fluctuates: an added force while it slips, as a base that trembles."""
    times = np.arange(math.ceil((SETTLED + SECONDS) * KNOTS) + 2) / KNOTS
    inside = np.minimum(times, even.duration)
    friction, piece = even.sample(inside, ("friction",))
    slips = np.array([mode.kind == "slip" for mode in even.table.modes])[even.modes][piece]
    moving = np.abs(even.sample(inside, ("v",))[0][0]) > SLOWEST if slips.all() else slips
    added = share * wandering(len(times), 1 / KNOTS, chance) * friction[0] * moving
    base = even.sample(inside, ("z",))[0][0] - added / RIG["stiffness"]
    rough = ss.simulate(even.system.having(drive=ss.drives.Recorded(base, fs=KNOTS)), duration=even.duration, rtol=1e-9)
    lag = {sensor.channel: sensor for sensor in rig.sensors}["load"]
    shaken = rig.measure(rough, fs=FS, rng=seed, start=SETTLED)
    instants = SETTLED + shaken.time - shaken.time[0]
    felt = respond(lambda at: np.interp(at, times, added), breaks=times, times=instants, response=lag.response)
    return shaken.with_samples(
        {**shaken.samples, "z": record["z"][: len(shaken)], "load": shaken["load"] + lag.gain * felt},
        ss.record.Step("roughened", {"share": share}),
    )


def draw(name: str, condition: str, seed: int, laws: list[str] | None) -> dict[str, Any]:
    """What is said of one data set whose law is `name`."""
    chance = np.random.default_rng([seed, LAWS.index(name)])
    law, rigs = drawn_law(name, chance), built_rig(CONDITIONS[condition], chance)
    records = [
        measured(law, frequency, CONDITIONS[condition], rigs, seed=int(chance.integers(2**31))) for frequency in MOTIONS
    ]
    begun = time.process_time()
    comparison = ss.compare_laws(records, ss.Oscillator(law=ss.laws.Coulomb(1.0), **RIG), laws=laws, calibration=0.01)
    excess = comparison.excess
    return {
        "truth": name, "condition": condition, "seed": seed, "law": comparison.law, "family": comparison.family,
        "kept": list(comparison.kept), "confidence": comparison.confidence, "seconds": time.process_time() - begun,
        "limits": [candidate.name for candidate in comparison.candidates if candidate.standing.limit],
        "true": repr(law), "fitted": repr(comparison.best.oscillator.law),
        "held": _held(comparison.fit, law) if comparison.law == NAMES[name] else {},
        "excess": None if excess is None else [excess.value, *excess.interval],
        "misfits": {candidate.name: candidate.standing.misfit for candidate in comparison.candidates},
        "criteria": {candidate.name: candidate.standing.criterion for candidate in comparison.candidates},
    }  # fmt: skip


def _held(fit: ss.law.LawFit, law: Any) -> dict[str, list[float]]:
    """Of each parameter of the law its true value, the fitted one and the ends of its interval."""
    # what the rig has by the same name is not the law's
    own = {name.removeprefix("law."): one for name, one in fit.parameters.items() if name not in RIG}
    return {
        name: [value, own[name].value, *own[name].interval]
        for name, value in vars(law).items()
        if isinstance(value, float) and name in own
    }


def family(name: str) -> str:
    return "rigid" if name in RIGID else name


def told(draws: list[dict[str, Any]]) -> list[str]:
    """The shares, in lines."""
    lines = []
    for name in NAMES:
        own = [draw for draw in draws if draw["truth"] == name and "error" not in draw]
        if not own:
            continue
        families = Counter(_answer(each["family"], family(NAMES[name])) for each in own)
        laws = Counter(_answer(each["law"], NAMES[name]) for each in own)
        seconds = float(np.median([each["seconds"] for each in own]))
        lines.append(
            f"{name:18}{len(own):5}  family {_shares(families, len(own))}"
            f"  law {_shares(laws, len(own))}  {seconds:.0f} s"
        )
    done = [draw for draw in draws if "error" not in draw]
    if done:
        right = [each["family"] == family(NAMES[each["truth"]]) for each in done]
        wrong = [each for each in done if _wrong(each) and each["confidence"] > SURE]
        lines.append(f"family right: {sum(right)} of {len(done)}")
        lines.append(f"wrong with a confidence above {SURE:.0%}: {len(wrong)} of {len(done)}")
        lines += [f"  {each['truth']} {each['seed']}: {each['kept']}, {each['confidence']:.3f}" for each in wrong]
        lines += _reliability(done) + _coverage(done)
    refused = [draw for draw in draws if "error" in draw]
    return lines + [f"refused: {each['truth']} {each['seed']}: {each['error']}" for each in refused]


def _reliability(done: list[dict[str, Any]]) -> list[str]:
    """Confidences told, and how often they were right."""
    lines = []
    for low, high in itertools.pairwise(TOLD):
        part = [each for each in done if low < each["confidence"] <= high]
        if part:
            mean = float(np.mean([each["confidence"] for each in part]))
            right = sum(not _wrong(each) for each in part)
            lines.append(f"  told {mean:.3f} ({low} to {high}): right {right} of {len(part)}")
    return lines


def _coverage(done: list[dict[str, Any]]) -> list[str]:
    """How often the 95 % intervals of the laws named rightly hold the truth, and by how much the values are off."""
    found: dict[str, list[list[float]]] = {}
    for each in done:
        for name, told in each.get("held", {}).items():
            found.setdefault(name, []).append(told)
    return [
        f"  {name}: {sum(low <= true <= high for true, _, low, high in rows)} of {len(rows)} intervals hold, "
        f"median error {np.median([abs(value / true - 1) for true, value, *_ in rows]):.2%}"
        for name, rows in found.items()
    ]


def _wrong(each: dict[str, Any]) -> bool:
    return NAMES[each["truth"]] not in each["kept"]


def _answer(said: str | None, true: str) -> str:
    return "open" if said is None else "right" if said == true else "wrong"


def _shares(answers: Counter[str], count: int) -> str:
    return ", ".join(f"{key} {100 * answers[key] / count:5.1f} %" for key in ("right", "open", "wrong"))


def kept(path: Path | None) -> list[dict[str, Any]]:
    """The data sets that an earlier call has written down."""
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()] if path and path.exists() else []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=10, help="data sets of each law")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--condition", choices=CONDITIONS, default="both")
    parser.add_argument("--truths", default=",".join(LAWS))
    parser.add_argument("--laws", help="the laws to compare, with commas; all unless given")
    parser.add_argument("--keep", type=Path, metavar="FILE")
    given = parser.parse_args()
    draws = kept(given.keep)
    done = {(draw["truth"], draw["condition"], draw["seed"]) for draw in draws}
    for seed in range(given.first, given.first + given.draws):
        for name in given.truths.split(","):
            if (name, given.condition, seed) in done:
                continue
            try:
                draws.append(draw(name, given.condition, seed, given.laws.split(",") if given.laws else None))
            except ss.StickslipError as error:
                draws.append({"truth": name, "condition": given.condition, "seed": seed, "error": str(error)})
            if given.keep:
                with given.keep.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(draws[-1]) + "\n")
    print(f"Which law it is: {given.condition}, three records of {SECONDS} s")
    print("\n".join(told([draw for draw in draws if draw["condition"] == given.condition])))


if __name__ == "__main__":
    main()
