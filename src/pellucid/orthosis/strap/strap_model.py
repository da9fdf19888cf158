r"""Models of a strap with up to six features, its torque from a body's balance, and slips of its mounting.

The plainest strap is a spring and a damper in parallel (Kelvin-Voigt).

The core computes every strap (``include/pellucid/strap.hpp``). A model is a set of features; each feature frees
parameters that are 0 without it. A second spring in series with a dashpot makes the strap a standard linear solid. A
strap rubs if dry friction acts in parallel with the spring; its cloth bends before it slips. Soft tissue in series is
compressed less and less by a growing torque. Tissue that is a linear spring, with or without a damper, cannot be
distinguished from a standard linear solid, which has the same response. The strap's misalignment with the joint's axis
is no property of the strap, but the other parameters are biased without it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ... import _core
from ...numerics.filters import central_difference, runs, zero_phase_lowpass

CORE_NAMES: tuple[str, ...] = tuple(_core.STRAP_PARAMETER_NAMES)
"""Names of the core's strap parameters, in its order."""

CONTACT_NAMES: tuple[str, ...] = tuple(_core.STRAP_CONTACT_NAMES)
"""Names of the core's parameters of friction in parallel and tissue in series with a strap, in its order."""


@dataclass(frozen=True)
class Coefficient:
    """A free parameter of a strap, with the scale on which the search treats it."""

    name: str
    field: str  # name of the parameter in the core
    unit: str
    start: float  # first value, at which the feature has almost no effect; a share of the stiffness if `per_stiffness`
    lower: float
    upper: float
    per_stiffness: bool = False
    searched: Literal["plain", "curvature", "logarithm"] = "plain"
    spread: float = float("inf")  # prior standard deviation around `start`, on the search's scale

    def sought(self, value: float) -> float:
        """Convert the parameter to the search's scale."""
        return float(np.log(value)) if self.searched == "logarithm" else float(value)

    def value(self, sought: float) -> float:
        """Convert a value on the search's scale to the parameter."""
        return float(np.exp(sought)) if self.searched == "logarithm" else float(sought)

    def core(self, value: float) -> float:
        """Convert the parameter to the core's parameter."""
        return value**-0.5 if self.searched == "curvature" else value

    def slope(self, value: float) -> float:
        """Return the derivative of the core's parameter with respect to the value on the search's scale."""
        if self.searched == "curvature":
            return -0.5 * value**-1.5
        return value if self.searched == "logarithm" else 1.0


STIFFNESS_COEFFICIENT = Coefficient("stiffness", "strap_stiffness", "N*m/rad", 1.0, 1e-3, 1e5)
"""The stiffness, which every strap has."""

DAMPING_COEFFICIENT = Coefficient("damping", "strap_damping", "N*m*s/rad", 1.0, 1e-4, 1e4)
"""The damping, which every strap has."""

STRAP_FEATURES: Mapping[str, tuple[Coefficient, ...]] = {
    "hardening": (Coefficient("hardening", "strap_hardening", "1/rad^2", 1.0, 1e-4, 1e4, searched="curvature"),),
    "slack": (Coefficient("slack", "strap_slack", "rad", 1e-3, 1e-6, 0.5),),
    "relaxing": (
        Coefficient("relaxing_stiffness", "strap_relaxing_stiffness", "N*m/rad", 0.1, 1e-4, 1e5, per_stiffness=True),
        Coefficient("relaxation_time", "strap_relaxation_time", "s", 0.4, 0.02, 10.0, searched="logarithm", spread=1.2),
    ),
    "askew": (
        Coefficient("along", "strap_along", "1", 0.0, -0.5, 0.5, spread=0.15),
        Coefficient("across", "strap_across", "1", 0.0, -0.5, 0.5, spread=0.15),
    ),
    "friction": (
        Coefficient("friction", "strap_friction", "N*m", 0.02, 1e-5, 50.0),
        Coefficient("friction_way", "strap_friction_way", "rad", 5e-3, 1e-4, 0.1, searched="logarithm", spread=1.2),
    ),
    "tissue": (
        Coefficient("tissue_depth", "strap_tissue_depth", "rad", 2e-3, 1e-6, 0.5),
        Coefficient("tissue_torque", "strap_tissue_torque", "N*m", 0.5, 0.01, 50.0, searched="logarithm", spread=1.2),
    ),
}
"""The features that a strap may have, each with the parameters that it frees."""

