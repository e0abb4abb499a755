"""The friction felt by a load cell against the friction computed from the motion: where do they agree?"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.balance.balance import Balance, known_constants
from stickslip.balance.force import friction_force
from stickslip.balance.mass import Lines, find_lines
from stickslip.balance.mounts import Resonance, find_mounts
from stickslip.errors import EstimateError
from stickslip.estimate import NORMAL_95, Constant, Estimate, Result, Status, plain
from stickslip.record.flaws import saturated
from stickslip.record.record import Record
from stickslip.signals.interpolate import without_delays

QUESTION = "the comparison of forces"
RATIO = 1.25  # of a band's upper edge to its lower one
CHANCE = 0.01  # probability with which bands that have nothing in common pass for coherent
USED = ("x", "z", "v", "a", "force", "load")


@dataclass(frozen=True)
class ForceBand:
    """Both forces in one band of frequencies.

    Attributes
    ----------
    low, high : float
        Its first and last line [Hz].
    centre : float
        Where its power lies [Hz], on the average.
    direct, indirect, difference : float
        Root mean squares [N] of the load cell's force, of the computed one, and of their difference.
    gain, phase : float
        Of the computed force over the felt one; phase in rad, positive where the computed one is ahead.
    gain_sd : float
        Standard deviation of the complex ratio, along either axis.
    coherence : float
        0 to 1.
    significant : float
        Coherence that unrelated forces pass once in a hundred times.
    verdict : str
        "agree", "differ", or "noise" where nothing in common stands out, or not enough to tell.
    """

    low: float
    high: float
    centre: float
    direct: float
    indirect: float
    difference: float
    gain: float
    phase: float
    gain_sd: float
    coherence: float
    significant: float
    verdict: str


@dataclass(frozen=True, eq=False, repr=False)
class ForceComparison(Result):
    """The friction felt against the friction computed.

    Attributes
    ----------
    difference : Estimate
        Root mean square of their difference [N], means taken off.
    agree_up_to : Estimate
        Frequency [Hz] up to which both agree within the tolerance.
    bands : tuple of ForceBand
        From low to high frequencies.
    resonances : tuple of Resonance
        Of the mounts that make them differ, where the record shows them.
    time, direct, indirect : ndarray (n,)
        Both forces [N] on the record's clock [s], as read.
    tolerance : float
        Share by which the ratio may be off 1.
    status : str
        "ok", or in words what to beware of.
    """

    difference: Estimate
    agree_up_to: Estimate
    bands: tuple[ForceBand, ...]
    resonances: tuple[Resonance, ...]
    time: Array
    direct: Array
    indirect: Array
    tolerance: float
    status: str

    @property
    def opposite(self) -> bool:
        """Whether the forces have opposite signs where they are largest."""
        return _opposite(self.bands)

    @property
    def unlike(self) -> bool:
        """Whether the forces are two where they are largest, and not one with the wrong sign."""
        return not self.opposite and self.bands[0].verdict != "agree"

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Every number found."""
        swinging = [number for resonance in self.resonances for number in (resonance.frequency, resonance.damping)]
        return (self.difference, self.agree_up_to, *swinging)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return dict(plain({name: getattr(self, name) for name in ("estimates", "bands", "resonances", "status")}))


