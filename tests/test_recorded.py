"""Recorded and arbitrary forces and motions: against closed forms, and the drives that they stand for."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.drives import Recorded

OMEGA = 2 * math.pi * 0.4
TIMES = np.arange(0, 10.01, 0.02)
LAWS = [ss.laws.Coulomb(0.4, static=0.6), ss.laws.Stribeck(0.4, 0.6, speed=0.2)]
FREE = ss.laws.Coulomb(0.0)


def slider(law: object, drive: object, *, stiffness: float = 1.0) -> ss.Oscillator:
    return ss.Oscillator(1.0, stiffness, law, drive, damping=0.05)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("on", ["base", "force", "face"])
def test_samples_of_a_tone_move_as_the_tone_does(law: object, on: str) -> None:
    tone = ss.drives.MultiTone([(1.5, 0.4, 0.0)], on=on)
    table = Recorded(1.5 * np.cos(OMEGA * TIMES), 50.0, on=on)
    exact, run = (ss.simulate(slider(law, drive), duration=9.0) for drive in (tone, table))
    assert [event.kind for event in run.events] == [event.kind for event in exact.events]
    x, known = (each.sample(np.linspace(0, 9, 181), ("x",))[0] for each in (run, exact))
    # the face kicks by its acceleration, of which a spline misses h^2 w^4 a / 12
    np.testing.assert_allclose(x, known, atol=100 * table.error if on != "face" else 5e-3)


@pytest.mark.parametrize(("order", "power"), [(1, 2), (3, 4)])
def test_the_error_is_that_of_the_pieces(order: int, power: int) -> None:
    for step in (0.1, 0.05):
        times = np.arange(0, 5 + step / 2, step)
        table = Recorded(np.cos(OMEGA * times), 1 / step, on="force", order=order)
        run = ss.simulate(slider(FREE, table), duration=times[-1])
        inside = np.linspace(0, times[-1], 4001)
        true = float(np.max(np.abs(run.sample(inside, ("force",))[0][0] - np.cos(OMEGA * inside))))
        assert 0.3 * true < table.error < 8 * true
        assert true < (OMEGA * step) ** power


@pytest.mark.parametrize(
    "law", [ss.laws.Coulomb(1.0, static=2.0), ss.laws.FrictionCurve(lambda v: 1.0 + 0.0 * v, static=2.0)]
)
def test_a_pulse_of_force_slides_as_the_closed_form(law: object) -> None:
    """Level pieces: held below the static friction, then m v' = F - f, and f alone until rest."""
    pulse = Recorded([1.5, 5.0, 0.0, 0.0], times=[0.0, 1.0, 1.2, 3.0], on="force", order=0)
    run = ss.simulate(ss.Oscillator(1.0, 0.0, law, pulse), duration=3.0)
    assert [event.kind for event in run.events] == ["slip", "stick"]
    assert [event.time for event in run.events] == pytest.approx([1.0, 2.0], abs=1e-12)
    assert run.state(0.999)["x"] == 0.0
    assert run.state(1.2)["v"] == pytest.approx(0.8, rel=1e-12)
    assert run.state(3.0)["x"] == pytest.approx(4 * 0.2**2 / 2 + 0.8**2 / 2, rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_a_ramp_of_force_breaks_away_at_the_static_friction(law: object) -> None:
    ramp = Recorded([0.0, 3.0, 0.0], times=[0.0, 10.0, 12.0], on="force", order=1)
    run = ss.simulate(slider(law, ramp), duration=12.0)
    assert run.events[0].kind == "slip"
    assert run.events[0].time == pytest.approx(2.0, rel=1e-12)


def test_a_chirp_is_as_near_as_asked_for() -> None:
    """Against a general solver with the function itself."""

    def signal(time: float) -> float:
        return math.cos(math.pi * time * (0.2 + 0.4 * time))

    chirp = Recorded.of(signal, duration=6.0, error=1e-7, on="force")
    run = ss.simulate(slider(FREE, chirp), duration=6.0)
    times = np.linspace(0, 6, 601)
    known = np.array([signal(time) for time in times])
    np.testing.assert_allclose(run.sample(times, ("force",))[0][0], known, atol=1e-7)
    peer = solve_ivp(
        lambda t, s: [s[1], signal(t) - s[0] - 0.05 * s[1]], (0, 6), [0, 0], "DOP853", times, rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(run.sample(times, ("x",))[0][0], peer.y[0], atol=1e-6)


def test_instants_at_one_rate_are_a_rate() -> None:
    samples = np.cos(OMEGA * TIMES[:40])
    one, other = Recorded(samples, 50.0), Recorded(samples, times=TIMES[:40])
    np.testing.assert_allclose(one.motion().knots, other.motion().knots, rtol=1e-6, atol=1e-6)


def test_a_face_under_a_structure_moves_too() -> None:
    table = Recorded(0.5 * np.cos(OMEGA * TIMES), 50.0, on="face")
    contact = ss.Contact(ss.laws.Coulomb(0.4), [1.0])
    system = ss.Structure([[1.0]], [[0.05]], [[1.0]], contacts=[contact], drive=table)
    run, known = (ss.simulate(each, duration=5.0) for each in (system, slider(ss.laws.Coulomb(0.4), table)))
    times = np.linspace(0, 5, 51)
    np.testing.assert_allclose(run.sample(times, ("x",))[0], known.sample(times, ("x",))[0], atol=1e-12)


def test_a_file_holds_forces_with_their_units(tmp_path: Path) -> None:
    (tmp_path / "blow.csv").write_text("time [s],hammer [kN]\n" + "".join(f"{t / 10},{t / 1000}\n" for t in range(20)))
    head = 'system = {mass = 1, stiffness = 1}\nlaw = {name = "Coulomb", kinetic = 0.1}\n[drive]\nname = "Recorded"\n'
    path = tmp_path / "system.toml"
    path.write_text(head + 'on = "force"\nrecord = "blow.csv"\nchannel = "hammer [kN]"\n')
    drive = ss.systems.read_system(path).system.drive
    np.testing.assert_allclose(drive.samples, np.arange(20.0))
    assert drive.fs == pytest.approx(10.0)
    path.write_text(head + 'on = "force"\norder = 0\ntimes = ["0 s", "100 ms", 3]\nsamples = ["0 N", "5 kN", 0]\n')
    case = ss.systems.read_system(path)
    assert (case.system.drive.samples.tolist(), case.system.drive.times) == ([0.0, 5000.0, 0.0], (0.0, 0.1, 3.0))
    assert ss.systems.read_system(
        _written(tmp_path, ss.systems.export_system(case))
    ).system.drive.motion().knots.tolist() == (case.system.drive.motion().knots.tolist())


def _written(folder: Path, text: str) -> Path:
    path = folder / "again.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Recorded([0, 1, 0, 1], 10, on="face", order=1), "order = 1 on the face"),
        (lambda: Recorded([0, 1, 0, 1], 10, order=0), "order = 0 on the base"),
        (lambda: Recorded([0, 1, 0, 1]), "one rate or their instants"),
        (lambda: Recorded([0, 1, 0, 1], 10, times=[0, 1, 2, 3]), "one rate or their instants"),
        (lambda: Recorded([0, 1, 0, 1], times=[0, 1, 2]), "3 times of 4 values"),
        (lambda: Recorded([0, 1, 0, 1], times=[0, 1, 1, 2]), "instants increase from 0"),
        (lambda: Recorded([0, 1], 10.0), "at least 4 finite numbers"),
        (lambda: Recorded([0, 1, 0, 1], 10, on="roof"), "roof"),
        (lambda: Recorded.of(lambda t: math.floor(t), duration=3.3, error=1e-9, on="force"), "come as near"),
    ],
)
def test_bad_drives_are_refused_in_a_sentence(make, told, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr("stickslip.drives.kinds.MOST_SAMPLES", 256)
    with pytest.raises(ss.errors.ModelError, match=told):
        make()
