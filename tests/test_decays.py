"""A free decay from file to page: one command, its table, folder, JSON and exit codes."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from motions import free_decay
from null_decays import on_a_cubic_spring
from stickslip.cli.program import main
from stickslip.estimate import stands


@pytest.fixture
def release(tmp_path, monkeypatch):
    """A ring-down in millimetres as a rig writes it, in the folder where the commands run."""
    monkeypatch.chdir(tmp_path)
    values, fs, _ = free_decay(amplitude=5.0, dry=0.1)
    noisy = values + 5e-3 * np.random.default_rng(5).standard_normal(len(values)) + 1.0
    columns = np.column_stack([np.arange(len(values)) / fs, noisy])
    np.savetxt("release.csv", columns, delimiter=",", header="t [s],pos [mm]", comments="", fmt="%.6f")
    return tmp_path / "release.csv"


def run(*words):
    return CliRunner().invoke(main, ["decay", *map(str, words)])


READ = ("--channels", "x=pos [mm]")


@pytest.mark.figures
@pytest.mark.parametrize("method", ["thesis", "waveform", "all"])
def test_the_command_answers_and_leaves_a_page(release, method):
    answer = run(release, *READ, "--method", method, "--stiffness", "2 N/mm", "--output", "out", "--all")
    assert answer.exit_code == 0, answer.output
    assert "damping ratio" in answer.output
    assert "dry friction force" in answer.output
    assert ("The same by other ways" in answer.output) == (method != "thesis")
    folder = release.parent / "out"
    page = (folder / "report.html").read_text("utf-8")
    assert "Recorded and identified" in page
    assert ("by decrements" in page) == (method == "all")
    data = json.loads((folder / "results.json").read_text("utf-8"))
    estimates = {each["name"]: each for each in data["estimates"]}
    low, high = estimates["damping ratio"]["interval"]
    assert low < 0.0316 < high
    low, high = estimates["dry friction force"]["interval"]
    assert low < 0.2 < high
    drawn = {path.name for path in (folder / "figures").iterdir()}
    assert {"decay.svg", "decay.png", "identified.svg"} <= drawn
    assert ("differences.svg" in drawn) == (method != "waveform")
    assert set(data["files"]) >= {"report.html", "results.json"}


def test_json_alone_writes_nothing(release):
    answer = run(release, *READ, "--json", "--method", "thesis")
    data = json.loads(answer.output)
    assert data["releases"][0]["stopped"]
    bounds = data["decrements"]["bounds"]
    assert len(bounds["m"]) == len(bounds["rate_worst"])
    assert bounds["best_m"] in bounds["m"]
    assert sorted(path.name for path in release.parent.iterdir()) == ["release.csv"]
    spoken = run(release, *READ, "--method", "thesis", "--output", "out", "--all").output
    assert "state --stiffness or --mass" in " ".join(spoken.split())


def test_several_files_share_a_page_and_the_faulty_one_is_named(release):
    t = np.arange(1000) / 100
    np.savetxt(
        "forced.csv", np.column_stack([t, np.sin(6 * t)]), delimiter=",", header="t [s],pos [mm]", comments="", fmt="%f"
    )
    answer = run(release, "forced.csv", *READ, "--method", "thesis")
    assert answer.exit_code == 0, answer.output
    assert "left out: forced.csv" in answer.output
    assert (release.parent / "decays-stickslip" / "report.html").is_file()


def test_several_releases_of_one_rig_are_fitted_together(release):
    again, fs, _ = free_decay(amplitude=4.4, dry=0.1)
    noisy = again + 5e-3 * np.random.default_rng(6).standard_normal(len(again)) + 0.7
    columns = np.column_stack([np.arange(len(again)) / fs, noisy])
    np.savetxt("again.csv", columns, delimiter=",", header="t [s],pos [mm]", comments="", fmt="%.6f")
    asked = ("--method", "waveform", "--stiffness", "2 N/mm", "--output", "out", "--all")
    answer = run(release, "again.csv", *READ, *asked)
    assert answer.exit_code == 0, answer.output
    said = " ".join(answer.output.split())
    assert "The 2 records agree within their own intervals." in said
    assert "damping ratio, again.csv" in said
    data = json.loads((release.parent / "out" / "results.json").read_text("utf-8"))
    assert data["comparison"]["joint"]
    estimates = {each["name"]: each for each in data["comparison"]["estimates"]}
    for name, true in (("damping ratio", 0.0316), ("dry friction force", 0.2)):
        low, high = estimates[name]["interval"]
        assert low < true < high
    assert [each["name"] for each in data["records"]] == ["release.csv", "again.csv"]


def test_every_file_that_can_not_answer_has_its_reason(release):
    t = np.arange(1000) / 100
    for name, values in (("forced.csv", np.sin(6 * t)), ("creeping.csv", np.exp(-t))):
        np.savetxt(name, np.column_stack([t, values]), delimiter=",", header="t [s],pos [mm]", comments="", fmt="%f")
    answer = run("forced.csv", "creeping.csv", *READ)
    assert answer.exit_code == 1
    assert "forced.csv: 20 swings shrink" in answer.output
    assert "creeping.csv: the motion turns 0 times" in answer.output
    assert "none of 2 records answers" in answer.output


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("forced.csv", *READ), 1, "a free decay dies away"),
        (("release.csv", *READ, "--stiffness", "-3"), 2, "stiffness"),
        (("release.csv", *READ, "--method", "guess"), 2, "guess"),
        (("release.csv", *READ, "--repair", "drift"), 2, "--repair drift of a free decay"),
        (("release.csv", *READ, "--repair", "drift:x"), 2, "--repair drift of a free decay"),
        (("release.csv", "--channels", "pressure=pos [mm]"), 1, "read from x, theta, v or a"),
        (("nowhere.csv",), 2, "nowhere.csv"),
        (("release.csv", *READ, "--channel", "v"), 2, "channel v is missing"),
    ],
)
def test_what_can_not_be_is_one_sentence_and_a_code(release, words, code, said):
    t = np.arange(1000) / 100
    np.savetxt(
        "forced.csv", np.column_stack([t, np.sin(6 * t)]), delimiter=",", header="t [s],pos [mm]", comments="", fmt="%f"
    )
    answer = run(*words)
    assert answer.exit_code == code, answer.output
    sentence = answer.output.partition("To mend it:\n")[0]  # a command may follow
    assert said in sentence
    assert len(sentence.strip().splitlines()) == 1
    assert not (release.parent / "release-stickslip").exists()


def test_the_force_follows_from_mass_or_stiffness(release):
    record = ss.read_record(release, channels={"x": "pos [mm]"})
    by_spring = ss.analyze_decay(record, method="thesis", stiffness=39.478)
    by_mass = ss.analyze_decay(record, method="thesis", mass=1.0)
    assert by_spring.decay.dry_force.value == pytest.approx(by_mass.decay.dry_force.value, rel=1e-3)
    assert ss.analyze_decay(record, method="thesis").decay.dry_force is None
    assert "state stiffness=" in " ".join(ss.summary(ss.analyze_decay(record, method="thesis")).headline)


def test_every_figure_can_be_drawn(release):
    record = ss.read_record(release, channels={"x": "pos [mm]"})
    for method in ("thesis", "all"):
        plates = ss.summary(ss.analyze_decay(record, method=method)).plates
        assert [plate.name for plate in plates] == ["decay", "identified", "differences", "bounds"]
        assert all(plate.png().startswith(b"\x89PNG") for plate in plates)
    values, fs, _ = free_decay(order=1)
    velocity = ss.analyze_decay(ss.Record.of({"v": values}, fs=fs), method="thesis")
    assert [plate.name for plate in ss.summary(velocity).plates] == ["decay", "differences", "bounds"]


def test_the_identified_motion_is_the_measured_one(release):
    """What the decrements identify leaves noise alone, over the whole motion (thesis, Figures 6.10 and 6.15)."""
    from stickslip.figures.decay import _identified

    record = ss.read_record(release, channels={"x": "pos [mm]"})
    _, measured, fitted, _ = _identified(ss.analyze_decay(record, method="thesis").decay)
    assert np.std(measured - fitted) < 2 * 5e-6


def test_too_few_extremes_for_any_method_are_refused():
    values, fs, turns = free_decay(damping_ratio=0.4, dry=0.04)
    assert len(turns) == 3
    with pytest.raises(ss.errors.EstimateError, match="4 are needed"):
        ss.analyze_decay(ss.Record.of({"x": values}, fs=fs), method="thesis")


@pytest.fixture(scope="module")
def swings(dataset):
    """The release of a real pendulum."""
    return ss.read_record(dataset("pendulum_decay") / "pend1.csv", channels={"theta": "#2 [rad]"}, time="#1")


@pytest.fixture(scope="module")
def pendulum(swings):
    """What is found of it, as a pendulum."""
    return ss.analyze_decay(swings, restoring="pendulum", stiffness="0.6956 N m/rad")


def test_a_pendulum_is_read_with_its_sine_and_by_its_own_waveform(swings, pendulum):
    findings = pendulum
    assert findings.decay.best is findings.decay.waveform
    assert findings.decay.thesis is None
    assert set(findings.decay.comparisons[0].name.split(", ")) == {"damping ratio", "extremes alone"}
    assert 3.6e-3 < findings.decay.dry_force.value < 4.9e-3
    low, high = findings.decay.as_force(findings.decay.whichever[1], "").interval
    assert low < 3.6e-3 < 4.8e-3 < high
    other = findings.decay.as_force(findings.decay.older["extremes alone"].dry_displacement, "")
    assert low < other.value < high
    assert [plate.name for plate in ss.summary(findings).plates] == ["decay", "identified"]
    with pytest.raises(ss.errors.EstimateError, match="hold for a linear spring"):
        ss.analyze_decay(swings, restoring="pendulum", method="thesis")


@pytest.mark.parametrize(
    ("name", "share"),
    [("60.txt", 0.5), *(pytest.param(name, 1.0, marks=pytest.mark.soak) for name in ("60.txt", "100.txt"))],
)
def test_a_clock_that_can_not_be_trusted_leaves_the_extremes(dataset, name, share):
    path = dataset("pendulum_bad_clock") / name
    record = ss.signals.repair_clock(ss.read_record(path, channels={"theta": "Angle [deg]"}, time="Time_Elapsed"))
    findings = ss.analyze_decay(record.rows(0, round(share * len(record))), restoring="pendulum")
    assert findings.decay.waveform is None
    assert findings.decay.best is findings.decay.older["extremes alone"]
    assert 0.0051 < findings.decay.best.damping_ratio.value < 0.0065
    low, high = np.degrees(findings.decay.best.dry_displacement.interval)
    assert low < 0.0155
    assert high > 0.0115
    told = " ".join(ss.summary(findings).headline)
    assert "read from its extremes alone" in told
    assert "mend the clock, or trust the extremes" in told
    assert "choose restoring" not in told


def test_a_clock_that_runs_unevenly_is_told_by_what_the_waveform_leaves():
    values, fs, _ = free_decay(dry=0.005)
    along = np.arange(len(values))
    warped = np.interp(along + 0.35 * fs * np.sin(2 * np.pi * along / (2.5 * fs)), along, values)
    noisy = warped + 1e-4 * np.random.default_rng(1).standard_normal(len(warped))
    with pytest.raises(ss.errors.EstimateError, match="of the motion; a waveform is read where the clock is even"):
        ss.analyze_decay(ss.Record.of({"x": noisy}, fs=fs), method="waveform")


def test_a_chain_of_sliders_is_no_viscous_friction():
    """Viscous and dry friction leave 14 %, and the extremes told a damping ratio of 0.017, sure, for 0.003."""
    yields = np.linspace(0.045, 0.55, 12)
    law = ss.laws.ElastoSlip(stiffnesses=(0.08 / 12,) * 12, forces=tuple(0.08 / 12 * yields))
    start = {"x": 1.0, **{f"anchor{number}": 1.0 - bent for number, bent in enumerate(yields)}}
    x = ss.simulate(ss.Oscillator(mass=1.0, stiffness=1.0, damping=0.006, law=law), duration=150.0, start=start)
    noisy = x.record(fs=20.0)["x"]
    noisy = noisy + 3e-4 * np.random.default_rng(3).standard_normal(len(noisy))
    findings = ss.analyze_decay(ss.Record.of({"x": noisy}, fs=20.0), method="waveform")
    assert findings.decay.best is findings.decay.motion
    assert findings.decay.motion.model == "micro-slip"
    assert findings.decay.best.damping_ratio.interval[1] < 0.006
    assert findings.decay.best.damping_ratio.status != "ok"
    assert " ".join(ss.summary(findings).headline).startswith("Nearest comes")
    assert "micro-slip" in ss.summary(findings).scope.model, "the page draws that motion"


def test_the_pendulum_has_a_page(swings, tmp_path):
    findings = ss.analyze_decay(swings, stiffness=0.2235 * 9.82 * 0.31692)
    assert findings.decay.dry_force.unit == "N m"
    folder = ss.publish(findings, folder=tmp_path / "out")
    assert "not linear" in (folder / "report.html").read_text("utf-8")


def test_viscous_damping_alone_leaves_ten_times_the_residual_of_a_real_pendulum(pendulum):
    findings = pendulum
    assert findings.decay.viscous_residual > 10
    story = ss.summary(findings)
    assert f"alone leaves {findings.decay.viscous_residual:.3g} times the residual" in " ".join(story.headline)
    assert [row[0] for row in story.tables[-1].rows] == [words for _, words, _ in findings.decay.motion.candidates]
    low, high = findings.decay.as_force(findings.decay.motion.dry_displacement_any, "").interval
    assert low < 3.6e-3 < 4.8e-3 < high


def test_a_record_without_noise_is_no_digitiser_however_long_it_rests():
    slider = ss.Oscillator(mass=1.0, stiffness=10.0, damping=0.2, law=ss.laws.Coulomb(0.2))
    record = ss.simulate(slider, duration=80.0, start={"x": 1.0}).record(fs=200)
    findings = ss.analyze_decay(record, method="waveform", stiffness=10.0)
    assert findings.decay.releases.ring_downs[0].step == 0
    assert findings.decay.waveform.damping_ratio.value == pytest.approx(0.1 / 10**0.5, rel=1e-5)
    assert findings.decay.waveform.damping_ratio.sd < 1e-5
    assert findings.decay.motion.model == "both"
    told = " ".join(ss.summary(findings).headline)
    assert "within within" not in told


def test_every_release_is_drawn():
    values, fs, _ = free_decay()
    values = np.asarray(values)
    pull = np.linspace(values[-1], values[0], 150)
    twice = np.concatenate([values, np.full(100, values[-1]), pull, np.full(200, values[0]), values])
    twice += 1e-5 * np.random.default_rng(1).standard_normal(len(twice))
    findings = ss.analyze_decay(ss.Record.of({"x": twice}, fs=fs), method="waveform")
    assert len(findings.decay.releases.ring_downs) == 2
    assert [plate.name for plate in ss.summary(findings).plates] == ["decay", "identified", "identified-2"]


def analyzed(values, fs, *, method="waveform", noise=1e-3):
    values = values + noise * np.random.default_rng(1).standard_normal(len(values))
    return ss.analyze_decay(ss.Record.of({"x": values}, fs=fs), method=method)


def test_what_can_not_be_told_from_zero_is_said_so():
    values, fs, _ = free_decay(dry=0.0)
    told = " ".join(ss.summary(analyzed(values, fs)).headline)
    assert "dies away by viscous friction: a damping ratio of" in told
    assert "That there is dry friction too can not be told" in told
    values, fs, _ = free_decay(damping_ratio=0.0)
    told = " ".join(ss.summary(analyzed(values, fs)).headline)
    assert "dies away by dry friction: a dry friction displacement of" in told


def test_a_second_mode_and_a_drift_are_named():
    t = np.arange(1500) / 100
    decay = np.exp(-0.2 * t) * np.cos(2 * np.pi * t)
    told = " ".join(ss.summary(analyzed(decay + 0.05 * np.exp(-0.1 * t) * np.cos(2 * np.pi * 2.7 * t), 100)).headline)
    assert "leaves over swings at 2.7" in told
    assert "another mode of the rig, or something that drives it" in told
    told = " ".join(ss.summary(analyzed(decay + 0.02 * np.exp(-0.1 * t) * np.cos(2 * np.pi * 5.99 * t), 100)).headline)
    assert "leaves over swings at 5.99" in told
    assert "Hz, about 6 times the oscillation's own: another mode of the rig, or a spring or a sensor" in told
    values, fs, _ = free_decay()
    told = " ".join(ss.summary(analyzed(values + 0.004 * np.arange(len(values)) / fs, fs)).headline)
    assert "the rest position drifts" in told
    assert "leaves over" not in " ".join(ss.summary(analyzed(values, fs)).headline)


def test_every_release_of_a_record_counts_for_the_interval_of_any_motion():
    """A short first release alone tells little of which motion it was; all together tell it as well as the long one."""
    long, fs, _ = free_decay()
    short = long[: np.flatnonzero(long != long[0])[0] + 160]
    both = analyzed(np.concatenate([short, np.full(250, short[-1]), free_decay(amplitude=short[-1])[0]]), fs)
    assert len(both.decay.waveform.motions) == 2
    assert both.decay.whichever[1].includes(0.02)
    assert np.ptp(both.decay.whichever[1].interval) < 0.5 * np.ptp(both.decay.motion.dry_displacement_any.interval)


def test_the_headline_names_the_motion_that_the_record_leaves():
    from stickslip.decay.motions import free_decay as any_decay

    t = np.arange(4000) / 500
    w, damping, quadratic, length = 20.0, 0.01, 20.0, 0.03
    x = any_decay(t, [w, damping, 0, 0, length, 0, quadratic, 0, 0, 0, 0.5, 0])[0]
    findings = ss.analyze_decay(
        ss.Record.of({"x": x + 3e-5 * np.random.default_rng(7).standard_normal(t.size)}, fs=500)
    )
    assert findings.decay.best is findings.decay.motion
    assert findings.decay.motion.model == "air"
    told = " ".join(ss.summary(findings).headline)
    assert "dies away by viscous and quadratic (air) damping, no dry friction: a damping ratio of 0.01" in told
    assert "quadratic damping of " in told
    estimates = {estimate.name: estimate for estimate in findings.estimates}
    assert estimates["damping ratio"].includes(damping)
    assert estimates["quadratic damping"].includes(quadratic)
    assert estimates["quadratic damping"].unit == "1/m"
    assert "dry friction displacement" not in estimates
    # what takes the motion for another one had stood beside it without a doubt, ten deviations off
    assert not stands(estimates["damping ratio, by decrements"].status)
    assert ss.summary(findings).plates


def test_a_motion_that_has_dry_friction_claims_none_that_is_not_there():
    """A softening spring without dry friction died away "by viscous damping and dry friction", of 0 nm."""
    from stickslip.decay.motions import free_decay as any_decay

    t = np.arange(4000) / 500
    x = any_decay(t, [20.0, 0.005, 0, 0, 0.03, 0, 0, 0, 0, 0, 0.5, -200.0])[0]
    findings = ss.analyze_decay(
        ss.Record.of({"x": x + 1e-6 * np.random.default_rng(7).standard_normal(t.size)}, fs=500)
    )
    assert findings.decay.best is findings.decay.motion
    assert not findings.decay.rubs
    told = " ".join(ss.summary(findings).headline)
    assert "dies away as it would by" in told
    assert "and a curvature of the spring" in told
    assert "That there is dry friction too can not be told: less than" in told


@pytest.mark.parametrize("draws", [6, pytest.param(100, marks=pytest.mark.soak)])
def test_a_spring_that_hardens_or_softens_is_named_and_what_stands_holds(draws):
    """A straight spring's fit lost its phase after some periods, and the decrements stood, off by ten deviations."""
    rng, held, named = np.random.default_rng(draws), [], 0
    for _ in range(draws):
        cubic = rng.choice([-1, 1]) * rng.uniform(0.03, 0.3)
        truth = {"damping ratio": rng.uniform(0.002, 0.04), "dry friction displacement": rng.uniform(0.003, 0.04)}
        fs, held_for = rng.choice([50.0, 100.0]), rng.choice([0.0, 0.5])
        t = np.arange(int(rng.uniform(8, 30) * fs)) / fs - held_for
        x = on_a_cubic_spring(np.maximum(t, 0.0), 2 * np.pi, *truth.values(), cubic)
        x += 10 ** rng.uniform(-3.5, -2.3) * rng.standard_normal(len(t))
        findings = ss.analyze_decay(ss.Record.of({"x": x}, fs=fs))
        way = "rises with the amplitude" if cubic > 0 else "falls with the amplitude"
        named += way in " ".join(ss.summary(findings).headline)
        truth["natural frequency"] = 1.0
        sure = [estimate for estimate in findings.decay.quoted if estimate.name in truth and stands(estimate.status)]
        held += [estimate.includes(truth[estimate.name]) for estimate in sure]
    assert named >= 0.9 * draws - 1
    assert len(held) >= 2 * draws
    assert np.mean(held) >= 0.95 - 2 * np.sqrt(0.05 / len(held))


