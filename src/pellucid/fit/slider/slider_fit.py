"""What the identification of a joint with a carriage returns: models, their parameters, their errors trial by trial."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...models.card import named
from ...models.directional_slider import DirectionalSliderModel
from ...models.slider_joint import SliderJointModel
from ...signals.markers import Geometry
from ...signals.slider_motion import SliderMotion
from ..parameter import Parameter, Verdict

METHODS: Mapping[str, str] = {
    "pooled": "three steps, one set of parameters",
    "dissociated": "three steps, one set for each direction",
    "pooled_at_once": "all at once, one set",
    "dissociated_at_once": "all at once, one set for each direction",
    "consistent": "one coherent body, friction by direction",
    "load": "one coherent body, friction by direction and load",
}
"""What is fitted, in the order of every table: the published model four ways, and two that a body could have."""


@dataclass(frozen=True)
class SliderEstimate:
    """One method's model of the joint.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    model : DirectionalSliderModel or SliderJointModel
    values : ndarray, shape (p,)
        Free parameters, SI.
    parameters : tuple of Parameter
        The same with their standard errors.
    covariance : ndarray, shape (p, p)
    samples : int
        Rows of the regression.
    residual_sd : float
        [N*m]
    notes : tuple of str
        Active bounds.
    """

    method: str
    model: DirectionalSliderModel | SliderJointModel
    values: np.ndarray
    parameters: tuple[Parameter, ...]
    covariance: np.ndarray
    samples: int
    residual_sd: float
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Parameter:
        return named(self.parameters, name, "this estimate")


@dataclass(frozen=True)
class TrialError:
    """How far one method's torque is from the measured one in one trial.

    Parameters
    ----------
    recording, protocol, split : str
    slider : float
        [m]
    current : float
        Mean absolute error, equation 6 [A].
    torque : float
        The same at the joint [N*m].
    torque_rms : float
        [N*m]
    bias : float
        Mean error of the prediction [N*m].
    """

    recording: str
    protocol: str
    split: str
    slider: float
    current: float
    torque: float
    torque_rms: float
    bias: float


@dataclass(frozen=True)
class SliderFit:
    """The identified joint with a carriage.

    Parameters
    ----------
    study : str
    lifts : str
    gain : float
        Torque at the joint per ampere [N*m/A].
    rail : tuple of float
        [m]
    geometry : Geometry
    static : tuple of Parameter
        The static set: gravity and what sticks.
    estimates : mapping of str to SliderEstimate
        By method.
    errors : mapping of str to tuple of TrialError
        By method, every moving recording.
    motions : tuple of SliderMotion
    verdicts : tuple of Verdict
    filter_note : str
    checksums : mapping of str to str
    """

    study: str
    lifts: str
    gain: float
    rail: tuple[float, float]
    geometry: Geometry = field(repr=False)
    static: tuple[Parameter, ...]
    estimates: Mapping[str, SliderEstimate]
    errors: Mapping[str, tuple[TrialError, ...]] = field(repr=False)
    motions: tuple[SliderMotion, ...] = field(repr=False)
    verdicts: tuple[Verdict, ...]
    filter_note: str
    checksums: Mapping[str, str] = field(repr=False, default_factory=dict)

    def __getitem__(self, method: str) -> SliderEstimate:
        return self.estimates[method]

    @property
    def judged_split(self) -> str:
        """What methods are judged on: "heldout" where any held-out trial has an error, else "fitted"."""
        held = any(e.split == "heldout" and np.isfinite(e.current) for errors in self.errors.values() for e in errors)
        return "heldout" if held else "fitted"

    def judged(self, method: str) -> tuple[TrialError, ...]:
        """A method's errors in the trials it is judged on; a trial in which nothing moved has none."""
        split = self.judged_split
        return tuple(e for e in self.errors[method] if e.split == split and np.isfinite(e.current))

    def judged_error(self, method: str) -> float:
        """Mean over those trials of the mean absolute current error [A]; NaN without any."""
        return float(np.mean([e.current for e in self.judged(method)] or [np.nan]))

    def mean_error(self, method: str, recordings: tuple[str, ...] | None = None) -> float:
        """Mean over trials of the mean absolute current error [A]: of those named, or of all held out."""
        chosen = [
            e.current
            for e in self.errors[method]
            if (e.split == "heldout" if recordings is None else e.recording in recordings)
        ]
        return float(np.mean(chosen)) if chosen else float("nan")
