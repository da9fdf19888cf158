"""A joint that carries a movable mass."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...recordings.study import Study
from ..procedure import Procedure, late

if TYPE_CHECKING:
    from ...recordings.fault import Fault


class SliderProcedure(Procedure):
    """A joint that carries a movable mass."""

    name, command = "slider", "identify"
    faults = late("slider.slider_faults", "slider_faults")
    run = late("slider.identify_slider", "identify_slider")
    page = late("slider.slider_page", "page")

    def unfit(self, study: Study) -> dict[str, Fault]:
        """None: a recording of which too much is cut refuses the study."""
        return {}

    def asked(self, study: Study) -> bool:
        alone = any(table.alone for table in study.config.procedures.values())
        return not alone and study.rig.drive is not None and study.rig.slider is not None
