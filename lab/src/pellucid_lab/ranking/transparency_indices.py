"""Indices of transparency that papers and this toolkit use, each defined once, on the same simulated recordings.

Every index is written so that a larger value means less transparency: a distance from the movement without a robot, or
an amount that a transparent robot has none of. They are computed on the true signals of one person's session with each
controller and of the same person's session without a robot. Controllers are then ranked by each index on every pair of
a person and a robot; the agreement of two indices is Kendall's tau of their mean ranks: the share of pairs of
controllers that both order alike, less the share that they order otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from pellucid._errors import PellucidError
from pellucid.numerics.motion import tangential_speed
from pellucid.numerics.tied_ranks import tied_ranks
from pellucid.people.indices import smoothness
from pellucid.people.movements import Kinematics, Movement, MovementRule, movements

from ..pointing.session import PointingSession, true_motion
from ..pointing.session_indices import EMG_LEAD_S

ELBOW_PAPER = "Verdel et al., Robotica 39, 2021 (the elbow's paper)"
THIS_TOOLKIT = "this toolkit"
"""Sources of indices. The paper tests duration, peak velocity, isochrony and EMG/Acc of upward movements, and no other
index of transparency. The knee's thesis fits the coupling of wearer and orthosis and states no index."""


FRICTION_VELOCITY_RAD_S = 0.05
"""Velocity over which apparent Coulomb friction changes its sign [rad/s]: a few per cent of a slow movement's peak."""


@dataclass(frozen=True)
class Seen:
    """One session as indices see it: movements by the published rule, and signals at the session's rate."""

    session: PointingSession
    motion: Kinematics
    found: Sequence[Movement]

    def mean(self, value: Callable[[Movement], float], direction: int = 0) -> float:
        """Return the mean of a value over movements, of one direction or both; NaN without movements."""
        values = [value(m) for m in self.found if direction in (0, m.direction)]
        return float(np.mean(values)) if values else float("nan")

    def during(self, name: str, movement: Movement, lead: float = 0.0) -> np.ndarray:
        """Return a signal during a movement, or over a window that is earlier by `lead` [s]."""
        shift = round(lead * self.session.fs)
        return self.session.signals[name][max(movement.first - shift, 0) : max(movement.last - shift, 0) + 1]

    def rms(self, name: str, direction: int = 0, lead: float = 0.0) -> float:
        """Return the mean over movements of the RMS of a signal."""
        return self.mean(lambda m: float(np.sqrt(np.mean(self.during(name, m, lead) ** 2))), direction)


@dataclass(frozen=True)
class TransparencyIndex:
    """One index: its definition, its source, and its value for a session with a robot and for one without."""

    name: str
    kind: str  # kinematic, smoothness, interaction, energy, EMG or statistical
    words: str
    unit: str
    source: str
    value: Callable[[Seen, Seen], float]


def _change(value: Callable[[Seen], float]) -> Callable[[Seen, Seen], float]:
    """Return the absolute change of a positive quantity against no robot [%]."""
    return lambda worn, free: 100.0 * abs(value(worn) / value(free) - 1.0)


def _difference(value: Callable[[Seen], float]) -> Callable[[Seen, Seen], float]:
    return lambda worn, free: abs(value(worn) - value(free))


def _smoothness(name: str) -> Callable[[Seen], float]:
    return lambda seen: seen.mean(lambda m: smoothness(seen.motion, m)[name])


def _peaks(seen: Seen) -> float:
    """Return the mean number of peaks of speed above a tenth of the largest, per movement."""

    def count(m: Movement) -> float:
        speed = tangential_speed(seen.motion.velocity[m.first : m.last + 1])
        inner = speed[1:-1]
        return float(np.sum((inner > speed[:-2]) & (inner >= speed[2:]) & (inner > 0.1 * speed.max())))

    return seen.mean(count)


def _line_r2(seen: Seen) -> float:
    """Return R² of the straight line of mean velocity over amplitude."""
    amplitude, velocity = np.array([(m.amplitude, m.mean_velocity) for m in seen.found if m.amplitude is not None]).T
    return float(np.corrcoef(amplitude, velocity)[0, 1] ** 2)


