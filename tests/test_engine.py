"""The exact engine: properties that hold in every run, and the rules at its edges."""

from __future__ import annotations

import itertools
import math

import mpmath
import numpy as np
import pytest

import stickslip as ss
from stickslip import scenarios
from stickslip.solve import phasors
from stickslip.solve import simulate as simulate_module
from stickslip.solve.energies import energy

RIGID = ss.Oscillator(
    mass=2.42, stiffness=2310, law=ss.laws.Coulomb(1.1), drive=ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
)
RECORDED = ss.drives.Recorded([0.0, 1e-3, 0.0, -1e-3], fs=10.0)  # 0.3 s
CONTACT = ss.laws.CompliantContact(1.1, 192000, 23.8635)
COMPLIANT = RIGID.having(law=CONTACT)
DRIVES = (
    lambda g, x, v, f, p: ss.drives.HarmonicForce(p, f, g.uniform(0, 6)),
    lambda g, x, v, f, p: ss.drives.HarmonicBase(x, f, g.uniform(0, 6)),
    lambda g, x, v, f, p: ss.drives.HarmonicBase(x, f, contact="base"),
    lambda g, x, v, f, p: ss.drives.MultiTone([(p, f, 0.0), (0.3 * p, f * g.uniform(1, 9), 1.0)], on="force"),
    lambda g, x, v, f, p: ss.drives.MultiTone([(x, f, 0.0)], on="face"),
    lambda g, x, v, f, p: ss.drives.Belt(v * g.choice([-1.0, 1.0]) * 10 ** g.uniform(-2, 0.3)),
    lambda g, x, v, f, p: ss.drives.Ramp(v * 10 ** g.uniform(-2, 0.3)),
    lambda g, x, v, f, p: ss.drives.Release(),
)


def random_case(seed: int) -> tuple[ss.Oscillator, dict[str, float], float]:
    """Any law under any drive, scales spread over decades: system, start, duration [s]."""
    g = np.random.default_rng(seed)
    mass, rate, push = 10 ** g.uniform(-2, 2), 10 ** g.uniform(0, 3), 10 ** g.uniform(-2, 3)
    stiffness = mass * rate**2
    level = push * 10 ** g.uniform(-1.7, 0.5)
    static = level * g.choice([1.0, 1.0, g.uniform(1, 2)])
    contact = stiffness * 10 ** g.uniform(0, 3)
    loss = g.choice([0.0, 2 * 10 ** g.uniform(-3, 0.3) * math.sqrt(mass * (stiffness + contact))])
    x, v = push / stiffness, push / stiffness * rate
    count = int(g.integers(2, 6))
    laws = (
        lambda: ss.laws.Coulomb(level, static),
        lambda: ss.laws.CompliantContact(level, contact, loss, static),
        lambda: ss.laws.CompliantContact(level, contact, loss, static, "consistent"),
        lambda: ss.laws.LinearSlope(level, g.uniform(-0.2, 0.5) * math.sqrt(mass * stiffness), static),
        lambda: ss.laws.Tabulated(
            [0, *np.cumsum(g.uniform(0.05, 1, count)) * v], level * g.uniform(0.3, 1, count + 1), static=1.1 * level
        ),
        lambda: ss.laws.StateVariable(
            level, 10 ** g.uniform(-1, 1) * rate / level, steepness=10 ** g.uniform(1, 3) / v
        ),
        lambda: ss.laws.InertialContact(level, contact, mass * 10 ** g.uniform(-1, 0), loss, static),
        lambda: ss.laws.ElastoSlip(contact * g.uniform(0.2, 1, count), level * g.uniform(0.05, 1, count)),
        lambda: ss.laws.PositionLoad(level, g.uniform(-1.5, 1.5) * level / x),
    )
    law = laws[int(g.integers(len(laws)))]()
    frequency = rate / (2 * math.pi) * 10 ** g.uniform(-1, 0.5)
    drive = DRIVES[int(g.integers(len(DRIVES)))](g, x, v, frequency, push)
    damping = g.choice([0.0, 10 ** g.uniform(-4, -0.3), 1.0, g.uniform(0.9, 1.5)]) * 2 * math.sqrt(mass * stiffness)
    system = ss.Oscillator(mass=mass, stiffness=stiffness, law=law, drive=drive, damping=damping)
    start = {"x": float(g.uniform(-3, 3) * x), "v": float(g.uniform(-2, 2) * v * g.choice([0, 1]))}
    return system, start, float(g.uniform(3, 8) / frequency)


