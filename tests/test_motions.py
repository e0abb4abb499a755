"""The motions that a free decay may follow, against closed forms, scipy and the exact engine."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.decay.motions import ALWAYS, MOTIONS, PARAMETERS, WORN, free_decay

W, TIMES = 6.0, np.linspace(0.0, 9.0, 500)
CASES = {
    "both": {"damping_ratio": 0.03, "dry_displacement": 0.02},
    "quadratic": {"damping_ratio": 0.01, "dry_displacement": 0.02, "quadratic": 0.1},
    "stribeck": {"damping_ratio": 0.01, "dry_displacement": 0.02, "rise": 0.3, "stribeck_speed": 0.05 * W},
    "micro-slip": {"damping_ratio": 0.01, "micro_slip": 0.05, "exponent": 0.4},
    "curved spring": {"damping_ratio": 0.01, "dry_displacement": 0.02, "curvature": 0.1},
    "elastic contact": {"damping_ratio": 0.01, "dry_displacement": 0.05, "presliding": 0.01, "relaxation": 0.02},
    "stiff contact": {"damping_ratio": 0.002, "dry_displacement": 0.03, "presliding": 0.001},
    "worn": {"damping_ratio": 0.01, "dry_displacement": 0.02, "wear": 0.05},
    "worn smooth": {"dry_displacement": 0.02, "wear": -0.03, "rise": 0.3, "stribeck_speed": 0.05 * W},
}


def parameters(**values: float) -> np.ndarray:
    given = {"angular_frequency": W, "rest": 0.1, "amplitude": -1.0, "release": 0.33, "exponent": 0.5, **values}
    return np.array([given.get(name, 0.0) for name in PARAMETERS])


def by_scipy(p: np.ndarray, pendulum: bool) -> np.ndarray:
    """The same motion, half cycle after half cycle, by scipy's eighth-order rule."""
    w, zeta, dry, rest, first, start, q, rise, speed, slip, exponent, curve, wear, presliding, relaxation = p
    side, amplitude, history = np.sign(first), abs(first), -slip * abs(first) ** (1 + exponent)
    x, slid, bent = np.full(TIMES.size, rest + first), 0.0, -dry

    def spring(u: float) -> float:
        return (np.sin(u) if pendulum else u) + curve * u**3

    def leaves() -> bool:
        holds = dry * (1 + rise) * (1 + wear * slid / abs(first))
        return presliding > 0 or abs(spring(amplitude) + history) > holds

    while start < TIMES[-1] and leaves():
        top, held = amplitude, history

        def rates(_: float, state: np.ndarray, top: float = top, held: float = held, slid: float = slid) -> list[float]:
            u, y = state[0], -state[1]
            joint = 2 * slip * max((top - u) / 2, 0.0) ** (1 + exponent)
            friction = dry * (1 + rise * np.exp(-y / speed)) if speed else dry
            friction *= 1 + wear * (slid + top - u) / abs(first)
            bends = y * (dry - state[2]) / presliding if presliding else 0.0  # Dahl's equation; LuGre's damping
            friction = state[2] + relaxation * bends if presliding else friction
            return [-y, w * w * (friction - spring(u) - held - joint) + 2 * zeta * w * y + q * y * y, bends]

        def turning(_: float, state: np.ndarray) -> float:
            return state[1]

        turning.terminal, turning.direction = True, 1
        run = solve_ivp(
            rates,
            (0, 10),
            [top, -1e-300, bent],
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
            events=turning,
            dense_output=True,
            max_step=0.1 / w,
        )
        length, (end, _, borne) = run.t_events[0][0], run.y_events[0][0]
        rows = (start < TIMES) & (start + length >= TIMES)
        if rows.any():
            x[rows] = rest + side * run.sol(TIMES[rows] - start)[0]
        history = -history - 2 * slip * ((top - end) / 2) ** (1 + exponent)
        amplitude, side, start, slid = -end, -side, start + length, slid + top - end
        bent = -borne
        x[start < TIMES] = rest + side * amplitude
    return x


@pytest.mark.parametrize("restoring", ["linear", "pendulum"])
@pytest.mark.parametrize("name", CASES)
def test_a_motion_is_that_of_scipy(name: str, restoring: str) -> None:
    given = parameters(**CASES[name], amplitude=-2.5 if restoring == "pendulum" else -1.0)
    found, _, _ = free_decay(TIMES, given, restoring=restoring)
    assert np.abs(found - by_scipy(given, restoring == "pendulum")).max() < 2e-7  # of the interpolation


