"""Coefficients of friction by closed forms, loads, wear-in and none, the map along the stroke, several tests."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.signal import lfilter

import stickslip as ss
from stickslip.answers import analyze_tribometer, compare_tribometers
from stickslip.cli.program import main
from stickslip.cycle import friction_coefficients, static_coefficient
from stickslip.cycle.tribometer import changes, fit_wear_in
from stickslip.errors import EstimateError, ModelError, RecordError
from stickslip.estimate import stands

FS, HALF, STROKE, RISE = 1000.0, 500, 4e-3, 0.4e-3  # Hz, samples of a stroke, m, m over which friction turns round
LOAD = 10.0


def strokes(cycles=40, coefficient=0.3, noise=0.01, seed=0, load=None, patch=0.0, rise=RISE):
    """Strokes of a crank; friction turns round over a way, as a contact gives way."""
    n = np.arange(2 * cycles * HALF)
    stroke, along = n // HALF, (1 - np.cos(np.pi * (n % HALF) / HALF)) / 2 * STROKE
    forward = stroke % 2 == 0
    x = np.where(forward, along, STROKE - along)
    level = coefficient * np.ones(cycles) if np.ndim(coefficient) == 0 else np.asarray(coefficient)
    shape = 2 * np.minimum(along / rise, 1) - 1
    local = level[stroke // 2] * (1 + patch * (np.abs(x - 0.7 * STROKE) < 0.05 * STROKE))
    normal = LOAD * (1 + 0.02 * np.sin(2 * np.pi * stroke / 7)) if load == "measured" else LOAD
    friction = np.where(forward, 1, -1) * local * shape * normal
    friction += np.random.default_rng(seed).normal(0, noise, n.size)
    channels = {"x": x, "friction": friction} | ({"normal": normal * np.ones(n.size)} if load == "measured" else {})
    return ss.Record.of(channels, fs=FS)


def test_each_definition_is_its_closed_form() -> None:
    coefficients = friction_coefficients(strokes(), normal="10 N")
    half, whole = np.arccos(1 - RISE / STROKE), np.arccos(1 - 2 * RISE / STROKE)  # phases at which it is none, and full

    def rising(phase: float) -> float:
        """Friction over its level, integrated over the phase from the reversal on."""
        return (STROKE / RISE - 1) * phase - STROKE / RISE * np.sin(phase)

    assert coefficients.plateau.value == pytest.approx(0.3, rel=2e-3)
    assert coefficients.by_energy.value == pytest.approx(0.3 * (1 - RISE / STROKE), rel=5e-3)
    assert coefficients.by_stroke.value == pytest.approx(0.3 * (rising(whole) + np.pi - whole) / np.pi, rel=5e-3)
    mean = (rising(whole) - 2 * rising(half) + np.pi - whole) / np.pi
    assert coefficients.by_cycle.value == pytest.approx(0.3 * mean, rel=5e-3)
    assert coefficients.wear_in is None
    assert stands(coefficients.plateau.status)
    assert len(coefficients.time) == pytest.approx(40, abs=1)


@pytest.mark.parametrize("noise", [0.0, 2e-4, 2e-3, 1e-2])
def test_noise_of_the_position_is_no_way_to_slide(noise: float) -> None:
    """It added to the way: by energy 0.3 was told as 0.053 where a sample's step is less than the noise."""
    record = strokes(rise=1e-9)
    x = record["x"] + noise * STROKE * np.random.default_rng(4).standard_normal(len(record))
    coefficients = friction_coefficients(ss.Record.of({"x": x, "friction": record["friction"]}, fs=FS), normal=LOAD)
    assert coefficients.by_energy.value == pytest.approx(0.3, rel=5e-4 + noise / 2)


