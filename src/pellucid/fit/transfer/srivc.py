r"""A first transfer function, linear step by linear step: state-variable filters, then refined instrumental variables.

Divided by a known denominator, A y = B u + Q becomes a regression on filtered signals,

.. math::
   \frac{s^n}{\hat A} y = -\sum_i a_i \frac{s^i}{\hat A} y + \sum_j b_j \frac{s^j}{\hat A} u
   + \sum_j q_j \frac{s^j}{\hat A}\delta ,

whose last columns carry the initial state. It starts with a filter :math:`(s + \lambda)^n` and goes on with the
denominator found [1]_; the instruments are the same columns made of the simulated output, so that its noise, which sits
in the regressors too, biases nothing [2]_. Unstable poles are mirrored after every step.

.. [1] P. C. Young, A. Jakeman, "Refined instrumental variable methods of recursive time-series analysis, part III",
   Int. J. Control 31, 1980.
.. [2] H. Garnier, L. Wang (eds.), "Identification of Continuous-time Models from Sampled Data", Springer, 2008.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...models.transfer_function import ResponseBasis, TransferFunction, filtered_powers, response_basis
from ...signals.input_output import InputOutput

STOP = 1e-4
"""Largest change of any coefficient, over its size, at which the iteration stops."""

MAX_ITERATIONS = 30

FILTERS = 6
"""Rates of the first filter that are tried, from one turn in a record to a tenth of what its sampling can show."""

SINGULAR = 1e-10
"""Share of the largest singular value, columns scaled to length 1, below which one counts as zero."""


@dataclass(frozen=True)
class Experiment:
    """Records of one system, and the form of its transfer function."""

    records: tuple[InputOutput, ...]  # Each with an initial state of its own
    poles: int
    zeros: int
    hold: str  # What the input does between samples: ``"zero"`` or ``"first"``
    offset: bool = False  # Whether each record's output has a constant of its own

    @property
    def lengths(self) -> list[int]:
        """Samples of each record."""
        return [len(r) for r in self.records]

    @property
    def output(self) -> np.ndarray:
        """Every record's output, one after the other, shape (m,)."""
        return np.concatenate([r.output for r in self.records])

    def bases(self, denominator: np.ndarray) -> list[ResponseBasis]:
        """The responses that a denominator, shape (poles + 1,), makes possible, record by record."""
        return [response_basis(denominator, self.zeros, r.time, r.input, hold=self.hold) for r in self.records]

    def columns(self, shared: Sequence[np.ndarray], own: Sequence[np.ndarray]) -> np.ndarray:
        """Regressor of all records. `shared` (n, k); `own` (n, l); gives (m, k + l * records)."""
        width, each = shared[0].shape[1], own[0].shape[1]
        made = np.zeros((sum(self.lengths), width + each * len(own)))
        begin = 0
        for k, (common, single) in enumerate(zip(shared, own, strict=True)):
            rows = slice(begin, begin + len(common))
            made[rows, :width] = common
            made[rows, width + k * each : width + (k + 1) * each] = single
            begin += len(common)
        return made

    def linear(self, bases: Sequence[ResponseBasis]) -> np.ndarray:
        """Columns of everything but the denominator: numerator, then each record's initial state and offset."""
        return self.columns([b.numerator for b in bases], [self._own(b.initial) for b in bases])

    def states(self, own: np.ndarray) -> np.ndarray:
        """Coefficients of the records' own columns as a table, shape (records, poles or poles + 1)."""
        return own.reshape(len(self.records), -1)

    def by_denominator(self, bases: Sequence[ResponseBasis], linear: np.ndarray) -> np.ndarray:
        """Derivatives of all outputs by the denominator, shape (m, poles), at the values of all linear ones."""
        numerator, states = linear[: self.zeros + 1], self.states(linear[self.zeros + 1 :])
        return np.concatenate(
            [b.by_denominator(numerator, q[: self.poles]) for b, q in zip(bases, states, strict=True)]
        )

    def _own(self, initial: np.ndarray) -> np.ndarray:
        return np.column_stack([initial, np.ones(len(initial))]) if self.offset else initial


def first_transfer_functions(experiment: Experiment) -> list[TransferFunction]:
    """Transfer functions to start a fit of the response from."""
    found = []
    for rate in _rates(experiment):
        filter_ = np.poly(np.full(experiment.poles, -rate))
        try:
            made, linear = _step(experiment, filter_, None)
        except IdentificationError:
            continue
        found.append((simulation_error(experiment, made), made, linear))
    if not found:
        raise IdentificationError(
            f"{_named(experiment)}: the regression on filtered signals is singular; the input does not excite "
            f"{experiment.poles} poles and {experiment.zeros} zeros"
        )
    found.sort(key=lambda each: each[0])
    error, start, linear = found[0]
    refined = refine(experiment, start, linear)[0]
    first = [refined] if simulation_error(experiment, refined) <= error else []
    return first + [made for _, made, _ in found]


