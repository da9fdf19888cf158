r"""Rational transfer functions in continuous time, simulated exactly between samples.

.. math::
   A(s)\,y = B(s)\,u + Q(s), \qquad A = s^n + a_{n-1}s^{n-1} + \dots + a_0, \quad B = b_m s^m + \dots + b_0

Q, of degree n - 1, holds the initial state: its leading coefficient is the free response at the first sample. The input
is known between samples by how it was made: held (``"zero"``) or going straight from one sample to the next
(``"first"``). With that the response at the samples is exact, whatever their spacing: two chains of integrators,

.. math::
   \dot x = F x + e\,u, \qquad \dot z = F z + e\,x_0,

F being the companion matrix of A, give every s^j/A u and s^j/A^2 u, and these both the response and its derivatives:
dy/db_j = s^j/A u, dy/dq_j = s^j/A delta, dy/da_i = -s^i/A y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._errors import IdentificationError
from .linear_recursion import march

INPUT_HOLDS = ("zero", "first")
"""What the input does between samples: stay, or go straight to the next one."""

STEP_RESOLUTION = 1e-9
"""Time steps that differ by less than this share of the median step are one step: a clock's last bits are no jitter."""

EXPONENTIAL_TERMS = 14
"""Terms of a matrix exponential's series."""


@dataclass(frozen=True)
class TransferFunction:
    """B(s)/A(s), proper, of any order."""

    # numerator, denominator: Coefficients, highest power first, as SciPy writes them; the denominator is scaled to
    # start with 1. Powers of s in 1/s, the whole in output unit per input unit
    numerator: tuple[float, ...]
    denominator: tuple[float, ...]

    def __post_init__(self):
        a = np.atleast_1d(np.asarray(self.denominator, float))
        b = np.atleast_1d(np.asarray(self.numerator, float))
        if len(a) < 2 or not len(b) or a.ndim != 1 or b.ndim != 1:
            raise IdentificationError(
                f"a transfer function of {len(b)} over {len(a)} coefficients: expected at least 1 over 2"
            )
        if not (np.isfinite(a).all() and np.isfinite(b).all()) or a[0] == 0.0:
            raise IdentificationError(
                f"transfer function: found {b.tolist()} over {a.tolist()}, expected finite numbers and a denominator "
                "that does not start with 0"
            )
        if len(b) > len(a):
            raise IdentificationError(
                f"transfer function: found {len(b) - 1} zeros and {len(a) - 1} poles, expected no more zeros than poles"
            )
        object.__setattr__(self, "denominator", tuple(float(x) for x in a / a[0]))
        object.__setattr__(self, "numerator", tuple(float(x) for x in b / a[0]))

    @property
    def order(self) -> int:
        """Number of poles."""
        return len(self.denominator) - 1

    @property
    def poles(self) -> np.ndarray:
        """Roots of A, shape (order,), complex [1/s]."""
        return np.roots(self.denominator).astype(complex)

    @property
    def zeros(self) -> np.ndarray:
        """Roots of B, shape (m,), complex [1/s]."""
        return np.roots(self.numerator).astype(complex)

    @property
    def static_gain(self) -> float:
        """B(0)/A(0), in output unit per input unit; infinite with a pole at 0."""
        bottom = self.denominator[-1]
        return self.numerator[-1] / bottom if bottom else float(np.copysign(np.inf, self.numerator[-1]))

    @property
    def stable(self) -> bool:
        """Whether every pole lies left of the imaginary axis."""
        return bool(np.all(self.poles.real < 0.0))

    def reflected(self) -> TransferFunction:
        """The same with unstable poles mirrored at the imaginary axis; those on the axis stay."""
        poles = self.poles
        if not np.any(poles.real > 0.0):
            return self
        return TransferFunction(self.numerator, tuple(np.poly(-np.abs(poles.real) + 1j * poles.imag).real))

    def frequency_response(self, frequency: np.ndarray) -> np.ndarray:
        """B(i w)/A(i w), complex, shape (k,), at frequencies, shape (k,) [Hz]."""
        s = 2j * np.pi * np.asarray(frequency, float)
        return np.polyval(self.numerator, s) / np.polyval(self.denominator, s)

    def simulate(
        self, time: np.ndarray, signal: np.ndarray, *, hold: str, initial: Sequence[float] | None = None
    ) -> np.ndarray:
        """The response to a sampled input, exact for the stated inter-sample behaviour. `time` (n,) [s]; `signal`
        (n,); gives (n,)."""
        chain = _Chain(self.denominator, time, hold)
        forced = chain.powers(np.asarray(signal, float)[:, None])[:, -len(self.numerator) :, 0]
        output = forced @ np.asarray(self.numerator)
        if initial is not None:
            output = output + chain.free()[:, 1:] @ np.asarray(initial, float)
        return output


