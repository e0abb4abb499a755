"""The forces, the energy and the motion of a harmonically driven mass: what must be true of their harmonics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stickslip.arrays import Array, Complex
from stickslip.balance.mass import Lines, find_lines, response_of
from stickslip.consistent.checks import APART, FAILS, HOLDS, UNTOLD, Amplitudes, Check, Slip, compared, judged, untold
from stickslip.consistent.sliding_balance import Slider
from stickslip.errors import RecordError
from stickslip.files.expression import split_spec
from stickslip.record.channels import Channel
from stickslip.record.record import RIG_UNITS, Record
from stickslip.statistics import mean_uncertainty
from stickslip.units import parse_unit

RATES = ("x_rate", "x_rate_rate")  # the displacement's derivatives
ENERGY, STOPPING = "energy of whole cycles", "sliding without stops"
MOST_ORDERS, PLACES = 40, 2000  # harmonics, and places in a cycle, of which the mean cycle is drawn
LOUD = 5.0  # standard deviations of its mean from which a harmonic counts
SLOW = 0.04  # share of the peak speed below which the mass rests
FEW_TRIPS = 2.0  # times the largest force over the stroke, that a spring might have kept
STEADY = 0.9  # of its amplitude is left of a line's mean over the stretches, where they are in phase
FAR_OFF = 0.1  # of the amplitude: a zero that is off by less harms little
STOPS = 0.1  # share of the time below it from which a motion stops: a harmonic one is there for 0.025


@dataclass(frozen=True, eq=False)
class Seen:
    """A record's lines as the motion made them, and the rig's constants where known."""

    lines: Lines
    channels: Mapping[str, Complex]
    rig: Mapping[str, float]
    damper: str
    tolerance: float
    at: int
    trips: float  # work of the load cell's force over the record, in its largest force times the stroke
    stated_channels: Mapping[str, Channel]
    contact: str

    @classmethod
    def of(cls, record: Record, names: list[str], rig: Mapping[str, Any], tolerance: float, question: str) -> Seen:
        contact = rig.get("contact")
        lines = find_lines(record, names, contact=contact, question=question)
        if lines.cycles is None:
            rates = dict(zip(RATES, _rates(record["x"], record.fs), strict=True))
            whole = replace(record, samples={**record.samples, **rates}, channels={**record.channels, **_plain(RATES)})
            lines = find_lines(whole, [*names, *RATES], contact=contact, question=question)
        known = {name: rig[name] for name in RIG_UNITS if name in rig}
        channels = {name: record.channels[name] for name in names}
        made = {name: lines.amplitudes[name] / response_of(channels[name]).at(lines.frequency) for name in names}
        if "load" in made and channels["load"].inertia:
            w = 2 * np.pi * lines.frequency
            made["load"] = made["load"] - channels["load"].inertia * made.get("a", -(w**2) * made["x"])
        at = 0 if lines.cycles is not None else int(np.argmax(np.abs(made["x"]).mean(axis=0) * lines.frequency))
        damper, face, trips = str(rig.get("damper", "ground")), str(contact or "ground"), _trips(record)
        return cls(lines, made, known, damper, tolerance, at, trips, channels, face)

    @property
    def angular(self) -> float:
        """Of the strongest line [rad/s]."""
        return 2 * math.pi * float(self.lines.frequency[self.at])

    @property
    def knows(self) -> bool:
        """Whether the forces can be written down."""
        return {"mass", "stiffness"} <= set(self.rig)

    @property
    def damping(self) -> float:
        return self.rig.get("damping", 0.0)

    @property
    def drag(self) -> Complex:
        """The damper's force [N], line by line."""
        moved = self.channels["x"]
        if self.damper == "base" and "z" in self.channels:
            moved = moved - self.channels["z"]
        return np.asarray(2j * np.pi * self.damping * self.lines.frequency * moved)

    def strongest(self, name: str) -> Complex:
        """Of each stretch, at the strongest line; zero where there is no such channel."""
        return self.channels[name][:, self.at] if name in self.channels else np.zeros(self.lines.count, dtype=complex)

    @property
    def acceleration(self) -> Complex:
        return self.strongest("a") if "a" in self.channels else -(self.angular**2) * self.strongest("x")

    def work(self, force: Complex) -> Array:
        r"""Of each cycle [J]: :math:`\oint f\,dx = \pi \sum_n n\,\mathrm{Re}(F_n \overline{i X_n})`."""
        order = np.arange(1, force.shape[1] + 1)
        return np.asarray(np.pi * (order * (force * np.conj(1j * self.channels["x"])).real).sum(axis=1))

    def sd(self, values: Array | Complex) -> float:
        """Of the mean over stretches."""
        parts = [values.real, values.imag] if np.iscomplexobj(values) else [values]
        spreads = [mean_uncertainty(np.asarray(part, dtype=float))[0] if len(part) > 1 else 0.0 for part in parts]
        return math.hypot(*spreads) / math.sqrt(self.lines.worth)

    def unsure(self, *names: str) -> float:
        """By which share channels may be apart: as unsure as each one's gain is stated to be, or as is usual."""
        return math.hypot(*(self.stated_channels[name].gain_sd or self.tolerance for name in names))

    @property
    def steady(self) -> bool:
        """Whether each channel keeps its phase from stretch to stretch: else their mean lines are of no one motion."""
        read = [values[:, self.at] for name, values in self.lines.amplitudes.items() if name not in RATES]
        return all(abs(values.mean()) > STEADY * np.abs(values).mean() for values in read)

    @property
    def balance(self) -> Amplitudes:
        """The strongest lines as read, for mix-ups."""
        amplitudes = {name: read for name, read in self.lines.amplitudes.items() if name not in RATES}
        values = {name: complex(read[:, self.at].mean()) for name, read in amplitudes.items()}
        stated = {name: unit for name, channel in self.stated_channels.items() if (unit := _unit_read(channel))}
        return Amplitudes(values, self.angular, self.rig, self.damper, self.tolerance, self.contact, stated)


