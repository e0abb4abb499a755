"""Maps are the motions of their points, one by one, and known answers."""

from __future__ import annotations

import builtins
import itertools
import math
import signal
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.errors import ModelError, SolveError
from stickslip.laws.base import Exit, Mode, Rigid
from stickslip.maps import engines
from stickslip.maps.crowd import run_block
from stickslip.maps.measures import FAILED, MOVING
from stickslip.maps.plan import Arrays, Plan
from stickslip.maps.sweep import planned
from stickslip.solve import refusal

pytest.importorskip("xarray")
CIRCLE = 2 * math.pi
UNIT = ss.Oscillator(
    mass=1, stiffness=1, law=ss.laws.Coulomb(0.5), drive=ss.drives.HarmonicForce(1.0, frequency=0.8 / CIRCLE)
)
RIGID = ss.Oscillator(
    mass=2.42, stiffness=2310, law=ss.laws.Coulomb(1.1), drive=ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
)
COMPLIANT = RIGID.having(law=ss.laws.CompliantContact(1.1, 192000, 23.8635))


def test_amplitudes_are_den_hartogs() -> None:
    """x0 = sqrt(V^2 - (U r)^2) for the motion without stops, V = 1 / (1 - b^2), U = tan(pi / 2b) / b."""
    b, r = np.array([0.6, 0.8, 1.3, 2.0]), np.array([0.3, 0.5, 0.4, 0.2])
    grid = [{"frequency": p / CIRCLE, "kinetic": q} for p, q in zip(b, r, strict=True)]
    swept = ss.sweep(UNIT.having(damping=1e-3), grid, measures=["amplitude", "stops"], settle=4000, cycles=4)
    known = np.sqrt((1 / (1 - b**2)) ** 2 - (np.tan(np.pi / 2 / b) / b * r) ** 2)
    assert swept.amplitude.values == pytest.approx(known, rel=1e-2)  # the damping of 0.05 % takes some of it
    assert not swept.normal_stops.values.any()


def test_a_map_is_its_points_one_by_one() -> None:
    swept = ss.sweep(
        RIGID,
        {"frequency": [2.5, 5.61], "kinetic": [0.9, 1.1]},
        settle=300,
        cycles=10,
        measures=["stops", "amplitude", "stick_share", "period", "multipliers"],
    )
    for f in (2.5, 5.61):
        for level in (0.9, 1.1):
            orbit, here = (
                ss.steady_state(RIGID.having(frequency=f, kinetic=level)),
                swept.sel(frequency=f, kinetic=level),
            )
            assert (int(here.normal_stops), int(here.abnormal_stops)) == orbit.stops
            assert float(here.amplitude) == pytest.approx(orbit.amplitude, rel=1e-9)
            assert int(here.order) == orbit.order
            assert abs(complex(here.multiplier)) == pytest.approx(abs(orbit.multipliers[0]), rel=1e-6, abs=1e-9)


def test_micro_slips_and_transition_speed_are_those_of_the_contact() -> None:
    """Thesis, the 2.5 Hz case: two micro-slips in each of two sticks a cycle."""
    swept = ss.sweep(
        COMPLIANT,
        {"kinetic": [1.1]},
        settle=20,
        cycles=4,
        measures=["micro_slips", "transition_speed", "energy", "stick_share"],
    )
    orbit = ss.steady_state(COMPLIANT)
    assert float(swept.micro_slips[0]) == 4
    assert float(swept.transition_speed[0]) == pytest.approx(orbit.transition_speed, rel=1e-9)
    assert float(swept.energy[0]) == pytest.approx(ss.solve.energy(orbit.orbit).friction, rel=1e-9)


def test_laws_arrays_starts_and_own_functions() -> None:
    def events(run: ss.solve.Trajectory) -> float:
        return float(len(run.events))

    grid = {"law": [ss.laws.Coulomb(1.0), COMPLIANT.law], ("start.x", "start.v"): [(0.0, 0.0), (1e-3, 0.02)]}
    swept = ss.sweep(RIGID, grid, measures=[events, "amplitude"], settle=2, cycles=2)
    assert dict(swept.sizes) == {"law": 2, "start.x_start.v": 2}
    assert swept["start.x"].values.tolist() == [0.0, 1e-3]
    run = ss.simulate(RIGID.having(law=COMPLIANT.law), cycles=4, start={"x": 1e-3, "v": 0.02})
    assert int(swept.events[1, 1]) == len(run.events)


