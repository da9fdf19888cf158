"""Controllers: what this domain offers to the rest of Pellucid, as `_domains.py` describes."""

EXPORTER_CLASSES = (
    "export.controller_exporter:ArmExporter",
    "export.controller_exporter:JointExporter",
    "export.simulator_folder:SimulatorExporter",
)
