"""Result of `identify` for a robot: models and errors as tables, rows and cards; its payloads and drive gains."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from importlib.metadata import version
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ... import _core
from ..._errors import IdentificationError
from ...models.causes import Cause
from ...models.estimates import Parameter
from ...models.friction_terms import STRIBECK_FRICTION
from ...models.joint import PARALLEL_STIFFNESS
from ...models.robot import Robot
from ...models.tree_card import JointRange, Ripple, TreeCard
from ...numerics.motion import Filtering
from ...study.answer import Answer, AnswerNumber, AnswerPart, Basis, Step, answer_of_parts
from ...study.cause_words import cause_sentence
from ...study.pages.quantities import percent
from ...study.procedures.findings import MAX_GOOD_ERROR, MAX_IMPROVING_STEPS, SECOND_RECORDING_TEXT, steps_before_use
from ...study.procedures.result import FigureTable, HeldOutEffort, ParameterTable, Result
from ...study.results import ResultRow, combined_checksum
from ...study.study import Study
from ..fit.fit_tree import SegmentJackknife
from ..fit.payload import gains_from_desired, gains_from_payload, identify_payload, with_drive_gains
from ..fit.tree_estimate import TreeEstimate, parameter_verdicts
from ..fit.tree_families import SpectralLine
from ..fit.tree_regression import TreeModel
from ..tree_motion import TreeMotion, fitted_without_payload
from .fit_robot import RobotFit, RobotScore, RobotTrace
from .joint_answers import MIN_MOVING_SHARE, answer_joints, answers_in_words
from .tree_table import TreeTable

COMMAND_NAME = "identify"
"""Name of the command that writes these results."""

MODEL_DESCRIPTIONS: Mapping[str, str] = {
    "published": "published friction, stated bodies",
    "stated": "stated bodies, friction fitted",
    "base": "base parameters, plain friction",
    "best": "friction chosen for each joint",
    "consistent": "the same, physically consistent",
}
"""Models in words, the simplest baselines first."""

HEADLINE_MODELS = ("best", "base")
"""Models whose errors the headline compares; a shortened table keeps their rows."""

ROW_KIND_DESCRIPTIONS: Mapping[str, str] = {
    "fitted": "fitted recordings",
    "segments_out": "held-out segments (cross-validation)",
    "heldout": "held-out recordings",
}
"""Kinds of rows on which errors are measured, in words."""

PAYLOAD_NOTES: Mapping[str, str] = {
    "gains": "",
    "gains of other payloads": "; with gains from the other payloads",
    "nothing": "; used to estimate the drive gains, so that it does not test them",
}
"""Remarks on a payload's mass in result rows, by what the mass tests."""

PLAIN_TERMS = ("viscous", "coulomb", "offset", "motor_viscous", "motor_coulomb")
"""Friction terms of every joint, and of every motor that turns with several joints."""


@dataclass(frozen=True)
class Errors:
    """Errors of one model on one kind of rows, over the rows in which a joint moves."""

    model: str  # name of the model
    judged: Literal["fitted", "segments_out", "heldout"]  # kind of rows
    each: tuple[float, ...]  # RMS error of each joint over its RMS effort, (m,) [%]

    @property
    def mean(self) -> float:
        """Mean error over joints [%]."""
        return float(np.mean(self.each))


@dataclass(frozen=True)
class TreeTrace:
    """A filtered recording of all joints; n rows, m joints."""

    recording: str
    use: Literal["fit", "validate"]
    time: np.ndarray  # (n,) [s]
    position: np.ndarray  # (n, m) [rad; m]
    velocity: np.ndarray  # (n, m) [rad/s; m/s]
    effort: np.ndarray  # measured effort, (n, m) [N m; N]
    moving: np.ndarray  # mask of the rows in which a joint moves, (n, m)
    load: np.ndarray  # effort of links and rotors by the best model, (n, m) [N m; N]
    friction: np.ndarray  # friction of joints in that effort, filtered as the measured effort is, (n, m) [N m; N]
    predicted: np.ndarray  # effort predicted by the best model, (n, m) [N m; N]


@dataclass(frozen=True)
class Choice:
    """Friction terms and ripples that were chosen without each segment in turn."""

    folds: int  # number of cross-validation folds, one for each segment
    terms: tuple[Mapping[str, int], ...]  # for each joint, number of folds in which a term was chosen
    ripples: Mapping[str, int]  # number of folds in which a ripple was found, by joint