def test_a_work_whose_turns_lie_between_samples_is_as_unsure_as_that() -> None:
    """At 50 samples a stroke it was low by 0.1 %, and sure to 0.01 %."""
    phase = 2 * np.pi * np.arange(6000) / 100
    friction = 3 * np.where(np.arange(6000) % 100 < 50, 1, -1) + np.random.default_rng(2).normal(0, 0.01, 6000)
    record = ss.Record.of({"x": -1e-3 * np.cos(phase), "friction": friction}, fs=100.0)
    assert friction_coefficients(record, normal=LOAD).by_energy.includes(0.3)


@pytest.mark.parametrize("slides", [0.2, 0.35, 0.5, 0.7, 0.85])
def test_of_a_contact_that_slides_over_a_part_of_its_stroke_that_part_is_told(slides: float) -> None:
    """Of a stroke half of which the contact gave way 0.48 was told for 0.5, of one with a fifth left 0.14: sure."""
    told = friction_coefficients(strokes(coefficient=0.5, rise=(1 - slides) * STROKE), normal=LOAD).plateau
    assert told.includes(0.5)
    assert told.value == pytest.approx(0.5, rel=2e-3)
    assert stands(told.status) == (slides > 0.75)
    assert slides > 0.75 or f"{100 * slides:.0f} % of each stroke" in told.status


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.5])
def test_a_contact_that_never_slides_has_no_kinetic_coefficient(noise: float) -> None:
    x = strokes()["x"]
    elastic = 2e3 * (x - STROKE / 2) + np.random.default_rng(1).normal(0, noise, len(x))
    test = analyze_tribometer(ss.Record.of({"x": x, "friction": elastic}, fs=FS), normal=LOAD)
    assert not test.tribometer.plateau.known
    assert str(ss.summary(test).headline[0]).startswith(
        "No kinetic coefficient of friction is told: the contact slides"
    )


def test_strokes_of_three_samples_are_told_though_none_lies_at_their_end() -> None:
    phase = 2 * np.pi * np.arange(240) / 6 + np.pi / 4
    record = ss.Record.of({"x": 1e-3 * np.sin(phase), "friction": 3 * np.sign(np.cos(phase))}, fs=6.0)
    assert friction_coefficients(record, normal=LOAD).plateau.value == pytest.approx(0.3, rel=1e-12)


def test_a_zero_that_is_off_stays_in_the_mean_of_a_cycle_alone() -> None:
    record = strokes()
    off = ss.Record.of({"x": record["x"], "friction": record["friction"] + 5.0}, fs=FS)
    plain, shifted = (friction_coefficients(one, normal=LOAD) for one in (record, off))
    for name in ("plateau", "by_stroke", "by_energy"):
        assert getattr(shifted, name).value == pytest.approx(getattr(plain, name).value, rel=0.01), name
    assert shifted.by_cycle.value > 1.3 * plain.by_cycle.value


def test_the_plateau_is_past_where_friction_turns_round() -> None:
    """What turns round is below the level in every cycle alike: none of 20 intervals held 0.3."""
    held = [
        friction_coefficients(strokes(noise=noise, seed=seed), normal=LOAD).plateau.includes(0.3)
        for seed, noise in enumerate(np.geomspace(0.003, 0.1, 20))
    ]
    assert sum(held) >= 17  # fewer are there of 20 at 95 % in 2 of 1,000


@pytest.mark.parametrize("size", [-2.0, 3.0])
def test_a_zero_that_drifts_is_no_wear_in(size: float) -> None:
    """Between a stroke forward and the next one back it moves on, and less and less so."""
    record = strokes()
    drift = size * np.exp(-np.arange(len(record)) / (0.1 * len(record)))
    drifting = ss.Record.of({"x": record["x"], "friction": record["friction"] + drift}, fs=FS)
    coefficients = friction_coefficients(drifting, normal=LOAD)
    assert coefficients.wear_in is None
    for name in ("plateau", "by_stroke", "by_energy"):
        plain = getattr(friction_coefficients(record, normal=LOAD), name)
        assert getattr(coefficients, name).value == pytest.approx(plain.value, abs=2 * plain.sd), name


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_force_without_its_sign_is_refused(sign: float) -> None:
    """Its plateau was told as 0.00001, without a doubt."""
    record = strokes()
    sized = ss.Record.of({"x": record["x"], "friction": sign * np.abs(record["friction"])}, fs=FS)
    with pytest.raises(EstimateError, match=r"same sign both ways, 2.76 N in the mean.*with its sign"):
        friction_coefficients(sized, normal=LOAD)


