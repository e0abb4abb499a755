"""Two surfaces: friction that fluctuates along the way, and materials that rub, by name, as a contact."""

from __future__ import annotations

import functools
import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from typing import Any

import numpy as np

from stickslip.arrays import Array
from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Mode, Row
from stickslip.laws.compliant import CompliantContact
from stickslip.laws.coulomb import Coulomb
from stickslip.laws.series import ElastoSlip
from stickslip.parameters import finite, parameter, parametric

CELLS = 60  # from the middle to either end: a run that starts far out crosses them without time between


@dataclass(frozen=True)
class _Over(Mode):
    """A mode over one cell of the surface: to cross into the next cell is no event."""

    def changes(self, before: Mode, leaving: int) -> Iterator[tuple[int, Mode, Mode]]:
        if (before.kind, before.side) != (self.kind, self.side):
            yield 0, before, self


@parametric
class RoughSurface:
    r"""A contact whose friction forces are multiplied by a random profile along the counter-face, :math:`1 + r(x)`.

    The profile is a polygon through independent Gaussian values, one in each `length`; beyond `span` it stays as it
    is there. Friction is piecewise linear in x, so that the motion stays a closed form between events.

    Raises
    ------
    ModelError
        A value has no meaning, more than 60 lengths in the span, or a contact of another kind.

    Examples
    --------
    >>> surface = RoughSurface(Coulomb(1.1), share=0.03, length=1e-4, span=1e-3, seed=1)
    >>> len(surface.modes()), bool(0.9 < surface.profile(0.0) < 1.1)
    (66, True)
    """

    chosen = ("seed",)  # not fitted

    contact: Coulomb | CompliantContact = parameter("", "contact on the even surface")
    share: float = parameter(
        "1", "unevenness", note="standard deviation of r along the surface: 0.03 is 3 % of the friction"
    )
    length: float = parameter("m", "length", positive=True, note="within which the friction changes")
    span: float = parameter("m", "span", positive=True, note="half the length of the surface, around x = 0")
    seed: int = parameter("", "which surface", default=0, note="one of the same seed is the same")
    values: Sequence[float] | None = parameter(
        "1",
        "profile",
        default=None,
        size="array",
        note="1 + r itself, at equal distances of `length` around x = 0, where it is known",
    )

    def __post_init__(self) -> None:
        if (
            not isinstance(self.contact, Coulomb | CompliantContact)
            or getattr(self.contact, "rule", "") == "consistent"
        ):
            raise ModelError(
                f"a rough surface under {self.contact!r}",
                "it is laid under Coulomb or the CompliantContact of the literal rule",
                "use one of the two",
            )
        if self.values is not None and not (len(self.values) >= 2 and np.all(np.isfinite(self.values))):
            raise ModelError(
                f"values = {self.values}", "a profile has two finite values or more", "correct them, or leave them out"
            ).of("values")
        if self.share > 0.3 or self.span / self.length > CELLS:
            raise ModelError(
                f"share = {self.share}, span = {self.span} m of {self.length} m each",
                f"the fluctuation is 0.3 at most, and the span has at most {CELLS} lengths",
                "make the surface smoother, shorter, or of longer waves",
            ).of("share")

    @cached_property
    def knots(self) -> Array:
        """Places [m] and values of the profile (n, 2)."""
        cells = 2 * math.ceil(self.span / self.length) if self.values is None else len(self.values) - 1
        places = self.length * (np.arange(cells + 1) - cells / 2)
        if self.values is not None:
            return np.column_stack([places, np.maximum(0.0, self.values)])
        chance = np.random.default_rng(self.seed).standard_normal(cells + 1)
        # between two knots a polygon has 2/3 of their variance
        return np.column_stack([places, np.maximum(0.0, 1 + math.sqrt(1.5) * self.share * chance)])

    def profile(self, x: float) -> float:
        """The friction at a place [m] over that of the even surface.

        Parameters
        ----------
        x : float
            Place on the counter-face [m].

        Returns
        -------
        float
        """
        return float(np.interp(x, *self.knots.T))

    @property
    def kinetic(self) -> float:
        """Mean sliding friction [N]."""
        return self.contact.kinetic

    @property
    def memory(self) -> Mapping[str, Row]:
        """The contact's."""
        return self.contact.memory

    @property
    def places(self) -> tuple[str, ...]:
        """The contact's."""
        return self.contact.places

    @property
    def entry(self) -> tuple[str, str, str]:
        """Modes in which motion starts, at x = 0; elsewhere the cells are crossed before time passes."""
        middle = (len(self.knots) + 1) // 2
        back, still, forward = (f"{name} {middle}" for name in self.contact.entry)
        return back, still, forward

    def modes(self) -> tuple[Mode, ...]:
        """The contact's modes over each cell of the surface, and over the even ends."""
        places, values = self.knots.T
        slopes = np.concatenate([[0.0], np.diff(values) / np.diff(places), [0.0]])
        starts = np.concatenate([values[:1], values])
        origins = np.concatenate([places[:1], places])
        edges = np.concatenate([[-np.inf], places, [np.inf]])
        return tuple(
            self._over(mode, cell, float(starts[cell] - slopes[cell] * origins[cell]), float(slopes[cell]), edges)
            for cell in range(len(slopes))
            for mode in self.contact.modes()
        )

    def _over(self, mode: Mode, cell: int, level: float, slope: float, edges: Array) -> Mode:
        """A mode over one cell, in which every force of the contact is multiplied by level + slope x."""

        def put(form: Row) -> dict[str, float]:
            other = {name: value for name, value in form.items() if name != "1"}
            force = form.get("1", 0.0)
            put_ = {**other, "1": force * level, "x": other.get("x", 0.0) + force * slope}
            return {name: value for name, value in put_.items() if value}

        exits = []
        if np.isfinite(edges[cell + 1]):
            exits.append(Exit({"x": 1.0, "1": -float(edges[cell + 1])}, f"{mode.name} {cell + 1}"))
        if np.isfinite(edges[cell]):
            exits.append(Exit({"x": -1.0, "1": float(edges[cell])}, f"{mode.name} {cell - 1}"))
        for exit_ in mode.exits:
            reset = {name: put(form) for name, form in exit_.reset.items()}
            exits.append(Exit(put(exit_.quantity), f"{exit_.to} {cell}", reset, exit_.crossing))
        friction = None if mode.friction is None else put(mode.friction)
        return _Over(f"{mode.name} {cell}", mode.kind, mode.side, friction, tuple(exits))


