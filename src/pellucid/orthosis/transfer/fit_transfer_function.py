r"""Identify a transfer function from arrays, by output error from a first estimate by instrumental variables.

**First estimate.** State-variable filters come first, then simplified refined instrumental variables. Filtered by a
known denominator, A y = B u + Q is a linear regression,

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
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr

from ..._errors import IdentificationError
from ...models.estimates import Estimates, Parameter, Whiteness
from ...numerics.arguments import with_checked_arguments
from ...numerics.sampled import sampled
from ...numerics.uncertainty import block_bootstrap, sandwich_covariance, whiteness
from ..input_output import InputOutput
from ..transfer_function import (
    INPUT_HOLDS,
    ResponseBasis,
    TransferFunction,
    filtered_powers,
    response_basis,
    time_steps,
)

COEFFICIENT_TOLERANCE = 1e-4
"""The iteration stops when no coefficient changes by more than this share."""

MAX_REFINEMENTS = 30
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
            f"excite {experiment.poles} poles and {experiment.zeros} zeros; state fewer, or record an input with more "
            "frequencies"
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
    for k in range(1, MAX_REFINEMENTS + 1):
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
        raise IdentificationError(
            "the filtered signals overflow: the first guess has a pole far faster than the sampling; state fewer poles"
        )
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
        raise IdentificationError(
            "the regression on filtered signals is singular: the input excites too few frequencies for this many poles "
            "and zeros; state fewer, or record an input with more frequencies"
        )
    return np.linalg.solve(gram, (z / weight).T @ y) / scale


def _coefficients(made: TransferFunction) -> np.ndarray:
    return np.array([*made.denominator[1:], *made.numerator])


def _recording_names(experiment: Experiment) -> str:
    return "recording " + ", ".join(f"'{r.recording}'" for r in experiment.records)


MIN_SAMPLES_PER_UNKNOWN = 5
"""A record must have at least this many samples for each unknown."""

OUTPUT_TOLERANCE = 1e-7
"""The search stops when a full step would change the output by less than this share of the residual."""

BOOTSTRAP_SEED = 20261121
"""Seed of the bootstrap."""

MAX_ITERATIONS = 60
"""Largest number of iterations."""

STABILITY_EDGE_SHARE = 1e-6
"""A pole counts as at the edge of stability if its distance from the imaginary axis is below this share of its modulus,
or of one over the record's duration."""

MAX_POLE_RATE_RATIO = 10.0
"""A pole may exceed the Nyquist rate, pi over the time step, by at most this factor."""


@dataclass(frozen=True)
class Response:
    """A record with the response that an identified model simulates."""

    recording: str
    split: str
    time: np.ndarray  # (n,) [s]
    input: np.ndarray  # (n,) input, SI
    measured: np.ndarray  # (n,) measured output, SI
    simulated: np.ndarray  # (n,) simulated output, SI
    fit: float  # 100 (1 - ||y - y_s|| / ||y - mean y||) [%], as MATLAB's ``compare`` defines it
    rmse: float  # root mean square error, in the output's unit
    # estimated initial state: coefficients of Q, highest power first; the first is the free response at the start
    initial: tuple[float, ...]
    offset: float  # estimated constant of the output; 0 if none was asked for

    @classmethod
    def of(cls, record: InputOutput, simulated: np.ndarray, initial: Sequence[float], offset: float = 0.0) -> Response:
        """Return a record's response and how well it fits; `simulated`, (n,), and so the fit, may be NaN."""
        return cls(
            record.recording, record.split, record.time, record.input, record.output, simulated,
            fit_percent(record.output, simulated), float(np.sqrt(np.mean((record.output - simulated) ** 2))),
            tuple(float(x) for x in initial), offset,
        )  # fmt: skip

    @property
    def residual(self) -> np.ndarray:
        """Measured minus simulated output, shape (n,), in the output's unit."""
        return self.measured - self.simulated

    @property
    def diverges(self) -> bool:
        """Whether the model cannot be simulated along this record; fit and simulation are then NaN."""
        return not np.isfinite(self.fit)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TransferFit(Estimates):
    """An identified transfer function; its parameters are a_{n-1} ... a_0, then b_m ... b_0.

    Attributes
    ----------
    transfer_function : TransferFunction
    hold : str
        Assumed behaviour of the input between samples.
    physical : tuple of Parameter
        Inertia 1/b0, damping a1/b0 and stiffness a0/b0 by the delta method, for two poles and no zeros; empty
        otherwise.
    responses : tuple of Response
        Responses of the fitted records.
    residual_sd : float
        Standard deviation of the residual, in the output's unit.
    iterations : int
    converged : bool
    whiteness : Whiteness
    notes : tuple of str
    """

    transfer_function: TransferFunction
    hold: str
    physical: tuple[Parameter, ...]
    responses: tuple[Response, ...]
    residual_sd: float
    iterations: int
    converged: bool
    whiteness: Whiteness
    notes: tuple[str, ...] = ()

    @property
    def every(self) -> tuple[Parameter, ...]:
        """The coefficients, then the physical parameters of a mass with spring and damper, if there are any."""
        return *self.parameters, *self.physical

    @property
    def numerator(self) -> np.ndarray:
        """b_m ... b_0, shape (zeros + 1,)."""
        return np.array(self.transfer_function.numerator)

    @property
    def denominator(self) -> np.ndarray:
        """1, a_{n-1} ... a_0, shape (poles + 1,)."""
        return np.array(self.transfer_function.denominator)

    def predict(self, time: np.ndarray, input: np.ndarray) -> np.ndarray:
        """Simulate the response to an input, starting from rest.

        Parameters
        ----------
        time, input : ndarray, shape (n,)
            Increasing [s]; in the fitted input's unit.

        Returns
        -------
        ndarray, shape (n,)

        Raises
        ------
        RecordingError
            If the arrays do not fit together, or a number is missing.
        """
        time, input = sampled("predict", time, even=False, input=input)
        return self.transfer_function.simulate(time, input, hold=self.hold)

    def _facts(self) -> tuple[str, ...]:
        fits = ", ".join(f"{r.fit:.1f} %" for r in self.responses)
        return (f"fit {fits}; residual {self.residual_sd:.3g} (SD)", *self.notes)


