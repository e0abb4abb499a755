"""Figures; they know the results, and no result knows them."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
