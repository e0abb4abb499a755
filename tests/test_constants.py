"""A constant of a rig, and a channel's gain, with how sure they are: what is read, and where it goes."""

from __future__ import annotations

import contextlib
import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

import stickslip as ss
from stickslip.cli.program import main
from stickslip.errors import ModelError, RecordError
from stickslip.estimate import Estimate
from stickslip.units import parse_uncertain

WRITTEN = [
    ("2.42 ± 0.02 kg", 2.42, 0.02),
    ("2.42 +- 0.02 kg", 2.42, 0.02),
    ("2.42+/-0.02kg", 2.42, 0.02),
    ("(2.42 ± 0.02) kg", 2.42, 0.02),
    ("2420 g ± 0.02 kg", 2.42, 0.02),
    ("2.42 kg ± 1 %", 2.42, 0.0242),
    ("2.42 ± 1% kg", 2.42, 0.0242),
    ("2.42(2) kg", 2.42, 0.02),
    ("2.42(0.02) kg", 2.42, 0.02),
    ("242(2)e-2", 2.42, 0.02),
    ("2.42 ± .02", 2.42, 0.02),
    ("2.42 kg", 2.42, 0.0),
    ("2.42 ± 0 kg", 2.42, 0.0),
    (2.42, 2.42, 0.0),
    ((2.42, 0.02), 2.42, 0.02),
    (("2420 g", "20 g"), 2.42, 0.02),
]
REFUSED = [
    ("2.42 ± -0.02 kg", "finite and not negative"),
    ((2.42, -0.02), "finite and not negative"),
    ("2.42 kg ± 3 N", "'N' is measured in N; this quantity is measured in kg"),
    ("0 kg ± 1 %", "a per cent of 0 is no uncertainty"),
    ("2.42 ± nan kg", "a number behind it"),
    ((2.42, float("nan")), "not a finite number"),
    ("2.42 ± inf kg", "a number behind it"),
    ("2.42 ± 1e999 %", "finite and not negative"),
    ("± 0.02 kg", "a value stands before the sign"),
    ((None, 0.02), "not a finite number"),
    ("2.42 kg ±", "a number behind it"),
    ("2420 g ± 20", "stands a number with one, or per cent"),
    ("2.42 kg ± 1 % kg", "stands a number with one, or per cent"),
    ((2.42, 0.02, 0.01), "a pair is a value and its uncertainty"),
    ("2,42 kg", "has a decimal comma"),
    ("2.42 ± 0.02 ± 0.01 kg", "is not known"),
    ("(2.42)", "not a finite number"),
]


@pytest.mark.parametrize(("stated", "value", "sd"), WRITTEN)
def test_a_value_and_its_standard_uncertainty_are_read_as_they_are_written(stated, value, sd):
    assert parse_uncertain(stated, "kg") == pytest.approx((value, sd), rel=1e-12)


@pytest.mark.parametrize(("stated", "told"), REFUSED)
def test_an_uncertainty_that_has_no_meaning_is_one_sentence(stated, told):
    with pytest.raises(RecordError) as caught:
        parse_uncertain(stated, "kg")
    assert told in str(caught.value)


def test_an_estimate_is_a_constant_as_sure_as_it_is():
    estimate = Estimate.normal("mass", 2.42, sd=0.02, unit="kg", method="scales")
    assert Estimate.stated("mass", estimate, "kg").sd == 0.02
    with pytest.raises(ModelError, match="a stiffness is measured in N/m"):
        Estimate.stated("stiffness", estimate, "N/m")
    with pytest.raises(ModelError, match="not a finite number"):
        Estimate.stated("mass", estimate.unknown("it never moved"), "kg")


@given(st.floats(-1e6, 1e6), st.floats(0, 1e6), st.sampled_from(["±", "+-", "+/-"]))
def test_what_is_written_is_read(value, sd, sign):
    assert parse_uncertain(f"{value!r} {sign} {sd!r} N/m", "N/m") == (value, sd)


@given(st.text("0123456789.±+-/()% ekgmN\n", max_size=300))
def test_any_text_is_read_or_one_sentence(text):
    with contextlib.suppress(RecordError):
        value, sd = parse_uncertain(text, "kg")
        assert abs(value) < float("inf")
        assert 0 <= sd < float("inf")


RIG = {"mass": "2.42 ± 0.02 kg", "stiffness": (2310, 5.0), "damping": 0.12}
SD = {"mass": 0.02, "stiffness": 5.0}


