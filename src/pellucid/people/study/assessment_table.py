"""Table ``[assessment]`` of study.toml."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, model_validator

from ...study.study_fields import ProcedureTable, ShownText, Word, quantity
from ...study.study_file import StudyFile

if TYPE_CHECKING:
    from ..analysis import Analysis

DEFAULT_STUDIES = 1000
"""Studies that are simulated for each number of participants, unless the caller asks for another number."""


class AssessmentTable(ProcedureTable):
    """Comparison of people's movements between conditions: ``[assessment]``, over recordings that name a condition.

    Attributes
    ----------
    control : str
        Condition with which the others are compared.
    design : str
        Order of a participant's sessions: ``"AB/BA"`` (two conditions) or ``"Williams"`` (three or more),
        which require the period of every recording, or ``"parallel sessions"``, which have no order.
    washout : str
        Pause between two sessions, such as ``"30 min"``.
    exclusions : tuple of str
        Exclusion rules for people or movements, in words.
    excluded : dict of str to str
        Excluded participants with the reason; they count as lost.
    angle : str
        Channel of the angle; a study with `segment` does not need it.
    segment : tuple of str
        Markers on the moving segment, the proximal one first: its angle with the vertical is the angle.
    target : str
        Channel of the angle to be reached; each of its steps begins a movement and states its amplitude.
    agonists, antagonists : tuple of str
        Muscles ``emg.<muscle>`` that cause positive movements, and their antagonists; empty without EMG.
    emg : str
        Stream of the muscles, if they are not in the recording's own file.
    interaction : str
        Channel of the robot's torque on the person.
    lowpass : float
        Cut-off of the zero-phase low-pass on the angle [Hz].
    order : int
        Order of one pass of the filter.
    threshold : float
        Share of the largest speed that begins and ends a movement.
    cutoffs, thresholds : tuple of float
        Other cut-offs and thresholds of the sensitivity analysis [Hz], [1].
    advance : float
        Time by which EMG precedes the motion [s].
    confidence : float
        Confidence level of the intervals, in (0, 1).
    margins : dict of str to str
        Largest change by a transparent robot for each index, ``"10 %"`` of control or with a unit, stated before the
        data are seen. Further keys are ``estimand``: ``"mean"`` of people's changes (the default), ``"pseudo-median"``,
        or ``"mean and people"``, with ``people``, the share of people who must lie within, such as ``"80 %"``
        (otherwise 75 %); ``people_level``, the level of the tests of the shares of people (default ``"10 %"``); and
        ``largest_carry_over``, the largest effect of one session on the next, in margins, for which the certificate
        holds (default ``"0.25"``; it matters where recordings state their period).
    justification : dict of str to str
        Reason by index why a change as large as its margin does not matter.
    spreads : dict of str to str
        Expected standard deviation of people's changes by index, in the units of `margins`; a plan requires it.
    false_transparent : float
        Probability of a false "transparent" about the estimand, in (0, 0.5). It is valid for the mean with any skewness
        of people's changes, and for the pseudo-median if their distribution is symmetric.
    looks : tuple of float
        Rising shares of the planned participants at which a sequential study is analysed; empty if only the end is
        analysed. O'Brien and Fleming's spending function then divides `false_transparent` over the looks.
    look : int
        Number of this look in `looks`, from 1.
    max_left_out : float
        Largest lost share of a condition's movements, or of its participants, for a certificate from the others alone,
        in [0, 1). Above it, a certificate requires bounds that hold for any values of the lost ones.
    curves : dict of str to str
        Largest change of whole curves over time by a transparent robot: ``velocity`` and ``emg`` in shares of the
        control's maximum, ``interaction`` with a unit.
    """

    control: ShownText
    design: Literal["", "parallel sessions", "AB/BA", "Williams"] = ""
    washout: ShownText = ""
    exclusions: tuple[ShownText, ...] = ()
    excluded: dict[ShownText, ShownText] = Field(default_factory=dict)
    angle: Word = "position"
    segment: tuple[Word, ...] = ()
    target: Word = "target"
    agonists: tuple[Word, ...] = ()
    antagonists: tuple[Word, ...] = ()
    emg: Word = "emg"
    interaction: Word = "interaction"
    lowpass: quantity("Hz", gt=0) = 3.0
    order: int = Field(4, ge=1, le=12)
    threshold: float = Field(0.05, gt=0, lt=0.5)
    cutoffs: tuple[quantity("Hz", gt=0), ...] = (1.5, 3.0, 6.0, 12.0)
    thresholds: tuple[Annotated[float, Field(gt=0, lt=0.5)], ...] = (0.025, 0.05, 0.1)
    advance: quantity("s", ge=0) = 0.1
    confidence: float = Field(0.95, gt=0, lt=1)
    margins: dict[Word, ShownText] = Field(default_factory=dict)
    justification: dict[Word, ShownText] = Field(default_factory=dict)
    spreads: dict[Word, ShownText] = Field(default_factory=dict)
    false_transparent: float = Field(0.05, gt=0, lt=0.5)
    looks: tuple[Annotated[float, Field(gt=0, le=1)], ...] = ()
    look: int | None = Field(None, ge=1)
    max_left_out: float = Field(0.10, ge=0, lt=1)
    curves: dict[Literal["velocity", "interaction", "emg"], ShownText] = Field(default_factory=dict)

    @property
    def analysis(self) -> Analysis:
        """What these settings state before the data are seen; every certificate executes it."""
        from ..analysis import MOVEMENT_SETTINGS, Analysis

        names = ("control", "design", "washout", "exclusions", "excluded", "margins", "false_transparent", "looks",
                 "look", "max_left_out", "curves")  # fmt: skip
        stated = {name: getattr(self, name) for name in names}
        movements = {name: getattr(self, name) for name in MOVEMENT_SETTINGS}
        return Analysis.of({**stated, "movements": movements}, where="[assessment]")

    def reads(self, channel: str, stream: str) -> bool:
        """The angle, the robot's torque, and EMG."""
        if stream:
            return stream == self.emg and channel.startswith("emg.")
        return channel in (self.angle, self.interaction) or channel.startswith("emg.")

    @model_validator(mode="before")
    @classmethod
    def _no_other_test(cls, given: object) -> object:
        if isinstance(given, dict) and "equivalence" in given:
            raise ValueError(
                f'equivalence: found "{given["equivalence"]}", expected [assessment.margins] estimand = "mean" or '
                '"pseudo-median"; the mixed model is only a sensitivity analysis of the certificate'
            )
        return given

    @model_validator(mode="after")
    def _analysis(self) -> AssessmentTable:
        # The analysis raises an error for what is stated wrongly.
        stated = self.analysis
        _ = stated.alpha
        strangers = [name for name in self.justification if name not in stated.margins]
        if strangers:
            raise ValueError(f"[assessment.justification]: found {', '.join(strangers)}, expected indices with margins")
        return self

    @model_validator(mode="after")
    def _two_markers(self) -> AssessmentTable:
        if len(self.segment) not in (0, 2) or len(set(self.segment)) < len(self.segment):
            raise ValueError(f"segment: found {list(self.segment)}, expected two markers, the proximal one first")
        both = set(self.agonists) & set(self.antagonists)
        if both:
            raise ValueError(
                f"found {', '.join(sorted(both))} as agonist and antagonist, expected each muscle in one list"
            )
        return self

    def require_in(self, config: StudyFile) -> None:
        """The control must be a condition of the recordings, the segment's markers among the motion capture's."""
        conditions = [entry.condition for entry in config.recordings if entry.condition is not None]
        # While a session runs, the conditions that are still to come are known from its plan.
        conditions += [] if config.session is None else list(config.session.conditions)
        if config.recordings and self.control not in conditions:
            raise ValueError(
                f'[assessment] control: found "{self.control}", expected a condition of the recordings: '
                f"{', '.join(dict.fromkeys(conditions)) or 'none'}"
            )
        markers = config.optical.markers if config.optical is not None else ()
        absent = [marker for marker in self.segment if marker not in markers]
        if absent:
            raise ValueError(
                f"[assessment] segment: found {', '.join(absent)}, expected [optical] markers: "
                f"{', '.join(markers) or 'none'}"
            )