def _rates(x: Array, fs: float) -> tuple[Array, Array]:
    speed = np.gradient(x, 1 / fs)
    return speed, np.gradient(speed, 1 / fs)


def _plain(names: Sequence[str]) -> dict[str, Channel]:
    return {name: Channel(name, "1") for name in names}


def _trips(record: Record) -> float:
    if "load" not in record or not np.isfinite(record["load"]).all():
        return 0.0
    force, x = record["load"] - np.mean(record["load"]), record["x"]
    most = float(np.abs(force).max() * np.ptp(x))
    return float(np.sum((force[1:] + force[:-1]) / 2 * np.diff(x))) / most if most > 0 else 0.0


def _unit_read(channel: Channel) -> str:
    """The unit that a channel's file, or who named it, has stated; empty where that tells none."""
    try:
        unit = split_spec(channel.source).unit or ""
        return unit if unit and parse_unit(unit, channel.unit) else ""
    except RecordError:  # read by a sensitivity, or from no file
        return ""


def acceleration_check(seen: Seen) -> Check:
    """Whether a is the second derivative of x."""
    return _derivative(seen, "a", "acceleration is that of the displacement", "m/s^2")


def velocity_check(seen: Seen) -> Check:
    """Whether v is the first derivative of x."""
    return _derivative(seen, "v", "velocity is that of the displacement", "m/s")


def _derivative(seen: Seen, channel: str, name: str, unit: str) -> Check:
    if channel not in seen.channels:
        return untold(name, f"there is no {'accelerometer' if channel == 'a' else 'velocity'} to be heard")
    order = 1 if channel == "v" else 2
    read, moved = seen.strongest(channel), (1j * seen.angular) ** order * seen.strongest("x")
    if seen.lines.cycles is None:  # a window's line is no single frequency, and begins at any phase
        moved = seen.lines.amplitudes[RATES[order - 1]][:, seen.at]
        turn = np.exp(-1j * np.angle(moved))
        read, moved = read * turn, moved * turn
    left, right = abs(read.mean()), abs(moved.mean())
    turned = -1.0 if (complex(read.mean()) * complex(moved.mean()).conjugate()).real < 0 else 1.0
    sd = math.hypot(seen.sd(read - moved), seen.unsure(channel, "x") * right)
    return judged(
        name,
        turned * float(left),
        float(right),
        abs(complex((read - moved).mean())) / sd,
        unit=unit,
        holds=f"amplitude and phase of {channel} are those of x",
        fails=_off(channel, "x", complex(read.mean() / moved.mean()), seen),
    )


def _off(name: str, other: str, ratio: complex, seen: Seen) -> str:
    """In which way one reading is not what another lets expect."""
    phase = float(np.angle(ratio))
    small = 3 * seen.unsure(name, other)
    reasons = []
    if abs(abs(phase) - math.pi) < 0.3:
        reasons.append(f"{name} and {other} have opposite signs")
        phase = float(np.angle(-ratio))
    if abs(phase) > small:
        ahead = "ahead of" if phase > 0 else "behind"
        reasons.append(
            f"{name} is {1e3 * abs(phase) / seen.angular:.3g} ms {ahead} {other}, or that and whole cycles: state the "
            "delay of the later one (sensor_delay finds it)"
        )
    if abs(abs(ratio) - 1) > small:
        reasons.append(f"{name} is {abs(ratio):.3g} times what {other} lets expect")
    return "; ".join(reasons) or f"{name} is not quite what {other} lets expect"


