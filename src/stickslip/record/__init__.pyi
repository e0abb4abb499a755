from stickslip.record.channels import Channel as Channel
from stickslip.record.check import Fault as Fault
from stickslip.record.exchange import from_pandas as from_pandas
from stickslip.record.exchange import from_sep005 as from_sep005
from stickslip.record.exchange import from_xarray as from_xarray
from stickslip.record.metadata import Log as Log
from stickslip.record.metadata import checksum as checksum
from stickslip.record.record import StatedRig as StatedRig
from stickslip.record.record import Step as Step

__all__: list[str]
