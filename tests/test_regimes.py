"""Attractors along a parameter, basins and boundaries: against closed forms."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

import stickslip as ss
from stickslip.estimate import stands
from stickslip.scenarios import forced
from stickslip.solve import poincare

TURN = 2 * math.pi
BISTABLE = forced(0.8, 1.0, static_ratio=1.5)  # over the force's amplitude P: r = 1 / P
SHAW = 0.72697564257968176  # r at which sliding with static = 1.5 kinetic friction begins to stick, b = 0.8


def test_hysteresis_is_followed_up_and_down() -> None:
    """Held until the force exceeds the static friction; on the way down sliding lasts to Shaw's boundary."""
    diagram = ss.bifurcation(BISTABLE, "amplitude", values=np.linspace(1.2, 1.6, 9))
    up, down = diagram.changes
    assert (up.direction, up.before, up.after) == ("up", "held", "no stops")
    assert up.value == pytest.approx(1.5, abs=up.error)
    assert (down.direction, down.before, down.after) == ("down", "no stops", "2 + 0 stops")
    assert down.value == pytest.approx(1 / SHAW, abs=1.01 * down.error)
    assert up.error < 1e-6
    assert diagram.coexisting == pytest.approx(np.linspace(1.2, 1.5, 7))
    assert [each.regime for each in diagram.at(0)] == ["held", "2 + 0 stops"]


def test_the_number_of_stops_is_the_one_known() -> None:
    """A row of the table of stops over friction (Hong and Liu 2000), b = 0.1."""
    known = ss.scenarios.grid("HL-1")
    row = known["ratios"].index(0.1)
    diagram = ss.bifurcation(forced(0.1, 0.5), "kinetic", values=known["loads"], precision=1e-3)
    stops = [each.orbit.stops for each in diagram.up]
    assert stops == list(zip(known["normal"][row], known["abnormal"][row], strict=True))


def test_starts_find_what_following_does_not() -> None:
    """From below only rest is met before the static friction; another start slides there."""
    diagram = ss.bifurcation(BISTABLE, "amplitude", values=[1.2, 1.3], starts=[{}, {"x": 3.0}])
    assert [each.regime for each in diagram.up + diagram.down] == ["held"] * 4
    assert [[other.regime for other in others] for others in diagram.beside] == [["2 + 0 stops"]] * 2


def test_the_diagram_is_labelled() -> None:
    diagram = ss.bifurcation(BISTABLE, "amplitude", values=[1.3, 1.4, 1.6], precision=1e-2)
    data = diagram.data
    assert data["regime"].sel(direction="down", amplitude=1.3) == "2 + 0 stops"
    sliding = data.sel(direction="up", amplitude=1.6)
    orbit = ss.steady_state(BISTABLE.having(amplitude=1.6), start={"x": 3.0})
    assert sliding["displacement"] == pytest.approx(orbit.amplitude, rel=1e-9)
    assert np.allclose(np.abs(sliding["multipliers"]), np.abs(orbit.multipliers), rtol=1e-6)
    assert np.allclose(sliding["points"].sel(point=0), orbit.orbit.states[0, :2], rtol=1e-9)
    assert "held -> no stops" in data.attrs["changes"][0]


def test_chaos_is_points_that_do_not_repeat() -> None:
    case = ss.scenarios.get("FM-1")
    diagram = ss.bifurcation(case.system, "drive.amplitude", values=[1.88, 1.9], transient=100)
    wild = diagram.up[-1]
    assert wild.regime == "chaotic"
    assert len(np.unique(wild.points[:, 0].round(9))) > 200
    assert diagram.data["points"].sizes["point"] == len(wild.points)


def test_branches_hold_the_unstable_orbits_between() -> None:
    """Stick-slip ends at a fold, below which the mass is held; the branch turns back there and is unstable."""
    diagram = ss.bifurcation(BISTABLE, "amplitude", values=[1.1, 1.4, 1.6], branches=True)
    assert [change.after for change in diagram.changes] == ["no stops", "2 + 0 stops", "held"]
    [branch] = diagram.branches
    [fold] = branch.folds
    assert branch.values[fold] == pytest.approx(diagram.changes[-1].value, abs=1e-5)
    assert {orbit.status for orbit in branch.orbits[fold + 1 :]} == {"unstable"}


