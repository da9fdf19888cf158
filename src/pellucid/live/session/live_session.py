"""A session from consent to report: its phases, the allowed actions of each role, and the state shown on both pages.

The session is stepped by the server's loop and knows no socket. It never carries the law's input: it tells the engine
which law to run, which target there is, and when to record.
"""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._errors import PellucidError
from ...controllers.session_state import ENDED, SILENT, UNPOWERED, SessionState
from ...controllers.supervisor_faults import NO_FAULT
from ...files.recording import MAXIMAL_PROTOCOL
from ...people.study.assessment_table import AssessmentTable
from ...people.study.registered import registered_analysis
from ...study.study import STUDY_FILE, Study
from ..setup import SESSION_TIMEOUT_S
from .recorded_trial import (
    Judged,
    add_to_study,
    judge_open_trial,
    judge_trial,
    next_attempt,
    recorded_names,
    trial_file,
)
from .running_indices import RunningIndices, RunningVerdict
from .running_task import Ask, RunningHolding, RunningTask, Sensed, finite_number, first_angle, running_task
from .torque_estimate import TorqueEstimate, TorqueEstimator, TorqueSamples, fit_estimate
from .trial_plan import EmgLevels, EmgSource, PlannedTrial

if TYPE_CHECKING:
    from ..engine import LiveEngine


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

ARMED_PHASES = (Phase.preparing, Phase.running)
"""Phases in which a law may be armed; in every other one it is disarmed."""

OPERATOR_AWAY_S = 0.5
"""A law is disarmed, and its trial ends, after this time without a sign of life from an operator's page [s]."""

MIN_FREE_BYTES = 500e6
"""Room on the disk that a trial needs before it begins [B]: some eight minutes at a megabyte a second."""

MIN_FREE_BYTES_RUNNING = 100e6
"""Room on the disk below which a trial ends [B], so that its file can be sealed."""

ROOM_LOOK_INTERVAL_S = 1.0
"""Time between two looks at the disk [s]."""

SAVING_LIMIT_S = 10.0
"""Longest time for a recording to be completed [s]: a recorder that was killed begins again within some 3 s."""

RECORDER_RESTART_INTERVAL_S = 5.0
"""Time between two starts of a recorder that ended [s]: where the disk stays full, it ends again at once."""

UNATTENDED_PATIENCE_S = 30.0
"""A session without a person is finished when no trial could begin for this time [s]."""

MAX_STREAM_SILENCE_S = 2.0
"""A stream of ``[session]`` that was not heard for longer is missing [s]."""

STREAM_LOOK_INTERVAL_S = 0.5
"""Time between two looks at the streams [s]: a look opens their files."""

MIN_TOLD_GAP_S = 0.004
"""Smallest gap between two cycles that is reported with a fault of old samples [s]."""

STALE_FAULT = "stale"
"""The supervisor's name for samples that are too old, or come after a gap."""

STOPPED_FAULT = "stopped"
"""The supervisor's name for a stop from outside: by hand, or after the session's silence."""

TOLD_SILENCE_S = 0.1
"""A gap between two cycles of at least this length is a silent engine, and not a busy computer [s]."""

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
    """The trial that is prepared, is running, or has just been checked."""

    trial: PlannedTrial
    number: int
    file: Path
    task: RunningTask
    begun: float
    interrupted: str = ""  # why it ended early
    stopped: bool = False  # whether a person stopped it
    ended: float = math.inf  # time of the end of its recording [s]
    judged: Judged | None = None
    rows: list[np.ndarray] = field(default_factory=list)  # samples for the torque estimate


