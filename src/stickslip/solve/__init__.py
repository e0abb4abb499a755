"""The exact solver: closed forms between events, first exits that are certified."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
