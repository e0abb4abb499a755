"""The rig that a record is believed to come from, the records that it would write, and answers tried on them."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
