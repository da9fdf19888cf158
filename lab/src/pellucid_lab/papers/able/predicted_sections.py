"""The page's chapter on the prediction of the paper's experiment, and on the factors that decide it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pellucid._errors import install_command
from pellucid.study.drawing.drawing import draw
from pellucid.study.pages.forest import Row, Table, number_table
from pellucid.study.pages.page import Section
from pellucid.study.pages.quantities import MINUS_SIGN

from ...pointing.prediction import STUDY_INTERVAL_SHARE
from ...pointing.sensitivity import CHANCE_FACTOR, Sensitivity
from ..figure import Reproduced
from .predicted import EFFECT_WORDS, EMG_RANK_SUM, ScoredPrediction, rank_sums
from .predicted_figures import Spread, deciding_figure, spread_figure
from .transparency import LAWS

UNPRINTED_INDICES = ("duration_median", "emg_per_acc", "antagonists")
"""Indices whose changes are predicted although the paper prints no number for them."""

SCREENED_INDICES = {"duration_median": "Median duration", "vmax": "Peak velocity", "emg_per_acc": "EMG/Acc"}
"""Indices whose sensitivity to every factor is drawn, with their titles."""


def predicted_sections(
    made: ScoredPrediction, screened: Sensitivity | None, rows: Mapping[str, Reproduced]
) -> tuple[Section, ...]:
    """Return the section on the predicted experiment, and one on the deciding factors if they were screened."""
    first = _predicted(made, rows, screened)
    return (first,) if screened is None else (first, _deciding(screened))


def _predicted(made: ScoredPrediction, rows: Mapping[str, Reproduced], screened: Sensitivity | None) -> Section:
    p, share = made.prediction, f"{100.0 * STUDY_INTERVAL_SHARE:.0f} %"
    count = len(made.effects)
    inside = sum(e.inside for e in made.effects)
    orders = round(count * made.order)
    ends = [one.friction for one in p.worn]
    paragraphs = (
        f"{len(p.worn)} robots were sampled, with friction of {min(ends):.2f} to {max(ends):.2f} times the rig's, from "
        f"the paper's value to the rig's. Each was identified, and worn with its controllers by {p.people} simulated "
        f"people ({', '.join(p.models)}; {p.repetitions} movements in each condition). On half of the robots five "
        "other people chose k of equation 8; on the others k is the paper's. Studies of six people on one robot were "
        f"sampled from these pairs; {share} of them lie in each interval.",
        f"{inside} of {count} effects lie inside their intervals, {orders} of {count} orders of two laws are as "
        "predicted. A very wide interval predicts nothing, so the interval score penalises width: it is the width "
        "plus ten times the distance of the paper's value from the interval. Its mean over duration and peak velocity "
        f"is {made.interval_score():.0f} %; for the prediction of no change it is "
        f"{made.interval_score(no_change=True):.0f} %. The paper prints only tests of EMG/Acc and no size; they allow "
        "one set of rank sums, 6, 12 and 18.",
    )
    scored = [
        Row(
            (
                EFFECT_WORDS[e.index] + ("" if e.index == EMG_RANK_SUM else " (%)"), e.law, _number(e.printed, e.index),
                _number(e.middle, e.index), f"{_number(e.low, e.index)} to {_number(e.high, e.index)}",
                _number(e.high - e.low, e.index).lstrip("+"), "inside" if e.inside else "outside",
            )
        )
        for e in made.effects
    ]  # fmt: skip
    for index in UNPRINTED_INDICES:
        for law in LAWS:
            row = rows[f"able.predicted.{index}.{law.lower()}"]
            between = f"{_number(row.lower)} to {_number(row.upper)}"
            width = _number(row.upper - row.lower).lstrip("+")
            scored.append(Row((f"{EFFECT_WORDS[index]} (%)", law, "–", _number(row.ours), between, width, "")))
    effects = number_table(
        ("Effect", "Law", "Paper", "Predicted", f"{share} of studies", "Width", ""), scored, words=2,
        caption="Changes from control, medians over simulated studies; rank sums are over six people and three laws",
    )  # fmt: skip
    found = number_table(
        ("Finding of the paper", "Pairs (%)", "Studies (%)"),
        [
            Row((f.words, "–" if np.isnan(f.pairs) else f"{100.0 * f.pairs:.0f}", f"{100.0 * f.studies:.0f}"))
            for f in made.findings
        ],
        caption="By how many pairs of a person and a robot, and by how many studies of six people, each is predicted",
    )
    folded = tuple(
        (f"By {name} alone: {round(count * one.inside)} of {count} inside", _alone(one))
        for name, one in made.of_models.items()
    )
    return Section(
        "predicted", "What would the experiment find?", paragraphs, (effects, found), folded=folded,
        drawings=(
            draw(
                spread_figure, _panels(made), EFFECT_WORDS[EMG_RANK_SUM],
                "Results of simulated studies (hills), their middle 80 % and median, and the paper's result.",
            ),
        ),
        notes=() if screened else (
            "What decides is not shown: that needs SALib "
            f"({install_command('sensitivity')}).",
        ),
    )  # fmt: skip


def _alone(made: ScoredPrediction) -> Table:
    """Return the prediction by people of one model as a table."""
    rows = [
        (EFFECT_WORDS[e.index], e.law, _number(e.printed, e.index), _number(e.middle, e.index),
         f"{_number(e.low, e.index)} to {_number(e.high, e.index)}", "inside" if e.inside else "outside")
        for e in made.effects
    ]  # fmt: skip
    return number_table(("Effect", "Law", "Paper", "Predicted", "80 % of studies", ""), rows, words=2)


def _panels(made: ScoredPrediction) -> dict[str, list[Spread]]:
    found: dict[str, list[Spread]] = {}
    sums = rank_sums(made.studies)
    for e in made.effects:
        if e.index == EMG_RANK_SUM:
            one = Spread(e.law, sums[:, LAWS.index(e.law)], (e.low, e.middle, e.high), e.printed)
        else:
            drawn = 1.0 + made.studies.effect(e.index, e.law) / 100.0
            low, middle, high, printed = (1.0 + x / 100.0 for x in (e.low, e.middle, e.high, e.printed))
            one = Spread(e.law, drawn, (low, middle, high), printed)
        found.setdefault(EFFECT_WORDS[e.index], []).append(one)
    return found


def _deciding(screened: Sensitivity) -> Section:
    law_texts, laws = [], range(len(screened.laws))
    for law in screened.laws:
        found = screened.strengths_of(law, "duration_median")
        above = [f"{name} ({value:.0f})" for name, value in found.items() if value > found[CHANCE_FACTOR]][:3]
        law_texts.append(f"{law}: {', '.join(above) or 'nothing'} against {found[CHANCE_FACTOR]:.0f} of chance")
    folded = []
    for j, title in enumerate(SCREENED_INDICES.values()):
        table = [
            Row((f.name, *(f"{screened.strength[i, j, k]:.1f} ± {screened.half_width[i, j, k]:.1f}" for i in laws)))
            for k, f in enumerate(screened.factors)
        ]
        folded.append((f"{title}, in numbers", number_table(("Factor", *screened.laws), table)))
    return Section(
        "deciding",
        "Deciding factors",
        (
            f"Morris's method ({screened.runs} points) varies each factor over its range from random points of a grid, "
            "with all others fixed. People's constants vary over the middle 80 % of people, or from half to double if "
            "the rig's file has one value. The robot's friction varies from the paper's value to the rig's, and k "
            f"from {MINUS_SIGN}2 to 1. Largest effects on the median duration, in 100 ln(ratio to control): "
            f"{'; '.join(law_texts)}. Chance is the seed of all noise; smaller effects are not significant.",
        ),
        drawings=(
            draw(
                deciding_figure, screened, SCREENED_INDICES,
                "Mean size of elementary effects with their 95 % intervals; dotted, those of chance.",
            ),
        ),
        folded=tuple(folded),
    )  # fmt: skip


def _number(value: float, index: str = "") -> str:
    if index == EMG_RANK_SUM:
        return f"{value:.0f}"
    text = f"{value:+.1f}" if abs(value) < 100.0 else f"{value:+.0f}"
    return text.replace("-", MINUS_SIGN)