@dataclass(frozen=True)
class FoundPayload:
    """Identified payload of one recording, with the stated mass."""

    recording: str
    mass: Parameter  # identified mass
    known: float | None = None  # stated mass [kg]
    centre: tuple[float, ...] = ()  # centre of mass in the link's frame [m]; NaN if it is not determined
    link: str = ""  # link that carries the payload
    tests: Literal["gains", "gains of other payloads", "nothing"] = "gains"  # gains that the identified mass tests

    @property
    def error(self) -> float:
        """Error of the mass [%]; NaN if the true mass is unknown or determined the gains in use."""
        unknown = self.known is None or bool(self.mass.refused) or self.tests == "nothing"
        return float("nan") if unknown else 100.0 * abs(self.mass.value - self.known) / self.known


@dataclass(frozen=True, kw_only=True, repr=False)
class TreeResult(Result):
    """Result of `identify` for a robot.

    ``result["joint_3.viscous"]`` belongs to the best model, ``"base.…"`` and ``"consistent.…"`` to the others.
    """

    robot: Robot
    models: Mapping[str, TreeEstimate]  # estimates by name: base, best, consistent, as far as they exist
    failures: Mapping[str, str]  # reasons, by model, why it could not be fitted
    errors: tuple[Errors, ...]
    choice: Choice | None  # choices of terms in cross-validation; None if there was none
    lines: tuple[SpectralLine, ...]  # strongest line of each drive's residual
    jackknife: SegmentJackknife | None
    payloads: tuple[FoundPayload, ...]
    gains: tuple[tuple[float, str, bool], ...]  # gain of each drive, its unit, and whether it is known
    identified_gains: tuple[Parameter, ...]  # identified gain of each drive; empty if they were stated
    gains_note: str  # source of the gains, in words
    published: Mapping[str, Mapping[str, float]]  # published values by joint and parameter, SI
    filter_note: str  # processing in one line
    segments: int  # number of segments
    causes: tuple[Cause, ...] = ()  # causes of what the best model misses, the one that explains most first
    doubts: tuple[str, ...] = ()  # joints whose sign is in doubt, in words
    traces: tuple[TreeTrace, ...] = field(default=(), repr=False)  # filtered recordings
    filtering: Filtering  # filtering and decimation of both sides
    effort_lowpass: float | None = None  # cut-off of the low-pass on effort, where it is another [Hz]
    computed: str = ""  # what the efforts are computed from, in words; "" where they were recorded as such
    dead_band: tuple[float, ...] = ()  # speed of each joint below which samples are excluded [rad/s; m/s]

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return tree_answer(self)

    @property
    def best(self) -> TreeEstimate:
        """Estimate whose figures are drawn."""
        return self.models["best"]

    @property
    def fit(self) -> RobotFit:
        """The best model as `pellucid.fit_robot` returns it."""
        own = {each.name: getattr(self.best, each.name) for each in fields(self.best)}
        return RobotFit(
            **own, filtering=self.filtering, dead_band=self.dead_band, effort_lowpass=self.effort_lowpass,
            consistent=self.models.get("consistent"), answers=self.joint_answers, causes=self.causes,
        )  # fmt: skip

    def predict(self, time: ArrayLike, position: ArrayLike, velocity: ArrayLike | None = None) -> np.ndarray:
        """Predict the efforts of a motion by the best model, shape (n, m); see `RobotFit.predict`."""
        return self.fit.predict(time, position, velocity)

    def simulate(
        self, time: ArrayLike, effort: ArrayLike, position: ArrayLike | None = None, velocity: ArrayLike | None = None
    ) -> RobotTrace:
        """Simulate the motion that efforts cause, with consistent bodies; see `RobotFit.simulate`."""
        return self.fit.simulate(time, effort, position, velocity)

    def score(self, recordings: Any) -> RobotScore:
        """Compare predicted with measured efforts of other recordings; see `RobotFit.score`."""
        return self.fit.score(recordings)

    @property
    def joint_answers(self) -> tuple[AnswerPart, ...]:
        """Whether the best model predicts each joint: "yes", "no" or "cannot say", with the reason."""
        judged = self.judged
        errors = None if judged == "fitted" else self.errors_of("best", judged).each
        wrong = list(dict.fromkeys(v.finding.replace("_", " ") for v in self.verdicts if v.kind == "wrong"))
        return answer_joints(self.names, errors, ROW_KIND_DESCRIPTIONS[judged], self.moving_shares, wrong)

    @property
    def moving_shares(self) -> list[float]:
        """Share of the fitted rows in which each joint moves."""
        return np.concatenate([t.moving for t in self.traces if t.use == "fit"]).mean(axis=0).tolist()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the moving joints."""
        return self.robot.names

    @property
    def effort_units(self) -> tuple[str, ...]:
        """Unit of each joint's effort; the drive's unit if its gain is unknown."""
        each = zip(self.robot.units, self.gains, strict=True)
        return tuple(own[1] if known else unit for own, (_, unit, known) in each)

    @property
    def estimates(self) -> Mapping[str, Parameter]:
        """Parameters of the best model by name, and those of every model with its name as prefix."""
        found = {f"{name}.{p.name}": p for name, model in self.models.items() for p in model.parameters.values()}
        return dict(self.best.parameters) | found

    @property
    def held_out(self) -> tuple[HeldOutEffort, ...]:
        """Efforts of joints on held-out recordings, measured and predicted."""
        traces = [trace for trace in self.traces if trace.use == "validate"]
        if not traces:
            return ()
        moving = np.concatenate([t.moving for t in traces]).astype(bool)
        times = np.concatenate([t.time for t in traces])
        measured, predicted = (np.concatenate([getattr(t, name) for t in traces]) for name in ("effort", "predicted"))
        named = zip(self.names, self.effort_units, strict=True)
        return tuple(
            HeldOutEffort(name, unit, times[rows], measured[rows, k], predicted[rows, k])
            for k, (name, unit) in enumerate(named)
            if (rows := moving[:, k]).any()
        )

    def errors_of(self, model: str, judged: str) -> Errors | None:
        """Return the errors of a model on one kind of rows; None if there are none."""
        return next((e for e in self.errors if (e.model, e.judged) == (model, judged)), None)

    @property
    def in_order(self) -> list[Errors]:
        """The errors in the order of `MODEL_DESCRIPTIONS`."""
        return sorted(self.errors, key=lambda e: list(MODEL_DESCRIPTIONS).index(e.model))

    @property
    def judged(self) -> str:
        """Most demanding kind of rows that is available."""
        return next(kind for kind in ("heldout", "segments_out", "fitted") if self.errors_of("best", kind))

    @property
    def worst(self) -> int:
        """Index of the joint with the largest error."""
        return int(np.nanargmax(self.errors_of("best", self.judged).each))


_INERTIAS_BY_SI = {"kg*m^2": "{}*s^2/rad", "kg*m": "{}*s^2/m", "kg": "{}*s^2/m^2"}
"""Units of bodies' parameters of an effort that is stated in the drive's unit, by those of an effort in N*m."""


def in_drive_units(model: TreeEstimate, effort_units: Sequence[str]) -> TreeEstimate:
    """Return a model whose parameters state their units as efforts are measured, such as A*s/rad for an unknown gain.

    `effort_units` are the joints', (m,). Several drives with other units share no unit of the bodies' parameters.
    """
    common = set(effort_units)
    bodies = next(iter(common)) if len(common) == 1 else "effort"
    if common <= {"N*m", "N"}:
        return model

    def unit_of(name: str, unit: str) -> str:
        # "joint.rotor_inertia", and "joint.ripple_2.cosine".
        owner = next((k for k, joint in enumerate(model.robot.names) if name.startswith(f"{joint}.")), None)
        effort = bodies if owner is None else effort_units[owner]
        if effort in ("N*m", "N", "effort"):
            return unit
        if unit in _INERTIAS_BY_SI:
            return _INERTIAS_BY_SI[unit].format(effort)
        return of_effort(unit, effort)

    parameters = {n: replace(p, unit=unit_of(n, p.unit)) for n, p in model.parameters.items()}
    return replace(model, parameters=parameters)


def of_effort(unit: str, effort: str) -> str:
    """Return a unit per newton or newton metre as the same per unit of the `effort` that is measured."""
    return re.sub(r"^N(\*m(?!\w))?", effort, unit) if effort not in ("N*m", "N") else unit


def complete_result(study: Study, found: TreeResult) -> TreeResult:
    """Add the headline, tables, rows and cards to a result."""
    return replace(
        found,
        headline=tree_answer(found).sentence,
        tables=tuple(_tables(found)),
        rows=tuple(tree_rows_of(found)),
        cards={f"tree.{name}": tree_card(study, found, model) for name, model in found.models.items()},
    )


EXPORT_STEP = Step("Export a controller, because the model predicts each joint", "export")
"""Last step with a model that predicts."""

UNIDENTIFIED_FINDINGS = ("hardly_moved", "unknown_gain", "weak_numbers")
"""Findings that a parameter is not known well enough for a controller."""


def tree_answer(found: TreeResult) -> Answer:
    """Return whether the model predicts the effort of each joint where it was not fitted."""
    parts, judged = found.joint_answers, ROW_KIND_DESCRIPTIONS[found.judged]
    best, base = (found.errors_of(name, found.judged) for name in HEADLINE_MODELS)
    stated = found.errors_of("stated", found.judged)
    said = f"{answers_in_words(parts)}. On {judged}, the mean effort error is {percent(best.mean)} % "
    said += f"({percent(np.nanmin(best.each))} to {percent(np.nanmax(best.each))} % by joint); with plain "
    said += f"friction {percent(base.mean)} %" + (f", with stated bodies {percent(stated.mean)} %" if stated else "")
    numbers = [
        AnswerNumber(f"error of the effort of {name} on {judged}", error, "%")
        for name, error in zip(found.names, best.each, strict=True)
    ]
    recordings = len(found.checksums)
    return answer_of_parts(
        f"Does the model predict each joint's effort on data not used in the fit within {MAX_GOOD_ERROR:g} %?",
        f"{said}.",
        parts,
        numbers,
        Basis(
            recordings, recordings, judged=_judged_words(found), held_out=_held_out_count(found),
            computed=found.computed,
        ),
        improve=_improving(found, parts),
        next=(*_before_export(found, best.each), EXPORT_STEP),
        is_relative=True,
    )


def _before_export(found: TreeResult, errors: Sequence[float]) -> tuple[Step, ...]:
    """Return what to record or to look for before a model that predicts is used; `errors` are the joints' [%]."""
    steps = [*steps_before_use(found.verdicts, UNIDENTIFIED_FINDINGS)]
    if found.judged == "segments_out":
        steps.append(Step(
            'Record a second motion and hold it out (`use = "validate"` in study.toml): the errors are of segments of '
            "the fitted recordings"
        ))  # fmt: skip
    elif _held_out_count(found) == 1:
        steps.append(Step(SECOND_RECORDING_TEXT))
    each = dict(zip(found.names, errors, strict=True))
    worst = max((cause for cause in found.causes if cause.joint in each), key=lambda c: each[c.joint], default=None)
    if worst is not None:
        steps.append(Step(f"To reduce the error, look for this cause: {cause_sentence(worst)}"))
    return tuple(steps[:MAX_IMPROVING_STEPS])