def refine(
    experiment: Experiment, start: TransferFunction, linear: np.ndarray
) -> tuple[TransferFunction, tuple[int, bool]]:
    """Simplified refined instrumental variables, until no coefficient moves. `linear` (zeros + 1 + own columns,)."""
    made, settled, k = start, False, 0
    for k in range(1, MAX_ITERATIONS + 1):
        before = made
        try:
            made, linear = _step(experiment, np.asarray(before.denominator), linear)
        except IdentificationError:
            return before, (k, False)
        new, old = _coefficients(made), _coefficients(before)
        settled = bool(np.all(np.abs(new - old) <= STOP * np.maximum(np.abs(new), np.finfo(float).tiny)))
        if settled:
            break
    return made, (k, settled)


def solve_linear(experiment: Experiment, bases: Sequence[ResponseBasis]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Best numerator, initial states and offsets for a denominator. Gives `values` (p,), `residual` (m,), `columns`
    (m, p)."""
    columns = experiment.linear(bases)
    scale = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    values = np.linalg.lstsq(columns / scale, experiment.output, rcond=None)[0] / scale
    return values, experiment.output - columns @ values, columns


def simulation_error(experiment: Experiment, transfer_function: TransferFunction) -> float:
    """Sum of squares that a denominator's best response leaves; infinite where it overflows."""
    bases = experiment.bases(np.asarray(transfer_function.denominator))
    if not all(np.isfinite(b.numerator).all() and np.isfinite(b.initial).all() for b in bases):
        return float("inf")
    residual = solve_linear(experiment, bases)[1]
    return float(residual @ residual)


def _rates(experiment: Experiment) -> np.ndarray:
    """Candidate cut-offs of the first filter, shape (FILTERS,) [1/s]."""
    longest = max(float(r.time[-1] - r.time[0]) for r in experiment.records)
    step = float(np.median(np.concatenate([np.diff(r.time) for r in experiment.records])))
    low, high = 2.0 * np.pi / longest, 0.1 * np.pi / step
    return np.geomspace(low, max(high, 2.0 * low), FILTERS)


def _step(
    experiment: Experiment, denominator: np.ndarray, linear: np.ndarray | None
) -> tuple[TransferFunction, np.ndarray]:
    """One regression on signals filtered by 1/denominator; with instruments where `linear` says what to simulate."""
    n = experiment.poles
    bases = experiment.bases(denominator)
    target, measured, own = [], [], []
    for record, basis in zip(experiment.records, bases, strict=True):
        # The output is seen at its samples alone: straight lines between them are the plainest guess.
        both = np.column_stack([record.output, np.ones(len(record))])
        powers = filtered_powers(denominator, record.time, both, hold="first")
        target.append(powers[:, 0, 0])
        measured.append(-powers[:, 1:, 0])
        constant = powers[:, -1:, 1] if experiment.offset else np.empty((len(record), 0))
        own.append(np.hstack([basis.initial, constant]))
    w = experiment.columns([np.hstack([f, b.numerator]) for f, b in zip(measured, bases, strict=True)], own)
    y = np.concatenate(target)
    if not (np.isfinite(w).all() and np.isfinite(y).all()):
        raise IdentificationError("the filtered signals overflow")
    if linear is None:
        values = _solved(w, w, y)
    else:
        simulated = np.split(experiment.by_denominator(bases, linear), np.cumsum(experiment.lengths)[:-1])
        z = experiment.columns([np.hstack([f, b.numerator]) for f, b in zip(simulated, bases, strict=True)], own)
        values = _solved(z, w, y)
    made = TransferFunction(tuple(values[n : n + experiment.zeros + 1]), (1.0, *values[:n])).reflected()
    bases = experiment.bases(np.asarray(made.denominator))
    return made, solve_linear(experiment, bases)[0]


def _solved(z: np.ndarray, w: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(Z^T W)^-1 Z^T y, columns scaled."""
    scale = np.maximum(np.linalg.norm(w, axis=0), np.finfo(float).tiny)
    weight = np.maximum(np.linalg.norm(z, axis=0), np.finfo(float).tiny)
    gram = (z / weight).T @ (w / scale)
    singular = np.linalg.svd(gram, compute_uv=False)
    # The products of two columns have the square of a regressor's condition number.
    if not np.isfinite(singular).all() or singular[-1] <= SINGULAR**1.5 * singular[0]:
        raise IdentificationError("the regression on filtered signals is singular")
    return np.linalg.solve(gram, (z / weight).T @ y) / scale


def _coefficients(made: TransferFunction) -> np.ndarray:
    return np.array([*made.denominator[1:], *made.numerator])


def _named(experiment: Experiment) -> str:
    return "recording " + ", ".join(f"'{r.recording}'" for r in experiment.records)
