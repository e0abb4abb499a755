"""A sweep written down, run from the command line, and drawn."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import stickslip as ss
from stickslip.cli.program import main
from stickslip.errors import ModelError
from stickslip.figures.maps import den_hartog
from stickslip.scenarios import forced, grid

pytest.importorskip("xarray")
pytest.importorskip("zarr")
SLIDER = """
system = { mass = 2.42, stiffness = "2.31 N/mm", damping = 0.12 }
law = { name = "Coulomb", kinetic = 1.1 }
drive = { name = "HarmonicBase", amplitude = "0.65 mm", frequency = 2.5 }
"""
GRID = """
system = "slider.toml"
measures = ["stops", "amplitude"]
cycles = 4
settle = 40
[grid]
frequency = { from = "2 Hz", to = 9, points = 8 }
kinetic = ["200 mN", 0.7, 1.2]
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "slider.toml").write_text(SLIDER)
    (tmp_path / "grid.toml").write_text(GRID)
    return tmp_path / "grid.toml"


def test_a_file_is_the_sweep_it_says(file: Path) -> None:
    asked = ss.maps.read_sweep(file)
    assert asked.case.system.drive.amplitude == pytest.approx(0.65e-3)  # type: ignore[union-attr]
    assert np.allclose(asked.grid["frequency"], np.linspace(2, 9, 8))
    assert asked.grid["kinetic"] == [0.2, 0.7, 1.2]
    assert (asked.measures, asked.cycles, asked.settle) == (("stops", "amplitude"), 4, 40)


def test_a_file_has_laws_and_what_changes_together(file: Path) -> None:
    laws = (
        'law = [{ name = "Coulomb", kinetic = "1.1 N" }, { name = "CompliantContact", kinetic = 1, stiffness = 2e5 }]'
    )
    pairs = '"mass, stiffness" = [[1, 4], ["2 kg", "8 N/m"]]'
    file.write_text(GRID.replace('kinetic = ["200 mN", 0.7, 1.2]', f"{laws}\n{pairs}"))
    grid = ss.maps.read_sweep(file).grid
    assert grid["law"] == [ss.laws.Coulomb(1.1), ss.laws.CompliantContact(1.0, 2e5)]
    assert grid["mass", "stiffness"] == [(1.0, 4.0), (2.0, 8.0)]
    file.write_text(GRID.replace('kinetic = ["200 mN", 0.7, 1.2]', '"mass, stiffness" = [[1, 4], [2]]'))
    with pytest.raises(ModelError, match=r"line 8.*mass, stiffness.*list of lists"):
        ss.maps.read_sweep(file)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("points = 8", "points = 0", "line 7.*points = 0"),
        ("points = 8", "points = 1000000000", "line 7.*points = 1000000000.*10000000"),
        ('"2 Hz"', '"2 mm"', "line 7.*mm"),
        ("[0", '["', "TOML|TOML file"),
        ("kinetic =", "kinetc =", "no parameter is called 'kinetc'"),
        ("cycles = 4", "cyles = 4", "key 'cyles'.*cycles"),
        ('["200 mN", 0.7, 1.2]', "1.0", "a list"),
        ("to = 9, points = 8", 'to = -9, points = 8, scale = "log"', "logarithmic"),
        (
            "cycles = 4",
            'law = { name = "Dahl" }',
            r"line 4, has the key 'law'; .*file that system = names; .*slider.toml",
        ),
        ("[grid]", "[law]", r"line 6, has the key 'law'; .*file that system = names; .*slider.toml"),
        ("[grid]", "[[contacts]]", "has the key 'contacts'; .*file that system = names"),
    ],
)
def test_a_mistake_in_the_file_is_named(file: Path, old: str, new: str, words: str) -> None:
    file.write_text(GRID.replace(old, new))
    if old == "[0":
        file.write_text(GRID + '\nbroken = "')
    with pytest.raises(ModelError, match=words):
        ss.maps.read_sweep(file)


def test_a_file_with_an_empty_grid_is_refused(file: Path) -> None:
    file.write_text(GRID.partition("frequency")[0])
    with pytest.raises(ModelError, match=r"grid.toml, line 6, has an empty grid.*kinetic = "):
        ss.maps.read_sweep(file)


