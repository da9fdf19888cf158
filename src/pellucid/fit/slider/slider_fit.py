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
    """One method's model of the joint."""

    method: str  # One of `METHODS`
    model: DirectionalSliderModel | SliderJointModel
    values: np.ndarray  # (p,) Free parameters, SI
    parameters: tuple[Parameter, ...]  # The same with their standard errors
    covariance: np.ndarray  # (p, p)
    samples: int  # Rows of the regression
    residual_sd: float  # [N*m]
    notes: tuple[str, ...] = ()  # Active bounds
    # (p, p) What of the covariance coloured residuals alone make; None where there is no more to it
    statistical: np.ndarray | None = None

    def __getitem__(self, name: str) -> Parameter:
        return named(self.parameters, name, "this estimate")


@dataclass(frozen=True)
class TrialError:
    """How far one method's torque is from the measured one in one trial."""

    recording: str
    protocol: str
    split: str
    slider: float  # [m]
    current: float  # Mean absolute error, equation 6 [A]
    torque: float  # The same at the joint [N*m]
    torque_rms: float  # [N*m]
    bias: float  # Mean error of the prediction [N*m]


@dataclass(frozen=True)
class SliderFit:
    """The identified joint with a carriage."""

    study: str
    lifts: str
    gain: float  # Torque at the joint per ampere [N*m/A]
    rail: tuple[float, float]  # [m]
    geometry: Geometry = field(repr=False)
    static: tuple[Parameter, ...]  # The static set: gravity and what sticks
    estimates: Mapping[str, SliderEstimate]  # By method
    errors: Mapping[str, tuple[TrialError, ...]] = field(repr=False)  # By method, every moving recording
    motions: tuple[SliderMotion, ...] = field(repr=False)
    verdicts: tuple[Verdict, ...]
    filter_note: str
    checksums: Mapping[str, str] = field(repr=False, default_factory=dict)
    travel: Parameter | None = None  # Over which friction builds up before it slips; None where nothing shows it

    def __getitem__(self, method: str) -> SliderEstimate:
        return self.estimates[method]

    @property
    def evaluated_split(self) -> str:
        """What methods are judged on: "heldout" where any held-out trial has an error, else "fitted"."""
        held = any(e.split == "heldout" and np.isfinite(e.current) for errors in self.errors.values() for e in errors)
        return "heldout" if held else "fitted"

    def evaluated(self, method: str) -> tuple[TrialError, ...]:
        """A method's errors in the trials it is judged on; a trial in which nothing moved has none."""
        split = self.evaluated_split
        return tuple(e for e in self.errors[method] if e.split == split and np.isfinite(e.current))

    def evaluated_error(self, method: str) -> float:
        """Mean over those trials of the mean absolute current error [A]; NaN without any."""
        return float(np.mean([e.current for e in self.evaluated(method)] or [np.nan]))

    def mean_error(self, method: str, recordings: tuple[str, ...] | None = None) -> float:
        """Mean over trials of the mean absolute current error [A]: of those named, or of all held out."""
        chosen = [
            e.current
            for e in self.errors[method]
            if (e.split == "heldout" if recordings is None else e.recording in recordings)
        ]
        return float(np.mean(chosen)) if chosen else float("nan")
