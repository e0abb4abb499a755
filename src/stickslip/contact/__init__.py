"""What the contact does while it holds, and where it begins to slip."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