def _judged_words(found: TreeResult) -> str:
    """Return the data of the errors in words, with their number where they were not fitted."""
    words = ROW_KIND_DESCRIPTIONS[found.judged]
    held = _held_out_count(found)
    if held:
        return "one held-out recording" if held == 1 else f"{held} {words}"
    return f"{found.segments} {words}" if found.judged == "segments_out" else words


def _held_out_count(found: TreeResult) -> int:
    """Return the number of held-out recordings that the errors are of."""
    return len({each.recording for each in found.traces if each.use == "validate"}) if found.judged == "heldout" else 0


def _improving(found: TreeResult, parts: Sequence[AnswerPart]) -> tuple[Step, ...]:
    """Return what improves the joints that the model does not predict: a cause, or what to record."""
    causes = {cause.joint: cause for cause in reversed(found.causes)}
    held = found.judged == "heldout"
    shares = dict(zip(found.names, found.moving_shares, strict=True))
    steps = []
    for part in (part for part in parts if part.verdict != "yes"):
        if part.verdict == "no" and part.name in causes:
            text = f"Look for this cause: {cause_sentence(causes[part.name])}"
        elif part.verdict == "no":
            text = (
                f"Look at {part.name} for an effect that the model lacks: load friction, ripple, a cable, or very "
                "small efforts"
            )
        elif shares[part.name] < MIN_MOVING_SHARE:
            text = f"Record motion of {part.name} in both directions, slowly and fast"
        else:
            text = f'Hold out a recording in which {part.name} moves (`use = "validate"`)'
        steps.append(Step(text))
    hold_out = () if held else (Step('Hold out a recording (`use = "validate"` in study.toml)'),)
    return tuple(dict.fromkeys((*steps[:MAX_IMPROVING_STEPS], *hold_out)))


