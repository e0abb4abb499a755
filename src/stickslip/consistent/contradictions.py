"""Can everything that a record says be true at once? If not: what, and which channel it is.

What a record says of its sensors: their ranges, their rate, and whether they tell of the same cycle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stickslip.arrays import Array, stretches
from stickslip.balance.balance import known_constants
from stickslip.balance.motion import is_measured, require_change
from stickslip.consistent.checks import (
    FAILS,
    HOLDS,
    ONE_SLIP,
    UNTOLD,
    Check,
    Slip,
    compared,
    judged,
    mixups,
    slip_check,
    untold,
)
from stickslip.consistent.forced_checks import (
    Seen,
    acceleration_check,
    energy_check,
    forces_check,
    identity_check,
    momentum_check,
    stops_check,
    velocity_check,
    zeros_off,
)
from stickslip.consistent.sliding_balance import Stated, stated_checks, what_fails
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Plain, Result
from stickslip.record.check import find_clipping
from stickslip.record.flaws import constant, saturated
from stickslip.record.record import Record
from stickslip.signals.derivatives import Filter
from stickslip.signals.interpolate import without_delays

QUESTION = "the consistency of a record"
USED = ("x", "z", "v", "a", "load", "force")
FORCED = (acceleration_check, velocity_check, forces_check, energy_check, momentum_check, identity_check, stops_check)


NOISY = ("v", "a", "load", "force")  # whose noise moves every sample, unless it is held
MAY_REST = ("z", "force")  # what may be held still while the mass moves
CROSSED = 0.8  # of the friction's level: a reversal goes from one side of it to the other
LEAST_SAMPLES = 4.0  # of a reversal
FEWEST = 0.5  # samples of a reversal that is shorter than a record can tell
RINGS = 10.0  # samples in each period of the mass on its contact
SMOOTHED = 6.0  # times the forcing frequency, to which channels are smoothed before they are compared in time
FEW_CYCLES = 6
FARTHEST = 20  # whole cycles of a lag that is looked for
UNIQUE = 1.03  # times the least that the next best shift leaves over, if the best is to be named
FAR = 2.0  # times by which a channel's cycle differs from what is expected, from which it is in a wrong unit
SURE = 5.0  # standard deviations of what is left over, from which shifts differ


@dataclass(frozen=True, eq=False, repr=False)
class Consistency(Result, Plain):
    """What must be true if everything stated is.

    Attributes
    ----------
    checks : tuple of Check
        In the order of asking.
    status : str
        "ok", or what can not all be true.
    slips : tuple of Slip
        What would make the channels agree, the likeliest first.
    zeros : tuple of Slip
        Which zero may be off, where the mean force is not zero by much: the balance tells a load cell's from no other.
    """

    checks: tuple[Check, ...]
    status: str
    slips: tuple[Slip, ...] = ()
    zeros: tuple[Slip, ...] = ()

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that fail."""
        return tuple(check for check in self.checks if check.verdict == FAILS)

    @property
    def slip(self) -> str:
        """The one slip of the hand (a sign, two cables, a unit) that would make the channels agree; else empty."""
        return next((check.sentence for check in self.failed if check.name == ONE_SLIP), "")

    def __getitem__(self, name: str) -> Check:
        """The check of that name."""
        named = [check for check in self.checks if check.name == name]
        if not named:
            names = ", ".join(check.name for check in self.checks)
            raise EstimateError(f"no check '{name}'", f"there are {names}", "choose one of them")
        return named[0]

    def __repr__(self) -> str:
        return "\n  ".join([f"Consistency [{'ok' if self.status == 'ok' else 'not ok'}]:", *map(str, self.checks)])


