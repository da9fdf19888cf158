"""The answer of `check`: may these recordings be used?"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from ..._errors import listed_names
from ..answer import Answer, AnswerVerdict, Step
from .complete_answer import count_recordings, with_study
from .procedure import typed_command
from .registry import asked

if TYPE_CHECKING:
    from ...files.fault import Fault
    from ..study import Study

CORRECT_RECORDINGS_STEP = Step("Correct what is named, or record again; then check the study again")
"""What to do with recordings that are not fit; a command would end with status 1 until that is done."""

MAX_NAMED_CHANNELS = 6
"""Largest number of channels with warnings that the sentence names; the warnings below it name all."""

MAX_NAMED_FAULTS = 3
"""Largest number of faults that the sentence names."""


def check_answer(study: Study, faults: Sequence[Fault]) -> Answer:
    """Return whether the first command that a study asks for can use its recordings, with the faults of a check."""
    procedure = asked(study)[0]
    command = typed_command(procedure.command)
    refused = [fault for fault in faults if fault.severity == "refuse"]
    warned = [fault for fault in faults if fault.severity == "warn"]
    recordings = study.recordings()
    excluded, files = set(procedure.unfit(study)), {fault.file for fault in refused}
    fit = [r.name for r in recordings if r.name not in excluded and r.path.name not in files]
    basis = count_recordings(study, fit)
    used, count = len(fit), len(recordings)
    verdict: AnswerVerdict = "no" if refused else "yes"
    if refused:
        faulty = "1 fault prevents" if len(refused) == 1 else f"{len(refused)} faults prevent"
        causes = _listed((f"{_place(fault)} ({fault.found})" for fault in refused), MAX_NAMED_FAULTS)
        said = reason = f"{faulty} their use: {causes}"
        step = CORRECT_RECORDINGS_STEP
    else:
        whole = f"All {basis.recorded} recordings" if basis.recorded > 1 else "The recording"
        whole = whole if used == count else f"{used} of {count} {'parts' if basis.parts else 'recordings'}"
        places = _listed(map(_place, warned), MAX_NAMED_CHANNELS)
        said = f"{whole} can be used" + (f"; see the warnings on {places}" if warned else "")
        reason, step = "", Step("Use the recordings", command)
    question = f"Are these recordings fit to be used by {command}?"
    return with_study(study, Answer(question, verdict, said, reason, basis=basis, next=(step,)))


def _place(fault: Fault) -> str:
    """Return the channel of a fault with its file."""
    return f"{fault.channel} of {fault.file}" if fault.channel else fault.file


def _listed(texts: Iterable[str], most: int) -> str:
    """Return texts in a row, each once and at most so many."""
    return listed_names([*dict.fromkeys(texts)], most)