def _profile(seen: Seen) -> np.ndarray:
    """Return the mean profile of velocity over the time of a movement, divided by its peak, (101,)."""
    grid = np.linspace(0.0, 1.0, 101)
    profiles = []
    for m in seen.found:
        speed = m.direction * seen.motion.velocity[m.first : m.last + 1]
        profiles.append(np.interp(grid, np.linspace(0.0, 1.0, len(speed)), speed) / m.peak_velocity)
    return np.mean(profiles, axis=0)


def apparent_dynamics(
    position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, torque: np.ndarray
) -> np.ndarray:
    """Return apparent inertia, viscosity and Coulomb friction of what a person moves against, (3,), from arrays (n,).

    The interaction torque is regressed on the motion together with a position term: sine and cosine of the angle and a
    constant, which are any residual of gravity and, over the range of pointing, of a spring. Without it the torque of a
    position counts as inertia, because a movement between two rests accelerates where it begins.
    """
    design = np.column_stack([
        acceleration, velocity, np.tanh(velocity / FRICTION_VELOCITY_RAD_S), np.sin(position), np.cos(position),
        np.ones(len(position)),
    ])  # fmt: skip
    return np.linalg.lstsq(design, torque, rcond=None)[0][:3]


def _impedance(seen: Seen) -> np.ndarray:
    """Return `apparent_dynamics` of all movements of a session, (3,)."""
    rows = np.concatenate([np.arange(m.first, m.last + 1) for m in seen.found])
    names = ("position", "velocity", "acceleration", "interaction")
    return apparent_dynamics(*(seen.session.signals[name][rows] for name in names))


def _power(seen: Seen, sign: float) -> float:
    """Return the mean power that the robot gives (1) or takes (-1) [W]."""
    power = -seen.session.signals["interaction"] * seen.session.signals["link"]
    return float(np.mean(np.maximum(sign * power, 0.0)))


def _abs_mean(seen: Seen) -> float:
    return seen.mean(lambda m: float(np.mean(np.abs(seen.during("interaction", m)))))


def _per_acceleration(name: str, direction: int) -> Callable[[Seen], float]:
    def value(seen: Seen) -> float:
        def of(m: Movement) -> float:
            return float(np.sqrt(np.mean(seen.during(name, m, EMG_LEAD_S) ** 2))) / m.peak_acceleration

        return seen.mean(of, direction)

    return value


def _fast(seen: Seen) -> Seen:
    """Return the session with its faster half of movements alone."""
    middle = float(np.median([m.peak_velocity for m in seen.found]))
    return Seen(seen.session, seen.motion, [m for m in seen.found if m.peak_velocity >= middle])


def _spread_overlap(value: Callable[[Movement], float]) -> Callable[[Seen, Seen], float]:
    """Return one less the overlap of the distributions of a value with and without a robot (Kolmogorov-Smirnov)."""

    def distance(worn: Seen, free: Seen) -> float:
        return float(stats.ks_2samp([value(m) for m in worn.found], [value(m) for m in free.found]).statistic)

    return distance


def _effect(value: Callable[[Movement], float]) -> Callable[[Seen, Seen], float]:
    """Return the absolute standardised difference of a movement's value with and without a robot (Cohen's d)."""

    def size(worn: Seen, free: Seen) -> float:
        a, b = (np.array([value(m) for m in seen.found]) for seen in (worn, free))
        return float(abs(a.mean() - b.mean()) / np.sqrt(0.5 * (a.var(ddof=1) + b.var(ddof=1))))

    return size


