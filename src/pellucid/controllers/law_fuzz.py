"""A law among nonsense, and how long a step of it takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import _core
from .control_law import ControlLaw


@dataclass(frozen=True)
class Fuzzed:
    """What came out of a law that was given NaN, infinities, jumps, frozen and repeated samples, and clock jumps."""

    cycles: int
    unsafe: int  # Commands outside the limits of torque or rate, or that grew after a fault
    faults: int  # How often the gate shut
    slowest: int  # Most cycles from a fault to a safe output; the fault's own is the first
    moving: int  # Cycles with a torque: a law that gives none is safe and useless


def fuzz(law: ControlLaw, cycles: int, *, seed: int = 1, single: bool = False) -> Fuzzed:
    """Give a law nonsense."""
    return Fuzzed(cycles, *_core.fuzz_law(law.kind, law.parameters, cycles, seed, single))


def step_times(law: ControlLaw, cycles: int = 200_000, *, single: bool = False) -> np.ndarray:
    """How long single steps of a law take here. Gives (cycles,) [s]."""
    return 1e-9 * _core.time_law(law.kind, law.parameters, cycles, single)
