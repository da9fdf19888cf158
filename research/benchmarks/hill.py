"""Fitting Hill muscles: one residual-and-Jacobian pass, a whole fit, and one step on the robot.

50,000 samples, three muscles, five shared parameters: shape, fibre length, its shift, largest speed, strength.
References are the same model in vectorised NumPy with SciPy's finite differences and, if installed, JAX (``jacfwd``,
float64) and CasADi. Every array is muscle-major. The references receive the neural activation, which the five
parameters do not change; the core computes it from the envelope each time. Compared runs are interleaved; figures are
medians.
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
from scipy import optimize

from pellucid import _core
from pellucid.emg.models.hill import FreeParameter, HillData, HillModel
from pellucid.emg.models.muscle_geometry import muscle_table

from ._peers import peer
from ._size import sized
from .identification import _row, interleaved

SAMPLE_COUNT = sized(50_000, smallest=2_000)
"""Number of samples of the simulated recording."""

PERIOD_S = 1e-3
"""Sampling period [s]."""

MUSCLE_NAMES = ("rectus_femoris", "vastus_lateralis", "vastus_medialis")
"""Muscles of the simulated recording."""

TRUE_PARAMETERS = np.array([-1.6, 1.06, 0.11, 0.9, 1.25])
"""True parameters of the simulation, in the order of the free parameters."""

START_PARAMETERS = np.array([-1.0, 1.0, 0.15, 1.0, 1.0])
"""Parameters at which both fits start."""

LOWER_BOUNDS = np.array([-3.0, 0.8, 0.0, 0.5, 0.5])
"""Lower bounds of the parameters."""

UPPER_BOUNDS = np.array([0.0, 1.2, 0.25, 1.5, 2.0])
"""Upper bounds of the parameters."""


def problem() -> tuple[HillModel, HillData, np.ndarray]:
    """Model, data and measured torque of a seated leg that swings."""
    table = muscle_table()
    quantities = ("shape", "optimal_fibre_length", "optimal_length_shift", "max_velocity", "strength")
    relative = {"optimal_fibre_length", "max_velocity"}
    free = [
        FreeParameter(q, q, MUSCLE_NAMES, low, high, q in relative)
        for q, low, high in zip(quantities, LOWER_BOUNDS, UPPER_BOUNDS, strict=True)
    ]
    model = HillModel([table.constants[n] for n in MUSCLE_NAMES], free)
    rng = np.random.default_rng(1)
    t = PERIOD_S * np.arange(SAMPLE_COUNT)
    angles = {"knee": np.radians(-65.0 + 35.0 * np.sin(3.1 * t)), "hip": np.full(SAMPLE_COUNT, np.radians(85.0))}
    rates = {"knee": np.radians(35.0 * 3.1 * np.cos(3.1 * t)), "hip": np.zeros(SAMPLE_COUNT)}
    paths = [table.geometry[n] for n in MUSCLE_NAMES]
    excitation = np.abs(np.sin(3.1 * t + np.array([[0.1], [0.4], [0.6]]))) ** 3 * 0.4 + 0.02 * rng.random(
        (3, SAMPLE_COUNT)
    )
    data = HillData(
        excitation,
        [p.length(angles) for p in paths],
        [p.rate(angles, rates) for p in paths],
        [p.moment_arm("knee", angles) for p in paths],
        PERIOD_S,
    )
    return model, data, model.torque(data, TRUE_PARAMETERS) + rng.normal(0.0, 0.5, SAMPLE_COUNT)


def torque_with(xp, p, u, length, rate, arm, constants):
    """The model in whatever array library `xp` is; constants are columns of F_0, l_o, l_ts, sin phi_o."""
    force, optimal, slack, sine = constants
    lo = optimal * p[1]
    along = length - slack
    fibre = xp.sqrt(along**2 + (lo * sine) ** 2)
    cosine = along / fibre
    a = xp.expm1(p[0] * u) / xp.expm1(p[0])
    f_l = xp.exp(-((fibre / (lo * (p[2] * (1 - a) + 1)) - 1) ** 2) / 0.45)
    v = rate * cosine / (10.0 * p[3] * lo)
    slow, fast = xp.minimum(xp.maximum(v, -1.0), 0.0), xp.maximum(v, 0.0)
    f_v = xp.where(v <= 0, (1 + slow) / (1 - slow / 0.25), (1.5 * fast + 0.1) / (fast + 0.1))
    strain = xp.minimum(xp.maximum(fibre / lo - 1, 0.0), 0.6)
    f_p = xp.expm1(4.0 * strain / 0.6) / np.expm1(4.0)
    return (arm * p[4] * force * (a * f_l * f_v + f_p) * cosine).sum(0)


def levenberg(normal: Callable, values: np.ndarray) -> np.ndarray:
    """A bounded least-squares fit from cost, gradient and J'J alone."""
    damping, (cost, gradient, matrix) = 1e-3, normal(values)
    for _ in range(60):
        step = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), -gradient)
        trial = np.clip(values + step, LOWER_BOUNDS, UPPER_BOUNDS)
        found = normal(trial)
        if found[0] < cost:
            done = cost - found[0] < 1e-12 * cost
            values, (cost, gradient, matrix), damping = trial, found, max(damping / 10.0, 1e-12)
            if done:
                break
        else:
            damping *= 10.0
            if damping > 1e8:
                break
    return values


