"""What a session of pointing came to: the published indices from true motion and excitation, without instruments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...assessment.indices import affine
from ...assessment.survival import survival
from ...signals.movements import Kinematics, Movement, MovementRule, Stretch, movements
from .session import PointingSession, true_motion

PUBLISHED_RULE, FIRST_REST_RULE = "published", "first_rest"

MOVEMENT_RULES: Mapping[str, MovementRule] = {
    PUBLISHED_RULE: MovementRule(),
    FIRST_REST_RULE: MovementRule(ends="peak"),
}
"""When a movement has ended: after the last sample above 5 % of its largest speed, as published, which counts every
correction at the target; or where the speed first falls below."""


@dataclass(frozen=True)
class IndexMeans:
    """Published indices of one session, means over its movements."""

    duration: float  # [s] of those that ended; where they were cut off a mean of where
    duration_median: float  # [s] by Kaplan and Meier, those that never settled counted as longer than seen
    vmax: float  # [rad/s]
    emg_per_acc: float  # RMS of the agonists' excitation over the largest acceleration, upward movements [s^2/rad]
    antagonists: float  # RMS of the antagonists' excitation, upward movements [1]
    r2: dict[str, float]  # "up", "down": of the straight line through amplitude and mean velocity [1]
    left_out: float  # Share of movements that the rule cannot use [1]


@dataclass(frozen=True)
class SessionIndices:
    """What one session came to."""

    person: str
    condition: str
    movements: int
    means: dict[str, IndexMeans]  # By rule, as `MOVEMENT_RULES`
    given: np.ndarray  # (n,) Energy that the robot gave over each movement there and back [J]
    fault: str  # Of the law's gate
    lasted: np.ndarray  # (n, 2) How long each movement was seen, by the published rule [s], and whether it settled

    @property
    def unsettled(self) -> float:
        """Share of movements that never came to rest on the target before the next one came."""
        return float(np.mean(self.lasted[:, 1] == 0.0))


def index_change(index: str, worn: np.ndarray, control: np.ndarray) -> np.ndarray:
    """Change of an index from control, of people's values in their last axis: of the mean over people, as published; of
    EMG the mean of each person's own, since nobody's amplitude means anything in another; of a median duration the
    median of each person's own.

    gives [%].
    """
    if index == "duration_median":
        ratio = np.median(worn / control, axis=-1)
    elif index in ("emg_per_acc", "antagonists"):
        ratio = np.mean(worn / control, axis=-1)
    else:
        ratio = np.mean(worn, axis=-1) / np.mean(control, axis=-1)
    return 100.0 * (ratio - 1.0)


def injected_energy(session: PointingSession) -> np.ndarray:
    """Energy that the robot gave the wearer over each movement there and back, shape (n,) [J]; below 0 it took some."""
    flow = -session.signals["interaction"] * session.signals["link"] / session.fs
    pairs = zip(session.movements[::2], session.movements[1::2], strict=True)
    return np.array([flow[there.begin : back.end].sum() for there, back in pairs])


def session_indices(session: PointingSession) -> SessionIndices:
    """What a session came to, by every rule."""
    motion, stretches = true_motion(session, MovementRule())
    means, lasted = {}, {}
    for name, rule in MOVEMENT_RULES.items():
        lasted[name] = _lasted(session, motion, stretches, rule)
        found, without = movements(motion, stretches, rule)
        lifts = [m for m in found if m.direction > 0]
        means[name] = IndexMeans(
            _mean([m.duration for m in found]),
            survival(*lasted[name].T).bounded_median,
            _mean([m.peak_velocity for m in found]),
            _mean([_rms(session, "flexor", m) / m.peak_acceleration for m in lifts]),
            _mean([_rms(session, "extensor", m) for m in lifts]),
            {word: _line(found, sign) for word, sign in (("up", 1), ("down", -1))},
            len(without) / len(stretches),
        )
    return SessionIndices(
        session.person.name, session.condition, len(session.movements), means, injected_energy(session),
        session.fault, lasted[PUBLISHED_RULE],
    )  # fmt: skip


def _lasted(
    session: PointingSession, motion: Kinematics, stretches: Sequence[Stretch], rule: MovementRule
) -> np.ndarray:
    """How long each movement was seen by a rule [s], and whether its target was held then (1 or 0), shape (n, 2)."""
    rows = []
    for reach, stretch in zip(session.movements, stretches, strict=True):
        found, _ = movements(motion, [stretch], rule)
        # A first rest is one, whatever comes after it.
        if found and (reach.held or rule.ends == "peak"):
            rows.append((found[0].duration, 1.0))
        elif not reach.held:
            begun = found[0].start if found else stretch.begin
            rows.append((stretch.end - begun, 0.0))
    return np.array(rows).reshape(-1, 2)


def _mean(values: Sequence[float]) -> float:
    """NaN where no movement came to an end."""
    return float(np.mean(values)) if values else float("nan")


def _rms(session: PointingSession, group: str, movement: Movement) -> float:
    """Of a group's excitation during a movement, 0.1 s ahead of it as published [1]."""
    advance = round(0.1 * session.fs)
    part = slice(max(movement.first - advance, 0), max(movement.last - advance, 0) + 1)
    return float(np.sqrt(np.mean(session.signals[group][part] ** 2)))


def _line(found: Sequence[Movement], direction: int) -> float:
    """R2 of the straight line through the mean velocities of each amplitude."""
    by_amplitude: dict[float, list[float]] = {}
    for m in found:
        if m.direction == direction:
            by_amplitude.setdefault(round(m.amplitude or 0.0, 6), []).append(m.mean_velocity)
    amplitudes = sorted(by_amplitude)
    if len(amplitudes) < 3:
        return float("nan")
    return affine(np.array(amplitudes), np.array([np.mean(by_amplitude[a]) for a in amplitudes]))[2]
