"""The constants of an elbow exoskeleton with a sliding carriage, as its file states them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ..constants import (
    AngleSize,
    CameraRate,
    ClockDrift,
    ClockOffset,
    Coordinate,
    Gain,
    Inertia,
    Length,
    Mass,
    Motion,
    Noise,
    PositiveSpeed,
    Quantum,
    Ranges,
    Rate,
    RigConstants,
    RigTable,
    RootViscosity,
    SampleSpan,
    Share,
    Speed,
    Stiffness,
    Text,
    TimeConstant,
    Torque,
    Viscosity,
    WaveNumber,
)
from ..shared_tables import (
    CurrentSensorTable,
    ForceSensorRangeTable,
    MotionLimitsTable,
    MotorEncoderTable,
    MotorTable,
)


class BodyTable(RigTable):
    """``[link]`` and ``[carriage]``: a rigid body."""

    mass: Mass  # mass of the body [kg]
    centre: tuple[Coordinate, Coordinate]  # centre of mass along and across the rail; the carriage's from its marker
    inertia: Inertia  # inertia about the body's own centre of mass [kg*m^2]


class SliderTable(RigTable):
    """``[slider]``: the rail on which the carriage may be clamped."""

    low: Length  # smallest distance of the carriage's marker from the axis [m]
    high: Length  # largest distance of the carriage's marker from the axis [m]
    marker_height: Coordinate  # position of the carriage's marker across the rail [m]


class TransmissionTable(RigTable):
    """``[transmission]``: cable and screw between motor and joint; names are those of the core's geared plant."""

    stiffness: Stiffness  # stiffness of the cable at the joint [N*m/rad]
    damping: Viscosity  # damping of the cable at the joint [N*m*s/rad]
    backlash: AngleSize  # whole gap of the backlash [rad]
    coulomb_positive: Torque  # Coulomb friction at positive velocities [N*m]
    coulomb_negative: Torque  # Coulomb friction at negative velocities [N*m]
    viscous_positive: Viscosity  # viscous friction at positive velocities [N*m*s/rad]
    viscous_negative: Viscosity  # viscous friction at negative velocities [N*m*s/rad]
    viscous_decline: PositiveSpeed  # speed at which the slope of viscous friction has halved [rad/s]
    stribeck: Torque  # additional friction at rest [N*m]
    stribeck_velocity: Speed  # speed at which the additional friction has fallen to 1/e [rad/s]
    load_motoring: Annotated[float, Field(ge=0.0, le=5.0)]  # share of the load lost while the motor lifts it [1]
    load_generating: Annotated[float, Field(ge=0.0, le=0.9)]  # share of the load lost while the load is lowered [1]
    square_root: RootViscosity = 0.0  # friction per root of the speed [N*m/(rad/s)^0.5]
    load_rise: Share  # share by which load-dependent friction grows towards rest [1]
    friction_swing: Share  # share by which Coulomb friction varies along the travel [1]
    friction_wave_number: WaveNumber  # phase of that variation per angle of the joint [1/rad]
    presliding_travel: AngleSize = 0.0  # angle over which friction builds up before it slips; 0 means at once [rad]


class BearingTable(RigTable):
    """``[bearing]``: the joint's own bearings, behind the transmission."""

    coulomb: Torque  # Coulomb friction [N*m]
    viscous: Viscosity  # viscous friction [N*m*s/rad]


class OpticalTable(RigTable):
    """``[optical]``: motion capture with cameras on a clock of their own."""

    rate: CameraRate  # frame rate [Hz]
    noise: Noise  # standard deviation of each coordinate [m]
    quantum: Quantum  # step in which coordinates are stored [m]
    clock_offset: ClockOffset  # start of the cameras after the start of the robot's recording [s]
    clock_offset_spread: Noise  # standard deviation of that offset from recording to recording [s]
    clock_drift: ClockDrift  # share by which the cameras' clock is fast [1]
    lost_share: Annotated[float, Field(ge=0.0, le=1.0)]  # share of the frames that lose the carriage's marker [1]
    lost_length: TimeConstant  # time for which the marker is lost at once [s]
    origin: tuple[Coordinate, Coordinate, Coordinate]  # point on the axis in the laboratory's frame, z up [m]
    axis: tuple[Coordinate, Coordinate, Coordinate]  # direction of the axis in that frame, of any length [1]
    rail_markers: Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(max_length=20)]  # along and across [m]
    rail_offset: Annotated[tuple[Coordinate, ...], Field(max_length=20)]  # position of each along the axis [m]


class PositionLoopTable(RigTable):
    """``[loop.position]``: u = kv e + ki sum(e) with e = kp (r - q) - v."""

    kp: Gain  # velocity per position error [1/s]
    kv: Gain  # current per velocity error [A*s/rad]
    ki: Gain  # current per integrated velocity error [A/rad]
    velocity_span: SampleSpan  # number of samples over which the measured velocity is a difference


class VelocityLoopTable(RigTable):
    """``[loop.velocity]``: proportional and integral control of the velocity."""

    kp: Gain  # current per velocity error [A*s/rad]
    ki: Gain  # current per integrated velocity error [A/rad]
    velocity_span: SampleSpan  # number of samples over which the measured velocity is a difference


class LoopTable(RigTable):
    """``[loop]``: the two controllers of the machine."""

    position: PositionLoopTable
    velocity: VelocityLoopTable


class SamplingTable(RigTable):
    """``[sampling]``: rate of the recordings."""

    rate: Rate  # rate of the controller and of the recording [Hz]


class ElbowConstants(RigConstants):
    """A file like ``rigs/able-elbow.toml``."""

    motion: Motion = "rotary"  # way in which the joint moves
    lifts: Text = "flexion"  # name of the positive direction
    link: BodyTable
    carriage: BodyTable
    slider: SliderTable
    motor: MotorTable
    transmission: TransmissionTable
    bearing: BearingTable
    encoder: MotorEncoderTable
    current_sensor: CurrentSensorTable
    force_sensor: ForceSensorRangeTable | None = None  # None for a robot that measures no interaction torque
    optical: OpticalTable
    range: MotionLimitsTable
    loop: LoopTable
    sampling: SamplingTable
    drawn: Ranges = Field(default_factory=dict)  # ranges of the constants of further rigs, by dotted path
