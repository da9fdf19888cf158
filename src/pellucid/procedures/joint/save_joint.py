"""An identified joint written down: one model card per family, and every figure as a row of results.json."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import version

import numpy as np

from ...fit.joint.friction_family import FamilyFit
from ...fit.joint.joint_estimate import JointEstimate
from ...fit.joint.replay import Simulation, relative_error
from ...fit.slider.slider_fit import SliderFit
from ...models.card import ModelCard, write_card
from ...recordings.results import ResultRow, checksum_of_all, write_rows
from ...recordings.study import Study
from ...signals.effort import drive_model
from ..slider.save_slider import save_slider
from .joint_fit import JointFit

COMMAND = "identify"


def save(study: Study, fit: JointFit | SliderFit) -> list[ResultRow]:
    """Write `models/joint.json` (the best family), `models/joint.<family>.json`, and this command's rows.

    Parameters
    ----------
    study : Study
    fit : JointFit or SliderFit
        The latter is written by `save_slider`.

    Returns
    -------
    list of ResultRow
        What results.json now holds of this command.
    """
    if isinstance(fit, SliderFit):
        return save_slider(study, fit)
    study.models_dir.mkdir(exist_ok=True)
    for name, family in fit.families.items():
        write_card(study.models_dir / f"joint.{name}.json", card_of(study, fit, family))
    write_card(study.models_dir / "joint.json", card_of(study, fit, fit.families[fit.best]))
    rows = list(rows_of(fit))
    write_rows(study.results_path, COMMAND, rows)
    return rows


def card_of(study: Study, fit: JointFit, family: FamilyFit) -> ModelCard:
    """The model card of one family's least-squares estimate.

    Parameters
    ----------
    study : Study
    fit : JointFit
    family : FamilyFit

    Returns
    -------
    ModelCard
    """
    level = study.model.confidence
    drive = drive_model(study.rig)
    fitted = [p for p in family.predictions if p.split == "fitted"]
    error = family.heldout_effort_error
    return ModelCard(
        study=fit.study,
        family=family.family,
        method=family.estimate.method,
        motion=fit.motion,
        effort_unit=fit.effort_unit,
        lifts=fit.lifts,
        parameters=tuple(p.on_card(level) for p in family.estimate.parameters),
        covariance=tuple(tuple(float(x) for x in row) for row in family.estimate.covariance),
        known=dict(family.model.known),
        velocity_range=max((float(np.abs(p.velocity).max()) for p in fitted), default=0.0),
        drive={"gain": drive.gain, "back_emf": drive.back_emf},
        heldout_effort_error=float(error) if np.isfinite(error) else None,
        processing=fit.filter_note,
        confidence=level,
        checksums=dict(fit.checksums),
        pellucid=version("pellucid"),
        joint=study.rig.joint,
    )


def rows_of(fit: JointFit) -> Iterator[ResultRow]:
    """Every figure of a fit: `<study>.<family>.<figure>[.<recording>[.<signal>]]`, other estimators as
    `<study>.<family>.<method>.<figure>`."""
    together = checksum_of_all(fit.checksums.values())
    if fit.drive_constant is not None:
        p = fit.drive_constant
        yield ResultRow(
            f"{fit.study}.drive.constant", p.value, p.unit, COMMAND, "fitted", together, _interval_note(p.interval())
        )
    for name, family in fit.families.items():
        head = f"{fit.study}.{name}"
        plain = ResultRow("", None, "1", COMMAND, "fitted", together, fit.filter_note)
        yield from _estimate_rows(head, family.estimate, plain)
        yield replace(plain, id=f"{head}.r2", value=family.fitted_r2)
        if np.isfinite(family.heldout_r2):
            held = replace(plain, split="heldout")
            yield replace(held, id=f"{head}.heldout.effort_error", value=family.heldout_effort_error, unit="%")
            yield replace(held, id=f"{head}.heldout.r2", value=family.heldout_r2)
        for p in family.predictions:
            own = replace(plain, split=p.split, data_checksum=fit.checksums[p.recording])
            yield replace(own, id=f"{head}.effort_error.{p.recording}", value=p.effort_error, unit="%")
            yield replace(own, id=f"{head}.prediction_coverage.{p.recording}", value=100.0 * p.coverage, unit="%")
        for method, estimate in family.others.items():
            yield from _estimate_rows(f"{head}.{method}", estimate, plain)
        for method, simulations in family.simulations.items():
            prefix = head if method == "ls" else f"{head}.{method}"
            yield from _simulation_rows(prefix, fit, simulations, plain)


def _interval_note(interval: tuple[float, float]) -> str:
    return f"95 % interval {interval[0]:.6g} to {interval[1]:.6g}"


def _estimate_rows(head: str, estimate: JointEstimate, plain: ResultRow) -> Iterator[ResultRow]:
    for p in estimate.parameters:
        note = f"{_interval_note(p.interval())}; {plain.note}"
        yield replace(plain, id=f"{head}.{p.name}", value=p.value, unit=p.unit, note=note)
        yield replace(plain, id=f"{head}.{p.name}.relative_sd", value=p.relative_sd, unit="%")
    yield replace(plain, id=f"{head}.condition_number", value=estimate.condition_number)
    if estimate.whiteness is not None:
        yield replace(plain, id=f"{head}.residual_lag1", value=estimate.whiteness.lag1)


def _simulation_rows(
    head: str, fit: JointFit, simulations: tuple[Simulation, ...], plain: ResultRow
) -> Iterator[ResultRow]:
    plain = replace(plain, note=f"measured and simulated signals through the same filter; {plain.note}")
    unit, scale = ("deg", 180.0 / np.pi) if fit.motion == "rotary" else ("mm", 1e3)
    for recording in dict.fromkeys(s.recording for s in simulations):
        for mode in ("closed_loop", "openloop"):
            parts = [s for s in simulations if s.recording == recording and s.mode == mode]
            if not parts:
                continue
            own = replace(plain, split=parts[0].split, data_checksum=fit.checksums[recording])
            if mode == "closed_loop":
                for signal in parts[0].errors:
                    value = _pooled_error(parts, signal)
                    yield replace(own, id=f"{head}.sim.{recording}.{signal}", value=value, unit="%")
            rmse, mae = _pooled_position(parts)
            prefix = f"{head}.{'openloop' if mode == 'openloop' else 'sim'}.{recording}"
            yield replace(own, id=f"{prefix}.rmse_{unit}", value=scale * rmse, unit=unit)
            yield replace(own, id=f"{prefix}.mae_{unit}", value=scale * mae, unit=unit)
    if fit.motion == "rotary":
        held = [s for s in simulations if s.split == "heldout" and s.mode == "openloop"]
        if held:
            _, mae = _pooled_position(held)
            yield replace(plain, id=f"{head}.heldout.angle_mae_deg", value=scale * mae, unit="deg", split="heldout")


def _pooled_error(parts: list[Simulation], signal: str) -> float:
    measured = np.concatenate([s.measured[signal] for s in parts])
    simulated = np.concatenate([s.simulated[signal] for s in parts])
    return relative_error(measured, simulated)


def _pooled_position(parts: list[Simulation]) -> tuple[float, float]:
    difference = np.concatenate([s.measured["position"] - s.simulated["position"] for s in parts])
    return float(np.sqrt(np.mean(difference**2))), float(np.mean(np.abs(difference)))
