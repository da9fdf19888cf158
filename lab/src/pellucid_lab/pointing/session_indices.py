"""Indices of movement of a simulated session, from true motion and excitation, without instruments.

The indices are those of a published comparison [1]_.

.. [1] D. Verdel, S. Bastide, N. Vignais, O. Bruneau, B. Berret, "An identification-based method improving the
transparency
   of a robotic upper limb exoskeleton", Robotica 39, 2021.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pellucid.people.movement_indices import affine
from pellucid.people.movements import Kinematics, Movement, MovementRule, Stretch, movements
from pellucid.people.survival import survival

from .session import PointingSession, true_motion

PUBLISHED_RULE = "published"
"""Name of the published rule for the end of a movement, in `MOVEMENT_RULES`."""

FIRST_REST_RULE = "first_rest"
"""Name of the rule by which a movement ends at its first rest, in `MOVEMENT_RULES`."""

MOVEMENT_RULES: Mapping[str, MovementRule] = {
    PUBLISHED_RULE: MovementRule(),
    FIRST_REST_RULE: MovementRule(ends="peak"),
}
"""Rules for the end of a movement.

By the published rule [1] it ends after the last sample above 5 % of its peak speed, so that every correction at the
target counts. By the rule of the first rest it ends where the speed first falls below 5 %."""

EMG_LEAD_S = 0.1
"""Time by which the window of EMG is earlier than the movement, as published [1] [s]."""


@dataclass(frozen=True)
class IndexMeans:
    """Published indices of one session, as means over its movements."""

    duration: float  # mean duration of the movements that the rule finds, whether or not they settled [s]
    duration_median: float  # median by Kaplan and Meier; movements that never settled are censored [s]
    vmax: float  # peak velocity [rad/s]
    emg_per_acc: float  # RMS of the agonists' excitation over the peak acceleration, of upward movements [s^2/rad]
    antagonists: float  # RMS of the antagonists' excitation, of upward movements [1]
    r2: dict[str, float]  # R2 of the straight line of mean velocity over amplitude, by "up" and "down" [1]
    left_out: float  # share of movements that the rule cannot use [1]


@dataclass(frozen=True)
class SessionIndices:
    """All indices of one session."""

    person: str
    condition: str
    movements: int
    means: dict[str, IndexMeans]  # by the name of the rule in `MOVEMENT_RULES`
    given: np.ndarray  # (n,) energy from the robot to the wearer over each movement there and back [J]
    fault: str  # fault that the law's supervisor has latched; "none" for none
    lasted: (
        np.ndarray
    )  # (n, 2) observed duration of each movement by the published rule [s]; 1 if it settled, or else 0

    @property
    def unsettled(self) -> float:
        """Return the share of movements that did not come to rest on the target before the next target appeared."""
        return float(np.mean(self.lasted[:, 1] == 0.0))


def injected_energy(session: PointingSession) -> np.ndarray:
    """Return the energy from the robot to the wearer over each movement there and back, shape (n,) [J]."""
    power = -session.signals["interaction"] * session.signals["link"] / session.fs
    pairs = zip(session.movements[::2], session.movements[1::2], strict=True)
    return np.array([power[there.begin : back.end].sum() for there, back in pairs])


def session_indices(session: PointingSession) -> SessionIndices:
    """Return the indices of a session by every rule of `MOVEMENT_RULES`."""
    motion, stretches = true_motion(session, MovementRule())
    means, lasted = {}, {}
    for name, rule in MOVEMENT_RULES.items():
        lasted[name] = _observed_durations(session, motion, stretches, rule)
        found, without = movements(motion, stretches, rule)
        lifts = [m for m in found if m.direction > 0]
        means[name] = IndexMeans(
            _mean([m.duration for m in found]),
            survival(*lasted[name].T).bounded_median,
            _mean([m.peak_velocity for m in found]),
            _mean([_rms(session, "flexor", m) / m.peak_acceleration for m in lifts]),
            _mean([_rms(session, "extensor", m) for m in lifts]),
            {word: _line_r2(found, sign) for word, sign in (("up", 1), ("down", -1))},
            len(without) / len(stretches),
        )
    return SessionIndices(
        session.person.name, session.condition, len(session.movements), means, injected_energy(session),
        session.fault, lasted[PUBLISHED_RULE],
    )  # fmt: skip


def _observed_durations(
    session: PointingSession, motion: Kinematics, stretches: Sequence[Stretch], rule: MovementRule
) -> np.ndarray:
    """Return each movement's observed duration by a rule [s], and 1 if it ended or 0 if it was cut, shape (n, 2)."""
    rows = []
    for reach, stretch in zip(session.movements, stretches, strict=True):
        found, _ = movements(motion, [stretch], rule)
        # By the rule of the first rest a movement has ended even if the person leaves the target again.
        if found and (reach.held or rule.ends == "peak"):
            rows.append((found[0].duration, 1.0))
        elif not reach.held:
            start = found[0].start if found else stretch.begin
            rows.append((stretch.end - start, 0.0))
    return np.array(rows).reshape(-1, 2)


def _mean(values: Sequence[float]) -> float:
    """Return the mean, or NaN where no movement ended."""
    return float(np.mean(values)) if values else float("nan")


def _rms(session: PointingSession, group: str, movement: Movement) -> float:
    """Return the RMS excitation of a muscle group during a movement, over a window `EMG_LEAD_S` earlier."""
    advance = round(EMG_LEAD_S * session.fs)
    part = slice(max(movement.first - advance, 0), max(movement.last - advance, 0) + 1)
    return float(np.sqrt(np.mean(session.signals[group][part] ** 2)))


def _line_r2(found: Sequence[Movement], direction: int) -> float:
    """Return R2 of the straight line of mean velocity over amplitude; NaN for fewer than three amplitudes."""
    by_amplitude: dict[float, list[float]] = {}
    for m in found:
        if m.direction == direction:
            by_amplitude.setdefault(round(m.amplitude or 0.0, 6), []).append(m.mean_velocity)
    amplitudes = sorted(by_amplitude)
    if len(amplitudes) < 3:
        return float("nan")
    return affine(np.array(amplitudes), np.array([np.mean(by_amplitude[a]) for a in amplitudes]))[2]
