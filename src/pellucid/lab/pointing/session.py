"""The pointing experiment: every person, every condition, movement by movement, on the core's model of both."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ... import _core
from ...control.control_law import ControlLaw
from ...control.supervised import Instruments, supervised
from ...models.simulate import substeps_for
from ...signals.movements import Kinematics, MovementRule, Stretch, kinematics
from .load_learning import load_regressor, update_expected_load
from .movement_choice import preferred_duration
from .people import Person, parameter_names, person_model

if TYPE_CHECKING:
    from .rig import PointingRig

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
"""What a movement returns, in the core's order: the forearm's motion (rad, s), the robot's encoder [rad], torque of the
wearer on the robot and of the law [N*m], excitations [1], and the robot's velocity [rad/s]."""

DRAWN_NOISE_S = 5.0  # s: of noise that is drawn for a movement; one that takes longer hears it again
FELT_SAMPLE_PERIODS = 10  # periods: what is felt is remembered a hundred times a second


class RobotLaw(Protocol):
    """How the robot is driven, as the core takes it."""

    kind: str  # "position_prediction", "directional" or "transparent"; "none" is a robot without power
    parameters: np.ndarray | None  # (k,) SI, in the core's order
    sensed: bool  # sensed, emg: Whether it is given a force sensor, or EMG
    emg: bool


CONTROL_CONDITION = "Ctrl"
"""The condition without a robot."""

Conditions = Mapping[str, Callable[[Person, float], RobotLaw] | None]
"""By condition: a law for a person and the place of the carriage [m]; None where no robot is worn."""


@dataclass(frozen=True)
class Unpowered:
    """A robot that is worn while its motor is off."""

    kind: str = "none"
    parameters: np.ndarray | None = None
    sensed: bool = False
    emg: bool = False


@dataclass(frozen=True)
class Reach:
    """One movement that was made."""

    amplitude: float  # Signed [rad]; positive lifts
    target: float  # [rad]
    duration: float  # Of the primary movement, as chosen [s]
    begin: int  # begin, end: Samples of the recording that are its: from the target's step on, and until the next
    end: int
    expected: np.ndarray  # (5,) What the load was expected to be, in the order of `load_learning.LOADS`
    held: bool = True  # Whether the target was held; if not, the next one came after the longest that is waited
    # What of the person outlasted it, as `_core.WornElbow.lasting` names it: co-contraction and fatigue [1], effort
    # [s], late error [rad], corrections, whether it was given up
    lasting: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class PointingSession:
    """One person in one condition, without its pauses."""

    person: Person
    condition: str
    fs: float  # [Hz]
    target: np.ndarray  # (n,) [rad]
    signals: dict[str, np.ndarray]  # (n,) By `SIGNAL_NAMES`
    movements: tuple[Reach, ...]
    fault: str  # Of the law's supervisor, at the end


def true_motion(session: PointingSession, rule: MovementRule) -> tuple[Kinematics, list[Stretch]]:
    """The forearm's own motion, filtered as an angle record would be, and the time of each movement."""
    seconds = np.arange(len(session.target)) / session.fs
    stretches = [Stretch(m.begin / session.fs, m.end / session.fs, m.amplitude) for m in session.movements]
    return kinematics(seconds, session.signals["position"], rule), stretches


def draw_session_lifts(rig: PointingRig, rng: np.random.Generator) -> np.ndarray:
    """Amplitudes of the upward movements of one condition in random order, shape (n,) [rad]; each comes down again."""
    pointing = rig["pointing"]
    return np.deg2rad(rng.permutation(np.repeat(pointing["amplitudes"], pointing["repetitions"])))


