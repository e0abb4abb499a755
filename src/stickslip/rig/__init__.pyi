from stickslip.rig.rig import Shaker as Shaker
from stickslip.rig.sensor import Digitiser as Digitiser
from stickslip.rig.sensor import Mount as Mount
from stickslip.rig.sensor import Noise as Noise
from stickslip.rig.sensor import Sensor as Sensor
from stickslip.rig.settings import CommissionSettings as CommissionSettings
from stickslip.rig.settings import Guess as Guess
from stickslip.rig.settings import RigSettings as RigSettings
from stickslip.rig.settings import ShakerSettings as ShakerSettings
from stickslip.rig.settings import guess_columns as guess_columns
from stickslip.rig.settings import read_rig as read_rig
from stickslip.rig.settings import rig_settings as rig_settings
from stickslip.rig.settings import rig_toml as rig_toml

__all__: list[str]
