"""Entry point of the domain of people's movements; `_domains.py` defines the interface."""

from ..study.procedures.procedure import ProcedureEntry

PROCEDURE_ENTRIES = (
    ProcedureEntry(
        package=f"{__package__}.study",
        name="assessment",
        command="assess",
        order=140,
        table_class="assessment_table:AssessmentTable",
        find_faults="pointing:assessment_faults",
        find="assess:assess",
        draw="assessment_page:page",
        find_inputs="registered:registered_files",
    ),
)
ARRAY_FUNCTIONS = {
    "assess": "assess_table:assess_table",
}
