from stickslip.balance.balance import Pull as Pull
from stickslip.balance.balance import pulled_slider as pulled_slider
from stickslip.balance.felt_and_computed import ForceBand as ForceBand
from stickslip.balance.felt_and_computed import ForceComparison as ForceComparison
from stickslip.balance.felt_and_computed import compare_force as compare_force
from stickslip.balance.impact import ImpactTest as ImpactTest
from stickslip.balance.impact import impact_test as impact_test
from stickslip.balance.lag import SensorDelay as SensorDelay
from stickslip.balance.lag import sensor_delay as sensor_delay
from stickslip.balance.mounts import Resonance as Resonance

__all__: list[str]