def consistency(
    record: Record | Stated,
    *,
    mass: Constant | None = None,
    stiffness: Constant | None = None,
    damping: Constant | None = None,
    damper: str | None = None,
    tolerance: float = 0.01,
) -> Consistency:
    r"""Can everything that a record, or a row of a table, says be true at once?

    Of a record, over whole cycles, from the harmonics of each: is the acceleration that of the displacement; do the
    forces balance at the forcing frequency; does friction take what the base gives (closed integrals of ``k z dx``,
    of the load cell over x, and of the damper); is the mean force zero; does the identity :math:`\oint f (\dddot x +
    w^2 \dot x)\,dt = 0` hold, true of every friction law under a harmonic drive; can the mass slide without stops
    under this friction, or stop (Den Hartog's boundary; :math:`F \le \pi k Z / 4` for any contact); is a sensor at
    the end of its range; is a reversal sampled densely enough; do the channels belong to the same cycle. Where it does
    not add up, every sign, exchange and unit of a channel, a constant or the clock is tried that would make it.

    Of stated values: friction against what the base can give, against what the amplitude asks for, Den Hartog's
    boundary, and the transition speed (thesis, 3.4). A text's last digit tells its rounding: "0.51 mm" is rounded
    by 0.003 mm.

    Parameters
    ----------
    record : Record or mapping
        With ``x`` and what else was measured of z, v, a, load, force; stated delays, mounts and discharge are taken
        out. Or "mass", "stiffness", "damping", "forcing frequency", "base amplitude", "amplitude", "sliding friction",
        "contact stiffness", "transition speed", each a number in SI, a text with its unit, an Estimate, or (value,
        standard deviation).
    mass, stiffness, damping : float, str, tuple or Estimate, optional
        Of the rig; as :func:`~stickslip.friction_force` was told, where not given. For a record only.
    damper : {"ground", "base"}, optional
        Where the damper's other end is fixed.
    tolerance : float
        Share by which each sensor's calibration, and each stated constant, may be off (one standard deviation).

    Returns
    -------
    Consistency

    Raises
    ------
    RecordError
        No displacement, or a broken clock.
    EstimateError
        Stated values that do not make a motion, or a tolerance that is none.
    ModelError
        A stated value without meaning.

    Examples
    --------
    >>> row = {"mass": 2.42, "stiffness": 2310, "forcing frequency": 5.61, "base amplitude": "0.51 mm",
    ...        "amplitude": "0.49 mm", "sliding friction": "1.06 N", "contact stiffness": 201e3}
    >>> [check.name for check in consistency(row).failed]
    ['energy', 'friction that base and amplitude ask for', 'sliding without stops']
    """
    if not 0 < tolerance < 0.5:
        raise EstimateError(f"tolerance = {tolerance}", "a share between 0 and 0.5", "leave it at 0.01")
    if isinstance(record, Mapping):
        checks = tuple(stated_checks(record, tolerance))
        return Consistency(checks, what_fails(checks))
    rig = known_constants(record, mass=mass, stiffness=stiffness, damping=damping, damper=damper)
    record.require_clean("x", question=QUESTION)
    require_change(record, "x", question=QUESTION)
    measured = [name for name in USED if name in record and is_measured(record, name)]
    unheard = silent(record, measured)
    names = [name for name in measured if name not in unheard]
    record = without_delays(record, *names, question=QUESTION)
    seen = Seen.of(record, names, rig, tolerance, QUESTION)
    checks = (
        *silence_checks(record, unheard),
        *range_checks(record, names),
        *(check(seen) for check in FORCED),
        sampling_check(record, seen),
        *cycle_checks(record, seen),
    )
    failing = any(check.verdict == FAILS for check in checks)
    slips = mixups(seen.balance, failing=failing) if seen.steady and seen.lines.cycles is not None else ()
    checks = (*checks, *slip_check(seen.balance, slips))
    return Consistency(checks, what_fails(checks), slips, zeros_off(seen))


def silent(record: Record, names: Sequence[str]) -> dict[str, str]:
    """Why a channel tells nothing, of those that do not."""
    silent_channels = {}
    for name in names:
        values, unit = record[name], record.channels[name].unit
        lost = int(np.sum(~np.isfinite(values)))
        if lost:
            silent_channels[name] = f"{name} has {lost} values that are not numbers: see record.check()"
        elif constant(values) and name not in MAY_REST:
            silent_channels[name] = (
                f"{name} does not change, it reads {values[0]:.4g} {unit} throughout: look at its cable"
            )
    return silent_channels


