"""The constants of people who point with the forearm, as their files state them.

People differ in a number ``NAME`` of some tables if the table also has ``NAME_spread``, the standard deviation of the
number's natural logarithm between people. The order of these fields is the order in which people are drawn.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ..constants import (
    Age,
    Angle,
    AngleSize,
    BodyHeight,
    BodyMass,
    CamerasTable,
    Compliance,
    Coordinate,
    Delay,
    LogarithmSpread,
    Motion,
    Noise,
    OptionalStiffness,
    PerSecond,
    PositiveAngle,
    PositiveSpeed,
    Repetitions,
    RigConstants,
    RigTable,
    Share,
    SignedShare,
    Stiffness,
    Text,
    TimeConstant,
    Torque,
    Viscosity,
)
from ..shared_tables import EmgTable

OptionalSpread = LogarithmSpread | None
"""Standard deviation of a number's natural logarithm between people [1]; None means that people do not differ."""

AmplitudeDegrees = Annotated[float, Field(ge=0.1, le=180.0)]
"""Amplitude of a movement [degrees]."""


class RobotTable(RigTable):
    """``[robot]``: the robot that is worn and its strap; names that begin with ``strap_`` are those of the core."""

    rig: Text  # name of the robot's rig
    strap_stiffness: Stiffness  # stiffness of the strap about the elbow [N*m/rad]
    strap_damping: Viscosity  # damping of the strap about the elbow [N*m*s/rad]
    strap_hardening: AngleSize = 0.0  # angle at which the tangent stiffness has doubled; 0 means a linear strap [rad]
    strap_slack: AngleSize = 0.0  # whole gap of the play in the padding [rad]
    strap_relaxing_stiffness: OptionalStiffness = 0.0  # stiffness that skin and muscle lose over time [N*m/rad]
    strap_relaxation_time: Annotated[float, Field(ge=0.0, le=1e4)] = 0.0  # time constant of that loss [s]
    strap_hold: Torque = 0.0  # torque above which the strap creeps over the skin [N*m]
    strap_mobility: Compliance = 0.0  # speed of the creep per torque above that [rad/(N*m*s)]
    strap_across: SignedShare = 0.0  # offset of the elbow's axis across the lever, over the lever [1]
    strap_along: SignedShare = 0.0  # offset of the elbow's axis along the lever, over the lever [1]
    strap_fitted: Angle = 0.0  # angle at which the strap was put on [rad]
    splint: Coordinate  # distance from the wrist back to the carriage's marker [m]


class PeopleTable(RigTable):
    """``[people]``: who takes part."""

    count: Annotated[int, Field(ge=1, le=1000)]  # number of people
    age: tuple[Age, Noise]  # mean and standard deviation of the age [years]
    height: tuple[BodyHeight, Noise]  # mean and standard deviation of the height [m]
    mass: tuple[BodyMass, Noise]  # mean and standard deviation of the mass [kg]


class ArmTable(RigTable):
    """``[arm]``: passive elbow and strength."""

    viscous: Viscosity  # viscous friction of a relaxed elbow [N*m*s/rad]
    passive_torque: Torque  # torque of the tissue at the end of extension [N*m]
    passive_angle: Angle  # angle at which the tissue has that torque [rad]
    passive_scale: PositiveAngle  # angle over which that torque changes by the factor e [rad]
    flexion: Annotated[Torque, Field(ge=1e-3)]  # largest torque of the flexors per mass of the body [N*m/kg]
    extension: Annotated[Torque, Field(ge=1e-3)]  # largest torque of the extensors per mass of the body [N*m/kg]


class ReachingMusclesTable(RigTable):
    """``[muscles]`` of people who move with a constant stiffness."""

    stiffness: Stiffness  # stiffness of a moving elbow's muscles without reflexes [N*m/rad]
    stiffness_spread: OptionalSpread = None
    damping: Viscosity  # damping of the same muscles [N*m*s/rad]
    damping_spread: OptionalSpread = None
    reflex_stiffness: OptionalStiffness  # torque of reflexes per angle [N*m/rad]
    reflex_stiffness_spread: OptionalSpread = None
    reflex_damping: Viscosity  # torque of reflexes per speed [N*m*s/rad]
    reflex_damping_spread: OptionalSpread = None
    reflex_delay: Delay  # delay of stretch reflexes up to excitation [s]
    reflex_delay_spread: OptionalSpread = None
    muscle_delay: Delay  # delay from excitation to the first force [s]
    muscle_delay_spread: OptionalSpread = None
    activation_time: TimeConstant  # time constant of the force after that delay [s]
    activation_time_spread: OptionalSpread = None
    cocontraction: Share  # constant activation of both groups over their strength [1]
    cocontraction_spread: OptionalSpread = None
    noise_share: Share  # standard deviation of a muscle's torque over the torque [1]
    noise_share_spread: OptionalSpread = None
    noise_time: TimeConstant  # correlation time of that noise [s]
    noise_time_spread: OptionalSpread = None


