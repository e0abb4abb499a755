"""Real forced rigs, measured by other people, through the public questions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cycle.onset import HIGH, LOW, _branch
from stickslip.cycle.slips import find_strokes

Sets = Callable[[str], Path]
WEIGHT = 0.0307 * 9.81  # of the paper slider [N]
SOUND = ("0.5Hz35lbtension", "0.5Hz36lbtension1amplitude", "0.5Hz80lbtension", "1Hz35lbtension", "1Hz80lbtension")
FAULTY = "0.5Hz0lbtension0.5amplitude"


def frame(dataset: Sets, weight: str) -> ss.answers.Findings:
    """The shaken frame: M 3.0799 kg, C 0.669 N s/m, K 1191 N/m (Marino and Cicirello 2023)."""
    files = [dataset("frame_base_excited") / f"s_b_{weight}_{side}.mat" for side in "xy"]
    record = ss.read_record(files, channels={"x": "x [mm]", "z": "y [mm]"})
    return ss.analyze(record, mass=3.0799, stiffness=1191, damping=0.669, damper="base")


def brake(dataset: Sets, name: str) -> ss.Record:
    channels = {"x": "#2 [in]", "friction": "c3 [kip]", "v": "#4 [in/s]"}
    return ss.read_record(dataset("band_brake_damper") / f"{name}.json", channels=channels, time="#1")


@pytest.mark.parametrize(("weight", "friction"), [("250g", 0.682), ("450g", 1.318)])
def test_the_frame_sticks_and_slips_in_each_cycle(dataset: Sets, weight: str, friction: float) -> None:
    found = frame(dataset, weight)
    assert found.loops is not None
    assert found.loops.level.value == pytest.approx(friction, rel=0.04)
    assert found.sticks is not None
    assert found.sticks.per_cycle.value == pytest.approx(2.0, abs=0.01)
    # forward and back apart, the friction just before breakaway is that of sliding, or a little more
    assert found.breakaway is not None
    assert found.breakaway.status == "ok"
    assert 0.9 < found.breakaway.ratio.interval[0] < found.breakaway.ratio.value < 1.15
    for side, level in ((found.breakaway.forward, found.loops.forward), (found.breakaway.back, found.loops.back)):
        assert side is not None
        assert side.value == pytest.approx(level.value, rel=0.2)


@pytest.mark.parametrize(("weight", "least"), [("250g", 2e-6), ("450g", 3e-5)])
def test_the_frame_moves_against_its_load_so_compliance_is_not_told(dataset: Sets, weight: str, least: float) -> None:
    """While it sticks it creeps some micrometres the wrong way, and more under more load: no contact does so."""
    findings = frame(dataset, weight)
    presliding = findings.presliding
    assert presliding is not None
    assert presliding.verdict == "can not be told"
    assert "against its load" in presliding.evidence
    assert not presliding.compliance_forward.known
    assert presliding.compliance_forward.status.startswith(presliding.evidence)
    strokes = find_strokes(findings.record, contact=None, question="the creep")
    lines = filter(None, (_branch(stroke, LOW, HIGH) for stroke in strokes.to(1)))
    assert -np.mean([compliance for _, compliance in lines]) > least


@pytest.mark.parametrize("name", SOUND)
def test_the_band_brake_gives_way_with_play_before_it_slips(dataset: Sets, name: str) -> None:
    findings = ss.analyze(brake(dataset, name))
    assert findings.presliding is not None
    assert findings.presliding.verdict == "gives way"
    assert findings.presliding.stiffness is not None
    assert 2e6 < findings.presliding.stiffness.value < 5e6  # read off the loops: 1 to 4 kip over 0.1 to 0.15 inch
    assert findings.presliding.backlash is not None
    assert findings.presliding.backlash.value == pytest.approx(0.0032, abs=0.0009)  # one device, whatever its tension
    assert findings.loops is not None
    for level in (findings.loops.forward, findings.loops.back):
        assert 0.8 < level.value / 4448.2216 < 4.4  # kip


def test_the_band_brake_rings_after_slip_begins(dataset: Sets) -> None:
    breakaway = ss.cycle.breakaway(brake(dataset, "0.5Hz35lbtension"))
    assert breakaway.ringing_forward is not None
    assert 41 < breakaway.ringing_forward.value < 56
    assert breakaway.ringing_back is not None
    assert 41 < breakaway.ringing_back.value < 58
    assert breakaway.ringing_difference is not None
    low, high = breakaway.ringing_difference.interval
    assert low < 44 - 54.6 < high  # by parabolas alone; what else may be taken for the ring widens it beyond telling
    assert breakaway.ratio.value > 1.2  # the first peak, ring included
    assert "moves before" in breakaway.status


def test_the_faulty_file_is_flagged_and_the_others_are_not(dataset: Sets) -> None:
    for name in (*SOUND, "0.5Hz20lbtension", "1Hz20lbtension", FAULTY):
        breakaway = ss.cycle.breakaway(brake(dataset, name))
        flagged = [estimate for estimate in breakaway.estimates if "no steady friction" in estimate.status]
        assert bool(flagged) == (name == FAULTY), name


@pytest.mark.parametrize(("name", "slope", "tolerance"), [("v42", 0.0234, 0.08), ("v1100", 0.614, 0.07)])
def test_paper_on_paper_is_loaded_at_the_rate_of_the_spring(
    dataset: Sets, name: str, slope: float, tolerance: float
) -> None:
    """k V / (m g), published; two of three records stick, as the paper says (Colas et al. 2019)."""
    path = dataset("paper_stick_slip") / f"k168Nm_{name}.mat"
    pull = ss.analyze(ss.read_record(path, channels={"load": f"Fnorm * {WEIGHT} [N]"})).pull
    assert pull is not None
    assert pull.loading_rate.value / WEIGHT == pytest.approx(slope, rel=tolerance)
    assert pull.regime == "stick-slip"
    assert pull.status == "ok"


def test_paper_on_paper_swings_when_it_is_pulled_fast(dataset: Sets) -> None:
    path = dataset("paper_stick_slip") / "k168Nm_v4300.mat"
    slider = ss.balance.pulled_slider(ss.read_record(path, channels={"load": f"Fnorm * {WEIGHT} [N]"}))
    assert slider.regime == "inertial"
