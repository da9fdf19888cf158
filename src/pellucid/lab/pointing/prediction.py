"""What an experiment with people in a robot would find, told before it is made: effects with their intervals.

People and robots are drawn; every robot is identified, gets its laws from what was found, and is worn by every person.
Of these pairs studies are drawn, each of a few people on one robot, as a lab would do it: the interval of a published
mean is that of studies, not of people. Several rigs, whose people follow different models, share the robots evenly, so
that an interval holds what the models disagree about.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import qmc

from ..._errors import PellucidError
from ..._processes import ordered_results
from ...control.elbow_controllers import ELBOW_CONTROLLERS
from ..elbow.rig import ElbowRig
from .conditions import Cards, choose_exponents, controller_builder, identify_cards, offered_controller
from .people import Person, draw_people
from .rig import PointingRig
from .session import CONTROL_CONDITION, RobotLaw, simulate_session
from .session_indices import PUBLISHED_RULE, index_change, session_indices

PUBLISHED_CONTROLLERS = {"FC": "fc", "PCFr": "pcfr", "CLPC": "clpc"}
"""Controllers of the published conditions, which are worn where no others are named."""

INDICES = ("duration", "duration_median", "vmax", "emg_per_acc", "antagonists", "unsettled")
"""What is predicted, in the order of every array: as `IndexMeans` has them, and the share that never settled."""

STUDY_INTERVAL_SHARE = 0.8
"""Of the drawn studies, which intervals hold."""

DRAWN_STUDY_COUNT = 4000
"""Studies that are drawn of the pairs; they cost next to nothing."""

FRICTION_SCALE_RANGE = (0.17, 1.0)
"""Of the rig's own friction, drawn evenly in the logarithm: from the 0.028 to 0.047 N*m that the ABLE paper prints of
its elbow to the committed rig's 0.22 N*m."""

FRICTION_CONSTANTS = {
    "transmission": ("coulomb_positive", "coulomb_negative", "viscous_positive", "viscous_negative", "stribeck"),
    "bearing": ("coulomb", "viscous"),
}
"""What is multiplied by that; the shares of the load are drawn for themselves."""

Exponents = tuple[float, float]


@dataclass(frozen=True)
class DrawnRobot:
    """A robot, who wears it, and who chooses its k."""

    rig: PointingRig  # People and robot
    model: int  # Which of the given rigs its people are of
    friction: float  # Of the rig's own [1]
    exponents: Exponents | None  # k of equation 8; None where testers on it choose them


@dataclass(frozen=True, eq=False)
class RobotOutcome:
    """What everybody came to on one robot."""

    robot: str
    model: int
    friction: float
    exponents: Exponents | None  # None where no law has any
    chosen: bool  # Whether testers on this robot chose them
    values: np.ndarray  # (laws, people, indices) In the order of `INDICES`
    movements: int  # All that were made, those of the testers left out
    cpu: float  # Processor time: of movements, and of the identification and choice before them [s]
    cpu_before: float


