"""Friction with a time lag, against the method of steps by a general solver, characteristic roots and limits."""

from __future__ import annotations

import math
from pathlib import Path

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss

BELT = ss.Oscillator(
    mass=1.3,
    stiffness=2.0,
    damping=0.1,
    drive=ss.drives.Belt(1.0),
    law=ss.laws.TimeDelay(ss.laws.LinearSlope(1.0, slope=-0.4, static=1.3), lag=0.3),
)
SHAKEN = ss.Oscillator(
    mass=2.42,
    stiffness=2310,
    drive=ss.drives.HarmonicBase(0.65e-3, 2.5),
    law=ss.laws.TimeDelay(ss.laws.Stribeck(1.1, 1.3, speed=4e-3, exponent=1.0, viscous=4.0), lag=7e-3),
)


class Steps:
    """The method of steps by DOP853: an oscillator with friction F(|v_r(t - lag)|), event by event."""

    def __init__(self, system: ss.Oscillator, x: float, v: float, mode: int) -> None:
        self.system, self.law, self.mode = system, system.law, mode
        self.first = abs(v - self.face(0.0))
        self.known: list[tuple[float, float, int, object]] = []
        self.time, self.state, self.events = 0.0, [x, v], []
        self.breaks = [self.law.lag * k for k in range(1, 30)]

    def face(self, _: float) -> float:
        return self.system.drive.speed if isinstance(self.system.drive, ss.drives.Belt) else 0.0

    def pull(self, t: float, x: float, v: float) -> float:
        """Every force but friction."""
        s, drive = self.system, self.system.drive
        z = 0.0 if isinstance(drive, ss.drives.Belt) else drive.amplitude * math.cos(2 * math.pi * drive.frequency * t)
        return s.stiffness * (z - x) - s.damping * v

    def friction(self, t: float) -> float:
        """Its magnitude."""
        then = t - self.law.lag
        speed = self.first
        for begin, end, side, path in reversed(self.known if then > 0 else []):
            if begin <= then <= end:
                speed = abs(path(then)[1] - self.face(then)) if side else 0.0
                break
        curve = self.law.law
        if isinstance(curve, ss.laws.LinearSlope):
            return curve.kinetic + curve.slope * speed
        if isinstance(curve, ss.laws.Tabulated):
            return float(np.interp(speed, curve.speeds, curve.forces))
        return curve.friction(speed)

    def rate(self, t: float, s: np.ndarray) -> list[float]:
        if self.mode == 0:
            return [self.face(t), 0.0]
        return [s[1], (self.pull(t, *s) - self.mode * self.friction(t)) / self.system.mass]

    def leave(self, t: float, s: np.ndarray) -> float:
        """Falls through zero where the mode ends."""
        if self.mode == 0:
            return self.law.law.static - abs(self.pull(t, *s))
        return self.mode * (s[1] - self.face(t)) + (1e-13 if t - self.since < 1e-6 else 0.0)

    def run(self, until: float) -> list[tuple[float, int]]:
        self.leave.__func__.terminal, self.leave.__func__.direction = True, -1.0  # type: ignore[attr-defined]
        while self.time < until:
            self.since = self.events[-1][0] if self.events else -1.0
            end = min([b for b in self.breaks if b > self.time + 1e-12] + [self.time + self.law.lag, until])
            step = solve_ivp(
                self.rate,
                (self.time, end),
                self.state,
                method="DOP853",
                rtol=1e-13,
                atol=1e-16,
                dense_output=True,
                events=self.leave,
                max_step=self.law.lag,
            )
            now = float(step.t[-1])
            self.known.append((self.time, now, self.mode, step.sol))
            self.time, self.state = now, list(step.y[:, -1])
            if step.t_events[0].size:
                pull = self.pull(now, *self.state)
                held = self.mode != 0 and abs(pull) <= self.law.law.static
                if self.mode:
                    self.state[1] = self.face(now)
                self.mode = 0 if held else int(np.sign(pull)) or 1
                self.events.append((now, self.mode))
                self.breaks += [now + self.law.lag * k for k in range(1, 30)]
        return self.events


