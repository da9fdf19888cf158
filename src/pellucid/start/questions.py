"""The questions that only the lab can answer: at most five, each with a default and what hangs on it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

MAX_QUESTION_COUNT = 5
"""At most so many questions are asked; what else is uncertain is marked in study.toml."""

QUESTION_ORDER = (
    "rate", "effort", "position_unit", "counts_per_turn", "gear_turns", "full_duty", "supply_voltage",
    "emg_unit", "worn", "drive_constant", "payload", "angle_zero",
)  # fmt: skip
"""Questions by how much hangs on their answer."""


@dataclass(frozen=True)
class Question:
    """Something that the files cannot tell."""

    key: str  # short name of the question, by which an answer is given
    text: str  # the question
    default: str  # answer that --yes takes
    consequence: str  # what hangs on the answer
    choices: tuple[str, ...] = ()  # answers that are possible; empty for any


def select_questions(questions: Iterable[Question]) -> tuple[tuple[Question, ...], tuple[Question, ...]]:
    """Return the questions that are asked, by importance, and those that are only marked."""
    ranked = sorted(questions, key=lambda question: QUESTION_ORDER.index(question.key))
    return tuple(ranked[:MAX_QUESTION_COUNT]), tuple(ranked[MAX_QUESTION_COUNT:])
