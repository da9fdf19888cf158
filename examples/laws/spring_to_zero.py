"""A law for `pellucid rank --law`: it carries a robot's weight and drives the torque at the strap towards zero."""

import math


class Law:
    """Asks once a period for the torque of the knee orthosis's spring, of the elbow robot's motor or of the arm's."""

    WEIGHT = 1.55  # of the orthosis [N m]
    GAIN = 0.4  # of the torque that the strap gives
    ELBOW_WEIGHT = 2.6  # of the elbow robot [N m]
    ELBOW_GAIN = 0.5  # of the torque that the force sensor reads
    ARM_GAIN = 1.5  # of the torques that the arm's force sensors read
    SMOOTHING = 0.02  # of a new sample

    def reset(self):
        self.filtered = 0.0
        self.filtered_at = [0.0] * 4

    def step(self, time, position, torque):
        """Return the torque for the spring [N m]; `time` [s], `position` [rad], `torque` of the spring [N m]."""
        carried = self.WEIGHT * math.sin(position)
        self.filtered = self.filtered + self.SMOOTHING * (torque - carried - self.filtered)
        return carried - self.GAIN * self.filtered

    def elbow_step(self, time, position, torque):
        """Return the motor's torque [N m]; `time` [s], `position` [rad], `torque` of the wearer on the robot [N m]."""
        if torque == torque:  # NaN: the sensor says nothing
            self.filtered = self.filtered + self.SMOOTHING * (torque - self.filtered)
        return self.ELBOW_WEIGHT * math.sin(position) + self.ELBOW_GAIN * self.filtered

    def arm_step(self, time, position, torque):
        """Return each motor's torque [N m]; `position` [rad] and `torque` [N m], of the wearer, have four numbers."""
        for k, felt in enumerate(torque):
            if felt == felt:
                self.filtered_at[k] = self.filtered_at[k] + self.SMOOTHING * (felt - self.filtered_at[k])
        return [self.ARM_GAIN * one for one in self.filtered_at]