def silence_checks(record: Record, why: Mapping[str, str]) -> list[Check]:
    """That a channel tells nothing: one that does not change can not be true, of one with gaps nothing is known."""
    verdicts = {name: FAILS if np.isfinite(record[name]).all() else UNTOLD for name in why}
    return [Check(f"{n} is heard", math.nan, math.nan, "1", math.nan, verdicts[n], reason) for n, reason in why.items()]


def range_checks(record: Record, names: Sequence[str]) -> list[Check]:
    """Whether a sensor stands at the end of its range."""
    checks = []
    for name in names:
        cut = find_clipping(record, name) if np.isfinite(record[name]).all() else None
        mask = saturated(record[name]) if name in NOISY else np.zeros(1, dtype=bool)
        if not mask.any() and cut is None:
            continue
        top = float(np.abs(record[name]).max())
        held = sum(last - first + 1 for first, last in cut.rows) if cut is not None else int(mask.sum())
        sentence = f"{name} is held at the end of its range in {held} of {len(record)} samples"
        checks.append(Check(f"range of {name}", top, top, record.channels[name].unit, math.inf, FAILS, sentence))
    none = "none stands at the end of its range"
    return checks or [Check("range of the sensors", math.nan, math.nan, "1", math.nan, HOLDS, none)]


def sampling_check(record: Record, seen: Seen) -> Check:
    name = "samples of a reversal"
    source = next((name for name in ("load", "friction") if name in record), "")
    if not source or not np.isfinite(record[source]).all():
        return untold(name, "no friction is measured, or computed yet")
    force = record[source] - np.mean(record[source])
    level = float(np.median(np.abs(force)))
    signs = np.sign(force) * (np.abs(force) > CROSSED * level)
    pairs = zip(*stretches(signs == 0), strict=True)
    spans = [(first, last) for first, last in pairs if first > 0 and last < len(signs)]
    turning = [(first, last) for first, last in spans if signs[first - 1] * signs[last] < 0]
    sides = signs[signs != 0]
    turns = int(np.sum(sides[1:] * sides[:-1] < 0))
    if not turns:
        return untold(name, "the friction never reverses")
    mean = float(sum(last - first for first, last in turning)) / turns
    rate = max(record.fs * LEAST_SAMPLES / max(mean, FEWEST), RINGS * _coupled(record["x"], force, turning, seen))
    check = compared(
        name,
        LEAST_SAMPLES,
        mean,
        sd=max(0.25, seen.tolerance),
        unit="1",
        bound=True,
        holds="enough to see how the friction turns round",
        fails=f"a reversal has {mean:.2g} sample{'' if mean == 1 else 's'} on the average, too few to see how the "
        f"friction turns round: sample at {_round_up(rate):.0f} Hz or more, or the contact is rigid",
    )
    return replace(check, verdict=UNTOLD) if check.verdict == FAILS else check  # a rigid contact contradicts nothing


def _coupled(x: Array, force: Array, turning: Sequence[tuple[int, int]], seen: Seen) -> float:
    """Least frequency [Hz] of the mass on its contact: the contact gives no more than x moves while it turns."""
    if "mass" not in seen.rig:
        return 0.0
    moved = np.array([x[last] - x[first - 1] for first, last in turning])
    gained = np.array([force[last] - force[first - 1] for first, last in turning])
    way = float(np.median(np.abs(moved))) if len(moved) else 0.0
    if way == 0:
        return 0.0
    stiffness = float(np.median(np.abs(gained))) / way
    return math.sqrt((stiffness + seen.rig.get("stiffness", 0.0)) / seen.rig["mass"]) / (2 * math.pi)


