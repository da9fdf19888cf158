"""Validity of findings on richer rigs: reduced reproductions of ``able`` and ``knee``, with and without each effect.

A line is a rig: straps that are a spring and a damper over friction that slips at once (`plain`, what models know);
that and one physics more; and all at once. Figures are those of `pellucid reproduce`, from fewer of everything: three
simulated elbows with three people and five movements there and back a law, whose robots are identified for themselves;
the virtual knee orthosis alone and its three wearers' straps, one seed. Nothing here was chosen by what it shows.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from pellucid.models.slider_joint import SliderCard
from pellucid.study.results import ResultRow
from pellucid_lab.elbow.rig import ElbowRig, able_elbow, drawn_rigs
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.papers.able.law_comparison import PEOPLE_SEED, REFERENCE_LAW, try_law
from pellucid_lab.papers.knee.wearers import drawn_from, identify_bench, identify_straps
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
from pellucid_lab.strap_options import STRAP_OPTIONS, without_strap_options
from research.benchmarks._size import sized

ROBOTS = sized(3, smallest=1)
PEOPLE = sized(3, smallest=1)
REPETITIONS, SEED = 1, 1
LAWS = ("clpc", REFERENCE_LAW, "transparent", "dithered", "force_sensor")
UNPOWERED = "unpowered"


@dataclass(frozen=True)
class Line:
    """A rig with some of the physics that models lack."""

    straps: tuple[str, ...] = ()  # What straps have of `STRAP_OPTIONS`
    travel: float = 0.0  # Over which friction builds up before it slips [rad]

    def strap(self) -> Mapping[str, float]:
        """Constants of a strap, as rigs take them in `strapped`."""
        left_out = [option for option in STRAP_OPTIONS if option not in self.straps]
        return without_strap_options(*left_out) if left_out else {}


LINES: Mapping[str, Line] = {
    "plain": Line(),
    **{option: Line((option,)) for option in STRAP_OPTIONS},
    "straps": Line(tuple(STRAP_OPTIONS)),
    "travel_0_3mrad": Line(travel=0.3e-3),
    "travel_1mrad": Line(travel=1e-3),
    "travel_3mrad": Line(travel=3e-3),
    "all": Line(tuple(STRAP_OPTIONS), 1e-3),
}
"""By the end of ids."""

KNEE_LINES = tuple(name for name in LINES if name not in ("travel_0_3mrad", "travel_3mrad"))

WORDS: Mapping[str, tuple[str, str]] = {
    "able.ratio": ("1", "error of one set of parameters over that of one for each direction, trials never fitted"),
    "able.load_ratio": ("1", "error of one coherent body with friction by load over that of two directions"),
    "able.gravity_error": ("%", "of that body's gravity torque, with its sign"),
    **{f"able.{law}": ("1", "interaction torque over FC's") for law in (*LAWS, UNPOWERED) if law != REFERENCE_LAW},
    "able.fc_given": ("J", "that FC gives over a movement there and back at most (99 %)"),
    "knee.gravity_error": ("%", "of the orthosis's gravity torque"),
    "knee.shank_error": ("%", "of the shank's gravity torque, mean size"),
    "knee.response": ("%", "fit of a pendulum with friction to another amplitude"),
    "knee.coupled": ("%", "fit of the angle between leg and orthosis, held out"),
    "knee.stiffness": ("1", "the strap's stiffness over the true one where it is not stretched"),
    "knee.holds": ("1", "share of 95 % intervals that cover it"),
    "knee.inertia_holds": ("1", "share of 95 % intervals that cover the strap's inertia, which is 0"),
}
"""Unit and meaning of each figure."""


NAMES = sized(tuple(LINES), smallest=("all",))
"""Lines that are played."""


def rows(robots: int = ROBOTS, names: tuple[str, ...] = NAMES) -> Iterator[ResultRow]:
    """Every figure on every line."""
    travels = sorted({LINES[name].travel for name in names})
    of_travel = {travel: tuple(n for n in names if LINES[n].travel == travel) for travel in travels}
    elbows = [(elbow, rig, travel, of_travel[travel]) for travel in travels for rig in drawn_rigs(able_elbow(), robots)]
    knees = [name for name in names if name in KNEE_LINES]
    made = ordered_results([*elbows, *((knee, name) for name in knees)])
    found: dict[str, list[dict[str, float]]] = {name: [] for name in names}
    for one in made[: len(elbows)]:
        for name, figures in one.items():
            found[name].append(figures)
    for name, every in found.items():
        for figure in every[0]:
            yield _row(figure, name, [one[figure] for one in every], f"{robots} drawn robots")
    for name, figures in zip(knees, made[len(elbows) :], strict=True):
        for figure, values in figures.items():
            yield _row(figure, name, values, "three wearers, one seed" if len(values) > 1 else "one seed")


def _row(figure: str, line: str, values: list[float], said: str) -> ResultRow:
    unit, words = WORDS[figure]
    between = f", {min(values):.3g} to {max(values):.3g}" if len(values) > 1 else ""
    middle = float(np.mean(values)) if figure.startswith("knee") else float(np.median(values))
    return ResultRow(
        f"richer.{figure}.{line}", middle, unit, "evidence", "simulated", None, f"{words}; {said}{between}"
    )


def elbow(robot: ElbowRig, travel: float, names: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """Figures of one robot on lines that share its travel [rad]: it is identified once, without straps."""
    robot = robot.changed({"transmission.presliding_travel": travel})
    cards = identify_cards(robot)
    errors = {method: card.heldout_error for method, card in cards.items()}
    own = {
        "able.ratio": errors["pooled"] / errors["dissociated"],
        "able.load_ratio": errors["load"] / errors["dissociated"],
        "able.gravity_error": 100.0 * (_gravity(cards["load"]) / robot.gravity(robot["slider"]["low"])[0] - 1.0),
    }
    found = {}
    for name in names:
        rig = elbow_participants(robot).strapped(LINES[name].strap())
        exponents = choose_exponents(rig, cards)[0]
        people = draw_people(rig, np.random.default_rng([PEOPLE_SEED, TUNING_SEED]), count=PEOPLE)
        tried = {}
        for law in (*LAWS, UNPOWERED):
            laws = [Unpowered()] * PEOPLE
            if law != UNPOWERED:
                build = controller_builder(cards, offered_controller(cards, law), exponents=exponents)
                laws = [build(person, person.slider(rig)) for person in people]
            tried[law] = try_law(rig, people, laws, PEOPLE_SEED, REPETITIONS)
        torque = tried[REFERENCE_LAW].torque
        found[name] = own | {f"able.{law}": one.torque / torque for law, one in tried.items() if law != REFERENCE_LAW}
        found[name]["able.fc_given"] = tried[REFERENCE_LAW].given
    return found


def _gravity(card: SliderCard) -> float:
    """Per sin q with the carriage at the rail's near end [N m]."""
    model = card.model()
    return float(model.gravity(card.values, np.array(card.rail[0]), np.array(0.5 * np.pi)))


def knee(name: str) -> dict[str, list[float]]:
    """Figures of the orthosis and its wearers on a line."""
    rig = knee_orthosis().changed({"actuator.presliding_travel": LINES[name].travel}).strapped(LINES[name].strap())
    bench, worn = identify_bench(rig, SEED), identify_straps(rig, SEED)
    gravity = next(p.value for p in bench.fit.parameters if p.name == "gravity")
    drawn = [drawn_from(one) for one in worn]
    return {
        "knee.gravity_error": [100.0 * abs(gravity / bench.gravity - 1.0)],
        "knee.shank_error": [abs(one.gravity_error) for one in drawn],
        "knee.response": [bench.fit.mean_fit()],
        "knee.coupled": [one.fit for one in drawn],
        "knee.stiffness": [
            one.strap["stiffness"].value / w.subject.strap["stiffness"] for one, w in zip(drawn, worn, strict=True)
        ],
        "knee.holds": [float(one.holds["stiffness"]) for one in drawn],
        "knee.inertia_holds": [float(one.holds["inertia"]) for one in drawn],
    }
