"""Activations of all muscles, near their EMG, that reproduce a measured torque."""

from ..command import Command

ORDER = 90
COMMAND = Command("activations", "Muscles' activations near EMG, by a measured torque.", reads_cards=True)
