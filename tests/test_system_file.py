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
from stickslip.scenarios import DRIVES, LAWS
from stickslip.system_file import UNITS, Case, read_system, scenario_case

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
        mass=2.42, stiffness=2310, damping=0.12, drive=case.system.drive,
        law=ss.CompliantContact(kinetic=1.1, stiffness=192000, damping=23.9),
    )  # fmt: skip
    assert isinstance(case.system.drive, ss.HarmonicBase)
    assert case.system.drive.amplitude == pytest.approx(0.65e-3, rel=1e-15)
    assert (case.name, case.run, case.fs, case.start) == ("slider", {"cycles": 40.0}, 4000.0, {"x": 1e-4})


def test_the_motion_is_that_of_the_same_system_in_python(tmp_path: Path) -> None:
    case = read_system(written(tmp_path, WHOLE.replace('"0.65 mm"', "0.65e-3")))
    law = ss.CompliantContact(kinetic=1.1, stiffness=192000, damping=23.9)
    drive = ss.HarmonicBase(0.65e-3, frequency=2.5)
    system = ss.Oscillator(mass=2.42, stiffness=2310, damping=0.12, law=law, drive=drive)
    assert ss.simulate(case.system, start=case.start, **case.run).events == ss.simulate(
        system, start={"x": 1e-4}, cycles=40
    ).events  # fmt: skip


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
        ("frequency = 2.5", "frequency = 1e12", ["line 14", "1e+09 times a second"]),
        (DRIVE, 'name = "Belt"\nspeed = 0', ["line 13", "a belt runs"]),
        (DRIVE, 'name = "MultiTone"\ntones = [[1e-3, 2.5, "9 N"]]', ["line 13", "drive.tones", "measured in rad"]),
        (DRIVE, 'name = "RecordedBase"\nrecord = "z.csv"', ["line 13", "channel"]),
        (DRIVE, 'name = "RecordedBase"\nsamples = [0, 1, 0, 1]\nfs = 3', ["[run]", "ends at 1 s"]),
        ('x = "0.1 mm"', "q = 1", ["line 16", "'start.q'", "known are x, v, anchor, mode"]),
        ('x = "0.1 mm"', 'mode = "flying"', ["line 16", "'microstuck'"]),
        ("cycles = 40", "cycles = -40", ["line 18", "greater than 0"]),
        ("cycles = 40", "cycles = 40\nduration = 3", ["line 17", "one of the two"]),
        ("[law]", "[laws]", ["line 6", "'laws'", "perhaps law is meant"]),
        ("[law]", "law", ["line 6", "not TOML"]),
    ],
)  # fmt: skip
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
        described = re.search(rf"^    {field.name}(?:, \w+)? : .*\n((?:        .*\n)+)", text, flags=re.MULTILINE)
        if number and described is not None:
            unit = re.search(r"\[([^\]]+)\]", described[1])  # none: a pure number
            assert UNITS.get(f"{name}.{field.name}", UNITS.get(field.name)) == (unit[1] if unit else None), field.name


def test_a_recorded_base_comes_from_a_file_beside(tmp_path: Path) -> None:
    time = np.arange(400) / 200
    z = 1e-3 * np.sin(2 * np.pi * time)
    ss.write_record(ss.Record.of({"plate": z}, fs=200, units={"plate": "m"}), tmp_path / "base.csv")
    text = WHOLE.replace(DRIVE, 'name = "RecordedBase"\nrecord = "base.csv"\nchannel = "plate [m]"')
    case = read_system(written(tmp_path, text.replace("cycles = 40", "")))
    drive = case.system.drive
    assert isinstance(drive, ss.RecordedBase)
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


def one_sentence(make: Callable[[], Case]) -> str | None:
    """None for a case, the sentence for a refusal; anything else fails the test."""
    try:
        make()
    except StickslipError as error:
        return str(error) if "\n" not in str(error) else "several lines"
    return None


KEYS = [(table, key) for table in ("system", "law", "drive", "start", "run") for key in ("name", "mass", "x", "cycles")]
VALUES = st.one_of(
    st.integers(), st.floats(), st.booleans(), st.text(max_size=5), st.lists(st.floats(), max_size=3),
    st.sampled_from(["Coulomb", "Belt", "ElastoSlip", "1 kg", "stuck"]),
)  # fmt: skip


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
