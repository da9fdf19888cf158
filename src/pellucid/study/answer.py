"""Answer of a result: question, verdict, sentence, numbers, basis, assumptions and recommended next steps.

A domain makes the answer of its result once. Terminal, page, certificate, results.json, notebook and paper show it, and
write no verdict of their own.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from .._printed_command import printed_command, printed_path
from .pages.quantities import capitalised, typeset_quantities
from .pages.values import plain_text

AnswerVerdict = Literal["yes", "no", "cannot say"]
"""Verdict of an answer."""

BADGE_WORDS: Mapping[AnswerVerdict, str] = {"yes": "Yes", "no": "No", "cannot say": "Cannot say"}
"""Words of a verdict on a page's badge and on a terminal."""

REPORT_COMMAND = "report"
"""Command that writes the page of a study."""

USE_QUESTION = "May these figures be used?"
"""Question of a result whose procedure asks none of its own."""

WORN_TOGETHER = "machine and limb together"
"""What the parameters of a machine that somebody wears describe."""

DIGITISED = "digitised from published figures"
"""Origin of recordings that are curves of a paper's figures, which lack its noise, clock and samples."""

RECORDED_UNITS = ("recording", "file")
"""Counted units that are recordings themselves, and not what was made of them."""

UNCONFIRMED_SCALE = "scale not confirmed"
"""Limit of a verdict on relative numbers where a default scales all absolute ones."""

FOLDER = "@folder@"
"""Mark in the text of a step that stands for the study's folder; a shell takes it without quotes."""

QUESTION_WORDS: Mapping[str, str] = {
    "rate": "sampling rate",
    "effort": "effort column",
    "rated": "rated effort of the drive",
    "position_unit": "unit of the position",
    "counts_per_turn": "counts per turn of the joint",
    "gear_turns": "motor turns per turn of the joint",
    "full_duty": "number for 100 % duty",
    "supply_voltage": "supply voltage",
    "lever_arm": "distance of the force from the axis",
    "command_followed": "the drive delivers its command",
    "emg_unit": "unit of EMG",
    "muscles": "muscles of the labels",
    "worn": "robot worn",
    "drive_constant": "drive constant",
    "payload": "payload carried",
    "angle_zero": "hangs down at angle 0",
}
"""Plain words for the keys of the questions about a recording."""

MAX_NAMED_ASSUMPTIONS = 4
"""Largest number of assumptions that a sentence names; a study's page has all."""

MAX_NAMED_REASONS = 4
"""Largest number of parts whose reasons stand in one sentence."""


@dataclass(frozen=True)
class AnswerNumber:
    """A number that an answer rests on.

    Attributes
    ----------
    what : str
        Name of the quantity.
    value : float
        Value in `unit`.
    unit : str
        Unit as plain text; ``"1"`` without a dimension.
    interval : tuple of float, optional
        Ends of its confidence interval, in `unit`.
    id : str
        Id of its row in results.json; "" without one.
    """

    what: str
    value: float
    unit: str
    interval: tuple[float, float] | None = None
    id: str = ""


@dataclass(frozen=True)
class AnswerPart:
    """The verdict on one joint, condition, muscle or claim.

    Attributes
    ----------
    name : str
        What the verdict is on.
    verdict : str
        "yes", "no" or "cannot say".
    reason : str
        Reason, with the number it rests on.
    """

    name: str
    verdict: AnswerVerdict
    reason: str

    def __str__(self) -> str:
        return f"{self.verdict}: {self.reason}"


