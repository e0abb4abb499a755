# records
# more of each kind
from stickslip import answers as answers
from stickslip import balance as balance
from stickslip import consistent as consistent
from stickslip import contact as contact
from stickslip import cycle as cycle
from stickslip import datasets as datasets
from stickslip import decay as decay
from stickslip import drives as drives
from stickslip import errors as errors
from stickslip import figures as figures
from stickslip import law as law
from stickslip import laws as laws
from stickslip import maps as maps
from stickslip import record as record
from stickslip import rig as rig
from stickslip import scenarios as scenarios
from stickslip import signals as signals
from stickslip import solve as solve
from stickslip import squeak as squeak
from stickslip import story as story
from stickslip import systems as systems
from stickslip import twin as twin
from stickslip.answers.decays import analyze_decay as analyze_decay
from stickslip.answers.many import compare as compare

# questions
from stickslip.answers.on_twins import tried as tried
from stickslip.answers.questions import analyze as analyze
from stickslip.answers.squeaks import analyze_squeaks as analyze_squeaks
from stickslip.balance.force import friction_force as friction_force
from stickslip.contact.contact import contact_stiffness as contact_stiffness
from stickslip.cycle.loops import friction_loops as friction_loops
from stickslip.cycle.sticks import find_sticks as find_sticks
from stickslip.decay.decrement import decrement as decrement
from stickslip.decay.fit_decay import fit_decay as fit_decay
from stickslip.errors import StickslipError as StickslipError
from stickslip.estimate import Estimate as Estimate
from stickslip.figures.drawing import plot as plot
from stickslip.files.read import read_blocks as read_blocks
from stickslip.files.read import read_record as read_record
from stickslip.files.write import write_record as write_record
from stickslip.law.fit_curve import fit_curve as fit_curve
from stickslip.law.which_law import compare_laws as compare_laws
from stickslip.law.which_law import fit_law as fit_law
from stickslip.maps.basins import basins as basins
from stickslip.maps.bifurcation import bifurcation as bifurcation
from stickslip.maps.dither import dither as dither
from stickslip.maps.sweep import sweep as sweep
from stickslip.oscillator import Contact as Contact

# systems
from stickslip.oscillator import Oscillator as Oscillator
from stickslip.oscillator import Structure as Structure

# telling
from stickslip.record.record import Record as Record
from stickslip.rig.rig import Rig as Rig
from stickslip.signals.wavelet import wavelet_map as wavelet_map
from stickslip.solve.periodic import steady_state as steady_state
from stickslip.solve.simulate import simulate as simulate
from stickslip.squeak.bursts import find_squeaks as find_squeaks
from stickslip.squeak.stability import stability as stability
from stickslip.story.folder import publish as publish
from stickslip.story.folder import report as report
from stickslip.story.story import summary as summary

__version__: str
__all__: list[str]
