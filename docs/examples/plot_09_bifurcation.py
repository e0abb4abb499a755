"""
Up and down a parameter
=======================

Friction that holds with 1.5 N and slides with 1 N, under a force that grows and shrinks again: what the motion
settles on depends on where it comes from.
"""

import numpy as np

import stickslip as ss

slider = ss.scenarios.forced(0.8, 1.0, static_ratio=1.5)
diagram = ss.bifurcation(slider, "amplitude", values=np.linspace(1.05, 1.8, 16))
print(diagram)
ax = ss.plot(diagram)