@dataclass(frozen=True, eq=False)
class DrawnStudies:
    """Studies as a lab would make them: some people, one robot, free and under every law."""

    laws: tuple[str, ...]
    robot: np.ndarray  # (n,) Which of `Prediction.worn`
    control: np.ndarray  # (n, people, indices)
    worn: np.ndarray  # (n, laws, people, indices)

    def effect(self, index: str, law: str) -> np.ndarray:
        """Change of an `index` from control under a `law`, shape (n,) [%]; of what is unsettled, the share itself."""
        i, k = INDICES.index(index), self.laws.index(law)
        worn, control = self.worn[:, k, :, i], self.control[:, :, i]
        return 100.0 * np.mean(worn, axis=-1) if index == "unsettled" else index_change(index, worn, control)

    def interval(self, index: str, law: str, share: float = STUDY_INTERVAL_SHARE) -> tuple[float, float, float]:
        """Lower end, median and upper end of the middle `share` of an effect [%]."""
        drawn = self.effect(index, law)
        drawn = drawn[np.isfinite(drawn)]
        if not len(drawn):
            return (float("nan"),) * 3
        low, middle, high = np.quantile(drawn, [0.5 - 0.5 * share, 0.5, 0.5 + 0.5 * share])
        return float(low), float(middle), float(high)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Every pair of a drawn person and a drawn robot."""

    laws: tuple[str, ...]
    models: tuple[str, ...]  # Names of the rigs
    control: np.ndarray  # (models, people, indices) Of the same people without a robot
    worn: tuple[RobotOutcome, ...]
    repetitions: int  # Movements of a person in a condition
    wall: float  # [s]

    @property
    def people(self) -> int:
        """Of each model."""
        return self.control.shape[1]

    @property
    def movements(self) -> int:
        """That were made in robots."""
        return sum(one.movements for one in self.worn)

    @property
    def cpu(self) -> float:
        """Processor time that movements in robots took, without identifications [s]."""
        return sum(one.cpu for one in self.worn)

    @cached_property
    def values(self) -> np.ndarray:
        """Of all pairs, shape (robots, laws, people, indices)."""
        return np.array([one.values for one in self.worn])

    @cached_property
    def free(self) -> np.ndarray:
        """The same people's indices without a robot, shape (robots, people, indices)."""
        return self.control[[one.model for one in self.worn]]

    def pairs(self, index: str, law: str) -> np.ndarray:
        """Every pair's own change under a `law`, shape (robots, people) [%]; of what is unsettled, the share itself."""
        i, k = INDICES.index(index), self.laws.index(law)
        worn = self.values[:, k, :, i]
        return 100.0 * worn if index == "unsettled" else 100.0 * (worn / self.free[:, :, i] - 1.0)

    def of_model(self, model: int) -> Prediction:
        """What people of one model came to alone."""
        return replace(self, worn=tuple(one for one in self.worn if one.model == model))

    def studies(self, count: int = DRAWN_STUDY_COUNT, *, size: int = 6, seed: int = 0) -> DrawnStudies:
        """`count` studies of `size` people each, nobody twice in one, on a robot drawn among all.

        Raises
        ------
        PellucidError
            If fewer people were drawn than a study takes.
        """
        if size > self.people:
            raise PellucidError(
                f"prediction: found {self.people} people, expected at least the {size} that take part in a study"
            )
        rng = np.random.default_rng([seed, 0x57])
        robots = rng.integers(len(self.worn), size=count)
        who = np.argsort(rng.random((count, self.people)), axis=1)[:, :size]
        free = np.take_along_axis(self.free[robots], who[:, :, None], axis=1)
        worn = np.take_along_axis(self.values[robots], who[:, None, :, None], axis=2)
        return DrawnStudies(self.laws, robots, free, worn)


def draw_robots(
    robot: ElbowRig, count: int, *, friction: tuple[float, float] = FRICTION_SCALE_RANGE, seed: int = 1
) -> list[tuple[float, ElbowRig]]:
    """So many robots like one, with their friction over its own [1]: that between `friction`, evenly in the logarithm,
    everything else evenly from the ranges of its file's ``[drawn]``. Each range is divided evenly among them."""
    own = {f"{table}.{name}" for table, names in FRICTION_CONSTANTS.items() for name in names}
    ranges = {path: ends for path, ends in robot["drawn"].items() if path not in own}
    levels = qmc.LatinHypercube(1 + len(ranges), rng=np.random.default_rng([seed, 0x0B])).random(count)
    made = []
    for i, (first, *others) in enumerate(levels):
        scale = float(np.exp(np.log(friction[0]) + first * np.log(friction[1] / friction[0])))
        values = {path: low + u * (high - low) for (path, (low, high)), u in zip(ranges.items(), others, strict=True)}
        other = robot.changed({path: float(value) for path, value in values.items()}, f"drawn-{i + 1}")
        made.append((scale, scale_friction(other, scale)))
    return made


