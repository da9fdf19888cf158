"""The plan of a session: every trial of a participant in order, as values that a seed decides.

A balanced order is a Latin square of E. J. Williams [1]_: over as many participants as there are conditions (twice as
many if their number is odd), each condition stands equally often at each place, and follows each other one equally
often.

Levels of EMG while a person contracts: envelopes of raw samples as they arrive, as shares of the largest ones.

The stream of EMG of a session's engine, which may begin after the session.

.. [1] E. J. Williams, "Experimental designs balanced for the estimation of residual effects of treatments", Australian
   Journal of Scientific Research A 2, 1949.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._errors import StudyError
from ...emg.signals.emg_chain import EmgStream, emg_chain
from ...study.instruments_table import AnyTask, HoldingTask, PointingTask, SessionTable


@dataclass(frozen=True)
class PlannedTrial:
    """One trial of the plan."""

    number: int  # position in the participant's session, from 1
    participant: str
    condition: str
    law: str  # law of the condition
    task: AnyTask
    repetition: int  # repetition of the task in this condition, from 1
    period: int  # position of the condition in the participant's order, from 1
    use: str  # "fit" or "validate"
    targets: tuple[float, ...] = ()  # target angles in order [rad]; of a held angle one
    rest: float = 0.0  # rest before the trial [s]

    @property
    def name(self) -> str:
        """Name of its recording."""
        return f"{self.participant}_{self.number:02d}_{self.task.name}_{self.condition}".replace(" ", "_")


def balanced_orders(count: int) -> tuple[tuple[int, ...], ...]:
    """Return the rows of a Williams square: orders of `count` conditions, each a permutation of 0 ... count - 1.

    There are `count` rows, twice as many if `count` is odd and above 1.
    """
    if count < 1:
        raise StudyError(f"balanced order: found {count} conditions, expected one or more")
    first = [0]
    for step in range(1, count):
        first.append((step + 1) // 2 if step % 2 else count - step // 2)
    rows = [tuple((each + shift) % count for each in first) for shift in range(count)]
    if count % 2 and count > 1:
        rows += [row[::-1] for row in rows]
    return tuple(rows)


def condition_order(session: SessionTable, place: int) -> tuple[str, ...]:
    """Return the conditions of the participant at a `place` in the study, from 0, in the order of their session."""
    names = tuple(session.conditions)
    if session.order == "given":
        return names
    rng = np.random.default_rng(session.seed)
    if session.order == "balanced":
        # The seed decides which condition is which letter of the square, and in which order its rows are used.
        letters, rows = rng.permutation(len(names)), balanced_orders(len(names))
        row = rows[rng.permutation(len(rows))[place % len(rows)]]
        return tuple(names[letters[each]] for each in row)
    own = np.random.default_rng(np.random.SeedSequence(session.seed, spawn_key=(place,)))
    return tuple(names[each] for each in own.permutation(len(names)))


def plan_trials(session: SessionTable, participants: Sequence[str], participant: str) -> tuple[PlannedTrial, ...]:
    """Return every trial of a participant in order.

    Parameters
    ----------
    session : SessionTable
    participants : sequence of str
        All participants in the order of study.toml; a participant's place decides the order of their conditions.
    participant : str
        One of them.

    Raises
    ------
    StudyError
        If the participant is unknown.
    """
    if participant not in participants:
        raise StudyError(
            f'session: found the participant "{participant}", expected one of [participants]: '
            f"{', '.join(participants) or 'none'}"
        )
    place = list(participants).index(participant)
    rng = np.random.default_rng(np.random.SeedSequence(session.seed, spawn_key=(place, 1)))
    made: list[PlannedTrial] = []
    for period, condition in enumerate(condition_order(session, place), 1):
        for task in session.tasks:
            if task.conditions and condition not in task.conditions:
                continue
            for repetition, targets in _repetitions(task, rng):
                number = len(made) + 1
                rests = number > 1 and (number - 1) % session.pause_every == 0
                made.append(
                    PlannedTrial(
                        number=number, participant=participant, condition=condition,
                        law=session.conditions[condition], task=task, repetition=repetition, period=period,
                        use=_use(task, repetition), targets=targets, rest=session.pause if rests else 0.0,
                    )
                )  # fmt: skip
    return tuple(made)


def _repetitions(task: AnyTask, rng: np.random.Generator) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Yield the number of each repetition of a task in one condition, and its targets."""
    if isinstance(task, HoldingTask):
        for repetition in range(1, task.trials + 1):
            yield from ((repetition, (angle,)) for angle in task.angles)
        return
    for repetition in range(1, task.trials + 1):
        yield repetition, _pointing_targets(task, rng) if isinstance(task, PointingTask) else ()


