"""Complete the answer of a result from its study: basis, assumptions and recommended next steps."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import islice, takewhile

import numpy as np

from ...files.cut import sound_samples
from ...files.defects import gaps as gap_defect
from ...models.estimates import rank_verdicts
from ..answer import (
    REPEAT_TEXT,
    REPORT_COMMAND,
    WORN_TOGETHER,
    Answer,
    Assumption,
    Basis,
    Step,
    excluded_words,
    spoilt,
    with_assumed,
)
from ..study import Study
from .procedure import typed_command
from .registry import asked
from .result import Result

REPORT_STEP = Step("Draw the page", REPORT_COMMAND)
"""Step after every result: nothing was drawn yet."""

FURTHER_TEXT = "Run the other analyses of study.toml"
"""Words of the step that names an analysis which has no result yet."""


def complete_answer(
    study: Study, found: Result, left_out: Collection[str] = (), beside: Collection[str] = ()
) -> Answer:
    """Return the answer of a result with what the study adds to it.

    `left_out` are the recordings that were not fit to be used. A finding that the figures are wrong, and a default on
    which all of them depend, leave nothing to be answered. `beside` are the names of the procedures of the same run.
    """
    answer = found.make_answer()
    if found.flaw:
        answer = spoilt(answer, found.flaw)
    answer = with_assumed(answer, assumptions_of(study))
    answer = replace(answer, basis=_counted(study, found, answer.basis, left_out))
    if study.config.worn and not answer.qualifier:
        answer = replace(answer, qualifier=WORN_TOGETHER)
    return with_study(study, replace(answer, next=_steps(study, found, answer, beside)))


def with_study(study: Study, answer: Answer) -> Answer:
    """Return an answer with what its study states: the origin of its basis, unconfirmed defaults, and the folder."""
    config, basis = study.config, answer.basis
    if basis is not None:
        basis = replace(basis, is_simulated=config.simulated, is_worn=config.worn, is_digitised=config.digitised)
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
    counted = count_recordings(study, [recording.name for recording in used])
    held = sum(recording.use == "validate" for recording in used)
    if basis is None:
        return replace(counted, held_out=held)
    refused = basis.recorded - basis.used
    held_out = held if basis.held_out else 0
    used_count = counted.used - refused
    return replace(counted, used=used_count, judged=basis.judged, held_out=held_out, computed=basis.computed)


def count_recordings(study: Study, used: Collection[str]) -> Basis:
    """Return how many of a study's recordings are used, by the names of those that are.

    Recordings that are windows of one file are parts of one recording.
    """
    wholes: dict[tuple[object, ...], list[str]] = {}
    windows = {entry.name for entry in study.config.recordings if entry.window is not None}
    recordings = study.recordings()
    for recording in recordings:
        columns = tuple(channel.column for channel in recording.channels.values())
        own = () if recording.name in windows else (recording.name,)
        wholes.setdefault((recording.path, columns, *own), []).append(recording.name)
    parts = sum(map(len, wholes.values()))
    read = [recording for recording in recordings if recording.name in used]
    cuts = [cut for recording in read for cut in recording.cuts]
    defects = sum(int(np.sum(~sound_samples(len(r), r.cuts))) for r in read)
    gaps = [cut.stop - cut.start for cut in cuts if cut.kind == gap_defect.KIND]
    excluded = excluded_words(sum(r.repeats for r in read), defects, gaps)
    return Basis(
        sum(any(name in used for name in names) for names in wholes.values()),
        len(wholes),
        parts=parts if parts > len(wholes) else 0,
        rows=sum(len(r) + r.repeats for r in read) if excluded else 0,
        excluded=excluded,
        people=len({recording.participant for recording in read} - {None}),
    )


def without_further(answer: Answer) -> Answer:
    """Return an answer without the step that names another analysis: a page names those that it lacks itself."""
    return replace(answer, next=tuple(step for step in answer.next if step.text != FURTHER_TEXT))


def _steps(study: Study, found: Result, answer: Answer, beside: Collection[str]) -> tuple[Step, ...]:
    """Return what to do next: correct what is wrong or assumed, run what else the study asks for, draw the page."""
    if found.flaw:
        worst = next(v for v in rank_verdicts(found.verdicts) if v.kind == "wrong")
        advice = worst.do.rstrip(".") or "Correct the first finding below"
        return (Step(f"{advice}; then check the recordings", "check"),)
    steps = list(answer.next)
    further = [Step(FURTHER_TEXT, typed_command(each)) for each in islice(_without_result(study, found, beside), 1)]
    # What to record comes before everything that uses the result.
    first = [*takewhile(lambda step: not step.command, steps)] if answer.verdict == "yes" else steps
    scales = ", ".join(each.subject for each in answer.assumed if each.is_scale)
    if scales:
        text = f"Confirm the assumption ({scales}): correct the line in study.toml, and remove its [[assumed]] table"
        recorded = first if answer.verdict == "yes" else ()
        return (Step(f"{text}; then", "check"), *recorded, *further, REPORT_STEP)
    is_named = any(step.command or "`pellucid " in step.text for step in steps)
    is_open = answer.verdict != "yes" and found.command and not is_named
    repeat = (Step(REPEAT_TEXT, typed_command(found.command)),) if is_open else ()
    return (*first, *further, REPORT_STEP, *steps[len(first) :], *repeat)


def _without_result(study: Study, found: Result, beside: Collection[str]) -> Iterator[str]:
    """Yield the commands that the study asks for and that have no result yet, those after this result's first.

    They are found one by one, because each kept result is read whole.
    """
    procedures = asked(study)
    own = next((i for i, each in enumerate(procedures) if each.command == found.command), None)
    if own is None:  # a plug-in's procedure may stand beside those that the study asks for
        return
    others = [each for each in (*procedures[own:], *procedures[:own]) if each.command != found.command]
    for each in others:
        if each.name not in beside and Result.kept(study, each) is None:
            yield each.command
