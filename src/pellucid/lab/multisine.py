"""Random-phase multisines, which replace a rig's own protocol where ``[multisine]`` of its file asks for them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..protocols.random_phase_multisine import MULTISINE_NAME, random_phase_multisine
from .rig import Rig, Taken


def multisine_references(rig: Rig, rate: float, seed: int) -> list[tuple[str, str, np.ndarray]]:
    """Return name, use and reference of each multisine that a `rig` asks for, and of one more that is held out.

    A reference has shape (n,) [rad] at the sampling `rate` [Hz]; its phases are drawn from `seed`. The list is empty
    where ``[multisine]`` does not ask for a recording.
    """
    table = rig.tables.get("multisine", {"asked": False})
    if not table["asked"]:
        return []
    keys = ("low", "high", "resolution", "rms", "peak", "fall", "lines", "periods", "settle")
    motion = random_phase_multisine(
        rate, **{key: table[key] for key in keys}, realisations=table["realisations"] + 1, seed=seed
    )
    named = [(f"r{m + 1}", "fit") for m in range(table["realisations"])] + [("heldout", "validate")]
    return [(*name, motion.reference(m, table["centre"])) for m, name in enumerate(named)]


def multisine_study(rig: Rig, made: Sequence[Taken], channels: tuple[str, str]) -> dict[str, Any]:
    """Return the table ``[transfer_function]`` of study.toml, between two `channels`, if multisines were recorded.

    The result is empty where none of the recordings `made` is a multisine.
    """
    if not any(taken.trial.protocol == MULTISINE_NAME for taken in made):
        return {}
    table = rig["multisine"]
    asked = {"input": channels[0], "output": channels[1], "reference": "reference"}
    return {"transfer_function": {**asked, "period": f"{1.0 / table['resolution']:.12g} s", "poles": table["poles"]}}
