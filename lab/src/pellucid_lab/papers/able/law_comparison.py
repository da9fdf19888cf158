"""Every law of a worn elbow on robots that none was chosen on, with people who took no part in choosing.

The free constants of the toolkit's own laws were chosen on `tuning_robots` by people drawn with `TUNING_SEED`; tried
are other robots and other people. On each robot the exponents of the published laws are chosen as the paper chose them,
by five further people.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pellucid.controllers.elbow_controllers import BEST_CONTROLLER, BEST_SENSED_CONTROLLER, ELBOW_CONTROLLERS

from ...elbow.rig import ElbowRig, able_elbow, drawn_rigs
from ...pointing.conditions import (
    TUNING_SEED,
    choose_exponents,
    controller_builder,
    identify_cards,
    interaction_rms,
    offered_controller,
)
from ...pointing.people import Person, draw_people
from ...pointing.rig import PointingRig, elbow_participants
from ...pointing.session import RobotLaw, Unpowered, simulate_session, standstill_speed
from ...pointing.session_indices import injected_energy
from ...processes import ordered_results
from ..figure import Reproduced, figure
from .elbow import able_elbow as able_elbow_as_published

PEOPLE_SEED = 77
"""Seed of the people who try each robot."""

TUNING_ROBOTS_SEED = 7
"""Seed of the robots on which the laws' constants were chosen, in addition to the committed one."""

REFERENCE_LAW = "fc"
"""Law to whose interaction torque all others are compared: the paper's full compensation."""

AMPLIFICATION_FACTORS = (2.0, 4.0, 10.0)
"""Values of alpha with which sensitivity amplification is compared."""

COMPARED_CONTROLLERS: Mapping[str, tuple[str, Mapping[str, float]]] = {
    **{name: (name, {}) for name, one in ELBOW_CONTROLLERS.items() if name != "amplification" and not one.assists},
    **{f"amplification_{x:g}": ("amplification", {"amplification": x}) for x in AMPLIFICATION_FACTORS},
}
"""Controllers by their name in ids: a name of `ELBOW_CONTROLLERS`, and its settings."""

UNPOWERED_ROBOT = "unpowered"
"""Name in ids of the robot without power, which is compared too."""

FC_WITH_OTHER_INERTIA = ("fc_table2_inertia", "fc_no_inertia")
"""FC with another J in equation 8 than the identified one: that of Table II, which is negative, and J = 0."""

LAW_WORDS: Mapping[str, str] = {
    "fc": "fc, J as identified",
    "fc_table2_inertia": "fc, J of Table II (negative)",
    "fc_no_inertia": "fc, J = 0 (no equation 8)",
}
"""Words for laws in tables, where their names alone do not suffice."""

_row = partial(figure, "transparency")


@dataclass(frozen=True)
class LawOnRobot:
    """Outcome of one law on one robot."""

    torque: float  # Interaction torque, RMS over movements [N m]; NaN where nobody came to a target
    given: float  # Energy that the robot gives over a movement there and back, 99 % quantile [J]
    resting: float  # Largest speed of the robot two seconds after a movement [rad/s]
    faults: int  # Number of sessions at whose end the safety gate was shut
    refused: bool = False  # True if the card refuses dither, so that the law ran without it


def tuning_robots(count: int = 9) -> tuple[ElbowRig, ...]:
    """Return the robots on which constants were chosen: the committed one, and others that appear nowhere else."""
    return (able_elbow(), *drawn_rigs(able_elbow(), count, seed=TUNING_ROBOTS_SEED))


def try_laws(robot: ElbowRig, seed: int, count: int = 3, repetitions: int = 2) -> dict[str, LawOnRobot]:
    """Identify a robot, build every law from the cards, and simulate a few people who wear it."""
    cards, rig = identify_cards(robot), elbow_participants(robot)
    exponents = choose_exponents(rig, cards)[0]
    rng = np.random.default_rng([seed, TUNING_SEED])
    people = draw_people(rig, rng, count=count)
    found = {}
    for name in (*COMPARED_CONTROLLERS, UNPOWERED_ROBOT, *FC_WITH_OTHER_INERTIA):
        laws = []
        for person in people:
            if name == UNPOWERED_ROBOT:
                laws.append(Unpowered())
                continue
            if name in FC_WITH_OTHER_INERTIA:
                inertia = table2_inertia(person.slider(rig)) if name == FC_WITH_OTHER_INERTIA[0] else (0.0, 0.0)
                laws.append(
                    controller_builder(cards, "fc", exponents=exponents, inertia=inertia)(person, person.slider(rig))
                )
                continue
            controller, settings = COMPARED_CONTROLLERS[name]
            controller = offered_controller(cards, controller)
            laws.append(
                controller_builder(cards, controller, exponents=exponents, **settings)(person, person.slider(rig))
            )
        tried = try_law(rig, people, laws, seed, repetitions)
        found[name] = replace(
            tried, refused=name == BEST_CONTROLLER and offered_controller(cards, BEST_CONTROLLER) != BEST_CONTROLLER
        )
    return found


