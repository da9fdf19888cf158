"""How often nominal intervals hold the truth: a virtual joint whose plant equals the model, identified many times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..fit.joint.friction_solver import solve_family
from ..fit.regression import Stack, stack
from ..fit.uncertainty import sandwich_covariance
from ..lab.bench.rig import BenchRig, matched
from ..models.joint import joint_model
from ..protocols.excitation import multisine
from ..signals.motion import Filtering, motion_of

PER_MOTION = 25  # repetitions with new noise before a new motion: a motion of its own can flatter or spoil intervals
# A dead band of a tenth of the top speed [rad/s]: what sticking leaves behind is small beside the noise.
FILTERING = Filtering(60.0, decimate=20, dead_band=0.2, trim=100)
QUANTILE = 1.959964
COLOURED_MEMORY = 0.05  # s: longer than a regression's sample, so that textbook intervals fail


@dataclass(frozen=True)
class RicherPlants:
    """How often intervals hold the worst of three quantities of plants richer than the model [%]: whole, and for
    coloured residuals alone."""

    identifications: int
    held: float
    statistical: float


RICHER = RicherPlants(240, 97.0, 16.7)
"""As `python -m evidence coverage` measured it, which takes minutes."""


@dataclass(frozen=True)
class Coverage:
    """Share of `repetitions` [%] in which each parameter's interval held the truth; `lowest` over the parameters, and
    `textbook` the lowest of intervals that take residuals for white."""

    colour: str
    repetitions: int
    by_parameter: dict[str, float]
    textbook: float

    @property
    def lowest(self) -> float:
        """The worst parameter's coverage [%]."""
        return min(self.by_parameter.values())


def coverage(joint: BenchRig, colour: str, *, repetitions: int = 200, seed: int = 2) -> Coverage:
    """Identify a matched virtual joint again and again, with new noise each time and a new motion now and then."""
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
        taken = plant.play(reference, min(PER_MOTION, repetitions - start), rng)
        for position, current in zip(taken["position"], taken["current"], strict=True):
            data = _stacked(plant, taken["time"], position, current)
            found = solve_family(model, data)
            w, rho = found.jacobian, found.residual
            error = np.abs(found.values - truth)
            plain = np.linalg.inv(w.T @ w) * np.sum(rho**2) / (len(rho) - len(truth))
            inside.append(error <= QUANTILE * np.sqrt(np.diag(sandwich_covariance(w, rho, data.lengths))))
            textbook.append(error <= QUANTILE * np.sqrt(np.diag(plain)))
    share = dict(zip(model.names, (100.0 * np.mean(inside, axis=0)).tolist(), strict=True))
    return Coverage(colour, repetitions, share, float(100.0 * np.mean(textbook, axis=0).min()))


def _stacked(plant: BenchRig, time: np.ndarray, raw: np.ndarray, current: np.ndarray) -> Stack:
    return stack([motion_of(time, raw, current, FILTERING, gain=plant.gain, fs=plant.rate)])
