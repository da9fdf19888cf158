"""Say of any log what is dead, constant, impossible, saturated, echoed, clipped, on another clock, not measured or
personal: one verdict for each channel, over all files."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..._domains import offered
from ..._errors import PellucidError, RecordingError, listed_names
from ..._given import visible_text
from ..._printed_command import printed_command
from ...files.defects import constant, echoed, garbage, held
from ...files.log import (
    ALARM_LEVEL,
    LEVELS,
    NOTE_LEVEL,
    REPAIRED_LEVEL,
    SOUND_LEVEL,
    VERDICT_WORDS,
    Log,
    LogFinding,
    inspect_log,
    log_of,
)
from ...files.quantity import EFFORT_QUANTITIES
from ...files.readers.read import describes_files, read_columns, readers_by_ending
from ...numerics.arguments import with_checked_arguments
from ..answer import Answer, AnswerPart, Basis, Step, excluded_words
from ..pages.quantities import unit_text
from .procedure import Progress, quiet

SOUND_VERDICT = "sound"
"""Verdict on a channel of which nothing was found."""

AFTER_REPAIR = "after automatic repair"
"""Limit of the verdict on a log of which Pellucid excludes or repairs something when it reads the log."""

MAX_LISTED_FILES = 3
"""A sentence lists at most this many files by name."""

MAX_LISTED_CHANNELS = 12
"""The first sentence names at most this many channels of each verdict."""

ENVELOPE_CORRECTION = (
    "Record raw EMG, or use these envelopes for co-contraction and force only and state unit 1 for them in study.toml: "
    "{channels}"
)
"""What to do with envelopes among channels of raw EMG, in an audit and in every analysis of EMG."""

CORRECTIONS = {
    VERDICT_WORDS["no_time"]: "Give the rate of files without a column of time by `--rate HZ`",
    VERDICT_WORDS["personal"]: "Remove what identifies a person from the files: {channels}",
    VERDICT_WORDS["unit"]: "Correct the unit of {channels}",
    VERDICT_WORDS["envelope"]: ENVELOPE_CORRECTION,
    VERDICT_WORDS["exchanged"]: "Exchange the names {channels}",
    VERDICT_WORDS[constant.KIND]: "Record or compute again the channels that never change: {channels} (dead)",
    VERDICT_WORDS["impossible"]: "Correct the unit of {channels}, or record again without the impossible values",
    VERDICT_WORDS[held.KIND]: "Log {channels} with a clock of its own, or exclude it from the study (another clock)",
    VERDICT_WORDS[echoed.KIND]: "Record the measured values, or exclude from the study: {channels} (echoed)",
}
"""What to do with the channels of a verdict, where it is something else than `RECORD_AGAIN`."""

IN_ALL_FILES = "in all files"
"""Words for all files of an audit."""

RECORD_AGAIN = "Record again, or exclude from the study: {channels} ({verdict})"
"""What to do with unsound channels."""

READING_SHARE = 0.9
"""Share of reading and checking in the time of an audit; the rest draws its page."""

CHANNEL_FREE_KINDS = ("personal", "text", "truncated", "damaged_rows", "short")
"""Kinds of findings that do not depend on a channel's samples."""

_VERDICT_ORDER = {kind: i for i, kind in enumerate(VERDICT_WORDS)}


@dataclass(frozen=True)
class AuditedFile:
    """One file of an audit.

    Attributes
    ----------
    name : str
        Path of the file, as short as it is unique among the audited ones.
    log : Log or None
        The file's channels; None if it could not be read.
    findings : tuple of LogFinding
        What was found of its channels.
    unread : str
        Why the file could not be read; "" if it was.
    """

    name: str
    log: Log | None
    findings: tuple[LogFinding, ...] = ()
    unread: str = ""

    @property
    def rows(self) -> int:
        """Number of rows of its longest table."""
        return 0 if self.log is None else max((len(channel.samples) for channel in self.log.channels), default=0)

    @property
    def folder(self) -> str:
        """First folder of the file's name; "" without one."""
        return self.name.partition("/")[0] if "/" in self.name else ""


