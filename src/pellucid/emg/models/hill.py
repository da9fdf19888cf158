r"""Muscles of Hill's type, from EMG envelopes to the torque of a joint; the physics is the core's.

For every muscle, with envelope e, electromechanical delay d and poles :math:`c_i = e^{-T_s/T_i}`
(``include/pellucid/activation.hpp``, ``fractional_delay.hpp``, ``muscle.hpp``):

.. math::
   u_t &= (1 - c_1)(1 - c_2)\,e(t - d) + (c_1 + c_2)\,u_{t-1} - c_1 c_2\,u_{t-2}, \qquad
   a = \frac{e^{A u} - 1}{e^A - 1} \\
   F &= s F_0 \max\left(0,\; a f_l(\tilde l) f_v(\tilde v) + k_p f_p(l/l_o) + \beta\tilde v\right)\cos\varphi, \qquad
   \tilde l = \frac{l}{l_o(\lambda(1 - a) + 1)}, \quad \tilde v = \frac{\dot l}{v_{max} l_o} \\
   l\cos\varphi &= l_{mt} - l_{ts}, \qquad l\sin\varphi = l_o\sin\varphi_o, \qquad \tau = \sum r F

Geometry (l_mt, its rate, r) comes from `muscle_geometry`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from ... import _core

MUSCLE_QUANTITIES: tuple[str, ...] = tuple(_core.MUSCLE_PARAMETER_NAMES)
"""Quantities that describe a muscle, in the core's order."""

FREE_QUANTITIES: tuple[str, ...] = MUSCLE_QUANTITIES[:11]
"""Quantities that identification may change."""

TWIN_QUANTITIES: Mapping[str, tuple[str, ...]] = {"time_constant": ("time_constant_1", "time_constant_2")}
"""Names that stand for two quantities with one value. Recordings cannot tell the two lags apart."""


@dataclass(frozen=True)
class HillMuscle:
    """One muscle."""

    name: str
    optimal_fibre_length: float  # optimal_fibre_length, tendon_slack_length: l_o and l_ts [m]
    tendon_slack_length: float
    max_isometric_force: float  # F_0 [N]
    pennation: float = 0.0  # phi_o, at l_o [rad]
    shape: float = -1.0  # A, from -3 to 0 [1]
    time_constant_1: float = 0.02  # time_constant_1, time_constant_2: T_1 and T_2 of the two lags [s]
    time_constant_2: float = 0.02
    delay: float = 0.02  # Electromechanical, d [s]
    strength: float = 1.0  # s [1]
    optimal_length_shift: float = 0.15  # lambda [1]
    max_velocity: float = 10.0  # v_max, in l_o per second [1/s]
    force_length_width: float = 0.45  # gamma of f_l [1]
    passive_scale: float = 1.0  # k_p [1]
    damping: float = 0.0  # beta [1]
    curvature: float = 0.25  # curvature, eccentric_force: A_f and g of f_v [1]
    eccentric_force: float = 1.5
    passive_strain: float = 0.6  # passive_strain, passive_shape: e_0 and k of f_p [1]
    passive_shape: float = 4.0

    def vector(self) -> np.ndarray:
        """Its numbers in the core's order, shape (18,), SI."""
        return np.array([getattr(self, quantity) for quantity in MUSCLE_QUANTITIES], float)


@dataclass(frozen=True)
class FreeParameter:
    """A number that identification may change, and what it drives."""

    name: str
    quantity: str  # One of `FREE_QUANTITIES`, or of `TWIN_QUANTITIES`
    muscles: tuple[str, ...]  # muscles that share the quantity
    lower: float  # lower, upper: Bounds of the number
    upper: float
    # Whether the number multiplies what each muscle has (a share of 1), or is the quantity itself (SI)
    relative: bool = False


