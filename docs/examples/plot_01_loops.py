"""
The friction loops of a record
==============================

The bundled record is of a mass on a driven spring over dry friction. ``analyze`` balances the forces on the mass, and
the loops show friction against displacement and against velocity: level while it slides, upright where it turns.
"""

import stickslip as ss

record = ss.datasets.demo()
truth = record.truth
findings = ss.analyze(record, mass=truth["mass"], stiffness=truth["stiffness"], damping=truth["damping"])
print(findings.level)
print("true:", truth["sliding friction"], "N")

drawn = {plate.name: plate.figure for plate in ss.summary(findings).plates}
displacement, velocity = drawn["friction-displacement"], drawn["friction-velocity"]