@dataclass(frozen=True)
class ChannelVerdict:
    """The verdict on one channel, over all files that have it.

    Attributes
    ----------
    channel : str
        Name of the column; ``"time"`` stands for the clock that a file lacks.
    holds : str
        What the channel probably holds, with the unit that the file states; "" if neither name nor unit tells.
    verdict : str
        The gravest thing that was found, such as ``"dead"``; ``"sound"`` if nothing was.
    level : str
        ``"alarm"``, ``"repaired"``, ``"note"`` or ``"sound"``.
    said : tuple of (str, str)
        Level and sentence of each thing that was found, with its files, the gravest first.
    findings : tuple of (str, LogFinding)
        Every finding with the name of its file.
    files : tuple of AuditedFile
        The files that have the channel.
    """

    channel: str
    holds: str
    verdict: str
    level: str
    said: tuple[tuple[str, str], ...]
    findings: tuple[tuple[str, LogFinding], ...]
    files: tuple[AuditedFile, ...] = field(default=(), repr=False)

    @property
    def alarms_by_file(self) -> dict[str, LogFinding]:
        """The gravest alarm of each file, by the file's name."""
        found: dict[str, LogFinding] = {}
        for name, finding in self.findings:
            known = found.get(name)
            if finding.level == ALARM_LEVEL and (known is None or _order(finding) < _order(known)):
                found[name] = finding
        return found

    @property
    def sentences(self) -> tuple[str, ...]:
        """What was found and in which files, the gravest first."""
        return tuple(sentence for _, sentence in self.said)


@dataclass(frozen=True)
class _AlarmGroup:
    """Channels with one verdict in the same files."""

    verdict: str
    where: str
    channels: tuple[str, ...]
    is_pair: bool  # Whether they have each other's signal
    is_everywhere: bool  # Whether all files that have them show it

    @property
    def words(self) -> str:
        """The channels with their verdict and its files."""
        what = f"{self.verdict} with each other" if self.is_pair else self.verdict
        return f"{', '.join(self.channels)} ({what}: {self.where})"

    @property
    def placed(self) -> str:
        """The channels with the files, if these are not all."""
        return ", ".join(self.channels) + ("" if self.is_everywhere else f" {self.where}")


