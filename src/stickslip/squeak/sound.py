"""Sound: how loud a vibrating surface is at a distance, levels, and what a squeaking rig would have recorded.

A virtual squeak rig: rubber on steel, dry or wet, lightly or heavily loaded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.drives.kinds import HarmonicBase
from stickslip.errors import ModelError, RecordError
from stickslip.laws.coulomb import LinearSlope
from stickslip.oscillator import Contact, Structure
from stickslip.parameters import finite
from stickslip.record.channels import Channel, described
from stickslip.record.record import Record, Step
from stickslip.units import parse_constant

if TYPE_CHECKING:
    from stickslip.solve.trajectory import Trajectory


AIR, SPEED_OF_SOUND = 1.204, 343.2  # kg/m^3 and m/s, dry air at 20 C and 101.325 kPa
REFERENCES = {"Pa": 20e-6, "m/s^2": 1e-6, "m/s": 1e-9, "N": 1e-6}  # ISO 1683
TIP = 2e-3  # m^2: chosen, the radiating area of the pinching beam's tip
MICROPHONE = 0.1  # m: chosen; the thesis's stood an inch away, nearer than a point source of this area allows
A_POLES = (20.598997, 107.65265, 737.86223, 12194.217)  # Hz, IEC 61672-1

MASS, STIFFNESS, BEARING = 1.92, 2310.0, 0.0177  # kg, N/m and damping ratio of the linear bearing (sections 2.2, 6.5)
FORCING = 5.0  # Hz
HEAVY = 6.13  # N
BENDING, TORSION = 185.0, 250.0  # Hz, of the beam without its contacts (section 7.3)

# chosen: the thesis does not give them
BEAM, INERTIA = 0.02, 5e-6  # kg and kg m^2 that move at the beam's tip
BENDING_DAMPING, TORSION_DAMPING = 0.017, 0.01
ENGAGED = 484.0  # Hz of bending alone with both contacts engaged under the heavy load
HERTZ = 1 / 3  # contact stiffness grows with this power of the load, as that of a sphere does
ARM, OFFSET = 13.8e-3, -0.95e-3  # m: half the distance of the contacts, and how far their middle is from the axis
LEVER, SKEW = 1.7e-3, 2.3e-3  # m: height of the contacts over the axis, and how much they differ from it


def sound_pressure(
    run: Trajectory | Record,
    *,
    fs: float | None = None,
    area: float = TIP,
    distance: float = MICROPHONE,
    normal: ArrayLike | str | None = None,
    baffled: bool = False,
) -> Record:
    r"""How loud is a vibrating surface at a distance?

    A small surface in a free field is a point source (Morse and Ingard, "Theoretical Acoustics", 1968, section 7.1):

    .. math:: p(t) = \frac{\rho\,S\,a_n(t - r/c)}{4\pi r}

    with S its area, a_n its acceleration towards the outside, r the distance, and air of 20 C: 1.204 kg/m^3, 343.2 m/s.
    Nothing is heard before the first wave arrives. A flat disk in a wall is exact on its axis at any distance, near too
    (Stepanishen, J. Acoust. Soc. Am. 49, 1971): what its middle and its edge send,

    .. math:: p(t) = \rho c\,[v_n(t - r/c) - v_n(t - R/c)], \quad R = \sqrt{r^2 + S/\pi}

    which far away is twice the point source, as the wall gives half of the sound back.

    Parameters
    ----------
    run : Trajectory or Record
        What vibrates; a Trajectory is sampled when the sound left it, a Record is delayed by its spectrum.
    fs : float, optional
        Sampling rate of the sound [Hz]; of a Trajectory alone, and needed there.
    area : float
        S [m^2].
    distance : float
        r [m].
    normal : array_like or str, optional
        Of a Trajectory: the share of each degree of freedom in a_n; the second alone of a structure where left out. Of
        a Record: the channel, "normal_acceleration" or "a" where left out.
    baffled : bool
        Whether it is a flat disk in a wall, and not a small surface in a free field.

    Returns
    -------
    Record
        With "sound" [Pa]: alone, or beside the channels of the Record given.

    Raises
    ------
    ModelError
        An area, distance or direction without meaning, or a surface so near or so large that it is no point.
    RecordError
        No rate for a Trajectory, or a Record without the acceleration.

    Examples
    --------
    A surface of 10 cm^2 that shakes with 100 m/s^2 (amplitude), heard one metre away:

    >>> t = np.arange(2000) / 8000
    >>> shaken = Record.of({"a": 100 * np.sin(2 * np.pi * 400 * t)}, fs=8000)
    >>> heard = sound_pressure(shaken, area=1e-3, distance=1.0)
    >>> round(float(np.sqrt(2) * np.std(heard["sound"][400:1600])), 5), round(1.204 * 1e-3 * 100 / (4 * np.pi), 5)
    (0.00958, 0.00958)
    """
    finite("area", area, unit="m^2", positive=True)
    finite("distance", distance, unit="m", positive=True)
    if distance < math.sqrt(area / math.pi) and not baffled:
        raise ModelError(
            f"distance = {distance:g} m from a surface of {area:g} m^2",
            "a point source is heard from farther away than its radius",
            "give a larger distance= or a smaller area=, or ask for a disk in a wall: baffled=True",
        )
    paths = _disk(area, distance) if baffled else [(AIR * area / (4 * math.pi * distance), distance / SPEED_OF_SOUND)]
    lag, arguments = paths[0][1], {"area": area, "distance": distance, "baffled": baffled}
    step = Step("sound_pressure", arguments, f"{lag * 1e3:.3g} ms later")
    if isinstance(run, Record):
        name = normal if isinstance(normal, str) else "normal_acceleration" if "normal_acceleration" in run else "a"
        run.require_clean(name, question="the sound of a surface")
        sent = _velocity(run[name], run.fs) if baffled else run[name]
        heard = sum((gain * _later(sent, lag * run.fs) for gain, lag in paths), np.zeros(len(run)))
        return run.with_channel("sound", heard, unit="Pa", source=name, step=step)
    if fs is None or not (math.isfinite(fs) and fs > 0):
        raise RecordError(f"fs = {fs}", "the sound of a simulated run is sampled at a positive rate", "give fs= in Hz")
    times = np.arange(int(np.floor(run.duration * fs * (1 + 1e-12))) + 1) / fs
    share, signal = _share(run, normal), "v" if baffled else "a"
    heard = sum((gain * _leaving(run, times - lag, share, signal) for gain, lag in paths), np.zeros(len(times)))
    samples = {"sound": heard}
    channels = {"sound": Channel("sound", "Pa", described("sound", "Pa"), source="sound_pressure")}
    return Record(samples, channels, float(fs), 0.0, (step,), None, {"system": repr(run.system)})


def squeak_record(
    run: Trajectory,
    *,
    fs: float = 10_000.0,
    snr: float = math.inf,
    rng: int | np.random.Generator | None = None,
    area: float = TIP,
    distance: float = MICROPHONE,
    baffled: bool = False,
) -> Record:
    """What the sensors of a squeak rig would have written of a run of :func:`squeak_rig`.

    The channels of the thesis's section 7.2 (2): displacement, velocity and acceleration of the mass, the base,
    friction, normal acceleration and angular velocity of the beam's tip, and the sound.

    Parameters
    ----------
    run : Trajectory
        Of a Structure of three degrees of freedom: tangential, normal, rotational.
    fs : float
        Sampling rate [Hz].
    snr : float
        Signal to noise [dB]: each channel's RMS about its mean over that of its white noise; none where infinite.
    rng : int or Generator, optional
        Where the noise comes from.
    area, distance, baffled : float, bool
        As in :func:`sound_pressure`.

    Returns
    -------
    Record
        Channels x, v, a, z, friction, normal_acceleration, torsion_velocity, sound.

    Raises
    ------
    ModelError
        A run of something else, or as in :func:`sound_pressure`.

    Examples
    --------
    >>> from stickslip.solve.simulate import simulate
    >>> from stickslip.squeak.sound import squeak_rig
    >>> record = squeak_record(simulate(squeak_rig(), duration=0.4), snr=30, rng=1)
    >>> list(record)
    ['x', 'v', 'a', 'z', 'friction', 'normal_acceleration', 'torsion_velocity', 'sound']
    """
    if not isinstance(run.system, Structure) or run.system.size != 3 or not run.table.motion.base:
        raise ModelError(
            f"a run of {type(run.system).__name__}",
            "the rig's record is of a tangential, a normal and a rotational motion on a moving base",
            "simulate squeak_rig()",
        )
    if math.isnan(snr):
        raise ModelError("snr = nan", "a signal-to-noise ratio is a number of decibel", "give snr= in dB")
    heard = sound_pressure(run, fs=fs, area=area, distance=distance, baffled=baffled)
    times = np.minimum(heard.time, run.duration)
    motion, _ = run.sample(times, ("x", "v", "a", "friction", "z"))
    rows = {
        "x": (motion[0], "m"), "v": (motion[3], "m/s"), "a": (motion[6], "m/s^2"), "z": (motion[-1], "m"),
        "friction": (motion[9:-1].sum(axis=0), "N"), "normal_acceleration": (motion[7], "m/s^2"),
        "torsion_velocity": (motion[5], "rad/s"), "sound": (heard["sound"], "Pa"),
    }  # fmt: skip
    generator = np.random.default_rng(rng)
    samples, channels = {}, {}
    for name, (values, unit) in rows.items():
        noise = float(np.std(values)) * 10 ** (-snr / 20)
        samples[name] = values + noise * generator.standard_normal(len(values))
        channels[name] = Channel(name, unit, described(name, unit), "squeak_record", noise=noise)
    step = Step("squeak_record", {"fs": fs, "snr": str(snr), "area": area, "distance": distance}, "virtual sensors")
    return Record(samples, channels, float(fs), 0.0, (step,), None, {"system": repr(run.system)})


def a_weighting(frequency: ArrayLike) -> Array:
    """The A-weighting of IEC 61672-1 as a factor of the amplitude; 1 at 1 kHz."""

    def weight(f: Array) -> Array:
        first, second, third, fourth = (pole * pole for pole in A_POLES)
        square = f * f
        root = np.sqrt((square + second) * (square + third))
        return np.asarray(fourth * square**2 / ((square + first) * root * (square + fourth)))

    return weight(np.asarray(frequency, dtype=float)) / weight(np.asarray(1000.0))


def level(values: Array, reference: float, *, fs: float, weighted: bool = False) -> float:
    """RMS in dB re `reference`; A-weighted if asked."""
    power = float(np.mean(values**2))
    if weighted:
        spectrum = np.abs(np.fft.rfft(values)) ** 2
        gain = a_weighting(np.fft.rfftfreq(len(values), 1 / fs)) ** 2
        power *= float(gain @ spectrum / max(spectrum.sum(), np.finfo(float).tiny))
    return 10 * math.log10(max(power, np.finfo(float).tiny) / reference**2)


def reference_of(unit: str) -> str:
    """What a level of this unit is told against."""
    named = {"Pa": "20 µPa", "m/s^2": "1 µm/s^2", "m/s": "1 nm/s", "N": "1 µN", "1": "1"}
    return named.get(unit, f"1 {unit}")


def _share(run: Trajectory, normal: ArrayLike | str | None) -> Array:
    size = run.rows("a").shape[1]
    share = np.zeros(size)
    share[min(1, size - 1)] = 1.0
    given = share if normal is None or isinstance(normal, str) else np.asarray(normal, dtype=float)
    if given.shape != (size,) or not np.all(np.isfinite(given)) or isinstance(normal, str):
        raise ModelError(f"normal = {normal!r}", f"it has {size} finite numbers", "correct normal=")
    return given


def _disk(area: float, distance: float) -> list[tuple[float, float]]:
    """What a disk's middle and edge send: pressure over velocity [Pa s/m], and how late [s]."""
    edge = math.hypot(distance, math.sqrt(area / math.pi))
    resistance = AIR * SPEED_OF_SOUND
    return [(resistance, distance / SPEED_OF_SOUND), (-resistance, edge / SPEED_OF_SOUND)]


