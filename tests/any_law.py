"""Any law of the register with values, so that a new one is tested without a line here."""

from __future__ import annotations

from typing import Any

import numpy as np

from stickslip.laws.guessing import Observed, asked_for

SLOWLY = np.array([-0.1, 0.1])
ONE_NEWTON = Observed(0.01 * SLOWLY, SLOWLY, np.sign(SLOWLY), np.full(2, 0.1), 1.0, 0.2, frequency=10.0, mass=1.0)


def with_values(law: type[Any]) -> Any:
    """A law whose friction is about 1 N at 0.1 m/s."""
    return asked_for(law)[0].guesses(ONE_NEWTON)[0]