def forces_check(seen: Seen) -> Check:
    name = "forces balance at the forcing frequency"
    if "load" not in seen.channels:
        return untold(name, "no load cell: the friction is what is left of the balance")
    if not seen.knows:
        return untold(name, "mass and stiffness are not known")
    k, m = seen.rig["stiffness"], seen.rig["mass"]
    x, z = seen.strongest("x"), seen.strongest("z")
    inertia = m * seen.acceleration
    computed = k * (z - x) - seen.drag[:, seen.at] + seen.strongest("force") - inertia
    felt = seen.strongest("load")
    sizes = [abs(term.mean()) for term in (k * z, k * x, inertia, felt, seen.strongest("force"))]
    sd = math.hypot(seen.sd(felt - computed), math.sqrt(2) * seen.tolerance * float(np.linalg.norm(sizes)))
    rest = complex((felt - computed).mean())
    return judged(
        name,
        float(abs(felt.mean())),
        float(abs(computed.mean())),
        abs(rest) / sd,
        unit="N",
        holds="the load cell measures what the motion leaves over",
        fails=_unbalanced(rest, complex(felt.mean()), complex((inertia / m).mean()), complex((z - x).mean()), seen, sd),
    )


def _unbalanced(rest: complex, felt: complex, acceleration: complex, stretch: complex, seen: Seen, sd: float) -> str:
    """What would balance the forces: another sign of the load cell, another mass, another spring."""
    if abs(rest - 2 * felt) < APART * sd:
        return "the load cell and k z - k x - m a have opposite signs"
    cures = []
    for name, unit, per, sign in (("mass", "kg", acceleration, -1.0), ("stiffness", "N/m", stretch, 1.0)):
        change = sign * rest / per
        other = seen.rig[name] + change.real
        if abs(change.imag * per) < APART * sd and other > 0:
            cures.append(f"a {name} of {other:.4g} {unit}")
    turned = math.degrees(float(np.angle(felt / (felt - rest))))
    leaves = f"the motion leaves {abs(felt - rest):.3g} N, {turned:.0f} degrees apart"
    sentence = f"the load cell measures {abs(felt):.3g} N where {leaves}"
    cure = f"; {' or '.join(cures)} would balance them" if cures else ": a delay, a calibration or a sign"
    return f"{sentence}{cure}"


def energy_check(seen: Seen) -> Check:
    """Whether friction and damper take what the drive gives; with one of both alone, whether it runs the right way."""
    if seen.lines.cycles is None:
        return _energy_without_cycles(seen)
    given = _given(seen)
    taken = seen.work(seen.channels["load"]) if "load" in seen.channels else None
    if given is None:
        if taken is None:
            return untold(ENERGY, "neither a drive nor a load cell")
        return _one_way(taken, seen, "J", "friction takes energy", "friction gives energy")
    if taken is None or ("z" in seen.channels and "stiffness" not in seen.rig):
        unit = "J" if "stiffness" in seen.rig else "m^2"
        return _one_way(given, seen, unit, "the base moves the mass", "the mass moves the base")
    taken = taken + seen.work(seen.drag)
    left, right = float(given.mean()), float(taken.mean())
    size = math.sqrt(2) * seen.tolerance * math.hypot(left, right)
    turned = min(left, right) < 0
    return compared(
        ENERGY,
        left,
        right,
        sd=math.hypot(seen.sd(given - taken), size),
        unit="J",
        holds="friction and damper take what the drive gives",
        fails="energy runs the wrong way: a channel has the wrong sign, or two are exchanged"
        if turned
        else f"friction and damper take {100 * abs(right / left - 1):.0f} % {'more' if right > left else 'less'} than "
        "the drive gives: a calibration, the spring or a delay is off",
    )


def _energy_without_cycles(seen: Seen) -> Check:
    """Over the whole record friction takes energy, if the mass travels far enough for a spring not to have kept it."""
    if abs(seen.trips) < FEW_TRIPS:
        return untold(ENERGY, "the motion does not repeat")
    return compared(
        ENERGY,
        0.0,
        seen.trips,
        sd=1.0,
        unit="1",
        bound=True,
        holds="over the record friction takes energy, though no cycle is like another",
        fails="friction gives energy: load or x has the wrong sign",
    )


