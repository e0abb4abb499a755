"""The table everyone meets at: a measured file, or a sampled simulation, in SI with its history."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
