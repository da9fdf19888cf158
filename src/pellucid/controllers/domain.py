"""Controllers: what this domain offers to the rest of Pellucid, as `_domains.py` describes."""

EXPORTER_CLASSES = (
    "export.joint_exporter:ArmExporter",
    "export.joint_exporter:JointExporter",
    "export.simulator_folder:SimulatorExporter",
)