def scale_friction(robot: ElbowRig, scale: float) -> ElbowRig:
    """A robot with its friction multiplied, but for the share of the load [1]."""
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
    seed: int = 1,
    workers: int | None = None,
    executor: Executor | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Prediction:
    """So many `people` of every rig, on so many `robots` in all, so many `movements` free and under each law.

    `controllers` are by the name of their condition; `exponents` are ways to come to k of equation 8, shared evenly by
    the robots: two numbers, or None where five people on the robot choose them.

    Raises
    ------
    PellucidError
        If there are fewer robots than rigs, or movements are no whole number of ways there and back.
    """
    if robots < len(rigs):
        raise PellucidError(
            f"prediction: found {robots} robots for {len(rigs)} models of people, expected one for each"
        )
    if movements < 2 or movements % 2:
        raise PellucidError(f"prediction: found {movements} movements, expected an even number: there and back")
    tell, begun = on_progress or (lambda text, share: None), time.perf_counter()
    named = dict(controllers or PUBLISHED_CONTROLLERS)
    drawn = draw_robots(rigs[0].robot, robots, friction=friction, seed=seed)
    who = [draw_people(rig, np.random.default_rng([seed, 0x9E, i]), count=people) for i, rig in enumerate(rigs)]
    jobs: list[tuple] = [(_free, rig, who[i], movements, (seed, 0, i)) for i, rig in enumerate(rigs)]
    for i, (scale, robot) in enumerate(drawn):
        model = i % len(rigs)
        k = exponents[i // len(rigs) % len(exponents)]
        one = DrawnRobot(replace(rigs[model], robot=robot), model, scale, k)
        jobs.append((_worn, one, who[model], named, movements, (seed, 1, i)))
    tell(f"{people} people without a robot, and on {robots} robots", 0.0)
    found = ordered_results(
        jobs, workers, lambda done, of: tell(f"{done} of {of} robots and controls", done / of), executor
    )
    free, worn = found[: len(rigs)], found[len(rigs) :]
    names = tuple(rig.name for rig in rigs)
    return Prediction(tuple(named), names, np.array(free), tuple(worn), movements, time.perf_counter() - begun)


def _free(rig: PointingRig, people: Sequence[Person], movements: int, seed: tuple[int, ...]) -> np.ndarray:
    """Indices of everybody without a robot, shape (people, indices)."""
    return np.array(
        [
            simulate_indices(rig, person, CONTROL_CONDITION, None, movements, (*seed, j))
            for j, person in enumerate(people)
        ]
    )


def _worn(
    drawn: DrawnRobot,
    people: Sequence[Person],
    controllers: Mapping[str, str],
    movements: int,
    seed: tuple[int, ...],
) -> RobotOutcome:
    """A robot is identified, and everybody wears it under every law."""
    begun, rig = time.process_time(), drawn.rig
    cards = identify_cards(rig.robot, seed=seed[-1])
    k = drawn.exponents
    chosen = k is None and any(ELBOW_CONTROLLERS[name].exponents for name in controllers.values())
    if chosen:
        k = choose_exponents(rig, cards, seed=seed)[0]
    ready = time.process_time()
    values = [
        [
            simulate_indices(rig, person, condition, build_law(cards, name, k, rig, person), movements, (*seed, j, i))
            for j, person in enumerate(people)
        ]
        for i, (condition, name) in enumerate(controllers.items())
    ]
    count = movements * len(people) * len(controllers)
    spent = time.process_time() - ready
    return RobotOutcome(
        rig.robot.name, drawn.model, drawn.friction, k, chosen, np.array(values), count, spent, ready - begun,
    )  # fmt: skip


def build_law(cards: Cards, controller: str, exponents: Exponents | None, rig: PointingRig, person: Person) -> RobotLaw:
    """A controller of an identified robot for whoever wears it; what its card refuses, as it is offered."""
    return controller_builder(cards, offered_controller(cards, controller), exponents=exponents)(
        person, person.slider(rig)
    )


def simulate_indices(
    rig: PointingRig, person: Person, condition: str, law: RobotLaw | None, movements: int, seed: tuple[int, ...]
) -> np.ndarray:
    """What a person's movements in a condition came to, shape (indices,)."""
    rng = np.random.default_rng(seed)
    found = session_indices(
        simulate_session(rig, person, condition, law, rng, draw_balanced_lifts(rig, movements, rng))
    )
    means = found.means[PUBLISHED_RULE]
    # Where none came to an end there is no mean of those that did, and what was seen of them is the least they took.
    duration = means.duration if np.isfinite(means.duration) else means.duration_median
    return np.array(
        [duration, means.duration_median, means.vmax, means.emg_per_acc, means.antagonists, found.unsettled]
    )


def draw_balanced_lifts(rig: PointingRig, movements: int, rng: np.random.Generator) -> np.ndarray:
    """Amplitudes of half so many upward movements, shape (n,) [rad]: every one of the rig's as often as the others, one
    at most."""
    amplitudes = np.deg2rad(rig["pointing"]["amplitudes"])
    n = movements // 2
    return np.concatenate([rng.permutation(amplitudes) for _ in range(-(-n // len(amplitudes)))])[:n]
