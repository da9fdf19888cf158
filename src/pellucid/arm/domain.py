"""Entry point of the domain of robots with several joints; `_domains.py` defines the interface."""

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
        makes_joint_cards=True,
    ),
)