def table2_inertia(slider: float) -> tuple[float, float]:
    """Return J of the paper's Table II upwards and downwards, with its sign, at a `slider` position [m]; [kg*m^2]."""
    elbow = able_elbow_as_published()
    return float(elbow.inertia("up", slider)), float(elbow.inertia("down", slider))


def try_law(
    rig: PointingRig, people: Sequence[Person], laws: Sequence[RobotLaw], seed: int, repetitions: int
) -> LawOnRobot:
    """Return the outcome of a law, built for each of several people, on the robot of a rig."""
    sessions, resting = [], []
    amplitudes = np.repeat(rig["pointing"]["amplitudes"], repetitions)
    for person, law, rng in zip(people, laws, np.random.default_rng(seed).spawn(len(people)), strict=True):
        sessions.append(simulate_session(rig, person, "", law, rng, np.deg2rad(rng.permutation(amplitudes))))
        resting.append(standstill_speed(rig, person, law))
    given = np.concatenate([injected_energy(session) for session in sessions])
    torques = np.array([interaction_rms(session) for session in sessions])
    return LawOnRobot(
        float(np.mean(torques[np.isfinite(torques)])) if np.any(np.isfinite(torques)) else float("nan"),
        float(np.quantile(given, 0.99)),
        max(resting),
        sum(session.fault != "none" for session in sessions),
    )


def compare_controllers(
    robots: Sequence[ElbowRig], *, seed: int = PEOPLE_SEED, count: int = 3, workers: int | None = None
) -> dict[str, tuple[LawOnRobot, ...]]:
    """Return the outcome of every law on several robots, each identified for itself."""
    made = ordered_results([(try_laws, robot, seed, count) for robot in robots], workers)
    return {
        name: tuple(one[name] for one in made)
        for name in (*COMPARED_CONTROLLERS, UNPOWERED_ROBOT, *FC_WITH_OTHER_INERTIA)
    }


def torque_ratios_to_fc(found: Mapping[str, Sequence[LawOnRobot]], law: str) -> np.ndarray:
    """Return the interaction torque of a law over that of FC, shape (robots,) [1]."""
    return np.array([one.torque / fc.torque for one, fc in zip(found[law], found[REFERENCE_LAW], strict=True)])


BEST_ROWS: Mapping[str, str] = {"": BEST_CONTROLLER, ".force_sensor": BEST_SENSED_CONTROLLER}
"""Best law with an encoder alone, and with a force sensor, by the last part of the row's id."""

DITHER_NOTE = "; their friction slips at once, as reversals measured: over 0.5 mrad of travel dither is refused"
"""Note on the best law's row: these robots have friction at which dither is allowed."""


def comparison_rows(found: Mapping[str, Sequence[LawOnRobot]]) -> tuple[Reproduced, ...]:
    """Return the outcome of `compare_controllers` as rows of the reproduction."""
    note = f"{len(found[REFERENCE_LAW])} simulated robots and people on which no law was chosen"
    over, rows = "Interaction torque (RMS) over that of FC", []
    for tail, law in BEST_ROWS.items():
        dither_note = DITHER_NOTE if law == BEST_CONTROLLER else ""
        drawn = torque_ratios_to_fc(found, law)
        rows.append(_row(f"torque.best_over_fc{tail}", f"{over}, best: {law}", "1", drawn, None, note + dither_note))
    for law, tried in found.items():
        law_words = LAW_WORDS.get(law, law)
        given, resting = [one.given for one in tried], [one.resting for one in tried]
        if law != REFERENCE_LAW:
            rows.append(
                _row(f"torque.{law}_over_fc", f"{over}, {law_words}", "1", torque_ratios_to_fc(found, law), None, note)
            )
        rows += [
            _row(f"given.{law}", f"Energy that {law_words} gives over a movement there and back, worst robot", "J",
                 given, None, note, middle=np.max),
            _row(f"resting.{law}", f"Speed two seconds after a movement, {law}, worst robot", "rad/s", resting, None,
                 note, middle=np.max),
        ]  # fmt: skip
    refused = sum(one.refused for one in found[BEST_CONTROLLER])
    rows.append(_row("dither_refused", "Drawn robots whose measured travel refuses dither", "1", refused, None, note))
    faults = sum(one.faults for tried in found.values() for one in tried)
    return (*rows, _row("faults", "Sessions that ended with a gate shut", "1", faults, None, note))
