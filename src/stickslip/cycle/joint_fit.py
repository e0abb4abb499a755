"""What a joint's log tells of its torque while it slides: the columns that may explain it, and the regression on them.

Which of its terms a log tells, of one log or of several together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from stickslip.arrays import Array
from stickslip.balance.motion import require_fit
from stickslip.cycle.joint_slides import (
    COGS,
    DERIVATIVES,
    NARROW,
    SHORTEST,
    Log,
    Sliding,
    Teeth,
    Window,
    later,
    motor_lead,
    places,
    seated,
    sliding,
)
from stickslip.errors import EstimateError, ModelError, RecordError
from stickslip.estimate import Constant, Estimate, stands
from stickslip.record.record import Record, Step, require_record
from stickslip.signals.derivatives import five_point_difference
from stickslip.signals.interpolate import without_delays
from stickslip.signals.noise import noise_level
from stickslip.statistics import LeastSquares, least_squares, repeating

QUESTION = "the friction of a joint"
LEAST = 200  # samples
ROWS = 20  # instants at which it slides
ROUNDS = 25  # of the regression about a load part: six are enough where the log tells it
SETTLED = 1e-6  # of the load part between two rounds
STARTS = (0.0, 0.3)  # of the load part: from none alone one joint in a hundred ended where gravity has the wrong sign
SURELY = 4.0  # deviations, by which the viscous friction of both directions differs: chance gives that once in 15000
# Of inertia and friction, what may be behind the teeth, chosen: of the joints drawn in tests it is 0.3 to 0.7.
BEHIND = (0.25, 0.75)
SEATINGS = 2  # rounds: by the torque of the regression on all rows, then by that of where they carry
WORDS = {
    "inertia": "inertia", "viscous": "viscous friction", "uneven": "uneven viscous friction",
    "forward": "Coulomb friction forward", "back": "Coulomb friction back",
    "coulomb": "Coulomb friction", "load": "friction per load",
    "warming": "friction per kelvin", "thinning": "viscous friction per kelvin",
    "sine": "gravity, sine part", "cosine": "gravity, cosine part", "damping": "damping of the control loop",
    "late": "delay of the torque", "lag": "delay of the controller", "fall": "friction that falls with the speed",
    "fall of load": "its part of the load", **dict.fromkeys(COGS, "torque along the way"),
}  # fmt: skip
ADVICE = {
    "inertia": "accelerate harder, by steps or faster swings",
    "viscous": "slide at several speeds, slow ones and fast ones",
    "uneven": "slide at several speeds either way, slow ones and fast ones",
    "forward": "pass the same places both ways, slowly and fast",
    "back": "pass the same places both ways, slowly and fast",
    "warming": "log it from cold to warm, without a change of its motion",
    "thinning": "log it from cold to warm, without a change of its motion",
    "load": "carry another payload, or turn farther, so that gravity's torque changes",
    "sine": "turn farther, a quarter turn at least",
    "cosine": "turn farther, a quarter turn at least",
    "damping": "log the torque or the motor's current, or state kd",
    "late": "swing at several frequencies, or state it",
    "fall": "slide slower too",
    "fall of load": "slide slowly under several loads",
}
WARM = ("warming", "thinning")
# Of the variance of a temperature, its counts' and its noise's: a regression on it is low by as much.
ROUGHLY = 0.02
LEAST_WAVES, WAVES = 3.0, 400  # periods of cogging within the way: fewer pass for gravity; how many, a radian apart
ENOUGH = 1500  # rows that are searched for cogging
SEEN = 0.01  # of the power of a wave, that the windows have to leave of it
# Independent samples times the share of what is left that a wave explains: of 170 logs without cogging, seeds 201000
# to 201021, 15 at most, of 101 others once over 25 by a wave no longer tried, with cogging to 33 or more on 19 of 20.
COGGED = 25.0
# Of the power that is left, what recurs along the way: 0.24 to 0.4 of gears and of a real axis' ball screw, 0.2 at most
# of seven joints whose counts recur with the motion; and times what chance brings, one in a hundred (F of 16).
MUCH, LUCK = 0.22, 2.0
OFTEN, USUAL = 0.25, 0.02  # odds that a torque is late, chosen, and s by which it then usually is, chosen
# s, and how that varies, chosen: of a torque in time. What a computer at 1 kHz sets acts half a period late on average.
HELD = (0.0, 5e-4)
LOOP = (1e-3, 2e-3)  # s, delay of a controller, and how that varies, chosen: it holds its output for 0.2 to 10 ms
# left out in this order where the motion can not tell all of them apart
OPTIONAL: tuple[tuple[str, ...], ...] = (WARM, ("load",), ("sine", "cosine"))


Fitted = tuple[LeastSquares, tuple[str, ...], tuple[float, float]]  # with its terms and gravity's sine and cosine part


# ---- what is regressed


@dataclass(frozen=True)
class JointData:
    """What is regressed: the torque at the rows, and what was stated, each with its standard deviation's column."""

    logs: tuple[Log, ...]
    torque: Array
    terms: tuple[str, ...]
    source: str
    raw: Array
    known: Array
    unsure: tuple[Array, ...] = ()
    stated: dict[str, Estimate] = field(default_factory=dict)

    @property
    def followed(self) -> bool:
        """Whether every log has the reference, whose columns are the instruments."""
        return all(log.reference is not None for log in self.logs)

    def columns(
        self, terms: tuple[str, ...], load: float, pull: tuple[float, float], *, steered: bool = False
    ) -> Array:
        """The columns of all logs, one below the other."""
        return np.concatenate([log.columns(terms, load, pull, steered=steered) for log in self.logs])

    @property
    def by_gravity(self) -> bool:
        """Whether friction grows with gravity's torque alone, in whose columns it stands then."""
        return self.logs[0].borne is None

    def alike(self, other: JointData) -> JointData:
        """With the cogging of another."""
        logs = tuple(replace(log, cogs=other.logs[0].cogs) for log in self.logs)
        return replace(self, terms=(*self.terms, *(term for term in COGS if term in other.terms)), logs=logs)

    def noise(self, terms: tuple[str, ...]) -> Array:
        """``E'E`` of the encoders' noise in the columns; in those that are no derivatives it is smoothed to nothing."""
        among = np.array([[float(term == one) for one in DERIVATIVES] for term in terms])
        return np.asarray(sum(among @ log.noise @ among.T for log in self.logs))

    def model(self, fit: LeastSquares, terms: tuple[str, ...], pull: tuple[float, float]) -> Array:
        """What a fit, of these logs or of others, makes of the torque."""
        share = coefficient(fit, terms, "load")
        bare = tuple(term for term in terms if term != "load" or not self.by_gravity)
        columns = np.concatenate([log.quiet().columns(bare, share, pull) for log in self.logs])
        return np.asarray(self.known + columns @ fit.coefficients[[terms.index(term) for term in bare]])

    def earlier(self, late: float) -> JointData:
        """With the torque read by so much later [s] as it comes late; a controller's, of an error so long ago."""
        if self.source == "reference":
            return self._lagging(late)
        logs = [replace(log, torque=later(log.torque, late * log.sliding.window.fs)) for log in self.logs]
        smoothed = [log.sliding.at(np.asarray(log.torque)) for log in logs]
        raw = np.concatenate([np.asarray(log.torque) for log in logs])
        return replace(self, logs=tuple(logs), torque=np.concatenate(smoothed), raw=raw)

    def _lagging(self, late: float) -> JointData:
        r"""With a controller's torque as it acts, :math:`k_p e(t - d) + k_d \dot e(t - d)`.

        Damping that is regressed is told as it damps, :math:`k_d - k_p d`: the rest of it stands with the gain.
        """
        logs, regressed = [], "damping" in self.terms
        for log in self.logs:
            fs = log.sliding.window.fs
            torque, error = (later(values, -late * fs) for values in (log.torque, log.error))
            if regressed:
                torque = torque + late * fs * five_point_difference(torque, 1)
            logs.append(replace(log, torque=torque, error=error))
        smoothed = [log.sliding.at(np.asarray(log.torque)) for log in logs]
        return replace(self, logs=tuple(logs), torque=np.concatenate(smoothed))

    def ripple(self, fit: LeastSquares) -> tuple[str, float, Array]:
        """What of the residual repeats along the way: whether as friction, which changes with the side, or as torque,
        its size, and what it makes of the torque at the rows if it stands elsewhere along the way, shape (parts, n).

        What recurs with the motion recurs at its places too: then it is to be more than means over as many parts leave
        of so many independent samples, or much of what is left.
        """
        slides = [log.sliding for log in self.logs]
        weights = np.concatenate([one.weights for one in slides])
        number = places(np.concatenate([log.position[log.sliding.rows] for log in self.logs]))
        sides = {"friction": np.concatenate([one.side[one.rows] for one in slides]), "torque": np.ones(len(number))}
        seen = {what: repeating(number, fit.residual / weights * side) for what, side in sides.items()}
        what = max(seen, key=lambda name: float(np.linalg.norm(seen[name])))
        elsewhere = np.stack([np.roll(seen[what], shift)[number] for shift in range(len(seen[what]))])
        size = float(np.sqrt(np.mean(elsewhere[0] ** 2)))
        least = min(LUCK * len(elsewhere) * fit.recurring / fit.independent, MUCH)
        if fit.recurring > 1 and size**2 < least * float(np.mean((fit.residual / weights) ** 2)):
            return what, 0.0, np.zeros_like(elsewhere)
        return what, size, elsewhere * sides[what] * weights

    def unshared(self, inertia: float, viscous: float) -> tuple[Array, Array]:
        """As :meth:`Log.unshared`, of all logs."""
        accelerated, moved = zip(*(log.unshared(inertia, viscous) for log in self.logs), strict=True)
        return np.concatenate(accelerated), np.concatenate(moved)


