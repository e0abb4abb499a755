from stickslip.oscillator import PlanarOscillator as PlanarOscillator
from stickslip.systems.export import export_system as export_system
from stickslip.systems.file import Case as Case
from stickslip.systems.file import read_system as read_system
from stickslip.systems.file import scenario_case as scenario_case

__all__: list[str]
