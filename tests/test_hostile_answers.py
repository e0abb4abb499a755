"""Records that can not answer: a sentence each, of what was asked, and nothing lost of what could be told."""

from __future__ import annotations

import contextlib
import inspect
import json
from collections.abc import Callable
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
    with pytest.raises(ss.errors.EstimateError, match="the friction force needs at least"):
        ss.analyze(short, mass=2.42, stiffness=2310, damping=0.12)
    with pytest.raises(ss.errors.EstimateError, match=r"(friction loops|sticks and slips) needs at least"):
        ss.analyze(short)


@pytest.mark.parametrize("samples", [100, 299])
def test_a_side_question_without_an_answer_refuses_no_other(samples):
    demo = ss.datasets.demo()
    short = ss.Record.of({name: demo[name][::50][:samples] for name in ("x", "z", "a")}, fs=demo.fs / 50)
    findings = ss.analyze(short, mass=2.42, stiffness=2310, damping=0.12)
    assert findings.level is not None
    assert findings.level.value == pytest.approx(1.1, rel=0.1)


def free_decay():
    """A mass on a spring, let go, with both frictions."""
    slider = ss.Oscillator(mass=1.0, stiffness=40.0, damping=0.2, law=ss.laws.Coulomb(0.1))
    run = ss.simulate(slider, duration=12.0, start={"x": 0.1})
    return ss.Rig.perfect().having("x", white=1e-4).measure(run, fs=100, rng=1)


@pytest.mark.figures
def test_findings_outlive_a_figure_that_can_not_be_drawn(tmp_path, monkeypatch):
    findings = ss.analyze_decay(free_decay(), method="thesis")

    def fails(*_, **__):
        raise ValueError("Axis limits cannot be NaN or Inf")

    monkeypatch.setattr("stickslip.figures.decay.plot_differences", fails)
    folder = ss.publish(findings, folder=tmp_path / "results")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "The figure &#39;Amplitude differences&#39; can not be drawn: Axis limits cannot be NaN or Inf." in page
    names = sorted(path.name for path in (folder / "figures").iterdir())
    assert {"decay.svg", "decay.png"} <= set(names)
    assert not [name for name in names if name.startswith("differences")]
    assert json.loads((folder / "results.json").read_text(encoding="utf-8"))["estimates"]


@pytest.mark.figures
def test_a_decay_without_a_finite_worst_case_is_drawn_and_written(tmp_path):
    findings = ss.analyze_decay(free_decay(), method="thesis")
    unbounded = {name: np.full(len(findings.decay.thesis.bounds.m), np.inf) for name in ("rate_worst", "dry_worst")}
    bounds = replace(findings.decay.thesis.bounds, **unbounded)
    decay = replace(findings.decay, thesis=replace(findings.decay.thesis, bounds=bounds))
    folder = ss.publish(findings.having(decay=decay), folder=tmp_path / "results")
    assert (folder / "figures" / "bounds.svg").exists()


ROOMS = ("balance", "cycle", "contact", "consistent", "decay", "law", "squeak", "signals")
# what searches for seconds in any record of this length, and is asked by others of the list or in its own tests
LONG = {"transition", "find_microslips", "mechanism", "lag_or_compliance", "synchronise", "sound_quality", "resample",
        "wavelet_map", "wavelet_blocks", "wavelet_overview"}  # fmt: skip
CHANNELS = ("x", "v", "a", "z", "friction", "load", "sound")
STATED = {"channel": "x", "channels": "x", "fs": 500.0}


def questions() -> dict[str, Callable[..., object]]:
    """Public functions of a record alone, by their signatures."""
    offered = {
        name: getattr(place, name) for place in (ss, *(getattr(ss, room) for room in ROOMS)) for name in place.__all__
    }
    chosen = {}
    for name, function in offered.items():
        if not inspect.isfunction(function) or function.__module__.split(".")[1] not in ROOMS or name in LONG:
            continue
        first, *others = inspect.signature(function).parameters.values()
        needed = {
            other.name for other in others if other.default is other.empty and other.kind is not other.VAR_POSITIONAL
        }
        if "Record" in str(first.annotation) and needed <= STATED.keys():
            chosen[name] = function
    return chosen


TIME = np.arange(1000) / 1000
SINE, NOISE = np.sin(10 * np.pi * TIME), np.random.default_rng(0).standard_normal(1000)
DEGENERATE = {
    "zero": 0 * TIME, "constant": 0 * TIME + 3.7, "impulse": np.eye(1000)[500], "noise": NOISE,
    "decay": np.exp(-3 * TIME) * np.cos(20 * np.pi * TIME), "large": 1e300 * SINE, "small": 1e-300 * NOISE,
    "least": 5e-324 * np.sign(SINE), "holes": np.where(abs(TIME - 0.5) < 0.05, np.nan, SINE),
    "one": NOISE[:1], "three": NOISE[:3], "nineteen": SINE[:19], "299": NOISE[:299],
}  # fmt: skip


QUESTIONS = questions()


def test_the_battery_is_asked_of_many() -> None:
    assert len(QUESTIONS) > 25


@pytest.mark.parametrize("name", QUESTIONS)
def test_a_degenerate_record_has_an_answer_or_a_sentence(name):
    """Nothing but StickslipError comes out, and no warning: they are errors here."""
    question = QUESTIONS[name]
    asked = inspect.signature(question).parameters.values()
    needed = {each.name: STATED[each.name] for each in asked if each.default is each.empty and each.name in STATED}
    by_name = {key: value for key, value in needed.items() if key != "channels"}
    for wave in DEGENERATE.values():
        for alike in (True, False):
            rows = {c: wave if alike else (1 + k) * np.roll(wave, 7 * k + 1) for k, c in enumerate(CHANNELS)}
            record = ss.Record.of(rows, fs=1000)
            with contextlib.suppress(ss.StickslipError):
                repr(question(record, *(["x"] if "channels" in needed else []), **by_name))
