"""Result of an assessment, with the data for its tables, figures and sentences.

A `Certified` is the certificate of one condition with its evidence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..._errors import StudyError
from ...study.answer import Answer
from ...study.procedures.procedure import Progress, quiet
from ...study.procedures.registry import asked
from ...study.procedures.result import Result
from ...study.procedures.run import run
from ...study.study import Study
from ...units import COORDINATES_BY_UNIT, Coordinate
from ..analysis import ESTIMAND_METHODS, EndPoint, Estimand
from ..certificate import Certificate
from ..comparison import ConditionComparison
from ..design_columns import MeasuredMovement
from ..equivalence import Equivalence
from ..indices import Index, indices_along
from ..mixed_model import MixedModel
from ..movement_indices import IndexTable, Isochrony
from ..session_periods import SessionPeriods
from ..survival import Survival
from .assessment_table import AssessmentTable
from .movement_curves import CurveEndPoint
from .pointing import SessionOrder


@dataclass(frozen=True)
class Certified:
    """Certificate of one condition's transparency, with its evidence."""

    condition: str
    certificate: Certificate
    end_points: Mapping[str, EndPoint]
    participants: int  # number of participants with all end points
    needed: int | None  # participants for a power of 90 % if there is no change; None if more than were tried
    estimand: Estimand = "mean"  # quantity that the study states
    people: tuple[str, ...] = ()  # participants with all end points, in the order of the tests' differences
    models: Mapping[str, MixedModel] = field(default_factory=dict)  # mixed model of all movements, by end point
    # sensitivity analyses: results of other tests, by test and end point
    beside: Mapping[str, Mapping[str, Equivalence]] = field(default_factory=dict)
    trends: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # trend and its p value, by end point
    unknown: tuple[str, ...] = ()  # questions that could not be tested, in sentences
    failed: Mapping[str, tuple[int, int]] = field(default_factory=dict)  # failed and all targets, by condition
    curves: tuple[CurveEndPoint, ...] = ()
    # lost and all movements, by end point and condition
    lost: Mapping[str, Mapping[str, tuple[int, int]]] = field(default_factory=dict)
    max_left_out: float = 0.0  # largest share of movements and of participants that may be lost
    lost_people: tuple[str, ...] = ()  # participants who were recorded and take no part
    needed_beyond: int | None = None  # participants for a power of 90 % of "beyond", if changes are as they were seen

    @property
    def test(self) -> str:
        """Name of the test that the certificate rests on."""
        return ESTIMAND_METHODS[self.estimand]


@dataclass(frozen=True, eq=False)
class Assessed:
    """One index: every participant's values (`table`) and the comparison of conditions (`comparison`)."""

    table: IndexTable
    comparison: ConditionComparison

    @property
    def name(self) -> str:
        """Name of the index."""
        return self.table.index.name

    def differs(self, condition: str, control: str, alpha: float) -> bool | None:
        """Return whether tests tell a condition from control; None without a test.

        The tests are Friedman's and Nemenyi's together, or signed ranks corrected after Holm where the index has no
        value of its own in control. Every part of a report that says "differs" asks here.
        """
        own = self.comparison.pairwise.get(condition)
        if own is None:
            return None
        if control not in self.table.conditions:
            return own.holm < alpha
        p = self.comparison.p_value
        return None if p is None else p < alpha and self.comparison.pair(control, condition) < alpha

    def share_of_control(self, control: str) -> float | None:
        """Return the divisor that makes a change a share of control's mean; None if shares are not meaningful."""
        if self.table.index.over_control:
            return 1.0
        if not self.table.index.scaled or control not in self.table.conditions:
            return None
        return float(self.table.column(control).mean())


@dataclass(frozen=True)
class Sensitivity:
    """Change from control by one rule for movements."""

    words: str  # rule, in words
    index: str
    condition: str
    control: float  # mean in the control condition, in the index's unit; NaN for an index relative to control
    change: float  # primary change from control, as a share, or in the index's unit if it has no zero
    p_value: float  # p value of Friedman's test, exact if possible
    at_least: bool = False  # whether the change is a lower bound, because somebody's movements were cut off


@dataclass(frozen=True, eq=False)
class Profile:
    """Mean movement of one kind in one condition, over all participants."""

    condition: str
    time: np.ndarray  # time since the movement's start, (n,) [s]
    angle: np.ndarray  # angle relative to the start, (n,) [rad]
    velocity: np.ndarray  # (n,) [rad/s]
    acceleration: np.ndarray  # (n,) [rad/s^2]


@dataclass(frozen=True, eq=False)
class Settling:
    """Share of movements of a condition that have not settled after a time, over all participants."""

    condition: str
    curve: Survival


@dataclass(frozen=True)
class Needed:
    """Number of participants with whom a change from control is detected in 8 of 10 studies."""

    index: str  # ``""`` if the effect holds for any index
    change: float | None  # change as a share of control's mean
    effect: float  # change divided by the standard deviation of participants' changes (d of pairs)
    participants: int | None  # None if more than the largest number tried


