"""A system in TOML: what is read, in which units, and how a mistake is told."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import stickslip as ss
from stickslip.errors import ModelError, StickslipError
from stickslip.parameters import declaration
from stickslip.scenarios import DRIVES, LAWS
from stickslip.systems.file import Case, read_system, scenario_case

WHOLE = """about = "a slider on a driven base"
[system]
mass = "2.42 kg"
stiffness = "2.31 N/mm"
damping = 0.12
[law]
name = "CompliantContact"
kinetic = 1.1
stiffness = 192000
damping = 23.9
[drive]
name = "HarmonicBase"
amplitude = "0.65 mm"
frequency = 2.5
[start]
x = "0.1 mm"
[run]
cycles = 40
fs = "4 kHz"
"""
DRIVE = 'name = "HarmonicBase"\namplitude = "0.65 mm"\nfrequency = 2.5'


def written(folder: Path, text: str) -> Path:
    path = folder / "slider.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_whole_file_is_read_into_si(tmp_path: Path) -> None:
    case = read_system(written(tmp_path, WHOLE))
    assert case.system == ss.Oscillator(
        mass=2.42,
        stiffness=2310,
        damping=0.12,
        drive=case.system.drive,
        law=ss.laws.CompliantContact(kinetic=1.1, stiffness=192000, damping=23.9),
    )
    assert isinstance(case.system.drive, ss.drives.HarmonicBase)
    assert case.system.drive.amplitude == pytest.approx(0.65e-3, rel=1e-15)
    assert (case.name, case.run, case.fs, case.start) == ("slider", {"cycles": 40.0}, 4000.0, {"x": 1e-4})


def test_the_motion_is_that_of_the_same_system_in_python(tmp_path: Path) -> None:
    case = read_system(written(tmp_path, WHOLE.replace('"0.65 mm"', "0.65e-3")))
    law = ss.laws.CompliantContact(kinetic=1.1, stiffness=192000, damping=23.9)
    drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
    system = ss.Oscillator(mass=2.42, stiffness=2310, damping=0.12, law=law, drive=drive)
    assert (
        ss.simulate(case.system, start=case.start, **case.run).events
        == ss.simulate(system, start={"x": 1e-4}, cycles=40).events
    )


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('mass = "2.42 kg"', 'mas = "2.42 kg"', ["line 3", "'system.mas'", "known are mass,", "perhaps mass is meant"]),
        ('mass = "2.42 kg"', 'mass = "-2.42 kg"', ["line 3", "system.mass", "greater than 0"]),
        ('mass = "2.42 kg"', 'mass = "2.42 N"', ["line 3", "measured in kg"]),
        ('mass = "2.42 kg"', "", ["line 2", "no system.mass"]),
        ('mass = "2.42 kg"', "mass = nan", ["line 3", "not a finite number"]),
        ("damping = 0.12", "damping = .12", ["line 5", "write 0.12"]),
        ("damping = 0.12", 'damper = "roof"', ["line 5", "'ground' or 'base'"]),
        ("kinetic = 1.1", "kinetic = -1.1", ["line 8", "kinetic = -1.1 N", "not negative"]),
        ("kinetic = 1.1", "kinetc = 1.1", ["line 8", "'law.kinetc'", "perhaps kinetic is meant"]),
        ("stiffness = 192000", 'stiffness = "192 m"', ["line 9", "law.stiffness", "measured in N/m"]),
        ("damping = 23.9", "static = 0.5", ["line 10", "below kinetic"]),
        ('"CompliantContact"', '"CompliantContacts"', ["line 7", "perhaps CompliantContact is meant"]),
        ('"CompliantContact"', "[1]", ["line 7", "a law is one of Coulomb,"]),
        ('name = "HarmonicBase"\n', "", ["line 11", "no drive.name", "Belt"]),
        ("frequency = 2.5", "frequency = 1e12", ["line 14", "1e+10 times a second"]),
        (DRIVE, 'name = "Belt"\nspeed = 0', ["line 13", "a belt runs"]),
        (DRIVE, 'name = "MultiTone"\ntones = [[1e-3, 2.5, "9 N"]]', ["line 13", "drive.tones", "measured in rad"]),
        (DRIVE, 'name = "Recorded"\nrecord = "z.csv"', ["line 13", "channel"]),
        (DRIVE, 'name = "Recorded"\nsamples = [0, 1, 0, 1]\nfs = 3', ["[run]", "ends at 1 s"]),
        ('x = "0.1 mm"', "q = 1", ["line 16", "'start.q'", "known are x, v, anchor, mode"]),
        ('x = "0.1 mm"', 'mode = "flying"', ["line 16", "'microstuck'"]),
        ("cycles = 40", "cycles = -40", ["line 18", "greater than 0"]),
        ("cycles = 40", "cycles = 1e15", ["line 18", "less than or equal to 1000000000"]),
        ("cycles = 40", "cycles = 40\nduration = 3", ["line 17", "one of the two"]),
        ("[law]", "[laws]", ["line 6", "'laws'", "perhaps law is meant"]),
        ("[law]", "law", ["line 6", "not TOML"]),
    ],
)
def test_a_mistake_is_one_sentence_that_names_the_line(tmp_path: Path, old: str, new: str, told: list[str]) -> None:
    assert old in WHOLE
    with pytest.raises(ModelError) as caught:
        read_system(written(tmp_path, WHOLE.replace(old, new, 1)))
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert sentence.startswith("slider.toml")
    assert all(part in sentence for part in told), sentence
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("name", [*LAWS, *DRIVES])
def test_every_parameter_is_read_in_the_unit_of_its_docstring(name: str) -> None:
    factory = {**LAWS, **DRIVES}[name]
    assert isinstance(factory, type)
    text = factory.__doc__ or ""
    for field in dataclasses.fields(factory):
        number = str(field.type) in ("float", "float | None", "Sequence[float]")
        described = re.search(rf"^{field.name} : .*\n((?:    .*\n)+)", text, flags=re.MULTILINE)
        if number and described is not None:
            unit = re.search(r"\[([^\]]+)\]", described[1])  # none: a pure number
            assert declaration(field).unit == (unit[1] if unit else "1"), field.name


def test_a_tone_goes_on_top_of_a_drive(tmp_path: Path) -> None:
    inner = 'drive = { name = "Belt", speed = "100 mm/s" }\n'
    outer = 'name = "Dithered"\namplitude = 5e-6\nfrequency = 200\n'
    case = read_system(written(tmp_path, WHOLE.replace(DRIVE, outer + inner)))
    assert case.system.drive == ss.drives.Dithered(ss.drives.Belt(0.1), amplitude=5e-6, frequency=200.0)
    with pytest.raises(ModelError, match="a drive within a drive is a table"):
        read_system(written(tmp_path, WHOLE.replace(DRIVE, outer + 'drive = "Belt"\n')))


def test_a_recorded_base_comes_from_a_file_beside(tmp_path: Path) -> None:
    time = np.arange(400) / 200
    z = 1e-3 * np.sin(2 * np.pi * time)
    ss.write_record(ss.Record.of({"plate": z}, fs=200, units={"plate": "m"}), tmp_path / "base.csv")
    text = WHOLE.replace(DRIVE, 'name = "Recorded"\nrecord = "base.csv"\nchannel = "plate [m]"')
    case = read_system(written(tmp_path, text.replace("cycles = 40", "")))
    drive = case.system.drive
    assert isinstance(drive, ss.drives.Recorded)
    assert drive.fs == 200
    assert np.array_equal(np.asarray(drive.samples), z)
    assert case.run == {"duration": 399 / 200}, "as long as the record"


def test_other_values_are_checked_as_those_of_a_file(tmp_path: Path) -> None:
    case = read_system(written(tmp_path, WHOLE))
    other = case.having(kinetic="1.3 N", amplitude="1 mm", mass=3)
    assert (other.system.law.kinetic, other.system.drive.amplitude, other.system.mass) == (1.3, 1e-3, 3.0)  # type: ignore[attr-defined]
    assert case.lasting(duration="2 min").run == {"duration": 120.0}
    for change in ({"kinetik": 1}, {"kinetic": "3 s"}, {"kinetic": -1}, {"law": "Coulomb"}):
        with pytest.raises(ModelError, match=r"kinetic|law"):
            case.having(**change)
    for time in ({"duration": 1, "cycles": 2}, {"duration": "1 m"}, {"cycles": 0}):
        with pytest.raises(ModelError, match=r"the two|measured in s|greater than 0"):
            case.lasting(**time)


def test_a_scenario_is_a_case_with_its_known_answers() -> None:
    case = scenario_case("FD-4")
    assert (case.start, case.known["rest"]) == ({"x": 1.25}, 0.25)
    assert not case.having(kinetic=0.9).known, "another system has other answers"
    with pytest.raises(ModelError, match="perhaps FD-"):
        scenario_case("FD")


TWO = """[system]
mass = [[1.3, 0], [0, "700 g"]]
damping = [[0.05, 0], [0, 0.05]]
stiffness = [[3.0, -1.3], [-1.3, 2.9]]
acts_on = [1, 0]
[[contacts]]
tangent = [1, 0]
[contacts.law]
name = "CompliantContact"
kinetic = "0.5 N"
stiffness = 50
[[contacts]]
tangent = [-1, 1]
normal = [0, 1]
stiffness = "2 N/m"
preload = 5
law = { name = "Coulomb", kinetic = 0.2, static = 0.3 }
[drive]
name = "HarmonicForce"
amplitude = 1.2
frequency = 0.13
[start]
x2 = 0.1
anchor1 = 0.0
"""


def test_a_structure_is_read_as_python_makes_it(tmp_path: Path) -> None:
    case = read_system(written(tmp_path, TWO))
    pads = [
        ss.Contact(ss.laws.CompliantContact(0.5, stiffness=50.0), [1, 0]),
        ss.Contact(ss.laws.Coulomb(0.2, static=0.3), [-1, 1], normal=[0, 1], stiffness=2.0, preload=5.0),
    ]
    system = ss.Structure(
        np.diag([1.3, 700 * 1e-3]),
        np.diag([0.05, 0.05]),
        [[3.0, -1.3], [-1.3, 2.9]],
        contacts=pads,
        acts_on=[1, 0],
        drive=ss.drives.HarmonicForce(1.2, frequency=0.13),
    )
    assert isinstance(case.system, ss.Structure)
    assert (case.start, case.run) == ({"x2": 0.1, "anchor1": 0.0}, {"cycles": 20.0})
    run = ss.simulate(case.system, start=case.start, **case.run)
    known = ss.simulate(system, start={"x2": 0.1, "anchor1": 0.0}, cycles=20)
    assert len(known.events) > 50
    assert run.events == known.events


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"700 g"', '"700 N"', ["line 2", "system.mass", "measured in kg"]),
        ('"700 g"', "-1", ["line 2", "positive definite"]),
        ('[0, "700 g"]', "[0]", ["line 2", "rows of equal length"]),
        ("[[3.0, -1.3], [-1.3, 2.9]]", "3", ["line 4", "system.stiffness", "it should be a list"]),
        ("tangent = [-1, 1]", "tangent = [-1, 1, 0]", ["tangent of 3 numbers"]),
        ("tangent = [-1, 1]", "tangents = [-1, 1]", ["line 13", "contacts.2.tangents", "perhaps tangent is meant"]),
        ("stiffness = 50", "stiffness = 50\nstatik = 3", ["line 12", "contacts.1.law.statik", "perhaps static"]),
        ("kinetic = 0.2", "kinetic = -0.2", ["line 17", "kinetic = -0.2 N"]),
        ("preload = 5", "preload = nan", ["line 16", "contacts.2.preload", "not a finite number"]),
        ('"Coulomb"', '"Stribeck", speed = -1', ["speed = -1"]),
        ("[drive]", "[law]\nname = 'Coulomb'\n[drive]", ["line 18", "each contact of a structure has its own"]),
        ("x2 = 0.1", "x3 = 0.1", ["line 23", "known are x1, x2, v1, v2, anchor1, mode"]),
    ],
)
def test_a_mistake_in_a_structure_is_told_alike(tmp_path: Path, old: str, new: str, told: list[str]) -> None:
    assert old in TWO
    with pytest.raises(ModelError) as caught:
        read_system(written(tmp_path, TWO.replace(old, new, 1)))
    assert "\n" not in str(caught.value)
    assert all(part in str(caught.value) for part in told), str(caught.value)


def test_one_contact_of_several_is_changed_by_its_place(tmp_path: Path) -> None:
    case = read_system(written(tmp_path, TWO))
    other = case.having(**{"contacts.2.law.kinetic": "0.1 N", "damper": "base"}).system
    assert isinstance(other, ss.Structure)
    assert [contact.law.kinetic for contact in other.contacts] == [0.5, 0.1]  # type: ignore[attr-defined]
    assert [c.law.kinetic for c in case.having(kinetic=0.3).system.contacts] == [0.3, 0.3]  # type: ignore[attr-defined, union-attr]
    for change in ({"stiffness": 3}, {"contacts.3.preload": 2}, {"kinetic": "1 m"}, {"acts_on": 2}, {"contacts": 1}):
        with pytest.raises(ModelError, match=r"stiffness|contacts|kinetic|acts_on"):
            case.having(**change)


LAW = '[law]\nname = "CompliantContact"\nkinetic = 1.1\nstiffness = 192000\ndamping = 23.9\n'


def test_a_law_behind_a_compliant_contact_is_a_table_within(tmp_path: Path) -> None:
    inner = 'name = "LinearSlope"\nkinetic = 1.1\nslope = -5\n'
    outer = '[law]\nname = "InSeries"\nstiffness = 192000\ndamping = 24\n[law.law]\n'
    text = WHOLE.replace(LAW, outer + inner)
    law = ss.laws.InSeries(ss.laws.LinearSlope(1.1, slope=-5.0), stiffness=192000.0, damping=24.0)
    case = read_system(written(tmp_path, text))
    assert case.system.law == law  # type: ignore[union-attr]
    changed = case.having(**{"law.stiffness": "1 N/um", "slope": -4}).system
    assert changed.law == ss.laws.InSeries(ss.laws.LinearSlope(1.1, slope=-4.0), stiffness=1e6, damping=24.0)  # type: ignore[union-attr]
    for old, new, told in (
        ("slope = -5", "slop = -5", "law.law.slop"),
        ("slope = -5", "slope = -50", "raise damping"),
        ('name = "LinearSlope"', 'name = "Linear"', "line 11,"),
    ):
        with pytest.raises(ModelError, match=told):
            read_system(written(tmp_path, text.replace(old, new)))


def test_a_law_with_a_time_lag_holds_its_curve(tmp_path: Path) -> None:
    text = '[law]\nname = "TimeDelay"\nlag = "1 ms"\nlaw = { name = "LinearSlope", kinetic = 1.1, slope = 2 }\n'
    system = read_system(written(tmp_path, WHOLE.replace(LAW, text))).system
    assert system.law == ss.laws.TimeDelay(ss.laws.LinearSlope(1.1, slope=2.0), lag=1e-3)  # type: ignore[union-attr]


def test_a_curve_is_a_formula_of_the_speed(tmp_path: Path) -> None:
    text = WHOLE.replace(LAW, '[law]\nname = "FrictionCurve"\ncurve = "3 / (1 + 1.42 * v) + 1 + 0.1 * v**2"\n')
    law = read_system(written(tmp_path, text)).system.law  # type: ignore[union-attr]
    assert isinstance(law, ss.laws.FrictionCurve)
    assert law.friction(0.7) == pytest.approx(3 / (1 + 1.42 * 0.7) + 1 + 0.1 * 0.49, rel=1e-15)
    for curve, told in (
        ("1 / v", "no value at rest"),
        ("v^2", r"has '\^'"),
        ("w", "has 'w'"),
        ("1 +", "read"),
        ("__import__('os')", "has"),
        ("v ** v", "has"),
        ("9**9**9**9", "has no value"),
        ("1" * 400, "400"),
    ):
        with pytest.raises(ModelError, match=f"(?s)line 8.*{told}"):
            read_system(written(tmp_path, text.replace("3 / (1 + 1.42 * v) + 1 + 0.1 * v**2", curve)))


def one_sentence(make: Callable[[], Case]) -> str | None:
    """None for a case, the sentence for a refusal; anything else fails the test."""
    try:
        make()
    except StickslipError as error:
        return str(error) if "\n" not in str(error) else "several lines"
    return None


KEYS = [(table, key) for table in ("system", "law", "drive", "start", "run") for key in ("name", "mass", "x", "cycles")]
VALUES = st.one_of(
    st.integers(),
    st.floats(),
    st.booleans(),
    st.text(max_size=5),
    st.lists(st.floats(), max_size=3),
    st.sampled_from(["Coulomb", "Belt", "ElastoSlip", "1 kg", "stuck"]),
)


@settings(suppress_health_check=[HealthCheck.too_slow])  # the first case compiles the engine
@given(st.dictionaries(st.sampled_from(KEYS), VALUES, max_size=6))
def test_any_values_give_a_system_or_one_sentence(
    tmp_path_factory: pytest.TempPathFactory, values: dict[tuple[str, str], object]
) -> None:
    def as_toml(value: object) -> str:
        if isinstance(value, float) and not math.isfinite(value):
            return str(value)
        if isinstance(value, list):
            return f"[{', '.join(map(as_toml, value))}]"
        return str(value).lower() if isinstance(value, bool) else repr(value)

    tables: dict[str, str] = {}
    for (table, key), value in values.items():
        tables[table] = tables.get(table, "") + f"{key} = {as_toml(value)}\n"
    text = "\n".join(f"[{table}]\n{body}" for table, body in tables.items())
    path = tmp_path_factory.mktemp("any") / "any.toml"
    path.write_text(text, encoding="utf-8", errors="replace")
    refused = one_sentence(lambda: read_system(path))
    assert refused is None or refused.startswith("any.toml")


@pytest.mark.parametrize(
    ("law", "start", "value"),
    [
        ("name = 'LuGre', kinetic = 1, static = 1.5, speed = 1e-3, stiffness = 1e5", "bristle = '2 um'", 2e-6),
        ("name = 'Dahl', kinetic = 1, stiffness = 1e5", "force_state = '300 mN'", 0.3),
        (
            "name = 'InSeries', stiffness = 1e5, law = {name = 'StateVariable', kinetic = 1, rate = 100}",
            "theta = '0.2 N'",
            0.2,
        ),
    ],
)
def test_what_a_law_remembers_is_given_in_its_unit(tmp_path: Path, law: str, start: str, value: float) -> None:
    text = f"system = {{mass = 1, stiffness = 4}}\nlaw = {{{law}}}\nstart = {{{start}}}\nrun = {{duration = 1}}\n"
    assert read_system(written(tmp_path, text)).start == {start.split()[0]: value}
