"""A walking wearer: the thigh is a base that moves and turns, and the ground pushes at the foot.

Shank and lower part of the orthosis are attached to a knee with the accelerations a_x (forward) and a_y (upward), on
a thigh that leans forward by theta. With the flexion q of the knee, the shank leans back by q - theta, and

    I q'' = torque + I theta'' + m l (a_x cos(q - theta) - (g + a_y) sin(q - theta)).

What this adds to a body on a thigh at rest, with -m g l sin q, is `MovingThigh.added_torque`. The ground's torque about
the knee is what inverse dynamics of the recorded person leaves, while the foot bears weight; it scales with body mass,
and a foot that bears weight also holds the shank where the recorded person had it.

Strides are recorded, or generated where the recordings are not on this machine. A recording may be played faster or
slower; the recorded moment of the knee is kept then, and the ground's torque computed again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pellucid._errors import DatasetError
from pellucid.controllers.coupling import Coupling
from pellucid.models.anthropometry import shank_length, winter
from pellucid.models.joint import GRAVITY
from pellucid.numerics.filters import zero_phase_lowpass
from pellucid.study.datasets.motions import RecordedGait, recorded_gait

from .gait import FADE_IN_S, GAIT_LOWPASS_HZ, generate_walking
from .machine import KneeMachine
from .protocol import KneeTrial
from .subject import KneeSubject
from .trial import Controller
from .wearer import Wearer

GROUND_STIFFNESS_NM_RAD = 150.0
"""Stiffness with which the ground holds the shank of a foot that bears full weight [N*m/rad]. Assumed."""

GROUND_DAMPING_NMS_RAD = 3.0
"""Damping of the same [N*m*s/rad]. Assumed."""

OWN_STIFFNESS_NM_RAD = 30.0
"""Stiffness at once of a walking person's muscles and tissue about the movement that they mean [N*m/rad]. Assumed; a
seated swing of this rig has reflexes alone."""

OWN_DAMPING_NMS_RAD = 1.0
"""Damping of the same [N*m*s/rad]. Assumed."""

BEARING_MOMENT_SHARE = 0.1
"""A foot bears weight while the ankle's moment is above this share of its largest one: without ground an ankle has
hardly any."""

BEARING_LOWPASS_HZ = 6.0
"""Zero-phase low-pass of recorded moments [Hz]."""

HIP_FROM_PELVIS_M = (-0.071, -0.066)
"""Place of the hip from the recorded origin of the pelvis, forward and upward [m], of the anatomical model."""

THIGH_SHARE = 0.245
"""Length of the thigh over body height [1] (Winter)."""

RECORDED_HEIGHT_M = 1.75
"""Height of the recorded person, whom no file describes [m]. Assumed."""

RECORDED_MASS_KG = 70.0
"""Mass of the recorded person [kg]. Assumed."""

RECORDED_SHANK_SHARE = 0.54
"""Moment that swings the recorded shank over that of the anatomical tables' for this height and mass [1].

