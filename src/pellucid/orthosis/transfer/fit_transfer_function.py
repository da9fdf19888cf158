"""Identify a transfer function from arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr

from ..._errors import IdentificationError
from ...models.estimates import Estimates, Parameter, Whiteness
from ...numerics.sampled import sampled
from ...numerics.uncertainty import block_bootstrap, sandwich_covariance, whiteness
from ..input_output import InputOutput
from ..transfer_function import INPUT_HOLDS, ResponseBasis, TransferFunction, response_basis, time_steps
from .srivc import SINGULAR_VALUE_TOLERANCE, Experiment, first_transfer_functions, solve_linear

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
    def of(
        cls, record: InputOutput, simulated: np.ndarray, initial: Sequence[float], offset: float = 0.0
    ) -> Response:
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
    own = np.linalg.lstsq(columns / scale, record.output - forced, rcond=None)[0] / scale
    initial, constants = np.split(own, [transfer_function.order])
    return Response.of(record, forced + columns @ own, initial, float(constants.sum()))


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
            f"the sampling shows ({_highest_visible_rate(experiment):.3g} 1/s)"
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
        raise IdentificationError(f"{_names(experiment)}: a coefficient changes nothing in the response")
    _, singular, rows = np.linalg.svd(jacobian / scale, full_matrices=False)
    if singular[-1] > SINGULAR_VALUE_TOLERANCE * singular[0]:
        return
    share = np.abs(rows[-1])
    tied = [name for name, s in zip(coefficient_names(n, m), share, strict=False) if s > 0.1 * share.max()]
    raise IdentificationError(
        f"{_names(experiment)}: {', '.join(tied) or 'initial states'} cannot be told apart (condition number above "
        f"{1 / SINGULAR_VALUE_TOLERANCE:.0e}): a pole cancels a zero, or the input is too poor for {n} poles "
        f"and {m} zeros"
    )


def _names(experiment: Experiment) -> str:
    return "recording " + ", ".join(f"'{r.recording}'" for r in experiment.records)


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
