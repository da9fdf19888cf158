"""Prediction of an experiment with people in a robot: effects of control laws on movement, with intervals.

People and robots are drawn. Every robot is identified, gets laws from its identification, and is worn by every person.
From these pairs of person and robot, studies are drawn as a lab would run them: a few people on one robot. The
intervals are those of study means, because a publication reports a mean and not a person. Several rigs, whose people
follow different models, share the robots evenly, so that the intervals include the disagreement between the models.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from scipy.stats import qmc

from pellucid._errors import PellucidError
from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.controllers.transparent_laws import expecting_load
from pellucid.models.anthropometry import Segment
from pellucid.people.comparison import tells_from_control
from pellucid.people.power import CANDIDATE_SIZES, find_fewest

from ..elbow.rig import ElbowRig, with_fastened_load
from ..processes import ordered_results
from .conditions import Cards, choose_exponents, controller_builder, identify_cards, offered_controller
from .people import Person, draw_people
from .predicted_indices import PREDICTED_INDICES, PREDICTED_INDICES_BY_NAME, change
from .rig import PointingRig
from .session import CONTROL_CONDITION, RobotLaw, simulate_session
from .session_indices import session_indices

PUBLISHED_CONTROLLERS = {"FC": "fc", "PCFr": "pcfr", "CLPC": "clpc"}
"""Controllers of the published conditions by the name of the condition; they are worn where no others are given."""

INDICES = tuple(PREDICTED_INDICES_BY_NAME)
"""Names of the predicted indices, in the order of every array."""

STUDY_INTERVAL_SHARE = 0.8
"""Share of the simulated studies that an interval contains."""

DRAWN_STUDY_COUNT = 4000
"""Number of studies sampled from the pairs, without further simulation."""

FORECAST_STUDY_COUNT = 2000
"""Number of studies sampled for each number of people that a forecast tries."""

FRICTION_SCALE_RANGE = (0.17, 1.0)
"""Smallest and largest factor on the friction of the rig's robot; that of a sampled robot is log-uniform between them.

The smallest gives the 0.028 to 0.047 N*m that the ABLE paper [1]_ prints for its elbow, the largest the rig's own 0.22
N*m.

.. [1] D. Verdel, S. Bastide, N. Vignais, O. Bruneau, B. Berret, "An identification-based method improving the
transparency
   of a robotic upper limb exoskeleton", Robotica 39, 2021."""

FRICTION_CONSTANTS = {
    "transmission": ("coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative", "stribeck"),
    "bearing": ("coulomb", "viscous"),
}
"""Constants of a robot's file, by table, that are multiplied by the factor on friction.

Load-dependent friction is drawn on its own."""

Exponents = tuple[float, float]
"""Exponents k of equation 8 of the ABLE paper, upwards and downwards."""


@dataclass(frozen=True)
class CarriedWeight:
    """What robots and people of a prediction carry beyond themselves, and controllers carry for them."""

    load: Segment | None = None  # load on the robot, about its axis; None for none
    held: Segment | None = None  # load in the hand, with a robot and without; None for none
    support: float | None = None  # share of the forearm's weight that "support" carries [1]; None for its own

    def settings_of(self, controller: str) -> dict[str, Segment | float]:
        """Return what a controller is built with, so that it carries this."""
        settings: dict[str, Segment | float] = {}
        if self.load is not None:
            settings["load"] = self.load
        if self.held is not None:
            settings["held"] = self.held
        if self.support is not None and ELBOW_CONTROLLERS[controller].assists:
            settings["share"] = self.support
        return settings

    def without(self, controller: str) -> dict[str, float]:
        """Return the settings of a controller's reference variant, which carries no weight."""
        return {"share": 0.0} if ELBOW_CONTROLLERS[controller].assists else {}

    def __str__(self) -> str:
        loads = [
            f"a load of {one.mass:.3g} kg at {one.centre:.3g} m {where}"
            for one, where in ((self.load, "on the robot"), (self.held, "in the hand"))
            if one is not None
        ]
        share = [] if self.support is None else [f"{100.0 * self.support:.3g} % of the forearm's weight supported"]
        return " and ".join(loads + share)


