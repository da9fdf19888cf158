"""Simulated sessions of the pointing experiment: one person in one condition, movement by movement."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from pellucid import _core
from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.supervised import supervised
from pellucid.controllers.supervisor_faults import NO_FAULT
from pellucid.models.simulate import substeps_for
from pellucid.people.movements import Kinematics, MovementRule, Stretch, kinematics

from ..processes import results_from_threads
from ..rig import Outcome
from .load_learning import load_regressor, update_expected_load
from .movement_choice import preferred_duration
from .people import Person, parameter_names, person_model

if TYPE_CHECKING:
    from .plant import PointingPlant

SIGNAL_NAMES = (
    "position",
    "velocity",
    "acceleration",
    "encoder",
    "interaction",
    "command",
    "flexor",
    "extensor",
    "link",
)
"""Signals of a movement, in the core's order.

Position, velocity and acceleration of the forearm (rad, s), the robot's encoder [rad], torque of the wearer on the
robot and torque commanded by the law [N*m], excitations of flexors and extensors [1], and the velocity of the robot's
link [rad/s]."""

DRAWN_NOISE_S = 5.0
"""Duration of the noise that is drawn for a movement [s]; in a longer movement the noise repeats."""

FELT_SAMPLE_PERIODS = 10
"""Control periods between two samples of the load that a person feels: 100 samples a second at 1 kHz."""

MIN_REACTION_S = 0.12
"""Shortest reaction time [s]; a drawn time below it is raised to it.

Chosen by judgement; no measurement is recorded."""

EMG_GAIN_SD = 0.1
"""Standard deviation of the torque estimated from EMG over the true torque, between sessions [1].

Chosen by judgement; no measurement is recorded."""


class RobotLaw(Protocol):
    """A control law of the robot, as the core takes it."""

    kind: str  # "position_prediction", "directional" or "transparent"; "none" for a robot without power
    parameters: np.ndarray | None  # (k,) parameters in the core's order, SI
    sensed: bool  # whether the law gets a force sensor
    emg: bool  # whether the law gets EMG


CONTROL_CONDITION = "Ctrl"
"""Name of the control condition, in which no robot is worn."""

Conditions = Mapping[str, Callable[[Person, float], RobotLaw] | None]
"""Conditions by name: a function that builds a law for a person and a place of the carriage [m]; None for no robot."""


@dataclass(frozen=True)
class Unpowered:
    """The law of a robot that is worn while its motor is off."""

    kind: str = "none"
    parameters: np.ndarray | None = None
    sensed: bool = False
    emg: bool = False


@dataclass(frozen=True)
class Reach:
    """One simulated movement."""

    amplitude: float  # signed angle from the previous target to this one [rad]; positive lifts the forearm
    target: float  # [rad]
    duration: float  # duration of the primary movement, as the person chose it [s]
    begin: int  # index of the first sample, in which the target steps
    end: int  # index after the last sample, in which the next target appears
    expected: np.ndarray  # (5,) load that the person expected, in the order of `load_learning.load_regressor`
    held: bool = True  # whether the person held the target; if not, the time for the movement ran out
    # State of the person after the movement, as `_core.WornElbow.lasting` names it: co-contraction and fatigue [1],
    # effort [s], late error [rad], number of corrections, whether the person gave up
    lasting: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class PointingSession:
    """The true signals of one person in one condition, without pauses."""

    person: Person
    condition: str
    fs: float  # sampling rate [Hz]
    target: np.ndarray  # (n,) [rad]
    signals: dict[str, np.ndarray]  # shape (n,) each, by `SIGNAL_NAMES`
    movements: tuple[Reach, ...]
    fault: str  # fault that the law's supervisor has latched at the end; "none" for none


def true_motion(session: PointingSession, rule: MovementRule) -> tuple[Kinematics, list[Stretch]]:
    """Return the forearm's true motion, filtered as a recorded angle is, and the stretch of time of each movement."""
    seconds = np.arange(len(session.target)) / session.fs
    stretches = [Stretch(m.begin / session.fs, m.end / session.fs, m.amplitude) for m in session.movements]
    return kinematics(seconds, session.signals["position"], rule), stretches


