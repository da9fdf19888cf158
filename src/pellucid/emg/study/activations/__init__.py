"""Activations of all muscles, near their EMG, that reproduce a measured torque."""
