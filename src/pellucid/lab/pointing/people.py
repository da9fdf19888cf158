"""Virtual people who point with the forearm: who they are, what their arms are, how they move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from ... import _core
from ...models.anthropometry import ELBOW_TO_WRIST, Segment, forearm
from ..elbow.rig import ElbowRig, parse_elbow_rig
from ..rig_file import Rig, checked_tables, shipped_rig

KIND = "elbow-participants"

NEEDED = {
    "robot": ("rig", "strap_stiffness", "strap_damping", "splint"),
    "people": ("count", "age", "height", "mass"),
    "arm": ("viscous", "passive_torque", "passive_angle", "passive_scale", "flexion", "extension"),
    "muscles": ("stiffness", "damping", "reflex_stiffness", "reflex_damping", "reflex_delay", "muscle_delay",
                "activation_time", "cocontraction", "noise_share", "noise_time"),
    "vision": ("delay", "tolerance", "check_share", "correction_share", "correction_least"),
    "planning": ("reach", "reach_spread", "pace_spread", "reaction", "sign_width"),
    "choice": ("reward", "reward_spread", "resting_power", "efficiency", "torque_rate_cost", "discount", "shortest",
               "longest"),
    "learning": ("rate", "trust", "felt_noise"),
    "emg": ("muscles", "groups", "share", "gains", "gain_spread", "rate"),
    "force_sensor": ("noise", "offset", "drift", "delay"),
    "pointing": ("reference", "amplitudes", "repetitions", "block", "hold", "tolerance", "longest"),
    "cameras": ("rate", "noise", "quantum", "clock_drift", "elbow"),
}  # fmt: skip
"""What a file of people must say, table by table."""


@dataclass(frozen=True)
class PointingRig(Rig):
    """The tables of a file like ``lab/rigs/elbow-participants.toml``, and the robot that its people wear.

    Parameters
    ----------
    name : str
    tables : mapping of str to mapping
    robot : ElbowRig
    """

    robot: ElbowRig

    @property
    def period(self) -> float:
        """Of control [s]."""
        return 1.0 / self.robot["sampling"]["rate"]


@dataclass(frozen=True)
class Person:
    """One virtual person.

    Parameters
    ----------
    name : str
        "P1", "P2", ...
    sex : {"female", "male"}
    age : float
        [years]
    height, mass : float
        [m], [kg].
    reward : float
        What arriving is worth [J]: how briskly this person moves.
    emg_gains : tuple of float
        RMS of every muscle at full excitation [V].
    """

    name: str
    sex: str
    age: float
    height: float
    mass: float
    reward: float
    emg_gains: tuple[float, ...]

    @property
    def forearm(self) -> Segment:
        """Forearm and hand about the elbow."""
        return forearm(self.mass, self.height)

    @property
    def forearm_length(self) -> float:
        """From elbow to wrist [m]."""
        return ELBOW_TO_WRIST * self.height

    def vector(self, rig: PointingRig) -> np.ndarray:
        """The core's parameters of the person, shape (26,), SI.

        Parameters
        ----------
        rig : PointingRig

        Returns
        -------
        ndarray, shape (26,)
        """
        arm, vision, segment = rig["arm"], rig["vision"], self.forearm
        values = {
            "inertia": segment.inertia,
            "gravity": segment.gravity(),
            "centre": 0.0,
            **{key: arm[key] for key in ("viscous", "passive_torque", "passive_angle", "passive_scale")},
            **rig["muscles"],
            "flexion_max": arm["flexion"] * self.mass,
            "extension_max": arm["extension"] * self.mass,
            "visual_delay": vision["delay"],
            **{key: vision[key] for key in ("tolerance", "check_share", "correction_share", "correction_least")},
            "sign_width": rig["planning"]["sign_width"],
            "period": rig.period,
        }
        return np.array([values[name] for name in _core.REACHING_PARAMETER_NAMES])

    def slider(self, rig: PointingRig) -> float:
        """Where the robot's carriage sits on this forearm [m from the axis]."""
        rail = rig.robot["slider"]
        return float(np.clip(self.forearm_length - rig["robot"]["splint"], rail["low"], rail["high"]))


def elbow_participants(robot: ElbowRig | None = None) -> PointingRig:
    """The people of ``lab/rigs/elbow-participants.toml``.

    Parameters
    ----------
    robot : ElbowRig, optional
        What they wear; the one that the file names if left out.

    Returns
    -------
    PointingRig
    """
    return parse_pointing_rig(shipped_rig(KIND), KIND, robot)


def parse_pointing_rig(text: str, name: str, robot: ElbowRig | None = None) -> PointingRig:
    """People and the robot that they wear, from the text of their file.

    Parameters
    ----------
    text : str
        TOML, SI.
    name : str
    robot : ElbowRig, optional
        What they wear; the one that the file names if left out.

    Returns
    -------
    PointingRig

    Raises
    ------
    StudyError
        If the file is not TOML, is of another kind, or lacks a table or a constant.
    """
    tables = checked_tables(text, name, KIND, NEEDED)
    if robot is None:
        worn = tables["robot"]["rig"]
        robot = parse_elbow_rig(shipped_rig(worn), worn)
    return PointingRig(name, tables, robot)


def draw_people(rig: PointingRig, rng: np.random.Generator, *, count: int | None = None) -> tuple[Person, ...]:
    """People whose ages, heights, masses and briskness have the means and spreads of the file.

    Each quantity takes its normal quantiles at evenly spaced levels, shuffled: a sample of six that is like the
    population, not one that chance made tall and quick.

    Parameters
    ----------
    rig : PointingRig
    rng : numpy.random.Generator
    count : int, optional
        The file's if left out.

    Returns
    -------
    tuple of Person
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
    return tuple(
        Person(
            f"P{i + 1}",
            str(sexes[i]),
            float(ages[i]),
            float(heights[i]),
            float(masses[i]),
            float(rewards[i]),
            tuple(gains[i].tolist()),
        )
        for i in range(n)
    )
