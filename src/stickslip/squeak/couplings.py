"""Which motions move together while it squeaks, which leads, and how much energy friction gives and takes."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Doubt, Estimate, Plain, Result, Status, plain
from stickslip.parameters import finite
from stickslip.record.record import Record
from stickslip.squeak.bursts import Squeak, Squeaks, find_squeaks
from stickslip.squeak.hearing import filtered
from stickslip.squeak.spectra import coherence_by_chance, stretches
from stickslip.statistics import student
from stickslip.units import parse_value

MOTIONS = ("a", "normal_acceleration", "torsion_velocity", "friction", "sound")
CYCLES = 8.0  # of the tone in a segment: its line is an eighth of its frequency wide
FEWEST = 4  # segments
OPPOSED = math.radians(5.0)  # nearer to half a period nobody tells which leads: a channel's sign may be chosen
NOTICED = 0.05  # of coherence: less is no change that matters
UNSURE = "the interval holds zero: whether friction feeds or damps can not be told"
ENERGIES = ("energy_per_cycle", "dissipated_per_cycle", "energy_to_torsion", "energy_to_normal")


@dataclass(frozen=True)
class Pair:
    """Two channels at the frequency of the squeak.

    Attributes
    ----------
    first, second : str
        The channels.
    inside, outside : float
        Coherence in the bursts and outside of them, 0 to 1; outside NaN where too little lies there.
    significant : float
        Coherence that channels that have nothing to do with each other exceed once in twenty times.
    added : Estimate or None
        `inside` less `outside`: what the squeak adds; None where too little lies outside.
    phase : Estimate
        By which the second lags the first [rad], -pi to pi.
    delay : Estimate or None
        The same as a time [s], within half a period; positive where the first leads. None where it can not be told from
        half a period, which is a sign.
    tied : bool
        Whether one follows from the other without any coupling: the friction and the acceleration of one mass, in
        opposite phase (m a = ... - f) or computed from each other.
    """

    first: str
    second: str
    inside: float
    outside: float
    significant: float
    added: Estimate | None
    phase: Estimate
    delay: Estimate | None
    tied: bool

    @property
    def coupled(self) -> bool:
        """Whether they move together in the bursts beyond chance."""
        return self.inside > self.significant

    @property
    def adds(self) -> bool:
        """Whether they move together in the bursts noticeably more than outside, and beyond chance."""
        if self.added is None or self.tied or not self.coupled:
            return False
        return self.added.value > NOTICED and self.added.interval[0] > 0

    @property
    def leads(self) -> str:
        """The channel that leads, within half a period; "neither" where the delay's interval holds zero, or none is."""
        if self.delay is None or self.delay.includes(0.0) or not self.coupled:
            return "neither"
        return self.first if self.delay.value > 0 else self.second

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return dict(plain({**vars(self), "coupled": self.coupled, "adds": self.adds, "leads": self.leads}))


