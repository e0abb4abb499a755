from stickslip.signals.clocks import clock_offset as clock_offset
from stickslip.signals.clocks import clock_rate as clock_rate
from stickslip.signals.clocks import synchronise as synchronise
from stickslip.signals.derivatives import differentiate as differentiate
from stickslip.signals.derivatives import smooth as smooth
from stickslip.signals.interpolate import without_delays as without_delays
from stickslip.signals.repair import fill_gaps as fill_gaps
from stickslip.signals.repair import fill_missing as fill_missing
from stickslip.signals.repair import remove_drift as remove_drift
from stickslip.signals.repair import remove_spikes as remove_spikes
from stickslip.signals.repair import repair_clock as repair_clock
from stickslip.signals.repair import resample as resample
from stickslip.signals.repair import restore_clipped as restore_clipped
from stickslip.signals.ridges import LocalMaximum as LocalMaximum
from stickslip.signals.ridges import Ridge as Ridge
from stickslip.signals.ridges import Spike as Spike
from stickslip.signals.ridges import find_ridges as find_ridges
from stickslip.signals.ridges import find_spikes as find_spikes
from stickslip.signals.ridges import local_maxima as local_maxima
from stickslip.signals.ridges import stft_map as stft_map
from stickslip.signals.wavelet import cone_of_influence as cone_of_influence
from stickslip.signals.wavelet import dyadic_map as dyadic_map
from stickslip.signals.wavelet import inverse_wavelet as inverse_wavelet
from stickslip.signals.wavelet import wavelet_blocks as wavelet_blocks
from stickslip.signals.wavelet import wavelet_overview as wavelet_overview

__all__: list[str]
