"""
A stick, looked at closely
==========================

A compliant contact does not hold still: the mass rings on it at some 45 Hz while it sticks, and where the ringing
reaches the friction's level the contact slips a little. The solver goes from event to event, so nothing is smeared.
"""

import matplotlib.pyplot as plt
import numpy as np

import stickslip as ss

contact = ss.laws.CompliantContact(1.1, stiffness=192_000, damping=23.9)
drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
run = ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive), cycles=12)

slips = [(event.time, event.kind) for event in run.events if event.time > 4.0]
begin = next(time for time, kind in slips if kind == "microstick") - 0.02
times = np.linspace(begin, begin + 0.16, 4000)
v, friction = run.sample(times, ("v", "friction"))[0]

figure, (above, below) = plt.subplots(2, figsize=(7, 4.4), sharex=True, layout="constrained")
above.plot(1e3 * (times - begin), friction, color="tab:orange")
above.set_ylabel("friction [N]")
below.plot(1e3 * (times - begin), 1e3 * v)
below.set(xlabel="time [ms]", ylabel="velocity [mm/s]")
for time, kind in slips:
    if begin < time < begin + 0.16:
        for ax in (above, below):
            ax.axvline(
                1e3 * (time - begin), color="grey", linewidth=0.6, linestyle=":" if kind == "microstick" else "-"
            )
print([kind for time, kind in slips if begin < time < begin + 0.16])