@dataclass(frozen=True)
class Audit:
    """What an audit found; `str` of it is one line for each channel.

    Attributes
    ----------
    files : tuple of AuditedFile
        Every file, in the order in which they were given.
    verdicts : tuple of ChannelVerdict
        One for each channel, in the order of the files' columns; the clock's is the first.
    paths : tuple of str
        Files and folders as they were given.
    options : tuple of str
        Options that were given, as words of a command.
    command : str
        Command that audits them.
    question : str
        Question that the audit answers.
    is_of_studies : bool
        Whether `paths` are folders of studies.
    stated_simulated : bool, optional
        Whether the recordings are simulated, as their studies state; None where they state nothing.
    people : int
        Number of people whom the recordings are of; 0 where none are named.
    """

    files: tuple[AuditedFile, ...]
    verdicts: tuple[ChannelVerdict, ...]
    paths: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    command: str = "audit"
    question: str = "May this log be used?"
    is_of_studies: bool = False
    stated_simulated: bool | None = None
    people: int = 0

    @property
    def alarms(self) -> tuple[ChannelVerdict, ...]:
        """Verdicts on the channels that must not be used as they are."""
        return tuple(verdict for verdict in self.verdicts if verdict.level == ALARM_LEVEL)

    @property
    def noted(self) -> dict[str, list[str]]:
        """Names of the channels that may be used and are not merely sound, by their verdict."""
        found: dict[str, list[str]] = {}
        for each in self.verdicts:
            if each.level == NOTE_LEVEL:
                found.setdefault(each.verdict, []).append(each.channel)
        return found

    @property
    def unread(self) -> tuple[AuditedFile, ...]:
        """Files that could not be read."""
        return tuple(file for file in self.files if file.unread)

    @property
    def is_sound(self) -> bool:
        """Whether every file was read and no channel has an alarm."""
        return not self.alarms and not self.unread

    @property
    def headline(self) -> str:
        """First sentence: how many channels are sound, and which are not."""
        count = len(self.verdicts)
        files = "1 file" if len(self.files) == 1 else f"{len(self.files)} files"
        sound = sum(v.level == SOUND_LEVEL for v in self.verdicts)
        text = f"{sound} of {count} channels of {files} {'is' if sound == 1 else 'are'} sound"
        text += "".join(f"; {len(names)} {word} ({listed_names(names, MAX_LISTED_CHANNELS)})"
                        for word, names in self.noted.items())  # fmt: skip
        text += "."
        if self.alarms:
            are = "channel is" if count == 1 else "channels is" if len(self.alarms) == 1 else "channels are"
            names, inside = ", ".join(f"{v.channel} ({v.verdict})" for v in self.alarms), f" in {files}"
            if len(self.files) > 1:
                names, inside = "; ".join(each.words for each in self._alarm_groups(is_gravest=True)), ""
            text = f"{len(self.alarms)} of {count} {are} unsound{inside}: {names}."
        repaired = ", ".join(f"{v.channel} ({v.verdict})" for v in self.verdicts if v.level == REPAIRED_LEVEL)
        if repaired:
            excluded = ", ".join(self._excluded)
            text += f" Pellucid repairs {repaired} when it reads the log{f': {excluded}' if excluded else ''}."
        if self.unread:
            text += f" {len(self.unread)} could not be read."
        return text

    @property
    def answer(self) -> Answer:
        """Whether the log may be used as it is, and what to do."""
        parts = tuple(
            AnswerPart(v.channel, "no" if v.level == ALARM_LEVEL else "yes", "; ".join(v.sentences) or v.verdict)
            for v in self.verdicts
        )
        return Answer(
            self.question,
            "yes" if self.is_sound else "no",
            self.headline,
            "" if self.is_sound else self.headline,
            parts,
            basis=Basis(
                len(self.files) - len(self.unread), len(self.files), "file", is_simulated=self._is_simulated,
                people=self.people, rows=sum(file.rows for file in self.files), excluded=self._excluded,
            ),
            next=self._steps(),
            qualifier=AFTER_REPAIR if self.is_sound and self._is_repaired else "",
        )  # fmt: skip

    def _alarm_groups(self, *, is_gravest: bool = False) -> list[_AlarmGroup]:
        """Return the alarms in groups with one verdict in the same files.

        With `is_gravest`, those of each channel's verdict alone.
        """
        made: dict[tuple[str, str, frozenset[str], bool], list[str]] = {}
        for verdict in self.alarms:
            having: dict[tuple[str, str], list[str]] = {}
            for name, finding in verdict.alarms_by_file.items():
                word = VERDICT_WORDS[finding.kind]
                if word == verdict.verdict or not is_gravest:
                    having.setdefault((word, visible_text(finding.partner)), []).append(name)
            for (word, partner), names in having.items():
                where, is_everywhere = _where(names, verdict.files), len(names) == len(verdict.files)
                if is_everywhere:
                    where = IN_ALL_FILES if len(names) == len(self.files) else f"{where} with it"
                pair = frozenset((verdict.channel, partner) if partner else ())
                made.setdefault((word, where, pair, is_everywhere), []).append(verdict.channel)
        return [
            _AlarmGroup(word, where, tuple(channels), bool(pair), is_everywhere)
            for (word, where, pair, is_everywhere), channels in made.items()
        ]

    @property
    def _excluded(self) -> tuple[str, ...]:
        """What reading excludes of the rows, in words."""
        found = [finding for file in self.files for finding in file.findings]
        repeats = sum(finding.excluded for finding in found if finding.kind == "repeated")
        defects = sum(finding.excluded for finding in found if finding.kind != "repeated")
        return excluded_words(repeats, defects, [gap for finding in found for gap in finding.gaps])

    @property
    def _is_repaired(self) -> bool:
        """Whether reading excludes or repairs something."""
        return any(finding.level == REPAIRED_LEVEL for file in self.files for finding in file.findings)

    @property
    def _is_simulated(self) -> bool | None:
        """Whether the studies or every file say that they are simulated; None where one does not say."""
        if self.stated_simulated is not None:
            return self.stated_simulated
        return all(file.log is not None and file.log.is_simulated for file in self.files) or None

    def _steps(self) -> tuple[Step, ...]:
        """Return what to do next: make a study, or correct what is unsound."""
        kinds = {channel.quantity.kind for file in self.files if file.log is not None for channel in file.log.channels}
        if self.is_sound and self.is_of_studies:
            return tuple(Step("Check the study", line=printed_command("check", path)) for path in self.paths)
        is_motion_alone = "" not in kinds and not kinds.intersection((*EFFORT_QUANTITIES, "emg"))
        if self.is_sound and is_motion_alone:
            return (Step("Record an effort or EMG too: no study is made of motion alone"),)
        start = printed_command("init", "my-study", "--from", *self.paths)
        if self.is_sound:
            return (Step("Make a study of it", line=start),)
        alike: dict[str, list[str]] = {}
        for group in self._alarm_groups():
            alike.setdefault(group.verdict, []).append(group.placed)
        steps = [
            Step(CORRECTIONS.get(kind, RECORD_AGAIN).format(channels="; ".join(names), verdict=kind))
            for kind, names in alike.items()
        ]
        unread = ", ".join(file.name for file in self.unread)
        steps += [Step(f"Correct or remove the files that cannot be read: {unread}")] if unread else []
        others = len(self.verdicts) - len(self.alarms)
        dead = VERDICT_WORDS[constant.KIND]
        is_left_out = all(v.verdict == dead and not v.holds.startswith("emg") for v in self.alarms)
        if is_left_out and others and not unread and not is_motion_alone and not self.is_of_studies:
            use = f"Or use the other {others} channels (`init` excludes those that never change)"
            return (*steps, Step(use, line=start))
        again = printed_command(self.command, *self.paths, *self.options)
        return (*steps, Step("Then audit changed files again", line=again))

    def table(self) -> dict[str, object]:
        """Return everything as a table for JSON."""
        return {
            "answer": self.answer.table(),
            "files": [{"file": f.name, "read": not f.unread, "why": f.unread} for f in self.files],
            "verdicts": [
                {
                    "channel": v.channel, "holds": v.holds, "verdict": v.verdict, "level": v.level,
                    "said": list(v.sentences),
                    "findings": [
                        {"file": name, "kind": f.kind, "level": f.level, "found": visible_text(f.found)}
                        for name, f in v.findings
                    ],
                }
                for v in self.verdicts
            ],
            "sound": self.is_sound,
        }  # fmt: skip

    def __str__(self) -> str:
        width = max((len(v.channel) for v in self.verdicts), default=0)
        lines = [self.answer.whole]
        for verdict in (v for v in self.verdicts if v.said):
            lines.append(f"  {verdict.channel.ljust(width)}  {verdict.verdict}: {'; '.join(verdict.sentences)}")
        return "\n".join(lines)


