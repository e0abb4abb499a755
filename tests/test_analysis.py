"""Which questions are asked of a record, and how records compare."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stepped
import stickslip as ss
from stickslip.answers.findings import BY_FORCE, Comparison, Findings, Inquiry, record_name
from stickslip.answers.many import compare
from stickslip.answers.preparation import _seen_from_face, mend
from stickslip.answers.questions import QUESTIONS, analyze
from stickslip.errors import EstimateError, ModelError
from stickslip.estimate import kinds, stands
from stickslip.rig.settings import RigSettings

FS = 500.0
TIME = np.arange(5000) / FS


def sliding(friction: float = 1.5, *, seed: int = 0, **extra: float) -> ss.Record:
    """Ten cycles of sliding at 1 Hz against a constant friction, measured with noise."""
    rng = np.random.default_rng(seed)
    force = friction * np.sign(np.cos(2 * np.pi * TIME)) + rng.normal(0, 0.02, TIME.size)
    constant = {name: np.full(TIME.size, value) for name, value in extra.items()}
    return ss.Record.of({"x": 0.01 * np.sin(2 * np.pi * TIME), "friction": force, **constant}, fs=FS)


def test_the_demonstration_agrees_with_its_truth() -> None:
    record = ss.datasets.demo()
    findings = analyze(record, mass=2.42, stiffness=2310, damping=record.truth["damping"])
    assert findings.level is not None
    assert findings.level.value == pytest.approx(record.truth["sliding friction"], rel=0.01)
    known = {e.name: findings.true_value(e) for e in findings.estimates if findings.true_value(e) is not None}
    assert {"sliding friction", "stuck share of the time", "stops per cycle"} <= set(known)
    assert known["sliding friction"] == record.truth["sliding friction"]


@pytest.mark.parametrize("belt", [False, True])
@pytest.mark.parametrize("way", [1, -1])
def test_a_slider_pulled_steadily_tells_its_friction_by_its_slips(way: int, belt: bool) -> None:
    """Of another integrator; seen from the spring's end that is a mass on a belt, and its damper drags there, too."""
    rig = stepped.Rig("static", 1.0, 400.0, 0.4, 0.0, 20 / (2 * np.pi), kinetic=2.0, static=3.0, pulled=0.01)
    record = stepped.record(rig, np.random.default_rng(5), cycles=40)
    truth, z = record.truth, way * record["z"]
    moved = {"x": way * record["x"] - z} if belt else {"x": way * record["x"], "z": z}
    findings = analyze(ss.Record.of(moved, fs=record.fs), **rig.stated)
    assert findings.level is not None
    assert findings.level.includes(2.0 + belt * 0.4 * 0.01)
    assert stands(findings.level.status)
    static = findings.breakaway.forward or findings.breakaway.back
    assert static.name.endswith("forward" if way == 1 else "back")
    assert static.includes(3.0 + belt * 0.4 * 0.01)
    assert findings.sticks.share.value == pytest.approx(truth["stuck share of the time"], abs=0.01)
    assert findings.sticks.per_cycle.value == 1
    assert not findings.loops.offset.known
    assert "one way" in kinds(findings.loops.status)
    assert "more than while it slides" in " ".join(map(str, ss.summary(findings).headline))
    assert not [note for note in findings.notes if "turns round" in note]


def test_no_belt_is_seen_where_a_base_shakes() -> None:
    """Rigs of another integrator whose base nobody measured: of 240 others none."""
    for kind in stepped.KINDS:
        rng = np.random.default_rng([712, stepped.KINDS.index(kind)])
        rig = stepped.drawn(kind, rng)
        record = ss.Record.of({"x": stepped.record(rig, rng)["x"]}, fs=1000.0)
        settings = ss.rig.rig_settings(rig.stated)
        assert _seen_from_face(record, settings, Inquiry()) is record


def test_the_frame_slides_and_sticks_as_published(dataset: Callable[[str], Path]) -> None:
    folder = dataset("frame_base_excited")
    rig = RigSettings(
        mass=3.0799, stiffness=1191, damping=0.669, damper="base", normal={"*250g*": "0.25 kg", "*450g*": "0.45 kg"}
    )
    files = [[folder / f"s_b_{weight}_{side}.mat" for side in "xy"] for weight in ("250g", "450g")]
    found = [analyze(ss.read_record(pair, channels={"x": "x [mm]", "z": "y [mm]"}), rig=rig) for pair in files]
    # sliding friction and stuck share found by hand from the same records
    for findings, friction, stuck in zip(found, (0.682, 1.318), (0.52, 0.56), strict=True):
        assert findings.level is not None
        assert findings.level.value == pytest.approx(friction, rel=0.04)
        assert findings.sticks is not None
        assert findings.sticks.share.value == pytest.approx(stuck, abs=0.05)
        assert findings.sticks.per_cycle.value == pytest.approx(2.0, abs=0.05)
    comparison = compare(found)
    assert comparison.coefficient is not None
    assert comparison.coefficient.includes(0.682 / (0.25 * 9.80665))
    assert found[0].name == "s_b_250g_x.mat + s_b_250g_y.mat"


