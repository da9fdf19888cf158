"""Findings on an identified joint: each function reports one thing that its recordings and its fits show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._errors import IdentificationError
from ...files.defects import worn
from ...files.fault import Fault
from ...models.causes import PARALLEL_SPRING
from ...models.estimates import Parameter, Verdict
from ...models.fields import largest_friction, model_fields
from ...models.friction_terms import LOAD_FEATURE, TERMS, features_of, grows_with_load
from ...models.joint import GRAVITY, PARALLEL_STIFFNESS, JointModel, joint_model
from ...models.plausible_effort import UNIT_ADVICE, doubt_torques
from ...numerics.block_test import SIGNIFICANCE_LEVEL, compare_held_out, count_independent_samples
from ...numerics.distributions import normal_quantile
from ...numerics.regression import stack
from ...numerics.spring_evidence import (
    MAX_SPRING_UNEXPLAINED_SHARE,
    MIN_EXCESS,
    MIN_LEVER_M,
    STANDARD_ERRORS,
    USUAL_LEVER_M,
)
from ...study.cause_words import cause_sentence
from ...study.pages.quantities import METHODS, interval_text, number, parameter_label, unit_text
from ...study.procedures.findings import MAX_GOOD_ERROR, SOUND_R2
from ..fit.estimator_agreement import differing_estimates, names_outside
from ..fit.friction_family import added_terms
from ..fit.friction_solver import cross_validate_family, solve_family
from ..fit.headline_choice import Candidate
from ..fit.joint_estimate import JointEstimate
from ..fit.recording_agreement import (
    BODY_PARAMETERS,
    AngleZero,
    Disagreement,
    estimate_angle_zero,
    find_disagreements,
    find_friction_drift,
    has_free_gravity,
)
from ..fit.replay import Prediction, relative_error
from ..fit.spring_doubt import SPRING_CAUSE
from ..fit.spring_fit import solve_spring
from .aligned_motions import find_alignments, find_clocks
from .joint_case import (
    ADVICE_BY_PARAMETER,
    PAYLOAD_ADVICE,
    WORN_ADVICE,
    JointCase,
    advice,
    estimate_without,
    unstated_payload,
    wearer_faults,
)

MIN_ZERO_ERROR_RAD = np.radians(3.0)
"""Smallest zero error that is reported [rad]. Smaller ones cannot be told from errors of the friction model."""


@dataclass(frozen=True)
class FindingThresholds:
    """Thresholds of the findings on a joint, by finding."""

    # A zero error is reported only if it differs from 0 by more than this many standard errors.
    min_zero_standard_errors: float = 3.0
    # A zero error is reported only if correcting it reduces the effort error by at least this factor.
    min_error_reduction: float = 1.1
    # The columns are nearly proportional if the condition number of the scaled regressor exceeds this.
    max_condition_number: float = 100.0
    # A recording differs by a factor on the effort if that factor is farther than this from 1.
    min_scale_difference: float = 0.1
    # Among at least this many fitted recordings each is tested for a payload, though its own estimate contradicts none:
    # of two, neither can be told to be the one without it.
    min_recordings_for_payloads: int = 3
    # The implied constant contradicts the stated one only if they differ by more than this many standard errors.
    min_constant_standard_errors: float = 4.0
    # The implied constant contradicts the stated one only if they differ by more than this share.
    min_constant_difference: float = 0.1
    # The error of a simulation matters from this share of the motion's standard deviation on. Chosen by judgement.
    min_simulation_error_share: float = 0.05
    # The error of a simulation is far larger than another's from this multiple of it on. Chosen by judgement.
    min_simulation_error_ratio: float = 1.5
    # A drift is told if it is at least this share of the friction at the recording's median speed.
    min_drift_level_share: float = 0.25
    min_drift_z_value: float = 4.0  # A drift is told if it is at least this many standard errors
    min_held_out_recordings: int = 3  # One recording is named only beside at least two others
    # One recording explains the error if without it at most this share is left. Chosen by judgement; no measurement is
    # recorded.
    max_remaining_share: float = 2.0 / 3.0
    # Two shares are the same if they differ by at most this many standard errors of their difference.
    max_share_difference_errors: float = 3.0
    failed_r2: float = 0.5  # A model does not explain the effort if its R2 is below this
    # Below this number of independent samples the error is stated with a reservation.
    min_independent_samples: float = 20.0
    # Coverage is too low if it is below its level by more than this share of samples.
    max_coverage_shortfall: float = 0.05
    # A held-out error up to this many times the fitted one is no sign of another machine.
    max_held_out_ratio: float = 1.5
    # The joint's model fails if it leaves at least this share of the effort's variance.
    min_joint_unexplained_share: float = 0.5
    # A spring that is taken for a weight leaves at most this share of the effort's variance; over wide angles it leaves
    # more.
    max_spring_alike_share: float = 0.01
    # A hidden spring is reported if half of gravity's interval exceeds this share of gravity.
    min_hidden_spring_share: float = 0.05
    # If the error of the fit exceeds this [%], the model is to blame for a weak parameter and not the motion.
    max_fit_error_percent: float = 20.0
    # A parameter differs from 0 statistically by more than this many standard errors.
    min_parameter_standard_errors: float = 1.96
    # A parameter is negligible if half the width of its interval changes the effort by less than this share (RMS).
    negligible_effort_share: float = 0.05
    # A parameter is hidden by another if the correlation of their estimates exceeds this.
    min_hiding_correlation: float = 0.9
    max_half_width_share: float = 1.0 / 3.0  # An interval is wide if half of its width exceeds this share of the value
    # The motion is to blame for a wide interval if coloured residuals alone make at least this share of its width.
    min_statistical_share: float = 0.7
    # The unit is wrong only if reading the angle in degrees reduces the error to at most this share.
    max_converted_error_ratio: float = 0.5
    # Small angles that were radians fit about as well in degrees, but angles in degrees never fit as radians.
    max_turned_error_ratio: float = 0.8


FINDING_THRESHOLDS = FindingThresholds()


MAX_STANDARD_ERROR_RAD = np.radians(15.0)
"""No angle is reported if its standard error exceeds this [rad]."""

TRIED_FAMILIES = ("symmetric", "directional", "load")
"""Families that are solved fast enough to be tried with a free zero."""


def report_causes(case: JointCase) -> Iterator[Verdict]:
    """Report each cause of what the model misses, and the parallel spring that is a term of it."""
    for cause in case.causes:
        is_term = cause.name == PARALLEL_SPRING
        yield Verdict("note", cause_sentence(cause), PARALLEL_SPRING_ADVICE if is_term else "", weight=6.0)


def report_hidden_spring(case: JointCase) -> Iterator[Verdict]:
    """Report that a parallel spring of usual size would not show, where it makes gravity's interval wide."""
    estimate = case.fit.headline.estimate
    found = estimate.get("gravity")
    if found is None or PARALLEL_STIFFNESS in estimate or estimate.discrepancy is None:
        return
    cause = estimate.discrepancy.of(["gravity"])[1][0]
    half = _half_width(found, case.level)
    if cause != SPRING_CAUSE or half < FINDING_THRESHOLDS.min_hidden_spring_share * abs(found.value):
        return
    text = (
        "These recordings cannot distinguish a parallel spring (hose, cable, skin) from gravity. The interval of "
        f"gravity, ± {100.0 * half / abs(found.value):.0f} %, allows for a spring of usual stiffness."
    )
    yield Verdict("note", text, ADVICE_BY_PARAMETER["gravity"])


