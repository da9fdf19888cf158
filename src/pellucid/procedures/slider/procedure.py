"""A joint that carries a movable mass."""

from __future__ import annotations

from ...recordings.study import Study
from ..procedure import Procedure, late


class SliderProcedure(Procedure):
    """A joint that carries a movable mass."""

    name, command = "slider", "identify"
    faults = late("slider.slider_faults", "slider_faults")
    run = late("slider.identify_slider", "identify_slider")
    page = late("slider.slider_page", "page")

    def asked(self, study: Study) -> bool:
        alone = any(table.alone for table in study.config.procedures.values())
        return not alone and study.rig.drive is not None and study.rig.slider is not None
