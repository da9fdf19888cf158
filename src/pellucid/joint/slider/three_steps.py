r"""The published identification of an elbow with a carriage: gravity at rest, friction at constant velocity, inertia.

Each step is linear in what it fits [1]_:

1. held still: gravity and what sticks;
2. constant velocities: gravity again, dry and viscous friction;
3. the swept sine, minus the torque that step 2 explains: inertia.

With a set of parameters for each direction, every column appears twice, masked by the sign of velocity. Both sides of
each regression pass the same zero-phase filter, unlike the paper's moving averages (docs/errata.md, A12).

.. [1] D. Verdel et al., "An identification-based method improving the transparency of a robotic upper limb
   exoskeleton", Robotica 39, 2021, section 3.3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..._errors import IdentificationError
from ...models.card import named
from ...models.estimates import Parameter, Verdict
from ...models.friction_terms import is_friction
from ...models.joint import GRAVITY
from ...models.slider_joint import (
    FRICTION_TERMS,
    GRAVITY_TERMS,
    INERTIA_TERMS,
    UNITS,
    DirectionalSliderModel,
    SliderJointModel,
    columns,
)
from ...numerics.regression import least_squares_within, make_parameters, require_full_rank
from ...numerics.uncertainty import sandwich_covariance
from .axis_offset import AxisOffset
from .markers import Geometry
from .slider_motion import REGRESSION_STRIDE, SliderMotion

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


STEP_PROTOCOLS = ("constant_velocity", "swept_sine")
"""Protocols that steps 2 and 3 are fitted to; the coherent body is fitted to both."""

MAX_STEADY_ACCELERATION = 0.5
"""Below this acceleration a velocity counts as constant [rad/s^2]."""

PARAMETER_NAMES = tuple(UNITS)
"""Names of the model's parameters, in its order."""

LOWER_BOUNDS = np.array([0.0 if is_friction(name) else -np.inf for name in PARAMETER_NAMES])
"""Lower bounds of the parameters: friction is not negative."""

DIRECTION_NAMES = ("up", "down")
"""Suffixes of the parameters where there is a set for each direction."""


def static_set(motions: Sequence[SliderMotion]) -> tuple[Parameter, ...]:
    """Run step 1: estimate gravity and the mean torque of sticking from the means of all holds.

    The parameters' units are [kg], [kg*m], [kg*m] and [N*m].
    """
    at = [(m, rest) for m in motions for rest in m.holds()]
    if len(at) < 8:
        raise IdentificationError(
            f"static trials: found {len(at)} holds of 2 s or more, expected at least 8 at several angles"
        )
    q = np.array([m.position[rest].mean() for m, rest in at])
    x = np.array([m.slider for m, _ in at])
    effort = np.array([m.effort[rest].mean() for m, rest in at])
    sine = GRAVITY * np.sin(q)
    w = np.column_stack([x * sine, sine, GRAVITY * np.cos(q), np.ones(len(q))])
    require_full_rank(("moment_slope", "moment", "cross_moment", "adherence"), w, "static trials")
    values = np.linalg.lstsq(w, effort, rcond=None)[0]
    rest = effort - w @ values
    covariance = sandwich_covariance(w, rest, [len(rest)])
    units = ("kg", "kg*m", "kg*m", "N*m")
    names = ("moment_slope", "moment", "cross_moment", "adherence")
    return make_parameters(names, units, values, covariance)


