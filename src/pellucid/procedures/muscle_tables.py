"""Common fields of the tables of study.toml that request the activity of muscles."""

from __future__ import annotations

from typing import Literal

from ..studies.study_fields import ProcedureTable, Word, quantity


class MuscleTable(ProcedureTable):
    """Common fields of the tables of muscle activity.

    Attributes
    ----------
    muscles : tuple of str
        Channels ``emg.<muscle>`` to use; empty: all.
    emg : str
        Stream of these channels, where they are not in the recording's own file.
    """

    muscles: tuple[Word, ...] = ()
    emg: Word = "emg"

    bridges = False

    def reads(self, channel: str, stream: str) -> bool:
        """Return whether a channel is EMG, in any stream."""
        return channel.startswith("emg.") and stream in ("", self.emg)


class EnvelopeTable(MuscleTable):
    """Common fields of the tables of EMG envelopes.

    Attributes
    ----------
    chain : str
        From raw EMG to envelopes: ``"hill"``, ``"knee"``, or ``"none"`` where envelopes were recorded.
    mains : float or None
        Where the notch of the chain ``"hill"`` lies [Hz]; left out: at 50 Hz, as published.
    """

    chain: Literal["hill", "knee", "none"] = "hill"
    mains: quantity("Hz", gt=0) | None = None