class PosturalMusclesTable(RigTable):
    """``[muscles]`` of people whose impedance differs between posture and movement."""

    reflex_stiffness: OptionalStiffness  # torque of reflexes per angle [N*m/rad]
    reflex_stiffness_spread: OptionalSpread = None
    reflex_damping: Viscosity  # torque of reflexes per speed [N*m*s/rad]
    reflex_damping_spread: OptionalSpread = None
    reflex_delay: Delay  # delay of short-latency and long-latency reflexes [s]
    reflex_delay_spread: OptionalSpread = None
    muscle_delay: Delay  # delay from excitation to the first force [s]
    muscle_delay_spread: OptionalSpread = None
    activation_time: TimeConstant  # time constant of the force after that delay [s]
    activation_time_spread: OptionalSpread = None
    noise_share: Share  # standard deviation of a muscle's torque over the torque [1]
    noise_share_spread: OptionalSpread = None
    noise_time: TimeConstant  # correlation time of the noise of muscles and eye [s]
    noise_time_spread: OptionalSpread = None


class ImpedanceTable(RigTable):
    """``[impedance]``: impedance about the planned movement, of muscles without their reflexes."""

    posture_stiffness: Stiffness  # stiffness of a held elbow [N*m/rad]
    posture_stiffness_spread: OptionalSpread = None
    movement_stiffness: Stiffness  # stiffness of a moving elbow [N*m/rad]
    movement_stiffness_spread: OptionalSpread = None
    posture_damping_ratio: Share  # damping ratio of the arm in posture [1]
    posture_damping_ratio_spread: OptionalSpread = None
    movement_damping_ratio: Share  # damping ratio of the arm in movement [1]
    movement_damping_ratio_spread: OptionalSpread = None
    movement_speed: PositiveSpeed  # speed above which the impedance is that of movement [rad/s]
    movement_speed_spread: OptionalSpread = None
    stiffness_per_torque: Annotated[float, Field(ge=0.0, le=1e3)]  # stiffness per torque of both muscle groups [1/rad]
    stiffness_per_torque_spread: OptionalSpread = None


class CocontractionTable(RigTable):
    """``[cocontraction]``: joint activation of both muscle groups, and fatigue."""

    cocontraction: Share  # smallest joint activation over the strength of either group [1]
    cocontraction_spread: OptionalSpread = None
    cocontraction_most: Share  # largest joint activation [1]
    cocontraction_most_spread: OptionalSpread = None
    cocontraction_rise: Annotated[float, Field(ge=0.0, le=1e3)]  # rise of the joint activation per error [1/rad]
    cocontraction_rise_spread: OptionalSpread = None
    cocontraction_decay: Share  # share by which the rise decays from movement to movement [1]
    cocontraction_decay_spread: OptionalSpread = None
    late_time: TimeConstant  # time within which an error counts as late [s]
    late_time_spread: OptionalSpread = None
    fatigue_rate: PerSecond  # rate at which strength is lost, per excitation [1/s]
    fatigue_rate_spread: OptionalSpread = None
    recovery_rate: PerSecond  # rate at which strength recovers [1/s]
    recovery_rate_spread: OptionalSpread = None


class ReachingVisionTable(RigTable):
    """``[vision]`` of people who correct every error that they see."""

    delay: Delay  # delay from the arm's position to a correction [s]
    delay_spread: OptionalSpread = None
    tolerance: AngleSize  # error that is not corrected [rad]
    tolerance_spread: OptionalSpread = None
    check_share: Share  # time of the first look over the duration of the primary movement [1]
    check_share_spread: OptionalSpread = None
    correction_share: Share  # duration of a correction over the duration of the primary movement [1]
    correction_share_spread: OptionalSpread = None
    correction_least: TimeConstant  # shortest duration of a correction [s]
    correction_least_spread: OptionalSpread = None


