"""What does a contact do before it slips, and how large is its friction just then, against that while it slides?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.balance.balance import ALONE, Balance, gains_unsure
from stickslip.balance.force import FUSIONS, sensors_behind
from stickslip.balance.motion import FORCES, is_measured, motion_channels
from stickslip.cycle.slips import FAST, Stroke, Strokes, find_strokes, ringing_of, sliding_swing
from stickslip.cycle.static_peak import LEAST, Peak, begun, unseen
from stickslip.cycle.sticks import find_sticks
from stickslip.errors import EstimateError
from stickslip.estimate import UNSTATED, Doubt, Estimate, Result, Status
from stickslip.record.record import Record
from stickslip.signals.noise import noise_level
from stickslip.statistics import mean_of_cycles
from stickslip.units import prefixed

GIVING = "presliding"
SIDES = ((1, "forward"), (-1, "back"))
LOW, HIGH = 0.2, 0.8  # of the sliding friction, between which a line is drawn on either side of zero
LINE = 4  # samples for a line
FELT = 5e-4  # of a stroke: a contact that gives way by less is not told from a rigid one
ELASTIC = 1 / 3  # of a stroke, that friction may take to turn: one that follows the speed seems to give way over 0.44
RIGID = 0.02  # of a stroke: where friction may take more to build up, a contact is not shown to be rigid
BLURRED = 0.5  # of the samples over which a balance of forces blurs a jump: a quicker build-up is the blur's
QUESTION = "the friction at breakaway"
PULL, PEAK = "pull at the start of the slip", "peak before the slip"
STRAYS = 1.5  # deviations of its noise by which the displacement of a mass at rest strays at most; a rig's at rest: 1.0
FINEST = 1e-6  # of the motion: a displacement without noise
FEW = 4  # samples from a reversal to the slip
BLUNT = {"load": 1, "a": 4, "x": 12}  # samples in which a corner of the friction is known by the best of its sensors
ROUNDED = {"load": 0.15, "a": 0.3, "x": 0.6}  # share of a sudden fall of the friction that smoothing takes off its peak
PULLED = 0.025  # share by which smoothing and lags move the level that a pull is held against, on simulated rigs
# Of 50 simulated rigs whose static friction lies above Coulomb's level, or at the end of Stribeck's curve, 44 intervals
# between models that leave up to 2.5 times the least held the true pull; of 20 said to fall at once, as by chance
# no more than one in 100 would, 18 did.
ALIKE, CLEAR = math.log(2.5), 2.6
NOTHING = 0.9  # of its level, by which a friction that tells nothing of its peak strays after a slip
NOT_FELT = "the contact never sticks, and static friction is what it bears at rest"
NOT_ABOVE = "not above sliding"  # the kind of doubt
BELOW = "it lies below the sliding friction: the contact is not seen to bear more at rest than as it slides"
EARLY = "the mass moves before the friction has come near its level: the first peak holds the ring that follows"
NEAR = 12  # samples before a slip in which the friction's rise is looked for
CREEPS = 0.1  # of a stroke's largest speed, below which it does not slide for good
RINGS = 1.5  # times what a mount's ring is after half a cycle it is at its start, at most


@dataclass(frozen=True, eq=False, repr=False)
class Presliding(Result):
    """How a contact gives way before it slips.

    Attributes
    ----------
    stiffness : Estimate or None
        Friction over displacement while it builds up, of both directions; where the contact gives way.
    stiffness_forward, stiffness_back : Estimate or None
        In either direction.
    backlash : Estimate or None
        Play: how far it moves between the line on which friction falls and that on which it builds up.
    compliance_forward, compliance_back : Estimate
        Displacement over friction [m/N]; without a value where the verdict is "can not be told".
    verdict : str
        "gives way", "rigid" or "can not be told".
    evidence : str
        Why, in a sentence with the numbers.
    status : str
        "ok", or in words what to beware of.
    """

    stiffness: Estimate | None
    stiffness_forward: Estimate | None
    stiffness_back: Estimate | None
    backlash: Estimate | None
    compliance_forward: Estimate
    compliance_back: Estimate
    verdict: str
    evidence: str
    status: str

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Stiffness and play of a contact that gives way; else the compliances that leave it open."""
        gives = (self.stiffness, self.stiffness_forward, self.stiffness_back, self.backlash)
        open_ = (self.compliance_forward, self.compliance_back)
        return tuple(estimate for estimate in gives if estimate is not None) or open_


