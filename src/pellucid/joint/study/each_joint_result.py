"""Result of `identify` for several joints, each on its own: a table of all, then what was found of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ...models.estimates import Parameter, Verdict
from ...study.answer import Answer, AnswerNumber, AnswerPart, Basis, Step, answer_of_parts, needed_of_parts
from ...study.pages.quantities import percent, unit_text, value_and_half_interval
from ...study.procedures.findings import MAX_GOOD_ERROR, MAX_IMPROVING_STEPS
from ...study.procedures.result import FigureTable, HeldOutEffort, Result
from ...study.study import Study
from .joint_answer import interval_words
from .joint_coupling import ROBOT_STEP
from .joint_result import JointResult
from .joint_views import joint_views

MAX_PARAMETER_COLUMNS = 6
"""The table of joints has at most so many parameters; those that most joints have are shown."""


@dataclass(frozen=True, kw_only=True, repr=False)
class EachJointResult(Result):
    """Result of `identify` for several joints, each identified on its own."""

    joints: Mapping[str, Result] = field(repr=False)  # what was found of each joint that was identified
    resting: Mapping[str, str] = field(default_factory=dict)  # joints that show nothing, and what was found of them
    left_out: Mapping[str, str] = field(default_factory=dict)  # joints that were not identified, and why

    @property
    def estimates(self) -> Mapping[str, Parameter]:
        """Parameters by joint and name, such as ``"hip.inertia"``."""
        return {f"{joint}.{name}": p for joint, found in self.joints.items() for name, p in found.estimates.items()}

    @property
    def held_out(self) -> tuple[HeldOutEffort, ...]:
        """Efforts of joints on held-out recordings, measured and predicted."""
        return tuple(replace(held, joint=joint) for joint, found in self.joints.items() for held in found.held_out)

    @property
    def prose(self) -> str:
        """Sentences of all joints for a paper."""
        return "\n\n".join(found.prose for found in self.joints.values() if found.prose)

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return each_joint_answer(self)

    def for_page(self) -> EachJointResult:
        return replace(self, joints={joint: found.for_page() for joint, found in self.joints.items()})


def complete_each_joint(
    study: Study,
    joints: Mapping[str, Result],
    resting: Mapping[str, str],
    left_out: Mapping[str, str],
    verdicts: tuple[Verdict, ...],
) -> EachJointResult:
    """Return the result of a study whose `joints` were identified."""
    found = EachJointResult(
        study=study.name,
        headline="",
        tables=(
            joint_table(study, joints, resting, left_out),
            *(replace(t, title=f"{joint}: {t.title}") for joint, found in joints.items() for t in found.tables),
        ),
        verdicts=verdicts,
        rows=tuple(row for found in joints.values() for row in found.rows),
        cards={_card_name(name, joint): card for joint, found in joints.items() for name, card in found.cards.items()},
        checksums={name: digest for found in joints.values() for name, digest in found.checksums.items()},
        confidence=study.model.confidence,
        joints=joints,
        resting=resting,
        left_out=left_out,
    )
    return replace(found, headline=found.answer.sentence)


def _card_name(name: str, joint: str) -> str:
    """Return the name of a joint's card: ``joint_hip.load`` for ``joint.load``."""
    kind, dot, rest = name.partition(".")
    return f"{kind}_{joint}{dot}{rest}"


def heldout_text(answer: Answer) -> str:
    """Return the error in the answer of a joint in words; "" if it has none."""
    error = _error_of(answer)
    return f"{percent(error.value)} %" if error else ""


def interval_text(answer: Answer) -> str:
    """Return the confidence interval of the error in the answer of a joint in words; "" if it is not known."""
    error = _error_of(answer)
    return f" ({interval_words(error.interval)})" if error and error.interval else ""


def _error_of(answer: Answer) -> AnswerNumber | None:
    """Return the error [%] in the answer of a joint."""
    return next((number for number in answer.numbers if number.unit == "%"), None)


def headline_parameters(found: Result) -> dict[str, Parameter]:
    """Return the parameters that a joint's result tells first."""
    if isinstance(found, JointResult):
        return {p.name: p for p in found.headlined.estimate.parameters}
    return {name: p for name, p in found.estimates.items() if "." not in name}