@with_checked_arguments
def audit(
    files: str | os.PathLike | Iterable[str | os.PathLike],
    *,
    rate: float | None = None,
    on_progress: Progress = quiet,
) -> Audit:
    """Say of any log what is wrong with each channel, without a study.

    Parameters
    ----------
    files : path-like, or iterable of path-like
        Files of any format that `pellucid.read` reads, or folders of them. Channels of one name are one channel.
    rate : float, optional
        Sampling rate of files without a column of time [Hz].
    on_progress : callable
        Called with a text and the share done, 0 to 1.

    Returns
    -------
    Audit
        `verdicts` has one verdict for each channel: "dead", "impossible values", "saturated", "clipped", "echoed",
        "another clock", "no time base", "not measured", "personal", "sound", and some more.

    Raises
    ------
    PellucidError
        If no file is given, or none can be read.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import pellucid as pl
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "swing.csv")
    ...     rows = "".join(f"{0.01 * i:.2f},{(0.1 * i) % 1.3:.3f},0.0\\n" for i in range(200))
    ...     _ = path.write_text("t [s],angle [rad],torque [N*m]\\n" + rows)
    ...     {verdict.channel: verdict.verdict for verdict in pl.audit(path).verdicts}
    {'t [s]': 'sound', 'angle [rad]': 'sound', 'torque [N*m]': 'dead'}
    """
    given = [files] if isinstance(files, (str, os.PathLike)) else list(files)
    paths = _paths_of(given)
    names = _short_names(paths)
    audited = []
    sizes = [path.stat().st_size if path.is_file() else 0 for path in paths]
    for i, (path, name) in enumerate(zip(paths, names, strict=True)):
        on_progress(f"checking {name}", READING_SHARE * sum(sizes[:i]) / max(sum(sizes), 1))
        try:
            log = log_of(read_columns(path), rate)
        except RecordingError as error:
            audited.append(AuditedFile(name, None, unread=visible_text(str(error))))
            continue
        audited.append(AuditedFile(name, log, _log_findings(log)))
    on_progress("writing the page", READING_SHARE)
    if all(file.unread for file in audited):
        raise RecordingError("\n".join(file.unread for file in audited))
    audited = _with_findings_of_all(audited)
    options = () if rate is None else ("--rate", f"{rate:g}")
    return Audit(tuple(audited), tuple(find_verdicts(audited)), tuple(map(os.fspath, given)), options)


