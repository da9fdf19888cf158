"""Write a calibrated estimator of torque from EMG as a folder of C and C++, with a test vector of motion and faults."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import ClassVar

import numpy as np

from ... import _core
from ..._errors import PellucidError
from ..._printed_command import printed_command
from ...controllers.export.c_folder import render, render_all
from ...controllers.export.controller_exporter import ControllerExporter, own_folder, owner_of
from ...controllers.export.replay_vector import ReplayVector
from ...models.fields import model_fields
from ...study.answer import Answer
from ...study.exporter import (
    OUTPUT_FILE,
    ExportRequest,
    float_literal,
    header_files,
    needed_headers,
    record_outputs,
    refuse_other_makefile,
    write_files,
)
from ...study.procedures.card_sources import require_fresh
from ...study.procedures.registry import asked
from ...study.results import ResultRow, read_rows
from ...study.study import Study
from ..estimators.families import named_family
from ..models.emg_estimator import (
    ESTIMATOR_FAULTS,
    ESTIMATOR_KINDS,
    EmgEstimatorCard,
    best_estimator,
    read_estimator_card,
    unwatched_words,
)
from .emg_torque.emg_torque_table import EmgTorqueTable
from .emg_torque.live_scores import HOLD_OUT_TEXT, limits_of, read_live_scores, scores_words

FOLDER_TITLE = "torque of joints from EMG"
"""Title in the exported files."""

MOTION_STEPS = 200
"""Number of steps of the test vector's motion."""

FAULT_STEPS = 24
"""Number of steps of each stretch of the test vector with a fault."""

FIELD_KINDS = ("muscle", "emg_channel", "watched_channel", "watched_angle", "estimated_joint")
"""Parameter kinds of the core that become structs in C."""

WATCH_FAULTS = tuple(i for i, name in enumerate(_core.EMG_FAULTS) if name in ("changed", "unlike", "uncertain"))
"""Faults that a made motion may raise, since it is nobody's movement: the watch says so, as it should."""

MAX_CHANGED_STEPS = 600
"""Largest number of steps of the test vector in which a channel has changed."""


@dataclass(frozen=True)
class EstimatorStep:
    """Inputs of one step of the estimator."""

    now: int  # time of the step [us]
    emg: np.ndarray  # envelopes, or magnitudes of raw EMG
    angle: np.ndarray  # angles of the joints [rad]
    before: int = 0  # event before the step; 1 for a power-on

    @property
    def text(self) -> str:
        """The inputs as a C initialiser."""

        def bits(values: np.ndarray) -> str:
            return ", ".join(f"0x{int(x):08x}u" for x in np.asarray(values, np.float32).view(np.uint32))

        return f"{{{self.before}u, {self.now}, {{{bits(self.emg)}}}, {{{bits(self.angle)}}}}}"


def chosen_card(
    study: Study, *, card: str | None = None, controller: str | None = None, participant: str | None = None,
    allow_outside: bool = False,
) -> EmgEstimatorCard:  # fmt: skip
    """Return the card by its file name, else the one of the first joint that is best in cross-validation."""
    if controller is not None and controller not in ESTIMATOR_KINDS:
        raise PellucidError(
            f'export: found the controller "{controller}", expected one of {", ".join(ESTIMATOR_KINDS)}'
        )
    if card is not None:
        path = Path(card) if allow_outside and Path(card).is_absolute() else study.card(card)
        return require_fresh(study, path, read_estimator_card(path))
    who = (*((participant,) if participant else ()), *study.table(EmgTorqueTable).joints, "together")
    kinds = [controller] if controller else ESTIMATOR_KINDS
    names = [[f"emg_{what}_{kind}.json" for kind in kinds] for what in who]
    present = ([path for path in map(study.card, own) if path.is_file()] for own in names)
    paths = next((own for own in present if own), [])
    best = best_estimator(require_fresh(study, path, read_estimator_card(path)) for path in paths)
    if best is None:
        every = ", ".join(name for own in names for name in own)
        held_out = "" if study.recordings("validate") else f"{HOLD_OUT_TEXT}, then "
        raise PellucidError(
            f"export of {study.name}: found none of the cards {every} in {study.models_dir}, expected one. "
            f"A card needs a held-out recording and a causal chain; {held_out}use: "
            f"{printed_command('calibrate', study.folder)}"
        )
    return best