NOTHING_CARRIED = CarriedWeight()
"""People and robots carry themselves alone."""

NOT_CARRYING = "_not_carrying"
"""End of the name of a condition in which the controller carries none of the load, or of the limb."""

CARRYING_CONTROLLERS = ("transparent", "force_sensor", "support")
"""Controllers that are worn where a weight is to be carried and no others are named."""


def condition_words(condition: str) -> str:
    """Return the name of a worn condition in words."""
    carrying = condition.removesuffix(NOT_CARRYING)
    return carrying.replace("_", " ") + (", not carrying" if carrying != condition else "")


@dataclass(frozen=True)
class DrawnRobot:
    """A sampled robot with its wearers."""

    rig: PointingRig  # people, and the drawn robot
    model: int  # index of the rig whose people wear the robot
    friction: float  # factor on the friction of the rig's own robot [1]
    exponents: Exponents | None  # exponents of equation 8; None if people on this robot choose them


@dataclass(frozen=True, eq=False)
class RobotOutcome:
    """The indices of everybody on one robot."""

    robot: str  # name of the robot
    model: int  # index of the rig whose people wear the robot
    friction: float  # factor on the friction of the rig's own robot [1]
    exponents: Exponents | None  # exponents of equation 8; None where no law has any
    chosen: bool  # whether people on this robot chose the exponents
    values: np.ndarray  # (laws, people, indices) in the order of `INDICES`
    movements: int  # number of simulated movements, without those for the choice of exponents
    cpu: float  # processor time of the movements [s]
    cpu_before: float  # processor time of the identification and the choice of exponents [s]


@dataclass(frozen=True, eq=False)
class DrawnStudies:
    """Studies as a lab would run them: several people and one robot, without the robot and under every law."""

    laws: tuple[str, ...]
    robot: np.ndarray  # (n,) index of the study's robot in `Prediction.worn`
    control: np.ndarray  # (n, people, indices) without the robot
    worn: np.ndarray  # (n, laws, people, indices) with the robot

    def effect(self, index: str, law: str) -> np.ndarray:
        """Return the change of an `index` under a `law` from the control condition in each study, shape (n,) [%].

        For "unsettled" it is the share of movements under the law itself.
        """
        i, k = INDICES.index(index), self.laws.index(law)
        worn, control = self.worn[:, k, :, i], self.control[:, :, i]
        return change(index, worn, control)

    def shown(self, index: str) -> dict[str, float]:
        """Return by law in which share of the studies their own tests tell its `index` from the control condition."""
        i = INDICES.index(index)
        values = np.concatenate([self.control[:, None, :, i], self.worn[:, :, :, i]], axis=1).swapaxes(1, 2)
        values = values[np.isfinite(values).all(axis=(1, 2))]
        told = tells_from_control(values)
        return {law: float(told[:, k + 1].mean()) if len(told) else float("nan") for k, law in enumerate(self.laws)}

    def interval(self, index: str, law: str, share: float = STUDY_INTERVAL_SHARE) -> tuple[float, float, float]:
        """Return lower end, median and upper end of the interval with the middle `share` of the studies [%]."""
        drawn = self.effect(index, law)
        drawn = drawn[np.isfinite(drawn)]
        if not len(drawn):
            return (float("nan"),) * 3
        low, middle, high = np.quantile(drawn, [0.5 - 0.5 * share, 0.5, 0.5 + 0.5 * share])
        return float(low), float(middle), float(high)