@dataclass(frozen=True)
class Coupling(Result, Plain):
    """How the motions of a squeak hang together.

    Attributes
    ----------
    frequency : float
        Of the squeak [Hz].
    pairs : tuple of Pair
        Each two channels.
    energy_per_cycle : Estimate or None
        Work of the friction force on the tangential vibration in a cycle of the squeak [J]: positive where friction
        feeds it, negative where it takes energy from it; None without velocity and friction.
    dissipated_per_cycle : Estimate or None
        What the friction force takes from the whole motion meanwhile, in a cycle of the squeak [J].
    energy_to_torsion : Estimate or None
        Work of the friction force on the torsion in a cycle of the squeak [J], by the lever stated; None without one.
    energy_to_normal : Estimate or None
        Work of the normal force on the normal motion in a cycle of the squeak [J]; None where either is not recorded.
    segments : int
        Stretches in the bursts that were averaged.
    compared : str
        What `inside` and `outside` are.
    """

    frequency: float
    pairs: tuple[Pair, ...]
    energy_per_cycle: Estimate | None
    dissipated_per_cycle: Estimate | None
    energy_to_torsion: Estimate | None
    energy_to_normal: Estimate | None
    segments: int
    compared: str

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The energies that are known."""
        return tuple(energy for energy in (getattr(self, name) for name in ENERGIES) if energy is not None)

    def of(self, first: str, second: str) -> Pair:
        """The pair of two channels, in this order."""
        match = next((pair for pair in self.pairs if (pair.first, pair.second) == (first, second)), None)
        if match is None:
            known = ", ".join(f"{pair.first} and {pair.second}" for pair in self.pairs)
            raise EstimateError(f"no pair of {first} and {second}", f"there are {known}", "choose one of them")
        return match

    def __repr__(self) -> str:
        rows = [
            f"{p.first} and {p.second}: coherence {p.inside:.2f} ({p.outside:.2f} outside), leads: {p.leads}"
            for p in self.pairs
        ]
        return "\n  ".join([f"Coupling at {self.frequency:.4g} Hz", *rows])


def coupling(record: Record, *, squeaks: Squeaks | None = None, lever: float | str | None = None) -> Coupling:
    r"""Which motions move together while it squeaks, and does friction feed them?

    The tone of each channel is taken from segments of eight cycles, Hann's window, without overlap: one complex number
    a segment. Coherence is :math:`|\sum X Y^*|^2/(\sum|X|^2\,\sum|Y|^2)`; of n segments of independent noise it exceeds
    :math:`1 - 0.05^{1/(n-1)}` once in twenty times (Carter, Knapp and Nuttall, "Estimation of the magnitude-squared
    coherence function", 1973). The phase is that of the sum, with the variance
    :math:`(1-\gamma^2)/(2 n \gamma^2)` (Bendat and Piersol, "Random Data", 9.2.4). A tone has no beginning, so a delay
    is told within half a period alone: which leads is a convention there, not a cause. Within five degrees of half a
    period, or where the interval reaches it, no delay is told: it would be that of a sign.

    What the squeak adds is the coherence inside less that outside. Of each, :math:`\mathrm{artanh}\,\gamma` is spread
    with the variance :math:`1/(2(n-1))` (Enochson and Goodman, AFFDL-TR-65-57, 1965); the interval of the difference
    joins both by their distances from the values (Zou and Donner, Statistics in Medicine 27, 2008).

    Friction opposes positive velocity (m a = ... - f), so its work on the vibration is minus the mean of f v in the
    band of the squeak. By a lever l it works on the torsion too, with minus the mean of l f times its velocity.
    Friction does no work in the normal direction: there it is the normal force, positive where it presses and the
    motion positive where it raises it, with minus the mean of N times the velocity, integrated from the acceleration.

    Parameters
    ----------
    record : Record
        With two at least of a, normal_acceleration, torsion_velocity, friction, sound.
    squeaks : Squeaks, optional
        What :func:`find_squeaks` found in it; found where left out.
    lever : float or str, optional
        Distance of the friction force from the axis of the torsion [m], positive where positive friction turns it
        back. Of several contacts at distances of their own the total force has none, and this work can not be told.

    Returns
    -------
    Coupling

    Raises
    ------
    RecordError
        A channel is broken.
    EstimateError
        No squeak, one channel alone, or bursts too short.

    Examples
    --------
    >>> from stickslip.solve.simulate import simulate
    >>> from stickslip.squeak.sound import squeak_record
    >>> from stickslip.squeak.stability import squeak_rig
    >>> record = squeak_record(simulate(squeak_rig(), duration=1.2), snr=30, rng=1)
    >>> coupled = coupling(record)
    >>> coupled.of("normal_acceleration", "torsion_velocity").coupled
    True
    """
    squeaks = find_squeaks(record) if squeaks is None else squeaks
    # what is tonal may squeak, too, where nothing but the sound would tell: it couples all the same
    bursts = squeaks.of("squeak", "squeal") or squeaks.of("tonal")
    if not bursts:
        raise EstimateError("no squeak was found", "coupling is told inside of squeaks", "see find_squeaks(record)")
    names = [name for name in MOTIONS if name in record and np.ptp(record[name]) > 0]
    record.require_clean(*names, question="coupling")
    if len(names) < 2:
        raise EstimateError(
            f"only {', '.join(names) or 'none'} of {', '.join(MOTIONS)}",
            "coupling is told between two channels at least",
            "name more channels when reading",
        )
    frequency = float(np.average([b.frequency for b in bursts], weights=[b.duration for b in bursts]))
    size = math.ceil(CYCLES * record.fs / frequency)
    where = stretches(record, squeaks=squeaks, size=size)
    within, beyond = where.inside, where.outside
    if len(within) < FEWEST:
        raise EstimateError(
            f"{len(within)} segments of {CYCLES:g} cycles in the squeaks",
            f"coherence is averaged over {FEWEST} at least",
            "give a record with more or longer squeaks",
        )
    inside = {name: _tones(record[name], within, size, frequency / record.fs) for name in names}
    outside = {name: _tones(record[name], beyond, size, frequency / record.fs) for name in names}
    computed = "friction" in record and record.channels["friction"].source == "friction_force"
    pairs = [
        _pair(one, other, inside, outside if len(beyond) >= FEWEST else None, frequency, computed)
        for one, other in itertools.combinations(names, 2)
    ]
    arm = None if lever is None else finite("lever", parse_value(lever, "m"), unit="m")
    energies = _Work(record, bursts, frequency).energies(arm)
    return Coupling(frequency, tuple(pairs), **energies, segments=len(within), compared=where.words)


def _tones(values: Array, rows: list[int], size: int, frequency: float) -> Complex:
    """The tone of a frequency [1/sample] in each segment."""
    time = np.arange(size)
    wave = np.hanning(size) * np.exp(-2j * np.pi * frequency * time)
    parts = np.array([values[row : row + size] for row in rows]).reshape(len(rows), size)
    return np.asarray((parts - parts.mean(axis=1, keepdims=True)) @ wave)


def _pair(
    one: str,
    other: str,
    inside: dict[str, Complex],
    outside: dict[str, Complex] | None,
    frequency: float,
    computed: bool,
) -> Pair:
    count = len(inside[one])
    coherence, angle = _coherence(inside[one], inside[other])
    sd, chance = math.sqrt(max(1 - coherence, 1e-12) / (2 * count * max(coherence, 1e-12))), coherence_by_chance(count)
    phase = Estimate.normal(
        f"phase of {other} behind {one}",
        angle,
        sd=sd,
        unit="rad",
        method=f"cross spectrum of {count} segments",
        quantile=student(count - 1),
        status="ok" if coherence > chance else "no coherence beyond chance: the phase means nothing",
    )
    delay = phase.scaled(1 / (2 * math.pi * frequency), "s", f"delay of {other} behind {one}")
    opposed = max(map(abs, phase.interval)) >= math.pi or abs(angle) > math.pi - OPPOSED
    beyond, added = math.nan, None
    if outside is not None:
        beyond = _coherence(outside[one], outside[other])[0]
        added = _added(one, other, (coherence, count), (beyond, len(outside[one])))
    tied = {one, other} == {"a", "friction"} and (computed or (opposed and coherence > chance))
    lag = None if opposed and coherence > chance else delay
    return Pair(one, other, coherence, beyond, chance, added, phase, lag, tied)


def _added(one: str, other: str, inside: tuple[float, int], outside: tuple[float, int]) -> Estimate:
    """The difference of two coherences, each with its count of segments."""
    (low, high), (least, most) = (_coherence_interval(*side) for side in (inside, outside))
    value = inside[0] - outside[0]
    ends = (
        value - math.hypot(inside[0] - low, most - outside[0]),
        value + math.hypot(high - inside[0], outside[0] - least),
    )
    return Estimate(
        f"coherence that the squeak adds to {one} and {other}",
        value,
        ends,
        (ends[1] - ends[0]) / (2 * NORMAL_95),
        "1",
        f"{inside[1]} segments in the squeaks less {outside[1]} outside",
    )


def _coherence_interval(coherence: float, count: int) -> tuple[float, float]:
    middle = math.atanh(math.sqrt(min(coherence, 1 - 1e-12))) - 1 / (2 * (count - 1))
    reach = NORMAL_95 / math.sqrt(2 * (count - 1))
    low, high = (math.tanh(max(0.0, middle + side * reach)) ** 2 for side in (-1, 1))
    return min(low, coherence), max(high, coherence)


def _coherence(one: Complex, other: Complex) -> tuple[float, float]:
    cross = np.sum(one * np.conj(other))
    power = float(np.sum(np.abs(one) ** 2) * np.sum(np.abs(other) ** 2))
    return (float(np.abs(cross) ** 2 / power) if power else 0.0), float(np.angle(cross))


@dataclass(frozen=True, eq=False)
class _Work:
    """Work in a cycle of the squeak, burst by burst."""

    record: Record
    bursts: tuple[Squeak, ...]
    frequency: float

    def energies(self, lever: float | None) -> dict[str, Estimate | None]:
        record = self.record
        energies: dict[str, Estimate | None] = dict.fromkeys(ENERGIES)
        if "friction" in record and "v" in record:
            friction, velocity = self.tone("friction"), self.tone("v")
            name = "energy that friction gives the vibration in a cycle"
            energies["energy_per_cycle"] = self.mean(-friction * velocity, name)
            taken = record["friction"] * record["v"]
            energies["dissipated_per_cycle"] = self.mean(taken, "energy that friction takes from the motion in a cycle")
        if "friction" in record and "torsion_velocity" in record and lever is not None:
            work = -lever * self.tone("friction") * self.tone("torsion_velocity")
            energies["energy_to_torsion"] = self.mean(work, "energy that friction gives the torsion in a cycle")
        if "normal" in record and "normal_acceleration" in record:
            work = -self.tone("normal") * self.integrated("normal_acceleration")
            name = "energy that the normal force gives the normal motion in a cycle"
            energies["energy_to_normal"] = self.mean(work, name)
        return energies

    @property
    def band(self) -> tuple[float, float]:
        return 0.7 * self.frequency, min(1.4 * self.frequency, 0.49 * self.record.fs)

    def tone(self, name: str) -> Array:
        return filtered(self.record[name], self.record.fs, self.band)

    def integrated(self, name: str) -> Array:
        """Velocity of an acceleration in the band of the squeak."""
        values = self.tone(name)
        spectrum, turns = np.fft.rfft(values), 2 * np.pi * np.fft.rfftfreq(len(values), 1 / self.record.fs)
        inside = turns > np.pi * self.band[0]
        spectrum[inside] /= 1j * turns[inside]
        return np.asarray(np.fft.irfft(np.where(inside, spectrum, 0), len(values)))

    def mean(self, power: Array, name: str) -> Estimate:
        """The mean of a power [W] over each burst, as the work in a cycle."""
        ends = [np.searchsorted(self.record.time, [burst.start, burst.end]) for burst in self.bursts]
        return _mean(name, [float(np.mean(power[first:last]) / self.frequency) for first, last in ends])


def _mean(name: str, values: list[float]) -> Estimate:
    count = len(values)
    status = Status(*([Doubt.few(count, "burst")] if count <= 2 else []))
    sd = float(np.std(values, ddof=1) / math.sqrt(count)) if count > 1 else math.inf
    mean = Estimate.normal(
        name,
        float(np.mean(values)),
        sd=sd,
        unit="J",
        method=f"mean of {count} bursts",
        quantile=student(max(1, count - 1)),
        status=status,
    )
    unsure = count > 2 and mean.includes(0.0)
    return replace(mean, status=UNSURE) if unsure else mean
