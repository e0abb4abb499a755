"""The steps of commissioning: what to do at each, the question that its record answers, and the walk through them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.balance.impact import ImpactTest, impact_test
from stickslip.balance.mounts import ACCELEROMETER, CELL, Resonance
from stickslip.bench.calibration import Calibration, SpringByWeights, calibrate, spring_by_weights
from stickslip.bench.free import (
    FreeVibration,
    MassAndSpring,
    OntoStick,
    added_mass,
    best_constants,
    damper_of,
    free_vibration,
    onto_stick,
)
from stickslip.bench.response import ModalFit, modal_fit
from stickslip.bench.rest import AtRest, DischargeTest, at_rest, discharge_test
from stickslip.errors import ABSENT, EstimateError, ModelError, RecordError
from stickslip.estimate import Estimate, Result
from stickslip.files.expression import split_spec
from stickslip.record.record import Record, Step
from stickslip.rig.rig import Rig
from stickslip.rig.settings import CommissionSettings, RigSettings, rig_settings, rig_toml
from stickslip.settings import nearest
from stickslip.signals.repair import fill_missing
from stickslip.units import parse_unit
from stickslip.whole import whole_file

CALIBRATIONS = {"gauge-x": "x", "gauge-z": "z", "turn": "a", "weigh": "load"}  # step -> channel
# Of a channel's samples, that may be lost and bridged: a hundredth leaves noise and level as they are within a percent.
BRIDGED = 0.01
STANDS_ON = {"a": ACCELEROMETER, "load": CELL}


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
        Results by step, constants, and :meth:`~stickslip.bench.steps.Known.toml`.
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
    answered: Callable[[BenchStep, Result | str], None] | None = None,
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
    answered : callable, optional
        Called with each step and its result, or why it was refused.

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
            known = known.having(step.name, step.ask(_bridged(record), known))
        except (EstimateError, RecordError) as error:
            if error.kind == ABSENT:  # what is asked wrongly ends all
                raise
            refused[step.name] = str(error)
        if answered is not None:
            answered(step, refused.get(step.name) or known.results[step.name])
    return Commissioned(known, refused, truth or {})


def _bridged(record: Record) -> Record:
    """The record with the few samples filled that its device lost; more than a few are left to the step's refusal."""
    lost = {name: float(np.mean(~np.isfinite(record[name]))) for name in record}
    few = [name for name, share in lost.items() if 0 < share <= BRIDGED]
    return fill_missing(record, *few) if few else record


# ---- what is known of the rig