PARALLEL_SPRING_ADVICE = (
    "The model has a separate term for it, and controllers compensate both gravity and spring. To identify the joint "
    "alone, record it without the hose or cable."
)
"""Advice on a parallel spring that was found."""


def report_angle_zero(case: JointCase) -> Iterator[Verdict]:
    """Report the zero error that gravity implies, with its interval, and the offset to write."""
    if not has_free_gravity(case.fit.model):
        return
    found = _best(case)
    if (
        found is None
        or found.standard_error > MAX_STANDARD_ERROR_RAD
        or abs(found.angle)
        < max(MIN_ZERO_ERROR_RAD, FINDING_THRESHOLDS.min_zero_standard_errors * found.standard_error)
    ):
        return
    half = float(np.degrees(normal_quantile(0.5 + 0.5 * case.level) * found.standard_error))
    at = f"the joint hangs at an encoder angle of {-np.degrees(found.angle):.1f} ± {half:.1f} deg"
    if case.study.model.gravity == "sine+cosine":
        text = f"The zero of the angle is free, as study.toml asks, and {at}"
        yield Verdict("note", f"{text} ({100 * case.level:g} %).")
        return
    turned = np.cos(found.angle) < 0.0  # both zeros then fit equally well, one of them with a negative weight
    if not turned and not (
        found.p_value < SIGNIFICANCE_LEVEL and found.before > FINDING_THRESHOLDS.min_error_reduction * found.after
    ):
        return
    unit = case.fit.model.effort_unit
    yield Verdict(
        "wrong",
        f"The zero of the angle is off: by its weight, {at} ({100 * case.level:g} %). With the zero free, effort that "
        f"was not fitted is predicted to {found.after:.3g} {unit} RMS instead of {found.before:.3g}.",
        f"Write {_zero_advice(case, found.angle)} in [model].",
        weight=11.0,
    )


def _best(case: JointCase) -> AngleZero | None:
    """Return the zero error by the family that predicts best with a free zero."""
    data = stack([m for m in case.excerpt if m.split == "fitted"])
    made = []
    for fit in [case.fits[n] for n in TRIED_FAMILIES if n in case.fits] or [case.fit]:
        try:
            made.append(estimate_angle_zero(fit.model, data))
        except IdentificationError:
            continue  # the range of angles is too small
    return min(made, key=lambda each: each.after, default=None)


def _zero_advice(case: JointCase, angle: float) -> str:
    """Return the entries of study.toml that correct the zero; an integrated velocity has no offset to write."""
    free = 'gravity = "sine+cosine"'
    spec = case.study.config.channels.get("position")
    if spec is None:
        return free
    offset = spec.offset + angle / spec.si_factor
    return f"offset = {offset:.4g} in [channels] position ({spec.unit}), or {free}"


def report_collinear(case: JointCase) -> Iterator[Verdict]:
    """Report a condition number at which parameters trade off."""
    condition = case.fit.estimate.scaled_condition_number
    if condition > FINDING_THRESHOLDS.max_condition_number:
        yield Verdict(
            # Intervals allow for it; `report_wide_interval` warns of wide ones.
            "note",
            f"The columns of the regressor are nearly collinear (condition number {condition:.0f} after scaling), so "
            "that errors of some parameters compensate each other.",
            "Record a richer motion.",
        )


def report_coloured_residuals(case: JointCase) -> Iterator[Verdict]:
    """Report how many of a hundred residuals are effectively independent."""
    white = case.fit.estimate.whiteness
    if white is not None and white.effective_share < 0.5:
        yield Verdict(
            "note",
            "Residuals are autocorrelated: 100 samples contain as much information as "
            f"{max(100 * white.effective_share, 1):.0f} independent ones. The intervals take this into account; "
            "ordinary least-squares intervals would be too narrow.",
        )


MIN_ZERO_DIFFERENCE_RAD = np.radians(5.0)
"""A recording differs by its encoder zero if the zeros are farther apart than this [rad]."""


ONE_FILE_ADVICE = (
    "All parts come from one file, with the same machine and settings. Look for a change within the file: speed, "
    "temperature, a contact, or the motion of another joint."
)
"""Advice if parts of one file contradict each other."""


def report_contradicting_recordings(case: JointCase) -> Iterator[Verdict]:
    """Report each contradicting recording, its parameters, and those of the others."""
    names = {m.recording for m in case.excerpt}
    if len(names) < 2:
        return
    found, fitted = _disagreements(case), {m.recording for m in case.excerpt if m.split == "fitted"}
    for i, each in enumerate(found):
        others = fitted - {each.recording}
        rest = next(iter(others)) if len(others) == 1 and (each.split == "fitted" or len(fitted) == 1) else ""
        payload = None
        if {"gravity", "inertia"} & set(each.own) and case.fit.model.effort_unit == "N*m":
            payload = unstated_payload(*estimate_without(case, [d.recording for d in found]), each.recording, case)
        yield _verdict(case, each, rest, 12.0 - 0.01 * i, payload)
    if not found and len(fitted) >= FINDING_THRESHOLDS.min_recordings_for_payloads:
        for name in sorted(fitted):
            payload = unstated_payload(*estimate_without(case, [name]), name, case)
            if payload is not None:
                yield Verdict("warning", f"Recording '{name}' differs. {payload}", PAYLOAD_ADVICE, weight=10.0)


def _disagreements(case: JointCase) -> tuple[Disagreement, ...]:
    """Find disagreements with the best family, or with families that fit better if it finds none in the body."""
    fits = sorted(case.fits.values(), key=lambda f: (f.family != case.best, f.fitted_effort_error))
    every = [find_disagreements(f.model, f.estimate.array, case.excerpt) for f in fits]
    bodily = [found for found in every if any(BODY_PARAMETERS & set(each.own) for each in found)]
    return (bodily or every)[0]


def _verdict(case: JointCase, each: Disagreement, rest: str, weight: float, payload: str | None) -> Verdict:
    times = normal_quantile(0.5 + 0.5 * case.level)

    def text(name: str, value: tuple[float, float]) -> str:
        unit = unit_text(case.fit.model.unit(name))
        return f"{number(*value)} ± {number(times * value[1], value[1])} {unit}".rstrip()

    others = f"from '{rest}'" if rest else "from the others"
    apart = "; ".join(
        f"{parameter_label(name)} is {text(name, each.own[name])} from it alone, "
        f"{text(name, each.others[name])} {others}, {number(each.together[name], digits=3)} in the fit"
        for name in each.own
    )
    sentence = f"Recording '{each.recording}' contradicts {repr(rest) if rest else 'the others'}: {apart}."
    which = f"'{each.recording}'" + (f" and in '{rest}'" if rest else "")
    is_one_file = len({recording.path for recording in case.study.recordings()}) == 1
    if payload is not None:
        sentence += f" {payload}"
        do = f"{PAYLOAD_ADVICE} {ONE_FILE_ADVICE}" if is_one_file else PAYLOAD_ADVICE
        return Verdict("wrong", sentence, do, weight=weight)
    if "gravity_cosine" in each.own and abs(each.turned) > MIN_ZERO_DIFFERENCE_RAD:
        sentence += f" By its weight, its angle reads {-np.degrees(each.turned):+.1f} deg against theirs."
        do = f"Check the encoder's zero in {which}: an offset in that recording's channels corrects it"
    elif np.isfinite(each.scale) and abs(each.scale - 1.0) > FINDING_THRESHOLDS.min_scale_difference:
        sentence += f" Its effort is {each.scale:.3g} times the effort predicted by the model of the others."
        do = f"Check the drive's unit, scale and sign in {which}"
    elif is_one_file:
        return Verdict("wrong", sentence, ONE_FILE_ADVICE, weight=weight)
    else:
        do = f"Check {which} for a payload that is not stated, another machine or other settings"
    return Verdict("wrong", sentence, f"{do}; or exclude it.", weight=weight)


