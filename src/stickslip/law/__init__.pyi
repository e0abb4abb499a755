from stickslip.law.fit_curve import CurveFit as CurveFit
from stickslip.law.fit_curve import LoadLine as LoadLine
from stickslip.law.fit_curve import friction_over_load as friction_over_load
from stickslip.law.law import LawFit as LawFit
from stickslip.law.memory import FrictionMemory as FrictionMemory
from stickslip.law.memory import friction_memory as friction_memory
from stickslip.law.verdict import LawComparison as LawComparison

__all__: list[str]