def slider(**changes):
    system = ss.Oscillator(
        mass=2.42,
        stiffness=2310,
        damping=0.12,
        law=ss.laws.Coulomb(1.1),
        drive=ss.drives.HarmonicBase(1e-3, frequency=4),
    )
    rig = ss.Rig.perfect("x", "z").having("x", white=1e-7)
    return rig.measure(ss.simulate(system.having(**changes), duration=2), fs=1000, rng=1)


def test_the_friction_is_that_of_the_values_and_the_record_keeps_how_sure_they_are():
    record = slider()
    exact = ss.friction_force(record, mass=2.42, stiffness=2310, damping=0.12)
    unsure = ss.friction_force(record, **RIG)
    assert exact.rig.sd == {}
    assert unsure.rig == replace(exact.rig, sd=SD)
    assert np.array_equal(unsure["friction"], exact["friction"])
    assert np.array_equal(unsure["friction_sd"], exact["friction_sd"])
    assert "sd" not in exact.history[-1].arguments
    assert unsure.history[-1].arguments["sd"] == SD


@pytest.mark.parametrize("method", ["smoother", "five-point", "motion", "F", "F1"])
def test_every_method_keeps_it(method):
    assert ss.friction_force(slider(), method=method, **RIG).rig.sd == SD


@pytest.mark.parametrize("method", ["smoother", "motion"])
def test_beside_a_constant_that_is_found_stands_how_sure_the_stated_one_is(method):
    made = ss.friction_force(slider(), stiffness="2310 ± 5 N/m", damping="0.12 ± 50 %", method=method)
    assert made.rig.mass == pytest.approx(2.42, rel=0.05)
    assert made.rig.sd == {"stiffness": 5.0, "damping": 0.06}


@pytest.mark.parametrize(
    ("constants", "told"),
    [
        ({"mass": "2.42 ± -0.02 kg"}, "mass: '2.42 ± -0.02 kg'; .*finite and not negative.*correct the mass"),
        ({"mass": "2.42 kg ± 3 N"}, "measured in N; this quantity is measured in kg"),
        ({"mass": (2.42, float("nan"))}, "not a finite number"),
        ({"mass": "-2.42 ± 0.02 kg"}, "a mass is positive"),
        ({"mass": 2.42, "damping": "0 ± 1 %"}, "a per cent of 0"),
    ],
)
def test_what_has_no_meaning_is_refused_with_its_name(constants, told):
    with pytest.raises(ModelError, match=told):
        ss.friction_force(slider(), **{"stiffness": 2310, **constants})


@pytest.mark.parametrize(
    "stated", ["2.42 ± 0.02 kg", (2.42, 0.02), [2.42, 0.02], Estimate.stated("m", (2.42, 0.02), "kg")]
)
def test_settings_take_a_constant_as_it_is_stated_and_pass_it_on(stated):
    rig = ss.rig.rig_settings({"mass": stated, "stiffness": 2310})
    assert (float(rig.mass), rig.mass.sd, rig.stiffness) == (2.42, 0.02, 2310.0)
    assert ss.rig.rig_settings(rig.model_dump()) == rig
    assert ss.rig.RigSettings.model_validate_json(rig.model_dump_json()) == rig


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("mass = '2.42 ± -0.02 kg'", ["line 1", "mass = '2.42 ± -0.02 kg'", "finite and not negative", "correct mass"]),
        ("x = 1\nmass = '2.42 kg ± 3 N'", ["line 2", "measured in N"]),
        ("damping = '0 N s/m ± 1 %'", ["line 1", "a per cent of 0"]),
        ("mass = '± 0.02 kg'", ["line 1", "a value stands before the sign"]),
        ("mass = [2.42]", ["line 1", "a value and its uncertainty"]),
        ("[sensors.a]\ngain_sd = '-1 %'", ["line 2", "greater than or equal to 0"]),
        ("[sensors.a]\ngain_sd = '100 %'", ["line 2", "less than 1"]),
    ],
)
def test_a_mistake_in_a_rig_file_is_told_with_its_line(tmp_path, text, told):
    path = tmp_path / "rig.toml"
    path.write_text(text.replace("x = 1\n", "# a rig\n"), encoding="utf-8")
    with pytest.raises(ModelError) as caught:
        ss.rig.read_rig(path)
    assert all(part in str(caught.value) for part in told), caught.value