@dataclass(frozen=True)
class Basis:
    """Basis of an answer: the data used.

    Attributes
    ----------
    used, recorded : int
        Number used, and number recorded.
    counted : str
        Counted unit, in the singular: ``"recording"``, ``"participant"``, ``"file"``.
    judged : str
        Data that the numbers were computed on, in words, such as ``"held-out recordings"``; "" without any.
    is_simulated : bool, optional
        Whether the recordings were simulated; None where that is not known, or not the same for all.
    is_worn : bool
        Whether somebody wears the machine that was identified.
    is_digitised : bool
        Whether the recordings were read off published figures.
    more : tuple of str
        Further sentences, such as on the analysis that was registered.
    parts : int
        Number of parts into which the counted things were cut; 0 where each is whole.
    held_out : int
        Number of the counted things, or of their parts, that were held out from the fit and that the numbers are of.
    rows : int
        Number of rows in the files; 0 where they are not counted.
    excluded : tuple of str
        What reading excludes of the rows, in words.
    people : int
        Number of people whom the recordings in use are of; 0 where they name none.
    wearers : int
        Number of people who each wear every one of the counted robots; 0 where they are not counted.
    computed : str
        What was computed from recorded signals, such as ``"torque computed from the drive's voltage"``; "" for nothing.
    """

    used: int
    recorded: int
    counted: str = "recording"
    judged: str = ""
    is_simulated: bool | None = None
    is_worn: bool = False
    more: tuple[str, ...] = ()
    parts: int = 0
    held_out: int = 0
    is_digitised: bool = False
    rows: int = 0
    excluded: tuple[str, ...] = ()
    people: int = 0
    wearers: int = 0
    computed: str = ""

    @property
    def sentence(self) -> str:
        """What the answer is based on, in one or more sentences."""
        text = f"{self.used} of {self.recorded}" if self.used != self.recorded else f"{self.recorded}"
        text += f" {_plural(self.counted, self.recorded)}{f' in {self.parts} parts' if self.parts else ''}"
        text += f" of {self.people} {'person' if self.people == 1 else 'people'}" if self.people else ""
        text += f" × {self.wearers} people" if self.wearers else ""
        unstated = "measured or simulated (not stated)" if self.counted in RECORDED_UNITS else ""
        origins = {True: "simulated", False: "measured", None: unstated}
        origin = DIGITISED if self.is_digitised else origins[self.is_simulated]
        rows = f"{self.rows:,} {_plural('row', self.rows)}" if self.rows else ""
        origin += f" ({self.computed})" if origin and self.computed else ""
        words = [text, rows, *self.excluded, origin, f"of {WORN_TOGETHER}" if self.is_worn else ""]
        whole, noun = (self.parts, "part") if self.parts else (self.used, self.counted)
        judged = f"held-out data: {self.held_out} of {whole} {_plural(noun, whole)}" if self.held_out else self.judged
        based_on = f"Based on {', '.join(filter(None, words))}{f'; numbers are of {judged}' if judged else ''}."
        return " ".join((based_on, *self.more))


def excluded_words(repeats: int, defects: int, gaps: Sequence[float]) -> tuple[str, ...]:
    """Return in words what reading excludes: rows that repeat, rows with defects, and gaps, with their lengths [s]."""
    longest = max(gaps, default=math.nan)
    length = f" of {'up to ' * (len(gaps) > 1)}{longest:.3g} s" if math.isfinite(longest) else ""
    return (
        *([f"{repeats:,} repeated {_plural('row', repeats)} excluded"] if repeats else []),
        *([f"{defects:,} {_plural('row', defects)} with defects cut"] if defects else []),
        *([f"{len(gaps)} {_plural('gap', len(gaps))}{length} cut"] if gaps else []),
    )


def _plural(noun: str, count: int) -> str:
    return noun if count == 1 else f"{noun}s"


@dataclass(frozen=True)
class Assumption:
    """Something that a study takes for true although no file states it.

    Attributes
    ----------
    subject : str
        Key of the question, or what the line of study.toml states.
    taken : str
        Value that is taken.
    why : str
        The question, or the reason of a guess.
    is_question : bool
        Whether an answer to a question replaces it; otherwise it is a guess of which the files give evidence.
    is_scale : bool
        Whether every number depends on it: with another answer each would be another one.
    """

    subject: str
    taken: str
    why: str = ""
    is_question: bool = True
    is_scale: bool = False

    @property
    def words(self) -> str:
        """Its subject in plain words."""
        return QUESTION_WORDS.get(self.subject, self.subject)

    @property
    def sentence(self) -> str:
        """The assumption with its reason."""
        return f"{self.subject}: {self.taken}" + (f". {capitalised(self.why)}" if self.why else "")