def test_basins_are_those_of_the_exact_runs() -> None:
    """Where Shaw's sliding and rest stand beside each other, each start leads where a long run ends."""
    system = BISTABLE.having(amplitude=1.25)
    basins = ss.basins(system, grid={"x": np.linspace(-2, 2, 9), "v": np.linspace(-2, 2, 9)})
    assert [attractor.regime for attractor in basins.attractors] == ["2 + 0 stops", "held"]
    for i, x in enumerate(basins.axes[0]):
        for j, v in enumerate(basins.axes[1]):
            run = ss.simulate(system, cycles=300, start={"x": x, "v": v})
            moves = any(event.time > 280 / system.drive.frequency for event in run.events)
            assert basins.attractors[basins.which[i, j]].regime == ("2 + 0 stops" if moves else "held")
    assert sum(share.value for share in basins.shares) == pytest.approx(1.0)
    assert all(share.includes(share.value) for share in basins.shares)
    assert basins.data.sel(x=-2.0, v=2.0) == 0


def test_a_grid_of_rest_is_known_in_closed_form() -> None:
    """Held starts, without velocity, stay held where P + k |x| does not exceed the static friction."""
    system = forced(0.8, 0.7, static_ratio=2.0)  # P = 1, static friction 1.4
    x = np.linspace(-0.6, 0.6, 13)
    basins = ss.basins(system, grid={"x": x, "v": [-3.0, 0.0]})
    held = [attractor.regime for attractor in basins.attractors].index("held")
    stay = basins.which[:, 1] == held
    assert np.all(stay[np.abs(x) <= 0.4 - 1e-9])


def test_a_start_that_can_not_be_followed_costs_no_map(monkeypatch: pytest.MonkeyPatch) -> None:
    """The other starts are answered, and no share counts it as one that leads elsewhere."""
    module, lap = sys.modules["stickslip.maps.basins"], poincare.lap

    def failing(system: ss.Oscillator, table: object, state: np.ndarray, mode: int, laps: int) -> ss.solve.Trajectory:
        if (state[0], state[1]) == (-1.0, 1.0):
            raise ss.errors.SolveError("chatter", "a law leaves every state in one direction", "check the law")
        return lap(system, table, state, mode, laps)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "lap", failing)
    basins = ss.basins(ss.scenarios.get("FM-1").system, grid={"x": [-1.0, 0.5], "v": [0.5, 1.0]}, transient=20)
    assert [sentence.partition(":")[0] for sentence in basins.lost] == ["x = -1, v = 1"]
    assert basins.which.tolist() == [[0, -1], [0, 0]]
    assert "could not be followed" in repr(basins)
    followed = basins.which.size - len(basins.lost)
    for number, share in enumerate(basins.shares):
        count = np.count_nonzero(basins.which == number)
        assert share.value == pytest.approx(count / followed)  # what failed is no start that leads elsewhere
        assert share.interval[1] >= (count + len(basins.lost)) / basins.which.size
        assert not stands(share.status)


def test_micro_slips_go_one_by_one_as_the_contact_is_damped() -> None:
    """Contact damping at which two micro-slips a stick become one, and none (thesis's case of 2.5 Hz, by bisection)."""
    contact = ss.laws.CompliantContact(1.1, stiffness=192000.0, damping=23.9)
    rig = ss.Oscillator(2.42, 2310, contact, ss.drives.HarmonicBase(0.65e-3, frequency=2.5))
    two = ss.maps.boundary(rig, "law.damping", between=(50.0, 138.5), kind="regime", precision=1e-5)
    none = ss.maps.boundary(rig, "law.damping", between=(200.0, 350.0), kind="regime", precision=1e-5)
    assert two.value == pytest.approx(138.07, abs=0.15)
    assert none.value == pytest.approx(298.35, abs=0.15)


