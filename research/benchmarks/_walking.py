"""The public study of walking that benchmarks and proofs calibrate."""

from __future__ import annotations

from pathlib import Path

from pellucid.study import datasets
from pellucid.study.procedures.registry import open_study
from pellucid.study.study import STUDY_FILE, Study

from ._size import is_smallest

DATASET = "lower_limb_walking"
"""Name of the public data set of walking."""

JOINTS_LINE = 'joints = ["knee", "ankle"]'
"""Line of the data set's study.toml that names the joints; at the smallest size fewer muscles follow it."""

SMALLEST_MUSCLES = (
    "soleus", "tibialis_anterior", "gastrocnemius_medialis", "semimembranosus", "vastus_lateralis",
)  # fmt: skip
"""Muscles of ankle and knee that are calibrated at the smallest size."""

FITTED_LINE = 'window = ["19 s", "24 s"]'
"""Line of the data set's study.toml with the fitted stretch."""

SMALLEST_FITTED_LINE = 'window = ["22 s", "24 s"]'
"""Line that replaces it at the smallest size."""


def walking_study(folder: Path) -> Study:
    """Make the study of walking in a new folder; at the smallest size with few muscles and two seconds to be fitted."""
    study = datasets.init(folder, dataset=DATASET)
    if not is_smallest():
        return study
    path = study.folder / STUDY_FILE
    text = path.read_text(encoding="utf-8")
    muscles = ", ".join(f'"{name}"' for name in SMALLEST_MUSCLES)
    for words, instead in ((JOINTS_LINE, f"{JOINTS_LINE}\nmuscles = [{muscles}]"), (FITTED_LINE, SMALLEST_FITTED_LINE)):
        if words not in text:
            raise RuntimeError(f"{DATASET}: found no {words} in its study.toml")
        text = text.replace(words, instead, 1)
    path.write_text(text, encoding="utf-8")
    return open_study(study.folder)
