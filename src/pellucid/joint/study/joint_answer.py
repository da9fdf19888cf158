"""The answer to whether the model of a joint predicts its effort where it was not fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from ..._errors import listed_names
from ...models.estimates import Verdict
from ...numerics.uncertainty import relative_error_factor
from ...study.answer import Answer, AnswerNumber, AnswerVerdict, Basis, Step
from ...study.pages.quantities import EFFORT_NAMES, number, percent
from ...study.pages.values import Value
from ...study.procedures.findings import (
    MAX_GOOD_ERROR,
    MAX_IMPROVING_STEPS,
    SECOND_RECORDING_TEXT,
    SOUND_R2,
    improving_steps,
    steps_before_use,
)
from ...study.procedures.result import HeldOutEffort
from ..fit.friction_family import FamilyFit
from ..fit.replay import Prediction, Simulation, r_squared, relative_error


class JudgedJoint(Protocol):
    """Members of a joint's result that its answer rests on."""

    @property
    def study(self) -> str:
        """Name of the study."""

    @property
    def joint(self) -> str:
        """Name of the joint."""

    @property
    def best(self) -> str:
        """Name of the chosen family."""

    @property
    def effort_unit(self) -> str:
        """Unit of the effort."""

    @property
    def computed(self) -> str:
        """What the effort is computed from, in words; "" where it was recorded as such."""

    @property
    def families(self) -> Mapping[str, FamilyFit]:
        """Fits of the families by name."""

    @property
    def headlined(self) -> FamilyFit:
        """Best family with the values of the chosen estimator."""

    @property
    def crossed_error(self) -> tuple[float, float]:
        """Cross-validated error [%] and R² on segments of the fitted recordings; NaN if unknown."""

    @property
    def error_interval(self) -> tuple[float, float] | None:
        """95 % confidence interval of the reported error [%]; None if it is not known."""

    @property
    def held_out(self) -> Sequence[HeldOutEffort]:
        """Effort on held-out recordings; empty without one."""

    @property
    def verdicts(self) -> Sequence[Verdict]:
        """Verdicts on the joint."""

    @property
    def checksums(self) -> Mapping[str, str]:
        """SHA-256 of the recordings."""


NO_MACHINE_FINDINGS = ("missing_inertia", "spring_bench")
"""Findings that the recorded effort does not move the machine, so that a good prediction is no model of it."""

STRETCHES_OUT = "segments of the fitted recordings (cross-validation)"
"""Data of the error if no recording is held out."""

HOLD_OUT_STEP = Step('Hold out some recordings (write `use = "validate"` in study.toml), then', "check")
"""Next step if no recording is held out."""

CONTROLLER_STEP = Step("Export a controller, because the model predicts the joint", "export")
"""Next step with a model that predicts."""

LATER_STEP = Step(
    f"Export a controller once the confidence interval of the error ends at or below {MAX_GOOD_ERROR:g} %", "export"
)
"""Next step with a model that may not predict, by the interval of its error."""

UNCERTAIN = "uncertain"
"""Limit of a yes where the interval of the error includes the bound."""

UNIDENTIFIED_FINDINGS = ("wide_interval", "weak_parameter")
"""Findings that a parameter is not known well enough for a controller."""

JUST_WITHIN_SHARE = 0.1
"""An error is just within its bound if less than this share of the bound is left. Chosen by judgement."""

MAX_NAMED_RECORDINGS = 4
"""Largest number of recordings that a sentence names."""

MIN_RANGE_RATIO = 2.0
"""Recordings differ much if the largest error is at least this many times the smallest. Chosen by judgement."""

PAYLOAD_TEXT = (
    "State the drive's constant, or record with a known payload too: until then, all parameters are per {unit}, and "
    "masses are not known"
)
"""Text of the next step where the drive's constant is unknown."""

RICHER_STEP = Step(
    "Record slow and fast motion in both directions over the range of the held-out recordings, and add friction "
    "families to [model]"
)
"""Next step with a model that does not predict, if no finding says why."""


