"""Movement decisions of a live session's simulated wearer, as in the simulated sessions of the pointing rig."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pellucid.live.setup import Task

from ..pointing.load_learning import load_regressor, update_expected_load
from ..pointing.movement_choice import preferred_duration
from ..pointing.people import Person
from ..pointing.plant import PointingPlant
from ..pointing.session import FELT_SAMPLE_PERIODS, MIN_REACTION_S

MIN_FELT_SAMPLES = 50
"""Smallest number of samples from which a wearer learns what the robot is like."""

SWING_DURATION_S = (0.5, 0.5)
"""Duration of a shank's movement at no amplitude [s], and what it gains per amplitude [s/rad].

Chosen by judgement; no measurement is recorded."""

SWING_PACE_SD = 0.07
"""Standard deviation of the logarithm of that duration from movement to movement."""

SWING_REACTION_S = (0.28, 0.04)
"""Mean and standard deviation of the reaction time, as of the elbow's people."""

FIRST_STOP_SHARE = 0.965
"""Share of the way after which the primary movement stops, as of the elbow's people."""


class ReachingPlan:
    """Draws durations, reactions and first stops, and learns from movement to movement what load to expect."""

    def __init__(self, rig: PointingPlant, person: Person, seed: int) -> None:
        self._rig = rig
        self._person = person
        self._rng = np.random.default_rng([seed, 27])
        self._expected = np.zeros(5)

    def reach(self, target: float, position: float, felt: Mapping[str, np.ndarray], worn: bool) -> Task:
        """Return the movement to a target [rad] from a position [rad]; `felt` are the samples since the last one."""
        planning, choice = self._rig["planning"], self._rig["choice"]
        self._learn(felt, worn)
        expected, rng = self._expected, self._rng
        dynamics = (
            self._person.forearm.inertia + max(expected[0], 0.0),
            self._rig.constants.arm.viscous + max(expected[1], 0.0),
            max(expected[2], 0.0),
        )
        amplitude = target - position
        duration = preferred_duration(amplitude, dynamics, self._person.reward, choice, planning["sign_width"])
        duration *= float(np.exp(planning["pace_spread"] * rng.standard_normal()))
        reach = planning["reach"] + planning["reach_spread"] * rng.standard_normal()
        reaction = max(planning["reaction"][0] + planning["reaction"][1] * rng.standard_normal(), MIN_REACTION_S)
        return Task(
            "reach", target, amplitude=float(reach * amplitude), duration=float(duration), reaction=float(reaction),
            load=tuple(expected.tolist()),
        )  # fmt: skip

    def _learn(self, felt: Mapping[str, np.ndarray], worn: bool) -> None:
        if not worn:
            self._expected = np.zeros(5)
            return
        q, v, load = (felt[name][::FELT_SAMPLE_PERIODS] for name in ("position", "velocity", "interaction"))
        sound = np.isfinite(q) & np.isfinite(v) & np.isfinite(load)
        if np.count_nonzero(sound) < MIN_FELT_SAMPLES or not sound.all():
            return
        a = np.gradient(v, FELT_SAMPLE_PERIODS * self._rig.period)
        regressor = load_regressor(q, v, a, self._rig["planning"]["sign_width"])
        self._expected = update_expected_load(self._expected, regressor, load, self._rig["learning"])


class SwingPlan:
    """Samples durations and reaction times of a shank's movements; reflexes react to the orthosis."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng([seed, 27])

    def reach(self, target: float, position: float, felt: Mapping[str, np.ndarray], worn: bool) -> Task:
        """Return the movement to a target [rad] from a position [rad]; nothing is learnt from what was `felt`."""
        amplitude, rng = target - position, self._rng
        duration = SWING_DURATION_S[0] + SWING_DURATION_S[1] * abs(amplitude)
        duration *= float(np.exp(SWING_PACE_SD * rng.standard_normal()))
        reaction = max(SWING_REACTION_S[0] + SWING_REACTION_S[1] * float(rng.standard_normal()), MIN_REACTION_S)
        return Task("reach", target, amplitude=FIRST_STOP_SHARE * amplitude, duration=duration, reaction=reaction)
