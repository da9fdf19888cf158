"""Findings on a robot, functions that yield verdicts: bodies, friction, ripple, errors, gains, payloads, signs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...models.causes import PARALLEL_SPRING
from ...models.estimates import Verdict
from ...study.cause_words import cause_sentence
from ...study.procedures.findings import MAX_GOOD_ERROR
from ..fit.tree_estimate import IDENTIFIED_VERDICT, NOT_IDENTIFIABLE_VERDICT, parameter_verdicts
from .joint_answers import MIN_MOVING_SHARE
from .tree_result import ROW_KIND_DESCRIPTIONS, TreeResult, errors_by_recording, unidentified_parameters


@dataclass(frozen=True)
class FindingThresholds:
    """When a finding warns."""

    max_negligible_loss: float = 0.1  # largest increase of the mean error that is negligible, in percentage points
    # A joint is predicted much worse if its error exceeds this multiple of the fitted error. Chosen by judgement; no
    # measurement is recorded.
    max_error_ratio: float = 1.5
    # Smallest share of standard errors that should agree with the jackknife's within a factor of two [%].
    min_agreeing_percent: float = 80.0
    max_mass_error_percent: float = 5.0  # largest error of an identified mass that counts as correct [%]
    # A recording disagrees only if its error exceeds this multiple of the best recording's.
    min_error_ratio: float = 1.5
    # A recording disagrees only if its error exceeds the best recording's by more than this [% of the effort].
    min_error_difference_percent: float = 2.0


FINDING_THRESHOLDS = FindingThresholds()


def report_bodies(case: TreeResult) -> Iterator[Verdict]:
    """Report the increase of the error, and models that failed."""
    for model, why in case.failures.items():
        yield Verdict("warning", f"No {model} model: {why}.", "Check masses, signs and gears.")
    best, bodies = case.errors_of("best", case.judged), case.errors_of("consistent", case.judged)
    if best is None or bodies is None:
        return
    loss = bodies.mean - best.mean
    notes_text = "; ".join(case.models["consistent"].notes)
    text = "Physically consistent inertias change the mean error on "
    text += f"{ROW_KIND_DESCRIPTIONS[case.judged]} by {loss:+.2g} percentage points"
    text += f" ({notes_text})." if notes_text else "."
    if loss <= FINDING_THRESHOLDS.max_negligible_loss:
        yield Verdict("good", text)
    else:
        yield Verdict(
            "warning", text, "Check masses, signs and gears: the efforts imply impossible inertias.", weight=loss
        )


def report_causes(case: TreeResult) -> Iterator[Verdict]:
    """Report each cause of what the model misses at a joint, and each parallel spring that is a term of it."""
    for cause in case.causes:
        yield Verdict("note", cause_sentence(cause), SPRING_ADVICE if cause.name == PARALLEL_SPRING else "", weight=6.0)


SPRING_ADVICE = (
    "The model has a separate term for it. Model cards and controllers of several joints have no such term: to "
    "compensate the joint, record it without the hose or cable."
)
"""Advice on a parallel spring that was found."""


def report_drive_ripple(case: TreeResult) -> Iterator[Verdict]:
    """Report each drive with a ripple."""
    ripple_texts = [
        f"{case.names[r.motor]} {r.amplitude:.2g} {case.effort_units[r.motor]}, {r.order:.4g} times in a turn"
        for r in case.best.ripples
    ]
    if ripple_texts:
        text = (
            "The drives have torque ripple, which the model includes (per turn of the motor): "
            f"{'; '.join(ripple_texts)}."
        )
        yield Verdict("note", text)


def report_hardly_moved(case: TreeResult) -> Iterator[Verdict]:
    """Report the joints that hardly move."""
    for joint, share in zip(case.names, case.moving_shares, strict=True):
        if share < MIN_MOVING_SHARE:
            yield Verdict(
                "warning",
                f"Joint {joint} moves in only {100.0 * share:.2g} % of the fitted rows, which determine its friction.",
                "Record motion of this joint in both directions, slowly and fast.",
                weight=MIN_MOVING_SHARE - share,
            )


def report_held_by_a_bound(case: TreeResult) -> Iterator[Verdict]:
    """Report the parameters on a physical bound."""
    named = (p.name.rpartition(".") for p in case.best.parameters.values() if p.at_bound)
    held = [f"{number} of {of}".replace("_", " ") for of, _, number in named]
    if held:
        text = f"On a physical bound: {', '.join(held)}. The effect is absent, or another term represents it."
        yield Verdict("note", text, weight=len(held))


def report_heldout_worse(case: TreeResult) -> Iterator[Verdict]:
    """Report joints with large, or much larger, errors on held-out data."""
    fitted, judged = case.errors_of("best", "fitted"), case.errors_of("best", case.judged)
    if case.judged == "fitted":
        yield Verdict(
            "warning",
            "No data were held out, so the model is not validated.",
            "Record more, or mark a recording to validate.",
        )
        return
    worse = {
        joint: (a, b)
        for joint, a, b in zip(case.names, fitted.each, judged.each, strict=True)
        if b > FINDING_THRESHOLDS.max_error_ratio * a
    }
    for joint, (a, b) in worse.items():
        yield Verdict(
            "warning",
            f"At {joint} the error is {b:.2g} % on {ROW_KIND_DESCRIPTIONS[case.judged]} and {a:.2g} % in the fitted "
            "recordings: the model overfits, or the machine has changed.",
            "Record more motion of that kind, or compare recordings of one day.",
            weight=b / a,
        )
    large = {
        joint: error
        for joint, error in zip(case.names, judged.each, strict=True)
        if error > MAX_GOOD_ERROR and joint not in worse
    }
    for joint, error in large.items():
        yield Verdict(
            "warning",
            f"At {joint} the error is {error:.2g} % on {ROW_KIND_DESCRIPTIONS[case.judged]}, more than the "
            f"{MAX_GOOD_ERROR:g} % of a good prediction.",
            "Look for an effect that the model lacks: load friction, ripple, a cable, or very small efforts.",
            weight=error / 100.0,
        )
    if not worse and not large:
        text = (
            f"On {ROW_KIND_DESCRIPTIONS[case.judged]}, the error of every joint is at most {MAX_GOOD_ERROR:g} % and at "
            f"most {FINDING_THRESHOLDS.max_error_ratio:g} times that in the fitted recordings."
        )
        yield Verdict("good", text)


def report_honest_intervals(case: TreeResult) -> Iterator[Verdict]:
    """Report the share of standard errors that agree."""
    if case.jackknife is None:
        return
    share = case.jackknife.share_within
    text = f"{share:.3g} % of the standard errors agree with the jackknife over segments within a factor of two"
    text += f"; ordinary least-squares errors are {case.jackknife.textbook_ratio:.2g} times too small."
    if share >= FINDING_THRESHOLDS.min_agreeing_percent:
        yield Verdict("good", text)
    else:
        do = "Record longer: there are too few segments to estimate standard errors."
        yield Verdict("warning", text, do)


def report_load_friction(case: TreeResult) -> Iterator[Verdict]:
    """Report the joints with load friction."""
    shares = {
        joint: p.value for joint in case.names if (p := case.best.parameters.get(f"{joint}.load")) and not p.refused
    }
    if shares:
        shares_text = ", ".join(f"{100.0 * share:.2g} % of the load at {joint}" for joint, share in shares.items())
        yield Verdict("note", f"Friction grows with the load: {shares_text}.", weight=max(shares.values()))


def report_payload(case: TreeResult) -> Iterator[Verdict]:
    """Report each identified payload, compared with its stated mass."""
    for p in case.payloads:
        if p.mass.refused:
            do = "Move the link that carries it in more directions."
            yield Verdict("note", f"The motion of {p.recording} does not identify the mass of its payload.", do)
            continue
        if p.tests == "nothing":
            yield Verdict(
                "note",
                f"The payload of {p.recording} was used to estimate the gains of the drives, so that it cannot test "
                "them.",
                'Record another known payload with use = "validate": its mass is then predicted.',
            )
            continue
        text = f"The estimated payload of {p.recording} is {p.mass.value:.4g} kg"
        if p.known is None:
            yield Verdict("note", f"{text}.")
            continue
        text += ", with gains from the other payloads" if p.tests == "gains of other payloads" else ""
        text += f", {p.error:.2g} % from the stated {p.known:.4g} kg."
        if p.error <= FINDING_THRESHOLDS.max_mass_error_percent:
            yield Verdict("good", text, weight=p.error)
        else:
            do = "Check the gains of the drives; [tree] gains states their source."
            yield Verdict("warning", text, do, weight=p.error)


def report_recordings_disagree(case: TreeResult) -> Iterator[Verdict]:
    """Report the joints at which fitted recordings disagree."""
    fitted = {name: each for name, (use, each) in errors_by_recording(case).items() if use == "fit"}
    if len(fitted) < 2:
        return
    for k, joint in enumerate(case.names):
        errors = {name: each[k] for name, each in fitted.items() if np.isfinite(each[k])}
        worst, best = max(errors, key=errors.get), min(errors, key=errors.get)
        if errors[worst] > max(
            FINDING_THRESHOLDS.min_error_ratio * errors[best],
            errors[best] + FINDING_THRESHOLDS.min_error_difference_percent,
        ):
            yield Verdict(
                "warning",
                f"One model for all recordings has an error of {errors[worst]:.2g} % of {joint}'s effort in {worst} "
                f"and {errors[best]:.2g} % in {best}: something differs, such as the temperature or a payload.",
                "Identify each recording separately and compare, or state the difference in study.toml.",
                weight=errors[worst] / errors[best],
            )


def report_sign_in_doubt(case: TreeResult) -> Iterator[Verdict]:
    """Report the evidence against a sign; predictions for other motions may then be far off."""
    for doubt in case.doubts:
        yield Verdict("warning", f"A sign may be wrong: {doubt}.")


def report_unknown_gain(case: TreeResult) -> Iterator[Verdict]:
    """Report the drives with unknown gains."""
    unknown = [joint for joint, (_, _, known) in zip(case.names, case.gains, strict=True) if not known]
    if unknown:
        several = len(case.names) > 1
        yield Verdict(
            "warning" if several else "note",
            f"The drive gains of {', '.join(unknown)} are unknown: parameters of these joints are per unit of the "
            "drive, not in newton metres."
            + (" Joints that carry the same bodies are fitted as if their gains were equal." if several else ""),
            'Write a torque_constant in [rig.joints.drive], or [tree] gains = "desired" or "payload".',
        )


def report_weak_numbers(case: TreeResult) -> Iterator[Verdict]:
    """Report the parameters that do not differ from 0, and those that the recordings do not determine."""
    weak = {joint: ", ".join(own) for k, joint in enumerate(case.names) if (own := unidentified_parameters(case, k))}
    if weak:
        names_text = "; ".join(f"{joint}: {names}" for joint, names in weak.items())
        do = "Record these joints slowly and fast, in both directions, with different loads."
        yield Verdict("note", f"Uncertain parameters of single joints: {names_text}.", do, weight=len(weak))
    of_joints = {f"{joint}." for joint in case.names}
    bodies = {
        n: s for n, s in parameter_verdicts(case.best).items() if not any(n.startswith(joint) for joint in of_joints)
    }
    identified_count = sum(state == IDENTIFIED_VERDICT for state in bodies.values())
    lost = sum(state == NOT_IDENTIFIABLE_VERDICT for state in bodies.values())
    text = (
        f"{identified_count} of {len(bodies)} combinations of the bodies' parameters are significantly different from 0"
    )
    text += f"; {lost} are not identifiable." if lost else "."
    do = (
        ""
        if identified_count > 0.5 * len(bodies)
        else "Record faster motion of all joints at once, over larger ranges."
    )
    yield Verdict("warning" if lost else "note", text, do, weight=lost)
