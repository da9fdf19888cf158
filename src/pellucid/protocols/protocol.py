"""Motions written as files that a machine's own controller can play."""

from __future__ import annotations

import os
from pathlib import Path

from .._atomic import write_text_atomically
from .._errors import PellucidError
from .random_phase_multisine import NAME, RandomPhaseMultisine, random_phase_multisine

NAMES = (NAME,)
"""Motions that can be written; as `protocol` of a recording in study.toml."""


def protocol(
    name: str,
    folder: str | os.PathLike,
    *,
    rate: float,
    low: float,
    high: float,
    resolution: float,
    rms: float,
    peak: float | None = None,
    centre: float = 0.0,
    lines: str = "odd_random",
    realisations: int = 7,
    periods: int = 4,
    settle: int = 1,
    fall: float = 0.0,
    unit: str = "rad",
    seed: int = 1,
) -> tuple[RandomPhaseMultisine, list[Path]]:
    """Write each realisation of a motion to a `folder` as CSV of time [s] and reference; the rest as
    `random_phase_multisine` takes it, `rms`, `peak` and `centre` in the `unit` that files name."""
    if name not in NAMES:
        raise PellucidError(f"unknown motion {name!r}; known: {', '.join(NAMES)}")
    motion = random_phase_multisine(
        rate, low=low, high=high, resolution=resolution, rms=rms, peak=peak, lines=lines, realisations=realisations,
        periods=periods, settle=settle, fall=fall, seed=seed,
    )  # fmt: skip
    made = []
    for m in range(motion.realisations):
        rows = "".join(f"{i / rate:.6f},{x:.9g}\n" for i, x in enumerate(motion.reference(m, centre).tolist()))
        text = f"# units: time [s], reference [{unit}]\ntime,reference\n{rows}"
        made.append(write_text_atomically(Path(folder) / f"{name}_{m + 1}.csv", text))
    return motion, made
