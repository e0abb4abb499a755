"""What a curve is fitted to: friction and motion of a contact, with the cycle that each sample lies in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stickslip.balance.motion import (
    AUDIBLE,
    CREEP,
    FORCES,
    away_from,
    contact_motion,
    find_cycles,
    motion_channels,
    require_fit,
)
from stickslip.cycle.loops import LEAST_SPREAD, Loops
from stickslip.errors import EstimateError
from stickslip.record.record import Record
from stickslip.signals.derivatives import smooth
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_level
from stickslip.units import prefixed

Array = NDArray[np.float64]

BLOCKS = 200  # of a cycle, or of a motion without one, whose residuals are told apart
LEAST = 50  # samples
REVERSED = 0.05  # of the fastest speed: what goes back slower than that does not reverse
COEFFICIENT = {"N": "1", "N s/m": "s/m", "N/m": "1/m"}  # what stands for a unit where friction has none
TURNING = {"N": "N m", "N s/m": "N m s/rad", "N/m": "N m/rad", "m": "rad", "m/s": "rad/s"}


@dataclass(frozen=True, eq=False)
class Samples:
    """Friction over a motion.

    Attributes
    ----------
    time, displacement, velocity, friction : ndarray, shape (n,)
        In order of time.
    cycle : ndarray of int, shape (n,)
        Number of the cycle that each sample lies in; all zero where there is none.
    block : ndarray of int, shape (n,)
        Part of the cycle, 0 to 199.
    cycles : int
        Number of cycles that went into them.
    noise : float
        Standard deviation of the friction's broadband noise.
    unit : str
        Of the displacement, "m" or "rad".
    force : str
        Of the friction, "N", "N m" or "1".
    skipped : int
        Samples at the start that set the memory of a curve that has one, and are not compared.
    blur : int
        Samples over which the velocity's smoothing spreads a kink.
    """

    time: Array
    displacement: Array
    velocity: Array
    friction: Array
    cycle: NDArray[np.intp]
    block: NDArray[np.intp]
    cycles: int
    noise: float
    unit: str
    force: str = "N"
    skipped: int = 0
    blur: int = 1

    @property
    def compared(self) -> Samples:
        """Those that a curve is held against."""
        return replace(self.rows(slice(self.skipped, None)), skipped=0)

    def rows(self, chosen: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Samples:
        """Some of the samples."""
        arrays = ("time", "displacement", "velocity", "friction", "cycle", "block")
        return replace(self, **{name: getattr(self, name)[chosen] for name in arrays})

    def in_units(self, unit: str) -> str:
        """A unit along a path, or what stands for it round an axis, or for a coefficient."""
        if self.force == "1":
            return COEFFICIENT.get(unit, unit)
        return TURNING.get(unit, unit) if self.unit == "rad" else unit

    @property
    def speed_spread(self) -> float:
        """How far the speed varies about its mean, over that mean; each direction about its own."""
        speed, forward = np.abs(self.velocity), self.velocity > 0
        spread = [float(speed[side].std()) for side in (forward, ~forward) if side.any()]
        return max(spread) / float(speed.mean())

    @property
    def drives(self) -> bool:
        """Whether friction feeds the motion on the whole."""
        return float(self.friction @ self.velocity) < 0

    @property
    def reverses(self) -> bool:
        """Whether it moves both ways."""
        fastest = float(np.abs(self.velocity).max())
        return bool(min(self.velocity.max(), -self.velocity.min()) > REVERSED * fastest)


def told(value: float, unit: str) -> str:
    """A number to three figures, in a readable unit."""
    factor, text = prefixed(value, unit)
    return f"{factor * value:.3g} {text}"


def require_resisting(samples: Samples) -> None:
    """Refuse friction that drives the motion: no contact gives way so."""
    if samples.drives:
        raise EstimateError(
            f"friction does {float(samples.friction @ samples.velocity) / len(samples.time):.3g} W on average",
            "it opposes the motion",
            "check the sign of the force or of the displacement",
        )


def samples_of(
    data: Record | Loops,
    *,
    contact: str | None,
    frequency: float | str | None,
    smoothed: bool = False,
    normal: float | None = None,
) -> tuple[Samples, Samples]:
    """All samples of the complete cycles, the first of several to set a memory, and those of them that slide.

    A displacement that trembles by its noise makes an element give way and come back: `smoothed`, it does not.
    A coefficient of friction is turned into a force where the load `normal` [N] is known.
    """
    if isinstance(data, Loops):
        query = {"contact": contact, "frequency": frequency, "normal": normal}
        if given := [f"{name}=" for name, value in query.items() if value is not None]:
            raise EstimateError(
                f"{' and '.join(given)} of friction_loops' answer",
                "its mean cycle holds a force over a known motion",
                "tell friction_loops, or give the record itself",
            )
        return _of_loops(data)
    if not isinstance(data, Record):
        raise EstimateError(
            f"a curve of {type(data).__name__}", "it is fitted to a Record or to friction_loops of one", "give either"
        )
    return _of_record(data, contact, frequency, smoothed, normal)


def _of_record(
    data: Record, contact: str | None, frequency: float | str | None, smoothed: bool, normal: float | None
) -> tuple[Samples, Samples]:
    """The friction over the motion of the contact, cycle by cycle where it has any."""
    question = "the fit of a friction curve"
    rubs = "coefficient" if "coefficient" in data and "friction" not in data else "friction"
    data.require_clean(rubs, question=question, samples=LEAST)
    if np.ptp(data[rubs]) == 0:
        raise EstimateError(f"channel {rubs} never changes", f"{question} needs one that does", "check its column")
    record = without_delays(data, *motion_channels(data, contact), rubs, question=question)
    motion = contact_motion(record, contact=contact, question=question)
    friction, force = record[rubs], record.channels[rubs].unit
    if rubs == "friction":
        require_fit(record, rubs, length=motion.unit, question=question)
    elif normal is not None:
        friction, force = normal * friction, "N"
    label, edges = np.zeros(len(friction), dtype=np.intp), np.array([0.0, len(friction)])
    try:
        cycles = find_cycles(record, motion, frequency=frequency)
    except EstimateError:
        if frequency is not None:
            raise
        peak = float(np.abs(motion.velocity).max())  # no cycle: all of it is one
    else:
        label, edges, peak = cycles.labels(len(friction)), cycles.edges, cycles.peak
    rows = np.arange(len(friction))
    place = smooth(motion.displacement, record.fs).values if smoothed else motion.displacement
    share = (rows - edges[label]) / (edges[label + 1] - edges[label])
    samples = Samples(
        time=record.start + rows / record.fs, displacement=place, velocity=motion.velocity,
        friction=friction, cycle=label, block=np.clip((BLOCKS * share).astype(np.intp), 0, BLOCKS - 1),
        cycles=len(edges) - 1, noise=noise_level(friction, record.fs), unit=motion.unit,
        force=force, blur=motion.blur,
    )  # fmt: skip
    fast = np.abs(motion.velocity) > max(CREEP * peak, AUDIBLE * motion.noise)
    clear = fast & away_from(~fast, motion.blur)
    sliding = clear if clear.sum() > fast.sum() / 2 else fast
    whole = samples.rows(label >= 0)
    return replace(whole, skipped=int(np.argmax(whole.cycle > 0))), _require_sliding(
        samples.rows(sliding & (label >= 0))
    )


def _of_loops(loops: Loops) -> tuple[Samples, Samples]:
    """The mean cycle; what it knows of the scatter between cycles is in the noise."""
    count = len(loops.phase_grid)
    samples = Samples(
        time=loops.phase_grid / loops.frequency.value, displacement=loops.displacement, velocity=loops.velocity,
        friction=loops.friction, cycle=np.zeros(count, dtype=np.intp),
        block=(BLOCKS * loops.phase_grid).astype(np.intp), cycles=len(loops.cycles),
        noise=float(np.median(loops.scatter)) / np.sqrt(len(loops.cycles)), unit=loops.unit,
        force=FORCES[loops.unit],
    )  # fmt: skip
    fast = np.abs(loops.velocity) > CREEP * float(np.abs(loops.velocity).max())
    twice = samples.rows(np.tile(np.arange(count), 2))  # once round to set the memory
    return replace(twice, skipped=count), _require_sliding(samples.rows(fast & away_from(~fast, 1)))


def _require_sliding(samples: Samples) -> Samples:
    if len(samples.friction) < LEAST:
        raise EstimateError(
            f"{len(samples.friction)} samples slide",
            f"a curve of friction needs {LEAST} at least",
            "give a record that slides longer, or was sampled faster",
        )
    return samples


def require_speeds(samples: Samples, curve: str) -> None:
    """Refuse to tell how friction changes with speed where the speed hardly does."""
    if samples.speed_spread < LEAST_SPREAD:
        raise EstimateError(
            f"the sliding speed varies by {100 * samples.speed_spread:.1f} % about its mean",
            f"the curve '{curve}' needs speeds that differ by {100 * LEAST_SPREAD:g} % at least",
            "let the speed vary, as in a sine or a ramp; of this record, fit 'coulomb'",
        )


def require_reversals(samples: Samples, curve: str) -> None:
    """Refuse what only motion both ways shows."""
    if not samples.reverses:
        raise EstimateError(
            f"the velocity runs from {samples.velocity.min():.3g} to {samples.velocity.max():.3g} {samples.unit}/s",
            f"the curve '{curve}' needs motion both ways",
            "give a record that reverses",
        )
