"""The manuscript, written from computed numbers: ``python docs/paper/make.py docs/_build/paper`` (``make paper``).

`paper.md.jinja` has the words and `numbers` the numbers: none is typed into the text, which a test holds.
"""

from __future__ import annotations

import math
import shutil
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

import stickslip as ss
from stickslip.decay import extremes as ex
from stickslip_thesis import (
    beyond,
    chapter2,
    chapter3,
    chapter4,
    chapter6,
    chapter7,
    measures,
    page,
    printed,
)

HERE = Path(__file__).parent
TEMPLATE = "paper.md.jinja"
FIGURES = ("figure-identity", "figure-critical-load", "figure-micro-slips", "figure-dither")
DRAWS = 5  # records of each twin: surfaces, or releases; so many intervals are no count of coverage, and none is told


def numbers() -> dict[str, Any]:
    """Everything that the manuscript tells, by name."""
    given = printed.given()
    chapters = [page.run_chapter(name, draw=False) for name in page.CHAPTERS]
    verdicts = page.results(chapters)["verdicts"]
    states = Counter(item.state for item in printed.items())
    expected = [one.why == "" for one in measures.observations()]
    return {
        "version": ss.__version__,
        "verdicts": {name: count for name, count in verdicts.items() if count},
        "meanings": printed.MEANINGS,
        "total": sum(verdicts.values()),
        "items": len(printed.items()),
        "states": states,
        "observations": len(expected),
        "seen": sum(expected),
        "corrected": [row for chapter in chapters for row in _corrected(chapter)],
        **_identity(given),
        **_flange(given),
        **_shaker(given),
        **_telescope(given),
        **_limits(given),
        **_readings(given),
        **_squeal(given),
        **_small(given),
        "unseen": [one for one in measures.observations() if one.why],
        "parts": [item for item in printed.items() if item.state == "in part"],
    }


def _corrected(chapter: page.Chapter) -> list[dict[str, Any]]:
    """Numbers that should have been printed otherwise."""
    kinds = (printed.CORRECTED, printed.CONTRADICTS)
    return [
        one for one in chapter.entries() if one["verdict"] in kinds and one["ours"] is not None and not one["again"]
    ]


def _identity(given: printed.Given) -> dict[str, Any]:
    """How well the identity holds for each law, and how far (3.4) is off with damping."""
    ends = {name: abs(float(beyond.identity(orbit)[1][-1])) for name, orbit in beyond.orbits(given).items()}
    told, off = given["sliding"], []
    for case in chapter3.CASES:
        orbit, give = chapter3.sliding(given, case), told["kinetic"][case] / told["stiffness"][case]
        equation = 4 * math.pi * told["frequency"][case] * math.sqrt(orbit.amplitude * give - give**2)
        off.append(100 * (equation / orbit.transition_speed - 1))
    return {"identity": ends, "identity_worst": max(ends.values()), "equation_off": off}


def _flange(given: printed.Given) -> dict[str, Any]:
    slow, fast = chapter2.coupled(given["rig"])
    told = given["rig"]
    records = [chapter2.rubbing(given, case) for case in range(3)]
    return {
        "flange_mass": chapter2.Flange.of(told).mass,
        "flange_slow": slow,
        "flange_fast": fast,
        "one_mass": math.sqrt((told["spring"] + told["stiffness"]) / told["mass"]) / (2 * math.pi),
        "cell_around_100": max(chapter2.transients(given, record, chapter2.HEARD) for record in records),
        "cell_around_250": max(chapter2.transients(given, record, chapter2.CELL_BAND) for record in records),
    }


def _shaker(given: printed.Given) -> dict[str, Any]:
    bearing = given["bearing"]
    bending, torsion = chapter7.merging(given)
    return {
        "stroke": 1e3 * ss.rig.Shaker().stroke,
        "stroke_needed": 4e3 * 50 * bearing["kinetic"] / (math.pi * bearing["stiffness"]),
        "meeting": 100 * abs(torsion / bending - 1),
    }


def _telescope(given: printed.Given) -> dict[str, Any]:
    """The mean of (6.11) over a trace, and the estimate from the first and the last difference alone."""
    x = chapter6.measured_extremes(given, "random")
    single = [ex.rate(x, i=i, m=1) for i in range(1, len(x) - 3)]
    whole = ex.rate(x, i=1, m=len(single))
    return {
        "mean_of_singles": float(np.mean(single)),
        "of_the_ends": whole,
        "scatter_of_singles": float(np.std(single)),
    }