@pytest.mark.parametrize("block", range(10))
def test_energy_balances_in_random_runs(block: int) -> None:
    for seed in range(20 * block, 20 * block + 20):
        system, start, duration = random_case(seed)
        run = ss.simulate(system, duration=duration, start=start)
        balance = energy(run)
        assert balance.residual < 1e-12, (seed, system, balance)
        assert np.all(run.durations[:-1] > 1e-12 * duration), (seed, system)
        assert run.durations.sum() == pytest.approx(duration, rel=1e-12), (seed, system)


@pytest.mark.parametrize("seed", [595, 758, 4004, 4747, 4803, 6220, 9639])
def test_energy_balances_over_thousands_of_cells(seed: int) -> None:
    """A stiff contact under a slow ramp: pieces of up to 42,000 turns of the contact, far along the way."""
    system, start, duration = random_case(seed)
    run = ss.simulate(system, duration=duration, start=start)
    assert np.max(run.durations / run.table.cell[run.modes]) > 2500 or run.table.settling
    assert energy(run).residual < 1e-12


def test_a_piece_of_a_hundred_thousand_cells_keeps_its_digits() -> None:
    """A free vibration on a belt that never lets it stick, against the closed form in 40 digits."""
    rate, damping, speed, level, mass = 1e4, 0.003, 10.0, 1.0, 1.5
    law, drive = ss.laws.Coulomb(level), ss.drives.Belt(speed)
    system = ss.Oscillator(mass=mass, stiffness=mass * rate**2, damping=damping, law=law, drive=drive)
    run = ss.simulate(system, duration=10.0, start={"x": 1e-5, "v": 0.0})
    assert len(run.modes) == 2  # cut once, for the ear of the caller
    with mpmath.workdps(40):
        k, c, m = (mpmath.mpf(value) for value in (system.stiffness, damping, mass))
        decay, rest, t = c / (2 * m), level / k, mpmath.mpf(10.0)
        turn = mpmath.sqrt(k / m - decay**2)
        away = mpmath.mpf(1e-5) - rest
        wave = away * (mpmath.cos(turn * t) + decay / turn * mpmath.sin(turn * t))
        x = rest + mpmath.exp(-decay * t) * wave
    assert run.state(10.0)["x"] == pytest.approx(float(x), rel=0, abs=1e-13 * 1e-5)


def test_friction_at_rest_follows_a_force_that_starts_at_zero() -> None:
    """A cosine that starts at zero carries the rounding of a cosine: it must not set off the state variable."""
    law, drive = ss.laws.StateVariable(0.5, rate=20), ss.drives.HarmonicForce(1.2, frequency=0.13, phase=-math.pi / 2)
    run = ss.simulate(ss.Oscillator(mass=1, stiffness=1, law=law, drive=drive), cycles=20)
    # held while the rate that friction needs, f' + f_k gamma f, stays below f_k^2 gamma
    omega = 2 * math.pi * 0.13
    limit, lead = 5 / math.hypot(12, 1.2 * omega), math.atan2(1.2 * omega, 12)
    assert run.events[0].time == pytest.approx((math.asin(limit) - lead) / omega, rel=1e-14)
    assert len(run.modes) == 42
    assert energy(run).residual < 1e-12


def test_a_run_that_ends_on_an_event_ends_there() -> None:
    """The energy at the end is that of the last instant, not of the last piece's start."""
    system = ss.Oscillator(mass=1, stiffness=4, law=ss.laws.Coulomb(1.0))
    whole = ss.simulate(system, duration=10, start={"x": 3.0})
    for event in whole.events[:3]:
        run = ss.simulate(system, duration=event.time, start={"x": 3.0})
        assert energy(run).residual < 1e-14
        assert run.state(event.time)["v"] == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize("system", [RIGID, COMPLIANT, RIGID.having(frequency=8.7, amplitude=1.1e-3)])
def test_both_paths_agree(system: ss.Oscillator, monkeypatch: pytest.MonkeyPatch) -> None:
    """The fast path by phasors against the general march: sequence first, then values."""
    fast = ss.simulate(system, cycles=300)
    monkeypatch.setattr(simulate_module, "fast_tables", lambda table: phasors.without(1).of(0))
    general = ss.simulate(system, cycles=300)
    assert [e[1:] for e in fast.events] == [e[1:] for e in general.events]
    period = 1 / system.drive.frequency
    assert np.max(np.abs(fast.offsets - general.offsets)) < 1e-12 * period
    scale = np.max(np.abs(general.states), axis=0)
    assert np.all(np.abs(fast.states - general.states) <= 1e-12 * scale)
    assert len(phasors.fast_tables(fast.table).nodes)


