r"""The muscle model as the paper prints it (HILL eqs. 16 to 38), to show what it gives.

Pellucid itself uses `pellucid.emg.models.hill`.

.. math::
   u_t &= \alpha e_{t-d} - \beta_1 u_{t-1} - \beta_2 u_{t-2}, \quad \beta_1 = \gamma_1 + \gamma_2,
   \beta_2 = \gamma_1\gamma_2, \alpha = 1 + \beta_1 + \beta_2 \\
   a &= \frac{e^{A u/R} - 1}{e^A - 1}, \quad R = k_r u_{max}, \qquad l_o^m = l_o(\lambda(a - 1) + 1), \quad
   l^m = k_s l_f(\theta) \\
   f_l &= e^{-(\tilde l - 1)^2/\gamma}, \quad \tilde v = -\dot l^m/(10 l_o k_v), \quad
   f_v = \frac{1 + \tilde v}{1 - \tilde v/A_{fv}} \;(\tilde v \le 0), \;
   \frac{g\tilde v + c}{\tilde v + c} \;(\tilde v > 0) \\
   \tau &= \sum r F_0 a f_l f_v \cos\varphi, \qquad \sin\varphi = \frac{l_o \sin\varphi_o}{l^m}, \qquad
   r = \frac{\partial l^m}{\partial\theta}\left(\cos\varphi +
   \frac{\sin\varphi\,l_o\sin\varphi_o}{l^m\sqrt{1 - K^2}}\right)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from pellucid.emg.models.hill import HillMuscle
from pellucid.emg.models.muscle_geometry import MuscleGeometry

FORCE_VELOCITY_CURVATURE = 0.25
"""A_fv."""
MAX_ECCENTRIC_FORCE = 1.5
"""g_max."""
FORCE_LENGTH_WIDTH = 0.45
"""gamma of f_l."""
RECURSION_COEFFICIENTS = (0.5, 0.5)
"""gamma_1 and gamma_2, fixed in the paper: poles at -gamma."""


@dataclass(frozen=True)
class PublishedParameters:
    """The five numbers that the paper identifies for a person, shared by all muscles."""

    # A, k_r, lambda_, k_s, k_v: Shape of activation, share of the largest neural activation, shift of the optimal
    # length, scale of the fibre's length, scale of the largest speed [1]
    A: float
    k_r: float
    lambda_: float
    k_s: float
    k_v: float


@dataclass(frozen=True)
class PublishedMuscle:
    """One muscle with its fibre's length as a straight line over the knee's angle (eq. 22)."""

    name: str
    max_isometric_force: float  # [N]
    optimal_fibre_length: float  # [m]
    pennation: float  # [rad]
    intercept: float  # intercept, slope: l_f = intercept + slope theta [m], [m/rad]
    slope: float


def fibre_line(
    muscle: HillMuscle, geometry: MuscleGeometry, *, others: Mapping[str, float], low: float, high: float
) -> PublishedMuscle:
    """The straight line through a rigid-tendon fibre's length over the knee's angle. `others` [rad]; `low`, `high`
    [rad]."""
    knee = np.linspace(low, high, 161)
    angles = {name: np.full_like(knee, value) for name, value in others.items()} | {"knee": knee}
    along = geometry.length(angles) - muscle.tendon_slack_length
    fibre = np.hypot(along, muscle.optimal_fibre_length * np.sin(muscle.pennation))
    slope, intercept = np.polyfit(knee, fibre, 1)
    return PublishedMuscle(
        muscle.name, muscle.max_isometric_force, muscle.optimal_fibre_length, muscle.pennation,
        float(intercept), float(slope),
    )  # fmt: skip


def recursion(gammas: Sequence[float] = RECURSION_COEFFICIENTS) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator, shapes (1,) and (3,), of the filter of eqs. 16 and 17."""
    beta_1, beta_2 = sum(gammas), float(np.prod(gammas))
    return np.array([1.0 + beta_1 + beta_2]), np.array([1.0, beta_1, beta_2])


def neural_activation(envelope: np.ndarray, gammas: Sequence[float] = RECURSION_COEFFICIENTS) -> np.ndarray:
    """u of an envelope, each of shape (n,), from a beginning of zeros (eq. 16, without its delay)."""
    return lfilter(*recursion(gammas), np.asarray(envelope, float))


def activation(neural: np.ndarray, shape: float, largest: float) -> np.ndarray:
    """Activation a(u) (eq. 18). `neural` (n,); gives (n,)."""
    return np.expm1(shape * np.asarray(neural, float) / largest) / np.expm1(shape)


def force_velocity(velocity: np.ndarray) -> np.ndarray:
    """f_v over the normalised velocity, each of shape (n,); positive is shortening, as eq. 24 has it (eq. 25)."""
    v = np.asarray(velocity, float)
    c = FORCE_VELOCITY_CURVATURE * (MAX_ECCENTRIC_FORCE - 1.0) / (FORCE_VELOCITY_CURVATURE + 1.0)
    slow, fast = np.minimum(v, 0.0), np.maximum(v, 0.0)
    return np.where(
        v <= 0.0, (1.0 + slow) / (1.0 - slow / FORCE_VELOCITY_CURVATURE), (MAX_ECCENTRIC_FORCE * fast + c) / (fast + c)
    )


def moment_arm(muscle: PublishedMuscle, fibre: np.ndarray, k_s: float) -> np.ndarray:
    """r of eq. 37. `fibre` (n,) [m]; gives (n,) [m]."""
    height = muscle.optimal_fibre_length * np.sin(muscle.pennation)
    sine = height / fibre
    cosine = np.sqrt(1.0 - sine**2)
    return k_s * muscle.slope * (cosine + sine * height / (fibre * np.sqrt(1.0 - sine**2)))


def torque(
    muscles: Sequence[PublishedMuscle],
    parameters: PublishedParameters,
    neural: np.ndarray,
    largest: np.ndarray,
    angle: np.ndarray,
    velocity: np.ndarray,
) -> np.ndarray:
    """The sum of r F over muscles (eq. 38). `neural` (m, n); `largest` (m,); `angle`, `velocity` (n,) [rad],
    [rad/s]; gives (n,) [N m]."""
    p, total = parameters, np.zeros(np.shape(angle))
    for muscle, u, most in zip(muscles, np.atleast_2d(neural), np.atleast_1d(largest), strict=True):
        a = activation(u, p.A, p.k_r * most)
        fibre = p.k_s * (muscle.intercept + muscle.slope * np.asarray(angle, float))
        optimal = muscle.optimal_fibre_length * (p.lambda_ * (a - 1.0) + 1.0)
        f_l = np.exp(-((fibre / optimal - 1.0) ** 2) / FORCE_LENGTH_WIDTH)
        v = -p.k_s * muscle.slope * np.asarray(velocity, float) / (10.0 * muscle.optimal_fibre_length * p.k_v)
        cosine = np.sqrt(1.0 - (muscle.optimal_fibre_length * np.sin(muscle.pennation) / fibre) ** 2)
        force = a * f_l * force_velocity(v) * muscle.max_isometric_force * cosine
        total = total + moment_arm(muscle, fibre, p.k_s) * force
    return total