def presliding(record: Record, *, contact: str | None = None) -> Presliding:
    r"""Does the contact give way before it slips, how stiffly, and with how much play?

    In each stroke, from a reversal to the next slip, two lines :math:`x = x_0 + C f` are drawn by least squares: one
    while the friction of the stroke before falls, one while that of the new stroke builds up, each between 20 and 80 %
    of the sliding friction, or of what is left of it as the motion turns round: the rest follows the speed, as that of
    a damper does. C of the second is the compliance (the displacement is regressed on the friction, which is the
    surer), :math:`1/C` the stiffness, and the distance of both lines at no friction the play. A contact that gives way
    does so alike in both directions; where C is not told from zero, or is smaller than 0.05 % of the stroke, it is
    rigid as far as the record can tell; where the mass moves against its load while it sticks, something else moves
    (the frame, the sensor), and its compliance can not be told. Nor can it where friction would take more than a third
    of a stroke to turn round, as one that follows the speed seems to, or builds up within the samples over which a
    balance of forces blurs a jump.

    Parameters
    ----------
    record : Record
        With ``friction`` and ``x`` (or ``theta``, or ``v``), as for :func:`friction_loops`.
    contact : {"ground", "base"}, optional
        What the mass slides on; as :func:`friction_force` was told, or the ground, when not given.

    Returns
    -------
    Presliding

    Raises
    ------
    RecordError
        A channel is missing, broken or too short, or the units of friction and motion do not belong together.
    EstimateError
        No motion, no stroke in which the contact turns round and slides, or too few samples before it slips.

    Examples
    --------
    >>> t = np.arange(8000) / 1000
    >>> x = 2e-3 * np.sin(2 * np.pi * t)
    >>> friction, spring = np.zeros(t.size), 0.0
    >>> for row in range(1, t.size):  # a spring of 5000 N/m that slips at 2 N
    ...     spring = float(np.clip(spring + 5000 * (x[row] - x[row - 1]), -2, 2))
    ...     friction[row] = spring
    >>> found = presliding(Record.of({"x": x, "friction": friction}, fs=1000))
    >>> found.verdict, round(found.stiffness.value)
    ('gives way', 5000)
    """
    strokes = find_strokes(record, contact=contact, question=GIVING)
    noise = noise_level(strokes.motion.displacement, record.fs)
    span = float(np.median([np.ptp(stroke.displacement) for stroke in strokes.strokes]))
    length = strokes.motion.unit
    turning = _at_reversal(strokes)
    if turning > LOW:
        strokes = replace(strokes, strokes=tuple(replace(s, level=turning * s.level) for s in strokes.strokes))
    slopes = [_compliance(strokes.to(way), f"compliance {side}", f"{length}/{strokes.unit}") for way, side in SIDES]
    level = float(np.median([stroke.level for stroke in strokes.strokes]))
    least = max(FELT * span, noise) / level  # compliance that would just be felt
    most = ELASTIC * span / 2 / level  # friction turns from one side to the other
    verdict, evidence = _verdict(slopes, level, (least, RIGID * span / level, most), length)
    if verdict == "gives way" and turning <= LOW:
        verdict, evidence = "can not be told", f"{evidence}, but where it turns round friction is gone with the speed"
    if verdict == "gives way" and not is_measured(record, "friction") and _blurred(strokes):
        verdict, evidence = "can not be told", f"{evidence}, as fast as the balance of forces lets a jump be seen"
    gives = verdict == "gives way"
    pairs = zip(slopes, SIDES, strict=True)
    sides = [_inverse(slope, f"presliding stiffness {side}") if gives else None for slope, (_, side) in pairs]
    untold = verdict == "can not be told"
    slopes = [slope.unknown(evidence) if untold else slope.within(0.0, otherwise=evidence) for slope in slopes]
    status = evidence if untold else "ok"
    unsure = math.hypot(*gains_unsure(record, motion_channels(record, contact)[0]))
    stiffness = _inverse(_both(slopes), "presliding stiffness").widened(unsure) if gives else None
    (forward, back), backlash = (side and side.widened(unsure) for side in sides), _backlash(strokes) if gives else None
    return Presliding(stiffness, forward, back, backlash, slopes[0], slopes[1], verdict, evidence, status)


