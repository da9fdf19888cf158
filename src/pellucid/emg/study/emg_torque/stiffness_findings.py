"""Findings on joint stiffness: tables by posture with intervals, rows, cards, and verdicts on its limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version

import numpy as np

from ....models.card import CardParameter
from ....models.parameter import Verdict
from ....models.parameter_card import ParameterCard
from ....study.procedures.result import FigureTable
from ....study.results import ResultRow
from ....study.study import Study
from ...estimators.hill import HillMap
from ...estimators.joint_stiffness import STIFFNESS_KINDS, JointStiffness, joint_stiffness
from ...models.emg_estimator import EmgEstimatorCard
from .calibration_findings import CalibrationFindings

STIFFNESS_UNIT = "N*m/rad"
"""Unit of stiffness in rows and cards."""

STIFFNESS_KIND_WORDS = {"short_range": "at once", "slope": "by Hill's slope"}
"""Description of each kind of stiffness."""


def find_stiffness(found: CalibrationFindings, cards: Mapping[str, EmgEstimatorCard]) -> tuple[JointStiffness, ...]:
    """Compute the stiffness of every joint with a live muscle estimator, along its first fitted recording.

    A card holds what is found, and held-out recordings may move nothing in it.
    """
    made = []
    for (joint, estimator), fit in found.causal.items():
        card = cards.get(f"emg_{joint}_{estimator}")
        if isinstance(fit, HillMap) and card is not None:
            made.append(joint_stiffness(card, fit.fit, found.stiffness_trials[joint]))
    return tuple(made)


def stiffness_tables(stiffness: Sequence[JointStiffness]) -> tuple[FigureTable, ...]:
    """Return a table of stiffness by posture for each joint."""
    heads = (
        "Angle (°)",
        "Torque (N·m)",
        *(f"{w[0].upper()}{w[1:]} ± 95 % (N·m/rad)" for w in STIFFNESS_KIND_WORDS.values()),
    )
    return tuple(
        FigureTable(
            f"Stiffness by calibrated muscles: {s.joint}, {s.recording.replace('_', ' ')}",
            heads,
            tuple(
                (
                    f"{np.degrees(p.low):.0f} to {np.degrees(p.high):.0f}",
                    float(p.torque),
                    *(f"{p.value[kind]:.0f} ± {1.96 * p.error[kind]:.0f}" for kind in STIFFNESS_KINDS),
                )
                for p in (*s.postures, s.whole)
            ),
            max_brief_rows=0,
        )
        for s in stiffness
    )


def stiffness_rows(study: str, stiffness: Sequence[JointStiffness], checksums: Mapping[str, str]) -> list[ResultRow]:
    """Return result rows: mean stiffness over the movement, its standard error, and the largest value."""
    rows = []
    for s in stiffness:
        for kind in STIFFNESS_KINDS:
            note = f"{STIFFNESS_KIND_WORDS[kind]}, muscles and tissue; ± {1.96 * s.whole.error[kind]:.3g} (95 %)"
            for name, value, words in (
                ("mean", s.whole.value[kind], note),
                (
                    "mean.error",
                    s.whole.error[kind],
                    "standard error: calibration, and what muscles and tendons differ by",
                ),
                ("largest", float(np.max(s.value[kind])), STIFFNESS_KIND_WORDS[kind]),
            ):
                where = f"{study}.{s.joint}.stiffness.{kind}.{name}"
                rows.append(
                    ResultRow(where, value, STIFFNESS_UNIT, "calibrate", "fitted", checksums.get(s.recording), words)
                )
    return rows


def stiffness_cards(study: Study, stiffness: Sequence[JointStiffness]) -> dict[str, ParameterCard]:
    """Return a card for each joint, with stiffness by posture and standard errors."""
    cards = {}
    for s in stiffness:
        parameters, ranges = [], {}
        for i, p in enumerate((s.whole, *s.postures)):
            for kind in STIFFNESS_KINDS:
                value, error = p.value[kind], p.error[kind]
                half, name = 1.96 * error, f"{kind}.{'mean' if i == 0 else f'posture_{i}'}"
                parameters.append(CardParameter(name, STIFFNESS_UNIT, value, error, (value - half, value + half)))
            if i:
                ranges |= {f"posture_{i}.low": p.low, f"posture_{i}.high": p.high, f"posture_{i}.torque": p.torque}
        name = f"stiffness_{s.joint}"
        cards[name] = ParameterCard(
            kind="joint_stiffness",
            study=study.name,
            name=name,
            parameters=tuple(parameters),
            settings={"joint": s.joint, "recording": s.recording, **ranges},
            processing="-d torque / d angle of calibrated muscles and tissue, mean over shares of a movement's time",
            pellucid=version("pellucid"),
        )
    return cards


def stiffness_verdicts(stiffness: Sequence[JointStiffness]) -> list[Verdict]:
    """Return verdicts that state the stiffness and the limits of an estimate without perturbation."""
    return [
        Verdict(
            "note",
            f"{s.joint}: stiffness is {s.whole.value['short_range']:.3g} N*m/rad at once and "
            f"{s.whole.value['slope']:.3g} by Hill's slope, in the mean over {s.recording.replace('_', ' ')}. Nothing "
            "was perturbed here: it follows from muscles that fit the torque and from muscles of cats, and antagonists "
            "that pull against each other do not show in a torque. Knees that were held still and perturbed were 17 % "
            "(extension) and 42 % (flexion) less stiff than such an estimate (Pfeifer et al. 2011).",
        )
        for s in stiffness
    ]
