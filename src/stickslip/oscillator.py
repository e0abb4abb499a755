"""What moves: one mass on a spring, along a line or in a plane, and several degrees of freedom that rub at several
contacts.

Each has what moves it and what it rubs on; the loads of a structure may follow its motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from stickslip.arrays import Array
from stickslip.drives.kinds import Drive, Release, require_drive
from stickslip.drives.on_another import Both
from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Law, Mode, loads_of, of_speed
from stickslip.laws.coulomb import Coulomb, LinearSlope
from stickslip.laws.curved import (
    Creeping,
    CurvedLaw,
    CurvedMode,
    Expression,
    curved_modes,
    lifted,
    symbol,
    with_sliding_modes,
)
from stickslip.laws.guessing import registered
from stickslip.laws.stribeck import SpeedCurve, Tabulated, TimeDelay
from stickslip.parameters import changed, finite, parameter, parametric

ROUNDED = 1e-6  # of the largest stiffness: an asymmetry below it is no one's intention


@parametric(eq=False)
class Contact:
    r"""One place where a structure rubs: a direction of sliding, a friction law, and the load that presses it.

    The load is :math:`N = N_0 + k_n\,w_n\cdot q`, and the contact pushes back with it; the preload comes from outside
    and balances it at q = 0. With a `power` m other than 1 it is :math:`N = N_0 (1 + k_n\,w_n\cdot q/(m N_0))^m`, whose
    stiffness at the preload is :math:`k_n` (of a sphere m = 1.5: Hertz; of rough surfaces 2 to 3.3: Oden and Martins,
    Computer Methods in Applied Mechanics and Engineering 52, 1985). Every force level of the law is multiplied by N: a
    friction coefficient in place of a force. Where friction depends on the speed, as a straight line
    :math:`\mu_0 + s v` or a table of them, it is :math:`\mu_0 N + s N_0 v`: its slope keeps to the preload, for the
    product of load and speed is not linear. Curved laws are coefficients as a whole, :math:`f = N \mu(v, \theta)`, and
    so are a slider's spring and damper. At N = 0
    the contact separates, and it closes again where N would rise above zero. Without `normal` the
    load is the preload; as that is 1 where left out, the levels of the law are then forces [N], as in an Oscillator.

    Raises
    ------
    ModelError
        A value has no meaning, or the law's forces can not follow a load.

    Examples
    --------
    >>> from stickslip.laws.coulomb import Coulomb
    >>> pad = Contact(Coulomb(0.4), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0)
    >>> [mode.name for mode in pad.modes()]
    ['back', 'stuck', 'forward', 'lifted', 'landing']
    """

    law: Law = parameter(
        "",
        "friction law",
        note="under a load that follows the motion: Coulomb, LinearSlope, Tabulated, CompliantContact or a curved law; "
        "under a preload also ElastoSlip and InertialContact; any other where its levels are forces",
    )
    tangent: ArrayLike = parameter(
        "1",
        "direction of sliding",
        size="array",
        note="w_t (n,): the contact slides by :math:`w_t q` less the counter-face's motion",
    )
    normal: ArrayLike | None = parameter(
        "1",
        "direction that presses the contact",
        default=None,
        size="array",
        note="w_n (n,); that of `tangent` where one motion slides and presses, as a sprag does",
    )
    stiffness: float = parameter(
        "N/m",
        "normal stiffness",
        default=0.0,
        note="k_n; positive where `normal` is given. It is not part of the structure's K",
    )
    power: float = parameter(
        "1", "power of the load", default=1.0, positive=True, note="m, by which the load grows with the approach"
    )
    preload: float = parameter("N", "normal load", default=1.0, note="N_0")
    carried: float = parameter(
        "1",
        "share of the belt",
        default=1.0,
        signed=True,
        note="of the motion of the counter-face (belt, moving base) seen here; 0: the counter-face is at rest here",
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "tangent", _direction("tangent", self.tangent))
        if isinstance(self.law, TimeDelay):
            raise ModelError(
                "TimeDelay in a structure",
                "a lag is followed in a single mass",
                "use an Oscillator, or SmoothStateVariable for a friction that lags",
            )
        if self.power != 1 and (self.normal is None or not self.preload > 0):
            raise ModelError(
                f"power = {self.power} without {'normal' if self.normal is None else 'a preload'}",
                "a load grows with a power from its preload on, along a direction",
                "give normal= and preload=, or leave out power=",
            ).of("power")
        if self.normal is None:
            if self.stiffness != 0:
                raise ModelError(
                    f"stiffness = {self.stiffness} N/m without normal",
                    "a load follows the motion in a direction",
                    "give normal=, or leave out stiffness=",
                ).of("stiffness")
            if self.preload != 1:
                self._require("preload", "under a preload")
            return
        object.__setattr__(self, "normal", _direction("normal", self.normal))
        finite("stiffness", self.stiffness, unit="N/m", positive=True)
        self._require("normal", "under a load that follows the motion")

    def _require(self, pressed: str, where: str) -> None:
        """Refuse a law whose forces are not all proportional to the load."""
        if pressed not in loads_of(self.law):
            fitting = [name for name, law in registered().items() if pressed in loads_of(law)]
            raise ModelError(
                f"{type(self.law).__name__} {where}",
                "its forces are not proportional to the load in every mode",
                f"use {' or '.join(fitting)}, or leave out normal= and preload=",
            )

    def modes(self) -> tuple[Any, ...]:
        """The law's table with "1" meaning the load, and what a contact adds to it.

        A load that follows the motion adds flight. Where the law starts in different modes by the sign of velocity,
        "landing" decides between them; no time passes in it.
        """
        own: Any = self.law
        if isinstance(own, CurvedLaw):
            return self.closing(curved_modes(own), own.entry)
        return self.closing(tuple(map(self._pressed, with_sliding_modes(own.modes()))), own.entry)

    def closing(self, law: tuple[Any, ...], entry: tuple[str, str, str]) -> tuple[Any, ...]:
        """A law's modes, which start in `entry` by the sign of velocity, and those that a contact adds to them."""
        none: Any = lifted(0.0) if isinstance(law[0], CurvedMode) else {}
        lands, made = len(set(entry)) > 1, type(law[0])
        start = (Exit({"v": 1.0}, entry[2]), Exit({"v": -1.0}, entry[0]), Exit({"always": 1.0}, entry[1]))
        landing = made("landing", "landing", 0, none, start)
        if self.normal is None:
            return (*law, landing) if lands else law
        closed = "1" if self.power == 1 else "closed"  # a power of nothing has no side
        lift = Exit({closed: -1.0}, "lifted")
        close = Exit({closed: 1.0}, "landing" if lands else entry[1], self.law.memory)
        flight = made("lifted", "flight", 0, none, (close,))
        every = (*law, landing) if lands else law
        pressed = tuple(replace(mode, exits=(lift, *map(self._followed, mode.exits))) for mode in every)
        return (*pressed[: len(law)], flight, *pressed[len(law) :])

    def _pressed(self, mode: Mode) -> Mode:
        """A mode of friction over speed: the slope of a coefficient becomes a force's, bounds on the speed stay."""
        if not isinstance(self.law, LinearSlope | Tabulated):
            return mode
        if mode.friction is not None:
            mode = replace(mode, friction={**mode.friction, "v": mode.friction["v"] * self.preload})
        return replace(mode, exits=tuple(replace(exit_, quantity=of_speed(exit_.quantity)) for exit_ in mode.exits))

    def _followed(self, exit_: Exit) -> Exit:
        """A stop at zero velocity, as it is while the load changes the deflection of a compliant contact.

        The slider is where a stop would leave it, at the place that the exit resets: it stops when that place does.
        """
        if not (exit_.crossing and set(exit_.quantity) == {"v"} and len(exit_.reset) == 1):
            return exit_
        (place,) = exit_.reset.values()
        return replace(exit_, quantity={**exit_.quantity, "d1": exit_.quantity["v"] * place.get("1", 0.0)})

    @property
    def entry(self) -> str:
        """Name of the mode in which the contact starts, before any exit that is due at once."""
        return "landing" if len(set(self.law.entry)) > 1 else self.law.entry[1]