def compare_force(
    record: Record,
    *,
    mass: Constant | None = None,
    stiffness: Constant | None = None,
    damping: Constant | None = None,
    damper: str | None = None,
    tolerance: float = 0.1,
) -> ForceComparison:
    r"""Do the load cell and the motion tell the same friction, and up to which frequency?

    Direct is what the load cell reads, less its flange's inertia where stated (by the forces on the mass, so that it
    owes nothing to the accelerometer); indirect is the thesis's F (section
    2.4), ``k z - k x - c v - m a + P`` of the channels as read. Both are taken apart into the harmonics of each whole
    cycle (into windows, where the motion does not repeat), and their ratio in a band is

    .. math:: H = \sum \bar D I / \sum |D|^2, \qquad \gamma^2 = |\sum \bar D I|^2 / \sum |D|^2 \sum |I|^2

    over its N lines of all cycles, with the deviation :math:`|H| \sqrt{(1/\gamma^2 - 1)/2N}` along either axis. Two
    unrelated forces have a coherence above :math:`1 - p^{1/(N-1)}` with probability p. They agree where H is within
    `tolerance` of 1. What makes them differ higher up, the swinging of the mounts, is fitted where the record shows
    it (see :class:`Resonance`).

    Parameters
    ----------
    record : Record
        With ``load`` and ``x``, and z, a, force where measured; the rig as :func:`~stickslip.friction_force` was told,
        where not given here.
    mass, stiffness, damping : float, str, tuple or Estimate, optional
        Of the rig [kg], [N/m], [N s/m].
    damper : {"ground", "base"}, optional
        Where the damper's other end is fixed.
    tolerance : float
        Share by which the ratio may be off 1.

    Returns
    -------
    ForceComparison

    Raises
    ------
    RecordError
        A channel is missing, broken or too short.
    EstimateError
        A tolerance that is none, neither mass nor stiffness, or no lines to compare.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(
    ...     mass=2.42, stiffness=2310, law=ss.laws.CompliantContact(1.1, stiffness=192000, damping=23.9),
    ...     drive=ss.drives.HarmonicBase(1.1e-3, frequency=8.7),
    ... )
    >>> rig = ss.Rig().having("x", lag=0).having("z", lag=0)
    >>> record = rig.measure(ss.simulate(slider, duration=7), fs=4000, rng=1, start=5)
    >>> compared = compare_force(record.with_details("load", inertia=0.05), mass=2.42, stiffness=2310)
    >>> 30 < compared.agree_up_to.value < 60  # the accelerometer's mount adds 10 % at 38 Hz, the load cell's 3 %
    True
    """
    if not 0 < tolerance < 1:
        raise EstimateError(f"tolerance = {tolerance}", "a share between 0 and 1", "leave it at 0.1")
    record.require_clean("load", "x", question=QUESTION)
    rig = known_constants(record, mass=mass, stiffness=stiffness, damping=damping, damper=damper)
    if not {"mass", "stiffness"} & set(rig):
        raise EstimateError(
            "neither mass nor stiffness is known",
            "a force can not be held against one that is known per mass only",
            "give mass= or stiffness=",
        )
    record = without_delays(record, *(name for name in USED if name in record), question=QUESTION)
    balanced = friction_force(record, method="F", **rig)
    balance = Balance.of(balanced.rig)
    assert balance is not None  # a mass or a stiffness is known
    share = record.channels["load"].inertia / balance.mass
    indirect = balanced["friction"]
    # m a = pull - f puts the flange's inertia in terms of the pull: the accelerometer's noise would be in both forces
    direct = (balanced["load"] - share * (indirect + balance.mass * balanced["a"])) / (1 - share)
    made = balanced.with_channel("direct", direct, unit="N").with_channel("indirect", indirect, unit="N")
    names = ["direct", "indirect", *(name for name in ("x", "z", "a", "load", "force") if name in made)]
    lines = find_lines(made, names, contact=rig.get("contact"), question=QUESTION)
    cut = _cut(record)
    bands = tuple(_bands(lines, tolerance))
    mounts = find_mounts(lines, balanced, balance) if "a" in record and bands[0].verdict != "differ" else ()
    return ForceComparison(
        difference=_flagged(_difference(lines, direct - indirect), cut),
        agree_up_to=_flagged(_agree_up_to(bands, tolerance, lines, record.fs / 2), cut),
        bands=bands,
        resonances=mounts,
        time=record.time,
        direct=direct,
        indirect=indirect,
        tolerance=tolerance,
        status=_status(bands, record, cut),
    )


def _bands(lines: Lines, tolerance: float) -> list[ForceBand]:
    """Bands of about equal width on a logarithmic axis, each with an odd and an even line at least."""
    bands, first, frequency = [], 0, lines.frequency
    while first < len(frequency):
        last = max(first + (2 if first else 1), int(np.searchsorted(frequency, RATIO * frequency[first])))
        part = slice(first, min(last, len(frequency)))
        direct, indirect = (lines.amplitudes[name][:, part] for name in ("direct", "indirect"))
        bands.append(_band(frequency[part], direct, indirect, lines.worth, tolerance))
        first = last
    return bands


def _band(frequency: Array, direct: Complex, indirect: Complex, worth: float, tolerance: float) -> ForceBand:
    shares = np.abs(direct * indirect).sum(axis=0)
    centre = float(frequency @ shares / shares.sum()) if shares.any() else float(frequency.mean())
    power, other = float(np.sum(np.abs(direct) ** 2)), float(np.sum(np.abs(indirect) ** 2))
    cross = complex(np.sum(direct.conj() * indirect))
    worth = max(2.0, direct.size * worth)
    coherence = abs(cross) ** 2 / (power * other) if power * other > 0 else 0.0
    ratio = cross / power if power > 0 else 0.0
    sd = abs(ratio) * math.sqrt(max(0.0, 1 / coherence - 1) / (2 * worth)) if coherence > 0 else math.inf
    significant = 1 - CHANCE ** (1 / (worth - 1))
    verdict = "differ" if abs(ratio - 1) > tolerance + NORMAL_95 * sd else "agree" if sd < tolerance else "noise"
    size = math.sqrt(1 / (2 * len(direct)))
    low, high, gain, phase = float(frequency[0]), float(frequency[-1]), abs(ratio), float(np.angle(ratio))
    sizes = size * math.sqrt(power), size * math.sqrt(other), size * float(np.linalg.norm(direct - indirect))
    verdict = verdict if coherence > significant else "noise"
    return ForceBand(low, high, centre, *sizes, gain, phase, sd, coherence, significant, verdict)


