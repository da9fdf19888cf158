"""What `identify` finds of a robot of several joints: its models, what each predicts, as tables, rows and cards."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from typing import Literal

import numpy as np

from ...fit.parameter import Parameter
from ...fit.tree.ripple import SpectralLine
from ...fit.tree.segment_jackknife import SegmentJackknife
from ...fit.tree.tree_estimate import TreeEstimate
from ...fit.tree.tree_regression import TreeModel
from ...fit.tree.tree_verdicts import parameter_verdicts
from ...models.robot import Robot
from ...models.tree_card import JointRange, Ripple, TreeCard
from ...recordings.results import ResultRow, combined_checksum
from ...recordings.study import Study
from ..result import FigureTable, ParameterTable, Result
from .tree_table import TreeTable

COMMAND = "identify"

MODELS: Mapping[str, str] = {
    "published": "published friction, stated bodies",
    "stated": "stated bodies, friction fitted",
    "base": "base parameters, plain friction",
    "best": "friction chosen for each joint",
    "consistent": "the same with bodies that can exist",
    "prior": "the same, drawn to stated bodies",
}
"""Models in words, the simplest rivals first."""

JUDGED: Mapping[str, str] = {
    "fitted": "what was fitted",
    "segments_out": "segments left out in turn",
    "heldout": "held-out recordings",
}
"""What errors are of."""

PAYLOAD_NOTES: Mapping[str, str] = {
    "gains": "",
    "gains of other payloads": "; with gains from the other payloads",
    "nothing": "; it set the gains of the drives, and is no test of them",
}
"""What rows add about a payload's mass, by what it tests."""

PLAIN = ("viscous", "coulomb", "offset", "motor_viscous", "motor_coulomb")
"""Friction terms that every joint has, or every motor that joints share."""


@dataclass(frozen=True)
class Errors:
    """Of a model: RMS of what it misses over the RMS effort, over rows in which a joint moves, (m,) [%]."""

    model: str
    judged: Literal["fitted", "segments_out", "heldout"]
    each: tuple[float, ...]

    @property
    def mean(self) -> float:
        """Over joints [%]."""
        return float(np.mean(self.each))


@dataclass(frozen=True)
class TreeTrace:
    """A recording of all joints as it was judged; n rows, m joints [rad; m, N m; N]."""

    recording: str
    use: Literal["fit", "validate"]
    time: np.ndarray  # (n,)
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    moving: np.ndarray
    load: np.ndarray  # What bodies and rotors need, by the best model
    predicted: np.ndarray  # By the best model


@dataclass(frozen=True)
class Choice:
    """Which friction terms and ripples were chosen within the rows that were left, a segment out in turn."""

    folds: int
    terms: tuple[Mapping[str, int], ...]  # Of each joint, how often a term was chosen
    ripples: Mapping[str, int]  # How often a ripple was found in a joint's drive


@dataclass(frozen=True)
class FoundPayload:
    """What hung on the robot in one recording, as found with the model, beside what study.toml says of it."""

    recording: str
    mass: Parameter
    known: float | None = None  # kg
    centre: tuple[float, ...] = ()  # In the link's frame [m]; NaN where the motion does not tell
    link: str = ""
    # What the mass tests: the gains; where the stated mass set them, gains from the other payloads, or nothing
    tests: Literal["gains", "gains of other payloads", "nothing"] = "gains"

    @property
    def error(self) -> float:
        """Error of the mass [%]; NaN where the mass is not known, or set the gains that it was found with."""
        unknown = self.known is None or bool(self.mass.refused) or self.tests == "nothing"
        return float("nan") if unknown else 100.0 * abs(self.mass.value - self.known) / self.known


@dataclass(frozen=True, kw_only=True)
class TreeResult(Result):
    """Everything `identify` found on a robot; ``result["joint_3.viscous"]`` is of the best model, ``"base.…"`` and
    ``"consistent.…"`` of the others."""

    robot: Robot
    models: Mapping[str, TreeEstimate]  # base, best, consistent, as far as there are
    failures: Mapping[str, str]  # Models that could not be found, and why
    errors: tuple[Errors, ...]
    choice: Choice | None
    lines: tuple[SpectralLine, ...]  # The strongest line of each drive's residual
    jackknife: SegmentJackknife | None
    payloads: tuple[FoundPayload, ...]
    gains: tuple[tuple[float, str, bool], ...]  # Of each drive: effort per unit, its unit, whether it is known
    identified_gains: tuple[Parameter, ...]  # Of each drive; () where they were stated
    gains_note: str  # Where they come from
    published: Mapping[str, Mapping[str, float]]
    filter_note: str
    segments: int
    doubts: tuple[str, ...] = ()  # What speaks against a joint's sign, and does not prove it
    traces: tuple[TreeTrace, ...] = field(default=(), repr=False)

    @property
    def best(self) -> TreeEstimate:
        """The model whose figures are drawn."""
        return self.models["best"]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the joints that move."""
        return self.robot.names

    @property
    def effort_units(self) -> tuple[str, ...]:
        """Of each joint's effort: the drive's where its gain is not known."""
        return tuple(
            own[1] if known else unit for own, (_, unit, known) in zip(self.robot.units, self.gains, strict=True)
        )

    @property
    def estimates(self) -> Mapping[str, Parameter]:
        """The best model's parameters by name; those of every model below its name too."""
        found = {f"{name}.{p.name}": p for name, model in self.models.items() for p in model.parameters.values()}
        return dict(self.best.parameters) | found

    def errors_of(self, model: str, judged: str) -> Errors | None:
        """Of a model on one kind of rows; None where these are not there."""
        return next((e for e in self.errors if (e.model, e.judged) == (model, judged)), None)

    @property
    def judged(self) -> str:
        """The most demanding kind of rows that there is."""
        return next(kind for kind in ("heldout", "segments_out", "fitted") if self.errors_of("best", kind))

    @property
    def worst(self) -> int:
        """The joint that is predicted worst."""
        return int(np.nanargmax(self.errors_of("best", self.judged).each))


