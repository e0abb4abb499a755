"""The delay between an LVDT and an accelerometer, on the thesis's rig: error against its bound, bias, and coverage.

Each row: root-mean-square error over the Cramer-Rao bound of a motion that neither channel knows, mean error, and how
many of the 95 % intervals hold the truth. Run as ``python benchmarks/delay.py [draws] [lag|rows]``.
"""

from __future__ import annotations

import math
import sys
from functools import cache

import numpy as np

import stickslip as ss

BALANCE = {"mass": 2.42, "stiffness": 2310.0, "damping": 0.1196}
LAG, FS = 0.0389 / 30.91, 4000.0
MOUNT = (125.0, 0.1)
NOISE = {"x": math.sqrt(1e-12 + 2.5e-6**2 / 12), "a": 0.04}
RIG = ss.Rig(tuple(sensor for sensor in ss.Rig().sensors if sensor.channel in ("x", "a")))
RUNS = {  # frequency [Hz], base amplitude [m], friction [N], seconds
    "free, 8 mm": (0.0, 8e-3, 0.0, 10.0),
    "forced, 10 Hz": (10.0, 2e-3, 0.0, 10.0),
    "forced, 20 Hz": (20.0, 2e-3, 0.0, 10.0),
    "friction, 2.5 Hz": (2.5, 0.65e-3, 1.1, 10.0),
    "friction, 8.7 Hz": (8.7, 1.1e-3, 1.1, 10.0),
    "friction, 11.1 Hz": (11.1, 2e-3, 1.1, 10.0),
}


BEGIN = 0.1  # s: before, the mounts have not yet rung out


@cache
def moved(name: str) -> ss.solve.Trajectory:
    """The motion, from its periodic orbit on where it is driven."""
    frequency, amplitude, friction, seconds = RUNS[name]
    law = ss.laws.CompliantContact(friction, stiffness=192000, damping=23.9) if friction else ss.laws.Coulomb(0.0)
    if not frequency:
        slider = ss.Oscillator(law=law, **BALANCE)
        return ss.simulate(slider, duration=seconds + BEGIN, start={"x": amplitude})
    slider = ss.Oscillator(law=law, drive=ss.drives.HarmonicBase(amplitude, frequency=frequency), **BALANCE)
    if friction:
        settled = ss.simulate(slider, cycles=60)
        start = {key: value for key, value in settled.state(settled.duration).items() if key in ("x", "v")}
    else:
        start = dict(zip("xv", ss.steady_state(slider).orbit.sample(np.zeros(1), ("x", "v"))[0][:, 0], strict=True))
    return ss.simulate(slider, duration=seconds + BEGIN, start=start)


def record(name: str, rig: ss.Rig, seed: int, *, mount: bool) -> ss.Record:
    """What the rig writes; the mount stated or not."""
    found = rig.measure(moved(name), fs=FS, rng=seed, start=BEGIN)
    return found.with_details("a", mount=MOUNT) if mount else found


def information(name: str) -> np.ndarray:
    """Fisher's, of delay, gain, 2 zeta/w_m and 1/w_m^2, from the lines of the true motion.

    With X the lines of the true x'' and A = G X those of a, G = g exp(-i w d) / Q: each line leaves A - G X, of
    variance s_a^2 + |G|^2 w^4 s_x^2, whose slopes are those of G. A ring-down is windowed, and its lines scaled to the
    power that it has.
    """
    run = moved(name)
    times = BEGIN + np.arange(round(RUNS[name][3] * FS)) / FS
    truth = run.sample(times, ("a",))[0][0]
    frequency = RUNS[name][0]
    window = np.ones(len(times))
    if frequency:
        times = times[: round(math.floor(RUNS[name][3] * frequency) / frequency * FS)]
        truth, window = truth[: len(times)], window[: len(times)]
    else:
        window = np.hanning(len(times))
    lines = np.fft.rfft(window * truth) * math.sqrt(np.sum(truth**2) / np.sum((window * truth) ** 2))
    w = 2 * math.pi * np.fft.rfftfreq(len(times), 1 / FS)
    turn = 2 * math.pi * MOUNT[0]
    q = 1 + 2j * MOUNT[1] * w / turn - (w / turn) ** 2
    spread = len(times) * (NOISE["a"] ** 2 + w**4 / np.abs(q) ** 2 * NOISE["x"] ** 2)
    slopes = (lines / q / np.sqrt(spread)) * np.array([-1j * w, np.ones_like(w), -1j * w / q, w**2 / q])
    return 2 * np.real(slopes @ slopes.conj().T)


