"""Result of `identify` for a joint with friction: families and verdicts, as tables, rows and cards."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ...models.card import ModelCard
from ...models.causes import Cause
from ...models.estimates import Parameter
from ...numerics.motion import Motion
from ...numerics.posterior.posterior import Posterior
from ...study.cause_words import cause_sentence
from ...study.pages.quantities import METHODS
from ...study.procedures.posterior_beside import ComparedPosterior, pair_with_posterior, posterior_rows, posterior_table
from ...study.procedures.result import FigureTable, HeldOutEffort, ParameterTable, Result
from ...study.recorded_motions import drive_model, recorded_word
from ...study.results import ResultRow, combined_checksum
from ...study.study import Study
from ..fit.friction_family import FamilyFit
from ..fit.headline_choice import HeadlineChoice
from ..fit.joint_estimate import JointEstimate
from ..fit.presliding import Presliding
from ..fit.replay import Simulation, relative_error
from ..fit.unknown_payload import UnknownPayload
from .joint_answer import STRETCHES_OUT, crossed_error_of, error_interval_of, joint_answer

if TYPE_CHECKING:
    from ...study.answer import Answer
    from ...study.drawing.drawing import Figure

COMMAND_NAME = "identify"
"""Name of the command that writes these results."""

MAX_DRAWN_SAMPLES = 50_000
"""Approximate largest number of samples of a recording in a figure; a page shows no more."""


@dataclass(frozen=True)
class Trace:
    """A filtered recording with a gap between stretches; signals have shape (n,), SI, the effort its own unit."""

    recording: str
    split: str
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


@dataclass(frozen=True, kw_only=True, repr=False)
class JointResult(Result):
    """Result of `identify` for one joint."""

    motion: str  # "rotary" or "prismatic"
    effort_unit: str
    lifts: str  # effect of positive motion, in words
    families: Mapping[str, FamilyFit]  # fits of the families, in the requested order
    choice: HeadlineChoice  # the model behind the headline, and why
    joint: str = "joint"  # name of the joint
    computed: str = ""  # what the effort is computed from, in words; "" where it was recorded as such
    is_simulated: bool = False
    # Effort error [%] and R² on stretches of the fitted recordings, each left out in turn; NaN if unknown
    crossed_error: tuple[float, float] = (float("nan"), float("nan"))
    # 95 % confidence interval of the reported error [%]; None if it is not known
    error_interval: tuple[float, float] | None = None
    filter_note: str  # processing in one line
    drive_constant: Parameter | None = None  # drive constant from recordings with a known payload
    posterior: Posterior | None = None  # posterior of the best family, if [model] posterior requests it
    presliding: Presliding = field(default_factory=Presliding)  # estimate of the presliding travel
    payloads: tuple[UnknownPayload, ...] = ()  # payloads of recordings with ``payload = {}``
    causes: tuple[Cause, ...] = ()  # causes of what the best family misses, the one that explains most first
    traces: tuple[Trace, ...] = field(default=(), repr=False)  # recordings for figures, fitted ones first

    @property
    def recorded(self) -> str:
        """Word for the recorded effort."""
        return recorded_word(self.computed, is_simulated=self.is_simulated)

    @property
    def estimates(self) -> Mapping[str, Parameter]:
        """Parameters by name: those of the chosen estimate, and those of each family by least squares as
        ``"load.inertia"``."""
        found = {p.name: p for p in self.headlined.estimate.parameters}
        if self.drive_constant is not None:
            found[self.drive_constant.name] = self.drive_constant
        if self.presliding.travel is not None:
            found[self.presliding.travel.name] = self.presliding.travel
        found |= {f"{x.recording}.{p.name}": p for x in self.payloads for p in x.parameters}
        return found | {f"{n}.{p.name}": p for n, family in self.families.items() for p in family.estimate.parameters}

    @property
    def best(self) -> str:
        """Name of the chosen family."""
        return self.choice.family

    @property
    def headlined(self) -> FamilyFit:
        """Best family with the values of the chosen estimator."""
        return self.families[self.best].headline

    @property
    def posterior_pairs(self) -> tuple[ComparedPosterior, ...]:
        """Parameters of the best family by least squares, each with its posterior; empty without a posterior."""
        if self.posterior is None:
            return ()
        return pair_with_posterior(self.families[self.best].estimate.parameters, self.posterior)

    @property
    def simulated(self) -> FamilyFit | None:
        """Family whose simulations are drawn: the best one, or else the first with simulations."""
        ordered = [self.families[self.best], *self.families.values()]
        return next((f for f in ordered if any(f.simulations.values())), None)

    @property
    def held_out(self) -> tuple[HeldOutEffort, ...]:
        """Efforts of joints on held-out recordings, measured and predicted."""
        parts = [p for p in self.headlined.predictions if p.split == "heldout"]
        if not parts:
            return ()
        time, measured, predicted = (
            np.concatenate([getattr(p, name) for p in parts]) for name in ("time", "effort", "predicted")
        )
        return (HeldOutEffort("", self.effort_unit, time, measured, predicted),)

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return joint_answer(self)

    def plot(self) -> Figure:
        """Draw the parameters of the chosen estimate with their intervals."""
        return self.headlined.estimate.plot()

    def for_page(self) -> JointResult:
        drawn = self.simulated
        families = {n: f if f is drawn else replace(f, simulations={}) for n, f in self.families.items()}
        return replace(self, families={n: f.shown(MAX_DRAWN_SAMPLES) for n, f in families.items()})


def complete_result(study: Study, found: JointResult) -> JointResult:
    """Add its sentence, tables, rows and cards to a result."""
    cards = {f"joint.{name}": card_of(study, found, family) for name, family in found.families.items()}
    compared: tuple[FigureTable, ...] = ()
    if found.posterior is not None:
        title = f"Posterior and least squares with {found.best} friction"
        compared = (posterior_table(title, found.posterior_pairs, found.confidence),)
    found = replace(found, crossed_error=crossed_error_of(found))
    found = replace(found, error_interval=error_interval_of(found))
    return replace(
        found,
        headline=joint_answer(found).sentence,
        tables=(
            *_tables(found.families, found.best, found.drive_constant),
            *(ParameterTable(f"Payload in recording {x.recording}", x.parameters) for x in found.payloads),
            *compared,
        ),
        rows=tuple(rows_of(found)),
        cards={**cards, "joint": card_of(study, found, found.headlined)},
    )


def _tables(
    families: Mapping[str, FamilyFit], best: str, constant: Parameter | None
) -> tuple[ParameterTable | FigureTable, ...]:
    chosen = families[best].headline.estimate
    by = f", by {METHODS[chosen.method]}" if families[best].others else ""
    shown = (*chosen.parameters, *(() if constant is None else (constant,)))
    parameters = ParameterTable(f"Parameters with {best} friction{by}", shown)
    by_recording = _errors_by_recording(families[best].headline)
    if len(families) == 1:
        return (parameters, *by_recording)
    heads = ("family", "parameters", "fitted %", "held out %", "held-out R²", "")
    rows = tuple(
        (
            f.family,
            len(f.model.symbols),
            f.fitted_effort_error,
            _finite(f.heldout_effort_error),
            _finite(f.heldout_r2),
            "best" if f.family == best else "",
        )
        for f in families.values()
    )
    compared, at = families[best].estimate.method, list(families).index(best)
    title = f"Friction families, by their errors of the effort by {METHODS[compared]}"
    if chosen.method != compared:
        title += f" (the headline is by {METHODS[chosen.method]})"
    return parameters, FigureTable(title, heads, rows, chosen_rows=(at,)), *by_recording


def _errors_by_recording(fit: FamilyFit) -> tuple[FigureTable, ...]:
    """Return the table of a fit's errors in each of several recordings."""
    if len(fit.predictions) < 2:
        return ()
    rows = tuple(
        (p.recording, "held out" if p.split == "heldout" else "fitted", p.effort_error, _finite(p.r2))
        for p in fit.predictions
    )
    return (FigureTable("Errors of the effort by recording", ("recording", "use", "error %", "R²"), rows),)


