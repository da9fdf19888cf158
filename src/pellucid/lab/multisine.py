"""A rig's first look: random-phase multisines in place of its own protocol, where ``[multisine]`` asks for them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..protocols.random_phase_multisine import MULTISINE_NAME, random_phase_multisine
from .rig import Rig, Taken


def multisine_references(rig: Rig, rate: float, seed: int) -> list[tuple[str, str, np.ndarray]]:
    """Name, use and reference, (n,) [rad], of each realisation that ``[multisine]`` of a `rig` asks for, and of one
    more that is held out, drawn from `seed`; none where it is not asked for."""
    said = rig.tables.get("multisine", {"asked": False})
    if not said["asked"]:
        return []
    keys = ("low", "high", "resolution", "rms", "peak", "fall", "lines", "periods", "settle")
    motion = random_phase_multisine(
        rate, **{key: said[key] for key in keys}, realisations=said["realisations"] + 1, seed=seed
    )
    named = [(f"r{m + 1}", "fit") for m in range(said["realisations"])] + [("heldout", "validate")]
    return [(*name, motion.reference(m, said["centre"])) for m, name in enumerate(named)]


def multisine_study(rig: Rig, made: Sequence[Taken], channels: tuple[str, str]) -> dict[str, Any]:
    """What study.toml asks of what was `made`, if that is a first look: a transfer function between two `channels`."""
    if not any(taken.trial.protocol == MULTISINE_NAME for taken in made):
        return {}
    said = rig["multisine"]
    asked = {"input": channels[0], "output": channels[1], "reference": "reference"}
    return {"transfer_function": {**asked, "period": f"{1.0 / said['resolution']:.12g} s", "poles": said["poles"]}}