def test_the_positioning_system_is_regressed_as_published(dataset: Callable[[str], Path]) -> None:
    path = dataset("emps") / "DATA_EMPS.mat"
    findings = analyze(ss.read_record(path, channels={"x": "qm [m]", "force": "vir * 35.1507 [N]"}))
    values = {estimate.name: estimate.value for estimate in findings.estimates}
    published = {"inertia": 95.1089, "viscous friction": 203.5034, "Coulomb friction": 20.3935}
    assert values == pytest.approx({**values, **published}, rel=0.01)  # Janot, Gautier, Brunot 2019
    sides = {"viscous friction forward": 166.706, "viscous friction back": 240.424}
    assert values == pytest.approx({**values, **sides}, rel=0.02)


def test_a_failed_question_becomes_a_note() -> None:
    record = sliding().with_channel("force", np.full(TIME.size, 2.0), unit="N")
    findings = analyze(record)
    assert findings.loops is not None
    assert findings.regression is None
    assert any(note.startswith("Regression: channel force never changes") for note in findings.notes)


def test_what_is_missing_for_the_friction_force_is_named() -> None:
    record = ss.Record.of({"x": sliding()["x"]}, fs=FS)
    notes = " ".join(analyze(record, mass=2.0).notes)
    assert "stiffness" in notes
    assert "mass" not in notes


def test_a_load_cell_stands_in_for_the_friction_and_says_so() -> None:
    record = ss.Record.of({"x": sliding()["x"], "load": sliding()["friction"]}, fs=FS)
    findings = analyze(record)
    assert findings.level is not None
    assert findings.level.value == pytest.approx(1.5, rel=0.01)
    assert any("load cell" in note for note in findings.notes)
    assert findings.record.history[-1].arguments == {"friction": "load"}


def test_the_interval_holds_how_sure_a_load_cell_is_and_nothing_breaks_away_that_never_stops() -> None:
    held = 0
    for seed in range(20):
        gain = 1 + 0.004 * np.random.default_rng([713, seed]).standard_normal()
        record = ss.Record.of({"x": sliding()["x"], "load": gain * sliding(seed=seed)["friction"]}, fs=FS)
        findings = analyze(record.with_details("load", gain_sd=0.004))
        held += findings.level.includes(1.5) and findings.loops.energy_per_cycle.includes(0.06)
        assert findings.level.sd == pytest.approx(0.006, rel=0.1)
        words = " ".join(map(str, ss.summary(findings).headline))
        assert "As it turns round it bears" in words
        assert "breakaway" not in words
    assert held >= 17  # by chance alone fewer in 16 of 1000


@pytest.mark.parametrize(
    ("samples", "reason"),
    [
        ({"x": np.full(5000, np.nan)}, "not numbers"),
        ({"x": np.ones(5000)}, "x does not change"),
        ({"x": np.sin(np.arange(10.0))}, "10 samples"),
        ({"sound": np.sin(np.arange(5000.0))}, "its channels are sound"),
    ],
)
def test_a_record_that_answers_nothing_is_refused_in_one_sentence(samples: dict[str, np.ndarray], reason: str) -> None:
    record = ss.Record.of(samples, fs=FS)
    with pytest.raises(EstimateError, match=reason) as caught:
        analyze(record, mass=1.0, stiffness=100.0)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("constants", [{"mass": -1}, {"mass": "2 N"}, {"contact": "wall"}, {"stiffness": float("nan")}])
def test_a_constant_without_meaning_is_wrong_use(constants: dict[str, object]) -> None:
    with pytest.raises(ModelError):
        analyze(sliding(), **constants)  # type: ignore[arg-type]


def test_the_arguments_go_before_the_rig() -> None:
    rig = RigSettings(mass=2.0, stiffness=100.0)
    record = ss.Record.of({"x": sliding()["x"]}, fs=FS)
    findings = analyze(record, rig=rig, mass="3 kg")
    assert findings.settings["mass"] == 3.0
    assert findings.settings["stiffness"] == 100.0


def test_constants_that_are_not_used_are_said_and_left_out() -> None:
    findings = analyze(sliding(), mass=3.0, damping=0.5)
    assert any("mass and damping as stated are not used" in note for note in findings.notes)
    assert findings.settings == {"contact": "ground"}
    assert not any("not used" in note for note in analyze(sliding()).notes)


