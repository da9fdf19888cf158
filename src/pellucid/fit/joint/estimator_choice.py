"""Choose the estimator whose values are reported first, by its errors on held-out recordings.

The purpose is either to predict torque (the effort of a recorded motion) or to simulate (the motion of a recorded
command). Among the estimators that are not significantly worse than the best at the stated purpose, the plainest is
chosen: least squares, if it is among them. Another of these is chosen only if it does far better at the other purpose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...signals.motion import Motion
from ..block_test import HeldOutComparison, compare_held_out
from .evaluation import Prediction
from .joint_estimate import JointEstimate
from .replay import Machine, Simulation, simulate_recording

ESTIMATION_METHODS = ("ls", "wls", "irls", "iv", "didim", "output_error")
"""Estimation methods, the plainest first."""

DECISIVE_ERROR_RATIO = 1.5
"""The other purpose decides if the plainest method's error there exceeds this multiple of the smallest error. Chosen by
judgement; no measurement is recorded."""


@dataclass(frozen=True)
class EstimatorChoice:
    """The estimation method chosen for a purpose, with the comparisons behind the choice."""

    method: str = "ls"
    purpose: str = "torque"  # "torque" or "simulation"
    torque: HeldOutComparison | None = (
        None  # comparison of effort errors [the effort's unit]; None if nothing is held out
    )
    simulation: HeldOutComparison | None = None  # comparison of simulated positions [rad or m]; None if there are none
    predictions: tuple[Prediction, ...] = ()  # predictions of every recording by the chosen method


Residuals = Mapping[str, Sequence[np.ndarray]]  # residuals of each method on each held-out recording, (n_i,)


def choose_method(first: Residuals, second: Residuals) -> str:
    """Return the plainest method that is not significantly worse than the best by `first`.

    Another of these methods is returned if it does far better by `second`.
    """
    found = compare_held_out(first)
    left = [name for name in ESTIMATION_METHODS if name in first and not found.worse(name)]
    other = compare_held_out({name: second[name] for name in left if name in second} or {left[0]: first[left[0]]})
    plain = left[0]
    decided = plain in other.errors and other.worse(plain)
    if decided and other.errors[plain] > DECISIVE_ERROR_RATIO * other.errors[other.winner]:
        return other.first([name for name in left if name in other.errors])
    return plain


def choose_estimator(
    purpose: str,
    predictions: Mapping[str, Sequence[Prediction]],
    estimates: Mapping[str, JointEstimate],
    simulations: Mapping[str, Sequence[Simulation]],
    motions: Sequence[Motion],
    machine: Machine,
) -> EstimatorChoice:
    """Choose for a `purpose` among `estimates` of one family, which include "ls".

    They are judged by their `predictions` of all `motions`, and by simulations of the held-out ones on a `machine`.
    Those that exist already are taken from `simulations`.
    """
    torque = {name: [p.residual for p in made if p.split == "heldout"] for name, made in predictions.items()}
    torque = {name: residuals for name, residuals in torque.items() if residuals}
    if not torque:
        return EstimatorChoice(purpose=purpose, predictions=tuple(predictions["ls"]))
    held = [m for m in motions if m.split == "heldout"]
    tried = {n: _position_errors(e, simulations.get(n, ()), held, machine) for n, e in estimates.items()}
    simulated = {name: errors for name, errors in tried.items() if errors is not None}
    orders = {"torque": (torque, simulated), "simulation": (simulated or torque, torque)}
    method = choose_method(*orders[purpose])
    return EstimatorChoice(
        method=method,
        purpose=purpose,
        torque=compare_held_out(torque),
        simulation=compare_held_out(simulated) if simulated else None,
        predictions=tuple(predictions[method]),
    )


def _position_errors(
    estimate: JointEstimate, made: Sequence[Simulation], held: Sequence[Motion], machine: Machine
) -> list[np.ndarray] | None:
    """Return measured minus simulated position, (n_i,), of every held-out recording, simulated from its command.

    Returns None if a simulation diverges, or if the errors are at least as large as the motion itself.
    """
    ready = [s for s in made if s.split == "heldout" and s.mode == "openloop"]
    try:
        runs = ready or [simulate_recording(estimate.model, estimate.array, m, machine, closed=False) for m in held]
    except IdentificationError:
        return None
    if len(runs) < len(held):
        return None
    off = [s.measured["position"] - s.simulated["position"] for s in runs]
    spread = np.concatenate([s.measured["position"] - s.measured["position"].mean() for s in runs])
    return off if float(np.linalg.norm(np.concatenate(off))) < float(np.linalg.norm(spread)) else None