@dataclass(frozen=True)
class Step:
    """What to do next: a sentence, and the command if there is one.

    Attributes
    ----------
    text : str
        What to do, without a full stop; `FOLDER` in it stands for the study's folder.
    name : str
        Name of the command on the study's folder, such as ``"export"``; "" without one.
    options : tuple of str
        Its options.
    folder : str
        The study's folder as it was given.
    line : str
        A whole command line, where it is not one on the study's folder.
    """

    text: str
    name: str = ""
    options: tuple[str, ...] = ()
    folder: str = ""
    line: str = ""

    @property
    def command(self) -> str:
        """Command as a shell takes it; "" if there is none."""
        return self.line or (printed_command(self.name, self.folder, *self.options) if self.name else "")

    @property
    def words(self) -> str:
        """What to do, with the study's folder in the words."""
        return self.text.replace(FOLDER, printed_path(self.folder))

    @property
    def sentence(self) -> str:
        """The step in a sentence, with its command between backticks."""
        if self.command:
            return f"{self.words}: `{self.command}`."
        is_ended = self.words.endswith("?") or re.search(r"`pellucid [^`]+`$", self.words)
        return self.words if is_ended else f"{self.words.rstrip('.')}."


REPEAT_TEXT = "Then repeat the analysis"
"""Words of the last step after a no or "cannot say" whose other steps have no command."""

PAPER_STEP = Step("Write figures, tables and methods for a paper", "paper")
"""What to do next with good figures that nothing else is made from."""


@dataclass(frozen=True)
class Answer:
    """The answer of a result.

    Attributes
    ----------
    question : str
        The question that the command asks.
    verdict : str
        "yes", "no" or "cannot say".
    said : str
        The answer in a sentence, with its numbers; a page marks them with their ids.
    reason : str
        Why it is no, or cannot be said; "" for yes.
    parts : tuple of AnswerPart
        Verdicts on single joints, conditions, muscles or claims; empty where there is one alone.
    numbers : tuple of AnswerNumber
        Numbers that the verdict rests on.
    basis : Basis, optional
        What it is based on.
    assumed : tuple of Assumption
        Defaults that were taken.
    next : tuple of Step
        What to do next, the first step first.
    is_unconfirmed : bool
        Whether nothing but an unconfirmed default, on which every number depends, keeps it from being yes or no.
    is_relative : bool
        Whether the verdict is the same in any scale of the numbers, as that on a relative error is.
    qualifier : str
        What limits the verdict, such as ``"post hoc"``; it stands on the badge.
    details : tuple of str
        Short lines that follow the sentence.
    """

    question: str
    verdict: AnswerVerdict
    said: str
    reason: str = ""
    parts: tuple[AnswerPart, ...] = ()
    numbers: tuple[AnswerNumber, ...] = ()
    basis: Basis | None = None
    assumed: tuple[Assumption, ...] = ()
    next: tuple[Step, ...] = field(default=())
    is_unconfirmed: bool = False
    is_relative: bool = False
    qualifier: str = ""
    details: tuple[str, ...] = ()

    @property
    def is_answered(self) -> bool:
        """Whether the question was answered, with yes or no."""
        return self.verdict != "cannot say"

    @property
    def badge(self) -> str:
        """Words on the badge."""
        return BADGE_WORDS[self.verdict] + (f" ({self.qualifier})" if self.qualifier else "")

    @property
    def sentence(self) -> str:
        """The answer in a sentence as it is read, without ids."""
        return plain_text(self.said)

    @property
    def whole(self) -> str:
        """Question, verdict and sentence in one line; the sentence has the ids of its numbers."""
        return f"{self.question} {self.badge}. {begun(self.said)}"

    @property
    def based_on(self) -> tuple[str, ...]:
        """What the answer is based on and what was assumed, in sentences."""
        found = () if self.basis is None else (self.basis.sentence,)
        return (*found, *((assumed_sentence(self.assumed),) if self.assumed else ()))

    @property
    def next_command(self) -> str:
        """The first command to run next; "" if there is none."""
        return next((step.command for step in self.next if step.command), "")

    @property
    def following(self) -> tuple[str, ...]:
        """Sentences on what to do next."""
        return tuple(step.sentence for step in self.next)

    def in_folder(self, folder: Path | str) -> Answer:
        """Return the answer whose commands name the study's folder as it was given."""
        return replace(self, next=tuple(replace(step, folder=str(folder)) for step in self.next))

    def table(self) -> dict[str, Any]:
        """Return the answer for JSON."""
        return {
            "question": self.question,
            "verdict": self.verdict,
            "qualifier": self.qualifier,
            "said": begun(self.sentence),
            "details": list(self.details),
            "reason": plain_text(self.reason),
            "parts": [asdict(part) for part in self.parts],
            "numbers": [_number_table(number) for number in self.numbers],
            "based_on": None if self.basis is None else {**asdict(self.basis), "sentence": self.basis.sentence},
            "assumed": [asdict(each) for each in self.assumed],
            "next": [{"text": step.words, "command": step.command} for step in self.next],
        }


