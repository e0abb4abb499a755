"""
What the sensors hide
=====================

Displacement sensors that come late, an accelerometer on a mount that rings: the balance of what they read is far from
the friction. Told how its sensors lie, the smoother of all of them sees through.
"""

import matplotlib.pyplot as plt

import stickslip as ss

contact = ss.laws.CompliantContact(1.1, stiffness=192_000, damping=23.9)
drive = ss.drives.HarmonicBase(0.65e-3, frequency=2.5)
run = ss.simulate(ss.Oscillator(mass=2.42, stiffness=2310, law=contact, drive=drive), duration=5)
rig = ss.Rig.air_track()
record = rig.stated(rig.measure(run, fs=4000, rng=1, start=3.0))

figure, axes = plt.subplots(3, figsize=(7, 6), sharex=True, sharey=True, layout="constrained")
words = {"F": "balance of what is read", "F1": "averaged over five points", "fusion": "all sensors together"}
for ax, (method, label) in zip(axes, words.items(), strict=True):
    balanced = ss.friction_force(record, mass=2.42, stiffness=2310, method=method)
    time, friction = balanced.time[:2000], balanced["friction"][:2000]
    true = run.sample(3.0 + time, ("friction",))[0][0]
    ax.plot(time, friction, color="tab:orange", linewidth=0.9, label=label)
    ax.plot(time, true, color="black", linewidth=0.7, label="true")
    ax.legend(loc="upper right", ncols=2, fontsize=8)
    ax.set_ylabel("friction [N]")
    print(f"{label}: {1e3 * float((friction - true)[100:].std()):.0f} mN off")
axes[-1].set_xlabel("time [s]")