def report_drive_constant(case: JointCase) -> Iterator[Verdict]:
    """Report the drive constant from known payloads, or that it is unknown."""
    if case.drive.kind == "torque" or case.drive.constant is not None:
        yield from _against_stated(case)
    elif case.constant is not None:
        low, high = case.constant.interval(case.level)
        yield Verdict(
            "good",
            f"The drive gives {case.constant.value:.4g} {case.constant.unit} (interval {low:.4g} to {high:.4g}), from "
            "the known payloads. Write it into study.toml to obtain results in SI units.",
        )
    elif case.no_constant:
        yield Verdict("warning", f"{case.no_constant[0].upper()}{case.no_constant[1:]}.")
    else:
        per = "ampere" if case.fit.model.effort_unit == "A" else "volt"
        yield Verdict(
            "note",
            f"The drive constant is unknown, so that parameters are per {per}: their ratios are meaningful, absolute "
            "masses are not.",
            "Add a recording with a known payload to identify the drive constant.",
        )


def _against_stated(case: JointCase) -> Iterator[Verdict]:
    """Report payloads whose effort contradicts the stated drive constant or sensor."""
    found = case.constant
    if found is None:
        return
    if abs(found.value - _nearest_ratio(case, found.value)) < max(
        FINDING_THRESHOLDS.min_constant_difference,
        FINDING_THRESHOLDS.min_constant_standard_errors * found.standard_error,
    ):
        return
    low, high = found.interval(case.level)
    drive = case.drive
    what = "torque_constant" if case.rotary else "force_constant"
    least, error = (
        FINDING_THRESHOLDS.min_constant_difference,
        FINDING_THRESHOLDS.min_constant_standard_errors * found.standard_error,
    )
    thousand = any(abs(found.value / k - 1.0) < max(least, error / k) for k in (1e3, 1e-3))
    if thousand and drive.kind == "current":
        do = "The factor is that between A and mA: check the unit of [channels] current."
    elif drive.constant is not None and drive.resistance is None:
        do = f"Check [rig.drive] {what} (the payloads imply {drive.constant * found.value:.4g} instead of "
        do += f"{drive.constant:.4g}), its gear_ratio, the drive's unit, and the payloads."
    else:
        do = "Check the constant, the unit of the channel and the payloads."
    yield Verdict(
        "wrong",
        f"The known payloads imply {found.value:.4g} times the effort that the drive is said to give (interval "
        f"{low:.4g} to {high:.4g}).",
        do,
        weight=12.5,  # more weight than a contradicting recording, which a wrong constant also causes
    )


def _nearest_ratio(case: JointCase, implied: float) -> float:
    """Return the ratio that payloads would imply with a correct constant, as near as possible to `implied`.

    The ratio is 1 without load friction. If the shares of the load lost in motoring and in generating differ by twice
    d, it is 1 / (1 + d), and d is at most their mean.
    """
    model = case.fit.model
    lost = [case.fit[name].value for name in model.names if grows_with_load(name)]
    mean = sum(lost) / len(lost) if lost else 0.0
    largest = 1.0 / (1.0 - mean) if mean < 1.0 else float("inf")
    return min(max(implied, 1.0 / (1.0 + mean)), largest)


def report_estimators_disagree(case: JointCase) -> Iterator[Verdict]:
    """Report estimators that disagree, or that do far better at something that the headline is not chosen for."""
    fit, choice = case.fit, case.choice
    compared = choice.methods_of(case.best)
    estimates, apart = differing_estimates(fit, case.level)
    shown = {"ls", choice.method, *_winners(compared), *(m for methods in apart.values() for m in methods)}
    involved = [m for m in estimates if m in shown]
    if apart:
        differences_text = "; ".join(
            f"{parameter_label(name)} is "
            + ", ".join(f"{interval_text(estimates[m][name], 0.95)} by {METHODS[m]}" for m in ("ls", *methods))
            for name, methods in apart.items()
        )
        text = (
            f"Estimators disagree by more than their intervals: {differences_text}. The model lacks an effect, "
        )
        text += "and each estimator weighs that error differently. "
        outside = names_outside(fit, case.level)
        if outside:
            names = ", ".join(parameter_label(name) for name in outside)
            text += f"Do not rely on the printed interval of {names}: the other estimate is outside it."
        else:
            text += "The printed intervals contain all of these estimates."
        yield Verdict("warning", f"{text} {_used(case, involved)}", _advice(case), weight=10.0)
    elif choice.method != "ls":
        text = f"Ordinary least squares predicts worse than {METHODS[choice.method]} in cross-validation."
        yield Verdict("note", f"{text} {_used(case, involved)}", weight=5.0)


def report_other_purpose(case: JointCase) -> Iterator[Verdict]:
    """Report a headline that simulates so badly that it matters, where another candidate simulates far better.

    An error that is small against the motion matters to nobody, however much smaller that of another candidate is.
    """
    chosen = case.choice.chosen
    if chosen is None or chosen.simulation_error is None or case.choice.purpose == "simulation":
        return
    best = min(case.choice.candidates, key=lambda c: c.simulation_error or 0.0)
    size = float(np.std(case.data.reduced([m.position for m in case.data.motions])))
    if (
        chosen.simulation_error < FINDING_THRESHOLDS.min_simulation_error_share * size
        or chosen.simulation_error < FINDING_THRESHOLDS.min_simulation_error_ratio * (best.simulation_error or 0.0)
    ):
        return
    scale, unit = _position_scale(case)
    errors = [number(scale * (each.simulation_error or 0.0), digits=3) for each in (chosen, best)]
    yield Verdict(
        "warning",
        "The chosen model predicts the effort best, but another model simulates the motion much better. Over "
        f"{case.choice.horizon:g} s, the simulation error is {errors[0]} {unit} with the chosen model and {errors[1]} "
        f"{unit} with {best.family} friction by {METHODS[best.method]} (RMS).",
        _advice(case),
        weight=5.0,
    )


def _winners(compared: Mapping[str, Candidate]) -> set[str]:
    """Return the estimators of one family with the smallest errors of effort and of simulated position."""
    if not compared:
        return set()
    found = {min(compared, key=lambda m: compared[m].effort_error)}
    simulated = {m: c.simulation_error for m, c in compared.items() if c.simulation_error is not None}
    return found | ({min(simulated, key=simulated.__getitem__)} if simulated else set())


def _position_scale(case: JointCase) -> tuple[float, str]:
    return (float(np.degrees(1.0)), "deg") if case.rotary else (1e3, "mm")


