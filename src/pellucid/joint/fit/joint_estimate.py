"""An identified joint: parameters with intervals, predicted effort, simulated motion, and the model card.

How well a motion separates the parameters of a model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ... import _core
from ..._errors import IdentificationError
from ...models.card import ModelCard
from ...models.estimates import Estimates, Whiteness
from ...models.joint import UNITS, JointModel
from ...models.simulate import JointTrace, LoopSetting, simulate
from ...numerics.arguments import number
from ...numerics.distributions import normal_quantile
from ...numerics.motion import Filtering, Motion, motion_of
from ...numerics.regression import (
    Solution,
    Stack,
    column_norms,
    make_parameters,
    predict_efforts,
    regression_rows,
    some_columns,
    triangular_factor,
)
from ...numerics.sampled import sampled
from ...numerics.uncertainty import block_bootstrap, correlation_time, sandwich_covariance, whiteness
from .discrepancy import Discrepancy, States, collect_states, compared_rows, estimate_discrepancy
from .recording_agreement import (
    BODY_PARAMETERS,
    RECORDING_DRIFT_CAUSE,
    ParameterDrift,
    RecordingDrift,
    add_drift,
    find_parameter_drift,
    find_recording_drift,
)
from .spring_doubt import SPRING_CAUSE, find_spring_doubt
from .turning_friction import turning_columns

BOOTSTRAP_SEED = 20261121
"""Random seed of the bootstrap."""

MAX_SIMULATED_POSITION = 1e100
"""A simulated position of this size counts as diverged [rad or m]."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class JointEstimate(Estimates):
    """An identified joint.

    Attributes
    ----------
    model : JointModel
        Model of one friction family; its names are those of the parameters.
    method : str
        "ls" (ordinary least squares on filtered data, the reference), "wls", "irls", "iv", "didim", "output_error".
    condition_number : float
        Condition number of the unscaled regressor (the literature's figure).
    scaled_condition_number : float
        Condition number of the regressor with columns scaled to unit norm, a measure of collinearity.
    residual_sd : float
        Standard deviation of the residual, in the effort's unit.
    samples : int
        Number of rows of the regression.
    filtering : Filtering
        Filtering and decimation of both sides.
    effort_error : float
        100 ||effort - model|| / ||effort|| over the fitted samples [%].
    iterations : int
        Number of iterations of the solver.
    converged : bool
        Whether the solver converged.
    whiteness : Whiteness or None
        Whiteness tests of the residuals.
    discrepancy : Discrepancy or None
        Part of the covariance that allows for effects that the model neglects, and for drifts.
    drift : ParameterDrift or None
        Changes of the parameters from start to end of the recordings, of least squares.
    between_recordings : RecordingDrift or None
        Parameters by recording and their spread, of least squares; None where fewer than two recordings tell them.
    notes : tuple of str
        Notes of the method (active bounds, excluded samples, weights).
    """

    model: JointModel
    method: str
    condition_number: float
    scaled_condition_number: float
    residual_sd: float
    samples: int
    filtering: Filtering
    effort_error: float = float("nan")
    iterations: int = 1
    converged: bool = True
    whiteness: Whiteness | None = None
    discrepancy: Discrepancy | None = None
    drift: ParameterDrift | None = None
    between_recordings: RecordingDrift | None = None
    notes: tuple[str, ...] = ()

    @property
    def statistical(self) -> np.ndarray:
        """Part of the covariance from coloured residuals alone, shape (p, p), SI."""
        if self.discrepancy is None:
            return self.covariance
        return self.covariance - self.discrepancy.of(self.model.names)[0]

    def predict(self, time: ArrayLike, position: ArrayLike, velocity: ArrayLike | None = None) -> np.ndarray:
        """Predict the effort of a motion, filtered as the fitted effort was.

        Parameters
        ----------
        time : array_like, shape (n,)
            Evenly sampled time [s].
        position : array_like, shape (n,) or (n, 1)
            Position [rad or m].
        velocity : array_like, shape (n,) or (n, 1), optional
            Recorded velocity [rad/s or m/s]; by default that of the position.

        Returns
        -------
        ndarray, shape (n,)
            Effort in the model's effort unit.

        Raises
        ------
        ArgumentError
            If an argument is no array of real numbers.
        RecordingError
            If the arrays do not fit together, a number is missing, or there are too few for the filter.
        """
        if velocity is None:
            time, position = sampled("predict", time, position=position)
        else:
            time, position, velocity = sampled("predict", time, position=position, velocity=velocity)
        motion = motion_of(time, position, np.zeros(len(time)), self.filtering, velocity=velocity)
        return predict_efforts(self.model, self.array, [motion])[0]

    def simulate(self, time: ArrayLike, effort: ArrayLike, position: float = 0.0, velocity: float = 0.0) -> JointTrace:
        """Simulate the motion that an effort causes, with true stiction.

        Parameters
        ----------
        time : array_like, shape (n,)
            Evenly sampled time [s].
        effort : array_like, shape (n,) or (n, 1)
            Effort at the joint, in the model's effort unit; each sample is held until the next one.
        position : float
            Position at the first sample [rad or m].
        velocity : float
            Velocity at the first sample [rad/s or m/s].

        Returns
        -------
        JointTrace
            `position` [rad or m], `velocity`, `acceleration` and `effort`, each of shape (n,).

        Raises
        ------
        ArgumentError
            If an argument is no array of real numbers, or no number.
        RecordingError
            If the arrays do not fit together, or a number is missing.
        IdentificationError
            If the simulated joint diverges.
        """
        time, drive = sampled("simulate", time, effort=effort)
        units = UNITS[self.model.motion]
        start = number("simulate", "position", position, unit=units["position"])
        speed = number("simulate", "velocity", velocity, unit=units["velocity"])
        period = float(time[-1] - time[0]) / (len(time) - 1)
        vector = self.model.vector(self.array)
        trace = simulate(
            vector,
            drive,
            period,
            loop=LoopSetting(),
            position0=start,
            velocity0=speed,
            presliding_travel=self.filtering.presliding_travel,
        )
        if not (np.abs(trace.position) < MAX_SIMULATED_POSITION).all():
            raise IdentificationError(
                "simulate: effort: found one at which the simulated joint diverges, expected a bounded motion: check "
                "the sign and unit of the effort and the start"
            )
        return trace

    def card(self, name: str = "joint", lifts: str = "") -> ModelCard:
        """Return the model card that `pellucid export` and `pellucid.controller` read.

        Parameters
        ----------
        name : str
            Name on the card instead of a study's name.
        lifts : str
            Effect of positive motion, in words.

        Returns
        -------
        ModelCard
        """
        from importlib.metadata import version

        return ModelCard(
            study=name,
            family=self.model.family,
            method=self.method,
            motion=self.model.motion,
            effort_unit=self.model.effort_unit,
            lifts=lifts,
            parameters=tuple(p.on_card(self.confidence) for p in self.parameters),
            covariance=tuple(map(tuple, self.covariance.tolist())),
            statistical=tuple(map(tuple, self.statistical.tolist())),
            known=dict(self.model.known),
            velocity_range=float(self.model.velocity_range),
            drive={"gain": 1.0, "back_emf": 0.0},
            heldout_effort_error=None,
            processing=self.filtering.sentence(UNITS[self.model.motion]["velocity"]),
            confidence=self.confidence,
            checksums={},
            pellucid=version("pellucid"),
        )

    def _facts(self) -> tuple[str, ...]:
        unit = self.model.effort_unit
        colour = "" if self.whiteness is None else f"; lag-1 autocorrelation {self.whiteness.lag1:.2f}"
        return (
            f"residual {self.residual_sd:.3g} {unit} (SD) over {self.samples} samples{colour}",
            *self.notes,
        )