def coefficient(fit: LeastSquares, terms: Sequence[str], term: str) -> float:
    """Of one term, 0 where the regression has it not."""
    return float(fit.coefficients[terms.index(term)]) if term in terms else 0.0


def warmed(data: Sequence[JointData]) -> list[JointData]:
    """Logs whose friction is told over the temperature, about the mean of all, where it changes by enough."""
    logs = [log for one in data for log in one.logs]
    known = [log.temperature for log in logs if log.temperature is not None]
    if len(known) < len(logs):
        return list(data)
    error = max(_error_of(warm, log.sliding.window.fs) for warm, log in zip(known, logs, strict=True))
    while_sliding = np.concatenate([warm[log.sliding.rows] for warm, log in zip(known, logs, strict=True)])
    if np.ptp(while_sliding) == 0 or error**2 > ROUGHLY * np.var(while_sliding):
        return list(data)
    about = float(np.mean(while_sliding))
    centred = [tuple(replace(log, about=about) for log in one.logs) for one in data]
    return [replace(one, terms=(*one.terms, *WARM), logs=logs) for one, logs in zip(data, centred, strict=True)]


def cogged(data: Sequence[JointData]) -> list[JointData]:
    """Logs beside whose other terms a torque surely goes up and down along the way, as a motor's teeth make it.

    What the terms leave of the torque is held against waves of the place, each as the windows smooth it at the speed
    there. A wave that is not there explains so much of it rarely, as many as are tried.
    """
    whole = pooled(data)
    fit, *_ = separable(whole)
    parts = [_waved(log) for log in whole.logs]
    place, dulled, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    reach, left = float(np.ptp(place)), fit.residual / weights
    every = math.ceil(len(place) / ENOUGH)

    def explained(waves: Array, every: int) -> Array:
        q, dull, r = place[::every], dulled[::every], left[::every]
        turned = 2 * np.pi * waves[:, None]
        columns = np.exp(1j * turned * q - turned**2 * dull)
        power = np.sum(np.abs(columns) ** 2, axis=1)
        seen = 2 * np.abs(columns @ r) ** 2 / np.maximum(power, SEEN * len(q)) / max(float(r @ r), np.finfo(float).tiny)
        return np.where(power > SEEN * len(q), seen, 0.0)

    waves = (LEAST_WAVES + np.arange(WAVES) / (2 * np.pi)) / reach
    best = waves[int(np.argmax(np.concatenate([explained(some, every) for some in np.array_split(waves, 8)])))]
    finer = best + np.linspace(-1, 1, 41) / (2 * np.pi * reach)
    shares = explained(finer, 1)
    if not fit.independent * float(shares.max()) > COGGED * fit.recurring:
        return list(data)
    cogs = float(finer[int(np.argmax(shares))]), float(place.min()) + reach / 2
    with_cogs = [tuple(replace(log, cogs=cogs) for log in one.logs) for one in data]
    return [replace(one, terms=(*one.terms, *COGS), logs=logs) for one, logs in zip(data, with_cogs, strict=True)]


