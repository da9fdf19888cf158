"""Plain sentences: what these recordings show, what they cannot show, and what to record next."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..._errors import IdentificationError
from ...fit.joint.friction_family import FamilyFit
from ...fit.joint.friction_solver import solve_family
from ...fit.joint.joint_estimate import JointEstimate
from ...fit.parameter import Parameter, Verdict
from ...fit.regression import Stack
from ...models.joint import UNITS, JointModel
from ...recordings.study import Study

MEANING = {
    "inertia": "it hardly accelerates",
    "gravity": "it hardly leaves its resting angle",
    "gravity_cosine": "its range of angles is too small",
    "stribeck": "it spends too little time just above zero speed",
    "stribeck_velocity": "it spends too little time just above zero speed",
    "load_friction": "the load hardly changes",
    "load_motoring": "the load hardly changes",
    "load_generating": "the load hardly changes",
    "coulomb": "the other friction terms explain what it would",
    "coulomb_positive": "the other friction terms explain what it would",
    "coulomb_negative": "the other friction terms explain what it would",
    "offset": "friction in the two directions hides it",
}
NEGLIGIBLE = 0.05  # share of the RMS effort below which an interval around zero settles the matter
INTERVAL_SLACK = 0.05  # share of held-out samples a prediction interval may miss beyond its level
METHODS = {
    "wls": "Weighted least squares",
    "irls": "Robust least squares",
    "iv": "The instrumental-variable estimate",
    "didim": "DIDIM",
    "output_error": "The output-error fit",
}
TRADE_OFF = 0.9  # correlation of two estimates above which one is said to hide the other


def sign_error(model: JointModel, data: Stack, channel: str) -> None:
    """Refuse recordings in which the drive's effort acts against the motion it causes."""
    found = solve_family(model, data, consistent=False)
    values = dict(zip(model.names, found.values, strict=True))
    noise = np.sqrt(np.mean(found.residual**2) / np.maximum(np.sum(found.jacobian**2, axis=0), 1e-300))
    sure = {n for n, v, s in zip(model.names, found.values, noise, strict=True) if v < -10.0 * s}
    work = sum(float(np.sum(m.effort * m.velocity)) / m.fs for m in data.motions)
    if work < 0.0 and "inertia" in sure:
        unit = "J" if model.effort_unit in ("N*m", "N") else f"{model.effort_unit}*{UNITS[model.motion]['position']}"
        raise IdentificationError(
            f"the drive takes {-work:.3g} {unit} of work out of the joint and the inertia comes out negative "
            f"({values['inertia']:.3g} {model.unit('inertia')}): the sign of the drive or of the position is reversed; "
            f"set sign = -1 on channel '{channel}' or 'position' in study.toml"
        )


