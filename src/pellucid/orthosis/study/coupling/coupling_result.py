"""Result of an orthosis and its wearers: tables, verdicts, rows and cards."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np

from ....models.estimates import Parameter, Verdict
from ....models.parameter_card import ParameterCard
from ....numerics.gravity_holds import accuracy
from ....study.procedures.posterior_beside import (
    pair_with_posterior,
    posterior_rows,
    posterior_table,
    posterior_verdicts,
)
from ....study.procedures.result import FigureTable, ParameterTable, Result
from ....study.results import ResultRow, combined_checksum
from ...strap.coupled_impedance import PublishedCoupling
from ...strap.identified_strap import IdentifiedStrap
from ...strap.limb import KNEE_DAMPING_SPREAD, ImuCalibration, LimbFit, MuscleTorque
from ...strap.orthosis_alone import COVARIANCE_ORDER, OrthosisFit
from ...strap.strap_model import STRAP_FEATURES, StrapModel
from ...strap.wearer_coupling import MODEL_NAMES, WearerCoupling

ANTHROPOMETRIC_TABLE_NAMES: Mapping[str, str] = {
    "winter": "Winter, knee to ankle",
    "published": "Winter, knee to heel (as published)",
    "de_leva": "de Leva",
}
"""Names of the anthropometric tables."""

LIMB_DAMPING = Parameter("damping", "N*m*s/rad", 0.0, KNEE_DAMPING_SPREAD, identifiable=False)
"""Prior of a relaxed knee's damping, which no recording here determines."""

MIN_GOOD_FIT_PERCENT = 95.0
"""Smallest fit of a good model of the orthosis alone [%]."""


@dataclass(frozen=True, eq=False)
class WearerStages:
    """Results of all stages for one participant."""

    calibration: ImuCalibration | None
    limb: LimbFit | None
    muscles: MuscleTorque | None
    coupling: WearerCoupling
    at_work: Mapping[str, str]  # observations, by relaxed trial, of active muscles
    dropped: Mapping[str, str]  # reasons, by swing, why it could not be used
    notes: tuple[str, ...] = ()  # reasons for missing stages


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CouplingResult(Result):
    """Result for an orthosis and its wearers."""

    orthosis: OrthosisFit
    wearers: Mapping[str, WearerStages]  # results by participant
    refused: Mapping[str, str]  # reasons, by participant, why the strap could not be identified


def coupling_result(
    study: str,
    orthosis: OrthosisFit,
    wearers: Mapping[str, WearerStages],
    refused: Mapping[str, str],
    notes: Mapping[str, str],
    checksums: Mapping[str, str],
    participants: Mapping[str, str | None],
    confidence: float,
) -> CouplingResult:
    """Build the tables, verdicts, rows and cards from the results of the stages."""

    def files(who: str | None) -> dict[str, str]:
        return {name: digest for name, digest in checksums.items() if participants[name] == who}

    return CouplingResult(
        study=study,
        headline=_headline(orthosis, wearers),
        tables=(*_tables(orthosis, wearers), *_posterior_tables(wearers, confidence)),
        verdicts=(*_verdicts(orthosis, wearers, refused, notes), *_posterior_verdicts(wearers, confidence)),
        rows=tuple(_rows(study, orthosis, wearers, refused, checksums, files, confidence)),
        cards=_cards(study, orthosis, wearers, files, confidence),
        checksums=checksums,
        confidence=confidence,
        orthosis=orthosis,
        wearers=wearers,
        refused=refused,
    )


def _headline(orthosis: OrthosisFit, wearers: Mapping[str, WearerStages]) -> str:
    held = [w.coupling.mean_fit() for w in wearers.values()]
    straps = ", ".join(f"{who} {w.coupling.parameter('stiffness').value:.3g} N*m/rad" for who, w in wearers.items())
    evaluated = f", which explain {np.nanmean(held):.1f} % of held-out mismatch" if np.isfinite(held).any() else ""
    diverging = ", ".join(name for name, response in orthosis.checks.items() if response.diverges)
    alone = f"cannot be simulated along {diverging}" if diverging else f"{orthosis.mean_fit():.1f} % held out"
    return f"Straps of {straps}{evaluated}; orthosis {alone}."


