"""Which questions are asked of a record, in which order."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
