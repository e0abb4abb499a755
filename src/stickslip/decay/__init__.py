"""The whole waveform of a free decay against a record."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