def _tables(found: TreeResult) -> Iterator[ParameterTable | FigureTable]:
    answers = found.joint_answers
    # Joints that are not predicted are told first, and on a short terminal too.
    chosen = tuple(k for k, each in enumerate(answers) if each.verdict != "yes")
    rows = tuple((each.name, each.verdict, each.reason) for each in answers)
    heads = ("joint", "answer", "reason")
    yield FigureTable("Prediction of each joint", heads, rows, chosen_rows=chosen)
    names = [name.replace("_", " ") for name in found.names]
    short = max(map(len, names)) <= 8
    joint_heads = [f"{name} %" if short else f"joint {k + 1} %" for k, name in enumerate(names)]
    for kind, words in ROW_KIND_DESCRIPTIONS.items():
        errors = [e for e in found.in_order if e.judged == kind]
        if errors:
            heads = ("model", *joint_heads, "mean %")
            rows = tuple((MODEL_DESCRIPTIONS[e.model], *e.each, e.mean) for e in errors)
            named = tuple(i for i, e in enumerate(errors) if e.model in HEADLINE_MODELS)
            yield FigureTable(f"Effort errors on {words}", heads, rows, chosen_rows=named)
    by_recording = errors_by_recording(found)
    if len(by_recording) > 1:
        heads = ("recording", "use", *joint_heads, "mean %")
        rows = tuple(
            (name, "fitted" if use == "fit" else "held out", *each, float(np.nanmean(each)))
            for name, (use, each) in by_recording.items()
        )
        yield FigureTable("Effort errors of the best model by recording", heads, rows)
    heads = ("joint", "friction other than viscous and dry", "parameters identified", "parameters not identified")
    yield FigureTable("Parameters of joints", heads, tuple(_joints(found)))
    heads = ("joint", *(f"{name.replace('_', ' ')}" for name in _friction_names(found)))
    units = f"{', '.join(dict.fromkeys(found.effort_units))}; rad, m, s"
    yield FigureTable(f"Friction of the best model ({units})", heads, tuple(_friction_rows(found)))
    if found.payloads:
        heads = ("recording", "mass kg", "±", "known kg", "error %")
        rows = []
        for p in found.payloads:
            mass, half = (None, None) if p.mass.refused else (p.mass.value, 1.96 * p.mass.standard_error)
            rows.append((p.recording, mass, half, p.known, p.error if np.isfinite(p.error) else None))
        yield FigureTable("Payloads", heads, tuple(rows))


