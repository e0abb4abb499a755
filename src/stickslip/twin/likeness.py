"""How far a record is from its twins' kind: by its displacement, and by constants that would have to be off."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stickslip.arrays import Array
from stickslip.estimate import Doubt
from stickslip.statistics import BINS, relative_swing, repeating
from stickslip.twin.belief import DAMPER, DRIVE, GAIN, GIVE, LATE, MASS, RATE, SPEED, SPRING, Belief, levelled

STRAINED = 4.0  # standard deviations by which a constant may be off before that is said
LOST = 0.3  # of x, that the nearest rig may leave: beyond, twins scatter so far that none strays from another
SAME = 0.95  # of x, that is the same in every cycle, where noise is told from a misfit by that: a bin of 16 holds 0.99
UNLIKE = 1.15  # times what noise explains, by which x may stray from its twin before that is said
# Of the sliding friction, the force that a constant amounts to which is off by more than was stated, and explains x,
# below which the numbers of dry friction alone stand: nobody knows a spring to a ten thousandth, and of a quiet record
# x asks for less. Those of a part that acts briefly or weakly do not, since as small a force may pass for all of it: of
# ten rigs with textbook bristles by tests/stepped.py two told static friction 1.3 and 2.3 times as large as it is,
# beside a misfit of 0.3 %. Beside a curve or a contact that gives way it has to be FINER: with gains and constants off
# by half a per cent these took that up, and sliding friction was 1.1 and 1.5 % off beside a force of 0.2 and 0.3 %.
SLIGHT, FINER = 0.01, 0.001
RICHER = {SPEED, GIVE, RATE}
LOADED = 0.01  # chosen: of its mean, the swing of a recorded normal load from which friction that follows it is meant
RATIOS = {SPRING, MASS, GAIN}  # by how much they are off stands as a logarithm
ASTRAY = "unlike its twins"  # a kind of doubt


@dataclass(frozen=True)
class Misfit:
    """How far a record is from its twins' kind: by its displacement, and by constants that would have to be off."""

    strays: float
    repeats: float
    strain: float
    left: float
    slip: str
    feigned: float  # N, as friction
    share: float  # by which a gain or a constant is off
    slight: bool
    load_swing: float  # standard deviation of a recorded normal load over its mean

    @classmethod
    def of(cls, belief: Belief, strays: float, repeats: float) -> Misfit:
        """That of a belief's record, with what else as well as its slip would be one."""
        slip, feigned = " or ".join(rig.slip for rig in belief.slips), _feigned(belief)
        share = max((abs(math.expm1(belief.values[name])) for name in _off(belief) if name in RATIOS), default=0.0)
        most = FINER if RICHER & belief.values.keys() else SLIGHT
        little = feigned < most * belief.kinetic and share < most
        slight = little and strays <= UNLIKE and belief.left <= LOST
        swing = relative_swing(belief.record["normal"]) if "normal" in belief.record else 0.0
        return cls(strays, repeats, belief.strain, belief.left, slip, feigned, share, bool(slight), swing)

    @property
    def lost(self) -> bool:
        """Whether the nearest rig is nowhere near."""
        return self.left > LOST

    @property
    def explained(self) -> bool:
        """Whether the nearest rig, with what it has off, explains x."""
        return not self.lost and self.strays <= UNLIKE and self.load_swing <= LOADED

    @property
    def unlike(self) -> bool:
        """Whether the record is not of its twins' kind."""
        return self.doubt is not None and not self.doubt.lesser

    @property
    def doubt(self) -> Doubt | None:
        """What is said of it, where it is too far."""
        if self.lost:
            what = f"its nearest twin leaves {100 * self.left:.0f} % of x"
            why = ": a constant, a unit or a channel is not as stated, or the contact is of no kind that was tried"
        elif self.strays > UNLIKE:
            what = f"x strays {self.strays:.2g} times as far from its twins as noise explains"
            why = ": the contact is of no kind that was tried, or a constant is not as stated"
            if not self.repeats:
                why = ", in each cycle another way, as slow noise of a sensor does, which the intervals do not count"
        elif self.slip:
            what = f"its nearest twin has {self.slip}"
            why = ": correct that, or say how sure it is, or the contact is of no kind that was tried"
        elif self.strain > STRAINED:
            what = f"its nearest twin has a constant {self.strain:.0f} standard deviations off"
            why = ": the contact is of no kind that was tried, or that constant is less sure than stated"
        else:
            return None
        if self.load_swing > LOADED:
            what = f"its normal load swings by {100 * self.load_swing:.2g} %, which that of its twins does not"
            why = ": no contact whose friction follows a recorded load was tried"
        if self.slight:
            why = f", as a force less than {100 * SLIGHT:g} % of the friction, which the intervals count"
        return Doubt(what + why, ASTRAY, lesser=self.slight)


def _off(belief: Belief) -> set[str]:
    """What a record's nearest rig has off by more than was stated."""
    strained = {name for name, sd in belief.unsure.items() if abs(belief.values[name]) > STRAINED * sd}
    return strained | set(belief.slipped)


def _feigned(belief: Belief) -> float:
    """Root mean square of the force [N] that what is off amounts to."""
    record, stated, x = belief.record, belief.stated, belief.record["x"]
    z, driven = (record[name] if name in record else np.zeros(len(record)) for name in ("z", "force"))
    spring = stated.stiffness * (x - z)
    inertia = driven - record["friction"] - spring
    by_x = inertia + stated.stiffness * x
    forces = {SPRING: spring, MASS: inertia, GAIN: by_x, LATE: np.gradient(by_x) * record.fs, DAMPER: record["v"]}
    forces |= dict.fromkeys(DRIVE, stated.stiffness * z + driven)
    return math.hypot(*(belief.values[name] * float(np.std(forces[name])) for name in _off(belief)))


def strays(belief: Belief, noises: Array, frequency: float) -> tuple[float, float]:
    """How much more x strays from its nearest rig than a twin's does from its own, which noise alone parts.

    And how much of that is the same in every cycle: a law or a constant that is wrong is, slow noise is not. Of a
    motion that is not the same in every cycle, all is counted. The noises are those of the twins, shape (twins, n).
    """
    if belief.fit is None:
        return math.inf, math.inf
    apart = levelled(noises.T)
    apart -= belief.fit.jacobian @ (belief.fit.gain @ apart)
    # nine of ten twins stray no further: of a mass that rests between two counts some stray a third more than the mean
    explained = math.sqrt(float(np.quantile(np.mean(apart**2, axis=0), 0.9)))
    if not explained:
        return math.inf, math.inf
    strayed = float(np.std(belief.residual))
    cycles = (belief.record.time - belief.record.start) * (0.0 if math.isnan(frequency) else frequency)
    number = (cycles % 1.0 * BINS).astype(np.intp)
    moved, left = (repeating(number, values)[number] for values in (levelled(belief.record["x"]), belief.residual))
    same = float(np.std(moved)) > SAME * float(np.std(belief.record["x"]))
    return strayed / explained, (float(np.std(left)) if same else strayed) / explained