TRANSPARENCY_INDICES: tuple[TransparencyIndex, ...] = (
    TransparencyIndex("duration", "kinematic", "change of the mean duration", "%", ELBOW_PAPER,
                      _change(lambda s: s.mean(lambda m: m.duration))),
    TransparencyIndex("peak_velocity", "kinematic", "change of the peak velocity", "%", ELBOW_PAPER,
                      _change(lambda s: s.mean(lambda m: m.peak_velocity))),
    TransparencyIndex("mean_velocity", "kinematic", "change of the mean velocity", "%", THIS_TOOLKIT,
                      _change(lambda s: s.mean(lambda m: m.mean_velocity))),
    TransparencyIndex("peak_acceleration", "kinematic", "change of the peak acceleration", "%", THIS_TOOLKIT,
                      _change(lambda s: s.mean(lambda m: m.peak_acceleration))),
    TransparencyIndex("peak_time", "kinematic", "change of the relative time to peak velocity", "1", THIS_TOOLKIT,
                      _difference(lambda s: s.mean(lambda m: m.peak_time))),
    TransparencyIndex("isochrony", "kinematic", "change of R² of mean velocity over amplitude", "1", ELBOW_PAPER,
                      _difference(_line_r2)),
    TransparencyIndex("profile", "kinematic", "RMS change of the normalised velocity profile", "1", THIS_TOOLKIT,
                      lambda worn, free: float(np.sqrt(np.mean((_profile(worn) - _profile(free)) ** 2)))),
    TransparencyIndex("travel", "kinematic", "change of the movement's travel", "%", THIS_TOOLKIT,
                      _change(lambda s: s.mean(lambda m: m.travel))),
    TransparencyIndex("sparc", "smoothness", "change of the spectral arc length", "1", THIS_TOOLKIT,
                      _difference(_smoothness("sparc"))),
    TransparencyIndex("ldlj", "smoothness", "change of the log dimensionless jerk", "1", THIS_TOOLKIT,
                      _difference(_smoothness("ldlj"))),
    TransparencyIndex("submovements", "smoothness", "change of the number of speed peaks", "1", THIS_TOOLKIT,
                      _difference(_peaks)),
    TransparencyIndex("torque_rms", "interaction", "RMS interaction torque", "N*m", THIS_TOOLKIT,
                      lambda worn, free: worn.rms("interaction")),
    TransparencyIndex("torque_peak", "interaction", "peak interaction torque", "N*m", THIS_TOOLKIT,
                      lambda worn, free: worn.mean(lambda m: float(np.abs(worn.during("interaction", m)).max()))),
    TransparencyIndex("torque_mean", "interaction", "mean absolute interaction torque", "N*m", THIS_TOOLKIT,
                      lambda worn, free: _abs_mean(worn)),
    TransparencyIndex("impulse", "interaction", "absolute impulse of a movement", "N*m*s", THIS_TOOLKIT,
                      lambda worn, free: worn.mean(lambda m: m.duration
                                                   * float(np.mean(np.abs(worn.during("interaction", m)))))),
    TransparencyIndex("apparent_inertia", "interaction", "apparent inertia", "kg*m^2", THIS_TOOLKIT,
                      lambda worn, free: float(abs(_impedance(worn)[0]))),
    TransparencyIndex("apparent_viscosity", "interaction", "apparent viscosity", "N*m*s/rad", THIS_TOOLKIT,
                      lambda worn, free: float(abs(_impedance(worn)[1]))),
    TransparencyIndex("apparent_friction", "interaction", "apparent Coulomb friction", "N*m", THIS_TOOLKIT,
                      lambda worn, free: float(abs(_impedance(worn)[2]))),
    TransparencyIndex("given", "energy", "power given to the person", "W", THIS_TOOLKIT,
                      lambda worn, free: _power(worn, 1.0)),
    TransparencyIndex("taken", "energy", "power taken from the person", "W", THIS_TOOLKIT,
                      lambda worn, free: _power(worn, -1.0)),
    TransparencyIndex("exchanged", "energy", "power exchanged either way", "W", THIS_TOOLKIT,
                      lambda worn, free: _power(worn, 1.0) + _power(worn, -1.0)),
    TransparencyIndex("emg_per_acc_up", "EMG", "change of EMG/Acc upwards", "%", ELBOW_PAPER,
                      _change(_per_acceleration("flexor", 1))),
    TransparencyIndex("emg_per_acc_down", "EMG", "change of EMG/Acc downwards", "%", THIS_TOOLKIT,
                      _change(_per_acceleration("extensor", -1))),
    TransparencyIndex("emg_per_acc_fast", "EMG", "change of EMG/Acc of the faster half, upwards", "%", THIS_TOOLKIT,
                      _change(lambda s: _per_acceleration("flexor", 1)(_fast(s)))),
    TransparencyIndex("emg_level", "EMG", "change of the flexors' excitation", "%", THIS_TOOLKIT,
                      _change(lambda s: s.rms("flexor", lead=EMG_LEAD_S))),
    TransparencyIndex("cocontraction", "EMG", "change of the smaller of both excitations", "%", THIS_TOOLKIT,
                      _change(lambda s: s.mean(lambda m: float(np.mean(np.minimum(
                          s.during("flexor", m, EMG_LEAD_S), s.during("extensor", m, EMG_LEAD_S))))))),
    TransparencyIndex("duration_effect", "statistical", "standardised difference of durations", "1", THIS_TOOLKIT,
                      _effect(lambda m: m.duration)),
    TransparencyIndex("velocity_distance", "statistical", "distance of the distributions of peak velocity", "1",
                      THIS_TOOLKIT, _spread_overlap(lambda m: m.peak_velocity)),
)  # fmt: skip
"""Every index of the comparison."""


