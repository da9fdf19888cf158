"""What the virtual shank exoskeleton and those who sit in it are asked to do: the paper's three steps, and an MVC."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...fit.swing.swing_information import better_swing
from ...models.anthropometry import shank_length, winter
from ...protocols.fourier import FourierSeries, play
from ...protocols.two_sines import two_sines
from .rig import SeatedRig
from .subject import SeatedSubject, subjects
from .wearer import swing_path

EASE = 2.0
"""In which a swing that the motor makes begins and ends [s]."""


@dataclass(frozen=True)
class SeatedTrial:
    """One trial.

    Parameters
    ----------
    name, protocol : str
    use : {"fit", "validate"}
    subject : SeatedSubject or None
        Nobody: the exoskeleton alone.
    task : {"driven", "swinging", "maximal"}
        The motor swings; the subject swings and the motor gives nothing; or the shank is clamped.
    reference : ndarray, shape (n,)
        Positions: of the motor's swing, that the subject means to go through, or of the clamp [rad].
    """

    name: str
    protocol: str
    use: Literal["fit", "validate"]
    subject: SeatedSubject | None
    task: Literal["driven", "swinging", "maximal"]
    reference: np.ndarray = field(repr=False)


def rich_swing(rig: SeatedRig) -> FourierSeries:
    """A swing that shows inertia better than the paper's, designed for a mean leg before anybody is measured."""
    loaded, people = rig["loaded"], rig["subjects"].values()
    weight, height = (float(np.mean([p[key] for p in people])) for key in ("weight", "height"))
    leg = winter(weight, shank_length(height))
    part = rig["exoskeleton"]
    return better_swing(
        leg.inertia + rig.exoskeleton_inertia,
        leg.mass * leg.centre + part["mass"] * part["centre"][0],
        reach=loaded["reach"],
        peak_torque=loaded["peak_torque"],
        rng=np.random.default_rng(loaded["excitation_seed"]),
        friction=True,
    )


def seated_trials(rig: SeatedRig, names: tuple[str, ...] | None = None) -> list[SeatedTrial]:
    """Everything that is recorded, in the order of a session.

    Parameters
    ----------
    rig : SeatedRig
    names : tuple of str, optional
        Of the subjects; all if left out.

    Returns
    -------
    list of SeatedTrial
    """
    loaded, fs = rig["loaded"], rig["instruments"]["rate"]
    swings = {
        "two_sines": _driven(two_sines(loaded["amplitude"]), loaded["duration"], fs),
        "rich": _driven(rich_swing(rig), loaded["duration"], fs),
    }
    people = {name: s for name, s in subjects(rig).items() if names is None or name in names}
    made = [SeatedTrial(f"empty_{key}", "empty_swing", "fit", None, "driven", q) for key, q in swings.items()]
    for name, subject in people.items():
        made += [SeatedTrial(f"{name}_{key}", "loaded_swing", "fit", subject, "driven", q) for key, q in swings.items()]
        clamped = np.full(round(rig["mvc"]["duration"] * fs), rig["mvc"]["angle"])
        made.append(SeatedTrial(f"{name}_mvc", "mvc", "fit", subject, "maximal", clamped))
        for i, (use, duration) in enumerate(zip(("fit", "validate"), rig["swing"]["duration"], strict=True), 1):
            # What a subject means to do is theirs, not a seed's: it is the same in every session.
            rng = np.random.default_rng([rig["difference"]["seed"], i, *name.encode()])
            path = swing_path(rig, subject, round(duration * fs), rng)
            made.append(SeatedTrial(f"{name}_swing_{i}", "seated_swing", use, subject, "swinging", path))
    return made


def _driven(series: FourierSeries, duration: float, fs: float) -> np.ndarray:
    *_, velocity, acceleration = series.peaks()
    return play(series, duration, fs, EASE, velocity=2.0 * velocity, acceleration=4.0 * acceleration)
