"""Activations of all muscles, near their EMG, that reproduce a measured torque."""

from ....study.procedures.command import Command

PROCEDURE_ORDER = 90
"""Position of this procedure among all procedures; the smallest comes first."""

PROCEDURE_COMMAND = Command("activations", "Find activations near EMG that explain a torque.", reads_cards=True)
"""Command that runs this procedure alone."""
