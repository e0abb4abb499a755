"""What of a record and its rig can not all be true."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
