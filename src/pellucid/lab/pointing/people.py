"""Virtual people who point with the forearm: who they are, what their arms are, how they move."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from ... import _core
from ...models.anthropometry import ELBOW_TO_WRIST, Segment, forearm

if TYPE_CHECKING:
    from .rig import PointingRig


PERSONAL_TABLES = ("impedance", "muscles", "cocontraction", "vision")
"""Tables whose numbers differ between people where one beside says by how much: ``NAME_spread``, the standard deviation
of the logarithm. So may those of a table with the name of the model, of what it takes besides."""


@dataclass(frozen=True)
class Person:
    """One virtual person."""

    name: str  # "P1", "P2",
    sex: str
    age: float  # [years]
    height: float  # height, mass: [m], [kg]
    mass: float
    reward: float  # What arriving is worth [J]: how briskly this person moves
    emg_gains: tuple[float, ...]  # RMS of every muscle at full excitation [V]
    drawn: tuple[
        tuple[str, float], ...
    ] = ()  # Numbers of the file's `PERSONAL_TABLES` tables that are this person's own, SI

    @property
    def forearm(self) -> Segment:
        """Forearm and hand about the elbow."""
        return forearm(self.mass, self.height)

    @property
    def forearm_length(self) -> float:
        """From elbow to wrist [m]."""
        return ELBOW_TO_WRIST * self.height

    def vector(self, rig: PointingRig) -> np.ndarray:
        """Return the core's parameters of this person, shape (k,), SI, in the order of `parameter_names`."""
        arm, vision, segment = rig["arm"], rig["vision"], self.forearm
        tables = {key: value for table in personal_table_names(rig) for key, value in rig.tables.get(table, {}).items()}
        values = {
            **tables,
            **dict(self.drawn),
            "inertia": segment.inertia,
            "gravity": segment.gravity(),
            "centre": 0.0,
            **{key: arm[key] for key in ("viscous", "passive_torque", "passive_angle", "passive_scale")},
            "flexion_max": arm["flexion"] * self.mass,
            "extension_max": arm["extension"] * self.mass,
            "sign_width": rig["planning"]["sign_width"],
            "period": rig.period,
        }
        values["visual_delay"] = values["delay"]
        if "tolerance_share" in vision:
            values["tolerance"] = values["tolerance_share"] * rig["pointing"]["tolerance"]
        return np.array([values[name] for name in parameter_names(rig)])

    def slider(self, rig: PointingRig) -> float:
        """Where the robot's carriage sits on this forearm [m from the axis]."""
        rail = rig.robot["slider"]
        return float(np.clip(self.forearm_length - rig["robot"]["splint"], rail["low"], rail["high"]))


def person_model(rig: PointingRig) -> str:
    """Which model of a person, of those of the core, a rig's people are."""
    return rig["people"].get("model", "reaching")


def personal_table_names(rig: PointingRig) -> tuple[str, ...]:
    """Names of the tables whose numbers may be each person's own."""
    return (*PERSONAL_TABLES, person_model(rig))


def parameter_names(rig: PointingRig) -> tuple[str, ...]:
    """What the core takes of a rig's people, in order."""
    return getattr(_core, f"{person_model(rig).upper()}_PARAMETER_NAMES")


def personal_parameter_names(model: str) -> tuple[str, ...]:
    """What the core takes of a model that a rig's file says in its `PERSONAL_TABLES` tables, in order."""
    elsewhere = {"inertia", "gravity", "centre", "viscous", "passive_torque", "passive_angle", "passive_scale",
                 "flexion_max", "extension_max", "sign_width", "period", "tolerance", "visual_delay"}  # fmt: skip
    return tuple(name for name in getattr(_core, f"{model.upper()}_PARAMETER_NAMES") if name not in elsewhere)


def draw_people(rig: PointingRig, rng: np.random.Generator, *, count: int | None = None) -> tuple[Person, ...]:
    """People whose ages, heights, masses and briskness have the means and spreads of the file.

    Each quantity takes its normal quantiles at evenly spaced levels, shuffled: a sample of six that is like the
    population, not one that chance made tall and quick.
    """
    people, choice, emg = rig["people"], rig["choice"], rig["emg"]
    n = int(count or people["count"])
    levels = ndtri((np.arange(n) + 0.5) / n)
    levels = levels / levels.std(ddof=1) if n > 1 else levels
    ages, heights, masses = (
        mean + spread * rng.permutation(levels) for mean, spread in (people[k] for k in ("age", "height", "mass"))
    )
    rewards = choice["reward"] * np.exp(choice["reward_spread"] * rng.permutation(levels))
    gains = np.array(emg["gains"]) * np.exp(emg["gain_spread"] * rng.standard_normal((n, len(emg["gains"]))))
    sexes = rng.permutation(["female", "male"] * ((n + 1) // 2))[:n]
    drawn = {
        key.removesuffix("_spread"): table[key.removesuffix("_spread")] * np.exp(spread * rng.permutation(levels))
        for table in (rig.tables.get(name, {}) for name in personal_table_names(rig))
        for key, spread in table.items()
        if key.endswith("_spread")
    }
    return tuple(
        Person(
            f"P{i + 1}",
            str(sexes[i]),
            float(ages[i]),
            float(heights[i]),
            float(masses[i]),
            float(rewards[i]),
            tuple(gains[i].tolist()),
            tuple((key, float(values[i])) for key, values in drawn.items()),
        )
        for i in range(n)
    )
