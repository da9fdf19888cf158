"""The calibrated estimator of torque from EMG, ten muscles of a knee: nanoseconds a step here, instructions on an M4.

Stepping includes the joint's stiffness. Beside it stands the same estimator with a loop of Python around its step, as a
live session has it.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from pellucid.controllers.export.microcontroller import measure, missing_tools
from pellucid.emg.estimators.live_torque import LiveTorque
from pellucid.emg.models.emg_estimator import EmgEstimatorCard, EstimatorChannel, EstimatorJoint, EstimatorMuscle
from pellucid.emg.models.hill import MUSCLE_QUANTITIES
from pellucid.emg.models.muscle_geometry import muscle_table, surface_from_geometry
from pellucid.emg.study.estimator_folder import write_estimator_folder

from ._size import sized
from .identification import _row

KNEE_MUSCLES = (
    "rectus_femoris", "vastus_medialis", "vastus_intermedius", "vastus_lateralis", "biceps_femoris_long",
    "biceps_femoris_short", "semimembranosus", "semitendinosus", "gastrocnemius_medialis", "gastrocnemius_lateralis",
)  # fmt: skip
"""Muscles of the knee that the estimator uses."""

SAMPLE_COUNT = sized(20_000, smallest=2_000)
"""Number of samples that are estimated at once."""

STEP_COUNT = sized(2_000, smallest=200)
"""Number of samples that are estimated one by one."""

REPEAT_COUNT = sized(7, smallest=1)
"""Number of timed runs."""

PERIOD_S = 1e-3
"""Control period [s]."""


def card() -> EmgEstimatorCard:
    """Anatomical muscles, each with a channel of its own."""
    table = muscle_table()
    muscles = tuple(
        EstimatorMuscle(
            name,
            dict(zip(MUSCLE_QUANTITIES, map(float, table.constants[name].vector()), strict=True)),
            {name: 1.0},
            surface_from_geometry(table.geometry[name]),
        )
        for name in KNEE_MUSCLES
    )
    channels = tuple(EstimatorChannel(name, 1.0, 0.0, 1.0) for name in KNEE_MUSCLES)
    joints = (EstimatorJoint("knee", 0.0, 5.0, 0.5, 300.0),)
    return EmgEstimatorCard(
        "benchmark", "emg_knee_hill", channels, ("hip", "knee", "ankle"), muscles, joints, PERIOD_S, 12.0
    )


def run() -> list[dict]:
    """Rows for benchmarks.json."""
    own, t = card(), PERIOD_S * np.arange(SAMPLE_COUNT)
    emg = 0.3 + 0.25 * np.sin(6.0 * t + np.arange(len(KNEE_MUSCLES))[:, None])
    angles = np.array([0.2 + 0.3 * np.sin(5.0 * t), -0.6 + 0.5 * np.sin(5.0 * t + 1.0), 0.1 * np.sin(5.0 * t + 2.0)])
    whole, stepped, time = [], [], np.round(1e6 * t)
    for _ in range(REPEAT_COUNT):
        estimator = own.build()
        start = perf_counter()
        estimator.run(time, emg, angles)
        whole.append((perf_counter() - start) / SAMPLE_COUNT)
        live, seconds = LiveTorque(own), PERIOD_S * np.arange(STEP_COUNT)
        heard = [dict(zip(KNEE_MUSCLES, row, strict=True)) for row in emg.T[:STEP_COUNT].tolist()]
        moved = [dict(zip(own.angles, row, strict=True)) for row in angles.T[:STEP_COUNT].tolist()]
        start = perf_counter()
        for each in zip(seconds, heard, moved, strict=True):
            live.step(*each)
        stepped.append((perf_counter() - start) / STEP_COUNT)
    rows = [
        _row("emg_estimator.step", [1e9 * s for s in whole], "ns", "ten muscles and their stiffness"),
        _row("emg_estimator.live_step", [1e9 * s for s in stepped], "ns", "the same by names, from Python"),
    ]
    if missing_tools():
        print(f"emg_estimator: not measured on an M4, {', '.join(missing_tools())} not installed")
        return rows
    with TemporaryDirectory() as folder:
        found = measure(write_estimator_folder("benchmark", own, Path(folder)))
    where = f"Cortex-M4F in QEMU, ten muscles, ten channels; the costliest step {found.most}"
    return [
        *rows,
        _row("emg_estimator.m4.instructions_per_step", [found.instructions], "1", where),
        _row("emg_estimator.m4.bytes", [found.bytes], "B", f"code {found.code}, configuration {found.constants}"),
        _row("emg_estimator.m4.memory", [found.memory], "B", "one context"),
        _row("emg_estimator.m4.wrong", [found.wrong], "1", f"steps of {found.steps} with a bit that differs from here"),
    ]