def _waved(log: Log) -> tuple[Array, Array, Array]:
    """Places of the rows, by how much windows dull a wave there over its wave number squared, and weights.

    The kernel is nearly Gauss's, of a variance of an eleventh of its half's square.
    """
    slides = log.sliding
    half = (slides.window.half + 1) / slides.window.fs
    return log.position[slides.rows], (slides.at(log.turned, 1) / slides.weights * half) ** 2 / 22, slides.weights


def damped(data: JointData, late: float, damping: float | None = None) -> JointData:
    """With what a controller's damping makes of a delay, where that is regressed: it is told as it damps."""
    if data.source != "reference" or "damping" not in data.terms:
        return data
    if damping is None:
        fit, terms, *_ = separable(data)
        damping = coefficient(fit, terms, "damping")
    own = damping + data.stated["kp"].value * late
    return replace(data, logs=tuple(replace(log, damped=own) for log in data.logs))


def punctual(data: JointData, delay: Estimate | None) -> JointData:
    """The data with a torque read as much later as it surely is late, and unsure by how unsure that is."""
    if data.source == "reference":
        late, unsure = _lag(delay, LOOP)
        data = damped(data.earlier(late), late)
    elif delay is not None and is_late(delay) and stands(delay.status):
        data, unsure = data.earlier(delay.value), delay.sd
    else:
        unsure = math.hypot(*_lag(delay, HELD), 0.0 if delay is None else _unseen(delay))
    return replace(data, unsure=(*data.unsure, unsure * data.columns(("late",), 0.0, (0.0, 0.0))[:, 0]))


