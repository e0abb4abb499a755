"""The force on the mass, and what each sensor says of it."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
