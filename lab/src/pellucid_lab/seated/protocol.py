"""What the virtual shank exoskeleton and those who sit in it are asked to do: the paper's three steps, and an MVC."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pellucid.models.anthropometry import shank_length, winter

from ..fourier import FourierSeries, play
from ..rig import Trial
from .machine import SeatedMachine
from .subject import SeatedSubject, subjects
from .swing_design import optimise_swing, two_sines
from .wearer import swing_path

EASE_IN_S = 2.0
"""Time in which a swing that the motor makes begins and ends [s]."""


@dataclass(frozen=True)
class SeatedTrial(Trial):
    """One trial. `name`, `protocol`, `use`, `participant`, `condition`, `reference` [rad]."""

    # The motor swings; the subject swings and the motor gives nothing; or the shank is clamped
    task: Literal["driven", "swinging", "maximal"] = "driven"
    subject: SeatedSubject | None = None  # Nobody: the exoskeleton alone

    def __post_init__(self):
        if self.subject is not None:
            object.__setattr__(self, "participant", self.subject.name)


def rich_swing(rig: SeatedMachine) -> FourierSeries:
    """A swing that shows inertia better than the paper's, designed for a mean leg before anybody is measured."""
    loaded, people = rig.constants.loaded, rig.constants.subjects.values()
    weight, height = (float(np.mean(values)) for values in zip(*((p.weight, p.height) for p in people), strict=True))
    leg = winter(weight, shank_length(height))
    part = rig.constants.exoskeleton
    return optimise_swing(
        leg.inertia + rig.exoskeleton_inertia,
        leg.mass * leg.centre + part.mass * part.centre[0],
        reach=loaded.reach,
        peak_torque=loaded.peak_torque,
        rng=np.random.default_rng(loaded.excitation_seed),
        friction=True,
    )


def seated_trials(rig: SeatedMachine, names: tuple[str, ...] | None = None) -> list[SeatedTrial]:
    """Everything that is recorded, in the order of a session; of the subjects of these `names`, or of all."""
    loaded, fs = rig.constants.loaded, rig.constants.instruments.rate
    swings = {
        "two_sines": _driven(two_sines(loaded.amplitude), loaded.duration, fs),
        "rich": _driven(rich_swing(rig), loaded.duration, fs),
    }
    people = {name: s for name, s in subjects(rig).items() if names is None or name in names}
    made = [SeatedTrial(f"empty_{key}", "empty_swing", reference=q) for key, q in swings.items()]
    for name, subject in people.items():

        def add(what: str, protocol: str, reference: np.ndarray, task: str, use: str = "fit", subject=subject) -> None:
            made.append(SeatedTrial(f"{subject.name}_{what}", protocol, use, None, None, reference, task, subject))

        for key, q in swings.items():
            add(key, "loaded_swing", q, "driven")
        add("mvc", "mvc", np.full(round(rig.constants.mvc.duration * fs), rig.constants.mvc.angle), "maximal")
        for i, (use, duration) in enumerate(zip(("fit", "validate"), rig.constants.swing.duration, strict=True), 1):
            # What a subject means to do is theirs, not a seed's: it is the same in every session.
            rng = np.random.default_rng([rig.constants.difference.seed, i, *name.encode()])
            path = swing_path(rig, subject, round(duration * fs), rng)
            add(f"swing_{i}", "seated_swing", path, "swinging", use)
    return made


def _driven(series: FourierSeries, duration: float, fs: float) -> np.ndarray:
    *_, velocity, acceleration = series.peaks()
    return play(series, duration, fs, EASE_IN_S, velocity=2.0 * velocity, acceleration=4.0 * acceleration)
