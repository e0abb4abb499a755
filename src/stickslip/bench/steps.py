"""The steps of commissioning: what to do at each, the question that its record answers, and the walk through them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from stickslip.balance.impact import impact_test
from stickslip.bench.calibration import calibrate, spring_by_weights
from stickslip.bench.free import free_vibration, onto_stick
from stickslip.bench.known import Known
from stickslip.bench.response import modal_fit
from stickslip.bench.rest import at_rest, discharge_test
from stickslip.errors import EstimateError, ModelError, RecordError
from stickslip.estimate import Estimate, Result
from stickslip.record.record import Record
from stickslip.rig.rig import Rig
from stickslip.rig.settings import RigSettings
from stickslip.settings import nearest


@dataclass(frozen=True)
class BenchStep:
    """One step of commissioning.

    Attributes
    ----------
    name : str
        As the command line calls it, and its record's file.
    title : str
        What is asked.
    todo : str
        What to do at the rig.
    needs : tuple of str
        Channels without which it is left out.
    seconds : float
        How long to record.
    ask : callable
        The question: a record and what is known so far make the result.
    arrangement : str
        What the simulated bench is asked for.
    drives : bool
        Whether the shaker moves.
    """

    name: str
    title: str
    todo: str
    needs: tuple[str, ...]
    seconds: float
    ask: Callable[[Record, Known], Result]
    arrangement: str
    drives: bool = False

    def fits(self, rig: Rig) -> bool:
        """Whether a rig has the sensors that it needs."""
        return set(self.needs) <= {sensor.channel for sensor in rig.sensors}


def _gauge(channel: str) -> Callable[[Record, Known], Result]:
    def ask(record: Record, known: Known) -> Result:
        hand = known.at_hand
        return calibrate(record, channel=channel, reference=hand.gauges, reference_sd=hand.gauges_sd)

    return ask


def _turn(record: Record, known: Known) -> Result:
    return calibrate(record, channel="a", reference=known.at_hand.turns)


def _weigh(record: Record, known: Known) -> Result:
    hand = known.at_hand
    return calibrate(record, channel="load", reference=hand.weights, reference_sd=hand.weights_sd, leaks=True)


def _spring(record: Record, known: Known) -> Result:
    hand = known.at_hand
    return spring_by_weights(known.corrected(record), weights=hand.weights, weights_sd=hand.weights_sd)


def _tap(record: Record, known: Known) -> Result:
    return impact_test(known.corrected(record), mass=known.rig.mass)


def _free(record: Record, known: Known) -> Result:
    return free_vibration(known.corrected(record), mounts=known.mounts)


def _sweep(record: Record, known: Known) -> Result:
    constants = known.constants
    damper = known.rig.damper
    return modal_fit(known.corrected(record), mass=constants.mass if constants else None, damper=damper)


def _stick(record: Record, known: Known) -> Result:
    constants = known.require_constants()
    return onto_stick(known.corrected(record), mass=constants.mass, stiffness=constants.stiffness)


STEPS = (
    BenchStep(
        "rest", "What do the sensors read at rest?",
        "Contact off, base held, air on. Touch nothing while it records.",
        (), 10.0, lambda record, known: at_rest(record), "rest",
    ),
    BenchStep(
        "gauge-x", "How sensitive is the displacement sensor?",
        "Move the mass by the gauge blocks, one after another; hold each still for two seconds.",
        ("x",), 18.0, _gauge("x"), "gauge",
    ),
    BenchStep(
        "gauge-z", "How sensitive is the base's sensor?", "The same for the base.", ("z",), 18.0, _gauge("z"), "gauge"
    ),
    BenchStep(
        "turn", "How sensitive is the accelerometer?",
        "Turn the accelerometer in gravity: level, up, level, down, level ...; hold each for two seconds.",
        ("a",), 18.0, _turn, "turn",
    ),
    BenchStep(
        "weigh", "How sensitive is the load cell?",
        "Put the weights on the cell, one after another; hold each for two seconds.",
        ("load",), 18.0, _weigh, "weigh",
    ),
    BenchStep(
        "discharge", "How fast does the load cell forget?",
        "After ten seconds of rest put a weight on the cell, and leave it there.",
        ("load",), 60.0, lambda record, known: discharge_test(known.corrected(record)), "discharge",
    ),
    BenchStep(
        "spring", "How stiff is the spring?",
        "Contact off. Hang the weights on the mass, one after another; hold each for two seconds.",
        ("x",), 18.0, _spring, "spring",
    ),
    BenchStep(
        "tap", "Which mounts ring?",
        "Base held, contact pressed hard. Tap the mass once with a small hammer.", ("a",), 0.5, _tap, "tap",
    ),
    BenchStep(
        "free", "How does the mass swing freely?",
        "Contact off, base held. Pull the mass out by some millimetres and let it go.", ("x",), 20.0, _free, "free",
    ),
    BenchStep(
        "added", "How does it swing with an added mass?",
        "The same with the added mass fixed on.", ("x",), 20.0, _free, "added",
    ),
    BenchStep(
        "sweep", "How does it answer the base?",
        "Contact off. Sweep the base from 1.5 to 20 Hz in a minute, with 0.2 mm.",
        ("x", "z"), 60.0, _sweep, "sweep", True,
    ),
    BenchStep(
        "stick", "How stiff is the contact?",
        "Contact on, base held. Pull the mass out so far that it turns once or twice, let it go, and let it stick.",
        ("x", "a"), 2.0, _stick, "stick",
    ),
)  # fmt: skip


def step_named(name: str) -> BenchStep:
    """The step of that name.

    Raises
    ------
    ModelError
        There is none.
    """
    names = [step.name for step in STEPS]
    for step in STEPS:
        if step.name == name:
            return step
    raise ModelError(f"no step '{name}'", f"there are {', '.join(names)}", nearest(name, names))


@dataclass(frozen=True, repr=False)
class Commissioned(Result):
    """A rig that was commissioned.

    Attributes
    ----------
    known : Known
        Results by step, constants, and :meth:`~stickslip.bench.known.Known.toml`.
    refused : mapping of str to str
        Steps that could not be answered, and why.
    truth : mapping of str to float
        True values by the names of estimates, of a simulated rig.
    """

    known: Known
    refused: Mapping[str, str]
    truth: Mapping[str, float] = field(default_factory=dict)

    @property
    def results(self) -> Mapping[str, Result]:
        """By step."""
        return self.known.results

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The constants of the rig, then the numbers of every step."""
        known = self.known
        constants = known.constants
        first = [*(constants.estimates if constants else ()), *([known.damping] if known.damping else [])]
        return (*first, *(estimate for result in self.results.values() for estimate in result.estimates))

    def true_value(self, name: str, step: str = "") -> float | None:
        """The true value behind an estimate of a step, of a simulated rig."""
        return self.truth.get(f"{step}: {name}", self.truth.get(name))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        steps = {name: [estimate.to_dict() for estimate in result.estimates] for name, result in self.results.items()}
        constants = self.known.constants
        own = [estimate.to_dict() for estimate in constants.estimates] if constants else []
        return {"constants": own, "steps": steps, "refused": dict(self.refused), "truth": dict(self.truth)}