def _number_table(number: AnswerNumber) -> dict[str, Any]:
    def finite(x: float) -> float | None:
        return float(x) if math.isfinite(x) else None

    ends = None if number.interval is None else [finite(end) for end in number.interval]
    return {"what": number.what, "value": finite(number.value), "unit": number.unit, "interval": ends, "id": number.id}


def assumed_sentence(assumed: Sequence[Assumption]) -> str:
    """Return the defaults that were taken, in a sentence; those that scale every number first."""
    ordered = sorted(assumed, key=lambda each: not each.is_scale)
    named = ", ".join(f"{each.words} = {each.taken}" for each in ordered[:MAX_NAMED_ASSUMPTIONS])
    more = len(ordered) - MAX_NAMED_ASSUMPTIONS
    return f"Assumed, because no file states it: {named}{f' and {more} more' if more > 0 else ''}."


def reason_of_parts(parts: Sequence[AnswerPart], verdict: AnswerVerdict | None = None) -> str:
    """Return why the verdict is no, or cannot say: the reasons of the parts that say the same; "" for yes.

    The `verdict` is `verdict_of_parts` unless another one is given. Where many parts share a few reasons, each reason
    stands once with their number, the most frequent first.
    """
    verdict = verdict_of_parts(parts) if verdict is None else verdict
    same = [part for part in parts if part.verdict == verdict != "yes"]
    causes = Counter(part.reason.rstrip(".") for part in same)
    if len(causes) <= MAX_NAMED_REASONS < len(same):
        return "; ".join(f"{cause} ({count})" for cause, count in causes.most_common())
    own = [f"{part.name}: {part.reason.rstrip('.')}" for part in same]
    more = len(own) - MAX_NAMED_REASONS
    return "; ".join(own[:MAX_NAMED_REASONS]) + (f"; and {more} more" if more > 0 else "")


def verdict_of_parts(parts: Iterable[AnswerPart]) -> AnswerVerdict:
    """Return the answer to whether something holds of each part: no if one says no, yes if all say yes."""
    said = {part.verdict for part in parts}
    return "no" if "no" in said else "yes" if said == {"yes"} else "cannot say"


def needed_of_parts(parts: Sequence[AnswerPart]) -> str:
    """Return how many parts a yes needs, to follow how many are sound; "" where all are."""
    return "" if verdict_of_parts(parts) == "yes" else f"; yes needs all {len(parts)}"


