"""Squeak: what a record tells of it, and which motion feeds it."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
