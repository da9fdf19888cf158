"""How often nominal intervals hold the truth: a virtual joint whose plant equals the model, identified many times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..identification.regression import Stack, solve, stack
from ..identification.uncertainty import sandwich
from ..lab.virtual_joint import VirtualJoint, matched, record
from ..models.joint import INDEX, joint_model
from ..protocols.excitation import multisine
from ..recordings.study_file import Processing
from ..signals.filters import zero_phase_lowpass
from ..signals.motion import Motion, differentiate

COLOURED_MEMORY = 0.05  # s: longer than a regression's sample, so that textbook intervals fail


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


def coverage(joint: VirtualJoint, colour: str, *, repetitions: int = 200, seed: int = 2) -> Coverage:
    """Identify a matched virtual joint again and again, with new noise each time.

    Parameters
    ----------
    joint : VirtualJoint
        Made to match the symmetric model first.
    colour : {"white", "coloured"}
        Of the current sensor's noise.
    repetitions, seed : int

    Returns
    -------
    Coverage
    """
    rng = np.random.default_rng(seed)
    plant = matched(joint)
    plant = type(plant)(**{**plant.__dict__, "current_noise_memory": 0.0 if colour == "white" else COLOURED_MEMORY})
    span = plant.motion_range
    half = 0.5 * (span["high"] - span["low"])
    reference = multisine(
        plant.duration,
        plant.rate,
        fundamental=0.1,
        harmonics=12,
        amplitude=half,
        centre=0.5 * (span["high"] + span["low"]),
        rng=rng,
    )
    taken = record(plant, reference, repetitions, rng)
    model = joint_model("symmetric", motion="rotary", effort_unit="N*m", gravity="sine")
    truth = np.array([plant.vector[INDEX[s.targets[0]]] for s in model.symbols])
    inside = np.zeros((repetitions, len(truth)), bool)
    textbook = np.zeros_like(inside)
    processing = Processing(lowpass="60 Hz", decimate=20, trim=100)
    dead_band = 0.1  # rad/s
    for i in range(repetitions):
        data = _stacked(plant, taken, i, processing, dead_band)
        found = solve(model, data)
        error = np.abs(found.values - truth)
        inside[i] = error <= 1.959964 * np.sqrt(np.diag(sandwich(found.jacobian, found.residual, data.lengths)))
        plain = np.linalg.inv(found.jacobian.T @ found.jacobian) * np.sum(found.residual**2) / len(found.residual)
        textbook[i] = error <= 1.959964 * np.sqrt(np.diag(plain))
    share = dict(zip(model.names, (100.0 * inside.mean(axis=0)).tolist(), strict=True))
    return Coverage(colour, repetitions, share, float(100.0 * textbook.mean(axis=0).min()))


def _stacked(plant: VirtualJoint, taken: dict, i: int, processing: Processing, dead_band: float) -> Stack:
    raw, current = taken["position"][i], taken["current"][i]
    position, velocity, acceleration = differentiate(raw, plant.rate, processing)
    effort = plant.gain * zero_phase_lowpass(current, processing.lowpass, processing.order, plant.rate)
    n = len(raw)
    return stack(
        [
            Motion(
                recording=str(i),
                split="fitted",
                fs=plant.rate,
                time=taken["time"],
                position=position,
                velocity=velocity,
                acceleration=acceleration,
                effort=effort,
                raw_position=raw,
                command=current,
                reference=None,
                injected=None,
                inner=slice(processing.trim, n - processing.trim),
                decimate=processing.decimate,
                dead_band=dead_band,
                lowpass=processing.lowpass,
                order=processing.order,
            )
        ]
    )