def errors_along(traces: Sequence[TreeTrace]) -> tuple[float, ...]:
    """Return the best model's error at each joint along some recordings, (m,) [%]; NaN where a joint rests."""
    moving, effort, predicted = (
        np.concatenate([getattr(t, name) for t in traces]) for name in ("moving", "effort", "predicted")
    )
    size, left = (np.sqrt((x * x * moving).sum(axis=0)) for x in (effort, effort - predicted))
    each = 100.0 * np.divide(left, size, out=np.full(len(size), np.nan), where=size > 0.0)
    return tuple(map(float, each))


def errors_by_recording(found: TreeResult) -> dict[str, tuple[str, tuple[float, ...]]]:
    """Return the use of each recording without a payload, and the best model's error at each joint, (m,) [%]."""
    parts: dict[str, list[TreeTrace]] = {}
    for trace in found.traces:
        parts.setdefault(trace.recording, []).append(trace)
    return {name: (each[0].use, errors_along(each)) for name, each in parts.items()}


def joint_states(found: TreeResult, k: int) -> dict[str, str]:
    """Return the verdict on each parameter of a joint, by the parameter's name."""
    head = f"{found.names[k]}."
    return {n.removeprefix(head): s for n, s in parameter_verdicts(found.best).items() if n.startswith(head)}


def terms_of(found: TreeResult, k: int) -> tuple[str, ...]:
    """Return the friction terms of a joint in addition to plain ones."""
    return tuple(term for term in found.best.families[k] if term not in PLAIN_TERMS)


ACCEPTABLE_VERDICTS = ("identified", "on a bound")
"""Verdicts that need no action."""

OFTEN_ZERO_PARAMETERS = ("offset", "ripple_")
"""Beginnings of the names of parameters that may be 0 without need for action."""


def unidentified_parameters(found: TreeResult, k: int) -> list[str]:
    """Return the parameters of a joint that are not identified but should be."""
    states = joint_states(found, k)
    return [
        n.replace("_", " ")
        for n, state in states.items()
        if state not in ACCEPTABLE_VERDICTS and not n.startswith(OFTEN_ZERO_PARAMETERS)
    ]