def _tables(orthosis: OrthosisFit, wearers: Mapping[str, WearerStages]) -> Iterator[ParameterTable | FigureTable]:
    yield ParameterTable("Orthosis", orthosis.parameters)
    yield ParameterTable("Orthosis, published form", orthosis.linear.physical)
    rows = [
        (name, orthosis.checks[name].fit, orthosis.linear_checks[name].fit, orthosis.checks[name].rmse)
        for name in orthosis.checks
    ]
    if rows:
        heads = ("Recording", "Pendulum [%]", "Published form [%]", "RMSE [rad]")
        yield FigureTable("Orthosis, held out", heads, tuple(rows))
    for who, stages in wearers.items():
        strap = stages.coupling.strap
        if strap is not None:
            yield ParameterTable(f"{who}: strap", strap.parameters)
        yield ParameterTable(f"{who}: strap as a spring and a damper", stages.coupling.orthosis_side.parameters)
        if stages.limb is not None:
            known = tuple(p for p in (stages.limb.gravity, stages.limb.inertia) if np.isfinite(p.value))
            yield ParameterTable(f"{who}: limb", known)
    tried = [
        (
            who,
            ", ".join(StrapModel.named(name).features) or "a spring and a damper",
            1e3 * error,
            "yes" if name == strap.model.name else "",
        )
        for who, stages in wearers.items()
        if (strap := stages.coupling.strap) is not None
        for name, error in sorted(strap.errors.items(), key=lambda pair: pair[1])
    ]
    if tried:
        heads = ("Participant", "Model of the strap", "Error of blocks held out [mrad]", "Chosen")
        chosen = tuple(i for i, row in enumerate(tried) if row[-1])
        yield FigureTable("Models of the straps", heads, tuple(tried), chosen_rows=chosen)
    heads = (
        "Participant", "Split", "Recording", "Strap [%]", "Spring and damper [%]", "Limb side [%]", "Published [%]",
        "Ceiling [%]",
    )  # fmt: skip
    evaluated = [
        (who, j.split, j.recording, *(j.fit.get(n) for n in MODEL_NAMES), _known(j.ceiling))
        for who, stages in wearers.items()
        for j in stages.coupling.evaluated
    ]
    yield FigureTable("Mismatch explained", heads, tuple(evaluated))


def _posterior_tables(wearers: Mapping[str, WearerStages], confidence: float) -> Iterator[FigureTable]:
    for who, stages in wearers.items():
        found = stages.coupling
        if found.posterior is not None:
            compared = pair_with_posterior(found.orthosis_side.parameters, found.posterior)
            yield posterior_table(f"{who}: posterior beside those of a spring and a damper", compared, confidence)


def _posterior_verdicts(wearers: Mapping[str, WearerStages], confidence: float) -> Iterator[Verdict]:
    for who, stages in wearers.items():
        found = stages.coupling
        if found.no_posterior:
            yield Verdict("warning", f"{who}: no posterior could be drawn: {found.no_posterior}.")
        if found.posterior is not None:
            compared = pair_with_posterior(found.orthosis_side.parameters, found.posterior)
            yield from posterior_verdicts(compared, found.posterior, confidence, who)


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _verdicts(
    orthosis: OrthosisFit,
    wearers: Mapping[str, WearerStages],
    refused: Mapping[str, str],
    notes: Mapping[str, str],
) -> Iterator[Verdict]:
    reached, linear = orthosis.mean_fit(), orthosis.mean_fit(linear=True)
    if np.isfinite(reached):
        yield Verdict(
            "good" if reached >= MIN_GOOD_FIT_PERCENT else "warning",
            f"The orthosis as a pendulum with friction fits sines it was not fitted to by {reached:.1f} %, the "
            f"published form, in which a spring stands for gravity, by {linear:.1f} %.",
        )
    for name, response in orthosis.checks.items():
        if response.diverges:
            yield Verdict(
                "warning",
                f"{name}: the orthosis as identified cannot be simulated along this held-out recording: it diverges. "
                "Nothing that was fitted depends on it; compare its torque's unit and sign with the other recordings'.",
            )
    for name, reason in orthosis.pendulum.reasons.items():
        yield Verdict("note", f"The orthosis's {name} is at its bound: {reason}")
    for who, stages in wearers.items():
        yield from stages.coupling.verdicts
        for name, why in stages.at_work.items():
            yield Verdict("warning", f"{who}: {name} was not relaxed and is not used: {why}.")
        for name, why in stages.dropped.items():
            yield Verdict("warning", f"{who}: {name} is not used: {why}.")
        for note in stages.notes:
            yield Verdict("warning", f"{who}: {note}.")
    for who, why in refused.items():
        yield Verdict("warning", f"{who}: refused. {why}.")
    for name, note in notes.items():
        yield Verdict("note", f"{name}: {note}.")


# --- figures --------------------------------------------------------------------------------------------------------


