"""The constants of a knee orthosis and of the people who wear it, as its file states them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ..constants import (
    Angle,
    AngleSize,
    BodyHeight,
    BodyMass,
    ClockDrift,
    ClockOffset,
    Compliance,
    Coordinate,
    Delay,
    Frequency,
    Gain,
    ImuRate,
    Inertia,
    Length,
    LogarithmSpread,
    Mass,
    Memory,
    Motion,
    Noise,
    OptionalStiffness,
    PerSecond,
    PositiveAngle,
    PositiveSpeed,
    Quantum,
    Rate,
    RigConstants,
    RigTable,
    RootViscosity,
    SampleCount,
    SampleSpan,
    Share,
    SignedShare,
    Speed,
    Stiffness,
    Substeps,
    Text,
    TimeConstant,
    Torque,
    TorqueLimit,
    Viscosity,
    WaveNumber,
)
from ..shared_tables import EmgTable, MultisineTable


class OrthosisTable(RigTable):
    """``[orthosis]``: the shank part, behind the spring."""

    mass: Mass  # mass of the shank part [kg]
    centre: tuple[Coordinate, Coordinate]  # centre of mass along the segment and across it [m]
    inertia: Inertia  # inertia about the joint [kg*m^2]
    bearing_coulomb: Torque  # Coulomb friction of the joint's bearings [N*m]
    bearing_viscous: Viscosity  # viscous friction of the joint's bearings [N*m*s/rad]


class ActuatorTable(RigTable):
    """``[actuator]``: motor and gear on the joint's side; names of friction are those of the core's coupled plant."""

    inertia: Inertia  # inertia of the rotor at the joint [kg*m^2]
    coulomb_positive: Torque  # Coulomb friction at positive velocities [N*m]
    coulomb_negative: Torque  # Coulomb friction at negative velocities [N*m]
    viscous_positive: Viscosity  # viscous friction at positive velocities [N*m*s/rad]
    viscous_negative: Viscosity  # viscous friction at negative velocities [N*m*s/rad]
    viscous_decline: PositiveSpeed  # speed at which the slope of viscous friction has halved [rad/s]
    stribeck: Torque  # additional friction at rest [N*m]
    stribeck_velocity: Speed  # speed at which the additional friction has fallen to 1/e [rad/s]
    load_motoring: Annotated[float, Field(ge=0.0, le=5.0)]  # share of the load lost while the motor drives [1]
    load_generating: Annotated[float, Field(ge=0.0, le=0.9)]  # share of the load lost while the load drives [1]
    square_root: RootViscosity = 0.0  # friction per root of the speed [N*m/(rad/s)^0.5]
    load_rise: Share  # share by which load-dependent friction grows towards rest [1]
    friction_swing: Share  # share by which Coulomb friction varies along the travel [1]
    friction_wave_number: WaveNumber  # phase of that variation per angle of the joint [1/rad]
    presliding_travel: AngleSize = 0.0  # angle over which friction builds up before it slips; 0 means at once [rad]
    motor_limit: TorqueLimit  # largest torque of the motor at the joint [N*m]
    torque_limit: TorqueLimit  # largest torque that may be asked of the spring [N*m]


class SpringTable(RigTable):
    """``[spring]``: the series-elastic spring."""

    stiffness: Stiffness  # stiffness of the spring [N*m/rad]
    damping: Viscosity  # damping of the spring [N*m*s/rad]
    calibration_error: Annotated[float, Field(ge=-0.9, le=9.0)]  # controller's stiffness over the true one, less 1 [1]


class TorqueLoopTable(RigTable):
    """``[torque_loop]``: feed-forward, proportional and integral control of the spring's torque, damped by its rate."""

    kp: Gain  # motor torque per torque error [1]
    ki: Gain  # motor torque per integrated torque error [1/s]
    kd: Gain  # motor torque per rate of the spring's torque [s]
    delay: SampleCount  # samples from a reading to the motor's current
    torque_span: SampleSpan  # number of samples over which the torque's rate is a difference
    substeps: Substeps  # integration steps in a control period


