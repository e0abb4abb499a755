"""
A map of stops
==============

How often a driven mass stops in each cycle, over friction and frequency. One closed form stands over it: Den Hartog's
boundary, beyond which it slides without stopping.
"""

import numpy as np

import stickslip as ss

slider = ss.Oscillator(
    mass=1.0, stiffness=1.0, law=ss.laws.Coulomb(0.5), drive=ss.drives.HarmonicForce(1.0, frequency=0.1)
)
grid = {"frequency": np.linspace(0.02, 0.25, 48), "kinetic": np.linspace(0.02, 0.98, 40)}
atlas = ss.sweep(slider, grid, measures=["stops"], cycles=10, settle=60)
print(atlas)
ax = ss.plot(atlas, system=slider)
