"""Mistakes in how a record or a rig is stated: the first line names each, and the command printed mends it."""

from __future__ import annotations

import functools
import html
import math
import os
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import stickslip as ss
from stickslip.cli.program import main
from stickslip.consistent.checks import Amplitudes, mixups

EXAMPLE = Path(__file__).parents[1] / "examples" / "rig.csv"
RIG = ("--mass", "2", "--stiffness", "3000", "--damping", "1")
HEADER = "t [s],x [m],z [m],a [m/s^2],load [N]"


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder of its own; the files lie in another."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    Path("data").mkdir()


@functools.cache
def motion() -> ss.Record:
    """A slider of 2 kg, 3000 N/m and 1 N s/m on 1.2 N of friction."""
    slider = ss.Oscillator(
        mass=2.0, stiffness=3000.0, damping=1.0, law=ss.laws.Coulomb(1.2), drive=ss.drives.HarmonicBase(2e-3, 4.0)
    )
    seen = ss.simulate(slider, duration=6.0).record(fs=1000).rows(2000, 6000)
    rng = np.random.default_rng(4)
    noise = {"x": 2e-7, "z": 2e-7, "a": 1e-3, "friction": 3e-3}
    return ss.Record.of({name: seen[name] + sd * rng.standard_normal(len(seen)) for name, sd in noise.items()}, fs=1000)


def written(header: str, *, delimiter: str = ",", rows: int | None = None, **factors: float) -> Path:
    """The motion in a file under that header, channels times these factors; `zero_a` is added to a."""
    seen, zeros = motion(), {key: factors.pop(key) for key in list(factors) if key.startswith("zero_")}
    columns = {
        "t": np.arange(len(seen)) / 1000,
        "x": seen["x"],
        "z": seen["z"],
        "a": seen["a"],
        "load": seen["friction"],
    }
    columns = {
        name: values * factors.get(name, 1.0) + zeros.get(f"zero_{name}", 0.0) for name, values in columns.items()
    }
    named = [cell.split()[0] for cell in header.split(",")]
    table = np.column_stack([columns[name] for name in named])[:rows]
    path = Path("data") / "run.csv"
    np.savetxt(path, table, delimiter=delimiter, header=header.replace(",", delimiter), comments="", fmt="%.9g")
    return path


def ask(*words: object) -> Result:
    return CliRunner().invoke(main, [*map(str, words), "--twins", "0"])


def first_line(result: Result) -> str:
    """The first sentence under the record's name, its lines joined; of an error that."""
    if not result.stdout:
        return result.stderr.splitlines()[0]
    lines = result.stdout.splitlines()[2:]
    return " ".join(lines[: lines.index("To mend it:")])


def command_in(result: Result) -> list[str]:
    lines = (result.stdout or result.stderr).splitlines()
    return shlex.split(lines[lines.index("To mend it:") + 1])


def mended(result: Result, **filled: str) -> str:
    """What the command that is printed prints, with what it leaves to be filled in."""
    words = [filled.get(word, word) for word in command_in(result)[1:]]
    answer = ask(*(word for word in words if word not in ("--twins", "0")))
    assert answer.exit_code == 0, answer.output
    assert "To mend it:" not in answer.stdout
    return answer.stdout


def right(told: str) -> bool:
    """Whether the answer is the rig's friction."""
    level = re.search(r"The contact slides against ([\d.]+) N of friction", told)
    return level is not None and float(level[1]) == pytest.approx(1.2, rel=0.01)


