from stickslip.answers.axes import axis_record as axis_record
from stickslip.answers.decays import Decay as Decay
from stickslip.answers.decays import compare_decays as compare_decays
from stickslip.answers.experiment import ExperimentPlan as ExperimentPlan
from stickslip.answers.experiment import plan_experiment as plan_experiment
from stickslip.answers.findings import Comparison as Comparison
from stickslip.answers.findings import Findings as Findings
from stickslip.answers.fits import Prediction as Prediction
from stickslip.answers.fits import Predictions as Predictions
from stickslip.answers.fits import fit_records as fit_records
from stickslip.answers.fits import predict as predict
from stickslip.answers.fits import read_fitted as read_fitted
from stickslip.answers.frequencies import TimeFrequency as TimeFrequency
from stickslip.answers.frequencies import time_frequency as time_frequency
from stickslip.answers.joints import analyze_joint as analyze_joint
from stickslip.answers.joints import compare_joints as compare_joints
from stickslip.answers.joints import episodes as episodes
from stickslip.answers.long_records import analyze_blocks as analyze_blocks
from stickslip.answers.many import Batch as Batch
from stickslip.answers.many import Kept as Kept
from stickslip.answers.many import Row as Row
from stickslip.answers.many import require_engine as require_engine
from stickslip.answers.many import spread as spread
from stickslip.answers.preparation import mend as mend
from stickslip.answers.squeaks import Condition as Condition
from stickslip.answers.squeaks import compare_squeaks as compare_squeaks

__all__: list[str]