def completed(study: Study, found: TreeResult) -> TreeResult:
    """The same with headline, tables, rows and cards."""
    return replace(
        found,
        headline=_headline(found),
        tables=tuple(_tables(found)),
        rows=tuple(tree_rows_of(found)),
        cards={f"tree.{name}": tree_card(study, found, model) for name, model in found.models.items()},
    )


def _headline(found: TreeResult) -> str:
    best, base = (found.errors_of(name, found.judged) for name in ("best", "base"))
    wrong = list(dict.fromkeys(v.finding.replace("_", " ") for v in found.verdicts if v.kind == "wrong"))
    said = (
        f"{len(found.names)} joints; mean effort error {best.mean:.3g} % on {JUDGED[found.judged]} with friction "
        f"chosen for each joint, {base.mean:.3g} % with plain friction"
    )
    return said + (f"; not to be used before this is mended: {', '.join(wrong)}" if wrong else "")


def _tables(found: TreeResult) -> Iterator[ParameterTable | FigureTable]:
    for kind, words in JUDGED.items():
        errors = sorted((e for e in found.errors if e.judged == kind), key=lambda e: list(MODELS).index(e.model))
        if errors:
            heads = ("model", *(f"{_short(found, k)} %" for k in range(len(found.names))), "mean %")
            rows = tuple((MODELS[e.model], *e.each, e.mean) for e in errors)
            yield FigureTable(f"Effort errors on {words}", heads, rows)
    yield FigureTable(
        "Joints", ("joint", "friction beside viscous and dry", "numbers shown", "verdict"), tuple(_joints(found))
    )
    heads = ("joint", *(f"{name.replace('_', ' ')}" for name in _friction_names(found)))
    yield FigureTable("Friction of the best model (SI)", heads, tuple(_friction_rows(found)))
    if found.payloads:
        heads = ("recording", "mass kg", "±", "known kg", "error %")
        rows = tuple(
            (
                p.recording,
                None if p.mass.refused else p.mass.value,
                None if p.mass.refused else 1.96 * p.mass.standard_error,
                p.known,
                p.error if np.isfinite(p.error) else None,
            )
            for p in found.payloads
        )
        yield FigureTable("Payloads", heads, rows)


def _short(found: TreeResult, k: int) -> str:
    """A joint's name where all names are short, else its number."""
    names = [name.replace("_", " ") for name in found.names]
    return names[k] if max(map(len, names)) <= 8 else f"joint {k + 1}"


def joint_states(found: TreeResult, k: int) -> dict[str, str]:
    """Verdict of each of a joint's own numbers, by the number's name."""
    head = f"{found.names[k]}."
    return {n.removeprefix(head): s for n, s in parameter_verdicts(found.best).items() if n.startswith(head)}


def terms_of(found: TreeResult, k: int) -> tuple[str, ...]:
    """Friction terms that were chosen for a joint beside those that every joint has."""
    return tuple(term for term in found.best.families[k] if term not in PLAIN)


FINE = ("identified", "on a bound")
SMALL = ("offset", "ripple_")
"""Small on a good machine, and a phase: that one of these may be 0 is nothing to act upon."""


def unsure(found: TreeResult, k: int) -> list[str]:
    """A joint's own numbers that are not told from 0, and ought to be."""
    said = joint_states(found, k)
    return [n.replace("_", " ") for n, state in said.items() if state not in FINE and not n.startswith(SMALL)]


def _joints(found: TreeResult) -> Iterator[tuple[str, str, str, str]]:
    for k, name in enumerate(found.names):
        said = joint_states(found, k)
        good = sum(state == "identified" for state in said.values())
        terms = ", ".join(term.replace("_", " ") for term in terms_of(found, k)) or "nothing"
        if any(ripple.motor == k for ripple in found.best.ripples):
            terms += ", ripple"
        weak = unsure(found, k)
        yield name, terms, f"{good} of {len(said)}", "good" if not weak else f"not sure: {', '.join(weak)}"


