"""Complete the answer of a result from its study: basis, assumptions and recommended next steps."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from ..answer import REPORT_COMMAND, WORN_TOGETHER, Answer, Assumption, Basis, Step, spoilt, with_assumed
from ..study import Study
from .procedure import typed_command
from .registry import asked
from .result import Result

REPORT_STEP = Step("Draw the page", REPORT_COMMAND)
"""Step after every result: nothing was drawn yet."""


def complete_answer(study: Study, found: Result, left_out: Collection[str] = ()) -> Answer:
    """Return the answer of a result with what the study adds to it.

    `left_out` are the recordings that were not fit to be used. A finding that the figures are wrong, and a default on
    which all of them depend, leave nothing to be answered.
    """
    answer = found.make_answer()
    if found.flaw:
        answer = spoilt(answer, found.flaw)
    answer = with_assumed(answer, assumptions_of(study))
    answer = replace(answer, basis=_counted(study, found, answer.basis, left_out))
    if study.config.worn and not answer.qualifier:
        answer = replace(answer, qualifier=WORN_TOGETHER)
    return with_study(study, replace(answer, next=_steps(study, found, answer)))


def with_study(study: Study, answer: Answer) -> Answer:
    """Return an answer with what its study states: the origin of its basis, unconfirmed defaults, and the folder."""
    config, basis = study.config, answer.basis
    if basis is not None:
        basis = replace(basis, is_simulated=config.simulated, is_worn=config.worn)
    return replace(answer, basis=basis, assumed=assumptions_of(study)).in_folder(study.folder)


def assumptions_of(study: Study) -> tuple[Assumption, ...]:
    """Return the defaults of a study that nobody confirmed."""
    return tuple(Assumption(each.key, each.taken, each.question, True, each.scale) for each in study.config.assumed)


def _counted(study: Study, found: Result, basis: Basis | None, left_out: Collection[str]) -> Basis:
    """Return what an answer is based on, with all recordings of the study counted; participants stay as they are."""
    if basis is not None and basis.counted != "recording":
        return basis
    recordings = study.recordings()
    # A piece of a recording is named after it.
    known = {name for whole in found.checksums for name in (whole, whole.rpartition(".")[0])}
    used = [r for r in recordings if r.name in known] or [r for r in recordings if r.name not in left_out]
    if basis is not None:
        return replace(basis, used=len(used) - (basis.recorded - basis.used), recorded=len(recordings))
    held = sum(recording.use == "validate" for recording in used)
    judged = "" if not held else "one held-out recording" if held == 1 else f"{held} held-out recordings"
    return Basis(len(used), len(recordings), judged=judged)


def _steps(study: Study, found: Result, answer: Answer) -> tuple[Step, ...]:
    """Return what to do next: correct what is wrong or assumed, run what else the study asks for, draw the page."""
    if found.flaw:
        return (Step("Correct the first finding below, then check the recordings", "check"),)
    steps = list(answer.next)
    if any(each.is_scale for each in answer.assumed):
        text = "Confirm the assumption: correct the line in study.toml, and remove its [[assumed]] table"
        steps = [Step(f"{text}; then", "check")]
    commands = [procedure.command for procedure in asked(study)]
    # A plug-in's procedure may stand beside those that the study asks for.
    after = commands[commands.index(found.command) + 1 :] if found.command in commands else []
    later = [each for each in after if each != found.command]
    further = [Step("Run the other analyses of study.toml", typed_command(later[0]))] if later else []
    return (*further, REPORT_STEP, *steps) if answer.is_answered else (*steps, *further, REPORT_STEP)
