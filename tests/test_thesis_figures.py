"""Every figure of the thesis is drawn; the sketches of the apparatus say what the parameters say."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from matplotlib.figure import Figure

import stickslip as ss
from stickslip_thesis import chapter7, page, printed, sketches

Sketch = Callable[[printed.Given], Figure]

OURS = {"4": 1, "6": 1, "7": 2, "beyond": 4}  # figures that the thesis does not have


@pytest.mark.parametrize("chapter", page.CHAPTERS)
def test_every_figure_is_drawn(chapter: str) -> None:
    plates = list(page.module_of(chapter).plates(printed.given()))
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


def words_of(drawn: Figure) -> str:
    """What is written in a figure."""
    return " ".join(text.get_text() for ax in drawn.axes for text in ax.texts)


@pytest.mark.parametrize(
    ("sketch", "section", "name", "told"),
    [
        (sketches.apparatus, "rig", "mass", "m = 2.42 kg"),
        (sketches.massless_contact, "sliding", "spring", "k = 2.31 N/mm"),
        (sketches.contact_with_inertia, "inertial", "ratio", "= 0.0555"),
        (sketches.system_i, "paper", "stiffness", "0.304 N or 0.264 N"),
        (sketches.system_ii, "bearing", "kinetic", "f_k = 0.413 N"),
        (sketches.transducers, "squeak", "heavy", "rubber, 6.13 or 1.23 N"),
    ],
)
def test_a_sketch_says_what_the_parameters_say(sketch: Sketch, section: str, name: str, told: str) -> None:
    assert told in words_of(sketch(printed.given()))
    other = printed.given()
    other[section][name] *= 1.5
    assert told not in words_of(sketch(other))
