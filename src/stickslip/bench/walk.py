"""Commissioning: one step after another, each a question to its record; at the end a rig.toml."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from stickslip.bench.known import Known
from stickslip.bench.steps import STEPS, BenchStep
from stickslip.errors import EstimateError, RecordError
from stickslip.estimate import Estimate, Result
from stickslip.record.record import Record
from stickslip.rig.settings import RigSettings

BESIDE = "not asked"


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
        return (*first, *(each for result in self.results.values() for each in result.estimates))

    def true_value(self, name: str, step: str = "") -> float | None:
        """The true value behind an estimate of a step, of a simulated rig."""
        return self.truth.get(f"{step}: {name}", self.truth.get(name))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        steps = {
            name: [each.to_dict() for each in result.estimates] for name, result in self.results.items()
        }  # fmt: skip
        constants = self.known.constants
        own = [each.to_dict() for each in constants.estimates] if constants else []
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
