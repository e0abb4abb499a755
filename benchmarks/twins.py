"""What an analysis says of rigs by another integrator, quick and tried on its twins: how often it holds, and is true.

    python benchmarks/twins.py [--draws 20] [--twins 20] [--seed 1] [--off 0.005] [--slow] [--minutes 10] [--keep FILE]

Each kind of contact is drawn with fresh masses, springs, dampers, motions and noise. An interval counts where its
status carries no grave doubt; a claim of static friction counts where its interval lies above 1, of a stick where it
lies above 0. With ``--keep FILE`` each rig is written down as it is done, and a second call goes on from there.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
import warnings
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import detrend, lfilter

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import stepped
import stickslip as ss
from stickslip.estimate import stands

LEVEL, FALL, SHARE, STOPS = (
    "sliding friction", "slope of friction against speed", "stuck share of the time", "stops per cycle"
)  # fmt: skip
RATIO, GIVES, OFFSET, ENERGY = (
    "static over sliding friction", "presliding stiffness", "friction offset", "energy per cycle"
)  # fmt: skip
SIDES = ("sliding friction forward", "sliding friction back", "static friction forward", "static friction back")
NAMES = (LEVEL, FALL, SHARE, STOPS, RATIO, *SIDES, OFFSET, ENERGY, GIVES)
CLAIMS = ("dry friction", "static", "sticks", "gives way", "falls or rises with speed")
UNTOLD = {  # what has no true value of its own
    "compliant": (SHARE, STOPS, ENERGY),
    "LuGre": (FALL, SHARE, STOPS, ENERGY),
    "state variable": (FALL, SHARE, STOPS, RATIO, *SIDES[2:], ENERGY),
}
ROWS = (*NAMES, *(f"claim: {what}" for what in CLAIMS))
BROKEN = "broken sensors"
KINDS = (*stepped.KINDS, BROKEN)
CONDITIONS = ("seed", "off", "slow", "twins")


def truths(findings: ss.answers.Findings, rig: stepped.Rig) -> dict[str, float]:
    """What is true of a rig, by the name of the answer; what has no true value is left out."""
    truth = dict(findings.record.truth)
    level, static = truth[LEVEL], max(rig.static, truth[LEVEL])
    truth |= dict.fromkeys(SIDES[:2], level) | dict.fromkeys(SIDES[2:], static) | {OFFSET: 0.0}
    if rig.contact:
        truth[GIVES] = rig.contact
    left_out = UNTOLD.get(rig.kind, ())
    return {name: truth[name] for name in NAMES if name in truth and name not in left_out and np.isfinite(truth[name])}


def counted(findings: ss.answers.Findings, rig: stepped.Rig, tally: dict[str, list[bool]]) -> list[str]:
    """Whether intervals without a doubt hold, and claims are true; those that are not, in words."""
    truth, wrong = truths(findings, rig), []

    def note(name: str, right: bool, estimate: ss.Estimate) -> None:
        tally[name].append(bool(right))
        if not right:
            wrong.append(f"{name}: {estimate}, in truth {truth.get(estimate.name)}")

    for estimate in findings.estimates:
        if not estimate.known or not stands(estimate.status):
            continue
        low, high = estimate.interval
        if estimate.name in truth:
            note(estimate.name, estimate.includes(truth[estimate.name]), estimate)
        if estimate.name == GIVES:
            note("claim: gives way", rig.kind in stepped.SOFT, estimate)
        if estimate.name == RATIO and low > 1:
            note("claim: static", truth.get(RATIO, 1.0) > 1, estimate)
        if estimate.name == SHARE and low > 0 and rig.kind not in stepped.SOFT:
            note("claim: sticks", truth[SHARE] > 0, estimate)
        if estimate.name == LEVEL and low > 0:
            note("claim: dry friction", rig.kinetic > 0, estimate)
        if estimate.name == FALL and not low <= 0 <= high:
            note("claim: falls or rises with speed", findings.record.truth[FALL] * (low + high) > 0, estimate)
    return wrong


def slow_noise(count: int, turn: float, rng: np.random.Generator) -> np.ndarray:
    """Noise of unit deviation, its line taken off: 1/f, of a first order, a walk, or a hum; `turn` in rad a sample."""
    kind, white = rng.integers(4), rng.standard_normal(count)
    if kind == 0:
        line = np.fft.rfft(white) / np.sqrt(np.maximum(np.arange(count // 2 + 1), 1))
        noise = np.fft.irfft(line, count)
    elif kind == 1:
        noise = lfilter([1.0], [1.0, -np.exp(-turn / (2 * np.pi) / rng.uniform(0.02, 0.5))], white)
    elif kind == 2:
        noise = np.cumsum(white)
    else:
        noise = np.sin(rng.uniform(8, 30) * turn * np.arange(count) + rng.uniform(0, 2 * np.pi)) + white / 2
    noise = detrend(noise)
    return noise / noise.std()


def asked(
    kind: str, seed: np.random.SeedSequence, off: float, twins: int, *, slow: bool
) -> tuple[stepped.Rig, list, list[float]]:
    """A rig, its answers quick and tried, and the processor time of each [s]."""
    rng = np.random.default_rng(seed)
    rig = stepped.drawn("Coulomb" if kind == BROKEN else kind, rng)
    if kind == "compliant":
        rig = replace(rig, loss=rng.uniform(0, 0.15) * np.sqrt(rig.contact * rig.mass))
    record = stepped.record(rig, rng, noise=10 ** rng.uniform(-4, -2.3), off=off)
    for name in "xz" if slow else "":
        level = rig.amplitude * 10 ** rng.uniform(-3.3, -2.2)
        noise = level * slow_noise(len(record), 2 * np.pi * rig.frequency / record.fs, rng)
        record = record.with_channel(name, record[name] + noise, unit="m")
    stated: dict[str, float | tuple[float, float]] = dict(rig.stated)
    if off:
        record = record.with_details("x", gain_sd=off).with_details("z", gain_sd=off)
        for name, value in rig.stated.items():
            written = value * (1 + off * rng.standard_normal())
            stated[name] = (written, off * written)
    if kind == BROKEN:
        record, stated = broken(record, stated, rng)
    begun = time.process_time()
    quick = ss.analyze(record, **stated)
    between = time.process_time()
    tried = ss.tried(quick, twins=twins)
    return rig, [quick, tried], [between - begun, time.process_time() - between]


def broken(record: ss.Record, stated: dict, rng: np.random.Generator) -> tuple[ss.Record, dict]:
    """A record with one thing wrong that nobody states: a range, a gain, a delay, a spring, a damper, or spikes."""
    x, what = record["x"], rng.integers(6)
    if what == 0:
        middle, most = float(np.mean(x)), rng.uniform(0.5, 0.95) * float(np.ptp(x)) / 2
        record = record.with_channel("x", np.clip(x, middle - most, middle + most), unit="m")
    elif what == 1:
        record = record.with_channel("x", rng.choice([0.8, 0.9, 1.1, 1.2, 1000.0]) * x, unit="m")
    elif what == 2:
        record = record.with_channel("x", np.roll(x, rng.integers(1, 6)), unit="m")
    elif what == 3:
        spring, factor = np.array(stated["stiffness"]), rng.choice([0.5, 0.9, 1.1, 2.0])
        stated = {**stated, "stiffness": tuple(factor * spring) if spring.ndim else float(factor * spring)}
    elif what == 4:
        slope = record.truth[FALL] + float(np.ravel(stated["damping"])[0])  # the damper that nobody stated is in it
        record = replace(record, truth={**record.truth, FALL: slope, ENERGY: np.nan})
        stated = {**stated, "damping": 0.0}
    else:
        x = x.copy()
        x[rng.integers(0, len(x), 10)] += rng.standard_normal(10) * float(np.ptp(x))
        record = record.with_channel("x", x, unit="m")
    return record, stated


def told(kind: str, draw: int, options: argparse.Namespace) -> dict[str, Any]:
    """What is said of one rig, as plain data: of each interval and claim whether it holds, quick and tried."""
    line: dict[str, Any] = {"kind": kind, "draw": draw, **{name: getattr(options, name) for name in CONDITIONS}}
    seed = np.random.SeedSequence([options.seed, KINDS.index(kind)]).spawn(draw + 1)[draw]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            rig, answers, times = asked(kind, seed, options.off, options.twins, slow=options.slow)
    except ss.errors.StickslipError as error:
        return {**line, "refused": str(error)}
    tallies: list[dict[str, list[bool]]] = [defaultdict(list), defaultdict(list)]
    wrong = [counted(answer, rig, tally) for answer, tally in zip(answers, tallies, strict=True)]
    return {
        **line, "seconds": times, "unlike": bool(answers[1].trial.unlike), "quick": tallies[0], "tried": tallies[1],
        "wrong": wrong[1],
    }  # fmt: skip


def main() -> None:
    """Draw, ask, and print: of each draw one rig a kind, so that what there was time for is told of all alike."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=20, help="of each kind")
    parser.add_argument("--twins", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--off", type=float, default=0.0, help="by which gains and constants are off, as is stated")
    parser.add_argument("--slow", action="store_true", help="with slow noise of x and z beside the white one")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--minutes", type=float, default=np.inf, help="after which no rig is begun")
    parser.add_argument("--keep", type=Path, help="file of rigs asked before, to go on from, and all under it are told")
    options = parser.parse_args()
    kinds, ends = options.kinds.split(","), time.monotonic() + 60 * options.minutes
    lines = kept(options)
    done = {(line["kind"], line["draw"]) for line in lines}
    for draw, kind in itertools.product(range(options.draws), kinds):
        if time.monotonic() > ends:
            break
        if (kind, draw) in done:
            continue
        lines.append(told(kind, draw, options))
        for words in filter(None, (lines[-1].get("refused"), *lines[-1].get("wrong", ()))):
            print(f"  {kind} {draw}: {words}", flush=True)
        if options.keep:
            with options.keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps(lines[-1]) + "\n")
    for kind in kinds:
        own = [line for line in lines if line["kind"] == kind]
        answered = [line for line in own if "refused" not in line]
        spent = np.round(np.mean([line["seconds"] for line in answered] or [[0.0, 0.0]], axis=0), 2)
        unlike = sum(line["unlike"] for line in answered)
        refused = len(own) - len(answered)
        print(
            f"{kind}: {len(answered)} rigs, {refused} refused, {unlike} unlike their twins; {spent} s quick, on twins"
        )
        table(answered)
    print("all kinds")
    table([line for line in lines if line["kind"] in kinds and "refused" not in line])


def kept(options: argparse.Namespace) -> list[dict[str, Any]]:
    """What was asked before under these conditions."""
    if options.keep is None or not options.keep.exists():
        return []
    lines = [json.loads(line) for line in options.keep.read_text(encoding="utf-8").splitlines()]
    return [line for line in lines if all(line[name] == getattr(options, name) for name in CONDITIONS)]


def table(lines: list[dict[str, Any]]) -> None:
    """How many intervals and claims there were, and how many held."""
    for name in ROWS:
        quick, tried = ([held for line in lines for held in line[way].get(name, ())] for way in ("quick", "tried"))
        if quick or tried:
            rows = [f"{sum(way):3d} of {len(way):3d}" for way in (quick, tried)]
            print(f"    {name:34s} quick {rows[0]}   tried {rows[1]}", flush=True)


if __name__ == "__main__":
    main()
