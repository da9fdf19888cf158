"""Rank controllers on each task by one rule: the mean rank of the interaction torque over pairs of person and robot."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pellucid._errors import PellucidError
from pellucid._given import require_folder
from pellucid.numerics.tied_ranks import tied_ranks
from pellucid.people.comparison import friedman, nemenyi
from pellucid.study.answer import Answer
from pellucid.study.results import ResultRow, require_own_page, write_rows

from ..processes import shared_results
from .arm import arm_pair
from .board import add_to_board
from .elbow import elbow_pair
from .foreign_cost import count_instructions
from .foreign_law import ForeignLaw
from .index_section import compare_indices, index_rows
from .knee import knee_pair
from .law_certificate import CERTIFICATE_VALUES, certificate_note, certify_controller
from .strategies import CONTROLLER_FIELDS, SIMPLE_RIVALS, SWING_TASK, strategies_of_task
from .task_ranking import SIGNIFICANCE_LEVEL, TaskRanking
from .tried import ControllerTrial

COMMAND_NAME = "rank"
"""Name of the command in the rows of results.json."""

DEFAULT_PAIR_COUNT = 7
"""Number of pairs of a person and a robot, unless the caller asks for another number."""

MAX_SEALED_SEED = 10**6
"""Largest seed that is drawn for a ranking whose seed nobody knew before."""

SWAY_TESTED_COUNT = 2
"""Number of wearers with whom margins are tested in simulation, if there are more wearers than these. The test takes as
long as everything else."""

JOB_WEIGHTS: Mapping[Callable, float] = {knee_pair: 1.0, elbow_pair: 1.0, arm_pair: 1.0}
"""Expected time of a pair of each robot relative to a knee without the test for sway, for reports of progress."""

SWAY_WEIGHT = 2.0
"""Time of a knee with the test for sway over that of one without."""


@dataclass(frozen=True)
class ControllerRanking:
    """Rankings of all tasks, and their page."""

    tasks: tuple[TaskRanking, ...]
    pairs: int
    seed: int
    page: Path
    laws: tuple[ForeignLaw, ...] = ()  # foreign laws among the controllers

    @property
    def answer(self) -> Answer:
        """Return whether a controller leaves less torque than every simple reference controller, as the page shows
        it.
        """
        from .ranking_page import ranking_answer

        return ranking_answer(self.tasks, self.pairs)


def rank(
    out: str | Path,
    *,
    pairs: int = DEFAULT_PAIR_COUNT,
    seed: int | None = 1,
    laws: Sequence[str | Path] = (),
    workers: int | None = None,
    executor: Executor | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> ControllerRanking:
    """Rank every controller on the elbow, on the knee and on an arm of four joints, and write the page.

    Parameters
    ----------
    out : path-like
        Folder, which is created if it does not exist.
    pairs : int
        Number of pairs of a simulated person and robot, for each task.
    seed : int, optional
        Seed of people, robots and noise, from 1. None chooses one after the laws were read, so that no
        law can be tuned on these people; the page shows it.
    laws : sequence of path-like
        Files with laws of your own: a Python class ``Law`` with ``reset()``, with ``step(time, position, torque)`` for
        the knee orthosis, ``elbow_step`` of the same for the elbow robot and ``arm_step`` of lists for the arm of four
        joints, or with some of them; or a C file or shared library with ``law_reset``, ``law_step``, ``elbow_step`` and
        ``arm_step``. Each runs in its own process with limited time and memory, but without a sandbox: do not run code
        that you do not trust.
    workers : int, optional
        Number of processes; by default one per processor.
    executor : concurrent.futures.Executor, optional
        Replaces the processes, for instance a cluster's whose workers see the files of the laws.
    on_progress : callable, optional
        Function that is called with a text and the share done, 0 to 1.

    Returns
    -------
    ControllerRanking
        Rankings of all tasks, and the path of the page.

    Raises
    ------
    PellucidError
        If there are no pairs, the seed is below 1, or a file holds no law.

    Examples
    --------
    >>> from pellucid_lab.ranking.rank import rank
    >>> ranked = rank("ranking", pairs=6)                                    # doctest: +SKIP
    """
    from .ranking_page import write_ranking

    if pairs < 1 or (seed is not None and seed < 1):
        raise PellucidError(f"rank: found {pairs} pairs and seed {seed}, expected 1 or more of either")
    read = tuple(ForeignLaw.from_file(path) for path in laws)
    if len({law.name for law in read}) < len(read):
        raise PellucidError("rank: found laws of the same file name, expected a name of its own for each")
    seed = secrets.randbelow(MAX_SEALED_SEED) + 1 if seed is None else seed
    out = require_folder(Path(out), "a folder for the page")
    require_own_page(out, COMMAND_NAME)
    tell = on_progress or (lambda text, share: None)
    tell("identifying robots and wearers, and wearing every controller", 0.0)
    # The longest jobs come first. The test for sway takes as long as everything else, so it runs for few wearers.
    knee = tuple(strategies_of_task(SWING_TASK))
    sways = [i < SWAY_TESTED_COUNT and pairs > SWAY_TESTED_COUNT for i in range(pairs)]
    jobs: list[tuple] = [(knee_pair, i, seed, sways[i], knee, read) for i in range(pairs)]
    jobs += [(elbow_pair, i, pairs, seed, read) for i in range(pairs)]
    jobs += [(arm_pair, i, seed, None, read) for i in range(pairs)]
    found = shared_results(
        jobs,
        workers,
        lambda done, share: tell(f"{done} of {len(jobs)} pairs of a person and a robot", 0.95 * share),
        [JOB_WEIGHTS[make] * (SWAY_WEIGHT if make is knee_pair and sways[i] else 1.0) for make, i, *_ in jobs],
        executor,
    )
    tell("counting instructions, comparing indices and writing the page", 0.95)
    tried = _with_cost([one for made in found for one in made], read)
    tasks = tuple(rank_task(task, [one for one in tried if one.task == task]) for task in CONTROLLER_FIELDS)
    out.mkdir(parents=True, exist_ok=True)
    rows = [row for task in tasks for row in rows_of(task)]
    rows += [row for task in tasks if (compared := compare_indices(task)) for row in index_rows(compared, COMMAND_NAME)]
    write_rows(out / "results.json", COMMAND_NAME, rows)
    board = add_to_board(out, tasks, pairs, seed, read)
    return ControllerRanking(tasks, pairs, seed, write_ranking(out, tasks, pairs, seed, board), read)


def _with_cost(tried: Sequence[ControllerTrial], laws: Sequence[ForeignLaw]) -> list[ControllerTrial]:
    """Return the trials with the instructions of foreign laws in C on a Cortex-M4F, where they can be counted."""
    names = {law.name: law for law in laws}
    asked = dict.fromkeys((one.controller, CONTROLLER_FIELDS[one.task]) for one in tried if one.controller in names)
    counted = {(name, robot): count_instructions(names[name], robot) for name, robot in asked}
    return [replace(one, instructions=counted.get((one.controller, CONTROLLER_FIELDS[one.task]))) for one in tried]


def rank_task(task: str, tried: Sequence[ControllerTrial]) -> TaskRanking:
    """Rank the controllers of a task. A controller with which the person never arrives is the last on that pair."""
    known = strategies_of_task(task)
    names = (*known, *dict.fromkeys(one.controller for one in tried if one.controller not in known))
    pairs = sorted({one.pair for one in tried})
    by = {(one.controller, one.pair): one for one in tried}
    torque = np.array([[by[name, pair].torque for name in names] for pair in pairs])
    torque = np.where(np.isnan(torque), np.inf, torque)
    ranks = tied_ranks(torque, axis=1)
    order = np.lexsort((np.median(torque, axis=0), ranks.mean(axis=0)))
    ranks, torque = ranks[:, order], torque[:, order]
    several = len(pairs) > 1
    return TaskRanking(
        task,
        tuple(names[i] for i in order),
        torque,
        ranks.mean(axis=0),
        friedman(ranks) if several else None,
        nemenyi(ranks)[0] >= SIGNIFICANCE_LEVEL if several else np.ones(len(names), bool),
        {name: tuple(by[name, pair] for pair in pairs) for name in names},
    )


def rows_of(ranking: TaskRanking) -> list[ResultRow]:
    """Return the rows of results.json for a task."""
    head, made = ranking.task.replace(" ", "_"), []
    low, middle, high = ranking.spread(ranking.torque)
    for i, name in enumerate(ranking.controllers):
        note = f"median of {len(ranking.torque)} pairs"
        if ranking.has_interval:
            note += f"; 80 % within {low[i]:.4g} to {high[i]:.4g}"
        if not np.isfinite(middle[i]):
            continue
        figures = {"torque": (middle[i], "N*m", note), "mean_rank": (ranking.ranks[i], "1", "")}
        for rival in SIMPLE_RIVALS[ranking.task]:
            figures[f"over_{rival}"] = (np.median(ranking.over(rival)[:, i]), "1", "median of pairs")
        for quantity, unit in FIGURE_UNITS.items():
            values = [v for one in ranking.tried[name] if (v := getattr(one, quantity)) is not None]
            if values and np.all(np.isfinite(values)):
                figures[quantity] = (float(PAIR_SUMMARIES.get(quantity, np.median)(values)), unit, "")
        certified = certify_controller(ranking.tried[name])
        if certified is not None:
            told = certificate_note(certified, len(ranking.tried[name]))
            figures["certificate"] = (CERTIFICATE_VALUES[certified.verdict], "1", told)
        made += [
            ResultRow(f"ranking.{head}.{name}.{quantity}", float(value), unit, COMMAND_NAME, "simulated", note=note)
            for quantity, (value, unit, note) in figures.items()
        ]
    return made


FIGURE_UNITS: Mapping[str, str] = {
    "given": "W", "taken": "W", "duration": "percent", "peak_velocity": "percent", "deviation": "rad", "emg": "percent",
    "fault_energy": "J", "cost": "s", "instructions": "1", "gain": "dB", "delay": "s", "holds": "1",
}  # fmt: skip
"""Unit of each attribute of `ControllerTrial` that is written in addition to the torque."""

PAIR_SUMMARIES: Mapping[str, Callable] = {"fault_energy": max, "gain": min, "delay": min, "holds": min}
"""Function that summarises an attribute of `ControllerTrial` over pairs, if the worst value is written and not the
median."""
