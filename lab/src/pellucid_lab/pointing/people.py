"""Virtual people who point with the forearm: their bodies, and the parameters of their movements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from pellucid import _core
from pellucid.models.anthropometry import BODY_SHARES, Segment, forearm

if TYPE_CHECKING:
    from .plant import PointingPlant

PERSONAL_TABLES = ("impedance", "muscles", "cocontraction", "vision")
"""Tables of a rig's file whose numbers may differ between people.

A number ``NAME`` differs if the table also has ``NAME_spread``, the standard deviation of its logarithm. The same holds
for the table with the name of the model of people, which has that model's additional parameters."""


@dataclass(frozen=True)
class Person:
    """One virtual person."""

    name: str  # "P1", "P2" and so on
    sex: str  # "female" or "male"
    age: float  # [years]
    height: float  # [m]
    mass: float  # [kg]
    reward: float  # value of arriving at the target [J]; the larger it is, the faster the person moves
    emg_gains: tuple[float, ...]  # RMS of every muscle at full excitation [V]
    drawn: tuple[tuple[str, float], ...] = ()  # names and values of the person's own parameters, SI
    held: Segment | None = None  # load in the hand, about the elbow; None for none

    @property
    def forearm(self) -> Segment:
        """Return forearm and hand as one segment that rotates about the elbow."""
        return forearm(self.mass, self.height)

    @property
    def moved(self) -> Segment:
        """Return what the muscles move: forearm and hand, with the load that the hand holds."""
        return self.forearm if self.held is None else self.forearm.joined(self.held)

    @property
    def forearm_length(self) -> float:
        """Return the distance from elbow to wrist [m]."""
        return BODY_SHARES.elbow_to_wrist * self.height

    def vector(self, rig: PointingPlant) -> np.ndarray:
        """Return the core's parameters of this person, shape (k,), SI, in the order of `parameter_names`."""
        arm, vision, segment = rig["arm"], rig["vision"], self.moved
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

    def slider(self, rig: PointingPlant) -> float:
        """Return the place of the robot's carriage on this forearm, as a distance from the axis [m]."""
        rail = rig.robot["slider"]
        return float(np.clip(self.forearm_length - rig["robot"]["splint"], rail["low"], rail["high"]))


def person_model(rig: PointingPlant) -> str:
    """Return the name of the core's model of a person that a rig's people follow."""
    return rig["people"].get("model", "reaching")


def personal_table_names(rig: PointingPlant) -> tuple[str, ...]:
    """Return the names of the tables of a rig's file whose numbers may differ between people."""
    return (*PERSONAL_TABLES, person_model(rig))


def parameter_names(rig: PointingPlant) -> tuple[str, ...]:
    """Return the names of the core's parameters of a rig's people, in order."""
    return getattr(_core, f"{person_model(rig).upper()}_PARAMETER_NAMES")


def personal_parameter_names(model: str) -> tuple[str, ...]:
    """Return those parameters of a model that a rig's file gives in its `PERSONAL_TABLES`, in the core's order."""
    elsewhere = {"inertia", "gravity", "centre", "viscous", "passive_torque", "passive_angle", "passive_scale",
                 "flexion_max", "extension_max", "sign_width", "period", "tolerance", "visual_delay"}  # fmt: skip
    return tuple(name for name in getattr(_core, f"{model.upper()}_PARAMETER_NAMES") if name not in elsewhere)


def draw_people(rig: PointingPlant, rng: np.random.Generator, *, count: int | None = None) -> tuple[Person, ...]:
    """Draw people whose ages, heights, masses and rewards have the means and spreads of the file.

    Each quantity takes its normal quantiles at evenly spaced levels, in random order. A sample of six therefore
    resembles the population; independent draws could make all six tall and fast.
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
