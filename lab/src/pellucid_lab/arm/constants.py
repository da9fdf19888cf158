"""The constants of an arm exoskeleton of four joints and a carriage, as its file states them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ..constants import (
    Acceleration,
    Angle,
    AngleSize,
    Coordinate,
    Delay,
    Duration,
    Gain,
    Inertia,
    InertiaProduct,
    Length,
    Mass,
    Motion,
    Noise,
    PositiveSpeed,
    Ranges,
    Rate,
    RigConstants,
    RigTable,
    RootViscosity,
    SampleCount,
    SampleSpan,
    Share,
    Speed,
    Stiffness,
    Substeps,
    Torque,
    Viscosity,
)
from ..shared_tables import CurrentSensorTable, MotorEncoderTable, MotorTable

Rotation = tuple[Angle, Angle, Angle]
"""Small rotation about x, y and z [rad]."""

Displacement = tuple[Coordinate, Coordinate, Coordinate]
"""Displacement along x, y and z [m]."""


class BodyTable(RigTable):
    """``[body]``: the person for whom the robot is set up."""

    upper_arm: Length  # distance from the shoulder's centre to the elbow's axis [m]


class LinkTable(RigTable):
    """``[link.NAME]``: a rigid body, in the frame of its joint."""

    mass: Mass  # mass of the body [kg]
    centre: Displacement  # centre of mass [m]
    inertia: tuple[Inertia, Inertia, Inertia]  # moments of inertia xx, yy, zz about the centre of mass [kg*m^2]
    product: tuple[InertiaProduct, InertiaProduct, InertiaProduct]  # products of inertia xy, xz, yz [kg*m^2]


class LinksTable(RigTable):
    """``[link]``: the moving bodies, from the trunk outwards."""

    abduction: LinkTable
    flexion: LinkTable
    internal_rotation: LinkTable
    elbow_flexion: LinkTable
    carriage: LinkTable


class SliderTable(RigTable):
    """``[slider]``: the carriage on the forearm."""

    low: Length  # smallest distance from the elbow's axis [m]
    high: Length  # largest distance from the elbow's axis [m]
    clamped: Length  # distance from the elbow's axis while the robot is identified [m]
    coulomb: Torque  # Coulomb friction of the free carriage [N]
    viscous: Viscosity  # viscous friction of the free carriage [N*s/m]


class AssemblyTable(RigTable):
    """``[assembly]``: errors of the assembly, which the drawing does not show."""

    tilt: tuple[Angle, Angle]  # rotation of the base about x and y [rad]
    axis_abduction: Rotation  # rotation of the axis from the drawing's [rad]
    axis_flexion: Rotation  # rotation of the axis from the drawing's [rad]
    axis_internal_rotation: Rotation  # rotation of the axis from the drawing's [rad]
    axis_elbow_flexion: Rotation  # rotation of the axis from the drawing's [rad]
    place_abduction: Displacement | None = None  # displacement of the axis from the drawing's [m]
    place_flexion: Displacement | None = None  # displacement of the axis from the drawing's [m]
    place_internal_rotation: Displacement | None = None  # displacement of the axis from the drawing's [m]
    place_elbow_flexion: Displacement | None = None  # displacement of the axis from the drawing's [m]


class MakerTable(RigTable):
    """``[maker]``: errors of the bodies' parameters in the drawing, and therefore in study.toml."""

    mass: Annotated[Share, Field(ge=0.01)]  # stated mass over true mass [1]
    centre: Coordinate  # error of each stated centre of mass in every direction [m]
    inertia: Annotated[Share, Field(ge=0.01)]  # stated inertia over true inertia [1]


