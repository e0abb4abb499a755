"""
Which contact was it?
=====================

Over time and frequency, a compliant contact shows itself by islands at the frequency with which the mass rings on it
while it sticks.
"""

import stickslip as ss

case = ss.scenarios.get("THESIS compliant 2.5Hz fk=1.1 Ky=192000 z.0174(k+Ky)")
record = ss.simulate(case.system, cycles=8).record(fs=4000).between(1.6, 3.2)

maps = ss.answers.time_frequency(record, mass=2.42, stiffness=2310)
print(maps.mechanism)
print(maps.transition.frequency)
stick = next(plate.figure for plate in ss.summary(maps).plates if plate.name == "stick")
