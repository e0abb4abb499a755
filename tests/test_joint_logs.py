"""Several logs of one joint: together they tell what none tells alone, and each is predicted by the others."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import joints
import stickslip as ss
from stickslip.cli.program import main
from stickslip.cycle import regress_joint, regress_joint_logs
from stickslip.errors import RecordError
from stickslip.estimate import kinds

TRUTH = {"inertia": 0.02, "forward": 0.07, "back": 0.05, "load": 0.2, "viscous": 0.03, "sine": 0.5, "cosine": -0.2}


def log(seed, speed=0.2, size=1.0, **changes):
    """A joint whose torque is exact but for white noise."""
    true, t = {**TRUTH, **changes}, np.arange(4000) / 200
    q = 0.3 + size * (np.sin(2 * np.pi * speed * t) + 0.4 * np.sin(2 * np.pi * 3.1 * speed * t))
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    weight = true["sine"] * np.sin(q) + true["cosine"] * np.cos(q)
    level = np.where(v > 0, true["forward"], true["back"]) + true["load"] * np.abs(weight)
    torque = true["inertia"] * a + true["viscous"] * v + np.sign(v) * level + weight
    noise = np.random.default_rng(seed).normal(0, 0.01, t.size)
    return ss.Record.of({"theta": q, "force": torque + noise}, fs=200.0, units={"force": "N m"})


def test_together_they_tell_what_is_true() -> None:
    together = regress_joint_logs([log(0), log(1, 0.35), log(2, 0.5, 0.7)])
    held = [getattr(together, name).includes(value) for name, value in TRUTH.items()]
    assert sum(held) >= 6  # of seven intervals of 95 %
    assert together.load.value == pytest.approx(0.2, rel=0.05)
    assert not together.left_out


def test_one_tells_gravity_and_the_other_the_speed() -> None:
    """Slow swings tell no inertia, and small ones no gravity: alone neither log is answered in full."""
    slow, small = log(0, 0.03, 1.2), log(1, 1.0, 0.05)
    assert regress_joint(small).left_out
    alone, together = regress_joint(slow), regress_joint_logs([slow, small])
    assert together.inertia.value == pytest.approx(0.02, rel=0.05)
    assert together.inertia.sd < 0.2 * alone.inertia.sd
    assert together.sine.value == pytest.approx(0.5, rel=0.05)


def test_a_log_that_was_left_out_is_predicted_to_its_noise() -> None:
    together = regress_joint_logs([log(0), log(1, 0.35), log(2, 0.5, 0.7)])
    for one in together.predictions:
        assert one.error < 0.02
        assert one.plain > 2 * one.error
        assert np.linalg.norm(one.predicted - one.measured) == pytest.approx(
            one.error * np.linalg.norm(one.measured - one.measured.mean())
        )


def test_an_encoders_counts_do_not_spoil_a_prediction() -> None:
    """Of 10 bit: as accelerations within a window they were 4.5 to 9 % of the torque."""
    count, coarse = 2 * np.pi / 2**10, []
    for seed, speed in enumerate((0.2, 0.25, 0.3)):
        one = log(seed, speed)
        coarse.append(one.with_channel("theta", np.round(one["theta"] / count) * count, unit="rad"))
    for one in regress_joint_logs(coarse).predictions:
        assert one.error < 0.04


def test_the_plain_law_is_as_good_where_it_is_the_law() -> None:
    logs = [log(seed, speed, load=0.0, forward=0.06, back=0.06) for seed, speed in enumerate((0.2, 0.35, 0.5))]
    for one in regress_joint_logs(logs).predictions:
        assert one.plain == pytest.approx(one.error, rel=0.1)


def test_logs_of_several_payloads_are_said_to_be_unlike() -> None:
    """Their gravity was pooled without a word, with the advice to carry another payload."""
    some = [log(number, inertia=heavy, sine=25 * heavy) for number, heavy in enumerate((0.02, 0.04, 0.06))]
    alike = [log(number) for number in range(3)]
    for logs, unlike in ((some, True), (alike, False)):
        comparison = ss.answers.compare_joints([ss.answers.analyze_joint(one) for one in logs])
        said = " ".join(ss.summary(comparison).headline)
        assert ("inertia and gravity differ" in said) == unlike
        assert comparison.unlike == (("inertia", "gravity") if unlike else ())
        assert (comparison.together.inertia is None) == unlike
        for name in ("forward", "back", "viscous", "load"):
            assert getattr(comparison.together, name).value == pytest.approx(TRUTH[name], rel=0.05)
        assert "e+0" not in said


@pytest.mark.parametrize(("growth", "sweep"), [(0.0, False), (0.4, False), (0.5, True)])
def test_friction_that_changes_along_a_log_is_said_or_that_it_would_be_hidden(growth: float, sweep: bool) -> None:
    """A sweep hid a rise by half in the viscous friction, and was sure; of tones of one speed it is a mean."""
    t = np.arange(8000) / 200
    phase = np.pi * (0.1 * t + 0.045 * t**2)  # of 0.05 to 1.85 Hz
    tones = np.sin(1.3 * t) + 0.4 * np.sin(4.1 * t), 1.3 * np.cos(1.3 * t) + 1.64 * np.cos(4.1 * t)
    q, v = (np.sin(phase), np.pi * (0.1 + 0.09 * t) * np.cos(phase)) if sweep else tones
    weight = 0.5 * np.sin(q)
    grown = 0.06 * (1 + growth * (t / t[-1] - 0.5)) + 0.1 * np.abs(weight)
    torque = 0.02 * np.gradient(v, t) + 0.03 * v + np.sign(v) * grown + weight
    noise = np.random.default_rng(7).normal(0, 0.01, t.size)
    level = regress_joint(ss.Record.of({"theta": q, "force": torque + noise}, fs=200.0, units={"force": "N m"})).level
    assert ("ages" in kinds(level.status)) == (growth > 0)


def test_logs_of_different_sources_are_refused() -> None:
    torque = log(0)
    by_current = ss.Record.of({"theta": torque["theta"], "current": torque["force"]}, fs=200.0)
    with pytest.raises(RecordError, match="force, current"):
        regress_joint_logs([torque, by_current], torque_constant=1.0)
    with pytest.raises(RecordError, match="1 log"):
        regress_joint_logs([torque])


def test_logs_of_another_integrator_are_predicted_no_worse_than_by_a_plain_law() -> None:
    """Thirds of a log; where a joint carries little the laws are one. Of 108 two were worse by 9 and 24 %."""
    errors = []
    for seed in (0, 2, 5, 6, 8, 12):
        record = joints.drawn(seed, torque=True).record
        third = len(record) // 3
        parts = [record.rows(third * number, third * (number + 1)) for number in range(3)]
        errors += [(one.error, one.plain) for one in regress_joint_logs(parts).predictions]
    told, plain = np.array(errors).T
    assert np.all(told < 1.1 * plain)
    assert np.median(told / plain) < 0.7


@pytest.mark.figures
def test_command(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for number, speed in enumerate((0.2, 0.35, 0.5)):
        record = log(number, speed)
        table = np.column_stack([record.time, record["theta"], record["force"]])
        header = "time [s],position [rad],effort [N m]"
        np.savetxt(f"{number}.csv", table, delimiter=",", header=header, comments="")
    run = CliRunner().invoke(main, ["joint", "0.csv", "1.csv", "2.csv", "--output", "out"])
    assert run.exit_code == 0, run.output
    assert "Each log by the others" in run.output
    data = json.loads((tmp_path / "out/results.json").read_text())
    assert len(data["records"]) == 3
    assert all(one["error"] < one["plain"] for one in data["comparison"]["predictions"])
    assert (tmp_path / "out/report.html").is_file()


def test_episodes_of_one_file_are_logs(tmp_path) -> None:
    """LeRobot keeps many episodes in a file of Parquet, whose time begins anew with each."""
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    logs = [log(number, speed) for number, speed in enumerate((0.2, 0.35, 0.5))]
    cells = {
        "observation.state": np.concatenate([one["theta"] for one in logs])[:, None],
        "action": np.concatenate([one["theta"] + one["force"] / 18.0 for one in logs])[:, None],
    }
    columns = {name: pyarrow.array(list(values)) for name, values in cells.items()}
    columns["timestamp"] = np.tile(np.arange(4000) / 200, 3).astype(np.float32)
    columns["episode_index"] = np.repeat([4, 5, 6], 4000)
    parquet.write_table(pyarrow.table(columns), tmp_path / "file-000.parquet")
    parts = list(ss.answers.episodes(ss.read_record(tmp_path / "file-000.parquet")))
    assert [(part.fs, len(part)) for part in parts] == [(200.0, 4000)] * 3
    found = [ss.answers.analyze_joint(part, kp=18.0, kd=0.0) for part in parts]
    assert ss.answers.compare_joints(found, kp=18.0, kd=0.0).load.value == pytest.approx(0.2, rel=0.1)
    gains = ["--kp", "18 N m/rad", "--kd", "0 N m s/rad"]
    run = CliRunner().invoke(main, ["joint", str(tmp_path / "file-000.parquet"), "--json", *gains])
    assert run.exit_code == 0, run.output
    names = [one["name"] for one in json.loads(run.stdout)["records"]]
    assert names == [f"file-000.parquet, episode {number}" for number in (4, 5, 6)]