@dataclass(frozen=True, eq=False)
class Prediction:
    """The indices of every pair of a simulated person and a simulated robot."""

    laws: tuple[str, ...]
    models: tuple[str, ...]  # names of the rigs
    control: np.ndarray  # (models, people, indices) without a robot
    worn: tuple[RobotOutcome, ...]  # one for each robot
    repetitions: int  # number of movements of a person in a condition
    wall: float  # time that the prediction took [s]

    @property
    def people(self) -> int:
        """Return the number of people of each model."""
        return self.control.shape[1]

    @property
    def movements(self) -> int:
        """Return the number of movements that were simulated in robots."""
        return sum(one.movements for one in self.worn)

    @property
    def cpu(self) -> float:
        """Return the processor time of movements in robots, without identifications [s]."""
        return sum(one.cpu for one in self.worn)

    @cached_property
    def values(self) -> np.ndarray:
        """Return the indices of all pairs, shape (robots, laws, people, indices)."""
        return np.array([one.values for one in self.worn])

    @cached_property
    def free(self) -> np.ndarray:
        """Return the indices of each robot's people without it, shape (robots, people, indices)."""
        return self.control[[one.model for one in self.worn]]

    def pairs(self, index: str, law: str) -> np.ndarray:
        """Return every pair's change of an `index` under a `law`, shape (robots, people) [%].

        For "unsettled" it is the share of movements under the law itself.
        """
        i, k = INDICES.index(index), self.laws.index(law)
        return PREDICTED_INDICES_BY_NAME[index].own_change(self.values[:, k, :, i], self.free[:, :, i])

    def of_model(self, model: int) -> Prediction:
        """Return the prediction with the people of one model only."""
        return replace(self, worn=tuple(one for one in self.worn if one.model == model))

    def studies(
        self, count: int = DRAWN_STUDY_COUNT, *, size: int = 6, seed: int = 0, repeats_people: bool = False
    ) -> DrawnStudies:
        """Draw `count` studies of `size` people each, on one robot each.

        The people of a study are different ones, unless it `repeats_people`: it may then have more than were simulated.

        Raises
        ------
        PellucidError
            If there are fewer people than a study needs.
        """
        if size > self.people and not repeats_people:
            raise PellucidError(
                f"prediction: found {self.people} people, expected at least the {size} that take part in a study"
            )
        rng = np.random.default_rng([seed, 0x57])
        robots = rng.integers(len(self.worn), size=count)
        who = (
            rng.integers(self.people, size=(count, size)) if repeats_people else
            np.argsort(rng.random((count, self.people)), axis=1)[:, :size]
        )  # fmt: skip
        free = np.take_along_axis(self.free[robots], who[:, :, None], axis=1)
        worn = np.take_along_axis(self.values[robots], who[:, None, :, None], axis=2)
        return DrawnStudies(self.laws, robots, free, worn)

    def people_needed(self, index: str, laws: Sequence[str], *, above: int, share: float) -> dict[str, int | None]:
        """Return by law the fewest people, `above` a number, with whom a `share` of studies shows its `index`.

        People are sampled from the simulated ones with replacement. None if the last of `CANDIDATE_SIZES` is too few.
        """
        shown = cache(lambda n: self.studies(FORECAST_STUDY_COUNT, size=n, repeats_people=True).shown(index))
        sizes = [n for n in CANDIDATE_SIZES if n > above]
        return {law: find_fewest(sizes, lambda n, law=law: shown(n)[law] >= share, above) for law in laws}


def draw_robots(
    robot: ElbowRig, count: int, *, friction: tuple[float, float] = FRICTION_SCALE_RANGE, seed: int = 1
) -> list[tuple[float, ElbowRig]]:
    """Draw `count` robots like `robot`; return each with the factor on its friction [1].

    The factor is log-uniform between the two of `friction`; all other constants are uniform over the ranges of
    ``[drawn]`` in the robot's file. A Latin hypercube spreads the robots evenly over each range.
    """
    friction_paths = {f"{table}.{name}" for table, names in FRICTION_CONSTANTS.items() for name in names}
    ranges = {path: ends for path, ends in robot["drawn"].items() if path not in friction_paths}
    levels = qmc.LatinHypercube(1 + len(ranges), rng=np.random.default_rng([seed, 0x0B])).random(count)
    drawn = []
    for i, (friction_level, *others) in enumerate(levels):
        scale = float(np.exp(np.log(friction[0]) + friction_level * np.log(friction[1] / friction[0])))
        values = {path: low + u * (high - low) for (path, (low, high)), u in zip(ranges.items(), others, strict=True)}
        other = robot.changed({path: float(value) for path, value in values.items()}, f"drawn-{i + 1}")
        drawn.append((scale, scale_friction(other, scale)))
    return drawn