class PositionGainsTable(RigTable):
    """Gains of the position controller in one situation."""

    kp: Gain  # torque per position error [N*m/rad]
    kd: Gain  # torque per rate of the position error [N*m*s/rad]


class PositionLoopTable(RigTable):
    """``[position_loop]``: proportional control with damping around the torque controller."""

    bench: PositionGainsTable  # gains of the orthosis alone
    worn: PositionGainsTable  # gains with a leg in the orthosis
    velocity_span: SampleSpan  # number of samples over which the velocity is a difference


class EncodersTable(RigTable):
    """``[encoders]``: the encoders on both sides of the spring."""

    motor: Quantum  # angle per count between gear and spring [rad]
    output: Quantum  # angle per count behind the spring [rad]
    rate: Rate  # rate of the controller and of the recording [Hz]


class StrapTable(RigTable):
    """``[strap]``: the cuff of every wearer who does not state otherwise; names are those of the core's strap."""

    hardening: AngleSize = 0.0  # angle at which the tangent stiffness has doubled; 0 means a linear strap [rad]
    slack: AngleSize  # whole gap of the play in padding and cloth [rad]
    relaxing_stiffness: OptionalStiffness = 0.0  # stiffness that skin and muscle lose over time [N*m/rad]
    relaxation_time: Annotated[float, Field(ge=0.0, le=1e4)] = 0.0  # time constant of that loss [s]
    hold: Torque  # torque above which the cuff creeps over the skin [N*m]
    mobility: Compliance  # speed of the creep per torque above that [rad/(N*m*s)]
    across: SignedShare = 0.0  # offset of the knee's axis across the lever, over the lever [1]
    along: SignedShare = 0.0  # offset of the knee's axis along the lever, over the lever [1]
    askew_spread: Share = 0.0  # standard deviation of either offset between drawn wearers [1]
    fitted: Angle = 0.0  # angle at which the cuff was put on [rad]


class SubjectStrapTable(RigTable):
    """``[subjects.NAME.strap]``: one wearer's strap; omitted keys are as in ``[strap]``."""

    stiffness: OptionalStiffness  # stiffness of the cuff; 0 couples nothing [N*m/rad]
    damping: Viscosity  # damping of the cuff [N*m*s/rad]
    hardening: AngleSize | None = None  # as in ``[strap]`` [rad]
    slack: AngleSize | None = None  # as in ``[strap]`` [rad]
    relaxing_stiffness: OptionalStiffness | None = None  # as in ``[strap]`` [N*m/rad]
    relaxation_time: Annotated[float, Field(ge=0.0, le=1e4)] | None = None  # as in ``[strap]`` [s]
    hold: Torque | None = None  # as in ``[strap]`` [N*m]
    mobility: Compliance | None = None  # as in ``[strap]`` [rad/(N*m*s)]
    across: SignedShare | None = None  # as in ``[strap]`` [1]
    along: SignedShare | None = None  # as in ``[strap]`` [1]
    fitted: Angle | None = None  # as in ``[strap]`` [rad]


class PlateTable(RigTable):
    """``[plate]``: a rigid plate that replaces the straps."""

    stiffness: Stiffness  # stiffness between plate and shank [N*m/rad]
    damping: Viscosity  # damping between plate and shank [N*m*s/rad]


class PassiveTable(RigTable):
    """``[passive]``: ligaments at the end of extension, of every knee."""

    torque: Torque  # torque of the ligaments at `angle` [N*m]
    angle: Angle  # angle at which the ligaments have that torque [rad]
    scale: PositiveAngle  # angle over which the torque changes by the factor e [rad]


