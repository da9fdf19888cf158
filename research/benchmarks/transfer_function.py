"""Time to identify a continuous-time transfer function: Pellucid and a plain SciPy output-error fit.

Both start from the same transfer function and fit the same two poles and the same initial state to the same record. The
plain one simulates with ``scipy.signal.lsim`` and finite differences, as a user would write it. Runs are
interleaved; figures are medians.
"""

from __future__ import annotations

import numpy as np
from scipy import optimize, signal

from pellucid.orthosis.input_output import InputOutput
from pellucid.orthosis.transfer.fit_transfer_function import fit_records
from pellucid.orthosis.transfer_function import TransferFunction

from ._size import sized
from .identification import _row, interleaved

TRUE_SYSTEM = TransferFunction((20.0,), (1.0, 0.8, 27.0))
"""Transfer function of the simulated system."""

START_SYSTEM = TransferFunction((14.0,), (1.0, 1.4, 21.0))
"""Transfer function at which both fits start."""

INITIAL_STATE = (0.2, -0.5)
"""State of the simulated system at the first sample."""

RECORDS = sized(((2_000, 50.0), (10_000, 500.0)), smallest=((2_000, 50.0),))
"""Number of samples and sampling rate [Hz] of the records that are fitted."""


def record(*, samples: int, rate: float) -> InputOutput:
    """A resonant joint under a torque of four sines, its angle with coloured noise."""
    rng = np.random.default_rng(4)
    time = np.arange(samples) / rate
    torque = sum(np.sin(2.0 * np.pi * f * time) for f in (0.3, 0.5, 0.7, 1.0))
    clean = TRUE_SYSTEM.simulate(time, torque, hold="first", initial=INITIAL_STATE)
    noise = signal.lfilter([1.0], [1.0, -0.95], rng.normal(size=samples))
    return InputOutput("record", "fitted", time, torque, clean + 0.02 * clean.std() * noise / noise.std())


def plain_output_error(data: InputOutput) -> np.ndarray:
    """a1, a0 and b0, with the initial state of an observer's form among the unknowns."""

    def residual(x: np.ndarray) -> np.ndarray:
        a1, a0, b0, *state = x
        system = (np.array([[-a1, 1.0], [-a0, 0.0]]), np.array([[0.0], [b0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1)))
        return signal.lsim(system, data.input, data.time, X0=state)[1] - data.output

    _, a1, a0 = START_SYSTEM.denominator
    start = np.array([a1, a0, *START_SYSTEM.numerator, 0.0, 0.0])
    return optimize.least_squares(residual, start, x_scale=np.array([1.0, 20.0, 20.0, 1.0, 1.0]), xtol=1e-8).x[:3]


def run() -> list[dict]:
    """Rows of name, value, unit, note."""
    rows = []
    for samples, rate in RECORDS:
        data = record(samples=samples, rate=rate)

        def ours(data: InputOutput = data) -> np.ndarray:
            found = fit_records([data], 2, hold="first", start=START_SYSTEM)
            return np.array([p.value for p in found.parameters])

        def unaided(data: InputOutput = data) -> object:
            return fit_records([data], 2, hold="first")

        def theirs(data: InputOutput = data) -> np.ndarray:
            return plain_output_error(data)

        a, b, c = interleaved(ours, theirs, unaided)
        ratio = [y / x for x, y in zip(a, b, strict=True)]
        name = f"transfer function, {samples:,} samples"
        rows.append(_row(name, a, "s", "Pellucid, with covariance and fit"))
        rows.append(_row(f"{name}, plain", b, "s", "SciPy lsim and least_squares, finite differences"))
        rows.append(_row(f"{name}, plain over Pellucid", ratio, "1", "pair by pair"))
        rows.append(_row(f"{name}, no start given", c, "s", "Pellucid, with instrumental variables"))
        apart = float(np.max(np.abs(ours() / theirs() - 1.0)))
        note = "of any coefficient"
        rows.append({"name": f"{name}, largest difference", "value": apart, "unit": "1", "note": note})
    return rows