@dataclass(frozen=True, eq=False)
class HillData:
    """Inputs at every sample, one row per muscle."""

    excitation: np.ndarray  # (m, n) Envelopes relative to maximal effort [1]
    # length, rate, moment_arm: (m, n) Musculotendon lengths [m], how fast they grow [m/s], moment arms about the joint
    # [m]; (j, m, n) about several joints, whose torques are then (j, n)
    length: np.ndarray
    rate: np.ndarray
    moment_arm: np.ndarray
    period: float  # From one sample to the next [s]
    starts: tuple[int, ...] = (0,)  # First sample of each recording

    def __post_init__(self):
        for name in ("excitation", "length", "rate", "moment_arm"):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), float))

    @property
    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Excitation, length, rate and moment arm, as the core takes them."""
        return self.excitation, self.length, self.rate, self.moment_arm


class HillModel:
    """Muscles of one joint or of several, some of whose numbers are free."""

    def __init__(self, muscles: Sequence[HillMuscle], free: Sequence[FreeParameter] = ()):
        self.muscles, self.free = tuple(muscles), tuple(free)
        names = [m.name for m in self.muscles]
        if len(set(names)) < len(names):
            raise ValueError(f"muscles: found {names}, expected each name once")
        self._base = np.array([m.vector() for m in self.muscles]).reshape(len(names), len(MUSCLE_QUANTITIES))
        self._column = np.full((len(names), len(FREE_QUANTITIES)), -1)
        for j, parameter in enumerate(self.free):
            driven = TWIN_QUANTITIES.get(parameter.quantity, (parameter.quantity,))
            if (
                not set(driven) <= set(FREE_QUANTITIES)
                or not set(parameter.muscles) <= set(names)
                or not parameter.muscles
            ):
                raise ValueError(
                    f"{parameter.name}: found {parameter.quantity} of {', '.join(parameter.muscles) or 'nothing'}, "
                    f"expected one of {', '.join(FREE_QUANTITIES)} of some of {', '.join(names)}"
                )
            for muscle, quantity in product(parameter.muscles, driven):
                at = names.index(muscle), FREE_QUANTITIES.index(quantity)
                if self._column[at] >= 0:
                    other = self.free[self._column[at]].name
                    raise ValueError(
                        f"{parameter.name}: found {quantity} of {muscle}, which {other} already sets, expected one "
                        "parameter for it"
                    )
                self._column[at] = j
        relative = np.array([p.relative for p in self.free], bool)
        has_free = self._column >= 0
        self._gain = np.ones(self._column.shape)
        if relative.any():
            scaled = has_free & relative[np.where(has_free, self._column, 0)]
            self._gain[scaled] = self._base[:, : len(FREE_QUANTITIES)][scaled]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters."""
        return tuple(p.name for p in self.free)

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper, each of shape (k,)."""
        return np.array([p.lower for p in self.free]), np.array([p.upper for p in self.free])

    @property
    def start(self) -> np.ndarray:
        """What the muscles have, shape (k,): 1 of what is relative, the mean of what several share."""
        mean = [
            1.0 if p.relative else np.mean(self._base[:, : len(FREE_QUANTITIES)][self._column == j])
            for j, p in enumerate(self.free)
        ]
        return np.array(mean, float)

    def parameters(self, values: np.ndarray | None = None) -> np.ndarray:
        """The core's array, shape (m, 18), for free `values`, shape (k,)."""
        table = self._base.copy()
        if values is not None and self.free:
            driven = self._column >= 0
            block = table[:, : len(FREE_QUANTITIES)]
            block[driven] = self._gain[driven] * np.asarray(values, float)[self._column[driven]]
        return table

    def with_values(self, values: np.ndarray) -> tuple[HillMuscle, ...]:
        """The muscles with free `values`, shape (k,), put in."""
        rows = self.parameters(values)

        def with_row(muscle: HillMuscle, row: np.ndarray) -> HillMuscle:
            quantities: dict[str, Any] = dict(zip(MUSCLE_QUANTITIES, map(float, row), strict=True))
            return replace(muscle, **quantities)

        return tuple(with_row(m, row) for m, row in zip(self.muscles, rows, strict=True))

    def torque(self, data: HillData, values: np.ndarray | None = None) -> np.ndarray:
        """Return the torque of all muscles, (n,) or (j, n) [N m], for free `values`, (k,)."""
        return _core.hill_torque(self.parameters(values), *data.arrays, period=data.period, starts=data.starts)

    def jacobian(self, data: HillData, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Torque and its exact derivatives. `values` (k,); gives `torque` (n,) or (j, n) [N m], `jacobian` (k, n) or
        (k, j, n)."""
        return _core.hill_jacobian(
            self.parameters(values), *data.arrays, self._column, self._gain, period=data.period, starts=data.starts
        )

    def normal(
        self, data: HillData, values: np.ndarray, measured: np.ndarray, weight: np.ndarray | None = None
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """What a least-squares step needs, in one pass: half the sum of squares, its gradient, and J'J. `values`
        (k,); `measured` (n,) [N m]; `weight` (n,); gives `gradient` (k,), `normal` (k, k)."""
        return _core.hill_normal(
            self.parameters(values), *data.arrays, self._column, self._gain, measured,
            period=data.period, starts=data.starts, weight=weight,
        )  # fmt: skip

    def states(self, data: HillData, values: np.ndarray | None = None) -> Mapping[str, np.ndarray]:
        """What each muscle does. `values` (k,); gives (m, n) [N], [m], [1, in v_max l_o]."""
        found = _core.hill_states(self.parameters(values), *data.arrays[:3], period=data.period, starts=data.starts)
        return dict(zip(("activation", "force", "fibre_length", "fibre_velocity"), found, strict=True))

    def estimator(self, period: float, values: np.ndarray | None = None) -> _core.HillTorque:
        """The same muscles sample by sample, causal, every `period` [s], with free `values`, shape (k,).

        Its ``delays`` say how late slow envelopes arrive in each muscle's activation.
        """
        return _core.HillTorque(self.parameters(values), period=period)
