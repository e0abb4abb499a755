"""Several free decays together: shared friction where they are alike, said where they are not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import stickslip as ss
from motions import free_decay
from stickslip.answers.decays import _apart


def record(seed, **motion):
    """A release in noise."""
    values, fs, _ = free_decay(**motion)
    noisy = values + 2e-3 * np.random.default_rng(seed).standard_normal(len(values))
    return ss.Record.of({"x": noisy}, fs=fs)


def findings(seed, *, method="waveform", **motion):
    return ss.analyze_decay(record(seed, **motion), method=method, stiffness=100.0)


def width(estimate):
    low, high = estimate.interval
    return high - low


def test_alike_records_share_friction_and_narrow_the_static_bracket():
    each = [findings(seed, amplitude=start, static=0.02) for seed, start in enumerate((0.98, 0.94, 0.9, 0.88))]
    together = ss.answers.compare_decays(each)
    assert not together.apart
    assert together.joint is not None
    assert together.joint.damping_ratio.includes(0.0316)
    assert together.joint.dry_displacement.includes(0.02)
    assert together.dry_force.includes(2.0)
    narrowest = min(width(one.decay.waveform.static_displacement) for one in each)
    assert together.joint.static_displacement.includes(0.02)
    assert width(together.joint.static_displacement) < narrowest
    for name in ("damping_ratio", "dry_displacement", "frequency"):
        assert width(getattr(together.joint, name)) < 0.7 * width(getattr(each[0].decay.best, name))
    told = " ".join(ss.summary(together).headline)
    assert "4 records agree" in told
    assert "the surest record alone leaves" in told


@pytest.mark.parametrize("method", ["waveform", "thesis"])
def test_unlike_records_are_told_and_their_mean_holds_the_scatter(method):
    each = [findings(seed, method=method, dry=dry) for seed, dry in enumerate((0.020, 0.024, 0.028))]
    together = ss.answers.compare_decays(each)
    assert together.joint is None
    assert together.apart["dry friction displacement"] > 5
    mean = together.dry_displacement
    assert mean.includes(0.020)
    assert mean.includes(0.028)
    assert "differ in dry friction displacement" in mean.status
    assert "not alike" in ss.summary(together).headline[0]
    assert ss.summary(together).data()["comparison"]["joint"] is False


def test_records_of_one_oscillator_are_seldom_called_unlike():
    """At one in a hundred: of 60 pairs at most three (0.3 % chance of more)."""
    fits = [ss.fit_decay(record(seed, amplitude=1 - 0.002 * seed)) for seed in range(120)]
    each = [SimpleNamespace(decay=SimpleNamespace(best=fit)) for fit in fits]
    assert sum(bool(_apart(each[2 * k : 2 * k + 2])) for k in range(60)) <= 3


def test_displacement_and_velocity_are_not_fitted_together():
    values, fs, _ = free_decay(order=1)
    velocity = ss.analyze_decay(ss.Record.of({"v": values}, fs=fs), method="thesis")
    together = ss.answers.compare_decays([findings(1, method="thesis"), velocity])
    assert together.joint is None
    assert "channel is x and v" in together.notes[0]


def test_one_record_is_no_comparison():
    with pytest.raises(ss.errors.EstimateError, match="two or more"):
        ss.answers.compare_decays([findings(1, method="thesis")])


@pytest.mark.figures
def test_records_together_have_a_page_and_figures(tmp_path):
    together = ss.answers.compare_decays([findings(1), findings(2, amplitude=0.9)])
    assert [plate.name for plate in ss.summary(together).plates] == ["damping-ratio", "dry-displacement"]
    folder = ss.publish(together, folder=tmp_path / "out")
    page = (folder / "report.html").read_text("utf-8")
    assert "2 records together" in page
    assert "damping ratio, record" in page