FEATURE_WORDS: Mapping[str, str] = {
    "hardening": "hardens",
    "slack": "has slack",
    "relaxing": "relaxes (a standard linear solid)",
    "askew": "sits askew of the joint's axis",
    "friction": "rubs (dry friction in parallel with the spring)",
    "tissue": "pulls through soft tissue in series",
}
"""Each feature as the verb phrase of a sentence whose subject is the strap."""

PLAIN_NAME = "kelvin_voigt"
"""Name of the model without any feature, in ids and on cards."""


@dataclass(frozen=True)
class StrapModel:
    """A spring and a damper with additional features, in the order of `STRAP_FEATURES`."""

    features: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the model in ids and on cards."""
        return "_".join(self.features) or PLAIN_NAME

    @classmethod
    def named(cls, name: str) -> StrapModel:
        """Return the model with this name."""
        return cls(() if name == PLAIN_NAME else tuple(name.split("_")))

    @property
    def words(self) -> str:
        """The model as a clause of a sentence."""
        does = [FEATURE_WORDS[f] for f in self.features]
        if not does:
            return "a spring and a damper describe it"
        return f"it {' and '.join(filter(None, [', '.join(does[:-1]), does[-1]]))}"

    @property
    def coefficients(self) -> tuple[Coefficient, ...]:
        """The free parameters: stiffness, damping, then those of the features."""
        return (STIFFNESS_COEFFICIENT, DAMPING_COEFFICIENT, *(c for f in self.features for c in STRAP_FEATURES[f]))

    def has(self, feature: str) -> bool:
        """Return whether the model has a feature."""
        return feature in self.features

    def without(self, feature: str) -> StrapModel:
        """Return the model without one of its features."""
        return StrapModel(tuple(f for f in self.features if f != feature))

    @property
    def in_core(self) -> bool:
        """Whether `core` is the whole model: neither friction nor tissue is among its parameters."""
        return not any(c.field in CONTACT_NAMES for c in self.coefficients)

    def core(self, values: Mapping[str, float]) -> np.ndarray:
        """Return the core's parameters, shape (p,), from values by coefficient; parameters that are not free are 0."""
        return self._values_of(CORE_NAMES, values)

    def contact(self, values: Mapping[str, float]) -> np.ndarray:
        """Return the core's parameters of friction and tissue, shape (4,); parameters that are not free are 0."""
        return self._values_of(CONTACT_NAMES, values)

    def _values_of(self, names: Sequence[str], values: Mapping[str, float]) -> np.ndarray:
        made = {c.field: c.core(values[c.name]) for c in self.coefficients}
        return np.array([made.get(name, 0.0) for name in names])


FULL_MODEL = StrapModel(tuple(STRAP_FEATURES))
"""The model with all features."""

KELVIN_VOIGT = StrapModel()
"""The model without any feature: a spring and a damper in parallel."""


DERIVATIVE_LOWPASS_HZ = 15.0
"""Cut-off of the zero-phase low-pass before differentiation, on every term [Hz]. A swing has almost no power above 6
Hz."""

DERIVATIVE_LOWPASS_ORDER = 2
"""Order of one pass of that filter."""

MIN_FRICTION_SPEED = 0.05
"""Below this speed the joint may stick, so the sign of dry friction is unknown [rad/s]."""

MIN_FRICTION_SHARE = 0.02
"""Slow samples are excluded only if dry friction exceeds this share of the strap's torque (RMS)."""


