"""One friction family fitted by every method its data allow, with what it predicts and simulates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..._errors import IdentificationError
from ...models.joint import JointModel
from ...signals.motion import Motion
from ..crossed_residuals import crossed_residuals
from ..parameter import Parameter
from ..regression import Solution, Stack, stack
from .closed_loop import solve_didim, solve_instrumental, solve_output_error
from .consistency import enforce_pseudo_inertia
from .determinacy import SEEDS, marked, undetermined
from .estimator_choice import EstimatorChoice, estimator_choice
from .evaluation import Prediction, pooled, predict
from .friction_solver import solve_family, solve_from_part, with_known_stribeck_velocity
from .joint_estimate import JointEstimate, estimated
from .predictive_band import PredictiveBand, banded, predictive_band
from .replay import Machine, Simulation, simulation_of
from .reweighting import solve_robust, solve_weighted


@dataclass(frozen=True)
class FamilyFit:
    """One friction family: its least-squares estimate, the other estimators, and how it predicts and simulates.

    `heldout_effort_error` [%] and `heldout_r2` pool all validation recordings (nan where there are none).
    """

    model: JointModel
    estimate: JointEstimate
    others: Mapping[str, JointEstimate] = field(default_factory=dict)
    predictions: tuple[Prediction, ...] = ()
    simulations: Mapping[str, tuple[Simulation, ...]] = field(default_factory=dict)
    """Keyed by the method whose parameters were simulated ("ls", "output_error", ...)."""
    failures: Mapping[str, str] = field(default_factory=dict)
    """Methods, and simulated recordings, that came to nothing, and why."""
    fitted_effort_error: float = float("nan")
    fitted_r2: float = float("nan")
    heldout_effort_error: float = float("nan")
    heldout_r2: float = float("nan")
    choice: EstimatorChoice = field(default_factory=EstimatorChoice)
    crossed: tuple[np.ndarray, ...] = ()
    """Where nothing is held out: residuals of blocks of the fitted recordings, each predicted from the others."""
    excerpt: str = ""  # Of which recordings the other estimates and simulations are parts, in words; empty: of all
    band: PredictiveBand | None = None  # Around the chosen estimator's predictions

    def shown(self, most: int) -> FamilyFit:
        """The same with so many rows of each recording at most: what figures show of hours."""
        if all(len(p.time) <= most for p in self.predictions):
            return self
        predictions = tuple(p.part(most) for p in self.predictions)
        choice = replace(self.choice, predictions=tuple(p.part(most) for p in self.choice.predictions))
        return replace(self, predictions=predictions, choice=choice, crossed=())

    @property
    def headline(self) -> FamilyFit:
        """The same with the chosen estimator's values, predictions and errors in the place of least squares'."""
        if self.choice.method == self.estimate.method:
            return self
        chosen, made = self.others[self.choice.method], self.choice.predictions
        fitted, heldout = pooled(made, "fitted"), pooled(made, "heldout")
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


def fit_family(
    model: JointModel,
    data: Stack,
    everything: Sequence[Motion],
    machine: Machine,
    *,
    level: float,
    moving_mass: float | None = None,
    thorough: bool = True,
    purpose: str = "torque",
    excerpt: Sequence[Motion] | None = None,
    said: str = "",
) -> FamilyFit:
    """Fit a `model` to `data`, predict and simulate `everything` a `machine` recorded; intervals at `level`, a body of
    at most `moving_mass` [kg]; `thorough` also by weighted, robust and closed-loop methods, of which one is
    chosen for a `purpose`. Of hours an `excerpt`, in words `said`, serves for all but least squares, which starts
    from it."""
    taken, part = everything, data
    if said:
        taken, part = excerpt, stack([m for m in excerpt if m.split == "fitted"])
    free = start = solve_family(model, part)
    note = ()
    first = solve_from_part(model, data, start) if said else start
    if moving_mass is not None:
        first, note = enforce_pseudo_inertia(model, data, first, moving_mass)
        start = enforce_pseudo_inertia(model, part, start, moving_mass)[0] if said else first
    estimate = estimated(model, data, first, "ls", note, level=level)
    loose = frozenset()
    if thorough:
        widths = [0.5 * np.ptp(p.interval(level)) for p in estimate.parameters]
        # What is then solved on hours of data, from there, is changed once.
        loose = undetermined(model, part, free, widths, SEEDS[:1] if said else SEEDS)
        estimate = replace(estimate, parameters=marked(estimate.parameters, loose))
    half_width = float(np.quantile(np.abs(first.residual), level))
    known = {}
    if said:
        ends = np.cumsum(data.lengths)[:-1]
        known = {id(m): x for m, x in zip(data.motions, np.split(data.target - first.residual, ends), strict=True)}
    predictions = predict(model, first.values, everything, half_width, known)
    fitted, heldout = pooled(predictions, "fitted"), pooled(predictions, "heldout")
    others, simulations, failures = (
        _thorough(model, part, start, estimate, taken, machine, level) if thorough else ({}, {}, {})
    )
    # The others take the Stribeck velocity of least squares, and with it what depends on it.
    taken_over = loose | {"stribeck"} if "stribeck_velocity" in loose else loose
    others = {name: replace(e, parameters=marked(e.parameters, taken_over)) for name, e in others.items()}
    estimates = {"ls": estimate, **others}
    by_method = {"ls": predict(model, first.values, taken, half_width) if said else predictions}
    for name, other in others.items():
        if other.converged:
            by_method[name] = predict(other.model, other.array, taken, half_width)
    choice = estimator_choice(purpose, by_method, {n: estimates[n] for n in by_method}, simulations, taken, machine)
    if said:
        chosen = estimates[choice.method]
        whole = predictions if chosen is estimate else predict(chosen.model, chosen.array, everything, half_width)
        choice = replace(choice, predictions=tuple(whole))
        others = {name: replace(e, notes=(*e.notes, f"from {said}")) for name, e in others.items()}
    crossed = () if np.isfinite(heldout[0]) else crossed_residuals(first, data.lengths)
    band = predictive_band(predictions, crossed, level)
    if band is not None:
        predictions = banded(predictions, band)
        of_chosen = band if choice.method == "ls" else predictive_band(choice.predictions, crossed, level)
        choice = replace(choice, predictions=banded(choice.predictions, of_chosen or band))
        band = of_chosen or band
    return FamilyFit(
        model, estimate, others, predictions, simulations, failures, *fitted, *heldout, choice, crossed, said, band
    )


def _thorough(
    model: JointModel,
    data: Stack,
    first: Solution,
    estimate: JointEstimate,
    everything: Sequence[Motion],
    machine: Machine,
    level: float,
) -> tuple[dict[str, JointEstimate], dict[str, tuple[Simulation, ...]], dict[str, str]]:
    """Estimates by the other methods, simulations, and what came to nothing."""
    if "stribeck_velocity" in model.names:
        # Only least squares profiles over it; the others take its value.
        at = model.names.index("stribeck_velocity")
        model = with_known_stribeck_velocity(model, float(first.values[at]))
        first = replace(
            first,
            values=np.delete(first.values, at),
            jacobian=np.delete(first.jacobian, at, axis=1),
            at_bound=np.delete(first.at_bound, at),
        )
    told = {"level": level, "discrepancy": estimate.discrepancy}
    weighted, robust = solve_weighted(model, data, first), solve_robust(model, data, first)
    others = {
        "wls": estimated(model, data, weighted, "wls", **told),
        "irls": estimated(model, data, robust, "irls", **told),
    }
    failures: dict[str, str] = {}

    def attempt(name: str, run: Callable[[], JointEstimate]) -> None:
        try:
            others[name] = run()
        except (IdentificationError, np.linalg.LinAlgError) as error:
            failures[name] = str(error)

    def instrumental() -> JointEstimate:
        solution, z = solve_instrumental(model, data, machine, first)
        return estimated(model, data, solution, "iv", instruments=z, **told)

    def didim() -> JointEstimate:
        return estimated(model, data, solve_didim(model, data, machine, first), "didim", **told)

    def output_error() -> JointEstimate:
        solution = solve_output_error(model, data, machine, first)
        stretches = [len(m.moving) for m in data.motions]
        return estimated(model, data, solution, "output_error", lengths=stretches, **told)

    if all(machine.can_close(m) for m in data.motions):
        attempt("iv", instrumental)
        attempt("didim", didim)
    attempt("output_error", output_error)
    simulations: dict[str, tuple[Simulation, ...]] = {}
    solved = {"ls": first.values} | ({"output_error": others["output_error"].array} if "output_error" in others else {})
    for method, values in solved.items():
        made = []
        for motion in everything:
            for closed in (True, False) if machine.can_close(motion) else (False,):
                try:
                    made.append(simulation_of(model, values, motion, machine, closed=closed))
                except IdentificationError as error:
                    failures[f"simulation of {motion.recording}"] = str(error)
        simulations[method] = tuple(made)
    return others, simulations, failures
