"""Which motion a record's free decay follows, by the call that a user makes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.decay.motions import free_decay

TIMES = np.arange(3000) / 200


def released(damping: float, dry: float, *, seed: int, restoring: str = "linear") -> ss.Record:
    given = [2 * np.pi, damping, dry, 0.02, 1.2, 0.5, 0, 0, 0, 0, 0.5, 0]
    x = free_decay(TIMES, given, restoring=restoring)[0] + 1e-3 * np.random.default_rng(seed).standard_normal(
        TIMES.size
    )
    return ss.Record.of({"theta": x}, fs=200)


@pytest.mark.parametrize(
    ("damping", "dry", "model"), [(0.02, 0.02, "both"), (0.02, 0.0, "viscous"), (0.0, 0.02, "dry")]
)
def test_the_model_is_chosen_from_the_record_alone(damping: float, dry: float, model: str) -> None:
    choice = ss.decay.choose_motion(released(damping, dry, seed=1))
    assert (choice.model, choice.status) == (model, "ok")
    for narrow, wide, truth in (
        (choice.damping_ratio, choice.damping_ratio_any, damping),
        (choice.dry_displacement, choice.dry_displacement_any, dry),
    ):
        assert wide.interval[0] <= narrow.interval[0] <= narrow.interval[1] <= wide.interval[1]
        assert wide.includes(truth)
    assert choice.frequency.value == pytest.approx(1.0, abs=1e-3)
    assert {name for name, _, _ in choice.candidates} == {
        "viscous",
        "dry",
        "both",
        "static",
        "air",
        "quadratic",
        "stribeck",
        "curved spring",
        "micro-slip",
        "elastic contact",
    }


def test_a_pendulum_is_told_from_a_straight_spring() -> None:
    record = released(0.01, 0.01, seed=2, restoring="pendulum")
    assert ss.decay.choose_motion(record).model == "curved spring"
    assert ss.decay.choose_motion(record, restoring="pendulum").model == "both"


def test_what_can_not_be_asked_is_refused() -> None:
    speed = np.gradient(released(0.02, 0.02, seed=0)["theta"], 0.005)
    with pytest.raises(ss.errors.EstimateError, match="made on a displacement"):
        ss.decay.choose_motion(ss.Record.of({"v": speed}, fs=200))
    record = released(0.02, 0.02, seed=0)
    with pytest.raises(ss.errors.EstimateError, match="restoring = 'round'"):
        ss.decay.choose_motion(record, restoring="round")
    with pytest.raises(ss.errors.EstimateError, match="an angle in rad"):
        ss.decay.choose_motion(ss.Record.of({"x": record["theta"]}, fs=200), restoring="pendulum")


def test_clipped_swings_are_left_out() -> None:
    choice = ss.decay.choose_motion(
        ss.Record.of({"theta": np.clip(released(0.02, 0.02, seed=1)["theta"], -0.7, 0.7)}, fs=200)
    )
    assert choice.model == "both"
    assert choice.status == "clipped swings are left out"
    assert abs(choice.dry_displacement.value - 0.02) < 4.5 * choice.dry_displacement.sd


def test_a_real_pendulum(dataset: Callable[[str], Path]) -> None:
    """Its authors: 4.1e-3 N m dry, 0.5e-3 N m s viscous; three other methods 3.7e-3 to 4.9e-3 and 2.6e-4 to 5.5e-4."""
    path = dataset("pendulum_decay") / "pend1.csv"
    record = ss.read_record(path, channels={"theta": "#2 - 3.141592653589793 [rad]"}, time="#1 [s]")
    choice = ss.decay.choose_motion(
        record, restoring="pendulum", candidates=("viscous", "both", "quadratic", "stribeck")
    )
    inertia = 0.2235 * 0.31692**2
    both = choice.choice.candidate("both")
    w = both.fitted.value("angular_frequency")
    torque, viscous = w**2 * inertia, 2 * w * inertia
    assert both.fitted.value("dry_displacement") * torque == pytest.approx(3.86e-3, abs=0.05e-3)
    assert both.fitted.value("damping_ratio") * viscous == pytest.approx(5.2e-4, abs=0.1e-4)
    alone = choice.choice.candidate("viscous").fitted.cost
    assert alone > 10**2 * both.fitted.cost
    assert alone > 50**2 * choice.choice.chosen.fitted.cost
    low, high = choice.dry_displacement_any.interval
    assert low * torque < 3.7e-3
    assert high * torque > 4.89e-3
    low, high = choice.damping_ratio_any.interval
    assert low * viscous < 2.6e-4
    assert high * viscous > 5.5e-4
    assert "no candidate fits" in choice.status


@pytest.mark.parametrize("length", [1e-9, 1.0])
def test_a_motion_without_noise_is_the_simplest_that_makes_it(length: float) -> None:
    """What is left is rounding, whose colour says nothing."""
    x = length * free_decay(TIMES, [2 * np.pi, 0.02, 0.02, 0.013, 1.0, 0.27, 0, 0, 0, 0, 0.5, 0])[0]
    choice = ss.decay.choose_motion(ss.Record.of({"x": x}, fs=200))
    assert (choice.model, choice.status) == ("both", "ok")
    assert ss.fit_decay(ss.Record.of({"x": x}, fs=200)).noise == "white"


def test_a_simulated_release_is_what_it_was_made_of() -> None:
    """Without noise, from the exact engine, in blocks of nine samples that hold turning points too."""
    slider = ss.Oscillator(mass=1.0, stiffness=10.0, damping=0.2, law=ss.laws.Coulomb(0.2))
    choice = ss.decay.choose_motion(ss.simulate(slider, duration=20.0, start={"x": 1.0}).record(fs=200))
    assert (choice.model, choice.status) == ("both", "ok")
    assert choice.dry_displacement_any.includes(0.02)


@pytest.mark.parametrize(("step", "noise"), [(5e-3, 1e-4), (5e-3, 2.5e-4), (5e-3, 2e-3)])
@pytest.mark.parametrize("counts", [False, True])
def test_a_coarse_encoder_feigns_no_friction(step: float, noise: float, counts: bool) -> None:
    """Readings of one level at rest are one reading: its error does not average out."""
    given = [2 * np.pi, 0.02, 0.02, 0.013, 1.0, 0.27, 0, 0, 0, 0, 0.5, 0]
    x = free_decay(TIMES, given)[0] + noise * np.random.default_rng(1).standard_normal(TIMES.size)
    choice = ss.decay.choose_motion(ss.Record.of({"x": np.round(x / step) * (1 if counts else step)}, fs=200))
    assert (choice.model, choice.status) == ("both", "ok")
    assert choice.dry_displacement_any.includes(0.02 / (step if counts else 1))


def test_dry_friction_beyond_doubt_stays_so_whichever_motion_it_was() -> None:
    """Friction that may rise towards rest shares the dry friction with the rise, and never takes it all."""
    x = free_decay(TIMES, [20, 0, 0.001, 0, 0.03, 0, 0, 0, 0, 0, 0.5, 0])[0]
    x += 3e-5 * np.random.default_rng(1).standard_normal(TIMES.size)
    choice = ss.decay.choose_motion(ss.Record.of({"x": x}, fs=200))
    assert "stribeck" in [each.name for each in choice.choice.kept]
    low, high = choice.dry_displacement_any.interval
    assert 0.4e-3 < low < 1e-3 < high < 1.1e-3
    assert choice.damping_ratio_any.interval[1] < 0.005


def test_whichever_motion_it_was_leaves_out_what_the_record_speaks_against() -> None:
    from scipy.integrate import solve_ivp

    zeta, drag, turn = 0.004, 7.2, 4 * np.pi  # viscous damping and air drag, without any dry friction
    moved = solve_ivp(
        lambda _, y: [y[1], -(turn**2) * y[0] - 2 * zeta * turn * y[1] - drag * abs(y[1]) * y[1]],
        (0, 14),
        [0.02, 0.0],
        t_eval=np.arange(0, 14, 1 / 200),
        rtol=1e-9,
        atol=1e-12,
    ).y[0]
    noisy = moved + 2e-5 * np.random.default_rng(1).standard_normal(len(moved))
    decay = ss.analyze_decay(ss.Record.of({"x": noisy}, fs=200), stiffness=1000.0).decay
    ratio, dry = decay.whichever
    assert ratio.interval[0] <= zeta <= ratio.interval[1] < 0.006  # as viscous and dry friction 0.038 came out
    assert ratio.interval[0] <= ratio.value <= ratio.interval[1]
    assert -1e-5 < dry.interval[0] <= 0 <= dry.interval[1] < 1e-5  # and -98 um of the swing's 20 mm