def joint_table(
    study: Study, joints: Mapping[str, Result], resting: Mapping[str, str], left_out: Mapping[str, str]
) -> FigureTable:
    """Return the table of all joints: parameters with half their intervals, and the error on held-out recordings."""
    found = {joint: headline_parameters(result) for joint, result in joints.items()}
    counts = Counter(name for own in found.values() for name in own)
    most = {name for name, _ in counts.most_common(MAX_PARAMETER_COLUMNS)}
    names = [name for name in counts if name in most]
    level, rows = study.model.confidence, []
    for joint in joint_views(study):
        own = found.get(joint, {})
        cells = [_cell(own.get(name), level) for name in names]
        if joint in joints:
            state = heldout_text(joints[joint].make_answer())
        else:
            state = "not moved" if joint in resting else "left out"
        rows.append((joint, *cells, state))
    heads = ("joint", *(name.replace("_", " ") for name in names), "held-out error")
    return FigureTable(
        f"Separately identified joints, with half-widths of {100 * level:g} % intervals", heads, tuple(rows)
    )


def _cell(parameter: Parameter | None, level: float) -> str:
    if parameter is None:
        return "–"
    return f"{value_and_half_interval(parameter, level)} {unit_text(parameter.unit)}".rstrip()


def _improving(answers: Mapping[str, Answer]) -> tuple[Step, ...]:
    """Return the first step that improves each joint whose model does not predict, from the answers by joint."""
    return tuple(
        _of_joint(joint, step) for joint, each in answers.items() if each.verdict != "yes" for step in each.next[:1]
    )


def _recording_steps(answers: Mapping[str, Answer]) -> tuple[Step, ...]:
    """Return what to record before the models that predict are used, from the answers by joint.

    A step that all joints share names none of them.
    """
    joints: dict[Step, list[str]] = {}
    for joint, each in answers.items():
        for step in each.next if each.verdict == "yes" else ():
            if not step.command:
                joints.setdefault(step, []).append(joint)
    count = len(answers)
    steps = [step if len(named) == count else _of_joint(", ".join(named), step) for step, named in joints.items()]
    return tuple(steps[:MAX_IMPROVING_STEPS])


def _of_joint(joint: str, step: Step) -> Step:
    return replace(step, text=f"{joint}: {step.text}")


def each_joint_answer(found: EachJointResult) -> Answer:
    """Return whether each joint's own model predicts its effort where it was not fitted."""
    answers = {joint: result.make_answer() for joint, result in found.joints.items()}
    parts = [
        AnswerPart(joint, each.verdict, each.reason or heldout_text(each) + interval_text(each) or each.sentence)
        for joint, each in answers.items()
    ]
    parts += [AnswerPart(joint, "cannot say", f"excluded: {why}") for joint, why in found.left_out.items()]
    good = [f"{joint} {heldout_text(each)}".strip() for joint, each in answers.items() if each.verdict == "yes"]
    count = len(parts) + len(found.resting)
    said = f"{len(good)} of {count} separately identified joints have a prediction error of at most "
    said += f"{MAX_GOOD_ERROR:g} % on data not used in the fit{': ' * bool(good)}{', '.join(good)}"
    said += needed_of_parts(parts)
    said += "".join(f"; {part.name}: {part}" for part in parts if part.verdict != "yes")
    said += f"; not moved: {', '.join(found.resting)}" if found.resting else ""
    bases = [each.basis for each in answers.values() if each.basis is not None]
    judged = dict.fromkeys(basis.judged for basis in bases)
    recordings = len(found.checksums)
    numbers = [
        replace(number, what=f"{joint}: {number.what}") for joint, each in answers.items() for number in each.numbers
    ]
    return answer_of_parts(
        f"Does each joint's model predict the effort of data not used in the fit within {MAX_GOOD_ERROR:g} %?",
        f"{said}.",
        parts,
        numbers,
        Basis(
            recordings,
            recordings,
            judged=" and ".join(filter(None, judged)),
            held_out=max((basis.held_out for basis in bases), default=0),
            computed=", ".join(dict.fromkeys(basis.computed for basis in bases if basis.computed)),
        ),
        improve=(*_improving(answers), ROBOT_STEP),
        next=(*_recording_steps(answers), ROBOT_STEP),
        is_relative=True,
    )
