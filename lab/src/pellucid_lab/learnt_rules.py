r"""Learn the torque residual of a joint's model as rules over angle and speed, by a fuzzy system or a network.

Triangles :math:`A_i(q)` and :math:`B_j(v)` that sum to one make a Takagi-Sugeno system of order zero [1]_,

.. math::
   r(q, v) = \sum_{ij} w_{ij} A_i(q) B_j(v),

as `include/pellucid/rule_compensation.hpp` computes it. The fuzzy system's :math:`w` come from a ridge regression. A
network is trained on the same samples, and its values at the centres of the rules are the :math:`w`. Cross-validation
chooses the *stiffness*, which is the ridge or the weight decay, and whether any rules are better than none. An outer
cross-validation scores this choice.

.. [1] T. Takagi, M. Sugeno, "Fuzzy identification of systems and its applications to modeling and control", IEEE
   Transactions on Systems, Man, and Cybernetics 15(1), 1985.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pellucid._errors import PellucidError
from pellucid.emg.estimators.neural_network import NeuralNetwork


@dataclass(frozen=True)
class RuleGrid:
    """Where the rules lie, and how they are learnt.

    No measurement is recorded for what is chosen by judgement.
    """

    angles: int = 5  # Number of rules over angle, the same as in the core
    speeds: int = 7  # Number of rules over speed, the same as in the core
    # Speed w below which half of the rules of either direction lie [rad/s]. Chosen by judgement.
    speed_rad_s: float = 0.3
    folds: int = 3  # Number of groups of recordings. Each is left out once in cross-validation. Chosen by judgement.


RULE_GRID = RuleGrid()


STIFFNESS_CANDIDATES = {"fuzzy": (1e-3, 1e-2, 1e-1, 1.0), "network": (0.1, 1.0, 10.0)}
"""Candidate stiffnesses: the ridge as a share of the samples, and the network's weight decay [1]."""

RuleKind = Literal["fuzzy", "network"]
"""Kind of system that finds the rules."""


@dataclass(frozen=True, eq=False)
class RecordedResidual:
    """Torque residual of a model in one recording."""

    position: np.ndarray  # Angle, shape (n,) [rad]
    velocity: np.ndarray  # Velocity, shape (n,) [rad/s]
    torque: np.ndarray  # Residual torque, shape (n,) [N m]