def fit_records(
    records: Sequence[InputOutput],
    poles: int,
    zeros: int = 0,
    *,
    hold: str,
    offset: bool = False,
    units: tuple[str, str] = ("1", "1"),
    start: TransferFunction | None = None,
) -> TransferFit:
    """Identify a transfer function from one or more records of the same system."""
    if poles < 1 or not 0 <= zeros <= poles:
        raise IdentificationError(f"found {poles} poles and {zeros} zeros, expected at least 1 pole and no more zeros")
    if hold not in INPUT_HOLDS:
        raise IdentificationError(f"hold: found {hold!r}, expected one of {', '.join(INPUT_HOLDS)}")
    records = tuple(records)
    own = poles + offset
    for record in records:
        _require(record, poles + zeros + 1 + own)
    experiment = Experiment(records, poles, zeros, hold, offset)
    starts = first_transfer_functions(experiment) if start is None else [start]
    if starts[0].order != poles:
        raise IdentificationError(f"start: found {starts[0].order} poles, expected {poles}")
    starts = [each for each in starts if _has_visible_poles(experiment, each)] or starts[:1]
    found = _search(experiment, starts[0])
    # A search that ends at the edge of stability may be stuck there, so the other starts are tried too.
    if not found.settled or _poles_at_stability_edge(found.point.denominator, experiment):
        others = [_search(experiment, other) for other in starts[1:]]
        found = min((found, *others), key=lambda each: each.point.error)
    return _result_at(experiment, found, units)


def evaluate_transfer_function(transfer_function: TransferFunction, record: InputOutput, *, hold: str) -> Response:
    """Simulate a record with fixed coefficients; its initial state is estimated."""
    _require(record, transfer_function.order, moving=False)
    zeros = len(transfer_function.numerator) - 1
    basis = response_basis(transfer_function.denominator, zeros, record.time, record.input, hold=hold)
    forced = basis.numerator @ np.asarray(transfer_function.numerator)
    columns = basis.initial
    scale = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    initial = np.linalg.lstsq(columns / scale, record.output - forced, rcond=None)[0] / scale
    return Response.of(record, forced + columns @ initial, initial)


def fit_percent(measured: np.ndarray, simulated: np.ndarray) -> float:
    """100 (1 - ||y - y_s|| / ||y - mean y||) [%] of two signals, each of shape (n,); 0 is no better than the mean."""
    return float(100.0 * (1.0 - np.linalg.norm(measured - simulated) / np.linalg.norm(measured - np.mean(measured))))


def coefficient_names(poles: int, zeros: int) -> list[str]:
    """Return a_{n-1} ... a_0, b_m ... b_0 as plain text."""
    return [f"a{i}" for i in range(poles - 1, -1, -1)] + [f"b{i}" for i in range(zeros, -1, -1)]