def _rows(
    study: str,
    orthosis: OrthosisFit,
    wearers: Mapping[str, WearerStages],
    refused: Mapping[str, str],
    checksums: Mapping[str, str],
    files: Callable[[str | None], Mapping[str, str]],
    confidence: float,
) -> Iterator[ResultRow]:
    all_of = {who: combined_checksum(files(who).values()) for who in (None, *wearers, *refused)}

    def row(what: str, value, unit: str, split: str, note: str = "", checksum: str | None = None) -> ResultRow:
        # Ids begin with the orthosis or with a wearer.
        checksum = checksum or all_of.get(what.split(".")[0], all_of[None])
        return ResultRow(f"{study}.{what}", value, unit, "identify", split, checksum, note)

    def parameter(what: str, p: Parameter, extra: str = "") -> ResultRow:
        low, high = p.interval(confidence)
        note = f"{100.0 * confidence:.4g} % interval {low:.6g} to {high:.6g}" + ("; at its bound" if p.at_bound else "")
        return row(what, p.value, p.unit, "fitted", "; ".join(filter(None, [note, extra])))

    for p in orthosis.parameters:
        yield parameter(f"orthosis.{p.name}", p)
    for p in orthosis.linear.physical:
        yield parameter(f"orthosis.published_form.{p.name}", p)
    for linear, name in ((False, "orthosis.fit"), (True, "orthosis.published_form.fit")):
        yield row(f"{name}.fitted", orthosis.mean_fit("fitted", linear=linear), "%", "fitted", "mean over recordings")
        note = "mean over recordings of another amplitude, initial states estimated"
        yield row(name, _known(orthosis.mean_fit(linear=linear)), "%", "heldout", note)
        checks = orthosis.linear_checks if linear else orthosis.checks
        for recording, response in checks.items():
            why = "refused: the simulation diverges" if response.diverges else ""
            checksum = checksums.get(recording)
            yield row(f"{name}.{recording}", _known(response.fit), "%", "heldout", why, checksum=checksum)
    for who, stages in wearers.items():
        yield from _limb_rows(who, stages, row, parameter)
        yield from _coupling_rows(who, stages.coupling, row, parameter, checksums)
        if stages.coupling.posterior is not None:
            drawn = stages.coupling.posterior
            plain = ResultRow("", None, "1", "identify", "fitted", all_of[who], drawn.settled)
            compared = pair_with_posterior(stages.coupling.orthosis_side.parameters, drawn)
            yield from posterior_rows(f"{study}.{who}.coupling", compared, confidence, plain)
    for who, why in refused.items():
        yield row(f"{who}.coupling.fit", None, "%", "heldout", f"refused: {why}")


def _limb_rows(who: str, stages: WearerStages, row, parameter) -> Iterator[ResultRow]:
    if stages.calibration is not None:
        note = "IMU on the orthosis against its encoder, the part not fitted"
        yield row(f"{who}.imu.rmse", stages.calibration.sd, "rad", "heldout", note)
    if stages.limb is not None:
        yield parameter(f"{who}.limb.gravity", stages.limb.gravity)
        if np.isfinite(stages.limb.inertia.value):
            yield parameter(f"{who}.limb.inertia", stages.limb.inertia, "shares of the body, scaled by gravity")
        for table, segment in stages.limb.segments.items():
            of_found, of_table = accuracy(stages.limb.gravity.value, segment.gravity())
            near = f"agreement {of_found:.2f} % of the one found, {of_table:.2f} % of this one"
            yield row(
                f"{who}.limb.gravity.{table}",
                segment.gravity(),
                "N*m",
                "fitted",
                f"{ANTHROPOMETRIC_TABLE_NAMES[table]}; {near}",
            )
    if stages.muscles is not None:
        note = "plain linear map from EMG, repetition by repetition"
        yield row(f"{who}.muscles.rmse", stages.muscles.rmse, "N*m", "heldout", note)


def _coupling_rows(who: str, found: WearerCoupling, row, parameter, checksums) -> Iterator[ResultRow]:
    head, fit = f"{who}.coupling", found.orthosis_side
    strap, stiffness = found.strap, found.parameter("stiffness")
    yield parameter(f"{head}.k", stiffness, stiffness.refused or "tangent where it begins to pull")
    yield parameter(f"{head}.b", found.parameter("damping"))
    if strap is not None:
        yield from _strap_rows(f"{head}.strap", strap, row, parameter)
        yield parameter(f"{head}.kelvin_voigt.k", fit.stiffness, "of a spring and a damper alone")
        yield parameter(f"{head}.kelvin_voigt.b", fit.damping, "of a spring and a damper alone")
    yield parameter(f"{head}.inertia", fit.inertia, "of a spring and a damper alone; must hold 0 where that is all")
    if found.limb_side is not None:
        yield parameter(f"{head}.limb_side.k", found.limb_side.stiffness)
        yield parameter(f"{head}.limb_side.b", found.limb_side.damping)
    for form, literal in found.published.items():
        yield from _published_rows(f"{head}.published_form.{form}", literal, row)
    names = {
        "orthosis": "fit", "kelvin_voigt": "kelvin_voigt.fit", "limb": "limb_side.fit",
        "published": "published_form.fit",
    }  # fmt: skip
    against = "mean over swings not fitted, against the IMU's mismatch"
    for model, name in names.items():
        if any(model in j.fit for j in found.evaluated):
            yield row(f"{head}.{name}", _known(found.mean_fit(model)), "%", "heldout", against)
            yield row(f"{head}.{name}.fitted", _known(found.mean_fit(model, "fitted")), "%", "fitted")
    yield row(f"{head}.ceiling", _known(found.mean_ceiling()), "%", "heldout", "what the IMU's own error allows")
    for j in found.evaluated:
        split = "heldout" if j.split == "heldout" else "fitted"
        yield row(f"{head}.fit.{j.recording}", j.fit["orthosis"], "%", split, checksum=checksums.get(j.recording))
        yield row(f"{head}.rmse.{j.recording}", j.rmse, "rad", split, checksum=checksums.get(j.recording))


