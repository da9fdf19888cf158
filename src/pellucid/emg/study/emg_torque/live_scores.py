"""Scores of the estimators that `export` writes: R² on held-out recordings, and how long their watch trusts them there.

They are reported only: held-out recordings choose no estimator and are in no card.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....study.procedures.result import FigureTable
from ....study.results import ResultRow
from ...estimators.cross_validation import score
from ...estimators.live_torque import LiveTorque
from ...estimators.torque_trial import TorqueTrial, group_pieces
from ...models.emg_estimator import EmgEstimatorCard

MIN_TORQUE_R2 = 0.8
"""Smallest R² on recordings that were not fitted for which torque counts as estimated: that of a sound joint model."""

HOLD_OUT_TEXT = 'set one recording to use = "validate" in study.toml'
"""Advice where no recording is held out."""

LiveRun = tuple[dict[str, np.ndarray], np.ndarray]
"""Torque of each joint without the watch, shape (n,) [N m] each, and whether the watch trusts it, shape (n,)."""

QUANTITIES = {
    "r2": "past samples only",
    "angles_r2": "ridge regression of angles alone, past samples only",
    "valid_time": "share of the time in which the estimator's own watch calls it valid",
}
"""Quantities of a score in result rows, with their notes."""


@dataclass(frozen=True)
class LiveScore:
    """Score of an estimator that can be exported, for one joint on one held-out recording."""

    joint: str
    recording: str
    r2: float
    angles_r2: float | None = None  # R² of angles alone, causal as well; None if it is not known
    valid_time: float | None = None  # Share of the time in which its watch calls it valid; None without a watch


def score_live(
    card: EmgEstimatorCard,
    held: Mapping[str, Sequence[TorqueTrial]],
    angles_r2: Mapping[tuple[str, str], float],
    predict: Callable[[TorqueTrial], np.ndarray] | None = None,
) -> tuple[LiveScore, ...]:
    """Return the scores of a card on the held-out trials of each joint, whose envelopes are as recorded.

    `angles_r2` is R² of angles alone by joint and recording. `predict` returns the torque of a trial; None: the card is
    stepped.
    """
    bare, found = card.of_envelopes(), []
    first = group_pieces(next(iter(held.values())))
    runs = {name: [_run(bare, piece) for piece in pieces] for name, pieces in first.items()}
    for joint, trials in held.items():
        for name, pieces in group_pieces(trials).items():
            made = [run[joint] for run, _ in runs[name]] if predict is None else [predict(t) for t in pieces]
            r2 = score(np.concatenate([t.torque for t in pieces]), np.concatenate(made)).r2
            valid = np.concatenate([each for _, each in runs[name]])
            share = None if card.watch is None else float(np.mean(valid))
            found.append(LiveScore(joint, name, float(r2), angles_r2.get((joint, name)), share))
    return tuple(found)


def _run(card: EmgEstimatorCard, trial: TorqueTrial) -> LiveRun:
    """Return the torques that a card gives without its watch along a trial, and where its watch trusts it."""
    inputs = (
        1.0 + card.period * np.arange(len(trial)),
        {channel.name: trial.envelopes[channel.name] for channel in card.channels},
        {name: trial.angles[name] for name in card.angles},
    )
    return LiveTorque(replace(card, watch=None)).run(*inputs), LiveTorque(card).find_valid(*inputs)


def live_rows(study: str, live: Mapping[str, Sequence[LiveScore]], checksums: Mapping[str, str]) -> Iterator[ResultRow]:
    """Yield the scores as result rows, whose ids name card, quantity, joint and recording."""
    for card, scores in live.items():
        for each in scores:
            for quantity, note in QUANTITIES.items():
                if (value := getattr(each, quantity)) is not None:
                    where = f"{study}.{card}.{quantity}.{each.joint}.{each.recording}"
                    yield ResultRow(where, value, "1", "calibrate", "heldout", checksums.get(each.recording), note)


def read_live_scores(study: str, card: str, rows: Iterable[ResultRow]) -> tuple[LiveScore, ...]:
    """Return the scores of a card in the rows of results.json; empty if there are none."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    for row in rows:
        head, _, tail = row.id.partition(f"{study}.{card}.")
        quantity, _, place = tail.partition(".")
        joint, _, recording = place.partition(".")
        if not head and quantity in QUANTITIES and recording and isinstance(row.value, (int, float)):
            found.setdefault((joint, recording), {})[quantity] = float(row.value)
    return tuple(LiveScore(*place, **numbers) for place, numbers in found.items() if "r2" in numbers)


def limits_of(scores: Sequence[LiveScore]) -> tuple[str, ...]:
    """Return in words why an estimator is not recommended for export; empty if it is.

    R² is too low on a recording, or not larger than that of angles alone in the mean over recordings.
    """
    gains = [each.r2 - each.angles_r2 for each in scores if each.angles_r2 is not None]
    said = {
        f"R² below {MIN_TORQUE_R2:g}": any(each.r2 < MIN_TORQUE_R2 for each in scores),
        "no better than angles alone": bool(gains) and sum(gains) <= 0.0,
    }
    return tuple(words for words, is_so in said.items() if is_so)


def export_qualifier(limits: Mapping[str, Sequence[str]]) -> str:
    """Return what limits the verdict if estimators with these limits, by joint, are exported; "" for nothing."""
    joints: dict[str, list[str]] = {}
    for joint, own in limits.items():
        for words in own:
            joints.setdefault(words, []).append(joint)
    said = [
        words if len(own) == len(limits) else f"{words} for {' and '.join(own)}" for words, own in joints.items()
    ]
    return f"offline; exports: {', '.join(said)}" if said else ""


def scores_words(scores: Sequence[LiveScore]) -> str:
    """Return R² on each held-out recording with that of angles alone, and the share of valid time, in words."""
    joints = {each.joint for each in scores}

    def place(each: LiveScore) -> str:
        of = f"{each.joint}, " if len(joints) > 1 else ""
        return f'{each.r2:.3f} on {of}recording "{each.recording.replace("_", " ")}"'

    text = f"R² {' and '.join(map(place, scores))}"
    alone = [f"{each.angles_r2:.3f}" for each in scores if each.angles_r2 is not None]
    text += f" (angles alone, also causal: {' and '.join(alone)})" if alone else ""
    valid = [time_words(each.valid_time) for each in scores if each.valid_time is not None]
    return text + (f", valid by its own watch {' and '.join(valid)} of the time" if valid else "")


def time_words(share: float) -> str:
    """Return a share of the time in words."""
    return f"{100.0 * share:.0f} %"


def live_tables(live: Mapping[str, Sequence[LiveScore]]) -> tuple[FigureTable, ...]:
    """Return the table of the cards that can be exported; none without a card."""
    heads = ("Card", "Held out", "R²", "R² of angles alone", "Time valid by its watch")
    rows = tuple(
        (
            f"{card}.json", f"{each.joint}, {each.recording.replace('_', ' ')}", each.r2, each.angles_r2,
            None if each.valid_time is None else time_words(each.valid_time),
        )
        for card, scores in live.items()
        for each in scores
    )  # fmt: skip
    return (FigureTable("Cards to export, with past samples only", heads, rows, max_brief_rows=0),)[: len(rows)]
