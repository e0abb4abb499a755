"""Planning an experiment: the errors are those of the estimators, and the least setup that is enough is found."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

import stickslip as ss
from stickslip.cli.program import main
from stickslip.errors import ModelError

SLIDER = """
system = { mass = "2.42 kg", stiffness = 2310, damping = 0.12 }
law = { name = "CompliantContact", kinetic = 1.1, stiffness = 192000, damping = 23.9 }
[drive]
name = "HarmonicBase"
amplitude = 0.65e-3
frequency = 2.5
[run]
cycles = 8
"""


@cache
def run() -> ss.solve.Trajectory:
    contact = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
    return ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, damping=0.12, law=contact, drive=drive), cycles=8)


@cache
def plan() -> ss.answers.ExperimentPlan:
    return ss.answers.plan_experiment(run(), rates=(2000, 500), draws=2, start=0.8, seed=3)


def invoke(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["rig", *arguments])


def test_every_setup_is_asked_everything() -> None:
    found = plan()
    assert [setup.fs for setup in found.setups] == [500] * 4 + [2000] * 4
    assert [setup.sensors for setup in found.setups[:4]] == [
        ("x", "z"),
        ("x", "z", "load"),
        ("x", "z", "a"),
        ("x", "z", "a", "load"),
    ]
    assert found.questions == ("delay", "friction", "sliding friction", "contact stiffness")
    assert all(tuple(setup.accuracy) == found.questions for setup in found.setups)


def test_an_error_is_that_of_the_answer() -> None:
    """Done by hand: the same draws, the same questions."""
    rig, setup = ss.Rig(), plan().setups[-1]
    traces, stiffness = [], []
    for draw in range(2):
        record = rig.stated(rig.measure(run(), fs=2000, rng=np.random.default_rng([3, 1, draw]), start=0.8))
        force = ss.friction_force(record, mass=2.42, stiffness=2310, damping=0.12, method="fusion")
        inside = slice(round(0.05 * len(force)), round(0.95 * len(force)))
        true = run().sample(0.8 + force.time[inside], ("friction",))[0][0]
        traces.append(force["friction"][inside] - true)
        stiffness.append(ss.contact_stiffness(force).value - 192000)
    assert setup.accuracy["friction"].error == pytest.approx(np.sqrt(np.mean(np.square(traces))))
    assert setup.accuracy["contact stiffness"].error == pytest.approx(np.sqrt(np.mean(np.square(stiffness))))
    assert setup.accuracy["contact stiffness"].bias == pytest.approx(np.mean(stiffness))


def test_more_sensors_and_faster_ones_tell_more() -> None:
    error = {(setup.fs, setup.sensors): setup.accuracy["friction"].error for setup in plan().setups}
    assert error[2000, ("x", "z", "load")] < error[2000, ("x", "z", "a")] < error[2000, ("x", "z")]
    assert error[2000, ("x", "z", "load")] < 0.5 * error[500, ("x", "z", "load")]


def test_the_least_that_is_enough_is_named() -> None:
    enough = plan().enough("friction", "10 mN")
    assert enough is not None
    assert (enough.fs, enough.sensors) == (2000, ("x", "z", "load"))
    assert plan().enough("friction", 1e-6) is None
    late = plan().enough("delay", 1e-3)
    assert late is not None
    assert late.sensors == ("x", "z", "a")  # without an accelerometer there is no answer
    with pytest.raises(ModelError, match="there are delay, friction"):
        plan().enough("colour", 1.0)


def test_a_seed_gives_the_same_plan_again() -> None:
    asked = {"rates": [500], "draws": 1, "start": 0.8}
    one, same, other = (ss.answers.plan_experiment(run(), seed=seed, **asked) for seed in (3, 3, 4))  # type: ignore[arg-type]
    assert one == same
    assert one != other


def test_it_says_how_far_it_is() -> None:
    told: list[tuple[str, float]] = []
    ss.answers.plan_experiment(
        run(), rates=[500], draws=2, start=0.8, progress=lambda words, share: told.append((words, share))
    )
    assert [share for _, share in told] == [0] * 4 + [0.5] * 4
    assert told[0][0] == "x, z at 500 Hz, draw 1 of 2"


def test_the_figure_has_a_panel_for_every_question() -> None:
    figure = ss.figures.plot_plan(plan())
    assert [panel.get_title(loc="left") for panel in figure.axes] == list(plan().questions)
    assert [len(panel.lines) for panel in figure.axes] == [4, 4, 4, 4]


def test_what_can_not_be_planned_is_refused() -> None:
    with pytest.raises(ModelError, match="does not sense x"):
        ss.answers.plan_experiment(run(), rig=ss.Rig.perfect("a"))
    with pytest.raises(ModelError, match="draws"):
        ss.answers.plan_experiment(run(), draws=0)
    with pytest.raises(ModelError, match="fs"):
        ss.answers.plan_experiment(run(), rates=[-1.0])
    two = ss.Structure(
        mass=np.eye(2), damping=np.zeros((2, 2)), stiffness=np.eye(2), contacts=(), drive=ss.drives.Release()
    )
    with pytest.raises(ModelError, match="several masses"):
        ss.answers.plan_experiment(ss.simulate(two, start={"x1": 1.0}, duration=1.0))


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("slider.toml").write_text(SLIDER)
    return tmp_path


@pytest.mark.usefixtures("elsewhere")
@pytest.mark.parametrize("form", ["csv", "h5", "parquet"])
def test_the_command_writes_the_record_with_its_truth(form: str) -> None:
    result = invoke("slider.toml", "--fs", "1000", "--seed", "7", "--start", "0.5", "--format", form, "--stated")
    assert result.exit_code == 0, result.output
    record = ss.read_record(Path("slider-rig") / f"record.{form}")
    same = ss.Rig().measure(run(), fs=1000, rng=7, start=0.5)
    assert all(np.array_equal(record[name], same[name]) for name in same)
    assert record.truth["contact stiffness"] == 192000
    assert record.channels["a"].mount == (125, 0.1)
    assert "sliding friction" in result.output


@pytest.mark.usefixtures("elsewhere")
def test_the_command_changes_sensors() -> None:
    result = invoke("slider.toml", "--sensor", "load.limit=1.05", "--sensor", "x.lag=0", "--json")
    assert result.exit_code == 0, result.output
    assert any("channel load has" in fault and "clipped" in fault for fault in json.loads(result.output)["faults"])
    assert not Path("slider-rig").exists()


@pytest.mark.figures
@pytest.mark.usefixtures("elsewhere")
def test_the_command_plans() -> None:
    asked = ["slider.toml", "--plan", "--fs", "500", "--draws", "1", "--start", "0.8", "--output", "out"]
    result = invoke(*asked, "--need", "contact stiffness=100 kN/m", "--need", "friction=1 uN")
    assert result.exit_code == 0, result.output
    said = " ".join(result.output.split())
    assert "contact stiffness within 100 kN/m: x, z at 500 Hz; friction within 1 uN: none of these" in said
    data = json.loads(Path("out/results.json").read_text())
    assert data["setups"][0]["sensors"] == ["x", "z"]
    assert Path("out/figures/plan.svg").is_file()
    silent = json.loads(invoke(*asked[:-2], "--json").output)
    assert silent["setups"] == data["setups"]
    assert math.isfinite(silent["setups"][0]["accuracy"]["friction"]["error"])


@pytest.mark.usefixtures("elsewhere")
@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        (["--fs", "500", "--fs", "1000"], "several go with --plan"),
        (["--need", "friction=1"], "add --plan"),
        (["--sensor", "x=3"], "CHANNEL.NAME=NUMBER"),
        (["--sensor", "q.lag=3"], "no sensor writes 'q'"),
        (["--sensor", "x.colour=3"], "no 'colour'"),
        (["--start", "100"], "the run lasts"),
    ],
)
def test_wrong_use_ends_in_a_sentence(arguments: list[str], match: str) -> None:
    result = invoke("slider.toml", *arguments)
    assert result.exit_code == 2
    assert match in result.output
    assert "Traceback" not in result.output
