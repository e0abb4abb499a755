from stickslip.squeak.bifurcation import CycleBranches as CycleBranches
from stickslip.squeak.bifurcation import Threshold as Threshold
from stickslip.squeak.bifurcation import critical_value as critical_value
from stickslip.squeak.bifurcation import limit_cycles as limit_cycles
from stickslip.squeak.bifurcation import stability_map as stability_map
from stickslip.squeak.couplings import Coupling as Coupling
from stickslip.squeak.couplings import Pair as Pair
from stickslip.squeak.couplings import coupling as coupling
from stickslip.squeak.cycles import LimitCycle as LimitCycle
from stickslip.squeak.cycles import limit_cycle as limit_cycle
from stickslip.squeak.quality import Impulsiveness as Impulsiveness
from stickslip.squeak.quality import SoundQuality as SoundQuality
from stickslip.squeak.quality import impulsiveness as impulsiveness
from stickslip.squeak.quality import sound_quality as sound_quality
from stickslip.squeak.sound import sound_pressure as sound_pressure
from stickslip.squeak.sound import squeak_record as squeak_record
from stickslip.squeak.sound import squeak_rig as squeak_rig
from stickslip.squeak.spectra import BurstSpectra as BurstSpectra
from stickslip.squeak.spectra import Clip as Clip
from stickslip.squeak.spectra import burst_clips as burst_clips
from stickslip.squeak.spectra import burst_spectra as burst_spectra
from stickslip.squeak.spectra import write_sound as write_sound
from stickslip.squeak.squeaks import Squeak as Squeak
from stickslip.squeak.squeaks import Squeaks as Squeaks
from stickslip.squeak.stability import SlidingMode as SlidingMode
from stickslip.squeak.stability import Stability as Stability

__all__: list[str]
