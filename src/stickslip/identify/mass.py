"""Mass or stiffness, where the rig's owner does not know one of them: from how the mass slides."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from stickslip.estimate import Estimate
from stickslip.identify.motion import away_from, contact_motion, find_cycles, is_measured
from stickslip.record.record import Record
from stickslip.signals.differentiate import differentiate
from stickslip.statistics import least_squares

Array = NDArray[np.float64]

QUESTION = "the stiffness over the mass"
FAST = np.linspace(0.2, 0.7, 6)  # shares of the peak speed above which the contact slides with its whole friction


def stiffness_per_mass(
    record: Record, *, resisting: Array | float = 0.0, stretched: Array | float = 0.0, contact: str = "ground"
) -> Estimate:
    r"""How large is the spring's stiffness over the mass, if the friction does not change while it slides?

    By least squares, where it slides, on :math:`\ddot x + r = (k/m)(z - x + s) - (F/m)\,\mathrm{sign}\,v + g`. The
    acceleration stands alone on its side, for it is the channel that rings; and reversals, where an elastic contact
    acts as one more spring, are left out. What rings on after them shows in how the answer hangs on how much is left
    out: it is the mean over several such choices, and their scatter is in its deviation.

    Parameters
    ----------
    record : Record
        With ``x``, ``z`` where the base moves, ``a`` where measured.
    resisting : ndarray (n,) or float
        r, what else than the spring is known to hold the mass back, over the mass [m/s^2], on the record's samples.
    stretched : ndarray (n,) or float
        s, what else than the spring is known to pull the mass, over the stiffness [m].
    contact : {"ground", "base"}
        What the mass slides on.

    Returns
    -------
    Estimate
        k/m [1/s^2].

    Raises
    ------
    RecordError, EstimateError
        No motion, no cycle, or channels that are missing or broken.
    """
    motion = contact_motion(record, contact=contact, question=QUESTION)
    cycles = find_cycles(record, motion)
    stretch = record["z"] - record["x"] if "z" in record else -record["x"]
    acceleration = record["a"] if is_measured(record, "a") else differentiate(record["x"], record.fs, order=2).values
    columns = np.column_stack([stretch + stretched, np.sign(motion.velocity), np.ones(len(record))])
    fits = []
    for share in FAST:
        fast = np.abs(motion.velocity) > share * cycles.peak
        clear = fast & away_from(~fast, motion.blur)
        sliding = clear if clear.sum() > fast.sum() / 2 else fast
        fits.append(least_squares(columns[sliding], (acceleration + resisting)[sliding]))
    ratios = np.array([fit.coefficients[0] for fit in fits])
    sd = math.hypot(float(np.mean([fit.sd[0] for fit in fits])), float(ratios.std(ddof=1)))
    return Estimate.normal(
        "stiffness over mass", ratios.mean(), sd=sd, unit="1/s^2",
        method="least squares on the acceleration while it slides",
        status="ok" if ratios.mean() > 0 else "negative: a sensor has the wrong sign",
    )  # fmt: skip
