"""An orthosis and its wearer: what it offers to the rest of Pellucid, as `_domains.py` describes."""

PROCEDURE_FOLDERS = (
    "study.coupling",
    "study.hinge",
    "study.loaded_swing",
    "study.transfer_function",
)
EXPORTER_CLASSES = ("study.worn_values:WornExporter",)
TORQUE_EVALUATIONS = ("study.loaded_swing.seated_swings:SEATED_SWINGS",)
WORN_BODIES = ("study.coupling.cards:strapped_wearer",)
