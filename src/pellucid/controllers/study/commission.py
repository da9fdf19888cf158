"""`commission` of a study: measure on the robot what its exported supervisor is to hold drive and encoder to."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from ..._atomic import write_text_atomically
from ..._errors import PellucidError
from ..._given import read_given
from ..._plugins import load_plugins
from ...files.readers.read import read_columns
from ...files.stated_units import split_unit
from ...numerics.arguments import with_checked_arguments
from ...study.answer import Answer, AnswerNumber, Basis, Step
from ...study.study import Study
from ...units import to_si_factor
from ..commissioning import (
    DRIVE_WAVE_FACTOR,
    MAX_GAIN_ERROR,
    MIN_STARTS,
    START_COUNT,
    Answers,
    DriveCheck,
    Robot,
    StartLog,
    answers,
    drive_check,
    drive_reading,
    mean_error,
    record_starts,
    shows_empty_robot,
)
from ..control_law import LAWS
from ..export.controller_values import protect_wearer
from ..export.export import values_for
from ..instruments import COMMISSIONING_CONDITION
from ..supervised import RATE_TOLERANCE, SupervisedLaw

LOG_COLUMNS = {"time": ("s",), "position": ("rad", "m"), "effort": ("N*m", "N")}
"""Columns that a log of starts must have, and their SI units: one row for each period of the controller."""

MIN_PAUSE_PERIODS = 20
"""A gap in a log's time of this many periods, or a step back, begins another start."""

MIN_UNIT_RATIO = 100.0
"""Smallest ratio of a log's period to the controller's that another unit explains better than rows that lack [1]."""

MIN_START_ROWS = 100
"""Shortest start of a log in rows; less is none."""

MAX_STUDY_BYTES = 10_000_000
"""Largest size of a study.toml that is written to [B]."""

VIRTUAL_SOURCE = "virtual robot"
"""Source of the starts of a study's virtual robot."""

PLAUSIBLE_GAINS = (0.2, 5.0)
"""Gains of a drive, over the stated one, beyond which log and study rather differ in robot or units [1]."""

UNKNOWN_WEARER_NOTE = (
    f"whether somebody wears the robot in --worn is not identifiable: that needs {MIN_STARTS} whole waves and a known "
    "gain"
)
"""Note where the starts of a wearer do not show the wearer."""

INSTRUMENTS_HEADER = "[rig.instruments]"
"""Table of study.toml that the answers are written to."""


