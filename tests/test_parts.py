"""A record in stretches: the same answers as of the whole."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from rigs import RIG, measured, told
from stickslip.cycle.sticks import join_sticks, overlapping
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import Doubt, Status


def pieces(record: ss.Record, *rows: int) -> list[ss.Record]:
    edges = [0, *rows, len(record)]
    return [record.rows(first, last) for first, last in itertools.pairwise(edges)]


def test_every_row_belongs_to_one_stretch() -> None:
    record = ss.Record.of({"x": np.arange(10007.0)}, fs=100, start=3.0)
    for parts in (record, pieces(record, 1, 5, 4000, 4001, 9990)):
        items = list(overlapping(parts, seconds=7.0, overlap=1.5))
        own = [
            item.record["x"][(item.record.time >= item.first - 1e-9) & (item.record.time < item.last - 1e-9)]
            for item in items
        ]
        assert np.array_equal(np.concatenate(own), record["x"])
        assert all(a.last == b.first for a, b in itertools.pairwise(items))
        assert all(item.record.start <= max(3.0, item.first - 1.49) for item in items)


def test_sticks_of_stretches_are_those_of_the_whole() -> None:
    record = told(measured(2.5, seconds=6.0)[0])
    whole = ss.find_sticks(ss.friction_force(record, method="fusion", **RIG))
    parts = pieces(record, 3000, 11111)
    stretches = overlapping(parts, seconds=2.0, overlap=0.5)
    sticks = join_sticks(
        (stretch, ss.find_sticks(ss.friction_force(stretch.record, method="fusion", **RIG))) for stretch in stretches
    )
    assert [event.kind for event in sticks.events] == [event.kind for event in whole.events]
    apart = np.array([a.time - b.time for a, b in zip(sticks.events, whole.events, strict=True)])
    assert np.sqrt(np.mean(apart**2)) < 0.02e-3
    assert sum(event.duration for event in sticks.events if event.kind in ("stick", "slip")) == pytest.approx(
        sum(event.duration for event in whole.events if event.kind in ("stick", "slip")), abs=1e-4
    )
    assert sticks.share.value == pytest.approx(whole.share.value, abs=0.002)
    assert sticks.microslips is not None
    assert sticks.microslips.value == 2.0
    assert (sticks.kind, sticks.method) == (whole.kind, whole.method)


def test_an_event_longer_than_the_overlap_is_one() -> None:
    t = np.arange(60000) / 1000
    drive = np.sin(2 * np.pi * t / 6)
    x = np.cumsum(np.maximum(np.abs(drive) - 0.5, 0) * np.sign(drive)) / 1000
    record = ss.Record.of({"x": x + 1e-6 * np.random.default_rng(0).standard_normal(t.size)}, fs=1000)
    whole = ss.find_sticks(record)
    sticks = join_sticks((each, ss.find_sticks(each.record)) for each in overlapping(record, seconds=20, overlap=0.2))
    assert [event.kind for event in sticks.events] == [event.kind for event in whole.events]
    assert sum(event.duration for event in sticks.events) == pytest.approx(60.0, abs=0.05)


def test_what_a_threshold_leaves_open_stays_open_in_the_mean() -> None:
    t = np.arange(80000) / 1000
    drive = np.sin(2 * np.pi * t)
    x = np.cumsum(np.maximum(np.abs(drive) - 0.5, 0) * np.sign(drive)) / 1000
    record = ss.Record.of({"x": x + 1e-6 * np.random.default_rng(0).standard_normal(t.size)}, fs=1000)
    whole = ss.find_sticks(record, threshold=0.03)
    stretches = overlapping(record, seconds=10)
    sticks = join_sticks((stretch, ss.find_sticks(stretch.record, threshold=0.03)) for stretch in stretches)
    assert sticks.method == "speed"
    assert sticks.share.includes(1 / 3)
    assert sticks.share.interval == pytest.approx(whole.share.interval, abs=0.01)


def test_what_keeps_a_stretch_from_being_sure_is_said_of_the_whole() -> None:
    t = np.arange(40000) / 1000
    drive = np.sin(2 * np.pi * t)
    x = np.cumsum(np.maximum(np.abs(drive) - 0.5, 0) * np.sign(drive)) / 1000
    record = ss.Record.of({"x": x + 1e-6 * np.random.default_rng(0).standard_normal(t.size)}, fs=1000)
    found = [(each, ss.find_sticks(each.record)) for each in overlapping(record, seconds=10)]
    stretch, sticks = found[2]
    doubted = replace(sticks, share=replace(sticks.share, status="a doubt"))
    joined = join_sticks([*found[:2], (stretch, doubted), *found[3:]])
    assert joined.share.status == "a doubt (in 1 of 4 stretches)"
    assert joined.per_cycle.status == "ok"
    crude = replace(sticks, share=replace(sticks.share, status=Status(Doubt.few(3, "cycle"))))
    assert join_sticks([*found[:2], (stretch, crude), *found[3:]]).share.status == "ok"


def test_parts_that_do_not_follow_are_refused() -> None:
    record = ss.Record.of({"x": np.arange(1000.0)}, fs=100)
    with pytest.raises(RecordError, match="follow each other"):
        list(overlapping([record.rows(0, 300), record.rows(301)], seconds=1))
    with pytest.raises(RecordError, match="no parts"):
        list(overlapping([]))
    with pytest.raises(EstimateError, match="positive"):
        list(overlapping(record, seconds=0))
    with pytest.raises(EstimateError, match="no stretch"):
        join_sticks([])