def _at_reversal(strokes: Strokes) -> float:
    """The friction as the motion turns round, over that while it slides: what follows the speed is not in it."""
    return min(1.0, float(np.median([-stroke.friction[0] / stroke.level for stroke in strokes.strokes])))


def _branch(stroke: Stroke, low: float, high: float) -> tuple[float, float] | None:
    """Displacement at no friction and compliance, from where the friction is between two shares of its level."""
    friction = stroke.friction[: stroke.slip + 1]
    inside = (friction > low * stroke.level) & (friction < high * stroke.level)
    if inside.sum() < LINE or np.ptp(friction[inside]) == 0:
        return None
    slope, offset = np.polyfit(friction[inside], stroke.displacement[: stroke.slip + 1][inside], 1)
    return float(offset), float(slope)


def _blurred(strokes: Strokes) -> bool:
    """Whether the friction builds up faster than a balance of forces can follow, in most strokes."""
    before = [(stroke.friction[: stroke.slip + 1], stroke.level) for stroke in strokes.strokes]
    rows = [np.count_nonzero((force > LOW * level) & (force < HIGH * level)) for force, level in before]
    return float(np.median(rows)) < BLURRED * strokes.motion.blur


def _compliance(strokes: Sequence[Stroke], name: str, unit: str) -> Estimate:
    lines = [line for stroke in strokes if (line := _branch(stroke, LOW, HIGH))]
    if not lines:
        raise EstimateError(
            f"fewer than {LINE} samples of each stroke lie between {LOW:g} and {HIGH:g} of the sliding friction",
            "a line through the build-up of friction needs more",
            "sample faster",
        )
    method = f"displacement on friction, {LOW:g} to {HIGH:g} of its level, mean of strokes"
    return mean_of_cycles(name, [slope for _, slope in lines], unit=unit, method=method)


def _backlash(strokes: Strokes) -> Estimate | None:
    gaps = []
    for stroke in strokes.strokes:
        falls, builds = _branch(stroke, -HIGH, -LOW), _branch(stroke, LOW, HIGH)
        if falls and builds:
            gaps.append(builds[0] - falls[0])
    if not gaps:
        return None
    how = "distance of both lines at no friction, mean of strokes"
    return mean_of_cycles("backlash", gaps, unit=strokes.motion.unit, method=how)


def _verdict(
    slopes: Sequence[Estimate], level: float, limits: tuple[float, float, float], length: str
) -> tuple[str, str]:
    """Whether the contact gives way, and why; by the compliance that is felt, still rigid, and possible."""
    least, rigid, most = limits
    ways = [slope.value * level for slope in slopes]
    factor, unit = prefixed(np.array([*ways, least * level]), length)
    ranges = " and ".join(f"{factor * way:.2g} {unit} {side}" for way, (_, side) in zip(ways, SIDES, strict=True))
    moves = f"while friction builds up to {level:.3g} {FORCES[length]} it moves {ranges}"
    against = [slope for slope in slopes if slope.interval[1] < 0 and abs(slope.value) > least]
    if against:
        return "can not be told", f"{moves}, against its load: something else moves than the contact"
    if any(slope.value > most for slope in slopes):
        return "can not be told", f"{moves}, too much of its stroke for a contact that slides"
    if all(abs(slope.value) < least or slope.includes(0.0) for slope in slopes):
        if any(slope.interval[1] > max(rigid, least) for slope in slopes):
            return "can not be told", f"{moves}, or much more: it scatters too much"
        return "rigid", f"{moves}; {factor * least * level:.2g} {unit} would be seen"
    if any(slope.value < least or slope.interval[0] <= 0 for slope in slopes):
        return "can not be told", f"{moves}: not in both directions"
    return "gives way", moves


