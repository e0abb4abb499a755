"""Every figure of the thesis that is no sketch of an apparatus is drawn."""

from __future__ import annotations

import pytest
from thesis import page, printed

SKETCHES = {"2.1", "3.1", "4.14", "6.3", "6.12", "7.7"}
OURS = {"4": 1, "6": 1, "beyond": 3}  # figures that the thesis does not have


@pytest.mark.parametrize("chapter", page.CHAPTERS)
def test_every_figure_is_drawn(chapter: str) -> None:
    plates = list(page.module_of(chapter).plates(printed.given()))
    drawn = {plate.title.removeprefix("Figure ") for plate in plates}
    wanted = {
        number
        for number in printed.captions()
        if number.startswith(("A.", "B.") if chapter == "appendices" else f"{chapter}.")
    }
    assert wanted - SKETCHES <= drawn
    assert len(drawn) == len(wanted - SKETCHES) + OURS.get(chapter, 0) == len(plates)
    assert all(plate.caption for plate in plates)