def three_steps(
    motions: Sequence[SliderMotion], *, dissociated: bool, solver: str = "linear", method: str = ""
) -> SliderEstimate:
    """Run steps 2 and 3 of the published identification."""
    steady, swept = ([m for m in motions if m.protocol == step] for step in STEP_PROTOCOLS)
    require_both_directions(steady)
    require_places(steady)
    copies = 2 if dissociated else 1
    moving = slice(GRAVITY_TERMS.start, FRICTION_TERMS.stop)
    w, effort, lengths = _rows(steady, dissociated, lambda m: np.abs(m.acceleration) < MAX_STEADY_ACCELERATION)
    found2, cov2 = _solve(_terms(w, moving), effort, lengths, moving, solver, "constant velocities")
    samples = len(effort)
    w, effort, lengths = _rows(swept, dissociated)
    left, inertia = effort - _terms(w, moving) @ found2, _terms(w, INERTIA_TERMS)
    found3, cov3 = _solve(inertia, left, lengths, INERTIA_TERMS, solver, "swept sines")
    sets = [np.concatenate([a, b]) for a, b in zip(np.split(found2, copies), np.split(found3, copies), strict=True)]
    covariance = np.zeros((8 * copies, 8 * copies))
    for i in range(copies):
        for j in range(copies):
            block = covariance[8 * i : 8 * i + 8, 8 * j : 8 * j + 8]
            block[:5, :5] = cov2[5 * i : 5 * i + 5, 5 * j : 5 * j + 5]
            block[5:, 5:] = cov3[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
    return _estimate(method, sets, covariance, samples + len(left), left - inertia @ found3)


def all_at_once(
    motions: Sequence[SliderMotion], *, dissociated: bool, solver: str = "linear", method: str = ""
) -> SliderEstimate:
    """Fit the same model in one regression over motions that excite all of its terms."""
    require_both_directions(motions)
    require_places(motions)
    copies = 2 if dissociated else 1
    w, effort, lengths = _rows(motions, dissociated)
    values, covariance = _solve(w, effort, lengths, slice(0, len(PARAMETER_NAMES)), solver, "all at once")
    return _estimate(method, np.split(values, copies), covariance, len(effort), effort - w @ values)


def require_both_directions(motions: Sequence[SliderMotion]) -> None:
    """Refuse motions that do not move in both directions."""
    if not motions:
        raise IdentificationError(
            'no recording of protocol "constant_velocity" or "swept_sine" is marked use = "fit"; the three steps need '
            "both"
        )
    up = sum(int(np.sum(m.scored & (m.velocity > 0.0))) for m in motions)
    down = sum(int(np.sum(m.scored & (m.velocity < 0.0))) for m in motions)
    if min(up, down) < 0.1 * max(up, down, 1):
        missing = "downward (negative)" if down < up else "upward (positive)"
        names = ", ".join(m.recording for m in motions[:3]) + (", ..." if len(motions) > 3 else "")
        raise IdentificationError(
            f"{names}: found {up} samples moving up and {down} moving down, expected both directions; "
            f"the {missing} one is missing, or the position's sign changes between recordings"
        )


def require_places(motions: Sequence[SliderMotion], least: float = 0.02) -> None:
    """Refuse carriage positions that do not separate the terms in x and x squared; `least` is their range [m]."""
    places = np.array([m.slider for m in motions])
    distinct = np.unique(np.round(places / 0.005)).size
    if distinct < 3 or np.ptp(places) < least:
        raise IdentificationError(
            f"slider positions do not vary: found {distinct} within {1e3 * np.ptp(places):.3g} mm "
            f"({', '.join(m.recording for m in motions[:3])}, ...), expected at least 3 over {1e3 * least:g} mm or more"
        )


def directional_columns(motion: SliderMotion) -> np.ndarray:
    """Return the torque per unit of each parameter of the up set, then of the down set, shape (n, 16).

    The states are already filtered, so terms that are smooth in them are not filtered again. Only the terms that jump
    with the direction pass the filter of the effort. Equal sets for both directions give the model without directions.
    """
    whole = columns(motion.position, motion.velocity, motion.acceleration, motion.slider)
    jumps = motion.smooth(whole * np.where(motion.velocity > 0.0, 1.0, -1.0)[:, None])
    whole[:, 3] = motion.smooth(whole[:, 3])  # dry friction jumps in both sets
    return 0.5 * np.column_stack([whole + jumps, whole - jumps])


def _rows(motions, dissociated, also=None) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Return the filtered regressor of one or two sets, the effort, and the number of samples of each motion."""
    w, y, lengths = [], [], []
    for m in motions:
        filtered = directional_columns(m)
        if not dissociated:
            filtered = np.add(*np.split(filtered, 2, axis=1))
        at = np.flatnonzero(m.scored if also is None else m.scored & also(m))[::REGRESSION_STRIDE]
        w.append(filtered[at])
        y.append(m.effort[at])
        lengths.append(len(at))
    return np.concatenate(w), np.concatenate(y), lengths


def _terms(w: np.ndarray, terms: slice) -> np.ndarray:
    """Return the columns of some parameters, from every set."""
    sets = np.split(w, w.shape[1] // len(PARAMETER_NAMES), axis=1)
    return np.hstack([part[:, terms] for part in sets])


def _solve(w, y, lengths, terms, solver, where) -> tuple[np.ndarray, np.ndarray]:
    from scipy.optimize import least_squares

    copies = w.shape[1] // (terms.stop - terms.start)
    names = [name + suffix for suffix in _suffixes(copies) for name in PARAMETER_NAMES[terms]]
    lower, upper = np.tile(LOWER_BOUNDS[terms], copies), np.full(w.shape[1], np.inf)
    require_full_rank(names, w, where)
    if solver == "linear":
        values = least_squares_within(w, y, lower, upper, method="bvls")
    else:
        scale = np.linalg.norm(w, axis=0)
        unit = w / scale
        found = least_squares(
            lambda p: unit @ p - y,
            np.where(np.isfinite(lower), 1.0, 0.0),
            bounds=(lower * scale, upper),
            xtol=1e-14,
            ftol=1e-14,
            gtol=1e-14,
            jac=lambda p: unit,
        ).x
        values = found / scale
    return values, sandwich_covariance(w, y - w @ values, lengths)


def _suffixes(copies: int) -> tuple[str, ...]:
    """Return the suffixes of the parameters' names: the direction, if there is a set for each."""
    return tuple(f"_{d}" for d in DIRECTION_NAMES) if copies == 2 else ("",)


def _estimate(method, sets, covariance, samples, residual) -> SliderEstimate:
    model = DirectionalSliderModel(up=sets[0], down=sets[-1])
    values = np.concatenate(sets)
    suffixes = _suffixes(len(sets))
    names = [name + suffix for suffix in suffixes for name in PARAMETER_NAMES]
    near = 1e-3 * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    held = values - np.tile(LOWER_BOUNDS, len(sets)) <= near
    notes = [f"{name} is held at its physical bound, 0" for name, bound in zip(names, held, strict=True) if bound]
    for direction, values_ in zip(suffixes, sets, strict=True):
        if values_[7] < 0.0:
            notes.append(f"a2{direction} is negative: no mass has such an inertia")
    return SliderEstimate(
        method=method,
        model=model,
        values=values,
        parameters=make_parameters(names, list(UNITS.values()) * len(sets), values, covariance, held),
        covariance=covariance,
        samples=samples,
        residual_sd=float(np.std(residual)),
        notes=tuple(notes),
    )
