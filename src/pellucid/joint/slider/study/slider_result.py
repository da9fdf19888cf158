"""The result of `identify` on a joint with a carriage: a fit with its tables, rows and cards."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from importlib.metadata import version

from ....models.slider_joint import SliderCard, SliderJointModel
from ....study.answer import Answer
from ....study.procedures.result import FigureTable, ParameterTable, Result
from ....study.results import ResultRow, combined_checksum
from ....study.study import Study
from ..slider_fit import SLIDER_METHODS, SliderEstimate, SliderFit
from .slider_answer import slider_answer

COMMAND_NAME = "identify"
"""Every row names this command as its origin."""

PRINTED_METHODS = ("load", "dissociated")
"""Methods whose parameters the terminal prints, the coherent body's first: they are the estimates to use."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SliderResult(Result):
    """Everything `identify` found on a joint with a carriage; ``fit["load"]`` is one method's estimate."""

    fit: SliderFit = field(repr=False)

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return slider_answer(self.fit)


def slider_result(study: Study, fit: SliderFit) -> SliderResult:
    """Return a fit with its tables, rows and cards."""
    errors = {name: fit.evaluated_error(name) for name in fit.estimates}
    rows = tuple((SLIDER_METHODS[n], len(fit[n].values), e, e * fit.gain) for n, e in errors.items())
    printed = tuple(i for i, name in enumerate(errors) if name in PRINTED_METHODS)
    return SliderResult(
        study=fit.study,
        headline=slider_answer(fit).sentence,
        tables=(
            FigureTable("Methods", ("method", "parameters", "error A", "error N·m"), rows, chosen_rows=printed),
            *(ParameterTable(SLIDER_METHODS[name], fit[name].parameters) for name in PRINTED_METHODS),
            *axis_tables(fit),
        ),
        verdicts=fit.verdicts,
        rows=tuple(slider_rows(fit)),
        cards={f"slider.{name}": slider_card(study, fit, found) for name, found in fit.estimates.items()},
        checksums=fit.checksums,
        confidence=study.model.confidence,
        fit=fit,
    )


def axis_tables(fit: SliderFit) -> tuple[FigureTable, ...]:
    """Return the table of the offset between the wearer's and the robot's axis, if a recording shows it."""
    if not fit.axis_offsets:
        return ()
    rows: list[tuple[str | float, ...]] = []
    for name, o in fit.axis_offsets.items():
        rows.append((name, *(1e3 * x for x in (o.along, *o.interval[0], o.across, *o.interval[1]))))
    head = ("recording", "along mm", "from", "to", "across mm", "from", "to")
    return (FigureTable("Offset of the wearer's axis from the robot's", head, tuple(rows)),)


def slider_card(study: Study, fit: SliderFit, estimate: SliderEstimate) -> SliderCard:
    """Return the model card of one method's estimate."""
    level = study.model.confidence
    model = estimate.model
    return SliderCard(
        study=fit.study,
        family=estimate.method,
        method=SLIDER_METHODS[estimate.method],
        motion="rotary",
        effort_unit="N*m",
        lifts=fit.lifts,
        parameters=tuple(p.on_card(level) for p in estimate.parameters),
        covariance=tuple(map(tuple, estimate.covariance.tolist())),
        statistical=() if estimate.statistical is None else tuple(map(tuple, estimate.statistical.tolist())),
        known=dict(model.known) if isinstance(model, SliderJointModel) else {},
        rail=fit.rail,
        drive={"gain": fit.gain},
        heldout_error=fit.evaluated_error(estimate.method) if fit.evaluated_split == "heldout" else None,
        residual_sd=estimate.residual_sd,
        processing=fit.filter_note,
        confidence=level,
        notes=estimate.notes,
        checksums=dict(fit.checksums),
        pellucid=version("pellucid"),
        joint=study.rig.joint,
        presliding_travel=None if fit.travel is None else fit.travel.on_card(level),
    )


def slider_rows(fit: SliderFit) -> Iterator[ResultRow]:
    """Yield every figure of a fit as a row.

    Ids are ``<study>.<method>.<figure>[.<recording>]``, and ``<study>.slider.<recording>`` for the carriage's place.
    """
    together = combined_checksum(fit.checksums.values())
    plain = ResultRow("", None, "1", COMMAND_NAME, "fitted", together, fit.filter_note)
    for p in fit.static:
        yield replace(plain, id=f"{fit.study}.static.{p.name}", value=p.value, unit=p.unit)
    for method, estimate in fit.estimates.items():
        head = f"{fit.study}.{method}"
        trials, error = len(fit.evaluated(method)), fit.evaluated_error(method)
        note = f"mean over {trials} trials of the mean absolute error while the joint moves; {fit.filter_note}"
        own = replace(plain, split=fit.evaluated_split, note=note)
        yield replace(own, id=f"{head}.error", value=error, unit="A")
        yield replace(own, id=f"{head}.torque_error", value=fit.gain * error, unit="N*m")
        for p in estimate.parameters:
            note = p.sentence() + ("; at its bound" if p.at_bound else "")
            yield replace(plain, id=f"{head}.{p.name}", value=p.value, unit=p.unit, note=f"{note}; {fit.filter_note}")
        for e in fit.errors[method]:
            one = replace(plain, split=e.split, data_checksum=fit.checksums.get(e.recording))
            yield replace(one, id=f"{head}.error.{e.recording}", value=e.current, unit="A")
    if fit.travel is not None:
        travel_note = f"presliding displacement; {fit.travel.sentence()}"
        yield replace(plain, id=f"{fit.study}.presliding_travel", value=fit.travel.value, unit="rad", note=travel_note)
    for name, offset in fit.axis_offsets.items():
        for which, value, (low, high) in zip(
            ("along", "across"), (offset.along, offset.across), offset.interval, strict=True
        ):
            note = f"offset of the wearer's axis from the robot's; 95 % interval {1e3 * low:.2f} to {1e3 * high:.2f} mm"
            row = replace(plain, id=f"{fit.study}.axis_{which}.{name}", value=value, unit="m", note=note)
            yield replace(row, data_checksum=fit.checksums.get(name))
    split = {m.recording: m.split for m in fit.motions}
    for place in fit.geometry.placements:
        use, checksum = split.get(place.recording, "fitted"), fit.checksums.get(place.recording)
        note = "from the markers" if place.optical else "by a ruler"
        yield ResultRow(f"{fit.study}.slider.{place.recording}", place.slider, "m", COMMAND_NAME, use, checksum, note)