@dataclass(frozen=True, eq=False)
class IndexComparison:
    """Values of every index for every controller and pair, and the agreement of the rankings that they give.

    Attributes
    ----------
    controllers : tuple of str
    values : mapping of str to ndarray, shape (pairs, controllers)
        By index; NaN if no movement ended.
    """

    controllers: tuple[str, ...]
    values: Mapping[str, np.ndarray]

    def ranks(self, name: str) -> np.ndarray:
        """Return mean ranks of the controllers by an index, (controllers,); without a value a controller is last."""
        values = self.values[name]
        return tied_ranks(np.where(np.isfinite(values), values, np.inf), axis=1).mean(axis=0)

    def agreement(self, name: str, other: str) -> float:
        """Return Kendall's tau (b) of the mean ranks by two indices, -1 to 1."""
        return float(stats.kendalltau(self.ranks(name), self.ranks(other)).statistic)

    def order(self, name: str) -> tuple[str, ...]:
        """Return the controllers by their mean rank by an index, the most transparent first."""
        return tuple(self.controllers[i] for i in np.argsort(self.ranks(name), kind="stable"))

    def mean_agreement(self, name: str) -> float:
        """Return the mean agreement of an index with those of other kinds: its own kind shares its definition."""
        kinds = {index.name: index.kind for index in TRANSPARENCY_INDICES}
        others = [other for other in self.values if kinds[other] != kinds[name]]
        return float(np.nanmean([self.agreement(name, other) for other in others]))

    def concordance(self, name: str) -> float:
        """Return Kendall's W of an index: how much the pairs agree on the order of controllers, 0 to 1."""
        values = self.values[name]
        ranks = tied_ranks(np.where(np.isfinite(values), values, np.inf), axis=1)
        pairs, k = ranks.shape
        return float(12.0 * np.sum((ranks.sum(axis=0) - 0.5 * pairs * (k + 1)) ** 2) / (pairs**2 * (k**3 - k)))


def see(session: PointingSession) -> Seen:
    """Return a session as indices see it."""
    motion, stretches = true_motion(session, MovementRule())
    return Seen(session, motion, movements(motion, stretches, MovementRule())[0])


def index_values(worn: PointingSession, free: PointingSession) -> dict[str, float]:
    """Return every index of a session with a robot, against the same person's without; NaN without movements."""
    seen, base = see(worn), see(free)
    if len(base.found) < 3:
        raise PellucidError(f"indices: found {len(base.found)} movements without a robot, expected 3 or more")
    return {i.name: i.value(seen, base) if len(seen.found) >= 3 else float("nan") for i in TRANSPARENCY_INDICES}