@pytest.mark.parametrize(
    ("grid", "words"),
    [
        ({}, "an empty grid"),
        ([], "an empty grid"),
        ({"kinetic": []}, "no values"),
        ({"kinetc": [1.0]}, "no parameter is called 'kinetc'.*kinetic"),
        ({"kinetic": [1.0], "law.kinetic": [1.0]}, "one parameter"),
        ({"kinetic": [1.0, math.nan]}, "finite number"),
        ({"kinetic": 1.0}, "several values"),
        ({("mass", "stiffness"): [(1.0,)]}, "1 entries"),
        ([{"mass": 1.0}, {"stiffness": 1.0}], "different parameters"),
    ],
)
def test_a_grid_without_meaning_is_refused(grid: object, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        ss.sweep(UNIT, grid, measures=["stops"])  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"measures": ["stop"]}, "no measure is called 'stop'.*stops"),
        ({"measures": []}, "no measures"),
        ({"measures": ["stops", "stops"]}, "two measures"),
        ({"engine": "thread"}, "no engine is called 'thread'"),
        ({"engine": "threads://two"}, "threads://two.*threads://4"),
        ({"engine": "serial://4"}, "serial has no address"),
        ({"cycles": 0}, "cycles = 0"),
        ({"cycles": 1, "measures": ["period"]}, "cycles = 1; an orbit repeats"),
        ({"cycles": 1, "measures": ["multipliers"]}, "cycles = 1; an orbit repeats"),
        ({"settle": -1}, "settle = -1"),
    ],
)
def test_a_sweep_without_meaning_is_refused(options: dict[str, object], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        ss.sweep(UNIT, {"kinetic": [0.5]}, **options)  # type: ignore[arg-type]


def test_a_parameter_called_as_an_answer_goes_by_its_place() -> None:
    swept = ss.sweep(RIGID, {"amplitude": [5e-4, 6e-4]}, measures=["amplitude"], settle=2, cycles=2)
    assert swept.amplitude.dims == ("drive.amplitude",)
    assert swept["drive.amplitude"].values.tolist() == [5e-4, 6e-4]

    def mass(run: ss.solve.Trajectory) -> float:
        return 1.0

    with pytest.raises(ModelError, match="'mass' is a parameter and a measure"):
        ss.sweep(RIGID, {"mass": [1.0]}, measures=[mass])


def test_a_point_without_meaning_is_marked_and_the_rest_stands() -> None:
    swept = ss.sweep(UNIT.having(static=0.6), {"kinetic": [0.5, 0.7]}, settle=2, cycles=2)
    words = dict(zip(swept.status.flag_values, swept.status.flag_meanings.split(), strict=True))
    assert [words[int(code)] for code in swept.status] == ["moving", "no_such_system"]
    assert "below kinetic" in swept.status.attrs["refused"]
    assert any("no system: static" in caution for caution in ss.summary(swept).cautions)
    assert math.isnan(swept.amplitude[1])


@pytest.mark.parametrize(("key", "wrong"), [("kinetic", -1.0), ("mass", 0.0), ("static", 0.1), ("frequency", 0.0)])
def test_a_point_that_is_no_system_may_stand_first_and_where_all_are_wrong_the_grid_is_named(
    key: str, wrong: float
) -> None:
    base = UNIT.having(static=0.6)
    swept = ss.sweep(base, {key: [wrong, wrong, 0.6]}, measures=["stops"], settle=2, cycles=2)
    assert swept.status.values.tolist() == [3, 3, 0]
    with pytest.raises(ModelError, match=f"no point of the grid is a system: .*; correct the grid of {key}[.]"):
        ss.sweep(base, {key: [wrong, wrong]}, measures=["stops"], settle=2, cycles=2)


def test_a_border_of_what_is_a_system_is_refined() -> None:
    refined = ss.maps.refine(UNIT, {"mass": [-1.0, 1.0]}, halvings=3, settle=2, cycles=2)
    assert refined.status.values.tolist()[:5] == [3] * 5  # up to and with a mass of 0
    assert 3 not in refined.status.values[5:]
    with pytest.raises(ModelError, match="correct the grid of mass"):
        ss.maps.refine(UNIT, {"mass": [-1.0, -0.5]}, halvings=3)


def test_what_a_measure_refuses_is_no_missing_system() -> None:
    def refuses(run: ss.solve.Trajectory) -> float:
        raise ModelError("the run", "it is asked for what it has not", "ask another")

    delayed = UNIT.having(law=ss.laws.TimeDelay(ss.laws.LinearSlope(0.5, slope=0.0), lag=0.1))
    for system in (UNIT, delayed):
        with pytest.raises(ModelError, match="asked for what it has not"):
            ss.sweep(system, {"mass": [1.0]}, measures=[refuses], settle=0, cycles=1, engine="serial")


@dataclass(frozen=True)
class Undecided(Rigid):
    """A law with a mistake: sliding forward and holding each end at once in the other."""

    level: float

    def modes(self) -> tuple[Mode, ...]:
        at_once = {"1": 1.0}
        return (
            Mode("back", "slip", -1, {"1": -self.level}, (Exit({"v": 1.0}, "stuck"),)),
            Mode("stuck", "stick", 0, None, (Exit(at_once, "forward"),)),
            Mode("forward", "slip", 1, {"1": self.level}, (Exit(at_once, "stuck"),)),
        )


@pytest.mark.parametrize("measure", ["stops", "events"])
def test_a_law_that_changes_for_ever_is_refused(measure: str, tmp_path: Path) -> None:
    """Motions marched together and alone; what grows without bound is no mistake and has its place on the map."""
    with pytest.raises(
        SolveError, match=r"without time between the modes 'stuck' and 'forward'.*with level = 0\.5.*the law's exits"
    ):
        ss.sweep(UNIT.having(law=Undecided(1.0)), {"level": [0.5]}, measures=[measure], store=tmp_path / "map.zarr")
    assert not list(tmp_path.iterdir())
    growing = ss.sweep(UNIT, {"damping": [-1e4, 0.1]}, measures=[measure], settle=2, cycles=40)
    assert growing.status.values.tolist() == [2, 0]


def test_a_map_draws_by_default_its_first_answer() -> None:
    from stickslip.figures.maps import plot_map

    names = ["energy", "stick_share", "amplitude", "micro_slips"]
    for first in names:
        measures = [first, *(name for name in names if name != first)]
        swept = ss.sweep(UNIT, {"kinetic": [0.3, 0.5]}, measures=measures, settle=1, cycles=1)
        words = swept[first].attrs["long_name"]
        assert plot_map(swept).get_ylabel().startswith(words)


def test_the_answer_says_what_made_it() -> None:
    swept = ss.sweep(UNIT, {"kinetic": [0.5]}, settle=2, cycles=2)
    assert swept.attrs["version"] == ss.__version__
    assert "Coulomb" in swept.attrs["system"]
    assert swept.kinetic.units == "N"
    other = ss.sweep(UNIT, {"kinetic": [0.5 * (1 + 1e-16 * 4)]}, settle=2, cycles=2)
    assert other.attrs["checksum"] != swept.attrs["checksum"]


def test_a_border_is_refined_with_few_runs_and_none_wrong() -> None:
    slider = ss.scenarios.forced(0.8, 0.5)
    coarse = {"frequency": np.linspace(0.08, 0.3, 9), "kinetic": np.linspace(0.1, 1.2, 9)}
    refined = ss.maps.refine(slider, coarse, halvings=3, settle=200, cycles=10)
    fine = {name: refined[name].values for name in coarse}
    whole = ss.sweep(slider, fine, measures=["stops"], settle=200, cycles=10)
    for name in ("normal_stops", "abnormal_stops", "status"):
        assert np.array_equal(np.round(refined[name]), np.round(whole[name])), name
    assert refined.run.sum() < refined.run.size / 5
    with pytest.raises(ModelError, match="halvings = 0"):
        ss.maps.refine(slider, coarse, halvings=0)
    with pytest.raises(ModelError, match="has 1 values"):
        ss.maps.refine(slider, {"kinetic": [0.5]})
    with pytest.raises(ModelError, match=r"measure = 'amplitude'; borders are of what counts"):
        ss.maps.refine(slider, coarse, measure="amplitude")
    with pytest.raises(ModelError, match=r"1099513724929 points.*memory"):
        ss.maps.refine(slider, {"frequency": [0.1, 0.2], "kinetic": [0.3, 0.5]}, halvings=20)


def test_between_two_runs_that_failed_nothing_is_claimed() -> None:
    refined = ss.maps.refine(UNIT, {"damping": [-2e4, -1e4, 0.1]}, halvings=2, settle=2, cycles=40)
    status, run = refined.status.values, refined.run.values
    assert status[0] == status[4] == FAILED
    assert np.all(run[[0, 4, 8]])
    assert np.all(status[~run][:3] == -1)
    assert np.all(np.isnan(refined.normal_stops.values[~run][:3]))


def test_an_own_measure_of_a_run_that_fails_alone_marks_its_point() -> None:
    """What was marched with others and fails by itself has no answer, and ends no sweep."""

    def refused(run: ss.solve.Trajectory) -> float:
        if run.system.mass == 2.0:
            raise SolveError("a state", "it is told by the engine", "ask another")
        return 1.0

    swept = ss.sweep(UNIT, {"mass": [1.0, 2.0]}, measures=["amplitude", refused], settle=0, cycles=2, engine="serial")
    assert swept.status.values.tolist() == [MOVING, FAILED]
    assert np.isnan(swept.amplitude.values).tolist() == [False, True]
    assert np.isnan(swept.refused.values).tolist() == [False, True]


def test_lines_of_a_table_fail_no_motion_of_a_map() -> None:
    """A table of many lines passes them all in each period: thousands of changes of mode, two events."""
    table = ss.laws.Tabulated.of(lambda v: 0.3 + 0.1 * math.exp(-v), np.linspace(0, 4, 4001))
    swept = ss.sweep(UNIT.having(law=table), {"amplitude": [2.0]}, settle=2, cycles=2)
    run = ss.simulate(UNIT.having(law=table, amplitude=2.0), cycles=4)
    assert len(run.modes) > 4 * 10_000
    assert swept.status.values.tolist() == [MOVING]


@pytest.mark.parametrize("last", [12, 17])
def test_an_interrupt_ends_a_refinement_with_what_is_known(last: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within a level, and before its first block."""
    run_block, begun = engines.run_block, itertools.count(1)

    def interrupted(plan: Plan, number: int) -> tuple[Arrays, Arrays | None]:
        if next(begun) == last:
            raise KeyboardInterrupt
        return run_block(plan, number)

    slider = ss.scenarios.forced(0.8, 0.5)
    coarse = {"frequency": np.linspace(0.08, 0.3, 9), "kinetic": np.linspace(0.1, 1.2, 9)}
    options: dict[str, Any] = {"halvings": 1, "settle": 5, "cycles": 2, "engine": "serial"}
    whole = ss.maps.refine(slider, coarse, **options)
    monkeypatch.setattr(engines, "run_block", interrupted)
    refined = ss.maps.refine(slider, coarse, **options)
    assert next(begun) == last + 1
    assert refined.attrs["status"] == f"interrupted: {int(refined.run.sum())} points were run"
    assert 0 < refined.run.sum() < whole.run.sum()
    known = refined.status.values >= 0
    assert not np.any(refined.run.values & ~known)
    assert np.array_equal(refined.normal_stops.values[known], whole.normal_stops.values[known])
    assert np.all(np.isnan(refined.normal_stops.values[~known]))


def test_a_design_tells_what_an_answer_depends_on() -> None:
    def of_two(run: ss.solve.Trajectory) -> float:
        return run.system.mass + 2 * run.system.stiffness  # type: ignore[union-attr, operator, return-value]

    points = ss.maps.design({"mass": (1.0, 2.0), "stiffness": (1.0, 2.0), "kinetic": (0.1, 0.2)}, count=64)
    assert len(points) == 64 * 5
    sensitivity = ss.maps.sensitivity(ss.sweep(UNIT, points, measures=[of_two], settle=0, cycles=1), variable="of_two")
    for name, share in (("mass", 0.2), ("stiffness", 0.8), ("kinetic", 0.0)):  # variances 1 : 4 : 0
        assert sensitivity[name]["total"].value == pytest.approx(share, abs=0.03)
        assert sensitivity[name]["first"].value == pytest.approx(share, abs=0.05)
    with pytest.raises(ModelError, match="power of two"):
        ss.maps.design({"mass": (1.0, 2.0)}, count=3)
    with pytest.raises(ModelError, match="lowest and a higher"):
        ss.maps.design({"mass": (2.0, 1.0)}, count=4)
    points = ss.maps.design({"mass": (1.0, 2.0), "stiffness": (1.0, 2.0)}, count=32, kind="random")  # 8 times 2 + 2
    random = ss.sweep(UNIT, points, settle=0, cycles=1)
    with pytest.raises(ss.errors.EstimateError, match="Sobol design"):
        ss.maps.sensitivity(random, variable="amplitude")


def test_shares_of_ishigamis_function_hold_its_closed_form() -> None:
    """Ishigami and Homma 1990: y = sin x1 + a sin^2 x2 + b x3^4 sin x1, the angles uniform from -pi to pi."""
    import xarray

    a, b = 7.0, 0.1
    alone = 0.5 * (1 + b * np.pi**4 / 5) ** 2, a**2 / 8, 0.0
    together = b**2 * np.pi**8 * (1 / 18 - 1 / 50)  # of x1 and x3
    variance = sum(alone) + together
    truth = {("x1", "first"): alone[0], ("x2", "first"): alone[1], ("x3", "first"): alone[2],
             ("x1", "total"): alone[0] + together, ("x2", "total"): alone[1], ("x3", "total"): together}  # fmt: skip
    held = []
    for seed in range(10):
        points = ss.maps.design(dict.fromkeys(("x1", "x2", "x3"), (-np.pi, np.pi)), count=1024, seed=seed)
        x1, x2, x3 = (np.array([point[name] for point in points]) for name in ("x1", "x2", "x3"))
        y = np.sin(x1) + a * np.sin(x2) ** 2 + b * x3**4 * np.sin(x1)
        coordinates = {name: ("point", values) for name, values in (("x1", x1), ("x2", x2), ("x3", x3))}
        shares = ss.maps.sensitivity(xarray.Dataset({"y": ("point", y)}, coords=coordinates), variable="y", seed=seed)
        for (name, kind), part in truth.items():
            assert shares[name][kind].value == pytest.approx(part / variance, abs=0.04)  # 0.027 at most of 40 seeds
            held.append(shares[name][kind].includes(part / variance))
    assert sum(held) >= 0.95 * len(
        held
    )  # 240 of 240 in 40 seeds: Sobol's points err less than the bootstrap of them says


def test_a_map_that_does_not_fit_is_refused_before_it_starts(tmp_path: Path) -> None:
    grid = {name: np.linspace(1, 2, 50_000) for name in ("kinetic", "mass", "stiffness")}
    with pytest.raises(ModelError, match=r"125000000000000 points.*memory"):
        ss.sweep(UNIT, grid)
    with pytest.raises(ModelError, match=r"125000000000000 points.*disk"):
        ss.sweep(UNIT, grid, store=tmp_path / "map.zarr")
    assert not list(tmp_path.iterdir())


def test_a_notebook_shows_one_line_that_is_written_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []

    class Line:
        def update(self, data: dict[str, str], *, raw: bool) -> None:
            shown.append(data["text/plain"])

    def display(data: dict[str, str], *, raw: bool, display_id: bool) -> Line:
        assert not shown
        Line().update(data, raw=raw)
        return Line()

    class ZMQInteractiveShell: ...

    monkeypatch.setattr(builtins, "get_ipython", ZMQInteractiveShell, raising=False)
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=display))  # type: ignore[arg-type]
    monkeypatch.setattr(sys.modules["stickslip.maps.sweep"], "PATIENCE", 0.0)
    ss.sweep(UNIT, {"kinetic": [0.1, 0.2, 0.3, 0.4]}, settle=0, cycles=1, engine="serial")
    assert [line.partition("blocks")[0][-4:-1] for line in shown[:-1]] == ["1/4", "2/4", "3/4", "4/4"]
    assert shown[1].startswith("mapping " + 15 * "━" + 15 * "─")
    assert "left 0:00:00" in shown[3]
    assert shown[-1] == ""


def test_an_interrupt_waits_for_no_block() -> None:
    """A block of 4,096 motions, each simulated by itself, took minutes more."""
    asked = itertools.count(1)

    def slow(run: ss.solve.Trajectory) -> float:
        if next(asked) == 3:
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
        time.sleep(0.02)
        return run.duration

    grid = {"frequency": np.linspace(0.1, 0.3, 3200)}  # 200 to a block
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job is deaf to it
    try:
        with pytest.raises(KeyboardInterrupt):
            ss.sweep(UNIT, grid, measures=[slow], settle=0, cycles=1, engine="threads://1")
    finally:
        signal.signal(signal.SIGINT, before)
    assert next(asked) < 150


@pytest.mark.parametrize("law", [ss.laws.Coulomb(0.5), ss.laws.Stribeck(0.5, 0.6, speed=0.1)], ids=["linear", "curved"])
def test_an_interrupt_waits_for_no_motion(law: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A motion of many periods, its exponent and a block of many systems ended first: up to 13 s."""
    looks, ended, real = itertools.count(1), threading.Event(), refusal.heed

    def heed() -> None:
        if next(looks) == 3:
            ended.set()
        real()

    for room in ("solve.refusal", "solve.simulate", "solve.curved", "maps.crowd"):
        monkeypatch.setattr(f"stickslip.{room}.heed", heed)
    grid = {"frequency": np.linspace(0.1, 0.3, 64)}
    plan = planned(UNIT.having(law=law), grid, measures=["lyapunov"], cycles=25, settle=0, start=None)

    def block() -> None:
        refusal.ended_by(ended)
        with pytest.raises(KeyboardInterrupt):
            run_block(plan, 0)

    thread = threading.Thread(target=block)
    thread.start()
    thread.join()
    assert ended.is_set()
    assert next(looks) == 4
