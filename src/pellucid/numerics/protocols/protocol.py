"""Motions written as files that a machine's own controller can play."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..._atomic import write_text_atomically
from ..._errors import PellucidError
from .excitation import MULTISINE_NAME, REVERSALS_NAME, RandomPhaseMultisine, random_phase_multisine, reversals

REQUIRED_OPTIONS: Mapping[str, tuple[str, ...]] = {
    MULTISINE_NAME: ("low", "high", "resolution", "rms"),
    REVERSALS_NAME: ("smallest", "largest", "around"),
}
"""Options that each motion requires. Its name is the `protocol` of a recording in study.toml."""


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
    """Write each realisation of a motion to a `folder` as CSV of time [s] and reference.

    The other options are those of `random_phase_multisine` or `reversals` (`around` are its centres). Sizes are in the
    `unit` that the files name.
    """
    if name not in REQUIRED_OPTIONS:
        raise PellucidError(f"unknown motion {name!r}; known: {', '.join(REQUIRED_OPTIONS)}")
    given = {"low": low, "high": high, "resolution": resolution, "rms": rms}
    given |= {"smallest": smallest, "largest": largest}
    missing = [key for key in REQUIRED_OPTIONS[name] if (given[key] is None if key in given else not around)]
    if missing:
        raise PellucidError(f"{name}: found no {', '.join(missing)}, expected {', '.join(REQUIRED_OPTIONS[name])}")
    if name == REVERSALS_NAME:
        assert smallest is not None  # both are required above
        assert largest is not None
        path = reversals(duration, rate, smallest=smallest, largest=largest, frequency=frequency, centres=around)
        return path, [write_references(Path(folder) / f"{name}.csv", rate, {"reference": (path, unit)})]
    assert low is not None  # all four are required above
    assert high is not None
    assert resolution is not None
    assert rms is not None
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