@dataclass(frozen=True)
class Commissioning:
    """What a commissioning measured, and what it wrote.

    Attributes
    ----------
    source : str
        Where the starts are from: ``"virtual robot"``, ``"logs"`` or ``"robot"``.
    drive : DriveCheck
        Sign, gain and delay of the drive.
    answers : Answers
        What start-up test and probe are to be held to.
    written : tuple of str
        Keys that were written into ``[rig.instruments]``; none where the drive is not right.
    folder : str
        Folder of the study.
    gain_checked : bool
        Whether the gain was checked by hand.
    options : tuple of str
        Options with which `export` writes the same controller.
    problem : str
        Why study.toml could not be written.
    files : tuple of str
        Names of the logs.
    looks_empty : bool
        Whether the starts that somebody should wear show the inertia of the empty robot.
    """

    source: str
    drive: DriveCheck
    answers: Answers
    written: tuple[str, ...]
    folder: str = ""
    gain_checked: bool = False
    options: tuple[str, ...] = ()
    problem: str = ""
    files: tuple[str, ...] = ()
    looks_empty: bool = False

    @property
    def is_undecided(self) -> bool:
        """Whether the worn starts may be of the empty robot, so that their responses are not used."""
        return self.looks_empty and self.answer.verdict == "cannot say"

    @property
    def answer(self) -> Answer:
        """Whether the drive follows its commands, and what to do next."""
        drive, reasons = self.drive, []
        if drive.sign < 0:
            reasons.append("its sign is reversed")
        elif not (drive.is_right or drive.is_open):
            reasons.append(f"its gain is {drive.gain:.3f} times the stated one{_unit_guess(drive.gain, self.files)}")
        if not drive.is_read_right:
            reasons.append(f"its measurement reads {drive.reading:.3f} times the command")
        known = np.isfinite(drive.gain)
        if drive.is_open and not (reasons or self.gain_checked):
            why = "the sign is right; the motion does not show the gain"
            advice = "Check the gain with a known weight, then commission again with --gain-checked"
            return self._open_answer(why, advice)
        if self.looks_empty and not reasons:
            why = "the logs of --worn show the inertia of the empty robot, as if nobody wears it"
            return self._open_answer(why, "Record the starts of --worn on a wearer, or leave out --worn")
        right = "sign and gain are right" if known else "the sign is right, and the gain was checked"
        said = "; ".join(reasons) or right
        numbers = (AnswerNumber("gain", drive.gain, "1"), AnswerNumber("delay", drive.delay, "s")) if known else ()
        again = Step("Correct the wiring, the sign of the effort's channel or [rig.drive], then commission again")
        return Answer(
            "Does the drive follow its commands?", "no" if reasons else "yes", said, "; ".join(reasons), (),
            numbers, Basis(drive.starts, drive.starts, "start", is_simulated=self.source == VIRTUAL_SOURCE),
            next=(again if reasons else Step("Export again", "export", self.options),),
            qualifier="" if known or reasons else "gain checked by hand",
        ).in_folder(self.folder)  # fmt: skip

    def _open_answer(self, why: str, advice: str) -> Answer:
        """Return why the starts do not answer the question, and what to do."""
        return Answer(
            "Does the drive follow its commands?", "cannot say", why, why, (), (),
            Basis(self.drive.starts, self.drive.starts, "start", is_simulated=self.source == VIRTUAL_SOURCE),
            next=(Step(advice),),
        ).in_folder(self.folder)  # fmt: skip

    def lines(self) -> tuple[str, ...]:
        """Return the lines of the printed summary."""
        drive, found = self.drive, self.answers
        gain, delay = "not identifiable: the transmission is compliant, or gain or identified inertia is wrong", ""
        if np.isfinite(drive.coarse_steps):
            gain = (
                f"not identifiable: the wave moves the joint by only {drive.coarse_steps:.0f} steps of the encoder. "
                "Start from more positions that differ, or commission with --udp, whose wave is longer"
            )
        elif np.isnan(drive.gain_spread):
            gain = f"not identifiable: fewer than {MIN_STARTS} starts have a whole wave"
        if np.isfinite(drive.gain):
            gain = f"{drive.gain:.3f} times the stated gain (standard deviation {drive.gain_spread:.3f})"
            delay = f"{1e3 * drive.delay:.1f} ms from command to effort"
        few = ""
        if drive.starts < START_COUNT:
            few = f"; {START_COUNT} are usual"
            if np.isfinite(drive.gain):
                error = 100.0 * mean_error(drive.gain_spread, drive.starts) / drive.gain
                few += f", and these suffice: mean gain within {error:.2g} %, at most {100.0 * MAX_GAIN_ERROR:.0f} %"
        made = [
            f"{self.source}: {drive.starts} starts{few}",
            f"sign: {'right' if drive.sign > 0 else 'reversed: exchange the leads, or the sign in [rig.drive]'}",
            f"gain: {gain}",
            f"delay: {delay or 'not identifiable'}",
        ]
        if np.isfinite(drive.reading):
            made.append(f"drive_answer: measured effort {drive.reading:.3f} times the command")
        if found.start_up is not None:
            made.append(f"start_up_answer: {found.start_up:.4g} J (standard deviation {found.start_up_spread:.2g} J)")
        if found.probe is not None:
            made.append(f"probe_answer: {', '.join(f'{x:.3g}' for x in found.probe)} ({found.probe_windows} windows)")
        made += [f"note: {note}" for note in found.notes]
        if self.written:
            made.append(f"study.toml: wrote {', '.join(self.written)} into {INSTRUMENTS_HEADER}")
        else:
            made.append("study.toml: nothing written")
        return tuple(made)