def scale_friction(robot: ElbowRig, scale: float) -> ElbowRig:
    """Return a robot whose friction, except for the load-dependent part, is multiplied by `scale` [1]."""
    values = {f"{t}.{name}": scale * robot[t][name] for t, names in FRICTION_CONSTANTS.items() for name in names}
    return robot.changed(values, robot.name)


def predict_effects(
    rigs: Sequence[PointingRig],
    *,
    people: int = 12,
    robots: int = 12,
    movements: int = 100,
    controllers: Mapping[str, str] | None = None,
    exponents: Sequence[Exponents | None] = (None,),
    friction: tuple[float, float] = FRICTION_SCALE_RANGE,
    carried: CarriedWeight = NOTHING_CARRIED,
    seed: int = 1,
    workers: int | None = None,
    executor: Executor | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Prediction:
    """Simulate every pair of a person and a robot, without a robot and under each law.

    Parameters
    ----------
    rigs : sequence of PointingRig
        Rigs whose people follow different models; they share the robots evenly. The robots are like that of the first.
    people : int
        Number of people of each rig.
    robots : int
        Number of robots in all.
    movements : int
        Number of movements of a person in each condition; even, because movements go there and back.
    controllers : mapping, optional
        Names of controllers by the name of their condition; by default `PUBLISHED_CONTROLLERS`.
    exponents : sequence
        Exponents k of equation 8, shared evenly by the robots: two numbers, or None if five people on the
        robot choose them.
    friction : tuple of float
        Smallest and largest factor on the friction of the robot [1].
    carried : CarriedWeight
        Load on the robot, load in the hand, and share of the limb's weight that controllers carry. If any is not zero,
        every controller that carries it is also worn without carrying, under its name with `NOT_CARRYING`.
    seed : int
        Seed of every random draw.
    workers : int, optional
        Number of processes; by default one for each processor.
    executor : concurrent.futures.Executor, optional
        Executor that runs the jobs instead of these processes.
    on_progress : callable, optional
        Function that is called with a text and the share of the work that is done, 0 to 1.

    Returns
    -------
    Prediction

    Raises
    ------
    PellucidError
        If there are fewer robots than rigs, or the number of movements is odd.
    """
    if robots < len(rigs):
        raise PellucidError(
            f"prediction: found {robots} robots for {len(rigs)} models of people, expected one for each"
        )
    if movements < 2 or movements % 2:
        raise PellucidError(f"prediction: found {movements} movements, expected an even number: there and back")
    tell, begun = on_progress or (lambda text, share: None), time.perf_counter()
    controllers = dict(controllers or PUBLISHED_CONTROLLERS)
    controllers |= {
        f"{condition}{NOT_CARRYING}": name for condition, name in controllers.items() if carried.settings_of(name)
    }
    drawn = draw_robots(rigs[0].robot, robots, friction=friction, seed=seed)
    who = [
        tuple(
            replace(person, held=carried.held)
            for person in draw_people(rig, np.random.default_rng([seed, 0x9E, i]), count=people)
        )
        for i, rig in enumerate(rigs)
    ]
    jobs: list[tuple] = [(_control_indices, rig, who[i], movements, (seed, 0, i)) for i, rig in enumerate(rigs)]
    for i, (scale, robot) in enumerate(drawn):
        model = i % len(rigs)
        k = exponents[i // len(rigs) % len(exponents)]
        one = DrawnRobot(replace(rigs[model], robot=robot), model, scale, k)
        jobs.append((_robot_outcome, one, who[model], controllers, movements, (seed, 1, i), carried))
    tell(f"{people} people without a robot, and on {robots} robots", 0.0)
    found = ordered_results(
        jobs, workers, lambda done, of: tell(f"{done} of {of} robots and controls", done / of), executor
    )
    free, worn = found[: len(rigs)], found[len(rigs) :]
    names = tuple(rig.name for rig in rigs)
    return Prediction(tuple(controllers), names, np.array(free), tuple(worn), movements, time.perf_counter() - begun)


def _control_indices(rig: PointingRig, people: Sequence[Person], movements: int, seed: tuple[int, ...]) -> np.ndarray:
    """Return the indices of everybody without a robot, shape (people, indices)."""
    return np.array(
        [
            simulate_indices(rig, person, CONTROL_CONDITION, None, movements, (*seed, j))
            for j, person in enumerate(people)
        ]
    )


def _robot_outcome(
    drawn: DrawnRobot,
    people: Sequence[Person],
    controllers: Mapping[str, str],
    movements: int,
    seed: tuple[int, ...],
    carried: CarriedWeight = NOTHING_CARRIED,
) -> RobotOutcome:
    """Identify a robot, and return the indices of all its wearers with every controller.

    A load is added to the robot after its identification.
    """
    begun, rig = time.process_time(), drawn.rig
    cards = identify_cards(rig.robot, seed=seed[-1])
    k = drawn.exponents
    chosen = k is None and any(ELBOW_CONTROLLERS[name].exponents for name in controllers.values())
    if chosen:
        k = choose_exponents(rig, cards, seed=seed)[0]
    if carried.load is not None:
        rig = replace(rig, robot=with_fastened_load(rig.robot, carried.load))
    ready = time.process_time()

    def law_of(condition: str, name: str, person: Person) -> RobotLaw:
        if not condition.endswith(NOT_CARRYING):
            return build_law(cards, name, k, rig, person, **carried.settings_of(name))
        law = build_law(cards, name, k, rig, person, **carried.without(name))
        return law if carried.load is None else expecting_load(law, carried.load)

    values = [
        [
            simulate_indices(rig, person, condition, law_of(condition, name, person), movements, (*seed, j, i))
            for j, person in enumerate(people)
        ]
        for i, (condition, name) in enumerate(controllers.items())
    ]
    count = movements * len(people) * len(controllers)
    spent = time.process_time() - ready
    return RobotOutcome(
        rig.robot.name, drawn.model, drawn.friction, k, chosen, np.array(values), count, spent, ready - begun,
    )  # fmt: skip


def build_law(
    cards: Cards, controller: str, exponents: Exponents | None, rig: PointingRig, person: Person, **settings
) -> ControlLaw:
    """Build a controller of an identified robot for a person; it has no dither where the card does not permit it.

    `settings` are further settings of the law, as a load that it carries.
    """
    return controller_builder(cards, offered_controller(cards, controller), exponents=exponents, **settings)(
        person, person.slider(rig)
    )


def simulate_indices(
    rig: PointingRig, person: Person, condition: str, law: RobotLaw | None, movements: int, seed: tuple[int, ...]
) -> np.ndarray:
    """Simulate a person's movements in a condition, and return their indices, shape (indices,)."""
    rng = np.random.default_rng(seed)
    session = simulate_session(rig, person, condition, law, rng, draw_balanced_lifts(rig, movements, rng))
    found = session_indices(session)
    return np.array([index.value(found) for index in PREDICTED_INDICES])


def draw_balanced_lifts(rig: PointingRig, movements: int, rng: np.random.Generator) -> np.ndarray:
    """Draw the amplitudes of the upward half of `movements`, shape (n,) [rad].

    Each of the rig's amplitudes occurs equally often, or once more than others.
    """
    amplitudes = np.deg2rad(rig["pointing"]["amplitudes"])
    n = movements // 2
    return np.concatenate([rng.permutation(amplitudes) for _ in range(-(-n // len(amplitudes)))])[:n]
