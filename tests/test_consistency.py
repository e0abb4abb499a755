"""What can not all be true is said: of records with one thing wrong, and of numbers in a table."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stepped
import stickslip as ss
from rigs import CASES, RIG, measured, told
from stickslip.consistent.sliding_balance import Slider
from stickslip.errors import EstimateError, ModelError, RecordError


@cache
def good() -> ss.Record:
    return told(measured(8.7, 0.03, 3.0)[0])


@cache
def started(frequency: float) -> ss.Record:
    """From rest on, so that the first cycles differ from the later ones."""
    law = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    slider = ss.Oscillator(law=law, drive=ss.drives.HarmonicBase(CASES[frequency][0], frequency=frequency), **RIG)
    return told(ss.Rig().measure(ss.simulate(slider, duration=5.0), fs=4000, rng=1))


def changed(record: ss.Record, **channels: np.ndarray) -> ss.Record:
    return dataclasses.replace(record, samples={**record.samples, **channels})


@pytest.mark.parametrize("rough", [0.0, 0.03])
@pytest.mark.parametrize("frequency", list(CASES))
def test_a_sound_record_is_consistent(frequency: float, rough: float) -> None:
    consistency = ss.consistent.consistency(told(measured(frequency, rough, 3.0)[0]), **RIG)
    assert consistency.status == "ok"
    held = {check.name for check in consistency.checks if check.verdict == "holds"}
    assert held >= {
        "range of the sensors",
        "acceleration is that of the displacement",
        "forces balance at the forcing frequency",
        "energy of whole cycles",
        "mean force is zero",
        "identity of harmonic forcing",
        "sliding without stops",
        "samples of a reversal",
    }


def test_it_seldom_cries_wolf() -> None:
    law = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    run = ss.simulate(ss.Oscillator(law=law, drive=ss.drives.HarmonicBase(1.1e-3, frequency=8.7), **RIG), duration=6.0)
    failed = [
        ss.consistent.consistency(told(ss.Rig().measure(run, fs=4000, rng=s, start=4.0)), **RIG).failed
        for s in range(5)
    ]
    assert not any(failed)


def test_the_rig_comes_from_the_history() -> None:
    record = ss.friction_force(good(), **RIG, method="F")
    assert ss.consistent.consistency(record)["forces balance at the forcing frequency"].verdict == "holds"
    assert ss.consistent.consistency(good())["forces balance at the forcing frequency"].verdict == "can not be told"


@pytest.mark.parametrize("name", ["x", "z", "a", "load"])
def test_a_wrong_sign_is_found(name: str) -> None:
    consistency = ss.consistent.consistency(changed(good(), **{name: -good()[name]}), **RIG)
    assert consistency["one slip that explains it"].sentence == f"{name} has the wrong sign"
    assert f"{name} has the wrong sign" in consistency.status


def test_a_velocity_of_the_wrong_sign_is_found() -> None:
    record = good().with_channel("v", np.gradient(good()["x"], 1 / 4000), unit="m/s")
    record = record.with_details("v", delay=good().channels["x"].delay)
    assert ss.consistent.consistency(record, **RIG)["velocity is that of the displacement"].verdict == "holds"
    turned = ss.consistent.consistency(changed(record, v=-record["v"]), **RIG)["velocity is that of the displacement"]
    assert "opposite signs" in turned.sentence
    assert turned.left * turned.right < 0


@pytest.mark.parametrize("pair", [("x", "z"), ("a", "load"), ("x", "a"), ("z", "load"), ("x", "load"), ("z", "a")])
def test_exchanged_channels_are_found(pair: tuple[str, str]) -> None:
    one, other = pair
    consistency = ss.consistent.consistency(changed(good(), **{one: good()[other], other: good()[one]}), **RIG)
    assert consistency["one slip that explains it"].sentence == f"{one} and {other} are exchanged"


def test_with_motion_sensors_alone_a_sign_is_still_found() -> None:
    bare = ss.Record.of({name: good()[name] for name in ("x", "z", "a")}, fs=4000)
    for name in ("x", "a"):
        consistency = ss.consistent.consistency(changed(bare, **{name: -bare[name]}), **RIG)
        assert consistency["one slip that explains it"].sentence == f"{name} has the wrong sign"
    two = ss.Record.of({name: good()[name] for name in ("x", "z")}, fs=4000)
    swapped = ss.consistent.consistency(changed(two, x=two["z"], z=two["x"]), **RIG)
    assert "exchanged" in swapped["energy of whole cycles"].sentence


def test_a_mistaken_unit_is_found() -> None:
    in_g = ss.consistent.consistency(changed(good(), a=good()["a"] / 9.80665), **RIG)
    assert "a is in g" in in_g["one slip that explains it"].sentence
    in_mm = ss.consistent.consistency(changed(good(), a=1e3 * good()["a"]), **RIG)
    assert "a is in mm/s^2" in in_mm["one slip that explains it"].sentence
    in_lb = ss.consistent.consistency(changed(good(), load=good()["load"] / 4.4482216152605), **RIG)
    assert "load is in lbf" in in_lb["one slip that explains it"].sentence


def test_a_wrong_constant_is_named_with_the_right_one() -> None:
    heavy = ss.consistent.consistency(good(), **{**RIG, "mass": 2.9})["forces balance at the forcing frequency"]
    assert heavy.verdict == "fails"
    assert "a mass of 2.4" in heavy.sentence
    stiff = ss.consistent.consistency(good(), **{**RIG, "stiffness": 2700.0})
    assert {"forces balance at the forcing frequency", "energy of whole cycles"} <= {c.name for c in stiff.failed}
    assert "stiffness of 23" in stiff["forces balance at the forcing frequency"].sentence


def test_a_lag_within_a_cycle_is_measured() -> None:
    late = told(measured(8.7, 0.0, 3.0)[0])
    for name in ("x", "z"):
        late = late.with_details(name, delay=0.0)
    check = ss.consistent.consistency(late, **RIG)["acceleration is that of the displacement"]
    assert check.verdict == "fails"
    assert "a is 1.25 ms ahead of x" in check.sentence
    # the LVDTs come 1.26 ms late (thesis, 2.3)


@pytest.mark.parametrize("frequency", [8.7, 11.1])
@pytest.mark.parametrize("name", ["a", "load"])
@pytest.mark.parametrize("cycles", [2, -3])
def test_a_lag_of_whole_cycles_is_found_where_cycles_differ(frequency: float, name: str, cycles: int) -> None:
    record, rows = started(frequency), round(abs(cycles) * 4000 / frequency)
    whole = len(record) - rows
    mine, others = (record[name][:whole], slice(rows, None)) if cycles > 0 else (record[name][rows:], slice(0, whole))
    samples = {each: mine if each == name else record[each][others] for each in record}
    consistency = ss.consistent.consistency(dataclasses.replace(record, samples=samples), **RIG)
    word = "late" if cycles > 0 else "early"
    assert f"{abs(cycles)} whole cycles {word}" in consistency[f"{name} is of the same cycle as x"].sentence
    other = "load" if name == "a" else "a"
    assert consistency[f"{other} is of the same cycle as x"].verdict != "fails"


@pytest.mark.parametrize("factor", [-1.0, 1e-3, 9.81])
@pytest.mark.parametrize("frequency", [8.7, 11.1])
def test_a_channel_in_a_wrong_unit_or_sign_is_not_told_as_late(frequency: float, factor: float) -> None:
    """Nothing cancels at any shift then, and the least of what is left stood somewhere by chance."""
    record = started(frequency)
    samples = {name: record[name] * (factor if name == "a" else 1.0) for name in record}
    consistency = ss.consistent.consistency(dataclasses.replace(record, samples=samples), **RIG)
    assert consistency["a is of the same cycle as x"].verdict != "fails"


def test_how_a_motion_begins_is_no_lag_of_whole_cycles() -> None:
    """The farthest shift leaves most of it out: on four of thirty rigs the accelerometer was three cycles early."""
    rng = np.random.default_rng([901, 3, stepped.KINDS.index("Stribeck")])
    rig = stepped.drawn("Stribeck", rng)
    record = stepped.record(rig, rng, noise=10 ** rng.uniform(-4, -2.3), felt=True, off=0.004, dirty=False)
    checks = ss.consistent.consistency(ss.Record.of({name: record[name] for name in "xza"}, fs=record.fs), **rig.stated)
    assert checks["a is of the same cycle as x"].verdict == "can not be told"


def test_in_a_steady_motion_whole_cycles_leave_no_trace() -> None:
    check = ss.consistent.consistency(good(), **RIG)["a is of the same cycle as x"]
    assert check.verdict == "can not be told"


def test_a_saturated_cell_a_shifted_zero_and_a_low_rate_are_named() -> None:
    law = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    run = ss.simulate(ss.Oscillator(law=law, drive=ss.drives.HarmonicBase(1.1e-3, frequency=8.7), **RIG), duration=8.0)
    full = told(ss.Rig().having("load", limit=0.9).measure(run, fs=4000, rng=1, start=5.0))
    assert ss.consistent.consistency(full, **RIG)["range of load"].verdict == "fails"
    off = told(ss.Rig().having("a", offset=0.2).measure(run, fs=4000, rng=1, start=5.0))
    assert "zero is off by 0.199" in ss.consistent.consistency(off, **RIG)["mean force is zero"].sentence
    felt = ss.Rig.perfect("x", "z", "a", "load").having("x", offset=2e-4).measure(run, fs=4000, rng=1, start=5.0)
    either = {name: off for slip in ss.consistent.consistency(felt, **RIG).zeros for name, off in slip.zeros.items()}
    assert either["x"] == pytest.approx(2e-4, rel=0.05), "or the load cell's, which the balance can not tell from it"
    for name, off in either.items():
        mended = felt.with_channel(name, felt[name] - off, unit=felt.channels[name].unit)
        assert not ss.consistent.consistency(mended, **RIG).zeros
    slow = told(ss.Rig().measure(run, fs=400, rng=1, start=5.0))
    assert "too few to see" in ss.consistent.consistency(slow, **RIG)["samples of a reversal"].sentence


def test_sliding_against_more_than_the_base_can_give_is_no_motion() -> None:
    """Friction doubled in the record: F > pi k Z / 4, and the mass goes on."""
    record = told(measured(5.61, 0.0, 3.0)[0])
    found = ss.consistent.consistency(changed(record, load=1.5 * record["load"]), **RIG)["sliding without stops"]
    assert found.verdict == "fails"
    assert "pi k Z / 4" in found.sentence


def test_a_motion_that_does_not_repeat_is_checked_where_it_can_be() -> None:
    rng = np.random.default_rng(2)
    drive = ss.drives.MultiTone(tuple((1e-3 / n, 2.0 + 1.37 * n, 6.28 * rng.random()) for n in range(1, 6)))
    run = ss.simulate(ss.Oscillator(law=ss.laws.Coulomb(1.5), drive=drive, **RIG), duration=20.0)
    record = told(ss.Rig().measure(run, fs=1000, rng=1, start=2.0))
    consistency = ss.consistent.consistency(record, **RIG)
    assert consistency["mean force is zero"].verdict == "can not be told"
    assert consistency["acceleration is that of the displacement"].verdict == "holds"
    assert "no cycle is like another" in consistency["energy of whole cycles"].sentence


@pytest.mark.parametrize("damper", ["ground", "base"])
def test_a_mass_that_a_force_drives_is_checked_too(damper: str) -> None:
    law = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    slider = ss.Oscillator(
        mass=2.42, stiffness=2310, damping=5.0, law=law, drive=ss.drives.HarmonicForce(4.0, frequency=6.0)
    )
    record = ss.Rig.perfect().measure(ss.simulate(slider, duration=8.0), fs=4000, rng=1, start=5.0)
    record = record.with_channel("force", 4.0 * np.cos(2 * np.pi * 6.0 * (5.0 + record.time)), unit="N")
    consistency = ss.consistent.consistency(record, mass=2.42, stiffness=2310, damping=5.0, damper=damper)
    assert consistency.status == "ok"
    assert consistency["energy of whole cycles"].verdict == "holds"
    without = ss.consistent.consistency(record, mass=2.42, stiffness=2310)["energy of whole cycles"]
    assert (without.verdict, without.left > without.right) == ("fails", True)


def test_plain_data_and_words() -> None:
    consistency = ss.consistent.consistency(good(), **RIG)
    data = consistency.to_dict()
    assert data["status"] == "ok"
    assert len(data["checks"]) == len(consistency.checks)
    assert all(
        value is None or not isinstance(value, float) or math.isfinite(value)
        for check in data["checks"]
        for value in check.values()
    )
    assert "energy of whole cycles: holds" in repr(consistency)
    with pytest.raises(EstimateError, match="no check"):
        consistency["magic"]


def test_what_can_not_be_checked_is_refused() -> None:
    with pytest.raises(RecordError, match="x"):
        ss.consistent.consistency(ss.Record.of({"a": good()["a"]}, fs=4000))
    with pytest.raises(EstimateError, match="tolerance"):
        ss.consistent.consistency(good(), tolerance=0.0)


def test_a_sensor_that_does_not_change_is_named_and_left_out() -> None:
    still = ss.consistent.consistency(changed(good(), a=np.full(len(good()), 0.3)), **RIG)
    assert still["a is heard"].verdict == "fails"
    assert "a does not change, it reads 0.3 m/s^2" in still["a is heard"].sentence
    assert still["acceleration is that of the displacement"].verdict == "can not be told"
    assert still["forces balance at the forcing frequency"].verdict == "holds"
    with pytest.raises(RecordError, match="channel x does not change"):
        ss.consistent.consistency(changed(good(), x=np.full(len(good()), 1e-3)), **RIG)


def test_a_sensor_with_gaps_is_named_and_left_out() -> None:
    gaps = good()["a"].copy()
    gaps[500:600] = np.nan
    consistency = ss.consistent.consistency(changed(good(), a=gaps), **RIG)
    assert consistency.status == "ok"
    assert "100 values that are not numbers" in consistency["a is heard"].sentence
    assert consistency["a is heard"].verdict == "can not be told"


@pytest.mark.parametrize("frequency", [2.5, 8.7])
def test_the_rate_that_is_advised_hangs_little_on_the_rate_that_was_taken(frequency: float) -> None:
    law = ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9)
    drive = ss.drives.HarmonicBase(CASES[frequency][0], frequency=frequency)
    run = ss.simulate(ss.Oscillator(law=law, drive=drive, **RIG), duration=6.0)
    rates = []
    for fs in (100, 250, 500):
        check = ss.consistent.consistency(told(ss.Rig().measure(run, fs=fs, rng=3, start=3.0)), **RIG)[
            "samples of a reversal"
        ]
        assert check.verdict == "can not be told"
        rates.append(float(check.sentence.partition("sample at ")[2].split()[0]))
    assert max(rates) <= 2 * min(rates)
    assert 10 * 45 < min(rates) < 3000  # the mass rings on its contact at 45 Hz


# ---- real records


def test_the_shaken_frame_is_consistent(dataset: Callable[[str], Path]) -> None:
    folder = dataset("frame_base_excited")
    record = ss.read_record(
        [folder / "s_b_450g_x.mat", folder / "s_b_450g_y.mat"], channels={"x": "x [mm]", "z": "y [mm]"}
    )
    rig: dict[str, Any] = {"mass": 3.0799, "stiffness": 1191, "damping": 0.669, "damper": "base"}
    consistency = ss.consistent.consistency(ss.friction_force(record, **rig))
    assert consistency.status == "ok"
    assert consistency["energy of whole cycles"].verdict == "holds"
    exchanged = ss.consistent.consistency(changed(record, x=record["z"], z=record["x"]), **rig)
    assert "exchanged" in exchanged.status


def test_of_the_band_brake_it_says_what_can_be_told(dataset: Callable[[str], Path]) -> None:
    path = dataset("band_brake_damper") / "0.5Hz35lbtension.json"
    record = ss.read_record(path, channels={"x": "#2 [in]", "load": "c3 [kip]", "v": "#4 [in/s]"}, time="#1")
    consistency = ss.consistent.consistency(record)
    assert consistency["energy of whole cycles"].verdict == "holds"
    assert consistency["velocity is that of the displacement"].verdict == "holds"
    assert consistency["forces balance at the forcing frequency"].verdict == "can not be told"
    turned = ss.consistent.consistency(changed(record, load=-record["load"]))
    assert "friction gives energy" in turned["energy of whole cycles"].sentence


# ---- numbers of a table

# Thesis, Tables 3.2 and 3.3: friction, contact stiffness, amplitude, base amplitude (measured), transition speed
ROWS = {
    5.61: ("1.06 N", "201000 N/m", "0.49 mm", "0.51 mm", "0.0035 m/s"),
    8.7: ("1.10 N", "181000 N/m", "0.485 mm", "1.1 mm", "0.0058 m/s"),
    11.1: ("1.28 N", "194000 N/m", "0.48 mm", "2.0 mm", "0.0080 m/s"),
}


def row(frequency: float) -> dict[str, Any]:
    names = ("sliding friction", "contact stiffness", "amplitude", "base amplitude", "transition speed")
    return {
        "mass": 2.42,
        "stiffness": 2310.0,
        "forcing frequency": frequency,
        **dict(zip(names, ROWS[frequency], strict=True)),
    }


def test_the_rows_at_5_61_hz_contradict_each_other() -> None:
    consistency = ss.consistent.consistency(row(5.61))
    names = {check.name for check in consistency.failed}
    assert names == {"energy", "friction that base and amplitude ask for", "sliding without stops"}
    needed = consistency["friction that base and amplitude ask for"]
    assert 0.87 < needed.right < 0.89  # as an independent simulation found
    assert "20 % more is stated" in needed.sentence
    assert consistency["transition speed"].verdict == "holds"


@pytest.mark.parametrize("frequency", [8.7, 11.1])
def test_the_other_rows_hold_within_their_rounding(frequency: float) -> None:
    assert ss.consistent.consistency(row(frequency)).status == "ok"


def test_stated_numbers_may_be_estimates_or_pairs() -> None:
    sure = row(5.61)
    sure["amplitude"] = (0.49e-3, 0.2e-3)
    sure["sliding friction"] = ss.Estimate.normal("sliding friction", 1.06, sd=0.2, unit="N", method="")
    assert ss.consistent.consistency(sure).status == "ok"  # so unsure that it may be true
    rounded, exact = (
        ss.consistent.consistency(row(8.7), tolerance=1e-6),
        ss.consistent.consistency({**row(8.7), "base amplitude": 1.1e-3}, tolerance=1e-6),
    )
    name = "friction that base and amplitude ask for"
    assert rounded[name].discrepancy < 0.5 * exact[name].discrepancy


def test_stated_numbers_without_meaning_are_refused() -> None:
    with pytest.raises(ModelError, match="colour"):
        ss.consistent.consistency({**row(8.7), "colour": 3.0})
    with pytest.raises(EstimateError, match="amplitude"):
        ss.consistent.consistency({name: value for name, value in row(8.7).items() if name != "amplitude"})
    with pytest.raises(ModelError, match="positive"):
        ss.consistent.consistency({**row(8.7), "mass": -1.0})
    with pytest.raises(ss.errors.RecordError):
        ss.consistent.consistency({**row(8.7), "mass": "2 mm"})


# ---- the closed forms


@pytest.mark.parametrize(
    ("b", "r", "z", "amplitude"),
    [
        (0.6, 0.3, 0.0, 1.5356018092808652),
        (0.8, 0.5, 0.0, 2.3322349875413653),
        (1.3, 0.4, 0.0, 1.2009006123575887),
        (2.0, 0.2, 0.0, 0.31797973380564853),
        (0.8, 0.5, 0.05, 1.9293215304847432),
        (1.3, 0.4, 0.1, 0.90533083487309023),
        (2.0, 0.2, 0.02, 0.31559307764650139),
    ],
)
def test_den_hartogs_drive(b: float, r: float, z: float, amplitude: float) -> None:
    assert Slider(1.0, 1.0, b, 2 * z).drive(amplitude, r) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    ("b", "z", "share"),
    [
        (0.3, 0.0, 0.086407277853965626),
        (0.5, 0.0, 1 / 3),
        (0.8, 0.0, 0.81740638571088274),
        (3.0, 0.0, 0.5625),
        (1.1, 0.0, 0.74677231148819771),
        (0.3, 0.02, 0.067725937424001559),
        (0.9, 0.2, 0.56797327234168904),
    ],
)
def test_den_hartogs_boundary(b: float, z: float, share: float) -> None:
    assert Slider(1.0, 1.0, b, 2 * z).boundary() == pytest.approx(share, rel=1e-4)


def test_the_boundary_at_resonance_and_far_above() -> None:
    assert Slider(1.0, 1.0, 1.0).boundary() == pytest.approx(math.pi / 4, rel=1e-4)
    assert Slider(1.0, 1.0, 200.0).boundary() == pytest.approx(1 / math.hypot(1, math.pi / 2), rel=1e-3)


@pytest.mark.parametrize(
    ("frequency", "friction", "contact", "base", "amplitude"),
    [
        (5.61, 1.06, 201000.0, 0.6e-3, 3.351651575369614e-4),
        (8.7, 1.10, 181000.0, 1.1e-3, 4.583018372375212e-4),
        (11.1, 1.28, 194000.0, 2.0e-3, 4.790057107500766e-4),
    ],
)
def test_the_drive_of_an_elastic_contact(
    frequency: float, friction: float, contact: float, base: float, amplitude: float
) -> None:
    slider = Slider(2.42, 2310.0, 2 * math.pi * frequency, 0.0, contact)
    assert slider.drive(amplitude, friction) / 2310 == pytest.approx(base, rel=2e-5)