def joint_states(model: JointModel, data: Stack[Motion], values: np.ndarray) -> States:
    """Return the joint's states in the rows of a stack, with the load by a `model` with `values`, (p,)."""
    bare, known = model.vector(values), vars(data)
    states = collect_states(
        data,
        model.motion == "rotary",
        lambda m, q, a: _core.load(model.loaded(bare, *m.payload), q.copy(), a.copy()),
        data.motions[0].filtering.dead_band,
    )
    if "_turning" not in known:  # computed once, because every model of these recordings has the same kinematics
        parts = zip(data.motions, data.rows_by_motion(compared_rows(states.standstill)), strict=True)
        known["_turning"] = np.concatenate([m.rows(turning_columns(m))[own] for m, own in parts])
    return replace(states, turning=known["_turning"])


def make_estimate(
    model: JointModel,
    data: Stack[Motion],
    found: Solution,
    method: str,
    notes: tuple[str, ...] = (),
    *,
    instruments: np.ndarray | None = None,
    lengths: Sequence[int] | None = None,
    level: float = 0.95,
    discrepancy: Discrepancy | None = None,
) -> JointEstimate:
    """Build an estimate with covariance, intervals at `level` and diagnostics from a solution `found` by a `method`.

    `instruments`, (m, p), belong to an instrumental-variable estimate. `lengths` are those of the stretches, if not the
    stack's. `discrepancy` is that of least squares; without it, it is estimated here.
    """
    lengths = data.lengths if lengths is None else lengths
    size = np.linalg.norm(data.target)
    if not size > 0.0:
        raise IdentificationError("found an effort of 0 in every row, expected one that changes as the joint moves")
    is_weighted = bool(np.any(found.weights != 1.0))
    w = found.jacobian * found.weights[:, None] if is_weighted else found.jacobian
    rho = found.residual * found.weights
    norms = column_norms(found.jacobian)
    # A Stribeck velocity without a Stribeck level has no effect at all: no interval can be given.
    idle = norms <= 1e-12 * norms.max()
    free = ~idle
    # Parameters on a bound remain in the covariance, because their values are not known exactly.
    memory = correlation_time(rho, lengths)
    statistical = sandwich_covariance(w, rho, lengths, instruments, free, memory)
    drift: ParameterDrift | None = None
    between: RecordingDrift | None = None
    if discrepancy is None:
        states = joint_states(model, data, found.values)
        discrepancy = estimate_discrepancy(
            model.names, found.values, found.jacobian, found.residual, states, statistical
        )
        statistical = statistical - discrepancy.explained
        drift = find_parameter_drift(model.names, found, data, level)
        between = find_recording_drift(model.names, found, data, neglected=discrepancy.covariance, level=level)
        if drift is not None and drift.is_told.any():
            discrepancy = add_drift(discrepancy, drift.covariance)
        if between is not None and between.is_told.any():
            discrepancy = add_drift(discrepancy, between.covariance, RECORDING_DRIFT_CAUSE)
        doubt = find_spring_doubt(model, data, found, states)
        if doubt is not None:
            discrepancy = add_drift(discrepancy, doubt.covariance, SPRING_CAUSE)
        del states  # hours of data have no memory for them and the scores of the bootstrap
    beside, causes = discrepancy.of(model.names)
    covariance = statistical + beside
    held = np.flatnonzero(found.at_bound)
    boot = None
    if method == "ls":
        boot = np.full((len(free), 2), np.nan)
        boot[free] = block_bootstrap(
            some_columns(w, free),
            rho,
            found.values[free],
            lengths,
            rng=np.random.default_rng(BOOTSTRAP_SEED),
            level=level,
            memory=memory,
        )
    names = model.names
    notes = notes + tuple(
        f"{names[i]} is held at its physical bound, {found.values[i]:.3g} {model.unit(names[i])}"
        for i in held
        if not any(note.startswith(names[i]) for note in notes)
    )
    plain = make_parameters(
        names, [model.unit(n) for n in names], found.values, covariance, found.at_bound, idle, statistical, causes
    )
    parameters = tuple(
        replace(
            p,
            influence=float(norms[i] / size),
            carried=discrepancy.carried.get(p.name),
            bootstrap=None if boot is None or not free[i] else (float(boot[i, 0]), float(boot[i, 1])),
        )
        for i, p in enumerate(plain)
    )
    shown = triangular_factor(found.jacobian)[:, ~idle]
    return JointEstimate(
        title=f"Joint with {model.family} friction",
        confidence=level,
        model=model,
        method=method,
        parameters=parameters,
        covariance=covariance,
        condition_number=float(np.linalg.cond(shown)),
        scaled_condition_number=float(np.linalg.cond(shown / norms[~idle])),
        residual_sd=float(np.sqrt(np.sum(found.residual**2) / max(len(rho) - len(names), 1))),
        samples=len(rho),
        filtering=data.motions[0].filtering,
        effort_error=float(100.0 * np.linalg.norm(found.residual) / size),
        iterations=found.iterations,
        converged=found.converged,
        whiteness=whiteness(found.residual, lengths),
        discrepancy=discrepancy,
        drift=drift,
        between_recordings=between,
        notes=notes,
    )


