"""Measure the coverage of nominal intervals: identify a virtual joint whose plant equals the model many times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pellucid.joint.fit.friction_solver import solve_family
from pellucid.models.joint import joint_model
from pellucid.numerics.motion import Filtering, motion_of
from pellucid.numerics.protocols.excitation import multisine
from pellucid.numerics.regression import Stack, stack
from pellucid.numerics.uncertainty import sandwich_covariance

from ..bench.rig import BenchRig, matched

PER_MOTION = 25
"""Number of repetitions with new noise before a new motion is drawn. A single motion may give too wide or too narrow
intervals."""

# The dead band is a tenth of the top speed [rad/s], so that the effects of sticking are small beside the noise.
REGRESSION_FILTERING = Filtering(60.0, decimate=20, dead_band=0.2, trim=100)

NORMAL_QUANTILE = 1.959964
"""97.5 % quantile of the normal distribution, for intervals of 95 %."""

COLOURED_MEMORY = 0.05
"""Correlation time of coloured noise [s]. It is longer than a regression's sample, so that textbook intervals fail."""


@dataclass(frozen=True)
class RicherPlants:
    """Coverage of intervals when the plant contains effects that the model lacks."""

    identifications: int  # number of identifications
    held: float  # lowest coverage of three quantities by the complete intervals [%]
    statistical: float  # the same for intervals that take only coloured residuals into account [%]


RICHER_PLANTS = RicherPlants(240, 97.0, 16.7)
"""Coverage that `python -m research.evidence coverage` measured, which takes minutes."""


@dataclass(frozen=True)
class Coverage:
    """Coverage of the intervals of all parameters."""

    colour: str  # "white" or "coloured" residuals
    repetitions: int  # number of identifications
    by_parameter: dict[str, float]  # share of the identifications in which each interval contained the truth [%]
    textbook: float  # lowest coverage of textbook intervals, which assume white residuals [%]

    @property
    def lowest(self) -> float:
        """Lowest coverage of all parameters [%]."""
        return min(self.by_parameter.values())


def coverage(joint: BenchRig, colour: str, *, repetitions: int = 200, seed: int = 2) -> Coverage:
    """Identify a matched virtual joint repeatedly, with new noise each time and a new motion after `PER_MOTION`
    times."""
    rng = np.random.default_rng(seed)
    memory = 0.0 if colour == "white" else COLOURED_MEMORY
    plant = matched(joint).changed({"drive.current_noise_memory": memory})
    span = plant["motion_range"]
    half, centre = 0.5 * (span["high"] - span["low"]), 0.5 * (span["high"] + span["low"])
    model = joint_model("symmetric", motion="rotary", effort_unit="N*m", gravity="sine")
    truth = np.array([plant["joint"][s.targets[0]] for s in model.symbols])
    inside, textbook = [], []
    for start in range(0, repetitions, PER_MOTION):
        reference = multisine(
            plant.duration, plant.rate, fundamental=0.1, harmonics=12, amplitude=half, centre=centre, rng=rng
        )
        played = plant.play(reference, min(PER_MOTION, repetitions - start), rng)
        for position, current in zip(played["position"], played["current"], strict=True):
            data = _stacked(plant, played["time"], position, current)
            found = solve_family(model, data)
            w, rho = found.jacobian, found.residual
            error = np.abs(found.values - truth)
            plain = np.linalg.inv(w.T @ w) * np.sum(rho**2) / (len(rho) - len(truth))
            inside.append(error <= NORMAL_QUANTILE * np.sqrt(np.diag(sandwich_covariance(w, rho, data.lengths))))
            textbook.append(error <= NORMAL_QUANTILE * np.sqrt(np.diag(plain)))
    share = dict(zip(model.names, (100.0 * np.mean(inside, axis=0)).tolist(), strict=True))
    return Coverage(colour, repetitions, share, float(100.0 * np.mean(textbook, axis=0).min()))


def _stacked(plant: BenchRig, time: np.ndarray, raw: np.ndarray, current: np.ndarray) -> Stack:
    return stack([motion_of(time, raw, current, REGRESSION_FILTERING, gain=plant.gain, fs=plant.rate)])
