"""What a notebook shows of a thing, the tables that it gives, and the one call that draws it."""

from __future__ import annotations

import re
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

import stickslip as ss
from stickslip.figures.drawing import DRAWN

mpl.use("agg")
RIG = {"mass": 2.42, "stiffness": 2310.0, "damping": 0.12}
DECAY = {"x": np.exp(-0.8 * np.arange(800) / 200) * np.cos(10 * np.arange(800) / 200)}


@pytest.fixture(scope="module")
def things() -> dict[str, Any]:
    """One of each kind that a person draws."""
    record = ss.datasets.demo().rows(0, 4000)
    findings = ss.analyze(record, **RIG)
    slider = ss.Oscillator(
        mass=1, stiffness=100, law=ss.laws.Coulomb(0.5), drive=ss.drives.HarmonicBase(0.02, frequency=1.0)
    )
    run = ss.simulate(slider, cycles=6)
    decay = ss.Record.of(
        {name: values + 1e-5 * np.sin(np.arange(800.0) ** 2) for name, values in DECAY.items()}, fs=200
    )
    tone = np.sin(np.arange(8000.0)) * (np.abs(np.arange(8000) - 4000) < 2000)
    return {
        "record": record, "findings": findings, "loops": findings.loops, "sticks": findings.sticks,
        "estimate": findings.level, "several": findings.estimates[:4], "run": run,
        "comparison": ss.compare([findings, findings]),
        "curve": ss.fit_curve(findings.record, curve="coulomb"), "decay": ss.analyze_decay(decay).decay,
        "wavelets": ss.wavelet_map(record, "a"), "squeaks": ss.find_squeaks(ss.Record.of({"sound": tone}, fs=8000)),
        "map": ss.sweep(slider, {"frequency": [0.5, 1.0], "kinetic": [0.2, 0.5]}, measures=["stops"], settle=4),
    }  # fmt: skip


def test_whatever_is_asked_for_is_drawn_by_one_call(things: dict[str, Any]) -> None:
    from matplotlib import pyplot

    for name, thing in things.items():
        ax = ss.plot(thing)
        assert ax.figure.number in pyplot.get_fignums(), name
        ax.figure.canvas.draw()
        assert ax.has_data(), name


@pytest.mark.parametrize(
    "name", ["record", "findings", "loops", "sticks", "estimate", "several", "comparison", "curve", "decay", "map"]
)
def test_it_is_drawn_on_axes_of_ones_own(things: dict[str, Any], name: str) -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert ss.plot(things[name], ax=right) is right
    assert right.has_data()
    assert not left.has_data()


def test_what_needs_several_panels_says_so(things: dict[str, Any]) -> None:
    from matplotlib.figure import Figure

    with pytest.raises(ss.errors.ModelError, match=r"several panels of its own; leave out ax="):
        ss.plot(things["squeaks"], ax=Figure().subplots())
    with pytest.raises(ss.errors.ModelError, match="a set"):
        ss.plot({1, 2})


def test_every_drawer_is_there() -> None:
    import importlib

    for place in DRAWN.values():
        file, name = place.split(".")
        assert callable(getattr(importlib.import_module(f"stickslip.figures.{file}"), name)), place


def test_a_notebook_shows_a_table(things: dict[str, Any]) -> None:
    for name in ("record", "findings", "loops", "estimate", "run", "comparison", "curve", "decay"):
        shown = things[name]._repr_html_()
        assert shown.count("<table>") == shown.count("</table>") == 1, name
        assert len(re.findall("<tr>", shown)) >= 2, name
    level = things["estimate"]
    assert all(cell in level._repr_html_() for cell in level.cells)
    assert "<script" not in ss.Record.of({"x": [1.0, 2.0]}, fs=1.0)._repr_html_()
    hostile = ss.Estimate.normal("<script>", 1.0, sd=0.1, unit="N", method="&")
    assert "&lt;script&gt;" in hostile._repr_html_()
    story = ss.summary(things["findings"])
    assert story.answer.split(";")[0] in story._repr_html_()


def test_a_caution_that_several_rows_share_stands_once(things: dict[str, Any]) -> None:
    shown = things["findings"]._repr_html_()
    shared = max(
        (str(estimate.status) for estimate in things["findings"].estimates if estimate.status != "ok"), key=len
    )
    assert shown.count(shared.split("; ")[0]) == 1


def test_answers_and_motions_become_tables_of_pandas_and_xarray(things: dict[str, Any]) -> None:
    frame = things["loops"].to_pandas()
    level = things["loops"].level
    row = frame.loc["sliding friction"]
    assert (row.value, row.low, row.high, row.unit) == (level.value, *level.interval, "N")
    assert list(frame.index) == [estimate.name for estimate in things["loops"].estimates]
    assert float(things["loops"].to_xarray()["value"].sel(quantity="sliding friction")) == level.value
    assert len(things["findings"].to_pandas()) == len(things["findings"].estimates)
    run = things["run"]
    frame, data = run.to_pandas(fs=50.0), run.to_xarray()
    np.testing.assert_array_equal(frame["x"], run.sample(frame.index, ("x",))[0][0])
    assert data.sizes["time"] == 6 * 200 + 1
    assert data["friction"].attrs["units"] == "N"


@pytest.mark.parametrize(
    ("given", "step"),
    [({"x": [1.0]}, r"Record\.of\(\{"), ("rig.csv", "read_record"), (3, r"Record\.of")],
)
@pytest.mark.parametrize(
    "ask", [ss.analyze, ss.friction_loops, ss.find_sticks, ss.decrement, ss.analyze_decay, ss.find_squeaks]
)
def test_what_is_no_record_is_refused_by_how_one_is_made(ask: Any, given: Any, step: str) -> None:
    with pytest.raises(ss.errors.RecordError, match=f"where a Record belongs.*{step}"):
        ask(given)


def test_a_frame_is_refused_by_what_makes_a_record_of_it(things: dict[str, Any]) -> None:
    record = things["record"]
    for frame, maker in ((record.to_pandas(), "from_pandas"), (record.to_xarray(), "from_xarray")):
        with pytest.raises(ss.errors.RecordError, match=maker):
            ss.analyze(frame)
        assert getattr(ss.record, maker)(frame).equals(record)


def test_some_forty_names_come_first(things: dict[str, Any]) -> None:
    assert 35 <= len(dir(ss)) <= 46
    assert set(dir(ss)) < set(ss.__all__)
    assert {"analyze", "plot", "laws", "Record", "simulate"} <= set(dir(ss))
    assert all(getattr(ss, name) is not None for name in ss.__all__)
