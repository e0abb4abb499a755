"""
Six laws under one motion
=========================

A mass on a driven spring, the same drive, and six friction laws: what the law does shows where the motion turns.
"""

import matplotlib.pyplot as plt

import stickslip as ss

laws = {
    "Coulomb": ss.laws.Coulomb(1.1),
    "static above kinetic": ss.laws.Coulomb(1.1, static=1.5),
    "Stribeck": ss.laws.Stribeck(kinetic=1.1, static=1.5, speed=5e-3),
    "compliant contact": ss.laws.CompliantContact(1.1, stiffness=20e3, damping=10.0),
    "Dahl": ss.laws.Dahl(kinetic=1.1, stiffness=20e3),
    "state variable": ss.laws.StateVariable(kinetic=1.1, rate=200.0),
}
figure, axes = plt.subplots(2, 3, figsize=(9, 5), sharex=True, sharey=True, layout="constrained")
for ax, (name, law) in zip(axes.flat, laws.items(), strict=True):
    drive = ss.drives.HarmonicBase(1.2e-3, frequency=2.5)
    slider = ss.Oscillator(mass=2.42, stiffness=2310, damping=5.0, law=law, drive=drive)
    run = ss.simulate(slider, cycles=6)
    motion = run.record(fs=4000).between(1.6, 2.4)
    ax.plot(1e3 * motion["v"], motion["friction"], linewidth=0.9)
    ax.set_title(name, loc="left", fontsize=10)
for ax in axes[1]:
    ax.set_xlabel("velocity [mm/s]")
for ax in axes[:, 0]:
    ax.set_ylabel("friction [N]")