def draw_session_lifts(rig: PointingPlant, rng: np.random.Generator) -> np.ndarray:
    """Draw the order of one condition's upward movements; return their amplitudes, shape (n,) [rad]."""
    pointing = rig["pointing"]
    return np.deg2rad(rng.permutation(np.repeat(pointing["amplitudes"], pointing["repetitions"])))


def simulate_session(
    rig: PointingPlant,
    person: Person,
    condition: str,
    law: RobotLaw | None,
    rng: np.random.Generator,
    lifts: np.ndarray | None = None,
) -> PointingSession:
    """Simulate the movements of one person in one condition.

    Parameters
    ----------
    rig : PointingPlant
    person : Person
    condition : str
        Name of the condition.
    law : RobotLaw or None
        Law of the robot; None if no robot is worn.
    rng : numpy.random.Generator
    lifts : ndarray, optional
        Amplitudes of the upward movements, shape (n,) [rad], each followed by the same movement downwards;
        by default from `draw_session_lifts`.

    Returns
    -------
    PointingSession
    """
    pointing, planning, choice = rig["pointing"], rig["planning"], rig["choice"]
    vector, fs = person.vector(rig), 1.0 / rig.period
    reference, width = pointing["reference"], planning["sign_width"]
    lifts = draw_session_lifts(rig, rng) if lifts is None else np.asarray(lifts, float)
    expected, moved_inertia = np.zeros(5), person.moved.inertia
    arm = _strapped(rig, person, vector, law, reference, rng)
    max_samples, noise_samples = round(pointing["longest"] * fs), round(DRAWN_NOISE_S * fs)
    sensor = rig["force_sensor"]
    offset = sensor["offset"] * rng.standard_normal()
    drift = sensor["drift"] * rng.standard_normal()
    noise_scale = np.array([1.0, 1.0, rig.robot["encoder"]["noise"], 1.0, 1.0])
    outputs, movements, targets, now, position = [], [], [], 0, reference
    for lift in lifts:
        for target in (reference + lift, reference):
            amplitude = target - position
            dynamics = (
                moved_inertia + max(expected[0], 0.0),
                rig.constants.arm.viscous + max(expected[1], 0.0),
                max(expected[2], 0.0),
            )
            duration = preferred_duration(amplitude, dynamics, person.reward, choice, width)
            duration *= float(np.exp(planning["pace_spread"] * rng.standard_normal()))
            reach = planning["reach"] + planning["reach_spread"] * rng.standard_normal()
            reaction = max(planning["reaction"][0] + planning["reaction"][1] * rng.standard_normal(), MIN_REACTION_S)
            error = None
            if law is not None and law.sensed:
                time = (now + np.arange(noise_samples)) / fs
                error = offset + drift * time + sensor["noise"] * rng.standard_normal(noise_samples)
            output = arm.move(
                target=target,
                amplitude=reach * amplitude,
                duration=duration,
                reaction=reaction,
                load=expected,
                tolerance=pointing["tolerance"],
                hold=pointing["hold"],
                noise=noise_scale * rng.standard_normal((noise_samples, 5)),
                longest=max_samples,
                sensor_error=error,
                emg=law is not None and law.emg,
                command=getattr(law, "command", None),
            )
            n = len(output[0])
            movements.append(Reach(amplitude, target, duration, now, now + n, expected, n < max_samples, arm.lasting))
            outputs.append(output)
            targets.append(np.full(n, target))
            now, position = now + n, target
            if law is not None:
                q, v, a, load = (output[i][::FELT_SAMPLE_PERIODS] for i in (0, 1, 2, 4))
                expected = update_expected_load(expected, load_regressor(q, v, a, width), load, rig["learning"])
    signals = {}
    for i, name in enumerate(SIGNAL_NAMES):
        signals[name] = np.concatenate([output[i] for output in outputs])
        # A movement's part is released once it is joined, which halves the memory of a session.
        outputs = [(*output[:i], None, *output[i + 1 :]) for output in outputs]
    return PointingSession(person, condition, fs, np.concatenate(targets), signals, tuple(movements), arm.fault)