def test_a_balance_of_before_is_made_anew_by_other_constants() -> None:
    record = ss.datasets.demo()
    first = ss.friction_force(record, mass=2.42, stiffness=2310, contact="ground")
    findings = analyze(first)
    assert findings.settings["mass"] == 2.42
    assert np.array_equal(findings.record["friction"], first["friction"])
    again = analyze(first, mass=3.0, stiffness=2310)
    assert again.settings["mass"] == 3.0
    direct = analyze(record, mass=3.0, stiffness=2310)
    assert np.array_equal(again.record["friction"], direct.record["friction"])


def test_stated_delays_are_taken_out_of_the_record_that_is_shown() -> None:
    late = ss.Record.of({"x": sliding()["x"][:-20], "friction": sliding()["friction"][20:]}, fs=FS)
    findings = analyze(late.with_details("x", delay=20 / FS))
    assert findings.record.channels["x"].delay == 0
    assert findings.loops is not None
    assert findings.loops.energy_per_cycle.value == pytest.approx(4 * 1.5 * 0.01, rel=0.01)


@pytest.mark.parametrize(
    ("reading", "load", "words"),
    [
        (-4.0, 4.0, "its magnitude is taken"),
        (np.nan, None, "no numbers"),
        (0.0, None, "zeros"),
    ],
)
def test_a_normal_load_is_taken_by_its_magnitude_or_missed_aloud(reading: float, load: float, words: str) -> None:
    findings = analyze(sliding(normal=reading))
    assert (findings.normal and findings.normal.value) == load
    assert any(words in note for note in findings.notes)
    stated = analyze(sliding(normal=reading), rig=RigSettings(normal=7.0))
    assert stated.normal.value == (load or 7.0)


@pytest.mark.parametrize("stated", [True, False], ids=["stated", "measured"])
def test_a_coefficient_is_no_surer_than_the_load(stated: bool) -> None:
    """As the quotient of two numbers that are unsure: its relative sd is the root of the sum of both squared."""
    rig = RigSettings(normal="4 ± 0.2 N") if stated else RigSettings(sensors={"normal": {"gain_sd": "5 %"}})
    findings = analyze(sliding() if stated else sliding(normal=4.0), rig=rig)
    level, coefficient = findings.level, findings.coefficient
    assert coefficient.value == pytest.approx(level.value / 4.0)
    half = np.diff(coefficient.interval)[0] / 2 / coefficient.value
    alone = np.diff(level.interval)[0] / 2 / level.value
    assert half == pytest.approx(np.hypot(alone, 1.96 * 0.05), rel=1e-3)


def test_a_coefficient_over_records_is_no_surer_than_the_scale_that_weighed_them() -> None:
    loads = (2.0, 4.0, 8.0)
    exact, weighed = (
        compare([analyze(sliding(0.3 * n), rig=RigSettings(normal=f"{n} ± {sure * n} N")) for n in loads]).coefficient
        for sure in (0.0, 0.02)
    )
    assert weighed.value == exact.value
    assert weighed.sd == pytest.approx(np.hypot(exact.sd, 0.02 * exact.value))


@pytest.mark.parametrize("swing", [0.0, 0.3])
def test_a_load_that_swings_is_said_beside_its_mean(swing: float) -> None:
    load = 4.0 * (1 + swing * np.sin(2 * np.pi * 1.1 * TIME))
    samples = {"x": sliding()["x"], "friction": sliding()["friction"], "normal": load}
    said = " ".join(ss.summary(analyze(ss.Record.of(samples, fs=FS))).headline)
    assert "Under a normal load of 4 N" in said
    assert ("which swings by 21 % (r.m.s.)" in said) == bool(swing)


def test_records_left_out_of_the_coefficient_are_named() -> None:
    variants = [replace(analyze(sliding(0.3 * n, normal=n)), name=f"load {n}") for n in (2.0, 4.0)]
    turning = ss.Record.of(
        {"theta": sliding()["x"], "friction": sliding()["friction"], "normal": np.full(TIME.size, 3.0)},
        fs=FS,
        units={"friction": "N m"},
    )
    torque = replace(analyze(turning), name="torque")
    mute = replace(variants[0].having(loops=None), name="mute")
    comparison = compare([*variants, torque, mute])
    assert comparison.coefficient is not None
    assert comparison.coefficient.value == pytest.approx(0.3, abs=0.01)
    assert "The friction of torque is a torque" in " ".join(comparison.notes)
    assert "No friction level was found for mute." in comparison.notes


