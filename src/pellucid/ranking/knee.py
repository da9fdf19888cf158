"""Simulate every controller of the knee orthosis with a drawn wearer who swings the shank and who walks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .._processes import job_part
from ..control.supervisor_faults import NO_FAULT
from ..control.worn_design import design_worn_law, other_straps
from ..lab.knee.chosen_constants import ChosenConstants, chosen
from ..lab.knee.gait import walking
from ..lab.knee.identified_wearer import WearerCard
from ..lab.knee.instruments import Mounting
from ..lab.knee.protocol import swing_trial, walking_trial
from ..lab.knee.rig import KneeRig, knee_orthosis
from ..lab.knee.subject import KneeSubject
from ..lab.knee.trial import Controller, KneeReadings, run_trial
from ..papers.knee.controllers import BuiltController, controllers
from ..papers.knee.residual import identify_by_name, session_of
from ..papers.knee.swings import SETTLING_TIME_S, holds_margins, rms_mismatch_and_torque, without_control, without_power
from .foreign_law import ForeignControllers, ForeignLaw
from .knee_faults import knee_in_use, worst_foreign_knee_fault, worst_knee_fault
from .strategies import SWING_TASK, WALKING_TASK, strategies_of_task
from .tried import ControllerTrial, given_and_taken_power

TRIAL_DURATION_S = 12.0
"""Duration of the swings and of the walk [s]; the first `swings.SETTLING_TIME_S` of them are not scored."""

FIRST_WEARER = 400
"""Number of the first drawn wearer of seed 1. No constant was chosen on these wearers."""

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

    Foreign `laws` are tried on the same wearer with the same noise, each trial in a new process.

    With `sway`, controllers without linear margins are also tested for their margins in simulation, which takes most of
    the time. Single faults are tried in swings.
    """
    parts = 1 + len(only) + len(laws)
    with job_part(0, parts):
        identified = identify_by_name(knee_orthosis(), f"D{FIRST_WEARER + WEARERS_PER_SEED * (seed - 1) + index}")
    rig, name, constants, session = identified.rig, identified.name, chosen(), session_of(identified)
    built = ranked_controllers(identified.card(constants.emg), rig, constants, only)
    plain = without_control(rig, name) if sway else None
    path, _ = walking(1.0 / rig.period, TRIAL_DURATION_S, np.random.default_rng([seed, index, 3]))
    worn = knee_in_use(rig, WEARERS_PER_SEED * seed + index)
    made = []
    for part, kind in enumerate(only, 1):
        with job_part(part, parts):
            one, where = built[kind], without_power(rig) if kind == "no_control" else rig
            margins = one.margins() if one.margins else None
            held = None
            if plain is not None and margins is None and kind not in ("no_control", "zero_impedance"):
                held = holds_margins(rig, name, one.build, plain)
            safety = {"gain": margins and margins.gain_db, "delay": margins and margins.delay, "holds": held}
            safety["fault_energy"] = worst_knee_fault(worn, kind, one.build)
            for task in (SWING_TASK, WALKING_TASK):
                controller: Controller | None = one.build()
                subject = rig.subjects[name]
                trial = (
                    swing_trial(rig, "swing", subject, duration=TRIAL_DURATION_S)
                    if task == SWING_TASK
                    else walking_trial(rig, "walking", subject, path)
                )
                rng = np.random.default_rng([seed, index, 7])
                readings = run_trial(where, trial, rng=rng, controller=controller, mounting=session)
                given = given_and_taken_power(_power(readings), 1.0 / rig.period)
                fault = getattr(controller, "fault", "none")
                torque = rms_mismatch_and_torque(readings)[1]
                made.append(ControllerTrial(task, kind, index, torque, *given, **safety, fault=fault))
    for part, law in enumerate(laws, 1 + len(only)):
        with job_part(part, parts):
            held = None
            with ForeignControllers(law, rig) as build:
                first = build()
                if first.fault == NO_FAULT and "knee" not in first.robots:
                    continue
                if plain is not None and first.fault == NO_FAULT:
                    held = holds_margins(rig, name, build, plain)
            joules = worst_foreign_knee_fault(worn, law)
            for task in (SWING_TASK, WALKING_TASK):
                tried = _try_foreign(law, task, index, seed, rig, rig.subjects[name], path, session)
                made.append(replace(tried, holds=held, fault_energy=joules))
    return made


def _try_foreign(
    law: ForeignLaw, task: str, index: int, seed: int, rig: KneeRig, subject: KneeSubject, path: np.ndarray,
    session: Mounting,
) -> ControllerTrial:  # fmt: skip
    """Try one foreign law; with one that was stopped the torque is NaN, so that it comes last."""
    trial = (
        swing_trial(rig, "swing", subject, duration=TRIAL_DURATION_S)
        if task == SWING_TASK
        else walking_trial(rig, "walking", subject, path)
    )
    with ForeignControllers(law, rig) as build:
        controller, rng = build(), np.random.default_rng([seed, index, 7])
        readings = run_trial(rig, trial, rng=rng, controller=controller, mounting=session)
    given = given_and_taken_power(_power(readings), 1.0 / rig.period)
    torque = rms_mismatch_and_torque(readings)[1] if controller.fault == NO_FAULT else float("nan")
    return ControllerTrial(task, law.name, index, torque, *given, fault=controller.fault)


def _power(readings: KneeReadings) -> np.ndarray:
    """Return the power of the orthosis on the wearer through the strap after the settling time, shape (n,) [W]."""
    late = readings.time >= SETTLING_TIME_S
    return -readings.truth.strap_torque[late] * readings.truth.orthosis_velocity[late]
