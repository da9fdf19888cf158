"""Validation of simulated people: parameters from movement without a robot, evaluated on held-out data.

Pointing under instructions (`human_pointing`; every person with files): a person has one weight, fitted on instructions
1, 3 and 5, with traits that are the same under all, and priors from the others (`pellucid_lab.pointing.instructed`);
then instructions 2 and 4 are simulated with weights in between, by movements of the core's model of a person, cut as
the people's are. The reference method takes geometric means of the person's own times and spreads under the
neighbouring instructions.

Reaching in a robot (`hug_mp`, knee to mouth, elbow) is only a test set, because these people wear a robot: the median
person of the lab's population over the person's own amplitude, against the range of 80 % of the person's repetitions.
The reference method is the minimum jerk with the person's own duration.
"""

import os
import re
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import chain
from pathlib import Path

import numpy as np

from pellucid.files.readers import read_columns
from pellucid.people.movements import MovementRule, Stretch, kinematics, movements
from pellucid.study.datasets.motions import motions_of
from pellucid.study.results import ResultRow
from pellucid_lab.pointing.conditions import identify_cards, published_conditions
from pellucid_lab.pointing.instructed import WIDE_PRIOR, Population, estimate_people
from pellucid_lab.pointing.line_pointing import measure_movements
from pellucid_lab.pointing.one_way_movements import OneWay, one_way_movements
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_participants, elbow_people
from pellucid_lab.pointing.session import CONTROL_CONDITION, simulate_session, true_motion
from research.benchmarks._size import sized
from research.benchmarks.people import COMMON_EXPONENTS, study_seconds

from ._able_predicted import able_rows

SEED = 20261123
SET_BY, TRIED = (1, 3, 5), {2: (1, 3), 4: (3, 5)}
"""Instructions that set a person, and those that try one, each with its neighbours."""
JUDGED = {"time": 0, "spread": 1}
"""Of `MEASURED`."""
COUNT = sized(256, smallest=16)
ROUNDS = sized(2, smallest=1)
"""Number of simulation rounds of a person under an instruction, in the fit and in the prediction."""
LAB_PEOPLE = sized(24, smallest=2)
"""Number of simulated people whose medians are compared with those of real ones."""

EYES = MovementRule(lowpass=10.0, order=2)
"""How movements in the robot are cut: from the first to the last sample above 5 % of the peak speed."""


def data() -> Path:
    """The folder of public recordings."""
    return Path(os.environ.get("PELLUCID_DATA", Path(__file__).parents[3] / "shared" / "data"))


def rows() -> Iterator[ResultRow]:
    """Every figure."""
    yield from pointing_rows(data() / "human_pointing")
    yield from worn_rows(data() / "hug_mp")
    yield study_over_frozen()
    yield from able_rows()


def _row(name: str, value: float, unit: str, note: str, split: str = "heldout") -> ResultRow:
    return ResultRow(f"people.{name}", float(value), unit, "evidence", split, None, note)


# Pointing under instructions


def blocks(folder: Path) -> dict[str, dict[int, list[list[OneWay]]]]:
    """Movements of every block, by person and instruction."""
    found: dict[str, dict[int, list[list[OneWay]]]] = {}
    for path in sorted(folder.glob("P*_*.csv")):
        named = re.match(r"(P\d+)_(\d)", path.name)
        if named is None:
            continue
        columns = read_columns(path)
        made = one_way_movements(columns.column(0, "time"), 1e-3 * columns.column(2, "place"))
        found.setdefault(named[1], {}).setdefault(int(named[2]), []).append(made)
    return found


Seen = Mapping[str, Mapping[int, tuple[np.ndarray, int]]]


def seen(people: Mapping[str, Mapping[int, list[list[OneWay]]]]) -> dict[str, dict[int, tuple[np.ndarray, int]]]:
    """What is measured of everybody under each instruction, where there are three movements or more."""
    whole = {name: {k: list(chain(*parts)) for k, parts in told.items()} for name, told in people.items()}
    return {
        name: {k: (measure_movements(m), len(m)) for k, m in told.items() if len(m) >= 3}
        for name, told in whole.items()
    }


