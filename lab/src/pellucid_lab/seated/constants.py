"""The constants of a shank exoskeleton on a frame and of the people who sit in it, as its file states them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator

from pellucid.emg.models.muscle_geometry import muscle_table

from ..constants import (
    Angle,
    AngleSize,
    BodyHeight,
    BodyMass,
    Compliance,
    Coordinate,
    Delay,
    Duration,
    Gain,
    GearRatio,
    Inertia,
    LogarithmSpread,
    Mass,
    Memory,
    Motion,
    Noise,
    PositiveAngle,
    PositiveSpeed,
    Quantum,
    Rate,
    RigConstants,
    RigTable,
    SampleSpan,
    Seed,
    Share,
    Stiffness,
    Substeps,
    Text,
    TimeConstant,
    Torque,
    TorqueLimit,
    Viscosity,
    WaveNumber,
)
from ..shared_tables import EmgTable

EmgGain = Annotated[float, Field(ge=1e-9, le=10.0)]
"""RMS of a channel's EMG at full excitation [V]."""

MuscleNames = Annotated[tuple[Text, ...], Field(min_length=1, max_length=64)]
"""Names of muscles of the anatomical model."""


class ExoskeletonTable(RigTable):
    """``[exoskeleton]``: the shank part."""

    mass: Mass  # mass of the shank part [kg]
    centre: tuple[Coordinate, Coordinate]  # centre of mass along the segment and across it [m]
    inertia: Inertia  # inertia about the joint [kg*m^2]


class ActuatorTable(RigTable):
    """``[actuator]``: motor and gear on the joint's side."""

    ratio: GearRatio | None = None  # gear ratio, which the simulation does not need [1]
    inertia: Inertia  # inertia of the rotor at the joint [kg*m^2]
    torque_limit: TorqueLimit  # largest torque of the motor at the joint [N*m]
    coulomb_positive: Torque  # Coulomb friction at positive velocities [N*m]
    coulomb_negative: Torque  # Coulomb friction at negative velocities [N*m]
    viscous: Viscosity  # viscous friction [N*m*s/rad]
    rest_speed: PositiveSpeed  # speed below which Coulomb friction has not built up [rad/s]
    load_loss: Share  # share of the torque that is lost in the teeth in either direction [1]
    cogging: Torque  # amplitude of the cogging torque [N*m]
    cogging_wave_number: WaveNumber  # phase of the cogging per angle of the joint [1/rad]
    constant_error: Annotated[float, Field(ge=-0.9, le=9.0)]  # drive's torque constant over the true one, less 1 [1]


class PositionLoopTable(RigTable):
    """``[position_loop]``: proportional control with damping."""

    kp: Gain  # torque per position error [N*m/rad]
    kd: Gain  # torque per rate of the position error [N*m*s/rad]
    velocity_span: SampleSpan  # number of samples over which the rate is a difference


class InstrumentsTable(RigTable):
    """``[instruments]``: controller and readings of the drive."""

    rate: Rate  # rate of the controller and of the recording [Hz]
    encoder: Quantum  # angle of the joint per count of the encoder [rad]
    torque_noise: Noise  # standard deviation of the torque read from the drive's current [N*m]
    substeps: Substeps  # integration steps in a control period


class ShellsTable(RigTable):
    """``[shells]``: the shells that hold the shank."""

    stiffness: tuple[Stiffness, Stiffness]  # smallest and largest stiffness between subjects [N*m/rad]
    damping: Viscosity  # damping [N*m*s/rad]


class LimbTable(RigTable):
    """``[limb]``: shank and foot of every subject."""

    spread: Annotated[float, Field(ge=0.0, le=0.3)]  # standard deviation of mass, centre, gyration over Winter's [1]
    ahead: tuple[Angle, Angle]  # range of the angle of the centre of mass in front of the shank [rad]
    viscous: tuple[Viscosity, Viscosity]  # range of the viscous friction of joint and skin [N*m*s/rad]


class PostureTable(RigTable):
    """``[posture]``: how the subjects sit."""

    rest: tuple[Angle, Angle]  # range of the knee's angle where the shank hangs [rad]
    hip: tuple[Angle, Angle]  # range of the hip's flexion [rad]
    goniometer: AngleSize  # standard deviation of either angle as it is noted [rad]


class DifferenceTable(RigTable):
    """``[difference]``: relative differences between the subjects' muscles and the anatomical model's."""

    low: Annotated[float, Field(ge=0.0, le=0.9)]  # smallest size of a difference of either sign [1]
    high: Annotated[float, Field(ge=0.0, le=0.9)]  # largest size of a difference of either sign [1]
    seed: Seed  # seed of all random numbers of the subjects