@dataclass(frozen=True)
class ResponseBasis:
    """What a denominator and an input make possible: the response is linear in all other coefficients."""

    numerator: np.ndarray  # (n, m + 1) s^m/A u ... u/A: the response's derivatives by b_m ... b_0
    initial: np.ndarray  # (n, order) s^{order-1}/A ... 1/A of an impulse: its derivatives by Q's coefficients
    squared: np.ndarray  # (n, 2 order, 2) s^{2 order-1}/A^2 ... 1/A^2 of the input and of the impulse

    def by_denominator(self, numerator: np.ndarray, initial: np.ndarray) -> np.ndarray:
        """The response's derivatives by a_{order-1} ... a_0, shape (n, order), for b and q, highest power first."""
        n, m = self.initial.shape[1], len(numerator) - 1
        # s^i B/A^2 u and s^i Q/A^2 delta are windows of powers, slid along.
        columns = [
            self.squared[:, 2 * n - 1 - i - m : 2 * n - i, 0] @ numerator
            + self.squared[:, n - i : 2 * n - i, 1] @ initial
            for i in range(n - 1, -1, -1)
        ]
        return -np.stack(columns, axis=1)


def response_basis(
    denominator: Sequence[float], zeros: int, time: np.ndarray, signal: np.ndarray, *, hold: str
) -> ResponseBasis:
    """The responses from which every transfer function with this denominator is put together. `time` (n,) [s];
    `signal` (n,)."""
    n = len(denominator) - 1
    once, twice = _Chain(denominator, time, hold, double=True).both(np.asarray(signal, float))
    return ResponseBasis(once[:, n - zeros :, 0], once[:, 1:, 1], twice)


def filtered_powers(denominator: Sequence[float], time: np.ndarray, signals: np.ndarray, *, hold: str) -> np.ndarray:
    """Signals through a state-variable filter: s^n/A x, ..., s/A x, x/A, each from rest. `time` (k,) [s]; `signals`
    (k, r); gives (k, n + 1, r)."""
    return _Chain(denominator, time, hold).powers(np.asarray(signals, float))


def time_steps(time: np.ndarray) -> np.ndarray:
    """Steps of a time axis, shape (n - 1,) [s], equal ones made equal to the last bit. `time` (n,) [s]; gives (n -
    1,)."""
    time = np.asarray(time, float)
    if time.ndim != 1 or len(time) < 2:
        raise IdentificationError(f"time: found shape {time.shape}, expected (n,) with at least two samples")
    steps = np.diff(time)
    wrong = np.flatnonzero(~(steps > 0.0))
    if len(wrong):
        i = int(wrong[0])
        raise IdentificationError(
            f"time: found {time[i]:.6g} s, then {time[i + 1]:.6g} s at sample {i + 1} ({len(wrong)} such steps), "
            "expected time that increases with every sample"
        )
    grain = STEP_RESOLUTION * float(np.median(steps))
    return np.round(steps / grain) * grain


