"""A tried log in lines of text, and as a table for programs."""

from __future__ import annotations

from typing import Any

from ..study.answer import answer_lines
from ..study.results import finite_row, row_table
from .study_text import channel_name
from .tried_log import TriedLog
from .try_page import column_roles, parameter_rows


def tried_lines(tried: TriedLog) -> tuple[list[str], tuple[tuple[str, ...], list[tuple[str, ...]]], list[str]]:
    """Return the answer and what was understood in lines, heads and rows of the parameters, and lines on what was
    assumed."""
    proposal = tried.proposal
    kind = "force" if (proposal.motion, proposal.drive) == ("prismatic", "torque") else proposal.drive
    drive = f", driven by {kind}" if kind else ""
    before = [
        *answer_lines(tried.answer),
        f"{tried.study.name}: {proposal.motion} motion{drive}; {proposal.summary}.",
        *(f"  {line}" for layout in proposal.layouts for line in column_roles(layout, "->")),
        *([tried.robot_advice.replace("`", "")] if tried.robot_advice else []),
    ]
    assumed = [f"assumed {assumption.sentence}" for assumption in tried.assumptions]
    return before, parameter_rows(tried), assumed


def try_table(tried: TriedLog) -> dict[str, Any]:
    """Return a tried log for JSON: columns, assumptions, held-out errors, figures and the next command."""
    return {
        "study": tried.study.name,
        "columns": [
            {"column": role.column, "role": channel_name(role), "unit": role.unit, "certain": not role.is_guess}
            for layout in tried.proposal.layouts
            for role in layout.channels
        ],
        "assumed": [
            {"subject": a.subject, "taken": a.taken, "why": a.why, "question": a.is_question} for a in tried.assumptions
        ],
        "held_out": [
            {"joint": joint.name, "error": held.error, "constant_error": held.constant_error, "unit": "%"}
            for joint in tried.joints
            if (held := joint.held_out) is not None
        ],
        "answer": tried.answer.verdict,
        "reason": tried.answer.reason,
        "answers": [{"command": tried.result.command, **tried.answer.table()}],
        "figures": [row_table(finite_row(row)) for row in tried.result.rows],
        "page": str(tried.page),
        "folder": str(tried.study.folder),
        "next": tried.next_command,
    }