class MusclesTable(RigTable):
    """``[muscles]``: muscles of every subject."""

    model_height: BodyHeight  # height of the anatomical model; lengths grow with height [m]
    model_mass: BodyMass  # mass of the anatomical model; forces grow with mass [kg]
    extensors: MuscleNames  # muscles that extend the knee
    flexors: MuscleNames  # muscles that flex the knee
    sharing: Annotated[dict[Text, Share], Field(max_length=64)]  # activation of each muscle over its group's drive [1]
    unseen: Share  # standard deviation of each muscle's share over time [1]
    unseen_memory: Memory  # correlation time of that share [s]
    tendon_strain: tuple[Share, Share]  # range of the tendon's strain under the largest force [1]
    passive_strain: Annotated[Share, Field(ge=1e-3)]  # fibre strain where passive force is the largest active one [1]
    passive_at_rest: tuple[Torque, Torque]  # range of the extensors' passive torque where the shank hangs [N*m]
    passive_flexors: Share  # passive force of the flexors over the anatomical model's [1]
    fibre_damping: Share  # damping, in largest force over the fastest shortening [1]
    length_shift: tuple[Share, Share]  # range of the optimal fibre length's relative increase without activation [1]
    activation_time: tuple[TimeConstant, TimeConstant]  # range of the time constant of rising activation [s]
    deactivation_time: tuple[TimeConstant, TimeConstant]  # range of the time constant of falling activation [s]
    delay: tuple[Delay, Delay]  # range of the delay from excitation to the first force [s]
    shape: tuple[Annotated[float, Field(ge=-20.0, le=-1e-3)], Annotated[float, Field(ge=-20.0, le=-1e-3)]]  # range of s
    variability: Share  # standard deviation of signal-dependent noise of the excitation [1]
    variability_memory: Memory  # correlation time of that noise [s]

    @field_validator("extensors", "flexors")
    @classmethod
    def _require_known_muscles(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        """Refuse muscles that the anatomical model does not have."""
        known = muscle_table().geometry
        unknown = [name for name in names if name not in known]
        if unknown:
            raise ValueError(f"found {', '.join(unknown)}, expected muscles of {', '.join(known)}")
        return names


class WearerTable(RigTable):
    """``[wearer]``: how the subjects move."""

    cocontraction: tuple[Torque, Torque]  # range of the torque of both sides at once [N*m]
    belief: Share  # standard deviation of the relative error of the expected inertia and weight [1]
    friction_belief: Share  # share of the machine's friction that is expected [1]
    reflex_delay: Delay  # delay of reflexes [s]
    activation_foresight: Delay  # time by which plans are sent earlier than the delay, for activation [s]
    weakening: Annotated[float, Field(ge=0.0, le=10.0)]  # expected relative shortening speed per knee speed [s/rad]
    stiffness: Stiffness  # torque of reflexes per angle error [N*m/rad]
    damping: Viscosity  # torque of reflexes per velocity error [N*m*s/rad]
    spontaneous: Share  # excitation of a muscle at rest [1]
    spontaneous_memory: Memory  # correlation time of that excitation [s]
    maximal: tuple[Share, Share]  # range of the excitation in an attempt at the maximum [1]


class SwingTable(RigTable):
    """``[swing]``: an active swing."""

    forward: tuple[AngleSize, AngleSize]  # smallest and largest angle in front of hanging [rad]
    backward: tuple[AngleSize, AngleSize]  # smallest and largest angle behind hanging [rad]
    pace: Annotated[float, Field(ge=0.0, le=0.9)]  # share by which the frequency changes in either direction [1]
    memory: Memory  # time over which angles and frequency change [s]
    duration: tuple[Duration, Duration]  # durations of the fitted and the held-out recording [s]


class LoadedTable(RigTable):
    """``[loaded]``: swings by the motor, with nobody and with a relaxed leg."""

    amplitude: PositiveAngle  # amplitude C of the printed swing [rad]
    duration: Duration  # duration of each swing [s]
    reach: PositiveAngle  # largest angle of the richer swing [rad]
    peak_torque: TorqueLimit  # largest torque of the richer swing [N*m]
    excitation_seed: Seed  # seed with which the richer swing is optimised


class MvcTable(RigTable):
    """``[mvc]``: maximal voluntary contractions against a clamp."""

    angle: Angle  # angle from hanging at which the shank is clamped [rad]
    clamp_compliance: Compliance = Field(alias="yield")  # angle by which the clamp yields per torque [rad/(N*m)]
    duration: Duration  # duration of two attempts [s]


class SeatedEmgTable(EmgTable):
    """``[emg]``: one amplifier; other muscles only leak into its channels."""

    leaking: Annotated[tuple[Text, ...], Field(max_length=64)]  # muscles without a channel
    leak_gain: Annotated[tuple[EmgGain, ...], Field(max_length=64)]  # RMS of each at full excitation [V]
    gain_spread: LogarithmSpread  # standard deviation of the gains' logarithm between subjects [1]
    gain: Annotated[dict[Text, EmgGain], Field(max_length=64)]  # RMS of each channel at full excitation [V]


class SubjectTable(RigTable):
    """``[subjects.NAME]``: a person who sits in the exoskeleton."""

    sex: Text  # "female" or "male"
    age: Annotated[int, Field(ge=1, le=150)]  # age [years]
    height: BodyHeight  # height [m]
    weight: BodyMass  # mass of the body [kg]
    frequency: Annotated[float, Field(ge=0.01, le=10.0)]  # mean frequency of the person's swings [Hz]


class SeatedConstants(RigConstants):
    """A file like ``rigs/knee-seated.toml``."""

    motion: Motion = "rotary"  # way in which the joint moves
    lifts: Text = "extension"  # name of the positive direction
    exoskeleton: ExoskeletonTable
    actuator: ActuatorTable
    position_loop: PositionLoopTable
    instruments: InstrumentsTable
    shells: ShellsTable
    limb: LimbTable
    posture: PostureTable
    difference: DifferenceTable
    muscles: MusclesTable
    wearer: WearerTable
    swing: SwingTable
    loaded: LoadedTable
    mvc: MvcTable
    emg: SeatedEmgTable
    subjects: Annotated[dict[Text, SubjectTable], Field(min_length=1, max_length=1000)]
