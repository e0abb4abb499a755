"""Friction laws: each one a table of linear modes with exits, one file per law."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
