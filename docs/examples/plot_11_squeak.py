"""
A squeak, and where in the cycle it comes
=========================================

A virtual rig of rubber on wet steel, driven slowly: each time it slides, coupled modes of its beam grow into a sound.
"""

import stickslip as ss

run = ss.simulate(ss.squeak.squeak_rig("wet", load=6.13), duration=0.8)
record = ss.squeak.squeak_record(run, snr=30, rng=1)
findings = ss.analyze_squeaks(record, name="wet, 6.13 N")
print(findings.squeaks)
spectrogram = next(plate.figure for plate in ss.summary(findings).plates if plate.name == "spectrogram")