def _unit_guess(gain: float, files: Sequence[str] = ()) -> str:
    """Return what an impossible gain suggests, as the end of a sentence: a wrong unit, or a log of another robot."""
    tenfold = 10.0 ** round(math.log10(gain))
    guesses = {
        180.0 / math.pi: "positions were degrees instead of radians",
        math.pi / 180.0: "positions were radians instead of degrees",
        tenfold: f"the unit of effort or position were wrong by a factor of {tenfold:g}",
    }
    near = [guess for factor, guess in guesses.items() if abs(gain / factor - 1.0) <= MAX_GAIN_ERROR and factor != 1.0]
    if near:
        return f", as if {near[0]}"
    if PLAUSIBLE_GAINS[0] <= gain <= PLAUSIBLE_GAINS[1]:
        return ""
    where = f" of {', '.join(files)}" if files else ""
    return (
        ", beyond any drive: check that log and study are of one robot, and the units of the columns effort and "
        f"position{where}"
    )


def _nobody_to_ask(question: str) -> None:
    """Continue at once, because the caller of the function has prepared the robot."""


@with_checked_arguments
def commission(
    study: Study,
    *,
    logs: Sequence[Path] = (),
    worn_logs: Sequence[Path] = (),
    robot: object | None = None,
    controller: str | None = None,
    participant: str | None = None,
    slider: float | None = None,
    period: float | None = None,
    wearer: bool = True,
    gain_checked: bool = False,
    ask: Callable[[str], None] = _nobody_to_ask,
) -> Commissioning:
    """Measure sign, gain and delay of a drive, and what start-up test and probe are held to, and write that down.

    Ten starts of the robot that nobody wears tell sign, gain and delay, for its inertia is identified. Ten starts on a
    wearer at ease and twenty seconds of motion tell the answers of test and probe. They go into ``[rig.instruments]``
    of study.toml, from which `export` takes them. A drive that is not right meets no wearer, and nothing is written.

    Parameters
    ----------
    study : Study
        Identified study of one joint.
    logs : sequence of Path
        Logs of the exported controller on the robot that nobody wears: columns ``time``, ``position``, ``effort`` and
        further sensors of the law, in SI or in the unit that a name states, a row for each period; starts are apart
        by a gap in the time. None of logs and `robot`: the study's virtual robot.
    worn_logs : sequence of Path
        The same on a wearer at ease, who moves the joint for 20 s. Without any, the answers are taken from `logs`; with
        fewer than three starts, that of the start-up test is.
    robot : object or None
        Robot that is started here, with `read` and `write` as `pellucid.live.udp_robot.UdpRobot` has them.
    controller, participant : str or None
        The controller that will be exported, as `export` takes them.
    slider : float or None
        Position of a carriage [m], as `export` takes it; None for the middle of its rail.
    period : float or None
        Period of the controller [s], as `export` takes it.
    wearer : bool
        Whether somebody wears the robot for the answers, where the starts are played here.
    gain_checked : bool
        Whether the gain was checked by hand, which counts where the starts do not show it.
    ask : callable
        Called with a sentence before power is applied; returns when that is done.

    Returns
    -------
    Commissioning
        What was measured and written.

    Raises
    ------
    PellucidError
        If the law drives a spring, a log lacks a column, too few starts move the joint, the supervisor stopped them,
        there are logs of a wearer alone, or the robot is not there.

    Examples
    --------
    Commission the virtual robot of an identified study:

    >>> import tempfile
    >>> from pathlib import Path
    >>> import pellucid as pl
    >>> folder = Path(tempfile.mkdtemp()) / "bench"
    >>> _ = pl.init(folder, rig="bench-joint")
    >>> _ = pl.simulate(folder)
    >>> study = pl.open(folder)
    >>> _ = pl.identify(study).save(study)
    >>> pl.commission(study).drive.sign
    1
    """
    if not isinstance(study, Study):
        kind = type(study).__name__
        raise PellucidError(f"commission: found study of the type {kind}, expected what pl.open returns")
    if slider is not None and robot is None and not logs:
        raise PellucidError(
            f"commission of {study.name}: found a slider of {slider:g} m, expected none for the virtual robot, whose "
            "carriage is in the middle: give --log or --udp"
        )
    values = values_for(study, controller=controller, participant=participant, slider=slider, period=period)
    if LAWS[values.law].drives_spring:
        raise PellucidError(f"commission of {study.name}: found a law that drives a spring, expected a joint's drive")
    law = protect_wearer(values, unmeasured=True, place=f"commission of {study.name}").supervised
    if worn_logs and not logs:
        raise PellucidError(
            f"commission of {study.name}: found --worn alone, expected --log of starts that nobody wears, too"
        )
    told = {"controller": controller, "participant": participant, "slider": slider, "period": period}
    options = tuple(
        word
        for name, value in told.items()
        if value is not None
        for word in (f"--{name}", f"{value:g}" if isinstance(value, float) else value)
    )

    def answered(
        source: str,
        empty: Sequence[StartLog],
        take_starts: Callable[[SupervisedLaw], Sequence[StartLog]],
        other_waves: Sequence[StartLog] = (),
    ) -> Commissioning:
        drive = drive_check(empty, law.supervision["body_inertia"])
        told = law
        if law.supervision["drive_expected"]:
            drive = replace(drive, reading=drive_reading(empty))
            # Logs are of a controller that did not know the answer yet.
            told = law if logs else law.changed(drive_answer=drive.reading)
        found, written, problem = Answers(None, math.nan, None, 0, 0), tuple[str, ...](), ""
        worn = read_starts(worn_logs, law.values["period"]) if worn_logs else ()
        looks_empty = shows_empty_robot(drive, worn, law.supervision["body_inertia"]) if worn else False
        if not looks_empty and (drive.is_right or (drive.is_open and gain_checked)) and drive.is_read_right:
            found = answers(told, take_starts(told), other_waves)
            found = replace(found, notes=(*found.notes, UNKNOWN_WEARER_NOTE)) if looks_empty is None else found
            try:
                written = state_answers(study.folder / "study.toml", found, values.effort_unit, drive.reading)
            except OSError as error:
                problem = f"{study.folder / 'study.toml'} could not be written: {error.strerror or error}"
        files = tuple(Path(path).name for path in logs)
        return Commissioning(
            source, drive, found, written, str(study.folder), gain_checked, options, problem, files, bool(looks_empty)
        )

    if logs:
        interval = law.values["period"]
        empty = read_starts(logs, interval)
        if not worn_logs:
            return answered("logs", empty, lambda told: empty)
        return answered("logs", empty, lambda told: read_starts(worn_logs, interval), empty)
    if robot is not None:
        source, robot_of = "robot", _same_robot(cast(Robot, robot))
    else:
        source, robot_of = VIRTUAL_SOURCE, _virtual_robot(study)
        ask = _nobody_to_ask
    interval = law.values["period"]
    ask(f"{COMMISSIONING_CONDITION} Press Enter to apply power.")
    empty = record_starts(robot_of(False, interval), law, START_COUNT, worn=False, wave_factor=DRIVE_WAVE_FACTOR)

    def record_answers(told: SupervisedLaw) -> list[StartLog]:
        if wearer:
            ask("Put the robot on a relaxed wearer, who moves the joint for 20 s from the tenth start. Press Enter.")
        return record_starts(robot_of(wearer, interval), told, START_COUNT, worn=wearer)

    return answered(source, empty, record_answers)


