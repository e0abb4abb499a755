"""Squeaks: where the bursts are, their spectra, what moves together, and where in the forcing cycle they come."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip.plot.contact import draw_loop
from stickslip.plot.plate import Plate, plate
from stickslip.plot.style import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    WIDTH,
    Array,
    axis_label,
    envelope,
    new_figure,
    prefixed,
    spelled,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from stickslip.analysis.squeak_comparison import SqueakComparison
    from stickslip.analysis.squeaks import SqueakFindings
    from stickslip.record.record import Record
    from stickslip.squeak.bursts import Squeak, Squeaks
    from stickslip.squeak.spectra import BurstSpectra

COLOURS = {"squeak": ORANGE, "squeal": ORANGE, "creak": PURPLE, "scrape": GREEN, "tonal": BLUE, "noise": FAINT}
SPAN = 70.0  # dB of the spectrogram
SHARE = 1e-3  # of the power that lies above the highest frequency shown
