"""Control laws of a worn elbow with presliding friction.

Five held-out robots are simulated with every presliding travel, and each is identified separately, including its
travel. Three held-out people make five movements there and back with each law. Reference methods are no law
(`unpowered`), the published FC, relative to which torques are reported, and the law without dither. Dither has three
variants. `dithered` is the exported law, without dither if the measured travel does not allow it. `dithered_anyway`
ignores the measured travel. `dithered_slowly`, at 600 rad/s, is not exported.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.elbow_controllers import BEST_CONTROLLER, DITHERED_BODY, transparent_and
from pellucid.controllers.transparent_laws import with_dither
from pellucid.models.slider_joint import SliderCard
from pellucid.study.results import ResultRow
from pellucid_lab.elbow.rig import ElbowRig, able_elbow, drawn_rigs
from pellucid_lab.papers.able.law_comparison import PEOPLE_SEED, REFERENCE_LAW, LawOnRobot, try_law
from pellucid_lab.pointing.conditions import (
    TUNING_SEED,
    choose_exponents,
    controller_builder,
    identify_cards,
    offered_controller,
)
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_participants
from pellucid_lab.pointing.session import Unpowered
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

TRAVELS = sized({"0mrad": 0.0, "0_3mrad": 0.3e-3, "1mrad": 1e-3, "3mrad": 3e-3}, smallest={"0_3mrad": 0.3e-3})
"""By the end of the id [rad]."""

LAWS = (
    "clpc", "pcfr", REFERENCE_LAW, "without_friction", "transparent", "emg", "oscillator", BEST_CONTROLLER,
    "zero_impedance", "disturbance_observer", "force_sensor", "residual",
)  # fmt: skip

TRIED_LAWS = sized(LAWS, smallest=(REFERENCE_LAW, "transparent", "force_sensor"))
"""Laws that are tried."""

ANYWAY: Mapping[str, float] = {"dithered_anyway": 1000.0, "dithered_slowly": 600.0}
"""Dither whatever the travel, at a frequency [rad/s]."""

UNPOWERED = "unpowered"

ROBOTS = sized(5, smallest=1)
PEOPLE = sized(3, smallest=1)
REPETITIONS = 1


def rows(robots: int = ROBOTS) -> Iterator[ResultRow]:
    """By law and travel: torque over FC's, energy given, speed at rest; and by travel what was measured of it."""
    drawn = drawn_rigs(able_elbow(), robots)
    jobs = [(tried, robot, travel) for travel in TRAVELS.values() for robot in drawn]
    made = ordered_results(jobs)
    for i, (name, travel) in enumerate(TRAVELS.items()):
        of_travel = made[i * robots : (i + 1) * robots]
        said = f"{robots} simulated robots that slip over {1e3 * travel:g} mrad"
        for law in of_travel[0][1]:
            found = [laws[law] for _, laws in of_travel]
            over = np.array([one.torque for one in found]) / [laws[REFERENCE_LAW].torque for _, laws in of_travel]
            note = f"{over.min():.2f} to {over.max():.2f}, median of {said}; interaction torque over FC's"
            refused = sum(one.refused for one in found)
            note += f"; dither refused on {refused}" if refused else ""
            yield _row(f"laws.{law}.{name}", float(np.median(over)), "1", note)
            note = f"worst of {said}; most of 99 % of movements there and back, above 0 the robot drives"
            yield _row(f"given.{law}.{name}", max(one.given for one in found), "J", note)
            note = f"worst of {said}; two seconds after a movement"
            yield _row(f"resting.{law}.{name}", max(one.resting for one in found), "rad/s", note)
        faults = sum(one.faults for _, laws in of_travel for one in laws.values())
        yield _row(f"laws.faults.{name}", faults, "1", f"sessions that ended with a gate shut; {said}")
        measured = np.array([value for value, _ in of_travel])
        note = f"travel as reversals show it, {1e3 * measured.min():.3f} to {1e3 * measured.max():.3f} mrad; {said}"
        yield _row(f"laws.measured.{name}", float(np.median(measured)), "rad", note)


def tried(robot: ElbowRig, travel: float) -> tuple[float, dict[str, LawOnRobot]]:
    """The travel that is measured of a robot [rad], and every law on it."""
    robot = robot.changed({"transmission.presliding_travel": travel})
    cards, rig = identify_cards(robot), elbow_participants(robot)
    exponents = choose_exponents(rig, cards)[0]
    people = draw_people(rig, np.random.default_rng([PEOPLE_SEED, TUNING_SEED]), count=PEOPLE)
    found = {}
    for name in (*TRIED_LAWS, *ANYWAY, UNPOWERED):
        laws = [Unpowered()] * PEOPLE
        if name in ANYWAY:
            laws = [_anyway(cards["load"], person.slider(rig), ANYWAY[name]) for person in people]
        elif name != UNPOWERED:
            build = controller_builder(cards, offered_controller(cards, name), exponents=exponents)
            laws = [build(person, person.slider(rig)) for person in people]
        one = try_law(rig, people, laws, PEOPLE_SEED, REPETITIONS)
        found[name] = replace(one, refused=offered_controller(cards, name) != name if name in TRIED_LAWS else False)
    return cards["load"].presliding_travel.value, found


def _anyway(card: SliderCard, place: float, frequency: float) -> ControlLaw:
    return with_dither(transparent_and(**DITHERED_BODY)(card, place), frequency=frequency)


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"friction.{name}", float(value), unit, "evidence", "simulated", None, note)
