"""A law for `pellucid rank --law`: it carries the orthosis's weight and drives the strap's torque towards zero."""

import math


class Law:
    """Asks for the torque of the spring, once a millisecond."""

    WEIGHT = 1.55  # of the orthosis [N m]
    GAIN = 0.4  # of the torque that the strap gives
    SMOOTHING = 0.02  # of a new sample

    def reset(self):
        self.filtered = 0.0

    def step(self, time, position, torque):
        """Return the torque for the spring [N m]; `time` [s], `position` [rad], `torque` of the spring [N m]."""
        carried = self.WEIGHT * math.sin(position)
        self.filtered = self.filtered + self.SMOOTHING * (torque - carried - self.filtered)
        return carried - self.GAIN * self.filtered