@pytest.mark.parametrize("coefficient", [0.3, 0.001])
def test_a_zero_beyond_the_friction_is_no_lack_of_a_sign(coefficient: float) -> None:
    record = strokes(coefficient=coefficient)
    off = ss.Record.of({"x": record["x"], "friction": record["friction"] + 50.0}, fs=FS)
    assert friction_coefficients(off, normal=LOAD).plateau.value == pytest.approx(coefficient, rel=0.1)


def test_a_load_that_was_measured_is_taken_cycle_by_cycle() -> None:
    coefficients = friction_coefficients(strokes(load="measured"))
    assert coefficients.measured
    assert coefficients.plateau.value == pytest.approx(0.3, rel=3e-3)
    assert coefficients.load.value == pytest.approx(LOAD, rel=0.01)
    assert friction_coefficients(strokes(load="measured"), normal=20.0).plateau.value == pytest.approx(0.15, rel=0.03)


def test_a_load_that_changes_along_the_stroke_is_taken_where_it_is() -> None:
    """The median over the stroke of a force that is not even there was 1.4 % below it, and outside of the interval."""
    even = strokes(noise=0.02)
    tilted = LOAD * (1 + 0.3 * (2 * even["x"] / STROKE - 1))
    channels = {"x": even["x"], "friction": even["friction"] * tilted / LOAD + 2.0, "normal": tilted}
    coefficients = friction_coefficients(ss.Record.of(channels, fs=FS))
    plain = friction_coefficients(even, normal=LOAD)
    assert coefficients.plateau.value == pytest.approx(plain.plateau.value, rel=1e-3)
    assert np.nanstd(coefficients.forward[:, 16:]) < 1.5 * np.nanstd(plain.forward[:, 16:])


def test_what_the_load_is_known_to_is_in_the_interval() -> None:
    exact, unsure = (friction_coefficients(strokes(), normal=load) for load in ("10 N", "10 ± 0.5 N"))
    low, high = unsure.plateau.interval
    assert high - low == pytest.approx(2 * 1.96 * 0.05 * 0.3, rel=0.01)
    assert exact.plateau.interval[1] - exact.plateau.interval[0] < 0.01 * (high - low)


@pytest.mark.parametrize(
    ("normal", "error", "words"), [(None, RecordError, "--normal"), (-3.0, ModelError, "positive")]
)
def test_a_load_that_is_none_is_refused(normal, error, words) -> None:
    with pytest.raises(error, match=words):
        friction_coefficients(strokes(), normal=normal)


def test_a_measured_load_of_none_is_the_records() -> None:
    """On the command line that is exit code 1 and not wrong use."""
    record = strokes()
    pressed = record.with_channel("normal", np.zeros(len(record)), unit="N")
    with pytest.raises(RecordError, match="a normal load of 0 N; the load presses"):
        friction_coefficients(pressed)


def test_wear_in_is_told_and_left_behind() -> None:
    cycle = np.arange(120)
    coefficients = friction_coefficients(strokes(120, 0.3 + 0.1 * np.exp(-cycle / 12)), normal=LOAD)
    assert coefficients.wear_in.cycles.value == pytest.approx(12, rel=0.05)
    assert coefficients.wear_in.change.value == pytest.approx(0.1, rel=0.05)
    assert coefficients.plateau.value == pytest.approx(0.3, rel=0.01)  # of the cycles after it: 0.31 of all
    still = friction_coefficients(strokes(60, 0.3 + 0.1 * np.exp(-np.arange(60) / 40)), normal=LOAD)
    assert "still wearing in" in still.plateau.status


