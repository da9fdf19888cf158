"""Muscles of a proposed study's EMG: what all labels together tell, and what the laboratory answers of the doubtful."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from .._errors import StudyError
from ..files.muscle_names import MIN_SURE_CONFIDENCE, MuscleLabel, settle_muscles
from ..files.name_evidence import emg_muscle_label
from .inference.assign_roles import ColumnRole
from .proposal import Layout, Question


def with_settled_muscles(layouts: Sequence[Layout]) -> tuple[list[Layout], dict[str, MuscleLabel]]:
    """Return layouts whose EMG has the muscles that all labels together tell, and the labels that stay doubtful."""
    roles = {r.column: r for layout in layouts for r in layout.channels if r.quantity == "emg"}
    found = {column: emg_muscle_label(column) for column in roles}
    # A file may state the muscle beside its label.
    own = {c: label for c, label in found.items() if label is not None and roles[c].label == label.name}
    settled = settle_muscles(own)
    moved = {column: label for column, label in settled.items() if label.name != own[column].name}
    doubtful = {column: label for column, label in settled.items() if label.confidence < MIN_SURE_CONFIDENCE}

    def with_confidence(role: ColumnRole) -> ColumnRole:
        label = settled.get(role.column)
        if label is None or role.quantity != "emg" or label.confidence >= 1.0:
            return role
        return replace(role, why=f"{role.why}; muscle by its label, with a confidence of {label.confidence:g}")

    named = (with_muscles(layout, moved) for layout in layouts)
    return [layout.with_each(with_confidence) for layout in named], doubtful


def with_muscles(layout: Layout, labels: Mapping[str, MuscleLabel]) -> Layout:
    """Return a layout whose columns of EMG have the muscles of `labels`, by column."""
    taken = {role.label for role in layout.channels if role.column not in labels}

    def named(role: ColumnRole) -> ColumnRole:
        label = labels.get(role.column)
        if label is None or role.quantity != "emg" or label.name in taken:
            return role
        taken.add(label.name)
        return replace(role, label=label.name)

    return layout.with_each(named) if labels else layout


def muscle_questions(doubtful: Mapping[str, MuscleLabel]) -> list[Question]:
    """Return the question about the labels that name several muscles, if there are any."""
    if not doubtful:
        return []
    listed = "; ".join(f'"{column}": {label.muscle} or {", ".join(label.others)}' for column, label in doubtful.items())
    return [
        Question(
            "muscles",
            f"Which muscles do these labels name? {listed}",
            ", ".join(f"{column} = {label.muscle}" for column, label in doubtful.items()),
            "the muscle's name in all results, and its place in models of the leg",
        )
    ]


def said_muscles(answer: str, doubtful: Mapping[str, MuscleLabel]) -> dict[str, MuscleLabel]:
    """Return the muscles that an answer such as ``GM = gluteus_medius`` gives, by column."""
    said = {}
    for part in filter(None, map(str.strip, re.split(r"[,;]", answer))):
        column, _, muscle = (text.strip() for text in part.partition("="))
        muscle = re.sub(r"[\s-]+", "_", muscle).lower()
        if column not in doubtful or not re.fullmatch(r"[a-z][a-z0-9_]*", muscle):
            raise StudyError(f"muscles: found {part!r}, expected a muscle for {', '.join(doubtful)}, as in GM = soleus")
        said[column] = replace(doubtful[column], muscle=muscle, others=())
    return said
