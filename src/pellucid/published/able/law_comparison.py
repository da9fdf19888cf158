"""Interaction torque of the toolkit's laws against that of the paper's, on robots that they were not chosen on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...lab.elbow.rig import ElbowRig
from ...lab.pointing.conditions import Cards, chosen_exponents, interaction_rms, own_laws, published_laws
from ...lab.pointing.people import draw_people, elbow_participants
from ...lab.pointing.study import take_part
from ..reproduction import Reproduced, spread

TORQUE_SEED = 77
"""Of the people who try each robot."""


def torque_ratios(
    robots: Sequence[tuple[ElbowRig, Cards]], *, seed: int, count: int = 3, threads: int = 2
) -> dict[str, np.ndarray]:
    """Interaction torque of the toolkit's laws over that of FC, on robots that they were not chosen on.

    Parameters
    ----------
    robots : sequence of (ElbowRig, mapping)
        Each with what its own identification found.
    seed : int
    count : int
        People who try each.
    threads : int

    Returns
    -------
    dict of str to ndarray, shape (robots,)
        By law.
    """
    found: dict[str, list[float]] = {}
    for robot, cards in robots:
        rig = elbow_participants(robot)
        people = draw_people(rig, np.random.default_rng(seed), count=count)
        exponents = chosen_exponents(rig, cards, threads=threads)[0]
        laws = {"FC": published_laws(cards, exponents)["FC"], **own_laws(cards)}
        torque = {}
        for name, make in laws.items():
            sessions = take_part(rig, {name: make}, seed=seed, people=people, threads=threads)
            torque[name] = float(np.mean([interaction_rms(s) for s in sessions]))
        for name in laws:
            found.setdefault(name, []).append(torque[name] / torque["FC"])
    return {name: np.array(ratios) for name, ratios in found.items()}


def torque_rows(ratios: Mapping[str, np.ndarray]) -> tuple[Reproduced, ...]:
    """Interaction torque of the toolkit's laws over that of FC, as rows of the reproduction.

    Parameters
    ----------
    ratios : mapping of str to ndarray, shape (robots,)
        From `torque_ratios`.

    Returns
    -------
    tuple of Reproduced
        Medians over robots.
    """
    said = "Interaction torque (RMS) over that of FC, the best law"
    rows = []
    for law, name, more in (
        ("best", "best_over_fc", ""),
        ("best_sensed", "best_over_fc.force_sensor", " with a force sensor"),
    ):
        ours, low, high = spread(ratios[law])
        note = f"{len(ratios[law])} drawn robots that it was not chosen on"
        rows.append(Reproduced(f"transparency.torque.{name}", said + more, "1", None, ours, low, high, note=note))
    return tuple(rows)