MISTAKES = {
    "k in N/mm": (HEADER, {}, ("--stiffness", "3"), "Probably the stiffness is in N/mm, not in N/m"),
    "k in N/mm, x and z alone": (
        "t [s],x [m],z [m]", {}, ("--stiffness", "3"), "Probably the stiffness is in N/mm, not in N/m"),
    "m in g": (HEADER, {}, ("--mass", "2000"), "Probably the mass is in g, not in kg"),
    "a in g": ("t [s],x [m],z [m],a [m/s^2]", {"a": 1 / 9.80665}, (), "Probably a is in g, not in m/s^2"),
    "sign of a": ("t [s],x [m],z [m],a [m/s^2]", {"a": -1}, (), "Probably a has the wrong sign"),
    "sign of load": ("t [s],x [m],z [m],load [N]", {"load": -1}, (), "Probably load has the wrong sign"),
    "time in ms": ("t [s],x [m],z [m],a [m/s^2]", {"t": 1e3}, (), "Probably the time is in ms, not in s"),
    "time in ms, x and z alone": ("t [s],x [m],z [m]", {"t": 1e3}, (), "Probably the time is in ms, not in s"),
    "x in mm": ("t [s],x [m],z [m],a [m/s^2]", {"x": 1e3}, (), "Probably x is in mm, not in m"),
    "x and z in mm": ("t [s],x [m],z [m],a [m/s^2]", {"x": 1e3, "z": 1e3}, (), "Probably x and z are in mm, not in m"),
    "x and z in mm, alone": ("t [s],x [m],z [m]", {"x": 1e3, "z": 1e3}, (), "Probably x and z are in mm, not in m"),
    "x and z in mm, with load": (
        "t [s],x [m],z [m],load [N]", {"x": 1e3, "z": 1e3}, (), "Probably x and z are in mm, not in m"),
    "x in mm, stated in um": (
        "t [s],x [um],z [mm],a [g]", {"x": 1e3, "z": 1e3, "a": 1 / 9.80665}, (), "Probably x is in mm, not in um"),
    "time in s, stated in ms": ("t [ms],x [m],z [m],a [m/s^2]", {}, (), "Probably the time is in s, not in ms"),
    "no units": ("t,x,z,a", {"x": 1e3, "z": 1e3}, (), "Probably x and z are in mm, not in m"),
    "zero of a": ("t [s],x [m],z [m],a [m/s^2]", {"zero_a": 0.7}, (), "The accelerometer's zero is off by 0.7 m/s^2"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_named_first_and_the_command_printed_mends_it(name: str) -> None:
    header, factors, stated, words = MISTAKES[name]
    result = ask("analyze", written(header, **factors), *RIG, *stated)
    assert first_line(result).startswith(words), result.output
    unanswered = name != "zero of a"
    assert ("until that is mended no force is given" in first_line(result)) == unanswered
    assert result.exit_code == unanswered, "a script learns of it"
    if name == "no units":  # those of a and t are still to be stated
        again = ask(*command_in(result)[1:])
        assert right(again.stdout)
        return
    assert right(mended(result))


def test_each_of_two_mistakes_that_look_alike_has_a_command() -> None:
    """Without a force a mass in g looks as a spring in N/mm does: the only command told friction of 1,200 N."""
    result = ask("analyze", written("t [s],x [m],z [m],a [m/s^2]"), *RIG, "--mass", "2000")
    assert "Probably the stiffness is in N/mm, not in N/m or the mass is in g, not in kg" in first_line(result)
    lines = result.stdout.splitlines()
    commands = [lines[lines.index(begin) + 1] for begin in ("To mend it:", "or:")]
    assert [right(ask(*shlex.split(command)[1:]).stdout) for command in commands] == [False, True]


@pytest.mark.parametrize("title", ["y", "frame", "Tisch"])
def test_a_column_that_is_called_as_a_base_is_proposed_as_one(title: str) -> None:
    path = written("t [s],x [mm],z [mm]", x=1e3, z=1e3)
    path.write_text(path.read_text().replace("z [mm]", f"{title} [mm]"))
    result = ask("analyze", path, *RIG)
    assert first_line(result).startswith(f"Probably {title} is the motion of the base, z: until"), result.output
    assert f"z={title} [mm]" in command_in(result)
    assert right(mended(result))


def test_what_moves_otherwise_than_the_mass_is_no_base() -> None:
    path = written("t [s],x [m],z [m]")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    for motion in (np.sin(40 * table[:, 0]), np.arange(len(table))):
        table[:, 2] = motion
        np.savetxt(path, table, delimiter=",", header="t [s],x [m],frame [m]", comments="")
        assert "is the motion of the base" not in ask("analyze", path, *RIG).output


def test_what_is_unsure_of_mounts_is_said_once() -> None:
    """The delay's own caution was repeated in a note, and the mounts that are not stated in another."""
    named = ["--channels", "x=plate [mm]", "--channels", "z=base [mm]", "--channels", "a=acc [g]"]
    told = " ".join(ask("analyze", EXAMPLE, *named, "--mass", "2.42", "--stiffness", "2310", "--all").stdout.split())
    for words in ("what a mount of a delays", "mounted is not stated"):
        assert told.count(words) == 1
    assert "no mount is stated" not in told


def test_check_names_what_analyze_names() -> None:
    """It found nothing wrong with a file of which analyze named a unit."""
    Path("rig.toml").write_text("mass = 2\nstiffness = 3000\ndamping = 1\n")
    path = written("t [s],x [um],z [mm],a [g]", x=1e3, z=1e3, a=1 / 9.80665)
    assert "Probably x is in mm, not in um" in " ".join(CliRunner().invoke(main, ["check", str(path)]).stdout.split())
    right_one = CliRunner().invoke(main, ["check", str(written("t [s],x [m],z [m],a [m/s^2]"))])
    assert "nothing wrong was found" in right_one.stdout


def test_units_that_two_slips_have_left_out_are_to_be_filled_in() -> None:
    """No single slip makes x and z in mm agree with an a in g: read as SI they told a friction a thousand times too
    large, and the command that was to mend it stated what could not be true."""
    scales = {"x": 1e3, "z": 1e3, "a": 1 / 9.80665}
    result = ask("analyze", written("t [s],x,z,a", **scales), *RIG)
    assert "The record contradicts itself: a is" in first_line(result), result.output
    assert "The contact slides against" not in result.stdout
    told = {"x=UNIT": "x=mm", "z=UNIT": "z=mm", "a=UNIT": "a=g"}
    assert right(mended(result, **told))


def test_a_unit_that_nobody_knows_is_named() -> None:
    result = ask("analyze", written("t [s],x [foo],z [mm],a [g]"), *RIG)
    assert result.exit_code == 1
    assert "'foo' is no unit that is known" in result.stderr


def test_a_command_that_mends_keeps_where_files_lie_and_results_go() -> None:
    path = written("t [s],x [m],z [m],a [m/s^2]", x=1e3).resolve()
    result = CliRunner().invoke(main, ["analyze", str(path), *RIG, "--twins=0", "--output", "results"])
    command = command_in(result)
    assert command[2] == str(path)
    assert "--twins=0" in command
    assert command[command.index("--output") + 1] == "results"


@pytest.mark.parametrize("question", ["analyze", "fit", "decay"])
def test_columns_that_nobody_named_are_asked_for(question: str) -> None:
    """The refusal named an option to fill in; `init` knows a "Weg Schlitten" for a displacement itself."""
    path = written("t [s],x [m],z [m]")
    text = path.read_text().replace("x [m],z [m]", "Weg Schlitten [m],Weg Tisch [m]")
    path.write_text(text)
    result = CliRunner().invoke(main, [question, str(path), *(RIG if question != "decay" else ())])
    assert result.exit_code == 1
    command = command_in(result)
    assert command == ["stickslip", "init", str(path)]
    assert CliRunner().invoke(main, [*command[1:], "--yes", *RIG]).exit_code == 0
    assert right(ask("analyze", path).stdout)


def unnamed(path: Path) -> Path:
    path.write_text(written("t [s],x [m],z [m]").read_text().replace("x [m],z [m]", "Weg Schlitten [m],Weg Tisch [m]"))
    return path


def test_columns_are_asked_of_the_files_of_the_command_alone() -> None:
    """A file called like the command, and the file of the rig, were taken for records."""
    Path("analyze").write_text("notes")
    unnamed(Path("run.csv"))
    assert command_in(CliRunner().invoke(main, ["analyze", "run.csv", *RIG])) == ["stickslip", "init", "run.csv"]
    assert command_in(CliRunner().invoke(main, ["analyze", "r*.csv", *RIG])) == ["stickslip", "init", "r*.csv"]


@pytest.mark.parametrize("config", ["my.toml", "rig.toml"])
def test_columns_go_beside_what_a_file_states_of_the_rig(config: str) -> None:
    Path(config).write_text(
        'mass = "2 ± 0.01 kg"\nstiffness = 3000\ndamping = 1\ndamper = "ground"\ncontact = "ground"\n'
    )
    unnamed(Path("run.csv"))
    asked = ["analyze", "run.csv", *(["--config", config] if config == "my.toml" else [])]
    command = command_in(CliRunner().invoke(main, asked))
    init = CliRunner().invoke(main, command[1:], input=5 * "\n")
    assert init.exit_code == 0, init.output
    assert "Mass that moves" not in init.output, "it is stated"
    first = next(line for line in init.stdout.splitlines() if line.startswith("Next: "))
    assert right(ask(*shlex.split(first.removeprefix("Next: stickslip "))).stdout)
    assert ss.rig.read_rig(command[-1]).mass.sd == pytest.approx(0.01)
    assert "To mend it:" not in CliRunner().invoke(main, asked).stderr, "that file is there now"


def test_a_rig_that_names_other_columns_is_not_mended_by_asking() -> None:
    Path("rig.toml").write_text('[channels]\nlift = "`Weg Tisch` [m]"\n')
    unnamed(Path("run.csv"))
    assert "To mend it:" not in CliRunner().invoke(main, ["analyze", "run.csv", *RIG]).stderr


def test_page_and_python_each_name_their_own_options(tmp_path: Path) -> None:
    path = written("t,x [m],z [m],a [m/s^2]")
    ask("analyze", path, *RIG, "--output", tmp_path / "out")
    page = html.unescape((tmp_path / "out" / "report.html").read_text("utf-8"))
    findings = ss.analyze(ss.read_record(path), mass=2.0, stiffness=3000.0, damping=1.0)
    own = html.unescape(ss.report(findings, tmp_path / "own.html").read_text("utf-8"))
    assert '--time "t [ms]"' in page
    assert 'time="t [ms]"' in own
    assert 'time="t [ms]"' not in page


@pytest.mark.parametrize(("one", "other"), [("x", "a"), ("x", "z")])
def test_exchanged_columns(one: str, other: str) -> None:
    header = "t [s],x [m],z [m],a [m/s^2]"
    path = written(header)
    turned = {one: other, other: one}
    named = [turned.get(cell.split()[0], cell.split()[0]) for cell in header.split(",")]
    units = {"t": "s", "x": "m", "z": "m", "a": "m/s^2"}
    text = path.read_text().splitlines()
    path.write_text("\n".join([",".join(f"{name} [{units[name]}]" for name in named), *text[1:]]))
    result = ask("analyze", path, *RIG)
    assert first_line(result).startswith(f"Probably {one} and {other} are exchanged"), result.output
    assert right(mended(result))


def test_units_left_out_are_asked_for_by_a_command_that_states_those_taken() -> None:
    result = ask("analyze", written("t,x,z,load"), *RIG)
    assert first_line(result).startswith("t states no unit: read as s")
    assert right(mended(result))


def test_a_delay_without_its_unit() -> None:
    Path("rig.toml").write_text("mass = 2\nstiffness = 3000\ndamping = 1\n[sensors.a]\ndelay = 3\n")
    result = ask("analyze", written("t [s],x [m],z [m],a [m/s^2]"), "--config", "rig.toml")
    assert first_line(result).startswith("Probably the delay of a, 3 s"), result.output
    assert "a.delay=0.003" in command_in(result)


@pytest.mark.parametrize("stated", ["mass", "stiffness"])
def test_a_constant_that_is_missing(stated: str) -> None:
    other, unit, value = {"mass": ("stiffness", "N/m", "3000"), "stiffness": ("mass", "kg", "2")}[stated]
    known = {"mass": "2", "stiffness": "3000"}[stated]
    result = ask("analyze", written("t [s],x [m],z [m]"), f"--{stated}", known)
    assert first_line(result).startswith(f"The {other} is missing: "), result.output
    assert command_in(result)[-2:] == [f"--{other}", f"VALUE {unit}"]
    assert "The contact slides against" in mended(result, **{f"VALUE {unit}": f"{value} {unit}"})


@pytest.mark.parametrize(("delimiter", "stated"), [(";", ","), (",", ";")])
def test_a_wrong_delimiter(delimiter: str, stated: str) -> None:
    result = ask("analyze", written("t [s],x [m],z [m]", delimiter=delimiter), *RIG, "--delimiter", stated)
    assert result.exit_code == 1
    assert first_line(result).startswith(f"stickslip: the delimiter '{stated}' does not fit 'run.csv'")
    assert right(mended(result))


def test_nineteen_samples() -> None:
    result = ask("analyze", written("t [s],x [m],z [m]"), *RIG, "--rows", "0:19")
    assert result.exit_code == 1
    assert first_line(result).startswith("stickslip: run.csv is too short: 19 samples")
    assert right(mended(result))
    result = ask("analyze", written("t [s],x [m],z [m]", rows=19), *RIG)
    assert "is too short: 19 samples" in result.stderr
    assert "To mend it:" not in result.stderr, "nothing but a longer record does"


def decayed(factor: float, *, mass: float = 0.0, clock: float = 1.0) -> Path:
    """A pendulum of 1.3 Hz that dies away, from 0.3 rad."""
    time = np.arange(1600) / 200
    turn = 2 * math.pi * 1.3 * time
    angle = 0.3 * np.exp(-0.02 * turn) * np.cos(turn) + 1e-4 * np.random.default_rng(1).standard_normal(time.size)
    path = Path("data") / "release.csv"
    header = "t [s],theta [rad]"
    np.savetxt(path, np.column_stack([clock * time, factor * angle]), delimiter=",", header=header, comments="")
    return path


def test_an_angle_in_degrees() -> None:
    result = CliRunner().invoke(main, ["decay", str(decayed(180 / math.pi)), "--method", "thesis"])
    assert first_line(result).startswith("Probably theta, which swings "), result.output
    assert "is in degrees, not in rad" in first_line(result)
    words = command_in(result)
    told = CliRunner().invoke(main, words[1:])
    assert "a damping ratio of 0.0" in told.stdout
    assert "To mend it:" not in told.stdout


def test_a_frequency_that_mass_and_stiffness_contradict_by_a_thousand() -> None:
    stiffness = 0.5 * (2 * math.pi * 1.3) ** 2
    asked = ["decay", str(decayed(1.0)), "--method", "thesis", "--mass", "0.5", "--stiffness", str(stiffness / 1e3)]
    result = CliRunner().invoke(main, asked)
    assert first_line(result).startswith("Probably the stiffness is in N/mm, not in N/m"), result.output
    told = CliRunner().invoke(main, command_in(result)[1:])
    assert "To mend it:" not in told.stdout


@pytest.mark.parametrize("seed", range(int(os.environ.get("STICKSLIP_DRAWS", "2"))))
def test_no_correct_rig_is_called_a_mistake(seed: int) -> None:
    """Sliders, sticking ones, elastic contacts that slip or never do, over rigs and drives of all sizes."""
    rng, named, tried = np.random.default_rng(1000 + seed), 0, 0
    for _ in range(60):
        balance = _correct(rng)
        found = mixups(balance, failing=False)
        tried, named = tried + 1, named + bool(found)
    assert tried == 60
    assert named == 0


def _correct(rng: np.random.Generator) -> Amplitudes:
    """The strongest lines of a rig whose constants are known to 2 %, its gains to 1 %."""
    mass, own, r = 10 ** rng.uniform(-2, 2), 10 ** rng.uniform(-0.3, 2.3), 10 ** rng.uniform(-1.3, 0.7)
    stiffness, frequency, base = mass * (2 * math.pi * own) ** 2, r * own, 10 ** rng.uniform(-6, -2)
    critical = 2 * math.sqrt(stiffness * mass)
    damping = critical * 10 ** rng.uniform(-4, -0.7)
    friction = 10 ** rng.uniform(-2, 0) * stiffness * base * min(1, abs(1 - r * r) + 0.2)
    soft = {"stiffness": stiffness * 10 ** rng.uniform(0, 3), "damping": 0.025 * critical}
    law = [
        ss.laws.Coulomb(friction),
        ss.laws.Coulomb(friction, static=1.3 * friction),
        ss.laws.CompliantContact(friction, **soft),
        ss.laws.CompliantContact(5 * stiffness * base, **soft),
    ][rng.integers(4)]
    drive = ss.drives.HarmonicBase(base, frequency)
    slider = ss.Oscillator(mass=mass, stiffness=stiffness, damping=damping, law=law, drive=drive)
    time = (np.arange(1024) / 256 + 35) / frequency
    seen = ss.simulate(slider, cycles=40).sample(time, ("x", "z"))[0]
    lines = seen @ np.exp(-2j * np.pi * frequency * time) * 2 / time.size
    x, z = (complex(line) * (1 + 0.01 * rng.standard_normal()) for line in lines)
    known = {
        "mass": mass * (1 + 0.02 * rng.standard_normal()),
        "stiffness": stiffness * (1 + 0.02 * rng.standard_normal()),
    }
    return Amplitudes({"x": x, "z": z}, 2 * math.pi * frequency, known, "ground", 0.01)


def test_a_spring_in_newtons_a_millimetre_is_named_of_a_rig_that_sticks_below_its_resonance() -> None:
    law = ss.laws.Stribeck(2.1, static=2.9, speed=0.01)
    slider = ss.Oscillator(
        mass=1.8, stiffness=3200, damping=0.5, law=law, drive=ss.drives.HarmonicBase(4e-3, frequency=3.0)
    )
    record = ss.Rig.perfect("x", "z", "a").measure(ss.simulate(slider, duration=5.0), fs=1000, rng=1, start=2.0)
    for constants, wrong in (({"stiffness": 3.2}, "stiffness"), ({"mass": 1800.0}, "mass")):
        findings = ss.analyze(record, **{"mass": 1.8, "stiffness": 3200.0, "damping": 0.5, **constants})
        assert wrong in findings.contradiction
        assert "N" not in {estimate.unit for estimate in findings.quoted}
    assert ss.analyze(record, mass=1.8, stiffness=3200.0, damping=0.5).contradiction == ""


def test_no_force_stands_in_the_table_where_what_it_rests_on_was_stated_wrongly() -> None:
    path = written("t [s],x [m],z [m],a [m/s^2]", a=1 / 9.80665)
    answer = ask("analyze", path, *RIG)
    assert "until that is mended no force is given" in " ".join(answer.stdout.split())
    assert "sliding friction" not in answer.stdout
    assert "sliding friction" in mended(answer)


@pytest.mark.figures
def test_no_force_is_drawn_where_none_is_given(tmp_path: Path) -> None:
    """Under "no force is given" the page drew friction in kN."""
    path = written("t [s],x [m],z [m],a [m/s^2]", x=1e3, z=1e3)
    ask("analyze", path, *RIG, "--output", tmp_path / "out")
    names = {picture.stem for picture in (tmp_path / "out").rglob("*.svg")}
    assert "record" in names
    assert not names & {"friction-velocity", "friction-displacement", "force-balance", "regression"}
    drawn = "".join(picture.read_text("utf-8") for picture in (tmp_path / "out").rglob("*.svg"))
    assert "friction" not in drawn
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert '"name":"friction"' not in page.replace(": ", ":")


def test_a_unit_that_ends_a_columns_name_is_read() -> None:
    path = Path("data") / "run.csv"
    seen = motion()
    table = np.column_stack([1e3 * np.arange(len(seen)) / 1000, 1e6 * seen["x"], 1e6 * seen["z"]])
    np.savetxt(path, table, delimiter=";", header="Zeit_ms;Weg_um;Tisch_um", comments="", fmt="%.9g")
    answer = ask("analyze", path, "--channels", "x=Weg_um", "--channels", "z=Tisch_um", *RIG)
    assert "no unit" not in answer.stdout
    assert right(" ".join(answer.stdout.split()))


def test_a_mass_that_friction_carries_on_a_shaken_table_is_stated_rightly() -> None:
    slider = ss.Oscillator(
        mass=1.0, stiffness=4.0, law=ss.laws.Coulomb(1.5), drive=ss.drives.HarmonicBase(4e-3, 5.0, contact="base")
    )
    record = ss.Rig.perfect("x", "z").measure(ss.simulate(slider, duration=6.0), fs=1000, rng=1, start=3.0)
    assert ss.analyze(record, mass=1.0, stiffness=4.0, contact="base").contradiction == ""


@pytest.mark.parametrize(
    ("channels", "stiffness", "mended"),
    [
        (["x=plate [mm]", "z=base [mm]", "a=acc * -1 [g]"], "2310", "a=-1 * (acc * -1) [g]"),
        (["x=plate [mm]", "z=base [mm]"], "2.31", "--stiffness 2310"),
        (["z=plate [mm]", "x=base [mm]", "a=acc [g]"], "2310", "x=plate [mm]"),
    ],
)
def test_a_fit_names_the_mistake_and_the_command_that_mends_it(channels, stiffness, mended, tmp_path) -> None:
    named = [word for channel in channels for word in ("--channels", channel)]
    rig = ["--mass", "2.42", "--stiffness", stiffness, "--damping", "0.12", "--laws", "Coulomb"]
    asked = ["fit", str(EXAMPLE), "--rows", "0:2000", *named, *rig, "--output", str(tmp_path / "fit")]
    ran = CliRunner().invoke(main, asked)
    assert "probably" in ran.output.lower()
    assert mended in ran.output.replace("\n", " ")