@dataclass(frozen=True, eq=False)
class LearntRules:
    """Rules learnt from a model's residual, with their errors on held-out recordings."""

    kind: RuleKind
    low: float  # Smallest angle of the rules [rad]
    high: float  # Largest angle of the rules [rad]
    torque: np.ndarray  # Torque of each rule, shape (angle rules, speed rules) [N m]
    stiffness: float  # Chosen stiffness; infinite if no rules were better than none
    rms_with_rules: float  # RMS of the residual with rules, in recordings of the outer cross-validation [N m]
    rms_without_rules: float  # RMS of the residual without rules [N m]

    def predict(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Predict the residual torque at angles [rad] and velocities [rad/s], all of shape (n,) [N m]."""
        return memberships(position, velocity, self.low, self.high) @ self.torque.ravel()

    def numbers(self, share: float = 1.0) -> dict[str, float]:
        """Return the core's parameters by name, in SI units, with every torque multiplied by `share`."""
        table = {f"rule_{i}_{j}": share * float(t) for (i, j), t in np.ndenumerate(self.torque)}
        return {"rule_low": self.low, "rule_high": self.high, "rule_speed": RULE_GRID.speed_rad_s, **table}


FitFunction = Callable[[Sequence[RecordedResidual], float], np.ndarray]
"""Function that fits the rules' torques to recordings, with a stiffness."""

ErrorFunction = Callable[[np.ndarray, RecordedResidual], np.ndarray]
"""Function that returns the errors of the rules' torques in a recording, shape (n,) [N m]."""


def learn_rules(recordings: Sequence[RecordedResidual], kind: RuleKind) -> LearntRules:
    """Learn rules from a model's residuals in several recordings.

    Cross-validation chooses their stiffness, and an outer cross-validation scores this choice.
    """
    if len(recordings) < RULE_GRID.folds + 1:
        raise PellucidError(
            f"rules: found {len(recordings)} recordings, expected {RULE_GRID.folds + 1} or more to learn from"
        )
    whole = np.concatenate([one.position for one in recordings])
    low, high = float(whole.min()), float(whole.max())
    if not high > low:
        raise PellucidError(f"rules: every angle is {low:g} rad, expected a motion")
    make = _fit_fuzzy_rules if kind == "fuzzy" else _fit_network_rules

    def fit(used: Sequence[RecordedResidual], stiffness: float) -> np.ndarray:
        if np.isinf(stiffness):
            return np.zeros((RULE_GRID.angles, RULE_GRID.speeds))
        q, v, r = (np.concatenate([getattr(one, x) for one in used]) for x in ("position", "velocity", "torque"))
        return make(q, v, r, low, high, stiffness)

    def missed(torque: np.ndarray, judged: RecordedResidual) -> np.ndarray:
        return judged.torque - memberships(judged.position, judged.velocity, low, high) @ torque.ravel()

    left = []
    for others, judged in _split_recordings(recordings):
        torque = fit(others, _choose_stiffness(others, STIFFNESS_CANDIDATES[kind], fit, missed))
        left += [missed(torque, one) for one in judged]
    chosen = _choose_stiffness(recordings, STIFFNESS_CANDIDATES[kind], fit, missed)
    before = np.concatenate([one.torque for one in recordings])
    return LearntRules(kind, low, high, fit(recordings, chosen), chosen, _rms(np.concatenate(left)), _rms(before))


def memberships(position: np.ndarray, velocity: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return the membership in each rule at angles [rad] and velocities [rad/s], shape (n,) each.

    `low` and `high` are the ends of the rules' angles [rad]. The result has shape (n, angle rules * speed rules); its
    rows sum to one.
    """
    along = np.clip((np.asarray(position) - low) / (high - low), 0.0, 1.0) * (RULE_GRID.angles - 1)
    fast = 0.5 * (RULE_GRID.speeds - 1) * (1.0 + compress_speed(velocity))
    a, b = (
        np.maximum(1.0 - np.abs(x[:, None] - np.arange(n)), 0.0)
        for x, n in ((along, RULE_GRID.angles), (fast, RULE_GRID.speeds))
    )
    return (a[:, :, None] * b[:, None, :]).reshape(len(along), -1)


def compress_speed(velocity: np.ndarray) -> np.ndarray:
    """Return v / (|v| + w) of velocities of shape (n,) [rad/s], same shape [1].

    Rules that are evenly spaced on this scale lie close together about zero speed, where friction changes its sign.
    """
    v = np.asarray(velocity, float)
    return v / (np.abs(v) + RULE_GRID.speed_rad_s)


def _fit_fuzzy_rules(
    q: np.ndarray, v: np.ndarray, r: np.ndarray, low: float, high: float, stiffness: float
) -> np.ndarray:
    """Return the rules' torques by ridge regression, shape (angle rules, speed rules) [N m]."""
    phi = memberships(q, v, low, high)
    ridge = stiffness * len(r) / (RULE_GRID.angles * RULE_GRID.speeds) * np.eye(RULE_GRID.angles * RULE_GRID.speeds)
    return np.linalg.solve(phi.T @ phi + ridge, phi.T @ r).reshape(RULE_GRID.angles, RULE_GRID.speeds)


def _fit_network_rules(
    q: np.ndarray, v: np.ndarray, r: np.ndarray, low: float, high: float, stiffness: float
) -> np.ndarray:
    """Return the rules' torques by a network trained on the same samples, shape (angle rules, speed rules) [N m]."""

    def features(angle: np.ndarray, speed: np.ndarray) -> np.ndarray:
        return np.column_stack([(angle - low) / (high - low), speed])

    # A thousand samples suffice, since neighbouring samples are alike.
    every = max(len(r) // 1000, 1)
    trained = NeuralNetwork(penalty=stiffness).fit(features(q, compress_speed(v))[::every], r[::every])
    angle, speed = np.meshgrid(
        np.linspace(low, high, RULE_GRID.angles), np.linspace(-1.0, 1.0, RULE_GRID.speeds), indexing="ij"
    )
    said = trained.predict(features(angle.ravel(), speed.ravel()))
    # A network extrapolates freely. Its values are limited to the residuals that were recorded.
    return np.clip(said, r.min(), r.max()).reshape(RULE_GRID.angles, RULE_GRID.speeds)


def _choose_stiffness(
    recordings: Sequence[RecordedResidual], stiffnesses: Sequence[float], fit: FitFunction, missed: ErrorFunction
) -> float:
    """Return the stiffness with the smallest error in cross-validation; infinite if no rules are better than none."""

    def error(stiffness: float) -> float:
        off = []
        for others, judged in _split_recordings(recordings):
            torque = fit(others, stiffness)
            off += [missed(torque, one) for one in judged]
        return _rms(np.concatenate(off))

    return min((*stiffnesses, float("inf")), key=error)


def _split_recordings(
    recordings: Sequence[RecordedResidual],
) -> list[tuple[list[RecordedResidual], list[RecordedResidual]]]:
    """Return pairs of fitted and left-out recordings."""
    return [
        (
            [one for i, one in enumerate(recordings) if i % RULE_GRID.folds != fold],
            list(recordings[fold :: RULE_GRID.folds]),
        )
        for fold in range(RULE_GRID.folds)
    ]


def _rms(values: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))
