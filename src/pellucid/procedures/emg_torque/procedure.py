"""Torque of joints from EMG, by several methods, on held-out data."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import ClassVar, Literal

from pydantic import Field

from ...recordings.study import Study
from ...recordings.study_fields import Place, ProcedureTable, Said, Word, quantity
from ..procedure import Procedure, late

BODY_CARDS = ("orthosis", "limb", "coupling", "strap")
"""Last parts of the names of cards that `identify` wrote, by which the wearer's torque is told."""


class EmgTorqueTable(ProcedureTable):
    """Torque of joints from EMG: ``[emg_torque]``.

    Attributes
    ----------
    joints : tuple of str
        Each with channels ``angle.<joint>`` and ``moment.<joint>``, or the rig's own position and torque.
    muscles : tuple of str
        Channels ``emg.<muscle>`` to use; empty: all.
    emg, moments : str
        Streams, where these channels are not in the recording's own file.
    chain : str
        From raw EMG to envelopes: ``"knee"``, ``"able"``, ``"hill"``, or ``"none"`` where envelopes were recorded.
    mains : float or None
        Where the notch of the chain ``"hill"`` lies [Hz]; left out: at 50 Hz, as published.
    reference_lowpass : float or None
        Cut-off of the zero-phase low-pass on the reference torque [Hz].
    largest_moment : dict of str to float
        What a maximal contraction reached, by joint [N m]: moments given in %MVC are taken as so many of these.
    normalise : str or None
        ``"mvc"``: envelopes over the largest of recordings with the protocol mvc, whatever the chain; ``"largest"``:
        over the largest of what is fitted; ``"none"``: as the chain leaves them. Left out: a chain that normalises by
        mvc recordings, or by the largest where there is none; one that does not, not.
    rescale : float or None
        Beginning of each recording to be judged by which channels that changed are brought to floor and range as
        fitted [s], exchanged ones exchanged again, those with another muscle's signal told by the others; without it
        they are used as they are, and named.
    muscle_file : str or None
        Path from the study's folder to an OpenSim model, a CEINMS subject, or the ``muscle_geometry.json`` that was
        made of a model: the muscles' constants, and of a model their lengths and moment arms.
    muscle_names : dict of str to str
        What that file calls the study's muscles.
    coordinates : dict of str to str
        What an OpenSim model calls each joint's angle, ``"-knee_angle_r"`` where it grows the other way; empty: columns
        of ``angle.<joint>`` that are called as the model's coordinates are.
    posterior : bool
        Whether a posterior of all joints' muscles together is drawn beside their intervals.
    """

    joints: tuple[Word, ...] = Field(min_length=1)
    muscles: tuple[Word, ...] = ()
    emg: Word = "emg"
    moments: Word = "moments"
    chain: Literal["knee", "able", "hill", "none"] = "knee"
    mains: quantity("Hz", gt=0) | None = None
    reference_lowpass: quantity("Hz", gt=0) | None = None
    largest_moment: dict[Word, quantity("N*m", gt=0)] = Field(default_factory=dict)
    normalise: Literal["mvc", "largest", "none"] | None = None
    rescale: quantity("s", gt=0) | None = None
    muscle_file: Place | None = None
    muscle_names: dict[Word, Said] = Field(default_factory=dict)
    coordinates: dict[Word, Said] = Field(default_factory=dict)
    posterior: bool = False

    bridges: ClassVar[bool] = False

    def reads(self, channel: str, stream: str) -> bool:
        """Angles, torques and EMG, wherever they are."""
        kind = channel.partition(".")[0]
        if stream:
            return (kind == "emg" and stream == self.emg) or (kind == "moment" and stream == self.moments)
        return channel in ("position", "torque") or kind in ("angle", "moment", "emg")


class EmgTorqueProcedure(Procedure):
    """Torque of joints from EMG, by several methods, on held-out data."""

    name, command = "emg_torque", "calibrate"
    whole = True
    table = EmgTorqueTable
    faults = late("emg_torque.study_faults", "study_faults")
    run = late("emg_torque.calibrate", "calibrate")
    page = late("emg_torque.calibration_page", "page")

    def inputs(self, study: Study) -> Iterable[Path]:
        """Cards of the bodies that a torque is told by, and the muscles' constants."""
        yield from (p for p in study.cards() if p.stem.split(".")[-1] in BODY_CARDS)
        constants = study.table(EmgTorqueTable).muscle_file
        if constants is not None:
            yield study.inside(constants, "[emg_torque] muscle_file")
