from stickslip.maps.basins import Attractor as Attractor
from stickslip.maps.basins import Basins as Basins
from stickslip.maps.bifurcation import Bifurcation as Bifurcation
from stickslip.maps.bifurcation import Change as Change
from stickslip.maps.boundaries import Boundary as Boundary
from stickslip.maps.boundaries import boundary as boundary
from stickslip.maps.boundaries import refine as refine
from stickslip.maps.dither import Dither as Dither
from stickslip.maps.dither import dithered_friction as dithered_friction
from stickslip.maps.grid import design as design
from stickslip.maps.grid import sensitivity as sensitivity
from stickslip.maps.plan import SweepFile as SweepFile
from stickslip.maps.plan import read_sweep as read_sweep

__all__: list[str]