def _same_robot(robot: Robot) -> Callable[[bool, float], Robot]:
    """Return a function that returns a robot, worn or not."""
    return lambda worn, period: robot


def _virtual_robot(study: Study) -> Callable[[bool, float], Robot]:
    """Return the function that makes a study's virtual robot, worn or not, with a period [s]."""
    made = [plugin.value(study.folder) for plugin in load_plugins("pellucid.robots")]
    make = next((one for one in made if one is not None), None)
    if make is None:
        raise PellucidError(
            f"commission of {study.name}: found no virtual robot, expected --log FILE or --udp HOST:PORT"
        )
    return make


def read_starts(paths: Sequence[Path], period: float) -> list[StartLog]:
    """Return the starts of logs, each from where the time of a log begins, has a gap or steps back.

    A column is in the unit that its name states, else in SI. Its rows are a controller's `period` [s] apart.
    """
    made = []
    for path in map(Path, paths):
        columns = dict(_si_columns(path))
        missing = [name for name in LOG_COLUMNS if name not in columns]
        if missing:
            raise PellucidError(
                f"{path}: found columns {', '.join(list(columns)[:8])}, expected {', '.join(LOG_COLUMNS)}: "
                f"no {missing[0]}"
            )
        time = columns["time"]
        bad = next((name for name in LOG_COLUMNS if not np.isfinite(columns[name]).all()), None)
        if bad is not None or time.size < MIN_START_ROWS:
            what = f"{time.size} rows" if bad is None else f"a {bad} that is no number"
            raise PellucidError(f"{path}: found {what}, expected at least {MIN_START_ROWS} rows of numbers")
        steps = np.diff(time)
        step = float(np.median(steps))
        if not abs(step / period - 1.0) <= RATE_TOLERANCE:
            is_unit = step > MIN_UNIT_RATIO * period
            other_unit, other_period = "state another unit in the name, such as time [ms]", "log one row each period"
            advice = other_unit if is_unit else f"{other_period}, or give --period"
            raise PellucidError(
                f"{path}: found rows {step:.4g} s apart by the column time, expected the controller's period of "
                f"{period:.4g} s: {advice}"
            )
        cuts = np.flatnonzero((steps > MIN_PAUSE_PERIODS * period) | (steps <= 0.0)) + 1
        for first, last in zip((0, *cuts), (*cuts, time.size), strict=True):
            if last - first >= MIN_START_ROWS:
                kept = {name: values[first:last] for name, values in columns.items()}
                position, effort = kept.pop("position"), kept.pop("effort")
                made.append(StartLog(f"{path.name} from row {first + 1}", kept.pop("time"), position, effort, kept))
    return made


