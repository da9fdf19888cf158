"""Table ``[emg_torque]`` of study.toml."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from ....study.study_fields import ProcedureTable, RelativePath, ShownText, Word, quantity
from ...estimators.emg_worth import DEFAULT_WORTHWHILE_GAIN

if TYPE_CHECKING:
    from ....study.study import Study

BODY_CARD_NAMES = ("orthosis", "limb", "coupling", "strap")
"""Last parts of the names of cards by `identify` from which the wearer's torque is computed."""

MAX_INTERPOLATED_GAP_S = 0.01
"""Gaps of recorded envelopes, angles and moments up to this long are interpolated over [s].

It is one sample of the rate to which trials are thinned (`KEPT_RATE_HZ`), at which nothing of the gap is left.
"""


class EmgTorqueTable(ProcedureTable):
    """Torque of joints from EMG: ``[emg_torque]``.

    Attributes
    ----------
    joints : tuple of str
        Joints, each with channels ``angle.<joint>`` and ``moment.<joint>``, or the rig's own position and torque.
    muscles : tuple of str
        Muscles to use, by their channels ``emg.<muscle>``; empty: all.
    emg, moments : str
        Streams of these channels, if they are not in the recording's own file.
    chain : str
        Filter chain from raw EMG to envelopes: ``"knee"``, ``"able"``, ``"hill"``, or ``"none"`` for recorded
        envelopes.
    mains : float, "auto" or None
        Frequency of a notch [Hz]; ``"auto"``: 50 or 60 Hz where the fitted recordings have such hum. By default as
        published, 50 Hz in the chain ``"hill"`` and none in the others.
    band : tuple of float or None
        Lowest and highest frequency of raw EMG [Hz]; by default as published.
    lowpass : float or None
        Cut-off of the envelope's low-pass [Hz]; by default as published.
    rms_window : float or None
        Length of the window whose root mean square is the envelope [s], instead of a low-pass.
    reference_lowpass : float or None
        Cut-off of the zero-phase low-pass on the reference torque [Hz].
    largest_moment : dict of str to float
        Moment of a maximal contraction, by joint [N m]: the scale of moments that are given in %MVC.
    normalise : str or None
        Scale of envelopes. ``"mvc"``: the largest envelope in recordings with the protocol mvc; ``"largest"``: the
        largest envelope in the fitted recordings; ``"none"``: as the chain leaves them. By default the chain decides:
        one that normalises uses mvc recordings, or without any the fitted ones.
    rescale : float or None
        Duration of the beginning of each test recording by which changed channels are repaired [s]. Floor and range
        are scaled to the fitted ones, exchanged channels exchanged back, and channels with another muscle's signal
        predicted from the others. By default changed channels are used as they are, and named.
    muscle_file : str or None
        Path from the study's folder to an OpenSim model, a CEINMS subject, or a ``muscle_geometry.json`` made of a
        model. It gives the muscles' constants, and if it is of a model, their lengths and moment arms.
    muscle_names : dict of str to str
        Name of each of the study's muscles in that file.
    coordinates : dict of str to str
        Name of each joint's angle in an OpenSim model, such as ``"-knee_angle_r"`` if it has the opposite sign. By
        default the columns of ``angle.<joint>`` must be named as the model's coordinates are.
    worthwhile_gain : float
        Gain in R² over angles alone from which EMG counts as worth it.
    posterior : bool
        Whether a posterior of all joints' muscles is sampled in addition to their intervals.
    """

    joints: tuple[Word, ...] = Field(min_length=1)
    muscles: tuple[Word, ...] = ()
    emg: Word = "emg"
    moments: Word = "moments"
    chain: Literal["knee", "able", "hill", "none"] = "knee"
    mains: Literal["auto"] | quantity("Hz", gt=0) | None = None
    band: tuple[quantity("Hz", gt=0), quantity("Hz", gt=0)] | None = None
    lowpass: quantity("Hz", gt=0) | None = None
    rms_window: quantity("s", gt=0) | None = None
    reference_lowpass: quantity("Hz", gt=0) | None = None
    largest_moment: dict[Word, quantity("N*m", gt=0)] = Field(default_factory=dict)
    normalise: Literal["mvc", "largest", "none"] | None = None
    rescale: quantity("s", gt=0) | None = None
    muscle_file: RelativePath | None = None
    muscle_names: dict[Word, ShownText] = Field(default_factory=dict)
    coordinates: dict[Word, ShownText] = Field(default_factory=dict)
    worthwhile_gain: float = Field(default=DEFAULT_WORTHWHILE_GAIN, ge=0.0, lt=1.0)
    posterior: bool = False

    bridges: ClassVar[bool] = False

    def named_files(self) -> tuple[str, ...]:
        """Return the file of the muscles, if there is one."""
        return () if self.muscle_file is None else (self.muscle_file,)

    def reads(self, channel: str, stream: str) -> bool:
        """Return whether the procedure reads a channel: angles, torques and EMG in their streams."""
        kind = channel.partition(".")[0]
        if stream:
            return (kind == "emg" and stream == self.emg) or (kind == "moment" and stream == self.moments)
        return channel in ("position", "torque") or kind in ("angle", "moment", "emg")

    def max_interpolated_gap(self, stream: str, channels: Collection[str]) -> float:
        """Return the longest gap [s] that is interpolated over.

        Raw EMG must be whole, since its filters need it, and so must an orthosis's own channels, which are
        differentiated.
        """
        is_raw = self.chain != "none" and any(name.startswith("emg.") for name in channels)
        return 0.0 if is_raw or {"position", "torque"} & set(channels) else MAX_INTERPOLATED_GAP_S


def muscle_files(study: Study) -> Iterator[Path]:
    """Yield the file of the muscles' constants, if a study names one."""
    for file in study.table(EmgTorqueTable).named_files():
        yield study.inside(file, "[emg_torque] muscle_file")


def card_and_muscle_files(study: Study) -> Iterator[Path]:
    """Yield the cards from which the wearer's torque is computed, and the file of the muscles' constants."""
    yield from (path for path in study.cards() if path.stem.split(".")[-1] in BODY_CARD_NAMES)
    yield from muscle_files(study)
