r"""First estimate of a transfer function: state-variable filters, then simplified refined instrumental variables.

Filtered by a known denominator, A y = B u + Q is a linear regression,

.. math::
   \frac{s^n}{\hat A} y = -\sum_i a_i \frac{s^i}{\hat A} y + \sum_j b_j \frac{s^j}{\hat A} u
   + \sum_j q_j \frac{s^j}{\hat A}\delta ,

whose last columns represent the initial state. The first filter is :math:`(s + \lambda)^n`; every further one is the
denominator estimated before [1]_. The instruments are the same columns computed from the simulated output, so that
noise in the regressors causes no bias [2]_. Unstable poles are reflected after every step.

.. [1] P. C. Young, A. Jakeman, "Refined instrumental variable methods of recursive time-series analysis, part III",
   Int. J. Control 31, 1980.
.. [2] H. Garnier, L. Wang (eds.), "Identification of Continuous-time Models from Sampled Data", Springer, 2008.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ..input_output import InputOutput
from ..transfer_function import ResponseBasis, TransferFunction, filtered_powers, response_basis

COEFFICIENT_TOLERANCE = 1e-4
"""The iteration stops when no coefficient changes by more than this share."""

MAX_ITERATIONS = 30
"""Largest number of iterations."""

FILTER_CANDIDATE_COUNT = 6
"""Number of rates tried for the first filter, from one cycle per record to a tenth of the Nyquist frequency."""

SINGULAR_VALUE_TOLERANCE = 1e-10
"""A singular value below this share of the largest counts as zero; columns are scaled to norm 1."""


@dataclass(frozen=True)
class Experiment:
    """Records of one system, and the form of its transfer function."""

    records: tuple[InputOutput, ...]  # records, each with its own initial state
    poles: int
    zeros: int
    hold: str  # behaviour of the input between samples: ``"zero"``- or ``"first"``-order hold
    offset: bool = False  # whether each record's output has its own constant

    @property
    def lengths(self) -> list[int]:
        """Number of samples of each record."""
        return [len(r) for r in self.records]

    @property
    def output(self) -> np.ndarray:
        """Output of all records, concatenated, shape (m,)."""
        return np.concatenate([r.output for r in self.records])

    def bases(self, denominator: np.ndarray) -> list[ResponseBasis]:
        """Return the basis of all responses with a denominator, shape (poles + 1,), for each record."""
        return [response_basis(denominator.tolist(), self.zeros, r.time, r.input, hold=self.hold) for r in self.records]

    def columns(self, shared: Sequence[np.ndarray], own: Sequence[np.ndarray]) -> np.ndarray:
        """Assemble the regressor of all records, (m, k + l * records), from `shared` (n, k) and `own` (n, l)
        columns."""
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
        """Return the columns of all linear parameters: numerator, then each record's initial state and offset."""
        return self.columns([b.numerator for b in bases], [self._own(b.initial) for b in bases])

    def states(self, own: np.ndarray) -> np.ndarray:
        """Reshape the coefficients of the records' own columns to (records, poles or poles + 1)."""
        return own.reshape(len(self.records), -1)

    def by_denominator(self, bases: Sequence[ResponseBasis], linear: np.ndarray) -> np.ndarray:
        """Return the outputs' derivatives by the denominator, shape (m, poles), given the linear parameters."""
        numerator, states = linear[: self.zeros + 1], self.states(linear[self.zeros + 1 :])
        return np.concatenate(
            [b.by_denominator(numerator, q[: self.poles]) for b, q in zip(bases, states, strict=True)]
        )

    def _own(self, initial: np.ndarray) -> np.ndarray:
        return np.column_stack([initial, np.ones(len(initial))]) if self.offset else initial


def first_transfer_functions(experiment: Experiment) -> list[TransferFunction]:
    """Return transfer functions from which an output-error fit can start, the best one first."""
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
            f"{_recording_names(experiment)}: the regression on filtered signals is singular; the input does not "
            f"excite {experiment.poles} poles and {experiment.zeros} zeros"
        )
    found.sort(key=lambda each: each[0])
    error, start, linear = found[0]
    refined = refine(experiment, start, linear)[0]
    first = [refined] if simulation_error(experiment, refined) <= error else []
    return first + [made for _, made, _ in found]


