"""A joint that carries a movable mass."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from ....study.study import Study

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from .slider_result import SliderResult


class SliderProcedure(Procedure[None, "SliderResult"]):
    """A joint that carries a movable mass."""

    name, command = "slider", "identify"

    def faults(self, study: Study, table: None) -> list[Fault]:
        from .recorded_slider import slider_faults

        return slider_faults(study)

    def run(self, study: Study, table: None, tell: Progress = quiet) -> SliderResult:
        from .identify_slider import identify_slider

        return identify_slider(study, tell)

    def page(self, study: Study, found: SliderResult) -> Page:
        from .slider_page import page

        return page(study, found)

    def unfit(self, study: Study) -> dict[str, Fault]:
        """None: a recording of which too much is cut refuses the study."""
        return {}

    def asked(self, study: Study) -> bool:
        alone = any(table.alone for table in study.config.procedures.values())
        return not alone and study.rig.drive is not None and study.rig.slider is not None
