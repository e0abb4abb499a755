"""What can not be is not claimed: bounds of physics, units that nobody stated, noise taken for a swing."""

from __future__ import annotations

import functools
import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.signal import lsim

import stickslip as ss
from stickslip.cli.program import main
from stickslip.estimate import Estimate
from stickslip.law.verdict import Evidence, Misfit, standings

MASS, SPRING, FS, STEPS = 2.0, 3000.0, 2000, 20


@functools.cache
def rig(
    *,
    elastic: float = math.inf,
    level: float = 0.0,
    damping: float = 0.0,
    amplitude: float = 1e-3,
    frequency: float = 2.0,
    duration: float = 6.0,
) -> dict[str, np.ndarray]:
    """A mass on a driven spring by steps of 25 us: a Jenkins contact (a spring that slips at `level`), and a damper."""
    step, x, v, held = 1 / (FS * STEPS), 0.0, 0.0, 0.0
    rows = []
    for row in range(round(duration * FS * STEPS)):
        z = amplitude * math.sin(2 * math.pi * frequency * row * step)
        if math.isfinite(elastic):
            held = min(level, max(-level, held + elastic * v * step))
        friction = held + damping * v
        acceleration = (SPRING * (z - x) - friction) / MASS
        if row % STEPS == 0:
            rows.append((x, z, v, acceleration, friction))
        v += acceleration * step
        x += v * step
    return dict(zip(("x", "z", "v", "a", "friction"), np.array(rows).T, strict=True))


def seen(made: dict[str, np.ndarray], *names: str, seed: int, **noise: float) -> ss.Record:
    """Channels as sensors read them, from the second second on."""
    rng = np.random.default_rng(seed)
    channels = {name: made[name][FS:] + rng.normal(0, noise.get(name, 0.0), len(made[name]) - FS) for name in names}
    return ss.Record.of(channels, fs=FS)


def sentences(findings: ss.answers.Findings) -> str:
    return " ".join(ss.summary(findings).headline)


# ---- estimates


def test_an_estimate_is_cut_to_what_is_possible() -> None:
    below = Estimate.normal("friction", -0.1, sd=0.2, unit="N", method="").within(0.0)
    assert below.known
    assert below.value == 0
    assert below.interval[0] == 0
    assert below.interval[1] == pytest.approx(-0.1 + 1.96 * 0.2, rel=1e-3)
    inside = Estimate.normal("friction", 1.0, sd=0.2, unit="N", method="")
    assert inside.within(0.0) is inside


def test_an_estimate_that_can_not_be_has_no_value_and_says_why() -> None:
    for impossible in (
        Estimate.normal("friction", -0.1, sd=0.01, unit="N", method=""),
        Estimate("friction", -0.1, (-math.inf, math.inf), math.inf, "N", ""),
    ):
        told = impossible.within(0.0, otherwise="the sign is wrong")
        assert not told.known
        assert told.status == "the sign is wrong"
        assert told.to_dict()["value"] is None
        assert told.to_dict()["interval"] == [None, None]
        assert not told.scaled(2.0, "N").known


# ---- what a contact does before it slips


@pytest.mark.parametrize(("damping", "seed"), [(12.0, 41), (60.0, 42)])
def test_a_damper_is_no_contact_that_gives_way(damping: float, seed: int) -> None:
    for frequency in (2.0, 5.0):
        record = seen(rig(damping=damping, frequency=frequency), "x", "z", seed=seed, x=2e-7)
        presliding = ss.cycle.presliding(ss.friction_force(record, mass=MASS, stiffness=SPRING))
        assert presliding.verdict == "can not be told"
        assert presliding.stiffness is None
        assert not any(estimate.known for estimate in presliding.estimates)
        assert all(estimate.status == presliding.evidence for estimate in presliding.estimates)


@pytest.mark.parametrize(("elastic", "seed"), [(2e4, 51), (8e4, 52)])
def test_a_contact_that_gives_way_is_still_told(elastic: float, seed: int) -> None:
    record = seen(rig(elastic=elastic, level=1.2, damping=60.0), "x", "z", seed=seed, x=2e-7)
    presliding = ss.cycle.presliding(ss.friction_force(record, mass=MASS, stiffness=SPRING, damping=60.0))
    assert presliding.verdict == "gives way"
    assert presliding.stiffness is not None
    assert presliding.stiffness.value == pytest.approx(elastic, rel=0.2)


def test_a_build_up_as_fast_as_the_filter_has_no_stiffness() -> None:
    record = seen(rig(elastic=2e6, level=1.2, amplitude=3e-3, frequency=5.0), "x", "z", seed=53, x=2e-6)
    try:
        presliding = ss.cycle.presliding(ss.friction_force(record, mass=MASS, stiffness=SPRING))
    except ss.errors.EstimateError:
        return
    assert presliding.stiffness is None


