"""The virtual rig: what real sensors would have written of a simulated motion."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
