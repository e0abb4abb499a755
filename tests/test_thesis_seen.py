"""What the text says that one should see is seen, and where it is not the page says why."""

from __future__ import annotations

import doctest
import functools

import pytest

from stickslip_thesis import measures, printed


@functools.cache
def seen(chapter: str) -> tuple[measures.Seen, ...]:
    return measures.seen(chapter, printed.given())


@pytest.mark.parametrize("chapter", measures.MEASURES)
def test_what_the_text_says_is_seen(chapter: str) -> None:
    wrong = [(one.observation.says, one.text) for one in seen(chapter) if one.shown == bool(one.observation.why)]
    assert not wrong


@pytest.mark.parametrize("chapter", measures.MEASURES)
def test_every_measure_is_asked_for(chapter: str) -> None:
    assert {one.observation.measure for one in seen(chapter)} == set(measures.MEASURES[chapter](printed.given()))


def test_every_observation_is_of_figures_that_there_are_and_has_a_bound() -> None:
    assert {one.chapter for one in measures.observations()} == set(measures.MEASURES)
    for one in measures.observations():
        assert set(one.figures) <= set(printed.captions()), one.says
        assert one.above > float("-inf") or one.below < float("inf"), one.says


def test_the_examples_run() -> None:
    assert not doctest.testmod(measures).failed