def _with_findings_of_all(files: Sequence[AuditedFile]) -> list[AuditedFile]:
    """Return files with what depends on all their logs, such as channels that are exchanged in one of them."""
    made = list(files)
    read = [i for i, file in enumerate(made) if file.log is not None]
    for check in offered("LOGS_CHECKS"):
        for i, more in zip(read, check([made[i].log for i in read]), strict=True):
            made[i] = replace(made[i], findings=(*made[i].findings, *more))
    return made


def _log_findings(log: Log) -> tuple[LogFinding, ...]:
    """Return what is wrong with a log's channels: by the checks of domains for what they know, else by the general."""
    general = inspect_log(log)
    if any(finding.kind == garbage.KIND for finding in general):
        # Rows of garbage come before anything that a domain knows of its signals.
        return general
    by_domain = [finding for check in offered("LOG_CHECKS") for finding in check(log)]
    known = {finding.channel for finding in by_domain}
    return (*(f for f in general if f.channel not in known or f.kind in CHANNEL_FREE_KINDS), *by_domain)


def _paths_of(given: Iterable[str | os.PathLike]) -> list[Path]:
    """Return the files that are named, and those in the folders that are named."""
    endings, paths = readers_by_ending(), []
    for path in map(Path, given):
        if path.is_dir():
            inside = (p for p in sorted(path.rglob("*")) if p.is_file() and p.suffix.lower() in endings)
            paths += [p for p in inside if not describes_files(p)]
        else:
            paths.append(path)
    if not paths:
        raise PellucidError("audit: found no file that can be read, expected one or more, or a folder of them")
    return list(dict.fromkeys(paths))


def _short_names(paths: Sequence[Path]) -> list[str]:
    """Return the paths below the folder that all of them share."""
    whole = [path.absolute() for path in paths]
    common = Path(os.path.commonpath([path.parent for path in whole]))
    return [visible_text(path.relative_to(common).as_posix()) for path in whole]