def _strap_rows(head: str, strap: IdentifiedStrap, row, parameter) -> Iterator[ResultRow]:
    """Yield rows of a strap's model, its further parameters, and the range of validity."""
    for p in strap.others:
        yield parameter(f"{head}.{p.name}", p)
    for feature in STRAP_FEATURES:
        p = strap.missed.get(feature)
        note = "given up: blocks held out are predicted as well without it" if p is None else f"p {p:.2g} without it"
        yield row(f"{head}.{feature}.chosen", float(strap.model.has(feature)), "1", "fitted", note)
    for name, value, tangent in zip(("low", "high"), strap.range, strap.ends, strict=True):
        yield row(f"{head}.range.{name}", value, "rad", "fitted", "of stretches seen")
        yield parameter(f"{head}.tangent.{name}", tangent, "at that end of the range")
    yield row(f"{head}.error", strap.errors[strap.model.name], "rad", "heldout", "of blocks held out")
    yield row(f"{head}.holds", strap.holds, "1", "heldout", "p of no physics beside the model being missed")


def _published_rows(head: str, literal: PublishedCoupling, row) -> Iterator[ResultRow]:
    for name, value, unit in (
        ("inertia", literal.inertia, "kg*m^2"),
        ("b", literal.damping, "N*m*s/rad"),
        ("k", literal.stiffness, "N*m/rad"),
    ):
        note = "at its bound" if {"b": "damping", "k": "stiffness"}.get(name, name) in literal.at_bound else ""
        yield row(f"{head}.{name}", value, unit, "fitted", note)


# --- cards ----------------------------------------------------------------------------------------------------------


def _cards(
    study: str,
    orthosis: OrthosisFit,
    wearers: Mapping[str, WearerStages],
    files: Callable[[str | None], Mapping[str, str]],
    confidence: float,
) -> dict[str, ParameterCard]:
    def card(kind: str, name: str, parameters, covariance, who: str | None, processing: str, **settings):
        return ParameterCard(
            kind,
            study,
            name,
            tuple(p.on_card(confidence) for p in parameters),
            tuple(tuple(float(x) for x in row) for row in np.atleast_2d(covariance)),
            settings,
            processing,
            confidence,
            files(who),
            version("pellucid"),
        )

    by_name = {p.name: p for p in orthosis.parameters}
    made = {
        "orthosis": card(
            "orthosis",
            "orthosis",
            [by_name[name] for name in COVARIANCE_ORDER],
            orthosis.covariance,
            None,
            "gravity from holds; inertia and friction by output error on sines",
            zero=float(orthosis.orthosis.zero),
            torque_offset=float(orthosis.orthosis.offset),
        )
    }
    for who, stages in wearers.items():
        fit = stages.coupling.orthosis_side
        made[f"{who}.coupling"] = card(
            "coupling",
            f"{who}.coupling",
            [fit.stiffness, fit.damping],
            fit.covariance,
            who,
            "output error on the IMU's angle, torque by the orthosis's balance; the spring and the damper that do best",
            participant=who,
        )
        if (strap := stages.coupling.strap) is not None:
            made[f"{who}.strap"] = card(
                "strap",
                f"{who}.strap",
                [strap.stiffness, strap.damping, *strap.others],
                strap.covariance,
                who,
                "output error on the IMU's angle; the model by blocks held out",
                participant=who,
                model=strap.model.name,
                stretch_low=strap.range[0],
                stretch_high=strap.range[1],
                holds=strap.fits,
            )
        if stages.limb is not None and np.isfinite(stages.limb.inertia.value):
            limb = stages.limb
            made[f"{who}.limb"] = card(
                "limb",
                f"{who}.limb",
                [limb.inertia, limb.gravity, LIMB_DAMPING],
                limb.limb.covariance,
                who,
                "gravity on a rigid plate, muscles at rest; inertia by shares of the body",
                participant=who,
                zero=float(limb.zero.value),
            )
    return made