def commission(
    source: Callable[[BenchStep], Record | None],
    *,
    rig: RigSettings | None = None,
    steps: Sequence[BenchStep] = STEPS,
    truth: Mapping[str, float] | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Commissioned:
    """Which constants, and which sensors, does a rig have?

    Every step is a question to a record of its own: the sensors at rest, against gauge blocks, weights and gravity, the
    discharge of the load cell, the spring under weights, a tap, free vibrations without and with an added mass, a
    sweep, a free vibration onto a stick. What a step finds is used by those after it: gains and zeros set its record
    right, mounts are not taken for delays. A step that is refused is told, and the others go on.

    Parameters
    ----------
    source : callable
        Gives the record of a step, as the acquisition, a file or a :class:`SimulatedBench` does; None leaves it out.
    rig : RigSettings, optional
        What is known before: constants, columns, weights and gauge blocks.
    steps : sequence of BenchStep
        Which, in order.
    truth : mapping, optional
        True values by the names of estimates.
    progress : callable, optional
        Called with words and the number of steps that are done.

    Returns
    -------
    Commissioned

    Examples
    --------
    >>> from stickslip.bench import STEPS, SimulatedBench, commission
    >>> bench = SimulatedBench(fs=1000)
    >>> steps = [step for step in STEPS if step.name in ("rest", "weigh", "discharge")]
    >>> done = commission(bench.step, steps=steps)
    >>> done.results["discharge"].time_constant.includes(50.0)
    True
    """
    known, refused = Known(rig or RigSettings()), {}
    for number, step in enumerate(steps):
        if progress is not None:
            progress(step.title, number)
        try:
            record = source(step)
            if record is None or any(name not in record for name in step.needs):
                continue
            known = known.having(step.name, step.ask(record, known))
        except (EstimateError, RecordError) as error:  # what is asked wrongly ends all
            refused[step.name] = str(error)
    return Commissioned(known, refused, truth or {})
