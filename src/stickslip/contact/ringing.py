"""How a sticking contact rings, and which mechanism shows, as simulated records taught."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.motion import forcing_frequency
from stickslip.balance.mounts import acceleration_of_mass
from stickslip.cycle.sticks import Sticks, find_sticks
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Estimate, Plain, Status
from stickslip.record.record import Record
from stickslip.signals.noise import noise_level
from stickslip.signals.pieces import GLIDE, RING, Piece, Splitter

QUESTION = "the mechanism"
UNTOLD = "cannot be told from this record"
SWINGING = "non-sinusoidal oscillation"
MEANINGS = {
    "bare spikes": "the acceleration jumps and rests: a rigid contact",
    "oscillation without micro-slip": "one mode rings through each stick: a compliant contact, strongly damped",
    "double stick-slip": "one mode rings, cut off by micro-slips: a compliant contact",
    SWINGING: "the sticks swing, but not as one mode: friction with a memory (a state variable)",
    UNTOLD: "no mechanism stands out",
}
LIKELY = 0.5
SURE = 0.7  # probability that a verdict has at least
FASTEST = 10.0  # cycles of the mode in a window: there the search for it ends
CHOPPED = 4.5  # micro-slips a stick: more are rather a mount's that rings than the friction's
ALONE = 0.8  # how often it is friction, where fewer are told by an acceleration whose mount nothing is known of
STATE_MOUNT = "state the mount, record.with_details('a', mount=(frequency, damping)), or give x"
STRANGE = 4.5  # standard deviations from what the simulated records of its kind were like

LEAD = 0.12  # of a stick's duration that is looked at before it, and LAG after it
LAG = 0.06
COARSE = 90  # samples of a window in the search
FREQUENCIES = np.geomspace(1.2, 9.0, 22)  # in cycles per stick: where the search looks
DAMPINGS = (0.02, 0.07, 0.16, 0.3)
STARTS = 3  # of the grid's best that are refined
AT_ONCE = 16  # windows that are cut together
PENALTY = 30.0  # what a piece must spare, in variances of the noise
MISFIT = 0.005  # of the acceleration's standard deviation: how well parabolas and one mode are trusted to fit
QUIET = 1.05  # times the mean square that rings leave: then rest explains as much
FAINT = 0.02  # of the acceleration's range, root mean square: rings that are smaller are none
FORBIDDEN = 1e30  # cost outside of the search, finite since costs are subtracted
SETTLED = 0.2  # of a cycle: a ring lasts longer
SEARCHED = 0.17  # the same on averaged samples: with 0.2 the wrong mode won in 4 of 40 records, with 0.15 in none,
# but then what a mount leaves is named as a contact's ring
SWINGS = 3  # reversals within one motion between sticks, from which on it swings and does not slide


@dataclass(frozen=True, repr=False)
class Mechanism(Plain):
    """What the sticks of a record are like.

    Attributes
    ----------
    name : str
        "bare spikes", "oscillation without micro-slip", "double stick-slip", "non-sinusoidal oscillation", or
        "cannot be told from this record".
    probability : float
        Of that name, among the four; NaN where it can not be told at all. Lower for a non-sinusoidal oscillation of an
        acceleration alone whose mount is not stated: that might ring, too.
    probabilities : mapping of str to float
        Of each of the four.
    features : mapping of str to float
        What the verdict rests on: ``loudness`` (root mean square of the rings over the acceleration's range),
        ``excess`` and ``rest`` (mean square left by rings and glides, and by rest and glides, over the noise's),
        ``noise`` (over the acceleration's standard deviation), ``glides`` (micro-slips per stick) and their ``spread``
        from stick to stick, ``longest`` and ``shortest`` ring of a stick in cycles, ``damping`` ratio of the mode,
        ``glided`` (share of the sticks in micro-slips), ``frequency`` (cycles of the mode in a stick).
    reason : str
        What the name means, or why it can not be told.
    """

    name: str
    probability: float
    probabilities: Mapping[str, float] = field(default_factory=dict)
    features: Mapping[str, float] = field(default_factory=dict)
    reason: str = ""

    def __repr__(self) -> str:
        sure = f" ({100 * self.probability:.0f} %)" if math.isfinite(self.probability) else ""
        return f"{self.name}{sure}: {self.reason}"


def mechanism(
    record: Record, *, channel: str = "a", mass: Constant | None = None, stiffness: Constant | None = None
) -> Mechanism:
    """Do the sticks show a rigid contact, a compliant one with or without micro-slips, or friction with a memory?

    What the thesis read from wavelet maps by eye (chapter 5). The sticks are cut into rings of one mode and glides,
    as in :func:`transition`; features of the pieces are weighed by multinomial logistic regression. Its weights were
    fitted to simulated records of the four kinds with random parameters, at signal-to-noise ratios of 22 to 50 dB, so
    that the probabilities hold for such records; a record unlike all of them is not told.

    Parameters
    ----------
    record : Record
        With an acceleration; see :func:`transition`.
    channel : str
        The acceleration.
    mass, stiffness : float, str, tuple or Estimate, optional
        Oscillating mass [kg] and spring [N/m]: with ``x`` and ``z``, to take a stated mount out of the acceleration.

    Returns
    -------
    Mechanism

    Raises
    ------
    RecordError
        A channel that is missing or not finite, a broken clock.
    EstimateError
        A mass that is not positive, a negative spring.

    Examples
    --------
    >>> import stickslip as ss
    >>> case = ss.scenarios.get("THESIS rigid 2.5Hz fk=1.1")
    >>> record = ss.simulate(case.system, cycles=8).record(fs=4000).between(1.0, 3.2)
    >>> mechanism(record).name
    'bare spikes'
    """
    checked_mass(mass, stiffness)
    try:
        return mechanism_of(find_ringing(record, channel, question=QUESTION, mass=mass, stiffness=stiffness))
    except EstimateError as error:
        return Mechanism(UNTOLD, math.nan, reason=f"{error.value}; {error.rule}")


def mechanism_of(ringing: Ringing) -> Mechanism:
    """The mechanism of sticks that are cut into pieces already."""
    observed = features(ringing)
    doubt = ringing.doubt or too_fast(ringing)
    if doubt:
        return Mechanism(UNTOLD, math.nan, features=observed, reason=doubt)
    probabilities = _weighed(observed)
    name = max(probabilities, key=lambda mechanism: probabilities[mechanism])
    sure, reason = probabilities[name], MEANINGS[name]
    against = _unlike(observed, name) or _undecided(probabilities) or (name == SWINGING and _swings_otherwise(ringing))
    if against:
        return Mechanism(UNTOLD, sure, probabilities, observed, against)
    if name == SWINGING and _mount_unknown(ringing):
        sure, reason = ALONE * sure, f"{reason}; an accelerometer whose mount rings looks alike: {STATE_MOUNT}"
    return Mechanism(name, sure, probabilities, observed, reason)


def too_fast(ringing: Ringing) -> str:
    """In words: that the mode is faster than was looked for; "" otherwise."""
    if features(ringing)["frequency"] < FASTEST or ringing.silent:
        return ""
    return f"what rings in the sticks is faster than {FASTEST:g} cycles in each, and was not looked for"


def _weighed(observed: Mapping[str, float]) -> dict[str, float]:
    """Probability of each mechanism by multinomial logistic regression."""
    table = _learnt()
    scaled = (columns(observed) - np.array(table["mean"])) / np.array(table["sd"])
    score = np.array(table["weights"]) @ np.append(scaled, 1.0)
    weight = np.exp(score - score.max())
    return {name: float(w / weight.sum()) for name, w in zip(table["names"], weight, strict=True)}


def _unlike(observed: Mapping[str, float], name: str) -> str:
    """In words: what no simulated record of that name was like."""
    table = _learnt()
    kind = table["names"].index(name)
    apart = np.abs((columns(observed) - np.array(table["centres"][kind])) / np.array(table["spreads"][kind]))
    if apart.max() <= STRANGE:
        return ""
    return f"the sticks are unlike those of any simulated contact (by their {table['columns'][int(apart.argmax())]})"


def _undecided(probabilities: Mapping[str, float]) -> str:
    first, second, *_ = sorted(probabilities, key=lambda name: -probabilities[name])
    return f"{first} or {second}" if probabilities[first] < SURE else ""


def _swings_otherwise(ringing: Ringing) -> str:
    """In words: what else than a memory may swing in sticks like these."""
    if ringing.blurred:
        return f"{SWINGING}, or what a smoother leaves of a mount where no load cell helps it"
    if _mount_unknown(ringing) and features(ringing)["glides"] > CHOPPED:
        return f"{SWINGING}, or an accelerometer whose mount rings: {STATE_MOUNT}"
    return ""


def _mount_unknown(ringing: Ringing) -> bool:
    """Whether nothing shows how the accelerometer is mounted: nobody said, and no displacement stands beside it."""
    return ringing.record.channels[ringing.channel].mount is None and "x" not in ringing.record


def not_one_mode(ringing: Ringing) -> str:
    """In words: what swings in the sticks is no ring of a contact, where that is likely; "" otherwise."""
    likely = mechanism_of(ringing).probabilities.get(SWINGING, 0.0)
    if likely < LIKELY:
        return ""
    return f"the sticks swing, but not as one mode ({100 * likely:.0f} %), as no contact rings"


def features(ringing: Ringing) -> dict[str, float]:
    """What the pieces are like, in pure numbers."""
    windows = ringing.windows
    cycle = 2 * math.pi / ringing.pole.imag * ringing.fs
    counts = [len(window.glides) for window in windows]
    rings = [[(piece.last - piece.first) / cycle for piece in window.rings] or [0.0] for window in windows]
    glided = [sum(p.last - p.first for p in window.glides) / len(window.values) for window in windows]
    return {
        "loudness": ringing.loudness,
        "excess": ringing.excess,
        "rest": ringing.rest,
        "noise": ringing.noise / float(np.median([window.values.std() for window in windows])),
        "glides": float(np.mean(counts)),
        "spread": float(np.std(counts)),
        "longest": float(np.median([max(lengths) for lengths in rings])),
        "shortest": float(np.median([min(lengths) for lengths in rings])),
        "damping": -ringing.pole.real / abs(ringing.pole),
        "glided": float(np.mean(glided)),
        "frequency": float(np.median([len(window.values) for window in windows])) / cycle,
    }


COLUMNS = ("loudness", "excess", "gain over rest", "noise", "glides", "any glide", "shortest ring", "short rings",
           "longest ring", "damping", "time glided")  # fmt: skip


def columns(observed: Mapping[str, float]) -> Array:
    """The features as the regression takes them: logarithms and bounds keep single ones from deciding alone.

    Noise counts from where it is larger than the pieces' misfit: less leaves them as they are, and moves no verdict.
    """
    return np.array(
        [
            math.log10(observed["loudness"] + 0.005),
            math.log10(min(max(observed["excess"], 1.0), 10.0)),
            math.log10(min(max(observed["rest"] / max(observed["excess"], 1.0), 1.0), 1e3)),
            math.log10(min(max(observed["noise"], MISFIT), 0.3)),
            min(observed["glides"], 6.0),
            min(observed["glides"], 1.0),
            min(observed["shortest"], 1.0),
            1 / (1 + math.exp((min(observed["shortest"], 1.0) - 0.24) / 0.01)),
            min(observed["longest"], 3.0),
            observed["damping"],
            observed["glided"],
        ]
    )


@functools.cache
def _learnt() -> dict[str, Any]:
    text = resources.files("stickslip").joinpath("data/mechanism.json").read_text("utf-8")
    table: dict[str, Any] = json.loads(text)
    return table


@dataclass(frozen=True, eq=False)
class Window:
    """One stick and its surroundings.

    Attributes
    ----------
    first : int
        Row of the record where the window begins.
    values : ndarray
        The acceleration in it.
    pieces : tuple of Piece
        Glides and rings in turn; rows count from `first`.
    """

    first: int
    values: Array
    pieces: tuple[Piece, ...]

    @property
    def rings(self) -> list[Piece]:
        """The pieces in which the contact rings."""
        return [piece for piece in self.pieces if piece.kind == RING]

    @property
    def glides(self) -> list[Piece]:
        """The glides within the stick: micro-slips."""
        return [piece for piece in self.pieces[1:-1] if piece.kind == GLIDE]


@dataclass(frozen=True, eq=False)
class Ringing:
    """The sticks of a record, each in pieces, and the mode in which the contact rings.

    Attributes
    ----------
    windows : tuple of Window
        One a stick.
    pole : complex
        Decay rate (negative) and angular frequency [rad/s] of the rings.
    noise : float
        Standard deviation of the acceleration's noise.
    excess : float
        Mean square that the pieces leave, over the variance that they were to leave.
    rest : float
        The same, were the mass at rest where it rings.
    sticks : Sticks
        When it sticks, as the velocity tells.
    record : Record
        What was cut: its acceleration is less what a stated mount adds, where that could be taken out.
    channel : str
        The acceleration.
    doubt : str
        What speaks against it, in words; "" where nothing does.
    blurred : bool
        Whether a smoother made it without a load cell: what that leaves may look like a micro-slip.
    """

    windows: tuple[Window, ...]
    pole: complex
    noise: float
    excess: float
    rest: float
    sticks: Sticks
    record: Record
    channel: str
    doubt: str
    blurred: bool

    @property
    def fs(self) -> float:
        """Samples a second."""
        return self.record.fs

    @property
    def status(self) -> str:
        """ "ok", or what to beware of."""
        return Status(self.doubt, self.sticks.status)

    @property
    def loudness(self) -> float:
        """Root mean square of the rings over the range of the acceleration in the windows."""
        rings = [window.values[p.first : p.last] for window in self.windows for p in window.rings]
        span = float(np.median([np.ptp(window.values) for window in self.windows]))
        return float(np.sqrt(np.mean(np.concatenate(rings) ** 2))) / span if rings else 0.0

    @property
    def silent(self) -> bool:
        """Whether the mass rests where it might ring: the rings are no larger than the noise, or than a trifle."""
        return self.rest < QUIET * max(self.excess, 1.0) or self.loudness < FAINT

    def time(self, window: Window, row: float) -> float:
        """Time [s] of a row of a window."""
        return self.record.start + (window.first + row) / self.fs


def find_ringing(
    record: Record, channel: str, *, question: str, mass: Constant | None = None, stiffness: Constant | None = None
) -> Ringing:
    """Cut the acceleration around each stick into glides and rings of one mode.

    Sticks come from ``x`` or ``v`` where the record has them, else from the acceleration's integral. The mode is
    searched on a grid and refined for the least cost of all windows together.
    """
    checked_mass(mass, stiffness)
    record.require_clean(channel, question=question, samples=256)
    if np.ptp(record[channel]) == 0:
        raise EstimateError(
            f"{channel} is constant", "sticks and slips change an acceleration", "choose another channel"
        )
    seen = acceleration_of_mass(record, channel, mass=mass, stiffness=stiffness, question=question)
    record = seen.record
    values, stated = record[channel], record.channels[channel].noise
    alone = not any(name in record for name in ("x", "v"))
    moving = with_velocity(record, channel, question) if alone else record
    sticks = _sticks(moving, question)
    if alone:
        _require_slips(sticks, moving, question)
    spans = _spans(sticks, record, values)
    noise = noise_level(values, record.fs) if stated is None else stated
    trusted = max(noise, MISFIT * float(values.std()))
    centred = values - _zero(values, sticks, record)
    windows = [centred[first:last] for first, last in spans]
    pole = _pole(windows, record.fs, trusted, sticks)
    shortest, pieces, left, rest, count = _shortest(pole, record.fs), [], 0.0, 0.0, sum(map(len, windows))
    for few in range(0, len(windows), AT_ONCE):
        splitter = Splitter(windows[few : few + AT_ONCE], trusted**2, PENALTY)
        cuts = splitter.split(pole / record.fs, shortest)
        pieces += cuts
        left += float(splitter.cost(pole / record.fs, shortest).sum()) - PENALTY * sum(map(len, cuts))
        rest += float(splitter.cost(0.0, shortest).sum()) - PENALTY * sum(map(len, splitter.split(0.0, shortest)))
    doubt, rings = seen.doubt, pole.imag / (2 * math.pi)
    if rings > seen.fastest:
        doubt = doubt or f"what rings at {rings:.3g} Hz may be left of a mount, where no load cell helps to take it out"
    cut = tuple(Window(first, v, p) for (first, _), v, p in zip(spans, windows, pieces, strict=True))
    return Ringing(cut, pole, noise, left / count, rest / count, sticks, record, channel, doubt, seen.blurred)


def checked_mass(mass: Constant | None, stiffness: Constant | None) -> tuple[float | None, float]:
    """Mass [kg] and spring [N/m] as numbers, 0 for no spring; refused where they are none of a mass and a spring."""
    kilograms = Estimate.stated("mass", mass, "kg").value if mass is not None else None
    spring = Estimate.stated("stiffness", stiffness, "N/m").value if stiffness is not None else 0.0
    if not (kilograms is None or 0 < kilograms < math.inf) or not 0 <= spring < math.inf:
        raise EstimateError(
            f"mass = {mass}, stiffness = {stiffness}",
            "a mass is positive, a spring not negative",
            "give the mass in kg and the spring in N/m",
        )
    return kilograms, spring


def with_velocity(record: Record, channel: str, question: str) -> Record:
    """The record's acceleration alone, with its integral ``v``, whose drift is taken off as its mean over a cycle."""
    values, fs = record[channel], record.fs
    level = values - values.mean()
    velocity = np.concatenate([[0.0], np.cumsum((level[1:] + level[:-1]) / 2)]) / fs
    frequency = forcing_frequency(velocity, fs).value  # harmonics are weaker in it than in the acceleration
    cycle = fs / frequency
    if cycle > len(values) / 3:
        raise EstimateError(
            f"no transition: the motion that {channel} integrates to, strongest at {frequency:.4g} Hz, has "
            f"{len(values) / cycle:.3g} cycles",
            f"three cycles at least tell {question} from an acceleration alone, and noise has no cycle",
            "give a longer record, or one with x or v",
        )
    if cycle < 32:
        raise EstimateError(
            f"no transition: the strongest line of {channel}, {frequency:.4g} Hz, has {cycle:.3g} samples a cycle",
            f"32 samples at least tell {question} from an acceleration alone",
            "record at a higher rate, or give x or v",
        )
    total = np.concatenate([[0.0], np.cumsum((velocity[1:] + velocity[:-1]) / 2)])
    rows = np.arange(math.ceil(cycle / 2), len(values) - math.ceil(cycle / 2))
    about = [np.interp(rows + side * cycle / 2, np.arange(len(values)), total) for side in (-1, 1)]
    slow = (about[1] - about[0]) / cycle
    kept = record.rows(int(rows[0]), int(rows[-1]) + 1)
    return Record.of({channel: kept[channel], "v": velocity[rows] - slow}, fs=fs, start=kept.start)


def _sticks(record: Record, question: str) -> Sticks:
    try:
        sticks = find_sticks(record, method="speed")  # windows are as wide as it says
    except EstimateError as error:
        raise EstimateError(f"no transition: {error.value}", error.rule, error.next_step) from error
    if not any(event.kind == "stick" and event.whole for event in sticks.events):
        raise EstimateError(
            "no transition: the record holds no whole stick",
            f"what a contact does while the mass sticks tells {question}",
            "give a record in which it sticks and slips",
        )
    return sticks


def _require_slips(sticks: Sticks, record: Record, question: str) -> None:
    """A blow's ringing fades to rest as a slip does to a stick; but a slip goes one way, and ringing swings."""
    rows = np.flatnonzero(np.abs(record["v"]) > sticks.threshold)
    turns = rows[1:][np.diff(np.sign(record["v"][rows])) != 0] / record.fs + record.start
    moves = [event for event in sticks.events if event.kind == "slip"]
    many = [np.sum((turns > move.time) & (turns < move.time + move.duration)) for move in moves]
    swinging = sum(move.duration for move, count in zip(moves, many, strict=True) if count >= SWINGS)
    if swinging > 0.5 * sum(move.duration for move in moves):
        raise EstimateError(
            f"no transition: between its rests the mass swings to and fro, up to {max(many)} times",
            f"sticks that a slip leads to tell {question}, and a slip goes one way; ringing that fades, as after a "
            "blow, sticks nowhere",
            "give a record in which it sticks and slips, or x or v beside it",
        )


def _spans(sticks: Sticks, record: Record, values: Array) -> list[tuple[int, int]]:
    """Rows around each whole stick; none where slips are so short that windows would overlap."""
    spans = []
    for event in sticks.events:
        if event.kind != "stick" or not event.whole:
            continue
        begin, long = (event.time - record.start) * record.fs, event.duration * record.fs
        first, last = math.floor(begin - LEAD * long), math.ceil(begin + (1 + LAG) * long)
        if first >= 0 and last <= len(values) and last - first >= 24:
            spans.append((first, last))
    if not spans:
        raise EstimateError(
            "no transition: no stick has its surroundings in the record, in 24 samples at least",
            "the pieces of a stick are told apart within it",
            "give a longer record, or one at a higher rate",
        )
    return spans


def _zero(values: Array, sticks: Sticks, record: Record) -> float:
    """The accelerometer's reading of no acceleration: the median of the cycles' means, spared by a start from rest."""
    cycle = record.fs / sticks.frequency.value if sticks.frequency.value > 0 else len(values)
    rows = np.arange(len(values))
    total = np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2)])
    gained = np.diff(np.interp(np.arange(0, len(values) - 1, cycle), rows, total))
    return float(np.median(gained) / cycle) if len(gained) else float(values.mean())