def _used(case: JointCase, involved: list[str]) -> str:
    """Return in words the errors of the methods, and which one's values are used."""
    compared = case.choice.methods_of(case.best)
    if not compared:
        return f"Estimators were not compared; results are by {METHODS[case.choice.method]}."
    efforts = {m: compared[m].effort_error for m in involved if m in compared}
    positions = {m: compared[m].simulation_error for m in efforts}
    clauses = []
    if all(error is not None for error in positions.values()):
        scale, unit = _position_scale(case)
        simulated = {m: scale * (error or 0.0) for m, error in positions.items()}
        clauses.append(f"simulated motion over {case.choice.horizon:g} s {_errors(simulated, unit)}")
    clauses.append(f"effort {_errors(efforts, case.fit.model.effort_unit)}")
    return (
        f"Errors in cross-validation on segments of the fitted recordings: {'; '.join(clauses)}. "
        f"Results are by {METHODS[case.choice.method]}."
    )


def _errors(errors: Mapping[str, float], unit: str) -> str:
    each = [f"{number(error, digits=3)} by {METHODS[m]}" for m, error in errors.items()]
    return f"{', '.join(each)} ({unit_text(unit)}, RMS)"


def _advice(case: JointCase) -> str:
    other = "simulation" if case.choice.purpose == "torque" else "torque"
    return f'The model is chosen for {case.choice.purpose}. For {other}, write [model] purpose = "{other}".'


def report_failed_attempts(case: JointCase) -> Iterator[Verdict]:
    """Report each failure with its reason."""
    for family, why in case.failures.items():
        yield Verdict("note", f"The '{family}' family could not be fitted: {why}.")
    for what, why in case.fit.failures.items():
        name = METHODS.get(what, what)
        yield Verdict("warning", f"{name[0].upper()}{name[1:]} failed: {why}.")


def report_family_choice(case: JointCase) -> Iterator[Verdict]:
    """Report why the chosen family is used, and what it adds that the recordings do not identify."""
    chosen = case.choice.chosen
    if len(case.fits) == 1 or chosen is None or case.choice.best is None:
        return
    family_best = {name: found for name in case.fits if (found := case.choice.best_of(name)) is not None}
    simpler = [c for c in family_best.values() if c.parameter_count < chosen.parameter_count]
    best = case.choice.best
    if simpler:
        nearest = min(simpler, key=lambda c: c.excess)
        gain = nearest.excess - chosen.excess
        added = added_terms(case.fit.estimate, case.fits[nearest.family].model.names, case.level)
        open_ones = [name for name, is_found in added.items() if not is_found]
        text = f"In cross-validation, the '{case.best}' family predicts better than every simpler family: its error is "
        text += f"{_share(gain)} smaller than that of '{nearest.family}', the best of these, which exceeds the best "
        text += f"model's by {_share(nearest.excess)} ± {_share(nearest.standard_error)}."
        if open_ones:
            is_partly = len(open_ones) < len(added)
            text += f" Of its additional parameters, {', '.join(open_ones)} cannot be identified"
            text += (
                ", which does not affect its predictions."
                if is_partly
                else (": use its predictions, not its value.")
            )
        head = case.fit.headline
        error = head.heldout_effort_error if case.judged_on_held_out else head.fitted_effort_error
        is_proven = not added or len(open_ones) < len(added)
        yield Verdict("good" if is_proven and error <= MAX_GOOD_ERROR else "note", text)
    elif best.family != case.best:
        yield Verdict(
            "note",
            f"The '{best.family}' family predicts stretches of the fitted recordings better than '{case.best}', but "
            f"only by {_share(chosen.excess)} ± {_share(chosen.standard_error)}: a richer family is used only if it "
            f"is better by {100.0 * case.choice.min_improvement:.2g} %.",
        )
    else:
        yield Verdict(
            "note",
            f"No richer friction family predicts stretches of the fitted recordings better than '{case.best}'.",
        )


def _share(excess: float) -> str:
    """Return a difference of scores as the percentage that it saves of the larger error."""
    return f"{-100.0 * np.expm1(-excess):.2g} %"


def report_friction_drift(case: JointCase) -> Iterator[Verdict]:
    """Report the fitted recording in which friction drifts most, and how many others there are."""
    found = []
    values = dict(zip(case.fit.model.names, case.fit.estimate.array, strict=True))
    for each in case.fit.predictions:
        if each.split != "fitted" or len(each.time) < 2:
            continue
        drift = find_friction_drift(each.time, each.velocity, each.residual)
        usual = _friction_at(values, float(np.median(np.abs(each.velocity))))
        if (
            drift is not None
            and abs(drift.z_value) > FINDING_THRESHOLDS.min_drift_z_value
            and abs(drift.change) > FINDING_THRESHOLDS.min_drift_level_share * usual > 0.0
        ):
            found.append((abs(drift.change) / usual, each, drift))
    if not found:
        return
    share, worst, drift = max(found, key=lambda entry: entry[0])
    unit = unit_text(case.fit.model.effort_unit)
    change = f"{number(drift.change, drift.standard_error)} ± {number(2.0 * drift.standard_error, digits=2)} {unit}"
    more = f" (and in {len(found) - 1} more)" if len(found) > 1 else ""
    text = (
        f"Friction drifts in recording '{worst.recording}'{more}: it changes by {change} from start to end, "
        f"{100 * share:.0f} % of its value, as in a gear that warms up."
    )
    yield Verdict("warning", text, "Let the machine warm up before you record, or identify cold and warm separately.")


def _friction_at(values: Mapping[str, float], speed: float) -> float:
    """Return the friction that reported terms give without a load at a speed [rad/s or m/s], in the effort's unit."""
    known = {
        target: abs(values[term.name])
        for term in TERMS
        if term.name in values and term.resists is not None
        for target in term.targets
    }
    return float(largest_friction(model_fields("joint"), known, speed, 0.0)) if known else 0.0


def report_joined_clock(case: JointCase) -> Iterator[Verdict]:
    """Report each estimated clock."""
    for clock in find_clocks(case.study):
        yield Verdict("note", clock.said, clock.do)


def report_late_drive(case: JointCase) -> Iterator[Verdict]:
    """Report a delay that was found, or a requested one that was not."""
    for found in find_alignments(case.study):
        if found.said:
            is_warning = (found.moved or found.recording) and not found.is_within_period
            yield Verdict("warning" if is_warning else "note", found.said, found.do)


COMMON_COEFFICIENT_TEXT = (
    "load friction while motoring and while generating cannot be distinguished from the load itself. One coefficient "
    "represents both, and the intervals of inertia and gravity include the difference."
)
"""Sentence on load friction with one coefficient for both directions of power."""

REASON_TEXTS = {
    "no known load": ("Without a known load,", ""),
    "held out": (
        "Only held-out recordings carry a known load, so that",
        'Mark a recording with a payload use = "fit".',
    ),
    "unknown drive": (
        "The drive's constant is not stated. Even with known payloads,",
        "State the drive's constant, so that the payloads identify both coefficients.",
    ),
    "same payload": (
        "All fitted recordings carry the same known load, so that",
        "Record without the payload too, or with another one.",
    ),
    "small payload": (
        "The known payloads change the load too little, so that",
        "Record with a heavier payload, or fasten it farther from the axis.",
    ),
}
"""Beginning of the sentence, and the remedy, by the reason for a common coefficient."""


def report_load_friction_tied(case: JointCase) -> Iterator[Verdict]:
    """Report that one coefficient represents two, and why."""
    if LOAD_FEATURE not in features_of(case.fit.model.names):
        return
    why: str = case.shares.why
    if why == "no known load" and any(mass for mass, _ in (motion.payload for motion in case.motions)):
        why = "held out"
    begins, do = REASON_TEXTS[why]
    yield Verdict("note", f"{begins} {COMMON_COEFFICIENT_TEXT}", do)


