"""Simulate every controller of the knee orthosis with a simulated wearer who swings the shank and walks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pellucid.controllers.supervisor_faults import NO_FAULT
from pellucid.controllers.worn import design_worn_law, other_straps

from ..knee.chosen_constants import ChosenConstants, chosen
from ..knee.gait import walking
from ..knee.identified_wearer import WearerCard
from ..knee.protocol import swing_trial, walking_trial
from ..knee.rig import KneeRig, knee_orthosis
from ..knee.trial import Controller, KneeReadings, run_trial
from ..papers.knee.controllers import BuiltController, controllers
from ..papers.knee.residual import identify_by_name, session_of
from ..papers.knee.swings import SETTLING_TIME_S, holds_margins, rms_mismatch_and_torque, without_control, without_power
from ..processes import job_part
from .foreign_law import ForeignLaw, ForeignLaws
from .knee_faults import knee_in_use, worst_foreign_knee_fault, worst_knee_fault
from .strategies import SWING_TASK, WALKING_TASK, strategies_of_task
from .tried import ControllerTrial, given_and_taken_power
from .watched_knee import IdentifiedDrive, WatchedController

TRIAL_DURATION_S = 12.0
"""Duration of the swings and of the walk [s]; the first `swings.SETTLING_TIME_S` of them are not scored."""

FIRST_WEARER = 400
"""Number of the first simulated wearer of seed 1. No constant was chosen on these wearers."""

WEARERS_PER_SEED = 1000
"""Difference between the numbers of the first wearers of two successive seeds."""


def ranked_controllers(
    card: WearerCard, rig: KneeRig, constants: ChosenConstants, only: Sequence[str]
) -> dict[str, BuiltController]:
    """Build the controllers that `only` names for one wearer.

    The residual compensator is the one that `export` writes, not the reproduction's, and the other linear loops keep
    their margins with the same straps as it does.
    """
    pace = rig["swing"]
    middle = (pace["centre"], np.pi * sum(pace["frequency"]))
    built = controllers(
        card, rig.period, middle, constants, only,
        residual=design_worn_law(card.coupling, rig.period), plants=other_straps(card.coupling),
    )  # fmt: skip
    return {"no_control": BuiltController(lambda: None), **built}


def knee_pair(
    index: int,
    seed: int,
    sway: bool = False,
    only: Sequence[str] = tuple(strategies_of_task(SWING_TASK)),
    laws: Sequence[ForeignLaw] = (),
) -> list[ControllerTrial]:
    """Identify wearer `index` in an orthosis of their own, and try every controller in swings and in walking.

    Foreign `laws` are tried on the same wearer with the same noise, each trial in a new process. Every controller, of
    the toolkit and foreign, is under the same supervisor (`watched_knee`); one that it stops has no torque.

    With `sway`, controllers without linear margins are also tested for their margins in simulation, which takes most of
    the time. Single faults are tried in swings.
    """
    parts = 1 + len(only) + len(laws)
    with job_part(0, parts):
        identified = identify_by_name(knee_orthosis(), f"D{FIRST_WEARER + WEARERS_PER_SEED * (seed - 1) + index}")
    rig, name, constants, session = identified.rig, identified.name, chosen(), session_of(identified)
    card = identified.card(constants.emg)
    built, drive = ranked_controllers(card, rig, constants, only), IdentifiedDrive.from_coupling(card.coupling)
    plain = without_control(rig, name) if sway else None
    path, _ = walking(1.0 / rig.period, TRIAL_DURATION_S, np.random.default_rng([seed, index, 3]))
    worn = knee_in_use(rig, WEARERS_PER_SEED * seed + index)
    made = []

    def attempt(task: str, kind: str, controller: Controller | None, where: KneeRig) -> ControllerTrial:
        subject = rig.subjects[name]
        trial = (
            swing_trial(rig, "swing", subject, duration=TRIAL_DURATION_S)
            if task == SWING_TASK
            else walking_trial(rig, "walking", subject, path)
        )
        rng = np.random.default_rng([seed, index, 7])
        readings = run_trial(where, trial, rng=rng, controller=controller, mounting=session)
        fault = getattr(controller, "fault", NO_FAULT)
        torque = rms_mismatch_and_torque(readings)[1] if fault == NO_FAULT else float("nan")
        given = given_and_taken_power(_power(readings), 1.0 / rig.period)
        return ControllerTrial(task, kind, index, torque, *given, fault=fault)

    for part, kind in enumerate(only, 1):
        with job_part(part, parts):
            one, where = built[kind], without_power(rig) if kind == "no_control" else rig
            margins = one.margins() if one.margins else None
            held = None
            if plain is not None and margins is None and kind not in ("no_control", "zero_impedance"):
                held = holds_margins(rig, name, one.build, plain)
            safety: dict[str, Any] = {
                "gain": margins and margins.gain_db,
                "delay": margins and margins.delay,
                "holds": held,
            }
            safety["fault_energy"] = worst_knee_fault(worn, kind, one.build, drive)
            for task in (SWING_TASK, WALKING_TASK):
                controller = one.build()
                under = None if controller is None else WatchedController(controller, rig, drive)
                made.append(replace(attempt(task, kind, under, where), **safety))
    for part, law in enumerate(laws, 1 + len(only)):
        with job_part(part, parts):
            held = None
            with ForeignLaws(law) as build:
                first = build()
                if first.fault == NO_FAULT and "knee" not in first.robots:
                    continue
                if plain is not None and first.fault == NO_FAULT:
                    held = holds_margins(rig, name, build, plain)
                joules = worst_foreign_knee_fault(worn, law, drive)
                for task in (SWING_TASK, WALKING_TASK):
                    tried = attempt(task, law.name, WatchedController(build(), rig, drive), rig)
                    made.append(replace(tried, holds=held, fault_energy=joules))
    return made


def _power(readings: KneeReadings) -> np.ndarray:
    """Return the power of the orthosis on the wearer through the strap after the settling time, shape (n,) [W]."""
    late = readings.time >= SETTLING_TIME_S
    return -readings.truth.strap_torque[late] * readings.truth.orthosis_velocity[late]