def _given(seen: Seen) -> Array | None:
    """What the drives give in each cycle [J], over the stiffness where that is not known; None where nothing drives."""
    parts = [seen.work(seen.channels["force"])] if "force" in seen.channels else []
    if "z" in seen.channels:
        parts.append(seen.rig.get("stiffness", 1.0) * seen.work(seen.channels["z"]))
    return np.sum(parts, axis=0) if parts else None


def _one_way(energy: Array, seen: Seen, unit: str, holds: str, fails: str) -> Check:
    """Whether an energy of each cycle is positive."""
    mean = float(energy.mean())
    return compared(
        ENERGY,
        0.0,
        mean,
        sd=math.hypot(seen.sd(energy), seen.tolerance * abs(mean)),
        unit=unit,
        bound=True,
        holds=holds,
        fails=f"{fails}: a channel has the wrong sign, or two are exchanged",
    )


def momentum_check(seen: Seen) -> Check:
    name = "mean force is zero"
    means = seen.lines.means
    if seen.lines.cycles is None:
        return untold(name, "the motion does not repeat")
    if seen.knows and "load" in means and seen.stated_channels["load"].discharge is None:
        pull = seen.rig["stiffness"] * (means.get("z", 0.0) - means["x"]) + means.get("force", 0.0)
        left, right, unit = pull, means["load"], "N"
        size = float(abs(seen.strongest("load").mean()))
        off = float(np.mean(right) - np.mean(left))
        of_x = f"{1e3 * off / seen.rig['stiffness']:.3g} mm of x"
        sentence = f"a zero is off by {off:.3g} N of load, or {of_x}, or of z as much the other way"
    elif "a" in means:
        left, right, unit = means["a"], np.zeros(seen.lines.count), "m/s^2"
        size = float(abs(seen.strongest("a").mean()))
        sentence = f"the accelerometer's zero is off by {float(np.mean(left)):.3g} m/s^2"
    else:
        return untold(name, "neither an accelerometer nor a load cell that keeps its charge, with mass and stiffness")
    sd = math.hypot(seen.sd(np.asarray(left - right)), seen.tolerance * size)
    holds = "what acts on the mass has no mean over whole cycles"
    return compared(name, float(np.mean(left)), float(np.mean(right)), sd=sd, unit=unit, holds=holds, fails=sentence)


def zeros_off(seen: Seen) -> tuple[Slip, ...]:
    """The sensors of which one's zero is off by a good part of what it reads; of x or z by what friction bears."""
    check = momentum_check(seen)
    if check.verdict != FAILS:
        return _stretched(seen)
    name = "a" if check.unit == "m/s^2" else "load"
    off = check.left if name == "a" else check.right - check.left
    if abs(off) < FAR_OFF * abs(complex(seen.strongest(name).mean())):
        return ()
    either = {name: off} if name == "a" else {name: off, "x": off / seen.rig["stiffness"]}
    return tuple(Slip(check.sentence, zeros={sensor: zero}) for sensor, zero in either.items())


def _stretched(seen: Seen) -> tuple[Slip, ...]:
    """A spring that pulls more on the average than friction can bear: one way twice its level, the other way none."""
    cycles, beside = seen.lines.cycles is not None and seen.knows, {"load", "force"} & set(seen.channels)
    if not cycles or beside or "z" not in seen.channels or seen.contact == "base":
        return ()
    k, means = seen.rig["stiffness"], seen.lines.means
    off, amplitude = float(np.mean(means["x"] - means["z"])), _mean_cycle(seen)[0]
    friction = float(seen.work(k * seen.channels["z"] - seen.drag).mean()) / (4 * amplitude)
    if friction <= 0 or abs(off) < max(2 * friction / k, FAR_OFF * amplitude):
        return ()
    pull = f"the spring would pull {k * abs(off):.3g} N on the average, more than the friction bears"
    return (Slip(f"a zero of x or z is off by {1e3 * off:.3g} mm: {pull}", zeros={"x": off}),)


