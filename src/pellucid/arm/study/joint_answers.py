"""Whether the model of a robot predicts the effort of each joint: yes, no or cannot say, with the reason."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...study.answer import AnswerPart, needed_of_parts
from ...study.pages.quantities import percent
from ...study.procedures.findings import MAX_GOOD_ERROR

MIN_MOVING_SHARE = 0.2
"""Smallest share of the fitted rows in which a joint should move."""


def answer_joints(
    names: Sequence[str], errors: Sequence[float] | None, where: str, moving: Sequence[float], wrong: Sequence[str] = ()
) -> tuple[AnswerPart, ...]:
    """Return the verdict on each joint.

    `errors`, (m,), are those on data that were not fitted [%], with NaN where a joint rests; None if nothing was left
    out. `where` names these data. `moving`, (m,), is the share of fitted rows in which a joint moves. `wrong` are
    findings after which no joint's numbers are to be used.
    """
    made = []
    for k, name in enumerate(names):
        error = float("nan") if errors is None else float(errors[k])
        text = f"effort error {percent(error)} % on {where}"
        if wrong:
            made.append(AnswerPart(name, "cannot say", f"first correct: {', '.join(wrong)}"))
        elif errors is None:
            made.append(AnswerPart(name, "cannot say", "no recording was held out"))
        elif not np.isfinite(error):
            made.append(AnswerPart(name, "cannot say", f"the joint does not move on {where}"))
        elif error > MAX_GOOD_ERROR:
            made.append(AnswerPart(name, "no", f"{text}, more than {MAX_GOOD_ERROR:g} %"))
        elif moving[k] < MIN_MOVING_SHARE:
            share = f"the joint moves in only {percent(100.0 * moving[k])} % of the fitted rows"
            made.append(AnswerPart(name, "cannot say", share))
        else:
            made.append(AnswerPart(name, "yes", text))
    return tuple(made)


def answers_in_words(answers: Sequence[AnswerPart]) -> str:
    """Return the verdicts in a sentence; joints that are not predicted have their reason."""
    good = [each.name for each in answers if each.verdict == "yes"]
    text = f"The model predicts {len(good)} of {len(answers)} joints within {MAX_GOOD_ERROR:g} % of their effort"
    text += needed_of_parts(answers)
    others = [f"{each.name}: {each}" for each in answers if each.verdict != "yes"]
    return f"{text}; {'; '.join(others)}" if others else text