# ---- friction and its level


@pytest.mark.parametrize("seed", range(61, 65))
def test_a_rig_without_friction_has_none_below_zero(seed: int) -> None:
    record = seen(rig(damping=1.0, frequency=4.0, duration=4.0), "x", "z", seed=seed, x=1e-6)
    loops = ss.friction_loops(ss.friction_force(record, mass=MASS, stiffness=SPRING, damping=1.0))
    for each in (loops.level, loops.forward, loops.back, loops.energy_per_cycle):
        assert not each.known or each.interval[0] >= 0
    assert not loops.level.known or loops.level.interval[1] < 0.05


def test_no_friction_is_told_as_at_most() -> None:
    record = seen(rig(damping=1.0, frequency=4.0, duration=4.0), "x", "z", seed=62, x=1e-6)
    findings = ss.analyze(record, mass=MASS, stiffness=SPRING, damping=1.0)
    assert findings.level is not None
    assert findings.level.interval[0] == 0
    assert "No sliding friction is resolved: it is below" in sentences(findings)
    assert "slides against" not in sentences(findings)


def test_a_friction_that_drives_is_no_number() -> None:
    made = rig(elastic=1e5, level=1.2, damping=2.0)
    findings = ss.analyze(seen({**made, "friction": -made["friction"]}, "x", "friction", seed=71, friction=0.01))
    assert findings.loops is not None
    assert findings.level is None
    assert not findings.loops.level.known
    assert not findings.loops.energy_per_cycle.known
    assert "-" not in sentences(findings).replace("stick-slip", "")
    assert "slides against" not in sentences(findings)
    assert ss.summary(findings).data()["estimates"][0]["value"] is None
    assert ss.summary(findings).plates


# ---- friction against the load


def test_friction_that_begins_late_is_not_below_zero_without_load() -> None:
    levels = [Estimate.normal("friction", 0.4 * (load - 1), sd=0.005, unit="N", method="") for load in (2, 4, 8)]
    line = ss.law.friction_over_load(levels, loads=[2, 4, 8])
    assert not line.adhesion.known
    assert line.coefficient.value == pytest.approx(0.4, abs=0.005)
    assert line.friction(6).value == pytest.approx(2.0, abs=0.02)
    assert not line.friction(0.5).known


def test_an_adhesion_within_its_scatter_of_zero_is_one_sided() -> None:
    levels = [Estimate.normal("friction", 0.4 * load - 0.01, sd=0.02, unit="N", method="") for load in (2, 4, 8)]
    line = ss.law.friction_over_load(levels, loads=[2, 4, 8])
    assert line.adhesion.value == 0
    assert line.adhesion.interval[0] == 0
    assert line.adhesion.interval[1] > 0
    assert line.friction(6).value == pytest.approx(2.39, abs=1e-6)


def test_records_side_by_side_have_no_friction_below_zero_at_no_load() -> None:
    time, rng = np.arange(4000) / 500, np.random.default_rng(72)

    def slide(load: float) -> ss.answers.Findings:
        friction = 0.3 * (load - 1) * np.sign(np.cos(2 * np.pi * time)) + rng.normal(0, 0.01, time.size)
        x = np.sin(2 * np.pi * time) / (2 * np.pi)
        return ss.analyze(ss.Record.of({"x": x, "friction": friction, "normal": np.full(time.size, load)}, fs=500))

    comparison = ss.compare([slide(load) for load in (2.0, 4.0, 8.0)])
    assert not comparison.offset.known
    assert comparison.coefficient is not None
    assert comparison.coefficient.status != "ok"


# ---- frequencies


def test_forces_agree_up_to_no_more_than_half_the_sampling_rate() -> None:
    made = rig(elastic=1e5, level=1.2, damping=2.0)
    record = seen({**made, "load": made["friction"]}, "x", "z", "a", "load", seed=81, x=1e-9, a=1e-6, load=1e-6)
    agree_up_to = ss.balance.compare_force(record, mass=MASS, stiffness=SPRING).agree_up_to
    assert 0 <= agree_up_to.interval[0] <= agree_up_to.value <= agree_up_to.interval[1] <= FS / 2


# ---- misfits


