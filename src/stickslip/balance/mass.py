"""Mass and stiffness, where the rig's owner does not know them: from how the mass slides, or what a load cell measures.

Channels as complex amplitudes: of each cycle where the motion repeats, of windows where it does not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.balance.motion import Cycles, away_from, contact_motion, find_cycles, is_measured
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate
from stickslip.record.channels import Channel
from stickslip.record.record import Record
from stickslip.signals.derivatives import differentiate
from stickslip.signals.interpolate import band_limited, without_delays
from stickslip.signals.response import Response, leak, resonance
from stickslip.statistics import least_squares, mean_uncertainty

QUESTION = "the stiffness over the mass"
BOTH = "mass and stiffness together"
HARMONICS = 9  # of the motion in which the load cell's force is told as spring and inertia
LEFT_OVER = 0.1  # share of that force that may stay unexplained
FAST = np.linspace(0.2, 0.7, 6)  # shares of the peak speed above which the contact slides with its whole friction

MOST = 400  # cycles looked at, spread over the record
WINDOWS = 16  # half overlapping, where the motion does not repeat
SHORTEST = 64  # samples of a window
WORTH = 0.6  # independent windows that one of many half overlapping Hann windows is worth


def stiffness_per_mass(
    record: Record, *, resisting: Array | float = 0.0, stretched: Array | float = 0.0, contact: str = "ground"
) -> Estimate:
    r"""How large is the spring's stiffness over the mass, if the friction does not change while it slides?

    By least squares, where it slides, on :math:`\ddot x + r = (k/m)(z - x + s) - (F/m)\,\mathrm{sign}\,v + g`. The
    acceleration stands alone on its side, for it is the channel that rings; and reversals, where an elastic contact
    acts as one more spring, are left out. What rings on after them shows in how the answer hangs on how much is left
    out: it is the mean over several such choices, and their scatter is in its deviation.

    Parameters
    ----------
    record : Record
        With ``x``, ``z`` where the base moves, ``a`` where measured.
    resisting : ndarray (n,) or float
        r, what else than the spring is known to hold the mass back, over the mass [m/s^2], on the record's samples.
    stretched : ndarray (n,) or float
        s, what else than the spring is known to pull the mass, over the stiffness [m].
    contact : {"ground", "base"}
        What the mass slides on.

    Returns
    -------
    Estimate
        k/m [1/s^2].

    Raises
    ------
    RecordError, EstimateError
        No motion, no cycle, or channels that are missing or broken.
    """
    motion = contact_motion(record, contact=contact, question=QUESTION)
    cycles = find_cycles(record, motion)
    stretch = record["z"] - record["x"] if "z" in record else -record["x"]
    acceleration = record["a"] if is_measured(record, "a") else differentiate(record["x"], record.fs, order=2).values
    columns = np.column_stack([stretch + stretched, np.sign(motion.velocity), np.ones(len(record))])
    fits = []
    for share in FAST:
        fast = np.abs(motion.velocity) > share * cycles.peak
        clear = fast & away_from(~fast, motion.blur)
        sliding = clear if clear.sum() > fast.sum() / 2 else fast
        fits.append(least_squares(columns[sliding], (acceleration + resisting)[sliding]))
    ratios = np.array([fit.coefficients[0] for fit in fits])
    sd = math.hypot(float(np.mean([fit.sd[0] for fit in fits])), float(ratios.std(ddof=1)))
    return Estimate.normal(
        "stiffness over mass",
        ratios.mean(),
        sd=sd,
        unit="1/s^2",
        method="least squares on the acceleration while it slides",
        status="ok" if ratios.mean() > 0 else "negative: a sensor has the wrong sign",
    )


def mass_and_stiffness(
    record: Record, *, damping: float = 0.0, damper: str = "ground", contact: str = "ground"
) -> tuple[Estimate, Estimate]:
    r"""How large are mass and spring, if what the load cell measures is what they leave over?

    By least squares over the first harmonics of each cycle on :math:`L = k (z - x) - m a - c v + P`, with what is
    stated of the sensors taken out; the mean over the cycles, which their scatter tells how sure it is. Calibrations
    are not in that.

    Parameters
    ----------
    record : Record
        With ``x``, ``z`` and ``load``; ``a`` and ``force`` where measured.
    damping : float
        c, known of the rig [N s/m].
    damper, contact : {"ground", "base"}
        Where the damper's other end is fixed, and what the mass slides on.

    Returns
    -------
    tuple of Estimate
        Mass [kg] and stiffness [N/m].

    Raises
    ------
    RecordError, EstimateError
        Channels that are missing or broken, a motion that does not repeat, or a force that mass and spring do not
        explain.
    """
    record.require_clean("x", "z", "load", question=BOTH)
    names = [name for name in ("x", "z", "a", "load", "force") if name in record and is_measured(record, name)]
    record = without_delays(record, *names, question=BOTH)
    lines = find_lines(record, names, contact=contact, question=BOTH)
    if lines.cycles is None:
        raise EstimateError("the motion does not repeat", f"{BOTH} need cycles", "give the mass, or the stiffness")
    line = lines.frequency[:HARMONICS]
    s = 2j * np.pi * line
    made = {name: lines.amplitudes[name][:, :HARMONICS] / response_of(record.channels[name]).at(line) for name in names}
    x, z = made["x"], made["z"]
    a = made.get("a", s**2 * x)
    felt = made["load"] - record.channels["load"].inertia * a
    felt = felt + damping * s * (x - z if damper == "base" else x) - made.get("force", 0.0)
    fits = [_fitted(*terms) for terms in zip(z - x, a, felt, strict=True)]
    left_over = float(np.mean([rest for _, rest in fits]))
    stiffness, mass = np.transpose([values for values, _ in fits])
    if left_over > LEFT_OVER or stiffness.mean() <= 0 or mass.mean() <= 0:
        raise EstimateError(
            f"{100 * left_over:.0f} % of what the load cell measures is left over by m = {mass.mean():.3g} kg and "
            f"k = {stiffness.mean():.4g} N/m",
            "a mass and a spring explain it where all channels tell of one motion",
            "correct signs, delays and mounts, or give mass and stiffness",
        )
    return tuple(
        Estimate.normal(
            name,
            values.mean(),
            sd=mean_uncertainty(values)[0],
            unit=unit,
            method=f"least squares on {HARMONICS} harmonics of what the load cell measures, over {len(values)} cycles",
            checks=(f"{100 * left_over:.1f} % of the force is left over",),
        )
        for name, values, unit in (("mass", mass, "kg"), ("stiffness", stiffness, "N/m"))
    )  # type: ignore[return-value]


def _fitted(stretch: Complex, acceleration: Complex, felt: Complex) -> tuple[Array, float]:
    """Stiffness and mass of one cycle, and the share of the force that they leave."""
    design = np.column_stack([stretch, -acceleration])
    fit = np.linalg.lstsq(np.vstack([design.real, design.imag]), np.concatenate([felt.real, felt.imag]))[0]
    return fit, float(np.linalg.norm(felt - design @ fit) / np.linalg.norm(felt))


@dataclass(frozen=True, eq=False)
class Lines:
    """Complex amplitudes c of channels, ``y(t) = Re sum c exp(2 pi i f (t - t_0))``, t_0 the stretch's beginning.

    Attributes
    ----------
    frequency : ndarray (k,)
        Of the lines [Hz], the constant left out.
    amplitudes : mapping of str to ndarray (m, k)
        Per channel and stretch.
    means : mapping of str to ndarray (m,)
        Mean of each stretch.
    worth : float
        Independent stretches that each is worth.
    cycles : Cycles or None
        The cycles, where the stretches are such.
    """

    frequency: Array
    amplitudes: Mapping[str, Complex]
    means: Mapping[str, Array]
    worth: float
    cycles: Cycles | None

    @property
    def count(self) -> int:
        """Number of stretches."""
        return len(next(iter(self.means.values())))


def find_lines(record: Record, channels: Sequence[str], *, contact: str | None = None, question: str) -> Lines:
    """The lines of `channels`: harmonics of each whole cycle, or Hann windows where the motion does not repeat."""
    try:
        cycles = find_cycles(record, contact_motion(record, contact=contact, question=question))
    except EstimateError:
        cycles = None
    if cycles is None or cycles.status != "ok" or len(cycles.edges) < 3:
        return _of_windows(record, channels, question)
    length = float(np.diff(cycles.edges).mean())
    points = 2 * math.floor(length / 2)
    chosen = np.unique(np.linspace(0, len(cycles.edges) - 2, min(MOST, len(cycles.edges) - 1)).astype(int))
    places = cycles.edges[chosen][:, None] + np.arange(points) * length / points
    places = np.minimum(places, len(record) - 1.0)
    folded = band_limited(np.array([record[name] for name in channels]), places.ravel())
    spectra = dict(zip(channels, np.fft.rfft(folded.reshape(-1, *places.shape)) / points, strict=True))
    orders = np.arange(1, points // 2)
    return Lines(
        np.asarray(orders * (record.fs / length), dtype=np.float64),
        {name: 2 * spectrum[:, 1 : points // 2] for name, spectrum in spectra.items()},
        {name: spectrum[:, 0].real for name, spectrum in spectra.items()},
        1.0,
        cycles,
    )


def _of_windows(record: Record, channels: Sequence[str], question: str) -> Lines:
    size = 2 * len(record) // (WINDOWS + 1) // 2 * 2
    if size < SHORTEST:
        raise EstimateError(
            f"{len(record)} samples",
            f"{question} needs {SHORTEST * (WINDOWS + 1) // 2} without cycles",
            "give a longer record",
        )
    window = np.hanning(size + 1)[:-1]
    starts = np.arange(WINDOWS) * (size // 2)
    amplitudes, means = {}, {}
    for name in channels:
        parts = np.stack([record[name][first : first + size] for first in starts])
        means[name] = parts.mean(axis=1)
        spectrum = np.fft.rfft((parts - means[name][:, None]) * window, axis=1)
        amplitudes[name] = 2 * spectrum[:, 1 : size // 2] / window.sum()
    frequency = np.arange(1, size // 2) * record.fs / size
    return Lines(frequency, amplitudes, means, WORTH, None)


def response_of(sensor: Channel) -> Response:
    """What a sensor makes of a motion, as far as it is stated: its mount, and its discharge."""
    mount = resonance(*sensor.mount) if sensor.mount is not None else Response()
    return mount.then(leak(sensor.discharge)) if sensor.discharge is not None else mount