def test_an_option_goes_before_the_file_with_what_it_says_of_its_sureness(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text("mass = '2.42 ± 0.02 kg'\nstiffness = '2310 N/m ± 1 %'\n[sensors.x]\ngain_sd = '1 %'\n", "utf-8")
    findings = ss.analyze(slider(), rig=ss.rig.read_rig(path), mass=2.42)
    assert findings.record.rig.sd == {"stiffness": 23.1}
    assert findings.settings["sd"] == {"stiffness": 23.1}
    assert findings.record.channels["x"].gain_sd == 0.01
    assert ss.summary(findings).settings["stiffness"] == "2310 N/m, standard uncertainty 23 N/m"


def test_other_questions_take_the_value():
    stated, record = Estimate.stated("mass", (2.42, 0.02), "kg"), slider()
    checks = [ss.consistent.consistency(ss.friction_force(record, **RIG), mass=mass) for mass in (2.42, stated)]
    assert str(checks[0]) == str(checks[1])
    assert record.rig is None
    row = {"mass": "2.42(2) kg", "stiffness": "2310 ± 5 N/m", "forcing frequency": 5.61, "base amplitude": "0.51 mm",
           "amplitude": "0.49 mm", "sliding friction": "1.06 N"}  # fmt: skip
    pairs = row | {"mass": (2.42, 0.02), "stiffness": (2310, 5)}
    assert str(ss.consistent.consistency(row)) == str(ss.consistent.consistency(pairs))
    case = ss.scenarios.get("THESIS compliant 2.5Hz fk=1.1 Ky=192000 z.0174(k+Ky)")
    rung = ss.simulate(case.system, cycles=8).record(fs=4000).between(1.0, 3.2)
    rings = [ss.contact.transition(rung, mass=mass, stiffness="2310 ± 5 N/m") for mass in (2.42, "2.42 ± 0.02 kg")]
    assert rings[0].stiffness == rings[1].stiffness


def measured(folder, **channels):
    (folder / "run.csv").write_text("t [s],acc [g],b [mm]\n0,1,2\n0.1,2,3\n0.2,1,4\n", "utf-8")
    return ss.read_record(folder / "run.csv", channels=channels)


@pytest.mark.parametrize(
    ("text", "sign"),
    [
        ("acc", "± 1 %"),
        ("acc [g]", "+- 1%"),
        ("acc [g]", "+/-1 %"),
        ("acc [V] @ 500 mV/g", "± 1 %"),
        ("2*acc", "+- 1 %"),
    ],
)
def test_a_channel_says_how_sure_its_gain_is(tmp_path, text, sign):
    exact, unsure = measured(tmp_path, a=text), measured(tmp_path, a=f"{text} {sign}")
    assert unsure.channels["a"] == replace(exact.channels["a"], gain_sd=0.01)
    assert np.array_equal(unsure["a"], exact["a"])


def test_a_minus_behind_a_plus_is_arithmetic(tmp_path):
    record = measured(tmp_path, q="b +- 1 [mm]", r="b +- 1 [mm] ± 2 %")
    assert np.allclose(record["q"], [0.001, 0.002, 0.003])
    assert np.array_equal(record["q"], record["r"])
    assert [record.channels[name].gain_sd for name in "qr"] == [0.0, 0.02]


@pytest.mark.parametrize(
    "text", ["acc [g] ± -1 %", "acc [g] ± 100 %", "acc [g] ± 0.1 g", "acc [g] ± nan %", "acc [g] ±", "acc ± x %"]
)
def test_a_gain_that_is_not_sure_by_a_part_of_it_is_one_sentence(tmp_path, text):
    with pytest.raises(RecordError, match=r"standard deviation, from 0 to 100 % of it; write it like"):
        measured(tmp_path, a=text)


def test_the_command_line_takes_it_and_the_results_tell_it(tmp_path):
    ss.write_record(slider(), tmp_path / "run.csv")
    constants = ["--mass", "2.42 ± 0.02 kg", "--stiffness", "2310 +- 5 N/m"]
    channels = ["--channels", "x=x [m] ± 1 %", "--channels", "z=z [m]", "--time", "time"]
    run = CliRunner().invoke(main, ["analyze", str(tmp_path / "run.csv"), "--json", *constants, *channels])
    assert json.loads(run.stdout)["settings"]["sd"] == SD
    wrong = CliRunner().invoke(main, ["analyze", str(tmp_path / "run.csv"), "--mass", "2.42 ± -0.02 kg"])
    assert wrong.exit_code == 2
    assert "finite and not negative" in wrong.output


def test_a_trial_says_once_that_constants_were_taken_as_exact():
    record, words = slider(), "with your constants exact"
    exact, unsure = (ss.analyze(record, **constants) for constants in ({"mass": 2.42, "stiffness": 2310}, RIG))
    tried = ss.tried(exact, twins=8)  # whose numbers serve for both: what is stated stands on the record
    both = (exact, tried, unsure, replace(tried, record=unsure.record))
    assert [sum(words in note for note in ss.summary(one).headline) for one in both] == [0, 1, 0, 0]