def errors(told: Seen) -> tuple[np.ndarray, np.ndarray]:
    """Return logarithms of predicted over measured time and spread, by the model and by the reference method.

    Each has shape (n, 3): one row for each instruction (first column) of a person.
    """
    population = Population.from_rig(elbow_people())
    own = {name: {k: v for k, v in each.items() if k in SET_BY} for name, each in told.items()}
    model, rival = [], []
    for name, one in estimate_people(population, own, SET_BY, WIDE_PRIOR, rounds=ROUNDS).items():
        for instruction, neighbours in TRIED.items():
            if instruction not in told[name]:
                continue
            truth = np.log(told[name][instruction][0][list(JUDGED.values())])
            told_by = population.simulate_measures(one.weight(instruction), one.traits, count=COUNT, seed=SEED)
            model.append((instruction, *(told_by[list(JUDGED.values())] - truth)))
            if all(k in told[name] for k in neighbours):
                ends = [np.log(told[name][k][0][list(JUDGED.values())]) for k in neighbours]
                rival.append((instruction, *(np.mean(ends, axis=0) - truth)))
    return np.array(model), np.array(rival)


def pointing_rows(folder: Path) -> Iterator[ResultRow]:
    """Median absolute errors of time and spread: of both instructions together, of each, and of the reference
    method.
    """
    people = blocks(folder)
    model, rival = errors(seen(people))
    scatter = from_block_to_block(people)
    for name, column in (("time", 1), ("spread", 2)):
        for who, made in (("", model), (".rival", rival)):
            for which in ("", *(f".{k}" for k in TRIED)):
                part = made[made[:, 0] == int(which[1:])] if which else made
                size = np.abs(part[:, column])
                low, high = _bootstrap(size)
                words = f"instruction {which[1:]}" if which else "instructions 2 and 4"
                of = "geometric means of the person's own" if who else "one weight in between"
                note = f"{words}, {len(size)} cases, {of}; 90 % by bootstrap {low:.3f} to {high:.3f}"
                yield _row(f"pointing.{name}_error{who}{which}", np.median(size), "1", note)
            each = [float(np.median(np.abs(made[made[:, 0] == k, column]))) for k in TRIED]
            yield _row(f"pointing.{name}_error{who}.worse", max(each), "1", "of the two instructions by themselves")
            yield _row(f"pointing.{name}_bias{who}", np.median(made[:, column]), "1", "median of logarithms, signed")
        note = "median absolute deviation of a block's logarithm from the person's others under the same instruction"
        yield _row(f"pointing.{name}_scatter", scatter[column - 1], "1", note)


def _bootstrap(size: np.ndarray) -> tuple[float, float]:
    rng = np.random.default_rng(SEED)
    medians = np.median(rng.choice(size, (2000, len(size))), axis=1)
    return tuple(np.quantile(medians, (0.05, 0.95)))


def from_block_to_block(people: Mapping[str, Mapping[int, list[list[OneWay]]]]) -> np.ndarray:
    """Return the variation of time and spread between blocks of the same person and tested instruction, shape (2,).

    It is the median absolute difference of logarithms between one block and the others together.
    """
    found = []
    for told in people.values():
        for instruction in TRIED:
            parts = [part for part in told.get(instruction, []) if len(part) >= 3]
            for i, part in enumerate(parts):
                rest = list(chain(*parts[:i], *parts[i + 1 :]))
                if rest:
                    found.append(np.log(measure_movements(part)[:2]) - np.log(measure_movements(rest)[:2]))
    return np.median(np.abs(found), axis=0)


# Reaching in a robot


KNEE_TO_MOUTH = (5, 1)
"""Task and motion within it."""
QUANTITIES = ("duration", "peak_velocity_over_amplitude", "time_to_peak")


