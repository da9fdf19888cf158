"""Fit each friction family by every method that the data allow.

A perturbation of the recordings far below sensor resolution finds parameters that they do not determine: it moves them
beyond their interval.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial

import numpy as np

from ..._errors import IdentificationError
from ...models.estimates import UNDETERMINED_REASON, Parameter
from ...models.friction_terms import shape_index, shaped_by
from ...models.joint import SYMBOLS_BY_NAME, JointModel
from ...models.simulate import JointTrace
from ...numerics.distributions import normal_quantile
from ...numerics.motion import Motion
from ...numerics.regression import Solution, Stack, stack
from .estimators import SolvedMethod, simulated_rows, solve_didim, solve_instrumental, solve_output_error
from .friction_solver import (
    cross_validate_family,
    solve_family,
    solve_from_part,
    solve_robust,
    solve_weighted,
    with_known_stribeck_velocity,
)
from .headline_choice import HeadlineChoice
from .joint_estimate import JointEstimate, make_estimate, widen_for_others
from .recording_agreement import (
    enforce_pseudo_inertia,
    is_pseudo_inertia_bounded,
    least_inertia,
    require_possible_mass,
)
from .replay import (
    Machine,
    Prediction,
    PredictiveBand,
    Simulation,
    apply_band,
    make_predictive_band,
    pool_errors,
    predict,
    replay,
    simulate_recording,
)

PERTURBATION_SHARE = 1e-12
"""Standard deviation of the perturbation of each column, divided by its root mean square. It has the size of rounding
differences between processors."""

PERTURBATION_SEEDS = (1, 2)
"""Random seeds of the perturbations that are tried."""


def find_undetermined(
    model: JointModel,
    data: Stack[Motion],
    found: Solution,
    widths: Iterable[float],
    seeds: Sequence[int] = PERTURBATION_SEEDS,
) -> frozenset[str]:
    """Return the names of parameters that a refit to perturbed columns moves by more than their interval's half width.

    `widths` are those half widths, (p,). There is one refit for each of `seeds`, with perturbations of size
    `PERTURBATION_SHARE`. Parameters without any effect are undetermined, and no refit is needed to see it.
    """
    norms = np.linalg.norm(found.jacobian, axis=0)
    idle = frozenset(name for name, n in zip(model.names, norms, strict=True) if n <= 1e-12 * norms.max())
    if idle:
        return idle
    widths, moved = np.asarray(list(widths), float), np.zeros(len(found.values))
    for seed in seeds:
        try:
            again = solve_family(model, _perturb(data, np.random.default_rng(seed)))
        except IdentificationError:
            return frozenset(model.names)
        moved = np.maximum(moved, np.abs(again.values - found.values))
    # Changes within rounding do not count, however narrow an interval is.
    beyond = moved > np.maximum(widths, 1e-9 * np.abs(found.values))
    return frozenset(name for name, out in zip(model.names, beyond, strict=True) if out)


def mark_undetermined(parameters: Iterable[Parameter], names: frozenset[str]) -> tuple[Parameter, ...]:
    """Return the parameters, with the intervals of those in `names` refused as undetermined."""
    return tuple(replace(p, refused=UNDETERMINED_REASON) if p.name in names else p for p in parameters)


def _perturb(data: Stack[Motion], rng: np.random.Generator) -> Stack[Motion]:
    """Return the stack with noise of relative size `PERTURBATION_SHARE` added to its states and efforts."""

    def change(x: np.ndarray) -> np.ndarray:
        return x + PERTURBATION_SHARE * float(np.sqrt(np.mean(x**2))) * rng.standard_normal(x.shape)

    return stack(
        [
            replace(
                m,
                position=change(m.position),
                velocity=change(m.velocity),
                acceleration=change(m.acceleration),
                effort=change(m.effort),
            )
            for m in data.motions
        ]
    )


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
    choice: HeadlineChoice | None = None
    """The choice of the headline if it fell on this family; None for every other family."""
    chosen: tuple[Prediction, ...] = ()
    """Predictions of every recording by the chosen estimator; empty for every other family."""
    crossed: tuple[np.ndarray, ...] = ()
    """Residuals of the fitted recordings by cross-validation over blocks. The predictive band is made of them."""
    excerpt: str = ""  # excerpt to which the other estimates and simulations were fitted, in words; empty for all data
    band: PredictiveBand | None = None  # predictive band around the chosen estimator's predictions

    def shown(self, most: int) -> FamilyFit:
        """Return the fit with at most `most` rows of each recording, for figures of long recordings."""
        if all(len(p.time) <= most for p in self.predictions):
            return self
        predictions = tuple(p.part(most) for p in self.predictions)
        chosen = tuple(p.part(most) for p in self.chosen)
        return replace(self, predictions=predictions, chosen=chosen, crossed=())

    @property
    def headline(self) -> FamilyFit:
        """The fit with the values, predictions and errors of the chosen estimator instead of least squares."""
        if self.choice is None or self.choice.method == self.estimate.method:
            return self
        chosen, made = self.others[self.choice.method], self.chosen
        fitted, heldout = pool_errors(made, "fitted"), pool_errors(made, "heldout")
        return FamilyFit(
            chosen.model, chosen, self.others, made, self.simulations, self.failures, *fitted, *heldout, self.choice,
            made, excerpt=self.excerpt, band=self.band,
        )  # fmt: skip

    def with_doubt(self, names: Collection[str], doubt: str) -> FamilyFit:
        """Return the fit whose chosen estimate states a `doubt` on the intervals of parameters."""
        chosen = self.headline.estimate
        marked = tuple(replace(p, doubt=doubt) if p.name in names else p for p in chosen.parameters)
        made = replace(chosen, parameters=marked)
        if self.choice is None or self.choice.method == "ls":
            return replace(self, estimate=made)
        return replace(self, others={**self.others, self.choice.method: made})

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
    moving_mass: float | None = None  # upper limit of the moving mass [kg], if it is stated

    @property
    def candidates(self) -> dict[str, SolvedMethod]:
        """Methods that may be chosen: least squares, and each that converged on a possible body."""
        estimates = {"ls": self.fit.estimate, **self.fit.others}
        return {
            name: each
            for name, each in self.solved.items()
            if name == "ls" or (estimates[name].converged and self._has_possible_body(each))
        }

    def _has_possible_body(self, solved: SolvedMethod) -> bool:
        """Return whether a method finds an inertia that a body of the stated mass can have."""
        model, values = solved.model, solved.found.values
        if self.moving_mass is None or not is_pseudo_inertia_bounded(model):
            return True
        return bool(values[model.names.index("inertia")] >= least_inertia(model, values, self.moving_mass))

    def estimate_by(self, method: str) -> JointEstimate:
        """Return the estimate by a method."""
        return self.fit.estimate if method == "ls" else self.fit.others[method]

    def with_choice(
        self, choice: HeadlineChoice, everything: Sequence[Motion], as_good: Sequence[JointEstimate] = ()
    ) -> FamilyFit:
        """Return the fit with the choice that fell on it; the chosen method predicts `everything`.

        The intervals of the chosen estimate contain those estimates that predict `as_good`.
        """
        chosen = widen_for_others(self.estimate_by(choice.method), as_good)
        if choice.method == "ls":
            return replace(self.fit, estimate=chosen, choice=choice, chosen=self.fit.predictions)
        fit = replace(self.fit, others={**self.fit.others, choice.method: chosen}, choice=choice)
        predictions = predict(chosen.model, chosen.array, everything, fit.predictions[0].half_width)
        band = fit.band and (make_predictive_band(predictions, fit.crossed, self.level) or fit.band)
        if band is not None:
            predictions = apply_band(predictions, band)
        return replace(fit, chosen=predictions, band=band)


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

    Intervals are at `level`. The body has at most `moving_mass` [kg], unless the data contradict it: that is an error.
    A `thorough` fit adds weighted, robust and closed-loop methods. Held-out motions are predicted and simulated, and
    reach nothing else. For hours of data an `excerpt`, described by `said`, is used by all methods but least squares,
    which only starts from it.
    """
    taken, part = everything if excerpt is None else excerpt, data
    if said:
        if excerpt is None:
            raise ValueError(f"found no `excerpt`, expected the motions described as: {said}")
        part = stack([m for m in excerpt if m.split == "fitted"])
    free = start = solve_family(model, part)
    note: tuple[str, ...] = ()
    first = solve_from_part(model, data, start) if said else start
    if moving_mass is not None and is_pseudo_inertia_bounded(model):
        unlimited = make_estimate(model, data, first, "ls", level=level)
        require_possible_mass(model, unlimited.array, unlimited.covariance, moving_mass, level)
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
    solved = {"ls": SolvedMethod(model, start if said else first)}
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
        crossed=crossed, excerpt=said, band=band,
    )  # fmt: skip
    return SolvedFamily(fit, solved, part, level, moving_mass)


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
    others = {"wls": make(weighted, "wls"), "irls": make(robust, "irls")}
    solved |= {n: SolvedMethod(model, x) for n, x in (("wls", weighted), ("irls", robust))}
    failures: dict[str, str] = {}

    def attempt(
        name: str, solve: Callable[[], tuple[Solution, np.ndarray | None]], lengths: list[int] | None = None
    ) -> None:
        """Add what `solve` finds, with its instruments if it has any; `lengths` are those of stretches with rest."""
        try:
            solution, z = solve()
            made = make(solution, name, instruments=z, lengths=lengths)
            if not np.isfinite(made.covariance).all():
                raise IdentificationError(
                    "found parameters that the motion does not identify separately, expected a finite covariance: "
                    "record a motion in which their effects differ"
                )
            solved[name] = SolvedMethod(model, solution, every_row=lengths is not None, instruments=z)
            others[name] = made
        except (IdentificationError, np.linalg.LinAlgError) as error:
            failures[name] = str(error)

    traces: dict[int, JointTrace] = {}  # in closed loop by the values of least squares

    def simulate(motion: Motion) -> JointTrace:
        return traces.setdefault(id(motion), replay(model, first.values, motion, machine, closed=True))

    given = model, data, machine, first
    if all(machine.can_close(m) for m in data.motions):
        begun = cache(lambda: simulated_rows(model, first.values, data, machine, simulate))
        attempt("iv", lambda: solve_instrumental(*given, begun))
        attempt("didim", lambda: (solve_didim(*given, begun), None))
    attempt("output_error", lambda: (solve_output_error(*given), None), [len(m.moving) for m in data.motions])
    simulations: dict[str, tuple[Simulation, ...]] = {}
    drawn = {"ls": first.values} | ({"output_error": others["output_error"].array} if "output_error" in others else {})
    for method, values in drawn.items():
        made = []
        for motion in everything:
            for closed in (True, False) if machine.can_close(motion) else (False,):
                try:
                    trace = traces.get(id(motion)) if closed and method == "ls" else None
                    made.append(simulate_recording(model, values, motion, machine, closed=closed, trace=trace))
                except IdentificationError as error:
                    failures[f"simulation of {motion.recording}"] = str(error)
        simulations[method] = tuple(made)
    return others, simulations, failures


