"""Each cause of what a joint's model misses in one sentence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..models.causes import (
    BACKLASH,
    DELAY,
    DRIFT,
    MISALIGNED_AXIS,
    PARALLEL_SPRING,
    POSITION_FRICTION,
    SATURATION,
    WARM_UP,
    Cause,
)
from .pages.quantities import number, unit_text


@dataclass(frozen=True)
class CauseWords:
    """Words of a cause: a subject, with its size in braces, and what it may be in the machine."""

    subject: str
    example: str
    scale: float = 1.0  # what the size is multiplied by
    unit: str = ""  # unit of the scaled size, if not the cause's own
    negative: str = ""  # subject where the size is below 0, which is then stated without its sign
    unsized: str = ""  # subject where the size is unknown


WORDS: Mapping[str, CauseWords] = {
    PARALLEL_SPRING: CauseWords("A parallel spring of {}", "hose or cable"),
    POSITION_FRICTION: CauseWords("Friction that changes by {} along the travel", "worn or tight at one end"),
    MISALIGNED_AXIS: CauseWords("An axis whose angle errs by {}", "encoder or joint off centre"),
    BACKLASH: CauseWords(
        "Backlash of about {}", "play in the gear or its coupling", unsized="Backlash, whose width is unknown,"
    ),
    SATURATION: CauseWords("A sensor whose range ends at {}", "clipped effort"),
    DRIFT: CauseWords("An effort that drifts by {} over a recording", "temperature of drive or sensor"),
    WARM_UP: CauseWords("Friction that changes by {} over a recording", "a gear that warms up"),
    DELAY: CauseWords(
        "An effort that is {} late", "filter or bus of the drive", 1e3, "ms", negative="An effort that is {} early"
    ),
}
"""Words of each cause."""


def cause_sentence(cause: Cause) -> str:
    """Return a cause with its joint, size and share in one sentence."""
    words = WORDS[cause.name]
    value = words.scale * (abs(cause.size) if words.negative else cause.size)
    size = f"{_size_text(value, words.scale * cause.half_width)} {unit_text(words.unit or cause.unit)}"
    share = "less than 1" if cause.share < 0.01 else f"{100.0 * cause.share:.0f}"
    does = f"explains {share} % of the residual" if np.isfinite(cause.share) else "is in the data"
    subject = _subject(cause, words).format(size.rstrip())
    subject = f"At {cause.joint}, {subject[0].lower()}{subject[1:]}" if cause.joint else subject
    return f"{subject} {does}: {words.example}{', or a transmission that twists' if cause.may_twist else ''}?"


def _size_text(size: float, half_width: float) -> str:
    """Return a size, with its interval if there is one: one that is wider than the size shows how little is known."""
    if not np.isfinite(half_width):
        return number(size, digits=2)
    if not 0.0 < half_width < abs(size):
        return f"{number(size - half_width, digits=2)} to {number(size + half_width, digits=2)}"
    return f"{number(size, digits=2)} ± {number(half_width, digits=2)}"


def _subject(cause: Cause, words: CauseWords) -> str:
    if not np.isfinite(cause.size):
        return words.unsized
    return words.negative if cause.size < 0.0 and words.negative else words.subject