It is the slope of the recorded moment of the knee over inverse dynamics of the shank, in mid-swing at 8.1 km/h
(correlation 0.98; at 3.6 km/h slope 0.51, correlation 0.83), where no ground touches the foot."""


@dataclass(frozen=True, eq=False)
class MovingThigh:
    """A stretch of walking, one sample a period; arrays have shape (n,)."""

    name: str
    source: str  # where the motion is from, in words
    flexion: np.ndarray = field(repr=False)  # flexion of the knee that the wearer means [rad]
    lean: np.ndarray = field(repr=False)  # angle of the thigh from vertical, positive forward [rad]
    lean_acceleration: np.ndarray = field(repr=False)  # [rad/s^2]
    forward: np.ndarray = field(repr=False)  # acceleration of the knee forward [m/s^2]
    upward: np.ndarray = field(repr=False)  # acceleration of the knee upward [m/s^2]
    ground: np.ndarray = field(repr=False)  # torque of the ground on the shank, in flexion, over body mass [N*m/kg]
    bearing: np.ndarray = field(repr=False)  # share of the foot's full load [1]

    def added_torque(self, k: int | slice, angle, sine: float, cosine: float, inertia: float):
        """Return what the moving thigh adds to the torque on a body at a knee `angle` [N*m].

        `sine` and `cosine` are the body's weight per sin and cos of the angle [N*m], `inertia` is about the knee
        [kg*m^2], and `k` is a sample or a slice of samples.
        """
        at = angle - self.lean[k]
        s, c = np.sin(at), np.cos(at)
        up, ahead = 1.0 + self.upward[k] / GRAVITY, self.forward[k] / GRAVITY
        still = sine * np.sin(angle) + cosine * np.cos(angle)
        return (
            inertia * self.lean_acceleration[k] - up * (sine * s + cosine * c) + ahead * (sine * c - cosine * s) + still
        )

    def outer_torque(self, k: int, angle: float, velocity: float, mass: float, speed: float, holds: float) -> float:
        """Return the torque of the ground, and of the wearer's own impedance, on the shank [N*m].

        `mass` is that of the body [kg].

        `velocity` is that of the knee and `speed` the one that is meant [rad/s]; `holds` is a factor on what holds the
        foot.
        """
        held = holds * self.bearing[k]
        stiffness = OWN_STIFFNESS_NM_RAD + held * GROUND_STIFFNESS_NM_RAD
        damping = OWN_DAMPING_NMS_RAD + held * GROUND_DAMPING_NMS_RAD
        pull = stiffness * (self.flexion[k] - angle) + damping * (speed - velocity)
        return float(mass * self.ground[k] + pull)


def shank_weight(subject: KneeSubject) -> tuple[float, float]:
    """Return a shank's weight per sin and cos of the flexion [N*m]."""
    ahead = subject.limb.ahead
    return subject.gravity * float(np.cos(ahead)), -subject.gravity * float(np.sin(ahead))


def walking_thigh(
    rate: float, duration: float, rng: np.random.Generator, *, pace: float = 1.0, running: bool = False
) -> MovingThigh:
    """Return a stretch of walking at a `rate` [Hz] for a `duration` [s], which begins at rest.

    `pace` is the speed at which a recording is played [1]; `running` selects the recording at 8.1 km/h instead of the
    one at 3.6 km/h.
    """
    try:
        gait, source = recorded_gait("fast" if running else "slow"), "recorded on a treadmill"
    except DatasetError:
        gait, source = generated_gait(rate, duration, rng, 1.6 if running else 1.0), "generated"
    return from_gait(gait, source, rate, duration, rng, pace)


