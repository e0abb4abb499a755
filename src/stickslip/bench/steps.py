"""The steps of commissioning: what to do, how long to record, and the question that the record answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stickslip.balance.impact import impact_test
from stickslip.bench.calibration import calibrate, spring_by_weights
from stickslip.bench.discharge import discharge_test
from stickslip.bench.free import free_vibration, onto_stick
from stickslip.bench.known import Known
from stickslip.bench.response import modal_fit
from stickslip.bench.rest import at_rest
from stickslip.errors import ModelError
from stickslip.estimate import Result
from stickslip.record.record import Record
from stickslip.rig.rig import Rig
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
