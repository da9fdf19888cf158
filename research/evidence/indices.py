"""What does each index of a movement depend on? One thing at a time is changed, and every index is computed again.

Movements of minimum jerk over 40 degrees in 0.8 s, up and down, that miss their targets by 1.5 degrees (standard
deviation), 30 % of them with a correction of 3 degrees at their end, as an encoder with white noise of 0.02 degrees
shows them. The robot behind the interaction is inertia, viscosity and dry friction, and EMG has a constant level: how
muscles answer is not known here. Values are those of the functions that `assess` uses.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pellucid.people.design_columns import DIRECTION_DOWN, DIRECTION_UP
from pellucid.people.emg_index import emg_per_acceleration
from pellucid.people.indices import INDICES, PercentOf, end_error, interaction, smoothness
from pellucid.people.movements import MovementRule, kinematics, movements, target_stretches
from pellucid.study.results import ResultRow
from research.benchmarks._size import sized

MOVEMENT_COUNT = sized(200, smallest=12)
"""Number of movements of each recording."""

RATE_HZ = 200.0
PERIOD_S = 2.5
SEED = 2026


@dataclass(frozen=True)
class Setting:
    """How people move, and how they are recorded."""

    duration: float = 0.8  # [s]
    amplitude: float = 40.0  # [deg]
    lowpass: float = 6.0  # [Hz]
    noise: float = 0.02  # [deg]


CHANGES = {
    "duration": ("movements last 10 % longer", {"duration": 0.88}),
    "amplitude": ("movements are 10 % larger and last as long", {"amplitude": 44.0}),
    "filter": ("low-pass at 3 Hz instead of 6 Hz", {"lowpass": 3.0}),
    "noise": ("noise of the angle ten times as large", {"noise": 0.2}),
}
"""What is changed, in words, and the setting."""

NAMES = tuple(name for name in INDICES if name not in ("duration_median", "unsettled", "emg_level"))
"""Indices that have a value of each movement here."""


def rise(share: np.ndarray) -> np.ndarray:
    """Return the path of minimum jerk from 0 to 1 at these shares of its duration."""
    share = np.clip(share, 0.0, 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def values(setting: Setting) -> dict[str, float]:
    """Return the mean of every index over the movements of a recording."""
    rng = np.random.default_rng(SEED)
    corrected = rng.uniform(size=MOVEMENT_COUNT) < 0.3
    goals = np.where(np.arange(MOVEMENT_COUNT) % 2 == 0, setting.amplitude, 0.0)
    ends = goals + 1.5 * rng.standard_normal(MOVEMENT_COUNT)
    starts = np.concatenate([[0.0], ends[:-1]])
    time = np.arange(0.0, MOVEMENT_COUNT * PERIOD_S, 1.0 / RATE_HZ)
    own = np.minimum((time / PERIOD_S).astype(int), MOVEMENT_COUNT - 1)
    since = time - own * PERIOD_S - 0.4
    short = np.where(corrected, 3.0, 0.0) * np.sign(ends - starts)
    path = starts[own] + (ends - starts - short)[own] * rise(since / setting.duration)
    path = path + short[own] * rise((since - setting.duration) / 0.35)
    seen = path + setting.noise * rng.standard_normal(len(time))
    target = np.radians(goals[own])
    rule = MovementRule(setting.lowpass, 4, 0.05, "all")
    motion = kinematics(time, np.radians(seen), rule)
    found, _ = movements(motion, target_stretches(time, target), rule)
    velocity = np.gradient(np.radians(path), time)
    torque = -(0.05 * np.gradient(velocity, time) + 0.3 * velocity + 0.4 * np.tanh(velocity / 0.05))
    made: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in NAMES}
    for movement in found:
        part = slice(movement.first, movement.last + 1)
        felt = interaction(np.interp(motion.time[part], time, torque), motion.velocity[part], motion.fs)
        known = {index.of: index.of_movement(motion, movement) for index in INDICES.values() if index.of_movement}
        known |= smoothness(motion, movement) | end_error(motion, movement, 0.0)
        known |= {"torque_rms": felt.rms, "torque_peak": felt.peak, "work": felt.resisted}
        known["emg_per_acc"] = emg_per_acceleration(0.2, movement.peak_acceleration)
        for name, directions in made.items():
            if INDICES[name].direction in ("", DIRECTION_UP if movement.direction > 0 else DIRECTION_DOWN):
                directions[movement.direction > 0].append(known[INDICES[name].of])
    return {
        name: float(np.mean([np.std(x, ddof=1) if INDICES[name].spread else np.mean(x) for x in directions if x]))
        for name, directions in made.items()
    }


def rows() -> Iterator[ResultRow]:
    """Every index by every change."""
    base = values(Setting())
    changed = {what: values(replace(Setting(), **settings)) for what, (_, settings) in CHANGES.items()}
    for name, before in base.items():
        index = INDICES[name]
        ratio = index.percent_of in (PercentOf.THE_CONTROL, PercentOf.OVER_CONTROL)
        for what, (words, _) in CHANGES.items():
            after = changed[what][name]
            factor, unit = (100.0 / before, "%") if ratio else index.shown
            note = f"change of {index.words.lower()} where {words}"
            value = factor * (after - before)
            yield ResultRow(f"indices.{name}.{what}", value, unit, "evidence", "simulated", None, note)
