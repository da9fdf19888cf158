"""Simulate every elbow controller with a sampled robot and a simulated person who points: torque, energy, indices,
faults.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace

import numpy as np

from pellucid.controllers.control_law import ControlLaw, step_times
from pellucid.controllers.elbow_controllers import BEST_CONTROLLER
from pellucid.controllers.supervised import SupervisedLaw
from pellucid.controllers.supervisor_faults import NO_FAULT
from pellucid.controllers.transparent_laws import sensitivity_amplification
from pellucid.people.indices import EMG_PER_ACCELERATION, MEDIAN_DURATION, PEAK_VELOCITY

from ..elbow.rig import ElbowRig, able_elbow, drawn_rigs
from ..pointing.conditions import (
    Cards,
    choose_exponents,
    controller_builder,
    identify_robot,
    interaction_rms,
    offered_controller,
)
from ..pointing.people import Person, draw_people
from ..pointing.predicted_indices import change
from ..pointing.rig import PointingRig, elbow_participants
from ..pointing.session import CONTROL_CONDITION, PointingSession, RobotLaw, Unpowered, simulate_session
from ..pointing.session_indices import PUBLISHED_RULE, SessionIndices, session_indices
from ..processes import job_part, tell_job_share
from ..safety.fault_table import DETECTABLE_FAULTS, FAULT_KINDS, try_law
from ..safety.worn_robot import WornRobot, make_worn_robot
from .foreign_elbow import elbow_law_of
from .foreign_law import ForeignLaw, ForeignProcess
from .learnt_elbow import elbow_rules, learnt_compensation
from .strategies import POINTING_TASK, strategies_of_task
from .transparency_indices import index_values
from .tried import ControllerTrial, given_and_taken_power

ROBOTS_SEED = 20261100
"""Seed of the robots and people for the ranking, added to the user's seed. No constant was chosen on them."""

AMPLIFICATION_FACTOR = 4.0
"""Factor of the sensitivity amplification on the wearer's torque [1]."""

TIMED_STEPS = 20_000
"""Number of steps for the median time of a step."""


def elbow_pair(index: int, pairs: int, seed: int, laws: Sequence[ForeignLaw] = ()) -> list[ControllerTrial]:
    """Identify robot `index` of `pairs`, and let person `index` wear each of its laws and of foreign `laws`."""
    robot = drawn_rigs(able_elbow(), index + 1, seed=ROBOTS_SEED + seed)[index]
    rig = elbow_participants(robot)
    person = draw_people(rig, np.random.default_rng([ROBOTS_SEED, seed]), count=max(pairs, 6))[index]
    return try_elbow(rig, person, index, seed, laws=laws)


def try_elbow(
    rig: PointingRig, person: Person, index: int, seed: int, *,
    only: Sequence[str] = tuple(strategies_of_task(POINTING_TASK)), laws: Sequence[ForeignLaw] = (),
    faults: bool = True,
) -> list[ControllerTrial]:  # fmt: skip
    """Try the controllers of `RANKED_STRATEGIES` that `only` names, and foreign `laws`, on one robot and one person.

    Single faults are tried, and steps timed, if `faults`. Every law, own and foreign, is under the same supervisor; one
    that it stops has no torque.
    """
    parts = 1 + len(only) + len(laws)
    with job_part(0, parts):
        own, cards = elbow_laws(rig.robot, rig, person, only)
        unworn = point(rig, person, None, [seed, index])
        free = session_indices(unworn)
        worn = make_worn_robot(rig, person, cards, seed + index).commissioned(person)
    made = []

    def wear(name: str, law: RobotLaw) -> ControllerTrial:
        under = worn.watched(law, start_up=False) if isinstance(law, ControlLaw) else law
        session = point(rig, person, under, [seed, index])
        power = -session.signals["interaction"] * session.signals["link"]
        return ControllerTrial(
            POINTING_TASK,
            name,
            index,
            interaction_rms(session) if session.fault == NO_FAULT else float("nan"),
            *given_and_taken_power(power, session.fs),
            **_changes(session_indices(session), free),
            fault=session.fault,
            indices=index_values(session, unworn),
        )

    for part, (name, law) in enumerate(own.items(), 1):
        with job_part(part, parts):
            tried = wear(name, law)
            if faults and isinstance(law, ControlLaw):
                energy = _worst_fault_energy(worn, index, name, worn.watched(law))
                tried = replace(tried, fault_energy=energy, cost=float(np.median(step_times(law, TIMED_STEPS))))
            made.append(tried)
    for part, foreign in enumerate(laws, 1 + len(own)):
        with job_part(part, parts), closing(ForeignProcess(foreign)) as process:
            if process.fault == NO_FAULT and "elbow" not in process.robots:
                continue
            tried = wear(foreign.name, elbow_law_of(process, worn, start_up=False))
            fault = process.fault if process.fault != NO_FAULT else tried.fault
            if fault == NO_FAULT and faults:
                supervised_law = elbow_law_of(process, worn, start_up=True)
                tried = replace(tried, fault_energy=_worst_fault_energy(worn, index, foreign.name, supervised_law))
            made.append(replace(tried, fault=fault))
    return made