def test_events_keep_when_units_change() -> None:
    reference = ss.simulate(COMPLIANT, cycles=12)
    for metre, second, newton in itertools.product((1e-9, 1e9), repeat=3):
        stiff, viscous = newton / metre, newton * second / metre
        law = ss.laws.CompliantContact(1.1 * newton, 192000 * stiff, 23.8635 * viscous)
        drive = ss.drives.HarmonicBase(0.65e-3 * metre, 2.5 / second)
        mass = 2.42 * newton * second**2 / metre
        run = ss.simulate(ss.Oscillator(mass=mass, stiffness=2310 * stiff, law=law, drive=drive), cycles=12)
        assert [e.mode for e in run.events] == [e.mode for e in reference.events]
        assert np.allclose(run.starts / second, reference.starts, rtol=0, atol=1e-12 * 0.4)
        assert np.allclose(run.states[:, 0] / metre, reference.states[:, 0], rtol=0, atol=1e-12 * 7e-4)


@pytest.mark.parametrize(
    ("system", "order"), [(RIGID, 1.0), (RIGID.having(frequency=8.7, amplitude=1.1e-3), 0.5)], ids=["sticks", "slides"]
)
def test_a_stiffening_contact_becomes_rigid(system: ss.Oscillator, order: float) -> None:
    """K_y from 1e2 to 1e12 N/m under half critical damping: first order where the mass sticks, else half an order."""
    rigid = ss.steady_state(system).amplitude
    gaps = []
    for decade in range(2, 13):
        law = ss.laws.CompliantContact(1.1, 10.0**decade, math.sqrt(2.42 * 10.0**decade))
        transient = 64 if decade < 10 else 16
        gaps.append(abs(ss.steady_state(system.having(law=law), transient=transient).amplitude - rigid) / rigid)
    assert np.all(np.diff(gaps[2:]) < 0)
    orders = np.log10(np.divide(gaps[:-1], gaps[1:]))
    assert np.allclose(orders[5:], order, rtol=0, atol=3e-3)
    assert gaps[-1] < (2e-9 if order == 1.0 else 3e-5)


@pytest.mark.parametrize("frequency", [5.61, 8.7, 11.1])
def test_the_transition_speed_is_exact_without_damping(frequency: float) -> None:
    """Equation 3.4, V_s = 2 w sqrt(X_m r - r^2) with r = f_k / K_y, holds for any response with c = 0."""
    for name in scenarios.names():
        scenario = scenarios.get(name)
        if name.startswith(f"THESIS compliant c=0 {frequency}Hz"):
            orbit = ss.steady_state(scenario.system)
            ratio = scenario.system.law.kinetic / scenario.system.law.stiffness
            speed = 4 * math.pi * frequency * math.sqrt(orbit.amplitude * ratio - ratio**2)
            assert orbit.transition_speed == pytest.approx(speed, rel=1e-12)
            return
    raise AssertionError("the scenario is missing")


@pytest.mark.parametrize("name", [n for n in scenarios.names() if n.startswith("THESIS compliant")])
def test_the_closed_integral_of_friction_vanishes(name: str) -> None:
    """The closed integral of f (x''' + w^2 x') dt is zero for any friction law without a viscous term."""
    system = scenarios.get(name).system
    orbit = ss.steady_state(system).orbit
    table, w = orbit.table, 2 * math.pi * system.drive.frequency
    total, turnover = 0.0, 0.0
    nodes, weights = np.polynomial.legendre.leggauss(12)
    for j, (begin, length) in enumerate(zip(orbit.starts, orbit.durations, strict=True)):
        flow = table.flow[orbit.modes[j]]
        rows = [table.friction[orbit.modes[j], 0], flow[1] @ flow + w**2 * flow[0]]
        parts = max(4, math.ceil(2 * length / table.cell[orbit.modes[j]]))
        for part in range(parts):
            times = begin + length * (part + (nodes + 1) / 2) / parts
            values, _ = orbit.sample(times, ("state", "z"))
            angle = w * times
            whole = np.column_stack([values[0], values[1], values[2], np.ones(12), np.cos(angle), np.sin(angle)])
            friction, bend = (whole @ row for row in rows)
            total += length / parts / 2 * float(weights @ (friction * bend))
            turnover += length / parts / 2 * float(weights @ np.abs(friction * bend))
    # friction is continuous in a compliant contact, so no jump of x''' has to be added
    assert abs(total) < 1e-12 * turnover