def _pointing_targets(task: PointingTask, rng: np.random.Generator) -> tuple[float, ...]:
    """Draw the order of a trial's amplitudes; each movement is followed by the one back."""
    lifts = rng.permutation(np.repeat(np.array(task.amplitudes), task.repetitions))
    return tuple(float(angle) for lift in lifts for angle in (task.start + lift, task.start))


def _use(task: AnyTask, repetition: int) -> str:
    if task.use != "last":
        return task.use
    return "validate" if repetition == task.trials and task.trials > 1 else "fit"


ENVELOPE_CHAIN = "knee"
"""Name of the chain of filters that makes an envelope for a screen."""

SETTLING_S = 1.0
"""Time after the start in which a filter's output counts for nothing [s]."""


class EmgLevels:
    """The level of each muscle now, and the largest one so far."""

    def __init__(self, fs: float):
        self.fs = fs
        self.envelopes: dict[str, float] = {}  # [V]
        self.largest: dict[str, float] = {}  # [V]
        self.seen = 0  # samples
        self._streams: dict[str, EmgStream] = {}

    def take(self, channels: Mapping[str, np.ndarray], *, keep_largest: bool = True) -> dict[str, np.ndarray]:
        """Take the samples that came, (n,) [V] by muscle; return their envelopes, (n,) [V]."""
        made = {}
        for muscle, samples in channels.items():
            if not len(samples):
                continue
            if muscle not in self._streams:
                self._streams[muscle] = emg_chain(ENVELOPE_CHAIN).stream(self.fs)
            made[muscle] = self._streams[muscle].filter(np.nan_to_num(samples))
            self.envelopes[muscle] = float(made[muscle][-1])
        self.seen += max((len(samples) for samples in channels.values()), default=0)
        if keep_largest and self.seen > SETTLING_S * self.fs:
            for muscle, envelope in made.items():
                self.largest[muscle] = max(self.largest.get(muscle, 0.0), float(np.max(envelope)))
        return made

    @property
    def levels(self) -> dict[str, float]:
        """Envelope of each muscle as a share of its largest one; nothing until there is one."""
        return {m: self.envelopes[m] / top for m, top in self.largest.items() if top > 0.0 and m in self.envelopes}


LOOK_INTERVAL_S = 0.5
"""Time between two looks for a stream that is not there yet [s]."""


class EmgSource:
    """Reads the engine's EMG by muscle, from several cursors."""

    def __init__(self, engine: Any, clock: Callable[[], float]):
        self._engine, self._clock = engine, clock
        self._ring: Any = None
        self._looked_at = -np.inf

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]; 0 while there is no stream."""
        ring = self._find()
        return 0.0 if ring is None else float(ring.nominal_rate)

    def read_since(self, cursor: int) -> tuple[int, np.ndarray, dict[str, np.ndarray]]:
        """Return the next cursor, times, shape (n,) [s], and samples by muscle, shape (n,) each [V]."""
        ring = self._find()
        if ring is None:
            return cursor, np.empty(0), {}
        found = ring.read_since(cursor)
        names = [label.removeprefix("emg.") for label in ring.labels]
        return found.cursor, found.time, {name: found.values[:, i] for i, name in enumerate(names)}

    def _find(self) -> Any:
        # A look opens files, so that it is not taken in every step.
        now = self._clock()
        if self._ring is None and now - self._looked_at >= LOOK_INTERVAL_S:
            self._looked_at, self._ring = now, self._engine.emg
        return self._ring