@dataclass(frozen=True)
class Known:
    """What is known of a rig while it is commissioned.

    Attributes
    ----------
    rig : RigSettings
        What was stated before.
    results : mapping of str to Result
        By step.
    """

    rig: RigSettings = field(default_factory=RigSettings)
    results: Mapping[str, Result] = field(default_factory=dict)

    @property
    def at_hand(self) -> CommissionSettings:
        """Weights, gauge blocks and the mass that is added."""
        return self.rig.commission or CommissionSettings()

    def of(self, step: str, kind: type[Any]) -> Any:
        """The result of a step, or None."""
        result = self.results.get(step)
        return result if isinstance(result, kind) else None

    def having(self, step: str, result: Result) -> Known:
        """With one more result."""
        return replace(self, results={**self.results, step: result})

    # ---- sensors

    @property
    def mounts(self) -> dict[str, Resonance | tuple[float, float]]:
        """What the sensors stand on, by channel: as a tap found it, else as stated."""
        known: dict[str, Resonance | tuple[float, float]] = {
            name: sensor.mount for name, sensor in self.rig.sensors.items() if sensor.mount is not None
        }
        tap = self.of("tap", ImpactTest)
        for channel, name in STANDS_ON.items():
            for resonance in tap.resonances if tap is not None and tap.status == "ok" else ():
                if resonance.name == name:
                    known[channel] = resonance
        return known

    def gain(self, channel: str) -> Estimate | None:
        """Reading over truth of a channel, where it was calibrated."""
        calibrations = [self.of(step, Calibration) for step, name in CALIBRATIONS.items() if name == channel]
        return next((calibration.gain for calibration in calibrations if calibration is not None), None)

    def zero(self, channel: str) -> float:
        """What a channel reads at rest; 0 where that was not asked."""
        rest = self.of("rest", AtRest)
        if rest is None or channel not in rest.sensors or rest.sensors[channel].zero.includes(0.0):
            return 0.0
        return float(rest.sensors[channel].zero.value)

    def corrected(self, record: Record) -> Record:
        """A record with zeros taken off and gains set right, as far as they are known; their doubt in ``gain_sd``."""
        samples, applied = dict(record.samples), {}
        for name in record:
            gain, zero = self.gain(name), self.zero(name)
            if gain is None and not zero:
                continue
            samples[name] = (record[name] - zero) / (gain.value if gain else 1.0)
            applied[name] = {"zero": zero, "gain": gain.value if gain else 1.0}
            if gain:
                record = record.with_details(name, gain_sd=gain.spread / abs(gain.value))
        if not applied:
            return record
        return record.with_samples(samples, Step("corrected", applied, "zero and gain by commissioning"))

    # ---- constants

    @property
    def constants(self) -> MassAndSpring | None:
        """Mass and spring that agree best with what was measured of them; None before there is enough."""
        free = self.of("free", FreeVibration)
        masses = [Estimate.stated("mass", self.rig.mass, "kg")] if self.rig.mass is not None else []
        spring = self.of("spring", SpringByWeights)
        if free is None:
            return self._stated
        loaded = self.of("added", FreeVibration)
        if loaded is not None:
            masses.append(added_mass(free.frequency, loaded.frequency, self.at_hand.added).mass)
        springs = [spring.stiffness] if spring is not None else []
        if self.rig.stiffness is not None and spring is None:
            springs.append(Estimate.stated("spring stiffness", self.rig.stiffness, "N/m"))
        return best_constants(free.frequency, masses=masses, springs=springs) if masses or springs else None

    @property
    def _stated(self) -> MassAndSpring | None:
        if self.rig.mass is None or self.rig.stiffness is None:
            return None
        pair = (("mass", self.rig.mass, "kg"), ("spring stiffness", self.rig.stiffness, "N/m"))
        mass, spring = (Estimate.stated(*arguments) for arguments in pair)
        return MassAndSpring(mass, spring, "ok")

    def require_constants(self) -> MassAndSpring:
        """Mass and spring, or a refusal that says what to do first.

        Raises
        ------
        EstimateError
            Neither is known yet.
        """
        if self.constants is not None:
            return self.constants
        raise EstimateError(
            "mass and spring are not known yet",
            "they come from a free vibration, with weights on the spring or an added mass",
            "do the steps free and spring first, or state mass in rig.toml",
        )

    @property
    def damping(self) -> Estimate | None:
        """Of the suspension [N s/m], by the damping ratio of the free vibration."""
        free, known = self.of("free", FreeVibration), self.constants
        return None if free is None or known is None else damper_of(free.damping_ratio, known)

    # ---- rig.toml

    def settings(self) -> dict[str, Any]:
        """What ``rig.toml`` is to say, as plain data: stated before, and found now."""
        settings = self.rig.model_dump(exclude_unset=True)
        known, damping = self.constants, self.damping
        if known is not None:
            settings |= {"mass": _pm(known.mass), "stiffness": _pm(known.stiffness)}
        if damping is not None:
            settings["damping"] = _pm(damping)
        if channels := self._channels():
            settings["channels"] = {**settings.get("channels", {}), **channels}
        sensors = self._sensors()
        if sensors:
            settings["sensors"] = {**settings.get("sensors", {}), **sensors}
        return settings

    def _channels(self) -> dict[str, str]:
        """The channel map with zeros and gains."""
        rest, made = self.of("rest", AtRest), {}
        for name in rest.sensors if rest is not None else CALIBRATIONS.values():
            gain = self.gain(name)
            if gain is None and rest is None:
                continue
            unit = rest.sensors[name].zero.unit if rest is not None else {"a": "m/s^2", "load": "N"}.get(name, "m")
            made[name] = _channel(self.rig.channels.get(name, f"{name} [{unit}]"), self.zero(name), gain)
        return made

    def _sensors(self) -> dict[str, dict[str, Any]]:
        tables: dict[str, dict[str, Any]] = {}
        rest, free = self.of("rest", AtRest), self.of("free", FreeVibration)
        for name, sensor in rest.sensors.items() if rest is not None else ():
            gain = self.gain(name)
            tables.setdefault(name, {})["noise"] = _short(sensor.noise.value / abs(gain.value if gain else 1.0))
        for name, mount in self.mounts.items():
            pair = mount if isinstance(mount, tuple) else (mount.frequency.value, mount.damping.value)
            tables.setdefault(name, {})["mount"] = [f"{pair[0]:.5g} Hz", _short(pair[1])]
        late = free.delays.get("a") if free is not None else None
        if late is not None:
            tables.setdefault("x", {})["delay"] = f"{late.value:.5g} s"
            modal = self.of("sweep", ModalFit)
            if modal is not None:
                tables.setdefault("z", {})["delay"] = f"{late.value - modal.delay.value:.5g} s"
        if free is not None and free.inertia is not None and free.inertia.interval[0] > 0:
            tables.setdefault("load", {})["inertia"] = f"{free.inertia.value:.5g} kg"
        leak = self.of("discharge", DischargeTest)
        if leak is not None and math.isfinite(leak.time_constant.value):
            tables.setdefault("load", {})["discharge"] = f"{leak.time_constant.value:.5g} s"
        return tables

    def toml(self) -> str:
        """The text of ``rig.toml``; read back, it is what :meth:`settings` says.

        Raises
        ------
        ModelError
            What was found can not be stated.
        """
        settings = self.settings()
        rig_settings(settings, source="what commissioning found")
        notes = ["# Written by stickslip commission: values with their standard uncertainty.", *self._notes()]
        return "\n".join([*notes, "", *rig_toml(settings)]) + "\n"

    def write(self, path: Path) -> None:
        """Write that text, whole or not at all.

        Raises
        ------
        ModelError
            What was found can not be stated.
        OSError
            The disk can not be written.
        """
        text = self.toml()
        with whole_file(path) as draft:
            draft.write_text(text, encoding="utf-8")

    def _notes(self) -> list[str]:
        stick = self.of("stick", OntoStick)
        if stick is None:
            return []
        return [f"# {estimate}" for estimate in (stick.frequency, stick.stiffness)]