@parametric(eq=False)
class Structure:
    r"""Several degrees of freedom that rub at several contacts.

    .. math:: M\ddot q + C\,(\dot q - r\dot d) + K\,(q - r z) + \sum w_t f + \sum w_n (N - N_0) = r P(t)

    z is the base's displacement and d the dampers' other ends'; each contact adds its friction f and its load N, as in
    :class:`Contact`. Contacts that hold rigidly share their forces through M.

    Raises
    ------
    ModelError
        A value has no meaning, shapes do not fit, or rigid contacts slide along dependent directions.

    Examples
    --------
    A mass on a belt, sprung along it and across it, pressed by the contact it slides on; above a critical friction
    coefficient both motions couple and grow:

    >>> from stickslip.drives.kinds import Belt
    >>> from stickslip.laws.coulomb import Coulomb
    >>> from stickslip.solve.simulate import simulate
    >>> pad = Contact(Coulomb(0.6), [1, 0], normal=[0, 1], stiffness=11.0, preload=5.0)
    >>> springs = [[23.25, 3.9], [3.9, 7.75]]
    >>> mass = Structure([[1, 0], [0, 1]], [[0, 0], [0, 0]], springs, contacts=[pad], drive=Belt(0.8))
    >>> run = simulate(mass, duration=25, start={"x1": 0.3, "v1": 0.0})
    >>> sorted({event.mode for event in run.events})
    ['back', 'forward', 'lifted', 'stuck']
    """

    mass: ArrayLike = parameter(
        "kg", "mass matrix", size="array", note="M (n, n), positive definite; a number for one degree of freedom"
    )
    damping: ArrayLike = parameter("N s/m", "damping matrix", size="array", note="C (n, n)")
    stiffness: ArrayLike = parameter(
        "N/m", "stiffness matrix", size="array", note="K (n, n), symmetric, without the contacts'"
    )
    contacts: Sequence[Contact] = parameter("", "where it rubs", default=())
    drive: Drive = parameter("", "what moves", default=Release(), note="nothing where left out")
    acts_on: ArrayLike | None = parameter(
        "1",
        "share of the drive",
        default=None,
        size="array",
        note="r (n,): of its force on every degree of freedom, or of the base's motion in it; 1 for all where left out",
    )
    damper: str = parameter("", "what the dampers are fixed to", default="ground", choices=("ground", "base"))
    rotations: Sequence[int] = parameter(
        "",
        "degrees of freedom that are angles [rad]",
        default=(),
        note="by number, from 1; their rows and columns are then in kg m^2, N m s and N m",
    )

    def __post_init__(self) -> None:
        size = len(_matrix("mass", self.mass))
        for name in ("mass", "damping", "stiffness"):
            object.__setattr__(self, name, _matrix(name, getattr(self, name), size))
        _require_mass(np.asarray(self.mass))
        _require_symmetric(np.asarray(self.stiffness))
        if isinstance(self.contacts, Contact) or not all(isinstance(contact, Contact) for contact in self.contacts):
            raise ModelError(
                f"contacts = {self.contacts!r}", "contacts are a list of Contact", "give contacts=[...]"
            ).of("contacts")
        object.__setattr__(self, "contacts", tuple(self.contacts))
        require_drive(self.drive)
        if self.drive.motion().imposed:
            raise ModelError(
                "a structure under an imposed motion", "a motion is imposed on one mass", "give an Oscillator"
            ).of("drive")
        _require_directions(self.contacts, size)
        share = np.ones(size) if self.acts_on is None else _direction("acts_on", self.acts_on)
        if share.shape != (size,):
            raise ModelError(f"acts_on of {len(share)} numbers", f"it has {size}", "correct acts_on=")
        object.__setattr__(self, "acts_on", share)
        object.__setattr__(self, "rotations", _angles(self.rotations, size))
        _require_determined(self.contacts)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return len(np.asarray(self.mass))

    @property
    def tangents(self) -> Array:
        """Directions of sliding, a row for each contact (m, n)."""
        return np.array([contact.tangent for contact in self.contacts]).reshape(len(self.contacts), self.size)

    @property
    def frequency(self) -> float:
        """Lowest natural frequency of M and K above zero [Hz]; 0 where there is none."""
        squares = np.linalg.eigvals(np.linalg.solve(np.asarray(self.mass), np.asarray(self.stiffness))).real
        real = squares[squares > 1e-12 * np.max(np.abs(squares), initial=0.0)]
        return math.sqrt(float(np.min(real))) / (2 * math.pi) if len(real) else 0.0

    def having(self, **changes: Any) -> Structure:
        """The same structure with other values; a name is looked for in the structure, its drive, then its contacts.

        Parameters
        ----------
        **changes
            New values by name; one that belongs to contacts or their laws is changed in every one that has it. With
            its place it is changed there alone (``**{"contacts.2.law.kinetic": 0.4}``).

        Returns
        -------
        Structure
        """
        return changed(self, changes)


