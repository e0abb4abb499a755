"""Systems written to files, and read from them."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