def worn(path: Path) -> np.ndarray:
    """Amplitude [rad], duration [s], peak velocity over amplitude [1/s] and relative time to peak of each repetition of
    the elbow's way from knee to mouth, shape (n, 4)."""
    made = []
    for one in motions_of("hug_mp", path, ("elbow_flexion",)):
        if (one.task, one.number) == KNEE_TO_MOUTH:
            made += _cut(np.arange(len(one.angles)) / one.rate, one.angles[:, 0])
    return np.array(made)


def _cut(time: np.ndarray, angle: np.ndarray) -> list[tuple[float, float, float, float]]:
    """The movement of a record, as `worn` has it."""
    motion = kinematics(time, angle, EYES)
    found, _ = movements(motion, [Stretch(time[0], time[-1] + 1e-9)], EYES)
    return [(m.travel, m.duration, m.peak_velocity / m.travel, m.peak_time) for m in found]


@cache
def population_medians(amplitude: float) -> np.ndarray:
    """The lab's people, without a robot, over an amplitude [rad]: medians of `QUANTITIES`, shape (3,)."""
    rig = elbow_people()
    made = []
    people = draw_people(rig, np.random.default_rng(SEED), count=LAB_PEOPLE)
    for person, rng in zip(people, np.random.default_rng(SEED).spawn(len(people)), strict=True):
        session = simulate_session(rig, person, CONTROL_CONDITION, None, rng, np.full(8, amplitude))
        motion, stretches = true_motion(session, EYES)
        for one in movements(motion, stretches, EYES)[0]:
            if one.direction > 0:
                made.append((one.duration, one.peak_velocity / one.travel, one.peak_time))
    return np.median(made, axis=0)


def minimum_jerk(duration: float) -> np.ndarray:
    """`QUANTITIES` of the minimum jerk whose speed is above 5 % of its peak for as long [s]."""
    time = np.linspace(-1.0, 2.0, 3001)
    s = np.clip(time, 0.0, 1.0)
    ((_, lasts, peak, when),) = _cut(time, s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
    return np.array([duration, peak * lasts / duration, when])


def worn_rows(folder: Path) -> Iterator[ResultRow]:
    """How many people's own range of 80 % holds the prediction."""
    held, rival, notes = [], [], {q: [] for q in QUANTITIES}
    for path in sorted(folder.glob("S*_trajs.mat")):
        made = worn(path)
        low, high = np.quantile(made[:, 1:], (0.1, 0.9), axis=0)
        told = population_medians(float(np.median(made[:, 0])))
        other = minimum_jerk(float(np.median(made[:, 1])))
        held.append((told >= low) & (told <= high))
        rival.append((other >= low) & (other <= high))
        for i, q in enumerate(QUANTITIES):
            notes[q].append(f"{path.name[:3]} {told[i]:.2f} in {low[i]:.2f} to {high[i]:.2f}")
    held, rival = np.array(held), np.array(rival)
    note = f"share of {held.size}: {len(held)} people, {len(QUANTITIES)} quantities; given the amplitude only"
    yield _row("hug_mp.within", held.mean(), "1", note)
    yield _row("hug_mp.within.minimum_jerk", rival.mean(), "1", "the same with the person's own median duration given")
    for i, q in enumerate(QUANTITIES):
        yield _row(f"hug_mp.within.{q}", held[:, i].sum(), "1", f"of {len(held)}: " + ", ".join(notes[q]))
        yield _row(f"hug_mp.within.{q}.minimum_jerk", rival[:, i].sum(), "1", f"of {len(held)}")


# What they cost


def study_over_frozen() -> ResultRow:
    """Processor time of the published study's 2,400 movements over that of the earlier people, in one run by turns."""
    rigs = elbow_people(), elbow_participants()
    taken = study_seconds(rigs, published_conditions(identify_cards(rigs[0].robot), COMMON_EXPONENTS))
    new, old = taken.sum(axis=1)
    note = f"{new:.1f} s over {old:.1f} s; free arms alone {taken[0, 0] / taken[1, 0]:.2f}"
    return _row("study_over_frozen", new / old, "1", note, "simulated")