def _lag(delay: Estimate | None, usual: tuple[float, float]) -> tuple[float, float]:
    """A delay [s] and its deviation, by what the log tells of it and by what it usually is."""
    about, spread = usual
    if delay is None:
        return usual
    share = spread**2 / (spread**2 + delay.sd**2)
    return about + share * (delay.value - about), math.sqrt(share) * delay.sd


def _unseen(delay: Estimate) -> float:
    """Deviation [s] by a delay that is not surely there: most torques are in time, which one seen badly may not be."""
    among, few = (delay.sd**2 + spread**2 for spread in (USUAL, HELD[1]))  # variances of what is seen of either
    share = USUAL**2 / among
    seen = min(delay.value**2 / few, SURELY**2)
    odds = OFTEN * math.sqrt(few / among) * math.exp(seen / 2 * (1 - few / among))
    size = math.hypot(share * delay.value, math.sqrt(share) * delay.sd)
    return math.sqrt(odds / (1 + odds)) * size


def is_late(delay: Estimate) -> bool:
    """Whether a delay is surely there."""
    return abs(delay.value) > SURELY * delay.sd


def _error_of(temperature: Array, fs: float) -> float:
    """Standard deviation of its noise, or of its counts, of which it may show a few only."""
    count = np.ptp(temperature) / max(len(np.unique(temperature)) - 1, 1)
    return max(noise_level(temperature, fs), float(count) / math.sqrt(12))


def pooled(data: Sequence[JointData]) -> JointData:
    """Several logs as one."""
    first = data[0]
    joined = {name: np.concatenate([getattr(one, name) for one in data]) for name in ("torque", "raw", "known")}
    unsure = tuple(np.concatenate(columns) for columns in zip(*(one.unsure for one in data), strict=True))
    logs = tuple(log for one in data for log in one.logs)
    if any(log.reference is None for log in logs):  # then no reference is an instrument
        logs = tuple(log if log.noise.any() else log.noisy() for log in logs)
    return JointData(logs, terms=first.terms, source=first.source, unsure=unsure, stated=first.stated, **joined)


def joint_data(
    record: Record, gravity: bool | None, slowly: bool = False, teeth: Teeth | None = None, /, **given: Constant | None
) -> tuple[Record, JointData]:
    """The record with its torque, and what is asked of it under what is stated; of slow sliding too, where asked.

    With play between motor and link: of where the teeth are seated.
    """
    require_record(record)
    if gravity and not turning(record):
        raise ModelError(
            "gravity of an axis that moves straight",
            "it is a constant force there, half of what Coulomb friction forward and back differ by",
            "leave it out",
        )
    constants = _constants(record, **given)
    record = _torqued(record, constants)
    pulled = turning(record) and "bodies" not in record if gravity is None else gravity
    return record, _data_of(record, constants, pulled, slowly, teeth)


