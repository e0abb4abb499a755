"""What moves the spring's end, the counter-face or the mass."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