@pytest.mark.parametrize(
    ("system", "start", "mode", "duration"),
    [
        (BELT, {"x": -0.3}, 0, 12.0),
        (BELT.having(law=ss.laws.TimeDelay(ss.laws.Stribeck(0.8, 1.3, speed=0.3), lag=0.7)), {"x": -0.3}, 0, 12.0),
        (
            BELT.having(
                damping=0.0, law=ss.laws.TimeDelay(ss.laws.Tabulated([0, 0.2, 1.5], [1, 0.6, 0.5], static=1.2), lag=0.3)
            ),
            {"x": -0.3},
            0,
            12.0,
        ),
        (SHAKEN, {}, 1, 1.2),
    ],
    ids=["slope", "stribeck", "tabulated", "shaken"],
)
def test_the_motion_is_that_of_the_method_of_steps(
    system: ss.Oscillator, start: dict[str, float], mode: int, duration: float
) -> None:
    run = ss.simulate(system, duration=duration, start=start)
    peer = Steps(system, start.get("x", 0.0), 0.0 if mode else 1.0, mode)
    known = peer.run(duration)
    assert [event.side for event in run.events] == [side for _, side in known]
    assert len(known) > 3
    assert [event.time for event in run.events] == pytest.approx([time for time, _ in known], rel=1e-11)
    end = run.state(duration)
    assert [end["x"], end["v"]] == pytest.approx(peer.state, rel=1e-9, abs=1e-12)
    assert ss.solve.energy(run).residual < 1e-12


def characteristic_root(system: ss.Oscillator, slope: float, guess: complex) -> complex:
    """Of m s^2 + (c + F' exp(-s lag)) s + k: what a small difference from steady sliding grows by."""
    lag = system.law.lag
    return complex(
        mpmath.findroot(
            lambda s: system.mass * s**2 + (system.damping + slope * mpmath.exp(-s * lag)) * s + system.stiffness, guess
        )
    )


@pytest.mark.parametrize(("lag", "grows"), [(0.05, True), (1.3, False), (2.5, True)])
def test_small_oscillations_about_steady_sliding_follow_the_characteristic_root(lag: float, grows: bool) -> None:
    law = ss.laws.Stribeck(1.0, 1.5, speed=0.5, exponent=1.0)
    system = ss.Oscillator(
        mass=1.0, stiffness=4.0, law=ss.laws.TimeDelay(law, lag=lag), drive=ss.drives.Belt(1.0), damping=0.05
    )
    slope = -0.5 / 0.5 * math.exp(-2.0)
    root = characteristic_root(system, slope, 2j)
    assert (root.real > 0) == grows
    rest, size = law.friction(1.0) / 4.0, 1e-6
    run = ss.simulate(system, duration=26.0, start={"x": rest + size, "v": 0.0}, rtol=1e-14)
    early, late = (root.imag and 2 * math.pi / root.imag * n for n in (4, 7))
    waves = []
    for begin in (early, late):  # the complex amplitude over one turn, the growth taken out
        times = begin + np.linspace(0, 2 * math.pi / root.imag, 400, endpoint=False)
        waves.append(np.mean((run.sample(times, ("x",))[0][0] - rest) * np.exp(-root * times)))
    assert waves[0] == pytest.approx(waves[1], rel=2e-5)
    assert not run.events


def test_steady_sliding_goes_on() -> None:
    law = ss.laws.Stribeck(1.0, 1.5, speed=0.5, exponent=1.0, viscous=0.5)
    system = ss.Oscillator(mass=1.0, stiffness=4.0, law=ss.laws.TimeDelay(law, lag=0.1), drive=ss.drives.Belt(1.0))
    rest = law.friction(1.0) / 4.0
    run = ss.simulate(system, duration=100.0, start={"x": rest, "v": 0.0})
    assert not run.events
    assert run.state(100.0)["x"] == pytest.approx(rest, rel=1e-14)


def test_a_lag_that_vanishes_leaves_the_law_itself() -> None:
    plain = BELT.having(law=BELT.law.law)
    known = [event.time for event in ss.simulate(plain, duration=30, start={"x": -0.3}).events]
    gaps = []
    for lag in (4e-3, 2e-3, 1e-3):
        run = ss.simulate(BELT.having(lag=lag), duration=30, start={"x": -0.3})
        assert len(run.events) == len(known)
        gaps.append(np.array([event.time for event in run.events[1:]]) - known[1:])
    assert np.max(np.abs(gaps[2])) < 4e-3
    assert gaps[0] / gaps[1] == pytest.approx(np.full(len(known) - 1, 2.0), rel=2e-2)
    assert gaps[1] / gaps[2] == pytest.approx(np.full(len(known) - 1, 2.0), rel=1e-2)


