"""The command `live`: run the session that study.toml describes, with its pages, and evaluate it at the end.

A new study whose recordings a session will make: its study.toml, from a template.
"""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from ..._atomic import write_text_atomically
from ..._errors import StudyError
from ..._given import require_empty_folder
from ..._plugins import load_plugins
from ...files.readers._apart import start_reading_process
from ...study.instruments_table import RUN_FOLDER, SessionTable
from ...study.pages.page import PAGE_FILE
from ...study.procedures.procedure import Progress, quiet
from ...study.procedures.registry import asked, open_study
from ...study.study import STUDY_FILE, Study
from .live_session import LiveSession
from .page_server import PageServer
from .recorded_trial import RECORDINGS_FOLDER, recorded_names
from .trial_plan import PlannedTrial, plan_trials

if TYPE_CHECKING:
    from ..engine import LiveEngine

COMMAND_LIMIT_S = 3600.0
"""Longest time that one command may take at the end of a session [s]."""

FAREWELL_S = 60.0
"""Once a session is finished its pages are served until they are closed, and no longer than this [s]."""

VIRTUAL_DEVICE_PREFIX = "virtual-"
"""Names of devices without hardware begin with this."""


@dataclass(frozen=True)
class SessionResult:
    """What a session left behind.

    Attributes
    ----------
    participant : str
    done, planned : int
        Numbers of trials in study.toml and in the plan.
    report : Path or None
        The report's page; None where none could be written.
    notes : tuple of str
        What the commands at the end said.
    """

    participant: str
    done: int
    planned: int
    report: Path | None
    notes: tuple[str, ...]


def live(
    folder: str | os.PathLike,
    *,
    participant: str | None = None,
    port: int = 0,
    unattended: bool = False,
    open_pages: bool = False,
    on_ready: Callable[[PageServer], None] | None = None,
    engine: Callable[[Study, Sequence[PlannedTrial]], LiveEngine] | None = None,
    show_evaluation: Callable[[], AbstractContextManager[Progress]] | None = None,
) -> SessionResult:
    """Run a participant's session, evaluate it, and end.

    Parameters
    ----------
    folder : path-like
        Folder of a study with a table ``[session]``.
    participant : str, optional
        The participant; by default the first one of ``[participants]`` with trials left to record.
    port : int
        Port of the pages on this computer; 0 takes a free one.
    unattended : bool
        Whether consent, starts and verdicts are given without a person, which only virtual devices allow.
    open_pages : bool
        Whether the operator's page is opened in a browser.
    on_ready : callable, optional
        Called with the server once pages can be opened.
    engine : callable, optional
        Makes the engine of a study and its plan, instead of the device that study.toml names.
    show_evaluation : callable, optional
        Returns a context whose function receives the progress of the commands at the end.

    Returns
    -------
    SessionResult

    Raises
    ------
    StudyError
        If the study has no session, the participant is unknown, or everything is done.
    PellucidError
        If the device is unknown or does not start.
    """
    study = open_study(folder)
    table = _session_of(study)
    if unattended and not table.device.startswith(VIRTUAL_DEVICE_PREFIX):
        raise StudyError(
            f"live: found the device {table.device}, expected a simulated one for an unattended session"
        )
    participant, plan, left = choose_participant(study, participant)
    make = start_device if engine is None else engine
    running = make(study, plan)
    try:
        with ThreadPoolExecutor(2) as executor:
            executor.submit(start_reading_process)

            def finish(study: Study) -> tuple[Path | None, list[str]]:
                with nullcontext(quiet) if show_evaluation is None else show_evaluation() as tell:
                    return evaluate(study, tell)

            session = LiveSession(
                study, running, left, participant, executor=executor, finish=finish, total=len(plan),
                unattended=unattended,
            )  # fmt: skip
            require_limits(session)
            server = PageServer(session, port)

            def opened(server: PageServer) -> None:
                if open_pages:
                    webbrowser.open(server.address("operator"))
                if on_ready is not None:
                    on_ready(server)

            asyncio.run(_serve(server, opened, 0.0 if unattended else FAREWELL_S))
            done = len(recorded_names(session.study) & {trial.name for trial in plan})
            return SessionResult(participant, done, len(plan), session.report, tuple(session.notes))
    finally:
        close = getattr(running, "close", None)
        if close is not None:
            close()


async def _serve(server: PageServer, opened: Callable[[PageServer], None], farewell: float) -> None:
    """Serve until the session is over and its pages are closed or `farewell` [s] has passed, or until Ctrl-C."""
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with suppress(NotImplementedError, RuntimeError, ValueError):
            loop.add_signal_handler(number, server.stopped.set)
    server.farewell = farewell
    await server.run(opened)


def _session_of(study: Study) -> SessionTable:
    if study.config.session is None:
        raise StudyError(
            f"{study.folder}: found no table [session] in study.toml, expected one; "
            "`pellucid init my-session --session elbow` writes an example"
        )
    return study.config.session


def choose_participant(
    study: Study, participant: str | None
) -> tuple[str, tuple[PlannedTrial, ...], tuple[PlannedTrial, ...]]:
    """Return who takes part, the whole plan, and what of it is not recorded yet."""
    table, people = _session_of(study), list(study.config.participants)
    if not people:
        raise StudyError(f"{study.folder}: found no [participants] in study.toml, expected at least one")
    done = recorded_names(study)
    for each in people if participant is None else [participant]:
        plan = plan_trials(table, people, each)
        left = tuple(trial for trial in plan if trial.name not in done)
        if left:
            return each, plan, left
    who = "every participant" if participant is None else participant
    raise StudyError(f"{study.folder}: found all trials of {who} recorded, expected some that are not")


