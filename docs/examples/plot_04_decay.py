"""
Viscous and dry friction in one decay
=====================================

A released mass dies away by a share of its amplitude in each cycle (viscous) and by a length (dry). The differences of
extremes two apart lose the dry part, and decay by the viscous one alone.
"""

import stickslip as ss

slider = ss.Oscillator(mass=1.0, stiffness=10.0, damping=0.2, law=ss.laws.Coulomb(0.2))
run = ss.simulate(slider, duration=20.0, start={"x": 1.0})
record = ss.Rig((ss.rig.Sensor("x", noise=ss.rig.Noise(1e-3)),)).measure(run, fs=100, rng=1)

findings = ss.analyze_decay(record, stiffness=10.0, method="thesis")
print(findings.decay.thesis.damping_ratio, "- true: 0.0316")
print(findings.decay.thesis.dry_displacement, "- true: 0.02 m")

drawn = {plate.name: plate.figure for plate in ss.summary(findings).plates}
decay, differences = drawn["decay"], drawn["differences"]