def _round_up(rate: float) -> float:
    """The next 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(rate))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= 0.9 * rate)


def cycle_checks(record: Record, seen: Seen) -> list[Check]:
    """Whether channels tell of the same cycle: what does not repeat cancels at one shift of whole cycles only."""
    if seen.lines.cycles is None:
        return []
    edges, checks = seen.lines.cycles.edges, []
    if len(edges) < FEW_CYCLES:
        return [untold("channels are of the same cycle", f"fewer than {FEW_CYCLES} cycles")]
    smooth = Filter("smoother", record.fs, min(SMOOTHED / float(np.diff(edges).mean()), 0.2) * record.fs)
    expected = _foretold(record, seen, smooth)
    for name in (channel for channel in expected if channel in seen.channels):
        title = f"{name} is of the same cycle as x"
        read = smooth.apply(record[name], {0: 1.0})
        if not 1 / FAR < _gain(read, expected[name], edges) < FAR:
            checks.append(untold(title, "its unit or sign is wrong, so that nothing cancels at any lag"))
            continue
        left = _left_over(read, expected[name], edges)
        best, here = min(left, key=lambda shift: left[shift]), left[0]
        # a channel smoothed to b Hz for T s is worth 2 b T samples; the deviation of their size is 1 / sqrt(4 b T)
        distinct = left[best] * (1 + SURE / math.sqrt(4 * SMOOTHED * len(edges)))
        if max(left.values()) < distinct:
            checks.append(untold(title, "the motion repeats: a lag of whole cycles leaves no trace, and does no harm"))
            continue
        # a shift to the end of those that are tried leaves most of how the motion begins out: no least of its own
        if best and (here < distinct or best in (min(left), max(left))):
            checks.append(untold(title, "the cycles differ too little to tell a lag of whole cycles"))
            continue
        apart = math.inf if best else 0.0
        next_best = min(left[shift] for shift in left if shift != best)
        many = f"{abs(best)} whole cycles {'late' if best > 0 else 'early'}" if next_best > UNIQUE * left[best] else ""
        late = f"{name} comes {many or 'some whole cycles late or early'} against x"
        what = "what does not repeat in the one does not repeat in the other"
        unit = record.channels[name].unit
        checks.append(judged(title, here, left[best], apart, unit=unit, holds=what, fails=late))
    return checks


def _foretold(record: Record, seen: Seen, smooth: Filter) -> dict[str, Array]:
    """What the displacement, smoothed, foretells of the acceleration, and of the load cell where the rig is known."""
    moved = smooth.apply(record["x"], {2: 1.0})
    if not seen.knows:
        return {"a": moved}
    damped = record["x"] - record["z"] if seen.damper == "base" and "z" in record else record["x"]
    pull = -seen.rig["stiffness"] * record["x"] - seen.damping * np.gradient(damped, 1 / record.fs)
    for name, factor in (("z", seen.rig["stiffness"]), ("force", 1.0)):
        pull = pull + factor * record[name] if name in record else pull
    return {"a": moved, "load": smooth.apply(pull, {0: 1.0}) - seen.rig["mass"] * moved}


def _gain(read: Array, expected: Array, edges: Array) -> float:
    """How large a channel's mean cycle is by what is expected of it; a lag of whole cycles leaves it as it is."""
    period = float(np.diff(edges).mean())
    own, other = (values - _unrepeated(values, period) for values in (read, expected))
    own, other = own - own.mean(), other - other.mean()
    return float(own @ other / (other @ other)) if other.any() else math.nan


def _left_over(read: Array, expected: Array, edges: Array) -> dict[int, float]:
    """Root mean square of what one holds beyond the other and does not repeat, by the shift of whole cycles."""
    rests, period = {}, float(np.diff(edges).mean())
    most = min(FARTHEST, (len(edges) - 1) // 3)
    margin = round(period / 2)  # where the smoothing feels the ends
    read, expected = read[margin:-margin], expected[margin:-margin]
    for shift in range(-most, most + 1):
        rows = round(shift * period)
        late, early = (read[rows:], expected[: len(read) - rows]) if rows >= 0 else (read[:rows], expected[-rows:])
        rest = _unrepeated(late - early, period)
        rests[shift] = float(np.sqrt(np.mean(rest**2) / (1 - period / len(rest))))
    return rests


def _unrepeated(values: Array, period: float) -> Array:
    """A channel less its mean cycle."""
    bins = max(8, int(period))
    place = (np.arange(len(values)) / period % 1.0 * bins).astype(int)
    mean = np.bincount(place, values, bins) / np.maximum(np.bincount(place, minlength=bins), 1)
    return np.asarray(values - mean[place])