def start_device(study: Study, plan: Sequence[PlannedTrial]) -> Any:
    """Start the engine of the device that study.toml names."""
    from ..engine import LiveEngine
    from ..recorder import seal_unfinished

    table = _session_of(study)
    devices = {plugin.name: plugin for plugin in load_plugins("pellucid.devices")}
    if table.device not in devices:
        raise StudyError(
            f'{study.folder}: [session] device: found "{table.device}", expected one of '
            f"{', '.join(devices) or 'those of an installed package; simulated devices need pellucid-lab'}"
        )
    place = list(study.config.participants).index(plan[0].participant)
    laws = tuple(dict.fromkeys(table.conditions.values()))
    setup = devices[table.device].value(conditions=laws, place=place, seed=table.seed)
    known = [condition.name for condition in setup.conditions]
    unknown = [law for law in laws if law not in known]
    if unknown:
        raise StudyError(
            f'{study.folder}: [session.conditions]: found the law "{unknown[0]}", expected one of '
            f"{', '.join(known)} of {table.device}"
        )
    setup = replace(setup, stream_names=table.streams)
    run_folder = study.folder / RUN_FOLDER / plan[0].participant
    for sentence in seal_unfinished(study.folder / RECORDINGS_FOLDER, run_folder):
        print(sentence, file=sys.stderr, flush=True)
    return LiveEngine.start(setup, run_folder)


def require_limits(session: LiveSession) -> None:
    """Refuse a device whose law may do more than ``[session.limits]`` says."""
    stated, runs = session.table.limits.effort, session.engine.status().effort_limit
    if stated is not None and runs > stated:
        raise StudyError(
            f"[session.limits] effort: found {stated:g} N*m, but the controller may command {runs:g} N*m; expected a "
            "controller with at most this effort: lower it in [rig.limits] and build the controller again"
        )


def evaluate(study: Study, tell: Progress = quiet) -> tuple[Path | None, list[str]]:
    """Run every command that the study asks for, then the report; return its page and what was refused.

    Each command is a process of its own, so that the pages go on meanwhile.
    """
    notes = []
    commands = (*dict.fromkeys(procedure.command for procedure in asked(study)), "report")
    for i, command in enumerate(commands):
        tell(f"evaluation of the session: {command}", i / len(commands))
        try:
            made = subprocess.run(
                [sys.executable, "-m", "pellucid", command, str(study.folder)],
                capture_output=True, text=True, timeout=COMMAND_LIMIT_S, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            notes.append(f"{command}: ended after {COMMAND_LIMIT_S / 60.0:.0f} minutes")
            continue
        if made.returncode:
            said = (made.stderr.strip() or made.stdout.strip()).splitlines()
            notes.append(f"{command}: {said[-1] if said else f'ended with status {made.returncode}'}")
        else:
            notes.append(f"{command}: done")
    tell("done", 1.0)
    page = study.report_dir / PAGE_FILE
    return (page if page.is_file() else None), notes


KNEE_MUSCLES = (
    "rectus_femoris", "vastus_lateralis", "vastus_medialis", "biceps_femoris", "semitendinosus",
    "gastrocnemius_medial", "gastrocnemius_lateral", "tibialis_anterior",
)  # fmt: skip

_PARTICIPANT_NAMES = [f"P{i + 1}" for i in range(6)]
_SHORT_ELBOW = {
    "participants": _PARTICIPANT_NAMES, "published": False, "pause": "5 s", "trials": 1, "repetitions": 1,
    "hold": "1 s", "amplitudes": '"12 deg", "36 deg", "60 deg"',
}  # fmt: skip
_SHORT_KNEE = {
    "participants": _PARTICIPANT_NAMES, "muscles": KNEE_MUSCLES, "pause": "3 s", "pause_every": 2, "contraction": "2 s",
    "contraction_rest": "1 s", "trials": 2, "angles": '"30 deg", "60 deg"', "hold": "2 s", "ramp": "0.5 s",
    "followed": "10 s",
}  # fmt: skip

SHIPPED_SESSIONS: Mapping[str, tuple[str, Mapping[str, Any]]] = MappingProxyType(
    {
        "elbow": ("elbow.toml.j2", _SHORT_ELBOW),
        "knee": ("knee.toml.j2", _SHORT_KNEE),
        "able-elbow": (
            "elbow.toml.j2",
            {**_SHORT_ELBOW, "published": True, "pause": "2 min", "trials": 2, "repetitions": 5, "hold": "2 s",
             "amplitudes": '"12 deg", "24 deg", "36 deg", "48 deg", "60 deg"'},
        ),
        "knee-orthosis": (
            "knee.toml.j2",
            {**_SHORT_KNEE, "pause": "1 min", "pause_every": 6, "contraction": "3 s", "contraction_rest": "3 s",
             "trials": 3, "angles": '"0 deg", "15 deg", "30 deg", "45 deg", "60 deg", "90 deg"', "hold": "5 s",
             "ramp": "2 s", "followed": "40 s"},
        ),
    }
)  # fmt: skip
"""Template and numbers of each session: a short one of each kind, and the protocol of each published study."""


def session_text(session: str, name: str) -> str:
    """Return the study.toml of a session, for a study of this name."""
    import jinja2

    if session not in SHIPPED_SESSIONS:
        raise StudyError(f"init: found the session {session!r}, expected one of {', '.join(SHIPPED_SESSIONS)}")
    template, numbers = SHIPPED_SESSIONS[session]
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(__package__, "templates"), undefined=jinja2.StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
    return environment.get_template(template).render(name=name, **numbers)


def start_session_study(folder: str | os.PathLike, session: str, name: str) -> Path:
    """Make a folder with the study.toml of a session; return its path."""
    folder, text = Path(folder), session_text(session, name)
    require_empty_folder(folder)
    return write_text_atomically(folder / STUDY_FILE, text)
