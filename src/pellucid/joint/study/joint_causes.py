"""Causes of what a joint's model misses, collected from everything that finds one, and each in one sentence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...files.defects import clipped, sensor_range
from ...files.recording import Recording
from ...models.joint import PARALLEL_STIFFNESS
from ...numerics.motion import Motion
from ...numerics.regression import Stack, predict_effort_rows
from ...study.drive_channel import drive_channel
from ...study.pages.quantities import number, unit_text
from ...study.recorded_motions import drive_model, motions_of
from ...study.study import Study
from ..fit.causes import (
    BACKLASH,
    DELAY,
    DRIFT,
    MISALIGNED_AXIS,
    PARALLEL_SPRING,
    POSITION_FRICTION,
    SATURATION,
    WARM_UP,
    Cause,
    ParallelSpring,
    find_causes,
)
from ..fit.friction_family import FamilyFit
from ..fit.joint_estimate import JointEstimate
from .aligned_motions import align_recordings, find_alignments

CUT_BEYOND_RANGE_KINDS = (sensor_range.KIND, clipped.KIND)
"""Kinds of the defects that cut out samples beyond the range of a sensor."""


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
    """Return a cause with its size and share in one sentence."""
    words = WORDS[cause.name]
    value = words.scale * (abs(cause.size) if words.negative else cause.size)
    size = f"{_size_text(value, words.scale * cause.half_width)} {unit_text(words.unit or cause.unit)}"
    share = "less than 1" if cause.share < 0.01 else f"{100.0 * cause.share:.0f}"
    does = f"explains {share} % of the residual" if np.isfinite(cause.share) else "is in the data"
    return f"{_subject(cause, words).format(size.rstrip())} {does}: {words.example}?"


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


def causes_of(study: Study, fit: FamilyFit, data: Stack[Motion], spring: ParallelSpring) -> tuple[Cause, ...]:
    """Return the causes of what a fit misses of fitted `data`, the one that explains most first.

    The decisions of the delay and of cuts beyond a sensor's range are those of their own findings.
    """
    estimate = fit.estimate
    moved = {each.recording: float(each.moved) for each in find_alignments(study) if each.moved}
    names = dict.fromkeys(m.recording for m in data.motions)
    delays = {name: moved.get(name, moved.get("", 0.0)) for name in names}
    found = list(find_causes(estimate.model, data, estimate.array, delays if any(delays.values()) else None))
    if spring.is_found and PARALLEL_STIFFNESS in estimate.model.names:
        stiffness = fit.headline.estimate[PARALLEL_STIFFNESS]
        low, high = stiffness.interval(fit.headline.estimate.confidence)
        half = 0.5 * (high - low) if stiffness.standard_error > 0.0 else float("nan")
        found.append(Cause(PARALLEL_SPRING, float(stiffness.value), stiffness.unit, spring.share, half))
    known = {cause.name for cause in found}
    if SATURATION not in known:
        found += _cut_saturation(study, estimate)
    return tuple(sorted(found, key=lambda cause: -np.nan_to_num(cause.share)))


def _cut_saturation(study: Study, estimate: JointEstimate) -> Iterator[Cause]:
    """Yield the limit at which samples of a fitted effort were cut out, if any were."""
    for recording in align_recordings(study, "fit"):
        channel = drive_channel(recording, study)
        cut = [c for c in recording.cuts if c.kind in CUT_BEYOND_RANGE_KINDS and c.channel == channel and c.samples]
        if channel is None or not cut:
            continue
        levels = np.concatenate([recording[channel][c.first : c.last + 1] for c in cut])
        limit = float(levels[np.argmax(np.abs(levels))]) * drive_model(study.rig).gain
        share = _share_of_limit(study, recording, estimate, abs(limit))
        yield Cause(SATURATION, limit, estimate.model.effort_unit, share)
        return


def _share_of_limit(study: Study, recording: Recording, estimate: JointEstimate, limit: float) -> float:
    """Return the share of the residual that a limit explains, including the samples excluded from the fit for it."""
    whole = replace(recording, cuts=tuple(c for c in recording.cuts if c.kind not in CUT_BEYOND_RANGE_KINDS))
    before = after = 0.0
    for motion in motions_of([whole], study):
        measured, modelled = motion.rows(motion.effort), predict_effort_rows(estimate.model, estimate.array, motion)
        before += float(np.sum((measured - modelled) ** 2))
        after += float(np.sum((measured - np.clip(modelled, -limit, limit)) ** 2))
    return max(1.0 - after / before, 0.0) if before > 0.0 else float("nan")