def answer_of_parts(
    question: str,
    said: str,
    parts: Sequence[AnswerPart],
    numbers: Iterable[AnswerNumber] = (),
    basis: Basis | None = None,
    *,
    improve: Sequence[Step],
    next: Sequence[Step] = (PAPER_STEP,),
    without_parts: str = "",
    is_relative: bool = False,
) -> Answer:
    """Return the answer that its parts give together, with their reasons; `without_parts` is the reason if none are.

    `next` are the steps after yes. `improve` are those after no or "cannot say": what to record or to correct.
    """
    verdict = verdict_of_parts(parts)
    return Answer(
        question, verdict, said, reason_of_parts(parts) if parts else without_parts, tuple(parts), tuple(numbers),
        basis, next=tuple(next if verdict == "yes" else improve), is_relative=is_relative,
    )  # fmt: skip


def answer_of_findings(headline: str, findings: Iterable[tuple[str, str]], question: str = USE_QUESTION) -> Answer:
    """Return the answer that findings give, of a kind each, the worst first: a warning is enough for "cannot say"."""
    doubts = [text for kind, text in findings if kind in ("wrong", "warning")]
    reason = doubts[0] if doubts else ""
    return Answer(question, "cannot say" if doubts else "yes", headline, reason)


def spoilt(answer: Answer, flaw: str) -> Answer:
    """Return the answer "cannot say", because a finding shows that the results are wrong."""
    text = f"Correct this first: {flaw.rstrip('.')}. Until then, the results do not describe the recordings. "
    return replace(answer, verdict="cannot say", reason=flaw, said=text + begun(answer.said))


def with_assumed(answer: Answer, assumed: Sequence[Assumption]) -> Answer:
    """Return an answer with the defaults that were taken.

    Where one scales every number, nobody can say yes or no, except to a question on relative numbers.
    """
    scales = [each for each in assumed if each.is_scale]
    answer = replace(answer, assumed=tuple(assumed))
    if not scales or not answer.is_answered:
        return answer
    named = ", ".join(f"{each.words} = {each.taken}" for each in scales)
    if answer.is_relative:
        said = f"{answer.said.rstrip('.')}; no file states the scale of the parameters; assumed: {named}"
        limits = filter(None, (answer.qualifier, UNCONFIRMED_SCALE))
        return replace(answer, said=said, qualifier=", ".join(limits))
    reason = f"no file states the scale of these figures, and a default is assumed: {named}"
    said = f"No file states the scale of these figures; assumed: {named}. {begun(answer.said)}"
    return replace(answer, verdict="cannot say", reason=reason, said=said, is_unconfirmed=True)


def answer_lines(answer: Answer) -> tuple[str, ...]:
    """Return an answer in lines of text: question, verdict with its sentence, details, basis and assumptions."""
    said = f"{answer.badge}. {typeset_quantities(begun(answer.sentence))}"
    return (answer.question, said, *answer.details, *answer.based_on)


def next_lines(steps: Iterable[Step]) -> tuple[str, ...]:
    """Return steps in lines of text, up to the first command."""
    lines = []
    for step in steps:
        lines.append(f"Next: {step.command or step.sentence.replace('`', '')}")
        if step.command:
            break
    return tuple(lines)


def begun(text: str) -> str:
    """Return a text as a sentence: a capital first letter, unless it begins with a name, and a full stop."""
    text = " ".join(text.split())
    first = text.split(" ", 1)[0]
    text = text if re.search(r"[\d'_:]", first) else capitalised(text)
    return text if text.endswith((".", "!", "?")) or not text else f"{text}."


def unanswered_message(answers: Iterable[Answer]) -> str:
    """Return why questions could not be answered, for a command that then ends with status 1; "" if all were.

    A default that nobody confirmed is for the user to confirm: the recordings themselves answered.
    """
    open_ones = [answer for answer in answers if not answer.is_answered and not answer.is_unconfirmed]
    return " ".join(f"cannot say: {plain_text(each.reason).rstrip('.') or each.question}." for each in open_ones)
