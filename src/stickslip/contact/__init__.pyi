from stickslip.contact.cause import Cause as Cause
from stickslip.contact.cause import lag_or_compliance as lag_or_compliance
from stickslip.contact.contact import TransitionSpeed as TransitionSpeed
from stickslip.contact.contact import contact_damping as contact_damping
from stickslip.contact.contact import coupled_frequency as coupled_frequency
from stickslip.contact.contact import transition_speed as transition_speed
from stickslip.contact.frequency_transition import Transition as Transition
from stickslip.contact.frequency_transition import transition as transition
from stickslip.contact.microslip import find_microslips as find_microslips
from stickslip.contact.ringing import Mechanism as Mechanism
from stickslip.contact.ringing import mechanism as mechanism

__all__: list[str]
