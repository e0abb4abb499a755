"""Friction laws and curves fitted to records, and compared."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