DISAGREEMENT_CAUSE = "another model that predicts as well"
"""Cause that is stated where estimates of other models add most to a parameter's interval."""


def widen_for_others(estimate: JointEstimate, others: Sequence[JointEstimate]) -> JointEstimate:
    """Return the estimate with intervals that contain the values of `others`, which predict as well.

    An estimate of the same family counts for every parameter. That of another family counts for the parameters of the
    body alone, because its friction terms share what one term of this family stands for. Values on a bound and
    undetermined ones count for nothing.
    """
    times, added = normal_quantile(0.5 + 0.5 * estimate.confidence), np.zeros(len(estimate.parameters))
    for i, own in enumerate(estimate.parameters):
        compared = [
            other[own.name]
            for other in others
            if own.name in other and (other.model.family == estimate.model.family or own.name in BODY_PARAMETERS)
        ]
        apart = [abs(p.value - own.value) for p in compared if not (p.at_bound or p.undetermined or own.at_bound)]
        added[i] = max(0.0, (max(apart, default=0.0) / times) ** 2 - own.standard_error**2)
    if estimate.discrepancy is None or not added.any():
        return estimate
    at = [estimate.discrepancy.names.index(p.name) for p in estimate.parameters]
    spread = np.zeros(len(estimate.discrepancy.names))
    spread[at] = added
    parameters = tuple(
        replace(p, standard_error=float(np.hypot(p.standard_error, np.sqrt(more)))) if more > 0.0 else p
        for p, more in zip(estimate.parameters, added, strict=True)
    )
    parameters = tuple(
        replace(p, identifiable=p.identifiable and abs(p.value) > times * p.standard_error) for p in parameters
    )
    return replace(
        estimate,
        parameters=parameters,
        covariance=estimate.covariance + np.diag(added),
        discrepancy=add_drift(estimate.discrepancy, np.diag(spread), DISAGREEMENT_CAUSE),
    )