@pytest.mark.parametrize("name", CASES)
def test_sensitivities_are_differences(name: str) -> None:
    given = parameters(**CASES[name])
    free = (*ALWAYS, *CASES[name])
    _, jacobian, _ = free_decay(TIMES, given, free=free)
    for column, parameter in enumerate(free):
        step = 1e-6 * np.eye(len(PARAMETERS))[PARAMETERS.index(parameter)]
        slope = (free_decay(TIMES, given + step)[0] - free_decay(TIMES, given - step)[0]) / 2e-6
        assert np.abs(jacobian[:, column] - slope).max() < 3e-5 * np.abs(slope).max()


@pytest.mark.parametrize("wear", [-0.1, -0.3])
def test_sensitivities_are_differences_where_friction_is_worn_away(wear: float) -> None:
    given = parameters(damping_ratio=0.01, dry_displacement=0.05, wear=wear)
    free = (*ALWAYS, "damping_ratio", "dry_displacement", "wear")
    times = np.linspace(0.0, 3.0, 400)
    _, jacobian, _ = free_decay(times, given, free=free)
    for column, parameter in enumerate(free):
        step = 1e-6 * np.eye(len(PARAMETERS))[PARAMETERS.index(parameter)]
        slope = (free_decay(times, given + step)[0] - free_decay(times, given - step)[0]) / 2e-6
        assert (
            np.abs(jacobian[:, column] - slope).max() < 3e-4 * np.abs(slope).max()
        )  # a step goes over the bend where it ends


def test_the_closed_form_of_viscous_and_dry() -> None:
    """Reference FD-1: thirteen half cycles, then rest at +0.017450259726877213."""
    x, _, begun = free_decay([0.0, 20.0], [np.sqrt(10), 0.1 / np.sqrt(10), 0.02, 0, 1, 0, 0, 0, 0, 0, 0.5, 0])
    assert begun == 13
    assert x[-1] == pytest.approx(0.017450259726877213, abs=1e-9)


def test_it_may_stay_where_static_friction_holds_it() -> None:
    given = parameters(dry_displacement=0.05, amplitude=1.0)
    x, _, begun = free_decay([100.0], given, half_cycles=4)
    assert (begun, x[0]) == (4, pytest.approx(0.1 + 0.6))  # four times 2 x_k lost


def test_means_over_blocks_are_those_of_the_samples() -> None:
    given, fs, size = parameters(damping_ratio=0.01, dry_displacement=0.01), 400.0, 8
    times = np.arange(3200) / fs
    x = free_decay(times, given)[0].reshape(-1, size).mean(axis=1)
    spread = np.full(x.size, np.sqrt((size**2 - 1) / 12) / fs)
    found = free_decay(times.reshape(-1, size).mean(axis=1), given, spread=spread)[0]
    assert np.abs(found - x).max() < 2e-4  # in the block with the release, whose acceleration jumps
    assert np.median(np.abs(found - x)) < 1e-7


def test_friction_of_the_exact_engine() -> None:
    times = np.arange(240) / 20
    slider = ss.Oscillator(
        mass=1.0, stiffness=4.0, damping=0.08, law=ss.laws.Stribeck(0.08, 0.1, speed=0.4, exponent=1.0)
    )
    x = ss.simulate(slider, duration=12.0, start={"x": 1.0, "v": 0.0}).record(fs=20.0)["x"][:240]
    found, _, _ = free_decay(times, [2, 0.02, 0.02, 0, 1, 0, 0, 0.25, 0.4, 0, 0.5, 0])
    assert np.abs(found - x).max() < 1e-8


def test_micro_slip_is_that_of_many_sliders() -> None:
    """Iwan's even spread of yield displacements: backbone K x - K_j x^2 / (2 D), so kappa = K_j / (2 D K) and p = 1."""
    joint, width, first = 0.2, 3.0, 1.0
    law = ss.laws.ElastoSlip.iwan(joint, width=width, elements=12)
    yields = np.array(law.forces) / np.array(law.stiffnesses)
    loaded = {f"anchor{j}": max(0.0, first - each) for j, each in enumerate(yields)}
    slider = ss.Oscillator(mass=1.0, stiffness=1.0, damping=0.01, law=law)
    x = ss.simulate(slider, duration=8.0, start={"x": first, "v": 0.0, **loaded}).record(fs=20.0)["x"][:160]
    w = np.sqrt(1 + joint)
    kappa = joint / (1 + joint) / (2 * width)
    found, _, _ = free_decay(np.arange(160) / 20, [w, 0.005 / w, 0, 0, first, 0, 0, 0, 0, kappa, 1.0, 0])
    assert np.abs(found - x).max() < 2e-3  # 12 sliders for a continuum: falls with their square
    straight, _, _ = free_decay(np.arange(160) / 20, [w, 0.005 / w, 0, 0, first, 0, 0, 0, 0, 0, 1.0, 0])
    assert np.abs(straight - x).max() > 0.05


def test_every_motion_names_parameters() -> None:
    for name, motion in {**MOTIONS, "worn": WORN}.items():
        assert motion.name == name
        assert set(motion.free) <= set(PARAMETERS)
