"""Logs of a heavy hip robot, from equations that Pellucid does not have, for a study that begins with files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

INERTIA = 1.2
"""Inertia of the robot [kg m^2]."""

GRAVITY_NM = 44.0
"""Largest gravity torque of the robot."""

DRY_FRICTION_NM = (7.0, 4.4)
"""Dry friction forwards and backwards."""

VISCOUS_FRICTION = (2.4, 4.0)
"""Viscous friction forwards and backwards [N m s/rad]."""

DRIVE_LIMIT_NM = 120.0
"""Largest torque of the drive."""

LOG_RATE_HZ = 500.0
"""Rate of the logs."""

STEPS_PER_ROW = 10
"""Steps of the integration between two rows."""

ENCODER_COUNTS = 16384
"""Counts of the encoder in a turn."""

TORQUE_NOISE_NM = 0.3
"""Standard deviation of the noise of the torque in a log."""

POSITION_GAIN, VELOCITY_GAIN = 360.0, 24.0
"""Gains of the loop that excites the robot [N m/rad, N m s/rad]."""

DELAY_ROWS = 2
"""Delay between a command and its torque."""

MULTI_SINE_HZ = np.linspace(0.1, 1.5, 8)
"""Frequencies of the excitation."""

LOG_S = 30.0
"""Duration of each log."""

LOG_NAMES = ("multisine_1", "multisine_2", "multisine_3", "slow")
"""Names of the logs; the last is a slow sine."""


def write_leg_logs(folder: Path, seed: int) -> list[Path]:
    """Write the logs of a robot that nobody wears, and return their files."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = round(LOG_S * LOG_RATE_HZ)
    time = np.arange(rows) / LOG_RATE_HZ
    position, torque = follow(*references(time, seed), np.random.default_rng(seed))
    files = []
    for name, angles, torques in zip(LOG_NAMES, position.T, torque.T, strict=True):
        table = np.column_stack([1e3 * time, np.degrees(angles), torques])
        files.append(folder / f"{name}.csv")
        header = "t [ms],hip angle [deg],motor torque [N*m]"
        np.savetxt(files[-1], table, "%.6f", ",", header=header, comments="", encoding="utf-8")
    return files


def references(time: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles to follow and their rates, one column for each log, shape (t, 4) [rad, rad/s]."""
    rng = np.random.default_rng([seed, 1])
    turn = 2.0 * np.pi * MULTI_SINE_HZ
    amplitudes = 0.45 / np.sqrt(len(turn)) / (0.3 + MULTI_SINE_HZ / MULTI_SINE_HZ[-1])
    columns = []
    for phases in rng.uniform(0.0, 2.0 * np.pi, (len(LOG_NAMES) - 1, len(turn))):
        angles = np.outer(time, turn) + phases
        columns.append((0.3 + np.sin(angles) @ amplitudes, np.cos(angles) @ (amplitudes * turn)))
    slow = 2.0 * np.pi * 0.1 * time
    columns.append((0.9 * np.sin(slow), 0.9 * 2.0 * np.pi * 0.1 * np.cos(slow)))
    begins = np.minimum(time, 1.0)[:, None]
    return begins * np.stack([way for way, _ in columns], 1), begins * np.stack([rate for _, rate in columns], 1)


def follow(way: np.ndarray, rate: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return encoder and torque of robots that follow references under Coulomb friction with sticking."""
    step, quantum = 1.0 / (LOG_RATE_HZ * STEPS_PER_ROW), 2.0 * np.pi / ENCODER_COUNTS
    (forwards, backwards), (viscous, viscous_back) = DRY_FRICTION_NM, VISCOUS_FRICTION
    angle, speed, seen_speed = (np.zeros(way.shape[1]) for _ in range(3))
    seen = np.zeros_like(angle)
    commands = [np.zeros_like(angle) for _ in range(DELAY_ROWS)]
    positions, torques = np.empty_like(way), np.empty_like(way)
    for row in range(len(way)):
        before, seen = seen, quantum * np.round(angle / quantum)
        seen_speed = seen_speed + 0.3 * ((seen - before) * LOG_RATE_HZ - seen_speed)
        wanted = POSITION_GAIN * (way[row] - seen) + VELOCITY_GAIN * (rate[row] - seen_speed)
        commands.append(np.clip(wanted + 0.8 * GRAVITY_NM * np.sin(seen), -DRIVE_LIMIT_NM, DRIVE_LIMIT_NM))
        applied = commands.pop(0)
        positions[row], torques[row] = seen, commands[-1]
        for _ in range(STEPS_PER_ROW):
            pushed = applied - GRAVITY_NM * np.sin(angle)
            sticks = (speed == 0.0) & (pushed <= forwards) & (pushed >= -backwards)
            ahead = np.where(speed != 0.0, speed > 0.0, pushed > 0.0)
            resisted = np.where(ahead, forwards + viscous * speed, -backwards + viscous_back * speed)
            after = np.where(sticks, 0.0, speed + step * (pushed - resisted) / INERTIA)
            speed = np.where(after * speed < 0.0, 0.0, after)
            angle = angle + step * speed
    return positions, torques + TORQUE_NOISE_NM * rng.standard_normal(torques.shape)
