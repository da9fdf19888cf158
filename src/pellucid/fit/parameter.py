"""What an identification returns: parameters with intervals, predictions, simulations, verdicts. Values, no methods
of estimation: the procedures in this folder fill them, the report draws them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import norm

from ..models.card import CardParameter, named
from ..models.joint import JointModel


@dataclass(frozen=True)
class Parameter:
    """An identified parameter and what is known of it.

    Parameters
    ----------
    name, unit : str
        The field's term; SI unit as plain text (per ampere or per volt where the drive constant is unknown).
    value, standard_error : float
        In `unit`; the standard error allows for coloured residuals.
    at_bound : bool
        A physical bound holds the value: its interval is then one-sided.
    identifiable : bool
        False where the interval holds zero or the recording does not carry this parameter (see the verdicts).
    influence : float
        RMS effort that one unit of it makes, over the RMS effort: what its uncertainty matters.
    bootstrap : tuple of float, optional
        The block bootstrap's 95 % interval, in `unit`.
    """

    name: str
    unit: str
    value: float
    standard_error: float
    at_bound: bool = False
    identifiable: bool = True
    influence: float = float("nan")
    bootstrap: tuple[float, float] | None = None

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval at `level`, in the parameter's unit."""
        half = float(norm.ppf(0.5 + level / 2.0)) * self.standard_error
        return self.value - half, self.value + half

    def on_card(self, level: float) -> CardParameter:
        """The same as a model card keeps it, its interval at `level`."""
        interval = self.interval(level)
        return CardParameter(
            self.name, self.unit, self.value, self.standard_error, interval, self.at_bound, self.identifiable
        )

    @property
    def relative_sd(self) -> float:
        """Standard error as a percentage of the value (infinite at zero)."""
        return 100.0 * self.standard_error / abs(self.value) if self.value else float("inf")


@dataclass(frozen=True)
class Whiteness:
    """How far residuals are from white: lag-1 autocorrelation, Ljung-Box statistic and p value over `lags` lags,
    and the effective share of independent samples (1 is white)."""

    lag1: float
    statistic: float
    p_value: float
    lags: int
    effective_share: float


@dataclass(frozen=True)
class Estimate:
    """One method's estimate of one family.

    Parameters
    ----------
    model : JointModel
    method : str
        "ls" (ordinary, on filtered data: the reference), "wls", "irls", "iv", "didim", "output_error".
    parameters : tuple of Parameter
        In the order of `model.symbols`.
    covariance : ndarray, shape (p, p)
    condition_number : float
        Of the regressor with columns as they are (the literature's figure).
    scaled_condition_number : float
        Of the regressor with columns scaled to unit norm: what collinearity is left.
    residual_sd : float
        In the effort's unit.
    iterations : int
    converged : bool
    notes : tuple of str
        What the method has to say (active bounds, samples left out, weights).
    """

    model: JointModel
    method: str
    parameters: tuple[Parameter, ...]
    covariance: np.ndarray
    condition_number: float
    scaled_condition_number: float
    residual_sd: float
    samples: int
    iterations: int = 1
    converged: bool = True
    whiteness: Whiteness | None = None
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Parameter:
        return named(self.parameters, name, "this estimate")

    def get(self, name: str) -> Parameter | None:
        """A parameter, or None where this method held it at the reference's value."""
        return next((p for p in self.parameters if p.name == name), None)

    @property
    def values(self) -> np.ndarray:
        """Parameter values, shape (p,), in the order of the model's symbols."""
        return np.array([p.value for p in self.parameters])


@dataclass(frozen=True)
class Prediction:
    """The effort a model predicts for a recording, after the same filter on both sides; scored samples only.

    `position`, `velocity`, `acceleration`, `load`, `effort`, `predicted`: shape (n,), SI; `effort_error` [%] is
    100 ||tau - tau_hat|| / ||tau||; `coverage` is the share of samples inside the prediction interval `half_width`.
    """

    recording: str
    split: str
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    load: np.ndarray
    effort: np.ndarray
    predicted: np.ndarray
    effort_error: float
    r2: float
    half_width: float
    coverage: float

    @property
    def residual(self) -> np.ndarray:
        """What the model misses, shape (n,), in the effort's unit."""
        return self.effort - self.predicted


@dataclass(frozen=True)
class Simulation:
    """A recording simulated with an identified joint.

    `mode` is "closed_loop" (the machine's own controller in the loop) or "openloop" (measured command in). `measured`
    and `simulated` map "position", "velocity", "acceleration", "effort" to arrays of shape (n,), SI; `errors` maps the
    same names to 100 ||x - x_s|| / ||x|| [%]; `rmse` is the position's, in rad or m.
    """

    recording: str
    split: str
    mode: str
    time: np.ndarray
    measured: Mapping[str, np.ndarray]
    simulated: Mapping[str, np.ndarray]
    errors: Mapping[str, float]
    rmse: float
    mean_absolute_error: float


@dataclass(frozen=True)
class FamilyFit:
    """One friction family: its reference estimate, the other estimators, and how it predicts and simulates.

    `heldout_effort_error` [%] and `heldout_r2` pool all validation recordings (nan where there are none).
    """

    model: JointModel
    estimate: Estimate
    others: Mapping[str, Estimate] = field(default_factory=dict)
    predictions: tuple[Prediction, ...] = ()
    simulations: Mapping[str, tuple[Simulation, ...]] = field(default_factory=dict)
    """Keyed by the method whose parameters were simulated ("ls", "output_error", ...)."""
    failures: Mapping[str, str] = field(default_factory=dict)
    """Methods, and simulated recordings, that came to nothing, and why."""
    fitted_effort_error: float = float("nan")
    fitted_r2: float = float("nan")
    heldout_effort_error: float = float("nan")
    heldout_r2: float = float("nan")

    @property
    def family(self) -> str:
        """The friction family's name."""
        return self.model.family

    def __getitem__(self, name: str) -> Parameter:
        return self.estimate[name]


@dataclass(frozen=True)
class Verdict:
    """One plain sentence on what the recordings do or do not show. `kind` is "good", "note" or "warning"."""

    kind: str
    text: str


@dataclass(frozen=True)
class JointFit:
    """Everything `identify` found on one joint.

    Parameters
    ----------
    study : str
        The study's name, first part of every figure id.
    motion, effort_unit, lifts : str
    families : mapping of str to FamilyFit
        In the order they were asked for.
    best : str
        The family with the smallest held-out effort error (fitted error where nothing is held out).
    drive_constant : Parameter, optional
        From recordings with a known payload.
    verdicts : tuple of Verdict
    filter_note : str
        The processing, as one line: it stands beside every figure.
    checksums : mapping of str to str
        SHA-256 of every recording's file, by recording.
    """

    study: str
    motion: str
    effort_unit: str
    lifts: str
    families: Mapping[str, FamilyFit]
    best: str
    verdicts: tuple[Verdict, ...]
    filter_note: str
    checksums: Mapping[str, str]
    drive_constant: Parameter | None = None

    def __getitem__(self, name: str) -> Parameter:
        """A parameter of the best family."""
        return self.families[self.best][name]