def test_friction_stays_below_static_while_stuck() -> None:
    run = ss.simulate(RIGID.having(law=ss.laws.Coulomb(0.9, static=1.2)), cycles=20)
    record = run.record(fs=4000)
    _, piece = run.sample(record.time, ("x",))
    stuck = np.array([run.table.modes[m].kind == "stick" for m in run.modes])[piece]
    assert np.max(np.abs(record["friction"][stuck])) <= 1.2 * (1 + 1e-12)
    assert np.allclose(np.abs(record["friction"][~stuck]), 0.9)


def random_contact(seed: int) -> ss.Oscillator:
    """A compliant contact near the thesis's own."""
    g = np.random.default_rng(seed)
    level, stiffness = float(g.uniform(0.8, 1.3)), float(g.uniform(5e4, 3e5))
    law = ss.laws.CompliantContact(level, stiffness, float(g.uniform(0, 60)))
    return RIGID.having(law=law, frequency=float(g.uniform(2, 7)), amplitude=float(g.uniform(0.5e-3, 1e-3)))


@pytest.mark.parametrize("seed", range(2))
def test_a_compliant_run_equals_a_replay_of_forty_digits(seed: int) -> None:
    system = random_contact(seed)
    run = ss.simulate(system, cycles=3)
    times, modes = replay(system, 3)
    names = [mode.name for mode in run.table.modes]
    assert [names[m] for m in run.modes[1:]] == modes
    assert np.allclose(run.starts[1:], times, rtol=0, atol=1e-12 / system.drive.frequency)


def replay(system: ss.Oscillator, cycles: int) -> tuple[list[float], list[str]]:
    """The same law in 40 digits: closed forms of each mode, first root by a fine scan and bisection."""
    mp = mpmath.mp.clone() if hasattr(mpmath.mp, "clone") else mpmath.mp
    mp.dps = 40
    m, k, level = (mp.mpf(value) for value in (system.mass, system.stiffness, system.law.kinetic))
    stiff, loss = mp.mpf(system.law.stiffness), mp.mpf(system.law.damping)
    w, z = 2 * mp.pi * mp.mpf(system.drive.frequency), mp.mpf(system.drive.amplitude)
    end = cycles * 2 * mp.pi / w

    def motion(t0, x0, v0, spring, damper, constant):
        """x and v of m x'' + damper x' + spring x = constant + k z cos w t from (t0, x0, v0)."""
        response = k * z / (spring - m * w**2 + mp.mpc(0, 1) * w * damper)
        rate, turn = damper / (2 * m), mp.sqrt(spring / m - (damper / (2 * m)) ** 2)
        forced = lambda t, n: (response * (mp.mpc(0, 1) * w) ** n * mp.expj(w * t)).real  # noqa: E731
        a = x0 - constant / spring - forced(t0, 0)
        b = (v0 - forced(t0, 1) + rate * a) / turn

        def at(t):
            s = t - t0
            decay, c, q = mp.exp(-rate * s), mp.cos(turn * s), mp.sin(turn * s)
            x = decay * (a * c + b * q) + constant / spring + forced(t, 0)
            v = decay * ((b * turn - rate * a) * c - (a * turn + rate * b) * q) + forced(t, 1)
            return x, v

        return at

    t, x, v, anchor, side = mp.mpf(0), mp.mpf(0), mp.mpf(0), mp.mpf(0), 0
    times, modes = [], []
    step = end / cycles / 1500
    while True:
        if side:
            at = motion(t, x, v, k, mp.mpf(0), -side * level)
            exits = [(lambda s, at=at, side=side: -side * at(s)[1], 0)]
        else:
            at = motion(t, x, v, k + stiff, loss, stiff * anchor)
            force = lambda s, at=at, held=anchor: stiff * (at(s)[0] - held) + loss * at(s)[1]  # noqa: E731
            exits = [(lambda s, f=force, j=j: j * f(s) - level, j) for j in (1, -1)]
        low, found = t, None
        if times:
            low = t + step / 1000
        while found is None and low < end:
            high = min(low + step, end)
            due = [(g, j) for g, j in exits if g(low) < 0 <= g(high)]
            if due:
                g, j = due[0]
                for _ in range(130):
                    middle = (low + high) / 2
                    low, high = (low, middle) if g(middle) >= 0 else (middle, high)
                found = (high, j)
            low = high
        if found is None:
            return times, modes
        t, side = found
        x, v = at(t)
        if side == 0:
            previous = 1 if modes and modes[-1] == "forward" else -1
            anchor, v = x - previous * level / stiff, mp.mpf(0)
        times.append(float(t))
        modes.append({0: "microstuck", 1: "forward", -1: "back"}[side])