def _limits(given: printed.Given) -> dict[str, Any]:
    """What the thesis's methods and the package's make of records whose truth is known: mean, scatter, and as told."""
    told, ours = given["paper"], []
    for draw in range(DRAWS):
        released = {**given, "paper": {**told, "release": told["release"] * (1 + 0.03 * draw)}}
        record = chapter6.on_paper(released, 1, "both")
        extremes, fitted = ss.decrement(record), ss.fit_decay(record)
        contact = chapter3.measured(given, 1, surface=4 + draw)
        slopes, likeliest = chapter3.slopes_of_sticks(contact) / 1e3, ss.contact_stiffness(contact).scaled(1e-3, "N/mm")
        ours.append(
            [
                (extremes.damping_ratio.value, float(np.std(extremes.scatter.damping_ratio))),
                (fitted.damping_ratio.value, fitted.damping_ratio.sd),
                (float(np.mean(slopes)), float(np.std(slopes, ddof=1))),
                (likeliest.value, likeliest.sd),
            ]
        )
    names = ("ratio_by_extremes", "ratio_by_fit", "stiffness_by_slopes", "stiffness_by_likelihood")
    found: dict[str, Any] = {
        "true_ratio": told["case1"]["damping_ratio"],
        "true_stiffness": given["sliding"]["stiffness"][1] / 1e3,
        "draws": DRAWS,
    }
    for name, column in zip(names, np.moveaxis(np.array(ours), 1, 0), strict=True):
        values, quoted = column.T
        found |= {name: np.mean(values), f"{name}_scatter": np.std(values, ddof=1), f"{name}_sd": np.mean(quoted)}
    return found


def _readings(given: printed.Given) -> dict[str, Any]:
    """Micro-slips of both cases under each reading of the damping ratio, least and most over the frictions printed."""
    told, rows = given["stick_slip"], []
    for reading in chapter4.READINGS:
        pairs = [
            chapter4.counts(told, reading, stiffness=told["stiffness"], kinetic=kinetic)
            for kinetic in chapter4.FRICTIONS
        ]
        agreeing = [kinetic for kinetic, pair in zip(chapter4.FRICTIONS, pairs, strict=True) if pair == chapter4.COUNTS]
        rows.append((reading.formula, *zip(*pairs, strict=True), agreeing))
    return {"readings": rows, "counts": chapter4.COUNTS}


def _squeal(given: printed.Given) -> dict[str, Any]:
    """Loads from which it squeals [N], dry and wet, of the virtual rig and under other normal laws."""
    critical = {
        name: [chapter7.critical_load(given, wetness, power) for wetness in (0.0, 1.0)]
        for name, power in chapter7.POWERS.items()
    }
    squeaks = [chapter7.squeaks(given, *condition) for condition in chapter7.CONDITIONS]
    return {
        "critical": critical,
        "heavy": given["squeak"]["heavy"],
        "light": given["squeak"]["light"],
        "squeaks": squeaks,
    }


def _small(given: printed.Given) -> dict[str, Any]:
    """Micro-slips heard and not, and a dither on rigs that were not identified."""
    designed, ring = beyond.dither(given)
    period = 1 / designed.frequency
    left = {times: beyond.tried(given, times) for times in (1.0, beyond.STRONGER)}
    return {
        "loud": beyond.level(beyond.sound(given, "case2")),
        "silent": beyond.level(beyond.sound(given, "case1")),
        "ring": ring,
        "dither": 1e6 * designed.amplitude.value,
        "dither_frequency": designed.frequency,
        "rigs": len(left[1.0]),
        "failed": [name for name, (_, after) in left[1.0].items() if after > period],
        "failed_with_more": [name for name, (_, after) in left[beyond.STRONGER].items() if after > period],
        "more": 100 * (beyond.STRONGER - 1),
        "steel": beyond.ring(
            given, ss.laws.pair("steel on steel").stiffness(given["beyond"]["load"], radius=given["beyond"]["radius"])
        ),
        "radius": 1e3 * given["beyond"]["radius"],
    }


def manuscript(values: dict[str, Any]) -> str:
    """The text with the numbers in it."""
    environment = Environment(loader=FileSystemLoader(HERE), undefined=StrictUndefined, trim_blocks=True)
    return environment.get_template(TEMPLATE).render(values)


def write(folder: Path) -> None:
    """Manuscript, figures and references into a folder."""
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    (folder / "paper.md").write_text(manuscript(numbers()) + "\n", encoding="utf-8")
    shutil.copy(HERE / "paper.bib", folder)
    for module in (beyond, chapter7):
        for plate in module.plates(printed.given()):
            if plate.name in FIGURES:
                (folder / "figures" / f"{plate.name}.svg").write_text(plate.svg(), encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