def run() -> list[dict]:
    """Rows of name, value, unit, note."""
    model, data, measured = problem()
    muscles = model.muscles
    neural = neural_activation(model, data)
    columns = [
        np.array([[getattr(m, q)] for m in muscles]) for q in ("max_isometric_force", "optimal_fibre_length")
    ] + [np.array([[m.tendon_slack_length] for m in muscles]), np.sin([[m.pennation] for m in muscles])]
    rest = (neural, data.length, data.rate, data.moment_arm, columns)

    def plain(p: np.ndarray) -> np.ndarray:
        return torque_with(np, p, *rest) - measured

    assert np.allclose(plain(TRUE_PARAMETERS) + measured, model.torque(data, TRUE_PARAMETERS), rtol=1e-9, atol=1e-9)

    def differences() -> tuple:
        first = plain(START_PARAMETERS)
        return first, [(plain(START_PARAMETERS + h) - first) / 1e-7 for h in 1e-7 * np.eye(5)]

    fitted = {}

    def ours() -> None:
        fitted["core"] = levenberg(lambda v: model.normal(data, v, measured), START_PARAMETERS)

    def scipys(name: str, f: Callable, jac: Callable | str = "2-point") -> Callable:
        def fit() -> None:
            options = dict(bounds=(LOWER_BOUNDS, UPPER_BOUNDS), x_scale="jac", xtol=1e-10, ftol=1e-12)
            fitted[name] = optimize.least_squares(f, START_PARAMETERS, jac=jac, **options).x

        return fit

    passes = {"core": lambda: model.normal(data, START_PARAMETERS, measured), "NumPy and differences": differences}
    fits = {"core": ours, "SciPy and differences": scipys("SciPy and differences", plain)}
    jax = peer("hill", "jax")
    if jax is not None:
        residual, jacobian = with_jax(jax, rest, measured)
        passes["JAX, jacfwd"] = lambda: (residual(START_PARAMETERS), jacobian(START_PARAMETERS))
        fits["JAX, jacfwd"] = scipys("JAX, jacfwd", residual, jacobian)
    casadi = peer("hill", "casadi")
    if casadi is not None:
        both = with_casadi(casadi, rest)
        passes["CasADi"] = lambda: both(START_PARAMETERS)
        fits["CasADi"] = scipys("CasADi", lambda p: both(p)[0] - measured, lambda p: both(p)[1])

    what = f"{SAMPLE_COUNT} samples, 3 muscles, 5 parameters"
    rows = []
    for kind, calls in (("pass", passes), ("fit", fits)):
        for name, taken in zip(calls, interleaved(*calls.values()), strict=True):
            rows.append(_row(f"Hill {kind}: {name}", [1e3 * s for s in taken], "ms", what))
    apart = max(float(np.max(np.abs(v - fitted["core"]))) for v in fitted.values())
    rows.append({"name": "Hill fits agree within", "value": apart, "unit": "1", "note": ", ".join(fitted)})

    estimator = _core.HillTorque(model.parameters(TRUE_PARAMETERS), period=PERIOD_S)
    (taken,) = interleaved(lambda: estimator.run(*data.arrays))
    rows.append(_row("Hill step, three muscles", [1e9 * s / SAMPLE_COUNT for s in taken], "ns", "envelope to torque"))
    return rows


def neural_activation(model: HillModel, data: HillData) -> np.ndarray:
    """What the envelopes become before the shape: the activation of the same muscles with a straight one."""
    table = model.parameters()
    table[:, 0] = 0.0
    return _core.hill_states(table, *data.arrays[:3], period=PERIOD_S)[0]


def with_jax(jax: ModuleType, rest: tuple, measured: np.ndarray) -> tuple[Callable, Callable]:
    """Residual and Jacobian, compiled."""
    jnp = jax.numpy

    jax.config.update("jax_enable_x64", True)

    def residual(p):
        return torque_with(jnp, p, *rest) - measured

    compiled, jacobian = jax.jit(residual), jax.jit(jax.jacfwd(residual))
    return lambda p: np.asarray(compiled(p)), lambda p: np.asarray(jacobian(p))


def with_casadi(casadi: ModuleType, rest: tuple) -> Callable:
    """Torque and Jacobian of one sample, mapped over all."""

    class Symbols:
        """The few functions of an array library, on CasADi's columns."""

        sqrt, exp, expm1 = staticmethod(casadi.sqrt), staticmethod(casadi.exp), staticmethod(casadi.expm1)
        minimum, maximum, where = (staticmethod(f) for f in (casadi.fmin, casadi.fmax, casadi.if_else))

    neural, length, rate, arm, columns = rest
    p = casadi.SX.sym("p", 5)
    inputs = [casadi.SX.sym(name, 3) for name in "ulvr"]
    total = 0
    for i in range(3):
        constants = [float(c[i, 0]) for c in columns]
        values = [x[i] for x in inputs]
        total = total + _summed(Symbols, [p[j] for j in range(5)], values, constants)
    one = casadi.Function("one", [p, *inputs], [total, casadi.jacobian(total, p)])
    every = one.map(SAMPLE_COUNT)
    arrays = [casadi.DM(x) for x in (neural, length, rate, arm)]

    def both(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        torque, jacobian = every(casadi.repmat(casadi.DM(values), 1, SAMPLE_COUNT), *arrays)
        return np.array(torque).ravel(), np.array(jacobian).reshape(SAMPLE_COUNT, 5)

    return both


class _Scalar:
    """One muscle's product, which has nothing to be summed over."""

    def __init__(self, value):
        self.value = value

    def __mul__(self, other):
        return _Scalar(self.value * other)

    def sum(self, axis):
        return self.value


def _summed(xp, p, values, constants):
    u, length, rate, arm = values
    return torque_with(xp, p, u, length, rate, _Scalar(arm), constants)
