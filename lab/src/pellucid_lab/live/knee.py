"""The virtual knee orthosis on a wearer who reaches with the shank, for a live session."""

from __future__ import annotations

from collections.abc import Sequence

from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import JOINT_LAW, ControlLaw
from pellucid.controllers.worn import watched_worn
from pellucid.live.setup import Condition, DeviceNumbers, EngineSetup, StreamsProgram

from ..drive_reading import EXACT_READING
from ..knee.rig import knee_orthosis
from ..virtual_streams import EMG_RATE_HZ, MuscleChannel
from .wearer import SwingPlan

RELAXED_CONDITION = "zero"
"""Name of the condition in which the spring is asked for no torque."""

TORQUE_CONDITION = "torque"
"""Name of the condition in which the operator's slider is the torque."""

TORQUE_LIMITS = {
    "effort_limit": 15.0,
    "rate_limit": 60.0,
    "velocity_limit": 12.0,
    "position_min": -0.2,
    "position_max": 2.0,
    "stop_margin": 0.1,
    "max_age": 0.005,
}
"""Limits of the slider's torque on a knee [N m, N m/s, rad/s, rad, rad, rad, s]."""

START_ANGLE_RAD = 0.6
"""Angle at which the wearer first holds the knee."""

MUSCLE_CHANNELS = (
    MuscleChannel("rectus_femoris", -1.0, 3.1e-4),
    MuscleChannel("vastus_lateralis", -0.9, 3.5e-4),
    MuscleChannel("vastus_medialis", -0.9, 3.3e-4),
    MuscleChannel("biceps_femoris", 1.0, 4.2e-4),
    MuscleChannel("semitendinosus", 0.9, 3.8e-4),
    MuscleChannel("gastrocnemius_medial", 0.4, 2.5e-4),
    MuscleChannel("gastrocnemius_lateral", 0.4, 2.4e-4),
    MuscleChannel("tibialis_anterior", -0.1, 2.8e-4),
)
"""Eight channels of EMG of a thigh and shank."""

REACHING_NUMBERS = {
    "centre": 0.0,
    "stiffness": 10.0,
    "damping": 2.0,
    "reflex_stiffness": 12.0,
    "reflex_damping": 1.0,
    "reflex_delay": 0.05,
    "muscle_delay": 0.03,
    "activation_time": 0.04,
    "cocontraction": 0.03,
    "noise_share": 0.03,
    "noise_time": 0.15,
    "visual_delay": 0.2,
    "tolerance": 0.03,
    "check_share": 0.9,
    "correction_share": 0.5,
    "correction_least": 0.25,
    "sign_width": 0.05,
}
"""How this wearer moves: orders of magnitude from the knee rig's file, and of vision from the elbow's, by judgement."""


def virtual_knee(
    *, conditions: Sequence[str] = (RELAXED_CONDITION, TORQUE_CONDITION), subject: str = "S1", seed: int = 1
) -> EngineSetup:
    """Return a virtual session with the rig of ``knee-orthosis`` on one of its subjects.

    Parameters
    ----------
    conditions : sequence of str
        "zero", where the orthosis is asked for no torque, and "torque", where `LiveEngine.set_torque` gives it.
    subject : str
    seed : int
        Seed of the wearer's noise.

    Returns
    -------
    EngineSetup

    Raises
    ------
    PellucidError
        If there is no such condition or subject.
    """
    rig = knee_orthosis()
    if subject not in rig.subjects:
        raise PellucidError(f'subject: found "{subject}", expected one of {", ".join(rig.subjects)}')
    unknown = [name for name in conditions if name not in (RELAXED_CONDITION, TORQUE_CONDITION)]
    if unknown:
        raise PellucidError(f'condition: found "{unknown[0]}", expected {RELAXED_CONDITION} or {TORQUE_CONDITION}')
    worn = rig.subjects[subject]
    law = ControlLaw(
        JOINT_LAW.name,
        JOINT_LAW.defaults
        | TORQUE_LIMITS
        | {"inertia": 0.05, "velocity_width": 0.1, "friction_share": 0.0, "period": rig.period},
    )
    drive = rig.constants.actuator
    friction = 0.5 * (drive.coulomb_positive + drive.coulomb_negative)
    watched = watched_worn(
        law, rig.instruments, actuator={"actuator_coulomb": friction, "actuator_inertia": drive.inertia}
    )
    values = {
        **REACHING_NUMBERS,
        "inertia": worn.inertia,
        "gravity": worn.gravity,
        "centre": worn.limb.ahead,
        "viscous": worn.limb.viscous,
        **{f"passive_{name}": value for name, value in rig.constants.passive.items()},
        "flexion_max": worn.strength.lateral_hamstring,
        "extension_max": worn.strength.rectus_femoris,
        "period": rig.period,
    }
    loop = rig.constants.torque_loop
    numbers = {
        "person": [float(values[name]) for name in _core.REACHING_PARAMETER_NAMES],
        "plant": rig.plant(worn).tolist(),
        "loop": [float(loop.delay), float(loop.torque_span), float(loop.substeps)],
        "noise": [0.0],
        "reading": EXACT_READING.numbers.tolist(),
        "position0": [START_ANGLE_RAD],
    }
    table = rig.constants.emg
    return EngineSetup(
        conditions=tuple(Condition(name, watched) for name in conditions),
        device=DeviceNumbers("virtual-knee", numbers=numbers),
        period=rig.period,
        seed=seed,
        wearer=SwingPlan(seed),
        streams=StreamsProgram(
            "pellucid_lab.virtual_streams",
            {
                "channels": [vars(channel) for channel in MUSCLE_CHANNELS],
                "rate": EMG_RATE_HZ,
                "table": table.model_dump(),
                "seed": seed,
                "segment": worn.shank_length,
            },
        ),
    )