def test_a_recorded_base_follows_the_tone_it_was_taken_from() -> None:
    fs = 2000.0
    times = np.arange(8001) / fs
    tone = ss.simulate(RIGID, duration=4.0)
    taken = ss.simulate(
        RIGID.having(drive=ss.drives.Recorded(0.65e-3 * np.cos(5 * math.pi * times), fs=fs)), duration=4.0
    )
    assert [e.mode for e in taken.events] == [e.mode for e in tone.events]
    assert np.allclose([e.time for e in taken.events], [e.time for e in tone.events], rtol=0, atol=1e-7)


def test_a_moving_base_equals_the_relative_coordinate() -> None:
    """Friction on the base: x - z obeys the force m w^2 z on the ground."""
    w = 5 * math.pi
    base = RIGID.having(drive=ss.drives.HarmonicBase(2e-2, 2.5, contact="base"))
    relative = RIGID.having(drive=ss.drives.HarmonicForce(2.42 * w**2 * 2e-2, 2.5))
    moving = ss.simulate(base, cycles=6, start={"x": 2e-2, "v": 0.0})
    fixed = ss.simulate(relative, cycles=6)
    assert [e.mode for e in moving.events] == [e.mode for e in fixed.events]
    assert np.allclose([e.time for e in moving.events], [e.time for e in fixed.events], rtol=0, atol=1e-12)


def test_critical_damping_and_no_spring_are_exact() -> None:
    critical = ss.Oscillator(mass=1, stiffness=1, damping=2.0, law=ss.laws.Coulomb(0.0))
    run = ss.simulate(critical, duration=5, start={"x": 1.0})
    assert run.state(5)["x"] == pytest.approx(6 * math.exp(-5), rel=1e-14)
    coasting = ss.Oscillator(mass=2, stiffness=0, law=ss.laws.Coulomb(3.0))
    run = ss.simulate(coasting, duration=4, start={"v": 3.0})
    assert run.events[0].time == 2.0
    assert run.state(4)["x"] == 3.0
    assert run.status == "at rest"


@pytest.mark.parametrize(
    "call",
    [
        lambda: ss.Oscillator(mass=-1, stiffness=1, law=ss.laws.Coulomb(1)),
        lambda: ss.Oscillator(mass=math.nan, stiffness=1, law=ss.laws.Coulomb(1)),
        lambda: ss.Oscillator(mass=1, stiffness=1, law=ss.laws.Coulomb(1), damper="wall"),
        lambda: ss.laws.Coulomb(1.0, static=0.5),
        lambda: ss.laws.CompliantContact(1.0, 0.0),
        lambda: ss.laws.CompliantContact(1.0, 1.0, rule="loose"),
        lambda: ss.laws.Tabulated([0, 2, 1], [1, 1, 1]),
        lambda: ss.drives.Belt(0.0),
        lambda: ss.drives.HarmonicForce(1.0, 1e12),
        lambda: ss.drives.Recorded([0.0, math.nan, 1.0, 2.0], fs=10),
        lambda: ss.simulate(RIGID, duration=0.0),
        lambda: ss.simulate(RIGID, duration=1.0, cycles=1.0),
        lambda: ss.simulate(RIGID, duration=1.0, start={"y": 1.0}),
        lambda: ss.simulate(RIGID, duration=1.0, start={"x": "far"}),
        lambda: ss.simulate(RIGID, duration=1.0, start={"v": 1.0, "mode": "stuck"}),
        lambda: ss.simulate(RIGID, duration=1.0, start={"v": 1.0, "mode": "back"}),
        lambda: ss.simulate(RIGID, duration=1.0, budget=0),
        lambda: ss.simulate(RIGID.having(drive=RECORDED), duration=1.0),
        lambda: ss.steady_state(RIGID.having(drive=RECORDED)),
        lambda: ss.steady_state(RIGID, orders=0),
        lambda: ss.Oscillator(mass="heavy", stiffness=1, law=ss.laws.Coulomb(1)),
        lambda: ss.Oscillator(mass=1, stiffness=1, law=ss.laws.Coulomb),
        lambda: ss.Oscillator(mass=1, stiffness=1, law=ss.laws.Coulomb(1), drive=2.5),
        lambda: ss.drives.HarmonicForce("1 N", 2.5),
        lambda: ss.drives.MultiTone([(1.0, 2.5)]),
        lambda: RIGID.having(colour=1),
        lambda: scenarios.get("none"),
    ],
)
def test_what_has_no_meaning_is_refused(call) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ss.errors.ModelError) as refusal:
        call()
    assert len(refusal.value.args) == 3