def _velocity(acceleration: Array, fs: float) -> Array:
    """Its integral without mean, by the trapezoidal rule."""
    steps = (acceleration[1:] + acceleration[:-1]) / (2 * fs)
    summed = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(summed - np.mean(summed))


def _leaving(run: Trajectory, times: Array, share: Array, signal: str) -> Array:
    """Normal acceleration or velocity at instants, 0 before the run begins."""
    begun = times >= 0
    values = np.zeros(len(times))
    values[begun] = share @ run.sample(np.minimum(times[begun], run.duration), (signal,))[0]
    return values


def _later(values: Array, samples: float) -> Array:
    """`values` delayed by a number of samples that need not be whole; zero before."""
    whole, part = divmod(samples, 1.0)
    padded = np.concatenate([values, np.zeros(len(values))])
    spectrum = np.fft.rfft(padded) * np.exp(-2j * np.pi * part * np.fft.rfftfreq(len(padded)))
    shifted = np.fft.irfft(spectrum, len(padded))
    return np.concatenate([np.zeros(int(whole)), shifted])[: len(values)]


@dataclass(frozen=True)
class Surface:
    """Friction coefficient of both contacts at vanishing speed, and its slope [s/m]."""

    friction: float
    slope: float


SURFACES = {
    "dry": Surface(20 / HEAVY, 2.3),
    "wet": Surface(8 / HEAVY, -0.26),
}  # 20 and 8 N (section 7.2); slopes chosen