def from_gait(
    gait: RecordedGait, source: str, rate: float, duration: float, rng: np.random.Generator, pace: float
) -> MovingThigh:
    """Return a stretch of a recorded gait, played at a `pace` [1]."""
    fs = gait.rate * pace
    # The low-pass follows the strides, so that a pace changes nothing but time.
    smooth = [
        zero_phase_lowpass(x, corner * pace, 2, fs)
        for x, corner in zip(gait.rows, (*(GAIT_LOWPASS_HZ,) * 5, *(BEARING_LOWPASS_HZ,) * 2), strict=True)
    ]
    n, last = round(duration * rate), (len(smooth[0]) - 1) / fs
    start = rng.uniform(0.0, max(last - duration, 0.0))
    seconds = np.arange(n) / rate
    played = np.arange(len(smooth[0])) / fs
    share = np.clip(seconds / FADE_IN_S, 0.0, 1.0)
    share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    # Interpolated angles would have steps in their speed, whose derivative would be torque.
    from scipy.interpolate import CubicSpline

    flexion, tilt, hip, forward, upward, knee_moment, ankle_moment = (
        CubicSpline(played, x)(np.minimum(start + seconds, last)) for x in smooth
    )
    lean = tilt + hip
    flexion, lean, tilt = (x.mean() + share * (x - x.mean()) for x in (flexion, lean, tilt))
    thigh = THIGH_SHARE * RECORDED_HEIGHT_M
    x, y = HIP_FROM_PELVIS_M
    knee = np.array([
        share * (forward - forward.mean()) + x * np.cos(tilt) - y * np.sin(tilt) + thigh * np.sin(lean),
        share * (upward - upward.mean()) + x * np.sin(tilt) + y * np.cos(tilt) - thigh * np.cos(lean),
    ])  # fmt: skip

    def second(signal: np.ndarray) -> np.ndarray:
        return np.gradient(np.gradient(signal, 1.0 / rate), 1.0 / rate)

    blank = np.zeros(n)
    ankle = np.abs(ankle_moment)
    bearing = np.clip(ankle / np.quantile(ankle, 0.95) / BEARING_MOMENT_SHARE - 1.0, 0.0, 1.0)
    made = MovingThigh(
        gait.name, source, flexion, lean, second(lean), second(knee[0]), second(knee[1]), blank, share * bearing
    )
    shank = winter(RECORDED_MASS_KG, shank_length(RECORDED_HEIGHT_M))
    weight = GRAVITY * shank.mass * shank.centre
    own = made.added_torque(slice(None), flexion, weight, 0.0, shank.inertia) - weight * np.sin(flexion)
    left = RECORDED_SHANK_SHARE * (shank.inertia * second(flexion) - own) - knee_moment
    ground = share * bearing * left / RECORDED_MASS_KG
    return MovingThigh(
        gait.name, source, flexion, lean, made.lean_acceleration, made.forward, made.upward, ground, made.bearing
    )


def generated_gait(rate: float, duration: float, rng: np.random.Generator, pace: float) -> RecordedGait:
    """Return generated strides: knee as in `generate_walking`, thigh as a sine of each stride, moments of stance."""
    flexion = generate_walking(rate, 2.0 * duration, rng)
    n = len(flexion)
    # Heel strike is where the knee's smaller bump begins: a stride's phase is found from the larger one.
    peaks = np.flatnonzero((flexion[1:-1] > flexion[:-2]) & (flexion[1:-1] >= flexion[2:]) & (flexion[1:-1] > 0.8)) + 1
    phase = np.interp(np.arange(n), peaks, np.arange(len(peaks)) + 0.72)
    wave = 2.0 * np.pi * phase
    stance = np.clip(np.sin(np.pi * np.minimum((phase % 1.0) / 0.62, 1.0)), 0.0, 1.0)
    return RecordedGait(
        "generated", rate * pace, flexion, np.zeros(n), 0.08 + 0.35 * np.cos(wave + 0.2), np.zeros(n),
        0.02 * np.cos(2.0 * wave), -25.0 * stance * np.sin(wave), 80.0 * stance,
    )  # fmt: skip


def thigh_trial(name: str, subject: KneeSubject, thigh: MovingThigh, rig: KneeMachine, holds: float = 1.0) -> KneeTrial:
    """Return a trial in which a person walks in the orthosis; `holds` is a factor on what holds a loaded foot."""
    sine, cosine = shank_weight(subject)
    along = thigh.added_torque(slice(None), thigh.flexion, sine, cosine, subject.inertia)
    wearer = Wearer(subject, "swinging", path=thigh.flexion, outside=along + subject.weight * thigh.ground)
    base = WalkingBase(rig, subject, thigh, holds)
    return KneeTrial(
        name, "walking", reference=np.zeros(len(thigh.flexion)), mode="torque", wearer=wearer,
        start=float(thigh.flexion[0]), base=base,
    )  # fmt: skip


class WalkingBase:
    """What a moving thigh and the ground do to an orthosis and to the limb in it, period by period."""

    def __init__(self, rig: KneeMachine, subject: KneeSubject, thigh: MovingThigh, holds: float = 1.0):
        self._thigh, self._subject, self._holds = thigh, subject, holds
        self._orthosis = (*rig.orthosis_gravity, rig.constants.orthosis.inertia)
        self._limb = (*shank_weight(subject), subject.inertia)
        self._speed = np.gradient(thigh.flexion, rig.period)

    def torques(self, k: int, orthosis: float, limb: float, velocity: float) -> tuple[float, float]:
        """Return the torques on orthosis and limb in period `k` [N*m].

        `orthosis` and `limb` are their angles [rad], and `velocity` is the limb's [rad/s].
        """
        thigh = self._thigh
        outer = thigh.outer_torque(k, limb, velocity, self._subject.weight, float(self._speed[k]), self._holds)
        return (
            float(thigh.added_torque(k, orthosis, *self._orthosis)),
            float(thigh.added_torque(k, limb, *self._limb)) + outer,
        )


