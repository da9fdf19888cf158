"""The reference angle of a hinge from motion capture, its samples that are not credible, and scores against it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ...._errors import IdentificationError
from ....files.recording import Recording
from ....numerics.clocks import Alignment, align
from ...imu.hinge_angle import HingeAngle
from ...imu.quaternion import angular_steps, conjugate, continuous, multiply, twist

JUMP_MARGIN_S = 0.05
"""Samples within this time of a jump are excluded: cameras see a body badly just before and after they lose it."""

MAX_CLOCK_DELAY_S = 0.2
"""The delay between the clocks of IMUs and cameras is searched up to this value."""


@dataclass(frozen=True, eq=False)
class HingeReference:
    """A hinge's angle from two bodies' orientations."""

    time: np.ndarray  # (n,) [s]
    angle: np.ndarray  # (n,) [rad]; from one believable stretch to the next it may be off by whole turns
    believable: np.ndarray  # (n,) False near a jump that the joint cannot make
    axis: np.ndarray  # (3,) Unit vector of the relative rotation's axis, in the proximal body's frame
    share: float  # Share of the squared relative rotation that is about the axis: 1 for a perfect hinge

    @property
    def excluded(self) -> int:
        """Number of samples that are not credible."""
        return int(np.sum(~self.believable))

    def excluded_between(self) -> tuple[tuple[float, float], ...]:
        """Return the first and last time of each stretch of samples that are not credible [s]."""
        from ....numerics.filters import runs

        return tuple((float(self.time[r.start]), float(self.time[r.stop - 1])) for r in runs(~self.believable))


def has_reference(recording: Recording, proximal: str, distal: str) -> bool:
    """Return whether a `recording` has orientations of the `proximal` and the `distal` body beside the IMUs."""
    return all(f"{prefix}.orientation.{c}" in recording for prefix in (proximal, distal) for c in "wxyz")


def hinge_reference(recording: Recording, proximal: str, distal: str, jump: float) -> HingeReference:
    """Return the angle between two bodies about their main axis of relative rotation.

    The axis is the first right-singular vector of their relative angular velocity. It is a part of the ground truth,
    so that all credible samples of the recording enter it. The angle is the twist about it. A sample is not credible
    if it is within 0.05 s of a step of more than `jump`, before or after it.

    `jump` [rad].
    """
    bodies = [np.stack([recording[f"{p}.orientation.{c}"] for c in "wxyz"], axis=-1) for p in (proximal, distal)]
    where = f"{recording.path.name} (recording {recording.name})"
    for prefix, body in zip((proximal, distal), bodies, strict=True):
        length = np.linalg.norm(body, axis=1)
        bad = np.flatnonzero(~(np.abs(length - 1.0) < 0.05))
        if len(bad):
            raise IdentificationError(
                f"{where}: channel {prefix}.orientation: found a norm of {length[bad[0]]:.3g} at "
                f"{recording.time[bad[0]]:.3f} s, expected unit quaternions"
            )
    time = np.asarray(recording.time)
    relative = continuous(multiply(conjugate(bodies[0]), bodies[1]))
    relative /= np.linalg.norm(relative, axis=1, keepdims=True)
    steps = angular_steps(relative)
    # A body that cameras lose seems to turn about any axis, so the axis is found without such steps.
    believable = ~_samples_near_jumps(time, np.linalg.norm(steps, axis=1) > jump)
    kept = believable[1:] & believable[:-1]
    if kept.sum() < 3:
        raise IdentificationError(f"{where}: found no believable step of the reference angle, expected most below jump")
    _, size, directions = np.linalg.svd(steps[kept], full_matrices=False)
    angle = twist(relative, directions[0])
    return HingeReference(time, angle, believable, directions[0], float(size[0] ** 2 / np.sum(size**2)))


def _samples_near_jumps(time: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    """Return which samples lie within `JUMP_MARGIN_S` of a step marked in `jumps` (n - 1,), shape (n,)."""
    near = np.zeros(len(time), bool)
    for i in np.flatnonzero(jumps):
        near |= (time >= time[i] - JUMP_MARGIN_S) & (time <= time[i + 1] + JUMP_MARGIN_S)
    return near


@dataclass(frozen=True, eq=False)
class HingeScore:
    """An estimated angle beside the reference."""

    angle: np.ndarray  # (n,) Estimate at the reference's times, sense and offset corrected [rad]; NaN outside its span
    error: np.ndarray  # (n,) Estimate less reference, in (-pi, pi] [rad]; NaN outside the estimate's span
    scored: np.ndarray  # (n,) True for samples that are scored
    delay: float  # Time by which the IMUs' clock is late [s]; 0 where no delay was allowed
    offset: float  # Angle added to the estimate [rad]
    rms: float  # Root mean square of the error over the scored samples [rad]
    largest: float  # Largest absolute error over the scored samples [rad]


def clock_delay(found: HingeAngle, reference: HingeReference, start: float, stop: float) -> Alignment:
    """Return the delay of the IMUs' clock against the cameras', from the angular rates between `start` and `stop`
    [s]."""
    part = (reference.time >= start) & (reference.time < stop)
    rate = np.where(reference.believable, np.gradient(reference.angle, reference.time), np.nan)[part]
    return align(
        reference.time[part], rate, found.time, np.gradient(found.angle, found.time), longest=MAX_CLOCK_DELAY_S
    )


def score(
    found: HingeAngle, reference: HingeReference, *, calibration: float, score_from: float, sense: float, delay: float
) -> HingeScore:
    """Score an angle against the reference from `score_from` on, with the offset found before `calibration`.

    `calibration`, `score_from` and `delay` are in seconds; `sense` is 1 or -1.
    """
    time = reference.time
    angle = sense * CubicSpline(found.time, found.angle, extrapolate=False)(time + delay)
    usable = reference.believable & np.isfinite(angle)
    early, scored = usable & (time < calibration), usable & (time >= score_from)
    if not early.any() or not scored.any():
        raise IdentificationError(
            f"hinge: {early.sum()} believable reference samples before {calibration:g} s and {scored.sum()} after "
            f"{score_from:g} s, expected some of both"
        )
    miss = angle - reference.angle
    offset = -float(np.angle(np.mean(np.exp(1j * miss[early]))))
    offset -= float(np.mean(_wrapped(miss[early] + offset)))
    error = _wrapped(miss + offset)
    return HingeScore(
        angle=reference.angle + error,
        error=error,
        scored=scored,
        delay=float(delay),
        offset=offset,
        rms=float(np.sqrt(np.mean(error[scored] ** 2))),
        largest=float(np.max(np.abs(error[scored]))),
    )


def _wrapped(angle: np.ndarray) -> np.ndarray:
    """Return an angle in (-pi, pi]."""
    return np.pi - (np.pi - angle) % (2.0 * np.pi)
