"""Materials that rub, by name: what a sphere of one on a flat of the other gives as a contact."""

from __future__ import annotations

import functools
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from stickslip.errors import ModelError
from stickslip.laws.compliant import CompliantContact
from stickslip.laws.series import ElastoSlip
from stickslip.parameters import finite


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