def _finite(x: float) -> float | None:
    return x if np.isfinite(x) else None


def traces_of(motions: Sequence[Motion]) -> tuple[Trace, ...]:
    """Return the filtered recordings, fitted ones first."""
    whole: dict[str, list[Motion]] = {}
    for motion in motions:
        whole.setdefault(motion.recording, []).append(motion)

    def joined(parts: list[Motion], signal: str) -> np.ndarray:
        keep = max(1, sum(m.count for m in parts) // MAX_DRAWN_SAMPLES)
        return np.concatenate([np.append(getattr(m, signal)[m.inner][::keep], np.nan) for m in parts])[:-1]

    traces = [
        Trace(name, parts[0].split, *(joined(parts, s) for s in ("time", "position", "velocity", "effort")))
        for name, parts in whole.items()
    ]
    return tuple(sorted(traces, key=lambda t: t.split != "fitted"))


def card_of(study: Study, fit: JointResult, family: FamilyFit) -> ModelCard:
    """Return the model card of a family's estimate."""
    drive = drive_model(study.rig)
    fitted = [p for p in family.predictions if p.split == "fitted"]
    travel = fit.presliding.travel
    return replace(
        family.estimate.card(fit.study, fit.lifts),
        velocity_range=max((float(np.abs(p.velocity).max()) for p in fitted), default=0.0),
        drive={"gain": drive.gain, "back_emf": drive.back_emf},
        heldout_effort_error=_finite(float(family.heldout_effort_error)),
        processing=fit.filter_note,
        checksums=dict(fit.checksums),
        joint=study.rig.joint,
        purpose=study.model.purpose,
        presliding_travel=None if travel is None else travel.on_card(study.model.confidence),
    )


def rows_of(fit: JointResult) -> Iterator[ResultRow]:
    """Yield the result rows of a fit.

    Their ids are `<study>.<family>.<figure>[.<recording>[.<signal>]]`, and `<study>.<family>.<method>.<figure>` for
    other estimators.
    """
    together = combined_checksum(fit.checksums.values())
    bare = ResultRow("", None, "1", COMMAND_NAME, "fitted", together)
    for name, found in (("drive.constant", fit.drive_constant), ("presliding.travel", fit.presliding.travel)):
        if found is not None:
            yield _parameter_row(bare, f"{fit.study}.{name}", found)
    for payload in fit.payloads:
        own = replace(bare, data_checksum=fit.checksums[payload.recording])
        for p in payload.parameters:
            yield _parameter_row(own, f"{fit.study}.{p.name.replace('_', '.')}.{payload.recording}", p)
    for cause in fit.causes:
        share, size = (x if np.isfinite(x) else None for x in (cause.share, cause.size))
        own = replace(bare, note=cause_sentence(cause))
        yield replace(own, id=f"{fit.study}.cause.{cause.name}", value=size, unit=cause.unit)
        yield replace(own, id=f"{fit.study}.cause.{cause.name}.share", value=share, unit="1")
    yield from _headline_rows(fit, bare)
    if fit.posterior is not None:
        plain = replace(bare, note=fit.posterior.settled)
        yield from posterior_rows(f"{fit.study}.{fit.best}", fit.posterior_pairs, fit.confidence, plain)
    plain = replace(bare, note=fit.filter_note)
    for name, family in fit.families.items():
        head = f"{fit.study}.{name}"
        yield from _estimate_rows(head, family.estimate, plain)
        yield replace(plain, id=f"{head}.r2", value=family.fitted_r2)
        if np.isfinite(family.heldout_r2):
            held = replace(plain, split="heldout")
            yield replace(held, id=f"{head}.heldout.effort_error", value=family.heldout_effort_error, unit="%")
            yield replace(held, id=f"{head}.heldout.r2", value=family.heldout_r2)
        for each in family.predictions:
            own = replace(plain, split=each.split, data_checksum=fit.checksums[each.recording], unit="%")
            yield replace(own, id=f"{head}.effort_error.{each.recording}", value=each.effort_error)
            yield replace(own, id=f"{head}.prediction_coverage.{each.recording}", value=100.0 * each.coverage)
        for method, estimate in family.others.items():
            yield from _estimate_rows(f"{head}.{method}", estimate, plain)
        for method, simulations in family.simulations.items():
            prefix = head if method == "ls" else f"{head}.{method}"
            yield from _simulation_rows(prefix, fit, simulations, plain)


def _parameter_row(plain: ResultRow, name: str, p: Parameter) -> ResultRow:
    """Return the row of a parameter with its interval in words, before what a `plain` row notes."""
    note = f"{p.sentence()}; {plain.note}" if plain.note else p.sentence()
    return replace(plain, id=name, value=p.value, unit=p.unit, note=note)


def _headline_rows(fit: JointResult, bare: ResultRow) -> Iterator[ResultRow]:
    one = fit.headlined
    choice = fit.choice
    how = f"method {one.estimate.method}; family {fit.best}; chosen for {choice.purpose}"
    plain = replace(bare, note=how)
    head = f"{fit.study}.headline"
    for p in one.estimate.parameters:
        own = replace(plain, note=f"{how}; {fit.filter_note}", undetermined=p.undetermined)
        yield _parameter_row(own, f"{head}.{p.name}", p)
    yield replace(plain, id=f"{head}.effort_error", value=one.fitted_effort_error, unit="%")
    if np.isfinite(fit.crossed_error[0]):
        own = replace(plain, split="heldout", note=STRETCHES_OUT)
        yield replace(own, id=f"{head}.blocks_out.effort_error", value=fit.crossed_error[0], unit="%")
    if np.isfinite(one.heldout_effort_error):
        held = replace(plain, split="heldout")
        yield replace(held, id=f"{head}.heldout.effort_error", value=one.heldout_effort_error, unit="%")
    unit, scale = ("deg", 180.0 / np.pi) if fit.motion == "rotary" else ("mm", 1e3)
    left_out = STRETCHES_OUT
    for method, each in choice.methods_of(fit.best).items():
        prefix, plainly = f"{head}.blocks_out.{method}", replace(bare, note=f"{left_out}, by {method}")
        if each.simulation_error is not None:
            note = f"position simulated from the command for at most {choice.horizon:g} s, over {plainly.note}"
            error = scale * each.simulation_error
            yield replace(plainly, id=f"{prefix}.rmse_{unit}", value=error, unit=unit, note=note)
        error, note = each.effort_error, f"effort predicted, over {plainly.note}"
        yield replace(plainly, id=f"{prefix}.effort_rmse", value=error, unit=fit.effort_unit, note=note)
    for each in choice.candidates:
        note = f"error above the best model's, ± {-100.0 * np.expm1(-each.standard_error):.2g} %, over {left_out}"
        excess = 100.0 * np.expm1(each.excess)
        yield replace(bare, id=f"{head}.excess.{each.family}.{each.method}", value=excess, unit="%", note=note)


def _estimate_rows(head: str, estimate: JointEstimate, plain: ResultRow) -> Iterator[ResultRow]:
    for p in estimate.parameters:
        own = replace(plain, undetermined=p.undetermined)
        yield _parameter_row(own, f"{head}.{p.name}", p)
        yield replace(own, id=f"{head}.{p.name}.relative_sd", value=p.relative_sd, unit="%")
    yield replace(plain, id=f"{head}.condition_number", value=estimate.condition_number)
    if estimate.whiteness is not None:
        yield replace(plain, id=f"{head}.residual_lag1", value=estimate.whiteness.lag1)


def _simulation_rows(
    head: str, fit: JointResult, simulations: tuple[Simulation, ...], plain: ResultRow
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
