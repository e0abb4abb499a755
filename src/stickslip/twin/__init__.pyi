from stickslip.twin.belief import Belief as Belief
from stickslip.twin.search import believe as believe
from stickslip.twin.trial import Trial as Trial
from stickslip.twin.trial import try_on_twins as try_on_twins

__all__: list[str]