@pytest.mark.parametrize("slope", [-0.4, 0.4])
def test_the_loop_over_the_speed_turns_as_its_area_tells_and_widens_with_the_frequency(slope: float) -> None:
    """f = F(V + A cos w(t - lag)) over v = V + A cos wt encloses -pi slope A^2 sin(w lag)."""
    lag, speed, swing, areas = 0.02, 1.0, 0.3, []
    for frequency in (1.0, 2.0, 4.0, 8.0):
        turn = 2 * math.pi * frequency
        face = ss.drives.MultiTone([(swing / turn, frequency, math.pi / 2)], on="face")  # -A cos wt under the mass
        law = ss.laws.TimeDelay(ss.laws.LinearSlope(1.0, slope=slope), lag=lag)
        system = ss.Oscillator(mass=1e30, stiffness=0.0, law=law, drive=face)
        run = ss.simulate(system, duration=lag + 2 / frequency, start={"v": speed})
        times = lag + 1 / frequency + np.arange(256) / 256 / frequency
        friction, slip = run.sample(times, ("friction", "slip"))[0]
        assert slip == pytest.approx(speed + swing * np.cos(turn * times), abs=1e-12)
        speeding = -np.sin(turn * times)
        areas.append(float(np.mean(friction * speeding) * turn * swing / frequency))  # of f dv
        assert areas[-1] == pytest.approx(-math.pi * slope * swing**2 * math.sin(turn * lag), rel=1e-10)
    assert np.all(np.diff(np.abs(areas)) > 0)
    assert np.all(np.sign(areas) == -np.sign(slope))  # where friction falls with speed, it is higher while speeding up


def test_the_answer_does_not_hang_on_tolerance_samples_or_units() -> None:
    run = ss.simulate(SHAKEN, cycles=20)
    loose = ss.simulate(SHAKEN, cycles=20, rtol=1e-7)
    assert [e.mode for e in loose.events] == [e.mode for e in run.events]
    assert [e.time for e in loose.events] == pytest.approx([e.time for e in run.events], rel=1e-7)
    coarse, fine = run.record(fs=100), run.record(fs=1000)
    assert coarse["friction"] == pytest.approx(fine["friction"][::10], rel=1e-12)
    length, time, force = 1e6, 1e-3, 1e-4
    curve = ss.laws.Stribeck(
        1.1 * force, 1.3 * force, speed=4e-3 * length / time, exponent=1.0, viscous=4.0 * force * time / length
    )
    scaled = ss.Oscillator(
        mass=2.42 * force * time**2 / length,
        stiffness=2310 * force / length,
        law=ss.laws.TimeDelay(curve, lag=7e-3 * time),
        drive=ss.drives.HarmonicBase(0.65e-3 * length, 2.5 / time),
    )
    other = ss.simulate(scaled, cycles=20)
    assert [e.mode for e in other.events] == [e.mode for e in run.events]
    assert [e.time / time for e in other.events] == pytest.approx([e.time for e in run.events], rel=1e-12)


def test_a_long_run_keeps_its_pace_and_its_past() -> None:
    """Breaks of the past fade: the number of steps stays in proportion to the time, whatever chunk they fall in."""
    short, long = (ss.simulate(SHAKEN, cycles=cycles) for cycles in (20, 200))
    assert len(long.steps.starts) < 11 * len(short.steps.starts)
    assert len(long.steps.starts) > 3 * 4096
    again = ss.simulate(SHAKEN, duration=200 * 0.4 - 1e-3)
    assert long.state(79.9) == pytest.approx(again.state(79.9), rel=1e-10, abs=1e-15)
    period = [long.state(time)["x"] for time in (79.2, 79.6)]
    assert period[0] == pytest.approx(period[1], rel=1e-9)


def test_a_recorded_base_moves_a_law_with_a_lag() -> None:
    times = np.arange(81) / 100
    base = ss.drives.Recorded(0.65e-3 * np.cos(2 * math.pi * 2.5 * times), fs=100)
    run = ss.simulate(SHAKEN.having(drive=base), duration=0.8)
    near = ss.simulate(SHAKEN, duration=0.8)
    assert [e.mode for e in run.events] == [e.mode for e in near.events]
    assert [e.time for e in run.events] == pytest.approx([e.time for e in near.events], abs=2e-4)
    assert ss.solve.energy(run).residual < 1e-12


def test_a_stop_shorter_than_the_lag_remembers_the_slip_before() -> None:
    law = ss.laws.TimeDelay(ss.laws.LinearSlope(1.0, slope=2.0, static=1.0), lag=0.5)
    run = ss.simulate(ss.Oscillator(mass=1.0, stiffness=0.0, law=law), duration=3.0, start={"v": 1.0})
    # 3 N while the delayed speed is 1 m/s: stopped after 1/3 s, and held whatever the past was
    assert [(round(e.time, 12), e.kind) for e in run.events] == [(round(1 / 3, 12), "stick")]
    assert run.state(0.2)["friction"] == pytest.approx(3.0, rel=1e-14)
    assert run.state(0.2)["v"] == pytest.approx(0.4, rel=1e-13)
    assert run.status == "at rest"


