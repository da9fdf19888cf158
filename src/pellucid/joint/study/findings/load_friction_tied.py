"""Finding: one load-friction coefficient represents both directions of power, which cannot be told apart."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.friction_terms import LOAD_FEATURE, features_of
from ....models.parameter import Verdict
from ..joint_case import JointCase

COMMON_COEFFICIENT_TEXT = (
    "motoring and generating load friction cannot be told apart from the load itself: one coefficient stands for both, "
    "and the intervals of inertia and gravity leave room for either."
)
"""Sentence on load friction with one coefficient for both directions of power."""

REASON_TEXTS = {
    "no known load": ("Without a known load,", ""),
    "held out": (
        "Only held-out recordings carry a known load, so that",
        'Mark a recording with a payload use = "fit".',
    ),
    "unknown drive": (
        "The drive's constant is not stated. Even with known payloads,",
        "State the drive's constant: the payloads then tell both.",
    ),
    "same payload": (
        "All fitted recordings carry the same known load, so that",
        "Record without the payload too, or with another one.",
    ),
    "small payload": (
        "The known payloads change the load too little:",
        "Record with a heavier payload, or fix it farther from the axis.",
    ),
}
"""Beginning of the sentence, and the remedy, by the reason for a common coefficient."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report that one coefficient represents two, and why."""
    if LOAD_FEATURE not in features_of(case.fit.model.names):
        return
    why = case.shares.why
    if why == "no known load" and any(mass for mass, _ in (motion.payload for motion in case.motions)):
        why = "held out"
    begins, do = REASON_TEXTS[why]
    yield Verdict("note", f"{begins} {COMMON_COEFFICIENT_TEXT}", do)
