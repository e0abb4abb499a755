"""What the cycles of a motion tell of friction."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
