"""What can be asked of each motion of a sweep: a register of measures, and what each one leaves on the map.

Counting along an event log: what the pieces of a motion add up to. Compiled, for whole logs and piece by piece.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from stickslip.compiled import OPTIONS, compiled
from stickslip.errors import ModelError
from stickslip.settings import nearest

Measure = str | Callable[..., float]
OUTCOMES = ("moving", "at_rest", "failed", "no_such_system")
MOVING, AT_REST, FAILED, NO_SYSTEM = range(len(OUTCOMES))
ORDERS = 8  # longest orbit looked for, in periods of the drive
CLOSE = 1e-6  # of the motion's size: a return this near is one

# What is counted, and what is remembered from piece to piece.
NORMAL, ABNORMAL, HELD, SHORT, FASTEST, REACH, WORK, SIDE, STOPPED, LONGEST, UNDERWAY, MICRO = range(12)
ENTRIES = 12
PART = 0.1  # of the longest slip: a shorter one is a micro-slip
SLIP, STICK, MICROSTICK = 0, 1, 2  # kinds of a mode


@dataclass(frozen=True)
class Variable:
    """One number of each point of a map.

    Attributes
    ----------
    unit : str
        "1" where it has none.
    words : str
        What it is.
    dtype : str
        As numpy has it.
    fill : float or int
        What stands where nothing is known.
    attributes : mapping
        More for the labelled answer.
    """

    unit: str
    words: str
    dtype: str = "float64"
    fill: Any = math.nan
    attributes: Mapping[str, Any] = field(default_factory=dict)


UNKNOWN = "where_unknown"  # the attribute of a variable that says where a motion leaves no number
LOG = "events"  # the measure that keeps every event
EVENTS = {"stops", "stick_share", "micro_slips", "transition_speed"}  # measures that count events of one contact
REPEATS = {"period", "multipliers"}  # measures of an orbit that is there twice in what is measured
COUNTS = ("stops", "micro_slips", "period", LOG)  # measures of whole numbers, which have borders
STATUS = Variable(
    "1",
    "what became of the motion",
    "int8",
    -1,
    {"flag_values": list(range(-1, len(OUTCOMES))), "flag_meanings": " ".join(("not_run", *OUTCOMES))},
)
MEASURES: dict[str, dict[str, Variable]] = {
    "stops": {
        "normal_stops": Variable("1", "stops per period after which the motion turns"),
        "abnormal_stops": Variable("1", "stops per period after which the motion goes on the same way"),
    },
    "amplitude": {"amplitude": Variable("m", "largest displacement from zero")},
    "stick_share": {"stick_share": Variable("1", "share of the time that the contact holds")},
    "micro_slips": {"micro_slips": Variable("1", "slips per period shorter than a tenth of the longest")},
    "transition_speed": {
        "transition_speed": Variable(
            "m/s",
            "largest speed at which a microstick becomes a slip",
            attributes={UNKNOWN: "no microstick becomes a slip"},
        )
    },
    "energy": {"energy": Variable("J", "work of friction per period")},
    "period": {
        "order": Variable(
            "1", "periods of the drive after which the motion repeats; 0: none up to 8 or half the cycles"
        )
    },
    "multipliers": {
        "multiplier": Variable(
            "1",
            "largest Floquet multiplier",
            "complex128",
            complex(math.nan, math.nan),
            {UNKNOWN: "no orbit repeats yet after the settling"},
        )
    },
    "lyapunov": {"lyapunov": Variable("1/s", "largest Lyapunov exponent")},
    LOG: {LOG: Variable("1", "events of the measured periods")},
}


def variables(measures: Sequence[Measure]) -> dict[str, Variable]:
    """The variables that the measures leave, by name, the status first."""
    variables = {"status": STATUS}
    for measure in measures:
        variables |= (
            MEASURES[measure] if isinstance(measure, str) else {own_name(measure): Variable("1", "a user's measure")}
        )
    return variables


def read_measures(measures: Sequence[Measure] | Measure) -> tuple[Measure, ...]:
    """The measures asked for, each known or a function.

    Raises
    ------
    ModelError
        None is asked for, or one is unknown or there twice.
    """
    given = (measures,) if isinstance(measures, str) or callable(measures) else tuple(measures)
    if not given:
        raise ModelError("no measures", "a map shows something", f"ask for some of {', '.join(MEASURES)}")
    names = [name for measure in given for name in _names(measure)]
    for name in names:
        if names.count(name) > 1 or name in ("status",):
            raise ModelError(
                f"two measures are called '{name}'", "each has a name of its own", "rename or leave one out"
            )
    return given


def _names(measure: Measure) -> tuple[str, ...]:
    if callable(measure):
        return (own_name(measure),)
    if measure not in MEASURES:
        raise ModelError(
            f"no measure is called '{measure}'",
            f"there are {', '.join(MEASURES)}, and functions of a Trajectory",
            nearest(str(measure), MEASURES),
        )
    return tuple(MEASURES[measure])


def own_name(measure: Callable[..., float]) -> str:
    """What a user's function is called on the map."""
    return str(getattr(measure, "__name__", type(measure).__name__)).strip("<>")


@compiled(**OPTIONS)
def note(kind, side, begin, length, path, speed, sums):
    """Add one piece: its kind and side, when it begins [s] after the measured time does, how long it lasts, how far
    the contact slips in it [m], and how fast at its start [m/s]. `sums` is (ENTRIES,)."""
    counted = begin >= 0.0
    # Slip: it tells what the stop before it was, or goes on, or turns without a stop.
    if kind == SLIP:
        if sums[STOPPED] > 0.0:
            # normal (thesis): it turns back; abnormal: it goes on the same way; unknown before the first slip
            if counted and sums[SIDE] != 0.0:
                sums[NORMAL if sums[SIDE] * side < 0.0 else ABNORMAL] += 1.0
            if counted and sums[MICRO] > 0.0:
                sums[FASTEST] = max(sums[FASTEST], speed)
        # turned without a stop: a new slip all the same
        elif sums[SIDE] * side < 0.0:
            _end_slip(counted, sums)
        sums[SIDE], sums[STOPPED], sums[MICRO] = side, 0.0, 0.0
        sums[UNDERWAY] += path
        return
    # Stick: the first piece of a stop ends the slip; a stop may consist of several.
    if sums[STOPPED] == 0.0:
        _end_slip(counted, sums)
    sums[STOPPED], sums[MICRO] = 1.0, 1.0 if kind == MICROSTICK else 0.0
    sums[HELD] += max(0.0, length + min(begin, 0.0))


@compiled(**OPTIONS)
def _end_slip(counted, sums):
    if sums[UNDERWAY] > 0.0:
        if counted and sums[UNDERWAY] < PART * sums[LONGEST]:
            sums[SHORT] += 1.0
        sums[LONGEST] = max(sums[LONGEST], sums[UNDERWAY])
    sums[UNDERWAY] = 0.0


@compiled(**OPTIONS)
def tally(kinds, sides, modes, begins, lengths, paths, speeds, sums):
    """Add a whole log; `kinds` and `sides` are by mode."""
    for j in range(modes.shape[0]):
        m = modes[j]
        note(kinds[m], sides[m], begins[j], lengths[j], paths[j], speeds[j], sums)
