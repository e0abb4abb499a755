"""What a joint's columns are: units at the end of a title, angles that wrap, and signs the wrong way round."""

import numpy as np
import pytest

import stickslip as ss
from stickslip.answers import analyze_joint, axis_record
from stickslip.cycle import regress_joint
from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import stands

T = np.arange(6000) / 200
Q = 0.3 + 2.4 * np.sin(2 * np.pi * 0.2 * T) + 0.8 * np.sin(2 * np.pi * 0.7 * T)
V, A = np.gradient(Q, T), np.gradient(np.gradient(Q, T), T)
TORQUE = 0.02 * A + 0.03 * V + np.sign(V) * (0.06 + 0.15 * np.abs(0.5 * np.sin(Q))) + 0.5 * np.sin(Q)
TORQUE = TORQUE + np.random.default_rng(0).normal(0, 0.01, T.size)


@pytest.mark.parametrize("places", [{"position_rad": Q}, {"position_deg": np.degrees(Q)}])
@pytest.mark.parametrize(
    ("torques", "constant"),
    [({"torque_Nm": TORQUE}, None), ({"current_mA": 1e3 * TORQUE}, 1.0), ({"current_A": TORQUE}, 1.0)],
)
def test_a_unit_at_the_end_of_a_title_is_one(places, torques, constant) -> None:
    """They were taken for axes, one of which had a position and the other a torque."""
    joint = analyze_joint(ss.Record.of({**places, **torques}, fs=200), torque_constant=constant).joint
    assert joint.forward.includes(0.06)
    assert joint.status == "ok"


def test_letters_that_tell_axes_are_no_units() -> None:
    for others in ({"position_B": 0 * Q, "current_B": 0 * Q}, {"position_B": 0 * Q}, {}):
        channels = {"position_A": Q / 2, "current_A": TORQUE, **others}
        axis = axis_record(ss.Record.of(channels, fs=200), axis="A" if others else None)
        assert list(axis) == ["theta", "current"]
        assert axis["current"] == pytest.approx(TORQUE)


@pytest.mark.parametrize("names", [("theta", "reference", "force"), ("position", "goal_position", "effort")])
def test_an_angle_that_wraps_is_counted_on(names) -> None:
    """It was told to be stuck for 80 % of the time, with no scatter, and its controller to pull by whole turns."""
    told = Q + TORQUE / 18
    whole, wrapped = (
        ss.Record.of(
            dict(zip(names, channels, strict=True)), fs=200, units=dict(zip(names, ("rad", "rad", "N m"), strict=True))
        )
        for channels in ((Q, told, TORQUE), (Q % (2 * np.pi), (told + np.pi) % (2 * np.pi) - np.pi, TORQUE))
    )
    log, counted = axis_record(whole), axis_record(wrapped)
    turns = (counted["theta"] - log["theta"]) / (2 * np.pi)
    assert np.ptp(turns) < 1e-9
    assert turns[0] == pytest.approx(round(turns[0]))
    assert counted["reference"] - counted["theta"] == pytest.approx(log["reference"] - log["theta"])
    assert "counted on" in counted.history[-1].outcome
    assert analyze_joint(wrapped).sticks.share.value == pytest.approx(analyze_joint(whole).sticks.share.value, abs=0.02)


def test_an_angle_that_jumps_otherwise_is_left_alone() -> None:
    jumps = Q + 4.0 * (T > 10)
    assert axis_record(ss.Record.of({"theta": jumps, "force": TORQUE}, fs=200))["theta"] == pytest.approx(jumps)


@pytest.mark.parametrize("gravity", [True, False])
def test_a_torque_of_the_other_sign_is_refused(gravity: bool) -> None:
    """Told was that no dry friction was felt: "more than unknown would be"."""
    torque = TORQUE if gravity else TORQUE - 0.5 * np.sin(Q)
    log = ss.Record.of({"theta": Q, "force": -torque}, fs=200, units={"force": "N m"})
    with pytest.raises(EstimateError, match=r"it drives the motion; friction opposes the motion; .*force=-COLUMN"):
        regress_joint(log, gravity=gravity)


def test_what_a_zero_of_the_torque_would_show_is_said_of_either_direction() -> None:
    """An axis that stands upright was told to rub against 396 N forward, without a doubt, of 128 N either way."""
    for zero in (0.0, 0.03, 0.3):
        log = ss.Record.of({"theta": Q, "force": TORQUE + zero}, fs=200, units={"force": "N m"})
        joint = regress_joint(log)
        assert joint.level.includes(0.06 + 0.15 * joint.carried)
        assert joint.level.status == "ok"
        for one in (joint.forward, joint.back):
            assert ("zero of the torque" in one.status) == (zero > 0)
            assert stands(one.status) or not one.known


def test_an_axis_that_moves_straight_is_refused_in_its_own_unit() -> None:
    log = ss.Record.of({"x": 1e-3 * T, "force": TORQUE}, fs=200)
    with pytest.raises(EstimateError, match=r"faster than \S+ m/s at"):
        regress_joint(log)


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_an_even_torque_tells_no_delay(seed: int) -> None:
    """Told were -42 to 23 ms, surely, of torques in time."""
    chance = np.random.default_rng(seed)
    speed = chance.choice([0.3, 0.6, 1.0, 2.0], 4)[T.astype(int) // 8] * np.where(T % 2 < 1, 1.0, -1.0)
    torque = 0.03 * speed + 0.06 * np.sign(speed) + chance.normal(0, 0.005, T.size)
    channels = {"theta": np.cumsum(speed) / 200 + chance.normal(0, 1e-5, T.size), "force": torque}
    log = ss.Record.of(channels, fs=200, units={"force": "N m"})
    joint = regress_joint(log, gravity=False, inertia=0.02)
    assert joint.delay is None
    assert "delay of the torque" in " ".join(joint.left_out)


def test_gravity_is_no_sine_of_a_displacement() -> None:
    """An axis was told to turn farther."""
    straight = ss.Record.of({"x": Q, "force": TORQUE}, fs=200)
    with pytest.raises(ModelError, match="half of what Coulomb friction forward and back differ by"):
        regress_joint(straight, gravity=True)
    assert regress_joint(straight, gravity=False).sine is None