def test_no_misfit_is_below_one() -> None:
    """The criterion weighs what tells many stories: the best law by it may leave more on the mean."""
    evidence = Evidence({("x", 0): 400.0, ("load", 0): 10.0}, {("x", 0): 1e-3, ("load", 0): 1e-3})
    tried = [
        Misfit("Coulomb", 1, {("x", 0): 1.0, ("load", 0): 2.0}),
        Misfit("compliant", 3, {("x", 0): 1.3, ("load", 0): 0.8}),
        Misfit("LuGre", 5, {("x", 0): 1.0, ("load", 0): 1.95}),
    ]
    for order in itertools.permutations(tried):
        told, _ = standings(order, evidence)
        assert told[0].name == "Coulomb"
        assert all(each.misfit >= 1 for each in told)
        rejected = {each.name: each.verdict for each in told if not each.kept}
        assert "times" not in rejected.get("compliant", "")


# ---- units that nobody stated, and channels that contradict each other


def written(folder: Path, record: ss.Record, *, units: bool) -> Path:
    """The record as a table of a data logger, with its units in the header or without."""
    names = [f"{name} [{record.channels[name].unit}]" if units else name for name in record]
    columns = np.column_stack([record.time, *(record[name] for name in record)])
    path = folder / "logger.csv"
    np.savetxt(path, columns, delimiter=",", header=",".join(["time [s]", *names]), comments="", fmt="%.9g")
    return path


def millimetres(*names: str, seed: int) -> ss.Record:
    """x and z as numbers of millimetres, which somebody takes for metres."""
    made = rig(elastic=1e5, level=1.2, damping=60.0)
    return seen({**made, "x": 1e3 * made["x"], "z": 1e3 * made["z"]}, *names, seed=seed, x=2e-4)


def test_a_unit_that_nobody_stated_is_a_finding_that_leads(tmp_path: Path) -> None:
    record = ss.read_record(written(tmp_path, millimetres("x", "z", seed=91), units=False))
    unstated = [fault for fault in record.check() if fault.kind == "unit"]
    assert len(unstated) == 1
    assert "x and z state no unit: read as m and m they span" in str(unstated[0])
    findings = ss.analyze(record, mass=MASS, stiffness=SPRING)
    headline = ss.summary(findings).headline
    assert headline[:1] == [str(fault) for fault in unstated]
    assert findings.level is not None
    assert findings.level.status != "ok"
    items = list(ss.summary(findings).data())
    assert items.index("faults") < items.index("estimates")


def test_a_unit_that_was_stated_is_no_finding(tmp_path: Path) -> None:
    path = written(tmp_path, millimetres("x", "z", seed=92), units=False)
    for stated in ({"units": {"x": "mm", "z": "mm"}}, {"channels": {"x": "x [mm]", "z": "z [mm]"}}):
        record = ss.read_record(path, **stated)  # type: ignore[arg-type]
        assert not any(fault.kind == "unit" for fault in record.check())
    assert not ss.read_record(written(tmp_path, millimetres("x", "z", seed=93), units=True)).check()


def test_a_record_written_again_keeps_that_its_unit_was_assumed(tmp_path: Path) -> None:
    record = ss.read_record(written(tmp_path, millimetres("x", "z", seed=94), units=False))
    again = ss.read_record(ss.write_record(record, tmp_path / "again.csv"))
    assert [fault.kind for fault in again.check()] == [fault.kind for fault in record.check()]


def test_terminal_page_and_json_begin_with_the_unit(tmp_path: Path) -> None:
    path = written(tmp_path, millimetres("x", "z", seed=95), units=False)
    run = CliRunner()
    asked = ["analyze", str(path), "--mass", str(MASS), "--stiffness", str(SPRING), "--output", str(tmp_path / "out")]
    text = " ".join(run.invoke(main, asked).output.split())
    assert text.index("x and z state no unit") < text.index("slides against")
    assert text.count("state no unit") == 1
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert page.index("x and z state no unit") < page.index("slides against")
    told = (tmp_path / "out" / "results.json").read_text(encoding="utf-8")
    assert told.index("x and z state no unit") < told.index('"estimates"')


@pytest.mark.parametrize(("scale", "seed"), [(1 / 9.80665, 101), (1e3, 102)])
def test_channels_that_contradict_each_other_lead_and_no_force_is_told(scale: float, seed: int) -> None:
    made = rig(elastic=1e5, level=1.2, damping=60.0, frequency=4.0)
    record = seen({**made, "a": scale * made["a"]}, "x", "z", "a", seed=seed, x=2e-7, a=1e-3 * scale)
    findings = ss.analyze(record, mass=MASS, stiffness=SPRING, damping=60.0)
    headline = ss.summary(findings).headline
    assert headline[0].startswith("Probably ")
    assert "a is in" in headline[0]
    assert not any(f" {unit} " in sentence for sentence in headline for unit in ("N", "kN", "mN", "N/m", "kg"))
    assert findings.loops is not None
    assert findings.loops.level.status.startswith("something is stated wrongly: probably ")
    items = list(ss.summary(findings).data())
    assert items.index("contradiction") < items.index("estimates")


