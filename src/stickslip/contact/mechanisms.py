"""Which mechanism do the sticks show? The features of their ringing, weighed as simulated records taught."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stickslip.contact.ringing import MISFIT, Ringing, checked_mass, find_ringing
from stickslip.errors import EstimateError
from stickslip.estimate import Constant, Plain
from stickslip.record.record import Record

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


def columns(observed: Mapping[str, float]) -> NDArray[np.float64]:
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