PHASE_CHANGE_S = 0.03
"""Time constant with which a command goes over from one phase of the gait to the next [s]."""


@dataclass(frozen=True)
class ThighSensor:
    """An inertial sensor on the thigh, near the knee: angle, its acceleration, and the knee's acceleration."""

    angle_error: float = 0.02  # constant error of the angle [rad]
    lowpass: float = 8.0  # corner of the causal low-pass of both accelerations [Hz]


class LawWithThighSensor:
    """A controller that also carries what the moving thigh adds to the identified orthosis, told by a sensor on it."""

    reads_motor_encoder = False

    def __init__(
        self, controller: Controller | None, coupling: Coupling, thigh: MovingThigh, period: float,
        sensor: ThighSensor | None = None,
    ):  # fmt: skip
        sensor = sensor or ThighSensor()
        self._controller, self._period = controller, period
        keep = float(np.exp(-2.0 * np.pi * sensor.lowpass * period))
        from scipy.signal import lfilter

        turned, forward, upward = (
            lfilter([1.0 - keep], [1.0, -keep], x) for x in (thigh.lean_acceleration, thigh.forward, thigh.upward)
        )
        seen = thigh.lean + sensor.angle_error
        self._seen = MovingThigh(
            thigh.name, thigh.source, thigh.flexion, seen, turned, forward, upward, thigh.ground, thigh.bearing
        )
        self._weight, self._inertia = coupling.orthosis_gravity, coupling.orthosis_inertia

    @property
    def fault(self) -> str:
        """Fault that the controller's safety gate has latched; "none" if there is none."""
        return str(getattr(self._controller, "fault", "none"))

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = ()) -> float:
        """Return the command [N*m] of one period; `time` [s], `position` [rad], `torque` [N*m], `emg` [V]."""
        k = min(round(time / self._period), len(self._seen.lean) - 1)
        carried = -float(self._seen.added_torque(k, position, self._weight, 0.0, self._inertia))
        if self._controller is None:
            return carried
        return carried + self._controller.step(time, position, torque - carried, emg)


@dataclass(frozen=True)
class FootSwitch:
    """A switch under the foot that tells stance from swing."""

    load_share: float = 0.1  # share of the foot's full load from which on it is closed [1]
    lateness: float = 0.02  # time after which a law hears of it [s]


class LawWithFootSwitch:
    """A controller whose command is scaled by the phase of the gait: one factor in stance, the whole in swing."""

    reads_motor_encoder = False

    def __init__(
        self, controller: Controller, thigh: MovingThigh, period: float, stance: float, switch: FootSwitch | None = None
    ):
        switch = switch or FootSwitch()
        self._controller, self._period, self._stance = controller, period, stance
        closed, late = thigh.bearing > switch.load_share, round(switch.lateness / period)
        self._closed = np.concatenate([np.full(late, closed[0]), closed[: len(closed) - late]])
        self._factor = 1.0

    @property
    def fault(self) -> str:
        """Fault that the controller's safety gate has latched; "none" if there is none."""
        return str(getattr(self._controller, "fault", "none"))

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = ()) -> float:
        """Return the command [N*m] of one period; `time` [s], `position` [rad], `torque` [N*m], `emg` [V]."""
        k = min(round(time / self._period), len(self._closed) - 1)
        wanted = self._stance if self._closed[k] else 1.0
        self._factor += self._period / PHASE_CHANGE_S * (wanted - self._factor)
        return self._factor * self._controller.step(time, position, torque, emg)
