"""The virtual elbow robot on a reaching wearer, for a live session."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.controllers.supervised import supervised
from pellucid.live.setup import Condition, DeviceNumbers, EngineSetup, StreamsProgram
from pellucid.models.simulate import substeps_for

from ..drive_reading import EXACT_READING
from ..elbow.rig import able_elbow
from ..pointing.conditions import CONTROL_CONDITION, Cards, controller_builder, identify_cards, published_conditions
from ..pointing.people import Person, draw_people
from ..pointing.rig import PointingRig, elbow_participants
from ..pointing.session import EMG_GAIN_SD, RobotLaw
from ..virtual_streams import EMG_RATE_HZ, MuscleChannel
from .wearer import ReachingPlan

UNPOWERED_CONDITION = "unpowered"
"""Name of the condition in which the robot is worn without power."""

COMMON_EXPONENTS = (-0.5, -0.5)
"""Exponents of the equation of full compensation, upwards and downwards, where no person has chosen others."""

MUSCLE_CHANNELS = (
    MuscleChannel("biceps", 1.0, 9.0e-4),
    MuscleChannel("brachialis", 1.0, 6.0e-4),
    MuscleChannel("brachioradialis", 0.9, 7.0e-4),
    MuscleChannel("triceps_long", -0.8, 6.0e-4),
    MuscleChannel("triceps_lateral", -1.0, 8.0e-4),
    MuscleChannel("triceps_medial", -0.9, 6.5e-4),
    MuscleChannel("deltoid_anterior", 0.2, 5.0e-4),
    MuscleChannel("deltoid_posterior", -0.2, 5.0e-4),
)
"""Eight channels of EMG: those of the rig's file, and neighbours that it does not have."""


@cache
def _cards(seed: int) -> Cards:
    return identify_cards(able_elbow(), seed=seed)


def virtual_elbow(
    *,
    conditions: Sequence[str] = (CONTROL_CONDITION, "FC", "PCFr", "CLPC"),
    person: int = 0,
    seed: int = 1,
    cards: Cards | None = None,
    session_seed: int = 20261121,
) -> EngineSetup:
    """Return a virtual elbow session: the rig of ``able-elbow``, on a person of ``elbow-participants``.

    Parameters
    ----------
    conditions : sequence of str
        "Ctrl" for an arm without robot, "unpowered", the paper's "FC", "PCFr" and "CLPC", or controllers by name.
    person : int
        Which of the rig's people wears the robot, from 0.
    seed : int
        Seed of the wearer's noise and choices.
    cards : mapping or None
        Identified cards of the robot by method; None: the virtual robot is identified, which takes seconds.
    session_seed : int
        Seed with which the people are drawn.

    Returns
    -------
    EngineSetup

    Raises
    ------
    PellucidError
        If there is no such condition or person.
    """
    rig = elbow_participants()
    people = draw_people(rig, np.random.default_rng(session_seed))
    if not 0 <= person < len(people):
        raise PellucidError(f"person: found {person}, expected 0 to {len(people) - 1}")
    wearer = people[person]
    powered = [name for name in conditions if name not in (CONTROL_CONDITION, UNPOWERED_CONDITION)]
    known = (cards or _cards(1)) if powered else {}
    made = tuple(_condition(rig, wearer, known, name) for name in conditions)
    return EngineSetup(
        conditions=made,
        device=DeviceNumbers("virtual-elbow", numbers=_numbers(rig, wearer, np.random.default_rng([seed, 28]))),
        period=rig.period,
        seed=seed,
        wearer=ReachingPlan(rig, wearer, seed),
        streams=StreamsProgram(
            "pellucid_lab.virtual_streams",
            {
                "channels": [vars(channel) for channel in MUSCLE_CHANNELS],
                "rate": EMG_RATE_HZ,
                "table": rig.constants.emg.model_dump(),
                "seed": seed,
                "segment": wearer.forearm_length,
            },
        ),
    )


def _condition(rig: PointingRig, person: Person, cards: Cards, name: str) -> Condition:
    if name == CONTROL_CONDITION:
        return Condition(name, None, worn=False)
    if name == UNPOWERED_CONDITION:
        return Condition(name, None)
    place = person.slider(rig)
    published = published_conditions(cards, COMMON_EXPONENTS)
    build: Callable[[Person, float], RobotLaw] | None
    if name in published:
        build = published[name]
    elif name in ELBOW_CONTROLLERS:
        build = controller_builder(cards, name, exponents=COMMON_EXPONENTS)
    else:
        known = [CONTROL_CONDITION, UNPOWERED_CONDITION, *published, *ELBOW_CONTROLLERS]
        raise PellucidError(f'condition: found "{name}", expected one of {", ".join(dict.fromkeys(known))}')
    assert build is not None
    law = build(person, place)
    assert isinstance(law, ControlLaw)
    return Condition(name, supervised(law, instruments=rig.robot.instruments, start_up=False))


def _numbers(rig: PointingRig, person: Person, rng: np.random.Generator) -> dict[str, list[float]]:
    """Return the numbers of the engine's virtual elbow, by name."""
    robot, motor, sensor = rig.robot, rig.robot["motor"], rig["force_sensor"]
    drive = [robot.gain, motor["current_limit"], motor["ripple_amplitude"], motor["ripple_wave_number"], robot.quantum]
    offset = sensor["offset"] * rng.standard_normal()
    reading = dict(zip(_core.DRIVE_READING_NAMES, EXACT_READING.numbers.tolist(), strict=True))
    reading["lag"] = robot.constants.current_sensor.noise_memory
    drive_noise = robot.gain * robot.constants.current_sensor.noise
    return {
        "person": person.vector(rig).tolist(),
        "robot": robot.plant(person.slider(rig)).tolist(),
        "strap": rig.strap.tolist(),
        "drive": [float(number) for number in drive],
        "emg_gains": (1.0 + EMG_GAIN_SD * rng.standard_normal(2)).tolist(),
        # noise of the encoder, offset and noise of the force sensor, noise of the drive; 1: there is a force sensor
        "noise": [robot["encoder"]["noise"], offset, sensor["noise"], drive_noise, 1.0],
        "reading": [reading[name] for name in _core.DRIVE_READING_NAMES],
        "position0": [float(rig["pointing"]["reference"])],
        "substeps": [float(substeps_for(rig.period))],
        "sensor_delay": [float(round(sensor["delay"] / rig.period))],
    }
