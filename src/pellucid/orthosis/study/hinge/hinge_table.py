"""Table ``[hinge]`` of study.toml."""

from __future__ import annotations

from typing import ClassVar

from ....study.study_fields import ProcedureTable, Word, quantity


class HingeTable(ProcedureTable):
    """A hinge between two segments, each with an IMU: ``[hinge]``.

    Attributes
    ----------
    proximal, distal : str
        Prefix of the channel names of each IMU.
    calibration : float
        Duration at the beginning from which axes, joint centre and the angle's zero are estimated [s].
    score_from : float
        Time after which the angle is evaluated [s].
    jump : float
        Largest plausible change of the reference angle between two samples; samples with a larger one are excluded
        [rad].
    delay : float or None
        Delay of the IMUs behind the reference [s]; if None, it is estimated from the angular rates of the calibration.
    """

    alone: ClassVar[bool] = True

    proximal: Word = "proximal"
    distal: Word = "distal"
    calibration: quantity("s", gt=0) = 10.0
    score_from: quantity("s", ge=0) = 10.0
    jump: quantity("rad", gt=0)
    delay: quantity("s") | None = None

    def reads(self, channel: str, stream: str) -> bool:
        """Rates and accelerations; a reference has a rule of its own for what is no measurement."""
        side, _, what = channel.partition(".")
        measured = what.startswith(("acceleration.", "angular_velocity."))
        return not stream and side in (self.proximal, self.distal) and measured