def test_no_stroke_is_parted_between_two_cycles_of_a_wear_in() -> None:
    """The median of two halves, a cycle apart, is that of either: the change was 3 % too small."""
    wear_in = friction_coefficients(strokes(120, 0.3 + 0.1 * np.exp(-np.arange(120) / 8)), normal=LOAD).wear_in
    assert wear_in.change.value == pytest.approx(0.1, rel=5e-3)
    assert wear_in.cycles.value == pytest.approx(8, rel=5e-3)


def test_a_wear_in_knows_what_its_load_is_known_to() -> None:
    test = strokes(120, 0.3 + 0.1 * np.exp(-np.arange(120) / 12))
    exact, unsure = (friction_coefficients(test, normal=load).wear_in for load in ("10 N", "10 ± 0.1 N"))
    for number in ("final", "change"):
        known, widened = getattr(exact, number), getattr(unsure, number)
        assert widened.sd == pytest.approx(np.hypot(known.sd, 0.01 * known.value))
    assert unsure.final.includes(0.3)
    assert unsure.cycles.sd == exact.cycles.sd


@pytest.mark.parametrize(("draws"), [60, pytest.param(2000, marks=pytest.mark.soak)])
def test_an_even_coefficient_is_not_told_to_wear_in_nor_to_rise(draws) -> None:
    """Neighbours alike by up to 0.9: of 750 none came near a wear-in; alike by up to 1, of 12,000 none to a rise."""
    for seed in range(draws):
        chance = np.random.default_rng(seed)
        scatter = lfilter([1], [1, -chance.choice([0.0, 0.5, 0.9])], chance.normal(0, 0.01, 700))
        even = 0.3 + scatter[200 : 200 + int(chance.integers(20, 500))]
        assert fit_wear_in(even) is None
        assert not changes(even)


@pytest.mark.parametrize("rise", [0.096, -0.15, 0.01])
def test_a_coefficient_that_rises_along_the_test_is_told_from_what_to_what(rise: float) -> None:
    """One that rose from 0.30 to 0.40 was told as 0.35 (0.19 to 0.50), and that it rises was not."""
    level = 0.3 + rise * np.arange(120) / 119 + np.random.default_rng(3).normal(0, 1e-3, 120)
    findings = analyze_tribometer(strokes(120, level), normal=LOAD)
    test = findings.tribometer
    cycles = len(test.time)  # the last may lack its end
    assert test.first.value == pytest.approx(level[:12].mean(), abs=1e-3)
    assert test.last.value == pytest.approx(level[cycles - 12 : cycles].mean(), abs=1e-3)
    assert test.plateau.includes(level[:cycles].mean())
    assert np.ptp(test.plateau.interval) < 0.002
    assert stands(test.plateau.status) == (abs(rise) < 0.015)
    words = " ".join(ss.summary(findings).headline)
    assert words.count("It rises along the test" if rise > 0 else "It falls along the test") == 1


def test_a_coefficient_that_rises_after_its_wear_in_is_told_to() -> None:
    cycle = np.arange(150)
    wears = 0.3 + 0.1 * np.exp(-cycle / 5)
    rising, settled = (friction_coefficients(strokes(150, wears + rise * cycle), normal=LOAD) for rise in (2e-5, 0.0))
    assert rising.wear_in is not None
    assert rising.last.value - rising.first.value == pytest.approx(2e-5 * 0.9 * (150 - rising.steady), rel=0.15)
    assert settled.wear_in is not None
    assert settled.first is None


