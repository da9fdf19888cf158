"""Motions written as files that a machine's own controller can play."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from .._atomic import write_text_atomically
from .._errors import PellucidError
from .random_phase_multisine import NAME, RandomPhaseMultisine, random_phase_multisine
from .reversals import REVERSALS, reversals

NEEDED: Mapping[str, tuple[str, ...]] = {
    NAME: ("low", "high", "resolution", "rms"),
    REVERSALS: ("smallest", "largest", "around"),
}
"""Motions that can be written, as `protocol` of a recording in study.toml, and what each must be told."""


def protocol(
    name: str,
    folder: str | os.PathLike,
    *,
    rate: float,
    low: float | None = None,
    high: float | None = None,
    resolution: float | None = None,
    rms: float | None = None,
    peak: float | None = None,
    centre: float = 0.0,
    lines: str = "odd_random",
    realisations: int = 7,
    periods: int = 4,
    settle: int = 1,
    fall: float = 0.0,
    smallest: float | None = None,
    largest: float | None = None,
    around: Sequence[float] = (),
    frequency: float = 1.0,
    duration: float = 20.0,
    unit: str = "rad",
    seed: int = 1,
) -> tuple[RandomPhaseMultisine | np.ndarray, list[Path]]:
    """Write each realisation of a motion to a `folder` as CSV of time [s] and reference; the rest as
    `random_phase_multisine` takes it, or `reversals` (`around` are its centres), sizes in the `unit` that files
    name."""
    if name not in NEEDED:
        raise PellucidError(f"unknown motion {name!r}; known: {', '.join(NEEDED)}")
    told = {"low": low, "high": high, "resolution": resolution, "rms": rms}
    told |= {"smallest": smallest, "largest": largest, "around": around or None}
    missing = [key for key in NEEDED[name] if told[key] is None]
    if missing:
        raise PellucidError(f"{name}: found no {', '.join(missing)}, expected {', '.join(NEEDED[name])}")
    if name == REVERSALS:
        path = reversals(duration, rate, smallest=smallest, largest=largest, frequency=frequency, centres=around)
        return path, [write_references(Path(folder) / f"{name}.csv", rate, {"reference": (path, unit)})]
    motion = random_phase_multisine(
        rate, low=low, high=high, resolution=resolution, rms=rms, peak=peak, lines=lines, realisations=realisations,
        periods=periods, settle=settle, fall=fall, seed=seed,
    )  # fmt: skip
    made = []
    for m in range(motion.realisations):
        columns = {"reference": (motion.reference(m, centre), unit)}
        made.append(write_references(Path(folder) / f"{name}_{m + 1}.csv", rate, columns))
    return motion, made


def write_references(path: Path, rate: float, columns: Mapping[str, tuple[np.ndarray, str]]) -> Path:
    """Write references (n,) with their units, by name, as CSV behind a column of time. `rate` [Hz]."""
    units = ", ".join(f"{name} [{unit}]" for name, (_, unit) in columns.items())
    samples = np.stack([values for values, _ in columns.values()], axis=1)
    rows = "".join(f"{i / rate:.6f},{','.join(f'{x:.9g}' for x in row)}\n" for i, row in enumerate(samples.tolist()))
    return write_text_atomically(path, f"# units: time [s], {units}\ntime,{','.join(columns)}\n{rows}")
