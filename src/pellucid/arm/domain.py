"""Robots of several joints: what it offers to the rest of Pellucid, as `_domains.py` describes."""

from ..study.procedures.procedure import ProcedureEntry

PROCEDURE_ENTRIES = (
    ProcedureEntry(
        package=f"{__package__}.study",
        name="tree",
        command="identify",
        order=30,
        table_class="tree_table:TreeTable",
        find_faults="tree_faults:tree_faults",
        find="identify_tree:identify_tree",
        draw="tree_page:page",
        find_inputs="tree_table:robot_files",
        find_notes="tree_faults:even_sampling_notes",
        leaves_out=False,
        uses_limits=True,
    ),
)