def elbow_laws(
    robot: ElbowRig, rig: PointingRig, person: Person, only: Sequence[str] = tuple(strategies_of_task(POINTING_TASK))
) -> tuple[dict[str, RobotLaw], Cards]:
    """Return the controllers for one person on an identified robot, by name, and the robot's cards."""
    with job_part(0, 2):
        fit, cards = identify_robot(robot)
    with job_part(1, 2):
        exponents = choose_exponents(rig, cards)[0]
    place = person.slider(rig)

    def make(name: str) -> RobotLaw:
        if name == "unpowered":
            return Unpowered()
        if name in ("fuzzy", "neural"):
            rules = elbow_rules(fit, cards["load"], "fuzzy" if name == "fuzzy" else "network")
            return learnt_compensation(cards["load"], place, rules)
        if name == "amplification":
            return sensitivity_amplification(cards["load"], place, amplification=AMPLIFICATION_FACTOR)
        chosen = offered_controller(cards, name) if name == BEST_CONTROLLER else name
        return controller_builder(cards, chosen, exponents=exponents)(person, place)

    return {name: make(name) for name in only}, cards


def point(rig: PointingRig, person: Person, law: RobotLaw | None, seed: list[int]) -> PointingSession:
    """Simulate one person who points with a `law`, or without a robot."""
    rng = np.random.default_rng(seed)
    lifts = np.deg2rad(rng.permutation(rig["pointing"]["amplitudes"]))
    return simulate_session(rig, person, CONTROL_CONDITION if law is None else "worn", law, rng, lifts)


def _changes(worn: SessionIndices, free: SessionIndices) -> Mapping[str, float]:
    """Return changes from movements without a robot [%]: of the median duration, and of means otherwise.

    Durations have medians because some movements may never end.
    """
    with_robot, without = worn.means[PUBLISHED_RULE], free.means[PUBLISHED_RULE]
    pairs = {
        "duration": MEDIAN_DURATION.name, "peak_velocity": PEAK_VELOCITY.name, "emg": EMG_PER_ACCELERATION.of
    }  # fmt: skip
    return {
        name: float(change(index, *(np.array([getattr(means, index)]) for means in (with_robot, without))))
        for name, index in pairs.items()
    }


def _worst_fault_energy(worn: WornRobot, index: int, name: str, law: SupervisedLaw) -> float:
    """Return the largest energy that a single detectable fault gives the person until the robot is safe [J]."""
    worst, trials = 0.0, try_law(worn, index, name, law)
    for number, trial in enumerate(trials, 1):
        tell_job_share(min(number / len(FAULT_KINDS), 1.0))
        worst = max(worst, trial.excess if trial.kind in DETECTABLE_FAULTS else 0.0)
    return worst
