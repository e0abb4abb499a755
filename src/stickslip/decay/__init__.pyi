from stickslip.decay.answer import DecayFit as DecayFit
from stickslip.decay.decrement import Bounds as Bounds
from stickslip.decay.decrement import Decrement as Decrement
from stickslip.decay.extremes import EnvelopeDecay as EnvelopeDecay
from stickslip.decay.extremes import effective_rate_bound as effective_rate_bound
from stickslip.decay.extremes import extreme_decay as extreme_decay
from stickslip.decay.extremes import hilbert_decay as hilbert_decay
from stickslip.decay.extremes import linear_decrement as linear_decrement
from stickslip.decay.extremes import log_decrement as log_decrement
from stickslip.decay.release import Releases as Releases
from stickslip.decay.release import RingDown as RingDown
from stickslip.decay.release import find_releases as find_releases
from stickslip.decay.which_motion import DecayMotion as DecayMotion
from stickslip.decay.which_motion import choose_motion as choose_motion

__all__: list[str]
