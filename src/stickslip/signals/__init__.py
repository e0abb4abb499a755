"""Signal processing that knows no friction: smoothing, differentiation, repairs, clocks."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