@dataclass(frozen=True, kw_only=True, repr=False)
class AssessmentResult(Result):
    """Result of an assessment."""

    paragraph: str = ""  # findings and missing evidence, in plain sentences
    control: str = ""
    conditions: tuple[str, ...] = ()  # compared conditions, control first
    participants: tuple[str, ...] = ()  # compared participants
    without: Mapping[str, str] = field(default_factory=dict)  # reasons, by participant, for exclusion
    absent: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # conditions that each excluded one lacks
    unusable: Mapping[str, str] = field(default_factory=dict)  # reasons, by recording, for exclusion
    movements: int = 0  # number of movements in use
    left_out: Mapping[str, int] = field(default_factory=dict)  # number of stretches without a movement, by reason
    assessed: Mapping[str, Assessed] = field(default_factory=dict, repr=False)  # comparisons by index
    isochrony: tuple[Isochrony, ...] = field(default=(), repr=False)
    sensitivity: tuple[Sensitivity, ...] = field(default=(), repr=False)
    needed: tuple[Needed, ...] = ()
    # by condition, participants who would show the change of the leading index that was seen; None if more than tried
    needed_as_seen: Mapping[str, int | None] = field(default_factory=dict)
    is_simulated: bool = False  # whether study.toml says that the recordings were simulated
    exclusions: tuple[str, ...] = ()  # stated exclusion rules for people or movements, in words
    rig_file: str = ""  # file, relative to the study's folder, from which its people are simulated; "" without one
    # by condition, whether somebody's median duration was not reached: in the condition, and in control
    unreached: Mapping[str, tuple[bool, bool]] = field(default_factory=dict, repr=False)
    estimand: Estimand = "mean"  # quantity that stands for people's changes
    order: SessionOrder | None = field(default=None, repr=False)  # order of the recordings
    found_answer: Answer | None = field(default=None, repr=False)  # answer to the command's question
    has_margins: bool = False  # whether study.toml states margins
    is_registered: bool = False  # whether an analysis was registered before the data
    certified: tuple[Certified, ...] = ()  # certificates by condition, if margins are stated
    profiles: tuple[Profile, ...] = field(default=(), repr=False)
    settling: tuple[Settling, ...] = field(default=(), repr=False)
    profile_of: str = ""  # kind of movement that the profiles show, in words
    measured: tuple[MeasuredMovement, ...] = field(default=(), repr=False)  # movements in use, by the study's own rule
    unit: str = "rad"  # unit of the coordinate of movement: "rad" or "m"
    # function that writes the tables for a paper into a folder
    write_tables: Callable[[Path, AssessmentResult], object] | None = field(default=None, repr=False)

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return super().make_answer() if self.found_answer is None else self.found_answer

    def said_of(self, index: str, condition: str) -> str | None:
        """Return what the certificate of a condition says of an index; None if no margin of it is stated."""
        own = next((each for each in self.certified if each.condition == condition and index in each.end_points), None)
        return None if own is None else own.certificate.said_of(index)

    def sessions(self, table: IndexTable, condition: str) -> SessionPeriods | None:
        """Return when a table's participants had a condition and control; None if that is not stated."""
        compared = self.control in table.conditions or table.index.over_control
        if self.order is None or not compared:
            return None
        return self.order.sessions(table.participants, self.conditions, self.control, condition)

    @property
    def along(self) -> Coordinate:
        """Coordinate of the movements."""
        return COORDINATES_BY_UNIT[self.unit]

    @property
    def indices(self) -> Mapping[str, Index]:
        """All possible indices, in this unit."""
        return indices_along(self.along)

    def written(self, study: Study) -> str:
        return f"Tables for a paper in {study.made / 'tables'}"

    @property
    def prose(self) -> str:
        return self.paragraph

    def for_page(self) -> AssessmentResult:
        # A function cannot be kept, and no page needs it.
        return replace(self, write_tables=None)

    def save_more(self, study: Study) -> None:
        if self.write_tables is not None:
            self.write_tables(study.place("tables"), self)


def kept_certificates(study: Study, expected: str, tell: Progress = quiet) -> AssessmentResult:
    """Return what `assess` kept of a study with margins if it is fresh, or else finds now.

    Raises
    ------
    StudyError
        If the study states no margins; the message says what was `expected`.
    """
    spec = study.find_table(AssessmentTable)
    if spec is None or not spec.analysis.margins:
        raise StudyError(f"{study.folder}, study.toml: found no [assessment.margins], expected {expected}")
    (procedure,) = asked(study, "assess")
    kept = AssessmentResult.kept(study, procedure)
    if kept is not None:
        return kept
    found = run(study, procedure.name, on_progress=tell)
    assert isinstance(found, AssessmentResult)  # that is what its procedure finds
    return found
