"""What a page shows beside what was printed now: the words alike, the numbers to the digits that machines share."""

from __future__ import annotations

import re

import numpy as np

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
NEAR = 0.02  # of a number: what another release of a linear algebra library may change in a fit


def alike(shown: str, printed: str) -> bool:
    """Whether both say the same."""
    words = [" ".join(NUMBER.sub("#", text).split()) for text in (shown, printed)]
    if words[0] != words[1]:
        return False
    numbers = (np.array([float(each) for each in NUMBER.findall(text)]) for text in (shown, printed))
    return bool(np.allclose(*numbers, rtol=NEAR, atol=1e-9))
