"""A study that is proposed: layouts of columns, recordings, and the questions that files leave open."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from ..files.file_facts import FileFact
from ..files.log import is_stated_simulated
from ..units import parse_quantity
from .given_files import GivenFiles, GivenTable
from .inference.assign_roles import ColumnRole, TableRoles
from .inference.locked_spring import LockedSpring
from .inference.motion_efforts import RepeatedMotion
from .inference.processing_choice import ProcessingChoice
from .match_robot_joints import RobotJoints

MAX_QUESTION_COUNT = 5
"""Largest number of questions that are asked; study.toml marks every other uncertain choice."""

QUESTION_ORDER = (
    "rate", "effort", "rated", "position_unit", "counts_per_turn", "gear_turns", "full_duty", "supply_voltage",
    "lever_arm", "command_followed", "emg_unit", "muscles", "worn", "drive_constant", "payload", "angle_zero",
)  # fmt: skip
"""Questions in order of importance: the first changes the results most."""

SCALE_QUESTIONS = frozenset({
    "rate", "effort", "rated", "position_unit", "counts_per_turn", "gear_turns", "full_duty", "supply_voltage",
    "command_followed",
})  # fmt: skip
"""Questions that decide the scale of every result."""


NO_ANSWERS = ("not certain", "unknown")
"""Answers that leave a question open, as its default does."""

CHOSEN_KEYS = frozenset({"command_followed", "worn", "angle_zero"})
"""Questions that accept only the listed choices as answers."""


@dataclass(frozen=True)
class Question:
    """Question about a fact that the files do not contain."""

    key: str  # short name of the question, used with --answer
    text: str  # the question
    default: str  # answer that --yes takes
    consequence: str  # results that depend on the answer
    choices: tuple[str, ...] = ()  # accepted answers; empty for any


def select_questions(questions: Iterable[Question]) -> tuple[tuple[Question, ...], tuple[Question, ...]]:
    """Return the questions that are asked, by importance, and those that are only marked."""
    ranked = sorted(questions, key=lambda question: QUESTION_ORDER.index(question.key))
    return tuple(ranked[:MAX_QUESTION_COUNT]), tuple(ranked[MAX_QUESTION_COUNT:])


SAID_BY_LAB = "said by the lab"
"""Source of a value that an answer gives."""

UNKNOWN_SUPPLY = FileFact(1.0, "V", "the supply voltage is unknown: efforts are fractions of the full duty cycle")
"""Supply of a duty cycle if no file states its voltage."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Tables with the same columns, and the roles of these."""

    tables: tuple[GivenTable, ...]
    roles: TableRoles
    stream: str = ""  # name of the stream, empty for the main layout
    rate_fact: FileFact | None = None

    @property
    def channels(self) -> tuple[ColumnRole, ...]:
        """Roles of the columns that become channels."""
        return tuple(role for role in self.roles.roles if role.quantity is not None)

    @property
    def measures_joint(self) -> bool:
        """Whether the joint's own position was measured."""
        return any(role.quantity == "position" for role in self.channels)

    def with_each(self, change: Callable[[ColumnRole], ColumnRole]) -> Layout:
        """Return the layout with every role changed."""
        return replace(self, roles=replace(self.roles, roles=tuple(map(change, self.roles.roles))))

    def with_changes(self, is_meant: Callable[[ColumnRole], bool], **changes: object) -> Layout:
        """Return the layout with `changes` of the roles that are meant."""
        return self.with_each(lambda role: replace(role, **changes) if is_meant(role) else role)

    def column_in(self, table: GivenTable, column: str) -> str:
        """Return the name that another table of the layout has for a column of the first one."""
        return list(table.columns)[list(self.tables[0].columns).index(column)]


@dataclass(frozen=True, eq=False)
class ProposedRecording:
    """One recording of the proposed study."""

    name: str
    table: GivenTable
    streams: Mapping[str, GivenTable] = field(default_factory=dict)
    use: str = "fit"
    window: tuple[float, float] | None = None  # on the file's own clock [s]
    participant: str | None = None
    condition: str | None = None
    protocol: str | None = None
    columns: Mapping[str, str] = field(default_factory=dict)  # columns that differ from the first recording's
    extras: tuple[ColumnRole, ...] = ()  # channels that this recording alone has
    why: str = ""  # reason for its use or window


@dataclass(frozen=True, eq=False)
class Proposal:
    """A study that is proposed, with everything that study.toml and the page say of it."""

    name: str
    main: Layout
    streams: tuple[Layout, ...]
    recordings: tuple[ProposedRecording, ...]
    motion: str  # "rotary" or "prismatic"
    motion_is_certain: bool
    drive: str | None  # kind of the drive, None without one
    drive_facts: Mapping[str, FileFact]
    gravity: str | None
    is_person: bool
    is_worn: bool
    asked: tuple[Question, ...]
    marked: tuple[Question, ...]
    answers: Mapping[str, str]
    processing: ProcessingChoice | None
    given: GivenFiles
    remarks: tuple[str, ...]  # what was left out and noticed
    repeated: RepeatedMotion | None = None
    robot_joints: RobotJoints | None = None  # how the joints lie in the robot's file, None without one
    spring: LockedSpring | None = None  # the spring on the bench that the recordings show
    doubtful_muscles: frozenset[str] = frozenset()  # columns whose labels name several muscles

    @property
    def layouts(self) -> tuple[Layout, ...]:
        """The main layout, and those of the streams."""
        return (self.main, *self.streams)

    @property
    def open_questions(self) -> tuple[Question, ...]:
        """Questions that are asked and not answered."""
        return tuple(question for question in self.asked if question.key not in self.answers)

    @property
    def rate(self) -> float | None:
        """Sampling rate of the main files [Hz]."""
        return self.main.roles.rate

    @property
    def motor_turns(self) -> float:
        """How often a motor turns for a turn of its joint; 1 where the joint's own position was measured."""
        return 1.0 if self.main.measures_joint else find_motor_turns(self.answers, self.drive_facts)

    @property
    def is_simulated(self) -> bool:
        """Whether every file says that its numbers are simulated."""
        tables = self.main.tables
        return all(is_stated_simulated(table.path, table.facts, table.columns) for table in tables)

    @property
    def whole_count(self) -> int:
        """Number of recordings, of which one may be split."""
        return len({id(recording.table) for recording in self.recordings})

    @property
    def summary(self) -> str:
        """Number of recordings and their rate, in words, and the number of parts if one recording is split."""
        whole = self.whole_count
        rate = f"{self.rate:.5g} Hz" if self.rate else "an unknown sampling rate"
        parts = f", in {len(self.recordings)} parts" if len(self.recordings) > whole else ""
        return f"{whole} recording{'' if whole == 1 else 's'} at {rate}{parts}"


def find_motor_turns(answers: Mapping[str, str], facts: Mapping[str, FileFact]) -> float:
    """Return how often a motor turns for a turn of its joint, by an answer or by what a file states; else 1."""
    if "gear_turns" in answers:
        return parse_quantity(answers["gear_turns"], "1", "gear_turns")
    return facts["gear_ratio"].value if "gear_ratio" in facts else 1.0
