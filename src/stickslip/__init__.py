"""stickslip: dry friction in oscillators, from a rig's record to its friction law, and back.

What one needs first::

    record = ss.read_record("rig.csv", channels={"x": "plate [mm]"})    # a file becomes a Record, in SI
    findings = ss.analyze(record, mass=2.42, stiffness=2310)            # every question that it can answer
    ss.publish(findings, folder="findings")                             # page, numbers, figures
    ss.plot(findings)                                                   # in a notebook, as all of these
    ss.compare_laws(record, mass=2.42, stiffness=2310)                  # which law the record leaves possible

    law, drive = ss.laws.Coulomb(1.1), ss.drives.HarmonicBase(6e-4, frequency=5.6)
    slider = ss.Oscillator(mass=2.42, stiffness=2310, law=law, drive=drive)
    ss.simulate(slider, cycles=10)                                      # exact, from event to event

More of each kind stands in its room: ``laws`` and ``drives``; ``signals`` (of one channel or several), ``balance``
(the force on the mass), ``cycle`` and ``contact`` (what a motion tells), ``decay``, ``law`` and ``squeak``; ``solve``,
``maps`` and ``rig`` (simulated motions); ``answers``, ``story`` and ``figures`` (all of a record, and how it is told);
``systems`` and ``record`` (files and other forms). ``dir(stickslip.laws)`` lists a room.
"""

from stickslip.lazy import attached

__version__ = "0.1.0"
__getattr__, __dir__, __all__ = attached(
    __name__, "__version__", rooms=("datasets", "drives", "laws", "scenarios", "signals")
)