def simulate_session(
    rig: PointingRig,
    person: Person,
    condition: str,
    law: RobotLaw | None,
    rng: np.random.Generator,
    lifts: np.ndarray | None = None,
) -> PointingSession:
    """One person makes the movements of one condition; lifts are amplitudes of the upward ones, shape (n,) [rad], or
    `draw_session_lifts`."""
    pointing, planning, choice = rig["pointing"], rig["planning"], rig["choice"]
    vector, fs = person.vector(rig), 1.0 / rig.period
    reference, width = pointing["reference"], planning["sign_width"]
    lifts = draw_session_lifts(rig, rng) if lifts is None else np.asarray(lifts, float)
    expected, own = np.zeros(5), person.forearm.inertia
    arm = _strapped(rig, person, vector, law, reference, rng)
    most, drawn = round(pointing["longest"] * fs), round(DRAWN_NOISE_S * fs)
    sensor = rig["force_sensor"]
    offset = sensor["offset"] * rng.standard_normal()
    drift = sensor["drift"] * rng.standard_normal()
    noise_scale = np.array([1.0, 1.0, rig.robot["encoder"]["noise"], 1.0, 1.0])
    taken, movements, goals, now, here = [], [], [], 0, reference
    for lift in lifts:
        for goal in (reference + lift, reference):
            amplitude = goal - here
            dynamics = (
                own + max(expected[0], 0.0),
                rig["arm"]["viscous"] + max(expected[1], 0.0),
                max(expected[2], 0.0),
            )
            duration = preferred_duration(amplitude, dynamics, person.reward, choice, width)
            duration *= float(np.exp(planning["pace_spread"] * rng.standard_normal()))
            reach = planning["reach"] + planning["reach_spread"] * rng.standard_normal()
            reaction = max(planning["reaction"][0] + planning["reaction"][1] * rng.standard_normal(), 0.12)
            error = None
            if law is not None and law.sensed:
                time = (now + np.arange(drawn)) / fs
                error = offset + drift * time + sensor["noise"] * rng.standard_normal(drawn)
            moved = arm.move(
                target=goal,
                amplitude=reach * amplitude,
                duration=duration,
                reaction=reaction,
                load=expected,
                tolerance=pointing["tolerance"],
                hold=pointing["hold"],
                noise=noise_scale * rng.standard_normal((drawn, 5)),
                longest=most,
                sensor_error=error,
                emg=law is not None and law.emg,
            )
            n = len(moved[0])
            movements.append(Reach(amplitude, goal, duration, now, now + n, expected, n < most, arm.lasting))
            taken.append(moved)
            goals.append(np.full(n, goal))
            now, here = now + n, goal
            if law is not None:
                q, v, a, load = (moved[i][::FELT_SAMPLE_PERIODS] for i in (0, 1, 2, 4))
                expected = update_expected_load(expected, load_regressor(q, v, a, width), load, rig["learning"])
    signals = {name: np.concatenate([one[i] for one in taken]) for i, name in enumerate(SIGNAL_NAMES)}
    return PointingSession(person, condition, fs, np.concatenate(goals), signals, tuple(movements), arm.fault)


def standstill_speed(rig: PointingRig, person: Person, law: RobotLaw, *, lift: float = 0.4) -> float:
    """Fastest that a robot still moves two seconds after a movement over a lift [rad], of a person without noise and
    corrections [rad/s]: 0 to the bit where friction holds it, a limit cycle where it is not small, infinite where its
    supervisor had to stop it."""
    vector = person.vector(rig)
    vector[parameter_names(rig).index("tolerance")] = 1e3
    reference, fs = rig["pointing"]["reference"], 1.0 / rig.period
    arm = _strapped(rig, person, vector, law, reference, np.random.default_rng(0))
    n = round(4.0 * fs)
    # A force sensor has its noise here too: one that says the same zero all through a strap's slack passes for lost.
    noise = rig["force_sensor"]["noise"] * np.random.default_rng(0).standard_normal(n)
    moved = arm.move(
        target=reference + lift, amplitude=lift, duration=0.8, reaction=0.2, load=np.zeros(5), tolerance=0.0,
        hold=1e9, noise=np.zeros((n, 5)), longest=n, sensor_error=noise if law.sensed else None, emg=law.emg,
    )  # fmt: skip
    if arm.fault != "none":
        return float("inf")
    return float(np.abs(moved[SIGNAL_NAMES.index("link")][-round(fs) :]).max())


def _strapped(
    rig: PointingRig,
    person: Person,
    vector: np.ndarray,
    law: RobotLaw | None,
    position: float,
    rng: np.random.Generator,
) -> _core.WornElbow:
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
        emg_gains=1.0 + 0.1 * rng.standard_normal(2),
        substeps=substeps_for(rig.period),
        person=person_model(rig),
        sensor_delay=round(rig["force_sensor"]["delay"] / rig.period),
        supervisor=_watching(rig, law),
    )


def _watching(rig: PointingRig, law: RobotLaw | None) -> np.ndarray | None:
    """The numbers of a law's supervisor, shape (m,); None where no law drives. The robot was tested before it was put
    on, and its drive obeys."""
    if not isinstance(law, ControlLaw):
        return getattr(law, "supervisor", None)
    robot = rig.robot
    return supervised(law, instruments=Instruments(robot.quantum + 4.0 * robot["encoder"]["noise"], drive=True,
                      drive_limit=robot.gain * robot["motor"]["current_limit"]), start_up=False).supervisor  # fmt: skip


def simulate_sessions(jobs: Sequence[tuple], *, threads: int = 1) -> list[PointingSession]:
    """Simulate several sessions in threads; each job holds the arguments of `simulate_session`.

    Threads help because the core releases Python's lock while it moves an arm.
    """
    if threads <= 1:
        return [simulate_session(*job) for job in jobs]
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(lambda job: simulate_session(*job), jobs))