def test_several_turns_of_an_orbit_are_one() -> None:
    """Near resonance Newton's method closes three and four turns of it before one; they are the same orbit."""
    orbits = [ss.steady_state(forced(0.99, 0.789305), start={"x": x}) for x in (0.0, 10.0, 30.0)]
    assert [orbit.order for orbit in orbits] == [1, 1, 1]
    assert all(orbit.amplitude == pytest.approx(orbits[0].amplitude, rel=1e-9) for orbit in orbits)


@pytest.mark.parametrize("row", ss.scenarios.grid("DH-2")["boundary"][::3], ids=str)
def test_the_boundary_is_den_hartogs(row: tuple[float, float, float]) -> None:
    ratio, damping, load = row
    if (ratio, damping) == (0.5, 0.0):
        pytest.skip("at half the natural frequency the sliding motion is not unique")
    system = forced(ratio, 0.5, damping_ratio=damping)
    border = ss.maps.boundary(system, "kinetic", between=(0.9 * load, min(1.1 * load, 0.99)))
    assert border.value == pytest.approx(load, rel=1e-8)
    assert border.kinds == (("no stops", "stops"),)
    assert np.all(border.multipliers < 1)


def test_the_boundary_with_static_friction_is_shaws() -> None:
    border = ss.maps.boundary(BISTABLE, "amplitude", between=(1.2, 1.6), start={"x": 3.0})
    assert border.value == pytest.approx(1 / SHAW, rel=1e-8)
    assert border.kinds == (("stops", "no stops"),)


def test_a_boundary_is_followed_along_a_parameter() -> None:
    chosen = {b: r for b, z, r in ss.scenarios.grid("DH-2")["boundary"] if not z and b in (0.4, 0.8, 1.4)}
    places = np.array(sorted(chosen)) / TURN
    border = ss.maps.boundary(forced(0.8, 0.5), "kinetic", between=(0.05, 0.99), along={"frequency": places})
    assert border.values == pytest.approx([chosen[b] for b in sorted(chosen)], rel=1e-8)
    assert border.data["kinetic"].dims == ("frequency",)


