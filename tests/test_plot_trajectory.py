"""Figures of a simulated motion: what is drawn is the exact motion, and what holds is marked."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

import stickslip as ss
from stickslip.figures.style import BLUE, SKY
from stickslip.figures.trajectory import (
    curve,
    cycle_of,
    frames,
    last_cycles,
    plot_loop,
    plot_motion,
    plot_phase,
    stretches,
)
from stickslip.solve.energies import energy
from stickslip.solve.trajectory import Trajectory
from stickslip.story.story import summary


def motion(name: str, **run: float) -> Trajectory:
    case = ss.systems.scenario_case(name)
    return ss.simulate(case.system, start=case.start, **(run or case.run))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def sticking() -> Trajectory:
    return motion("DH-3 b=0.25 r=0.9", cycles=20)


def test_every_figure_is_drawn_without_pyplot(sticking: Trajectory) -> None:
    before = dict(mpl.rcParams)
    plates = summary(sticking).plates
    assert [plate.name for plate in plates] == [
        "whole-run",
        "motion",
        "friction-displacement",
        "friction-velocity",
        "phase-portrait",
    ]
    assert dict(mpl.rcParams) == before
    for plate, again in zip(plates, summary(sticking).plates, strict=True):
        assert plate.figure.canvas.manager is None
        assert plate.caption.endswith(".")
        assert ET.fromstring(plate.svg()).tag.endswith("svg")
        assert plate.svg() == again.svg()
        assert len(plate.svg()) < 600_000


def test_the_curve_keeps_jumps_upright(sticking: Trajectory) -> None:
    times, (friction, _) = curve(sticking, ("friction", "x"), first=0.0, last=sticking.duration)
    assert np.all(np.diff(times) > 0)
    jumps = np.flatnonzero(np.abs(np.diff(friction)) > 0.2)
    assert len(jumps) > 20
    assert np.diff(times)[jumps].max() < 1e-9 * sticking.duration


def test_the_area_of_the_drawn_loop_is_the_work_of_a_cycle(sticking: Trajectory) -> None:
    lines = {str(line.get_label()): line for line in plot_loop(sticking).get_lines()}
    x, friction = (np.asarray(part, dtype=float) for part in lines["last cycle"].get_data())
    area = abs(np.sum((x[1:] - x[:-1]) * (friction[1:] + friction[:-1]) / 2))
    whole, shorter = energy(sticking).friction, energy(motion("DH-3 b=0.25 r=0.9", cycles=19)).friction
    assert area == pytest.approx(whole - shorter, rel=1e-5)


def test_sticks_are_shaded_and_marked_where_they_are(sticking: Trajectory) -> None:
    first, last = last_cycles(sticking, 3)
    axes = plot_motion(sticking, first=first, last=last).axes[0]
    shaded = sum(float(np.ptp(path.vertices[:, 0])) for path in axes.collections[0].get_paths())
    held = [p for p in sticking.pieces if p.mode == "stuck"]
    overlaps = [min(p.start + p.duration, last) - max(p.start, first) for p in held if p.start + p.duration > first]
    assert shaded == pytest.approx(sum(overlaps), rel=1e-9)
    marked = next(line for line in plot_phase(sticking).get_lines() if line.get_label() == "stick")
    assert marked.get_color() == BLUE
    _, v = (np.asarray(part, dtype=float) for part in marked.get_data())
    assert np.nanmax(np.abs(v)) < 1e-9, "a stick on the ground is at rest"
    assert len(marked.get_markevery()) == len(stretches(sticking, "stick", first=last - cycle_of(sticking), last=last))


def test_microsticks_have_their_own_mark() -> None:
    run = motion("THESIS compliant 2.5Hz fk=1.1 Ky=192000 z.0174(k+Ky)")
    lines = {str(line.get_label()): line for line in plot_loop(run).get_lines()}
    assert lines["microstick"].get_color() == SKY
    x, friction = (np.asarray(part, dtype=float) for part in lines["microstick"].get_data())
    factor = 1e6 if "µm" in plot_loop(run).get_xlabel() else 1e3
    sides = np.split(np.column_stack([x, friction]), np.flatnonzero(np.isnan(x)))
    fits = [np.polyfit(*side[1:].T, 1)[0] * factor for side in sides if len(side) > 10]
    slope = np.median(fits)
    assert slope == pytest.approx(192000, rel=0.1), "the side of the loop is the contact's stiffness"


def test_on_a_belt_it_sticks_at_the_belt_s_speed() -> None:
    run = motion("BS-1", cycles=20)
    axes = plot_phase(run)
    lines = {str(line.get_label()): line for line in axes.get_lines()}
    _, v = (np.asarray(part, dtype=float) for part in lines["stick"].get_data())
    belt = float(np.asarray(lines["belt"].get_ydata(), dtype=float)[0])
    assert np.nanmin(v) == pytest.approx(belt)
    assert np.nanmax(v) == pytest.approx(belt)
    assert cycle_of(run) == pytest.approx(ss.steady_state(run.system, start={"x": 0.3}).period, rel=1e-9)
    loop = plot_loop(run, against="slip")
    assert loop.get_xlabel().startswith("sliding velocity")
    held = next(line for line in loop.get_lines() if line.get_label() == "stick")
    assert np.nanmax(np.abs(np.asarray(held.get_xdata(), dtype=float))) < 1e-12


def test_a_motion_that_ends_is_shown_as_long_as_it_moves() -> None:
    run = motion("FD-4")
    plates = summary(run).plates
    assert "whole-run" not in [plate.name for plate in plates]
    left, right = plates[0].figure.axes[0].get_xlim()
    assert (left, run.starts[-1] < right < 2 * run.starts[-1]) == (0.0, True)


def test_of_a_long_run_no_peak_is_lost() -> None:
    run = motion("DH-1 b=0.8", cycles=5000)
    _, (x,) = curve(run, ("x",), first=0.0, last=run.duration)
    late = x[len(x) // 2 :]
    assert len(x) <= 3000
    assert late.max() == pytest.approx(2.3322349875413646, rel=0.01)


def test_a_figure_goes_where_it_is_told(sticking: Trajectory) -> None:
    axes = Figure().add_subplot()
    assert plot_phase(sticking, ax=axes) is axes


def test_frames_move_and_count_themselves(sticking: Trajectory) -> None:
    told: list[int] = []
    shown = list(frames(sticking, tell=lambda number, count: told.append(number)))
    assert told == list(range(150))
    assert {image.shape for image in shown} == {(480, 640, 3)}
    assert np.any(shown[0] != shown[40])
    middle = np.array([[np.flatnonzero((image[60:130] == (213, 94, 0)).all(axis=2).any(axis=0)).mean()
                        for image in shown if (image[60:130] == (213, 94, 0)).all(axis=2).any()]])  # fmt: skip
    assert np.ptp(middle) > 50, "the sliding mass travels over the picture"


@pytest.fixture(scope="module")
def lifting() -> Trajectory:
    """A mass on a belt that its load lifts off."""
    pad = ss.Contact(ss.laws.Coulomb(0.6), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0)
    springs = [[23.25, 3.9], [3.9, 7.75]]
    system = ss.Structure(np.eye(2), np.zeros((2, 2)), springs, contacts=[pad], drive=ss.drives.Belt(0.8))
    return ss.simulate(system, duration=25, start={"x1": 0.3, "v1": 0.0})


def test_of_a_structure_every_mass_and_load_is_drawn(lifting: Trajectory) -> None:
    figure = plot_motion(lifting)
    displacement, _, friction, load = figure.axes
    assert [line.get_label() for line in displacement.get_lines()[:2]] == ["x1", "x2"]
    for ax, name in ((friction, "friction"), (load, "load")):
        times, shown = (np.asarray(part, dtype=float) for part in ax.get_lines()[0].get_data())
        (exact,) = lifting.sample(np.clip(times, 0, lifting.duration), (name,))[0]
        assert np.allclose(shown, exact, rtol=0, atol=1e-9), name
    flown = sum(piece.duration for piece in lifting.pieces if piece.mode == "lifted")
    assert np.sum(stretches(lifting, "flight", first=0.0, last=25.0)[:, 1]) == pytest.approx(flown, rel=1e-12)


def test_sliding_lies_on_the_wedge_of_friction_over_load(lifting: Trajectory) -> None:
    lines = {str(line.get_label()): line for line in plot_loop(lifting, against="load").get_lines()}
    load, friction = (np.asarray(part, dtype=float) for part in lines["last cycle"].get_data())
    assert np.all(np.abs(friction) <= 0.6 * load + 1e-9)
    assert friction.min() == pytest.approx(-0.6 * load.max(), rel=1e-6)


def test_each_contact_has_its_own_loop_and_shades() -> None:
    pads = [
        ss.Contact(ss.laws.Coulomb(0.3), [1, 0]),
        ss.Contact(ss.laws.CompliantContact(0.2, stiffness=50.0), [-1, 1]),
    ]
    drive = ss.drives.HarmonicForce(1.2, frequency=0.13)
    system = ss.Structure(np.eye(2), 0.05 * np.eye(2), [[3.0, -1.3], [-1.3, 2.9]], contacts=pads, drive=drive)
    run = ss.simulate(system, cycles=10)
    names = [plate.name for plate in summary(run).plates]
    assert names[2:] == [
        "friction-displacement-1",
        "friction-velocity-1",
        "friction-displacement-2",
        "friction-velocity-2",
        "phase-portrait-x1",
        "phase-portrait-x2",
    ]
    line = next(line for line in plot_loop(run, contact=1).get_lines() if line.get_label() == "last cycle")
    assert np.abs(np.asarray(line.get_ydata(), dtype=float)).max() == pytest.approx(0.2, rel=1e-9)
    assert len(stretches(run, "stick", first=0, last=run.duration, contact=1)) == 0
    assert len(stretches(run, "microstick", first=0, last=run.duration, contact=1)) > 10


def test_a_contact_that_lifts_off_rises_in_the_moving_picture(lifting: Trajectory) -> None:
    purple = [np.argwhere((image[:150] == (176, 85, 155)).all(axis=2))[:, 0] for image in list(frames(lifting))[::5]]
    heights = [rows.min() for rows in purple if len(rows) > 1000]
    assert len(heights) > 3
    assert max(heights) - min(heights) > 5
