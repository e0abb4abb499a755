"""The whole waveform of a free decay: the exact motion, the fit, its accuracy and its intervals."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from motions import free_decay as closed_form
from stickslip.decay.motions import free_decay
from stickslip.decay.start import Search
from stickslip.decay.waveform import Blocks, normal_equations

OMEGA, DAMPING, DRY, REST, AMPLITUDE, RELEASE = 2 * math.pi, 0.0316, 0.02, 0.1, 1.0, 0.26
TRUTH = np.array([OMEGA, DAMPING, DRY, REST, AMPLITUDE, RELEASE])


def half_cycles(damping: float, dry: float, amplitude: float = 1.0) -> int:
    """Thesis, after equation 6.5: the mass rests at the first extreme within the dry friction."""
    ratio, count = math.exp(-math.pi * damping / math.sqrt(1 - damping**2)), 0
    while amplitude > dry:
        amplitude, count = ratio * (amplitude - dry) - dry, count + 1
    return count


def motion(parameters, count: int, total: int, dt: float, *, size: int = 1, order: int = 0):
    return Blocks(np.empty(-(-total // size)), size, total, dt, order).motion(np.asarray(parameters), count)


def ring_down(*, per_period: int = 100, noise: float = 1e-3, seed: int = 0, order: int = 0, truth=TRUTH):
    """A simulated release: samples, their step and the bound of each parameter's standard deviation."""
    count = half_cycles(truth[1], truth[2], abs(truth[4]))
    dt = 2 * math.pi / truth[0] / per_period
    total = int((truth[5] + (count + 1) * math.pi / truth[0]) / dt)
    values, jacobian = motion(truth, count, total, dt, order=order)
    level = noise * truth[0] ** order
    bound = level * np.sqrt(np.diag(np.linalg.inv(jacobian @ jacobian.T)))
    return values + level * np.random.default_rng(seed).standard_normal(total), dt, bound


@pytest.mark.parametrize("side", [1, -1])
def test_the_motion_is_the_engines(side: int) -> None:
    """The same decay by the exact solver, which knows no half cycles."""
    parameters = [OMEGA, DAMPING, DRY, 0.0, side * AMPLITUDE, 0.0]
    system = ss.Oscillator(
        mass=2.0, stiffness=2 * OMEGA**2, damping=4 * DAMPING * OMEGA, law=ss.laws.Coulomb(2 * OMEGA**2 * DRY)
    )
    record = ss.simulate(system, duration=8.0, start={"x": side * AMPLITUDE}).record(fs=100)
    for order, name in enumerate(["x", "v"]):
        values, _ = motion(parameters, 13, 800, 0.01, order=order)
        np.testing.assert_allclose(values, record[name][:800], atol=1e-11 * OMEGA**order)


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("size", [1, 7])
def test_the_jacobian_is_that_of_differences(order: int, size: int) -> None:
    _, jacobian = motion(TRUTH, 13, 800, 0.01, size=size, order=order)
    for index in range(6):
        step = np.zeros(6)
        step[index] = 1e-6
        above, below = (motion(TRUTH + each, 13, 800, 0.01, size=size, order=order)[0] for each in (step, -step))
        error = np.abs((above - below) / 2e-6 - jacobian[index])
        assert np.sort(error)[-15] < 1e-7 * np.abs(jacobian[index]).max()  # but where a turning point passes a sample


def test_the_means_over_blocks_are_exact() -> None:
    for order in range(3):
        every, _ = motion(TRUTH, 13, 8000, 0.001, order=order)
        means, _ = motion(TRUTH, 13, 8000, 0.001, size=25, order=order)
        np.testing.assert_allclose(means, every.reshape(-1, 25).mean(axis=1), atol=1e-10 * OMEGA**order)


