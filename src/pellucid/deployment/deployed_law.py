"""The control laws that can leave the PC: for each, the core's names, its sensors and its parameters.

One entry of `LAWS` is all that a law of the core needs in order to be exported; what its parameters' values are for a
study says a function of `values.py`'s kind, such as `joint_values` and `worn_values`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from .. import _core
from ..controllers.elbow_laws import LAW_NAMES


@dataclass(frozen=True)
class Sensor:
    """What a law reads each period.

    Attributes
    ----------
    name : str
        Of the field in C.
    unit : str
        SI, plain text.
    meaning : str
        For the engineer.
    required : bool
        Whether the law stops without it; if not, it goes on with less.
    swing, noise : float
        Amplitude and resolution of the test vector's motion, in `unit`.
    """

    name: str
    unit: str
    meaning: str
    required: bool = True
    swing: float = 1.0
    noise: float = 1e-3


@dataclass(frozen=True)
class DeployedLaw:
    """A law of the core, as C sees it.

    Attributes
    ----------
    title : str
        What it does, in a few words.
    header : str
        Of the core, with the law.
    coefficients, state, input, params : str
        Its types, and the function that makes its parameters of an array, in the core.
    sensors : tuple of Sensor
        The first is the joint's position.
    fill : tuple of str
        C++ statements that fill the law's `input` from `good[i]`, whether sensor i may be believed, and `sample[i]`;
        the value of a sample that may not be believed is NaN.
    parameters : tuple of str
        Names, in the core's order; the last nine are the safety gate's.
    units : mapping of str to str
        Of the parameters that `GATE_UNITS` and `BODY_UNITS` do not have.
    storage : int
        Bytes that the law and its state take at most, on any machine.
    """

    title: str
    header: str
    coefficients: str
    state: str
    input: str
    params: str
    sensors: tuple[Sensor, ...]
    fill: tuple[str, ...]
    parameters: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    storage: int = 1024

    def unit(self, parameter: str) -> str:
        """SI unit of a parameter of a rotary joint, plain text; "1" for none."""
        return {**GATE_UNITS, **self.units}.get(parameter, "1")


GATE_UNITS: Mapping[str, str] = {
    "effort_limit": "N*m",
    "rate_limit": "N*m/s",
    "velocity_limit": "rad/s",
    "position_min": "rad",
    "position_max": "rad",
    "stop_margin": "rad",
    "max_age": "s",
    "max_repeats": "1",
    "period": "s",
}
"""The last nine parameters of every law."""

BODY_UNITS: Mapping[str, str] = {
    "inertia": "kg*m^2",
    **dict.fromkeys(("gravity_sine", "gravity_cosine", "offset", "stribeck"), "N*m"),
    **dict.fromkeys(("coulomb_positive", "coulomb_negative"), "N*m"),
    **dict.fromkeys(("viscous_positive", "viscous_negative"), "N*m*s/rad"),
    **dict.fromkeys(("stribeck_velocity", "velocity_width"), "rad/s"),
}

COUPLED_UNITS: Mapping[str, str] = {
    **dict.fromkeys(("orthosis_inertia", "limb_inertia", "actuator_inertia"), "kg*m^2"),
    **dict.fromkeys(("orthosis_viscous", "limb_viscous", "actuator_viscous", "strap_damping"), "N*m*s/rad"),
    **dict.fromkeys(("orthosis_gravity", "limb_gravity", "coulomb", "actuator_coulomb"), "N*m"),
    **dict.fromkeys(("integral_limit", "emg_limit"), "N*m"),
    **dict.fromkeys(("friction_width", "assist_width", "swing_rate"), "rad/s"),
    **dict.fromkeys(("slack", "innovation_limit", "swing_angle"), "rad"),
    **dict.fromkeys(("correct_velocity", "correct_mismatch_rate", "actuator_leak", "integral"), "1/s"),
    **dict.fromkeys(("derivative", "preview", "trust_time"), "s"),
    "strap_stiffness": "N*m/rad",
    "correct_disturbance": "N*m/rad",
}

DIRECTIONAL_UNITS: Mapping[str, str] = {
    **{f"{name}_{way}": "N*m" for name in ("gravity_sine", "gravity_cosine", "coulomb") for way in ("up", "down")},
    **{f"viscous_{way}": "N*m*s/rad" for way in ("up", "down")},
    **{f"inertia_{way}": "kg*m^2" for way in ("up", "down")},
    "dead_band": "rad/s",
    "inertia_limit": "N*m",
}

TRANSPARENT_UNITS: Mapping[str, str] = {
    **BODY_UNITS,
    **dict.fromkeys(("bandwidth", "sensor_lowpass", "sensor_drift", "emg_slow", "disturbance_lowpass"), "rad/s"),
    **dict.fromkeys(("frequency", "frequency_min", "frequency_max", "dither_frequency"), "rad/s"),
    **dict.fromkeys(("integral", "leak", "phase_rate", "frequency_rate", "amplitude_rate"), "1/s"),
    **dict.fromkeys(("acceleration_limit", "emg_limit"), "rad/s^2"),
    **dict.fromkeys(("innovation_gate", "least_amplitude"), "rad"),
    **dict.fromkeys(("friction_lead", "oscillator_lead", "disturbance_delay"), "s"),
    **dict.fromkeys(("limb_gravity", "feedback_limit", "disturbance_limit", "dither"), "N*m"),
    "limb_inertia": "kg*m^2",
    "limb_viscous": "N*m*s/rad",
    "energy_store": "J",
}

POSITION = Sensor("position", "rad", "the joint's encoder, 0 where it hangs along gravity", swing=0.8, noise=4e-4)

JOINT_PARAMETERS = (*_core.PARAMETER_NAMES, "gravity_share", "friction_share", "bandwidth", *GATE_UNITS)

LAW_INPUT = (
    "input.position = sample[0].value;",
    "input.valid = good[0];",
    "input.time = sample[0].time;",
    "input.sequence = sample[0].sequence;",
)
"""How the encoder fills the input that the laws of a worn elbow share."""

ELBOW_SENSORS = (
    POSITION,
    Sensor("interaction", "N*m", "the wearer's torque on the robot, from a force sensor", False, 1.0, 1e-2),
    Sensor("muscle", "N*m", "the wearer's torque at the joint, from EMG", False, 2.0, 0.05),
)

LAWS: Mapping[str, DeployedLaw] = {
    "joint": DeployedLaw(
        title="compensation of a joint's gravity and friction",
        header="joint_compensation.hpp",
        coefficients="JointCompensationCoefficients",
        state="JointCompensationState",
        input="JointCompensationInput",
        params="joint_compensation_params",
        sensors=(POSITION,),
        fill=(
            "input.position = sample[0].value;",
            "input.time = sample[0].time;",
            "input.sequence = sample[0].sequence;",
            "input.valid = good[0];",
        ),
        parameters=JOINT_PARAMETERS,
        units={**BODY_UNITS, "bandwidth": "1/s"},
        storage=512,
    ),
    "worn": DeployedLaw(
        title="zero-impedance mode of a worn orthosis, with its residual compensated",
        header="residual_compensator.hpp",
        coefficients="ResidualCoefficients",
        state="ResidualState",
        input="ResidualInput",
        params="residual_params",
        sensors=(
            POSITION,
            Sensor("torque", "N*m", "the spring's torque on the orthosis", swing=0.5, noise=5e-3),
            Sensor("emg_torque", "N*m", "the muscles' torque, from EMG", required=False, swing=4.0, noise=0.1),
        ),
        fill=(
            "input.position = sample[0].value;",
            "input.torque = sample[1].value;",
            "input.emg_torque = sample[2].value;",
            "input.emg_valid = good[2];",
            "input.time = sample[0].time;",
        ),
        parameters=tuple(_core.RESIDUAL_PARAMETER_NAMES),
        units=COUPLED_UNITS,
        storage=1024,
    ),
    "position_prediction": DeployedLaw(
        title="closed-loop position control of a worn elbow",
        header="position_prediction.hpp",
        coefficients="PositionPredictionCoefficients",
        state="PositionPredictionState",
        input="LawInput",
        params="law_params",
        sensors=(POSITION,),
        fill=LAW_INPUT,
        parameters=LAW_NAMES["position_prediction"],
        units={**BODY_UNITS, "coulomb": "N*m", "stiffness": "N*m/rad", "dead_band": "rad/s"},
    ),
    "directional": DeployedLaw(
        title="open-loop compensation of a worn elbow, by direction",
        header="directional_compensation.hpp",
        coefficients="DirectionalCompensationCoefficients",
        state="DirectionalCompensationState",
        input="LawInput",
        params="law_params",
        sensors=(POSITION,),
        fill=LAW_INPUT,
        parameters=LAW_NAMES["directional"],
        units=DIRECTIONAL_UNITS,
    ),
    "transparent": DeployedLaw(
        title="compensation of a worn elbow's whole body, with or without a force sensor",
        header="transparent_compensation.hpp",
        coefficients="TransparentCompensationCoefficients",
        state="TransparentCompensationState",
        input="LawInput",
        params="law_params",
        sensors=ELBOW_SENSORS,
        fill=(
            *LAW_INPUT,
            "input.interaction = sample[1].value;",
            "input.has_interaction = good[1];",
            "input.muscle = sample[2].value;",
            "input.has_muscle = good[2];",
        ),
        parameters=LAW_NAMES["transparent"],
        units=TRANSPARENT_UNITS,
        storage=1536,
    ),
}
"""By name."""