def turning(record: Record) -> bool:
    return "theta" in record or "x" not in record


def _constants(record: Record, **given: Constant | None) -> dict[str, Estimate]:
    """The stated constants, in the units of the motion."""
    torque = "N m" if turning(record) else "N"
    stiff, damped, heavy = ("N m/rad", "N m s/rad", "kg m^2") if turning(record) else ("N/m", "N s/m", "kg")
    units = {"inertia": heavy, "kp": stiff, "kd": damped, "torque_constant": f"{torque}/A"}
    units["play"] = "rad" if turning(record) else "m"
    stated = {name: Estimate.stated(name, value, units[name]) for name, value in given.items() if value is not None}
    for name, constant in stated.items():
        if (
            constant.value < 0
            or (constant.value == 0 and name not in ("kd", "play"))
            or not math.isfinite(constant.value)
        ):
            raise ModelError(
                f"{name} = {constant.value:g} {constant.unit}", f"a joint's {name} is positive", f"correct {name}="
            )
    return stated


def _torqued(record: Record, constants: dict[str, Estimate]) -> Record:
    """The record with a torque, from a current where it has none; delays taken out."""
    position = "theta" if turning(record) else "x"
    used = [name for name in (position, "motor", "reference", "force", "current") if name in record]
    record.require_clean(position, *used, question=QUESTION, samples=LEAST)
    record = without_delays(record, *used, question=QUESTION, samples=LEAST)
    if "force" not in record and "current" in record and "torque_constant" in constants:
        constant = constants["torque_constant"]
        step = Step("regress_joint", {"torque_constant": constant.value}, "torque of the current")
        unit = "N m" if turning(record) else "N"
        force = constant.value * record["current"]
        record = record.with_channel("force", force, unit=unit, source="current", step=step)
    if "force" in record:
        require_fit(record, "force", length="rad" if position == "theta" else "m", question=QUESTION)
        return record
    if not ("reference" in record and "kp" in constants):
        lacks = "the current's torque_constant" if "current" in record else "kp" if "reference" in record else "force"
        raise RecordError(
            f"no torque: the record has {', '.join(record)}, and {lacks} is missing",
            f"{QUESTION} needs a torque: measured, of a current with its constant, or of a controller with its gains",
            'name the column of the torque, as in channels={"force": "COLUMN [N m]"}, give --torque-constant of a '
            "current, or --kp with the reference",
        )
    return record


def _data_of(
    record: Record, constants: dict[str, Estimate], gravity: bool, slowly: bool, teeth: Teeth | None
) -> JointData:
    position = record["theta" if turning(record) else "x"]
    followed = "reference" in record
    reference = record["reference"] if followed else None
    if np.ptp(position) == 0:
        raise EstimateError("the position never changes", f"{QUESTION} needs motion", "check the column")
    slides = sliding(position, record.fs, slowly=slowly, carry=teeth.carry if teeth else None)
    _refuse_still(slides, record)
    lead = motor_lead(position, record["motor"]) if "motor" in record else None
    logged = "temperature" in record and bool(np.all(np.isfinite(record["temperature"])))
    warm = record["temperature"] if logged else None
    log = Log(position, reference, slides, np.zeros(len(position)) if lead is None else lead, warm)
    if not followed:
        log = log.noisy()
    if teeth is not None:
        log = replace(log, ahead=teeth.lead)
    terms = ["viscous", "forward", "back", *(("sine", "cosine", "load") if gravity else ())]
    known, unsure = np.zeros(len(slides.rows)), [] if teeth is None else [slides.at(teeth.unsure)]
    if "inertia" in constants:
        column = slides.at(log.turned, 2)
        known, unsure = known + constants["inertia"].value * column, [*unsure, constants["inertia"].sd * column]
    else:
        terms.insert(0, "inertia")
    if "force" in record:
        raw = record["force"]
        torque = slides.at(raw)
        log = replace(log, torque=raw)
        scale = constants.get("torque_constant") if record.channels["force"].source == "current" else None
        source = "current" if scale else "force"
    else:
        assert reference is not None
        scale, source = constants["kp"], "reference"
        error = reference - position
        raw = made = scale.value * error
        if "kd" in constants:
            kd, rate = constants["kd"], five_point_difference(error, 1) * record.fs
            raw, made = raw + kd.value * slides.window.apply(error, 1), made + kd.value * rate
            unsure = [*unsure, kd.sd * slides.at(rate)]
        else:
            terms.append("damping")
        torque = slides.at(made)
        log = replace(log, torque=made, error=error)
    if scale is not None:
        unsure.append(scale.sd / scale.value * torque)
    if "bodies" in record:
        log = replace(log, bodies=record["bodies"])
        taken = slides.at(record["bodies"])
        known, unsure = known + taken, [*unsure, record.channels["bodies"].gain_sd * taken]
    gain_sd = max((record.channels[name].gain_sd for name in ("force", "current") if name in record), default=0.0)
    unsure.append(gain_sd * torque)
    return JointData((log,), torque, tuple(terms), source, np.asarray(raw), known, tuple(unsure), constants)


