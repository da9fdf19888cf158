"""Electromyography: what it offers to the rest of Pellucid, as `_domains.py` describes."""

PROCEDURE_FOLDERS = (
    "study.activations",
    "study.cocontraction",
    "study.emg_force",
    "study.emg_torque",
    "study.isolated_muscle",
    "study.onset",
    "study.synergies",
)
ARRAY_FUNCTIONS = {
    "onset": "signals.emg_onset:onset",
    "cocontraction": "cocontraction:cocontraction",
    "synergies": "estimators.synergies:synergies",
}
EXPORTER_CLASSES = ("study.estimator_folder:EstimatorExporter", "study.subject:MusclesExporter")
