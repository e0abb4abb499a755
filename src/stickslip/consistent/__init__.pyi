from stickslip.consistent.checks import Check as Check
from stickslip.consistent.contradictions import Consistency as Consistency
from stickslip.consistent.contradictions import consistency as consistency
from stickslip.consistent.sliding_balance import sliding_boundary as sliding_boundary

__all__: list[str]
