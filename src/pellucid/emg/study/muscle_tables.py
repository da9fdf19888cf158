"""Common fields of the tables of study.toml that request the activity of muscles."""

from __future__ import annotations

from typing import Literal

from ...study.study_fields import ProcedureTable, Word, quantity


class MuscleTable(ProcedureTable):
    """Common fields of the tables of muscle activity.

    Attributes
    ----------
    muscles : tuple of str
        Channels ``emg.<muscle>`` to use; empty: all.
    emg : str
        Stream of these channels, if they are not in the recording's own file.
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
        Filter chain from raw EMG to envelopes: ``"hill"``, ``"knee"``, or ``"none"`` for recorded envelopes.
        Channels of unit 1 next to raw ones are envelopes: the chain smooths them only.
    mains : float, "auto" or None
        Frequency of a notch [Hz]; ``"auto"``: 50 or 60 Hz where the fitted recordings have such hum. By default
        as published, 50 Hz in the chain ``"hill"`` and none in the others.
    band : tuple of float or None
        Lowest and highest frequency of raw EMG [Hz]; by default as published.
    lowpass : float or None
        Cut-off of the envelope's low-pass [Hz]; by default as published.
    rms_window : float or None
        Length of the window whose root mean square is the envelope [s], instead of a low-pass.
    """

    chain: Literal["hill", "knee", "none"] = "hill"
    mains: Literal["auto"] | quantity("Hz", gt=0) | None = None
    band: tuple[quantity("Hz", gt=0), quantity("Hz", gt=0)] | None = None
    lowpass: quantity("Hz", gt=0) | None = None
    rms_window: quantity("s", gt=0) | None = None