def _joints(found: TreeResult) -> Iterator[tuple[str, str, str, str]]:
    for k, name in enumerate(found.names):
        states = joint_states(found, k)
        good = sum(state == "identified" for state in states.values())
        terms = ", ".join(term.replace("_", " ") for term in terms_of(found, k)) or "nothing"
        if any(ripple.motor == k for ripple in found.best.ripples):
            terms += ", ripple"
        weak = unidentified_parameters(found, k)
        yield name, terms, f"{good} of {len(states)}", "none" if not weak else ", ".join(weak)


def _friction_names(found: TreeResult) -> tuple[str, ...]:
    return tuple(dict.fromkeys(n for k in range(len(found.names)) for n in _friction_of(found, k)))


def _friction_of(found: TreeResult, k: int) -> dict[str, float]:
    best, own = found.best, found.best.joint_numbers(k)
    shared = {f"motor_{n}": v for n, v in best.joint_numbers(k, True).items()} if k in found.robot.shared else {}
    return own | shared


def _friction_rows(found: TreeResult) -> Iterator[tuple[str | float | None, ...]]:
    names = _friction_names(found)
    for k, joint in enumerate(found.names):
        own = _friction_of(found, k)
        yield joint, *(own.get(name) for name in names)


def tree_card(study: Study, found: TreeResult, model: TreeEstimate) -> TreeCard:
    """Return the card of one of the models."""
    tree, level = found.robot.tree, study.table(TreeTable).confidence
    judged = next((e for kind in ("heldout", "segments_out") if (e := found.errors_of(model.name, kind))), None)
    motors = model.motors()
    seen = [np.concatenate([t.position for t in found.traces if t.use == "fit"]),
            np.concatenate([t.velocity for t in found.traces if t.use == "fit"])]  # fmt: skip
    limits = {joint.joint: joint.limits for joint in study.rig.joints}
    ranges = tuple(
        JointRange(
            limits[name].position_min, limits[name].position_max, limits[name].velocity, limits[name].effort,
            float(seen[0][:, k].min()), float(seen[0][:, k].max()), float(np.abs(seen[1][:, k]).max()),
        )
        for k, name in enumerate(found.names)
    )  # fmt: skip
    return TreeCard(
        study=found.study,
        family=model.name,
        method=f"{model.method} least squares" if model.method != "consistent" else "consistent least squares",
        names=found.names,
        bodies=tuple(joint.child for joint in tree.order),
        links=_rows(model.links()),
        gravity=tuple(float(x) for x in tree.gravity),
        joints=_rows(_without_springs(model, seen[0])),
        turns=_rows(found.robot.turns_array),
        motors=() if motors is None else _rows(motors),
        gains=tuple(gain for gain, _, _ in found.gains),
        gains_known=tuple(known for _, _, known in found.gains),
        drive_units=tuple(unit for _, unit, _ in found.gains),
        effort_units=found.effort_units,
        ranges=ranges,
        families=model.families,
        consistent=model.name == "consistent",
        parameters=tuple(p.on_card(level) for p in model.parameters.values()),
        covariance=_rows(model.covariance),
        heldout_error=() if judged is None else judged.each,
        processing=found.filter_note,
        confidence=level,
        notes=(*model.notes, *_spring_notes(model)),
        checksums=dict(found.checksums),
        pellucid=version("pellucid"),
        ripples=tuple(Ripple(found.names[r.motor], r.order, r.cosine, r.sine) for r in model.ripples),
        known={f"{p.recording}.payload": p.known for p in found.payloads if p.known is not None},
    )


def _without_springs(model: TreeEstimate, position: np.ndarray) -> np.ndarray:
    """Return the core's parameters of joints, which have no springs, with the springs' mean effort in the offsets.

    `position`, (n, m), is that of the fitted recordings.
    """
    made = model.joints()
    stiffness = [model.joint_numbers(k).get(PARALLEL_STIFFNESS, 0.0) for k in range(len(made))]
    made[:, _core.TREE_JOINT_PARAMETER_NAMES.index("offset")] += np.array(stiffness) * position.mean(axis=0)
    return made


def _spring_notes(model: TreeEstimate) -> Iterator[str]:
    for name, family in zip(model.robot.names, model.families, strict=True):
        if PARALLEL_STIFFNESS in family:
            yield f"the parallel spring of {name} is not in this card, except that its mean effort is in the offset"


def _rows(values: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, np.asarray(values, float).tolist()))