def bound(names: tuple[str, ...], *, mount: bool) -> float:
    """Of the delay [s]: with the mount known, or fitted too."""
    total = sum(information(name) for name in names)
    known = total[:2, :2] if mount else total
    scale = 1 / np.sqrt(np.diag(known))
    return float(math.sqrt(np.linalg.inv(known * np.outer(scale, scale))[0, 0]) * scale[0])


def row(names: tuple[str, ...], draws: int, *, mount: bool) -> str:
    """Many draws of the same runs."""
    errors, inside, sds, resonance = [], 0, [], []
    for seed in range(draws):
        runs = [record(name, RIG, 1000 * j + seed, mount=mount) for j, name in enumerate(names)]
        delay = ss.balance.sensor_delay(runs)
        errors.append(delay.delay.value + LAG)
        sds.append(delay.delay.sd)
        inside += delay.delay.includes(-LAG)
        if delay.mount_frequency is not None:
            resonance.append(delay.mount_frequency.value)
    least = bound(names, mount=mount)
    rms = float(np.sqrt(np.mean(np.square(errors))))
    said = f"; mount {np.mean(resonance):.2f} -+ {np.std(resonance):.2f} Hz in {len(resonance)}" if resonance else ""
    return (
        f"{' + '.join(names):62s} mount {'stated' if mount else 'fitted'}: bound {least * 1e6:6.2f} us, rms/bound "
        f"{rms / least:.3f} -+ {rms / least / math.sqrt(2 * draws):.3f}, stated sd/bound {np.mean(sds) / least:.3f}, "
        f"mean {np.mean(errors) * 1e6:+.2f} us, interval holds {inside}/{draws}{said}"
    )


def lags(draws: int) -> None:
    """The mean error at every part of a sample."""
    name = "free, 8 mm"
    least = bound((name,), mount=True)
    for part in np.arange(0, 1.01, 0.1):
        lag = (5 + part) / FS
        rig = RIG.having("x", lag=lag)
        phase = [ss.balance.sensor_delay(record(name, rig, s, mount=True)).delay.value + lag for s in range(draws)]
        few = [record(name, rig, s, mount=True) for s in range(2)]
        mounted = 2 * MOUNT[1] / (2 * math.pi * MOUNT[0])  # what the mount adds to a delay that knows none
        residual = [ss.balance.sensor_delay(each, method="residual").delay.value + lag - mounted for each in few]
        print(
            f"{name}, lag {5 + part:.1f} samples: mean {np.mean(phase) * 1e6:+6.2f} us -+ "
            f"{least / math.sqrt(draws) * 1e6:.2f}, rms/bound {np.sqrt(np.mean(np.square(phase))) / least:.2f}; "
            f"least residual, mean {np.mean(residual) * 1e6:+7.1f} us",
            flush=True,
        )


def main() -> None:
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    if "lag" not in sys.argv[2:]:
        for name in RUNS:
            print(row((name,), draws, mount=True), flush=True)
        for name in ("friction, 2.5 Hz", "friction, 8.7 Hz", "friction, 11.1 Hz"):
            print(row((name,), draws, mount=False), flush=True)
        print(row(("free, 8 mm", "forced, 10 Hz", "forced, 20 Hz"), draws, mount=False), flush=True)
        print(row(("friction, 8.7 Hz", "free, 8 mm"), draws, mount=False), flush=True)
    if "rows" not in sys.argv[2:]:
        lags(draws)


if __name__ == "__main__":
    main()
