"""Controllers ranked by one rule on each task: the mean rank of the interaction torque over people in robots."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import stats

from .._errors import PellucidError
from .._given import require_folder
from .._processes import ordered_results
from ..assessment.friedman import FriedmanTest, friedman, nemenyi
from ..recordings.results import ResultRow, require_own_page, write_rows
from .elbow import elbow_pair
from .knee import knee_pair
from .strategies import RIVALS, TASKS, of_task
from .tried import Tried

COMMAND = "rank"

SWAYED = 2
"""Wearers with whom it is tried whether they sway, if there are more than these."""

LEVEL = 0.05
"""Of Nemenyi's test: whom it does not tell from the first, shares the first's place [1]."""


@dataclass(frozen=True, eq=False)
class TaskRanking:
    """The controllers of one task, from the first to the last."""

    task: str
    controllers: tuple[str, ...]  # By mean rank of the torque over pairs; ties by the median torque
    torque: np.ndarray  # (pairs, controllers) RMS [N m], in that order; infinite where nobody arrived
    ranks: np.ndarray  # (controllers,) Mean over pairs [1]
    test: FriedmanTest | None  # Whether they differ at all; None with one pair
    like_first: np.ndarray  # (controllers,) Whether Nemenyi's test does not tell it from the first; all with one pair
    tried: Mapping[str, tuple[Tried, ...]]  # By controller, pair by pair

    def over(self, rival: str) -> np.ndarray:
        """Torque of every controller over a rival's, shape (pairs, controllers) [1]."""
        return self.torque / self.torque[:, [self.controllers.index(rival)]]

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Lower end, median and upper end over pairs of what 80 % of them are within, shape (3, controllers)."""
        low, high = np.quantile(values, (0.1, 0.9), axis=0, method="inverted_cdf")
        return np.stack([low, np.median(values, axis=0), high])

    @property
    def critical(self) -> float:
        """Difference of mean ranks from which Nemenyi's test tells two controllers apart [1]."""
        pairs, k = self.torque.shape
        quantile = float(stats.studentized_range.ppf(1.0 - LEVEL, k, np.inf)) / np.sqrt(2.0)
        return quantile * float(np.sqrt(k * (k + 1) / (6.0 * pairs)))


@dataclass(frozen=True)
class Ranked:
    """What was ranked, and its page."""

    tasks: tuple[TaskRanking, ...]
    pairs: int
    seed: int
    page: Path


def rank(
    out: str | Path,
    *,
    pairs: int = 2,
    seed: int = 1,
    workers: int | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Ranked:
    """Rank every controller on the elbow and on the knee, and write the page.

    Parameters
    ----------
    out : path-like
        Folder, made if it is not there.
    pairs : int
        Of a drawn person and a drawn robot, for either joint.
    seed : int
        Of people, robots and noise, from 1.
    workers : int, optional
        Processes; as many as there are processors if left out.
    on_progress : callable, optional
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Ranked

    Raises
    ------
    PellucidError
        If there are no pairs, or the seed is below 1.

    Examples
    --------
    >>> from pellucid.ranking.rank import rank
    >>> ranked = rank("ranking", pairs=6)                                    # doctest: +SKIP
    """
    from .ranking_page import write_ranking

    if pairs < 1 or seed < 1:
        raise PellucidError(f"rank: found {pairs} pairs and seed {seed}, expected 1 or more of either")
    out = require_folder(Path(out), "a folder for the page")
    require_own_page(out, COMMAND)
    tell = on_progress or (lambda text, share: None)
    tell("identifying robots and wearers, and wearing every controller", 0.0)
    # What takes longest first; whether anybody sways takes as long as all else, and is tried where time was given.
    jobs = [(knee_pair, i, seed, i < SWAYED and pairs > SWAYED) for i in range(pairs)]
    jobs += [(elbow_pair, i, pairs, seed) for i in range(pairs)]
    found = ordered_results(
        jobs, workers, lambda done, of: tell(f"{done} of {of} pairs of a person and a robot", 0.95 * done / of)
    )
    tried = [one for made in found for one in made]
    tasks = tuple(rank_task(task, [one for one in tried if one.task == task]) for task in TASKS)
    out.mkdir(parents=True, exist_ok=True)
    write_rows(out / "results.json", COMMAND, [row for task in tasks for row in rows_of(task)])
    return Ranked(tasks, pairs, seed, write_ranking(out, tasks, pairs, seed))


def rank_task(task: str, tried: Sequence[Tried]) -> TaskRanking:
    """The controllers of a task by the stated rule. One under which nobody arrives comes last on that pair."""
    names = tuple(of_task(task))
    pairs = sorted({one.pair for one in tried})
    by = {(one.controller, one.pair): one for one in tried}
    torque = np.array([[by[name, pair].torque for name in names] for pair in pairs])
    torque = np.where(np.isnan(torque), np.inf, torque)
    ranks = stats.rankdata(torque, axis=1)
    order = np.lexsort((np.median(torque, axis=0), ranks.mean(axis=0)))
    ranks, torque = ranks[:, order], torque[:, order]
    several = len(pairs) > 1
    return TaskRanking(
        task,
        tuple(names[i] for i in order),
        torque,
        ranks.mean(axis=0),
        friedman(ranks) if several else None,
        nemenyi(ranks)[0] >= LEVEL if several else np.ones(len(names), bool),
        {name: tuple(by[name, pair] for pair in pairs) for name in names},
    )


def rows_of(ranking: TaskRanking) -> list[ResultRow]:
    """The figures of a task, as every command writes its own."""
    head, made = ranking.task.replace(" ", "_"), []
    low, middle, high = ranking.spread(ranking.torque)
    for i, name in enumerate(ranking.controllers):
        note = f"median of {len(ranking.torque)} pairs; 80 % within {low[i]:.4g} to {high[i]:.4g}"
        figures = {"torque": (middle[i], "N*m", note), "mean_rank": (ranking.ranks[i], "1", "")}
        for rival in RIVALS[ranking.task]:
            figures[f"over_{rival}"] = (np.median(ranking.over(rival)[:, i]), "1", "median of pairs")
        for quantity, unit in FIGURES.items():
            values = [v for one in ranking.tried[name] if (v := getattr(one, quantity)) is not None]
            if values and np.all(np.isfinite(values)):
                figures[quantity] = (float(OVER_PAIRS.get(quantity, np.median)(values)), unit, "")
        made += [
            ResultRow(f"ranking.{head}.{name}.{quantity}", float(value), unit, COMMAND, "simulated", note=note)
            for quantity, (value, unit, note) in figures.items()
        ]
    return made


FIGURES: Mapping[str, str] = {
    "given": "W", "taken": "W", "duration": "percent", "peak_velocity": "percent", "emg": "percent",
    "fault_energy": "J", "cost": "s", "gain": "dB", "delay": "s", "holds": "1",
}  # fmt: skip
"""What is written beside the torque, an attribute of `Tried`, with its unit."""

OVER_PAIRS: Mapping[str, Callable] = {"fault_energy": max, "gain": min, "delay": min, "holds": min}
"""What of several pairs is written, where it is the worst and no median."""
