"""Which estimator's values are the headline: the one that does best, on what was held out, what they are wanted for.

They are wanted to predict torque (the effort of a recorded motion) or to simulate (the motion of a recorded command).
What they are for is judged first: of those that are not significantly worse than the best, the plainest is taken, which
is least squares where it is among them. Only where another of these does far better at the other purpose, that one is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...signals.motion import Motion
from ..block_test import Contest, contest
from .evaluation import Prediction
from .joint_estimate import JointEstimate
from .replay import Machine, Simulation, simulation_of

METHODS = ("ls", "wls", "irls", "iv", "didim", "output_error")
"""Plainest first."""

DECISIVE = 1.5  # times the smallest error, from where the purpose that was not asked for decides too


@dataclass(frozen=True)
class EstimatorChoice:
    """The `method` chosen for a `purpose`, with how all did in `torque` [the effort's unit] and `simulation` [rad or
    m]; None where nothing is held out, or nothing can be simulated."""

    method: str = "ls"
    purpose: str = "torque"
    torque: Contest | None = None
    simulation: Contest | None = None
    predictions: tuple[Prediction, ...] = ()  # By the chosen one, of every recording


Residuals = Mapping[str, Sequence[np.ndarray]]  # Of each method on each held-out recording, (n_i,)


def chosen_method(first: Residuals, second: Residuals) -> str:
    """The plainest method that is not significantly worse than the best by `first`, unless one of these does far better
    by `second`."""
    found = contest(first)
    left = [name for name in METHODS if name in first and not found.worse(name)]
    other = contest({name: second[name] for name in left if name in second} or {left[0]: first[left[0]]})
    plain = left[0]
    decided = plain in other.errors and other.worse(plain)
    if decided and other.errors[plain] > DECISIVE * other.errors[other.winner]:
        return other.first([name for name in left if name in other.errors])
    return plain


def estimator_choice(
    purpose: str,
    predictions: Mapping[str, Sequence[Prediction]],
    estimates: Mapping[str, JointEstimate],
    simulations: Mapping[str, Sequence[Simulation]],
    motions: Sequence[Motion],
    machine: Machine,
) -> EstimatorChoice:
    """The choice for a `purpose` among `estimates` of one family, "ls" among them, by their `predictions` of all
    `motions`, and by simulations of the held-out ones on a `machine`, taken from `simulations` where they are there."""
    torque = {name: [p.residual for p in made if p.split == "heldout"] for name, made in predictions.items()}
    torque = {name: residuals for name, residuals in torque.items() if residuals}
    if not torque:
        return EstimatorChoice(purpose=purpose, predictions=tuple(predictions["ls"]))
    held = [m for m in motions if m.split == "heldout"]
    simulated = {n: _position_errors(e, simulations.get(n, ()), held, machine) for n, e in estimates.items()}
    simulated = {name: errors for name, errors in simulated.items() if errors is not None}
    orders = {"torque": (torque, simulated), "simulation": (simulated or torque, torque)}
    method = chosen_method(*orders[purpose])
    return EstimatorChoice(
        method=method,
        purpose=purpose,
        torque=contest(torque),
        simulation=contest(simulated) if simulated else None,
        predictions=tuple(predictions[method]),
    )


def _position_errors(
    estimate: JointEstimate, made: Sequence[Simulation], held: Sequence[Motion], machine: Machine
) -> list[np.ndarray] | None:
    """Measured less simulated position, (n_i,), of every held-out recording from its command; None where one diverges
    or strays farther than the joint ever moved."""
    ready = [s for s in made if s.split == "heldout" and s.mode == "openloop"]
    try:
        runs = ready or [simulation_of(estimate.model, estimate.array, m, machine, closed=False) for m in held]
    except IdentificationError:
        return None
    if len(runs) < len(held):
        return None
    off = [s.measured["position"] - s.simulated["position"] for s in runs]
    spread = np.concatenate([s.measured["position"] - s.measured["position"].mean() for s in runs])
    return off if float(np.linalg.norm(np.concatenate(off))) < float(np.linalg.norm(spread)) else None