class MusclesTable(RigTable):
    """``[muscles]``: muscles of every wearer."""

    delay: Delay  # delay from excitation to the first force [s]
    activation: TimeConstant  # time constant of each of two lags in series [s]
    shape: Annotated[float, Field(ge=-20.0, le=-1e-3)]  # s; torque is (exp(s a) - 1) / (exp(s) - 1) of activation a
    angle_slope: Annotated[float, Field(ge=0.0, le=10.0)]  # relative strength that flexors gain per flexion [1/rad]
    best_angle: Angle  # angle at which the stated strengths hold [rad]
    slowing: Annotated[float, Field(ge=0.0, le=10.0)]  # relative torque that is lost per speed of shortening [s/rad]
    variability: Share  # standard deviation of signal-dependent noise of the excitation [1]
    variability_memory: Memory  # correlation time of that noise [s]
    unseen: Share  # standard deviation of synergists' part of the torque, which no electrode shows [1]
    unseen_memory: Memory  # correlation time of that part [s]
    fatigue: PerSecond  # share of the torque that a muscle loses per time at full excitation [1/s]
    fatigue_emg: PerSecond  # share by which the EMG grows per time at full excitation [1/s]


class WearerTable(RigTable):
    """``[wearer]``: how all wearers move."""

    cocontraction: Torque  # torque of both sides at once, without need [N*m]
    bracing: Torque  # torque of both sides at once while an angle is held [N*m]
    foresight: Delay  # time by which planned excitations are sent earlier [s]
    reflex_delay: Delay  # delay of reflexes to the excitation [s]
    stiffness: Stiffness  # torque of reflexes per angle error [N*m/rad]
    damping: Viscosity  # torque of reflexes per velocity error [N*m*s/rad]
    integral: Gain  # torque per integrated angle error [N*m/(rad*s)]
    resistance: Torque  # friction of the orthosis that the wearer expects [N*m]
    resistance_speed: PositiveSpeed  # speed above which that friction is expected in full [rad/s]
    learning: Gain  # rate at which the expected friction is learned [N*m/rad]
    load_memory: TimeConstant  # time constant over which a load is felt [s]
    load_share: Share  # share of the felt load that the wearer carries [1]
    drift: AngleSize  # standard deviation of the believed angle while an angle is held [rad]
    drift_memory: Memory  # correlation time of that drift [s]
    tremor: Torque  # amplitude of tremor, RMS [N*m]
    tremor_frequency: Frequency  # mean frequency of tremor [Hz]
    spontaneous: Share  # excitation of a muscle at rest [1]
    spontaneous_memory: Memory  # correlation time of that excitation [s]
    not_relaxed: Share  # excitation of a subject who helps although asked not to [1]


class SwingTable(RigTable):
    """``[swing]``: a free swing."""

    centre: Angle  # centre of the swing [rad]
    amplitude: tuple[AngleSize, AngleSize]  # smallest and largest amplitude [rad]
    frequency: tuple[Frequency, Frequency]  # slowest and fastest frequency [Hz]
    memory: Memory  # time over which amplitude and frequency change [s]
    sharpness: Share  # amplitude of the second harmonic over that of the first [1]


class KneeEmgTable(EmgTable):
    """``[emg]``: one amplifier with two bipolar channels."""

    gain_spread: LogarithmSpread  # standard deviation of the gains' logarithm from session to session [1]


