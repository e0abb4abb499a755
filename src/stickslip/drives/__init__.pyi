from stickslip.drives.kinds import Belt as Belt
from stickslip.drives.kinds import Crank as Crank
from stickslip.drives.kinds import HarmonicBase as HarmonicBase
from stickslip.drives.kinds import HarmonicForce as HarmonicForce
from stickslip.drives.kinds import MultiTone as MultiTone
from stickslip.drives.kinds import Ramp as Ramp
from stickslip.drives.kinds import Recorded as Recorded
from stickslip.drives.kinds import Release as Release
from stickslip.drives.kinds import SpeedProfile as SpeedProfile
from stickslip.drives.on_another import Dithered as Dithered
from stickslip.drives.on_another import Imposed as Imposed
from stickslip.drives.on_another import Later as Later

__all__: list[str]
