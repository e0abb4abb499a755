"""The friction that a load cell feels: the thesis's F2, or its reading through the inverse of its mount."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from stickslip.balance.balance import FRICTION, averaged_gain, with_friction
from stickslip.record.record import Record, StatedRig
from stickslip.signals.delay import without_delays
from stickslip.signals.derivatives import (
    LEAST,
    Filter,
    best_bandwidth,
    checked_bandwidth,
    five_point_average,
    noise_along,
)

ALONE = "load cell alone"
BEYOND = 2.0  # times its mount's frequency up to which a load cell's reading is followed


def felt(record: Record, rig: StatedRig) -> Record:
    """What the load cell feels, less the inertia of its flange: the thesis's F2, or through its mount's inverse."""
    method, cell = rig.method, record.channels["load"]
    source = next((name for name in ("a", "v", "x") if name in record), "") if cell.inertia else ""
    used = ["load", *([source] if source else [])]
    record.require_clean(*used, question=FRICTION, samples=LEAST)
    record = without_delays(record, *used, question=FRICTION, samples=LEAST)
    terms = {"load": {0: 1.0}, **({source: {"avx".index(source): -cell.inertia}} if source else {})}
    if method == "F2":
        derive = dict.fromkeys(terms, Filter("five-point", record.fs, 0.0))
        notes = ["the load cell, averaged over five points"]
    else:
        derive, notes = _unmounted(record, terms)
    force, variance = np.zeros(len(record)), np.zeros(len(record))
    for name, orders in terms.items():
        noise = noise_along(record[name], record.fs, record.channels[name].noise)
        part = derive[name].apply(record[name], orders)
        if method == "F2":
            force += five_point_average(part)
            variance += (averaged_gain(len(record), derive[name], orders, five_point_average) * noise) ** 2
        else:
            force += part
            variance += (derive[name].noise_gain(len(record), orders) * noise) ** 2
    if source:
        notes.append(f"less {cell.inertia:g} kg times the acceleration from {source}")
    elif cell.inertia:
        notes.append(f"no motion: the inertia of {cell.inertia:g} kg of its flange is left in")
    if cell.discharge is not None:
        notes.append(f"its discharge of {cell.discharge:g} s is left in")
    name = ALONE if method == "load" else method  # no balance of forces stands behind it
    return with_friction(record, force, np.sqrt(variance), replace(rig, method=name), notes)


def _unmounted(record: Record, terms: dict[str, dict[int, float]]) -> tuple[dict[str, Filter], list[str]]:
    """The filters of a load cell alone and of what its flange does; its mount's inverse is added to its terms."""
    mount = record.channels["load"].mount
    width = {name: best_bandwidth(record[name], record.fs) for name in terms}
    if mount is not None:
        angular = 2 * math.pi * mount[0]
        terms["load"] |= {1: 2 * mount[1] / angular, 2: angular**-2}
        width["load"] = checked_bandwidth(min(BEYOND * mount[0], 0.4 * record.fs), record.fs, len(record))
    notes = [f"the load cell alone, smoothed to {width['load']:.4g} Hz (-3 dB)"]
    if mount is not None:
        notes.append(f"less what its mount of {mount[0]:g} Hz adds")
    return {name: Filter("smoother", record.fs, pair) for name, pair in width.items()}, notes
