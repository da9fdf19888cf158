"""The answer to whether one coherent body predicts a joint with a carriage as well as two sets of parameters."""

from __future__ import annotations

import numpy as np

from ....study.answer import Answer, AnswerNumber, Basis, Step
from ....study.pages.quantities import number
from ....study.pages.values import Value
from ....study.procedures.findings import MAX_BODY_ERROR_RATIO
from ..slider_fit import SliderFit

EXPORT_STEP = Step("Export a controller", "export", ("--controller", "transparent"))
"""Next step with one body that predicts."""

HOLD_OUT_STEP = Step('Hold out some trials (write `use = "validate"` in study.toml), then', "check")
"""Next step if no trial is held out."""

BODY_STEP = Step(
    "Record slow and fast trials in both directions at more positions of the carriage: friction that depends on the "
    "direction and not only on the load makes the two models differ"
)
"""Next step with one body that predicts worse than two directions."""


def slider_answer(fit: SliderFit) -> Answer:
    """Return whether one coherent body predicts the current as well as a set of parameters for each direction."""
    ratio = fit.evaluated_error("load") / fit.evaluated_error("dissociated")
    percent = 100.0 * (MAX_BODY_ERROR_RATIO - 1.0)
    is_held, holds = fit.evaluated_split == "heldout", ratio <= MAX_BODY_ERROR_RATIO
    trials, use = len(fit.evaluated("pooled")), evaluated_use(fit)
    body, sets, one = (error_value(fit, m) for m in ("load", "dissociated", "pooled"))
    said = (
        f"Over {trials} {use} trials, the current error is {body} A{_range_text(fit, 'load')} for one rigid body with "
        f"load-dependent friction ({len(fit['load'].values)} parameters), {sets} A for separate parameters in each "
        f"direction ({len(fit['dissociated'].values)} parameters), and {one} A for one set."
    )
    reason = "no trial was held out" if not is_held else ""
    if is_held and not holds:
        reason = f"the body's error is {number(100.0 * (ratio - 1.0), digits=2)} % larger than that of two sets"
    recordings = len(fit.motions)
    return Answer(
        "Does one body with load friction predict the current as well as a set of parameters for each direction, to "
        f"{percent:.3g} %?",
        "cannot say" if not is_held else "yes" if holds else "no",
        said,
        reason,
        numbers=tuple(
            AnswerNumber(f"error of the current, {method}", value.number, "A", id=value.id)
            for method, value in (("one body", body), ("each direction", sets), ("one set", one))
        ),
        basis=Basis(recordings, recordings, judged=f"{trials} {use} trials"),
        next=(HOLD_OUT_STEP if not is_held else EXPORT_STEP if holds else BODY_STEP,),
    )


def _range_text(fit: SliderFit, method: str) -> str:
    """Return the smallest and the largest error of a trial, in brackets [A]; "" of a single trial."""
    errors = [each.current for each in fit.evaluated(method) if np.isfinite(each.current)]
    if len(errors) < 2:
        return ""
    return f" (between {number(min(errors), digits=3)} and {number(max(errors), digits=3)}, by trial)"


def error_value(fit: SliderFit, method: str) -> Value:
    """Return the mean absolute current error of a method over its test trials [A], as all reports show it."""
    error = float(fit.evaluated_error(method))
    return Value(f"{fit.study}.{method}.error", error, number(error, digits=3))


def evaluated_use(fit: SliderFit) -> str:
    """Return which trials tell the errors, in a word."""
    return "held-out" if fit.evaluated_split == "heldout" else "fitted"
