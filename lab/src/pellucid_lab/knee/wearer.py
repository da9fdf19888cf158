"""Simulated wearer of the virtual orthosis: intended motion, excitations and muscle torques.

Feedforward commands lead, and corrections have the delay of a reflex. Both become excitations of two antagonistic
muscles, and the excitations become torque after an electromechanical delay. Torque is not exactly proportional to
excitation: strength changes with angle and speed, the relation is nonlinear and fatigues, and other muscles share the
load.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ..noise import draw_noise, draw_wandering_path
from .machine import KneeMachine
from .subject import EXTENSOR_MUSCLE, FLEXOR_MUSCLE, KneeSubject


@dataclass(frozen=True)
class Wearer:
    """A subject and their task; `relaxed`, `counteracting`, `swinging`, `following` and `contracting` make one."""

    subject: KneeSubject
    task: Literal["relaxed", "counteracting", "swinging", "contracting"]
    helps: bool = False  # Whether they help although they were asked to relax: a trial that must be found out
    angle: float = 0.0  # That is held by one who counteracts [rad]
    frequency: tuple[float, float] | None = None  # Slowest and fastest swing [Hz], in place of the rig's
    amplitude: tuple[float, float] | None = None  # Smallest and largest swing [rad], in place of the rig's
    # (n,) What is swung through, a sample a period [rad], in place of the rig's swings; rest follows
    path: np.ndarray | None = field(default=None, repr=False, compare=False)
    # (n,) Torque of a moving thigh and of the ground along that path, which the plan counts with [N*m]
    outside: np.ndarray | None = field(default=None, repr=False, compare=False)


def relaxed(subject: KneeSubject, *, helps: bool = False) -> Wearer:
    """One who lets the leg hang; or, with `helps`, was asked to and does not."""
    return Wearer(subject, "relaxed", helps=helps)


def counteracting(subject: KneeSubject, angle: float) -> Wearer:
    """One who holds an angle [rad] against whatever the orthosis does."""
    return Wearer(subject, "counteracting", angle=angle)


def swinging(
    subject: KneeSubject,
    *,
    frequency: tuple[float, float] | None = None,
    amplitude: tuple[float, float] | None = None,
) -> Wearer:
    """Return a wearer who swings the shank freely.

    Frequency [Hz] and amplitude [rad] vary randomly between their limits, by default the rig's. Equal limits give a
    steady swing.
    """
    return Wearer(subject, "swinging", frequency=frequency, amplitude=amplitude)


def following(subject: KneeSubject, path: np.ndarray) -> Wearer:
    """Return a wearer who moves the shank along a `path`, shape (n,) [rad], one sample for each period."""
    return Wearer(subject, "swinging", path=path)


def contracting(subject: KneeSubject) -> Wearer:
    """One who pulls as hard as they can against a frame, with one muscle and then the other."""
    return Wearer(subject, "contracting")


def swing_path(rig: KneeMachine, wearer: Wearer, n: int, rng: np.random.Generator) -> np.ndarray:
    """The angle that a swinging wearer means to go through, shape (n,) [rad]; it begins at rest in the centre."""
    if wearer.path is not None:
        return np.pad(wearer.path, (0, max(n - len(wearer.path), 0)), mode="edge")[:n]
    swing, fs = rig.constants.swing, rig.constants.encoders.rate
    slow, fast = wearer.frequency or swing.frequency
    small, large = wearer.amplitude or swing.amplitude
    pace = slow + (fast - slow) * draw_wandering_path(n, swing.memory, fs, rng)
    size = small + (large - small) * draw_wandering_path(n, swing.memory, fs, rng)
    phase = 2.0 * np.pi * np.cumsum(pace) / fs
    begin = np.clip(np.arange(n) / (2.0 * fs), 0.0, 1.0)
    size = size * begin**2 * (3.0 - 2.0 * begin)
    return swing.centre + size * (np.sin(phase) + swing.sharpness * np.sin(2.0 * phase + 0.6))


def contractions(n: int, fs: float) -> np.ndarray:
    """Excitations of flexor and extensor who each pull twice with all their might, shape (n, 2) [1]."""
    t = np.arange(n) / fs
    made = np.zeros((n, 2))
    slot = t[-1] / 4.0 if n > 1 else 1.0
    for i in range(4):
        # Up within half a second, held, and let go before the next.
        made[:, i % 2] += np.clip(np.minimum((t - (i + 0.15) * slot) / 0.5, ((i + 0.85) * slot - t) / 0.3), 0.0, 1.0)
    return made


class Acting:
    """A wearer during one trial, period by period. `torque` [N*m]; `position`, `load` [rad], [N*m]."""

    def __init__(
        self, rig: KneeMachine, wearer: Wearer, n: int, position: float, load: float, rng: np.random.Generator
    ) -> None:
        fs, self._period = rig.constants.encoders.rate, rig.period
        self._muscles, self._nerves, subject = rig.constants.muscles, rig.constants.wearer, wearer.subject
        m, w = self._muscles, self._nerves
        self._strength = subject.strength[FLEXOR_MUSCLE], subject.strength[EXTENSOR_MUSCLE]
        self._bend = math.expm1(m.shape)
        self._late = round(m.delay * fs)
        self._reflex = round(w.reflex_delay * fs)
        self._rate = 1.0 - math.exp(-self._period / m.activation)
        self._felt_rate = 1.0 - math.exp(-self._period / w.load_memory)
        self._task = wearer.task
        self._both = w.bracing if wearer.task == "counteracting" else w.cocontraction
        waver = 1.0 + draw_noise((2, n), m.variability, m.variability_memory, fs, rng)
        unseen = 1.0 + draw_noise((2, n), m.unseen, m.unseen_memory, fs, rng)
        self._waver = list(zip(*waver.tolist(), strict=True))
        self._unseen = list(zip(*unseen.tolist(), strict=True))
        self.excitation: list[tuple[float, float]] = []
        self.amplitude: list[tuple[float, float]] = []
        self.torque: list[float] = []
        self._position: list[float] = []
        self._velocity: list[float] = []
        self._load: list[float] = []
        self._tired = [0.0, 0.0]
        if wearer.task in ("relaxed", "contracting"):
            self._sent = list(map(tuple, self._spontaneous(rig, wearer, n, rng).tolist()))
            self._first = self._sent[0]
        else:
            self._plan(rig, wearer, n, load, rng)
            self._first = self._excite(self._planned[0] + self._standing, position)
        self._state = [*self._first, *self._first]

    def _spontaneous(self, rig: KneeMachine, wearer: Wearer, n: int, rng: np.random.Generator) -> np.ndarray:
        w, fs = self._nerves, rig.constants.encoders.rate
        rest = np.abs(draw_noise((2, n), w.spontaneous, w.spontaneous_memory, fs, rng)).T
        if wearer.task == "contracting":
            rest = rest + contractions(n, fs)
        elif wearer.helps:
            rest[:, 0] += w.not_relaxed * (0.4 + 1.2 * draw_wandering_path(n, 2.0, fs, rng))
        return np.clip(rest, 0.0, 1.0)

    def _plan(self, rig: KneeMachine, wearer: Wearer, n: int, load: float, rng: np.random.Generator) -> None:
        w, fs, subject = self._nerves, rig.constants.encoders.rate, wearer.subject
        ahead = round(w.foresight * fs)
        if wearer.task == "swinging":
            wanted = swing_path(rig, wearer, n + ahead, rng)
            tremor = np.zeros(n)
        else:
            wanted = np.full(n + ahead, wearer.angle)
            tremor = w.tremor * np.sqrt(2.0) * np.sin(
                2.0 * np.pi * np.cumsum(w.tremor_frequency * (0.8 + 0.4 * draw_wandering_path(n, 0.3, fs, rng))) / fs
            )  # fmt: skip
        speed = np.gradient(wanted, self._period)
        limb, passive = subject.limb, rig.constants.passive
        torque = (
            subject.inertia * np.gradient(speed, self._period)
            + subject.gravity * np.sin(wanted - limb.ahead)
            + limb.viscous * speed
            - passive.torque * np.exp(np.minimum((passive.angle - wanted) / passive.scale, 5.0))
        )
        if wearer.outside is not None:
            torque -= np.pad(wearer.outside, (0, max(n + ahead - len(wearer.outside), 0)), mode="edge")[: n + ahead]
        if wearer.task == "counteracting":
            wanted[:n] += draw_noise((n,), w.drift, w.drift_memory, fs, rng)
        # Whoever walks has learnt in a lifetime how their muscles weaken while they shorten, and expects no resistance.
        practised = wearer.outside is not None
        self._own_speed = (speed[ahead:] * practised).tolist()
        self._planned = (torque[ahead:] + tremor).tolist()
        self._against = np.tanh(speed[ahead:] / w.resistance_speed).tolist()
        self._against_now = np.tanh(speed[:n] / w.resistance_speed).tolist()
        self._wanted, self._speed = wanted[:n].tolist(), speed[:n].tolist()
        self._resistance = w.resistance if wearer.task == "swinging" and not practised else 0.0
        self._felt, self._standing = load, load
        if wearer.task == "counteracting":
            self._integral = load * (1.0 - w.load_share)
        else:
            self._integral = load

    def _excite(self, torque: float, position: float, speed: float = 0.0) -> tuple[float, float]:
        """Excitations that a wearer believes to give a torque [N*m], both sides never quite off.

        `speed` is what the wearer counts with of the muscles' shortening [rad/s].
        """
        m = self._muscles
        both = math.sqrt(torque * torque + 4.0 * self._both**2)
        stretch = m.angle_slope * (position - m.best_angle)
        slowed = min(max(m.slowing * speed, -0.5), 0.5)
        flexor = 0.5 * (both + torque) / (self._strength[0] * (1.0 + stretch) * (1.0 - slowed))
        extensor = 0.5 * (both - torque) / (self._strength[1] * (1.0 - stretch) * (1.0 + slowed))
        bend, shape = self._bend, m.shape
        return (
            math.log1p(min(flexor, 1.0) * bend) / shape if flexor > 0.0 else 0.0,
            math.log1p(min(extensor, 1.0) * bend) / shape if extensor > 0.0 else 0.0,
        )

    def _demand(self, k: int) -> float:
        """Torque that is wanted of the muscles now, by plan and by what was felt a reflex ago [N*m]."""
        w = self._nerves
        then = k - self._reflex if k > self._reflex else 0
        error = self._wanted[then] - self._position[then]
        lag = self._speed[then] - self._velocity[then]
        self._integral += w.integral * error * self._period
        torque = self._planned[k] + self._integral + w.stiffness * error + w.damping * lag
        if self._task == "swinging":
            self._resistance += w.learning * lag * self._against_now[then] * self._period
            return torque + self._resistance * self._against[k]
        self._felt += self._felt_rate * (self._load[then] - self._felt)
        return torque + w.load_share * self._felt

    def step(self, k: int, position: float, velocity: float, load: float) -> float:
        """One period. `position`, `velocity` [rad], [rad/s]; `load` [N*m]; gives [N*m]."""
        self._position.append(position)
        self._velocity.append(velocity)
        self._load.append(load)
        if self._task in ("relaxed", "contracting"):
            sent = self._sent[k]
        else:
            sent = self._excite(self._demand(k), position, self._own_speed[k])
        waver = self._waver[k]
        first, second = sent[0] * waver[0], sent[1] * waver[1]
        sent = (1.0 if first > 1.0 else max(first, 0.0), 1.0 if second > 1.0 else max(second, 0.0))
        self.excitation.append(sent)

        m, state, tired, period, rate = self._muscles, self._state, self._tired, self._period, self._rate
        arriving = self.excitation[k - self._late] if k >= self._late else self._first
        state[0] += rate * (arriving[0] - state[0])
        state[1] += rate * (arriving[1] - state[1])
        state[2] += rate * (state[0] - state[2])
        state[3] += rate * (state[1] - state[3])
        tired[0] += state[2] * period
        tired[1] += state[3] * period
        stretch = m.angle_slope * (position - m.best_angle)
        slowed = m.slowing * velocity
        unseen, fatigue, bend, shape = self._unseen[k], m.fatigue, self._bend, m.shape
        flexor = self._strength[0] * (1.0 + stretch) * (1.0 - slowed) * (1.0 - fatigue * tired[0]) * unseen[0]
        extensor = self._strength[1] * (1.0 - stretch) * (1.0 + slowed) * (1.0 - fatigue * tired[1]) * unseen[1]
        torque = (flexor * math.expm1(shape * state[2]) - extensor * math.expm1(shape * state[3])) / bend
        more = m.fatigue_emg
        self.amplitude.append((sent[0] * (1.0 + more * tired[0]), sent[1] * (1.0 + more * tired[1])))
        self.torque.append(torque)
        return torque
