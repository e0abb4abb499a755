"""Records that can not answer: a sentence each, of what was asked, and nothing lost of what could be told."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss


@pytest.mark.parametrize("samples", [3, 19])
@pytest.mark.parametrize("names", [("x", "z", "a"), ("x", "z", "a", "load")])
def test_what_is_too_short_is_told_of_what_was_asked(samples, names):
    """And not of a side question: the delay between two sensors, or a comparison of forces."""
    demo = ss.datasets.demo()
    short = ss.Record.of({name: demo[name][::50][:samples] for name in names}, fs=demo.fs / 50)
    with pytest.raises(ss.EstimateError, match="the friction force needs at least"):
        ss.analyze(short, mass=2.42, stiffness=2310, damping=0.12)
    with pytest.raises(ss.EstimateError, match=r"(friction loops|sticks and slips) needs at least"):
        ss.analyze(short)


@pytest.mark.parametrize("samples", [100, 299])
def test_a_side_question_without_an_answer_refuses_no_other(samples):
    demo = ss.datasets.demo()
    short = ss.Record.of({name: demo[name][::50][:samples] for name in ("x", "z", "a")}, fs=demo.fs / 50)
    found = ss.analyze(short, mass=2.42, stiffness=2310, damping=0.12)
    assert found.level is not None
    assert found.level.value == pytest.approx(1.1, rel=0.1)


def free_decay():
    """A mass on a spring, let go, with both frictions."""
    slider = ss.Oscillator(mass=1.0, stiffness=40.0, damping=0.2, law=ss.Coulomb(0.1))
    run = ss.simulate(slider, duration=12.0, start={"x": 0.1})
    return ss.Rig.perfect().having("x", white=1e-4).measure(run, fs=100, rng=1)


def test_findings_outlive_a_figure_that_can_not_be_drawn(tmp_path, monkeypatch):
    found = ss.analyze_decay(free_decay(), method="thesis")

    def fails(*_, **__):
        raise ValueError("Axis limits cannot be NaN or Inf")

    monkeypatch.setattr("stickslip.plot.decay.plot_differences", fails)
    folder = ss.publish(found, folder=tmp_path / "results")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "The figure &#39;Amplitude differences&#39; can not be drawn: Axis limits cannot be NaN or Inf." in page
    names = sorted(path.name for path in (folder / "figures").iterdir())
    assert {"decay.svg", "decay.png"} <= set(names)
    assert not [name for name in names if name.startswith("differences")]
    assert json.loads((folder / "results.json").read_text(encoding="utf-8"))["estimates"]


def test_a_decay_without_a_finite_worst_case_is_drawn_and_written(tmp_path):
    found = ss.analyze_decay(free_decay(), method="thesis")
    unbounded = {name: np.full(len(found.thesis.bounds.m), np.inf) for name in ("rate_worst", "dry_worst")}
    bounds = replace(found.thesis.bounds, **unbounded)
    folder = ss.publish(replace(found, thesis=replace(found.thesis, bounds=bounds)), folder=tmp_path / "results")
    assert (folder / "figures" / "bounds.svg").exists()