def _refuse_still(slides: Sliding, record: Record) -> None:
    """Refuse a log that does not slide both ways for long enough."""
    ways = [int(np.sum(slides.side[slides.rows] == side)) for side in (1, -1)]
    if min(ways) >= ROWS // 2 and sum(ways) >= ROWS:
        return
    unit = "rad/s" if turning(record) else "m/s"
    raise EstimateError(
        f"it slides steadily faster than {slides.slowest:.2g} {unit} at {ways[0]} instants forward and {ways[1]} back",
        f"friction is told from gravity by strokes both ways, {ROWS // 2} instants each at least",
        "swing it back and forth, farther or faster, through the same places",
    )


def fitted(data: JointData) -> tuple[LeastSquares, tuple[str, ...], tuple[float, float], tuple[str, ...]]:
    """The regression, with viscous friction of each direction where these differ surely."""
    fit, terms, pull, left_out = separable(data)
    _refuse_driving(data, fit, terms)
    richer = (*terms, "uneven")
    try:
        both, shifted = about_load(data, richer)
    except EstimateError:
        return fit, terms, pull, left_out
    differ = both.combined(np.eye(len(richer))[-1], "", "", "")
    return (both, richer, shifted, left_out) if abs(differ.value) > SURELY * differ.sd else (fit, terms, pull, left_out)


def seating(record: Record, gravity: bool | None, **given: Constant | None) -> Teeth | None:
    """Where the teeth of a joint whose motor alone has an encoder carry, with the stated play; None without."""
    if given.get("play") is None:
        return None
    if "motor" in record:
        raise ModelError(
            f"play = {given['play']} beside an encoder on the motor and one on the link",
            "both tell where the teeth are",
            "leave play= out, or the channel of the link",
        )
    teeth = None
    for _ in range(SEATINGS):
        (data,) = warmed([joint_data(record, gravity, False, teeth, **given)[1]])
        if not data.stated["play"].value:
            return None
        teeth = _teeth_of(data)
    return teeth


def _teeth_of(data: JointData) -> Teeth:
    """On which side the teeth of a joint with stated play carry, by the torque that a first regression gives them."""
    fit, terms, pull, _ = fitted(data)
    (log,), play = data.logs, data.stated["play"]
    fs, place = log.sliding.window.fs, log.position
    window = Window(max(SHORTEST, round(NARROW * log.sliding.window.half)), fs)
    speed, acceleration = (window.apply(place, order) for order in (1, 2))
    inertia = data.stated["inertia"].value if "inertia" in data.stated else coefficient(fit, terms, "inertia")
    rubs = np.where(speed > 0, coefficient(fit, terms, "forward"), -coefficient(fit, terms, "back"))
    own = inertia * acceleration + coefficient(fit, terms, "viscous") * speed + rubs
    weight = pull[0] * np.sin(place) + pull[1] * np.cos(place)
    carried = weight + coefficient(fit, terms, "load") * np.abs(weight) * np.sign(speed)
    least, most = (carried + share * own for share in BEHIND)
    side, carry = seated(place, least, most, play.value)
    slope = pull[0] * np.cos(place) - pull[1] * np.sin(place)
    return Teeth(side * play.value / 2, carry, play.sd / 2 * side * slope)