def test_a_lag_is_written_in_a_file_around_its_law(tmp_path: Path) -> None:
    file = tmp_path / "late.toml"
    text = """
        system = {mass = 2.42, stiffness = 2310}
        drive = {name = "HarmonicBase", amplitude = "0.65 mm", frequency = 2.5}
        [law]
        name = "TimeDelay"
        lag = "7 ms"
        law = {name = "Stribeck", kinetic = 1.1, static = 1.3, speed = "4 mm/s", exponent = 1.0, viscous = 4.0}
    """
    file.write_text(text)
    case = ss.systems.read_system(file)
    assert case.system.law == SHAKEN.law
    assert case.having(lag="3 ms").system.law.lag == 3e-3
    file.write_text(text.replace('"7 ms"', '"-7 ms"'))
    with pytest.raises(ss.errors.ModelError, match=r"line 6.*lag = -0.007 s"):
        ss.systems.read_system(file)


@pytest.mark.parametrize(
    ("build", "word"),
    [
        (lambda: ss.laws.TimeDelay(ss.laws.Dahl(1.0, 1.0), lag=0.1), "Dahl"),
        (lambda: ss.laws.TimeDelay(SHAKEN.law.law, lag=0.0), "lag"),
        (lambda: ss.laws.TimeDelay(SHAKEN.law.law, lag=-1.0), "lag"),
        (lambda: ss.laws.TimeDelay(SHAKEN.law.law, math.nan), "lag"),
        (lambda: ss.laws.TimeDelay(1.0, lag=1.0), "float"),
        (lambda: ss.laws.InSeries(SHAKEN.law, stiffness=1.0), "series"),
        (lambda: ss.simulate(SHAKEN, cycles=1, rtol=0.0), "rtol"),
        (lambda: ss.simulate(SHAKEN, cycles=1, start={"delayed_speed": 1.0}), "start"),
    ],
)
def test_bad_input_is_named(build: object, word: str) -> None:
    with pytest.raises(ss.errors.ModelError, match=word) as error:
        build()  # type: ignore[operator]
    assert all((error.value.value, error.value.rule, error.value.next_step))


def test_a_lag_too_short_for_the_run_is_refused() -> None:
    with pytest.raises(ss.errors.SolveError, match="lag"):
        ss.simulate(SHAKEN.having(lag=1e-12), cycles=100)


@pytest.mark.parametrize("seeds", [range(12), pytest.param(range(12, 200), marks=pytest.mark.soak)])
def test_friction_that_rises_with_the_speed_holds_what_it_stopped(seeds: range) -> None:
    """A mass that stops is pulled by more than f_s, and by less than the friction of the speed a while ago."""
    for seed in seeds:
        draw = np.random.default_rng(seed)
        level, stiffness, mass = 10.0 ** draw.uniform(-1, 2), 10.0 ** draw.uniform(1, 4), 10.0 ** draw.uniform(-1, 1)
        speed, natural = level / math.sqrt(stiffness * mass), math.sqrt(stiffness / mass) / (2 * math.pi)
        curve = ss.laws.LinearSlope(level, slope=level / speed * draw.uniform(0.05, 1))
        law = ss.laws.TimeDelay(curve, lag=10.0 ** draw.uniform(-3, -0.5) / natural)
        system = ss.Oscillator(mass, stiffness, law)
        run = ss.simulate(system, duration=6 / natural, start={"x": level / stiffness * 10.0 ** draw.uniform(0, 1.5)})
        assert run.status in ("at rest", "complete")
        assert ss.solve.energy(run).residual < 1e-9


def test_a_hold_lasts_until_the_larger_of_break_away_and_friction() -> None:
    """Stopped from 1 m/s by a wall's pull: held while what the speed a lag ago had is more than the pull."""
    curve, lag = ss.laws.LinearSlope(1.0, slope=2.0), 0.5
    system = ss.Oscillator(1.0, 4.0, ss.laws.TimeDelay(curve, lag))
    run = ss.simulate(system, duration=4.0, start={"x": 1.25, "v": 0.0})
    stops = [event for event in run.events if event.kind == "stick"]
    assert stops
    for event in stops:
        pull = abs(4.0 * run.state(event.time)["x"])
        ago = abs(run.state(event.time - lag)["v"])
        assert pull <= max(1.0, 1.0 + 2.0 * ago) * (1 + 1e-9)
