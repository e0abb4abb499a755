"""The rate behind time stamps: rounded, added up, in single precision, or not uniform."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.record.clock import fit_clock


@pytest.mark.parametrize("digits", [6, 7])
@pytest.mark.parametrize("fs", [22_050.0, 4000.0, 229.0, 161.0, 150.0])
def test_stamps_of_so_many_significant_digits_follow_one_rate(tmp_path: Path, fs: float, digits: int) -> None:
    rows = np.arange(int(2.1 * fs))
    lines = [f"{row / fs:.{digits}g},{np.sin(row / 50):.6g}" for row in rows]  # as "%g" writes them
    path = tmp_path / "sound.csv"
    path.write_text("time [s],sound [1]\n" + "\n".join(lines), "utf-8")
    record = ss.read_record(path)
    assert record.stamps is None
    assert record.fs == pytest.approx(fs, rel=1e-6)


@pytest.mark.parametrize("fs", [1 / 3, 20, 150, 250, 900, 1000, 1024, 1500, 2000, 44100, 51200])
@pytest.mark.parametrize("digits", [5, 6, 9])
@pytest.mark.parametrize("start", [0.0, 17.0, 2332.308])
def test_the_rate_behind_rounded_stamps(fs: float, digits: int, start: float) -> None:
    stamps = np.round(start + np.arange(3000) / fs, digits)
    clock = fit_clock(stamps)
    assert clock.stamps is None
    assert clock.fs == pytest.approx(fs, rel=1e-9 if fs > 1 else 1e-7)
    assert clock.start == stamps[0]


def test_a_rounded_step_that_was_added_up_still_tells_the_rate() -> None:
    assert fit_clock(np.round(2.74812 + 0.00667 * np.arange(5000), 5)).fs == 150
    assert fit_clock(np.round(0.667 * np.arange(1000), 3), 1e-3).fs == 1500


def test_a_single_precision_clock_is_uniform() -> None:
    clock = fit_clock((np.arange(20000) / 1000).astype(np.float32).astype(float))
    assert clock.stamps is None
    assert clock.fs == 1000


@pytest.mark.parametrize("fault", ["gap", "jump back", "jitter", "doubled", "missing"])
def test_stamps_that_are_not_uniform_are_kept(fault: str) -> None:
    stamps = np.arange(1000) / 250
    if fault == "gap":
        stamps[500:] += 0.004
    elif fault == "jump back":
        stamps[500:] -= 1
    elif fault == "jitter":
        stamps += np.random.default_rng(5).normal(0, 2e-4, 1000)
    elif fault == "doubled":
        stamps[500] = stamps[499]
    else:
        stamps[500] = np.nan
    clock = fit_clock(stamps)
    assert clock.stamps is not None
    np.testing.assert_array_equal(clock.stamps, stamps)
    assert clock.fs == pytest.approx(250, rel=0.02)


@pytest.mark.parametrize("fs", [1000, 700, 333])
def test_stamps_in_whole_milliseconds(fs: float) -> None:
    stamps = np.round(np.arange(5000) / fs * 1000)
    assert fit_clock(stamps, 1e-3).stamps is None
    assert fit_clock(stamps, 1e-3).fs == pytest.approx(fs, rel=1e-4)
    dropped = np.delete(np.arange(5000.0), [1234, 3333])
    assert fit_clock(dropped, 1e-3).stamps is not None


@pytest.mark.parametrize("stamps", [[1.0, 1.0, 1.0], [np.nan, np.nan], [3.0, 2.0, 1.0], [5.0]])
def test_a_clock_that_stands_still_is_refused(stamps: list[float]) -> None:
    with pytest.raises(ss.errors.RecordError, match=r"does not advance; .* pass fs="):
        fit_clock(np.array(stamps))