def report_odd_recording(case: JointCase) -> Iterator[Verdict]:
    """Report the held-out recording that explains the pooled error, and whether a payload explains it."""
    held = [p for p in case.fit.headline.predictions if p.split == "heldout"]
    if len(held) < FINDING_THRESHOLDS.min_held_out_recordings:
        return
    whole = _pooled_error(held)
    left = {p.recording: _pooled_error([other for other in held if other is not p]) for p in held}
    odd = min(held, key=lambda p: left[p.recording])
    if left[odd.recording] > FINDING_THRESHOLDS.max_remaining_share * whole:
        return
    text = f"Recording '{odd.recording}' dominates the held-out error: {odd.effort_error:.3g} % there, "
    text += f"{left[odd.recording]:.3g} % over the others, {whole:.3g} % over all."
    do = "Check what was different in it: a payload, another machine or setting, the temperature."
    payload = unstated_payload(*estimate_without(case, ()), odd.recording, case) if case.rotary else None
    if payload is not None:
        text += f" {payload}"
        do = PAYLOAD_ADVICE
    yield Verdict("warning", text, do, weight=8.0)


def _pooled_error(predictions: Sequence[Prediction]) -> float:
    """Return the effort error over all samples [%]."""
    return relative_error(*(np.concatenate([getattr(p, n) for p in predictions]) for n in ("effort", "predicted")))


SCALED_BY_THE_GAIN = ("gravity", "inertia")
"""Parameters that change by the same share where the gain of a drive or a torque sensor drifts."""


def report_parameter_drift(case: JointCase) -> Iterator[Verdict]:
    """Report the parameters that drift, by how much, and what their intervals make of it."""
    estimate = case.fit.estimate
    drift = estimate.drift
    if drift is None or not drift.is_told.any():
        return
    shares: dict[str, tuple[float, float]] = {}
    for name, change, error in zip(drift.names, drift.change, drift.standard_error, strict=True):
        value = abs(estimate[name].value)
        if value > 0.0 and np.isfinite(error):
            shares[name] = 100.0 * float(change) / value, 100.0 * float(error) / value
    told = [name for name, is_told in zip(drift.names, drift.is_told, strict=True) if is_told and name in shares]
    if not told:
        return
    said = ", ".join(
        f"{name.replace('_', ' ')} by {shares[name][0]:+.2g} ± {2.0 * shares[name][1]:.1g} %" for name in told
    )
    text = (
        f"Parameters drift from the start of a recording to its end: {said} (± two standard errors). A model with "
        f"drift reduces the cross-validated error by {100.0 * drift.improvement:.2g} %. The intervals include the "
        "drift."
    )
    gained = [shares[name] for name in SCALED_BY_THE_GAIN if name in shares]
    if "gravity" in told and len(gained) == len(SCALED_BY_THE_GAIN):
        (one, error), (other, other_error) = gained
        if abs(one - other) <= FINDING_THRESHOLDS.max_share_difference_errors * float(np.hypot(error, other_error)):
            text += " Inertia changes by the same share as gravity, as with a drifting gain of drive or torque sensor."
    do = "Let machine, drive and sensors warm up before you record, or identify parts of the recording separately."
    yield Verdict("warning", text, do)


def report_posterior(case: JointCase) -> Iterator[Verdict]:
    """Compare a requested posterior with the least-squares intervals of the best family."""
    if case.no_posterior:
        yield Verdict("warning", f"The posterior could not be sampled: {case.no_posterior}.")
    if case.posterior is not None:
        from ...study.procedures.posterior_beside import pair_with_posterior, posterior_verdicts

        compared = pair_with_posterior(case.fit.estimate.parameters, case.posterior)
        yield from posterior_verdicts(compared, case.posterior, case.level)


def report_prediction(case: JointCase) -> Iterator[Verdict]:
    """Report the held-out error of the best family, its failure, or the lack of held-out recordings."""
    fit = case.fit.headline
    held = [p.residual for p in fit.predictions if p.split == "heldout"]
    if fit.fitted_r2 < FINDING_THRESHOLDS.failed_r2:
        yield Verdict(
            "wrong",
            "The fit failed: even in the fitted recordings, the model explains only "
            f"{100 * max(fit.fitted_r2, 0.0):.0f} % of the variance "
            f"(error {fit.fitted_effort_error:.3g} %). The parameters do not describe this machine.",
            "Check units, signs and offsets of the channels, and the drive's constant.",
            weight=10.0,
        )
    if not held:
        yield Verdict(
            "warning",
            'No recording is held out (use = "validate"). The error is from cross-validation on segments of the fitted '
            "recordings, which resemble each other more than new data would.",
        )
        return
    count = count_independent_samples(held)
    error = f"an error of {number(fit.heldout_effort_error, digits=2)} % (R2 {fit.heldout_r2:.3f}, "
    error += f"{count:.0f} independent samples)"
    if fit.heldout_r2 < FINDING_THRESHOLDS.failed_r2:
        yield Verdict(
            "wrong",
            f"The '{case.best}' family fails on held-out recordings: {error}; on the fitted recordings "
            f"{number(fit.fitted_effort_error, digits=2)} %.",
            "Check that held-out recordings have the same machine, units and range of motion.",
            weight=9.0,
        )
        return
    yield from _better_on_held_out(case)
    few, large = count < FINDING_THRESHOLDS.min_independent_samples, fit.heldout_effort_error > MAX_GOOD_ERROR
    good = fit.heldout_r2 > SOUND_R2 and fit.fitted_r2 > FINDING_THRESHOLDS.failed_r2 and not large
    do = f"The error exceeds {MAX_GOOD_ERROR:g} %: look for effects that the model lacks." if large else ""
    yield Verdict(
        "warning" if large else "note" if few else "good" if good else "warning",
        f"The '{case.best}' family predicts held-out effort with {error}; on the fitted recordings "
        f"{number(fit.fitted_effort_error, digits=2)} %.",
        f"{do} {'The held-out data are too few for a reliable error: hold out more.' * few}".strip(),
        weight=1.0,
    )


def _better_on_held_out(case: JointCase) -> Iterator[Verdict]:
    """Report a family that predicts held-out recordings better than the chosen one, which they may not choose."""
    errors = {name: fit.heldout_effort_error for name, fit in case.fits.items()}
    name = min(errors, key=errors.__getitem__)
    gain = 1.0 - errors[name] / errors[case.best]
    if gain >= case.study.model.min_improvement:
        yield Verdict(
            "note",
            f"On held-out recordings, the '{name}' family has an error of {errors[name]:.3g} %, '{case.best}' one of "
            f"{errors[case.best]:.3g} %. Held-out recordings are not used to choose the family, and the fitted ones do "
            "not show this difference.",
            'Mark such recordings use = "fit", and hold out others.',
        )