def _si_columns(path: Path) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the columns of a log: name in lower case without its unit, and values in SI."""
    found = read_columns(path)
    for name, values in found.values.items():
        if isinstance(values, np.ndarray):
            bare, stated = split_unit(name)
            unit = stated or found.units.get(name)
            column = bare.strip().lower()
            expected = LOG_COLUMNS.get(column)
            factor, offset = to_si_factor(unit, expected, f"{path}: {name}") if unit else (1.0, 0.0)
            yield column, values * factor + offset


def state_answers(
    path: Path, found: Answers, effort_unit: str = "N*m", drive_answer: float = math.nan
) -> tuple[str, ...]:
    """Write answers into ``[rig.instruments]`` of a study.toml, and return the keys that were written."""
    lines = {}
    if math.isfinite(drive_answer):
        lines["drive_answer"] = f"{drive_answer:.4g}  # measured effort per commanded effort"
    if found.start_up is not None:
        lines["start_up_answer"] = (
            f'"{found.start_up:.5g} J"  # mean of {found.starts} starts, '
            f"standard deviation {found.start_up_spread:.2g} J"
        )
        if math.isfinite(found.wave):
            lines["start_up_wave"] = f'"{found.wave:.6g} {effort_unit}"  # amplitude of the wave that gave it'
    if found.probe is not None:
        numbers = ", ".join(f"{x:.5g}" for x in found.probe)
        lines["probe_answer"] = f"[{numbers}]  # from {found.probe_windows} windows of a moving joint"
        if math.isfinite(found.window):
            lines["probe_window"] = f'"{found.window:.4g} s"  # duration of each'
    if lines:
        text = read_given(path, MAX_STUDY_BYTES).decode("utf-8")
        write_text_atomically(path, with_keys(text, INSTRUMENTS_HEADER, lines))
    return tuple(lines)


def with_keys(text: str, header: str, lines: dict[str, str]) -> str:
    """Return the text of a TOML file in which a table has these keys; the table is made where there is none."""
    rows = text.splitlines()
    start = next((i for i, row in enumerate(rows) if row.split("#")[0].strip() == header), None)
    made = [f"{key} = {value}" for key, value in lines.items()]
    if start is None:
        return "\n".join([*rows, "", header, *made]) + "\n"
    end = next((i for i in range(start + 1, len(rows)) if rows[i].lstrip().startswith("[")), len(rows))
    own = [row for row in rows[start + 1 : end] if not re.match(rf"\s*({'|'.join(lines)})\s*=", row)]
    return "\n".join([*rows[: start + 1], *made, *own, *rows[end:]]) + "\n"