class PosturalVisionTable(RigTable):
    """``[vision]`` of people who look at times, correct in part, and give up."""

    delay: Delay  # delay from the arm's position to a correction [s]
    delay_spread: OptionalSpread = None
    visual_noise: AngleSize  # standard deviation of the seen angle [rad]
    visual_noise_spread: OptionalSpread = None
    tolerance_share: Share  # error that is not corrected, over half the target's width [1]
    tolerance_share_spread: OptionalSpread = None
    check_share: Share  # time of the first look over the duration of the primary movement [1]
    check_share_spread: OptionalSpread = None
    correction_share: Share  # duration of a correction over the duration of the primary movement [1]
    correction_share_spread: OptionalSpread = None
    correction_least: TimeConstant  # shortest duration of a correction [s]
    correction_least_spread: OptionalSpread = None
    correction_gain: Share  # share of the seen error that a correction removes [1]
    correction_gain_spread: OptionalSpread = None
    correction_discount: Share  # factor on the next correction after one that did not help [1]
    correction_discount_spread: OptionalSpread = None
    refractory_time: TimeConstant  # time after a look or a correction without another [s]
    refractory_time_spread: OptionalSpread = None
    patience: TimeConstant  # time after which a movement is given up [s]
    patience_spread: OptionalSpread = None
    failures_most: Annotated[float, Field(ge=1.0, le=1e4)]  # number of failed corrections after which it is given up
    failures_most_spread: OptionalSpread = None


class PlanningTable(RigTable):
    """``[planning]``: the primary movement as it is planned."""

    reach: Share  # amplitude of the primary movement over the distance of the target [1]
    reach_spread: Share  # standard deviation of that share from movement to movement [1]
    pace_spread: Share  # standard deviation of the duration's logarithm from movement to movement [1]
    reaction: tuple[TimeConstant, Delay]  # mean and standard deviation of the reaction time [s]
    sign_width: PositiveSpeed  # speed over which expected friction changes its sign [rad/s]


class ChoiceTable(RigTable):
    """``[choice]``: the duration T of a movement has the largest utility (reward - effort) / (1 + discount T)."""

    reward: Annotated[float, Field(ge=1e-3, le=1e5)]  # median of people's value of arriving [J]
    reward_spread: LogarithmSpread  # standard deviation of the reward's logarithm between people [1]
    resting_power: Annotated[float, Field(ge=0.0, le=1e4)]  # cost of time [W]
    efficiency: Annotated[float, Field(ge=1e-3, le=1.0)]  # mechanical work over metabolic energy of muscles [1]
    torque_rate_cost: Annotated[float, Field(ge=0.0, le=1e4)]  # cost per squared torque rate [W/(N*m/s)^2]
    discount: PerSecond  # rate at which value falls with time [1/s]
    shortest: Annotated[float, Field(ge=0.01, le=100.0)]  # shortest duration of a movement [s]
    longest: Annotated[float, Field(ge=0.05, le=100.0)]  # longest duration of a movement [s]


class LearningTable(RigTable):
    """``[learning]``: how a person learns the load of a movement from the felt load."""

    rate: Annotated[float, Field(ge=0.0, le=1.0)]  # share of the felt difference that the next movement takes over [1]
    # Standard deviations of the expected load before learning: inertia [kg*m^2], viscous friction [N*m*s/rad], Coulomb
    # friction, gravity torque per sine and per cosine of the angle [N*m].
    trust: tuple[Noise, Noise, Noise, Noise, Noise]
    felt_noise: Annotated[Noise, Field(ge=1e-6)]  # standard deviation of the felt torque, 100 times a second [N*m]