def _both(slopes: Sequence[Estimate]) -> Estimate:
    """The mean of both directions, as unsure as each of them and as they are apart."""
    value = float(np.mean([slope.value for slope in slopes]))
    low, high = min(slope.interval[0] for slope in slopes), max(slope.interval[1] for slope in slopes)
    sd = float(np.hypot(slopes[0].sd + slopes[1].sd, slopes[0].value - slopes[1].value) / 2)
    return replace(slopes[0], value=value, interval=(low, high), sd=sd)


def _inverse(compliance: Estimate, name: str) -> Estimate:
    """Stiffness of a compliance; it has no upper end where the compliance may be zero."""
    low, high = compliance.interval
    over, under = compliance.unit.split("/")
    interval, sd = (1 / high, 1 / low if low > 0 else np.inf), compliance.sd / compliance.value**2
    return replace(compliance, name=name, value=1 / compliance.value, interval=interval, sd=sd, unit=f"{under}/{over}")


@dataclass(frozen=True, eq=False, repr=False)
class Breakaway(Result):
    """The friction at which a contact breaks away.

    Attributes
    ----------
    forward, back : Estimate or None
        Static friction: what the contact bears just before it slips, in either direction.
    ratio : Estimate
        That over the sliding friction of the same stroke, of both directions.
    ringing_forward, ringing_back : Estimate or None
        Frequency [Hz] at which the friction rings after slip has begun, where it was measured and does; more of it
        tells :func:`slip_ringing`.
    ringing_difference : Estimate or None
        Forward less back [Hz].
    swing_forward, swing_back : Estimate or None
        How much the friction swings about its level while it slides, over that level, its noise taken off; a friction
        that is steady enough to be called one does so by less than 30 %.
    count : int
        Strokes looked at.
    status : str
        "ok", or in words what to beware of.
    """

    forward: Estimate | None
    back: Estimate | None
    ratio: Estimate
    ringing_forward: Estimate | None
    ringing_back: Estimate | None
    ringing_difference: Estimate | None
    swing_forward: Estimate | None
    swing_back: Estimate | None
    count: int
    status: str


