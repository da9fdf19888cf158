"""A study's motions with its drive where it belongs: recorded late against the encoder, it is moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import PellucidError
from ...fit.delay import Delay
from ...fit.joint.drive_delay import drive_delay
from ...recordings.delay import moved
from ...recordings.drive_channel import drive_channel
from ...recordings.recording import Recording
from ...recordings.study import Study
from ...signals.effort import drive_model
from ...signals.motion import Motion
from .first_look import simple_model, some_of
from .joined_clocks import clocks_to_find, rejoined
from .recorded_motions import Excerpt, excerpt_of, motions_of


@dataclass(frozen=True)
class Alignment:
    """What was found of a drive's delay: `moved` [s] is by how much its channel was moved; `asked` in study.toml."""

    channel: str
    delay: Delay | None
    moved: float
    asked: bool

    @property
    def said(self) -> str:
        """One sentence; empty where there is nothing to tell."""
        d = self.delay
        if d is None:
            return (
                f"The delay of {self.channel} against position was not found: nothing in these recordings shows it."
                if self.asked
                else ""
            )
        interval = f"95 % interval {1e3 * d.low:.3g} to {1e3 * d.high:.3g} ms"
        if not self.moved:
            return f"No delay of {self.channel} against position is certain ({interval})." if self.asked else ""
        first, second = (self.channel, "position") if d.value > 0.0 else ("position", self.channel)
        return (
            f"{first} comes {1e3 * abs(d.value):.3g} ms late, against {second} ({interval} for {self.channel}): "
            f"{self.channel} was moved by that before anything else."
        )

    @property
    def do(self) -> str:
        """What to write."""
        if not self.moved:
            return ""
        return (
            f'Write {self.channel} = {{ delay = "{1e3 * self.moved:.3g} ms" }} in [channels] to keep it, or '
            'delay = "0 s" to use the channel as recorded.'
        )


def motions(study: Study, use: str | None = None) -> tuple[Motion, ...]:
    """Every stretch of every recording of a study in which nothing was cut out and the drive was enabled, its drive
    moved to where it belongs, filtered and differentiated."""
    return motions_of(aligned(study, use), study)


def aligned(study: Study, use: str | None = None) -> list[Recording]:
    """A study's recordings with their streams joined by the clocks found, and the drive where it belongs."""
    return [_aligned(rejoined(r, study), study) for r in study.recordings(use)]


def excerpt(study: Study, everything: tuple[Motion, ...]) -> Excerpt:
    """Everything that was recorded where it is little, and parts of each recording otherwise, aligned as it was."""
    return excerpt_of(aligned(study), study, everything)


def alignment(study: Study) -> Alignment | None:
    """The drive's delay against the encoder, from the fitted recordings; None where study.toml states it."""
    if "alignment" not in study.found:
        study.found["alignment"] = _alignment(study)
    return study.found["alignment"]


def _aligned(recording: Recording, study: Study) -> Recording:
    found = alignment(study)
    return moved(recording, {found.channel: found.moved}) if found and _open(recording, study) else recording


def _open(recording: Recording, study: Study) -> bool:
    """Whether a recording's delay is to be estimated: study.toml gives none."""
    spec = study.specs_of(recording).get(drive_channel(recording, study) or "")
    return spec is not None and not isinstance(spec.delay, float) and not clocks_to_find(recording, study)


def _alignment(study: Study) -> Alignment | None:
    recordings = [r for r in study.recordings("fit") if "position" in r and _open(r, study)]
    if not recordings:
        return None
    channel = drive_channel(recordings[0], study)
    asked = any(study.specs_of(r)[channel].delay == "auto" for r in recordings if channel in r)
    step = max(float(np.median(np.diff(r.time))) for r in recordings)
    found = _estimated(recordings, study, step)
    certain = found is not None and (found.clear(step) or (asked and found.certain != 0.0))
    return Alignment(channel, found, found.value if certain else 0.0, asked)


def _estimated(recordings: Sequence[Recording], study: Study, step: float) -> Delay | None:
    drive = drive_model(study.rig)
    try:
        return drive_delay(
            simple_model(study), motions_of(some_of(recordings), study), drive.back_emf, quantile=1.96, step=step
        )
    except (PellucidError, np.linalg.LinAlgError):
        return None  # what is wrong with them is told by those who fit
