"""Fit a friction family by every method that the data allow, and evaluate its predictions and simulations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ..._errors import IdentificationError
from ...models.estimates import Parameter
from ...models.friction_terms import shaped_by
from ...models.joint import JointModel
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack, stack
from .closed_loop import solve_didim, solve_instrumental, solve_output_error
from .determinacy import PERTURBATION_SEEDS, find_undetermined, mark_undetermined
from .estimator_choice import EstimatorChoice, SolvedMethod, choose_estimator
from .friction_solver import (
    cross_validate_family,
    solve_family,
    solve_from_part,
    solve_robust,
    solve_weighted,
    with_known_stribeck_velocity,
)
from .joint_estimate import JointEstimate, make_estimate
from .predictive_band import PredictiveBand, apply_band, make_predictive_band
from .recording_agreement import enforce_pseudo_inertia
from .replay import Machine, Prediction, Simulation, pool_errors, predict, simulate_recording


@dataclass(frozen=True)
class FamilyFit:
    """One friction family: its least-squares estimate, the other estimators, predictions and simulations.

    `heldout_effort_error` [%] and `heldout_r2` pool all held-out recordings (nan if there are none).
    """

    model: JointModel
    estimate: JointEstimate
    others: Mapping[str, JointEstimate] = field(default_factory=dict)
    predictions: tuple[Prediction, ...] = ()
    simulations: Mapping[str, tuple[Simulation, ...]] = field(default_factory=dict)
    """Simulations by the method whose parameters were used ("ls", "output_error", ...)."""
    failures: Mapping[str, str] = field(default_factory=dict)
    """Methods, and simulations of recordings, that failed, with the reason."""
    fitted_effort_error: float = float("nan")
    fitted_r2: float = float("nan")
    heldout_effort_error: float = float("nan")
    heldout_r2: float = float("nan")
    choice: EstimatorChoice = field(default_factory=EstimatorChoice)
    """The estimator that was chosen. It is least squares for a family that was not chosen itself."""
    crossed: tuple[np.ndarray, ...] = ()
    """Residuals of the fitted recordings by cross-validation over blocks. Families are chosen by them."""
    excerpt: str = ""  # excerpt to which the other estimates and simulations were fitted, in words; empty for all data
    band: PredictiveBand | None = None  # predictive band around the chosen estimator's predictions

    def shown(self, most: int) -> FamilyFit:
        """Return the fit with at most `most` rows of each recording, for figures of long recordings."""
        if all(len(p.time) <= most for p in self.predictions):
            return self
        predictions = tuple(p.part(most) for p in self.predictions)
        choice = replace(self.choice, predictions=tuple(p.part(most) for p in self.choice.predictions))
        return replace(self, predictions=predictions, choice=choice, crossed=())

    @property
    def headline(self) -> FamilyFit:
        """The fit with the chosen estimator's values, predictions and errors in place of those of least squares."""
        if self.choice.method == self.estimate.method:
            return self
        chosen, made = self.others[self.choice.method], self.choice.predictions
        fitted, heldout = pool_errors(made, "fitted"), pool_errors(made, "heldout")
        return FamilyFit(
            chosen.model, chosen, self.others, made, self.simulations, self.failures, *fitted, *heldout, self.choice,
            excerpt=self.excerpt, band=self.band,
        )  # fmt: skip

    @property
    def family(self) -> str:
        """The friction family's name."""
        return self.model.family

    def __getitem__(self, name: str) -> Parameter:
        return self.estimate[name]


@dataclass(frozen=True)
class SolvedFamily:
    """A family's fit, and what each method found, by which one of them can be chosen."""

    fit: FamilyFit
    solved: Mapping[str, SolvedMethod]
    data: Stack[Motion]  # motions on which the methods other than least squares were solved
    level: float  # confidence level of the intervals [1]

    def choose_estimator(self, purpose: str, machine: Machine) -> EstimatorChoice:
        """Choose one of the methods for a `purpose`, by blocks of the fitted data alone.

        Positions are simulated from the commands that a `machine` recorded.
        """
        estimates = {"ls": self.fit.estimate, **self.fit.others}
        compared = {name: each for name, each in self.solved.items() if estimates[name].converged}
        return choose_estimator(purpose, compared, self.data, machine)

    def with_estimator(self, choice: EstimatorChoice, everything: Sequence[Motion]) -> FamilyFit:
        """Return the fit with the chosen method, which predicts `everything`."""
        fit, estimates = self.fit, {"ls": self.fit.estimate, **self.fit.others}
        if choice.method == "ls":
            return replace(fit, choice=replace(choice, predictions=fit.predictions))
        chosen, half_width = estimates[choice.method], fit.predictions[0].half_width
        predictions = predict(chosen.model, chosen.array, everything, half_width)
        band = fit.band and (make_predictive_band(predictions, fit.crossed, self.level) or fit.band)
        if band is not None:
            predictions = apply_band(predictions, band)
        return replace(fit, choice=replace(choice, predictions=predictions), band=band)