def _difference(lines: Lines, difference: Array) -> Estimate:
    """Root mean square of the whole difference; its deviation from the scatter between stretches."""
    apart = lines.amplitudes["direct"] - lines.amplitudes["indirect"]
    powers = np.sum(np.abs(apart) ** 2, axis=1) / 2
    rms = float(np.std(difference))
    sd = float(np.std(powers, ddof=1)) / math.sqrt(len(powers) * lines.worth) / (2 * rms) if rms > 0 else 0.0
    return Estimate.normal("difference of the forces", rms, sd=sd, unit="N", method="root mean square, means taken off")


def _agree_up_to(bands: tuple[ForceBand, ...], tolerance: float, lines: Lines, nyquist: float) -> Estimate:
    """Where the ratio leaves its tolerance for the first time; its ends, where it surely has and may have."""
    heard = [band for band in bands if band.verdict != "noise"]
    middle = np.array([band.centre for band in heard])
    off = np.array([abs(band.gain * np.exp(1j * band.phase) - 1) for band in heard])
    sd = np.array([band.gain_sd for band in heard])
    width = math.log(RATIO) / math.sqrt(12)
    ends = [_crossing(middle, off + sign * NORMAL_95 * sd, tolerance) for sign in (1, 0, -1)]
    status = "ok"
    if not len(heard):
        status = "the forces have nothing in common at any frequency"
    elif ends[1] == 0:
        status = f"they differ by more than {100 * tolerance:g} % from the lowest frequency on"
    elif not np.any(off > tolerance):
        status = f"they agree as far as they stand out of the noise, to {heard[-1].high:.4g} Hz"
    low, high = ends[0] * math.exp(-NORMAL_95 * width), ends[2] * math.exp(NORMAL_95 * width)
    name, unsure = "frequency up to which the forces agree", (high - low) / (2 * NORMAL_95)
    method = f"ratio within {100 * tolerance:g} % of 1 in bands a factor of {RATIO:g} wide"
    common = f"{len(heard)} of {len(bands)} bands have both forces in common"
    checks = (f"{lines.count} {'cycles' if lines.cycles else 'windows'}", common)
    return Estimate(name, ends[1], (low, high), unsure, "Hz", method, status, checks).within(0.0, nyquist)


def _crossing(frequency: Array, off: Array, tolerance: float) -> float:
    """Where `off` first rises above the tolerance, between bands by a straight line; 0 where it begins above."""
    above = np.flatnonzero(off > tolerance)
    if not len(above):
        return float(frequency[-1]) if len(frequency) else 0.0
    at = int(above[0])
    if at == 0:
        return 0.0
    share = (tolerance - off[at - 1]) / (off[at] - off[at - 1])
    return float(frequency[at - 1] * (frequency[at] / frequency[at - 1]) ** share)


def _cut(record: Record) -> str:
    """Which sensors stand at the end of their range, in words."""
    cut = {name: int(saturated(record[name]).sum()) for name in ("a", "load") if name in record}
    losses = [f"{name} in {count} of {len(record)} samples" for name, count in cut.items() if count]
    return f"at the end of the range is {' and '.join(losses)}: what lies beyond is missing here" if losses else ""


def _flagged(estimate: Estimate, cut: str) -> Estimate:
    return replace(estimate, status=cut) if cut else estimate


def _opposite(bands: tuple[ForceBand, ...]) -> bool:
    return bands[0].verdict == "differ" and abs(abs(bands[0].phase) - math.pi) < 0.5


def _status(bands: tuple[ForceBand, ...], record: Record, cut: str) -> str:
    doubts = [cut] if cut else []
    if _opposite(bands):
        doubts.append("the forces have opposite signs: one sensor is wired the wrong way round, or the sign convention")
    elif bands[0].verdict != "agree":
        doubts.append("the forces differ where they are largest: ask consistency(record) which channel it is")
    stated = any(record.channels[name].delay for name in ("x", "a") if name in record)
    if not stated and "delays" not in str(record.history):
        doubts.append("no delay of a sensor is stated: one would count as a difference of the forces")
    return Status(*doubts)
