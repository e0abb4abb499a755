"""The bench: devices that measure and drive a rig, their records on disk, and the rig watched live."""

from stickslip.lazy import attached

__getattr__, __dir__, __all__ = attached(__name__)