@pytest.mark.parametrize(("draws", "least"), [(60, 0.84), pytest.param(600, 0.91, marks=pytest.mark.soak)])
def test_intervals_of_a_wear_in_hold(draws, least) -> None:
    """Of 147 they held 93, 95 and 95 %; `least` is three or four binomial deviations below 95 %."""
    held = []
    for seed in range(draws):
        chance = np.random.default_rng([seed, 77])
        count, alike = int(chance.integers(100, 500)), chance.choice([0.0, 0.3, 0.6])
        true = 0.3, chance.uniform(0.05, 0.2) * chance.choice([-1, 1]), chance.uniform(5, count / 5)
        scatter = lfilter([1], [1, -alike], chance.normal(0, 0.008, count + 200))[200:]
        wear = fit_wear_in(true[0] + true[1] * np.exp(-np.arange(count) / true[2]) + scatter)
        if wear is not None:
            held.append([one.includes(value) for one, value in zip(wear.estimates, true, strict=True)])
    assert len(held) > 0.9 * draws
    assert np.all(np.mean(held, axis=0) >= least)


def test_the_map_shows_the_place_that_rubs_more() -> None:
    coefficients = friction_coefficients(strokes(patch=0.5), normal=LOAD)
    both = np.nanmean((coefficients.forward + coefficients.back) / 2, axis=0)
    inner = np.abs(coefficients.position - STROKE / 2) < 0.35 * STROKE
    assert coefficients.position[inner][np.argmax(both[inner])] == pytest.approx(0.7 * STROKE, abs=0.06 * STROKE)
    assert both[inner].max() == pytest.approx(0.45, rel=0.02)
    assert np.median(both[inner]) == pytest.approx(0.3, rel=0.02)


def test_over_tests_the_scatter_between_them_counts() -> None:
    tests = [
        analyze_tribometer(strokes(12, level, seed=seed), normal=LOAD) for seed, level in enumerate((0.28, 0.3, 0.32))
    ]
    mean = compare_tribometers(tests).plateau
    assert mean.value == pytest.approx(0.3, rel=0.01)
    assert mean.interval[1] - mean.interval[0] > 5 * np.ptp(tests[0].tribometer.plateau.interval)