def report_prediction_interval(case: JointCase) -> Iterator[Verdict]:
    """Report a band with too low cross-validated coverage, overall or under one condition."""
    held = [p for p in case.fit.predictions if p.split == "heldout"]
    if not held:
        return
    share = np.average([p.coverage for p in held], weights=[len(p.time) for p in held])
    # Few independent samples lie outside by chance.
    count = count_independent_samples([p.residual for p in held])
    chance = 2.0 * np.sqrt(case.level * (1.0 - case.level) / max(count, 1.0))
    if share < case.level - max(FINDING_THRESHOLDS.max_coverage_shortfall, chance):
        fit = case.fit.headline
        larger = fit.heldout_effort_error > FINDING_THRESHOLDS.max_held_out_ratio * fit.fitted_effort_error
        where = f"The {100 * case.level:.3g} % prediction interval covers only {100 * share:.0f} % of held-out samples"
        if larger:
            said = f"{where}: these recordings contain effects that the fitted ones do not show."
        else:
            said = f"{where}, although their error is hardly larger than in fitted ones: the interval is too narrow."
        yield Verdict("warning" if larger else "note", said)
        return
    band = case.fit.headline.band
    conditions = band.conditions if band is not None else ()
    for kind in ("direction", "speed", "position"):
        worst = min((c for c in conditions if c.kind == kind), key=lambda c: c.coverage, default=None)
        if worst is not None and worst.coverage < case.level - 2.0 * FINDING_THRESHOLDS.max_coverage_shortfall:
            yield Verdict(
                "note",
                f"The {100 * case.level:.3g} % prediction interval covers {100 * share:.0f} % of held-out samples, but "
                f"only {100 * worst.coverage:.0f} % of those with {kind} {worst.condition}: the model error depends on "
                f"{kind}.",
            )


RECORDING_ADVICE = (
    "Before you use dither or a controller that acts near standstill, record small slow reversals of increasing size "
    "around several angles. The command `protocol` writes such a motion under the name reversals."
)
"""Advice if no recording shows the presliding displacement."""


def report_presliding(case: JointCase) -> Iterator[Verdict]:
    """Report the presliding travel, and its effect on the prediction of held-out effort."""
    found = case.presliding
    if found is None:
        return
    unit = "mrad" if case.rotary else "mm"
    if found.travel is not None:
        low, high = found.travel.interval(case.level)
        text = (
            f"Presliding displacement: {1e3 * found.travel.value:.3g} {unit} ({1e3 * low:.3g} to {1e3 * high:.3g}, "
            f"{100 * case.level:g} % interval)"
        )
        if case.judged_on_held_out:
            text += (
                f". With slow samples included, the held-out effort error is {found.gives:.3g} "
                f"{case.fit.model.effort_unit} RMS, and {found.slips:.3g} without presliding"
            )
        yield Verdict("note", f"{text}.")
    elif found.below is not None:
        yield Verdict(
            "note",
            f"Presliding displacement: below {1e3 * found.below:.2g} {unit} ({found.why}).",
        )
    else:
        yield Verdict(
            "note",
            f"Presliding displacement: not identifiable, because {found.why}.",
            RECORDING_ADVICE,
        )


def report_recording_drift(case: JointCase) -> Iterator[Verdict]:
    """Report the parameters that differ between recordings, by how much, and what their intervals make of it."""
    estimate = case.fit.estimate
    between = estimate.between_recordings
    if between is None or not between.is_told.any():
        return
    said = []
    for i in np.flatnonzero(between.is_told):
        values, spread = between.values[:, i], float(between.spread[i])
        low, high = int(np.argmin(values)), int(np.argmax(values))
        unit = unit_text(estimate[between.names[i]].unit)
        said.append(
            f"{between.names[i].replace('_', ' ')} from {number(float(values[low]), spread)} "
            f"({between.recordings[low]}) to {number(float(values[high]), spread)} {unit} ({between.recordings[high]})"
        )
    text = (
        f"Parameters differ between the {len(between.recordings)} recordings by more than their errors: "
        f"{'; '.join(said)}. Separate parameters for each recording reduce the cross-validated error by "
        f"{100.0 * between.improvement:.2g} %. The intervals include the spread."
    )
    do = "Check what changed between them (temperature, load, a gain), or identify them separately."
    yield Verdict("warning", text, do)


def report_spring_bench(case: JointCase) -> Iterator[Verdict]:
    """Report a spring that the joint's model lacks, or attributes to gravity."""
    fitted = [p for p in case.fit.predictions if p.split == "fitted"]
    if not fitted:
        return
    stiffness, error, left = _spring(fitted)
    size = float(np.sum(np.concatenate([p.effort - p.effort.mean() for p in fitted]) ** 2))
    missed = float(np.sum(np.concatenate([p.effort - p.predicted for p in fitted]) ** 2))
    unit = unit_text("N*m/rad" if case.rotary else "N/m") if case.fit.model.effort_unit in ("N*m", "N") else ""
    said = f"{number(stiffness, error)} ± {number(STANDARD_ERRORS * error, digits=2)} {unit}".rstrip()
    do = 'If this is a spring with one end locked, state protocol = "locked_spring" to identify it; otherwise record '
    do += "the joint with its end free."
    if (
        stiffness > 0.0
        and missed > FINDING_THRESHOLDS.min_joint_unexplained_share * size
        and left < MAX_SPRING_UNEXPLAINED_SHARE * size
    ):
        text = f"The effort is that of a spring of {said}, which explains {100.0 * (1.0 - left / size):.0f} % of its "
        text += f"variance; the model of a joint explains {100.0 * max(1.0 - missed / size, 0.0):.0f} %."
        yield Verdict("wrong", text, do, weight=2.0)
        return
    found = {p.name: p for p in case.fit.estimate.parameters}
    if "inertia" not in found:
        return
    inertia = found["inertia"]
    is_unseen = inertia.at_bound or inertia.value < STANDARD_ERRORS * inertia.standard_error
    if "parallel_stiffness" in found and "gravity" not in found and is_unseen and stiffness > 0.0:
        text = f"The effort is that of a spring of {said} and shows no inertia: this is probably a spring with one end "
        yield Verdict("warning", f"{text}locked.", do, weight=2.0)
        return
    text = _weight_without_inertia(case)
    is_alike = left <= FINDING_THRESHOLDS.max_spring_alike_share * size
    if text and is_alike and case.fit.model.effort_unit == "N*m":
        text += f" this is probably a spring of {said}, which resembles gravity over small angles."
        yield Verdict("warning", text, do, weight=2.0)


def report_missing_inertia(case: JointCase) -> Iterator[Verdict]:
    """Report an effort that carries the weight and moves nothing, as in a machine that is guided by hand."""
    text = _weight_without_inertia(case)
    if text:
        text += " the drive only carries the weight, and something else, such as a guiding hand, moves the joint."
        do = "Record the joint while its drive alone moves it, or measure the force that guides it."
        yield Verdict("warning", text, do, weight=2.0)


def _weight_without_inertia(case: JointCase) -> str:
    """Return the beginning of a sentence on a weight whose inertia allows no lever, up to a colon; "" if it does."""
    fitted = [p for p in case.fit.predictions if p.split == "fitted"]
    found = {p.name: p for p in case.fit.estimate.parameters}
    if not fitted or not case.rotary or not {"inertia", "gravity"} <= set(found):
        return ""
    gravity, inertia = found["gravity"], found["inertia"]
    most = inertia.value + STANDARD_ERRORS * inertia.standard_error
    sure = gravity.value > STANDARD_ERRORS * gravity.standard_error
    missed = float(np.sum(np.concatenate([p.effort - p.predicted for p in fitted]) ** 2))
    acceleration = np.concatenate([p.acceleration for p in fitted])
    usual = USUAL_LEVER_M * gravity.value / GRAVITY * float(np.linalg.norm(acceleration))
    shown = usual > MIN_EXCESS * np.sqrt(missed)
    if not (sure and shown and np.isfinite(most) and most * GRAVITY < MIN_LEVER_M * gravity.value):
        return ""
    return (
        f"Gravity of {number(gravity.value, gravity.standard_error)} {unit_text(gravity.unit)} with an inertia below "
        f"{number(most, digits=2)} {unit_text(inertia.unit)} implies a mass less than {100 * MIN_LEVER_M:.0f} cm from "
        "the axis, which is implausible:"
    )