def coefficient_units(poles: int, zeros: int, units: tuple[str, str]) -> tuple[str, ...]:
    """Return the units of a_{n-1} ... a_0, b_m ... b_0 as plain text."""
    given, made = units
    ratio = "" if given == made else made if given == "1" else f"{made}/({given}" if "*" in given else f"{made}/{given}"
    found = [f"1/s^{k}" if k > 1 else "1/s" for k in range(1, poles + 1)]
    for k in range(poles - zeros, poles + 1):
        second = "" if k == 0 else "s" if k == 1 else f"s^{k}"
        if "(" in ratio:
            found.append(f"{ratio}*{second})" if second else f"{ratio})")
        elif "/" in ratio and second:
            top, bottom = ratio.split("/", 1)
            found.append(f"{top}/({bottom}*{second})")
        elif second:
            found.append(f"{ratio or '1'}/{second}")
        else:
            found.append(ratio or "1")
    return tuple(found)


# --- the search -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Point:
    """A denominator with the least-squares solution of all linear parameters."""

    denominator: np.ndarray
    bases: list[ResponseBasis]
    linear: np.ndarray
    residual: np.ndarray
    columns: np.ndarray

    @property
    def error(self) -> float:
        return float(self.residual @ self.residual)


def _point_at(experiment: Experiment, denominator: np.ndarray) -> _Point | None:
    """Return the point of a denominator; None if its response overflows, or a pole is unstable or too fast."""
    poles = np.roots(np.concatenate([[1.0], denominator]))
    if np.any(poles.real > 0.0) or np.any(np.abs(poles) > MAX_POLE_RATE_RATIO * _highest_visible_rate(experiment)):
        return None
    bases = experiment.bases(np.concatenate([[1.0], denominator]))
    if not all(np.isfinite(b.numerator).all() and np.isfinite(b.initial).all() for b in bases):
        return None
    return _Point(denominator, bases, *solve_linear(experiment, bases))


@dataclass(frozen=True)
class _SearchResult:
    """Result of a search for the denominator."""

    point: _Point
    slopes: np.ndarray  # dy/da at the point
    iterations: int
    settled: bool  # whether the search converged


def _highest_visible_rate(experiment: Experiment) -> float:
    """Return the Nyquist rate of the records [rad/s]."""
    return float(np.pi / np.median(np.concatenate([np.diff(r.time) for r in experiment.records])))


def _has_visible_poles(experiment: Experiment, start: TransferFunction) -> bool:
    return bool(np.all(np.abs(start.poles) <= MAX_POLE_RATE_RATIO * _highest_visible_rate(experiment)))


def _search(experiment: Experiment, start: TransferFunction) -> _SearchResult:
    """Search the denominator by Levenberg-Marquardt steps."""
    point = _point_at(experiment, np.asarray(start.reflected().denominator[1:]))
    if point is None:
        raise IdentificationError(
            f"{_names(experiment)}: the first guess has a pole at {np.max(np.abs(start.poles)):.3g} 1/s, faster than "
            f"the sampling shows ({_highest_visible_rate(experiment):.3g} 1/s); state fewer poles, or record at a "
            "higher rate"
        )
    floor = 1e-12 * float(np.linalg.norm(experiment.output))
    damping, settled, steps = 1e-3, False, 0
    slopes = experiment.by_denominator(point.bases, point.linear)
    while not settled and steps < MAX_ITERATIONS:
        steps += 1
        q = qr(point.columns / np.linalg.norm(point.columns, axis=0), mode="economic", pivoting=True)[0]
        reduced = slopes - q @ (q.T @ slopes)
        scale = np.maximum(np.linalg.norm(reduced, axis=0), np.finfo(float).tiny)
        reduced = reduced / scale
        full = np.linalg.lstsq(reduced, point.residual, rcond=None)[0]
        settled = bool(np.linalg.norm(reduced @ full) <= OUTPUT_TOLERANCE * np.linalg.norm(point.residual) + floor)
        if settled:
            break
        better = None
        while better is None and damping < 1e10:
            rows = np.vstack([reduced, np.sqrt(damping) * np.eye(experiment.poles)])
            step = np.linalg.lstsq(rows, np.append(point.residual, np.zeros(experiment.poles)), rcond=None)[0]
            tried = _point_at(experiment, point.denominator + step / scale)
            better = tried if tried is not None and tried.error < point.error else None
            damping = max(damping / 10.0, 1e-12) if better else damping * 10.0
        if better is None:  # no step reduces the error: the edge of stability, or rounding
            settled = True
            break
        point = better
        slopes = experiment.by_denominator(point.bases, point.linear)
    return _SearchResult(point, slopes, steps, settled)


