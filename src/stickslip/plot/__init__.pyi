from stickslip.plot.animation import animate as animate
from stickslip.plot.bifurcation import plot_basins as plot_basins
from stickslip.plot.bifurcation import plot_bifurcation as plot_bifurcation
from stickslip.plot.bifurcation import plot_boundary as plot_boundary
from stickslip.plot.bifurcation import plot_dither as plot_dither
from stickslip.plot.contact import plot_transition_speed as plot_transition_speed
from stickslip.plot.experiment import plot_plan as plot_plan
from stickslip.plot.friction import plot_consistency as plot_consistency
from stickslip.plot.limit_cycle import plot_limit_cycles as plot_limit_cycles
from stickslip.plot.limit_cycle import plot_stability as plot_stability
from stickslip.plot.maps import plot_map as plot_map
from stickslip.plot.traces import plot_force_comparison as plot_force_comparison
from stickslip.plot.wavelet import plot_wavelet as plot_wavelet

__all__: list[str]
