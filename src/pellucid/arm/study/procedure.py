"""Procedure for a robot of several joints, identified together."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from ...study.procedures.procedure import Procedure, Progress, quiet
from .tree_table import TreeTable

if TYPE_CHECKING:
    from ...files.fault import Fault
    from ...study.pages.page import Page
    from ...study.study import Study
    from .tree_result import TreeResult


class TreeProcedure(Procedure[TreeTable, "TreeResult"]):
    """Procedure for a robot of several joints, identified together."""

    name, command = "tree", "identify"
    uses_limits = True
    table = TreeTable

    def faults(self, study: Study, table: TreeTable) -> list[Fault]:
        from .tree_faults import tree_faults

        return tree_faults(study)

    def run(self, study: Study, table: TreeTable, tell: Progress = quiet) -> TreeResult:
        from .identify_tree import identify_tree

        return identify_tree(study, tell)

    def page(self, study: Study, found: TreeResult) -> Page:
        from .tree_page import page

        return page(study, found)

    def inputs(self, study: Study) -> Iterable[Path]:
        """Return the robot's file."""
        urdf = study.table(TreeTable).urdf
        return () if urdf is None else (study.inside(urdf, "[tree] urdf"),)

    def cut(self, study: Study) -> list[Fault]:
        """Return the cuts, and the notes on jittering clocks."""
        from .tree_faults import even_sampling_notes

        return [*super().cut(study), *even_sampling_notes(study)]

    def unfit(self, study: Study) -> dict[str, Fault]:
        """Return nothing, because a recording with too many cuts refuses the whole study."""
        return {}