def write_estimator_folder(
    study: str,
    card: EmgEstimatorCard,
    out: Path,
    *,
    period: float | None = None,
    motion: tuple[np.ndarray, np.ndarray] | None = None,
    accuracy: Sequence[str] = (),
) -> Path:
    """Write the folder; files of an earlier export are replaced, all others stay.

    `motion` holds envelopes, (n, channels), and angles, (n, angles) [rad], for the test vector; None for made ones.
    `accuracy` are sentences of `describe_card` for the README.
    """
    refuse_other_makefile(out)
    card.build(period)  # raises an error if the estimator cannot be stepped
    arrays, raw = card.arrays(period), card.chain != "none"
    headers = sorted({*needed_headers("emg_estimator.hpp"), *needed_headers("integrity.hpp")})
    files = header_files(headers)
    terms, joints, muscles, surface = [], [], [], []
    for joint, named in zip(arrays["joints"], card.joints, strict=True):
        own = arrays["terms"][len(joints)]
        joints.append({"joint": named, "angle": joint[0], "first": len(terms), "terms": len(own)})
        terms += [
            {"weight": weight, "first": _factor(first), "second": _factor(second), "name": _product(term)}
            for (weight, first, second), term in zip(own, named.terms, strict=True)
        ]
    for muscle, shares in zip(card.muscles, arrays["shares"], strict=True):
        rows = muscle.surface.rows(card.angles)
        axes = [
            {"angle": _factor(int(row[0])), "sign": row[1], "offset": row[2], "start": row[3], "step": row[4] or 1.0,
             "cells": int(row[5]) or 1, "name": axis.angle if axis else "none"}
            for row, axis in zip(rows, (*muscle.surface.axes, None), strict=False)
        ]  # fmt: skip
        made = {"muscle": muscle, "shares": shares, "axes": axes, "count": len(muscle.surface.axes)}
        muscles.append({**made, "surface": len(surface)})
        surface += muscle.surface.coefficients
    watched, unwatched = [], np.zeros((len(card.channels), len(model_fields("watched_channel"))))
    for channel, numbers, own in zip(
        card.channels,
        arrays.get("watch", unwatched).tolist(),
        arrays.get("patterns", [()] * len(card.channels)),
        strict=True,
    ):
        watched.append({"name": channel.name, "numbers": numbers, "first": len(terms), "terms": len(own)})
        terms += [
            {"weight": weight, "first": _factor(first), "second": _factor(second), "name": f"pattern of {channel.name}"}
            for weight, first, second in own
        ]
    ranges = [*zip(card.angles, arrays.get("ranges", np.zeros((len(card.angles), 4))).tolist(), strict=True)]
    late = max((m.numbers["delay"] for m in card.muscles), default=0.0) / arrays["period"]
    sizes = {"delay": int(np.ceil(late)) + 4, "lag": 1 + max(arrays["lags"], default=0)}
    vector = estimator_vector(card, arrays["period"], motion)
    content = {
        "title": FOLDER_TITLE, "card": card, "arrays": arrays, "study": study, "version": version("pellucid"),
        "raw": raw, "headers": headers, "literal": float_literal, "vector": vector, "joints": joints, "terms": terms,
        "muscles": muscles, "surface": surface, "lags": arrays["lags"], "watched": watched, "ranges": ranges, **sizes,
        "before": arrays["before"] if raw else (), "after": arrays["after"] if raw else (),
        "fields": {name: model_fields(name) for name in FIELD_KINDS},
        "faults": _core.EMG_FAULTS, "fault_words": {each.name: each.words for each in ESTIMATOR_FAULTS},
        "period_us": round(1e6 * arrays["period"]),
        "listened": max(1, round(card.emg_rate * arrays["period"])) if raw else 0,
        "storage": _storage(card, len(terms), **sizes), "cards": (card.name,), "checksums": card.checksums,
        "notes": card.notes, "period": arrays["period"],
        "unwatched": unwatched_words(card.watch.alike) if card.watch else "",
        "common": arrays.get("common", (0.0, 0.0)), "accuracy": tuple(accuracy),
    }  # fmt: skip
    files |= render_all("estimator", **content)
    outputs = [
        (int(status), [int(x, 16) for x in bits]) for status, *bits in map(str.split, record_outputs(files, out))
    ]
    wrong = {status & 0xFF for status, _ in outputs[1 : vector.motion]} - {0, *WATCH_FAULTS}
    if wrong:
        raise PellucidError(f"{out}: found {_core.EMG_FAULTS[wrong.pop()]} in the test vector's motion, expected none")
    if outputs:
        files[OUTPUT_FILE] = render("vector_outputs.h", "estimator", outputs=outputs)
    return write_files(files, out)


