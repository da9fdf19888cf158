"""A whole study with simulated people: those who hold as well as reach, by either model, and the earlier frozen ones,
by turns.

The 2,400 movements of the published experiment, four conditions of 100 movements each for six people, on one robot and
under the same laws. Rows give CPU time, which excludes other work on the machine. The free arm has its own rows,
because all models make about the same motion with it.
"""

from __future__ import annotations

import time

import numpy as np

from pellucid_lab.pointing.conditions import Conditions, identify_cards, published_conditions
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import PointingRig, elbow_participants, elbow_people
from pellucid_lab.pointing.session import CONTROL_CONDITION, simulate_session

from ._size import sized

COMMON_EXPONENTS = (-0.5, -0.5)
"""Exponents k of equation 8 of Verdel et al. (Robotica 39, 2021), upwards and downwards.

Five simulated people chose these values on most robots."""

PEOPLE_COUNT = sized(6, smallest=1)
"""Number of people of each rig, the first of those whom the rig draws."""

REPETITION_COUNT = sized(None, smallest=1)
"""Number of movements of each amplitude and direction; None for as many as the rig states."""


def study_seconds(rigs: tuple[PointingRig, ...], conditions: Conditions, seed: int = 1) -> np.ndarray:
    """CPU seconds of all movements of each rig's people in each condition, session by session by turns, shape
    (rigs, conditions)."""
    people = [draw_people(rig, np.random.default_rng(seed))[:PEOPLE_COUNT] for rig in rigs]
    if REPETITION_COUNT is not None:
        rigs = tuple(rig.changed({"pointing.repetitions": REPETITION_COUNT}) for rig in rigs)
    n = len(rigs)
    taken = np.zeros((n, len(conditions)))
    for i, same in enumerate(zip(*people, strict=True)):
        for j, (name, make) in enumerate(conditions.items()):
            for k in np.roll(np.arange(n), i + j).tolist():
                law = None if make is None else make(same[k], same[k].slider(rigs[k]))
                rng = np.random.default_rng([seed, i, j])
                start = time.process_time()
                simulate_session(rigs[k], same[k], name, law, rng)
                taken[k, j] += time.process_time() - start
    return taken


def run() -> list[dict]:
    """Rows of name, value, unit, note."""
    rigs = elbow_people(), elbow_people().modelled("optimal"), elbow_participants()
    conditions = published_conditions(identify_cards(rigs[0].robot), COMMON_EXPONENTS)
    taken = study_seconds(rigs, conditions)
    free = list(conditions).index(CONTROL_CONDITION)
    whole = taken.sum(axis=1)
    rows = [{"name": "people: the same, frozen ones", "value": float(whole[-1]), "unit": "s", "note": "one run"}]
    for name, of, alone in zip(("people", "people by optimal feedback"), whole, taken[:, free], strict=False):
        rows += [
            {"name": f"{name}: a study of 2,400 movements", "value": float(of), "unit": "s", "note": "one run"},
            {"name": f"{name}: over frozen ones", "value": float(of / whole[-1]), "unit": "1", "note": "by turns"},
            {
                "name": f"{name}: over frozen ones, free arm",
                "value": float(alone / taken[-1, free]),
                "unit": "1",
                "note": "600 movements each, by turns",
            },
        ]
    return rows
