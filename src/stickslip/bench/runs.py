"""Run lists: what is to be measured next, and which runs would tell most about the law that is left open."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, ValidationInfo

from stickslip.arrays import Array
from stickslip.drives.kinds import HarmonicBase
from stickslip.errors import EstimateError, ModelError, StickslipError
from stickslip.oscillator import Oscillator
from stickslip.rig.rig import Shaker
from stickslip.settings import STRICT, checked, quantity, read_toml
from stickslip.solve.simulate import simulate
from stickslip.solve.tables import require_oscillator

SHARES = (1.0, 0.5, 0.25)  # of the largest amplitude that are tried
FREQUENCIES = 10  # that are tried, evenly on a logarithmic scale
HIGHEST = 2.5  # times the natural frequency, up to which is tried: above, the mass hardly moves
CYCLES, READ, POINTS = 24, 4, 64  # of the drive that are run, those at the end that are read, and points in each
NUDGE = 0.01  # of a parameter, by which its effect is told
APART = 0.15  # of a frequency, and of an amplitude, by which proposals are different
GAIN_SD = 0.01  # by which a sensor's gain may be wrong: what it explains tells no law from another


def _amplitude_of(value: object, info: ValidationInfo) -> object:
    """A number, or text with its own unit, in the unit of what moves."""
    return quantity("N" if info.data.get("on") == "force" else "m").func(value)  # type: ignore[call-arg]


class Run(BaseModel):
    """One run to record.

    Attributes
    ----------
    name : str
        Of its file.
    frequency, amplitude : float
        Of the output's tone [Hz], [m] or [N].
    seconds : float
        How long to record.
    on : {"base", "force"}
        What moves.
    why : str
        For what it was chosen.
    """

    model_config = STRICT

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+$")]
    frequency: Annotated[float, quantity("Hz"), Field(gt=0)]
    on: Literal["base", "force"] = "base"  # before the amplitude, whose unit it tells
    amplitude: Annotated[float, BeforeValidator(_amplitude_of), Field(ge=0)]
    seconds: Annotated[float, quantity("s"), Field(gt=0)] = 20.0
    why: str = ""


def _of_names(runs: tuple[Run, ...]) -> tuple[Run, ...]:
    names = [run.name for run in runs]
    if twice := next((name for name in names if names.count(name) > 1), ""):
        raise ValueError(f"two runs are called {twice}, and each is recorded into a file of its name")
    return runs


class RunList(BaseModel):
    """Runs to record, one after another.

    Attributes
    ----------
    run : tuple of Run
        ``[[run]]`` tables of a file.
    """

    model_config = STRICT

    run: Annotated[tuple[Run, ...], AfterValidator(_of_names)]

    def toml(self) -> str:
        """As the text of a file that ``stickslip acquire --runs`` reads."""
        lines = ["# Runs to record: stickslip acquire --device NAME --runs THIS.toml --output FOLDER"]
        for run in self.run:
            lines += ["", "[[run]]", f'name = "{run.name}"', f"frequency = {run.frequency!r}  # Hz"]
            lines += [f"amplitude = {run.amplitude!r}", f"seconds = {run.seconds!r}", f'on = "{run.on}"']
            lines += [f'why = "{run.why}"'] if run.why else []
        return "\n".join(lines) + "\n"


def read_runs(path: str | Path) -> RunList:
    """Read a run list from a TOML file.

    Parameters
    ----------
    path : path
        With a ``[[run]]`` table for each: name, frequency, amplitude, seconds, on.

    Returns
    -------
    RunList

    Raises
    ------
    ModelError
        The file can not be read, or a value has no meaning.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "runs.toml"
    >>> _ = path.write_text('[[run]]\\nname = "slow"\\nfrequency = "2.5 Hz"\\namplitude = 0.65e-3')
    >>> read_runs(path).run[0].frequency
    2.5
    """
    values, lines = read_toml(Path(path), what="a run list is")
    return checked(RunList, values, source=Path(path).name, lines=lines)


@dataclass(frozen=True)
class Proposal:
    """A run that would tell laws apart.

    Attributes
    ----------
    frequency, amplitude : float
        Of the base [Hz, m].
    separation : float
        By how much the two laws that it tells least apart differ in the displacement, in standard deviations of the
        noise of one sample, after what fitted parameters and gains could take up of it.
    bound : str
        Which limit of the shaker the amplitude reaches ("stroke" ...); empty where none.
    pair : tuple of str
        Those two laws.
    """

    frequency: float
    amplitude: float
    separation: float
    bound: str
    pair: tuple[str, str]

    @property
    def why(self) -> str:
        """What it would tell, in words."""
        one, other = self.pair
        return f"tells {one} from {other} by {self.separation:.3g} standard deviations a sample"


def next_runs(
    laws: Mapping[str, object],
    *,
    shaker: Shaker | None = None,
    noise: float = 1e-6,
    largest: float = 10e-3,
    count: int = 3,
    done: Sequence[tuple[float, float]] = (),
) -> tuple[Proposal, ...]:
    r"""Which frequency and amplitude of the base would tell most about the law that is left open?

    For each motion that the shaker can make, the steady answers of all laws are simulated. What two laws differ in is
    less than it seems, as each could be fitted anew: the difference is projected off the effects of the one's
    parameters and of the sensor's gain, and what is left, over the noise,

    .. math:: T = \min_{i<j} \; \frac{1}{\sigma} \min_\theta
              \sqrt{\frac{1}{n} \sum_k \left( x_i - x_j - J_i \theta \right)_k^2} ,

    is the criterion of T-optimality, linearised (Atkinson and Fedorov, Biometrika 62 (1975) 57-70). The runs with the
    largest T are proposed, those that are nearly a run made already left out.

    Parameters
    ----------
    laws : mapping of str to Oscillator
        The oscillator with each law that is left, its fitted values in it, as ``compare_laws(...).candidates`` hold.
    shaker : Shaker, optional
        What it can do; the thesis's where left out.
    noise : float
        Of the displacement [m].
    largest : float
        Range of the displacement's sensor [m]; what would leave it is not proposed.
    count : int
        How many runs.
    done : sequence of (float, float)
        Frequencies [Hz] and amplitudes [m] that were measured already.

    Returns
    -------
    tuple of Proposal
        The best first.

    Raises
    ------
    ModelError
        Noise or count without meaning, or what is no oscillator.
    EstimateError
        Fewer than two laws, or none of the motions can be simulated.

    Examples
    --------
    >>> import stickslip as ss
    >>> slider = ss.Oscillator(mass=2.42, stiffness=2310, damping=0.12, law=ss.laws.Coulomb(1.1))
    >>> soft = replace(slider, law=ss.laws.CompliantContact(1.1, stiffness=60e3, damping=10.0))
    >>> best = next_runs({"rigid": slider, "compliant": soft}, count=1)[0]
    >>> 1.0 <= best.frequency <= 12.5, best.separation > 1
    (True, True)
    """
    if len(laws) < 2:
        raise EstimateError(f"{len(laws)} laws", "a run is chosen to tell two laws apart", "give those that are left")
    if not noise > 0 or count < 1:
        raise ModelError(f"noise = {noise}, count = {count}", "both are positive", "correct them")
    left = {name: require_oscillator(law, "the next run is planned") for name, law in laws.items()}
    shaker, proposals = shaker or Shaker(), []
    for frequency in _frequencies(left, shaker):
        top = _amplitude(left, shaker, frequency)
        for share in SHARES:
            motion = (frequency, _round(share * top))
            if motion[1] > 0 and all(_apart(motion, other) for other in done):
                bound = shaker.bound(frequency) if share == 1.0 and top >= 0.99 * shaker.largest(frequency) else ""
                proposals += _proposals(left, motion, noise, largest, bound)
    if not proposals:
        raise EstimateError(
            "no motion of the base is left to try", "the shaker has to move the mass", "check its limits"
        )
    return _several(sorted(proposals, key=lambda proposal: -proposal.separation), count)


def run_list(proposals: Sequence[Proposal], *, seconds: float = 20.0) -> RunList:
    """The proposals as runs to record.

    Examples
    --------
    >>> run_list([Proposal(4.2, 0.5e-3, 12.0, "", ("rigid", "compliant"))]).run[0].name
    'next-1'
    """
    if not 0 < seconds < math.inf:
        raise ModelError(f"seconds = {seconds}", "a recording lasts some time", "give a length in s")
    runs = (
        Run(name=f"next-{number}", frequency=one.frequency, amplitude=one.amplitude, seconds=seconds, why=one.why)
        for number, one in enumerate(proposals, start=1)
    )
    return RunList(run=tuple(runs))


def _frequencies(laws: Mapping[str, Oscillator], shaker: Shaker) -> list[float]:
    natural = max(math.sqrt(system.stiffness / system.mass) / math.tau for system in laws.values())
    low = max(shaker.lowest, 0.2 * natural)
    high = min(shaker.highest, HIGHEST * natural)
    if not low < high:
        raise EstimateError(
            f"a shaker from {shaker.lowest:g} to {shaker.highest:g} Hz",
            f"the mass moves below {high:.3g} Hz",
            "use another",
        )
    return [_round(frequency) for frequency in np.geomspace(low, high, FREQUENCIES)]


def _amplitude(laws: Mapping[str, Oscillator], shaker: Shaker, frequency: float) -> float:
    """The largest amplitude that is tried: what the shaker can, up to four times what friction holds."""
    stiffness = min(system.stiffness for system in laws.values())
    friction = max(float(getattr(system.law, "kinetic", 1.0)) for system in laws.values())
    wanted = 4 * friction / stiffness
    top = shaker.largest(frequency)
    return min(top, max(wanted, 0.5e-3))


def _round(value: float) -> float:
    return float(f"{float(value):.3g}")


def _apart(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return any(abs(a - b) > APART * max(a, b) for a, b in zip(one, other, strict=True))


def _several(ranked: Sequence[Proposal], count: int) -> tuple[Proposal, ...]:
    """The best ones that differ from each other."""
    chosen: list[Proposal] = []
    for proposal in ranked:
        if all(_apart((proposal.frequency, proposal.amplitude), (c.frequency, c.amplitude)) for c in chosen):
            chosen.append(proposal)
    return tuple(chosen[:count])


def _proposals(
    laws: Mapping[str, Oscillator], motion: tuple[float, float], noise: float, largest: float, bound: str
) -> list[Proposal]:
    """What a motion tells; nothing where a law can not be simulated or the mass leaves the sensor's range."""
    try:
        answers = {name: _steady(system, motion) for name, system in laws.items()}
        if any(np.abs(answer).max() > largest for answer in answers.values()):
            return []
        effects = {name: _effects(system, motion, answers[name]) for name, system in laws.items()}
    except StickslipError:
        return []
    names = list(laws)
    pairs = [(a, b) for number, a in enumerate(names) for b in names[number + 1 :]]
    separations = {(a, b): min(_left(answers, effects, a, b), _left(answers, effects, b, a)) / noise for a, b in pairs}
    pair = min(separations, key=lambda pair: separations[pair])
    return [Proposal(*motion, separations[pair], bound, pair)]


