from stickslip.twin.belief import Belief as Belief
from stickslip.twin.search import believe as believe
from stickslip.twin.trial import Trial as Trial

__all__: list[str]
