"""A session from consent to report: what comes next, who may ask for what, and what both pages are told.

The session is stepped by the server's loop and knows no socket. It never carries the law's input: it tells the engine
which law to run, which target there is, and when to record.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from .._errors import PellucidError
from ..control.supervisor_faults import NO_FAULT
from ..live.setup import SESSION_TIMEOUT_S
from ..procedures.assessment.assessment_table import AssessmentTable
from ..studies.study import STUDY_FILE, Study
from .emg_levels import EmgLevels
from .emg_source import EmgSource
from .recorded_trial import Judged, add_to_study, judge_trial, next_attempt, recorded_names, trial_file
from .running_indices import RunningIndices, RunningVerdict
from .running_task import Ask, RunningHolding, RunningTask, Sensed, first_angle, running_task
from .session_engine import EngineSamples, SessionEngine
from .torque_estimate import RATE_HZ, TorqueEstimate, TorqueEstimator
from .trial_plan import PlannedTrial


class Phase(StrEnum):
    """What a session does now."""

    consent = "consent"
    instructions = "instructions"
    waiting = "waiting"
    preparing = "preparing"
    running = "running"
    saving = "saving"
    judging = "judging"
    judged = "judged"
    rest = "rest"
    finishing = "finishing"
    finished = "finished"


PREPARATION_LIMIT_S = 20.0
"""Longest time for the law to change and the person to come to the first angle [s]."""

SETTLED_S = 0.3
"""Time for which the person must have been at the first angle before a recording begins [s]."""

OPERATOR_AWAY_S = 2.0
"""A running trial ends, and the law with it, after this time without an operator's page [s]."""

MAX_STREAM_SILENCE_S = 2.0
"""A stream of ``[session]`` that was not heard for longer is missing [s]."""

STREAM_LOOK_INTERVAL_S = 0.5
"""Time between two looks at the streams [s]: a look opens their files."""

MIN_TOLD_GAP_S = 0.004
"""A gap between two cycles of at least this length is named beside a fault of old samples [s]."""

STALE_FAULT = "stale"
"""The supervisor's name for samples that are too old, or come after a gap."""

STOPPED_FAULT = "stopped"
"""The supervisor's name for a stop from outside: by hand, or after the session's silence."""

RESET_INTERVAL_S = 0.2
"""Time between two answers to the supervisor's challenge [s]."""

MAX_MARKED_CHARACTERS = 500
"""A reason is recorded to at most this many characters: an event has a limited size."""

SHOWN_FAULTS = 12
"""The operator's page lists at most this many faults."""

OPERATOR_ACTIONS = (
    "start", "accept", "repeat", "skip_rest", "stop", "reset", "end_trial", "torque", "finish", "consent", "ready",
)  # fmt: skip
PARTICIPANT_ACTIONS = ("consent", "ready", "stop")


@dataclass
class Fault:
    """One fault of the session, as the operator's page lists it."""

    time: float  # since the session began [s]
    text: str


@dataclass
class Attempt:
    """The trial that is prepared, runs, or has just been judged."""

    trial: PlannedTrial
    number: int
    file: Path
    task: RunningTask
    begun: float
    interrupted: str = ""  # why it ended early
    judged: Judged | None = None
    features: list[np.ndarray] = field(default_factory=list)  # features of the torque estimate
    torques: list[np.ndarray] = field(default_factory=list)
    kept_at: float = -math.inf  # time of the last sample that was kept for it [s]


