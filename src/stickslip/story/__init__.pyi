from stickslip.story.fit import fit_numbers as fit_numbers
from stickslip.story.fit import fit_summary as fit_summary
from stickslip.story.fit import publish_fit as publish_fit
from stickslip.story.folder import check_folder as check_folder
from stickslip.story.maps import map_numbers as map_numbers
from stickslip.story.maps import publish_map as publish_map
from stickslip.story.rig import publish_rig as publish_rig
from stickslip.story.simulation import Outcome as Outcome
from stickslip.story.simulation import outcome as outcome
from stickslip.story.simulation import publish_run as publish_run
from stickslip.story.simulation import require_output as require_output

__all__: list[str]
