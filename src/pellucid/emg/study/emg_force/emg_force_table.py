"""Table ``[emg_force]`` of study.toml."""

from __future__ import annotations

from pydantic import Field

from ....study.study_fields import Word
from ..muscle_tables import EnvelopeTable


class EmgForceTable(EnvelopeTable):
    """Settings of EMG against force: ``[emg_force]``.

    Attributes
    ----------
    agonists : dict of str to str
        Muscle that pulls in each task, by the recordings' condition; results list it first.
    force : str
        Channel of the force, in every recording's own file.
    follows : float
        Smallest correlation of envelope and force that counts as following it, in (0, 1).
    confidence : float
        Confidence level of the intervals over people, in (0, 1).
    """

    agonists: dict[str, Word] = Field(min_length=1)
    force: Word = "force"
    follows: float = Field(0.5, gt=0, lt=1)
    confidence: float = Field(0.95, gt=0, lt=1)

    def reads(self, channel: str, stream: str) -> bool:
        """Return whether a channel is EMG, in any stream, or the force."""
        return super().reads(channel, stream) or (channel == self.force and stream == "")