def _spring(fitted: Sequence[Prediction]) -> tuple[float, float, float]:
    """Return a spring's stiffness, its standard error, and the residual sum of squares with damping and friction."""
    parts = []
    for p in fitted:
        one = np.ones_like(p.position)
        parts.append(np.column_stack([p.position, p.acceleration, p.velocity, np.sign(p.velocity), one]))
    columns, effort = np.concatenate(parts), np.concatenate([p.effort for p in fitted])
    del parts  # as large as the columns
    solution, covariance, residual = solve_spring(columns, effort, [len(p.effort) for p in fitted])
    error = float(np.sqrt(max(covariance[0, 0], 0.0)))
    return float(solution[0]), error, float(residual @ residual)


def report_unknown_payload(case: JointCase) -> Iterator[Verdict]:
    """Report each unknown payload with its interval, or why it was not found."""
    for name, payload in case.payloads.items():
        if payload is None:
            yield Verdict(
                "warning",
                f"The payload of recording '{name}' cannot be estimated: this needs a rotary joint with free inertia "
                "and gravity, and efforts in N*m.",
                "State its mass and distance, or remove gravity and inertia from [model] known.",
            )
            continue
        share = f"It explains {100.0 * max(payload.explained, 0.0):.0f} % of the residual of the joint without payload."
        mass, distance, weight, inertia = (
            interval_text(p, case.level) for p in (payload.mass, payload.distance, payload.weight, payload.inertia)
        )
        if not payload.is_told:
            text = f"The payload of recording '{name}' is not identifiable: weight {weight}, inertia {inertia}."
            yield Verdict("warning", f"{text} {share}", "Check what else differs in it, or delete payload = {} there.")
            continue
        said, do = f"The payload of recording '{name}' has a weight of {weight} and an inertia of {inertia}", ""
        if payload.mass.trusted:
            said += f", equal to a point mass of {mass} at {distance}"
            do = f'To fit it with the others, write payload = {{ mass = "{payload.mass.value:.4g} kg", '
            do += f'distance = "{payload.distance.value:.4g} m" }} there.'
        yield Verdict("note", f"{said}. {share}", do)


WEAKNESS_REASONS = {
    "inertia": "it hardly accelerates",
    "gravity": "it hardly leaves its resting angle",
    "gravity_cosine": "its range of angles is too small",
    "parallel_stiffness": "its range of positions is too small",
    "offset": "friction in the two directions masks it",
} | {term.name: term.weak_because for term in TERMS}
"""Reason why recordings may not show a parameter; ``{speed}`` is the largest recorded speed."""

DEFAULT_REASON = "it never moves faster than {speed}"
"""Reason for a parameter without one of its own."""


OFTEN_ZERO_PARAMETERS = ("offset", "gravity_cosine")
"""Parameters that most joints lack. If they do not differ from zero, their intervals are reported without a warning."""


def report_weak_parameter(case: JointCase) -> Iterator[Verdict]:
    """Report each parameter of the best family that is on its bound or not different from zero."""
    top = max(float(np.abs(m.velocity).max()) for m in case.data.motions)
    speed = f"{np.degrees(top):.3g} deg/s" if case.rotary else f"{top:.3g} m/s"
    estimate = case.fit.headline.estimate
    for parameter in estimate.parameters:
        name = parameter.name.replace("_", " ")
        if parameter.influence == 0.0:
            continue  # without a Stribeck level the Stribeck velocity has no effect
        if parameter.at_bound:
            yield Verdict(
                "note",
                f"{name} is held at its physical bound ({parameter.value:.3g} {parameter.unit}): the effect "
                "is absent, or the model lacks another effect that biases it.",
            )
        elif (
            not parameter.identifiable
            and abs(parameter.value) < FINDING_THRESHOLDS.min_parameter_standard_errors * parameter.statistical_error
        ):
            # A neglected effect may also widen an interval; the motion is then not to blame.
            low, high = parameter.interval(case.level)
            if 0.5 * (high - low) * parameter.influence < FINDING_THRESHOLDS.negligible_effort_share:
                yield Verdict(
                    "note",
                    f"{name} is indistinguishable from zero: at most {max(abs(low), abs(high)):.2g} "
                    f"{parameter.unit}, too little to matter.",
                )
                continue
            missed = case.fit.fitted_effort_error
            why = _rival(estimate, parameter.name)
            if why is None and missed > FINDING_THRESHOLDS.max_fit_error_percent:
                why = f"the model misses {number(missed, digits=2)} % of the effort, which is more than it explains"
            why = why or WEAKNESS_REASONS.get(parameter.name, DEFAULT_REASON).format(speed=speed)
            yield Verdict(
                "note" if parameter.name in OFTEN_ZERO_PARAMETERS else "warning",
                f"{name} is not identifiable from these recordings: {why} (interval {low:.3g} to {high:.3g} "
                f"{parameter.unit}).",
                "" if "misses" in why else advice(parameter.name),
            )


def _rival(estimate: JointEstimate, name: str) -> str | None:
    """Return the parameter that hides another one, if their estimates are nearly proportional."""
    names = [p.name for p in estimate.parameters]
    sd = np.sqrt(np.diag(estimate.covariance))
    i = names.index(name)
    # What no recording shows has an infinite variance, and trades off against nothing that is known.
    known = np.isfinite(estimate.covariance[i]) & np.isfinite(sd * sd[i])
    size = np.where(known, np.maximum(sd * sd[i], np.finfo(float).tiny), 1.0)
    correlation = np.where(known, estimate.covariance[i], 0.0) / size
    correlation[i] = 0.0
    j = int(np.argmax(np.abs(correlation)))
    if abs(correlation[j]) < FINDING_THRESHOLDS.min_hiding_correlation:
        return None
    return f"its estimate is correlated at {correlation[j]:+.2f} with that of {names[j].replace('_', ' ')}"


ALWAYS_STATED_PARAMETERS = ("inertia", "gravity")
"""Parameters that every use of a model reads. A wide interval of theirs is a warning even if it changes little."""


def report_wide_interval(case: JointCase) -> Iterator[Verdict]:
    """Report the identifiable parameters of the headline whose intervals are wide, in one verdict."""
    estimate = case.fit.headline.estimate
    wide = [p for p in estimate.parameters if _is_wide(p, case.level)]
    if not wide:
        return
    matters = any(
        p.name in ALWAYS_STATED_PARAMETERS
        or _half_width(p, case.level) * p.influence > FINDING_THRESHOLDS.negligible_effort_share
        for p in wide
    )
    said = "; ".join(_sentence(p, case.level, estimate) for p in wide)
    first = min(wide, key=lambda p: p.name not in ALWAYS_STATED_PARAMETERS)
    yield Verdict("warning" if matters else "note", f"Wide confidence intervals: {said}.", advice(first.name))


