"""
The speed at which sliding begins
=================================

Where a sliding mass turns, a compliant contact first gives way elastically; the friction goes over from one level to
the other while the mass gathers speed. The speed at the end of that is the transition speed.
"""

import stickslip as ss

contact = ss.laws.CompliantContact(1.1, stiffness=192_000, damping=23.9)
slider = ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=ss.drives.HarmonicBase(1.1e-3, frequency=8.7))
rig = ss.Rig.air_track()
record = rig.stated(rig.measure(ss.simulate(slider, duration=6.0), fs=4000, rng=1, start=4.0))
fused = ss.friction_force(record, mass=2.42, stiffness=2310, method="fusion")

speed = ss.contact.transition_speed(fused)
print(speed)
ax = ss.plot(speed)