@dataclass(frozen=True, eq=False)
class StrappedSwing:
    """One trial in which a wearer swings the lower leg, recorded or simulated."""

    name: str
    split: str  # ``"fitted"`` or ``"heldout"``
    # (n,) the actuator's evenly sampled times [s], the orthosis's angle [rad], and the spring's torque on it [N m]
    time: np.ndarray
    position: np.ndarray
    torque: np.ndarray
    imu_time: np.ndarray  # (m,) times of the IMU, on its own clock [s]
    imu_angle: np.ndarray  # (m,) limb angle by the IMU [rad]
    knee_torque: np.ndarray | None = None  # (n,) muscles' torque, from EMG, at the actuator's times [N m]

    @property
    def fs(self) -> float:
        """Sampling rate of the actuator [Hz]."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])


@dataclass(frozen=True, eq=False)
class Orthosis:
    """Parameters of the orthosis without a wearer."""

    inertia: float  # [kg m^2]
    viscous: float  # viscous friction [N m s/rad]
    gravity: float  # gravity torque at 90 degrees [N m]
    coulomb: float = 0.0  # Coulomb friction [N m]
    # (4, 4) covariance of the four parameters in this order, SI; zeros where it is unknown
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((4, 4)), repr=False)
    zero: float = 0.0  # angle at which the orthosis hangs [rad]
    offset: float = 0.0  # reading of the spring without load [N m]


@dataclass(frozen=True, eq=False)
class Limb:
    """Parameters of shank and foot."""

    inertia: float  # inertia about the knee [kg m^2]
    gravity: float  # gravity torque at 90 degrees [N m]
    viscous: float = 0.0  # viscous damping of the knee [N m s/rad]
    # (3, 3) covariance of the three parameters in this order, SI
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)), repr=False)
    zero: float = 0.0  # angle at which the limb hangs [rad]


@dataclass(frozen=True, eq=False)
class StrapTorque:
    """The strap's torque in one trial, with its uncertainty."""

    torque: np.ndarray  # (n,) torque on the orthosis, at the actuator's times [N m]
    sensitivity: np.ndarray  # (n, p) derivatives of the torque with respect to the body's parameters
    covariance: np.ndarray  # (p, p) covariance of the body's parameters
    known: np.ndarray  # (n,) False where the joint may stick, so that dry friction is unknown up to its level


def derivative_lowpass(samples: np.ndarray, fs: float) -> np.ndarray:
    """Return samples, (n,) or (n, k), through the low-pass that every term of a balance passes."""
    return zero_phase_lowpass(samples, DERIVATIVE_LOWPASS_HZ, DERIVATIVE_LOWPASS_ORDER, fs)


def from_orthosis(swing: StrappedSwing, orthosis: Orthosis) -> StrapTorque:
    """Return the strap's torque from the balance of the orthosis."""
    fs = swing.fs
    raw_velocity = central_difference(derivative_lowpass(swing.position, fs), fs)
    moving = np.abs(raw_velocity) > MIN_FRICTION_SPEED
    dry = _direction(raw_velocity, moving)
    angle, torque, dry = derivative_lowpass(np.column_stack([swing.position, swing.torque, dry]), fs).T
    velocity = central_difference(angle, fs)
    columns = np.column_stack([central_difference(velocity, fs), velocity, np.sin(angle - orthosis.zero), dry])
    values = np.array([orthosis.inertia, orthosis.viscous, orthosis.gravity, orthosis.coulomb])
    strap = columns @ values - (torque - orthosis.offset)
    matters = orthosis.coulomb > MIN_FRICTION_SHARE * float(np.std(strap))
    return StrapTorque(strap, columns, orthosis.covariance, moving if matters else np.ones(len(angle), bool))


def from_limb(swing: StrappedSwing, limb: Limb, limb_angle: np.ndarray) -> StrapTorque:
    """Return the strap's torque from the balance of the limb; `limb_angle`, shape (n,) [rad]."""
    if swing.knee_torque is None:
        raise ValueError(f"{swing.name}: found no knee torque, expected the muscles' for the limb's balance")
    fs = swing.fs
    angle, torque = derivative_lowpass(np.column_stack([limb_angle, swing.knee_torque]), fs).T
    velocity = central_difference(angle, fs)
    columns = -np.column_stack([central_difference(velocity, fs), np.sin(angle - limb.zero), velocity])
    values = np.array([limb.inertia, limb.gravity, limb.viscous])
    return StrapTorque(torque + columns @ values, columns, limb.covariance, np.ones(len(angle), bool))


