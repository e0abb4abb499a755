"""Figures: what is drawn is what was found, and nothing is left open."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import stickslip as ss
from stickslip.answers.findings import Findings
from stickslip.answers.many import compare
from stickslip.answers.questions import analyze
from stickslip.cycle.sticks import StickEvent
from stickslip.figures.contact import plot_sticks, plot_velocity_loop
from stickslip.figures.friction import plot_load_dependence
from stickslip.figures.squeak import plot_squeaks
from stickslip.figures.style import COLUMNS, STYLE, Plate, envelope, thinned
from stickslip.figures.traces import close_up, force_balance, plot_force_balance, plot_traces
from stickslip.story.story import summary
from stickslip.units import prefixed

FS = 500.0


@pytest.fixture(scope="module")
def demo() -> Findings:
    record = ss.datasets.demo()
    return analyze(record, **{name: record.truth[name] for name in ("mass", "stiffness", "damping")})


@pytest.fixture(scope="module")
def plates(demo: Findings) -> tuple[Plate, ...]:
    return summary(demo).plates


def slid(friction: float, normal: float) -> Findings:
    time = np.arange(4000) / FS
    force = friction * np.sign(np.cos(2 * np.pi * time)) + np.random.default_rng(1).normal(0, 0.02, time.size)
    samples = {"x": 0.01 * np.sin(2 * np.pi * time), "friction": force, "normal": np.full(time.size, normal)}
    return analyze(ss.Record.of(samples, fs=FS))


def test_every_figure_of_the_demonstration_is_drawn_once_without_pyplot(demo: Findings) -> None:
    before = dict(mpl.rcParams)
    plates = summary(demo).plates
    assert [plate.name for plate in plates] == [
        "friction-velocity",
        "friction-displacement",
        "record",
        "close-up",
        "force-balance",
        "sticks",
    ]
    assert dict(mpl.rcParams) == before, "the user's own settings stay as they were"
    for plate in plates:
        assert isinstance(plate.figure, Figure)
        assert plate.figure.canvas.manager is None, "not known to pyplot"
        assert plate.caption.endswith(".")
        assert all(
            axes.get_xlabel() or axes.get_shared_x_axes().joined(axes, plate.figure.axes[-1])
            for axes in plate.figure.axes
        )


def test_a_stick_or_slip_that_the_record_cuts_is_not_counted(demo: Findings, plates: tuple[Plate, ...]) -> None:
    """The demonstration begins and ends within a slip, of which 13 ms are left at the end."""
    assert demo.sticks is not None
    cut = [event for event in demo.sticks.events if not event.whole]
    assert [event.kind for event in cut] == ["slip", "slip"]
    left = next(plate for plate in plates if plate.name == "sticks").figure.axes[0]
    drawn = {line.get_label(): len(line.get_xdata()) for line in left.get_lines()}  # type: ignore[arg-type]
    whole = [event.kind for event in demo.sticks.events if event.whole]
    assert drawn == {"stick": whole.count("stick"), "slip": whole.count("slip")}


def test_images_are_valid_small_and_the_same_again(demo: Findings, plates: tuple[Plate, ...]) -> None:
    for plate, again in zip(plates, summary(demo).plates, strict=True):
        assert ET.fromstring(plate.svg()).tag.endswith("svg")
        assert len(plate.svg()) < 600_000
        assert plate.svg() == again.svg()
    assert plates[0].png().startswith(b"\x89PNG")


def test_the_dotted_levels_are_the_estimates(demo: Findings) -> None:
    axes = plot_velocity_loop(demo)
    dotted = [line.get_ydata()[0] for line in axes.get_lines() if line.get_linestyle() == ":"]
    assert demo.loops is not None
    assert dotted == pytest.approx([demo.loops.forward.value, -demo.loops.back.value])
    assert axes.get_ylabel() == "friction [N]"
    assert axes.get_xlabel() == "velocity of the contact [mm/s]"


def test_a_rotary_contact_is_drawn_against_its_angle() -> None:
    time = np.arange(4000) / FS
    torque = 1.5 * np.sign(np.cos(2 * np.pi * time)) + np.random.default_rng(1).normal(0, 0.02, time.size)
    samples = {"theta": 0.3 * np.sin(2 * np.pi * time), "friction": torque}
    plates = {
        plate.name: plate for plate in summary(analyze(ss.Record.of(samples, fs=FS, units={"friction": "N m"}))).plates
    }
    for name, unit in (("displacement", "rad"), ("velocity", "rad/s")):
        axes = plates[f"friction-{name}"].figure.axes[0]
        assert (axes.get_xlabel(), axes.get_ylabel()) == (f"{name} of the contact [{unit}]", "friction [N m]")


def test_a_figure_goes_where_it_is_told(demo: Findings) -> None:
    figure = Figure()
    axes = figure.add_subplot()
    assert plot_velocity_loop(demo, ax=axes) is axes


def test_the_closer_look_holds_about_six_cycles(demo: Findings) -> None:
    near = close_up(demo)
    assert near is not None
    assert near.duration == pytest.approx(6 / 2.5, rel=0.01)


def test_sticks_are_shaded_where_they_are(demo: Findings) -> None:
    near = close_up(demo)
    axes = plot_traces(demo, record=near).axes[0]
    spans = axes.collections[0].get_paths()
    assert near is not None
    shaded = sum(float(np.ptp(path.vertices[:, 0])) for path in spans)
    assert demo.sticks is not None
    assert shaded / near.duration == pytest.approx(demo.sticks.share.value, abs=0.03)


def pushed(*, damper: str = "ground") -> ss.Record:
    """A mass (2 kg, 800 N/m, 3 N s/m) on a moving base, pushed so that its friction is 1.5 N against the motion."""
    w, time = 2 * np.pi, np.arange(8000) / 1000
    x, v, a = 0.02 * np.sin(w * time), 0.02 * w * np.cos(w * time), -0.02 * w**2 * np.sin(w * time)
    z, base_speed = 0.005 * np.sin(w * time + 1), 0.005 * w * np.cos(w * time + 1)
    drag = 3 * (v - base_speed * (damper == "base"))
    samples = {"x": x, "z": z, "v": v, "a": a, "force": 2 * a + drag + 1.5 * np.sign(v) - 800 * (z - x)}
    noise = np.random.default_rng(1).normal(0, 1e-7, time.size)
    return ss.Record.of({**samples, "x": x + noise}, fs=1000.0)


@pytest.mark.parametrize("damper", ["ground", "base"])
def test_each_term_of_the_balance_is_drawn_as_itself(damper: str) -> None:
    record = pushed(damper=damper)
    balanced = ss.friction_force(record, mass=2, stiffness=800, damping=3, damper=damper)
    axes = plot_force_balance(analyze(balanced))
    drawn = {str(line.get_label()): np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()}
    across = record["v"] - (0.005 * 2 * np.pi * np.cos(2 * np.pi * record.time + 1) if damper == "base" else 0)
    expected = {
        "spring": 800 * (record["z"] - record["x"]), "inertia": -2 * record["a"], "damper": -3 * across,
        "applied force": record["force"], "friction": balanced["friction"],
    }  # fmt: skip
    assert list(drawn)[:5] == list(expected)
    for name, values in expected.items():
        assert drawn[name] == pytest.approx(envelope(balanced.time, values)[1], abs=0.005), name


def test_a_balance_by_all_sensors_with_the_damper_on_the_base_is_drawn() -> None:
    slider = ss.Oscillator(
        mass=2.0,
        stiffness=800,
        damping=4.0,
        damper="base",
        law=ss.laws.Coulomb(1.0),
        drive=ss.drives.HarmonicBase(4e-3, frequency=2.0),
    )
    rig = ss.Rig.perfect("x", "z", "a").having("x", white=1e-6)
    record = rig.measure(ss.simulate(slider, duration=3), fs=1000, rng=1)
    constants = {"mass": 2.0, "stiffness": 800, "damping": 4.0, "damper": "base"}
    record = ss.friction_force(record, method="fusion", **constants)  # type: ignore[arg-type]
    assert set(force_balance(record) or ()) == {"spring", "inertia", "damper", "friction"}


def test_a_friction_that_was_measured_has_no_balance_to_draw() -> None:
    record = pushed()
    measured = record.with_channel("friction", 1.5 * np.sign(record["v"]), unit="N")
    assert "force-balance" not in [plate.name for plate in summary(analyze(measured, mass=2, stiffness=800)).plates]
    again = analyze(ss.friction_force(record, mass=2, stiffness=800, damping=3))
    assert "force-balance" in [plate.name for plate in summary(again).plates], "whoever asked for it"


def test_the_comparison_shows_the_line_of_the_coefficient() -> None:
    comparison = compare([slid(0.3 * n, n) for n in (1.0, 2.0, 4.0)])
    axes = plot_load_dependence(comparison)
    line = next(line for line in axes.get_lines() if "×" in str(line.get_label()))
    assert f" {comparison.coefficient.cells[1]} ×" in str(line.get_label()), "rounded as in the table"
    assert comparison.coefficient is not None
    x, y = (np.asarray(part, dtype=float) for part in line.get_data())
    assert y[-1] / x[-1] == pytest.approx(comparison.coefficient.value)
    assert [plate.name for plate in summary(comparison).plates] == ["friction-load", "levels"]


def test_a_regression_is_drawn_with_what_it_leaves_over() -> None:
    time = np.arange(8000) / 1000
    x = 0.1 * np.sin(np.pi * time) + 0.02 * np.sin(3.4 * np.pi * time)
    v, a = np.gradient(x, 1e-3), np.gradient(np.gradient(x, 1e-3), 1e-3)
    force = 3.0 * a + 5.0 * v + 2.0 * np.sign(v) + np.random.default_rng(0).normal(0, 0.3, time.size)
    plates = {plate.name: plate for plate in summary(analyze(ss.Record.of({"x": x, "force": force}, fs=1000))).plates}
    lines = {line.get_label(): line for line in plates["regression"].figure.axes[0].get_lines()}
    assert {"measured", "explained"} <= set(lines)


def test_a_dollar_sign_in_a_name_is_no_mathematics() -> None:
    from dataclasses import replace

    comparison = compare([replace(slid(1.0, 2.0), name="run $\\frac$ <1>.csv"), slid(2.0, 4.0)])
    svg = summary(comparison).plates[1].svg()
    assert "run $\\frac$ &lt;1&gt;.csv" in svg
    ET.fromstring(svg)


def test_the_style_can_be_told_apart_by_the_colour_blind() -> None:
    from stickslip.figures import style

    okabe_ito = {"#0072b2", "#d55e00", "#009e73", "#56b4e9"}
    assert okabe_ito <= {style.BLUE, style.ORANGE, style.GREEN, style.SKY}
    assert STYLE["svg.fonttype"] == "none", "text stays text: small, and found by search"


@given(st.integers(0, 50_000), st.floats(1, 1e6))
def test_no_peak_is_lost_in_drawing(place: int, height: float) -> None:
    values = np.zeros(50_001)
    values[place] = height
    time, drawn = envelope(np.arange(50_001.0), values)
    assert drawn.max() == height
    assert len(time) == len(drawn) == 2 * COLUMNS


def test_an_envelope_bridges_a_missing_sample_and_shows_a_gap() -> None:
    values = np.sin(np.arange(10_000.0))
    values[4000:4003] = np.nan
    assert np.isfinite(envelope(np.arange(10_000.0), values)[1]).all()
    values[4000:4100] = np.nan
    time, drawn = envelope(np.arange(10_000.0), values)
    missing = time[np.isnan(drawn)]
    assert 3990 < missing.min() < missing.max() < 4100


@given(st.integers(1, 10_000), st.integers(1, 500))
def test_thinning_keeps_both_ends(count: int, limit: int) -> None:
    chosen = thinned(count, limit)
    assert len(chosen) <= limit
    assert chosen[0] == 0
    assert limit == 1 or chosen[-1] == count - 1


@pytest.mark.parametrize(
    ("peak", "unit", "shown"),
    [
        (0.0123, "m", "mm"),
        (2e-5, "m/s", "µm/s"),
        (0.3, "N", "N"),
        (4500.0, "N", "kN"),
        (0.002, "J", "mJ"),
        (120.0, "s", "s"),
        (0.5, "rad", "rad"),
        (2.0, "m/s^2", "m/s²"),
        (0.0, "m", "m"),
        (0.29, "1", "1"),
        (199014.0, "N/m", "N/m"),
        (4.2e6, "N/m", "MN/m"),
        (15656605923.0, "N/m", "GN/m"),
    ],
)
def test_units_are_chosen_to_be_read(peak: float, unit: str, shown: str) -> None:
    assert prefixed(peak, unit)[1] == shown


def test_a_result_without_figures_is_refused_in_a_sentence() -> None:
    wave = np.sin(2 * np.pi * 500 * np.arange(4000) / 8000)
    heard = ss.find_squeaks(ss.Record.of({"sound": wave}, fs=8000))
    with pytest.raises(ss.errors.ModelError, match=r"a Squeaks; .* analyze_squeaks, "):
        ss.summary(heard)


def test_a_name_that_is_unknown_is_answered_with_the_nearest() -> None:
    with pytest.raises(AttributeError, match=r"the nearest are .*friction_loops") as caught:
        _ = ss.friction_loop
    assert len(str(caught.value)) < 200
    with pytest.raises(AttributeError, match=r"dir\(stickslip\) lists"):
        _ = ss.qqqqqqqq


def test_a_room_above_the_face_is_an_attribute_too() -> None:
    assert "STEPS" in dir(ss.bench)


@pytest.mark.parametrize("count", [20, 30, 35, 40, 48])
def test_no_label_of_how_often_it_stuck_is_cut(count: int) -> None:
    events = [StickEvent(0.1 * k, kind, 0.05 + d) for k in range(count) for kind, d in (("stick", 0.0), ("slip", 0.1))]
    figure = plot_sticks(SimpleNamespace(sticks=SimpleNamespace(events=events)))  # type: ignore[arg-type]
    figure.canvas.draw()
    for axes in (*figure.axes, *(child for ax in figure.axes for child in ax.child_axes)):
        low, high = axes.get_xlim()
        for place, label in zip(axes.get_xticks(), axes.get_xticklabels(), strict=True):
            if low <= place <= high:
                assert label.get_window_extent().x1 <= figure.bbox.x1


def test_the_label_of_a_colour_bar_stands_beside_its_ticks() -> None:
    time = np.arange(10_000) / 10_000
    tone = np.sin(2 * np.pi * 500 * time) * (np.abs(time - 0.5) < 0.2)
    squeaks = ss.find_squeaks(ss.Record.of({"sound": tone}, fs=10_000))
    figure = Plate("spectrogram", lambda: plot_squeaks(squeaks), "", "").figure
    FigureCanvasAgg(figure).draw()
    bar = figure.axes[-1].yaxis
    ticks = max(tick.label2.get_window_extent().x1 for tick in bar.get_major_ticks())
    assert ticks < bar.label.get_window_extent().x0 < ticks + 30
