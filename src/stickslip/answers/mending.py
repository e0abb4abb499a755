"""Repairs by name, in the order asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from stickslip.record.record import Record
from stickslip.rig.settings import rig_settings
from stickslip.signals.repair import (
    fill_gaps,
    fill_missing,
    remove_drift,
    remove_spikes,
    repair_clock,
    restore_clipped,
)


def mend(record: Record, *, repairs: Sequence[str]) -> Record:
    """The record after repairs, made in the order given and each logged in its history.

    Parameters
    ----------
    record : Record
        As read.
    repairs : sequence of str
        ``clock`` (:func:`repair_clock`), ``gaps`` (:func:`fill_gaps`), ``missing`` (:func:`fill_missing`), ``spikes``
        (:func:`remove_spikes`), ``clipping`` (:func:`restore_clipped`), ``drift`` (:func:`remove_drift`). The last
        four take a channel, as in ``drift:x``; without one they mend the channels in which the check-up finds
        that fault.

    Returns
    -------
    Record

    Raises
    ------
    RecordError
        A repair that can not be made.
    ModelError
        A repair that is not known.

    Examples
    --------
    >>> import numpy as np
    >>> wave = np.sin(0.2 * np.arange(400))
    >>> wave[100:103] = np.nan
    >>> mended = mend(Record.of({"x": wave}, fs=100.0), repairs=["missing"])
    >>> bool(np.isfinite(mended["x"]).all()), mended.history[-1].action
    (True, 'fill_missing')
    """
    for repair in rig_settings({"repair": list(repairs)}, source="the call").repair:
        word, _, channel = repair.partition(":")
        if word in _WHOLE:
            record = _WHOLE[word](record)
            continue
        kind, function = _PER_CHANNEL[word]
        found = [fault.channel for fault in record.check() if fault.kind == kind and fault.channel is not None]
        for name in [channel] if channel else dict.fromkeys(found):
            record = function(record, name)
    return record


_WHOLE: dict[str, Callable[[Record], Record]] = {"clock": repair_clock, "gaps": fill_gaps}
_PER_CHANNEL: dict[str, tuple[str, Callable[[Record, str], Record]]] = {
    "missing": ("missing", fill_missing),
    "spikes": ("spike", remove_spikes),
    "clipping": ("clipped", restore_clipped),
    "drift": ("drift", remove_drift),
}
