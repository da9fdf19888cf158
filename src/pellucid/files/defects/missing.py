"""Find missing samples: NaN in time or in a channel that the study reads."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..cut import Cut
from ..recording import make_cut
from .watched import WatchedRecording, find_runs

KIND = "missing_samples"


def find(watched: WatchedRecording) -> Iterator[Cut]:
    """Yield a cut for each run of NaN while the drive was on."""
    for name in ("time", *watched.channels):
        for first, length in zip(*find_runs(~np.isfinite(watched.recording[name]) & watched.usable), strict=True):
            many = "1 missing sample" if length == 1 else f"{length} missing samples"
            yield make_cut(watched.recording, KIND, name, first=first, last=first + length - 1, found=f"{many} (NaN)")
