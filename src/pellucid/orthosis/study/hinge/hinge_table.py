"""Table ``[hinge]`` of study.toml."""

from __future__ import annotations

from typing import ClassVar

from ....study.study_fields import ProcedureTable, Word, quantity


class HingeTable(ProcedureTable):
    """A hinge between two segments, each with an IMU: ``[hinge]``.

    Attributes
    ----------
    proximal, distal : str
        What the names of each IMU's channels begin with.
    calibration : float
        The first seconds, from which axes, joint centre and the angle's zero are found [s].
    score_from : float
        From when on the angle is judged [s].
    jump : float
        A reference angle that changes by more than this from one sample to the next is no measurement [rad].
    delay : float or None
        How much later the IMUs show a motion than the reference does [s]; left out, it is found from the angular rates
        of the calibration's seconds.
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