def _friction_names(found: TreeResult) -> tuple[str, ...]:
    names = dict.fromkeys(n for k in range(len(found.names)) for n in _friction_of(found, k))
    return tuple(names)


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
    """The card of one of the models."""
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
        joints=_rows(model.joints()),
        turns=_rows(found.robot.turns_array),
        motors=() if motors is None else _rows(motors),
        gains=tuple(gain for gain, _, _ in found.gains),
        gains_known=tuple(known for _, _, known in found.gains),
        drive_units=tuple(unit for _, unit, _ in found.gains),
        effort_units=found.effort_units,
        ranges=ranges,
        families=model.families,
        consistent=model.name in ("consistent", "prior"),
        parameters=tuple(p.on_card(level) for p in model.parameters.values()),
        covariance=_rows(model.covariance),
        heldout_error=() if judged is None else judged.each,
        processing=found.filter_note,
        confidence=level,
        notes=tuple(model.notes),
        checksums=dict(found.checksums),
        pellucid=version("pellucid"),
        ripples=tuple(Ripple(found.names[r.motor], r.order, r.cosine, r.sine) for r in model.ripples),
        known={f"{p.recording}.payload": p.known for p in found.payloads if p.known is not None},
    )


def _rows(values: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, np.asarray(values, float).tolist()))


def tree_rows_of(found: TreeResult) -> Iterator[ResultRow]:
    """Every figure: `<study>.<model>.<judged>.error.joint_<k>` and `.mean`, `<study>.<model>.<parameter>`, ..."""
    together = combined_checksum(found.checksums.values())
    plain = ResultRow("", None, "1", COMMAND, "fitted", together, found.filter_note)
    kept = replace(plain, split="heldout")
    for e in found.errors:
        of = plain if e.judged == "fitted" else kept
        note = f"{MODELS[e.model]}; on {JUDGED[e.judged]}; RMS missed over RMS effort, rows in which the joint moves"
        head = f"{found.study}.{e.model}.{e.judged}.error"
        for k, (name, value) in enumerate(zip(found.names, e.each, strict=True), 1):
            yield replace(of, id=f"{head}.joint_{k}", value=value, unit="%", note=f"{name}: {note}")
        yield replace(of, id=f"{head}.mean", value=e.mean, unit="%", note=f"mean over joints; {note}")
    names = [n for n in found.models["base"].parameters if not _of_joint(found.robot, n)]
    rotors = [n for n in found.models["base"].parameters if n.endswith(".rotor_inertia")]
    head = f"{found.study}.base.parameters"
    yield replace(plain, id=f"{head}.rigid", value=len(names), note="combinations of bodies' numbers that efforts tell")
    yield replace(plain, id=f"{head}.rotors", value=len(rotors), note="rotors that can be told from bodies")
    yield replace(plain, id=f"{head}.all", value=len(found.models["base"].parameters))
    for kind in ("segments_out", "heldout"):
        best, consistent = (found.errors_of(model, kind) for model in ("best", "consistent"))
        if best and consistent:
            note = "points of the mean error that bodies must give up to exist"
            value = consistent.mean - best.mean
            yield replace(kept, id=f"{found.study}.consistent.{kind}.loss", value=value, unit="%", note=note)
    if found.jackknife is not None:
        share, book = found.jackknife.share_within, found.jackknife.textbook_ratio
        note = f"standard errors within a factor of 2 of the jackknife over {found.jackknife.segments} segments"
        yield replace(
            plain, id=f"{found.study}.interval.over_jackknife.share_within_2", value=share, unit="%", note=note
        )
        note = "jackknife over textbook standard error, median"
        yield replace(plain, id=f"{found.study}.interval.jackknife_over_textbook", value=book, note=note)
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
            note += f"; stands for {reading}" if reading and reading != p.name else ""
            yield replace(
                plain, id=f"{found.study}.{name}.{p.name}", value=p.value, unit=p.unit, note=note,
                undetermined=p.undetermined,
            )  # fmt: skip


def _of_joint(robot: Robot, name: str) -> bool:
    return name.rpartition(".")[0].rpartition(".")[0] in robot.names or name.rpartition(".")[0] in robot.names


def choice_of(robot: Robot, models: Sequence[TreeModel]) -> Choice:
    """How often each term, and a ripple, was chosen over the `models` of all folds."""
    terms: list[dict[str, int]] = []
    for k in range(len(robot.names)):
        counted: dict[str, int] = {}
        for term in (term for model in models for term in model.families[k] if term not in PLAIN):
            counted[term] = counted.get(term, 0) + 1
        terms.append(counted)
    found = {name: sum(any(r.motor == k for r in m.ripples) for m in models) for k, name in enumerate(robot.names)}
    return Choice(len(models), tuple(terms), {name: count for name, count in found.items() if count})