def breakaway(record: Record, *, contact: str | None = None) -> Breakaway:
    r"""How large is the friction just before the contact slips, against the friction while it slides?

    A mass at rest has no inertia force: the contact bears exactly what pulls, :math:`p = k (z - x) + c\,\dot z + P`
    (the second term for a damper on the base), which is known without any differentiation. When the slip begins is
    found, to a sample, from its first travel (:func:`~stickslip.cycle.static_peak.begun`), with a friction that falls
    at once or with the speed, whichever leaves less; the interval holds what each model as good would tell. Static
    friction is the pull at that instant, from a line through the stick's last fifth. By a balance of forces it is
    unknown where the mass never rests: what pulls then also moves the mass. Of a friction that was measured, or
    found by all sensors together, it is the largest
    value before the contact moves, which noise makes too large by two of its deviations at most: the interval's low end
    goes as far down. It goes down by as much as a load cell that rises so and is let go would swing on, or to the level
    where the peak is as brief as the jump before it, for a sensor's own filter overshoots so, at most by 9 % of the
    level where it lasts longer; its high end goes up by what the friction rises or falls in a sample, or by the whole
    of a brief peak, which a filter cuts. Where the mass moves before friction is near its level it is the first peak
    thereafter.

    A mass that is not at rest while it sticks, ringing on a contact that gives way, bears its own inertia beside the
    pull: then it is the friction's peak, and the interval reaches from the pull on. The interval of a peak that was
    not measured has what sensors and smoothing do to it: as much as the friction rises in a sample before it (in four
    without a load cell, in twelve from the displacement alone) or 15 % (30 %, 60 %) of what it then falls, for a
    corner is not sharper known; as much as the friction strays from its level while it slides; and where a sensor's
    mount is not stated one and a half times as much as it strays and rings after the slip.

    Parameters
    ----------
    record : Record
        With ``friction`` and ``x`` (or ``theta``, or ``v``), as for :func:`friction_loops`.
    contact : {"ground", "base"}, optional
        What the mass slides on; as :func:`friction_force` was told, or the ground, when not given.

    Returns
    -------
    Breakaway

    Raises
    ------
    RecordError
        A channel is missing, broken or too short, or the units of friction and motion do not belong together.
    EstimateError
        No motion, no stroke in which the contact turns round and slides, a hold of less than four samples, or a
        friction that strays from its level by nearly as much as that after each slip, as a mount that rings makes it.

    Examples
    --------
    >>> import stickslip as ss
    >>> drive = ss.drives.HarmonicBase(3e-3, frequency=1.0)
    >>> slider = ss.Oscillator(3.0, 1200, law=ss.laws.Coulomb(1.0, static=1.3), drive=drive)
    >>> record = ss.simulate(slider, cycles=12).record(fs=500)
    >>> found = breakaway(ss.friction_force(record.rows(1000, 6000), mass=3.0, stiffness=1200))
    >>> bool(abs(found.ratio.value - 1.3) < 0.03)
    True
    """
    strokes = find_strokes(record, contact=contact, question=QUESTION)
    borne = _borne(record, strokes)
    levels = [_level(borne, strokes, way, side) for way, side in SIDES]
    sliding = float(np.median([stroke.level for stroke in borne.strokes]))
    ratio = mean_of_cycles(
        "static over sliding friction",
        [friction / pair.level for pair, friction in zip(borne.strokes, borne.friction, strict=True)],
        unit="1",
        method=f"{borne.method} over the median of the stroke, mean of strokes",
    )
    ratio = _told_apart(_widened(ratio, borne.below / sliding, borne.above / sliding), 1.0)
    status = borne.status
    rings = ringing_of(strokes.strokes, record.fs) if is_measured(record, "friction") else None  # a balance rings too
    heard = (None, None, None) if rings is None else (rings.forward, rings.back, rings.difference)
    own = {way: [stroke for stroke in borne.strokes if stroke.way == way] for way, _ in SIDES}
    swings = [sliding_swing(record, own[way], side) for way, side in SIDES]
    gain, _ = gains_unsure(record, motion_channels(record, contact)[0])
    forward, back = (_flagged(level and level.widened(gain), status) for level in levels)
    ratio = _flagged(ratio, status) or ratio
    if not _rests(record, contact):
        forward, back = (level and level.unknown(NOT_FELT) for level in (forward, back))
        ratio, status = ratio.unknown(NOT_FELT), NOT_FELT
    return Breakaway(forward, back, ratio, *heard, swings[0], swings[1], len(borne.strokes), status)


def _rests(record: Record, contact: str | None) -> bool:
    """Whether the mass rests at all, where a balance of forces tells it only then: what pulls also moves the mass."""
    fused = record.rig is not None and record.rig.method in FUSIONS
    if fused or is_measured(record, "friction"):
        return True
    return bool(find_sticks(record, contact=contact, method="speed").share.value)


def _level(borne: _Borne, strokes: Strokes, way: int, side: str) -> Estimate | None:
    pairs = zip(borne.strokes, borne.friction, strict=True)
    values = [friction + way * strokes.offset for pair, friction in pairs if pair.way == way]
    if not values:
        return None
    how = f"{borne.method}, mean of strokes"
    level = mean_of_cycles(f"static friction {side}", values, unit=strokes.unit, method=how)
    return _told_apart(_widened(level, borne.below, borne.above), borne.sliding(way) + way * strokes.offset)


def _told_apart(static: Estimate, sliding: float) -> Estimate:
    """With a lesser doubt where it lies below the sliding friction, which no contact at rest need do."""
    if static.value >= sliding:
        return static
    doubt = Doubt(BELOW, NOT_ABOVE, lesser=True)
    return replace(static, status=Status(static.status, doubt))


def _flagged(estimate: Estimate | None, status: str) -> Estimate | None:
    """With what is to beware of in all of them."""
    return estimate if estimate is None or status == "ok" else replace(estimate, status=Status(status, estimate.status))


