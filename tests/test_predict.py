"""A law tried on records that it was not fitted to."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import joints
import stickslip as ss
from stickslip.answers.arm import Joint
from stickslip.bench import SimulatedBench
from stickslip.cli.program import main

RIG = {"mass": 2.42, "stiffness": 2310.0, "damping": 0.12}
LAW = "[law]\nname = 'Coulomb'\nkinetic = 1.1\nstatic = 1.3\n"
SYSTEM = f"{LAW}[system]\nmass = 2.42\nstiffness = 2310\ndamping = 0.12\n[drive]\nname = 'HarmonicBase'\n" + (
    "amplitude = '0.65 mm'\nfrequency = 2.5\n"
)
STICKING = ss.Oscillator(
    law=ss.laws.Coulomb(1.1, static=1.3), drive=ss.drives.HarmonicBase(0.65e-3, frequency=2.5), **RIG
)
WEAKER = STICKING.having(kinetic=1.0)
NOISE = 1e-6


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")


def measured(system: ss.Oscillator, seed: int = 1, lag: float = 0.0) -> ss.Record:
    bench = ss.Rig.perfect("x", "z").having("x", white=NOISE, lag=lag)
    return bench.measure(ss.simulate(system, duration=4), fs=1000, rng=seed, start=1.0)


def write(name: str, record: ss.Record) -> None:
    rows = np.column_stack([record.time, 1e3 * record["x"], 1e3 * record["z"]])
    np.savetxt(name, rows, delimiter=",", header="t [s],x [mm],z [mm]", comments="", fmt="%.7f")


def predict(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["predict", *arguments])


def test_the_true_law_leaves_the_noise_and_a_wrong_one_more() -> None:
    record = measured(STICKING)
    (true,) = ss.answers.predict(record, STICKING).parts
    assert true.fit.residual["x"] == pytest.approx(NOISE, rel=0.1)
    assert true.follows["x"] == pytest.approx(100 * (1 - NOISE / np.std(record["x"])), abs=0.05)
    scope = ss.summary(ss.answers.predict(record, STICKING, plain=False)).scope
    assert [panel.name for panel in scope.panels] == ["x", "x, measured less model"]
    left = scope.panels[1].lines["left"]
    assert np.nanstd(left) == pytest.approx(NOISE, rel=0.1), "it stood in a figure that the page does not show"
    assert scope.view is None, "of seven cycles and a half all are shown"
    assert true.plain["x"] < true.follows["x"] - 1, "static friction is not Coulomb's level and a damper"
    (wrong,) = ss.answers.predict(record, STICKING.having(static=1.1, kinetic=0.7)).parts
    assert wrong.follows["x"] < 95
    assert wrong.plain["x"] > wrong.follows["x"]
    (plain,) = ss.answers.predict(record, STICKING.having(law=ss.laws.Coulomb(0.7))).parts
    assert not plain.plain, "the law is plain itself"


def test_what_a_prediction_leaves_is_held_against_the_noise() -> None:
    told = (ss.answers.predict(measured(STICKING), system, plain=False) for system in (STICKING, WEAKER))
    right, wrong = (str(ss.summary(predictions).headline[0]) for predictions in told)
    assert right.endswith(", all but the sensors' noise.")
    assert "times the noise of x" in wrong


def test_what_is_followed_is_the_fit_of_system_identification() -> None:
    (found,) = ss.answers.predict(measured(STICKING), STICKING.having(kinetic=1.0), plain=False).parts
    traces = found.fit.traces[0]
    y, yhat = traces.measured["x"], traces.fitted["x"]
    defined = 100 * (1 - np.linalg.norm(y - yhat) / np.linalg.norm(y - y.mean()))
    assert found.follows["x"] == pytest.approx(defined, abs=1e-6)


def test_stops_are_counted_alike_in_both() -> None:
    (found,) = ss.answers.predict(measured(STICKING), STICKING, plain=False).parts
    seen, told = found.sticks
    assert seen.per_cycle.value == told.per_cycle.value == 2
    assert told.share.value == pytest.approx(seen.share.value, abs=0.01)


def test_sensors_are_read_as_they_are_stated() -> None:
    record, late = measured(STICKING, lag=2e-3), ss.rig.rig_settings({"sensors": {"x": {"delay": "2 ms"}}})
    (unknown,), (stated,) = (ss.answers.predict(record, STICKING, rig=rig, plain=False).parts for rig in (None, late))
    assert stated.fit.misfit["x"] < 1.2 < unknown.fit.misfit["x"]


def test_a_fit_is_tried_on_another_record_as_it_was_written(tmp_path: Path) -> None:
    record = measured(STICKING)
    fit = ss.fit_law(record, STICKING.having(kinetic=1.0), free=["kinetic"], nuisance=["damping"], intervals=False)
    folder = ss.publish(fit, folder=tmp_path / "slow-fit", record=record)
    read = ss.answers.read_fitted(folder)
    assert (read.law, read.damping) == (fit.law, fit.oscillator.damping)
    write("fast.csv", measured(STICKING.having(frequency=4.0), seed=2))
    result = predict("slow-fit", "fast.csv")
    assert result.exit_code == 0, result.output
    assert "99." in result.stdout.splitlines()[2]
    assert len(result.stdout.splitlines()) <= 40
    assert max(map(len, result.stdout.splitlines())) <= 80
    page = Path("fast-predicted/report.html").read_text("utf-8")
    assert "as it was given" in page
    data = json.loads(Path("fast-predicted/results.json").read_text("utf-8"))
    assert data["records"][0]["channels"]["x"]["follows"] == pytest.approx(data["follows"]["x"])


def test_columns_of_the_fit_are_those_of_the_next_record() -> None:
    columns = {"x": "Weg [mm]", "z": "Tisch [mm]"}
    for name, record in (("slow.csv", measured(STICKING)), ("fast.csv", measured(STICKING.having(frequency=4.0)))):
        write(name, record)
        text = Path(name).read_text("utf-8")
        Path(name).write_text(text.replace("x [mm],z [mm]", "Weg [mm],Tisch [mm]"), "utf-8")
    record = ss.read_record("slow.csv", channels=columns)
    fit = ss.fit_law(record, STICKING.having(kinetic=1.0), free=["kinetic"], nuisance=["damping"], intervals=False)
    ss.publish(fit, folder="slow-fit", record=record)
    result = predict("slow-fit", "fast.csv", "--no-plain")
    assert result.exit_code == 0, result.output
    assert "columns by slow-fit/law/rig.toml" in result.stderr
    assert "follows 99." in result.stdout
    Path("mass.toml").write_text("mass = 2.42\n")  # states no column
    assert "follows 99." in predict("slow-fit", "fast.csv", "--no-plain", "--config", "mass.toml").stdout
    Path("mass.toml").rename("rig.toml")
    assert "follows 99." in predict("slow-fit", "fast.csv", "--no-plain").stdout
    write("named.csv", measured(STICKING.having(frequency=4.0)))  # "x" and "z" tell themselves
    table = predict("slow-fit", "fast.csv", "named.csv", "--no-plain", "--json")
    assert table.exit_code == 0, table.output
    assert [part["name"] for part in json.loads(table.stdout)["records"]] == ["fast.csv", "named.csv"]


def test_the_rate_of_the_fitted_file_is_not_that_of_the_next() -> None:
    record = measured(STICKING)
    for name, part in (("slow.csv", record), ("fast.csv", measured(STICKING.having(frequency=4.0)).rows(0, 2000))):
        np.savetxt(
            name, 1e3 * np.column_stack([part["x"], part["z"]]), delimiter=",", header="x [mm],z [mm]", comments=""
        )
    record = ss.read_record("slow.csv", channels={"x": "x [mm]", "z": "z [mm]"}, fs=1000)
    fit = ss.fit_law(record, STICKING.having(kinetic=1.0), free=["kinetic"], nuisance=["damping"], intervals=False)
    ss.publish(fit, folder="slow-fit", record=record)
    refused = predict("slow-fit", "fast.csv", "--no-plain")
    assert refused.exit_code == 1
    assert "neither time nor sampling rate" in refused.stderr
    assert "follows 99." in predict("slow-fit", "fast.csv", "--no-plain", "--fs", "1000").stdout


def test_a_page_begins_with_cycles_of_a_tone_and_with_all_of_what_noise_shakes() -> None:
    """Counts of a base at rest were taken for its drive: the page began with 4.4 ms of 20 s."""
    driven = ss.Rig.perfect("x", "z").measure(ss.simulate(STICKING, duration=10), fs=200, rng=1, start=1.0)
    predictions = ss.answers.predict(driven, STICKING, plain=False)
    view = ss.summary(predictions).scope.view
    assert view[1] - view[0] == pytest.approx(6 / 2.5, rel=1e-3)
    counts = np.round(np.random.default_rng(0).normal(0, 3e-6, len(driven)) / 2.5e-6) * 2.5e-6
    resting = driven.with_channel("z", counts, unit="m", source="array")
    of_noise = replace(predictions, parts=(replace(predictions.parts[0], record=resting),))
    assert ss.summary(of_noise).scope.view is None
    decay = SimulatedBench().record("free")
    counts = np.round(np.random.default_rng(0).normal(0, 3e-6, len(decay)) / 2.5e-6) * 2.5e-6
    shaken = ss.analyze_decay(decay.with_channel("z", counts, unit="m", source="array"))
    assert ss.summary(shaken).scope.view is None


def test_several_records_are_rows_and_what_can_not_be_asked_is_left_out() -> None:
    Path("law.toml").write_text(SYSTEM)
    write("a.csv", measured(STICKING))
    write("b.csv", measured(STICKING.having(kinetic=1.0), seed=2))
    write("still.csv", measured(STICKING.having(amplitude=1e-5), seed=3))
    result = predict("law.toml", "a.csv", "b.csv", "still.csv", "--no-plain", "--json")
    assert result.exit_code == 0, result.output
    assert "left out: still.csv" in result.stderr
    data = json.loads(result.stdout)
    assert [each["name"] for each in data["records"]] == ["a.csv", "b.csv"]
    a, b = (each["channels"]["x"]["follows"] for each in data["records"])
    assert data["follows"]["x"] == b < a
    assert not Path("comparison-predicted").exists()


def test_a_law_alone_needs_the_mass() -> None:
    Path("law.toml").write_text(LAW)
    write("a.csv", measured(STICKING))
    refused = predict("law.toml", "a.csv")
    assert refused.exit_code == 2
    assert "holds a law alone" in refused.stderr
    Path("elbow-joint", "joint").mkdir(parents=True)
    Path("elbow-joint", "joint", "law.toml").write_text(LAW)
    for folder in ("elbow-joint", "elbow-joint/joint"):  # as `stickslip joint` writes it
        assert "holds a law alone" in predict(folder, "a.csv").stderr
    rig = ("--mass", "2.42 kg", "--stiffness", "2.31 N/mm", "--damping", "0.12")
    result = predict("law.toml", "a.csv", *rig, "--no-plain", "--json")
    assert json.loads(result.stdout)["follows"]["x"] > 99
    heavy = predict("law.toml", "a.csv", "--mass", "2.6", *rig[2:], "--no-plain", "--json")
    assert json.loads(heavy.stdout)["follows"]["x"] < 99


def test_a_structure_is_refused() -> None:
    with pytest.raises(ss.errors.ModelError, match="several masses"):
        ss.answers.predict(measured(STICKING), ss.squeak.squeak_rig())  # type: ignore[arg-type]
    with pytest.raises(ss.errors.EstimateError, match="no record"):
        ss.answers.predict([], STICKING)


def test_a_channel_at_the_end_of_its_range_is_named_by_fit_and_prediction(monkeypatch: pytest.MonkeyPatch) -> None:
    """As analyze names it, by the check-up; of several records with the one that it is in."""
    monkeypatch.setenv("COLUMNS", "400")
    record = measured(STICKING)
    cut = ss.Record.of({"x": np.clip(record["x"], -3e-4, 3e-4), "z": record["z"]}, fs=record.fs, start=record.start)
    write("cut.csv", cut)
    write("whole.csv", record)
    Path("law.toml").write_text(SYSTEM, encoding="utf-8")
    rig = ["--mass", "2.42", "--stiffness", "2310", "--laws", "Coulomb"]
    fitted = CliRunner().invoke(main, ["fit", "cut.csv", "whole.csv", *rig])
    assert "cut.csv: channel x has" in fitted.output, fitted.output
    assert "whole.csv: channel" not in fitted.output
    for output in (predict("law.toml", "cut.csv").output, CliRunner().invoke(main, ["fit", "cut.csv", *rig]).output):
        assert "samples clipped near" in output, output
    assert "clipped" not in predict("law.toml", "whole.csv").output


# ---- a joint


def true_joint(joint: joints.Joint) -> Joint:
    """A joint of the other integrator, whose controller holds its output for a millisecond: late by half of that."""
    true = {name: joint.truth[name] for name in ("inertia", "forward", "back", "load", "sine", "cosine", "kp")}
    viscous = {f"viscous_{way}": joint.truth["viscous"] for way in ("forward", "back")}
    return Joint(**true, **viscous, damping=joint.truth["kd"] - joint.truth["kp"] * joints.PERIOD / 2)


@pytest.mark.parametrize(("draws", "most"), [(8, 1.0), pytest.param(100, 3.0, marks=pytest.mark.soak)])
def test_a_joint_moves_as_another_integrator_moves_it(draws: int, most: float) -> None:
    """Inside its loop; 0.02 to 1 % of it is the peak of friction at rest, which has no part in these numbers."""
    for seed in range(100, 100 + draws):
        joint = joints.drawn(seed, torque=False)
        (part,) = ss.answers.predict(joint.record, true_joint(joint), plain=False).parts
        assert 100 - part.follows["theta"] < most, seed


def test_a_joint_under_a_steady_torque_falls_as_galileo_says() -> None:
    """2 N m against 0.5 N m of friction and 0.1 kg m^2, after a second under less than its friction at rest."""
    time = np.arange(400) / 200
    falls = np.maximum(time - 1.0, 0.0)
    log = ss.Record.of(
        {"theta": falls**2 / 2 * 15, "force": np.where(time < 1, 0.4, 2.0)}, fs=200, units={"force": "N m"}
    )
    place, _ = Joint(0.1, 0.5, 0.5, 0.0, 0.0).moved(log, loop=False)
    assert np.all(np.abs(place[:200] - place[0]) < 1e-12)
    assert place[-1] - place[0] == pytest.approx(log["theta"][-1], rel=0.02)  # its torque rises within a sample


def test_friction_of_what_the_teeth_bear_takes_its_share_of_the_motor() -> None:
    """A steady 2 N m against 0.4 N m and 0.2 of the mean of that and of no gravity: 14 rad/s²."""
    time = np.arange(400) / 200
    log = ss.Record.of({"theta": 7 * time**2, "force": np.full(400, 2.0)}, fs=200, units={"force": "N m"})
    place, _ = Joint(0.1, 0.4, 0.4, 0.0, 0.0, load=0.2, by_teeth=1.0).moved(log, loop=False)
    assert place[-1] - place[0] == pytest.approx(log["theta"][-1], rel=0.01)


def test_a_joint_of_next_to_no_inertia_is_refused_and_not_waited_for() -> None:
    log = ss.Record.of({"theta": np.sin(np.arange(400) / 20), "reference": np.sin(np.arange(400) / 20)}, fs=200)
    with pytest.raises(ss.errors.ModelError, match=r"an inertia of 1e-12 .*stickslip joint tells"):
        Joint(1e-12, 0.1, 0.1, 0.05, 0.05, kp=10.0).moved(log, loop=True)


def test_friction_at_rest_holds_a_joint_longer_and_falls_within_its_speed() -> None:
    time = np.arange(2000) / 1000
    log = ss.Record.of({"theta": 0.01 * time, "force": 0.5 * time}, fs=1000, units={"force": "N m"})
    log = log.with_channel("theta", np.zeros(2000) + 1e-9 * time, unit="rad")
    place, _ = Joint(0.1, 0.4, 0.4, 0.0, 0.0, excess=0.2, speed=1e-3).moved(log, loop=False)
    assert time[np.argmax(place > 1e-6)] == pytest.approx(1.2, abs=0.02)
    assert place[-1] == pytest.approx(0.2 / 0.1 * 0.8**2 / 2 + 0.5 / 0.1 * 0.8**3 / 6, rel=0.02)


def test_a_joint_is_predicted_from_one_log_in_another(tmp_path: Path) -> None:
    joint = joints.drawn(102, torque=True)
    kp, kd = joint.truth["kp"], joint.truth["kd"]
    names = {"theta": "elbow_position_rad", "reference": "elbow_goal_position_rad", "force": "elbow_effort_Nm"}
    for name, rows in (("first.csv", slice(0, 9000)), ("second.csv", slice(9000, None))):
        columns = [joint.record.time[rows], *(joint.record[channel][rows] for channel in names)]
        header = ",".join(["time [s]", *names.values()])
        np.savetxt(name, np.column_stack(columns), delimiter=",", header=header, comments="")
    gains = ("--kp", f"{kp}", "--kd", f"{kd}")
    told = CliRunner().invoke(main, ["joint", "first.csv", "--axis", "elbow", *gains, "--output", "elbow"])
    assert told.exit_code == 0, told.output
    for law in ("elbow", "elbow/joint/law.toml"):
        result = predict(law, "second.csv", "--json")
        assert result.exit_code == 0, result.output
        loop, torque = json.loads(result.stdout)["records"]
        assert loop["channels"]["theta"]["follows"] > 99.5
        assert loop["channels"]["force"]["follows"] > 85  # the rest is the noise of its sensor
        assert torque["channels"]["theta"]["follows"] > 95 > torque["channels"]["theta"]["plain"]
    assert "2 predictions" in predict("elbow", "second.csv").stdout
    page = Path("second-predicted/report.html").read_text("utf-8")
    assert "inside its control loop" in page
    assert "by its torque from turn to turn" in page
    law = Path("elbow/joint/law.toml")
    law.write_text(law.read_text("utf-8").replace("inertia = ", "inertia = -"), "utf-8")
    assert "its inertia positive" in predict("elbow", "second.csv").stderr
    law.write_text(law.read_text("utf-8").replace("inertia = ", "weight = "), "utf-8")
    assert "weight" in predict("elbow", "second.csv").stderr


def test_a_log_without_torque_or_gain_moves_no_joint() -> None:
    log = joints.drawn(100, torque=False).record
    with pytest.raises(ss.errors.RecordError, match="neither a torque nor a gain"):
        ss.answers.predict(log, Joint(0.1, 0.5, 0.5, 0.0, 0.0))


def test_a_joint_whose_parts_are_told_together_alone_moves_by_them_together() -> None:
    """Each of them cut at zero by itself, it stuck 82 % of the time where the true one never does (fit 9 %)."""
    record = joints.drawn(4711, torque=True).record
    half = len(record) // 2
    joint = Joint.of(ss.cycle.regress_joint(record.rows(0, half)), "")
    predictions = ss.answers.predict(record.rows(half, 2 * half), joint)
    assert predictions.least["theta"] > 90
    assert joint.forward == joint.back > 0
    assert "gravity, sine part" in joint.doubtful
    assert any("gravity, sine part" in caution for caution in ss.summary(predictions).cautions)


def test_emps_moves_by_its_force_as_its_other_half_tells(dataset: Callable[[str], Path]) -> None:
    """Coulomb's friction with a damper, alike both ways and fitted to that very half, misses 6.8 % of it."""
    channels = {"x": "qm [m]", "force": "vir * 35.1507 [N]"}
    record = ss.read_record(dataset("emps") / "DATA_EMPS.mat", channels=channels, fs=1000.0)
    half = len(record) // 2
    joint = Joint.of(ss.cycle.regress_joint(record.rows(0, half)), "")
    (part,) = ss.answers.predict(record.rows(half, 2 * half), joint).parts
    assert 100 - part.follows["x"] < 1.0 < 5.0 < 100 - part.plain["x"]
