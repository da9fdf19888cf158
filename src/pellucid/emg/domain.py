"""Electromyography: its contributions to the rest of Pellucid, as `_domains.py` describes."""

from ..study.procedures.command import PEOPLE_GROUP, Command
from ..study.procedures.procedure import ProcedureEntry

MIN_PIECE_S = 1.0
"""Pieces of a recording between two cuts are used from this length on [s].

It is ten times the memory of the slowest filter of angles and torques, which runs on each piece by itself. Chosen by
judgement; no measurement is recorded.
"""

EXCLUDED_FAULTS = ".muscle_channels:excluded_faults"
"""Function that examines the EMG of recordings that a procedure excludes."""

PROCEDURE_ENTRIES = (
    ProcedureEntry(
        package=f"{__package__}.study.emg_torque",
        name="emg_torque",
        command="calibrate",
        order=80,
        table_class="emg_torque_table:EmgTorqueTable",
        find_faults="study_faults:study_faults",
        find_excluded_faults=EXCLUDED_FAULTS,
        find="calibrate:calibrate",
        draw="calibration_page:page",
        find_inputs="emg_torque_table:card_and_muscle_files",
        brings=Command("calibrate", "Estimate torque from EMG, and test it on held-out data.", reads_cards=True),
        whole=True,
        shortest_piece=MIN_PIECE_S,
        cost=20.0,
    ),
    ProcedureEntry(
        package=f"{__package__}.study.activations",
        name="activations",
        command="activations",
        order=90,
        table_class="activations_table:ActivationsTable",
        find_faults=".emg_torque.study_faults:study_faults",
        find_excluded_faults=EXCLUDED_FAULTS,
        find="find_activations:find_activations",
        draw="activations_page:page",
        find_inputs=".emg_torque.emg_torque_table:muscle_files",
        brings=Command("activations", "Find activations near EMG that explain a torque.", reads_cards=True),
        whole=True,
    ),
    ProcedureEntry(
        package=f"{__package__}.study.isolated_muscle",
        name="isolated_muscle",
        command="calibrate",
        order=100,
        table_class="isolated_muscle_table:IsolatedMuscleTable",
        find_faults="isolated_muscle:faults",
        find="isolated_muscle:isolated_result",
        draw="isolated_page:page",
    ),
    ProcedureEntry(
        package=f"{__package__}.study.onset",
        name="onset",
        command="onset",
        order=110,
        table_class="onset_table:OnsetTable",
        find_faults="find_onsets:faults",
        find_excluded_faults=EXCLUDED_FAULTS,
        find="find_onsets:find_onsets",
        draw="onset_page:page",
        brings=Command("onset", "Find when muscles become active, from raw EMG.", PEOPLE_GROUP, typed="emg onset"),
        whole=True,
        cost=5.0,
    ),
    ProcedureEntry(
        package=f"{__package__}.study.cocontraction",
        name="cocontraction",
        command="cocontraction",
        order=120,
        table_class="cocontraction_table:CocontractionTable",
        find_faults="find_cocontraction:faults",
        find_excluded_faults=EXCLUDED_FAULTS,
        find="find_cocontraction:find_cocontraction",
        draw="cocontraction_page:page",
        brings=Command(
            "cocontraction", "Measure how much antagonists work against each other.", PEOPLE_GROUP,
            typed="emg cocontraction",
        ),
        whole=True,
    ),
    ProcedureEntry(
        package=f"{__package__}.study.emg_force",
        name="emg_force",
        command="emg-force",
        order=125,
        table_class="emg_force_table:EmgForceTable",
        find_faults="find_emg_force:faults",
        find_excluded_faults=EXCLUDED_FAULTS,
        find="find_emg_force:find_emg_force",
        draw="emg_force_page:page",
        brings=Command(
            "emg-force", "Compare EMG with force in contractions that do not move.", PEOPLE_GROUP, typed="emg force"
        ),
        whole=True,
    ),
    ProcedureEntry(
        package=f"{__package__}.study.synergies",
        name="synergies",
        command="synergies",
        order=130,
        table_class="synergies_table:SynergiesTable",
        find_faults="find_synergies:faults",
        find_excluded_faults=EXCLUDED_FAULTS,
        find="find_synergies:run",
        draw="synergies_page:page",
        brings=Command(
            "synergies", "Find groups of muscles that are active together.", PEOPLE_GROUP, typed="emg synergies"
        ),
        whole=True,
    ),
)
ARRAY_FUNCTIONS = {
    "onset": "signals.emg_onset:onset",
    "cocontraction": "cocontraction:cocontraction",
    "synergies": "estimators.synergies:synergies",
}
EXPORTER_CLASSES = ("study.estimator_folder:EstimatorExporter", "study.subject:MusclesExporter")
LOG_CHECKS = ("signals.emg_log:emg_log_findings",)
LOGS_CHECKS = ("signals.emg_log:exchanged_log_findings", "signals.emg_log:own_maximum_log_findings")
