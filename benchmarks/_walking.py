"""The public study of walking that benchmarks and proofs calibrate."""

from __future__ import annotations

from pathlib import Path

from pellucid import datasets
from pellucid.procedures.registry import open_study
from pellucid.studies import Study
from pellucid.studies.study import STUDY_FILE

from ._size import is_smallest

DATASET = "lower_limb_walking"
JOINTS = 'joints = ["knee", "ankle"]'
MUSCLES_OF_THE_SMALLEST = (
    "soleus", "tibialis_anterior", "gastrocnemius_medialis", "semimembranosus", "vastus_lateralis",
)  # fmt: skip
"""Muscles of the smallest size, of the ankle and of the knee."""
FITTED = 'window = ["19 s", "24 s"]'
FITTED_OF_THE_SMALLEST = 'window = ["22 s", "24 s"]'
"""What is fitted at the smallest size."""


def walking_study(folder: Path) -> Study:
    """Make the study of walking in a new folder; at the smallest size with few muscles and two seconds to be fitted."""
    study = datasets.init(folder, dataset=DATASET)
    if not is_smallest():
        return study
    path = study.folder / STUDY_FILE
    text = path.read_text(encoding="utf-8")
    muscles = ", ".join(f'"{name}"' for name in MUSCLES_OF_THE_SMALLEST)
    for words, instead in ((JOINTS, f"{JOINTS}\nmuscles = [{muscles}]"), (FITTED, FITTED_OF_THE_SMALLEST)):
        if words not in text:
            raise RuntimeError(f"{DATASET}: found no {words} in its study.toml")
        text = text.replace(words, instead, 1)
    path.write_text(text, encoding="utf-8")
    return open_study(study.folder)