def _steady(system: Oscillator, motion: tuple[float, float]) -> Array:
    """The displacement over the last cycles of a run."""
    frequency, amplitude = motion
    moved = replace(system, drive=HarmonicBase(amplitude, frequency=frequency))
    run = simulate(moved, cycles=CYCLES)
    times = (CYCLES - READ + np.arange(READ * POINTS) / POINTS) / frequency
    x = run.sample(np.minimum(times, run.duration), ("x",))[0][0]
    return np.asarray(x - x.mean())  # where it stands is nobody's to know


def _effects(system: Oscillator, motion: tuple[float, float], answer: Array) -> Array:
    """What each parameter of the law, its damper and the sensor's gain change, a column each."""
    columns = [answer * GAIN_SD]
    law: Any = system.law
    for name in (field.name for field in fields(law)):
        value = getattr(law, name)
        if isinstance(value, (int, float)) and not isinstance(value, bool) and value > 0:
            nudged = value * (1 - NUDGE if name == "kinetic" else 1 + NUDGE)  # which no static friction is below
            changed = replace(system, law=replace(law, **{name: nudged}))
            columns.append(_steady(changed, motion) - answer)
    if system.damping:
        columns.append(_steady(replace(system, damping=system.damping * (1 + NUDGE)), motion) - answer)
    return np.column_stack(columns)


def _left(answers: Mapping[str, Array], effects: Mapping[str, Array], one: str, other: str) -> float:
    """Root mean square of the difference that the one law's parameters can not take up."""
    difference = answers[one] - answers[other]
    design = effects[one]
    rest = difference - design @ np.linalg.lstsq(design, difference, rcond=1e-8)[0]
    return math.sqrt(float(np.mean(rest**2)))