def tree_rows_of(found: TreeResult) -> Iterator[ResultRow]:
    """Yield the result rows: `<study>.<model>.<judged>.error.joint_<k>`, `.mean`, `<study>.<model>.<parameter>`, ..."""
    together = combined_checksum(found.checksums.values())
    plain = ResultRow("", None, "1", COMMAND_NAME, "fitted", together, found.filter_note)
    kept = replace(plain, split="heldout")
    for e in found.errors:
        of = plain if e.judged == "fitted" else kept
        note = f"{MODEL_DESCRIPTIONS[e.model]}; on {ROW_KIND_DESCRIPTIONS[e.judged]}; RMS missed over RMS effort, "
        note += "rows in which the joint moves"
        head = f"{found.study}.{e.model}.{e.judged}.error"
        for k, (name, value) in enumerate(zip(found.names, e.each, strict=True), 1):
            yield replace(of, id=f"{head}.joint_{k}", value=value, unit="%", note=f"{name}: {note}")
        yield replace(of, id=f"{head}.mean", value=e.mean, unit="%", note=f"mean over joints; {note}")
    for k, answer in enumerate(found.joint_answers, 1):
        value = {"yes": 1.0, "no": 0.0}.get(answer.verdict)
        note = f"{answer.name}: {answer}"
        yield replace(kept, id=f"{found.study}.best.predicts.joint_{k}", value=value, note=note)
    for cause in found.causes:
        share, size = (x if np.isfinite(x) else None for x in (cause.share, cause.size))
        own = replace(plain, id=f"{found.study}.cause.{cause.joint}.{cause.name}", note=cause_sentence(cause))
        yield replace(own, value=size, unit=cause.unit)
        yield replace(own, id=f"{own.id}.share", value=share, unit="1")
    for recording, (use, each) in errors_by_recording(found).items():
        of = plain if use == "fit" else kept
        for k, (name, value) in enumerate(zip(found.names, each, strict=True), 1):
            place = f"{found.study}.best.recording.{recording}.error.joint_{k}"
            yield replace(of, id=place, value=value if np.isfinite(value) else None, unit="%", note=name)
    names = [n for n in found.models["base"].parameters if not _of_joint(found.robot, n)]
    rotors = [n for n in found.models["base"].parameters if n.endswith(".rotor_inertia")]
    head = f"{found.study}.base.parameters"
    yield replace(plain, id=f"{head}.rigid", value=len(names), note="identifiable combinations of inertial parameters")
    yield replace(plain, id=f"{head}.rotors", value=len(rotors), note="rotor inertias identifiable separately")
    yield replace(plain, id=f"{head}.all", value=len(found.models["base"].parameters))
    for kind in ("segments_out", "heldout"):
        best, consistent = (found.errors_of(model, kind) for model in ("best", "consistent"))
        if best and consistent:
            note = "increase of the mean error from physical consistency, percentage points"
            value = consistent.mean - best.mean
            yield replace(kept, id=f"{found.study}.consistent.{kind}.loss", value=value, unit="%", note=note)
    if found.jackknife is not None:
        share, book = found.jackknife.share_within, found.jackknife.textbook_ratio
        note = f"standard errors within a factor of 2 of the jackknife over {found.jackknife.segments} segments"
        head = f"{found.study}.interval"
        yield replace(plain, id=f"{head}.over_jackknife.share_within_2", value=share, unit="%", note=note)
        note = "jackknife over textbook standard error, median"
        yield replace(plain, id=f"{head}.jackknife_over_textbook", value=book, note=note)
    for p in found.payloads:
        known = f"; known: {p.known:g} kg" if p.known is not None else ""
        known += PAYLOAD_NOTES[p.tests]
        first = f"{found.study}.payload" if len(found.payloads) == 1 else f"{found.study}.payload.{p.recording}"
        of = plain if p.tests == "nothing" else kept
        yield replace(of, id=f"{first}.mass", value=p.mass.value, unit="kg", note=f"{p.mass.sentence()}{known}")
        if p.known is not None and p.tests != "nothing":
            yield replace(kept, id=f"{first}.mass_error", value=p.error, unit="%", note=f"{p.recording}{known}")
    for name, model in found.models.items():
        for p in model.parameters.values():
            note = p.sentence() + ("; at its bound" if p.at_bound else "")
            reading = model.readings.get(p.name, "")
            note += f"; represents {reading}" if reading and reading != p.name else ""
            of = replace(plain, id=f"{found.study}.{name}.{p.name}", undetermined=p.undetermined)
            yield replace(of, value=p.value, unit=p.unit, note=note)


def _of_joint(robot: Robot, name: str) -> bool:
    owner = name.rpartition(".")[0]
    return owner in robot.names or owner.rpartition(".")[0] in robot.names