SPLIT_SUFFIXES = (("_positive", "_negative", ""), ("_motoring", "_generating", "_friction"))
"""Suffixes of two terms that a simpler family combines into one, and the suffix of that one."""


def added_terms(estimate: JointEstimate, simpler: Sequence[str], level: float) -> dict[str, bool]:
    """Return the terms of an estimate that a simpler family lacks, and whether each is identified.

    `simpler` are the parameters of the simpler family. A term is identified at `level` if it differs from 0. If the
    simpler family has one term for both directions, the difference between the directions counts. A parameter that
    shapes a friction curve is not a term, because the curve may be absent at any of its values. The variation of a term
    between recordings does not count against it.
    """
    names, added = [p.name for p in estimate.parameters], {}
    between = estimate.between_recordings
    covariance = estimate.covariance - (between.covariance if between is not None else 0.0)
    shape = shape_index(names)
    for i, parameter in enumerate(estimate.parameters):
        name = parameter.name
        if name in simpler or i == shape:
            continue
        for one, other, both in SPLIT_SUFFIXES:
            stem = name.removesuffix(one).removesuffix(other)
            if stem == name or f"{stem}{both}" not in simpler or f"{stem}{other}" not in names:
                continue
            if name.endswith(one):
                k = names.index(f"{stem}{other}")
                variance = covariance[i, i] + covariance[k, k] - 2.0 * covariance[i, k]
                apart = abs(parameter.value - estimate.parameters[k].value)
                label = f"the difference of {stem.replace('_', ' ')} between {one[1:]} and {other[1:]}"
                added[label] = bool(apart > normal_quantile(0.5 + 0.5 * level) * np.sqrt(max(variance, 0.0)))
            break
        else:
            added[name.replace("_", " ")] = is_told_from_zero(
                replace(parameter, standard_error=float(np.sqrt(max(covariance[i, i], 0.0)))), level
            )
    return added


def is_told_from_zero(parameter: Parameter, level: float) -> bool:
    """Return whether a parameter differs from 0 at a confidence `level`: above 0 alone where it cannot be negative."""
    if parameter.at_bound or parameter.undetermined or not 0.0 < parameter.standard_error < np.inf:
        return False
    if SYMBOLS_BY_NAME[parameter.name].lower >= 0.0:
        return bool(parameter.value > normal_quantile(level) * parameter.standard_error)
    return bool(abs(parameter.value) > normal_quantile(0.5 + 0.5 * level) * parameter.standard_error)