@pytest.mark.figures
def test_the_command_maps_keeps_and_draws(file: Path, tmp_path: Path) -> None:
    store = tmp_path / "map.zarr"
    command = ["sweep", str(file), "--store", str(store), "--output", str(tmp_path / "maps"), "--json"]
    run = CliRunner().invoke(main, command, catch_exceptions=False)
    assert run.exit_code == 0, run.output
    data = json.loads(run.output)
    assert data["status"] == "complete"
    assert data["variables"]["amplitude"]["known"] == 24
    assert {path.name for path in (tmp_path / "maps" / "figures").glob("*.png")} == {"stops.png", "amplitude.png"}
    page = (tmp_path / "maps" / "report.html").read_text("utf-8")
    assert "24 motions over frequency and kinetic: " in page
    again = CliRunner().invoke(main, ["sweep", str(file), "--store", str(store)], catch_exceptions=False)
    assert again.exit_code == 0
    assert "8 x 3 points, complete" in again.output
    wrong = CliRunner().invoke(main, ["sweep", str(file), "--engine", "gpu"], catch_exceptions=False)
    assert wrong.exit_code == 2


def test_the_curve_over_the_map_is_den_hartogs() -> None:
    for ratio, damping, boundary in grid("DH-2")["boundary"]:
        curve = den_hartog(
            forced(ratio, 0.5, damping_ratio=damping), ("frequency", "kinetic"), np.array([ratio]) / (2 * np.pi)
        )
        assert curve is not None
        assert curve[0] == pytest.approx(boundary, rel=1e-4)  # as fine as it is drawn
    assert den_hartog(forced(0.8, 0.5, static_ratio=1.2), ("frequency", "kinetic"), np.array([1.0])) is None


def test_the_map_is_drawn_over_its_parameters() -> None:
    slider = forced(0.8, 0.5)
    values = {"frequency": np.linspace(0.08, 0.3, 12), "kinetic": np.linspace(0.1, 1.2, 10)}
    atlas = ss.sweep(slider, values, measures=["stops", "amplitude", "multipliers"], settle=60, cycles=20)
    ax = ss.figures.plot_map(atlas, system=slider)
    drawn = ax.collections[0].get_array()
    assert np.array_equal(np.ravel(drawn), np.ravel((atlas.normal_stops + atlas.abnormal_stops).values.T))
    assert [line.get_label() for line in ax.lines] == ["Den Hartog (1931): no stops below"]
    assert len(ss.figures.plot_map(atlas, variable="multiplier").collections) == 1
    curve = ss.figures.plot_map(atlas.isel(kinetic=3), variable="amplitude")
    assert np.allclose(curve.lines[0].get_xdata(), values["frequency"])
    stops = ss.figures.plot_map(atlas.isel(frequency=3))
    assert all(tick == int(tick) for tick in stops.get_yticks())
    status = ss.figures.plot_map(atlas, variable="status").figure.axes[1]
    assert [tick.get_text() for tick in status.get_yticklabels()] == ["moving", "at rest"]
    with pytest.raises(ModelError, match="has no 'stick'"):
        ss.figures.plot_map(atlas, variable="stick")


@pytest.mark.figures
def test_a_map_that_can_not_be_drawn_says_why(tmp_path: Path) -> None:
    slider = forced(0.8, 0.5)
    cube = {"frequency": [0.1, 0.13], "kinetic": [2.0, 3.0], ("mass", "stiffness"): [(1, 1), (2, 2)]}
    atlas = ss.sweep(slider, cube, measures=["stops"], settle=2, cycles=2)
    page = (ss.publish(atlas, folder=tmp_path / "cube", system=slider) / "report.html").read_text("utf-8")
    assert "over frequency and kinetic and mass with stiffness: 8 at rest" in page
    assert "There is no figure: the map is over 3 parameters" in page
    assert "Nothing moves anywhere" in page
    thin = ss.sweep(slider, {**cube, "kinetic": [0.5]}, measures=["stops"], settle=2, cycles=2)
    folder = ss.publish(thin.isel(mass_stiffness=[0]), folder=tmp_path / "thin", system=slider)
    assert "no figure" not in (folder / "report.html").read_text("utf-8")
    assert (folder / "figures" / "stops.png").is_file()


def test_what_is_white_on_a_map_is_explained() -> None:
    from stickslip.figures.maps import plates_of

    slider = forced(0.8, 0.5)
    atlas = ss.sweep(
        slider, {"frequency": [0.1, 0.13], "kinetic": [0.1, 0.5]}, measures=["multipliers"], settle=0, cycles=2
    )
    assert bool(atlas.multiplier.isnull().all())
    (figure,) = plates_of(atlas)
    assert figure.caption.endswith("White: no number at 4 of 4 points (no orbit repeats yet after the settling).")
    whole = ss.sweep(slider, {"kinetic": [-1.0, 0.5], "frequency": [0.1, 0.13]}, measures=["stops"], settle=2, cycles=2)
    legend = ss.figures.plot_map(whole).get_legend()
    assert legend is not None
    assert legend.get_texts()[0].get_text() == "white: no number at 2 of 4 points (no such system)"