def test_a_pendulum_read_with_a_straight_spring_is_told_so():
    from stickslip.decay.motions import free_decay as any_decay

    t = np.arange(1000) / 100
    x = any_decay(t, [6, 0.005, 0.01, 0, 1.2, 0, 0, 0, 0, 0, 0.5, 0], restoring="pendulum")[0]
    record = ss.Record.of({"theta": x + 1e-3 * np.random.default_rng(1).standard_normal(t.size)}, fs=100)
    told = " ".join(ss.summary(ss.analyze_decay(record)).headline)
    assert 'of a pendulum ask with restoring="pendulum"' in told
    assert "dies away by dry" not in told
    findings = ss.analyze_decay(record, restoring="pendulum")
    assert findings.decay.best.dry_displacement.includes(0.01)
    assert "straight spring" not in " ".join(ss.summary(findings).headline)


def test_a_friction_below_zero_is_never_told_as_friction():
    findings = analyzed(np.asarray(free_decay()[0]), free_decay()[1])
    estimate = replace(findings.decay.waveform.dry_displacement, value=-1e-3, interval=(-2e-3, -1e-4))
    waveform = replace(findings.decay.waveform, dry_displacement=estimate)
    below = findings.having(decay=replace(findings.decay, waveform=waveform, motion=None))
    assert "which the record speaks against" in ss.summary(below).headline[0]


