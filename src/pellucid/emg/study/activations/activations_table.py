"""Table ``[activations]`` of study.toml."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ....study.study_fields import ProcedureTable, Word
from ....study.study_file import StudyFile
from ..emg_torque.emg_torque_table import EmgTorqueTable


class ActivationsTable(ProcedureTable):
    """Settings of activations: ``[activations]``. It requires ``[emg_torque]``, which states EMG and torque.

    Attributes
    ----------
    trust : float or None
        Weight of the deviation from EMG, against the torque; by default chosen within the fitted recordings.
    effort : float or None
        Weight of the activity of a muscle without EMG; chosen together with `trust`.
    unrecorded : str
        Method for muscles that never had an electrode: ``"neighbour"``, the EMG of their group, or ``"static"``, static
        optimisation.
    lost : tuple of str
        Channels whose electrodes were lost in the test recordings, which are filled in from the others.
    fill : str
        Method that fills them in: ``"synergies"`` or ``"linear"``.
    """

    trust: float | None = Field(None, gt=0)
    effort: float | None = Field(None, gt=0)
    unrecorded: Literal["neighbour", "static"] = "neighbour"
    lost: tuple[Word, ...] = ()
    fill: Literal["synergies", "linear"] = "synergies"

    def require_in(self, config: StudyFile) -> None:
        """Require the table [emg_torque], and either both or none of `trust` and `effort`."""
        if config.find_table(EmgTorqueTable) is None:
            raise ValueError("[activations]: found no table [emg_torque], expected it with EMG and torque channels")
        if (self.trust is None) != (self.effort is None):
            raise ValueError("[activations]: found one of trust and effort, expected both or neither")
