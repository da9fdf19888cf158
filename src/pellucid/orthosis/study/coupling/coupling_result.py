"""Result of an orthosis and its wearers: tables, verdicts, rows and cards."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version

import numpy as np

from ....models.estimates import Parameter, Verdict
from ....models.parameter_card import ParameterCard
from ....numerics.gravity_holds import accuracy
from ....study.answer import Answer, AnswerNumber, AnswerPart, Basis, Step, answer_of_parts
from ....study.procedures.findings import MIN_EXPLAINED_PERCENT
from ....study.procedures.posterior_beside import (
    ComparedPosterior,
    pair_with_posterior,
    posterior_rows,
    posterior_table,
    posterior_verdicts,
)
from ....study.procedures.result import FigureTable, ParameterTable, Result
from ....study.results import ResultRow, combined_checksum
from ...strap.coupled_impedance import UNITS as COEFFICIENT_UNITS
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
    notes: Mapping[str, str] = field(repr=False)  # corrections of a recording's angles, by recording
    files: Mapping[str | None, Mapping[str, str]] = field(repr=False)  # checksums by participant; None: nobody wore it

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return coupling_answer(self)


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
    files = {
        who: {name: digest for name, digest in checksums.items() if participants[name] == who}
        for who in (None, *wearers, *refused)
    }
    made = CouplingResult(
        study=study, headline=_headline(orthosis, wearers), tables=(), verdicts=(), rows=(), cards={},
        checksums=checksums, confidence=confidence, orthosis=orthosis, wearers=wearers, refused=refused, notes=notes,
        files=files,
    )  # fmt: skip
    tables, verdicts, rows = tuple(_tables(made)), tuple(_verdicts(made)), tuple(_rows(made))
    return replace(made, tables=tables, verdicts=verdicts, rows=rows, cards=_cards(made))


def coupling_answer(found: CouplingResult) -> Answer:
    """Return whether each strap explains the angle between limb and orthosis in swings that were not fitted."""
    held = {who: float(stages.coupling.mean_fit()) for who, stages in found.wearers.items()}
    parts = [
        AnswerPart(who, "yes" if fit >= MIN_EXPLAINED_PERCENT else "no", f"{fit:.1f} % explained")
        if np.isfinite(fit)
        else AnswerPart(who, "cannot say", "no swing was held out")
        for who, fit in held.items()
    ]
    parts += [AnswerPart(who, "cannot say", why) for who, why in found.refused.items()]
    count = len(found.checksums)
    swings = sum(each.split == "heldout" for stages in found.wearers.values() for each in stages.coupling.evaluated)
    judged = f"{swings} held-out swing{'s' * (swings > 1)}, of {len(found.wearers)} wearer{'s' * (len(held) > 1)}"
    controller = [
        Step(f"Make a controller for {who}", "export", ("--participant", who)) for who in list(found.wearers)[:1]
    ]
    return answer_of_parts(
        f"Do the straps explain at least {MIN_EXPLAINED_PERCENT:.0f} % of the angle between limb and orthosis in "
        "held-out swings?",
        found.headline,
        parts,
        [AnswerNumber(f"explained held-out angle, {who}", fit, "%") for who, fit in held.items()],
        Basis(count, count, judged=judged if np.isfinite(list(held.values())).any() else ""),
        improve=(Step("Hold out some swings, and record faster ones: the strap yields more in them"),),
        next=controller,
        without_parts="nobody wore the orthosis",
    )


def strap_beside_posterior(found: WearerCoupling) -> tuple[ComparedPosterior, ...]:
    """Return the parameters of the spring and damper, each paired with its posterior; a posterior is required."""
    return pair_with_posterior(found.orthosis_side.parameters, found.posterior)


def _headline(orthosis: OrthosisFit, wearers: Mapping[str, WearerStages]) -> str:
    held = [w.coupling.mean_fit() for w in wearers.values()]
    straps = ", ".join(f"{who} {w.coupling.parameter('stiffness').value:.3g} N*m/rad" for who, w in wearers.items())
    evaluated = f", which explain {np.nanmean(held):.1f} % of held-out mismatch" if np.isfinite(held).any() else ""
    diverging = ", ".join(name for name, response in orthosis.checks.items() if response.diverges)
    fitted = f"model alone fits {orthosis.mean_fit():.1f} % of its held-out angle"
    alone = f"cannot be simulated along {diverging}" if diverging else fitted
    return f"Straps of {straps}{evaluated}; orthosis {alone}."


def _tables(found: CouplingResult) -> Iterator[ParameterTable | FigureTable]:
    orthosis, wearers = found.orthosis, found.wearers
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
    tried = []
    for who, stages in wearers.items():
        errors = {} if (strap := stages.coupling.strap) is None else strap.errors
        for name, error in sorted(errors.items(), key=lambda pair: pair[1]):
            features = ", ".join(StrapModel.named(name).features) or "a spring and a damper"
            tried.append((who, features, 1e3 * error, "yes" if name == strap.model.name else ""))
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
    for who, stages in wearers.items():
        if stages.coupling.posterior is not None:
            title = f"{who}: posterior and least-squares estimates of spring and damper"
            yield posterior_table(title, strap_beside_posterior(stages.coupling), found.confidence)


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _verdicts(found: CouplingResult) -> Iterator[Verdict]:
    orthosis, wearers = found.orthosis, found.wearers
    reached, linear = orthosis.mean_fit(), orthosis.mean_fit(linear=True)
    if np.isfinite(reached):
        yield Verdict(
            "good" if reached >= MIN_GOOD_FIT_PERCENT else "warning",
            f"On held-out sines, the fit of the orthosis as a pendulum with friction is {reached:.1f} %; that of the "
            f"published form, with a spring instead of gravity, is {linear:.1f} %.",
        )
    for name, response in orthosis.checks.items():
        if response.diverges:
            yield Verdict(
                "warning",
                f"{name}: the simulation of the identified orthosis diverges in this held-out recording. The fit does "
                "not depend on it; compare unit and sign of its torque with those of the other recordings.",
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
    for who, why in found.refused.items():
        yield Verdict("warning", f"{who}: the strap was not identified. {why}.")
    for name, note in found.notes.items():
        yield Verdict("note", f"{name}: {note}.")
    for who, coupling in ((who, stages.coupling) for who, stages in wearers.items()):
        if coupling.no_posterior:
            yield Verdict("warning", f"{who}: the posterior could not be sampled: {coupling.no_posterior}.")
        if coupling.posterior is not None:
            compared = strap_beside_posterior(coupling)
            yield from posterior_verdicts(compared, coupling.posterior, found.confidence, who)


# --- figures --------------------------------------------------------------------------------------------------------


def _rows(found: CouplingResult) -> Iterator[ResultRow]:
    orthosis, confidence = found.orthosis, found.confidence
    all_of = {who: combined_checksum(sums.values()) for who, sums in found.files.items()}

    def row(what: str, value, unit: str, split: str, note: str = "", checksum: str | None = None) -> ResultRow:
        # Ids begin with the orthosis or with a wearer.
        checksum = checksum or all_of.get(what.split(".")[0], all_of[None])
        return ResultRow(f"{found.study}.{what}", value, unit, "identify", split, checksum, note)

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
            why = "not evaluated: the simulation diverges" if response.diverges else ""
            checksum = found.checksums.get(recording)
            yield row(f"{name}.{recording}", _known(response.fit), "%", "heldout", why, checksum=checksum)
    for who, stages in found.wearers.items():
        yield from _limb_rows(who, stages, row, parameter)
        yield from _coupling_rows(who, stages.coupling, row, parameter, found.checksums)
        if (drawn := stages.coupling.posterior) is not None:
            plain = ResultRow("", None, "1", "identify", "fitted", all_of[who], drawn.settled)
            compared = strap_beside_posterior(stages.coupling)
            yield from posterior_rows(f"{found.study}.{who}.coupling", compared, confidence, plain)
    for who, why in found.refused.items():
        yield row(f"{who}.coupling.fit", None, "%", "heldout", f"not identified: {why}")


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
            note = f"{ANTHROPOMETRIC_TABLE_NAMES[table]}; "
            note += f"agreement {of_found:.2f} % of the identified value, {of_table:.2f} % of this one"
            yield row(f"{who}.limb.gravity.{table}", segment.gravity(), "N*m", "fitted", note)
    if stages.muscles is not None:
        note = "plain linear map from EMG, repetition by repetition"
        yield row(f"{who}.muscles.rmse", stages.muscles.rmse, "N*m", "heldout", note)


def _coupling_rows(who: str, found: WearerCoupling, row, parameter, checksums) -> Iterator[ResultRow]:
    head, fit = f"{who}.coupling", found.orthosis_side
    strap, stiffness = found.strap, found.parameter("stiffness")
    yield parameter(f"{head}.k", stiffness, stiffness.refused or "tangent at the onset of tension")
    yield parameter(f"{head}.b", found.parameter("damping"))
    if strap is not None:
        yield from _strap_rows(f"{head}.strap", strap, row, parameter)
        yield parameter(f"{head}.kelvin_voigt.k", fit.stiffness, "of a spring and a damper alone")
        yield parameter(f"{head}.kelvin_voigt.b", fit.damping, "of a spring and a damper alone")
    yield parameter(f"{head}.inertia", fit.inertia, "of a spring and a damper alone; contains 0 if these suffice")
    if found.limb_side is not None:
        yield parameter(f"{head}.limb_side.k", found.limb_side.stiffness)
        yield parameter(f"{head}.limb_side.b", found.limb_side.damping)
    for form, literal in found.published.items():
        for letter, name in {"inertia": "inertia", "b": "damping", "k": "stiffness"}.items():
            note = "at its bound" if name in literal.at_bound else ""
            value, unit = getattr(literal, name), COEFFICIENT_UNITS[name]
            yield row(f"{head}.published_form.{form}.{letter}", value, unit, "fitted", note)
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
        note = "omitted: held-out blocks are predicted as well without it" if p is None else f"p {p:.2g} without it"
        yield row(f"{head}.{feature}.chosen", float(strap.model.has(feature)), "1", "fitted", note)
    for name, value, tangent in zip(("low", "high"), strap.range, strap.ends, strict=True):
        yield row(f"{head}.range.{name}", value, "rad", "fitted", "range of observed extensions")
        yield parameter(f"{head}.tangent.{name}", tangent, "at that end of the range")
    yield row(f"{head}.error", strap.errors[strap.model.name], "rad", "heldout", "error on held-out blocks")
    yield row(f"{head}.holds", strap.holds, "1", "heldout", "p-value of the hypothesis that the model lacks no effect")


# --- cards ----------------------------------------------------------------------------------------------------------


def _cards(found: CouplingResult) -> dict[str, ParameterCard]:
    made: dict[str, ParameterCard] = {}

    def add(
        kind: str, who: str | None, parameters: Sequence[Parameter], covariance: np.ndarray, how: str, **settings
    ) -> None:
        name, of = (kind, {}) if who is None else (f"{who}.{kind}", {"participant": who})
        made[name] = ParameterCard(
            kind, found.study, name, tuple(p.on_card(found.confidence) for p in parameters),
            tuple(map(tuple, np.atleast_2d(covariance).astype(float).tolist())), of | settings, how, found.confidence,
            found.files[who], version("pellucid"),
        )  # fmt: skip

    alone = found.orthosis
    by_name = {p.name: p for p in alone.parameters}
    how = "gravity from holds; inertia and friction by output error on sines"
    places = {"zero": float(alone.orthosis.zero), "torque_offset": float(alone.orthosis.offset)}
    add("orthosis", None, [by_name[name] for name in COVARIANCE_ORDER], alone.covariance, how, **places)
    for who, stages in found.wearers.items():
        fit, strap, limb = stages.coupling.orthosis_side, stages.coupling.strap, stages.limb
        how = "output error on the IMU's angle, torque by the orthosis's torque balance; "
        how += "best spring and damper"
        add("coupling", who, [fit.stiffness, fit.damping], fit.covariance, how)
        if strap is not None:
            add(
                "strap", who, [strap.stiffness, strap.damping, *strap.others], strap.covariance,
                "output error on the IMU's angle; the model by blocks held out", model=strap.model.name,
                stretch_low=strap.range[0], stretch_high=strap.range[1], holds=strap.fits,
            )  # fmt: skip
        if limb is not None and np.isfinite(limb.inertia.value):
            how = "gravity on a rigid plate, muscles at rest; inertia by shares of the body"
            parameters = [limb.inertia, limb.gravity, LIMB_DAMPING]
            add("limb", who, parameters, limb.limb.covariance, how, zero=float(limb.zero.value))
    return made