def _shortest(pole: complex, fs: float) -> int:
    return max(5, round(SETTLED * 2 * math.pi / pole.imag * fs))


def _pole(windows: list[Array], fs: float, noise: float, sticks: Sticks) -> complex:
    """The mode that leaves the least cost, on averaged samples."""
    from scipy import optimize

    minimize: Any = optimize.minimize
    block = max(1, int(np.median([len(values) for values in windows])) // COARSE)
    short = [values[: len(values) // block * block].reshape(-1, block).mean(axis=1) for values in windows]
    durations = [event.duration for event in sticks.events if event.kind == "stick" and event.whole]
    rate, variance, long = fs / block, noise**2 / block, float(np.median(durations))

    def cost(splitter: Splitter, frequency: float, damping: float) -> float:
        if not (lowest <= frequency <= highest and 0 <= damping < 0.9):
            return FORBIDDEN
        shortest = max(3, round(SEARCHED / frequency * rate))
        return float(splitter.cost(_mode(frequency, damping) / rate, shortest).sum())

    def of_pole(parameters: Any) -> Any:
        return cost(some, math.exp(parameters[0]), float(parameters[1]))

    lowest, highest = FREQUENCIES[0] / long, min(FREQUENCIES[-1] / long, rate / 5)
    few = Splitter(short[:: max(1, len(short) // 6)][:6], variance, PENALTY)
    grid = [(cost(few, f, z), f, z) for f in FREQUENCIES / long if f <= highest for z in DAMPINGS]
    if not grid:
        raise EstimateError(
            f"no transition: half of the sticks last less than {1e3 * long:.3g} ms among others far longer",
            "a ring needs a cycle in a stick, and five samples in that",
            "give a part of the record whose sticks are alike, or one at a higher rate",
        )
    some = Splitter(short[:: max(1, len(short) // 16)][:16], variance, PENALTY)
    tried = []
    for _, f, z in sorted(grid)[:STARTS]:
        corners = np.array([(math.log(f), z), (math.log(f) + 0.05, z), (math.log(f), 1.4 * z + 0.01)])
        options: dict[str, Any] = {"xatol": 5e-4, "fatol": 0.2, "maxiter": 40, "initial_simplex": corners}
        tried.append(minimize(of_pole, corners[0], method="Nelder-Mead", options=options))
    root = min(tried, key=lambda fit: float(fit.fun)).x
    return _mode(math.exp(root[0]), float(root[1]))


def _mode(frequency: float, damping: float) -> complex:
    """Pole of a mode from its damped frequency [Hz] and damping ratio."""
    turn = 2 * math.pi * frequency
    return complex(-damping * turn / math.sqrt(1 - damping**2), turn)