@dataclass(frozen=True)
class Excitation:
    """Range of a motion, and how well it separates the parameters of a model."""

    position: tuple[float, float]  # smallest and largest position [rad or m]
    speed: float  # largest speed [rad/s or m/s]
    acceleration: float  # largest acceleration [rad/s^2 or m/s^2]
    condition: float  # condition number of the regressor with columns of equal length
    own: dict[str, float]  # for each parameter, the share of its column's norm that no other column explains


def measure_excitation(model: JointModel, data: Stack[Motion]) -> Excitation:
    """Return the excitation of a linear `model` by the motions of `data`; their effort is not used."""
    w, _ = regression_rows(model, np.zeros(len(model.names)), data)
    norms = np.linalg.norm(w, axis=0)
    w = w[:, norms > 0.0] / norms[norms > 0.0]
    # Rows of zeros pad a regressor with fewer rows than columns.
    w = np.vstack([w, np.zeros((max(w.shape[1] - len(w), 0), w.shape[1]))])
    _, singular, axes = np.linalg.svd(np.linalg.qr(w, mode="r"))
    # The squared part of a column normal to all others is one over the diagonal of the inverse of W'W.
    apart = 1.0 / np.sum((axes / np.maximum(singular, 1e-12 * singular[0])[:, None]) ** 2, axis=0)
    seen = iter(np.sqrt(apart))
    own = {name: float(next(seen)) if n > 0.0 else 0.0 for name, n in zip(model.names, norms, strict=True)}
    position = data.reduced([m.position for m in data.motions])
    return Excitation(
        position=(float(position.min()), float(position.max())),
        speed=float(np.abs(data.reduced([m.velocity for m in data.motions])).max()),
        acceleration=float(np.abs(data.reduced([m.acceleration for m in data.motions])).max()),
        condition=float(singular[0] / max(singular[-1], 1e-300)) if norms.all() else float("inf"),
        own=own,
    )
