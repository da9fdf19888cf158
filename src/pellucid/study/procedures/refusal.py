"""The answer of a command whose recordings `check` refuses: files and page are written, and say why."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from ..._errors import PellucidError, UnfitRecordingError
from ...models.estimates import Verdict
from ..answer import Answer
from ..kept import hold_lock
from ..pages.page import write_page
from ..results import replace_rows
from ..study import Study
from .check_answer import CORRECT_RECORDINGS_STEP
from .complete_answer import count_recordings, with_study
from .procedure import typed_command
from .study_page import study_page


def write_refusal(study: Study, command: str, error: UnfitRecordingError) -> tuple[Answer, Path | None]:
    """Write the answer "cannot say" of a command to results.json and as the page of the report.

    Return it with the page, which is None where nothing can be written.

    The command's earlier rows are removed: they are not of the recordings as they are now.
    """
    first, *others = str(error).splitlines()
    more = f" (and {len(others)} further fault{'' if len(others) == 1 else 's'})" if others else ""
    reason = f"the recordings are not fit to be used: {first.rstrip('.')}{more}"
    question = f"What does {typed_command(command)} find in these recordings?"
    basis = count_recordings(study, ())
    answer = Answer(question, "cannot say", reason, reason, basis=basis, next=(CORRECT_RECORDINGS_STEP,))
    answer = with_study(study, answer)
    page = study_page(study.name, answer, (), (), [Verdict("wrong", text) for text in others])
    # The command ends with the reason in any case, also where nothing can be written.
    with suppress(OSError, PellucidError):
        with hold_lock(study.results_path):
            replace_rows(study.results_path, command, (), [{"procedure": command, **answer.table()}])
        return answer, write_page(study.report_dir, page)
    return answer, None
