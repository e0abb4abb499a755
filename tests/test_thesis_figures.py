"""Every figure of the thesis is drawn; the sketches of the apparatus say what the parameters say."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

import stickslip as ss
from stickslip_thesis import beyond, chapter7, drawing, page, printed

Sketch = Callable[[printed.Given], Figure]

OURS = {"4": 1, "6": 1, "7": 2, "beyond": 8}  # figures that the thesis does not have


@pytest.mark.parametrize("chapter", page.CHAPTERS)
def test_every_figure_is_drawn(chapter: str) -> None:
    plates = list(page.CHAPTERS[chapter].plates(printed.given()))
    drawn = {plate.title.removeprefix("Figure ") for plate in plates}
    wanted = {
        number
        for number in printed.captions()
        if number.startswith(("A.", "B.") if chapter == "appendices" else f"{chapter}.")
    }
    assert wanted <= drawn
    assert len(drawn) == len(wanted) + OURS.get(chapter, 0) == len(plates)
    assert all(plate.caption for plate in plates)


def test_the_critical_load_falls_with_wetness() -> None:
    given = printed.given()
    loads = [chapter7.critical_load(given, wetness, 1.0) for wetness in (0.0, 0.5, 1.0)]
    assert loads[0] > given["squeak"]["heavy"] > loads[1] > loads[2] > given["squeak"]["light"]
    for wetness, surface in ((0.0, "dry"), (1.0, "wet")):
        rig = chapter7.rig_between(given, wetness, 6.13, 1.0)
        assert ss.stability(rig, speed=-0.1).growth == pytest.approx(
            ss.stability(ss.squeak.squeak_rig(surface, 6.13), speed=-0.1).growth, rel=1e-9
        )


def test_a_dither_for_what_was_identified_serves_others_with_a_margin() -> None:
    given = printed.given()
    period = 1 / beyond.dither(given)[0].frequency
    smallest, more = beyond.tried(given, 1.0), beyond.tried(given, beyond.STRONGER)
    assert all(before > 3 * period for before, _ in smallest.values())
    assert smallest["the rig"][1] < period
    assert {name for name, (_, after) in smallest.items() if after > period} == {"less stiffness", "more friction"}
    assert all(after < period for _, after in more.values())


def test_more_damping_leaves_fewer_micro_slips_whatever_the_geometry() -> None:
    given = printed.given()
    maps = {geometry: beyond.counted(given, geometry) for geometry in beyond.GEOMETRIES}
    for counts in maps.values():
        assert np.mean(counts[0]) > np.mean(counts[-1]) == 0
    assert np.ptp(maps["flat"], axis=1).max() == 0, "loads and motions in proportion, and so everything"
    assert maps["rough"][0, -1] > maps["sphere"][0, -1] > maps["flat"][0, -1]


def test_micro_slips_are_heard() -> None:
    given = printed.given()
    assert 3 < beyond.level(beyond.sound(given, "case2")) - beyond.level(beyond.sound(given, "case1")) < 6


def test_a_lag_behind_the_contact_s_spring_rounds_what_falls() -> None:
    """The peak where sliding begins comes late, and friction is less where the motion slows down."""
    at_once, late = (beyond.delayed(printed.given(), lag) for lag in (0.0, 0.003))
    slowing = (at_once["v"] > 2e-3) & (at_once["v"] < 8e-3) & (at_once["a"] < 0)
    assert np.mean(late["friction"][slowing]) < np.mean(at_once["friction"][slowing]) - 0.02


def words_of(drawn: Figure) -> str:
    """What is written in a figure."""
    return " ".join(text.get_text() for ax in drawn.axes for text in ax.texts)


@pytest.mark.parametrize(
    ("sketch", "section", "name", "told"),
    [
        (drawing.apparatus, "rig", "mass", "m = 2.42 kg"),
        (drawing.massless_contact, "sliding", "spring", "k = 2.31 N/mm"),
        (drawing.contact_with_inertia, "inertial", "ratio", "= 0.0555"),
        (drawing.system_i, "paper", "stiffness", "0.304 N or 0.264 N"),
        (drawing.system_ii, "bearing", "kinetic", "f_k = 0.413 N"),
        (drawing.transducers, "squeak", "heavy", "rubber, 6.13 or 1.23 N"),
    ],
)
def test_a_sketch_says_what_the_parameters_say(sketch: Sketch, section: str, name: str, told: str) -> None:
    assert told in words_of(sketch(printed.given()))
    other = printed.given()
    other[section][name] *= 1.5
    assert told not in words_of(sketch(other))
