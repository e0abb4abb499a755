from stickslip.bench.device import Block as Block
from stickslip.bench.device import Device as Device
from stickslip.bench.device import Found as Found
from stickslip.bench.device import Input as Input
from stickslip.bench.device import Output as Output
from stickslip.bench.device import Stream as Stream
from stickslip.bench.device import Tone as Tone
from stickslip.bench.device import blocks as blocks
from stickslip.bench.device import devices as devices
from stickslip.bench.device import find_device as find_device
from stickslip.bench.device import in_si as in_si
from stickslip.bench.monitor import Cycle as Cycle
from stickslip.bench.monitor import Flaw as Flaw
from stickslip.bench.monitor import Monitor as Monitor
from stickslip.bench.monitor import answers as answers
from stickslip.bench.recording import Acquired as Acquired
from stickslip.bench.recording import Tape as Tape
from stickslip.bench.recording import Trigger as Trigger
from stickslip.bench.recording import Wanted as Wanted
from stickslip.bench.recording import acquire as acquire
from stickslip.bench.sim import Fault as Fault
from stickslip.bench.sim import Sim as Sim

__all__: list[str]
