"""Elasto-slip elements side by side: Jenkins, Iwan, Maxwell slip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from stickslip.errors import ModelError
from stickslip.laws.base import Exit, Mode, Row
from stickslip.parameters import finite, parameter, parametric


@parametric
class ElastoSlip:
    """Parallel elements, each a spring in series with a Coulomb slider; one element is a Jenkins element.

    Elements yield in the order of their yield displacement f/k. From the virgin start (all springs relaxed) this
    order holds on every branch for ever, so n elements need 2 n + 1 modes.

    Examples
    --------
    >>> chain = ElastoSlip.iwan(1e6, width=30e-6, elements=10)
    >>> len(chain.modes()), round(sum(chain.forces), 3)
    (21, 15.0)
    """

    label = "Elasto-slip elements"
    formula = "f = sum of elements, each a spring of its stiffness that slips at its force"
    loads = ("preload",)  # of a contact: its levels are proportional to a steady load

    stiffnesses: Sequence[float] = parameter(
        "N/m", "stiffnesses", size="row", positive=True, note="the spring of every element"
    )
    forces: Sequence[float] = parameter("N", "yield forces", size="row", positive=True, note="one of every element")

    def __post_init__(self) -> None:
        if len(self.stiffnesses) != len(self.forces) or len(self.forces) == 0:
            raise ModelError(
                f"{len(self.stiffnesses)} stiffnesses, {len(self.forces)} forces",
                "one of each an element",
                "complete it",
            )
        pairs = sorted(
            zip(map(float, self.stiffnesses), map(float, self.forces), strict=True), key=lambda p: p[1] / p[0]
        )
        object.__setattr__(self, "stiffnesses", tuple(k for k, _ in pairs))
        object.__setattr__(self, "forces", tuple(f for _, f in pairs))

    @classmethod
    def iwan(cls, stiffness: float, *, width: float, elements: int) -> ElastoSlip:
        """Iwan's model with yield displacements spread evenly over a width, in equal classes.

        Parameters
        ----------
        stiffness : float
            Stiffness of the whole [N/m].
        width : float
            Largest yield displacement [m].
        elements : int
            Number of classes; each yields at its middle.

        Returns
        -------
        ElastoSlip
        """
        finite("width", width, unit="m", positive=True)
        if elements < 1:
            raise ModelError(f"elements = {elements}", "at least one", "raise elements=")
        each = stiffness / elements
        return cls([each] * elements, [each * width * (j + 0.5) / elements for j in range(elements)])

    @property
    def memory(self) -> Mapping[str, Row]:
        """Where each slider holds [m]; under the mass at the start."""
        return {f"anchor{j}": {"x": 1.0} for j in range(len(self.forces))}

    @property
    def places(self) -> tuple[str, ...]:
        """All anchors."""
        return tuple(self.memory)

    @property
    def entry(self) -> tuple[str, str, str]:
        """All sliders hold at the start."""
        return "held", "held", "held"

    def modes(self) -> tuple[Mode, ...]:
        """All hold; or the first j slide, to either side."""
        held = Mode("held", "microstick", 0, self._force(0, 0), (self._yield(1, 0), self._yield(-1, 0)))
        sliding = [self._slide(side, j) for side in (-1, 1) for j in range(1, len(self.forces) + 1)]
        return held, *sliding

    def _slide(self, side: int, count: int) -> Mode:
        anchors = {f"anchor{j}": {"x": 1.0, "1": -side * self.forces[j] / self.stiffnesses[j]} for j in range(count)}
        back = Exit({"v": float(-side)}, "held", anchors, crossing=True)
        onward = (self._yield(side, count),) if count < len(self.forces) else ()
        return Mode(_name(side, count), "slip", side, self._force(side, count), (back, *onward))

    def _force(self, side: int, count: int) -> Row:
        stiff = {f"anchor{j}": -self.stiffnesses[j] for j in range(count, len(self.forces))}
        return {"x": -sum(stiff.values()), "1": side * sum(self.forces[:count]), **stiff}

    def _yield(self, side: int, j: int) -> Exit:
        k = side * self.stiffnesses[j]
        return Exit({"x": k, f"anchor{j}": -k, "1": -self.forces[j]}, _name(side, j + 1))


def _name(side: int, count: int) -> str:
    return f"{'forward' if side > 0 else 'back'} {count}"
