"""An exoskeleton's swings, empty and with relaxed legs in it."""

from __future__ import annotations

from typing import ClassVar

from pydantic import Field

from ...recordings.study_fields import ProcedureTable, quantity
from ..procedure import Procedure, late


class LoadedSwingTable(ProcedureTable):
    """An exoskeleton's swings, empty and with relaxed legs in it: ``[loaded_swing]``.

    Attributes
    ----------
    lowpass : float
        Cut-off of the zero-phase low-pass on position and torque [Hz].
    confidence : float
        Of the intervals, in (0, 1).
    """

    alone: ClassVar[bool] = True

    lowpass: quantity("Hz", gt=0) = 4.0
    confidence: float = Field(0.95, gt=0, lt=1)

    bridges: ClassVar[bool] = False

    def reads(self, channel: str, stream: str) -> bool:
        """Position and torque."""
        return not stream and channel in ("position", "torque")


class LoadedSwingProcedure(Procedure):
    """An exoskeleton's swings, empty and with relaxed legs in it."""

    name, command = "loaded_swing", "identify"
    table = LoadedSwingTable
    faults = late("loaded_swing.identify_loaded_swing", "faults")
    run = late("loaded_swing.identify_loaded_swing", "identify_loaded_swing")
    page = late("loaded_swing.loaded_swing_page", "page")
