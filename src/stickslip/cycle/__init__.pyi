from stickslip.cycle.joint import JointFriction as JointFriction
from stickslip.cycle.joint import JointLogs as JointLogs
from stickslip.cycle.joint import JointPrediction as JointPrediction
from stickslip.cycle.joint import regress_joint as regress_joint
from stickslip.cycle.joint import regress_joint_logs as regress_joint_logs
from stickslip.cycle.joint_onset import JointBacklash as JointBacklash
from stickslip.cycle.joint_onset import JointBreakaway as JointBreakaway
from stickslip.cycle.joint_onset import joint_backlash as joint_backlash
from stickslip.cycle.joint_onset import joint_breakaway as joint_breakaway
from stickslip.cycle.joint_onset import telling_motion as telling_motion
from stickslip.cycle.onset import Breakaway as Breakaway
from stickslip.cycle.onset import Presliding as Presliding
from stickslip.cycle.onset import breakaway as breakaway
from stickslip.cycle.onset import presliding as presliding
from stickslip.cycle.parts import Stretch as Stretch
from stickslip.cycle.parts import join_sticks as join_sticks
from stickslip.cycle.parts import overlapping as overlapping
from stickslip.cycle.regression import regress_friction as regress_friction
from stickslip.cycle.slips import SlipRinging as SlipRinging
from stickslip.cycle.slips import slip_ringing as slip_ringing
from stickslip.cycle.sticks import StickEvent as StickEvent
from stickslip.cycle.sticks import Sticks as Sticks
from stickslip.cycle.tribometer import Coefficients as Coefficients
from stickslip.cycle.tribometer import WearIn as WearIn
from stickslip.cycle.tribometer import friction_coefficients as friction_coefficients

__all__: list[str]