def verdicts(
    study: Study,
    fits: Mapping[str, FamilyFit],
    best: str,
    failures: Mapping[str, str],
    data: Stack,
    constant: Parameter | None,
    no_constant: str = "",
) -> tuple[Verdict, ...]:
    """Everything a reader must know before using the numbers."""
    found: list[Verdict] = []
    fit = fits[best]
    rotary = study.rig.motion == "rotary"
    if np.isfinite(fit.heldout_effort_error):
        found.append(
            Verdict(
                "good" if fit.heldout_r2 > 0.8 else "warning",
                f"The '{best}' family predicts effort it has never seen with an error of "
                f"{fit.heldout_effort_error:.2g} % (R2 {fit.heldout_r2:.3f}); on the fitted recordings "
                f"{fit.fitted_effort_error:.2g} %.",
            )
        )
        found += _comparison(fits, best)
        found += _interval(fit, study.model.confidence)
    else:
        found.append(
            Verdict(
                "warning",
                'No recording is held out (use = "validate"): nothing here says how the model predicts new data.',
            )
        )
    top = max(float(np.abs(m.velocity).max()) for m in data.motions)
    speed = f"{np.degrees(top):.3g} deg/s" if rotary else f"{top:.3g} m/s"
    for parameter in fit.estimate.parameters:
        name = parameter.name.replace("_", " ")
        if parameter.influence == 0.0:
            continue  # the velocity of a Stribeck level that came out zero says nothing
        if parameter.at_bound:
            found.append(
                Verdict(
                    "note",
                    f"{name} is held at its physical bound ({parameter.value:.3g} {parameter.unit}): there is none "
                    "to see, or the model misses something that pushes it there.",
                )
            )
        elif not parameter.identifiable:
            low, high = parameter.interval(study.model.confidence)
            if 0.5 * (high - low) * parameter.influence < NEGLIGIBLE:
                found.append(
                    Verdict(
                        "note",
                        f"{name} is indistinguishable from zero: at most {max(abs(low), abs(high)):.2g} "
                        f"{parameter.unit}, too little to matter.",
                    )
                )
                continue
            why = _rival(fit.estimate, parameter.name) or MEANING.get(
                parameter.name, f"it never moves faster than {speed}"
            )
            found.append(
                Verdict(
                    "warning",
                    f"{name} is not identifiable from these recordings: {why} (interval {low:.3g} to {high:.3g} "
                    f"{parameter.unit}).",
                )
            )
    if fit.estimate.scaled_condition_number > 100.0:
        found.append(
            Verdict(
                "warning",
                "The regressor's columns are nearly collinear (condition number "
                f"{fit.estimate.scaled_condition_number:.0f} with columns of equal length): some parameters trade off "
                "against each other. A richer motion helps.",
            )
        )
    white = fit.estimate.whiteness
    if white is not None and white.effective_share < 0.5:
        found.append(
            Verdict(
                "note",
                "Residuals are coloured: 100 samples carry about as much as "
                f"{max(100 * white.effective_share, 1):.0f} independent ones. Intervals allow for it; textbook "
                "intervals would be too narrow.",
            )
        )
    if study.rig.drive.kind != "torque" and study.rig.drive.constant is None:
        unit = fit.model.effort_unit
        if constant is not None:
            low, high = constant.interval(study.model.confidence)
            found.append(
                Verdict(
                    "good",
                    f"The drive gives {constant.value:.4g} {constant.unit} (interval {low:.4g} to {high:.4g}), from "
                    "the known payloads: put it into study.toml to have results in SI.",
                )
            )
        elif no_constant:
            found.append(Verdict("warning", f"{no_constant[0].upper()}{no_constant[1:]}."))
        else:
            found.append(
                Verdict(
                    "note",
                    f"No drive constant is known, so parameters are per {'ampere' if unit == 'A' else 'volt'}: shapes "
                    "and ratios are meaningful, absolute masses are not. A recording with a known payload gives it.",
                )
            )
    if "load_friction" in fit.model.names:
        found.append(
            Verdict(
                "note",
                "Without a known load, motoring and generating load friction cannot be told apart from the load "
                "itself: one coefficient stands for both, and inertia and gravity are scaled accordingly.",
            )
        )
    for family, why in failures.items():
        found.append(Verdict("note", f"The '{family}' family could not be fitted: {why}."))
    found += [
        Verdict("warning", f"{METHODS.get(what, what)} came to nothing: {why}.") for what, why in fit.failures.items()
    ]
    found += _methods(fit)
    return tuple(found)


def _interval(fit: FamilyFit, level: float) -> list[Verdict]:
    """Whether the prediction interval, made on fitted residuals, holds on what was held out."""
    held = [p for p in fit.predictions if p.split == "heldout"]
    share = np.average([p.coverage for p in held], weights=[len(p.time) for p in held])
    if share >= level - INTERVAL_SLACK:
        return []
    return [
        Verdict(
            "warning",
            f"The {100 * level:.3g} % prediction interval holds only {100 * share:.0f} % of held-out samples: those "
            "recordings ask for something that the fitted ones do not show.",
        )
    ]


def _comparison(fits: Mapping[str, FamilyFit], best: str) -> list[Verdict]:
    plain = fits.get("symmetric")
    if plain is None or best == "symmetric":
        if plain is not None and len(fits) > 1:
            return [Verdict("note", "No richer friction family predicts held-out effort better by 3 % or more.")]
        return []
    gain = 100.0 * (1.0 - fits[best].heldout_effort_error / plain.heldout_effort_error)
    return [
        Verdict(
            "good" if gain > 2.0 else "note",
            f"It is {gain:.2g} % better on held-out effort than symmetric friction "
            f"({plain.heldout_effort_error:.3g} %)" + ("." if gain > 2.0 else ": too little to matter."),
        )
    ]


def _rival(estimate: JointEstimate, name: str) -> str | None:
    """The parameter that hides another one, where two estimates are nearly proportional."""
    names = [p.name for p in estimate.parameters]
    sd = np.sqrt(np.diag(estimate.covariance))
    i = names.index(name)
    correlation = estimate.covariance[i] / np.maximum(sd * sd[i], np.finfo(float).tiny)
    correlation[i] = 0.0
    j = int(np.argmax(np.abs(correlation)))
    if abs(correlation[j]) < TRADE_OFF:
        return None
    return f"it trades off against {names[j].replace('_', ' ')} (correlation {correlation[j]:+.2f})"


def _methods(fit: FamilyFit) -> list[Verdict]:
    """Where an estimator disagrees with least squares by more than both intervals allow."""
    found = []
    for name, other in fit.others.items():
        apart = [
            q.name.replace("_", " ")
            for q in other.parameters
            for p in (fit.estimate[q.name],)
            if abs(p.value - q.value) > 3.0 * np.hypot(p.standard_error, q.standard_error) and not q.at_bound
        ]
        if apart:
            found.append(
                Verdict(
                    "note",
                    f"{METHODS.get(name, name)} disagrees with ordinary least squares on {', '.join(apart)} by more "
                    "than three standard errors: the friction model is not the whole truth, and each method weighs "
                    "the misfit differently.",
                )
            )
    return found
