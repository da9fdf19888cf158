r"""What a model of a joint leaves, learnt from recordings as rules over angle and speed: fuzzy, or those of a network.

Triangles :math:`A_i(q)` and :math:`B_j(v)` that sum to one make a Takagi-Sugeno system of order zero [1]_,

.. math::
   r(q, v) = \sum_{ij} w_{ij} A_i(q) B_j(v),

as `include/pellucid/rule_compensation.hpp` computes it. The fuzzy system's :math:`w` are a ridge regression's; a
network is trained on the same samples and carried by its values at the places of the rules. How stiff either is, and
whether it is any better than nothing, is chosen by leaving out recordings, and judged by leaving out others around it.

.. [1] T. Takagi, M. Sugeno, "Fuzzy identification of systems and its applications to modeling and control", IEEE
   Transactions on Systems, Man, and Cybernetics 15(1), 1985.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .._errors import PellucidError
from .neural_network import NeuralNetwork

ANGLES, SPEEDS = 5, 7
"""Rules over angle and over speed, as the core has them."""

SPEED = 0.3
"""w: half of either direction's rules lie below it [rad/s]."""

FOLDS = 3
"""Groups of recordings, each of which is left out once."""

STIFFNESS = {"fuzzy": (1e-3, 1e-2, 1e-1, 1.0), "network": (0.1, 1.0, 10.0)}
"""From which either is chosen: of the ridge as a share of the samples, and of the network's weight decay [1]."""

Kind = Literal["fuzzy", "network"]


@dataclass(frozen=True, eq=False)
class Residual:
    """What a model leaves in one recording."""

    position: np.ndarray  # position, velocity, torque: (n,) [rad], [rad/s], [N m]
    velocity: np.ndarray
    torque: np.ndarray


@dataclass(frozen=True, eq=False)
class LearntRules:
    """Rules, and how much of what a model leaves they tell in recordings that had no part in them."""

    kind: Kind
    low: float  # low, high: Where the rules' angles begin and end [rad]
    high: float
    torque: np.ndarray  # (ANGLES, SPEEDS) [N m]
    stiffness: float  # As chosen; infinite where no rule was better than none
    left: float  # RMS of what rules leave of recordings left out of everything [N m] ...
    before: float  # ... and of what was there without them

    def predict(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """What the rules say at angles [rad] and velocities [rad/s], shape (n,) each; gives (n,) [N m]."""
        return memberships(position, velocity, self.low, self.high) @ self.torque.ravel()

    def numbers(self, share: float = 1.0) -> dict[str, float]:
        """The core's numbers by name, SI, with a `share` of every torque."""
        table = {f"rule_{i}_{j}": share * float(t) for (i, j), t in np.ndenumerate(self.torque)}
        return {"rule_low": self.low, "rule_high": self.high, "rule_speed": SPEED, **table}


Fit = Callable[[Sequence[Residual], float], np.ndarray]
Missed = Callable[[np.ndarray, Residual], np.ndarray]


def learn_rules(recordings: Sequence[Residual], kind: Kind) -> LearntRules:
    """Rules of what a model leaves in several recordings, chosen by cross-validation and judged by a second one around
    it."""
    if len(recordings) < FOLDS + 1:
        raise PellucidError(f"rules: found {len(recordings)} recordings, expected {FOLDS + 1} or more to learn from")
    whole = np.concatenate([one.position for one in recordings])
    low, high = float(whole.min()), float(whole.max())
    if not high > low:
        raise PellucidError(f"rules: every angle is {low:g} rad, expected a motion")
    make = _fuzzy if kind == "fuzzy" else _network

    def fit(used: Sequence[Residual], stiffness: float) -> np.ndarray:
        if np.isinf(stiffness):
            return np.zeros((ANGLES, SPEEDS))
        q, v, r = (np.concatenate([getattr(one, x) for one in used]) for x in ("position", "velocity", "torque"))
        return make(q, v, r, low, high, stiffness)

    def missed(torque: np.ndarray, judged: Residual) -> np.ndarray:
        return judged.torque - memberships(judged.position, judged.velocity, low, high) @ torque.ravel()

    left = []
    for others, judged in _folds(recordings):
        torque = fit(others, _chosen(others, STIFFNESS[kind], fit, missed))
        left += [missed(torque, one) for one in judged]
    chosen = _chosen(recordings, STIFFNESS[kind], fit, missed)
    before = np.concatenate([one.torque for one in recordings])
    return LearntRules(kind, low, high, fit(recordings, chosen), chosen, _rms(np.concatenate(left)), _rms(before))


def memberships(position: np.ndarray, velocity: np.ndarray, low: float, high: float) -> np.ndarray:
    """How far each rule holds at angles [rad] and velocities [rad/s], shape (n,) each, between two angles [rad]; rows
    sum to one. Gives (n, ANGLES * SPEEDS)."""
    along = np.clip((np.asarray(position) - low) / (high - low), 0.0, 1.0) * (ANGLES - 1)
    fast = 0.5 * (SPEEDS - 1) * (1.0 + bent(velocity))
    a, b = (np.maximum(1.0 - np.abs(x[:, None] - np.arange(n)), 0.0) for x, n in ((along, ANGLES), (fast, SPEEDS)))
    return (a[:, :, None] * b[:, None, :]).reshape(len(along), -1)


def bent(velocity: np.ndarray) -> np.ndarray:
    """v / (|v| + w): evenly spaced rules lie close where friction turns. Shape (n,) [rad/s]; gives (n,) [1]."""
    v = np.asarray(velocity, float)
    return v / (np.abs(v) + SPEED)


def _fuzzy(q: np.ndarray, v: np.ndarray, r: np.ndarray, low: float, high: float, stiffness: float) -> np.ndarray:
    phi = memberships(q, v, low, high)
    ridge = stiffness * len(r) / (ANGLES * SPEEDS) * np.eye(ANGLES * SPEEDS)
    return np.linalg.solve(phi.T @ phi + ridge, phi.T @ r).reshape(ANGLES, SPEEDS)


def _network(q: np.ndarray, v: np.ndarray, r: np.ndarray, low: float, high: float, stiffness: float) -> np.ndarray:
    def features(angle: np.ndarray, speed: np.ndarray) -> np.ndarray:
        return np.column_stack([(angle - low) / (high - low), speed])

    # A thousand samples tell as much as all of them, neighbours being alike.
    every = max(len(r) // 1000, 1)
    trained = NeuralNetwork(penalty=stiffness).fit(features(q, bent(v))[::every], r[::every])
    angle, speed = np.meshgrid(np.linspace(low, high, ANGLES), np.linspace(-1.0, 1.0, SPEEDS), indexing="ij")
    said = trained.predict(features(angle.ravel(), speed.ravel()))
    # Where nobody was, a network may say anything.
    return np.clip(said, r.min(), r.max()).reshape(ANGLES, SPEEDS)


def _chosen(recordings: Sequence[Residual], stiffnesses: Sequence[float], fit: Fit, missed: Missed) -> float:
    """The stiffness with the smallest error of recordings left out one by one; infinite where none beats nothing."""

    def error(stiffness: float) -> float:
        off = []
        for others, judged in _folds(recordings):
            torque = fit(others, stiffness)
            off += [missed(torque, one) for one in judged]
        return _rms(np.concatenate(off))

    return min((*stiffnesses, float("inf")), key=error)


def _folds(recordings: Sequence[Residual]) -> list[tuple[list[Residual], list[Residual]]]:
    return [
        ([one for i, one in enumerate(recordings) if i % FOLDS != fold], list(recordings[fold::FOLDS]))
        for fold in range(FOLDS)
    ]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