@dataclass(frozen=True, eq=False)
class _Borne:
    """What the contact bears just before it slips [N], stroke by stroke, and how far off all of it may be."""

    strokes: Sequence[Stroke]
    friction: Sequence[float]
    method: str
    below: float = 0.0
    above: float = 0.0
    status: str = "ok"

    def sliding(self, way: int) -> float:
        """The friction while it slides that way."""
        return float(np.median([stroke.level for stroke in self.strokes if stroke.way == way]))


def _borne(record: Record, strokes: Strokes) -> _Borne:
    """By the pull where the mass rests; else by the friction's peak, and, where the pull is known, from there on."""
    pulled, rested = _by_pull(record, strokes), [stroke for stroke in strokes.strokes if stroke.rests]
    mostly = 2 * len(rested) > len(strokes.strokes)
    strays = _strays(rested, strokes, record.fs)
    if pulled is not None and mostly and strays < STRAYS:
        return pulled
    peak = _by_peak(record, strokes)
    if not mostly:
        return replace(peak, status=Status(EARLY, peak.status))
    if pulled is None:
        return peak
    sentence = (
        f"the mass is not at rest while it sticks (it strays by {strays:.2g} times its displacement's noise), so that "
        "the pull is not what the contact bears: told from the pull to the balance of forces"
    )
    apart = float(np.median(peak.friction)) - float(np.median(pulled.friction))
    below, above = max(peak.below, apart + pulled.below), max(peak.above, pulled.above - apart)
    return replace(peak, below=below, above=above, status=Status(sentence, peak.status))


