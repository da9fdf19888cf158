"""Result of identifying a joint with a carriage: models, their parameters, and their errors in each trial."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...models.card import named
from ...models.directional_slider import DirectionalSliderModel
from ...models.parameter import Parameter, Verdict
from ...models.slider_joint import SliderJointModel
from .axis_offset import AxisOffset
from .markers import Geometry
from .slider_motion import SliderMotion

SLIDER_METHODS: Mapping[str, str] = {
    "pooled": "three steps, one set of parameters",
    "dissociated": "three steps, one set for each direction",
    "pooled_at_once": "all at once, one set",
    "dissociated_at_once": "all at once, one set for each direction",
    "consistent": "one coherent body, friction by direction",
    "load": "one coherent body, friction by direction and load",
}
"""Methods in the order of every table: the published model fitted in four ways, and two physically consistent
models."""


@dataclass(frozen=True)
class SliderEstimate:
    """The model of the joint that one method estimates."""

    method: str  # one of `SLIDER_METHODS`
    model: DirectionalSliderModel | SliderJointModel
    values: np.ndarray  # (p,) free parameters, SI
    parameters: tuple[Parameter, ...]  # the same parameters with their standard errors
    covariance: np.ndarray  # (p, p)
    samples: int  # number of rows of the regression
    residual_sd: float  # standard deviation of the residual [N*m]
    notes: tuple[str, ...] = ()  # sentences on active bounds
    # (p, p) part of the covariance due to coloured residuals alone; None if there is no other part
    statistical: np.ndarray | None = None

    def __getitem__(self, name: str) -> Parameter:
        return named(self.parameters, name, "this estimate")


@dataclass(frozen=True)
class TrialError:
    """Prediction errors of one method in one trial."""

    recording: str
    protocol: str
    split: str
    slider: float  # position of the carriage [m]
    current: float  # mean absolute error of the current, equation 6 [A]
    torque: float  # mean absolute error of the torque at the joint [N*m]
    torque_rms: float  # root mean square error of the torque [N*m]
    bias: float  # mean error of the torque [N*m]


@dataclass(frozen=True)
class SliderFit:
    """The identified joint with a carriage."""

    study: str
    lifts: str
    gain: float  # torque at the joint per ampere [N*m/A]
    rail: tuple[float, float]  # ends of the rail [m]
    geometry: Geometry = field(repr=False)
    static: tuple[Parameter, ...]  # gravity and mean torque of sticking, from static trials
    estimates: Mapping[str, SliderEstimate]  # estimates by method
    errors: Mapping[str, tuple[TrialError, ...]] = field(repr=False)  # errors by method, for every moving recording
    motions: tuple[SliderMotion, ...] = field(repr=False)
    verdicts: tuple[Verdict, ...]
    filter_note: str
    checksums: Mapping[str, str] = field(repr=False, default_factory=dict)
    travel: Parameter | None = None  # presliding travel; None where the recordings do not show it
    # Place of the wearer's axis beside the robot's, by recording with a free carriage
    axis_offsets: Mapping[str, AxisOffset] = field(default_factory=dict)

    def __getitem__(self, method: str) -> SliderEstimate:
        return self.estimates[method]

    @property
    def evaluated_split(self) -> str:
        """Split on which methods are evaluated: "heldout" if any held-out trial has an error, else "fitted"."""
        held = any(e.split == "heldout" and np.isfinite(e.current) for errors in self.errors.values() for e in errors)
        return "heldout" if held else "fitted"

    def evaluated(self, method: str) -> tuple[TrialError, ...]:
        """Return a method's errors in the trials of `evaluated_split`; trials without motion have none."""
        split = self.evaluated_split
        return tuple(e for e in self.errors[method] if e.split == split and np.isfinite(e.current))

    def evaluated_error(self, method: str) -> float:
        """Return the mean over those trials of the mean absolute current error [A]; NaN if there are none."""
        return float(np.mean([e.current for e in self.evaluated(method)] or [np.nan]))

    def mean_error(self, method: str, recordings: tuple[str, ...] | None = None) -> float:
        """Return the mean over trials of the mean absolute current error [A], over `recordings` or all held-out
        ones."""
        chosen = [
            e.current
            for e in self.errors[method]
            if (e.split == "heldout" if recordings is None else e.recording in recordings)
        ]
        return float(np.mean(chosen)) if chosen else float("nan")
