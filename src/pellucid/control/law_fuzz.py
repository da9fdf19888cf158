"""A law among nonsense, and how long a step of it takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import _core
from .control_law import ControlLaw


@dataclass(frozen=True)
class Fuzzed:
    """What came out of a law that was given NaN, infinities, jumps, frozen and repeated samples, and clock jumps.

    Attributes
    ----------
    cycles : int
    unsafe : int
        Commands outside the limits of torque or rate, or that grew after a fault.
    faults : int
        How often the gate shut.
    slowest : int
        Most cycles from a fault to a safe output; the fault's own is the first.
    moving : int
        Cycles with a torque: a law that gives none is safe and useless.
    """

    cycles: int
    unsafe: int
    faults: int
    slowest: int
    moving: int


def fuzz(law: ControlLaw, cycles: int, *, seed: int = 1, single: bool = False) -> Fuzzed:
    """Give a law nonsense.

    Parameters
    ----------
    law : ControlLaw
    cycles : int
    seed : int
    single : bool
        In float32, as on a microcontroller.

    Returns
    -------
    Fuzzed
    """
    return Fuzzed(cycles, *_core.fuzz_law(law.kind, law.parameters, cycles, seed, single))


def step_times(law: ControlLaw, cycles: int = 200_000, *, single: bool = False) -> np.ndarray:
    """How long single steps of a law take here.

    Parameters
    ----------
    law : ControlLaw
    cycles : int
    single : bool
        In float32.

    Returns
    -------
    ndarray, shape (cycles,)
        [s], the clock's own cost taken off.
    """
    return 1e-9 * _core.time_law(law.kind, law.parameters, cycles, single)
