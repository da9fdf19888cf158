"""The constants of a joint on a bench, as its file states them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ..constants import (
    AngleSize,
    Current,
    Duration,
    EncoderCounts,
    Gain,
    GearRatio,
    Memory,
    Motion,
    Noise,
    Rate,
    RigConstants,
    RigTable,
    RootViscosity,
    SampleCount,
    SampleSpan,
    SignedTorque,
    Speed,
    Text,
    Torque,
    TorqueConstant,
    Viscosity,
    WaveNumber,
)
from ..shared_tables import MotionLimitsTable, MultisineTable


class JointTable(RigTable):
    """``[joint]``: the moving part, in the order of the core's parameters; an omitted constant is 0."""

    inertia: Annotated[float, Field(ge=0.0, le=1e4)] = 0.0  # inertia about the axis with the reflected rotor [kg*m^2]
    gravity_sine: SignedTorque = 0.0  # gravity torque per sine of the angle [N*m]
    gravity_cosine: SignedTorque = 0.0  # gravity torque per cosine of the angle [N*m]
    offset: SignedTorque = 0.0  # constant torque, for example of a cable's pull [N*m]
    coulomb_positive: Torque = 0.0  # Coulomb friction at positive velocities [N*m]
    coulomb_negative: Torque = 0.0  # Coulomb friction at negative velocities [N*m]
    viscous_positive: Viscosity = 0.0  # viscous friction at positive velocities [N*m*s/rad]
    viscous_negative: Viscosity = 0.0  # viscous friction at negative velocities [N*m*s/rad]
    stribeck: Torque = 0.0  # additional friction at rest [N*m]
    stribeck_velocity: Speed = 0.0  # speed at which the additional friction has fallen to 1/e [rad/s]
    load_motoring: Annotated[float, Field(ge=0.0, le=5.0)] = 0.0  # share of the load lost while the motor drives [1]
    load_generating: Annotated[float, Field(ge=0.0, le=0.9)] = 0.0  # share of the load lost while the load drives [1]
    square_root: RootViscosity = 0.0  # friction per root of the speed [N*m/(rad/s)^0.5]
    velocity_width: Speed = 0.0  # width of a smooth sign of the velocity; 0 is the true sign [rad/s]
    presliding_travel: AngleSize = 0.0  # angle over which friction builds up before it slips; 0 means at once [rad]


class DriveTable(RigTable):
    """``[drive]``: the motor and the sensor of its current."""

    torque_constant: TorqueConstant  # torque of the motor per ampere [N*m/A]
    gear_ratio: GearRatio  # angle of the motor over the angle of the joint [1]
    ripple_amplitude: Torque  # torque ripple at the joint, which no identified model contains [N*m]
    ripple_wave_number: WaveNumber  # phase of the ripple per angle of the joint [1/rad]
    current_limit: Current  # largest current of the amplifier [A]
    current_noise: Noise  # standard deviation of the measured current [A]
    current_noise_memory: Memory  # correlation time of that noise [s]


class EncoderTable(RigTable):
    """``[encoder]``: the encoder of the joint."""

    counts_per_turn: EncoderCounts  # counts in one turn of the joint [1]
    noise: Noise  # standard deviation of the reading before it is rounded to counts [rad]


class LoopTable(RigTable):
    """``[loop]``: the controller of the machine, at the sampling rate."""

    kind: Literal["cascade"]  # position controller around a velocity controller
    kp: Gain  # velocity per position error [1/s]
    kv: Gain  # current per velocity error [A*s/rad]
    velocity_span: SampleSpan  # number of samples over which the measured velocity is a difference


class SamplingTable(RigTable):
    """``[sampling]``: rate and duration of the recordings."""

    rate: Rate  # rate of the controller and of the recording [Hz]
    duration: Duration  # duration of each recording [s]
    reversals: Annotated[SampleCount, Field(le=100)] = 0  # angles with small slow strokes in two more recordings


class BenchConstants(RigConstants):
    """A file like ``rigs/bench-joint.toml``."""

    motion: Motion  # way in which the joint moves
    lifts: Text  # name of the positive direction
    joint: JointTable = JointTable()
    drive: DriveTable
    encoder: EncoderTable
    loop: LoopTable
    motion_range: MotionLimitsTable
    sampling: SamplingTable
    multisine: MultisineTable | None = None