def fit_family(
    model: JointModel,
    data: Stack[Motion],
    everything: Sequence[Motion],
    machine: Machine,
    *,
    level: float,
    moving_mass: float | None = None,
    thorough: bool = True,
    excerpt: Sequence[Motion] | None = None,
    said: str = "",
) -> SolvedFamily:
    """Fit a `model` to `data`, and predict and simulate `everything` that a `machine` recorded.

    Intervals are at `level`. The body has at most `moving_mass` [kg]. A `thorough` fit adds weighted, robust and
    closed-loop methods. Held-out motions are predicted and simulated, and reach nothing else. For hours of data an
    `excerpt`, described by `said`, is used by all methods but least squares, which only starts from it.
    """
    taken, part = everything if excerpt is None else excerpt, data
    if said:
        if excerpt is None:
            raise ValueError(f"found no `excerpt` that is {said}, expected its motions")
        part = stack([m for m in excerpt if m.split == "fitted"])
    free = start = solve_family(model, part)
    note: tuple[str, ...] = ()
    first = solve_from_part(model, data, start) if said else start
    if moving_mass is not None:
        first, note = enforce_pseudo_inertia(model, data, first, moving_mass)
        start = enforce_pseudo_inertia(model, part, start, moving_mass)[0] if said else first
    estimate = make_estimate(model, data, first, "ls", note, level=level)
    loose: frozenset[str] = frozenset()
    if thorough:
        widths = [0.5 * np.ptp(p.interval(level)) for p in estimate.parameters]
        # With hours of data one perturbation is tried, to save time.
        loose = find_undetermined(model, part, free, widths, PERTURBATION_SEEDS[:1] if said else PERTURBATION_SEEDS)
        estimate = replace(estimate, parameters=mark_undetermined(estimate.parameters, loose))
    half_width = float(np.quantile(np.abs(first.residual), level))
    known = {}
    if said:
        ends = np.cumsum(data.lengths)[:-1]
        known = {id(m): x for m, x in zip(data.motions, np.split(data.target - first.residual, ends), strict=True)}
    predictions = predict(model, first.values, everything, half_width, known)
    fitted, heldout = pool_errors(predictions, "fitted"), pool_errors(predictions, "heldout")
    solved = {"ls": SolvedMethod(model, start if said else first, weighs_rows=True)}
    others, simulations, failures = (
        _apply_other_methods(model, part, start, estimate, taken, machine, level, solved) if thorough else ({}, {}, {})
    )
    # The other methods use the Stribeck velocity of least squares, so its Stribeck level is no better determined.
    taken_over = loose | shaped_by(loose)
    others = {name: replace(e, parameters=mark_undetermined(e.parameters, taken_over)) for name, e in others.items()}
    if said:
        others = {name: replace(e, notes=(*e.notes, f"from {said}")) for name, e in others.items()}
    crossed = cross_validate_family(model, data, first)
    band = make_predictive_band(predictions, crossed, level)
    if band is not None:
        predictions = apply_band(predictions, band)
    fit = FamilyFit(
        model, estimate, others, predictions, simulations, failures, *fitted, *heldout,
        EstimatorChoice(predictions=predictions), crossed, said, band,
    )  # fmt: skip
    return SolvedFamily(fit, solved, part, level)


def _apply_other_methods(
    model: JointModel,
    data: Stack[Motion],
    first: Solution,
    estimate: JointEstimate,
    everything: Sequence[Motion],
    machine: Machine,
    level: float,
    solved: dict[str, SolvedMethod],
) -> tuple[dict[str, JointEstimate], dict[str, tuple[Simulation, ...]], dict[str, str]]:
    """Return the estimates by the other methods, the simulations, and the reasons for failures.

    What each method found is added to `solved`.
    """
    if model.shape_index is not None:
        # Only least squares searches the Stribeck velocity; the other methods use its value.
        at = model.shape_index
        model = with_known_stribeck_velocity(model, float(first.values[at]))
        first = replace(
            first,
            values=np.delete(first.values, at),
            jacobian=np.delete(first.jacobian, at, axis=1),
            at_bound=np.delete(first.at_bound, at),
        )
    make = partial(make_estimate, model, data, level=level, discrepancy=estimate.discrepancy)
    weighted, robust = solve_weighted(model, data, first), solve_robust(model, data, first)
    others = {
        "wls": make(weighted, "wls"),
        "irls": make(robust, "irls"),
    }
    solved |= {n: SolvedMethod(model, x, weighs_rows=True) for n, x in (("wls", weighted), ("irls", robust))}
    failures: dict[str, str] = {}

    def attempt(name: str, run: Callable[[], JointEstimate]) -> None:
        try:
            others[name] = run()
        except (IdentificationError, np.linalg.LinAlgError) as error:
            failures[name] = str(error)

    def instrumental() -> JointEstimate:
        solution, z = solve_instrumental(model, data, machine, first)
        solved["iv"] = SolvedMethod(model, solution, instruments=z)
        return make(solution, "iv", instruments=z)

    def didim() -> JointEstimate:
        solution = solve_didim(model, data, machine, first)
        solved["didim"] = SolvedMethod(model, solution)
        return make(solution, "didim")

    def output_error() -> JointEstimate:
        solution = solve_output_error(model, data, machine, first)
        stretches = [len(m.moving) for m in data.motions]
        solved["output_error"] = SolvedMethod(model, solution, every_row=True)
        return make(solution, "output_error", lengths=stretches)

    if all(machine.can_close(m) for m in data.motions):
        attempt("iv", instrumental)
        attempt("didim", didim)
    attempt("output_error", output_error)
    simulations: dict[str, tuple[Simulation, ...]] = {}
    drawn = {"ls": first.values} | ({"output_error": others["output_error"].array} if "output_error" in others else {})
    for method, values in drawn.items():
        made = []
        for motion in everything:
            for closed in (True, False) if machine.can_close(motion) else (False,):
                try:
                    made.append(simulate_recording(model, values, motion, machine, closed=closed))
                except IdentificationError as error:
                    failures[f"simulation of {motion.recording}"] = str(error)
        simulations[method] = tuple(made)
    return others, simulations, failures
