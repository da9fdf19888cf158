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
        Channels; the displacement in the recording's amplitudes.
    stream : str
        Of the displacement, where it is not in the recording's own file.
    isometric_force : float
        Measured at rest length: errors are shares of it [N].
    max_isometric_force : float
        F_0 of the model [N].
    optimal_fibre_length, tendon_slack_length : float
        [m]
    pennation : float
        Of the fibres at their optimal length [rad].
    max_velocity : float
        In optimal fibre lengths per second [1/s].
    damping : float
        Of the fibre [1].
    tendon_strain : float
        Of the tendon under F_0 [1].
    score_from : float
        From when on the force is fitted and judged [s].
    confidence : float
        Of the intervals, in (0, 1).
    posterior : bool
        Whether a posterior is drawn beside the interval.
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
