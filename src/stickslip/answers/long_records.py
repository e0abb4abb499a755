"""Records longer than memory: the questions asked of block after block, and the answers put together."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from stickslip.answers.findings import Findings
from stickslip.answers.questions import analyze
from stickslip.errors import EstimateError, ModelError, StickslipError
from stickslip.estimate import NORMAL_95, Estimate, Result
from stickslip.record.record import Record
from stickslip.rig.settings import RigSettings
from stickslip.statistics import student

TIMES = ("cycles", "slips")  # arrays of instants, which follow each other from block to block


def analyze_blocks(
    blocks: Iterable[Record],
    *,
    rig: RigSettings | None = None,
    method: str = "auto",
    progress: Callable[[str], None] | None = None,
) -> Findings:
    """Ask a record that is longer than memory every question about friction, block after block.

    Each block is analysed as a record of its own, so that no more than one is held. A number is the mean over the
    blocks, each counting by its length; its interval holds what the blocks' own intervals leave and, by Student's t,
    how far the blocks are apart. Sticks, slips and cycles follow each other; one that a block's end cuts is not whole.
    Figures show the block in the middle.

    Parameters
    ----------
    blocks : iterable of Record
        In order, as :func:`read_blocks` yields them.
    rig : RigSettings, optional
        The rig's constants, as for :func:`analyze`.
    method : str
        As for :func:`analyze`.
    progress : callable, optional
        Called with a sentence before each block.

    Returns
    -------
    Findings
        With the record of one block.

    Raises
    ------
    EstimateError
        None of the blocks answers anything.
    ModelError
        A constant that has no meaning.

    Examples
    --------
    >>> import stickslip as ss
    >>> record = ss.datasets.demo()
    >>> blocks = [record.rows(first, first + 8000) for first in (0, 8000)]
    >>> found = analyze_blocks(blocks, rig=ss.rig.rig_settings({"mass": 2.42, "stiffness": 2310, "damping": 0.12}))
    >>> round(found.level.value, 2)
    1.1
    """
    answered: list[Findings] = []
    refused: list[str] = []
    kept: Record | None = None
    size, number = 0, 0
    for number, block in enumerate(blocks, start=1):
        place = f"block {number}, from {block.start:.5g} s"
        if progress is not None:
            progress(place)
        size += len(block)
        try:
            findings = analyze(block, rig=rig, method=method)
        except ModelError:
            raise
        except StickslipError as error:
            refused.append(f"{place.capitalize()}, answers nothing: {error}")
            continue
        if number & (number - 1) == 0 or kept is None:  # of blocks 1, 2, 4, 8 ... the last is near the middle
            kept, shown = findings.record, f"The figures show {place}."
        answered.append(replace(findings, record=_first_row(findings.record)))
    if kept is None:
        raise EstimateError(
            f"none of {number} blocks answers anything" + (f"; {refused[0]}" if refused else ""),
            "a block holds some cycles of a motion, and what tells its friction",
            "see the check-up of the record",
        )
    blocks_told = f"The record was analysed in {number} blocks, {size} samples in all; numbers are means over them."
    return replace(_in_one(answered, [f"{blocks_told} {shown}", *refused]), record=kept)


def _in_one(answered: Sequence[Findings], notes: Sequence[str]) -> Findings:
    """The findings of blocks as those of one record; notes that most blocks have come first."""
    middle = answered[len(answered) // 2]
    results = {key: _joined([block.results[key] for block in answered], middle.results[key]) for key in middle.results}
    faults = tuple(fault for block in answered for fault in block.faults)
    own = Counter(note for block in answered for note in block.notes).most_common()
    return replace(middle, results=results, faults=faults, notes=(*notes, *(note for note, _ in own)))


def _first_row(record: Record) -> Record:
    """One row, copied: a part of an array would keep all of it in memory."""
    row = record.rows(0, 1)
    return replace(row, samples={name: values.copy() for name, values in row.samples.items()})


def _together(parts: Sequence[Any]) -> Any:
    """Answers of one kind to one question, of several blocks, as one."""
    middle = parts[len(parts) // 2]
    joined: dict[str, Any] = {}
    for name in (field.name for field in fields(middle)):
        values = [getattr(part, name) for part in parts]
        if name in TIMES:
            joined[name] = np.concatenate(values)
        elif name == "events":
            joined[name] = tuple(event for value in values for event in value)
        else:
            joined[name] = _joined(values, getattr(middle, name))
    return replace(middle, **joined)


def _joined(values: Sequence[Any], otherwise: Any) -> Any:
    """A number, a part of an answer or words of several blocks as one; of anything else what the middle one has."""
    present = [value for value in values if value is not None]
    kind = present[0] if present else None
    if isinstance(kind, Estimate):
        return _mean(present)
    if isinstance(kind, Result):
        return _together(present)
    if isinstance(kind, str):
        return Counter(present).most_common(1)[0][0]
    return otherwise


def _mean(estimates: Sequence[Estimate]) -> Estimate:
    """The mean of what blocks tell, as sure as they are, and as they agree."""
    count = len(estimates)
    if count == 1:
        return estimates[0]
    values = np.array([estimate.value for estimate in estimates])
    halves = np.array([np.subtract(*estimate.interval[::-1]) / 2 for estimate in estimates])
    mean = float(values.mean())
    own = float(np.sqrt(np.sum(halves**2))) / count
    apart = student(count - 1) * float(values.std(ddof=1)) / math.sqrt(count)
    low, high = (float(np.mean([estimate.interval[end] - estimate.value for estimate in estimates])) for end in (0, 1))
    skew = (high + low) / 2  # of an interval that is not symmetric, in which a method's own error stands
    half = max(own, apart) + abs(skew)
    status = Counter(estimate.status for estimate in estimates).most_common(1)[0][0]
    checks = (f"{count} blocks, which scatter by {values.std(ddof=1):.3g}", *estimates[count // 2].checks)
    ends, sd = (mean - half + min(skew, 0), mean + half + max(skew, 0)), half / NORMAL_95
    return replace(estimates[count // 2], value=mean, interval=ends, sd=sd, status=status, checks=checks)