def test_channels_that_agree_contradict_nothing() -> None:
    made = rig(elastic=1e5, level=1.2, damping=60.0, frequency=4.0)
    findings = ss.analyze(seen(made, "x", "z", "a", seed=103, x=2e-7, a=1e-3), mass=MASS, stiffness=SPRING, damping=60)
    assert not findings.contradiction
    assert "slides against" in ss.summary(findings).headline[0]


# ---- the swing of the friction, and whose noise it is


@pytest.mark.parametrize(("noise", "seed"), [(0.02, 111), (0.05, 112), (0.1, 113)])
def test_an_accelerometer_s_noise_is_no_swing_of_the_friction(noise: float, seed: int) -> None:
    """A contact whose friction is constant while it slides, by an accelerometer of some noise."""
    made = rig(elastic=3e5, level=1.2, damping=60.0, amplitude=2e-3)
    record = seen(made, "x", "z", "a", seed=seed, x=2e-7, a=noise)
    record = ss.friction_force(record.with_details("a", noise=noise), mass=MASS, stiffness=SPRING, damping=60.0)
    breakaway = ss.cycle.breakaway(record)
    for swing in (breakaway.swing_forward, breakaway.swing_back):
        assert swing is not None
        assert swing.interval[0] < 0.3 * MASS * noise / 1.2  # it is told from none by no more than that
        assert swing.value < 0.5 * MASS * noise / 1.2


@pytest.mark.parametrize(("share", "seed"), [(0.1, 121), (0.2, 122)])
def test_a_swing_that_is_there_is_told_through_the_noise(share: float, seed: int) -> None:
    made = rig(elastic=3e5, level=1.2, damping=60.0, amplitude=2e-3, duration=14.0)
    time = np.arange(len(made["x"])) / FS
    rng = np.random.default_rng(seed)
    tones, phases = rng.uniform(60, 110, 24), rng.uniform(0, 2 * np.pi, 24)
    vibration = np.sin(2 * np.pi * np.outer(time, tones) + phases).sum(axis=1) / math.sqrt(12)
    friction = made["friction"] - 60.0 * made["v"] + share * 1.2 * vibration
    breakaway = ss.cycle.breakaway(
        seen({**made, "friction": friction}, "x", "friction", seed=seed, x=2e-7, friction=0.05)
    )
    for swing in (breakaway.swing_forward, breakaway.swing_back):
        assert swing is not None
        assert swing.interval[0] > 0
        assert swing.value == pytest.approx(share, rel=0.2)


# ---- which sensors the friction is taken from


def felt(*, noise: float, seed: int, mount: tuple[float, float] | None = None, gain: float = 1.0) -> ss.Record:
    """x, z, a and a load cell of that noise, ideal or on a mount of which nothing is stated."""
    made = rig(elastic=3e5, level=1.2, damping=20.0, amplitude=2e-3, duration=5.0)
    true = load = made["friction"] - 20.0 * made["v"]
    if mount is not None:
        turn = 2 * math.pi * mount[0]
        system = ([turn**2], [1.0, 2 * mount[1] * turn, turn**2])
        load = lsim(system, load, np.arange(len(load)) / FS)[1]
    made = {**made, "true": true, "load": gain * load}
    return seen(made, "x", "z", "a", "load", "true", seed=seed, x=2e-6, a=0.2, load=noise)


def method_of(record: ss.Record) -> tuple[str, float]:
    """The method that was chosen, and how far its friction is from the true one [N]."""
    bare = record.rows(0, len(record))
    kept = {name: bare[name] for name in bare if name != "true"}
    findings = ss.analyze(ss.Record.of(kept, fs=FS), mass=MASS, stiffness=SPRING, damping=20.0)
    off = (findings.record["friction"] - record["true"])[100:-100]
    return str(findings.settings["differentiation"]), float(np.std(off))


@pytest.mark.parametrize(("gain", "seed"), [(0.8, 142), (4.448, 143)], ids=["a calibration", "a unit"])
def test_a_load_cell_that_reads_something_else_is_left_aside(gain: float, seed: int) -> None:
    assert method_of(felt(noise=2e-3, seed=seed, gain=gain))[0] == "smoother"


@pytest.mark.parametrize(("mount", "seed"), [((60.0, 0.05), 144), ((45.0, 0.2), 145)], ids=["60 Hz", "45 Hz"])
def test_a_load_cell_that_rings_makes_no_friction_worse(mount: tuple[float, float], seed: int) -> None:
    """It is left aside, or its mount is found in the record and taken out."""
    assert method_of(felt(noise=2e-3, seed=seed, mount=mount))[1] < 0.45