def _require_directions(contacts: Sequence[Contact], size: int) -> None:
    for contact in contacts:
        for name in ("tangent", "normal"):
            row = getattr(contact, name)
            if row is not None and len(row) != size:
                raise ModelError(
                    f"{name} of {len(row)} numbers in a structure of {size} degrees of freedom",
                    "a direction has a number for each degree of freedom",
                    f"correct {name}= of the contact",
                )


def _require_determined(contacts: Sequence[Contact]) -> None:
    """Refuse rigid contacts that hold one motion twice: how they share its force is not told."""
    if len(contacts) < 2:
        return
    rigid = [contact.tangent for contact in contacts if any(m.friction is None for m in contact.modes())]
    if rigid and np.linalg.matrix_rank(np.array(rigid)) < len(rigid):
        raise ModelError(
            f"{len(rigid)} rigid contacts whose directions of sliding depend on each other",
            "the forces that hold them would be undetermined",
            "give one of them a tangential stiffness (CompliantContact)",
        )


def _angles(rotations: Sequence[int], size: int) -> tuple[int, ...]:
    """The degrees of freedom that turn, counted from 1."""
    angles = np.atleast_1d(np.asarray(rotations, dtype=object)).tolist()
    if not all(isinstance(angle, int) and 1 <= angle <= size for angle in angles):
        raise ModelError(
            f"rotations = {rotations!r}",
            f"they are numbers of degrees of freedom, from 1 to {size}",
            "correct rotations=",
        ).of("rotations")
    return tuple(angles)