class ImuTable(RigTable):
    """``[imu]``: an inertial sensor on the ankle or on the orthosis."""

    rate: ImuRate  # sampling rate [Hz]
    jitter: Delay  # standard deviation of the time of a sample; its time stamp has the true time [s]
    lever: tuple[Share, Coordinate]  # place on the ankle: along the shank over its length [1], across it [m]
    orthosis_lever: tuple[Coordinate, Coordinate]  # place on the orthosis along the segment and across it [m]
    mounting: tuple[Angle, Angle, Angle]  # rotation vector from the segment to the sensor [rad]
    remounting: AngleSize  # standard deviation of that rotation about each axis when the sensor moves [rad]
    heading: Angle  # angle from magnetic north to the plane of flexion [rad]
    magnetometer: bool  # whether the sensor has a magnetometer
    accelerometer_noise: Noise  # standard deviation of the acceleration [m/s^2]
    accelerometer_bias: Noise  # standard deviation of each axis's offset between sessions [m/s^2]
    gyroscope_noise: Noise  # standard deviation of the angular velocity [rad/s]
    gyroscope_bias: Noise  # standard deviation of each axis's offset between sessions [rad/s]
    gyroscope_drift: Noise  # standard deviation of the drifting part of the offset [rad/s]
    gyroscope_memory: Memory  # correlation time of that drift [s]
    magnetometer_noise: Noise  # standard deviation of the magnetic field [T]
    magnetometer_bias: Noise  # standard deviation of each axis's offset [T]
    disturbance: Noise  # standard deviation of the field of steel and currents nearby [T]
    disturbance_memory: Memory  # correlation time of that field [s]
    field: Annotated[float, Field(ge=1e-7, le=1e-3)]  # strength of the earth's field [T]
    dip: Angle  # angle of the earth's field below the horizontal [rad]
    sway: AngleSize  # standard deviation of the angle of the thigh that stands still [rad]
    sway_memory: Memory  # correlation time of that sway [s]
    quanta: tuple[Quantum, Quantum, Quantum]  # steps of acceleration [m/s^2], angular velocity [rad/s], field [T]
    clock_offset: ClockOffset  # start of the sensor's recording after the actuator's [s]
    clock_offset_spread: Noise  # standard deviation of that offset from recording to recording [s]
    clock_drift: ClockDrift  # share by which the sensor's clock is fast [1]


class LimbTable(RigTable):
    """``[subjects.NAME] limb``: shank and foot."""

    mass: Mass  # mass of shank and foot [kg]
    centre: Length  # distance of the centre of mass from the knee [m]
    gyration: Length  # radius of gyration about the centre of mass [m]
    ahead: Angle  # angle of the centre of mass in front of the shank [rad]
    viscous: Viscosity  # viscous friction of the knee [N*m*s/rad]


class StrengthTable(RigTable):
    """``[subjects.NAME] strength``: largest torque of each muscle group."""

    rectus_femoris: TorqueLimit  # largest torque of the extensors [N*m]
    lateral_hamstring: TorqueLimit  # largest torque of the flexors [N*m]


class EmgGainTable(RigTable):
    """``[subjects.NAME] emg_gain``: RMS of the EMG at full excitation."""

    rectus_femoris: Annotated[float, Field(ge=1e-9, le=10.0)]  # gain of the extensors' channel [V]
    lateral_hamstring: Annotated[float, Field(ge=1e-9, le=10.0)]  # gain of the flexors' channel [V]


class SubjectTable(RigTable):
    """``[subjects.NAME]``: a wearer of the orthosis."""

    sex: Text  # "female" or "male"
    age: Annotated[int, Field(ge=1, le=150)]  # age [years]
    weight: BodyMass  # mass of the body [kg]
    height: BodyHeight  # height [m]
    shank_length: Length  # distance from knee to heel [m]
    limb: LimbTable
    strap: SubjectStrapTable
    strength: StrengthTable
    emg_gain: EmgGainTable


class KneeConstants(RigConstants):
    """A file like ``rigs/knee-orthosis.toml``."""

    motion: Motion = "rotary"  # way in which the joint moves
    lifts: Text = "flexion"  # name of the positive direction
    orthosis: OrthosisTable
    actuator: ActuatorTable
    spring: SpringTable
    torque_loop: TorqueLoopTable
    position_loop: PositionLoopTable
    encoders: EncodersTable
    strap: StrapTable
    plate: PlateTable
    passive: PassiveTable
    muscles: MusclesTable
    wearer: WearerTable
    swing: SwingTable
    emg: KneeEmgTable
    imu: ImuTable
    multisine: MultisineTable | None = None
    subjects: Annotated[dict[Text, SubjectTable], Field(min_length=1, max_length=1000)]
