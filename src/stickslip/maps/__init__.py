"""Many motions side by side: sweeps, and where motions change."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