def test_a_motion_rejected_by_chance_is_not_denied_as_a_fact():
    values, fs, _ = free_decay()
    findings = analyzed(values, fs)
    choice = findings.decay.motion.choice
    weak = replace(choice, candidates=tuple(replace(candidate, p_value=0.01) for candidate in choice.candidates))
    motion = replace(findings.decay.motion, choice=weak)
    told = " ".join(ss.summary(findings.having(decay=replace(findings.decay, motion=motion))).headline)
    assert "dies away by viscous and dry friction" in told
    assert "but weakly (p = 0.01)" in told
    assert "friction of another kind too" not in told
    assert all("p = 0)" not in verdict for _, _, verdict in findings.decay.motion.candidates)


def test_what_no_repair_bridges_is_not_sent_to_a_repair():
    values = np.asarray(free_decay()[0]).copy()
    values[300:380] = np.nan
    with pytest.raises(
        ss.errors.RecordError, match=r"too many in a row .* keep a part without them with record.rows\(\)"
    ):
        ss.analyze_decay(ss.Record.of({"x": values}, fs=100))
    with pytest.raises(ss.errors.RecordError, match="look at its cable"):
        ss.analyze_decay(ss.Record.of({"x": np.full(400, np.nan)}, fs=100))


def test_the_release_is_told_by_one_number_everywhere():
    from stickslip.story.story import value_of

    values, fs, _ = free_decay(hold=1.0)
    noisy = values + 1e-3 * np.random.default_rng(1).standard_normal(len(values))
    for motion, words in (
        (noisy, ("begins at", "release time")),
        (noisy[120:], ("under way when the record begins (it is fitted from", "time of the first turn")),
        (np.clip(noisy, -0.7, 0.7), ("(swings are left out: it is fitted from", "time of the first turn")),
    ):
        findings = ss.analyze_decay(ss.Record.of({"x": motion}, fs=fs))
        begin, far = findings.decay.waveform.release_time, findings.decay.waveform.amplitude
        sentence = next(each for each in ss.summary(findings).headline if "extremes from" in each)
        assert words[0] in sentence
        assert begin.name == words[1]
        assert f"at {value_of(begin)}" in sentence
        assert f"from {value_of(far, abs(far.value))}" in sentence


