"""Curves of participants over a movement's time: velocity, the robot's torque, and EMG of the agonists, by
condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import StudyError
from ...assessment.curves import CurveComparison, compare_curves, resample_movement
from ...assessment.emg_index import Activity
from ...assessment.equivalence import Margin
from ...units import Coordinate, parse_quantity
from .measured_study import MeasuredStudy
from .pointing import PointingRecord, PointingSettings

SMOOTHED = 0.05
"""Share of a movement over which rectified EMG is averaged: of single movements it is noise."""

WORDS = {"velocity": "Velocity", "interaction": "Interaction", "emg": "EMG of agonists"}

Curves = dict[tuple[str, str, str], np.ndarray]
"""By quantity, participant and condition: the mean over movements that are alike, then over those kinds; (101,), along
the movement's direction."""


@dataclass(frozen=True, eq=False)
class CurveEndPoint:
    """One quantity of one condition against control."""

    quantity: str
    condition: str
    stated: str  # ``""`` where no margin is
    unit: str  # Of the comparison as shown: ``"%"`` of control's largest, or the torque's
    control: np.ndarray | None  # (101,) Means of participants, in that unit; None where control has none
    own: np.ndarray
    comparison: CurveComparison
    factor: float = 1.0  # From the comparison's unit to what is shown


def participants_curves(
    records: Sequence[PointingRecord],
    whole: MeasuredStudy,
    emg: Mapping[str, Activity],
    largest: Mapping[str, Mapping[str, float]],
    spec: PointingSettings,
) -> Curves:
    """Curves of these records' participants."""
    sums: dict[tuple, list[np.ndarray]] = {}
    by_name = {record.recording.name: record.recording for record in records}
    for m in whole.movements:
        recording, motion, at = by_name[m.recording], whole.motions[m.recording], m.movement
        ends, sign = (at.start, at.duration), at.direction
        found = {"velocity": sign * resample_movement(motion.time, motion.velocity, *ends)}
        if spec.interaction in recording:
            found["interaction"] = sign * resample_movement(recording.time, recording[spec.interaction], *ends)
        if m.recording in emg and spec.agonists and sign > 0:
            shares = at.start + at.duration * np.linspace(0.0, 1.0, 101)
            top, width = largest[m.participant], SMOOTHED * at.duration
            found["emg"] = emg[m.recording].envelope(spec.agonists, top, shares, width)
        for name, curve in found.items():
            if np.isfinite(curve).all():
                sums.setdefault((name, m.participant, m.condition, m.cell), []).append(curve)
    cells: dict[tuple[str, str, str], dict] = {}
    for (name, person, condition, cell), own in sums.items():
        cells.setdefault((name, person, condition), {})[cell] = np.mean(own, axis=0)
    made: Curves = {}
    for (name, person, condition), own in cells.items():
        others = [set(each) for (n, p, _), each in cells.items() if (n, p) == (name, person)]
        shared = set.intersection(*others)
        if shared:
            made[name, person, condition] = np.mean([own[cell] for cell in sorted(shared, key=str)], axis=0)
    return made


def compared_curves(
    curves: Curves,
    people: Sequence[str],
    condition: str,
    control: str,
    stated: Mapping[str, str],
    along: Coordinate,
    alpha: float,
) -> tuple[CurveEndPoint, ...]:
    """Every quantity of a condition against control, with the margins that are stated; one that is stated and was not
    recorded is refused."""
    made = []
    for quantity in WORDS:
        where = f"[assessment.curves] {quantity}"
        rows = [curves.get((quantity, person, condition)) for person in people]
        base = [curves.get((quantity, person, control)) for person in people]
        has_control = all(each is not None for each in base)
        if any(row is None for row in rows) or len(people) < 3 or not (has_control or quantity == "interaction"):
            if quantity in stated and len(people) >= 3:
                raise StudyError(
                    f"{where}: found none of everybody in {condition}, expected it: record it, or state none"
                )
            continue
        own = np.array(rows)
        effort = quantity == "interaction"
        size = _size(stated[quantity], along.effort if effort else "", where) if quantity in stated else None
        margin = None if size is None else Margin.either_way(size)
        there = np.array(base) if has_control else np.zeros_like(own)
        scale = 1.0 if effort else np.abs(there).max(axis=1, keepdims=True)
        comparison = compare_curves((own - there) / scale, margin, alpha=alpha)
        factor, unit = (1.0, along.effort) if effort else (100.0, "%")
        shown = factor * np.mean(there / scale, axis=0) if has_control else None
        made.append(
            CurveEndPoint(quantity, condition, stated.get(quantity, ""), unit, shown,
                          factor * np.mean(own / scale, axis=0), comparison, factor)
        )  # fmt: skip
    return tuple(made)


def _size(stated: str, unit: str, where: str) -> float:
    """A margin as stated: a share, or with the effort's unit."""
    size = parse_quantity(stated, unit or "1", where)
    if not size > 0.0:
        raise StudyError(f'{where}: found "{stated}", expected a size above 0')
    return size
