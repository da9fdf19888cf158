"""What was found of a spring on the bench: the fit, and every recording with its prediction."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...study.answer import Answer, AnswerNumber, Basis, Step
from ...study.pages.quantities import percent
from ...study.procedures.findings import MAX_GOOD_ERROR
from ...study.procedures.result import Result
from ..fit.replay import relative_error
from ..fit.spring_fit import SpringFit


@dataclass(frozen=True)
class SpringTrace:
    """One recording's rows, in their order."""

    recording: str
    split: str  # "fitted" or "heldout"
    deflection: np.ndarray = field(repr=False)  # (m,) [rad or m]
    effort: np.ndarray = field(repr=False)  # (m,) in the effort's unit
    predicted: np.ndarray = field(repr=False)  # (m,) in the effort's unit

    @property
    def error(self) -> float:
        """Error of the predicted effort [%]."""
        return relative_error(self.effort, self.predicted)


DEFLECTION_STEP = Step(
    "Deflect the spring slowly in both directions over the whole range: friction or a second spring shows as a "
    "difference between the directions"
)
"""Next step with a spring that does not explain the effort."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SpringResult(Result):
    """A spring on the bench, from the deflections and efforts of its driven end."""

    fit: SpringFit
    traces: tuple[SpringTrace, ...] = ()  # what is held out last

    def make_answer(self) -> Answer:
        """Return whether a spring explains the effort: of held-out recordings, where there are any."""
        held = [trace for trace in self.traces if trace.split == "heldout"]
        judged = f"{len(held)} held-out recording{'' if len(held) == 1 else 's'}" if held else "what was fitted"
        error = max((trace.error for trace in held), default=float(self.fit.effort_error))
        good, stiffness = error <= MAX_GOOD_ERROR, self.fit.parameters[0]
        stated = f"{stiffness.value:.4g} {stiffness.unit}"
        use = f'State it where the robot has it behind its motor: `[rig.instruments] spring_stiffness = "{stated}"`'
        count = len(self.checksums)
        return Answer(
            "Does one spring explain the effort?",
            "yes" if good else "no",
            f"{self.headline}; the error on {judged} is {percent(error)} % of the effort"
            + (" in the worst one" if len(held) > 1 else ""),
            "" if good else f"the error on {judged} is {percent(error)} %, more than {MAX_GOOD_ERROR:g} %",
            numbers=(
                AnswerNumber("stiffness", stiffness.value, stiffness.unit, stiffness.interval(self.confidence)),
                AnswerNumber(f"error of the effort on {judged}", error, "%"),
            ),
            basis=Basis(count, count, judged=judged, held_out=len(held)),
            next=(Step(use) if good else DEFLECTION_STEP,),
            is_relative=True,
        )