def test_other_questions_have_boundaries_too() -> None:
    """Held from where the friction is the force; and a user's own question."""
    held = ss.maps.boundary(forced(0.3, 0.5), "kinetic", between=(0.9, 1.2), kind="held", precision=1e-6)
    assert held.value == pytest.approx(1.0, rel=2e-4)
    orbit = ss.maps.boundary(
        forced(0.8, 0.5), "kinetic", between=(0.1, 0.7), kind=lambda found: found.orbit.amplitude > 2.5
    )
    assert orbit.low[0].orbit.amplitude == pytest.approx(2.5, rel=1e-6)


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (lambda: ss.bifurcation(BISTABLE, "amplitud", values=[1, 2]), "amplitude"),
        (lambda: ss.bifurcation(BISTABLE, "law", values=[1, 2]), "one number is varied"),
        (lambda: ss.bifurcation(BISTABLE, "amplitude", values=[1.0]), "two different finite values"),
        (lambda: ss.bifurcation(BISTABLE, "amplitude", values=[1.0, math.nan]), "finite"),
        (lambda: ss.bifurcation(BISTABLE.having(drive=ss.drives.Belt(0.1)), "kinetic", values=[1, 1.2]), "Belt"),
        (lambda: ss.basins(BISTABLE.having(drive=ss.drives.Release()), grid={"x": [0, 1], "v": [0, 1]}), "Release"),
        (lambda: ss.basins(BISTABLE, grid={"x": [0, 1]}), "two start coordinates"),
        (lambda: ss.basins(BISTABLE, grid={"x": [0, 1], "v": [0]}), "two different finite values"),
        (lambda: ss.bifurcation(BISTABLE, "amplitude", values=["much"]), "made of numbers"),
        (lambda: ss.basins(BISTABLE, grid={"x": [0, 1], "q": [0, 1]}), "'q'"),
        (lambda: ss.maps.boundary(BISTABLE, "kinetc", between=(0.1, 0.2)), "kinetic"),
        (lambda: ss.maps.boundary(BISTABLE, "kinetic", between=(0.2, 0.2)), "two different values"),
        (lambda: ss.maps.boundary(forced(0.8, 0.5), "kinetic", between=(0.1, 0.2)), "widen between="),
        (lambda: ss.maps.boundary(BISTABLE, "kinetic", between=(0.1, 0.2), kind="colour"), "sticking"),
        (
            lambda: ss.maps.boundary(BISTABLE, "kinetic", between=(0.1, 0.2), along={"frequency": [1.0]}),
            "two different finite values",
        ),
    ],
)
def test_bad_questions_are_refused_in_a_sentence(ask, told) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ss.StickslipError, match=told) as caught:
        ask()
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_a_tone_on_top_of_any_drive() -> None:
    """As two tones on the mass; and on the face of a belt, seen from the face."""
    tone, drive = (0.3, 24 / TURN), ss.drives.HarmonicForce(1.0, 0.8 / TURN)
    both = ss.drives.MultiTone([(1.0, 0.8 / TURN, 0.0), (*tone, 0.0)], on="force")
    mine = forced(0.8, 0.5).having(drive=ss.drives.Dithered(drive, *tone, on="force"))
    other = forced(0.8, 0.5).having(drive=both)
    one, two = (ss.simulate(system, duration=30.0) for system in (mine, other))
    assert [event[1:] for event in one.events] == [event[1:] for event in two.events]
    assert one.state(30.0)["x"] == pytest.approx(two.state(30.0)["x"], rel=1e-9)
    assert mine.drive.motion().period == pytest.approx(TURN / 0.8)
    # a belt whose face shakes: in the face's frame the mass feels its acceleration
    belt = ss.Oscillator(
        mass=1, stiffness=0, law=ss.laws.Coulomb(1.0), drive=ss.drives.Dithered(ss.drives.Belt(0.5), 0.01, 10.0)
    )
    run = ss.simulate(belt, duration=2.0)
    assert run.sample([1.0], ("slip",))[0][0, 0] == pytest.approx(
        run.state(1.0)["v"] - 0.5 + 0.01 * TURN * 10 * math.sin(TURN * 10), abs=1e-12
    )
    with pytest.raises(ss.errors.ModelError, match="base"):
        ss.drives.Dithered(drive, *tone, on="roof")


def test_the_figures_show_what_was_found() -> None:
    diagram = ss.bifurcation(BISTABLE, "amplitude", values=[1.3, 1.6], starts=[{}, {"x": 3.0}], precision=1e-2)
    places = {"frequency": np.array([0.6, 0.8, 1.1]) / TURN}
    curve = ss.maps.boundary(forced(0.8, 0.5), "kinetic", between=(0.05, 0.99), along=places, precision=1e-6)
    basins = ss.basins(BISTABLE.having(amplitude=1.25), grid={"x": np.linspace(-2, 2, 5), "v": np.linspace(-2, 2, 5)})
    for result, words in ((diagram, "held"), (curve, "Den Hartog"), (basins, "2 + 0 stops")):
        [plate] = ss.summary(result).plates
        assert words in plate.svg()
    line = next(line for line in ss.figures.plot_boundary(curve).get_lines() if "Hartog" in str(line.get_label()))
    assert np.interp(curve.places, *line.get_data()) == pytest.approx(curve.values, rel=2e-4)


def test_the_figures_tell_an_angle_in_radians() -> None:
    lever = ss.Structure(
        [[1.0]],
        [[0.1]],
        [[1.0]],
        contacts=[ss.Contact(ss.laws.Coulomb(0.8), [1.0])],
        acts_on=[1.0],
        rotations=[1],
        drive=ss.drives.HarmonicForce(1.0, frequency=0.08),
    )
    map_ = ss.figures.plot_basins(ss.basins(lever, grid={"x": [-1.0, 1.0], "v": [-1.0, 1.0]}))
    assert (map_.get_xlabel(), map_.get_ylabel()) == ("x [rad]", "v [rad/s]")
    diagram = ss.figures.plot_bifurcation(ss.bifurcation(lever, "drive.amplitude", values=[1.0, 1.2]))
    assert diagram.axes[0].get_ylabel() == "displacement at phase zero [rad]"
