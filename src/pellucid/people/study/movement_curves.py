"""Mean curves of participants over a movement's time, by condition: velocity, robot torque, and EMG of the agonists."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..._errors import StudyError
from ...units import Coordinate, parse_quantity
from ..curves import CurveComparison, compare_curves, resample_movement
from ..emg_index import Activity
from ..equivalence import Margin
from .assessment_table import AssessmentTable
from .measured_study import MeasuredStudy
from .pointing import PointingRecord

SMOOTHING_SHARE = 0.05
"""Share of a movement over which rectified EMG is averaged, because that of single movements is noisy."""

QUANTITY_NAMES = {"velocity": "Velocity", "interaction": "Interaction", "emg": "EMG of agonists"}
"""Names of the quantities in figures and tables."""

Curves = dict[tuple[str, str, str], np.ndarray]
"""Mean curve, (101,), along the movement's direction, by quantity, participant and condition. Movements of one kind are
averaged first, then the kinds."""


@dataclass(frozen=True, eq=False)
class CurveEndPoint:
    """One quantity of one condition, compared with control."""

    quantity: str
    condition: str
    stated: str  # stated margin; ``""`` if there is none
    unit: str  # unit of the displayed comparison: ``"%"`` of control's largest value, or the torque's unit
    comparison: CurveComparison
    factor: float = 1.0  # factor from the comparison's unit to the displayed one

    @property
    def furthest(self) -> tuple[float, int]:
        """Largest mean difference from control, in the displayed unit, and where it is [% of the movement]."""
        mean = self.factor * self.comparison.mean
        percent = int(np.argmax(np.abs(mean)))
        return float(mean[percent]), percent


def participants_curves(
    records: Sequence[PointingRecord],
    whole: MeasuredStudy,
    emg: Mapping[str, Activity],
    largest: Mapping[str, Mapping[str, float]],
    spec: AssessmentTable,
) -> Curves:
    """Return the curves of these records' participants."""
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
            top, width = largest[m.participant], SMOOTHING_SHARE * at.duration
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


def compare_with_control(
    curves: Curves,
    people: Sequence[str],
    condition: str,
    control: str,
    stated: Mapping[str, str],
    along: Coordinate,
    alpha: float,
) -> tuple[CurveEndPoint, ...]:
    """Compare every quantity of a condition with control; refuse a stated margin for a quantity without recording."""
    made = []
    for quantity in QUANTITY_NAMES:
        where = f"[assessment.curves] {quantity}"
        rows = [curves.get((quantity, person, condition)) for person in people]
        base = [curves.get((quantity, person, control)) for person in people]
        has_control = all(each is not None for each in base)
        if any(row is None for row in rows) or len(people) < 3 or not (has_control or quantity == "interaction"):
            if quantity in stated and len(people) >= 3:
                raise StudyError(
                    f"{where}: found participants without this curve in {condition}, expected one for all: record "
                    "it, or remove the line"
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
        made.append(CurveEndPoint(quantity, condition, stated.get(quantity, ""), unit, comparison, factor))
    return tuple(made)


def _size(stated: str, unit: str, where: str) -> float:
    """Return a stated margin as a number: a share, or a value in the effort's unit."""
    size = parse_quantity(stated, unit or "1", where)
    if not size > 0.0:
        raise StudyError(f'{where}: found "{stated}", expected a size above 0')
    return size