def standstill_speed(rig: PointingPlant, person: Person, law: RobotLaw, *, lift: float = 0.4) -> float:
    """Return the largest speed of the robot between two and three seconds after a movement over a `lift` [rad/s].

    The lift is in rad. The person moves without noise and corrections. The speed is exactly 0 where friction holds the
    robot, and not small in a limit cycle. It is infinite where the supervisor had to stop the robot.
    """
    vector = person.vector(rig)
    vector[parameter_names(rig).index("tolerance")] = 1e3
    reference, fs = rig["pointing"]["reference"], 1.0 / rig.period
    arm = _strapped(rig, person, vector, law, reference, np.random.default_rng(0))
    n = round(4.0 * fs)
    # The force sensor keeps its noise: the supervisor takes a sensor for lost that is exactly zero throughout slack.
    noise = rig["force_sensor"]["noise"] * np.random.default_rng(0).standard_normal(n)
    moved = arm.move(
        target=reference + lift, amplitude=lift, duration=0.8, reaction=0.2, load=np.zeros(5), tolerance=0.0,
        hold=1e9, noise=np.zeros((n, 5)), longest=n, sensor_error=noise if law.sensed else None, emg=law.emg,
    )  # fmt: skip
    if arm.fault != NO_FAULT:
        return float("inf")
    return float(np.abs(moved[SIGNAL_NAMES.index("link")][-round(fs) :]).max())


def _strapped(
    rig: PointingPlant,
    person: Person,
    vector: np.ndarray,
    law: RobotLaw | None,
    position: float,
    rng: np.random.Generator,
) -> _core.WornElbow:
    """Return the core's model of a person at rest at a `position` [rad], in the robot if there is a `law`."""
    robot, motor = rig.robot, rig.robot["motor"]
    drive = [robot.gain, motor["current_limit"], motor["ripple_amplitude"], motor["ripple_wave_number"], robot.quantum]
    return _core.WornElbow(
        vector,
        np.zeros(5),
        position0=position,
        robot=None if law is None else robot.plant(person.slider(rig)),
        strap=rig.strap,
        drive=drive,
        law="none" if law is None else law.kind,
        law_parameters=None if law is None else law.parameters,
        emg_gains=1.0 + EMG_GAIN_SD * rng.standard_normal(2),
        substeps=substeps_for(rig.period),
        person=person_model(rig),
        sensor_delay=round(rig["force_sensor"]["delay"] / rig.period),
        supervisor=_supervisor_parameters(rig, law),
    )


def _supervisor_parameters(rig: PointingPlant, law: RobotLaw | None) -> np.ndarray | None:
    """Return the parameters of a law's supervisor, shape (m,), or None if no law drives the robot.

    There is no start-up test, because the robot was tested before it was put on.
    """
    if not isinstance(law, ControlLaw):
        return getattr(law, "supervisor", None)
    return supervised(law, instruments=rig.robot.instruments, start_up=False).supervisor


def simulate_sessions(
    jobs: Sequence[tuple], *, threads: int = 1, then: Callable[[PointingSession], Outcome] = lambda session: session
) -> list[Outcome]:
    """Simulate several sessions in threads; each job holds the arguments of `simulate_session`.

    The result holds what the function `then` returns for each session. Threads help because the core releases Python's
    lock while it moves an arm.
    """

    def one(*job: Any) -> Outcome:
        return then(simulate_session(*job))

    return list(results_from_threads([(one, *job) for job in jobs], threads))
