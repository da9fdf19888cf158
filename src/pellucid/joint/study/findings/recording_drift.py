"""Finding: parameters differ between recordings, as those of hot and cold machines or of a gain set anew do."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....models.parameter import Verdict
from ....study.pages.quantities import number, unit_text
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """Report the parameters that differ between recordings, by how much, and what their intervals make of it."""
    estimate = case.fit.estimate
    between = estimate.between_recordings
    if between is None or not between.is_told.any():
        return
    said = []
    for i in np.flatnonzero(between.is_told):
        values, spread = between.values[:, i], float(between.spread[i])
        low, high = int(np.argmin(values)), int(np.argmax(values))
        unit = unit_text(estimate[between.names[i]].unit)
        said.append(
            f"{between.names[i].replace('_', ' ')} from {number(float(values[low]), spread)} "
            f"({between.recordings[low]}) to {number(float(values[high]), spread)} {unit} ({between.recordings[high]})"
        )
    text = (
        f"Parameters differ between the {len(between.recordings)} recordings by more than their errors: "
        f"{'; '.join(said)}. Parameters by recording save {100.0 * between.improvement:.2g} % of the error on blocks "
        "left out. Intervals contain the spread."
    )
    do = "Look what changed between them (heat, load, a gain set anew), or identify them apart."
    yield Verdict("warning", text, do)
