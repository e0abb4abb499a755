"""How a measured friction rings after a slip begins, on closed forms and on a real brake."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from stickslip.cli.program import main
from stickslip.errors import EstimateError, RecordError

FORWARD, BACK = 47.0, 54.0


def rung(
    fs: float = 1000.0,
    *,
    scale: float = 1.0,
    size: float = 0.3,
    noise: float = 0.01,
    decay: float = 10.0,
    seed: int = 0,
) -> ss.Record:
    """Twelve seconds at 0.5 Hz: each stroke rings from its begin on, faster when it goes back."""
    time = np.arange(round(12 * fs)) / fs
    since, way = np.mod(time + 0.5, 1.0), np.sign(np.cos(np.pi * time))
    ring = np.exp(-decay * since) * np.cos(2 * np.pi * np.where(way > 0, FORWARD, BACK) * since)
    noises = np.random.default_rng(seed).normal(size=time.size) * noise
    friction = scale * (way * (1 + 0.05 * since + size * ring) + noises)
    return ss.Record.of({"x": np.sin(np.pi * time) / np.pi, "friction": friction}, fs=fs)


def test_frequency_damping_and_difference_of_closed_forms() -> None:
    ringing = ss.cycle.slip_ringing(rung())
    truth = {
        "forward": FORWARD, "back": BACK, "difference": FORWARD - BACK,
        "damping_forward": 10 / np.hypot(10, 2 * np.pi * FORWARD), "damping_back": 10 / np.hypot(10, 2 * np.pi * BACK),
    }  # fmt: skip
    for name, true in truth.items():
        assert getattr(ringing, name).value == pytest.approx(true, rel=0.04), name
    assert ringing.forward is not None
    assert ringing.amplitude_forward is not None
    assert 0.7 * 0.3 < ringing.amplitude_forward.value < 0.3  # slip is seen at a peak of the ring
    assert ringing.forward.value == pytest.approx(FORWARD, rel=3e-3)
    assert ringing.verdict == "higher back"


@pytest.mark.parametrize(("trials", "least"), [(12, 0.82), pytest.param(40, 0.88, marks=pytest.mark.soak)])
def test_intervals_hold_the_truth(trials: int, least: float) -> None:
    """Three intervals of a record; fewer of the short form's 36 hold by chance once in 500."""
    held = []
    for seed in range(trials):
        ringing = ss.cycle.slip_ringing(rung(noise=0.05, seed=seed))
        for estimate, true in ((ringing.forward, FORWARD), (ringing.back, BACK), (ringing.difference, FORWARD - BACK)):
            assert estimate is not None
            held.append(estimate.interval[0] <= true <= estimate.interval[1])
    assert np.mean(held) > least


def test_neither_unit_nor_rate_matters() -> None:
    one, large, fast = (
        ss.cycle.slip_ringing(each) for each in (rung(noise=0), rung(noise=0, scale=1e4), rung(4000, noise=0))
    )
    for name in ("forward", "back", "damping_forward", "amplitude_back"):
        assert getattr(large, name).value == pytest.approx(getattr(one, name).value, rel=1e-6)
        assert getattr(fast, name).value == pytest.approx(getattr(one, name).value, rel=0.02)


def test_two_alike_directions_have_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "BACK", FORWARD)
    differences = [ss.cycle.slip_ringing(rung(noise=0.05, seed=seed)).verdict for seed in range(10)]
    assert differences.count("no difference can be told") >= 8


def test_no_ringing_is_refused() -> None:
    for seed in range(10):
        with pytest.raises(EstimateError, match="no ringing"):
            ss.cycle.slip_ringing(rung(size=0.0, noise=0.1, seed=seed))
    with pytest.raises(EstimateError, match="no ringing"):
        ss.cycle.slip_ringing(rung(size=0.01, noise=0.0))
    with pytest.raises(RecordError, match="friction"):
        ss.cycle.slip_ringing(ss.Record.of({"x": np.sin(np.arange(4000) / 100)}, fs=1000))


def test_friction_from_a_balance_is_refused() -> None:
    slider = ss.Oscillator(3.0, 1200, law=ss.laws.Coulomb(1.0), drive=ss.drives.HarmonicBase(3e-3, frequency=1.0))
    record = ss.friction_force(ss.simulate(slider, cycles=6).record(fs=500), mass=3.0, stiffness=1200)
    with pytest.raises(RecordError, match="balance"):
        ss.cycle.slip_ringing(record)


def test_what_is_taken_for_the_course_of_the_friction_widens_the_interval() -> None:
    """A ring of two swings on a friction that bends as fast: polynomials of degree 4, 6 and 8 leave different rings."""
    time = np.arange(12000) / 1000
    since, way = np.mod(time + 0.5, 1.0), np.sign(np.cos(np.pi * time))
    ring = np.exp(-60 * since) * np.cos(2 * np.pi * FORWARD * since)
    noises = np.random.default_rng(1).normal(size=time.size) * 0.01
    bent = 0.1 * np.exp(-((since - 0.06) ** 2) / 1e-3)
    record = ss.Record.of(
        {"x": np.sin(np.pi * time) / np.pi, "friction": way * (1 + 0.3 * ring + bent) + noises}, fs=1000
    )
    ringing = ss.cycle.slip_ringing(record)
    assert ringing.forward is not None
    assert "takes part of the ring" in ringing.forward.status
    low, high = ringing.forward.interval
    assert low < FORWARD < high
    assert ringing.verdict == "no difference can be told"


def test_a_band_brake_rings(dataset: Callable[[str], Path], tmp_path: Path) -> None:
    """What a user is told of the real damper: the ringing after slips, and by how much the directions differ."""
    for name, damping, verdict in (
        ("0.5Hz35lbtension", 0.08, "no difference can be told"),  # the polynomial moves it by more
        ("1Hz80lbtension", 0.0, "higher back"),
    ):
        path = dataset("band_brake_damper") / f"{name}.json"
        channels = ["friction=c3 [kip]", "x=#2 [in]", "v=#4 [in/s]"]
        options = [part for channel in channels for part in ("--channels", channel)]
        called = ["wavelet", str(path), *options, "--time", "#1", "--output", str(tmp_path)]
        ran = CliRunner().invoke(main, called)
        assert ran.exit_code == 0, ran.output
        assert "After slip begins the friction rings at" in " ".join(ran.output.split())
        data = json.loads((tmp_path / "results.json").read_text())
        assert data["slip_ringing"] == verdict
        values = {each["name"]: each["value"] for each in data["estimates"]}
        assert 41 < values["ringing after slip begins, forward"] < 56
        assert 53 < values["ringing after slip begins, back"] < 59
        assert values["ringing after slip begins, forward less back"] < -2
        forward, back = (values[f"damping ratio of that ringing, {side}"] for side in ("forward", "back"))
        assert forward - back > damping  # forward it dies away, back it goes on
        assert "After slip begins" in (tmp_path / "report.html").read_text()


def test_a_friction_that_is_its_level_to_rounding_does_not_ring() -> None:
    """The search for a mode in what rounding leaves tried one that grows beyond all numbers."""
    angle = 2 * np.pi * np.arange(8000) / 1000
    noise = np.random.default_rng(1).normal(0, 1e-7, angle.size)
    channels = {"x": 0.02 * np.sin(angle) + noise, "v": 0.04 * np.pi * np.cos(angle)}
    record = ss.Record.of({**channels, "friction": 1.5 * np.sign(channels["v"])}, fs=1000.0)
    with pytest.raises(EstimateError, match="no ringing"):
        ss.cycle.slip_ringing(record)
