"""
Which motion, from which start?
===============================

Between 1.38 and 1.5 N, a mass whose static friction exceeds the kinetic one may be held or may slide, as it starts.
"""

import numpy as np

import stickslip as ss

slider = ss.scenarios.forced(0.8, 1.0, static_ratio=1.5).having(amplitude=1.25)
basins = ss.basins(slider, grid={"x": np.linspace(-4, 4, 41), "v": np.linspace(-4, 4, 41)})
print(basins)
ax = ss.plot(basins)
