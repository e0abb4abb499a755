from stickslip.solve.continuation import Branch as Branch
from stickslip.solve.continuation import Locus as Locus
from stickslip.solve.continuation import continue_orbit as continue_orbit
from stickslip.solve.continuation import doubled as doubled
from stickslip.solve.continuation import locus as locus
from stickslip.solve.continuation import period_doublings as period_doublings
from stickslip.solve.energies import EnergyFlow as EnergyFlow
from stickslip.solve.energies import GlobalError as GlobalError
from stickslip.solve.energies import Statistics as Statistics
from stickslip.solve.energies import energy as energy
from stickslip.solve.energies import energy_flow as energy_flow
from stickslip.solve.energies import global_error as global_error
from stickslip.solve.energies import statistics as statistics
from stickslip.solve.periodic import attractors as attractors
from stickslip.solve.poincare import SteadyState as SteadyState
from stickslip.solve.poincare import lyapunov as lyapunov
from stickslip.solve.self_excited import SteadySliding as SteadySliding
from stickslip.solve.self_excited import steady_sliding as steady_sliding
from stickslip.solve.sensitivity import Sensitivities as Sensitivities
from stickslip.solve.sensitivity import sensitivities as sensitivities
from stickslip.solve.simulate import crossings as crossings
from stickslip.solve.trajectory import Trajectory as Trajectory

__all__: list[str]
