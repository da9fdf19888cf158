"""Interaction torque of the toolkit's laws against that of the paper's, on robots that they were not chosen on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...lab.elbow.rig import ElbowRig
from ...lab.pointing.conditions import Cards, chosen_exponents, interaction_rms, own_laws, published_laws
from ...lab.pointing.people import draw_people, elbow_participants
from ...lab.pointing.study import take_part
from ...recordings.results import ResultRow


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


def torque_rows(ratios: Mapping[str, np.ndarray], note: str) -> list[ResultRow]:
    """Rows of results.json: interaction torque of the toolkit's laws over that of FC.

    Parameters
    ----------
    ratios : mapping of str to ndarray, shape (robots,)
        From `torque_ratios`.
    note : str
        How it was made.

    Returns
    -------
    list of ResultRow
    """
    rows = []
    for law, name in (("best", "best_over_fc"), ("best_sensed", "best_over_fc.force_sensor")):
        drawn = ratios[law]
        text = f"median of {len(drawn)} robots, from {drawn.min():.3f} to {drawn.max():.3f}; {note}"
        rows.append(
            ResultRow(f"transparency.torque.{name}", float(np.median(drawn)), "1", "reproduce", "simulated", None, text)
        )
    return rows
