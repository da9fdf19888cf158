"""Whether conditions change how people move."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...study.procedures.procedure import Procedure, Progress, quiet
from .assessment_table import DEFAULT_STUDIES, AssessmentTable

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from ...files.fault import Fault
    from ...study.pages.page import Page
    from ...study.study import Study
    from .assessment_result import AssessmentResult


class AssessmentProcedure(Procedure[AssessmentTable, "AssessmentResult"]):
    """Whether conditions change how people move."""

    name, command = "assessment", "assess"
    table = AssessmentTable

    def faults(self, study: Study, table: AssessmentTable) -> list[Fault]:
        from .pointing_faults import assessment_faults

        return assessment_faults(study, table)

    def run(
        self,
        study: Study,
        table: AssessmentTable,
        tell: Progress = quiet,
        *,
        studies: int = DEFAULT_STUDIES,
        executor: Executor | None = None,
    ) -> AssessmentResult:
        from .assess import assess

        return assess(study, table, tell, studies=studies, executor=executor)

    def page(self, study: Study, found: AssessmentResult) -> Page:
        from .assessment_page import page

        return page(study, found)