def refine(
    experiment: Experiment, start: TransferFunction, linear: np.ndarray
) -> tuple[TransferFunction, tuple[int, bool]]:
    """Iterate simplified refined instrumental variables until no coefficient changes.

    `linear`, shape (zeros + 1 + own columns,), are the linear parameters of `start`. Returns the transfer function, the
    number of iterations, and whether they converged.
    """
    made, settled, k = start, False, 0
    for k in range(1, MAX_ITERATIONS + 1):
        before = made
        try:
            made, linear = _step(experiment, np.asarray(before.denominator), linear)
        except IdentificationError:
            return before, (k, False)
        new, old = _coefficients(made), _coefficients(before)
        settled = bool(
            np.all(np.abs(new - old) <= COEFFICIENT_TOLERANCE * np.maximum(np.abs(new), np.finfo(float).tiny))
        )
        if settled:
            break
    return made, (k, settled)


def solve_linear(experiment: Experiment, bases: Sequence[ResponseBasis]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solve for numerator, initial states and offsets, given the bases of a denominator.

    Returns their values (p,), the residual (m,) and the columns (m, p).
    """
    columns = experiment.linear(bases)
    scale = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    values = np.linalg.lstsq(columns / scale, experiment.output, rcond=None)[0] / scale
    return values, experiment.output - columns @ values, columns


def simulation_error(experiment: Experiment, transfer_function: TransferFunction) -> float:
    """Return the residual sum of squares of a denominator's best response; infinite where the response overflows."""
    bases = experiment.bases(np.asarray(transfer_function.denominator))
    if not all(np.isfinite(b.numerator).all() and np.isfinite(b.initial).all() for b in bases):
        return float("inf")
    residual = solve_linear(experiment, bases)[1]
    return float(residual @ residual)


def _rates(experiment: Experiment) -> np.ndarray:
    """Return the candidate cut-offs of the first filter, shape (`FILTER_CANDIDATE_COUNT`,) [1/s]."""
    longest = max(float(r.time[-1] - r.time[0]) for r in experiment.records)
    step = float(np.median(np.concatenate([np.diff(r.time) for r in experiment.records])))
    low, high = 2.0 * np.pi / longest, 0.1 * np.pi / step
    return np.geomspace(low, max(high, 2.0 * low), FILTER_CANDIDATE_COUNT)


def _step(
    experiment: Experiment, denominator: np.ndarray, linear: np.ndarray | None
) -> tuple[TransferFunction, np.ndarray]:
    """Solve one regression on signals filtered by 1/denominator.

    Instruments are used if `linear`, the linear parameters for the simulated output, is given.
    """
    n = experiment.poles
    bases = experiment.bases(denominator)
    target, measured, own = [], [], []
    for record, basis in zip(experiment.records, bases, strict=True):
        # The output between its samples is unknown, so it is interpolated linearly.
        both = np.column_stack([record.output, np.ones(len(record))])
        powers = filtered_powers(denominator.tolist(), record.time, both, hold="first")
        target.append(powers[:, 0, 0])
        measured.append(-powers[:, 1:, 0])
        constant = powers[:, -1:, 1] if experiment.offset else np.empty((len(record), 0))
        own.append(np.hstack([basis.initial, constant]))
    w = experiment.columns([np.hstack([f, b.numerator]) for f, b in zip(measured, bases, strict=True)], own)
    y = np.concatenate(target)
    if not (np.isfinite(w).all() and np.isfinite(y).all()):
        raise IdentificationError("the filtered signals overflow")
    if linear is None:
        values = _solve_instrumental(w, w, y)
    else:
        simulated = np.split(experiment.by_denominator(bases, linear), np.cumsum(experiment.lengths)[:-1])
        z = experiment.columns([np.hstack([f, b.numerator]) for f, b in zip(simulated, bases, strict=True)], own)
        values = _solve_instrumental(z, w, y)
    made = TransferFunction(tuple(values[n : n + experiment.zeros + 1]), (1.0, *values[:n])).reflected()
    bases = experiment.bases(np.asarray(made.denominator))
    return made, solve_linear(experiment, bases)[0]


def _solve_instrumental(z: np.ndarray, w: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(Z^T W)^-1 Z^T y, columns scaled."""
    scale = np.maximum(np.linalg.norm(w, axis=0), np.finfo(float).tiny)
    weight = np.maximum(np.linalg.norm(z, axis=0), np.finfo(float).tiny)
    gram = (z / weight).T @ (w / scale)
    singular = np.linalg.svd(gram, compute_uv=False)
    # The condition number of this product is the square of that of the regressor.
    if not np.isfinite(singular).all() or singular[-1] <= SINGULAR_VALUE_TOLERANCE**1.5 * singular[0]:
        raise IdentificationError("the regression on filtered signals is singular")
    return np.linalg.solve(gram, (z / weight).T @ y) / scale


def _coefficients(made: TransferFunction) -> np.ndarray:
    return np.array([*made.denominator[1:], *made.numerator])


def _recording_names(experiment: Experiment) -> str:
    return "recording " + ", ".join(f"'{r.recording}'" for r in experiment.records)