def joint_answer(fit: JudgedJoint) -> Answer:
    """Return whether the model predicts effort that was not used in the fit, and its error.

    The error is that of held-out recordings. Without any, it is the cross-validated error on segments of the fitted
    recordings.
    """
    error, r2 = headline_error(fit), unfitted_r2(fit)
    effort = EFFORT_NAMES.get(fit.effort_unit, "effort").lower()
    held, judged = _held_out_recordings(fit), judged_words(fit)
    question = f"Does the model predict the {effort} of data not used in the fit within {MAX_GOOD_ERROR:g} %?"
    model = f"The {fit.best} friction model of the {fit.joint}"
    if not judged:
        said = f"No recording was held out. {model} has an error of {error} % of the {effort} in the fitted recordings."
        reason = "no recording was held out"
        return Answer(question, "cannot say", said, reason, basis=_basis(fit, judged), next=(HOLD_OUT_STEP,))
    said = f"{model} predicts the {effort} of {judged} with an error of {error} %"
    interval = fit.error_interval
    sure = ", ".join(filter(None, (interval_words(interval), f"R² {number(r2, digits=3)}" if np.isfinite(r2) else "")))
    bracketed = error_range_text(fit) or (f" ({sure})" if sure else "")
    verdict, reason = _verdict(error.number, r2, judged)
    is_open = verdict == "yes" and interval is not None and interval[1] > MAX_GOOD_ERROR
    near = _margin_text(fit, error.number, is_open=is_open) if verdict == "yes" else ""
    said += f"{bracketed}{near}{_constant_text(fit, effort)}."
    no_machine = next((v.text for v in fit.verdicts if v.finding in NO_MACHINE_FINDINGS and v.kind == "warning"), "")
    if verdict == "yes" and no_machine:
        verdict, reason = "cannot say", no_machine[:1].lower() + no_machine[1:].rstrip(".")
        said = f"The results do not describe the machine alone: {reason}. {said}"
    numbers = [AnswerNumber(f"error of the {effort} on {judged}", error.number, "%", interval, error.id)]
    if np.isfinite(r2):
        numbers.append(AnswerNumber(f"R2 on {judged}", r2, "1"))
    if verdict == "yes":
        steps = (*_recording_steps(fit, is_close=bool(near)), LATER_STEP if is_open else CONTROLLER_STEP)
    else:
        steps = improving_steps(fit.verdicts, RICHER_STEP)
    steps = steps if held else (HOLD_OUT_STEP, *steps)
    return Answer(
        question, verdict, said, reason, numbers=tuple(numbers), basis=_basis(fit, judged),
        next=steps, is_relative=True, qualifier=UNCERTAIN if is_open and verdict == "yes" else "",
    )  # fmt: skip


def _margin_text(fit: JudgedJoint, error: float, *, is_open: bool) -> str:
    """Return that an error [%] is just within the bound, and by how much it exceeds the fitted one; "" otherwise."""
    if error <= (1.0 - JUST_WITHIN_SHARE) * MAX_GOOD_ERROR and not is_open:
        return ""
    fitted = float(fit.headlined.fitted_effort_error)
    beside = f"; on the fitted data {percent(fitted)} %" if np.isfinite(fitted) else ""
    return f", just within {MAX_GOOD_ERROR:g} %{' and uncertain' * is_open}{beside}"


def _recording_steps(fit: JudgedJoint, *, is_close: bool) -> tuple[Step, ...]:
    """Return what to record before a model that predicts is used."""
    groups = _held_out_recordings(fit)
    steps = [*steps_before_use(fit.verdicts, UNIDENTIFIED_FINDINGS)]
    errors = _recording_errors(fit) if len(groups) > 1 else {}
    held = {group[0].recording for group in groups}
    beyond = [
        f"{name} ({percent(error)} %, {'held out' if name in held else 'fitted'})"
        for name, error in errors.items()
        if error > MAX_GOOD_ERROR
    ]
    if beyond:
        text = f"Find what differs in {listed_names(beyond, MAX_NAMED_RECORDINGS)}"
        steps.append(Step(f"{text}: a payload, another setting, the temperature"))
    if len(groups) == 1:
        close = f", whose error is just within {MAX_GOOD_ERROR:g} %" if is_close else ""
        steps.insert(0, Step(f"{SECOND_RECORDING_TEXT}{close}"))
    if any(v.finding == "drive_constant" and v.kind == "note" and v.do for v in fit.verdicts):
        steps.append(Step(PAYLOAD_TEXT.format(unit="ampere" if fit.effort_unit == "A" else "volt")))
    return tuple(steps[:MAX_IMPROVING_STEPS])


def _verdict(error: float, r2: float, judged: str) -> tuple[AnswerVerdict, str]:
    """Return whether an error [%] and its R² are those of a good prediction, and why not."""
    if error > MAX_GOOD_ERROR:
        return "no", f"the error on {judged} is {percent(error)} %, more than {MAX_GOOD_ERROR:g} %"
    if not r2 >= SOUND_R2:
        return "no", f"R² on {judged} is {number(r2, digits=2)}, less than {SOUND_R2:g}"
    return "yes", ""


def _basis(fit: JudgedJoint, judged: str) -> Basis:
    """Return what the numbers are based on."""
    count = len(fit.checksums)
    held_out = len(_held_out_recordings(fit))
    return Basis(count, count, judged=judged, held_out=held_out, computed=fit.computed)


def _held_out_recordings(fit: JudgedJoint) -> list[list[Prediction]]:
    """Return the predictions of held-out stretches, grouped by recording."""
    return by_recording([p for p in fit.headlined.predictions if p.split == "heldout"])


def judged_words(fit: JudgedJoint) -> str:
    """Return in words the data that were not fitted and tell the error; "" if there are none."""
    held = _held_out_recordings(fit)
    if held:
        return "held-out data" if len(held) == 1 else f"{len(held)} held-out recordings"
    return STRETCHES_OUT if np.isfinite(fit.crossed_error[0]) else ""