def _channel(stated: str, zero: float, gain: Estimate | None) -> str:
    """The column of a channel with its zero taken off and its gain set right.

    A zero is written in the column's unit; behind a sensitivity, whose column is in volts, it is left out.
    """
    spec = split_spec(stated)
    arithmetic, unit = spec.arithmetic, f" [{spec.unit}]" if spec.unit else ""
    if zero and not spec.sensitivity:
        own = zero / parse_unit(spec.unit).scale if spec.unit else zero
        arithmetic = f"({arithmetic} {'-' if own > 0 else '+'} {abs(own):.6g})"
    if gain is None:
        return f"{arithmetic}{unit}" + (f" @ {spec.sensitivity}" if spec.sensitivity else "")
    tail = f" @ {spec.sensitivity}" if spec.sensitivity else ""
    percent = 100 * gain.spread / abs(gain.value)
    arithmetic = arithmetic if arithmetic.startswith("(") or arithmetic.isidentifier() else f"({arithmetic})"
    return f"{arithmetic} / {gain.value:.8g}{unit}{tail} ± {percent:.2g} %"


def _pm(estimate: Estimate) -> str:
    """Value and standard uncertainty, as the settings read them."""
    within = max(estimate.sd, 1e-12 * abs(estimate.value))
    digits = max(2, 2 + math.ceil(math.log10(max(1.0, abs(estimate.value) / within))))
    return f"{estimate.value:.{min(digits, 12)}g} ± {estimate.sd:.2g} {estimate.unit}"


def _short(value: float) -> float:
    return float(f"{value:.5g}")
