"""Tables that the files of several rigs have: motors with their sensors, limits, multisines and EMG amplifiers."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .constants import (
    Acceleration,
    Angle,
    ClockDrift,
    Current,
    EmgRate,
    EncoderCounts,
    Frequency,
    GearRatio,
    Inertia,
    Memory,
    Noise,
    PositiveAngle,
    PositiveSpeed,
    Quantum,
    RigTable,
    Share,
    Text,
    Torque,
    TorqueConstant,
    TorqueLimit,
    Voltage,
    WaveNumber,
)


class MultisineTable(RigTable):
    """``[multisine]``: a random-phase multisine, which shows how far a linear model can hold."""

    asked: bool  # whether multisines are recorded in place of the rig's own protocol
    realisations: Annotated[int, Field(ge=1, le=70)]  # number of fitted realisations; one more is held out
    periods: Annotated[int, Field(ge=2, le=30)]  # number of measured periods of each realisation
    settle: Annotated[int, Field(ge=0, le=100)]  # number of periods before the measured ones
    low: Frequency  # lower end of the excited band [Hz]
    high: Annotated[Frequency, Field(le=1000.0)]  # upper end of the excited band [Hz]
    resolution: Annotated[float, Field(ge=0.01, le=1.0)]  # frequency resolution, one over the period [Hz]
    lines: Literal["full", "odd", "odd_random"]  # harmonics of the band that are excited
    rms: PositiveAngle  # root mean square of the motion [rad]
    peak: PositiveAngle  # largest angle that a realisation may reach [rad]
    fall: Annotated[float, Field(ge=0.0, le=100.0)]  # amplitudes are proportional to frequency to minus this power
    centre: Angle  # angle about which the joint moves [rad]
    poles: Annotated[int, Field(ge=1, le=20)]  # number of poles of the fitted transfer function


class EmgTable(RigTable):
    """The part of ``[emg]`` that all rigs with EMG have: the amplifier and its disturbances."""

    muscles: Annotated[tuple[Text, ...], Field(min_length=1, max_length=64)]  # names of the recorded channels
    rate: EmgRate  # sampling rate [Hz]
    band: tuple[Frequency, Frequency]  # lower and upper corner of the amplifier [Hz]
    median_frequency: Annotated[float, Field(ge=1.0, le=1000.0)]  # median of the EMG's power spectrum [Hz]
    baseline: Voltage  # noise of amplifier and skin, RMS [V]
    hum: Voltage  # amplitude of the mains hum at its first harmonic [V]
    hum_frequency: Frequency  # frequency of the mains [Hz]
    harmonics: Annotated[tuple[Share, ...], Field(max_length=50)]  # amplitude of each harmonic over `hum` [1]
    artefact: Annotated[float, Field(ge=0.0, le=1.0)]  # motion artefact per acceleration of the limb [V*s^2/rad]
    artefact_band: Frequency  # upper corner of the motion artefact [Hz]
    crosstalk: Share  # share of every other channel's EMG in a channel [1]
    quantum: Quantum  # step of the converter [V]
    full_range: Annotated[Voltage, Field(ge=1e-6)]  # largest voltage of either sign [V]
    clock_drift: ClockDrift  # share by which the amplifier's clock is fast [1]


class MotorEncoderTable(RigTable):
    """``[encoder]``: the encoder on the shaft of a motor."""

    counts_per_turn: EncoderCounts  # counts in one turn of the motor [1]
    noise: Noise  # standard deviation of the reading at the joint before it is rounded to counts [rad]


class CurrentSensorTable(RigTable):
    """``[current_sensor]``: the sensor of a motor's current."""

    noise: Noise  # standard deviation of the reading [A]
    noise_memory: Memory  # correlation time of that noise [s]
    quantum: Quantum  # step in which currents are stored [A]


class ForceSensorRangeTable(RigTable):
    """``[force_sensor]`` of a robot: the sensor of the interaction torque between robot and wearer."""

    range: TorqueLimit  # largest reading of either sign [N*m]


class MotorTable(RigTable):
    """``[motor]``: the motor and its amplifier."""

    rotor_inertia: Inertia  # inertia of the rotor about its own axis [kg*m^2]
    torque_constant: TorqueConstant  # torque of the motor per ampere [N*m/A]
    gear_ratio: GearRatio  # angle of the motor over the angle of the joint [1]
    current_limit: Current  # largest current of the amplifier [A]
    ripple_amplitude: Torque  # torque ripple at the joint [N*m]
    ripple_wave_number: WaveNumber  # phase of the ripple per angle of the joint [1/rad]


class MotionLimitsTable(RigTable):
    """Limits of the requested motions: ``[range]``, ``[motion_range]``."""

    low: Angle  # smallest angle [rad]
    high: Angle  # largest angle [rad]
    velocity: PositiveSpeed  # largest speed [rad/s]
    acceleration: Acceleration  # largest acceleration [rad/s^2]
