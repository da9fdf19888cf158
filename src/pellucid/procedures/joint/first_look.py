"""With what a study's recordings are looked at before any family is fitted: the simplest model, some of the samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...models.joint import JointModel, joint_model
from ...recordings.delay import recording_part
from ...recordings.recording import Recording
from ...recordings.study import Study
from ...signals.effort import drive_model

MOST = 200_000
"""Samples, at the recordings' rate, that are looked at; of more, stretches of every recording."""

STRETCHES = 4
"""Stretches of a long recording that are looked at."""


def simple_model(study: Study) -> JointModel:
    """Symmetric friction; payloads count as part of the joint where the drive's constant is not known."""
    unit = drive_model(study.rig).effort_unit
    made = joint_model(
        "symmetric",
        motion=study.rig.motion,
        effort_unit=unit,
        gravity=study.model.gravity,
        known=study.model.known,
    )
    return replace(made, payload_scale=1.0 if unit in ("N*m", "N") else 0.0)


def some_of(recordings: Sequence[Recording], most: int = MOST) -> list[Recording]:
    """The recordings, of long ones a few stretches spread over them."""
    total = sum(len(r) for r in recordings)
    if total <= most:
        return list(recordings)
    length = max(most // (STRETCHES * len(recordings)), 1)
    made = []
    for recording in recordings:
        starts = np.linspace(0, len(recording), STRETCHES + 1)[:-1].astype(int) if len(recording) > most else [0]
        ends = [s + length for s in starts] if len(starts) > 1 else [STRETCHES * length]
        made += [recording_part(recording, s, min(e, len(recording))) for s, e in zip(starts, ends, strict=True)]
    return made
