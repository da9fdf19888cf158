"""Table ``[isolated_muscle]`` of study.toml."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from ....study.study_fields import ProcedureTable, Word, quantity


class IsolatedMuscleTable(ProcedureTable):
    """One muscle, fully active, whose free end is moved: ``[isolated_muscle]``.

    Attributes
    ----------
    force, displacement : str
        Name of the channel. The displacement is a length. With the `amplitude` of a recording it may have any unit,
        and is scaled so that its largest value has that amplitude.
    stream : str
        Stream of the displacement, if it is not in the recording's own file.
    isometric_force : float
        Measured isometric force at rest length, to which errors are relative [N].
    max_isometric_force : float
        Maximal isometric force of the model [N].
    optimal_fibre_length : float
        Optimal fibre length [m].
    tendon_slack_length : float
        Slack length of the tendon [m].
    pennation : float
        Pennation angle of the fibres at their optimal length [rad].
    max_velocity : float
        Maximal shortening velocity in optimal fibre lengths per second [1/s].
    damping : float
        Damping of the fibre, relative to the maximal force [1].
    tendon_strain : float
        Strain of the tendon under the maximal isometric force [1].
    score_from : float
        Time from which the force is fitted and compared [s].
    confidence : float
        Confidence level of the intervals, in (0, 1).
    posterior : bool
        Whether a posterior is sampled in addition to the interval.
    """

    force: Word = "force"
    displacement: Word = "displacement"
    stream: Word = "displacement"
    isometric_force: quantity("N", gt=0)
    max_isometric_force: quantity("N", gt=0)
    optimal_fibre_length: quantity("m", gt=0)
    tendon_slack_length: quantity("m", gt=0)
    pennation: quantity("rad", ge=0) = 0.0
    max_velocity: float = Field(10.0, gt=0)
    damping: float = Field(0.1, ge=0)
    tendon_strain: float = Field(0.049, gt=0)
    score_from: quantity("s", ge=0) = 0.0
    confidence: float = Field(0.95, gt=0, lt=1)
    posterior: bool = False

    bridges: ClassVar[bool] = False

    def reads(self, channel: str, stream: str) -> bool:
        """Force and displacement."""
        return channel == self.displacement if stream == self.stream else not stream and channel == self.force