def identity_check(seen: Seen) -> Check:
    r""":math:`\oint f (\dddot x + w^2 \dot x)\,dt = 0`: harmonics n > 1 of f and x are in phase or opposed."""
    name = "identity of harmonic forcing"
    if "load" not in seen.channels or seen.lines.cycles is None:
        return untold(name, "no load cell" if "load" not in seen.channels else "the motion does not repeat")
    if "z" in seen.channels and "stiffness" not in seen.rig:
        return untold(name, "the stiffness is not known, and the base is not harmonic to the last digit")
    w, x = seen.angular, seen.channels["x"]
    order = np.arange(1, x.shape[1] + 1)
    level = np.sqrt(np.mean(np.abs(x - x.mean(axis=0)) ** 2, axis=0) / max(1, seen.lines.count - 1))
    heard = np.flatnonzero((np.abs(x.mean(axis=0)) > LOUD * level) & (order > 1) & (order < 60))
    if not len(heard):
        return untold(name, "no harmonic of the displacement stands out of its noise")
    force = seen.channels["load"] + seen.drag
    if "z" in seen.channels:
        force = force - seen.rig["stiffness"] * seen.channels["z"]
    if "force" in seen.channels:
        force = force - seen.channels["force"]
    weight = np.pi * (order * (order**2 - 1.0)) * w**2
    terms = weight * (force * np.conj(1j * x)).real
    per_cycle = terms[:, heard].sum(axis=1)
    sizes = weight[heard] * np.abs(force.mean(axis=0) * x.mean(axis=0))[heard]
    first = float(w**2 * seen.work(seen.channels["load"]).mean())
    sd = math.hypot(seen.sd(per_cycle), math.sqrt(2) * seen.tolerance * float(np.linalg.norm(sizes)))
    return compared(
        name,
        first + float(per_cycle.mean()),
        first,
        sd=sd,
        unit="N m/s^2",
        holds="the integrals of -f x''' and w^2 f x' over a cycle are one, as under any friction law",
        fails="load and x are not of one motion under one harmonic drive: a delay, a mount or a second frequency",
    )


def stops_check(seen: Seen) -> Check:
    """Whether this friction lets the mass slide without stops, or stop, as it does."""
    name = STOPPING
    if not seen.knows or "z" not in seen.channels or "force" in seen.channels or seen.lines.cycles is None:
        return untold(name, "mass, stiffness, whole cycles and a base that alone drives the mass are needed")
    k, m = seen.rig["stiffness"], seen.rig["mass"]
    z = abs(complex(seen.strongest("z").mean()))
    amplitude, rests = _mean_cycle(seen)
    residual = k * seen.channels["z"] - seen.drag
    source = seen.work(seen.channels.get("load", residual))
    friction = float(source.mean()) / (4 * amplitude)
    if friction <= 0:
        return untold(name, "energy runs the wrong way")
    share, least = friction / (k * z), Slider(m, k, seen.angular, seen.damping).boundary()
    sd = math.sqrt(3) * seen.tolerance * share
    return _stopping(share, least, sd) if rests > STOPS else _sliding_on(share, least, sd, friction, k * z)


def _mean_cycle(seen: Seen) -> tuple[float, float]:
    """Amplitude [m] of the mean cycle, and the share of it that the mass rests."""
    mean = seen.channels["x"].mean(axis=0)[:MOST_ORDERS]
    order = np.arange(1, len(mean) + 1)
    phase = np.exp(2j * np.pi * np.outer(order, np.arange(PLACES) / PLACES))
    path, speed = (mean @ phase).real, ((1j * order * mean) @ phase).real
    return float(np.ptp(path)) / 2, float(np.mean(np.abs(speed) < SLOW * np.abs(speed).max()))


def _stopping(share: float, least: float, sd: float) -> Check:
    """Of a mass that stops: whether friction makes it."""
    if share > least - APART * sd:
        return Check(STOPPING, share, least, "1", 0.0, HOLDS, "it stops, and friction makes it stop")
    sentence = (
        "it stops, though sliding on is possible too: friction at rest above that of sliding, or it was started so"
    )
    return Check(STOPPING, share, least, "1", (least - share) / sd, UNTOLD, sentence)


def _sliding_on(share: float, least: float, sd: float, friction: float, drive: float) -> Check:
    """Of a mass that does not stop: whether friction lets it slide on."""
    check = compared(
        STOPPING,
        share,
        math.pi / 4,
        sd=sd,
        unit="1",
        bound=True,
        holds="it slides on, as this friction allows",
        fails=f"it slides on against {friction:.3g} N, and against more than {math.pi * drive / 4:.3g} N (pi k Z / 4) "
        "it can not: friction, base motion or stiffness is wrong",
    )
    if check.verdict == HOLDS and share > least + APART * sd:
        sentence = (
            f"it slides on where a rigid contact would stop ({least:.3g} of k Z, Den Hartog): the contact is elastic"
        )
        return Check(STOPPING, share, least, "1", (share - least) / sd, HOLDS, sentence)
    return replace(check, right=least) if check.verdict == HOLDS else check
