"""The manuscript, written from computed numbers: ``python docs/paper/make.py > docs/_build/paper.md`` (``make paper``).

`paper.md.jinja` has the words and `numbers` the numbers: none is typed into the text, which a test holds.
"""

from __future__ import annotations

import math
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
    chapter6,
    chapter7,
    flange,
    inventory,
    observations,
    page,
    printed,
)

HERE = Path(__file__).parent
TEMPLATE = "paper.md.jinja"


def numbers() -> dict[str, Any]:
    """Everything that the manuscript tells, by name."""
    given = printed.given()
    chapters = [page.run_chapter(name, draw=False) for name in page.CHAPTERS]
    verdicts = page.results(chapters)["verdicts"]
    states = Counter(item.state for item in inventory.items())
    expected = [one.why == "" for one in observations.observations()]
    return {
        "version": ss.__version__,
        "verdicts": {name: count for name, count in verdicts.items() if count},
        "meanings": printed.MEANINGS,
        "total": sum(verdicts.values()),
        "items": len(inventory.items()),
        "states": states,
        "observations": len(expected),
        "seen": sum(expected),
        "corrected": [row for chapter in chapters for row in _corrected(chapter)],
        **_identity(given),
        **_flange(given),
        **_shaker(given),
        **_telescope(given),
        **_limits(given),
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
    slow, fast = flange.coupled(given["rig"])
    told = given["rig"]
    records = [chapter2.rubbing(given, case) for case in range(3)]
    return {
        "flange_mass": flange.Flange.of(told).mass,
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
    """What the thesis's methods and the package's make of one record each, its truth known."""
    told = given["paper"]["case1"]
    record = chapter6.on_paper(given, 1, "both")
    extremes, fitted = ss.decrement(record), ss.fit_decay(record)
    contact = chapter3.measured(given, 1)
    slopes = chapter3.slopes_of_sticks(contact)
    likeliest = ss.contact_stiffness(contact)
    return {
        "true_ratio": told["damping_ratio"],
        "true_dry": 1e3 * told["dry"],
        "ratio_by_extremes": extremes.damping_ratio.value,
        "ratio_by_extremes_sd": float(np.std(extremes.scatter.damping_ratio)),
        "ratio_by_fit": fitted.damping_ratio.value,
        "ratio_by_fit_sd": fitted.damping_ratio.sd,
        "true_stiffness": given["sliding"]["stiffness"][1] / 1e3,
        "stiffness_by_slopes": float(np.mean(slopes)) / 1e3,
        "stiffness_by_slopes_sd": float(np.std(slopes, ddof=1)) / 1e3,
        "stiffness_by_likelihood": likeliest.value / 1e3,
        "stiffness_by_likelihood_sd": likeliest.sd / 1e3,
    }


def manuscript(values: dict[str, Any]) -> str:
    """The text with the numbers in it."""
    environment = Environment(loader=FileSystemLoader(HERE), undefined=StrictUndefined, trim_blocks=True)
    return environment.get_template(TEMPLATE).render(values)


if __name__ == "__main__":
    print(manuscript(numbers()))
