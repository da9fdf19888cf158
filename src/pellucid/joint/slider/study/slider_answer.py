"""The answer to whether one coherent body predicts a joint with a carriage as well as two sets of parameters."""

from __future__ import annotations

from ....study.answer import Answer, AnswerNumber, Basis, Step
from ....study.pages.quantities import MINUS_SIGN, number
from ....study.pages.values import Value
from ....study.procedures.findings import MAX_BODY_ERROR_RATIO
from ..slider_fit import SliderFit

EXPORT_STEP = Step(
    "Export a controller, because one body describes the joint", "export", ("--controller", "transparent")
)
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
    more = f"{abs(100.0 * (ratio - 1.0)):.1f} % {'larger' if ratio >= 1.0 else 'smaller'}"
    said = (
        f"The current error of one rigid body with load-dependent friction is {more}{_range_text(fit)} than with "
        f"separate parameters in each direction: {body} A against {sets} A, over {trials} {use} trials; one set of "
        f"parameters has {one} A."
    )
    reason = "no trial was held out" if not is_held else ""
    if is_held and not holds:
        reason = f"the body's error is {more}, and at most {percent:.3g} % is allowed"
    recordings = len(fit.motions)
    return Answer(
        "Does one rigid body predict the current as well as separate parameters for each direction, with an error at "
        f"most {percent:.3g} % larger?",
        "cannot say" if not is_held else "yes" if holds else "no",
        said,
        reason,
        numbers=(
            AnswerNumber("error of one body against each direction", 100.0 * (ratio - 1.0), "%"),
            *(AnswerNumber(f"error of the current, {method}", value.number, "A", id=value.id)
              for method, value in (("one body", body), ("each direction", sets), ("one set", one))),
        ),
        basis=Basis(recordings, recordings, judged=f"{trials} {use} trials"),
        next=(HOLD_OUT_STEP if not is_held else EXPORT_STEP if holds else BODY_STEP,),
    )


def _range_text(fit: SliderFit) -> str:
    """Return the smallest and the largest difference of both errors in a trial, in brackets; "" of a single trial."""
    body, sets = ({e.recording: e.current for e in fit.evaluated(method)} for method in ("load", "dissociated"))
    more = [100.0 * (body[name] / sets[name] - 1.0) for name in body if name in sets]
    return f" ({min(more):+.1f} to {max(more):+.1f} % by trial)".replace("-", MINUS_SIGN) if len(more) > 1 else ""


def error_value(fit: SliderFit, method: str) -> Value:
    """Return the mean absolute current error of a method over its test trials [A], as all reports show it."""
    error = float(fit.evaluated_error(method))
    return Value(f"{fit.study}.{method}.error", error, number(error, digits=3))


def evaluated_use(fit: SliderFit) -> str:
    """Return which trials tell the errors, in a word."""
    return "held-out" if fit.evaluated_split == "heldout" else "fitted"
