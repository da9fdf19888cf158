"""Table ``[loaded_swing]`` of study.toml."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from ....study.study_fields import ProcedureTable, quantity


class LoadedSwingTable(ProcedureTable):
    """An exoskeleton's swings, empty and with relaxed legs in it: ``[loaded_swing]``.

    Attributes
    ----------
    lowpass : float
        Cut-off of the zero-phase low-pass on position and torque [Hz].
    confidence : float
        Confidence level of the intervals, in (0, 1).
    """

    alone: ClassVar[bool] = True

    lowpass: quantity("Hz", gt=0) = 4.0
    confidence: float = Field(0.95, gt=0, lt=1)

    bridges: ClassVar[bool] = False

    def reads(self, channel: str, stream: str) -> bool:
        """Position and torque."""
        return not stream and channel in ("position", "torque")
