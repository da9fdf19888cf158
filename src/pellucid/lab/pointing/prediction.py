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
from .conditions import Cards, chosen_exponents, condition_of, identified_cards, offered
from .people import Person, draw_people
from .predicted_indices import PREDICTED_INDICES, PREDICTED_INDICES_BY_NAME, change
from .rig import PointingRig
from .session import CONTROL, RobotLaw, point
from .session_indices import session_indices

LAWS = {"FC": "fc", "PCFr": "pcfr", "CLPC": "clpc"}
"""Controllers of the published conditions, which are worn where no others are named."""

INDICES = tuple(PREDICTED_INDICES_BY_NAME)
"""Names of the predicted indices, in the order of every array."""

SHARE = 0.8
"""Of the drawn studies, which intervals hold."""

STUDIES = 4000
"""Studies that are drawn of the pairs; they cost next to nothing."""

FRICTION = (0.17, 1.0)
"""Of the rig's own friction, drawn evenly in the logarithm: from the 0.028 to 0.047 N*m that the ABLE paper prints of
its elbow to the committed rig's 0.22 N*m."""

FRICTIONAL = {
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
class Worn:
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
        return change(index, worn, control)

    def interval(self, index: str, law: str, share: float = SHARE) -> tuple[float, float, float]:
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
    worn: tuple[Worn, ...]
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
        return PREDICTED_INDICES_BY_NAME[index].own_change(self.values[:, k, :, i], self.free[:, :, i])

    def of_model(self, model: int) -> Prediction:
        """What people of one model came to alone."""
        return replace(self, worn=tuple(one for one in self.worn if one.model == model))

    def studies(self, count: int = STUDIES, *, size: int = 6, seed: int = 0) -> DrawnStudies:
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


def drawn_robots(
    robot: ElbowRig, count: int, *, friction: tuple[float, float] = FRICTION, seed: int = 1
) -> list[tuple[float, ElbowRig]]:
    """So many robots like one, with their friction over its own [1]: that between `friction`, evenly in the logarithm,
    everything else evenly from the ranges of its file's ``[drawn]``. Each range is divided evenly among them."""
    own = {f"{table}.{name}" for table, names in FRICTIONAL.items() for name in names}
    ranges = {path: ends for path, ends in robot["drawn"].items() if path not in own}
    levels = qmc.LatinHypercube(1 + len(ranges), rng=np.random.default_rng([seed, 0x0B])).random(count)
    made = []
    for i, (first, *others) in enumerate(levels):
        scale = float(np.exp(np.log(friction[0]) + first * np.log(friction[1] / friction[0])))
        values = {path: low + u * (high - low) for (path, (low, high)), u in zip(ranges.items(), others, strict=True)}
        other = robot.changed({path: float(value) for path, value in values.items()}, f"drawn-{i + 1}")
        made.append((scale, with_friction(other, scale)))
    return made


def with_friction(robot: ElbowRig, scale: float) -> ElbowRig:
    """A robot with its friction multiplied, but for the share of the load [1]."""
    values = {f"{t}.{name}": scale * robot[t][name] for t, names in FRICTIONAL.items() for name in names}
    return robot.changed(values, robot.name)


def predict_effects(
    rigs: Sequence[PointingRig],
    *,
    people: int = 12,
    robots: int = 12,
    movements: int = 100,
    controllers: Mapping[str, str] | None = None,
    exponents: Sequence[Exponents | None] = (None,),
    friction: tuple[float, float] = FRICTION,
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
    named = dict(controllers or LAWS)
    drawn = drawn_robots(rigs[0].robot, robots, friction=friction, seed=seed)
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
    return np.array([indices_of(rig, person, CONTROL, None, movements, (*seed, j)) for j, person in enumerate(people)])


def _worn(
    drawn: DrawnRobot,
    people: Sequence[Person],
    controllers: Mapping[str, str],
    movements: int,
    seed: tuple[int, ...],
) -> Worn:
    """A robot is identified, and everybody wears it under every law."""
    begun, rig = time.process_time(), drawn.rig
    cards = identified_cards(rig.robot, seed=seed[-1])
    k = drawn.exponents
    chosen = k is None and any(ELBOW_CONTROLLERS[name].exponents for name in controllers.values())
    if chosen:
        k = chosen_exponents(rig, cards, seed=seed)[0]
    ready = time.process_time()
    values = [
        [
            indices_of(rig, person, condition, law_of(cards, name, k, rig, person), movements, (*seed, j, i))
            for j, person in enumerate(people)
        ]
        for i, (condition, name) in enumerate(controllers.items())
    ]
    count = movements * len(people) * len(controllers)
    spent = time.process_time() - ready
    return Worn(
        rig.robot.name, drawn.model, drawn.friction, k, chosen, np.array(values), count, spent, ready - begun,
    )  # fmt: skip


def law_of(cards: Cards, controller: str, exponents: Exponents | None, rig: PointingRig, person: Person) -> RobotLaw:
    """A controller of an identified robot for whoever wears it; what its card refuses, as it is offered."""
    return condition_of(cards, offered(cards, controller), exponents=exponents)(person, person.slider(rig))


def indices_of(
    rig: PointingRig, person: Person, condition: str, law: RobotLaw | None, movements: int, seed: tuple[int, ...]
) -> np.ndarray:
    """What a person's movements in a condition came to, shape (indices,)."""
    rng = np.random.default_rng(seed)
    found = session_indices(point(rig, person, condition, law, rng, lifts_of(rig, movements, rng)))
    return np.array([index.value(found) for index in PREDICTED_INDICES])


def lifts_of(rig: PointingRig, movements: int, rng: np.random.Generator) -> np.ndarray:
    """Amplitudes of half so many upward movements, shape (n,) [rad]: every one of the rig's as often as the others, one
    at most."""
    amplitudes = np.deg2rad(rig["pointing"]["amplitudes"])
    n = movements // 2
    return np.concatenate([rng.permutation(amplitudes) for _ in range(-(-n // len(amplitudes)))])[:n]
