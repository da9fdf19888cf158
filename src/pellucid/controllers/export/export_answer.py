"""The answer of `export`: is it written, and what does a controller's supervisor protect from?"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ...study.answer import Answer, AnswerNumber, Basis, with_assumed
from ...study.exporter import ExportRequest, find_exporter
from ...study.kept import hold_lock
from ...study.procedures.complete_answer import assumptions_of, with_study
from ...study.results import read_answers, read_rows, replace_rows
from ...study.study import Study
from .c_folder import read_owner
from .fmu import read_unit_owner
from .microcontroller import COMMAND_NAME, OnCortexM4

MODEL_COMMAND = "identify"
"""Command whose answer says whether an exported model describes the machine."""


def export_answer(
    study: Study, to: str, place: Path, *, card: str | None = None, measured: OnCortexM4 | None = None
) -> Answer:
    """Return the answer of an export that was written to `place`, with what was `measured` on a Cortex-M4F."""
    request = ExportRequest(study, to, card=card)
    answer = find_exporter(request).make_answer(request, place)
    answer = replace(answer, said=f"{answer.said.rstrip('.')}.{_doubt(study)}")
    owner = (read_owner(place) if place.is_dir() else read_unit_owner(place)) or {}
    cards = [name for name in owner.get("cards", "").split(", ") if name]
    if cards:
        answer = replace(answer, basis=Basis(len(cards), len(cards), "model card"))
    answer = with_assumed(answer, assumptions_of(study))
    if measured is not None:
        head = f"{study.name}.export.m4"
        numbers = (
            AnswerNumber("instructions of a step", measured.instructions, "1", id=f"{head}.instructions_per_step"),
            AnswerNumber("code and constants", measured.bytes, "B", id=f"{head}.bytes"),
        )
        answer = replace(answer, numbers=(*answer.numbers, *numbers))
    if measured is not None and measured.wrong:
        reason = f"{measured.wrong} of {measured.steps} steps on a Cortex-M4F differ from this machine's"
        answer = replace(answer, verdict="no", reason=reason, said=f"{reason}. {answer.said}")
    return with_study(study, answer)


def _doubt(study: Study) -> str:
    """Return in a sentence that the exported model is in doubt by the answer that it was identified with; "" if not."""
    told = read_answers(study.results_path) if study.results_path.is_file() else []
    # What nobody confirmed is said as an assumption of the export.
    unconfirmed = [each for each in told if any(one.get("is_scale") for one in each.get("assumed", ()))]
    identified = [each for each in told if each.get("command") == MODEL_COMMAND and each not in unconfirmed]
    doubted = [each for each in identified if each.get("verdict") != "yes"]
    reasons = "; ".join(str(each.get("reason", "")).rstrip(".") for each in doubted)
    return f" The model is in doubt: {reasons}." if reasons else ""


def save_answer(study: Study, to: str, answer: Answer) -> None:
    """Write the answer of an export to results.json; it replaces that of an earlier export to the same."""
    path = study.results_path
    with hold_lock(path):
        known = path.exists()
        rows = [row for row in read_rows(path) if row.command == COMMAND_NAME] if known else []
        others = [each for each in read_answers(path) if each.get("command") == COMMAND_NAME] if known else []
        kept = [each for each in others if each.get("procedure") != to]
        replace_rows(path, COMMAND_NAME, rows, [*kept, {"procedure": to, **answer.table()}])