def let_go_of(**motion):
    """Answer and headline of a release from 50 mm of a mass of 1 kg on 100 N/m, seen with a micrometre of noise."""
    t = np.arange(3500) / 100 - 0.5
    x = 0.05 * on_a_cubic_spring(np.maximum(t, 0.0), 10.0, **motion)
    noisy = x + 1e-6 * np.random.default_rng(2).standard_normal(len(x))
    findings = ss.analyze_decay(ss.Record.of({"x": noisy}, fs=100), stiffness=100.0)
    return findings, " ".join(ss.summary(findings).headline)


@pytest.mark.parametrize("more", [{"air": 0.02}, {"cubic": 0.04}])
def test_begin_and_rest_are_those_of_the_motion_that_is_named(more):
    """Those of the rejected fit stood there: 44.6 mm of 50.0 mm, and a rest position that drifts."""
    findings, headline = let_go_of(zeta=0.004, dry=0.008, **more)
    decay = findings.decay
    assert decay.best is decay.motion
    rows = {estimate.name: estimate for estimate in decay.quoted}
    truth = {"amplitude at release": 0.05, "release time": 0.5, "rest position": 0.0}
    for name, value in truth.items():
        assert abs(rows[name].value - value) < 4 * rows[name].sd
        assert stands(rows[name].status)
    assert rows["static friction displacement"].includes(0.05 * 0.008)
    assert "from 50.0" in headline
    assert "drifts" not in headline