class LiveSession:
    """One participant's session.

    Parameters
    ----------
    study : Study
        With a table ``[session]``.
    engine : LiveEngine
    plan : sequence of PlannedTrial
        Trials that are still to be done.
    total : int
        Number of trials of the whole plan.
    unattended : bool
        Whether consent, readiness, starts and verdicts are given without a person: for virtual devices alone.
    executor : Executor
        Executor that runs checks in parallel to the loop.
    finish : callable
        Called with the study at the end, in the executor; returns the report's path and lines for the operator.
    clock : callable
        Host's monotonic clock [s].
    """

    def __init__(
        self,
        study: Study,
        engine: LiveEngine,
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
        self._torque_samples = TorqueSamples()
        self.emg = EmgSource(engine, clock)
        self.levels: EmgLevels | None = None
        self.pages = {"operator": 0, "participant": 0}
        self.cue = 0  # number of cues so far; its parity is the patch on the participant's page
        self.shown_instructions: set[str] = set()
        self._spec = study.find_table(AssessmentTable)
        self._running = None if self._spec is None else RunningIndices(self._spec, registered_analysis(study))
        self._cursor = self._emg_cursor = 0
        self._last: dict[str, float] = {}
        self._last_time = math.nan
        self._armed = False  # whether a law was armed and not disarmed since
        self._resetting = False
        self._reset_at = 0.0
        self._stop_asked = False  # whether a person has pressed Stop since the last reset
        self._silent_since: float | None = None  # since when the engine runs no cycles [s]
        self._recorder_problem = self._told_recorder = ""
        self._recorder_started_at = -math.inf
        self._blocked_since: float | None = None  # since when no trial can begin in a session without a person [s]
        self._operator_left: float | None = None
        self._free_bytes, self._room_seen_at = math.inf, -math.inf
        self._at_angle_since: float | None = None
        self._job: Future | None = None
        self._status: Any = None
        self._told_fault = NO_FAULT
        self._alive: dict[str, bool] = {}
        self._estimate: TorqueEstimate | None = None
        self._fit: Future | None = None
        self._fit_is_due = False  # whether a trial was accepted since the last fit began
        self._streams_seen_at = -math.inf
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
        self._keep_recorder(now)
        self._read(now)
        self._watch_streams(now)
        if self.phase in ARMED_PHASES and (why := self._obstacle(now)):
            self._interrupt(why)
        {
            Phase.preparing: self._prepare, Phase.running: self._run, Phase.saving: self._save,
            Phase.judging: self._judge, Phase.rest: self._rest, Phase.finishing: self._end,
        }.get(self.phase, lambda now: None)(now)  # fmt: skip
        if self.unattended:
            self._act_unattended(now)
        self._disarm_unless_allowed(now)
        if self._background is not None and self._background.done():
            self._take_indices(self._background)
            self._background = None
        self._keep_fitted()

    def act(self, role: str, action: str, value: float | None = None) -> str:
        """Do what a page asks for; return why not, or an empty text."""
        allowed = OPERATOR_ACTIONS if role == "operator" else PARTICIPANT_ACTIONS
        if action not in allowed:
            return f"found the action {action!r} from the {role}'s page, expected one of {', '.join(allowed)}"
        told = {"role": role, "action": action, "value": None if value is None else finite_number(value)}
        self.engine.mark("action", told)
        try:
            return getattr(self, f"_{action}")(value) or ""
        except (PellucidError, OSError) as error:
            return str(error)
        finally:
            self._disarm_unless_allowed(self.clock())

    def page_opened(self, role: str) -> None:
        """Count a page that connected, or answers again."""
        self.pages[role] += 1
        if role != "operator":
            return
        self._operator_left = None
        if self.pages[role] > 1:
            self._tell(f"{self.pages[role]} operator's pages are open; each of them controls the session")

    def page_closed(self, role: str, *, heard: float | None = None, is_silent: bool = False) -> None:
        """Count a page that was closed or does not respond.

        Parameters
        ----------
        role : str
        heard : float, optional
            Time of the last message, on the session's clock [s]; by default now.
        is_silent : bool
            Whether the page is open and does not answer.
        """
        self.pages[role] -= 1
        if self.pages[role] > 0:
            return
        how = "does not answer" if is_silent else "was closed"
        self.engine.mark("page closed", {"role": role, "how": how})
        if role == "operator":
            self._operator_left = self.clock() if heard is None else heard
        if self.phase in ARMED_PHASES and self.attempt is not None:
            self._tell(f"the {role}'s page {how} during a trial")
            if role == "participant":
                self._interrupt(f"the participant's page {how} during the trial")

    @property
    def trial(self) -> PlannedTrial | None:
        """The trial that is next, or runs."""
        return self.plan[self.index] if self.index < len(self.plan) else None

    # Actions of the pages.

    def _consent(self, value: float | None) -> str:
        if self.phase != Phase.consent:
            return "consent can be given only at the start of a session"
        text = [part[: MAX_MARKED_CHARACTERS // 4] for part in self.table.consent[:4]]
        self.engine.mark("consent", {"participant": self.participant, "text": text})
        self.phase = Phase.instructions
        return ""

    def _ready(self, value: float | None) -> str:
        if self.phase != Phase.instructions:
            return "readiness can be confirmed only while instructions are shown"
        trial = self.trial
        if trial is not None:
            self.shown_instructions.add(trial.task.name)
        self.phase = Phase.waiting if trial is not None else Phase.finishing
        return ""

    def _start(self, value: float | None) -> str:
        trial = self.trial
        if self.phase != Phase.waiting or trial is None:
            return f"a trial can start only in the phase waiting; the present phase is {self.phase}"
        if self._state.is_lost:
            return self._state.words
        if self.is_stopped:
            return "the robot is stopped; reset it first"
        if self.missing_streams:
            return f"the stream {self.missing_streams[0]} is not received, but [session] streams requires it"
        if self.pages["participant"] == 0 and not self.unattended:
            return "the participant's page is not open; open it first"
        if why := self._obstacle(self.clock()):
            return f"no trial can start: {why}"
        number = next_attempt(self.study.folder, trial)
        file = trial_file(self.study.folder, trial, number)
        attempt = Attempt(trial, number, file, running_task(trial), self.clock())
        self._at_angle_since = None
        self.engine.set_condition(trial.law)
        if self._is_powered(trial.law):
            self._armed = True
            self.engine.arm()
        self.attempt = attempt
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
        # In a maximal contraction the person pushes against a stop, and not against the robot.
        if self.attempt.rows and self.attempt.trial.task.protocol != MAXIMAL_PROTOCOL:
            rows = np.concatenate(self.attempt.rows)
            self._fit_is_due |= self.estimator.add_trial(self._torque_samples.muscles, rows)
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
        self._resetting = False
        self._stop_asked = True
        self._tell("stopped by hand")
        if self.phase in ARMED_PHASES and self.attempt is not None:
            self.attempt.stopped = True
        if self._state.is_lost:
            return f"{self._state.words}: it does not respond to the stop; switch off the robot's power"
        return ""

    def _reset(self, value: float | None) -> str:
        if self._state.is_lost:
            return "the engine does not respond, so that a stop cannot be reset"
        if not self.is_stopped:
            return "there is no stop to reset"
        self._resetting = True
        return ""

    def _end_trial(self, value: float | None) -> str:
        if self.phase not in ARMED_PHASES:
            return "no trial runs"
        self._interrupt("the operator ended the trial")
        return ""

    def _torque(self, value: float | None) -> str:
        if value is None or not math.isfinite(value):
            return f"torque: found {value!r}, expected a number"
        limit = self.table.limits.slider
        torque = float(np.clip(value, -limit, limit))
        if self.phase != Phase.running or self.attempt is None or not isinstance(self.attempt.task, RunningHolding):
            return "the slider commands a torque only while an angle is held"
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
        is_ready = self._state.in_force if self._is_powered(trial.law) else self._state == UNPOWERED
        runs = is_ready and self._status.condition == trial.law
        angle = first_angle(trial)
        position = self._last.get(self.table.pointer, math.nan)
        there = angle is None or abs(position - angle) <= 2.0 * getattr(trial.task, "tolerance", 0.1) or (
            trial.task.kind == "holding"
        )  # fmt: skip
        if not (runs and there):
            self._at_angle_since = None
            if now - attempt.begun > PREPARATION_LIMIT_S:
                what = "the controller did not start" if not runs else "the participant did not reach the first angle"
                self._tell(what)
                self.phase, self.attempt = Phase.waiting, None
            return
        self._at_angle_since = now if self._at_angle_since is None else self._at_angle_since
        if now - self._at_angle_since < SETTLED_S:
            return
        try:
            self._begin_recording(attempt)
        except OSError as error:
            self._interrupt(f"the recording could not begin: {error.strerror or error}")
            return
        self.phase = Phase.running

    def _begin_recording(self, attempt: Attempt) -> None:
        trial, study_file = attempt.trial, self.study.folder / STUDY_FILE
        about = {
            "study": study_file.read_text(encoding="utf-8", errors="replace") if study_file.is_file() else "",
            "participant": trial.participant, "condition": trial.condition, "protocol": trial.task.protocol,
            "trial": trial.name, "attempt": attempt.number,
        }  # fmt: skip
        attempt.file.parent.mkdir(parents=True, exist_ok=True)
        self.engine.begin_recording(attempt.file, about)

    def _run(self, now: float) -> None:
        attempt = self.attempt
        assert attempt is not None
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
        if not self.faults or self.faults[-1].text != why:
            self._tell(why)
        if self.phase == Phase.running:
            self._end_recording()
        else:
            self.attempt, self.phase = None, Phase.waiting

    def _end_recording(self) -> None:
        assert self.attempt is not None
        self.engine.end_recording(wait=False)
        self.slider = 0.0
        self.attempt.ended = self.clock()
        self.phase = Phase.saving

    def _save(self, now: float) -> None:
        attempt = self.attempt
        assert attempt is not None
        if self.engine.recorded(attempt.file):
            self._job = self.executor.submit(judge_trial, self.study, attempt.trial, attempt.file)
            self.phase = Phase.judging
        elif now - attempt.ended > SAVING_LIMIT_S:
            late = f"did not complete the file within {SAVING_LIMIT_S:g} s"
            why = f"the recording is not complete: the recorder {self._told_recorder or late}"
            self._tell(why)
            self.engine.give_up_recording(attempt.file)
            self._job = self.executor.submit(judge_open_trial, self.study, attempt.trial, attempt.file, why)
            self.phase = Phase.judging

    def _judge(self, now: float) -> None:
        assert self.attempt is not None
        assert self._job is not None
        if not self._job.done():
            return
        self.attempt.judged = self._job.result()
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
            self.rest_until, self.phase = self.clock() + trial.rest, Phase.rest
        else:
            self._show_instructions_or_wait()

    def _show_instructions_or_wait(self) -> None:
        trial = self.trial
        new = trial is not None and trial.task.instructions and trial.task.name not in self.shown_instructions
        self.phase = Phase.instructions if new else Phase.waiting

    def _begin_finish(self) -> None:
        self._job = self.executor.submit(self.finish, self.study)
        self.phase = Phase.finishing

    def _end(self, now: float) -> None:
        if self._job is None:
            self._begin_finish()
        assert self._job is not None
        if self._job.done():
            try:
                self.report, self.notes = self._job.result()
            except (PellucidError, OSError) as error:
                self.notes = [str(error)]
            self._job, self.phase = None, Phase.finished

    def _act_unattended(self, now: float) -> None:
        if self.phase == Phase.consent:
            self.act("participant", "consent")
        elif self.phase == Phase.instructions:
            self.act("participant", "ready")
        elif self.phase == Phase.waiting and self.is_stopped:
            self._resetting = True
        elif self.phase == Phase.waiting and self._obstacle(now):
            self._blocked_since = now if self._blocked_since is None else self._blocked_since
            if now - self._blocked_since > UNATTENDED_PATIENCE_S:
                self.act("operator", "finish")
        elif self.phase == Phase.waiting and not self.missing_streams:
            self._blocked_since = None
            self.act("operator", "start")
        elif self.phase == Phase.judged and self.attempt is not None and self.attempt.judged is not None:
            refused = self.act("operator", "repeat" if self.reason and self.attempt.number < 3 else "accept")
            if refused:  # a trial that cannot be kept after some attempts
                self.act("operator", "repeat")
                self.act("operator", "finish")

    @property
    def reason(self) -> str:
        """Why the last trial should be repeated; empty if it need not."""
        attempt = self.attempt
        if attempt is None or attempt.judged is None:
            return ""
        return attempt.interrupted or attempt.judged.reason

    # What stands against a law.

    def _obstacle(self, now: float) -> str:
        """Return why no trial may go on or begin now; empty if nothing stands against it."""
        if self.attempt is not None and self.attempt.stopped:
            return "the robot was stopped by hand"
        if self._state.needs_reset:
            return f"the robot was stopped ({self._status.fault})"
        if self._engine_is_lost(now):
            return self._state.words
        if self._recorder_problem:
            return f"the recorder {self._recorder_problem}"
        if why := self._lacks_room(now):
            return why
        away = self._operator_left is not None and now - self._operator_left > OPERATOR_AWAY_S
        return "no operator's page was open" if away and not self.unattended else ""

    def _lacks_room(self, now: float) -> str:
        """Return why the disk of the recordings has no room for a trial, or to go on with one; empty if it has."""
        if now - self._room_seen_at > ROOM_LOOK_INTERVAL_S:
            self._room_seen_at = now
            with suppress(OSError):  # where nobody can tell, the recorder says what is wrong
                self._free_bytes = shutil.disk_usage(self.study.folder).free
        needed = MIN_FREE_BYTES_RUNNING if self.phase in ARMED_PHASES else MIN_FREE_BYTES
        if self._free_bytes >= needed:
            return ""
        return f"the disk has {1e-6 * self._free_bytes:.0f} MB free and needs {1e-6 * needed:.0f} MB"

    def _engine_is_lost(self, now: float) -> bool:
        """Return whether the engine runs no law now; without a law a short silence is a gap of the recording."""
        patience = 0.0 if self._armed else SESSION_TIMEOUT_S
        silent = self._silent_since is not None and now - self._silent_since >= patience
        return self._state == ENDED or silent

    def _disarm_unless_allowed(self, now: float) -> None:
        """Take the law's power off unless a law may be armed now: asked after every step and action, in every phase."""
        allowed = self.phase in ARMED_PHASES and not self._obstacle(now)
        if not allowed and (self._armed or self._state.in_force):
            self.engine.disarm()
            self._armed = False

    # The engine and its samples.

    @property
    def _state(self) -> SessionState:
        return UNPOWERED if self._status is None else self._status.state

    @property
    def is_stopped(self) -> bool:
        """Whether no trial can start before a reset: supervisor or person stopped the robot, with or without a law."""
        return self._state.needs_reset or self._stop_asked

    def _is_powered(self, law: str) -> bool:
        """Return whether the robot has power in a condition; one that is not worn has none."""
        setup = getattr(self.engine, "setup", None)
        return setup is None or any(each.name == law and each.law is not None for each in setup.conditions)

    def _watch_engine(self, now: float) -> None:
        self._status = self.engine.status()
        fault = self._status.fault
        if fault != self._told_fault and fault not in (NO_FAULT, ""):
            self._tell(f"supervisor: {fault}{self._why_stopped(fault)}")
        self._told_fault = fault
        self._watch_silence(now)
        alive = dict(self.engine.alive)
        for name, lives in alive.items():
            if not lives and self._alive.get(name, True) and name != "recorder":
                self._tell(f"the process {name} has ended")
        self._alive = alive
        if self._resetting and self._state.needs_reset and now - self._reset_at >= RESET_INTERVAL_S:
            self._reset_at = now
            self.engine.reset()
        elif self._resetting and not (self._state.needs_reset or self._state.is_lost):
            self._resetting = self._stop_asked = False
            self._tell("the stop was reset")

    def _watch_silence(self, now: float) -> None:
        """Tell when the engine falls silent, and when it goes on."""
        if self._state != SILENT:
            if self._silent_since is not None:
                self._tell(f"the engine continues after {now - self._silent_since:.2f} s")
            self._silent_since = None
        elif self._silent_since is None:
            self._silent_since = now
            self._tell("the engine is silent")

    def _keep_recorder(self, now: float) -> None:
        """Tell why the recorder does not record, and start it again."""
        health = self.engine.recorder_health()
        if health.problem and health.problem != self._told_recorder and not health.is_starting:
            self._tell(f"the recorder {health.problem}")
            self._told_recorder = health.problem
        elif self._told_recorder and not health.problem:
            self._tell("the recorder records again")
            self._told_recorder = ""
        self._recorder_problem = health.problem
        due = now - self._recorder_started_at > RECORDER_RESTART_INTERVAL_S
        if health.problem and not health.is_starting and due and self.phase != Phase.finished:
            self._recorder_started_at = now
            try:
                self.engine.restart_recorder()
            except (PellucidError, OSError) as error:
                self._tell(f"the recorder could not be restarted: {error}")

    def _why_stopped(self, fault: str) -> str:
        """Return what this computer did where it, and not robot or person, made the supervisor stop."""
        times = self.engine.read_since(self._cursor).time
        gap = float(np.max(np.diff(times, prepend=self._last_time))) if len(times) else 0.0
        if fault == STALE_FAULT and gap > TOLD_SILENCE_S:
            pressed = "; Stop was pressed" if self._stop_asked else ""
            return f" (the engine was silent for {gap:.2f} s{pressed})"
        if fault == STALE_FAULT and gap > MIN_TOLD_GAP_S:
            return f" (the engine did not run for {1e3 * gap:.0f} ms: this computer is too busy)"
        if fault == STOPPED_FAULT and not self._stop_asked:
            return f" (this program did not respond for {SESSION_TIMEOUT_S:g} s: this computer is too busy)"
        return ""

    def _read(self, now: float) -> None:
        samples = self.engine.read_since(self._cursor)
        self._cursor = samples.cursor
        if len(samples.time):
            self._last = {name: float(values[-1]) for name, values in samples.channels.items()}
            self._last_time = float(samples.time[-1])
        self._emg_cursor, emg_time, emg = self.emg.read_since(self._emg_cursor)
        if self.levels is None and self.emg.rate > 0.0:
            self.levels = EmgLevels(self.emg.rate)
        envelopes = {} if self.levels is None else self.levels.take(emg)
        if self.levels is not None and not self.levels.largest:
            envelopes = {}  # the filters have not settled
        lacking = np.full(len(samples.time), math.nan)
        channels = [samples.channels.get(name, lacking) for name in (self.table.pointer, "interaction")]
        rows = self._torque_samples.take(np.column_stack([samples.time, *channels]), emg_time, envelopes)
        if len(rows):
            if self.phase == Phase.running and self.attempt is not None:
                self.attempt.rows = [r for r in self.attempt.rows if r.shape[1] == rows.shape[1]] + [rows]
            self._tell_estimate(rows)

    def _tell_estimate(self, rows: np.ndarray) -> None:
        """Estimate the torque on the person now, and let the engine record it."""
        before, self._estimate = self._estimate, self.estimator.estimate(self._torque_samples.muscles, rows)
        if self._estimate is not None:
            self.engine.set_estimate(self._estimate.torque, self._estimate.half_width)
        elif before is not None:
            self.engine.set_estimate(math.nan, math.nan)

    def _keep_fitted(self) -> None:
        """Take the estimator that was fitted, and fit it again in the executor if a trial was accepted since."""
        if self._fit is not None and self._fit.done():
            try:
                self.estimator.use(self._fit.result())
            except PellucidError as error:
                self._tell(f"torque from EMG: {error}")
            self._fit = None
        if self._fit is None and self._fit_is_due:
            self._fit_is_due = False
            self._fit = self.executor.submit(fit_estimate, *self.estimator.session_trials())

    def _watch_streams(self, now: float) -> None:
        """Tell which streams of ``[session]`` are missing, and each jump of a clock, first batch and lost sample."""
        if now - self._streams_seen_at < STREAM_LOOK_INTERVAL_S:
            return
        self._streams_seen_at = now
        heard = self.engine.heard_streams()
        missing = tuple(n for n in self.table.streams if n not in heard or heard[n].silent_s > MAX_STREAM_SILENCE_S)
        for name in [each for each in missing if each not in self.missing_streams]:
            self._tell(f"the stream {name} stopped sending")
            if self.phase == Phase.running and self.attempt is not None and not self.attempt.interrupted:
                self.attempt.interrupted = f"the stream {name} stopped sending during the trial"
        self.missing_streams = missing
        for name, stream in heard.items():
            counts = (stream.clock.jumps, stream.clock.batches, stream.clock.lost)
            jumps, batches, lost = self._stream_counts.get(name, (0, 0, 0))
            self._stream_counts[name] = counts
            if counts[0] > jumps:
                self._tell(f"the clock of the stream {name} jumped, {counts[0]} times so far")
            if counts[1] > 0 and batches == 0:
                self._tell(f"the stream {name} sends batches of samples with the same time")
            if counts[2] > lost:
                self._tell(f"the stream {name} lost {counts[2] - lost} samples")

    def _sensed(self, now: float) -> Sensed:
        levels = {} if self.levels is None else self.levels.levels
        return Sensed(now, self._last.get(self.table.pointer, math.nan), levels)

    def _tell(self, text: str) -> None:
        self.faults.append(Fault(self.clock() - self.begun, text))
        self.engine.mark("fault", {"text": text[:MAX_MARKED_CHARACTERS]})

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
                "used_by": [] if self.reason else list(judged.used_by),
                "faults": [{"severity": f.severity, "text": f.message} for f in judged.faults[:SHOWN_FAULTS]],
            },
            "recorder": self._recorder_problem,
            "stopped": self.is_stopped,
            "engine": {
                "state": asdict(self._state), "armed": self._armed, "condition": getattr(status, "condition", ""),
                "fault": getattr(status, "fault", ""), "alive": self._alive,
                "effort_limit": finite_number(getattr(status, "effort_limit", math.nan)),
                "velocity_limit": finite_number(getattr(status, "velocity_limit", math.nan)),
                "position_limits": [finite_number(x) for x in getattr(status, "position_limits", ()) or ()],
            },
            "now": {"pointer": finite_number(self._last.get(self.table.pointer, math.nan))} | {
                name: finite_number(self._last.get(name, math.nan))
                for name in ("position", "velocity", "torque", "interaction", "muscle", "drive")
            },
            "slider": {"value": self.slider, "limit": self.table.limits.slider},
            "estimate": None if estimate is None else {
                "torque": estimate.torque, "half_width": estimate.half_width, "error": self.estimator.error,
                "error_of_mean": self.estimator.error_of_mean,
            },
            "changed_channels": self.estimator.changed,
            "estimate_fault": self.estimator.fault,
            "is_estimate_useful": self.estimator.is_useful,
            "estimate_errors": [finite_number(self.estimator.error), finite_number(self.estimator.error_of_mean)],
            "levels": {} if self.levels is None else self.levels.levels,
            "faults": [asdict(fault) for fault in self.faults[-SHOWN_FAULTS:]],
            "indices": self.indices,
            "verdicts": [verdict.answer.table() for verdict in self.verdicts],
            "notes": self.notes,
            "report": self.report is not None,
        }  # fmt: skip

    @property
    def urgent(self) -> tuple[object, ...]:
        """State that is sent to the operator's page as soon as it changes."""
        engine = self._state, self._armed, self._recorder_problem, self.is_stopped
        return self.phase, *engine, len(self.faults), *self.pages.values()

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
        made["stopped"] = self.is_stopped or self._engine_is_lost(now)
        made["done"], made["all"] = self.total - len(self.plan) + self.index, self.total
        return made

    def _general_instructions(self) -> tuple[str, ...]:
        return self.table.instructions if not self.shown_instructions else ()
