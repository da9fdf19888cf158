"""A robot of several joints, identified at once."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from ..procedure import Procedure, Progress, quiet
from .tree_table import TreeTable

if TYPE_CHECKING:
    from ...pages.page import Page
    from ...recordings.fault import Fault
    from ...recordings.study import Study
    from .tree_result import TreeResult


class TreeProcedure(Procedure[TreeTable, "TreeResult"]):
    """A robot of several joints, identified at once."""

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
        """The robot's file."""
        urdf = study.table(TreeTable).urdf
        return () if urdf is None else (study.inside(urdf, "[tree] urdf"),)

    def cut(self, study: Study) -> list[Fault]:
        """Cuts, and what was made of clocks that jitter."""
        from .tree_faults import evened

        return [*super().cut(study), *evened(study)]

    def unfit(self, study: Study) -> dict[str, Fault]:
        """None: a recording of which too much is cut refuses the study."""
        return {}
