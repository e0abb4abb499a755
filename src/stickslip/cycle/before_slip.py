"""What does a contact do before it slips: does it give way, how stiffly, and is there play in it?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import FORCES, is_measured
from stickslip.cycle.slips import Stroke, Strokes, find_strokes
from stickslip.errors import EstimateError
from stickslip.estimate import Estimate, Result
from stickslip.record.record import Record
from stickslip.signals.noise import noise_level
from stickslip.statistics import mean_of_cycles
from stickslip.units import prefixed

Array = NDArray[np.float64]

QUESTION = "presliding"
SIDES = ((1, "forward"), (-1, "back"))
LOW, HIGH = 0.2, 0.8  # of the sliding friction, between which a line is drawn on either side of zero
FEW = 4  # samples for a line
FELT = 5e-4  # of a stroke: a contact that gives way by less is not told from a rigid one
ELASTIC = 1 / 3  # of a stroke, that friction may take to turn: one that follows the speed seems to give way over 0.44
RIGID = 0.02  # of a stroke: where friction may take more to build up, a contact is not shown to be rigid
BLURRED = 0.5  # of the samples over which a balance of forces blurs a jump: a quicker build-up is the blur's


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
    of the sliding friction. C of the second is the compliance (the displacement is regressed on the friction, which is
    the surer of the two), :math:`1/C` the stiffness, and the distance of both lines at no friction the play. A contact
    that gives way does so alike in both directions; where C is not told from zero, or is smaller than 0.05 % of the
    stroke, it is rigid as far as the record can tell; where the mass moves against its load while it sticks, something
    else moves (the frame, the sensor), and its compliance can not be told. Nor can it where friction would take more
    than a third of a stroke to turn round, as one that follows the speed seems to, or builds up within the samples over
    which a balance of forces blurs a jump.

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
    strokes = find_strokes(record, contact=contact, question=QUESTION)
    noise = noise_level(strokes.motion.displacement, record.fs)
    span = float(np.median([np.ptp(stroke.displacement) for stroke in strokes.strokes]))
    length = strokes.motion.unit
    slopes = [_compliance(strokes.to(way), f"compliance {side}", f"{length}/{strokes.unit}") for way, side in SIDES]
    level = float(np.median([stroke.level for stroke in strokes.strokes]))
    least = max(FELT * span, noise) / level  # compliance that would just be felt
    most = ELASTIC * span / 2 / level  # friction turns from one side to the other
    verdict, evidence = _verdict(slopes, level, (least, RIGID * span / level, most), length)
    if verdict == "gives way" and not is_measured(record, "friction") and _blurred(strokes):
        verdict, evidence = "can not be told", f"{evidence}, as fast as the balance of forces lets a jump be seen"
    gives = verdict == "gives way"
    sides = [
        _inverse(slope, f"presliding stiffness {side}") if gives else None
        for slope, (_, side) in zip(slopes, SIDES, strict=True)
    ]
    untold = verdict == "can not be told"
    slopes = [slope.unknown(evidence) if untold else slope.within(0.0, otherwise=evidence) for slope in slopes]
    status = evidence if untold else "ok"
    stiffness = _inverse(_both(slopes), "presliding stiffness") if gives else None
    (forward, back), backlash = sides, _backlash(strokes) if gives else None
    return Presliding(stiffness, forward, back, backlash, slopes[0], slopes[1], verdict, evidence, status)


def _branch(stroke: Stroke, low: float, high: float) -> tuple[float, float] | None:
    """Displacement at no friction and compliance, from where the friction is between two shares of its level."""
    friction = stroke.friction[: stroke.slip + 1]
    inside = (friction > low * stroke.level) & (friction < high * stroke.level)
    if inside.sum() < FEW or np.ptp(friction[inside]) == 0:
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
            f"fewer than {FEW} samples of each stroke lie between {LOW:g} and {HIGH:g} of the sliding friction",
            "a line through the build-up of friction needs more",
            "sample faster",
        )
    return mean_of_cycles(
        name,
        [slope for _, slope in lines],
        unit=unit,
        method=f"displacement on friction, {LOW:g} to {HIGH:g} of its level, mean of strokes",
    )


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
    said = " and ".join(f"{factor * way:.2g} {unit} {side}" for way, (_, side) in zip(ways, SIDES, strict=True))
    moves = f"while friction builds up to {level:.3g} {FORCES[length]} it moves {said}"
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