def _half_width(parameter: Parameter, level: float) -> float:
    low, high = parameter.interval(level)
    return 0.5 * (high - low)


def _is_wide(parameter: Parameter, level: float) -> bool:
    """Whether a parameter differs from zero, has a valid interval, and the interval is wide."""
    read = parameter.identifiable and parameter.trusted and not parameter.at_bound and parameter.influence > 0.0
    return read and _half_width(parameter, level) > FINDING_THRESHOLDS.max_half_width_share * abs(parameter.value)


def _sentence(parameter: Parameter, level: float, estimate: JointEstimate) -> str:
    """Return a parameter with its interval and what widens it, in words."""
    half = _half_width(parameter, level)
    value = f"{number(parameter.value, half)} ± {number(half, digits=2)} {unit_text(parameter.unit)}".rstrip()
    cause = ""
    if estimate.discrepancy is not None and parameter.name in estimate.discrepancy.names:
        cause = estimate.discrepancy.of([parameter.name])[1][0]
    if not cause or parameter.statistical_error > FINDING_THRESHOLDS.min_statistical_share * parameter.standard_error:
        cause = "the motion excites it too little"
    else:
        cause = f"{cause} could bias it"
    name = parameter.name.replace("_", " ")
    return f"{name} ± {100.0 * half / abs(parameter.value):.0f} % ({value}; {cause})"


WORN_WEIGHT = 1e6
"""Weight of this verdict, which stands before all others of its kind."""


def report_worn_joint(case: JointCase) -> Iterator[Verdict]:
    """Report that recordings were worn, which makes every parameter one of robot and wearer together."""
    faults = wearer_faults(case.study)
    worn_faults = [fault for fault in faults if fault.kind == worn.KIND]
    echoes = [fault for fault in faults if fault.kind != worn.KIND]
    if worn_faults:
        files, found = _files_of(worn_faults), worn_faults[0].found
        text = f"The joint was probably worn in {files}: {found}. The channels were not shifted in time."
        yield Verdict("warning", text, f"{WORN_ADVICE}.", weight=WORN_WEIGHT)
    if echoes:
        text = (
            f"{echoes[0].channel} of {_files_of(echoes)} is a copy of the command, not a measurement: "
            f"{echoes[0].found}."
        )
        do = "Record the measured current of the drive, or a torque sensor."
        yield Verdict("warning", text, do, weight=WORN_WEIGHT)


def _files_of(faults: Sequence[Fault]) -> str:
    files = list(dict.fromkeys(fault.file for fault in faults))
    return files[0] if len(files) == 1 else f"{files[0]} and {len(files) - 1} more"


MAX_SUSPICIOUS_RANGE_RAD = 0.1
"""Largest range of motion that suggests radians declared as degrees [rad]: 5.7 rad, which few joints exceed."""

MIN_SUSPICIOUS_RANGE_RAD = 2.0 * np.pi
"""Smallest range of motion that suggests degrees [rad]. Few joints with a weight have such a range in radians."""


def report_implausible_effort(case: JointCase) -> Iterator[Verdict]:
    """Report torques whose weight and inertia require a mass that no worn robot has."""
    found = {p.name: p for p in case.fit.estimate.parameters}
    if not case.rotary or case.fit.model.effort_unit != "N*m" or not {"inertia", "gravity"} <= set(found):
        return
    gravity, inertia = found["gravity"], found["inertia"]
    least = abs(gravity.value) - STANDARD_ERRORS * gravity.standard_error
    text = doubt_torques(max(least, 0.0), inertia.value + STANDARD_ERRORS * inertia.standard_error)
    if text:
        yield Verdict("warning", f"{text}: implausible for a worn robot.", f"{UNIT_ADVICE}.", weight=9.0)


def report_missing_load_friction(case: JointCase) -> Iterator[Verdict]:
    """Report friction that grows with the load, where no fitted family has it: it biases inertia and gravity."""
    model = case.fit.model
    if any(LOAD_FEATURE in features_of(fit.model.names) for fit in case.fits.values()):
        return
    loaded = joint_model(
        LOAD_FAMILY, motion=model.motion, effort_unit=model.effort_unit, gravity=case.study.model.gravity,
        known=model.known, velocity_range=model.velocity_range, parallel_spring=PARALLEL_STIFFNESS in model.names,
    )  # fmt: skip
    try:
        crossed = {
            each.family: cross_validate_family(each, case.data, solve_family(each, case.data))
            for each in (model, loaded)
        }
    except IdentificationError:
        return
    own, other = (float(np.linalg.norm(np.concatenate(crossed[each.family]))) for each in (model, loaded))
    p_value = compare_held_out(crossed).p_values[model.family]
    if p_value < SIGNIFICANCE_LEVEL and own > FINDING_THRESHOLDS.min_error_reduction * other:
        yield Verdict(
            "warning",
            f"Friction grows with the load: in cross-validation, the '{LOAD_FAMILY}' family has an error "
            f"{100.0 * (1.0 - other / own):.2g} % smaller than '{model.family}'. Without it, inertia and gravity may "
            "be biased beyond their intervals.",
            f"Add '{LOAD_FAMILY}' to families in [model].",
            weight=7.0,
        )


LOAD_FAMILY = "load"
"""Family whose friction grows with the load, which is tried where no fitted family has such a term."""


def report_wrong_unit(case: JointCase) -> Iterator[Verdict]:
    """Report an angle that fits in the other unit, degrees or radians; the sine in gravity makes the difference."""
    if not has_free_gravity(case.fit.model):
        return
    position = case.data.reduced([m.position for m in case.data.motions])
    if np.ptp(position) > MIN_SUSPICIOUS_RANGE_RAD and case.fit.fitted_r2 <= FINDING_THRESHOLDS.failed_r2:
        stated, meant, factor, most = "rad", "deg", np.pi / 180.0, FINDING_THRESHOLDS.max_converted_error_ratio
    elif np.ptp(position) < MAX_SUSPICIOUS_RANGE_RAD:
        # A fit of tiny angles may be good: gravity is nearly linear there, and inertia absorbs the factor.
        stated, meant, factor, most = "deg", "rad", 180.0 / np.pi, FINDING_THRESHOLDS.max_turned_error_ratio
    else:
        return
    model = case.fits.get("symmetric", case.fit).model
    error, error_in_meant = _error(case, model, 1.0), _error(case, model, factor)
    if error_in_meant < most * error:
        words = {"rad": "radians", "deg": "degrees"}
        yield Verdict(
            "wrong",
            f"The position is probably in {words[meant]}, not in {words[stated]} as stated: the effort error is "
            f"{error_in_meant:.3g} % in {words[meant]} and {error:.3g} % in {words[stated]}.",
            f'Write unit = "{meant}" in [channels] position.',
            weight=11.5,
        )


def _error(case: JointCase, model: JointModel, factor: float) -> float:
    """Return the effort error [%] with the motion multiplied by a factor; infinite if it cannot be fitted."""
    motions = [
        replace(
            m,
            position=factor * m.position,
            velocity=factor * m.velocity,
            acceleration=factor * m.acceleration,
            filtering=replace(m.filtering, dead_band=factor * m.filtering.dead_band),
        )
        for m in case.data.motions
    ]
    try:
        data = stack(motions)
        residual = solve_family(model, data).residual
    except IdentificationError:
        return float("inf")
    return float(100.0 * np.linalg.norm(residual) / np.linalg.norm(data.target))