def _require_mass(mass: Array) -> None:
    if not np.array_equal(mass, mass.T) or not _positive(mass):
        raise ModelError(
            f"mass = {mass.tolist()} kg",
            "a mass matrix is symmetric and positive definite",
            "correct mass=: every degree of freedom needs a mass",
        ).of("mass")


def _require_symmetric(stiffness: Array) -> None:
    """Refuse springs that do not push both ends alike, beyond what a program that wrote them has rounded."""
    apart = np.abs(stiffness - stiffness.T)
    i, j = np.unravel_index(int(np.argmax(apart)), apart.shape)
    if apart[i, j] > ROUNDED * np.max(np.abs(stiffness)):
        raise ModelError(
            f"stiffness with {stiffness[i, j]:g} N/m in row {i + 1}, column {j + 1} but {stiffness[j, i]:g} N/m across",
            "a matrix of springs is symmetric",
            "correct stiffness=; friction that follows a load belongs to a Contact with normal=",
        )


def _positive(mass: Array) -> bool:
    """Whether a symmetric matrix is positive definite beyond rounding, whatever the units of its rows."""
    units = np.sqrt(np.maximum(np.diag(mass), 0.0))
    if not np.all(units > 0):
        return False
    return bool(np.min(np.linalg.eigvalsh(mass / np.outer(units, units))) > 1e-14 * len(mass))


def _numbers(name: str, values: ArrayLike) -> Array:
    try:
        return np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as reason:
        raise ModelError(f"{name} = {values!r}", f"{name} is numbers in rows of equal length", "correct it").of(
            name
        ) from reason


def _direction(name: str, values: ArrayLike) -> Array:
    row = np.atleast_1d(_numbers(name, values))
    if row.ndim != 1 or not np.all(np.isfinite(row)) or not np.any(row):
        raise ModelError(
            f"{name} = {row.tolist()}", f"{name} is a row of finite numbers, not all zero", "correct it"
        ).of(name)
    row.flags.writeable = False
    return row