def headline_error(fit: JudgedJoint) -> Value:
    """Return the reported error [%]: of held-out recordings, of cross-validation, or of the fitted recordings."""
    best, head = fit.headlined, f"{fit.study}.headline"
    if np.isfinite(best.heldout_effort_error):
        error, name = float(best.heldout_effort_error), f"{head}.heldout.effort_error"
    elif np.isfinite(fit.crossed_error[0]):
        error, name = fit.crossed_error[0], f"{head}.blocks_out.effort_error"
    else:
        error, name = float(best.fitted_effort_error), f"{head}.effort_error"
    return Value(name, error, percent(error))


def error_interval_of(fit: JudgedJoint) -> tuple[float, float] | None:
    """Return the 95 % confidence interval of the reported error [%]; None if it is not known.

    Between several held-out recordings errors differ more than within them: their range is reported in its place.
    """
    held = _held_out_recordings(fit)
    if len(held) > 1:
        return None
    found = _joined(held[0], [p.residual for p in held[0]]) if held else _crossed_efforts(fit)
    if found is None:
        return None
    error, factor = headline_error(fit).number, relative_error_factor(*found)
    low, high = error / factor, error * factor
    return (low, high) if np.isfinite(high) and percent(low) != percent(high) else None


def interval_words(interval: tuple[float, float] | None) -> str:
    """Return the 95 % confidence interval of an error [%] in words; "" if it is not known."""
    return f"95 % CI {percent(interval[0])} to {percent(interval[1])} %" if interval else ""


def unfitted_r2(fit: JudgedJoint) -> float:
    """Return R² of held-out recordings, or of cross-validation; NaN if neither is known."""
    best = fit.headlined
    return float(best.heldout_r2) if np.isfinite(best.heldout_effort_error) else fit.crossed_error[1]


def crossed_error_of(fit: JudgedJoint) -> tuple[float, float]:
    """Return the cross-validated error [%] and R² on segments of the fitted recordings; NaN if unknown."""
    found = _crossed_efforts(fit)
    if found is None:
        return float("nan"), float("nan")
    effort, residual, _ = found
    return relative_error(effort, effort - residual), r_squared(effort, effort - residual)


def _crossed_efforts(fit: JudgedJoint) -> tuple[np.ndarray, np.ndarray, list[int]] | None:
    """Return effort and cross-validated residual of the fitted recordings; see `_joined`."""
    family = fit.families[fit.best]
    return _joined([p for p in family.predictions if p.split == "fitted"], family.crossed)


def _joined(
    parts: Sequence[Prediction], residuals: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, list[int]] | None:
    """Return effort and residual of all `parts`, (m,), and the parts' lengths; None if the rows do not match.

    `residuals` may be of pieces: a long recording is fitted in several.
    """
    if not parts or not residuals:
        return None
    effort, residual = np.concatenate([p.effort for p in parts]), np.concatenate(residuals)
    if len(effort) != len(residual) or not np.any(effort):
        return None
    return effort, residual, [len(p.effort) for p in parts]


def _constant_text(fit: JudgedJoint, effort: str) -> str:
    """Return the error of the best constant effort in words, as a baseline."""
    held = fit.held_out
    return f"; the best constant {effort} has {percent(held[0].constant_error)} %" if held else ""


def error_range_text(fit: JudgedJoint) -> str:
    """Return in brackets the smallest and the largest held-out error of a recording; "" of a single one.

    The recordings beyond the bound of a good prediction are named, or the worst one where recordings differ much.
    """
    errors = {group[0].recording: pooled_error(group) for group in _held_out_recordings(fit)}
    if len(errors) < 2 or not all(_is_number(percent(error)) for error in errors.values()):
        return ""
    *_, least = worst_first = sorted(errors, key=errors.__getitem__, reverse=True)
    beyond = [name for name in worst_first if errors[name] > MAX_GOOD_ERROR]
    worst = f"; above {MAX_GOOD_ERROR:g} %: {listed_names(beyond, MAX_NAMED_RECORDINGS)}" if beyond else ""
    if not beyond and errors[worst_first[0]] >= MIN_RANGE_RATIO * errors[least]:
        worst = f", worst {worst_first[0]}"
    return f" over all of them ({percent(errors[least])} to {percent(errors[worst_first[0]])} % by recording{worst})"


def _recording_errors(fit: JudgedJoint) -> dict[str, float]:
    """Return the errors of all recordings, fitted and held out [%], the largest first."""
    errors = {group[0].recording: pooled_error(group) for group in by_recording(fit.headlined.predictions)}
    return dict(sorted(errors.items(), key=lambda each: -each[1]))


def by_recording(parts: Sequence[Prediction] | Sequence[Simulation]) -> list[list]:
    """Return the stretches grouped by recording, in the order of the recordings."""
    groups: dict[str, list] = {}
    for part in parts:
        groups.setdefault(part.recording, []).append(part)
    return list(groups.values())


def pooled_error(group: Sequence[Prediction]) -> float:
    """Return the effort error over several stretches [%]."""
    residual = np.concatenate([p.residual for p in group])
    return 100.0 * float(np.linalg.norm(residual) / np.linalg.norm(np.concatenate([p.effort for p in group])))


def _is_number(text: str) -> bool:
    return text.replace(".", "", 1).isdigit()
