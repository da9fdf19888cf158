"""Entry point of the domain of an orthosis and its wearer; `_domains.py` defines the interface."""

from ..study.procedures.procedure import ProcedureEntry

PROCEDURE_ENTRIES = (
    ProcedureEntry(
        package=f"{__package__}.study.transfer_function",
        name="transfer_function",
        command="identify",
        order=40,
        table_class="transfer_function_table:TransferFunctionTable",
        find_faults="identify_transfer:faults",
        find="identify_transfer:identify_transfer",
        draw="transfer_page:page",
    ),
    ProcedureEntry(
        package=f"{__package__}.study.hinge",
        name="hinge",
        command="identify",
        order=50,
        table_class="hinge_table:HingeTable",
        find_faults="identify_hinge:faults",
        find="identify_hinge:identify_hinge",
        draw="hinge_page:page",
    ),
    ProcedureEntry(
        package=f"{__package__}.study.coupling",
        name="coupling",
        command="identify",
        order=60,
        table_class="coupling_table:CouplingTable",
        find_faults="identify_coupling:faults",
        find="identify_coupling:identify_coupling",
        draw="coupling_page:page",
    ),
    ProcedureEntry(
        package=f"{__package__}.study.loaded_swing",
        name="loaded_swing",
        command="identify",
        order=70,
        table_class="loaded_swing_table:LoadedSwingTable",
        find_faults="identify_loaded_swing:faults",
        find="identify_loaded_swing:identify_loaded_swing",
        draw="loaded_swing_page:page",
    ),
)
EXPORTER_CLASSES = ("study.worn_values:WornExporter",)
TORQUE_EVALUATIONS = ("study.loaded_swing.seated_swings:SEATED_SWINGS",)
WORN_BODIES = ("study.coupling.cards:strapped_wearer",)
