"""A hinge joint between two IMUs, from arrays: its axis, its centre and its angle."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import RecordingError
from ..._tabular import data_frame
from .hinge import Hinge, find_hinge
from .hinge_angle import HingeAngle, hinge_angle
from .inertial import Inertial

DEFAULT_CALIBRATION_S = 20.0
"""Axis and centre are found in this first part of the recording by default."""


@dataclass(frozen=True, eq=False)
class HingeFit:
    """A hinge between two IMUs and its angle.

    Attributes
    ----------
    hinge : Hinge
        Axes, centre and gyroscope offsets, in each sensor's frame.
    angle : HingeAngle
        ``time`` [s], ``angle`` [rad] and ``standard_error`` [rad], each of shape (n,).
    """

    hinge: Hinge = field(repr=False)
    angle: HingeAngle = field(repr=False)

    def to_frame(self):
        """Return time, angle and its standard error as a data frame; needs pandas."""
        found = self.angle
        return data_frame({"time": found.time, "angle": found.angle, "standard_error": found.standard_error})


def fit_hinge(
    time: ArrayLike,
    proximal: tuple[ArrayLike, ArrayLike],
    distal: tuple[ArrayLike, ArrayLike],
    *,
    calibration: float = DEFAULT_CALIBRATION_S,
    causal: bool = False,
) -> HingeFit:
    """Find the axis of a hinge joint from two IMUs, and follow its angle without drift.

    Neither magnetometers nor a known mounting are needed. The joint has to move in the calibration.

    Parameters
    ----------
    time : array_like, shape (n,)
        Evenly sampled, common to both IMUs [s].
    proximal, distal : tuple of array_like, each of shape (n, 3)
        Angular velocity [rad/s] and specific force [m/s^2] of the IMU on either segment, each in its own frame.
    calibration : float
        Length of the first part of the recording in which axis and centre are found [s].
    causal : bool
        Whether the angle uses past samples only, as in real time.

    Returns
    -------
    HingeFit
        ``.angle.angle``, shape (n,) [rad], its ``standard_error``, and ``.hinge`` with the axes.

    Raises
    ------
    RecordingError
        If arrays do not fit together, time is uneven, or the joint hardly moves in the calibration.

    Examples
    --------
    With recordings of two IMUs on thigh and shank:

    >>> fit = pl.fit_hinge(t, (thigh_rate, thigh_force), (shank_rate, shank_force))    # doctest: +SKIP
    >>> fit.angle.angle                                                            # doctest: +SKIP
    """
    t = np.asarray(time, float)
    if t.ndim != 1 or len(t) < 3 or not np.isfinite(t).all():
        raise RecordingError(f"fit_hinge: found time of shape {t.shape}, expected (n,) without missing samples")
    steps = np.diff(t)
    if np.min(steps) <= 0.0 or np.ptp(steps) > 0.01 * float(np.median(steps)):
        raise RecordingError("fit_hinge: found uneven time, expected evenly increasing samples; resample first")
    if not calibration > 0.0:
        raise RecordingError(f"fit_hinge: calibration: found {calibration:g} s, expected a time above 0")
    first, second = _inertial(t, *proximal, "proximal"), _inertial(t, *distal, "distal")
    end = t[0] + calibration
    hinge = find_hinge(first.between(t[0], end), second.between(t[0], end))
    return HingeFit(hinge, hinge_angle(first, second, hinge, offline=not causal))


def _inertial(time: np.ndarray, rate: ArrayLike, force: ArrayLike, where: str) -> Inertial:
    found = {"angular velocity": np.asarray(rate, float), "specific force": np.asarray(force, float)}
    for name, values in found.items():
        if values.shape != (len(time), 3):
            raise RecordingError(f"fit_hinge, {where} {name}: found shape {values.shape}, expected ({len(time)}, 3)")
        if not np.isfinite(values).all():
            raise RecordingError(f"fit_hinge, {where} {name}: found missing samples (NaN), expected none")
    return Inertial(time, found["angular velocity"], found["specific force"])
