"""What was understood of a tried log, and what was identified from it."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from pathlib import Path

from ..models.estimates import Parameter, Verdict, rank_verdicts
from ..study.answer import REPEAT_TEXT, REPORT_COMMAND, Answer, Assumption, Step
from ..study.procedures.findings import ROBOT_ADVICE
from ..study.procedures.result import HeldOutEffort, Result
from ..study.study import Study
from .proposal import NO_ANSWERS, Proposal
from .propose_study import scale_reading


@dataclass(frozen=True)
class TriedJoint:
    """What was found of one joint."""

    name: str
    parameters: tuple[Parameter, ...]
    held_out: HeldOutEffort | None  # None if no recording was held out, or the joint did not move in one


@dataclass(frozen=True, eq=False)
class TriedLog:
    """What was understood of a log, and what was identified from it.

    Attributes
    ----------
    folder : Path
        Folder of the page and the study.
    page : Path
        Page with the answer.
    proposal : Proposal
        Roles of all columns, questions and answers.
    study : Study
        The study that was made.
    result : Result
        What its command found.
    joints : tuple of TriedJoint
        Parameters and held-out efforts by joint; empty where the command does not identify joints.
    assumptions : tuple of Assumption
        Defaults and guesses on which the result depends.
    next_command : str
        Command that makes a study of the same files in a folder of the user's.
    again_command : str
        Command that tries the same files again.
    robot_command : str
        Command that tries the same files with the robot's URDF; "" unless several joints were identified one by one.
    """

    folder: Path
    page: Path
    proposal: Proposal
    study: Study
    result: Result
    joints: tuple[TriedJoint, ...]
    assumptions: tuple[Assumption, ...]
    next_command: str
    again_command: str
    robot_command: str = ""

    @property
    def robot_advice(self) -> str:
        """Sentence that says how to get a model of all joints together; "" where nothing is to be gained."""
        if not self.robot_command:
            return ""
        return (
            "Each joint was identified separately, as if the others did not move. Pass the robot's URDF to identify "
            f"one model of all joints: `{self.robot_command}`."
        )

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts on the result, the worst first."""
        return rank_verdicts(self.result.verdicts)

    @property
    def answer(self) -> Answer:
        """The result's answer; its next steps confirm a scale or correct a cause, and make a study of these files."""
        found = self.result.answer
        steps = [Step("Make a study of these files", line=self.next_command)]
        taken = [a for a in self.assumptions if a.is_scale]
        unneeded = (REPEAT_TEXT, ROBOT_ADVICE if self.robot_command else "")
        advice = [step for step in found.next if step.name != REPORT_COMMAND and step.text not in unneeded]
        if found.verdict == "yes":
            steps = [*(step for step in advice if not step.command), *steps]
        elif not taken:
            again = [Step("Then try the files again", line=self.again_command)] if advice else []
            steps = [*advice, *again, *steps]
        if taken:
            shown = {a.subject: a.taken if a.taken not in NO_ANSWERS else "..." for a in taken}
            command = self.again_command + "".join(
                f" --answer {shlex.quote(f'{key}={value}')}" for key, value in shown.items()
            )
            read_as = scale_reading(self.proposal) if "effort" in shown else ""
            named = ", ".join(a.words for a in taken)
            steps.insert(0, Step(f"Confirm or correct the scale ({named}){read_as}: `{command}`"))
        if self.robot_command:
            steps.append(Step("Or identify one model of all joints, with the robot's URDF", line=self.robot_command))
        return replace(found, next=tuple(steps))