def _matrix(name: str, values: ArrayLike, size: int | None = None) -> Array:
    """A square matrix; of `size` rows where given."""
    matrix = np.atleast_2d(_numbers(name, values))
    count = max(matrix.shape) if size is None else size
    if matrix.shape != (count, count) or not np.all(np.isfinite(matrix)):
        raise ModelError(
            f"{name} of shape {matrix.shape}: {matrix.tolist()}",
            f"it is {count} by {count} finite numbers: one row for each degree of freedom",
            f"correct {name}=",
        )
    matrix.flags.writeable = False
    return matrix


@parametric
class Oscillator:
    r"""One mass: :math:`m\ddot x + c\,(\dot x - \dot d) + k\,(x - z) + f = P(t)`, z the spring's end, d the damper's.

    Raises
    ------
    ModelError
        A value has no meaning.

    Examples
    --------
    >>> from stickslip.laws.coulomb import Coulomb
    >>> slider = Oscillator(mass=2.42, stiffness=2310, law=Coulomb(1.1))
    >>> round(slider.frequency, 3), slider.having(kinetic=1.28, mass=3.0).law
    (4.917, Coulomb(kinetic=1.28, static=None))
    """

    mass: float = parameter("kg", "mass", positive=True, note="m")
    stiffness: float = parameter("N/m", "stiffness", note="k; zero: no spring")
    law: Law | CurvedLaw = parameter("", "friction law of the contact")
    drive: Drive = parameter("", "what moves", default=Release(), note="nothing (free decay) where left out")
    damping: float = parameter("N s/m", "damping", default=0.0, signed=True, note="c; negative: self-excited")
    damper: str = parameter("", "what the damper is fixed to", default="ground", choices=("ground", "base"))

    def __post_init__(self) -> None:
        if isinstance(self.law, type) or not (hasattr(self.law, "modes") or hasattr(self.law, "rates")):
            raise ModelError(
                f"law = {self.law!r}", "a mass rubs under a friction law", "give one, as law=Coulomb(1.1)"
            ).of("law")
        require_drive(self.drive)
        if self.drive.motion().imposed:
            _require_given_way(self.law)

    @property
    def frequency(self) -> float:
        """Natural frequency without friction and damping [Hz]."""
        return math.sqrt(self.stiffness / self.mass) / (2 * math.pi)

    def having(self, **changes: Any) -> Oscillator:
        """The same oscillator with other values; a name is looked for in the oscillator, its law, then its drive.

        Parameters
        ----------
        **changes
            New values by name (``mass=3.0, kinetic=1.28, frequency=5.61``), or by name and place
            (``**{"law.stiffness": 1e5}``).

        Returns
        -------
        Oscillator
        """
        return changed(self, changes)


def _require_given_way(law: Any) -> None:
    """Refuse a law under an imposed motion that would hold the mass."""
    name = type(law).__name__
    modes = law.rates() if isinstance(law, CurvedLaw) else law.modes()
    if isinstance(law, Creeping) or any(mode.friction is None for mode in modes):
        raise ModelError(
            f"{name} under an imposed motion",
            "a rigid contact would hold the mass against it",
            "put a spring before it: CompliantContact(), or InSeries() of this law",
        ).of("law")


