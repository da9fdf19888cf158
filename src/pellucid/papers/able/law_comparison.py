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

from ..._processes import ordered_results
from ...control.elbow_controllers import BEST_CONTROLLER, BEST_SENSED_CONTROLLER, ELBOW_CONTROLLERS
from ...lab.elbow.rig import ElbowRig, able_elbow, drawn_rigs
from ...lab.pointing.conditions import (
    TUNING_SEED,
    choose_exponents,
    controller_builder,
    identify_cards,
    interaction_rms,
    offered_controller,
)
from ...lab.pointing.people import Person, draw_people
from ...lab.pointing.rig import PointingRig, elbow_participants
from ...lab.pointing.session import RobotLaw, Unpowered, simulate_session, standstill_speed
from ...lab.pointing.session_indices import injected_energy
from ..figure import Reproduced, figure
from .elbow import able_elbow as able_elbow_as_published

TORQUE_SEED = 77
"""Of the people who try each robot."""

TUNING_ROBOTS_SEED = 7
"""Of the robots that constants were chosen on, beside the committed one."""

REFERENCE = "fc"

AMPLIFICATIONS = (2.0, 4.0, 10.0)

CONTROLLERS: Mapping[str, tuple[str, Mapping[str, float]]] = {
    **{name: (name, {}) for name in ELBOW_CONTROLLERS if name != "amplification"},
    **{f"amplification_{x:g}": ("amplification", {"amplification": x}) for x in AMPLIFICATIONS},
}
"""By the name in ids: a controller of `ELBOW_CONTROLLERS`, and its settings. "unpowered" is compared beside them."""

UNPOWERED = "unpowered"

OTHER_INERTIAS = ("fc_table2_inertia", "fc_no_inertia")
"""FC again with other J in equation 8 than what was identified: that of Table II, which is negative, and none."""

WORDS: Mapping[str, str] = {
    "fc": "fc, J as identified",
    "fc_table2_inertia": "fc, J of Table II (negative)",
    "fc_no_inertia": "fc, J = 0 (no equation 8)",
}
"""What laws are called in tables, where their names do not say it."""

_row = partial(figure, "transparency")


@dataclass(frozen=True)
class LawOnRobot:
    """What one law did on one robot."""

    torque: float  # Interaction torque, RMS over movements [N m]; NaN where nobody came to a target
    given: float  # The most energy that the robot gave over a movement there and back, of 99 % of them [J]
    resting: float  # Fastest that the robot still moves two seconds after a movement [rad/s]
    faults: int  # Sessions at whose end the gate was shut
    refused: bool = False  # Its card refuses dither, and this is the law without it


def tuning_robots(count: int = 9) -> tuple[ElbowRig, ...]:
    """The robots that constants were chosen on: the committed one, and others that are tried nowhere else."""
    return (able_elbow(), *drawn_rigs(able_elbow(), count, seed=TUNING_ROBOTS_SEED))


def try_laws(robot: ElbowRig, seed: int, count: int = 3, repetitions: int = 2) -> dict[str, LawOnRobot]:
    """A robot is identified, and every law built from what was found is tried by a few people."""
    cards, rig = identify_cards(robot), elbow_participants(robot)
    exponents = choose_exponents(rig, cards)[0]
    rng = np.random.default_rng([seed, TUNING_SEED])
    people = draw_people(rig, rng, count=count)
    found = {}
    for name in (*CONTROLLERS, UNPOWERED, *OTHER_INERTIAS):
        laws = []
        for person in people:
            if name == UNPOWERED:
                laws.append(Unpowered())
                continue
            if name in OTHER_INERTIAS:
                inertia = table2_inertia(person.slider(rig)) if name == OTHER_INERTIAS[0] else (0.0, 0.0)
                laws.append(
                    controller_builder(cards, "fc", exponents=exponents, inertia=inertia)(person, person.slider(rig))
                )
                continue
            controller, settings = CONTROLLERS[name]
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
    """J of the paper's Table II, upwards and downwards, sign and all, with the carriage at `slider` [m]; [kg*m^2]."""
    elbow = able_elbow_as_published()
    return float(elbow.inertia("up", slider)), float(elbow.inertia("down", slider))


def try_law(
    rig: PointingRig, people: Sequence[Person], laws: Sequence[RobotLaw], seed: int, repetitions: int
) -> LawOnRobot:
    """What each of some people's laws does to them, on the robot of a rig."""
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
    robots: Sequence[ElbowRig], *, seed: int = TORQUE_SEED, count: int = 3, workers: int | None = None
) -> dict[str, tuple[LawOnRobot, ...]]:
    """Every law on several robots, each of which is identified for itself."""
    made = ordered_results([(try_laws, robot, seed, count) for robot in robots], workers)
    return {name: tuple(one[name] for one in made) for name in (*CONTROLLERS, UNPOWERED, *OTHER_INERTIAS)}


def ratios(found: Mapping[str, Sequence[LawOnRobot]], law: str) -> np.ndarray:
    """Interaction torque of a law over that of FC, shape (robots,) [1]."""
    return np.array([one.torque / fc.torque for one, fc in zip(found[law], found[REFERENCE], strict=True)])


BEST_ROWS: Mapping[str, str] = {"": BEST_CONTROLLER, ".force_sensor": BEST_SENSED_CONTROLLER}
"""By the end of the id: which law is the best with an encoder alone, and with a force sensor."""

DITHER_NOTE = "; their friction slips at once, as reversals measured: over 0.5 mrad of travel dither is refused"


def comparison_rows(found: Mapping[str, Sequence[LawOnRobot]]) -> tuple[Reproduced, ...]:
    """What `compare_controllers` found, as rows of the reproduction."""
    note = f"{len(found[REFERENCE])} drawn robots, and people, that no law was chosen on"
    over, rows = "Interaction torque (RMS) over that of FC", []
    for tail, law in BEST_ROWS.items():
        more = DITHER_NOTE if law == BEST_CONTROLLER else ""
        drawn = ratios(found, law)
        rows.append(_row(f"torque.best_over_fc{tail}", f"{over}, best: {law}", "1", drawn, None, note + more))
    for law, tried in found.items():
        said = WORDS.get(law, law)
        given, resting = [one.given for one in tried], [one.resting for one in tried]
        if law != REFERENCE:
            rows.append(_row(f"torque.{law}_over_fc", f"{over}, {said}", "1", ratios(found, law), None, note))
        rows += [
            _row(f"given.{law}", f"Energy that {said} gives over a movement there and back, worst robot", "J", given,
                 None, note, middle=np.max),
            _row(f"resting.{law}", f"Speed two seconds after a movement, {law}, worst robot", "rad/s", resting, None,
                 note, middle=np.max),
        ]  # fmt: skip
    refused = sum(one.refused for one in found[BEST_CONTROLLER])
    rows.append(_row("dither_refused", "Drawn robots whose measured travel refuses dither", "1", refused, None, note))
    faults = sum(one.faults for tried in found.values() for one in tried)
    return (*rows, _row("faults", "Sessions that ended with a gate shut", "1", faults, None, note))