def _direction(velocity: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """Return the sign of the motion, interpolated linearly through reversals, where friction changes its side."""
    sign = np.sign(velocity)
    if not moving.any():
        return np.zeros_like(sign)
    at = np.arange(len(sign), dtype=float)
    filled = sign.copy()
    for run in runs(~moving):
        filled[run] = np.interp(at[run], at[moving], sign[moving])
    return filled


@dataclass(frozen=True)
class SlipThresholds:
    """Thresholds for the slip of a strap."""

    min_slip_rad: float = np.radians(1.5)  # steps smaller than this are ignored [rad]
    # A step must exceed this many standard errors. By chance the largest of hundreds of candidates reaches about 3.5.
    min_slip_standard_errors: float = 6.0
    # The noise of the residual is estimated from the means of blocks of this length, longer than one swing [s].
    block_length_s: float = 2.5
    # A step is not searched for in this many blocks at either end of a trial, where it cannot be told from noise.
    excluded_end_blocks: int = 2


SLIP_THRESHOLDS = SlipThresholds()


CLOCK_CORRECTIONS_S = np.arange(-0.15, 0.16, 0.025)
"""Corrections of the IMU's clock that are tried, because the clock was found from two different angles [s]."""


@dataclass(frozen=True)
class Slip:
    """A step in the mismatch between limb and orthosis."""

    recording: str  # name of the trial
    time: float  # time of the slip [s]
    step: float  # angle by which the limb turned in the orthosis [rad]


def regression_residual(swing: StrappedSwing, torque: StrapTorque, shift: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the residual of a linear regression of the IMU's angle on motion and strap torque.

    The regression has no memory, so it cannot follow a step, as a strap with much damping and little stiffness could.
    `shift` is the clocks' difference [s]. Returns times and residuals, each of shape (m,) [s], [rad].
    """
    rate = central_difference(torque.torque, swing.fs)
    speed, jerk = central_difference(swing.position, swing.fs), central_difference(rate, swing.fs)
    series = np.column_stack([swing.position, speed, torque.torque, rate, jerk])
    # The clock was found from two angles that differ, so corrections are tried and the best one is used.
    tried = [_residual_at_shift(swing, series, shift + late) for late in CLOCK_CORRECTIONS_S]
    return min(tried, key=lambda pair: float(np.mean(pair[1] ** 2)))


def _residual_at_shift(swing: StrappedSwing, series: np.ndarray, shift: float) -> tuple[np.ndarray, np.ndarray]:
    time = swing.imu_time + shift
    known = np.isfinite(swing.imu_angle) & (time >= swing.time[0]) & (time <= swing.time[-1])
    columns = np.column_stack([np.interp(time[known], swing.time, s) for s in series.T])
    columns = np.column_stack([np.ones(len(columns)), columns / np.maximum(columns.std(axis=0), 1e-12)])
    angle = swing.imu_angle[known]
    return time[known], angle - columns @ np.linalg.lstsq(columns, angle, rcond=None)[0]


def find_slip(recording: str, time: np.ndarray, residual: np.ndarray) -> Slip | None:
    """Return the largest step of a residual, or None if it is not significant. Shapes (m,) [s], [rad]."""
    known = np.isfinite(residual) & np.isfinite(time)
    t, r = time[known], residual[known]
    n = len(r)
    each = max(1, round(SLIP_THRESHOLDS.block_length_s * (n - 1) / max(float(t[-1] - t[0]), 1e-9)))
    first, last = SLIP_THRESHOLDS.excluded_end_blocks * each, n - SLIP_THRESHOLDS.excluded_end_blocks * each
    if last - first < each:
        return None
    before = np.cumsum(r)[first:last]
    count = np.arange(first + 1, last + 1)
    step = (r.sum() - before) / (n - count) - before / count
    # All candidates have the same noise, so the best one explains the largest sum of squares.
    at = int(np.argmax(step**2 * count * (n - count) / n))
    after = np.arange(n) >= count[at]
    rest = r - np.where(after, r[after].mean(), r[~after].mean())
    # The blocks are longer than a swing and than the sway of a thigh, so their means are nearly independent.
    sides = (rest[~after], rest[after])
    blocks = np.array([b.mean() for side in sides for b in np.array_split(side, len(side) // each)])
    spread = np.sqrt(np.sum(blocks**2) / (len(blocks) - 2))
    share = len(blocks) / n
    error = spread * np.sqrt(1.0 / (share * count[at]) + 1.0 / (share * (n - count[at])))
    if abs(step[at]) < max(SLIP_THRESHOLDS.min_slip_rad, SLIP_THRESHOLDS.min_slip_standard_errors * error):
        return None
    return Slip(recording, float(t[count[at]]), float(step[at]))