def find_verdicts(files: Sequence[AuditedFile]) -> list[ChannelVerdict]:
    """Return the verdict on each channel of the files, the clock's first."""
    holders: dict[str, list[AuditedFile]] = {}
    holds: dict[str, str] = {}
    for file in files:
        if file.log is None:
            continue
        clock = file.log.time or "time"
        named = [clock, *(c.name for c in file.log.channels), *file.log.texts, *(p.label for p in file.log.personal)]
        for name in dict.fromkeys(named):
            holders.setdefault(name, []).append(file)
        for channel in file.log.channels:
            quantity = channel.quantity
            role = f", {quantity.role}" if quantity.role else ""
            unit = f" [{unit_text(quantity.stated) or quantity.stated}]" if quantity.stated else ""
            kind = "time" if channel.name == clock else quantity.kind
            holds.setdefault(channel.name, f"{kind}{role}{unit}" if kind else "")
    clocks = {f.log.time or "time" for f in files if f.log}
    order = sorted(holders, key=lambda name: name not in clocks)
    findings: dict[str, list[tuple[AuditedFile, LogFinding]]] = {}
    for file in files:
        for finding in file.findings:
            findings.setdefault(finding.channel, []).append((file, finding))
    return [_verdict_on(name, holders[name], holds.get(name, ""), findings.get(name, ())) for name in order]


def _verdict_on(
    channel: str, files: Sequence[AuditedFile], holds: str, found: Sequence[tuple[AuditedFile, LogFinding]]
) -> ChannelVerdict:
    kinds = sorted(
        {f.kind for _, f in found}, key=lambda kind: (LEVELS.index(_level(found, kind)), _VERDICT_ORDER[kind])
    )
    said = []
    for kind in kinds:
        text = _sentence([(file, finding) for file, finding in found if finding.kind == kind], files)
        said.append((_level(found, kind), text))
    verdict, level = (VERDICT_WORDS[kinds[0]], said[0][0]) if kinds else (SOUND_VERDICT, SOUND_LEVEL)
    shown = tuple((file.name, finding) for file, finding in found)
    return ChannelVerdict(visible_text(channel), holds, verdict, level, tuple(said), shown, tuple(files))


def _order(finding: LogFinding) -> int:
    """Return the place of a finding's kind among all, the gravest first."""
    return _VERDICT_ORDER[finding.kind]


def _level(found: Sequence[tuple[AuditedFile, LogFinding]], kind: str) -> str:
    """Return the gravest level of the findings of a kind."""
    return min((f.level for _, f in found if f.kind == kind), key=LEVELS.index)


def _sentence(found: Sequence[tuple[AuditedFile, LogFinding]], files: Sequence[AuditedFile]) -> str:
    """Return what was found of one kind, in the words for the file in which it is largest, and in which files it is."""
    worst, finding = min(found, key=lambda each: (LEVELS.index(each[1].level), -finding_size(each[1])))
    if len(files) == 1:
        return visible_text(finding.found)
    having = list(dict.fromkeys(file.name for file, _ in found))
    alike = len({each.found for _, each in found}) == 1
    example = f" (in {worst.name})" if len(having) > 1 and not alike else ""
    return visible_text(f"{_where(having, files)}: {finding.found}{example}")


def finding_size(finding: LogFinding) -> float:
    """Return the magnitude behind a finding; 0 without one."""
    return abs(finding.size) if math.isfinite(finding.size) else 0.0


def _where(having: Sequence[str], files: Sequence[AuditedFile]) -> str:
    """Return in which of the files something is: by folder where folders decide it, else by count and names."""
    if len(having) == len(files):
        return f"in all {len(files)} files"
    folders = dict.fromkeys(file.folder for file in files)
    inside = {folder: [f.name for f in files if f.folder == folder] for folder in folders}
    whole = [folder for folder, names in inside.items() if set(names) <= set(having)]
    none = [folder for folder, names in inside.items() if not set(names) & set(having)]
    if whole and none and len(whole) + len(none) == len(folders):
        return f"in every file of {', '.join(whole)}, in none of {', '.join(none)}"
    if len(having) <= MAX_LISTED_FILES:
        return f"in {', '.join(having)}"
    return f"in {len(having)} of {len(files)} files"