class LiveSession:
    """One participant's session.

    Parameters
    ----------
    study : Study
        With a table ``[session]``.
    engine : SessionEngine
    plan : sequence of PlannedTrial
        Trials that are still to be done.
    total : int
        Number of trials of the whole plan.
    unattended : bool
        Whether consent, readiness, starts and verdicts are given without a person: for virtual devices alone.
    executor : Executor
        Runs checks beside the loop.
    finish : callable
        Called with the study at the end, in the executor; returns the report's path and lines for the operator.
    clock : callable
        Host's monotonic clock [s].
    """

    def __init__(
        self,
        study: Study,
        engine: SessionEngine,
        plan: Sequence[PlannedTrial],
        participant: str,
        *,
        executor: Executor,
        finish: Callable[[Study], tuple[Path | None, list[str]]],
        total: int | None = None,
        unattended: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ):
        assert study.config.session is not None
        self.study, self.engine, self.table = study, engine, study.config.session
        self.plan, self.participant = list(plan), participant
        self.total = len(self.plan) if total is None else total
        self.executor, self.finish, self.unattended, self.clock = executor, finish, unattended, clock
        self.begun = clock()
        self.phase = Phase.consent if self.table.consent else Phase.instructions
        self.index = 0  # place of the trial in `plan`
        self.attempt: Attempt | None = None
        self.rest_until = 0.0
        self.faults: list[Fault] = []
        self.notes: list[str] = []
        self.report: Path | None = None
        self.verdicts: list[RunningVerdict] = []
        self.indices: list[dict[str, Any]] = []
        self.slider = 0.0
        self.estimator = TorqueEstimator()
        self.emg = EmgSource(engine, clock)
        self.levels: EmgLevels | None = None
        self.pages = {"operator": 0, "participant": 0}
        self.cue = 0  # number of cues so far; its parity is the patch on the participant's page
        self.shown_instructions: set[str] = set()
        self._spec = study.find_table(AssessmentTable)
        self._running = None if self._spec is None else RunningIndices(self._spec)
        self._cursor = self._emg_cursor = 0
        self._last: dict[str, float] = {}
        self._last_time = math.nan
        self._resetting = False
        self._reset_at = 0.0
        self._stopped_at = -math.inf
        self._operator_left: float | None = None
        self._at_angle_since: float | None = None
        self._job: Future | None = None
        self._status: Any = None
        self._told_fault = NO_FAULT
        self._alive: dict[str, bool] = {}
        self._estimate: TorqueEstimate | None = None
        self._estimated_at = self._streams_seen_at = -math.inf
        self.missing_streams: tuple[str, ...] = self.table.streams
        self._stream_counts: dict[str, tuple[int, int, int]] = {}  # jumps, batches and lost samples by stream
        self._background: Future | None = None
        if self._running is not None:
            self._background = executor.submit(self._measure_earlier, self._running)

    # What the server calls.

    def step(self) -> None:
        """Go on: to be called some 60 times a second."""
        now = self.clock()
        self.engine.beat()
        self._watch_engine(now)
        self._read(now)
        self._watch_streams(now)
        {
            Phase.preparing: self._prepare, Phase.running: self._run, Phase.saving: self._save,
            Phase.judging: self._judge, Phase.rest: self._rest, Phase.finishing: self._end,
        }.get(self.phase, lambda now: None)(now)  # fmt: skip
        if self.unattended:
            self._act_unattended()
        if self._background is not None and self._background.done():
            self._take_indices(self._background)
            self._background = None

    def act(self, role: str, action: str, value: float | None = None) -> str:
        """Do what a page asks for; return why not, or an empty text."""
        allowed = OPERATOR_ACTIONS if role == "operator" else PARTICIPANT_ACTIONS
        if action not in allowed:
            return f"found the action {action!r} from the {role}'s page, expected one of {', '.join(allowed)}"
        self.engine.mark("action", {"role": role, "action": action, "value": value})
        return getattr(self, f"_{action}")(value) or ""

    def page_opened(self, role: str) -> None:
        """Count a page that connected."""
        self.pages[role] += 1
        self._operator_left = None if role == "operator" else self._operator_left

    def page_closed(self, role: str) -> None:
        """Count a page that is gone."""
        self.pages[role] -= 1
        if self.pages[role] > 0:
            return
        self.engine.mark("page closed", {"role": role})
        if role == "operator":
            self._operator_left = self.clock()
        if self.phase in (Phase.preparing, Phase.running) and self.attempt is not None:
            self._tell(f"the {role}'s page was closed during a trial")
            if role == "participant":
                self._interrupt("the participant's page was closed during the trial")

    @property
    def trial(self) -> PlannedTrial | None:
        """The trial that is next, or runs."""
        return self.plan[self.index] if self.index < len(self.plan) else None

    # Actions of the pages.

    def _consent(self, value: float | None) -> str:
        if self.phase != Phase.consent:
            return "consent is not asked for now"
        self.engine.mark("consent", {"participant": self.participant, "text": list(self.table.consent)[:4]})
        self.phase = Phase.instructions
        return ""

    def _ready(self, value: float | None) -> str:
        if self.phase != Phase.instructions:
            return "there is nothing to be ready for now"
        trial = self.trial
        if trial is not None:
            self.shown_instructions.add(trial.task.name)
        self.phase = Phase.waiting if trial is not None else Phase.finishing
        return ""

    def _start(self, value: float | None) -> str:
        trial = self.trial
        if self.phase != Phase.waiting or trial is None:
            return f"a trial can start once it is waited for; now: {self.phase}"
        if self._state == "stopped":
            return "the robot is stopped; reset it first"
        if self.missing_streams:
            return f"the stream {self.missing_streams[0]} is not heard; [session] streams asks for it"
        if self.pages["participant"] == 0 and not self.unattended:
            return "the participant's page is not open; open it first"
        number = next_attempt(self.study.folder, trial)
        file = trial_file(self.study.folder, trial, number)
        self.attempt = Attempt(trial, number, file, running_task(trial), self.clock())
        self._at_angle_since = None
        self.engine.set_condition(trial.law)
        if self._is_powered(trial.law):
            self.engine.arm()
        angle = first_angle(trial)
        if angle is not None:
            self.engine.set_target(angle)
        self.phase = Phase.preparing
        return ""

    def _accept(self, value: float | None) -> str:
        if self.phase != Phase.judged or self.attempt is None:
            return "there is no trial to accept"
        judged = self.attempt.judged
        if judged is None or judged.recording is None:
            return "the recording cannot be read; repeat the trial"
        self.study = add_to_study(self.study, self.attempt.trial, self.attempt.file)
        for features, torque in zip(self.attempt.features, self.attempt.torques, strict=True):
            self.estimator.add_trial(features, torque)
        if self._running is not None and self._spec is not None and self.attempt.trial.task.kind == "pointing":
            running, recording = self._running, judged.recording
            self._background = self.executor.submit(self._measure_one, running, recording)
        self._next()
        return ""

    def _repeat(self, value: float | None) -> str:
        if self.phase != Phase.judged:
            return "there is no trial to repeat"
        self.attempt, self.phase = None, Phase.waiting
        return ""

    def _skip_rest(self, value: float | None) -> str:
        if self.phase != Phase.rest:
            return "there is no rest now"
        self.rest_until = self.clock()
        return ""

    def _stop(self, value: float | None) -> str:
        self.engine.stop()
        self._stopped_at = self.clock()
        self._tell("stopped by hand")
        return ""

    def _reset(self, value: float | None) -> str:
        self._resetting = True
        return ""

    def _end_trial(self, value: float | None) -> str:
        if self.phase not in (Phase.preparing, Phase.running):
            return "no trial runs"
        self._interrupt("the operator ended the trial")
        return ""

    def _torque(self, value: float | None) -> str:
        if value is None or not math.isfinite(value):
            return f"torque: found {value!r}, expected a number"
        limit = self.table.limits.slider
        torque = float(np.clip(value, -limit, limit))
        if self.phase != Phase.running or self.attempt is None or not isinstance(self.attempt.task, RunningHolding):
            return "the slider asks for a torque only while an angle is held"
        self.slider = torque
        self.attempt.task.set_by_hand(torque, self.table.limits.slider_rate)
        return ""

    def _finish(self, value: float | None) -> str:
        if self.phase not in (Phase.waiting, Phase.rest, Phase.instructions):
            return "a session can be finished between two trials"
        self._begin_finish()
        return ""

    # What happens in each phase.

    def _prepare(self, now: float) -> None:
        attempt = self.attempt
        assert attempt is not None
        trial = attempt.trial
        expected = "running" if self._is_powered(trial.law) else "idle"
        runs = self._state == expected and self._status.condition == trial.law
        angle = first_angle(trial)
        position = self._last.get(self.table.pointer, math.nan)
        there = angle is None or abs(position - angle) <= 2.0 * getattr(trial.task, "tolerance", 0.1) or (
            trial.task.kind == "holding"
        )  # fmt: skip
        if not (runs and there):
            self._at_angle_since = None
            if now - attempt.begun > PREPARATION_LIMIT_S:
                what = "the law did not start" if not runs else "the person did not come to the first angle"
                self._tell(what)
                self.phase, self.attempt = Phase.waiting, None
            return
        self._at_angle_since = now if self._at_angle_since is None else self._at_angle_since
        if now - self._at_angle_since < SETTLED_S:
            return
        about = {
            "study": (self.study.folder / STUDY_FILE).read_text(encoding="utf-8")
            if (self.study.folder / STUDY_FILE).is_file() else "",
            "participant": trial.participant, "condition": trial.condition, "protocol": trial.task.protocol,
            "trial": trial.name, "attempt": attempt.number,
        }  # fmt: skip
        attempt.file.parent.mkdir(parents=True, exist_ok=True)
        self.engine.begin_recording(attempt.file, about)
        self.phase = Phase.running

    def _run(self, now: float) -> None:
        attempt = self.attempt
        assert attempt is not None
        if self._state == "stopped":
            self._interrupt(f"the robot was stopped ({self._status.fault})")
            return
        if self._operator_left is not None and now - self._operator_left > OPERATOR_AWAY_S and not self.unattended:
            self.engine.disarm()
            self._interrupt("no operator's page was open")
            return
        attempt.task.step(self._sensed(now))
        cues, asks = attempt.task.take()
        for cue in cues:
            self.cue += 1
            self.engine.mark("cue", {**cue, "cue": self.cue})
        for ask in asks:
            self._ask(ask)
        if attempt.task.is_over(now):
            self._end_recording()

    def _ask(self, ask: Ask) -> None:
        if ask.kind == "torque":
            self.slider = ask.values[0]
        try:
            getattr(self.engine, f"set_{ask.kind}")(*ask.values)
        except PellucidError as error:
            if ask.values != (0.0,):
                self._tell(str(error))

    def _interrupt(self, why: str) -> None:
        assert self.attempt is not None
        self.attempt.interrupted = why
        self._tell(why)
        if self.phase == Phase.running:
            self._end_recording()
        else:
            self.attempt, self.phase = None, Phase.waiting

    def _end_recording(self) -> None:
        self.engine.end_recording(wait=False)
        self.slider = 0.0
        self.phase = Phase.saving

    def _save(self, now: float) -> None:
        assert self.attempt is not None
        if self.engine.recorded(self.attempt.file):
            self._job = self.executor.submit(judge_trial, self.study, self.attempt.trial, self.attempt.file)
            self.phase = Phase.judging

    def _judge(self, now: float) -> None:
        assert self.attempt is not None
        assert self._job is not None
        if not self._job.done():
            return
        self.attempt.judged = self._job.result()
        self._gather_for_estimate(self.attempt)
        reason = self.reason[:MAX_MARKED_CHARACTERS]
        told = {"trial": self.attempt.trial.name, "seconds": self.attempt.judged.seconds, "reason": reason}
        self.engine.mark("judged", told)
        self._job, self.phase = None, Phase.judged

    def _rest(self, now: float) -> None:
        if now >= self.rest_until:
            self._show_instructions_or_wait()

    def _next(self) -> None:
        self.attempt = None
        self.index += 1
        trial = self.trial
        if trial is None:
            self._begin_finish()
        elif trial.rest > 0.0:
            self.engine.disarm()
            self.rest_until, self.phase = self.clock() + trial.rest, Phase.rest
        else:
            self._show_instructions_or_wait()

    def _show_instructions_or_wait(self) -> None:
        trial = self.trial
        new = trial is not None and trial.task.instructions and trial.task.name not in self.shown_instructions
        self.phase = Phase.instructions if new else Phase.waiting

    def _begin_finish(self) -> None:
        self.engine.disarm()
        self._job = self.executor.submit(self.finish, self.study)
        self.phase = Phase.finishing

    def _end(self, now: float) -> None:
        if self._job is None:
            self._begin_finish()
        assert self._job is not None
        if self._job.done():
            try:
                self.report, self.notes = self._job.result()
            except PellucidError as error:
                self.notes = [str(error)]
            self._job, self.phase = None, Phase.finished

    def _act_unattended(self) -> None:
        if self.phase == Phase.consent:
            self.act("participant", "consent")
        elif self.phase == Phase.instructions:
            self.act("participant", "ready")
        elif self.phase == Phase.waiting and self._state == "stopped":
            self._resetting = True
        elif self.phase == Phase.waiting and not self.missing_streams:
            self.act("operator", "start")
        elif self.phase == Phase.judged and self.attempt is not None and self.attempt.judged is not None:
            self.act("operator", "repeat" if self.reason and self.attempt.number < 3 else "accept")

    @property
    def reason(self) -> str:
        """Why the last trial should be repeated; empty if it need not."""
        attempt = self.attempt
        if attempt is None or attempt.judged is None:
            return ""
        return attempt.interrupted or attempt.judged.reason

    # The engine and its samples.

    @property
    def _state(self) -> str:
        return "idle" if self._status is None else self._status.state

    def _is_powered(self, law: str) -> bool:
        """Return whether the robot has power in a condition; one that is not worn has none."""
        setup = getattr(self.engine, "setup", None)
        return setup is None or any(each.name == law and each.law is not None for each in setup.conditions)

    def _watch_engine(self, now: float) -> None:
        self._status = self.engine.status()
        fault = self._status.fault
        if fault != self._told_fault and fault not in (NO_FAULT, ""):
            self._tell(f"supervisor: {fault}{self._why_stopped(fault, now)}")
        self._told_fault = fault
        alive = dict(self.engine.alive)
        for name, lives in alive.items():
            if not lives and self._alive.get(name, True):
                self._tell(f"the process {name} has ended")
        self._alive = alive
        if self._resetting and now - self._reset_at >= RESET_INTERVAL_S:
            self._reset_at = now
            if self._state == "stopped":
                self.engine.reset()
            else:
                self._resetting = False
                self._tell("the stop was reset")

    def _why_stopped(self, fault: str, now: float) -> str:
        """Return what this computer did where it, and not robot or person, made the supervisor stop."""
        times = self.engine.read_since(self._cursor).time
        gap = float(np.max(np.diff(times, prepend=self._last_time))) if len(times) else 0.0
        if fault == STALE_FAULT and gap > MIN_TOLD_GAP_S:
            return f" (the engine did not run for {1e3 * gap:.0f} ms: this computer is too busy)"
        if fault == STOPPED_FAULT and now - self._stopped_at > SESSION_TIMEOUT_S:
            return f" (this program gave no sign of life for {SESSION_TIMEOUT_S:g} s: this computer is too busy)"
        return ""

    def _read(self, now: float) -> None:
        samples = self.engine.read_since(self._cursor)
        self._cursor = samples.cursor
        if len(samples.time):
            self._last = {name: float(values[-1]) for name, values in samples.channels.items()}
            self._last_time = float(samples.time[-1])
        self._emg_cursor, _, emg = self.emg.read_since(self._emg_cursor)
        if self.levels is None and self.emg.rate > 0.0:
            self.levels = EmgLevels(self.emg.rate)
        emg_levels: dict[str, np.ndarray] = {}
        if self.levels is not None:
            self.levels.take(emg)
            emg_levels = {m: np.array([level]) for m, level in self.levels.levels.items()}
        if self.phase == Phase.running and self.attempt is not None and len(samples.time) and emg_levels:
            self._keep_for_estimate(self.attempt, samples, emg_levels)
        if now - self._estimated_at >= 1.0 / RATE_HZ and self.levels is not None:
            self._estimated_at = now
            self._tell_estimate(self.levels.levels)

    def _keep_for_estimate(self, attempt: Attempt, samples: EngineSamples, levels: Mapping[str, np.ndarray]) -> None:
        """Keep the last sample for the torque estimate, some `RATE_HZ` times a second."""
        now, interaction = self._last_time, self._last.get("interaction", math.nan)
        if now - attempt.kept_at < 1.0 / RATE_HZ:
            return
        attempt.kept_at = now
        position, velocity = (np.array([self._last.get(n, math.nan)]) for n in (self.table.pointer, "velocity"))
        attempt.features.append(self.estimator.features(levels, position, velocity))
        attempt.torques.append(np.array([interaction]))

    @staticmethod
    def _gather_for_estimate(attempt: Attempt) -> None:
        """Make one trial of the samples that were kept."""
        if attempt.features and len({each.shape[1] for each in attempt.features}) == 1:
            attempt.features, attempt.torques = [np.concatenate(attempt.features)], [np.concatenate(attempt.torques)]
        else:
            attempt.features, attempt.torques = [], []

    def _tell_estimate(self, levels: Mapping[str, float]) -> None:
        """Estimate the torque on the person now, and let the engine record it."""
        position, velocity = (self._last.get(n, math.nan) for n in (self.table.pointer, "velocity"))
        before, self._estimate = self._estimate, self.estimator.estimate(levels, position, velocity)
        if self._estimate is not None:
            self.engine.set_estimate(self._estimate.torque, self._estimate.half_width)
        elif before is not None:
            self.engine.set_estimate(math.nan, math.nan)

    def _watch_streams(self, now: float) -> None:
        """Tell which streams of ``[session]`` are missing, and each jump of a clock, first batch and lost sample."""
        if now - self._streams_seen_at < STREAM_LOOK_INTERVAL_S:
            return
        self._streams_seen_at = now
        heard = self.engine.heard_streams()
        missing = tuple(n for n in self.table.streams if n not in heard or heard[n].silent_s > MAX_STREAM_SILENCE_S)
        for name in [each for each in missing if each not in self.missing_streams]:
            self._tell(f"the stream {name} fell silent")
            if self.phase == Phase.running and self.attempt is not None and not self.attempt.interrupted:
                self.attempt.interrupted = f"the stream {name} fell silent during the trial"
        self.missing_streams = missing
        for name, stream in heard.items():
            counts = (stream.clock.jumps, stream.clock.batches, stream.clock.lost)
            jumps, batches, lost = self._stream_counts.get(name, (0, 0, 0))
            self._stream_counts[name] = counts
            if counts[0] > jumps:
                self._tell(f"the clock of the stream {name} jumped, {counts[0]} times so far")
            if counts[1] > 0 and batches == 0:
                self._tell(f"the stream {name} sends batches of samples with one time")
            if counts[2] > lost:
                self._tell(f"the stream {name} lost {counts[2] - lost} samples")

    def _sensed(self, now: float) -> Sensed:
        levels = {} if self.levels is None else self.levels.levels
        return Sensed(now, self._last.get(self.table.pointer, math.nan), levels)

    def _tell(self, text: str) -> None:
        self.faults.append(Fault(self.clock() - self.begun, text))
        self.engine.mark("fault", {"text": text})

    # Indices beside the loop.

    def _measure_earlier(self, running: RunningIndices) -> tuple[list[dict[str, Any]], list[RunningVerdict]]:
        for entry in self.study.config.recordings:
            if entry.protocol == "pointing" and entry.file is not None:
                running.add(self.study.recording(entry.name))
        return self._told_indices(running)

    def _measure_one(self, running: RunningIndices, recording) -> tuple[list[dict[str, Any]], list[RunningVerdict]]:
        running.add(recording)
        return self._told_indices(running)

    def _told_indices(self, running: RunningIndices) -> tuple[list[dict[str, Any]], list[RunningVerdict]]:
        shown = [asdict(each) for each in running.shown(self.participant)]
        return shown, running.verdicts(list(self.table.conditions))

    def _take_indices(self, done: Future) -> None:
        try:
            self.indices, self.verdicts = done.result()
        except PellucidError as error:
            self._tell(f"indices: {error}")

    # What the pages are told.

    def plan_rows(self) -> list[dict[str, Any]]:
        """Return the plan as the operator's page lists it."""
        done = recorded_names(self.study)
        return [
            {"number": t.number, "task": t.task.name, "condition": t.condition, "repetition": t.repetition,
             "angle": t.targets[0] if t.task.kind == "holding" else None,
             "state": "done" if t.name in done else "now" if t is self.trial else "to come"}
            for t in self.plan
        ]  # fmt: skip

    def operator_state(self) -> dict[str, Any]:
        """Return everything that the operator's page shows, but samples."""
        now, attempt, trial, status = self.clock(), self.attempt, self.trial, self._status
        judged = None if attempt is None else attempt.judged
        estimate = self._estimate
        return {
            "type": "state",
            "time": now - self.begun,
            "phase": self.phase,
            "participant": self.participant,
            "study": self.study.name,
            "pages": self.pages,
            "device": self.table.device,
            "missing_streams": self.missing_streams,
            "done": self.total - len(self.plan) + self.index,
            "of": self.total,
            "trial": None if trial is None else {
                "name": trial.name, "task": trial.task.name, "kind": trial.task.kind, "condition": trial.condition,
            },
            "progress": 0.0 if attempt is None else attempt.task.progress,
            "holding": attempt is not None and isinstance(attempt.task, RunningHolding) and self.phase == Phase.running,
            "rest": max(self.rest_until - now, 0.0) if self.phase == Phase.rest else 0.0,
            "judged": None if judged is None else {
                "seconds": judged.seconds,
                "reason": self.reason,
                "faults": [{"severity": f.severity, "text": f.message} for f in judged.faults[:SHOWN_FAULTS]],
            },
            "engine": {
                "state": self._state, "condition": getattr(status, "condition", ""),
                "fault": getattr(status, "fault", ""), "alive": self._alive,
                "effort_limit": _finite(getattr(status, "effort_limit", math.nan)),
                "velocity_limit": _finite(getattr(status, "velocity_limit", math.nan)),
                "position_limits": [_finite(x) for x in getattr(status, "position_limits", ()) or ()],
            },
            "now": {"pointer": _finite(self._last.get(self.table.pointer, math.nan))} | {
                name: _finite(self._last.get(name, math.nan))
                for name in ("position", "velocity", "torque", "interaction", "muscle", "drive")
            },
            "slider": {"value": self.slider, "limit": self.table.limits.slider},
            "estimate": None if estimate is None else {
                "torque": estimate.torque, "half_width": estimate.half_width, "error": self.estimator.error,
                "error_of_mean": self.estimator.error_of_mean,
            },
            "levels": {} if self.levels is None else self.levels.levels,
            "faults": [asdict(fault) for fault in self.faults[-SHOWN_FAULTS:]],
            "indices": self.indices,
            "verdicts": [asdict(verdict) for verdict in self.verdicts],
            "notes": self.notes,
            "report": self.report is not None,
        }  # fmt: skip

    def participant_state(self) -> dict[str, Any]:
        """Return what the participant's page shows."""
        now, trial = self.clock(), self.trial
        made: dict[str, Any] = {"type": "screen", "phase": self.phase, "time": now, "cue": self.cue}
        if self.phase == Phase.consent:
            made["text"] = list(self.table.consent)
        elif self.phase == Phase.instructions:
            made["text"] = [*self._general_instructions(), *(() if trial is None else trial.task.instructions)]
        elif self.phase == Phase.rest:
            made["left"] = max(self.rest_until - now, 0.0)
        elif self.phase in (Phase.preparing, Phase.running) and self.attempt is not None:
            made |= self.attempt.task.screen(self._sensed(now))
        made["stopped"] = self._state == "stopped"
        made["done"], made["all"] = self.total - len(self.plan) + self.index, self.total
        return made

    def _general_instructions(self) -> tuple[str, ...]:
        return self.table.instructions if not self.shown_instructions else ()


def _finite(value: float) -> float | None:
    """Return a number as JSON has it: None for one that is not finite."""
    return float(value) if math.isfinite(value) else None
