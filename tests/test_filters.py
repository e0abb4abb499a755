"""Filters before a question: by tones whose gain is known in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stickslip as ss

FS, T = 1000.0, np.arange(8000) / 1000
MIDDLE = slice(2000, -2000)


def tone(frequency: float) -> ss.Record:
    return ss.Record.of({"x": np.sin(2 * np.pi * frequency * T), "load": 2 * np.cos(2 * np.pi * frequency * T)}, fs=FS)


def gain(before: ss.Record, after: ss.Record) -> float:
    """Of x, its phase counted: the share of the tone that comes through in time."""
    x, y = before["x"][MIDDLE], after["x"][MIDDLE]
    return float(x @ y / (x @ x))


@pytest.mark.parametrize("frequency", [2.0, 8.0, 10.0, 12.0, 30.0])
def test_a_low_pass_has_butterworths_gain_and_no_phase(frequency: float) -> None:
    def warped(f: float) -> float:
        return float(np.tan(np.pi * f / FS))  # the digital filter's frequency

    wanted = 1 / (1 + (warped(frequency) / warped(10.0)) ** 8)
    before = tone(frequency)
    assert gain(before, ss.signals.keep_band(before, high=10.0)) == pytest.approx(wanted, abs=2e-4)
    assert gain(before, ss.signals.keep_band(before, low=10.0)) == pytest.approx(1 - wanted, abs=2e-4)


def test_a_mode_is_taken_out_and_its_neighbours_stay() -> None:
    out = [gain(tone(f), ss.signals.remove_mode(tone(f), frequency=50.0)) for f in (5.0, 50.0, 200.0)]
    np.testing.assert_allclose(out, [1, 0, 1], atol=1e-3)


def test_forces_still_balance_where_all_channels_are_filtered_alike() -> None:
    mixed = np.random.default_rng(1).normal(size=(2, T.size))
    record = ss.Record.of({"x": mixed[0], "force": mixed[1], "load": 3 * mixed[0] - mixed[1]}, fs=FS)
    kept = ss.signals.keep_band(record, low=2.0, high=40.0)
    assert np.abs(3 * kept["x"] - kept["force"] - kept["load"]).max() < 1e-12
    assert kept.history[-1].action == "keep_band"
    assert kept.history[-1].arguments["channels"] == ["x", "force", "load"]


def test_a_trend_of_the_degree_asked_for_goes() -> None:
    slow = 3 + 0.2 * T - 0.05 * T**2
    record = ss.Record.of({"x": slow, "load": slow}, fs=FS)
    assert np.abs(ss.signals.remove_trend(record, degree=2)["x"]).max() < 1e-10
    assert abs(ss.signals.remove_trend(record, "x", degree=0)["x"].mean()) < 1e-12
    np.testing.assert_array_equal(ss.signals.remove_trend(record, "x")["load"], slow)


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda r: ss.signals.keep_band(r), "low=, high="),
        (lambda r: ss.signals.keep_band(r, high=500.0), "half the"),
        (lambda r: ss.signals.keep_band(r, low=20, high=10), "lower first"),
        (lambda r: ss.signals.keep_band(r, low=0.1), "needs at least 30001"),
        (lambda r: ss.signals.remove_mode(r, frequency=490.0), "correct the frequency"),
        (lambda r: ss.signals.remove_trend(r, degree=9), "degree 0 to 6"),
        (lambda r: ss.signals.keep_band(r, high=5.0, channels=["w"]), "channel w is missing"),
    ],
)
def test_what_a_filter_can_not_do_is_one_sentence(ask: Any, words: str) -> None:
    with pytest.raises(ss.errors.RecordError, match=words):
        ask(tone(5.0))