class OptimalTable(RigTable):
    """``[optimal]``: additional constants of people who control their arm optimally."""

    resting_stiffness: Stiffness  # stiffness of a relaxed elbow [N*m/rad]
    resting_stiffness_spread: OptionalSpread = None
    damping_ratio: Share  # damping ratio of the arm [1]
    damping_ratio_spread: OptionalSpread = None
    feedback_delay: Delay  # delay of sensory feedback [s]
    feedback_delay_spread: OptionalSpread = None
    position_noise: Annotated[AngleSize, Field(ge=1e-9)]  # standard deviation of the felt angle [rad]
    position_noise_spread: OptionalSpread = None
    velocity_noise: Annotated[AngleSize, Field(ge=1e-9)]  # standard deviation of the felt velocity [rad/s]
    velocity_noise_spread: OptionalSpread = None
    phasic_noise_share: Share  # standard deviation of an accelerating command over the command [1]
    phasic_noise_share_spread: OptionalSpread = None
    uncertainty: Torque  # standard deviation of the torque of the unknown load [N*m]
    uncertainty_spread: OptionalSpread = None
    uncertainty_time: TimeConstant  # correlation time of that torque [s]
    uncertainty_time_spread: OptionalSpread = None
    uncertainty_share: Share  # share of that torque that the next movement takes over [1]
    uncertainty_share_spread: OptionalSpread = None
    velocity_weight: Annotated[float, Field(ge=0.0, le=1e4)]  # weight of the end's velocity in the cost [1]
    velocity_weight_spread: OptionalSpread = None
    correction_time: TimeConstant  # duration of a correction [s]
    correction_time_spread: OptionalSpread = None


class PointingEmgTable(EmgTable):
    """``[emg]``: wireless bipolar channels on the arm, a list entry for each of `muscles`."""

    groups: Annotated[tuple[Literal["flexor", "extensor"], ...], Field(max_length=64)]  # group of each muscle
    share: Annotated[tuple[Share, ...], Field(max_length=64)]  # excitation of each muscle over that of its group [1]
    gains: Annotated[tuple[Annotated[float, Field(ge=1e-9, le=10.0)], ...], Field(max_length=64)]  # RMS when full [V]
    gain_spread: LogarithmSpread  # standard deviation of the gains' logarithm between people [1]


class ForceSensorTable(RigTable):
    """``[force_sensor]``: the sensor at the splint."""

    noise: Noise  # standard deviation of a sample [N*m]
    offset: Noise  # standard deviation of the offset from session to session [N*m]
    drift: Noise  # standard deviation of the drift from session to session [N*m/s]
    delay: Annotated[float, Field(ge=0.0, le=1.0)]  # delay of the reading [s]


class PointingTable(RigTable):
    """``[pointing]``: the task."""

    reference: Angle  # angle at which upward movements start [rad]
    amplitudes: Annotated[tuple[AmplitudeDegrees, ...], Field(min_length=1, max_length=50)]  # amplitudes [degrees]
    repetitions: Repetitions  # number of movements of each amplitude in either direction
    block: Annotated[int, Field(ge=1, le=10_000)]  # number of movements between two pauses
    hold: Annotated[float, Field(ge=0.01, le=20.0)]  # time for which the target is held [s]
    tolerance: PositiveAngle  # largest distance from a target that is held [rad]
    longest: Annotated[float, Field(ge=0.1, le=200.0)]  # time after which the next target appears in any case [s]


class ArmCamerasTable(CamerasTable):
    """``[cameras]``: motion capture of a marker at the elbow and one at the wrist."""

    elbow: tuple[Coordinate, Coordinate, Coordinate]  # position of the elbow in the laboratory's frame, z up [m]


class PointingConstants(RigConstants):
    """Tables that the files of all people who point have."""

    motion: Motion = "rotary"  # way in which the joint moves
    lifts: Text = "flexion"  # name of the positive direction
    robot: RobotTable
    people: PeopleTable
    arm: ArmTable
    planning: PlanningTable
    choice: ChoiceTable
    learning: LearningTable
    emg: PointingEmgTable
    force_sensor: ForceSensorTable
    pointing: PointingTable
    cameras: ArmCamerasTable


class ParticipantsConstants(PointingConstants):
    """A file like ``rigs/elbow-participants.toml``."""

    muscles: ReachingMusclesTable
    vision: ReachingVisionTable


class ModelledPeopleTable(PeopleTable):
    """``[people]`` with the model of their movements."""

    model: Text  # one of the core's models of people


class PeopleConstants(PointingConstants):
    """A file like ``rigs/elbow-people.toml``."""

    people: ModelledPeopleTable
    impedance: ImpedanceTable
    muscles: PosturalMusclesTable
    cocontraction: CocontractionTable
    vision: PosturalVisionTable
    optimal: OptimalTable | None = None
