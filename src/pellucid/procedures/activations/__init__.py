"""Activations of all muscles, near their EMG, with which a measured torque follows."""
