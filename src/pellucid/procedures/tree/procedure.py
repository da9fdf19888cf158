"""A robot of several joints, identified at once."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from ..procedure import Procedure, late
from .tree_table import TreeTable

if TYPE_CHECKING:
    from ...recordings.fault import Fault
    from ...recordings.study import Study


class TreeProcedure(Procedure):
    """A robot of several joints, identified at once."""

    name, command = "tree", "identify"
    uses_limits = True
    table = TreeTable
    faults = late("tree.tree_faults", "tree_faults")
    run = late("tree.identify_tree", "identify_tree")
    page = late("tree.tree_page", "page")

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
