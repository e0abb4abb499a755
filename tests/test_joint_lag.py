"""A controller's output comes late, as it is held and computed: by what its damping lags a joint seems lighter."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import joints
import stickslip as ss
from scripts import loaded
from stickslip.answers import analyze_joint
from stickslip.estimate import stands

INERTIA, KP, KD, LEVEL, VISCOUS = 0.02, 18.0, 0.6, 0.06, 0.03
FS, FINER = 500, 20


def moved(late: float, *, of_speed: bool = False, ki: float = 0.0) -> ss.Record:
    """A joint that moves by sines, and the reference from which a controller that is late makes just its torque.

    Its error e solves ``ki int e + kp e + kd e' = torque(t + d)``; of a controller that damps the speed, what it asks
    for, ``a = kp e - kd v``, solves ``ki int a + a = torque(t + d)``: by the exact response of either equation to a
    torque which is a straight line from instant to instant.
    """
    time = np.arange(30 * FS * FINER) / (FS * FINER)
    sines = [(0.8, 0.21, 0.3), (0.3, 0.83, 1.1), (0.1, 2.3, 0.2)]

    def motion(at: np.ndarray, order: int) -> np.ndarray:
        turn = np.pi / 2 * order
        return sum(a * (2 * np.pi * f) ** order * np.sin(2 * np.pi * f * at + p + turn) for a, f, p in sines)

    later = time + late
    speed = motion(later, 1)
    torque = INERTIA * motion(later, 2) + VISCOUS * speed + LEVEL * np.sign(speed)
    answers = ([1.0, 0.0], [1.0, ki]) if of_speed else ([1.0, 0.0], [KD, KP, ki]) if ki else ([1.0], [KD, KP])
    system = cont2discrete(answers, 1 / (FS * FINER), method="foh")
    asked = lfilter(system[0].ravel(), system[1], torque)
    error = (asked + KD * motion(time, 1)) / KP if of_speed else asked
    rows = slice(2 * FS * FINER, None, FINER)  # without what was before the first instant
    counted = np.round(motion(time, 0) / 1e-4) * 1e-4
    return ss.Record.of({"theta": counted[rows], "reference": (motion(time, 0) + error)[rows]}, fs=FS)


@pytest.mark.parametrize("late", [0.5e-3, 3e-3])
@pytest.mark.parametrize("stated", [True, False], ids=["kd stated", "kd unknown"])
def test_a_late_controller_makes_no_joint_lighter(late: float, stated: bool) -> None:
    given = {"kd": KD} if stated else {}
    joint = ss.cycle.regress_joint(moved(late), kp=KP, gravity=False, **given)
    assert joint.inertia.includes(INERTIA)
    assert joint.inertia.value == pytest.approx(INERTIA, rel=2e-3)
    assert joint.viscous.includes(VISCOUS)
    assert joint.level.includes(LEVEL)
    assert joint.delay is not None
    assert joint.delay.includes(late)
    assert joint.delay.sd < 0.5e-3
    if not stated:
        assert joint.damping is not None
        assert joint.damping.includes(KD - KP * late)


def test_damping_of_the_speed_is_doubted_to_be_viscous_friction() -> None:
    joint = ss.cycle.regress_joint(moved(0.5e-3, of_speed=True), kp=KP, gravity=False)
    assert joint.viscous.value == pytest.approx(VISCOUS + KD, rel=0.02)
    assert joint.delay is None
    assert not stands(joint.viscous.status)
    assert not stands(joint.inertia.status)
    assert stands(joint.level.status)
    sound = ss.cycle.regress_joint(moved(0.5e-3), kp=KP, gravity=False)
    assert stands(sound.viscous.status)
    assert stands(sound.inertia.status)
    stated = ss.cycle.regress_joint(moved(0.5e-3, of_speed=True), kp=KP, kd=KD, gravity=False)
    assert "damp the speed" in stated.inertia.status  # by a delay as long as kd over kp it looked as sound
    assert not stands(stated.level.status)


def test_a_headline_says_what_the_rows_of_its_numbers_doubt() -> None:
    """Viscous friction of which most is the controller's damping stood there as if it were sure."""
    findings = analyze_joint(moved(0.5e-3, of_speed=True), kp=KP, gravity=False)
    words = " ".join(ss.summary(findings).headline)
    assert "viscous friction (in doubt: the controller may damp the speed" in words
    assert "kg m² (in doubt as well)" in words


def test_of_a_joint_without_gravity_the_remedy_is_to_say_so() -> None:
    """It was told to turn farther, so that gravity's torque changes, and all of its numbers were not to be trusted."""
    level = ss.cycle.regress_joint(joints.drawn(305, torque=True, loaded=False).record).level
    assert "--no-gravity" in level.status
    assert "turn farther" not in level.status


def test_a_controller_that_integrates_its_error_is_doubted() -> None:
    for given in ({"kd": KD}, {}):
        joint = ss.cycle.regress_joint(moved(0.5e-3, ki=40.0), kp=KP, gravity=False, **given)
        assert "integrate its error" in joint.level.status
        assert not stands(joint.inertia.status)


@pytest.mark.parametrize("seed", [130006, 130011])
def test_a_controller_that_integrates_the_error_of_its_speed_is_doubted(seed: int) -> None:
    """Load part and damping passed for it: these inertias, 85 and 21 % too large, stood."""
    record, truth = loaded("benchmarks/joint_loops.py").drawn(seed, "PI of the speed")
    joint = ss.cycle.regress_joint(record, kp=(truth["kp"], 0.01 * truth["kp"]))
    assert "integrate its error" in joint.level.status
    assert not stands(joint.inertia.status)


def test_a_torque_that_is_set_acts_half_a_period_later() -> None:
    """A computer at 1 kHz logs it at the beginning of a period: of gravity that makes viscous friction, here 0.01."""
    time = np.arange(6000) / 200
    q, v, a = (sum(s * (6.283 * f) ** k * np.sin(6.283 * f * time + k * np.pi / 2) for s, f in ((1.2, 0.2), (0.4, 0.7)))
               for k in range(3))  # fmt: skip
    torque = 0.02 * a + 0.01 * v + 8.0 * np.sin(q) + 0.06 * np.sign(v)
    ahead = torque + 0.5e-3 * np.gradient(torque, time)
    noise = np.random.default_rng(0).normal(0, 0.02, time.size)
    log = ss.Record.of({"theta": q, "force": ahead + noise}, fs=200, units={"force": "N m"})
    assert ss.cycle.regress_joint(log).viscous.includes(0.01)
