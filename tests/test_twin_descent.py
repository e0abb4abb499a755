"""The descent to the rig nearest to a record ends at the floor of a valley, however bent that is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import stepped
import stickslip as ss
from stickslip.twin import descent, search
from stickslip.twin.belief import BENT, GIVE, KINETIC, LOSS, SLOPE, Belief

RIG = stepped.Rig("compliant", 0.52, 0.51, 0.0122, 1.02e-3, 0.248, kinetic=2.08e-4, contact=2.556, loss=0.172)


def nearest() -> Belief:
    """The rig nearest to a record that begins in slip, as its contact relaxes: searched from the true one."""
    record = stepped.record(RIG, np.random.default_rng(11), noise=1.4e-4)
    told = ss.friction_force(record.rows(90, len(record)), **RIG.stated)
    (drive,) = search.possible_drives(told, ss.drives.HarmonicBase(0.0, frequency=1.0))
    simple = search._linear(told, ss.Oscillator(law=search.LinearSlope(0.0, slope=0.0), **RIG.stated), drive)
    loss = RIG.loss / math.sqrt(RIG.contact * RIG.mass)
    true = {GIVE: math.log(RIG.contact), LOSS: loss, BENT: 0.0, KINETIC: RIG.kinetic, SLOPE: 0.0}
    begun = replace(simple.as_stated().at(**true), held=LOSS, fit=None)
    led = search._led(begun, [told.rows(0, samples) for samples in search._horizons(told)])
    return descent.refined(replace(led, record=told, held=""))


def test_a_damped_contact_is_found_from_along_its_valley() -> None:
    """Newton's step halved ended on the valley's side, 87 to 280 of chi-squared above its floor, 5 % too stiff."""
    best = nearest()
    assert best.fit is not None
    for loss in (0.02, 0.05):
        for bent in (-0.1, 0.1):
            along = {LOSS: best.values[LOSS] - loss, GIVE: best.values[GIVE] + 2.9 * loss, BENT: bent}
            end = descent.refined(replace(best.at(**along), fit=None))
            assert best.fit.freedom * math.log(descent.misfit(end) / descent.misfit(best)) < 1
            assert end.contact == pytest.approx(RIG.contact, rel=0.01)