def _strays(rested: Sequence[Stroke], strokes: Strokes, fs: float) -> float:
    """How far the mass moves with its load in the middle of its sticks, in deviations of its displacement's noise."""
    rests = [stroke.displacement[: stroke.slip] for stroke in rested if stroke.slip >= 2 * LEAST]
    if not rests:
        return 0.0
    quarters = [np.array_split(stretch, 4) for stretch in rests]
    if np.median([last.mean() - first.mean() for first, *_, last in quarters]) < 0:
        return 0.0  # against its load something else moves, slowly
    strays = [float(np.std(stretch[len(stretch) // 4 : 3 * len(stretch) // 4])) for stretch in rests]
    reach = float(np.median([np.ptp(stroke.displacement) for stroke in rested]))
    return float(np.median(strays)) / max(noise_level(strokes.motion.displacement, fs), FINEST * reach)


def _by_pull(record: Record, strokes: Strokes) -> _Borne | None:
    """What pulls when each slip begins, where friction was found by a balance of forces and no sensor did better."""
    balance = _balance(record)
    if balance is None:
        return None
    pull = balance.pull(record) - strokes.offset
    rested = [stroke for stroke in strokes.strokes if stroke.rests]
    onsets = [(stroke, *onset) for stroke in rested if (onset := begun(stroke, pull, balance.mass, record.fs))]
    if not onsets:
        return None
    chosen, forces, changes, misfits = zip(*onsets, strict=True)
    level = float(np.median([onset.level for onset in chosen]))
    left, pulls = np.array(misfits), np.array(forces)
    lean = float(np.mean(np.sign(left[:, 1] - left[:, 0]))) * math.sqrt(len(left))  # above zero it falls at once
    falls = np.median(pulls / np.array([[onset.level] for onset in chosen]), axis=0) >= 1  # to where it slides
    best, typical = int(lean < 0 and falls[1]), np.median(left, axis=0)
    alike = falls & (typical < typical.min() + ALIKE)
    alike[1 - best] &= abs(lean) < CLEAR
    friction = pulls[:, best].tolist()
    apart = [0.0, *np.median(pulls[:, alike] - pulls[:, [best]], axis=0)]
    unsure = float(np.median([change[best] for change in changes])) + PULLED * level  # known to a sample
    return _Borne(chosen, friction, PULL, unsure - float(min(apart)), unsure + float(max(apart)))


def _by_peak(record: Record, strokes: Strokes) -> _Borne:
    """The friction's largest value before each slip, with what sensors and smoothing do to it."""
    chosen = strokes.strokes
    friction = [float(stroke.friction[stroke.slip]) for stroke in chosen]
    deviation = record.channels["friction"].noise or noise_level(record["friction"], record.fs)
    noise = 2 * deviation
    if is_measured(record, "friction"):
        peaks = [Peak.at(stroke.slip, stroke.friction, stroke.level, deviation) for stroke in chosen]
        below, above = unseen(Peak.median(peaks))
        return _Borne(chosen, friction, PEAK, below + noise, above)
    rows = float(np.median([stroke.slip for stroke in chosen]))
    if rows < FEW:
        raise EstimateError(
            f"{rows:g} samples from a reversal to the slip at {record.fs:g} Hz",
            f"what the contact bears before it slips takes {FEW} at least",
            "sample faster, if it ever sticks",
        )
    method = "" if record.rig is None else record.rig.method
    unknown = _unstated(record, method)
    strays = [_stray(stroke, wide=bool(unknown)) for stroke in chosen]
    stray = (RINGS if unknown else 1.0) * float(np.median(strays))
    level = float(np.median([stroke.level for stroke in chosen]))
    if stray > NOTHING * level:
        unit = record.channels["friction"].unit
        raise EstimateError(
            f"the friction strays by {stray:.2g} {unit} after each slip, from a level of {level:.2g} {unit}",
            f"static friction is told where it strays by less than {100 * NOTHING:.0f} % of its level",
            unknown or "give a record with less noise",
        )
    best = next(iter(sensors_behind(record)), "x")
    fall = float(np.median(friction)) - level
    corner = max(BLUNT[best] * float(np.median([_steepest(stroke) for stroke in chosen])), ROUNDED[best] * fall)
    blurred = "told from the displacement alone, which blurs a peak" if best == "x" else "ok"
    status = Status(Doubt(unknown, UNSTATED) if unknown else blurred)
    return _Borne(chosen, friction, PEAK, max(noise, corner / 4) + stray, corner + stray, status)


def _unstated(record: Record, method: str) -> str:
    """What of the sensors behind the friction is taken as it reads, in words."""
    names = sensors_behind(record)
    if method in (*FUSIONS, ALONE):
        names = [name for name in names if record.channels[name].mount is None]
        how = "is not stated, and its ringing is in it: state it, by with_details or under [sensors] in the rig file"
    elif method and not names:
        return "a balance of forces smooths and overshoots its peak"
    else:
        how = 'is not used, and its ringing is in it: state it and take friction_force(record, ..., method="fusion")'
    return f"the mount of {' and '.join(names)} {how}" if names else ""


def _steepest(stroke: Stroke) -> float:
    """By how much the friction rises in a sample at most, shortly before the slip [N]."""
    return float(np.max(np.diff(stroke.friction[max(0, stroke.slip - NEAR) : stroke.slip + 1]), initial=0.0))


def _stray(stroke: Stroke, *, wide: bool) -> float:
    """How far the friction strays from its level while it slides, once it has come back to it [N].

    `wide` from the slip on, with all that rings there; else from where it slides for good.
    """
    speed = np.gradient(stroke.displacement)
    fast = np.flatnonzero(speed > FAST * speed.max())
    slow = np.flatnonzero(speed[: fast[0]] < CREEPS * speed.max())
    first = stroke.slip if wide or not len(slow) else max(stroke.slip, int(slow[-1]) + 1)
    off = stroke.friction[first : int(fast[-1]) + 1] - stroke.level
    back = np.flatnonzero(off <= 0)
    return float(np.max(np.abs(off[back[0] :]))) if len(back) else 0.0


def _widened(estimate: Estimate, below: float, above: float) -> Estimate:
    """The estimate, its interval as far as noise and the instant of a sample may have moved it."""
    low, high = estimate.interval
    wide = replace(estimate, interval=(low - below, high + above), sd=float(np.hypot(estimate.sd, (below + above) / 4)))
    return wide.within(0.0)


def _balance(record: Record) -> Balance | None:
    """By which friction was found, where no sensor did better than that and the mass rests on the ground."""
    rig = record.rig
    if is_measured(record, "friction") or rig is None or rig.contact == "base" or rig.method in FUSIONS:
        return None
    return Balance.of(rig)
