"""An identified joint with a carriage written down: a model card per method, and every figure as a row."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import version

from ...fit.slider.slider_fit import METHODS, SliderEstimate, SliderFit
from ...models.card import write_card
from ...models.slider_card import SliderCard
from ...models.slider_joint import SliderJointModel
from ...recordings.results import ResultRow, checksum_of_all, write_rows
from ...recordings.study import Study

COMMAND = "identify"


def save_slider(study: Study, fit: SliderFit) -> list[ResultRow]:
    """Write `models/slider.<method>.json` for every method, and this command's rows.

    Parameters
    ----------
    study : Study
    fit : SliderFit

    Returns
    -------
    list of ResultRow
        What results.json now holds of this command.
    """
    study.models_dir.mkdir(exist_ok=True)
    for method, estimate in fit.estimates.items():
        write_card(study.models_dir / f"slider.{method}.json", slider_card(study, fit, estimate))
    rows = list(slider_rows(fit))
    write_rows(study.results_path, COMMAND, rows)
    return rows


def slider_card(study: Study, fit: SliderFit, estimate: SliderEstimate) -> SliderCard:
    """The model card of one method's estimate.

    Parameters
    ----------
    study : Study
    fit : SliderFit
    estimate : SliderEstimate

    Returns
    -------
    SliderCard
    """
    level = study.model.confidence
    model = estimate.model
    return SliderCard(
        study=fit.study,
        family=estimate.method,
        method=METHODS[estimate.method],
        motion="rotary",
        effort_unit="N*m",
        lifts=fit.lifts,
        parameters=tuple(p.on_card(level) for p in estimate.parameters),
        covariance=tuple(tuple(float(x) for x in row) for row in estimate.covariance),
        known=dict(model.known) if isinstance(model, SliderJointModel) else {},
        rail=fit.rail,
        drive={"gain": fit.gain},
        heldout_error=fit.judged_error(estimate.method) if fit.judged_split == "heldout" else None,
        residual_sd=estimate.residual_sd,
        processing=fit.filter_note,
        confidence=level,
        notes=estimate.notes,
        checksums=dict(fit.checksums),
        pellucid=version("pellucid"),
        joint=study.rig.joint,
    )


def slider_rows(fit: SliderFit) -> Iterator[ResultRow]:
    """Every figure of a fit: `<study>.<method>.<figure>[.<recording>]`, and `<study>.slider.<recording>` for where the
    carriage was."""
    together = checksum_of_all(fit.checksums.values())
    plain = ResultRow("", None, "1", COMMAND, "fitted", together, fit.filter_note)
    for p in fit.static:
        yield replace(plain, id=f"{fit.study}.static.{p.name}", value=p.value, unit=p.unit)
    for method, estimate in fit.estimates.items():
        head = f"{fit.study}.{method}"
        trials, error = len(fit.judged(method)), fit.judged_error(method)
        note = f"mean over {trials} trials of the mean absolute error while the joint moves; {fit.filter_note}"
        own = replace(plain, split=fit.judged_split, note=note)
        yield replace(own, id=f"{head}.error", value=error, unit="A")
        yield replace(own, id=f"{head}.torque_error", value=fit.gain * error, unit="N*m")
        for p in estimate.parameters:
            low, high = p.interval()
            note = f"95 % interval {low:.6g} to {high:.6g}" + ("; at its bound" if p.at_bound else "")
            yield replace(plain, id=f"{head}.{p.name}", value=p.value, unit=p.unit, note=f"{note}; {fit.filter_note}")
        for e in fit.errors[method]:
            one = replace(plain, split=e.split, data_checksum=fit.checksums.get(e.recording))
            yield replace(one, id=f"{head}.error.{e.recording}", value=e.current, unit="A")
    split = {m.recording: m.split for m in fit.motions}
    for place in fit.geometry.placements:
        yield ResultRow(
            f"{fit.study}.slider.{place.recording}",
            place.slider,
            "m",
            COMMAND,
            split.get(place.recording, "fitted"),
            fit.checksums.get(place.recording),
            "from the markers" if place.optical else "by a ruler",
        )