def squeak_rig(surface: str = "wet", load: float | str = HEAVY, *, amplitude: float = 8e-3) -> Structure:
    r"""A rig that squeaks where it is wet and heavily loaded, and only there.

    A mass on a linear bearing is driven by its base at 5 Hz and rubs on two rubber hemispheres at the tip of a
    beam, which bends towards the mass and twists: three degrees of freedom (x of the mass, x2 of the tip across it,
    x3 its angle [rad]), tangential, normal and rotational, as section 8.2 of the thesis asks for. Of chapter 7 are the
    masses, springs, frequencies and friction levels; inertia, levers, slopes and damping of the beam are chosen so that
    its four observations hold together: the contacts stiffen with the load until bending and torsion, at 185 and 250 Hz
    without contact, meet near 490 Hz; water lowers friction to where they couple (dry, friction shifts torsion past
    bending), while its falling slope alone is too weak. Which of them decides, :func:`stability` says.

    Parameters
    ----------
    surface : {"wet", "dry"}
        Friction of 8 or 20 N under the heavy load, falling or rising with speed.
    load : float or str
        Normal load on both contacts together [N]; the thesis has 6.13 and 1.23.
    amplitude : float
        Of the mass's motion [m], roughly: the base moves as far as that takes against the friction by harmonic balance.
        Where friction nearly holds the mass the motion is up to two thirds smaller; to drive it to like motions, as
        the thesis did, move the base as the mass alone needs it (``stickslip_thesis.chapter7.base_for``).

    Returns
    -------
    Structure
        Driven by a :class:`HarmonicBase`; for steady sliding give it a Belt: ``rig.having(drive=Belt(0.1))``.

    Raises
    ------
    ModelError
        No such surface, or a load or an amplitude that is not positive.

    Examples
    --------
    >>> from stickslip.squeak.stability import stability
    >>> for surface, load in [("dry", 6.13), ("wet", 6.13), ("dry", 1.23), ("wet", 1.23)]:
    ...     print(surface, load, stability(squeak_rig(surface, load), speed=-0.1).mechanism)
    dry 6.13 stable
    wet 6.13 mode coupling
    dry 1.23 stable
    wet 1.23 stable
    """
    if surface not in tuple(SURFACES):
        raise ModelError(f"surface = '{surface}'", f"it is {' or '.join(SURFACES)}", "choose one of them")
    load = parse_constant("load", load, "N")
    amplitude = finite("amplitude", amplitude, unit="m", positive=True)
    rubber, turn = SURFACES[surface], 2 * math.pi
    bends, twists = BEAM * (turn * BENDING) ** 2, INERTIA * (turn * TORSION) ** 2
    stiffness = BEAM * turn**2 * (ENGAGED**2 - BENDING**2) * (load / HEAVY) ** HERTZ
    damping = [
        2 * BEARING * math.sqrt(MASS * STIFFNESS),
        2 * BENDING_DAMPING * math.sqrt(BEAM * bends),
        2 * TORSION_DAMPING * math.sqrt(INERTIA * twists),
    ]
    contacts = [
        Contact(
            LinearSlope(rubber.friction, slope=rubber.slope),
            [1, 0, LEVER + side * SKEW],
            normal=[0, 1, OFFSET + side * ARM],
            stiffness=stiffness / 2,
            preload=load / 2,
        )
        for side in (1, -1)
    ]
    return Structure(
        np.diag([MASS, BEAM, INERTIA]),
        np.diag(damping),
        np.diag([STIFFNESS, bends, twists]),
        contacts=contacts,
        drive=HarmonicBase(_base(rubber.friction * load, amplitude), frequency=FORCING),
        acts_on=[1, 0, 0],
        rotations=[3],
    )


def _base(friction: float, amplitude: float) -> float:
    """Amplitude of the base that moves the mass so far, by harmonic balance [m]."""
    detuned = 1 - (2 * math.pi * FORCING) ** 2 * MASS / STIFFNESS
    return math.hypot(amplitude * detuned, 4 * friction / (math.pi * STIFFNESS))
