"""One joint: its contributions to the rest of Pellucid, as `_domains.py` describes."""

from ..study.procedures.procedure import ProcedureEntry

PROCEDURE_ENTRIES = (
    ProcedureEntry(
        package=f"{__package__}.study",
        name="joint",
        command="identify",
        order=10,
        find_faults="procedure:faults",
        find="procedure:run",
        draw="procedure:page",
        is_asked="procedure:is_joint_asked",
        find_notes="procedure:notes",
        leaves_out=False,
        takes_families=True,
        makes_joint_cards=True,
    ),
    ProcedureEntry(
        package=f"{__package__}.study",
        name="joints",
        command="identify",
        order=15,
        find_faults="each_joint:each_joint_faults",
        find="each_joint:identify_each_joint",
        draw="each_joint_page:page",
        is_asked="procedure:is_each_joint_asked",
        find_notes="each_joint:each_joint_notes",
        leaves_out=False,
        takes_families=True,
        takes_each_joint=True,
        makes_joint_cards=True,
    ),
    ProcedureEntry(
        package=f"{__package__}.slider.study",
        name="slider",
        command="identify",
        order=20,
        find_faults="recorded_slider:slider_faults",
        find="identify_slider:identify_slider",
        draw="slider_page:page",
        is_asked="..study.procedure:is_slider_asked",
        leaves_out=False,
        makes_joint_cards=True,
    ),
)