def _result_at(experiment: Experiment, found: _SearchResult, units: tuple[str, str]) -> TransferFit:
    point, settled = found.point, found.settled
    n, m = experiment.poles, experiment.zeros
    jacobian = np.hstack([found.slopes, point.columns])
    _require_regular(experiment, jacobian)
    p = n + m + 1
    covariance = sandwich_covariance(jacobian, point.residual, experiment.lengths)[:p, :p]
    made = TransferFunction(tuple(point.linear[: m + 1]), (1.0, *point.denominator))
    values = np.array([*point.denominator, *point.linear[: m + 1]])
    names = coefficient_names(n, m)
    rng, start = np.random.default_rng(BOOTSTRAP_SEED), np.zeros(jacobian.shape[1])
    steps = block_bootstrap(jacobian, point.residual, start, experiment.lengths, rng=rng)[:p]
    each = zip(names, coefficient_units(n, m, units), values, np.diag(covariance), steps, strict=True)
    parameters = tuple(
        replace(_parameter(name, unit, value, variance), bootstrap=(float(value + low), float(value + high)))
        for name, unit, value, variance, (low, high) in each
    )
    states = experiment.states(point.linear[m + 1 :])
    ends = np.cumsum(experiment.lengths)
    responses = tuple(
        Response.of(record, record.output - point.residual[end - len(record) : end], own[:n], float(own[n:].sum()))
        for record, own, end in zip(experiment.records, states, ends, strict=True)
    )
    notes = [] if settled else [f"the search had not settled after {found.iterations} steps"]
    notes += _pole_notes(made, experiment)
    return TransferFit(
        title=f"Transfer function of {n} pole{'s' * (n != 1)} and {m} zero{'s' * (m != 1)}",
        transfer_function=made,
        hold=experiment.hold,
        parameters=parameters,
        covariance=covariance,
        physical=_physical(values, covariance, units) if (n, m) == (2, 0) else (),
        responses=responses,
        residual_sd=float(np.sqrt(point.error / max(len(jacobian) - jacobian.shape[1], 1))),
        iterations=found.iterations,
        converged=settled,
        whiteness=whiteness(point.residual, experiment.lengths),
        notes=tuple(notes),
    )


def _parameter(name: str, unit: str, value: float, variance: float) -> Parameter:
    made = Parameter(name, unit, float(value), float(np.sqrt(max(variance, 0.0))))
    low, high = made.interval()
    return Parameter(name, unit, made.value, made.standard_error, identifiable=not low <= 0.0 <= high)


def _physical(values: np.ndarray, covariance: np.ndarray, units: tuple[str, str]) -> tuple[Parameter, ...]:
    """Return inertia, damping and stiffness of I q'' + b q' + k q = u, by the delta method."""
    a1, a0, b0 = values
    given, made_of = units
    texts = {
        ("N*m", "rad"): ("kg*m^2", "N*m*s/rad", "N*m/rad"),
        ("N", "m"): ("kg", "N*s/m", "N/m"),
        ("1", "1"): ("s^2", "s", "1"),
    }.get(units, (f"{given}*s^2/{made_of}", f"{given}*s/{made_of}", f"{given}/{made_of}"))
    slopes = np.array([[0.0, 0.0, -1.0 / b0**2], [1.0 / b0, 0.0, -a1 / b0**2], [0.0, 1.0 / b0, -a0 / b0**2]])
    names, made = ("inertia", "damping", "stiffness"), (1.0 / b0, a1 / b0, a0 / b0)
    return tuple(map(_parameter, names, texts, made, np.diag(slopes @ covariance @ slopes.T)))


def _poles_at_stability_edge(denominator: np.ndarray, experiment: Experiment) -> list[complex]:
    """Return the poles at the edge of stability, one of each conjugate pair."""
    slowest = 1.0 / max(float(r.time[-1] - r.time[0]) for r in experiment.records)
    poles = np.roots(np.concatenate([[1.0], denominator]))
    return [p for p in poles if abs(p.real) <= STABILITY_EDGE_SHARE * max(abs(p), slowest) and p.imag >= 0.0]


def _pole_notes(made: TransferFunction, experiment: Experiment) -> list[str]:
    notes = [
        f"a pole at {abs(p.imag) / (2 * np.pi):.3g} Hz lies at the edge of stability: the records show no damping there"
        for p in _poles_at_stability_edge(np.asarray(made.denominator[1:]), experiment)
    ]
    fast = [p for p in made.poles if abs(p) > _highest_visible_rate(experiment)]
    return notes + [
        f"a pole at {p.real:.3g} 1/s is faster than the sampling shows: fewer poles say as much" for p in fast
    ]


