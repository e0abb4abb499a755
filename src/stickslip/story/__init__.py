"""What is told of a result: page, terminal, numbers, folder."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
