from stickslip.laws.compliant import CompliantContact as CompliantContact
from stickslip.laws.compliant import Dahl as Dahl
from stickslip.laws.compliant import InertialContact as InertialContact
from stickslip.laws.compliant import LuGre as LuGre
from stickslip.laws.coulomb import Coulomb as Coulomb
from stickslip.laws.coulomb import Geared as Geared
from stickslip.laws.coulomb import LinearSlope as LinearSlope
from stickslip.laws.coulomb import PositionLoad as PositionLoad
from stickslip.laws.export import export_fmu as export_fmu
from stickslip.laws.export import export_law as export_law
from stickslip.laws.series import ElastoSlip as ElastoSlip
from stickslip.laws.series import InSeries as InSeries
from stickslip.laws.state_variable import RateState as RateState
from stickslip.laws.state_variable import SmoothStateVariable as SmoothStateVariable
from stickslip.laws.state_variable import StateVariable as StateVariable
from stickslip.laws.stribeck import FrictionCurve as FrictionCurve
from stickslip.laws.stribeck import Stribeck as Stribeck
from stickslip.laws.stribeck import Tabulated as Tabulated
from stickslip.laws.stribeck import TimeDelay as TimeDelay
from stickslip.laws.surfaces import Pair as Pair
from stickslip.laws.surfaces import RoughSurface as RoughSurface
from stickslip.laws.surfaces import pair as pair

__all__: list[str]