def choice_of(robot: Robot, models: Sequence[TreeModel]) -> Choice:
    """Count how often each term, and a ripple, was chosen in the `models` of all folds."""
    terms = tuple(
        Counter(term for model in models for term in model.families[k] if term not in PLAIN_TERMS)
        for k in range(len(robot.names))
    )
    ripples = Counter(robot.names[k] for model in models for k in sorted({r.motor for r in model.ripples}))
    return Choice(len(models), terms, ripples)


GAIN_SOURCES = {
    "stated": "as stated in study.toml",
    "desired": "from the controller's desired torque and current",
    "payload": "from recordings with and without a known payload",
}
"""Sources of the drive gains, in words."""


def with_gains(
    study: Study, robot: Robot, motions: Sequence[TreeMotion]
) -> tuple[list[TreeMotion], tuple[Parameter, ...]]:
    """Return the motions with efforts by the gains that `[tree] gains` requests, and these gains.

    There are no gains if they are stated. Only fitted recordings determine gains.
    """
    table = study.table(TreeTable)
    if table.gains == "desired":
        gains = gains_from_desired(robot, fitted_without_payload(motions), width=table.velocity_width)
    elif table.gains == "payload":
        gains = _gains_from_payloads(robot, motions, _calibrating(study, motions), table.velocity_width)
    else:
        return list(motions), ()
    each = np.array([g.value for g in gains])
    return [with_drive_gains(m, robot, each) for m in motions], gains


def identify_payloads(
    study: Study, robot: Robot, motions: Sequence[TreeMotion], best: TreeEstimate, gains: Sequence[Parameter]
) -> tuple[FoundPayload, ...]:
    """Identify the payload of each recording with one, together with the fitted recordings without one.

    If a recording's stated mass determined the gains, its payload is identified with gains from the other such
    recordings. If it is the only one, its mass is marked as no test of the gains.
    """
    made = []
    if not all(motions[0].gain_known):
        return ()  # without gains there is no effort in N m, and so no mass
    # Stribeck terms are left out: their velocities are searched only without load, and the terms are small beside one.
    families = tuple(tuple(term for term in family if term != STRIBECK_FRICTION.name) for family in best.families)
    calibrating = _calibrating(study, motions)
    for name in _with_payload(motions):
        loaded = [m for m in motions if m.recording == name]
        spec = loaded[0].payload
        tests, own_gains = "gains", gains
        if name in calibrating:
            others = [other for other in calibrating if other != name]
            tests = "gains of other payloads" if others else "nothing"
            if others:
                own_gains = _gains_from_payloads(robot, motions, others, best.velocity_width)
        found = identify_payload(
            robot, fitted_without_payload(motions), loaded, families, width=best.velocity_width, link=spec.link,
            gains=own_gains or None,
        )  # fmt: skip
        made.append(FoundPayload(name, found.mass, spec.mass, tuple(map(float, found.centre)), found.link, tests))
    return tuple(made)


def _calibrating(study: Study, motions: Sequence[TreeMotion]) -> list[str]:
    """Return the recordings whose stated payloads determine the gains, if `[tree] gains` requests payloads."""
    if study.table(TreeTable).gains != "payload":
        return []
    return _with_payload([m for m in motions if m.use == "fit"])


def _gains_from_payloads(
    robot: Robot, motions: Sequence[TreeMotion], names: Sequence[str], width: float
) -> tuple[Parameter, ...]:
    """Estimate the gains from the stated payloads of the recordings `names`.

    `width` is that of the smooth sign of friction [rad/s; m/s].
    """
    loaded = [[m for m in motions if m.recording == name] for name in names]
    last = robot.tree.order[-1].child
    links = list(dict.fromkeys(each[0].payload.link or last for each in loaded))
    if len(links) > 1:
        raise IdentificationError(
            f'[tree] gains = "payload": found payloads on the links {" and ".join(links)}, expected those that are '
            'fitted on one link; mark the recordings of the others use = "validate"'
        )
    masses = [mass for each in loaded if (mass := each[0].payload.mass) is not None]
    if len(masses) < len(loaded):
        raise IdentificationError(
            '[tree] gains = "payload": found a payload without a mass, expected the mass of each that is fitted'
        )
    link = links[0] if links else None
    return gains_from_payload(robot, fitted_without_payload(motions), loaded, masses, width=width, link=link)


def _with_payload(motions: Sequence[TreeMotion]) -> list[str]:
    """Return the names of the recordings with a payload, each once."""
    return list(dict.fromkeys(m.recording for m in motions if m.payload is not None))


