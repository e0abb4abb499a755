from stickslip.story.findings import check_table as check_table
from stickslip.story.findings import write_table as write_table
from stickslip.story.folder import check_folder as check_folder
from stickslip.story.simulation import Outcome as Outcome
from stickslip.story.simulation import outcome as outcome
from stickslip.story.simulation import require_output as require_output
from stickslip.story.story import Caution as Caution
from stickslip.story.story import Line as Line
from stickslip.story.story import Story as Story
from stickslip.story.story import Table as Table
from stickslip.story.story import doubts as doubts

__all__: list[str]