@parametric(eq=False)
class PlanarOscillator:
    r"""One mass that rubs in a plane: friction lies on a disc, and couples the two directions.

    .. math:: m\ddot x_i + c_i\,(\dot x_i - \dot d_i) + k_i\,(x_i - z_i) + f_i = P_i(t), \qquad i = 1, 2

    While it slides :math:`f = F(|u|)\,u/|u|`, u the velocity against the counter-face; at rest whatever holds it, up to
    :math:`|f| \le f_s`: a point whose friction is alike in all directions (Goyal, Ruina and Papadopoulos, Wear 143,
    1991).

    Raises
    ------
    ModelError
        A value has no meaning, or friction does not follow the sliding speed alone by one smooth curve.

    Examples
    --------
    A block on a conveyor, given a small velocity across it, drifts as if friction were viscous:

    >>> from stickslip.drives.kinds import Belt
    >>> from stickslip.solve.simulate import simulate
    >>> block = PlanarOscillator(1.0, (100.0, 0.0), Coulomb(2.0), drives=(Belt(1.0), Release()))
    >>> run = simulate(block, duration=2.0, start={"x1": 0.02, "v1": 0.0, "v2": 1e-3})
    >>> round(run.state(0.5)["v2"] / 1e-3, 4), round(math.exp(-2.0 * 0.5), 4)  # of 2 N over 1 m/s and 1 kg
    (0.3679, 0.3679)
    """

    mass: float = parameter("kg", "mass", positive=True, note="m")
    stiffness: ArrayLike = parameter(
        "N/m", "stiffness", size="array", note="k along both axes, or one for either; zero: no spring"
    )
    law: Coulomb | SpeedCurve = parameter(
        "", "friction law", note="Coulomb, LinearSlope, Stribeck or FrictionCurve: its magnitude over the sliding speed"
    )
    drives: Sequence[Drive] = parameter(
        "", "what moves along either axis", default=(Release(), Release()), note="two; nothing where left out"
    )
    damping: ArrayLike = parameter("N s/m", "damping", default=0.0, size="array", note="c, as the stiffness")
    damper: str = parameter("", "what the dampers are fixed to", default="ground", choices=("ground", "base"))

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping"):
            object.__setattr__(self, name, _pair(name, getattr(self, name)))
        if len(tuple(self.drives)) != 2:
            raise ModelError(
                f"{len(tuple(self.drives))} drives of a mass in a plane",
                "each of the two axes has its own",
                "give two, as drives=(HarmonicBase(1e-3, frequency=2.5), Release())",
            ).of("drives")
        object.__setattr__(self, "drives", tuple(self.drives))
        self.drive.motion()
        _require_disc(self.friction, self.breakaway)

    @property
    def friction(self) -> Expression:
        """Magnitude of the friction [N] over the sliding speed "v"."""
        if isinstance(self.law, Coulomb):
            return lifted(self.law.kinetic)
        branches = self.law.branches() if isinstance(self.law, SpeedCurve) else ()
        if len(branches) != 1:
            raise ModelError(
                f"{type(self.law).__name__} in a plane",
                "friction in a plane follows the sliding speed alone, by one smooth curve",
                "use Coulomb, LinearSlope, Stribeck or FrictionCurve",
            ).of("law")
        return lifted(branches[0][1](symbol("v")))

    @property
    def breakaway(self) -> float:
        """Largest friction force while stuck [N]: the radius of the disc."""
        return float(self.law.breakaway)

    @property
    def drive(self) -> Both:
        """Both drives as one."""
        return Both(*self.drives)

    @property
    def frequency(self) -> float:
        """Lower natural frequency above zero, without friction and damping [Hz]; 0 where there is none."""
        stiffness = np.asarray(self.stiffness)
        springs = stiffness[stiffness > 0]
        return math.sqrt(float(springs.min()) / self.mass) / (2 * math.pi) if len(springs) else 0.0

    def having(self, **changes: Any) -> PlanarOscillator:
        """The same with other values; a name is looked for in the oscillator, its law, then its drives.

        Parameters
        ----------
        **changes
            New values by name, or by name and place (``**{"drives.2.amplitude": 1e-3}``).

        Returns
        -------
        PlanarOscillator
        """
        return changed(self, changes)


def _pair(name: str, values: ArrayLike) -> tuple[float, float]:
    """A number for each of the two axes."""
    row = np.atleast_1d(_numbers(name, values))
    if row.shape not in ((1,), (2,)) or not np.all(np.isfinite(row)) or (name == "stiffness" and np.any(row < 0)):
        raise ModelError(
            f"{name} = {values!r}",
            f"{name} in a plane is one finite number for both axes or two, of springs none negative",
            f"give {name}=(first, second)",
        ).of(name)
    first, second = np.broadcast_to(row, 2).tolist()
    return first, second


def _require_disc(friction: Expression, breakaway: float) -> None:
    """Refuse friction of no force at rest, or whose slope there has no number."""
    rest = friction.at(v=0.0)
    try:
        smooth = math.isfinite(friction.slope("v").at(v=0.0))
    except ModelError:
        smooth = False
    if not (rest > 0 and math.isfinite(breakaway) and smooth):
        raise ModelError(
            f"friction of {rest:g} N at rest, {'smooth' if smooth else 'of no finite slope'} there",
            "sliding in a plane begins and ends on a disc of some radius, along a smooth curve",
            "give a law with friction at rest, a Stribeck of exponent= 1 or more; without friction take Structure",
        ).of("law")
