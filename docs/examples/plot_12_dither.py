"""
A dither that removes stick-slip
================================

A mass creeps on a belt by stick-slip. A fast small tone along the contact keeps it from sticking; ``dither`` finds the
smallest one by simulation.
"""

import stickslip as ss

creeping = ss.Oscillator(
    mass=1, stiffness=1, law=ss.laws.Coulomb(1.0, static=1.5), drive=ss.drives.Belt(0.1), damping=0.02
)
dithered = ss.dither(creeping, frequency=5.0)
print(dithered)
ax = ss.plot(dithered)
