"""Every controller of the knee orthosis on one drawn wearer who swings the shank, and who takes it through walking."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..lab.knee.gait import walking
from ..lab.knee.protocol import swing_trial, walking_trial
from ..lab.knee.rig import knee_orthosis
from ..lab.knee.trial import Controller, KneeReadings, run_trial
from ..papers.knee.controllers import Built, chosen, controllers
from ..papers.knee.residual import session_of, wearer
from ..papers.knee.swings import SETTLING, driven_back, holds_margins, root_mean_square, without_control
from .strategies import SWINGS, WALKING, of_task
from .tried import Tried, energies

DURATION = 12.0
"""Of a swing and of a walk [s]; the first `swings.SETTLING` are not scored."""

FIRST, APART = 400, 1000
"""The first of the drawn wearers of seed 1, whom nothing was chosen on; and how far those of the next seed are."""


def knee_pair(index: int, seed: int, sway: bool = False, only: Sequence[str] = tuple(of_task(SWINGS))) -> list[Tried]:
    """Wearer `index` in an orthosis of their own: identified, every controller built, worn in swings and in walking.
    With `sway` also whether those without linear margins keep them in the simulation, which takes longest."""
    identified = wearer(knee_orthosis(), f"D{FIRST + APART * (seed - 1) + index}")
    rig, name, constants, session = identified.rig, identified.name, chosen(), session_of(identified)
    pace = rig["swing"]
    middle = (pace["centre"], np.pi * sum(pace["frequency"]))
    built = controllers(identified.card(constants.emg), rig.period, middle, constants, only)
    built = {"no_control": Built(lambda: None), **built}
    plain = without_control(rig, name) if sway else None
    path, _ = walking(1.0 / rig.period, DURATION, np.random.default_rng([seed, index, 3]))
    made = []
    for kind in only:
        one, where = built[kind], driven_back(rig) if kind == "no_control" else rig
        margins = one.margins() if one.margins else None
        held = None
        if plain is not None and margins is None and kind not in ("no_control", "zero_impedance"):
            held = holds_margins(rig, name, one.build, plain)
        safety = {"gain": margins and margins.gain_db, "delay": margins and margins.delay, "holds": held}
        for task in (SWINGS, WALKING):
            controller: Controller | None = one.build()
            subject = rig.subjects[name]
            trial = (
                swing_trial(rig, "swing", subject, duration=DURATION)
                if task == SWINGS
                else walking_trial(rig, "walking", subject, path)
            )
            rng = np.random.default_rng([seed, index, 7])
            taken = run_trial(where, trial, rng=rng, controller=controller, mounting=session)
            given = energies(_power(taken), 1.0 / rig.period)
            fault = getattr(controller, "fault", "none")
            made.append(Tried(task, kind, index, root_mean_square(taken)[1], *given, **safety, fault=fault))
    return made


def _power(taken: KneeReadings) -> np.ndarray:
    """Of the orthosis on the wearer through the strap, once settled, shape (n,) [W]."""
    late = taken.time >= SETTLING
    return -taken.truth.strap_torque[late] * taken.truth.orthosis_velocity[late]
