"""Every law of a worn elbow on robots that none was chosen on, with people who took no part in choosing.

The free constants of the toolkit's own laws were chosen on `tuning_robots` by people drawn with `TUNING_SEED`; judged
are other robots and other people. On each robot the exponents of the published laws are chosen as the paper chose them,
by five further people.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...controllers.elbow_controllers import BEST, BEST_SENSED, ELBOW_CONTROLLERS
from ...lab.elbow.rig import ElbowRig, able_elbow, drawn_rigs
from ...lab.pointing.conditions import TUNING_SEED, chosen_exponents, identified_cards, interaction_rms, worn
from ...lab.pointing.people import Person, PointingRig, draw_people, elbow_participants
from ...lab.pointing.session import Law, Unpowered, hold_still, point
from ..processes import finished
from ..reproduction import Reproduced, spread
from .transparency import injected_energy

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


@dataclass(frozen=True)
class Judged:
    """What one law did on one robot."""

    torque: float  # Interaction torque, RMS over movements [N m]; NaN where nobody came to a target
    given: float  # The most energy that the robot gave over a movement there and back, of 99 % of them [J]
    resting: float  # Fastest that the robot still moves two seconds after a movement [rad/s]
    faults: int  # Sessions at whose end the gate was shut


def tuning_robots(count: int = 9) -> tuple[ElbowRig, ...]:
    """The robots that constants were chosen on: the committed one, and others that are judged nowhere."""
    return (able_elbow(), *drawn_rigs(able_elbow(), count, seed=TUNING_ROBOTS_SEED))


def judge_laws(robot: ElbowRig, *, seed: int, count: int = 3, repetitions: int = 2) -> dict[str, Judged]:
    """A robot is identified, and every law built from what was found is tried by a few people."""
    cards, rig = identified_cards(robot), elbow_participants(robot)
    exponents = chosen_exponents(rig, cards)[0]
    rng = np.random.default_rng([seed, TUNING_SEED])
    people = draw_people(rig, rng, count=count)
    found = {}
    for name in (*CONTROLLERS, UNPOWERED):
        laws = []
        for person in people:
            if name == UNPOWERED:
                laws.append(Unpowered())
                continue
            controller, settings = CONTROLLERS[name]
            laws.append(worn(cards, controller, exponents=exponents, **settings)(person, person.slider(rig)))
        found[name] = _judge(rig, people, laws, seed, repetitions)
    return found


def _judge(rig: PointingRig, people: Sequence[Person], laws: Sequence[Law], seed: int, repetitions: int) -> Judged:
    sessions, resting = [], []
    amplitudes = np.repeat(rig["pointing"]["amplitudes"], repetitions)
    for person, law, rng in zip(people, laws, np.random.default_rng(seed).spawn(len(people)), strict=True):
        sessions.append(point(rig, person, "", law, rng, np.deg2rad(rng.permutation(amplitudes))))
        resting.append(hold_still(rig, person, law))
    given = np.concatenate([injected_energy(session) for session in sessions])
    torques = np.array([interaction_rms(session) for session in sessions])
    return Judged(
        float(np.mean(torques[np.isfinite(torques)])) if np.any(np.isfinite(torques)) else float("nan"),
        float(np.quantile(given, 0.99)),
        max(resting),
        sum(session.fault != "none" for session in sessions),
    )


def compare_controllers(
    robots: Sequence[ElbowRig], *, seed: int = TORQUE_SEED, count: int = 3, workers: int | None = None
) -> dict[str, tuple[Judged, ...]]:
    """Every law on several robots, each of which is identified for itself."""
    made: dict[int, dict[str, Judged]] = {}
    for i, found in finished([(_one, robot, seed, count) for robot in robots], workers):
        made[i] = found
    return {name: tuple(made[i][name] for i in range(len(robots))) for name in (*CONTROLLERS, UNPOWERED)}


def _one(robot: ElbowRig, seed: int, count: int) -> dict[str, Judged]:
    return judge_laws(robot, seed=seed, count=count)


def ratios(found: Mapping[str, Sequence[Judged]], law: str) -> np.ndarray:
    """Interaction torque of a law over that of FC, shape (robots,) [1]."""
    return np.array([one.torque / fc.torque for one, fc in zip(found[law], found[REFERENCE], strict=True)])


BEST_ROWS: Mapping[str, str] = {"": BEST, ".force_sensor": BEST_SENSED}
"""By the end of the id: which law is the best with an encoder alone, and with a force sensor."""

TREMBLE_NOTE = "; their friction slips at once: one that yields before it slips is freed less by a tremble"


def comparison_rows(found: Mapping[str, Sequence[Judged]]) -> tuple[Reproduced, ...]:
    """What `compare_controllers` found, as rows of the reproduction."""
    note = f"{len(found[REFERENCE])} drawn robots, and people, that no law was chosen on"
    rows = []

    def add(head: str, said: str, unit: str, drawn: Iterable[float], worst: bool = False, more: str = ""):
        middle, low, high = spread(drawn)
        rows.append(Reproduced(head, said, unit, None, high if worst else middle, low, high, note=note + more))

    over = "Interaction torque (RMS) over that of FC"
    for tail, law in BEST_ROWS.items():
        more = TREMBLE_NOTE if law == BEST else ""
        add(f"transparency.torque.best_over_fc{tail}", f"{over}, best: {law}", "1", ratios(found, law), more=more)
    for law, judged in found.items():
        if law != REFERENCE:
            add(f"transparency.torque.{law}_over_fc", f"{over}, {law}", "1", ratios(found, law))
        add(
            f"transparency.given.{law}", f"Energy that {law} gives over a movement there and back, worst robot", "J",
            (one.given for one in judged), worst=True,
        )  # fmt: skip
        add(
            f"transparency.resting.{law}", f"Speed two seconds after a movement, {law}, worst robot", "rad/s",
            (one.resting for one in judged), worst=True,
        )  # fmt: skip
    faults = sum(one.faults for judged in found.values() for one in judged)
    said = "Sessions that ended with a gate shut"
    rows.append(Reproduced("transparency.faults", said, "1", None, float(faults), note=note))
    return tuple(rows)