def cell(fs=1000.0, static=0.25, kinetic=0.18, stiffness=2e4, period=0.5, frequency=400.0, seed=0, load=LOAD):
    """A specimen on a load cell under a stage that moves evenly to and fro; what holds after a slip holds no longer."""
    step, mass, rounds = 2e-5, stiffness / (2 * np.pi * frequency) ** 2, 6
    damping, speed = 0.3 * np.sqrt(stiffness * mass), 2 * STROKE / period
    every, count = round(1 / fs / step), round(rounds * period / step)
    away, rate, holds, side, bears = 0.0, 0.0, True, 1.0, static
    force = np.empty(-(-count // every))
    for row in range(count):
        stage = speed if (row * step / period) % 1 < 0.5 else -speed
        if row % every == 0:
            force[row // every] = stiffness * away
        if holds:
            rate = stage
            borne = stiffness * away + damping * rate
            bears = static if side * stage < 0 else bears
            holds, side = abs(borne) < bears * load, np.sign(borne)
        if not holds:
            bears = kinetic
            after = rate + step * (side * load * kinetic - damping * rate - stiffness * away) / mass
            holds = side * (stage - after) <= 0
            rate = stage if holds else after
        away += step * rate
    chance, time = np.random.default_rng(seed), np.arange(len(force)) / fs
    x = STROKE * np.abs(2 * ((time / period) % 1) - 1) + chance.normal(0, 1e-6, time.size)
    return ss.Record.of({"x": -x, "friction": force + chance.normal(0, 0.01, time.size)}, fs=fs)


@pytest.mark.parametrize("fs", [1000.0, 5000.0])
def test_the_static_coefficient_is_the_peak_at_each_reversal(fs) -> None:
    findings = analyze_tribometer(cell(fs), normal=LOAD)
    assert findings.static.includes(0.25), findings.static
    assert findings.static.interval[0] > 0.19
    assert np.ptp(findings.static.interval) < (0.07 if fs < 5000 else 0.02)
    assert len(findings.peaks.of_strokes) >= 9
    assert not findings.notes


def test_the_static_coefficient_is_of_the_load_that_was_measured() -> None:
    record = cell()
    load = 10.0 + np.random.default_rng(1).normal(0, 0.1, len(record))
    measured = ss.Record.of({"x": record["x"], "friction": record["friction"], "normal": load}, fs=record.fs)
    assert analyze_tribometer(measured).static.includes(0.25)
    unsure = analyze_tribometer(record, normal="10 ± 0.5 N").static
    assert np.ptp(unsure.interval) > 1.96 * 2 * 0.05 * 0.23


@pytest.mark.parametrize("frequency", [100.0, 250.0, 400.0])
def test_a_cell_that_swings_on_claims_no_static_friction(frequency: float) -> None:
    """What bears no more at rest seemed to bear 5 to 10 % more: the cell is let go as it rises, and swings beyond."""
    record = cell(5000.0, static=0.18, stiffness=4e4, frequency=frequency)
    assert not ss.cycle.breakaway(record).ratio.interval[0] > 1


@pytest.mark.parametrize(
    ("record", "why"),
    [
        (cell(static=0.18), "may swing"),
        (cell(250.0), "Hz or more"),
        (cell(5000.0, static=0.18, stiffness=1e4, frequency=4.0), "may swing"),
        (strokes(), "without a peak"),
    ],
    ids=["none", "too slow", "a ring", "a slow turn"],
)
def test_where_no_static_coefficient_shows_the_reason_is_told(record, why) -> None:
    findings = analyze_tribometer(record, normal=LOAD)
    assert findings.static is None
    assert why in findings.notes[0], findings.notes
    with pytest.raises(EstimateError, match=why):
        static_coefficient(record, coefficients=findings.tribometer)


@pytest.mark.figures
def test_no_friction_at_all_has_no_coefficient_by_its_work() -> None:
    x = STROKE * np.sin(2 * np.pi * np.arange(4000) / FS)
    told = friction_coefficients(ss.Record.of({"x": x, "friction": 0.0 * x}, fs=FS), normal=LOAD)
    assert told.by_energy.interval == (0.0, 0.0)


def test_command(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    for number, level in enumerate((0.3, 0.31)):
        record = strokes(25, level + 0.1 * np.exp(-np.arange(25) / 2.5), seed=number)
        table = np.column_stack([record.time, 1e3 * record["x"], record["friction"]])
        np.savetxt(f"{number}.csv", table, delimiter=",", header="t [s],x [mm],Ft [N]", comments="")
    channels = ["--channels", "x=x", "--channels", "friction=Ft", "--normal", "10"]
    run = CliRunner().invoke(main, ["tribometer", "0.csv", *channels])
    assert run.exit_code == 0, run.output
    assert "kinetic coefficient of friction" in run.output
    data = json.loads((tmp_path / "0-tribometer/results.json").read_text())
    values = {one["name"]: one["value"] for one in data["estimates"]}
    assert values["coefficient of friction, plateau"] == pytest.approx(0.3, rel=0.02)
    assert len(data["map"]["forward"][0]) == len(data["map"]["position"])
    both = CliRunner().invoke(main, ["tribometer", "0.csv", "1.csv", "--json", *channels])
    assert both.exit_code == 0, both.output
    assert len(json.loads(both.stdout)["records"]) == 2
    lacking = CliRunner().invoke(main, ["tribometer", "0.csv", "--json", *channels[:4]])
    assert lacking.exit_code == 1
    assert "--normal" in lacking.output
    unnamed = CliRunner().invoke(main, ["tribometer", "0.csv", "--normal", "10"])
    assert unnamed.stderr.endswith("To mend it:\nstickslip init 0.csv\n")
    CliRunner().invoke(main, ["init", "0.csv", "--yes"])
    assert CliRunner().invoke(main, ["tribometer", "0.csv", "--normal", "10", "--json"]).exit_code == 0