def require_samples(record: InputOutput, unknowns: int) -> str:
    """Refuse a `record` with missing samples or too few for its `unknowns`; return the prefix for further messages."""
    where = f"recording '{record.recording}'"
    table = np.column_stack([record.time, record.input, record.output])
    if not np.isfinite(table).all():
        raise IdentificationError(f"{where}: found missing samples, expected a number in each")
    if len(record) < MIN_SAMPLES_PER_UNKNOWN * unknowns:
        raise IdentificationError(
            f"{where}: found {len(record)} samples, expected at least {MIN_SAMPLES_PER_UNKNOWN * unknowns}, "
            f"{MIN_SAMPLES_PER_UNKNOWN} for each of {unknowns} unknowns"
        )
    return where


def _require(record: InputOutput, unknowns: int, *, moving: bool = True) -> None:
    where = require_samples(record, unknowns)
    try:
        time_steps(record.time)
    except IdentificationError as error:
        raise IdentificationError(f"{where}, {error}") from None
    for what, values in (("input", record.input), ("output", record.output)):
        if np.ptp(values) == 0.0 and (moving or what == "output"):
            raise IdentificationError(
                f"{where}: found an {what} that stays at {values[0]:.6g} in all {len(record)} samples, expected one "
                "that moves"
            )


def _require_regular(experiment: Experiment, jacobian: np.ndarray) -> None:
    n, m = experiment.poles, experiment.zeros
    scale = np.linalg.norm(jacobian, axis=0)
    if not np.isfinite(scale).all() or np.any(scale == 0.0):
        raise IdentificationError(
            f"{_names(experiment)}: a coefficient has no effect on the response; state fewer poles or zeros"
        )
    _, singular, rows = np.linalg.svd(jacobian / scale, full_matrices=False)
    if singular[-1] > SINGULAR_VALUE_TOLERANCE * singular[0]:
        return
    share = np.abs(rows[-1])
    tied = [name for name, s in zip(coefficient_names(n, m), share, strict=False) if s > 0.1 * share.max()]
    raise IdentificationError(
        f"{_names(experiment)}: {', '.join(tied) or 'initial states'} are not identifiable separately "
        f"(condition number above {1 / SINGULAR_VALUE_TOLERANCE:.0e}): a pole cancels a zero, or the input excites too "
        f"few frequencies for {n} poles and {m} zeros; state fewer, or record an input with more frequencies"
    )


def _names(experiment: Experiment) -> str:
    return "recording " + ", ".join(f"'{r.recording}'" for r in experiment.records)


@with_checked_arguments
def fit_transfer_function(
    time: np.ndarray,
    input: np.ndarray,
    output: np.ndarray,
    *,
    poles: int,
    zeros: int = 0,
    hold: str = "first",
    offset: bool = False,
    units: tuple[str, str] = ("1", "1"),
) -> TransferFit:
    r"""Identify a continuous-time transfer function from a sampled input and the response to it.

    .. math::  y = \frac{b_m s^m + \dots + b_0}{s^n + a_{n-1} s^{n-1} + \dots + a_0}\, u

    The simulated output is fitted to the measured one, from an initial state that is estimated too.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Increasing, evenly spaced or not [s].
    input, output : ndarray, shape (n,) or (n, 1)
        In any unit; see `units`.
    poles, zeros : int
        At least 1 pole, and no more zeros than poles.
    hold : {"first", "zero"}
        What the input does between samples: goes straight to the next one, or stays.
    offset : bool
        Estimate a constant of the output as well.
    units : tuple of str
        Of the input and of the output, for the parameters' units.

    Returns
    -------
    TransferFit
        Coefficients by name (``fit["a0"]``) with intervals; `numerator` and `denominator`, highest power first; of two
        poles and no zeros also ``fit["inertia"]``, ``fit["damping"]`` and ``fit["stiffness"]``.

    Raises
    ------
    RecordingError
        If arrays differ in shape, hold a number that is not finite, or time does not increase.
    IdentificationError
        If there are too few samples, an option is unknown, or the input cannot tell the coefficients apart.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> from scipy.signal import lsim
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> u = np.sin(t) + np.sign(np.sin(0.7 * t))
    >>> _, y, _ = lsim(([2.0], [1.0, 0.8, 9.0]), u, t)
    >>> fit = pl.fit_transfer_function(t, u, y, poles=2)
    >>> fit.numerator.round(3), fit.denominator.round(3)
    (array([2.]), array([1. , 0.8, 9. ]))
    """
    time, input, output = sampled("fit_transfer_function", time, even=False, input=input, output=output)
    record = InputOutput("response", "fitted", time, input, output)
    return fit_records([record], poles, zeros, hold=hold, offset=offset, units=units)
