"""Causes of what a joint's model misses, collected from everything that finds one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...files.defects import clipped, sensor_range
from ...files.recording import Recording
from ...models.causes import SATURATION, Cause, ParallelSpring
from ...models.joint import PARALLEL_STIFFNESS
from ...numerics.motion import Motion
from ...numerics.regression import Stack, predict_effort_rows
from ...study.drive_channel import drive_channel
from ...study.recorded_motions import drive_model, motions_of
from ...study.study import Study
from ..fit.causes import find_causes, spring_cause
from ..fit.friction_family import FamilyFit
from ..fit.joint_estimate import JointEstimate
from .aligned_motions import align_recordings, find_alignments

CUT_BEYOND_RANGE_KINDS = (sensor_range.KIND, clipped.KIND)
"""Kinds of the defects that cut out samples beyond the range of a sensor."""


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
        headline = fit.headline.estimate
        found.append(spring_cause(spring, headline[PARALLEL_STIFFNESS], headline.confidence))
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