def test_chatter_ends_in_an_error_that_names_the_state() -> None:
    with pytest.raises(ss.errors.SolveError, match="x = "):
        ss.simulate(RIGID, cycles=2000, budget=1)


@pytest.mark.parametrize("budget", [3, 4])
def test_a_budget_counts_in_short_runs_too(budget: int) -> None:
    """Four events in each of ten periods."""
    if budget < 4:
        with pytest.raises(ss.errors.SolveError, match="at most 3 events"):
            ss.simulate(RIGID, cycles=10, budget=budget)
    else:
        assert len(ss.simulate(RIGID, cycles=10, budget=budget).events) <= 4 * 10


def test_growth_without_end_is_no_number() -> None:
    growing = RIGID.having(damping=-100.0)
    assert ss.steady_state(growing).status == "unbounded"
    tones = ss.drives.MultiTone([(1e-3, 8.7, 0.0), (1e-3, 17.4, 0.0)], on="base")
    assert ss.steady_state(growing.having(drive=tones)).status == "unbounded"
    with pytest.raises(ss.errors.SolveError, match="beyond the largest number"):
        ss.simulate(growing.having(damping=-1e4), cycles=40)


@pytest.mark.parametrize(
    ("call", "names"),
    [
        (lambda run: run.sample([0.5, 0.2], ("x",)), "run back"),
        (lambda run: run.sample([0.5], ("colour",)), "there are x, v"),
        (lambda run: run.state(2.0), "from 0 to 1 s"),
        (lambda run: run.record(fs=0.0), "fs = 0"),
        (lambda run: run.record(fs=1e300), "up to 1e\\+10"),
    ],
)
def test_a_run_is_asked_for_what_it_knows(call, names: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ss.errors.SolveError, match=names):
        call(ss.simulate(RIGID, duration=1.0))


def test_chaos_has_a_positive_exponent() -> None:
    """FM-1: 0.596 +- 0.004 a forcing period."""
    scenario = scenarios.get("FM-1")
    exponent = ss.solve.lyapunov(scenario.system, cycles=4000, start=scenario.start)
    period = 1 / scenario.system.drive.frequency
    assert exponent.interval[0] * period < 0.596 + 0.012
    assert exponent.interval[1] * period > 0.596 - 0.012


def test_the_section_of_a_periodic_orbit_is_one_point() -> None:
    orbit = ss.steady_state(RIGID)
    start = dict(zip(("x", "v"), map(float, orbit.orbit.states[0, :2]), strict=True))
    points = ss.simulate(RIGID, cycles=6, start=start).section()
    assert points.shape == (7, 2)
    assert np.allclose(points, points[0], rtol=0, atol=1e-12 * orbit.amplitude)


def test_rest_and_sliding_attract_beside_each_other() -> None:
    """Static friction above the force's amplitude: rest where the start is at rest, sliding where it slides."""
    system = scenarios.forced(0.8, 0.7, static_ratio=1.5)
    rest, sliding, *more = ss.solve.attractors(system, starts=[{}, {"x": 3.0}, {"x": 3.1}])
    assert not more
    assert (rest.status, sliding.status) == ("rest", "unique")
    assert sliding.stops == (0, 0)


def test_a_run_that_would_fill_the_memory_is_refused_at_once() -> None:
    """1e9 s of slip and stick asked for 41 GB after minutes, and ended in numpy's words."""
    with pytest.raises(ss.errors.SolveError, match=r"at most 2e\+08, some 10 GB; simulate a shorter time"):
        ss.simulate(RIGID, duration=1e9)