def test_friction_that_falls_to_less_than_half_is_told_as_such():
    """A rise held below one ended at two thirds, and viscous and dry friction were sure, each far off."""
    findings, headline = let_go_of(zeta=0.008, dry=0.011, rise=1.5, power=1.0)
    terms = {estimate.name: estimate for estimate in findings.decay.motion.terms}
    assert findings.decay.best is findings.decay.motion
    assert terms["rise of friction towards rest"].includes(1.5)
    assert findings.decay.best.damping_ratio.includes(0.008)
    assert findings.decay.best.dry_displacement.includes(0.05 * 0.011)
    assert "(Stribeck)" in headline


def test_where_no_motion_fits_the_nearest_tells_the_course():
    """A rejected fit's bracket stood sure, and far off; its force stood beside the displacement of whichever motion."""
    findings, headline = let_go_of(zeta=0.004, dry=0.006, rise=0.5)
    decay = findings.decay
    assert decay.denied
    assert not stands(decay.waveform.static_displacement.status)
    rows = {estimate.name: estimate for estimate in decay.quoted}
    assert rows["static friction displacement"].includes(0.05 * 0.009)
    assert rows["dry friction force"].interval == pytest.approx([100 * end for end in decay.whichever[1].interval])
    assert rows["amplitude at release"].value == pytest.approx(0.05, rel=1e-3)
    assert "dry friction displacement" not in rows
    assert "drifts" not in headline
