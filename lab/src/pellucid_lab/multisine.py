"""Random-phase multisines, which replace a rig's own protocol where ``[multisine]`` of its file asks for them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pellucid.numerics.protocols.excitation import MULTISINE_NAME, random_phase_multisine

from .rig import Taken
from .shared_tables import MultisineTable


def multisine_references(table: MultisineTable | None, rate: float, seed: int) -> list[tuple[str, str, np.ndarray]]:
    """Return name, use and reference of each multisine that a rig's `table` asks for, and of one more to hold out.

    A reference has shape (n,) [rad] at the sampling `rate` [Hz]; its phases are drawn from `seed`. The list is empty
    where the table is missing or does not ask for a recording.
    """
    if table is None or not table.asked:
        return []
    motion = random_phase_multisine(
        rate,
        low=table.low,
        high=table.high,
        resolution=table.resolution,
        rms=table.rms,
        peak=table.peak,
        fall=table.fall,
        lines=table.lines,
        periods=table.periods,
        settle=table.settle,
        realisations=table.realisations + 1,
        seed=seed,
    )
    named = [(f"r{m + 1}", "fit") for m in range(table.realisations)] + [("heldout", "validate")]
    return [(*name, motion.reference(m, table.centre)) for m, name in enumerate(named)]


def multisine_study(table: MultisineTable | None, made: Sequence[Taken], channels: tuple[str, str]) -> dict[str, Any]:
    """Return the table ``[transfer_function]`` of study.toml, between two `channels`, if multisines were recorded.

    The result is empty where none of the recordings `made` is a multisine.
    """
    if table is None or not any(taken.trial.protocol == MULTISINE_NAME for taken in made):
        return {}
    asked = {"input": channels[0], "output": channels[1], "reference": "reference"}
    return {"transfer_function": {**asked, "period": f"{1.0 / table.resolution:.12g} s", "poles": table.poles}}