def estimator_vector(
    card: EmgEstimatorCard, period: float, motion: tuple[np.ndarray, np.ndarray] | None = None, seed: int = 1
) -> ReplayVector:
    """Return a motion with a missed period and a channel that is silent for a moment, then each fault and its end."""
    emg, angle = _motion(card, period, seed) if motion is None else motion
    step, patience = round(1e6 * period), max(1, card.periods(card.patience, period))

    def heard(i: int) -> EstimatorStep:
        return EstimatorStep(
            1_000_000 + i * step, emg[i % len(emg)].astype(np.float32), angle[i % len(angle)].astype(np.float32)
        )

    rows = [heard(i) for i in range(len(emg)) if i != len(emg) // 3]
    rows[0] = replace(rows[0], before=1)
    if card.chain == "none":
        rows[len(rows) // 2].emg[0] = np.nan
    last = len(emg)
    steps = [*rows, *_fault_steps(heard, last, patience, step), *_changed_steps(card, heard, period)]
    return ReplayVector(tuple(steps), len(rows))


def _fault_steps(heard: Callable[[int], EstimatorStep], at: int, patience: int, step: int) -> Iterator[EstimatorStep]:
    """Yield the steps of every fault, each after a power-on of its own, and the steps after the fault."""
    for number in (np.nan, np.inf, -np.inf, 3e38):
        for of in ("emg", "angle"):
            for i in range(FAULT_STEPS + patience):
                row = replace(heard(at + i), before=int(i == 0))
                if 6 <= i < 10 + patience:
                    getattr(row, of)[-1] = number
                yield row
    for changed in (0, -10 * step, 5 * step, 40 * step):
        for i in range(FAULT_STEPS):
            row = replace(heard(at + i), before=int(i == 0))
            yield replace(row, now=row.now + changed) if i >= 12 else row
    for i in range(FAULT_STEPS):  # not every angle was heard at first
        row = replace(heard(at + i), before=int(i == 0))
        if i < 4:
            row.angle[0] = np.nan
        yield row


def _changed_steps(
    card: EmgEstimatorCard, heard: Callable[[int], EstimatorStep], period: float
) -> Iterator[EstimatorStep]:
    """Yield the steps in which the channel of the greatest consequence is four times as large, then as it was."""
    if card.watch is None:
        return
    count = min(MAX_CHANGED_STEPS, round(2.0 * card.watch.seconds / period))
    worst = int(np.argmax([c.consequence * c.square for c in card.watch.channels]))
    for i in range(2 * count):
        row = replace(heard(i), before=int(i == 0))
        if i < count:
            row.emg[worst] *= 4.0
        yield row


def _motion(card: EmgEstimatorCard, period: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return bursts of every channel, (n, channels), and angles within every surface, (n, angles) [rad]."""
    rng, t = np.random.default_rng(seed), period * np.arange(MOTION_STEPS)
    rate = 2.0 * np.pi * 3.0 / (MOTION_STEPS * period)
    waves = 0.5 + 0.5 * np.sin(rate * t[:, None] + rng.uniform(0.0, 6.0, len(card.channels)))
    low, high = (np.array([getattr(c, end) for c in card.channels]) for end in ("rest", "ceiling"))
    emg = low + (0.4 * high - low) * waves**2
    emg = emg / np.array([c.scale for c in card.channels])
    middle, swing = np.zeros(len(card.angles)), np.full(len(card.angles), 0.3)
    for muscle in card.muscles:
        for axis in muscle.surface.axes:
            if axis.angle in card.angles:
                k = card.angles.index(axis.angle)
                middle[k] = (axis.start + 0.5 * axis.cells * axis.step - axis.offset) * axis.sign
                swing[k] = min(swing[k], 0.3 * axis.cells * axis.step)
    return emg, middle + swing * np.sin(0.7 * rate * t[:, None] + np.arange(len(card.angles)))


def _storage(card: EmgEstimatorCard, terms: int, *, delay: int, lag: int) -> int:
    """Return the size of a context with a margin [bytes]; the compiler refuses too small a size."""
    c, a, m, j = len(card.channels), len(card.angles), max(len(card.muscles), 1), len(card.joints)
    # Terms are those of maps and of patterns.
    numbers = (
        512
        + c * (80 + 4 * lag)
        + 80 * a
        + m * (432 + 4 * c + 4 * delay)
        + 96 * j
        + 16 * terms
        + c * 44
        + 64 * c
        + 16 * a
    )
    return (numbers + 63) // 64 * 64


def _factor(index: int) -> str:
    return "PELLUCID_NONE" if index < 0 else f"{index}u"


def _product(term) -> str:
    return " * ".join(name for name in (term.first, term.second) if name) or "offset"


def describe_card(request: ExportRequest, name: str) -> tuple[str, ...]:
    """Return sentences on a card: its joints, its held-out figures, and other cards to export."""
    study = request.study
    rows = _result_rows(request)
    scores = read_live_scores(study.name, name, rows)
    what, _, kind = name.removeprefix("emg_").rpartition("_")
    joints = tuple(dict.fromkeys(each.joint for each in scores)) or (what,)
    family = f"{named_family(kind).description}, {name}.json" if kind in ESTIMATOR_KINDS else f"{name}.json"
    sentences = [f"Estimates torque of {' and '.join(joints)} from past samples ({family})."]
    if scores:
        limits = ", ".join(limits_of(scores))
        sentences.append(f"Held-out recordings: {scores_words(scores)}.{f' Limits: {limits}.' if limits else ''}")
    else:
        sentences.append("Its error on held-out recordings is not known: run `calibrate`.")
    for joint in joints:
        chosen = [r for r in rows if r.id.startswith(f"{study.name}.{joint}.chosen.r2") and r.value is not None]
        if chosen:
            worst = min(chosen, key=lambda row: row.value)
            sentences.append(
                f"R² {worst.value:.3f} for {joint} in `calibrate` belongs to {worst.note.rpartition(': ')[2]}, which "
                "runs offline only: it also uses later samples."
            )
    missing = [joint for joint in study.table(EmgTorqueTable).joints if joint not in joints]
    others = [path.name for path in study.cards() if path.stem.startswith("emg_") and path.stem != name]
    if missing:
        sentences.append(f"Not included: {', '.join(missing)}.")
    if others:
        sentences.append(f"Other exports: {', '.join(f'`--card {other}`' for other in others)}.")
    return tuple(sentences)


def _result_rows(request: ExportRequest) -> list[ResultRow]:
    """Return the rows of the study's results.json; none without the file, or if the card is not the study's own."""
    study, card = request.study, Path(request.card or "")
    if card.is_absolute() and card.resolve() != study.card(card.name).resolve():
        return []
    return read_rows(study.results_path) if study.results_path.is_file() else []


class EstimatorExporter(ControllerExporter):
    """An estimator of torque from EMG, which is no law and has no safety gate."""

    order: ClassVar[int] = 20
    unused: ClassVar[tuple[str, ...]] = ("slider", "exponents", "load", "held", "probe", "unmeasured")
    why_unused: ClassVar[str] = "torque from EMG has none"
    question: ClassVar[str] = "Can this estimator be exported, and what does it protect from?"

    def describe(self, request: ExportRequest, place: Path) -> str:
        """Return how accurate the written estimator is, what else can be exported, and its lack of a supervisor."""
        supervised = "An estimator commands no drive and has no supervisor: the controller that reads it must have one"
        cards = self.written_cards(place)
        return " ".join((*(describe_card(request, Path(cards[0]).stem) if cards else ()), supervised))

    def make_answer(self, request: ExportRequest, place: Path) -> Answer:
        """Return the answer, with the limits of the written estimator on held-out recordings."""
        rows, cards = _result_rows(request), self.written_cards(place)
        scores = [read_live_scores(request.study.name, Path(each).stem, rows) for each in cards]
        limits = limits_of([one for own in scores for one in own])
        return replace(super().make_answer(request, place), qualifier=", ".join(limits))

    def fits(self, request: ExportRequest) -> bool:
        """Return whether the estimator is requested: by its card, or if the study has nothing else."""
        if not request.study.has_table("emg_torque"):
            return False
        named = request.card is not None and Path(request.card).name.startswith("emg_")
        return named or not asked(request.study, "identify")

    def export(self, request: ExportRequest) -> Path:
        """Write the folder of the estimator."""
        study, out = request.study, self.folder(request)
        found = chosen_card(
            study, card=request.card, controller=request.controller, participant=request.participant,
            allow_outside=request.allow_outside,
        )  # fmt: skip
        owner = owner_of(study, "torque from EMG", (f"{found.name}.json",))
        with own_folder(out, owner, overwrite=request.overwrite):
            accuracy = describe_card(request, found.name)
            return write_estimator_folder(study.name, found, out, period=request.period, accuracy=accuracy)
