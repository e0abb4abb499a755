from stickslip.consistent.checks import Check as Check
from stickslip.consistent.contradictions import Consistency as Consistency
from stickslip.consistent.contradictions import consistency as consistency

__all__: list[str]