def test_the_line_is_no_surer_than_its_records() -> None:
    found = [analyze(sliding(0.3 * n, normal=n)) for n in (1.0, 2.0, 4.0)]
    levels = [f.loops.level for f in found if f.loops is not None]
    vague = [
        f.having(loops=replace(f.loops, level=replace(level, sd=0.1)))
        for f, level in zip(found, levels, strict=True)
        if f.loops is not None
    ]
    comparison = compare(vague)
    design = np.column_stack([[1.0, 2.0, 4.0], np.ones(3)])
    own = 0.1 * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    for estimate, sd in zip((comparison.slope, comparison.offset), own, strict=True):
        assert estimate.interval[1] - estimate.value == pytest.approx(1.96 * sd, rel=1e-3)
    endless = compare([vague[0].having(loops=replace(vague[0].loops, level=replace(levels[0], sd=np.inf))), *vague])
    assert np.isfinite(endless.estimates[0].sd)


@pytest.mark.parametrize("offset", [0.0, 0.4])
def test_the_coefficient_and_the_line_are_those_of_the_law(offset: float) -> None:
    loads = [1.0, 2.0, 4.0, 8.0]
    comparison = compare([analyze(sliding(0.3 * n + offset, seed=int(n), normal=n)) for n in loads])
    slope, at_no_load = comparison.slope, comparison.offset
    assert slope.value == pytest.approx(0.3, abs=0.003)  # noise 0.02 N, some 4000 sliding samples each
    assert at_no_load.value == pytest.approx(offset, abs=0.005)
    assert comparison.coefficient is not None
    through_origin = sum(n * (0.3 * n + offset) for n in loads) / sum(n * n for n in loads)
    assert comparison.coefficient.value == pytest.approx(through_origin, abs=0.003)
    assert (comparison.coefficient.status == "ok") == (offset == 0.0)


def test_two_records_are_compared_by_students_t() -> None:
    found = [analyze(sliding(friction, normal=n)) for friction, n in ((1.0, 2.0), (1.3, 4.0))]
    coefficient = compare(found).coefficient
    assert coefficient is not None
    slope = (2 * 1.0 + 4 * 1.3) / 20
    rest = np.array([1.0, 1.3]) - slope * np.array([2.0, 4.0])
    half = 12.7062 * np.sqrt(rest @ rest / 20)  # Student's t at 97.5 %, one degree of freedom
    assert coefficient.interval[1] - coefficient.value == pytest.approx(half, rel=0.02)


def test_without_loads_there_is_a_table_and_a_note() -> None:
    comparison = compare([analyze(sliding(1.0)), analyze(sliding(2.0))])
    assert comparison.coefficient is None
    assert "not known" in comparison.notes[0]
    with pytest.raises(EstimateError, match="two or more"):
        compare([analyze(sliding())])


def test_results_are_plain_data() -> None:
    findings = analyze(sliding(normal=3.0))
    data = json.loads(json.dumps(ss.summary(findings).data(), allow_nan=False))
    assert data["normal_load"] == 3.0
    assert {"friction coefficient", "sliding friction"} <= {estimate["name"] for estimate in data["estimates"]}
    assert isinstance(compare([findings, findings]), Comparison)
    assert isinstance(findings, Findings)


def test_answers_print_as_their_estimates() -> None:
    findings = analyze(sliding(normal=3.0))
    assert findings.loops is not None
    for answer in (findings, findings.loops, findings.sticks, compare([findings, findings])):
        assert len(repr(answer)) < 1500
        assert "array" not in repr(answer)
    assert str(findings.loops).startswith("Loops:\n  sliding friction 1.49")
    assert str(findings).startswith("record:\n  friction coefficient 0.5")


def test_a_joined_record_bears_the_name_of_the_first(tmp_path: Path) -> None:
    for name, shift in (("first", 0), ("second", 7)):
        table = np.column_stack([TIME, np.roll(sliding()["x"], shift)])
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header="time [s],x [m]", comments="")
    first, second = (ss.read_record(tmp_path / f"{name}.csv") for name in ("first", "second"))
    assert record_name(ss.signals.synchronise(first, second, on="x")) == "first.csv"


def test_mending_is_asked_for_and_logged() -> None:
    wave = np.sin(0.2 * np.arange(2000))
    wave[100:103] = np.nan
    record = ss.Record.of({"x": wave, "load": wave}, fs=100.0)
    mended = mend(record, repairs=["missing:x"])
    assert np.isfinite(mended["x"]).all()
    assert np.isnan(mended["load"]).sum() == 3
    assert mended.history[-1].action == "fill_missing"
    assert mend(record, repairs=[]) is record
    with pytest.raises(ModelError, match="clok"):
        mend(record, repairs=["clok"])


def test_what_rests_on_the_friction_force_is_doubted_with_it() -> None:
    """A question that is added must not be sure of a force whose constants contradict the record."""
    by_force = {question.key for question in QUESTIONS if ("friction",) in question.needs and not question.derived}
    assert by_force == set(BY_FORCE)