@dataclass(frozen=True)
class Pair:
    """Two materials that rub, as :func:`pair` knows them.

    Attributes
    ----------
    name : str
        "steel on steel": the sphere's material first.
    kinetic, static : float
        Coefficients of friction.
    modulus : float
        Of both together across, :math:`1/E^* = \\sum (1 - \\nu^2)/E` [Pa].
    shear : float
        Of both together along, :math:`1/G^* = \\sum 2 (2 - \\nu)(1 + \\nu)/E` [Pa].
    loss : float
        Loss factor: each material's, as it gives way.
    sources : tuple of str
        Where the numbers are from.
    """

    name: str
    kinetic: float
    static: float
    modulus: float
    shear: float
    loss: float
    sources: tuple[str, ...]

    def stiffness(self, load: float, *, radius: float) -> float:
        r"""How stiff is a sphere along the flat that it is pressed on, before it slips?

        .. math:: K = 8 a G^*, \quad a^3 = \frac{3 N R}{4 E^*}

        (Hertz; Mindlin, Journal of Applied Mechanics 16, 1949).

        Parameters
        ----------
        load : float
            Normal load N [N].
        radius : float
            Of the sphere, R [m].

        Returns
        -------
        float
            K [N/m].

        Examples
        --------
        >>> stiff, soft = (pair(name).stiffness(3.53, radius=5e-3) for name in ("steel on steel", "Teflon on steel"))
        >>> round(stiff / soft)
        38
        """
        finite("load", load, unit="N", positive=True)
        finite("radius", radius, unit="m", positive=True)
        return 8 * math.cbrt(0.75 * load * radius / self.modulus) * self.shear

    def sphere(self, load: float, *, radius: float, elements: int = 12) -> ElastoSlip:
        """The contact of a sphere that slips from the rim inwards: curved from rest on, and without static friction.

        Parameters
        ----------
        load, radius, elements
            As of :meth:`stiffness` and :meth:`ElastoSlip.mindlin`.

        Returns
        -------
        ElastoSlip
        """
        return ElastoSlip.mindlin(self.kinetic * load, stiffness=self.stiffness(load, radius=radius), elements=elements)

    def contact(self, load: float, *, radius: float, mass: float) -> CompliantContact:
        r"""The contact of a sphere as a spring, that loses as its materials do where a mass rings on it.

        The damping is :math:`c = \\eta K/\\omega`, :math:`\\omega = \\sqrt{K/m}`: a loss factor is told at a frequency.

        Parameters
        ----------
        load, radius : float
            As of :meth:`stiffness`.
        mass : float
            Of what rings on the contact [kg].

        Returns
        -------
        CompliantContact
        """
        stiffness = self.stiffness(load, radius=radius)
        damping = self.loss * math.sqrt(stiffness * finite("mass", mass, unit="kg", positive=True))
        return CompliantContact(self.kinetic * load, stiffness=stiffness, damping=damping, static=self.static * load)


@functools.cache
def _known() -> dict[str, Any]:
    return tomllib.loads((files("stickslip.data") / "pairs.toml").read_text("utf-8"))


def pair(name: str) -> Pair:
    """Which friction and elasticity have two materials?

    Parameters
    ----------
    name : str
        "steel on steel", "aluminium on steel", "Teflon on steel", "rubber on steel" or "wet rubber on steel".

    Returns
    -------
    Pair

    Raises
    ------
    ModelError
        No such pair.

    Examples
    --------
    >>> rubbing = pair("Teflon on steel")
    >>> rubbing.kinetic, rubbing.sources[0]
    (0.04, "Marks' Standard Handbook for Mechanical Engineers")
    """
    known = _known()
    if name not in known["pairs"]:
        raise ModelError(f"a pair '{name}'", f"known are {', '.join(known['pairs'])}", "choose one of them").of("name")
    friction = known["pairs"][name]
    materials = [known["materials"][word] for word in name.removeprefix("wet ").split(" on ")]
    gives = [_compliance(material) for material in materials]
    shear = sum(along for _, along in gives)
    return Pair(
        name,
        friction["kinetic"],
        friction["static"],
        1 / sum(across for across, _ in gives),
        1 / shear,
        sum(material["loss"] * along for material, (_, along) in zip(materials, gives, strict=True)) / shear,
        (friction["source"], *dict.fromkeys(material["source"] for material in materials)),
    )


def _compliance(material: Mapping[str, float]) -> tuple[float, float]:
    """What a material gives across and along [1/Pa]."""
    modulus, poisson = material["modulus"], material["poisson"]
    return (1 - poisson**2) / modulus, 2 * (2 - poisson) * (1 + poisson) / modulus