class JointTable(MotorTable):
    """``[joint.NAME]``: motor, transmission and bearing of one joint; names are those of the core."""

    stiffness: Stiffness  # stiffness of the cable at the joint [N*m/rad]
    damping: Viscosity  # damping of the cable at the joint [N*m*s/rad]
    backlash: AngleSize  # whole gap of the backlash [rad]
    coulomb_positive: Torque  # Coulomb friction of the transmission at positive velocities [N*m]
    coulomb_negative: Torque  # Coulomb friction of the transmission at negative velocities [N*m]
    viscous_positive: Viscosity  # viscous friction of the transmission at positive velocities [N*m*s/rad]
    viscous_negative: Viscosity  # viscous friction of the transmission at negative velocities [N*m*s/rad]
    stribeck: Torque  # additional friction at rest [N*m]
    stribeck_velocity: Speed  # speed at which the additional friction has fallen to 1/e [rad/s]
    load_motoring: Annotated[float, Field(ge=0.0, le=5.0)]  # share of the load lost while the motor lifts it [1]
    load_generating: Annotated[float, Field(ge=0.0, le=0.9)]  # share of the load lost while the load is lowered [1]
    square_root: RootViscosity = 0.0  # friction per root of the speed [N*m/(rad/s)^0.5]
    bearing_coulomb: Torque  # Coulomb friction of the joint's bearings [N*m]
    bearing_viscous: Viscosity  # viscous friction of the joint's bearings [N*m*s/rad]
    presliding_travel: AngleSize  # angle over which the bearings' friction builds up before they slip [rad]
    low: Angle  # lower stop [rad]
    high: Angle  # upper stop [rad]
    velocity: PositiveSpeed  # largest speed [rad/s]
    acceleration: Acceleration  # largest acceleration [rad/s^2]

    @property
    def gain(self) -> float:
        """Return the torque at the joint per ampere [N*m/A]."""
        return self.torque_constant * self.gear_ratio

    @property
    def motor_inertia(self) -> float:
        """Return the rotor's inertia at the joint [kg*m^2]."""
        return self.rotor_inertia * self.gear_ratio**2


class JointsTable(RigTable):
    """``[joint]``: the joints, from the trunk outwards."""

    abduction: JointTable
    flexion: JointTable
    internal_rotation: JointTable
    elbow_flexion: JointTable


class DriveTable(RigTable):
    """``[drive]``: the amplifiers."""

    lag: Delay  # time constant of the current controller [s]
    delay: SampleCount  # control periods from an encoder's reading to the amplifier's command


class ForceSensorTable(RigTable):
    """``[force_sensor]``: the six-axis sensor of the handle."""

    force_noise: Noise  # standard deviation of each force [N]
    moment_noise: Noise  # standard deviation of each moment [N*m]


class LoopTable(RigTable):
    """``[loop.NAME]``: proportional and integral control of a joint's position, with velocity damping."""

    kp: Gain  # velocity per position error [1/s]
    kv: Gain  # current per velocity error [A*s/rad]
    ki: Gain  # current per integrated velocity error [A/rad]


class LoopsTable(RigTable):
    """``[loop]``: the controllers of the joints."""

    abduction: LoopTable
    flexion: LoopTable
    internal_rotation: LoopTable
    elbow_flexion: LoopTable


class SamplingTable(RigTable):
    """``[sampling]``: rate and integration."""

    rate: Rate  # rate of the controllers and of the recording [Hz]
    velocity_span: SampleSpan  # number of samples over which a measured velocity is a difference
    substeps: Substeps  # integration steps in a control period


class ProtocolTable(RigTable):
    """``[protocol]``: extent of the recordings."""

    repetitions: Annotated[int, Field(ge=1, le=40)]  # number of different Fourier motions that are fitted
    duration: Annotated[Duration, Field(le=400.0)]  # duration of each Fourier motion [s]
    slow_share: Annotated[float, Field(ge=0.01, le=1.0)]  # share of the velocity limits in slow movements [1]


class ArmConstants(RigConstants):
    """A file like ``rigs/able-arm.toml``."""

    motion: Motion = "rotary"  # way in which the joints move
    body: BodyTable
    link: LinksTable
    slider: SliderTable
    assembly: AssemblyTable
    maker: MakerTable
    joint: JointsTable
    drive: DriveTable
    encoder: MotorEncoderTable
    current_sensor: CurrentSensorTable
    force_sensor: ForceSensorTable
    loop: LoopsTable
    sampling: SamplingTable
    protocol: ProtocolTable
    drawn: Ranges = Field(default_factory=dict)  # ranges of factors on constants of further robots, by dotted path