def _refuse_driving(data: JointData, fit: LeastSquares, terms: tuple[str, ...]) -> None:
    """Refuse friction that surely goes with the motion: it is that of another sign."""
    speed = float(np.mean([np.abs(log.sliding.at(log.turned, 1)).mean() for log in data.logs]))
    row = np.array([{"forward": 0.5, "back": 0.5, "viscous": speed}.get(term, 0.0) for term in terms])
    friction = fit.combined(row, "", "", "")
    if friction.value < -SURELY * friction.sd:
        share = friction.value / float(np.sqrt(np.mean(data.torque**2)))
        raise EstimateError(
            f"friction at the mean speed is {share:.2g} of the torque: it drives the motion",
            "friction opposes the motion",
            'if torque and position count the other way round, give one with a minus: --channels "force=-COLUMN [N m]"',
        )


def separable(data: JointData) -> tuple[LeastSquares, tuple[str, ...], tuple[float, float], tuple[str, ...]]:
    """The regression with as many terms as the motion tells apart, and what was left out."""
    terms, left_out = data.terms, list[str]()
    for optional in (*OPTIONAL, ()):
        try:
            fit, pull = about_load(data, terms)
            return fit, terms, pull, tuple(left_out)
        except EstimateError:
            if not set(optional) & set(terms):
                if optional:
                    continue
                raise _inseparable(data, terms) from None
            terms = tuple(term for term in terms if term not in optional)
            left_out.append(f"{' and '.join(WORDS[term] for term in optional)}: {ADVICE[optional[0]]}")
    raise _inseparable(data, terms)


def about_load(data: JointData, terms: tuple[str, ...]) -> tuple[LeastSquares, tuple[float, float]]:
    """The regression, linear about its own load part: of those that settle the one that leaves least."""
    if "load" not in terms or not data.by_gravity:
        fit = _solved(data, terms, 0.0, (0.0, 0.0))
        return fit, _pull(fit, terms)
    settled = [one for start in STARTS if (one := _settled(data, terms, start)) is not None]
    if not settled:
        raise EstimateError(
            "the load part does not settle", "gravity's torque is known while it slides", ADVICE["load"]
        )
    return min(settled, key=lambda one: float(np.linalg.norm(one[0].residual)))


def _settled(data: JointData, terms: tuple[str, ...], start: float) -> tuple[LeastSquares, tuple[float, float]] | None:
    """From a load part that is guessed; gravity's torque is first that of a joint with just so much of it."""
    bare = tuple(term for term in terms if term != "load")
    pull = _pull(_solved(data, bare, 0.0, (0.0, 0.0)), bare)
    for _ in range(2 if start else 0):
        pull = _pull(_solved(data, bare, start, pull), bare)
    share = start
    for _ in range(ROUNDS):
        fit = _solved(data, terms, share, pull)
        before, share, pull = share, float(fit.coefficients[terms.index("load")]), _pull(fit, terms)
        if abs(share - before) < SETTLED:
            return fit, pull
    return None


def _solved(data: JointData, terms: tuple[str, ...], share: float, pull: tuple[float, float]) -> LeastSquares:
    columns = data.columns(terms, share, pull)
    torque = data.torque - data.known
    if "load" in terms and data.by_gravity:  # linear about `share`: its column stands in gravity's already
        torque = torque + share * columns[:, terms.index("load")]
    instruments = None if not data.followed else data.columns(terms, share, pull, steered=True)
    fit = least_squares(columns, torque, instruments=instruments, noise=data.noise(terms))
    return replace(fit, cyclic=True)


def _pull(fit: LeastSquares, terms: Sequence[str]) -> tuple[float, float]:
    return coefficient(fit, terms, "sine"), coefficient(fit, terms, "cosine")


def _inseparable(data: JointData, terms: tuple[str, ...]) -> EstimateError:
    """Which terms are one column to this motion, by the weakest singular vector of the columns."""
    columns = data.columns(terms, 0.0, (0.0, 0.0))
    lengths = np.linalg.norm(columns, axis=0)
    if not np.all(lengths > 0):
        mixed = [term for term, length in zip(terms, lengths, strict=True) if length == 0]
    else:
        weakest = np.abs(np.linalg.svd(columns / lengths)[2][-1])
        mixed = [term for term, weight in zip(terms, weakest, strict=True) if weight > 0.3 * weakest.max()]
    return EstimateError(
        f"{' and '.join(WORDS[term] for term in mixed)} can not be told apart in this log",
        "every term needs motion that shows it alone",
        "; ".join(dict.fromkeys(ADVICE[term] for term in mixed)),
    )