class _Chain:
    """Integrators with the companion matrix of A, discretised for one time axis and hold; time scaled by A's roots."""

    def __init__(self, denominator: Sequence[float], time: np.ndarray, hold: str, *, double: bool = False):
        if hold not in INPUT_HOLDS:
            raise IdentificationError(f"hold: found {hold!r}, expected one of {', '.join(INPUT_HOLDS)}")
        a = np.asarray(denominator, float)
        n = len(a) - 1
        powers = np.arange(1, n + 1)
        # With this unit of time every entry of the companion matrix is at most 1.
        rate = float(np.max(np.abs(a[1:]) ** (1.0 / powers)))
        steps = time_steps(time)
        self.rate = rate = rate if rate > 0.0 else 1.0 / float(np.sum(steps))
        self.scaled = a[1:] / rate**powers  # highest power first
        self.order, self.count, self.hold = n, len(steps) + 1, hold
        d = 2 * n if double else n
        # States: s^{n-1}/A ... 1/A of the input, then the same of the first chain's last one.
        system = np.zeros((d + 2, d + 2))
        for k in range(d // n):
            at = k * n
            system[at, at : at + n] = -self.scaled
            system[np.arange(at + 1, at + n), np.arange(at, at + n - 1)] = 1.0
        system[0, d] = 1.0
        if double:
            system[n, n - 1] = 1.0
        distinct, index = np.unique(steps, return_inverse=True)
        scaled = system * (rate * distinct)[:, None, None]
        scaled[:, d, d + 1] = 1.0  # the input's slope, over one step
        made = _exponentials(scaled)
        self.transition, self.held, self.ramp = (made[:, :d, at][index] for at in (slice(d), d, d + 1))

    def _march(self, signals: np.ndarray, initial: np.ndarray) -> np.ndarray:
        if signals.shape[0] != self.count or not np.isfinite(signals).all():
            missing = int(np.count_nonzero(~np.isfinite(signals).all(axis=1)))
            raise IdentificationError(
                f"signal: found {len(signals)} samples, {missing} of them missing, expected a number for each of "
                f"{self.count} times"
            )
        forcing = self.held[:, :, None] * signals[:-1, None, :]
        if self.hold == "first":
            forcing = forcing + self.ramp[:, :, None] * np.diff(signals, axis=0)[:, None, :]
        return march(self.transition, forcing, initial)

    def powers(self, signals: np.ndarray) -> np.ndarray:
        """s^n/A ... 1/A of signals, shape (k, n + 1, r)."""
        n = self.order
        x = self._march(signals, np.zeros((len(self.transition[0]), signals.shape[1])))[:, :n]
        top = signals[:, None, :] - np.tensordot(x, self.scaled, axes=(1, 0))[:, None, :]
        return np.concatenate([top, x], axis=1) * (self.rate ** -np.arange(0.0, n + 1))[:, None]

    def free(self) -> np.ndarray:
        """A column of zeros, then s^{n-1}/A ... 1/A of an impulse at the first sample, shape (k, n + 1)."""
        x = march(self.transition, np.zeros((self.count - 1, self.order, 1)), np.eye(self.order, 1))[:, :, 0]
        return np.pad(x, ((0, 0), (1, 0))) * self.rate ** -np.arange(-1.0, self.order)

    def both(self, signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return s^n/A ... 1/A and s^{2n-1}/A^2 ... 1/A^2 of the input and of an impulse (last axis)."""
        n = self.order
        two = np.column_stack([signal, np.zeros(self.count)])
        initial = np.zeros((2 * n, 2))
        initial[0, 1] = 1.0
        states = self._march(two, initial)
        x, z = states[:, :n], states[:, n:]
        top = two - np.tensordot(x, self.scaled, axes=(1, 0))
        squares = [z[:, i] for i in range(n)]  # highest power first
        for k in range(n):
            # s^{n+k}/A^2 = s^k/A - sum a_i s^{i+k}/A^2
            squares.insert(0, x[:, n - 1 - k] - sum(a * squares[i] for i, a in enumerate(self.scaled)))
        # An impulse is larger by the rate in scaled time.
        units = np.array([1.0, self.rate])
        down = self.rate ** -np.arange(0.0, n + 1)
        once = np.concatenate([top[:, None], x], axis=1) * down[:, None] * units
        down = self.rate ** -np.arange(1.0, 2 * n + 1)
        return once, np.stack(squares, axis=1) * down[:, None] * units


def _exponentials(matrices: np.ndarray) -> np.ndarray:
    """Exponential of every matrix, shape (k, d, d), all at once: a record may have as many steps as samples."""
    largest = float(np.abs(matrices).sum(axis=2).max())
    halvings = max(0, int(np.ceil(np.log2(2.0 * largest))))
    scaled = matrices / 2.0**halvings
    # For a norm of at most a half, fourteen terms leave less than the last bit.
    made = np.eye(matrices.shape[1]) + scaled / EXPONENTIAL_TERMS
    for k in range(EXPONENTIAL_TERMS - 1, 0, -1):
        made = np.eye(matrices.shape[1]) + scaled @ made / k
    for _ in range(halvings):
        made = made @ made
    return made