def test_the_normal_equations_are_those_of_the_jacobian() -> None:
    total, size = 803, 10
    means, jacobian = motion(TRUTH, 13, total, 0.01, size=size)
    data = means + 1e-3 * np.cos(np.arange(len(means)))
    hessian, gradient = np.empty((6, 6)), np.empty(6)
    blocks = Blocks(data, size, total, 0.01, 0)
    squares = normal_equations(TRUTH, 13, blocks, hessian, gradient, np.empty((3, 7, 6)))
    weight = np.ones(len(means))
    weight[-1] = 0.3
    assert squares == pytest.approx(weight @ (data - means) ** 2, rel=1e-9)
    np.testing.assert_allclose(hessian, (jacobian * weight) @ jacobian.T, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(gradient, (jacobian * weight) @ (data - means), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("amplitude", [1.0, -1.0])
def test_every_channel_gives_the_truth_within_its_interval(order: int, amplitude: float) -> None:
    truth = TRUTH.copy()
    truth[4] = amplitude
    samples, dt, bound = ring_down(order=order, truth=truth)
    record = ss.Record.of({("x", "v", "a")[order]: samples}, fs=1 / dt)
    decay = ss.fit_decay(record)
    answers = [decay.frequency, decay.damping_ratio, decay.dry_displacement, decay.bias, decay.amplitude]
    for answer, true, sd in zip(answers, [1.0, *truth[1:5]], [bound[0] / 2 / math.pi, *bound[1:5]], strict=True):
        assert abs(answer.value - true) < 4 * sd, answer.name
        assert 0.7 * 1.96 * sd < (answer.interval[1] - answer.interval[0]) / 2 < 1.5 * 1.96 * sd, answer.name
    assert decay.half_cycles == (13,)
    assert decay.status == "ok"


def test_the_answer_does_not_depend_on_the_rate() -> None:
    slow, fast = (ring_down(per_period=n, noise=1e-9)[:2] for n in (50, 5000))
    a, b = (ss.fit_decay(ss.Record.of({"x": x}, fs=1 / dt)) for x, dt in (slow, fast))
    assert a.damping_ratio.value == pytest.approx(b.damping_ratio.value, rel=1e-6)
    assert len(b.measured[0]) < 600


@pytest.mark.parametrize(
    ("damping", "dry", "noise", "per_period"),
    [(0.0008, 0.005, 1e-3, 20), (0.0177, 0.02, 1e-2, 100), (0.0631, 0.06, 3e-2, 100), (0.0316, 0.02, 1e-4, 20)],
)
def test_the_fit_reaches_the_bound(damping: float, dry: float, noise: float, per_period: int) -> None:
    """RMSE over the Cramer-Rao bound, and how often the intervals hold the truth: 300 records, +-4 % and +-1.3 %."""
    search, errors, inside = Search(), [], []
    random = np.random.default_rng(7)
    for trial in range(300):
        truth = np.array([OMEGA, damping, dry, REST, 1.0, 0.25 + random.random() / per_period])
        samples, dt, bound = ring_down(per_period=per_period, noise=noise, seed=trial, truth=truth)
        blocks = search.blocks(samples, dt)
        assert blocks is not None
        fits = search.candidates(blocks).copy()
        best = fits[np.argmin(fits[:, 1]), 3:]
        ends = search.intervals(blocks, fits)
        errors.append((best - truth) / bound)
        inside.append((ends[:, 0] <= truth) & (truth <= ends[:, 1]))
    assert np.all(np.sqrt(np.mean(np.square(errors), axis=0))[[1, 2]] < 1.14)
    assert np.all(np.abs(np.mean(inside, axis=0) - 0.95) < 0.05)


def test_static_friction_is_bracketed() -> None:
    samples, dt, _ = ring_down()
    decay = ss.fit_decay(ss.Record.of({"x": samples}, fs=1 / dt))
    assert decay.static_displacement.includes(DRY)


def test_a_force_needs_the_stiffness_or_the_mass() -> None:
    samples, dt, _ = ring_down()
    record = ss.Record.of({"x": samples}, fs=1 / dt)
    assert ss.fit_decay(record).dry_force is None
    by_mass, by_spring = ss.fit_decay(record, mass=2.0), ss.fit_decay(record, stiffness=2 * OMEGA**2)
    assert by_mass.dry_force is not None
    assert by_spring.dry_force is not None
    assert by_mass.dry_force.value == pytest.approx(by_spring.dry_force.value, rel=1e-3)
    assert by_spring.dry_force.includes(2 * OMEGA**2 * DRY)


@pytest.mark.parametrize(
    "samples",
    [np.zeros(400), np.exp(-np.arange(400) / 50.0), np.random.default_rng(0).normal(size=400)],
    ids=["flat", "overdamped", "noise"],
)
def test_what_does_not_ring_is_refused(samples) -> None:
    with pytest.raises(ss.errors.EstimateError, match="free decay"):
        ss.fit_decay(ss.Record.of({"x": samples}, fs=100.0))


def test_mistakes_are_told() -> None:
    samples, dt, _ = ring_down()
    record = ss.Record.of({"x": samples}, fs=1 / dt)
    with pytest.raises(ss.errors.RecordError, match="channel y is not a motion"):
        ss.fit_decay(record, channel="y")
    with pytest.raises(ss.errors.EstimateError, match="mass = -1"):
        ss.fit_decay(record, mass=-1)
    with pytest.raises(ss.errors.RecordError, match="channel v is missing"):
        ss.fit_decay(record, channel="v")
    with pytest.raises(ss.errors.EstimateError, match="no step"):
        ss.fit_decay(record, noise="quantised")
    with pytest.raises(ss.errors.EstimateError, match="restoring = 'round'"):
        ss.fit_decay(record, restoring="round")
    with pytest.raises(ss.errors.EstimateError, match="an angle in rad"):
        ss.fit_decay(record, restoring="pendulum")


PENDULUM = [OMEGA, 0.01, 0.015, 0.05, 1.4, 0.5, 0, 0, 0, 0, 0.5, 0]


def pendulum(*, seed: int = 0, noise: float = 1e-3, seconds: float = 20.0) -> ss.Record:
    """An angle released from 80 degrees: half a percent off in the zero, and its swings not of one length."""
    t = np.arange(int(200 * seconds)) / 200
    theta = free_decay(t, PENDULUM, restoring="pendulum")[0]
    return ss.Record.of({"theta": theta + noise * np.random.default_rng(seed).standard_normal(t.size)}, fs=200)


@pytest.mark.parametrize(("draws", "share"), [(10, 0.74), pytest.param(30, 0.83, marks=pytest.mark.soak)])
def test_a_pendulum_of_large_swings_is_fitted_with_its_sine(draws: int, share: float) -> None:
    """Values, and intervals of 95 % less three deviations; the straight spring is far off and says so."""
    inside = []
    for seed in range(draws):
        decay = ss.fit_decay(pendulum(seed=seed), restoring="pendulum", stiffness=2.0)
        answers = (decay.damping_ratio, decay.dry_displacement, decay.bias, decay.amplitude, decay.release_time)
        inside.append([each.includes(true) for each, true in zip(answers, PENDULUM[1:6], strict=True)])
        assert abs(decay.dry_displacement.value - 0.015) < 4.5 * decay.dry_displacement.sd
    assert decay.status == "ok"
    assert "sin x" in decay.model
    assert decay.frequency.value == pytest.approx(1.0, abs=1e-4)
    assert decay.dry_force is not None
    assert decay.dry_force.includes(0.03)
    assert np.all(np.mean(inside, axis=0) > share)
    assert np.std(decay.residual[0]) == pytest.approx(1e-3 / math.sqrt(5), rel=0.15)
    assert decay.noise_level == pytest.approx(1e-3, rel=0.1)
    straight = ss.fit_decay(pendulum())
    assert "times the noise" in straight.status


def test_a_pendulum_s_static_friction_is_bracketed() -> None:
    """Its dry friction is static too: the sine of where it stays lies below it, that of where it turned above."""
    decay = ss.fit_decay(pendulum(seconds=40.0), restoring="pendulum")
    assert decay.static_displacement.includes(0.015)
    assert decay.static_displacement.status == "ok"
    early = ss.fit_decay(pendulum(seconds=6.0), restoring="pendulum")
    assert "only an upper bound" in early.static_displacement.status


def test_a_pendulum_s_fit_is_that_of_the_choice_among_motions() -> None:
    record = pendulum()
    decay = ss.fit_decay(record, restoring="pendulum", candidates=("both", "viscous"))
    chosen = ss.decay.choose_motion(record, restoring="pendulum", candidates=("both", "static"))
    for name in ("damping_ratio", "dry_displacement", "frequency"):
        one, other = getattr(decay, name), getattr(chosen, name)
        assert (one.value, one.interval, one.sd) == (other.value, other.interval, other.sd)
    assert decay.dry_displacement_any is not None
    assert decay.dry_displacement_any.includes(decay.dry_displacement.value)


def test_a_real_pendulum(dataset: Callable[[str], Path]) -> None:
    """Its authors: 4.1e-3 N m dry, 0.5e-3 N m s viscous; three other methods 3.7e-3 to 4.9e-3 and 2.6e-4 to 5.5e-4."""
    path = dataset("pendulum_decay") / "pend1.csv"
    record = ss.read_record(path, channels={"theta": "#2 - 3.141592653589793 [rad]"}, time="#1 [s]")
    inertia = 0.2235 * 0.31692**2
    decay = ss.fit_decay(record, restoring="pendulum", mass=inertia, candidates="all")
    assert decay.dry_force is not None
    assert 3.6e-3 < decay.dry_force.value < 4.9e-3
    w = 2 * math.pi * decay.frequency.value
    assert 2e-4 < 2 * w * inertia * decay.damping_ratio.value < 6e-4
    dry, damping = decay.dry_displacement_any, decay.damping_ratio_any
    assert dry is not None
    assert damping is not None
    for torque in (3.7e-3, 4.1e-3, 4.89e-3):
        assert dry.includes(torque / (w**2 * inertia))
    for viscous in (2.6e-4, 5e-4, 5.5e-4):
        assert damping.includes(viscous / (2 * w * inertia))
    tried = {candidate.name: candidate.fitted.cost for candidate in decay.motions[0].choice.candidates}
    assert tried["viscous"] > 10**2 * float(sum(each @ each for each in decay.residual))
    assert "Stribeck" in decay.status


def test_the_interval_that_counts_the_model_s_form_stands_beside_the_statistical_one() -> None:
    """In noise of 3 % a friction that rises by 30 % towards rest is not seen, and biases viscous and dry friction."""
    t = np.arange(480) / 40
    x = free_decay(t, [2 * math.pi, 0.02, 0.02, 0.01, 1.0, 0.27, 0, 0.3, 0.3 * 2 * math.pi, 0, 0.5, 0])[0]
    record = ss.Record.of({"x": x + 3e-2 * np.random.default_rng(1).standard_normal(480)}, fs=40)
    plain, found = ss.fit_decay(record), ss.fit_decay(record, candidates="all")
    assert plain.dry_displacement_any is None
    assert plain.motions == ()
    assert found.dry_displacement == plain.dry_displacement
    dry = found.dry_displacement_any
    assert dry is not None
    assert not plain.dry_displacement.includes(0.02)
    assert dry.includes(0.02)
    assert dry.interval[0] <= plain.dry_displacement.interval[0]
    assert "stribeck" in dry.checks[0]
    with pytest.raises(ss.errors.EstimateError, match="candidates = coulomb; each is one of"):
        ss.fit_decay(record, candidates="coulomb")


def test_several_releases_reject_a_motion_together() -> None:
    """Friction that one release leaves open is seen by three; a true motion is not rejected the oftener for it."""
    truth, records = TRUTH.copy(), []
    for seed in range(3):
        truth[3:] = 0.1 * seed, 1.0 - 0.2 * seed, 0.3
        samples, dt, _ = ring_down(seed=seed, truth=truth)
        records.append(ss.Record.of({"x": samples}, fs=1 / dt))
    alone = ss.fit_decay(records[0], candidates=("both", "quadratic"))
    decay = ss.fit_decay(records, candidates=("both", "quadratic"))
    assert len(decay.motions) == 3
    assert decay.status == "ok"
    for one, all_ in (
        (alone.damping_ratio_any, decay.damping_ratio_any), (alone.dry_displacement_any, decay.dry_displacement_any)
    ):  # fmt: skip
        assert one is not None
        assert all_ is not None
        assert all_.sd < one.sd
    assert decay.dry_displacement_any is not None
    assert decay.dry_displacement_any.includes(DRY)


def test_what_a_pendulum_s_fit_does_not_do_is_refused() -> None:
    with pytest.raises(ss.errors.EstimateError, match="2 releases"):
        ss.fit_decay([pendulum(), pendulum(seed=1)], restoring="pendulum")
    with pytest.raises(ss.errors.EstimateError, match="noise = 'coloured'"):
        ss.fit_decay(pendulum(), restoring="pendulum", noise="coloured")


def test_a_lost_extreme_is_said_in_the_status() -> None:
    samples, dt, _ = ring_down(per_period=200)
    decay = ss.fit_decay(ss.Record.of({"x": np.delete(samples, slice(430, 480))}, fs=1 / dt))
    assert "an extreme was lost" in decay.status


def test_the_noise_of_every_release_is_told() -> None:
    samples, dt, _ = ring_down(noise=2e-4)
    records = [ss.Record.of({"x": each}, fs=1 / dt) for each in (samples, np.round(samples / 0.01) * 0.01)]
    assert ss.fit_decay(records).noise == "white; counts of 0.01"


def drift(total: int, dt: float, corner: float, random: np.random.Generator) -> np.ndarray:
    """White noise of unit power and 1/f drift that outweighs it below the corner [Hz]."""
    frequencies = np.fft.rfftfreq(8 * total, dt)
    frequencies[0] = frequencies[1]
    spectrum = np.fft.rfft(random.standard_normal(8 * total)) * np.sqrt(1 + corner / frequencies)
    return np.fft.irfft(spectrum, 8 * total)[:total]


def test_coarse_counts_are_fitted_by_their_intervals() -> None:
    """Noise of a twentieth of a step: least squares lie, the interval likelihood does not; 40 records, +-11 %."""
    step, errors, inside = 0.01, [], []
    for seed in range(40):
        random = np.random.default_rng(seed)
        truth = TRUTH.copy()
        truth[5] += random.random() / 100
        samples = ring_down(noise=0.0, truth=truth)[0]
        samples = samples + 0.05 * step * random.standard_normal(len(samples))
        record = ss.Record.of({"x": np.round(samples / step) * step}, fs=100.0)
        found, plain = ss.fit_decay(record), ss.fit_decay(record, noise="white")
        errors.append([each.damping_ratio.value - DAMPING for each in (found, plain)])
        inside.append([each.damping_ratio.includes(DAMPING) for each in (found, plain)])
        assert "counts" in found.noise
    by_counts, by_squares = np.sqrt(np.mean(np.square(errors), axis=0))
    assert by_squares > 3 * by_counts
    assert np.mean(inside, axis=0)[0] > 0.85
    assert np.mean(inside, axis=0)[1] < 0.7


@pytest.mark.parametrize("corner", [1.0, 10.0])
def test_drift_widens_the_interval(corner: float) -> None:
    inside = []
    for seed in range(40):
        clean, dt, _ = ring_down(noise=0.0)
        samples = clean + 1e-3 * drift(len(clean), dt, corner, np.random.default_rng(seed))
        decay = ss.fit_decay(ss.Record.of({"x": samples}, fs=1 / dt))
        inside.append(
            ["drift" in decay.noise, decay.damping_ratio.includes(DAMPING), decay.dry_displacement.includes(DRY)]
        )
    assert np.all(np.mean(inside, axis=0) > 0.84)


def test_white_noise_is_called_white() -> None:
    called = []
    for seed in range(40):
        samples, dt, _ = ring_down(seed=seed)
        called.append(ss.fit_decay(ss.Record.of({"x": samples}, fs=1 / dt)).noise)
    assert called.count("white") >= 38


def test_several_releases_share_the_friction_and_narrow_the_bracket() -> None:
    records, random = [], np.random.default_rng(4)
    for seed in range(6):
        truth = TRUTH.copy()
        truth[3:] = random.normal(), random.uniform(0.5, 1.0) * random.choice([-1, 1]), 0.3 + random.random()
        samples, dt, _ = ring_down(seed=seed, truth=truth)
        records.append(ss.Record.of({"x": samples}, fs=1 / dt))
    alone = [ss.fit_decay(record) for record in records]
    decay = ss.fit_decay(records)
    assert len(decay.half_cycles) == len(decay.time) == 6
    assert decay.damping_ratio.includes(DAMPING)
    assert decay.dry_displacement.includes(DRY)
    assert decay.damping_ratio.sd < 0.6 * min(each.damping_ratio.sd for each in alone)
    assert decay.static_displacement.includes(DRY)
    assert decay.static_displacement.sd <= min(each.static_displacement.sd for each in alone)


@pytest.mark.parametrize(("index", "value"), [(2, 0.03), (1, 0.05), (0, 7.0)], ids=["dry", "damping", "frequency"])
def test_releases_that_share_no_friction_are_said_to(index: int, value: float) -> None:
    records = []
    for seed, truth in enumerate((TRUTH, TRUTH.copy())):
        truth[index] = value if seed else truth[index]
        samples, dt, _ = ring_down(seed=seed, truth=truth)
        records.append(ss.Record.of({"x": samples}, fs=1 / dt))
    decay = ss.fit_decay(records)
    assert decay.status.startswith("the releases do not share one friction and frequency")
    assert all(np.isfinite(estimate.interval).all() for estimate in decay.estimates)


def several_releases(*changed: dict[int, float]) -> ss.Record:
    """Releases in one record, with the hand's slow pull between them, each with other values of the truth's."""
    parts, random = [], np.random.default_rng(1)
    for seed, values in enumerate(changed):
        truth = TRUTH.copy()
        truth[list(values)] = list(values.values())
        samples, dt, _ = ring_down(seed=seed, truth=truth)
        if parts:
            before = parts[-1][-1]
            pull = before + (samples[0] - before) * (1 - np.cos(np.linspace(0, math.pi, 300))) / 2
            parts.append(pull + 1e-3 * random.standard_normal(300))
        parts.append(samples)
    return ss.Record.of({"x": np.concatenate(parts)}, fs=1 / dt)


def test_several_releases_in_one_file_are_fitted_together() -> None:
    decay = ss.fit_decay(several_releases({4: 1.0}, {4: 0.8}, {4: -0.9}))
    assert len(decay.ring_downs) == 3
    assert len(decay.half_cycles) == 3
    assert decay.status == "ok"
    assert abs(decay.damping_ratio.value - DAMPING) < 4 * decay.damping_ratio.sd
    assert abs(decay.dry_displacement.value - DRY) < 4 * decay.dry_displacement.sd


def test_releases_of_one_file_that_share_no_friction_are_told_each_by_its_own() -> None:
    """The headline had what fits both of them, 10 % off either."""
    findings = ss.analyze_decay(several_releases({4: 1.0, 2: DRY}, {4: 0.8, 2: 0.9 * DRY}))
    motions = findings.decay.waveform.motions
    assert [motion.dry_displacement.includes(dry) for motion, dry in zip(motions, (DRY, 0.9 * DRY), strict=True)] == [
        True,
        True,
    ]
    told = " ".join(ss.summary(findings).headline)
    assert told.startswith("The releases do not share one friction and frequency: of release 1 a damping ratio of ")


@pytest.mark.parametrize("extremes", [3, 4])
def test_three_or_four_extremes_are_enough(extremes: int) -> None:
    """Release and the first turns alone, with the dry friction that stops it there, or cut off while it moves."""
    inside = []
    for seed in range(20):
        for dry in (0.2 if extremes == 3 else 0.15, DRY):
            truth = TRUTH.copy()
            truth[2] = dry
            samples, dt, _ = ring_down(seed=seed, truth=truth)
            if dry == DRY:
                samples = samples[: int((truth[5] + (extremes - 1) / 2 + 0.2) / dt)]
            decay = ss.fit_decay(ss.Record.of({"x": samples}, fs=1 / dt))
            inside.append([decay.damping_ratio.includes(DAMPING), decay.dry_displacement.includes(dry)])
    assert np.all(np.mean(inside, axis=0) >= 0.85)


def test_one_release_twice_is_half_the_variance() -> None:
    """The general likelihood gives what the compiled fit of one release gives."""
    samples, dt, _ = ring_down()
    record = ss.Record.of({"x": samples}, fs=1 / dt)
    one, two = ss.fit_decay(record), ss.fit_decay([record, record])
    assert two.damping_ratio.value == pytest.approx(one.damping_ratio.value, abs=0.01 * one.damping_ratio.sd)
    assert two.damping_ratio.sd == pytest.approx(one.damping_ratio.sd / math.sqrt(2), rel=0.01)
    for a, b in zip(one.damping_ratio.interval, two.damping_ratio.interval, strict=True):
        assert b - two.damping_ratio.value == pytest.approx((a - one.damping_ratio.value) / math.sqrt(2), rel=0.02)


def test_a_hand_that_pulls_and_touches_is_left_out() -> None:
    samples, dt, bound = ring_down()
    pull = np.linspace(samples[-1], samples[0], 150) + 1e-3 * np.random.default_rng(3).standard_normal(150)
    touch = samples[-1] + 0.3 * np.sin(np.linspace(0, 1, 100)) + 1e-3 * np.random.default_rng(5).standard_normal(100)
    whole = np.concatenate([pull, samples, samples[-50:], touch])
    decay = ss.fit_decay(ss.Record.of({"x": whole}, fs=1 / dt))
    assert abs(decay.damping_ratio.value - DAMPING) < 4 * bound[1]
    assert abs(decay.dry_displacement.value - DRY) < 4 * bound[2]


def test_clipped_swings_are_left_out() -> None:
    samples, dt, bound = ring_down()
    decay = ss.fit_decay(ss.Record.of({"x": np.clip(samples, REST - 0.7, REST + 0.7)}, fs=1 / dt))
    assert "clipped swings are left out" in decay.status
    assert abs(decay.damping_ratio.value - DAMPING) < 8 * bound[1]
    assert abs(decay.dry_displacement.value - DRY) < 8 * bound[2]


@pytest.mark.parametrize(("damping", "dry"), [(DAMPING, 0.0), (0.0, DRY)], ids=["viscous", "dry"])
def test_one_friction_alone_is_told_from_both(damping: float, dry: float) -> None:
    truth = TRUTH.copy()
    truth[1:3] = damping, dry
    count = 40 if dry == 0 else half_cycles(damping, dry)
    clean, _ = motion(truth, count, 1200, 0.01)
    samples = clean + 1e-3 * np.random.default_rng(2).standard_normal(1200)
    decay = ss.fit_decay(ss.Record.of({"x": samples}, fs=100.0))
    assert abs(decay.damping_ratio.value - damping) < 4 * decay.damping_ratio.sd
    assert abs(decay.dry_displacement.value - dry) < 4 * decay.dry_displacement.sd
    assert decay.status == "ok"


def test_static_friction_above_the_kinetic_is_bracketed() -> None:
    slider = ss.Oscillator(mass=1.0, stiffness=1000.0, damping=2.0, law=ss.laws.Coulomb(0.3, 1.5))
    seen = ss.simulate(slider, duration=4.0, start={"x": 0.01}).record(fs=500)["x"]
    decay = ss.fit_decay(ss.Record.of({"x": seen + 1e-5 * np.random.default_rng(0).standard_normal(len(seen))}, fs=500))
    assert abs(decay.dry_displacement.value - 3e-4) < 4 * decay.dry_displacement.sd
    assert decay.static_displacement.includes(1.5e-3)


def test_another_motion_is_flagged() -> None:
    t = np.arange(3000) / 500
    seen = np.exp(-0.4 * t) * np.cos(30 * t) + 0.02 * t + 1e-3 * np.random.default_rng(0).standard_normal(3000)
    assert "times the noise" in ss.fit_decay(ss.Record.of({"x": seen}, fs=500)).status


def test_a_growing_swing_is_refused() -> None:
    t = np.arange(3000) / 500
    seen = 1e-3 * np.exp(0.4 * t) * np.cos(30 * t) + 1e-6 * np.random.default_rng(0).standard_normal(3000)
    with pytest.raises(ss.errors.EstimateError, match="grow"):
        ss.fit_decay(ss.Record.of({"x": seen}, fs=500))


@pytest.mark.parametrize("length", [1e-9, 1e3])
def test_the_same_answer_in_other_units(length: float) -> None:
    samples, dt, _ = ring_down()
    metres = ss.fit_decay(ss.Record.of({"x": samples}, fs=1 / dt))
    other = ss.fit_decay(ss.Record.of({"x": length * samples}, fs=0.1 / dt))
    assert other.damping_ratio.value == pytest.approx(metres.damping_ratio.value, rel=1e-9)
    assert other.dry_displacement.interval == pytest.approx(
        [length * end for end in metres.dry_displacement.interval], rel=1e-6
    )


def test_counts_at_a_high_rate_are_counts_still() -> None:
    """Without noise a count's error is steady over many samples, and no part of it averages out."""
    x = np.round(free_decay(np.arange(36000) / 4000, [2 * math.pi, DAMPING, DRY, 0.013, 1.0, 0.3, *[0] * 6])[0], 2)
    decay = ss.fit_decay(ss.Record.of({"x": x}, fs=4000.0))
    assert "counts" in decay.noise
    assert decay.status == "ok"
    assert decay.damping_ratio.includes(DAMPING)
    assert decay.dry_displacement.includes(DRY)


def test_a_motion_without_noise_that_came_to_rest_is_not_taken_for_counts() -> None:
    slider = ss.Oscillator(mass=1, stiffness=10, damping=0.2, law=ss.laws.Coulomb(0.2))
    run = ss.simulate(slider, duration=60, start={"x": 1.0})
    decay = ss.fit_decay(run.record(fs=200), stiffness=10)
    assert decay.noise == "white"
    assert decay.damping_ratio.value == pytest.approx(0.1 / math.sqrt(10), rel=1e-9)
    assert decay.dry_force is not None
    assert decay.dry_force.value == pytest.approx(0.2, rel=1e-9)
    assert decay.dry_displacement.sd < 1e-8


def test_the_mean_of_several_candidates_lies_within_its_interval():
    """A candidate too unlikely for the interval still has its share in the mean."""
    from stickslip.decay.fit_decay import _mean

    rows = np.array([np.full(6, 1.0), np.full(6, 2.0)])
    ends = np.tile([0.99, 1.01], (6, 1))
    found = _mean(rows, np.array([0.9, 0.1]), np.eye(6), ends, [(3,), (4,)], [(), ()])
    assert np.all(found.values == pytest.approx(1.1))
    assert np.all((found.ends[:, 0] <= found.values) & (found.values <= found.ends[:, 1]))


@pytest.mark.parametrize("counts", [0.0, 0.02])
@pytest.mark.parametrize("held", [1, 2, 4])
def test_an_acceleration_that_is_released_at_a_sample_is_damped_as_it_is(held: int, counts: float) -> None:
    """The jump of the release stood in one sample, passed for drift, and took 30 deviations off the damping ratio."""
    slider = ss.Oscillator(mass=1.0, stiffness=2000.0, damping=0.5, law=ss.laws.Coulomb(0.3))
    run = ss.simulate(slider, duration=4.0, start={"x": 5e-3})
    motion = ss.Rig.perfect("a").measure(run, fs=2000, rng=0)["a"][1:]
    samples = np.concatenate([np.zeros(held), motion])
    samples = samples + np.random.default_rng(held).normal(0, 0.02, len(samples))
    samples = np.round(samples / counts) * counts if counts else samples
    decay = ss.fit_decay(ss.Record.of({"a": samples}, fs=2000))
    for estimate, truth in ((decay.damping_ratio, 0.25 / 2000**0.5), (decay.dry_displacement, 1.5e-4)):
        assert abs(estimate.value - truth) < 3 * estimate.sd
        assert estimate.sd < 0.2 * truth


@pytest.mark.parametrize("channel", ["v", "a"])
def test_what_moves_no_more_has_come_to_rest_on_any_channel(channel: str) -> None:
    """Of an acceleration it was an upper bound of 10 mm: its noise in m/s^2 was taken for one in metres."""
    values, fs, turns = closed_form(order="xva".index(channel), per_cycle=200, hold=3, tail=5)
    noisy = values + 2e-3 * np.ptp(values) * np.random.default_rng(4).standard_normal(len(values))
    static = ss.fit_decay(ss.Record.of({channel: noisy}, fs=fs)).static_displacement
    assert static.status == "ok"
    assert static.includes(0.02)
    assert static.interval[1] < 1.2 * abs(turns[-2])


def test_the_rest_position_lies_where_it_swings() -> None:
    """A second mode passed for drift, beside which the rest position was -7 m to 7 m of swings of 30 mm."""
    values, fs, _ = closed_form(per_cycle=200, tail=4)
    since = np.maximum(np.arange(len(values)) / fs - 0.25, 0.0)
    mode = 0.03 * np.exp(-0.05 * 13.7 * since) * np.cos(2 * np.pi * 6.85 * since)
    noisy = values + mode + 2e-4 * np.random.default_rng(1).standard_normal(len(values))
    rest = ss.fit_decay(ss.Record.of({"x": noisy}, fs=fs)).bias
    assert np.ptp(rest.interval) <= np.ptp(noisy)
    assert rest.includes(0.0)
