from stickslip.figures.bifurcation import plot_basins as plot_basins
from stickslip.figures.bifurcation import plot_bifurcation as plot_bifurcation
from stickslip.figures.bifurcation import plot_boundary as plot_boundary
from stickslip.figures.bifurcation import plot_dither as plot_dither
from stickslip.figures.bifurcation import plot_limit_cycles as plot_limit_cycles
from stickslip.figures.bifurcation import plot_stability as plot_stability
from stickslip.figures.contact import plot_transition_speed as plot_transition_speed
from stickslip.figures.friction import plot_consistency as plot_consistency
from stickslip.figures.maps import plot_map as plot_map
from stickslip.figures.maps import plot_wavelet as plot_wavelet
from stickslip.figures.traces import plot_force_comparison as plot_force_comparison
from stickslip.figures.traces import plot_plan as plot_plan
from stickslip.figures.trajectory import animate as animate

__all__: list[str]
