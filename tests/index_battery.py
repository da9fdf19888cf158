"""Battery over the catalogue of indices: what is missing for an index to be whole, in words; nothing if all are.

It runs on the installed package and on copies of it in which an index is half added.
"""

import sys
import tempfile
from functools import cache
from pathlib import Path

sys.path.append(str(Path(__file__).parent / "unit"))

import made_pointing
import numpy as np

from pellucid._errors import StudyError
from pellucid.people.indices import (
    INDICES,
    SHOWN_INDICES,
    CutOff,
    Index,
    PercentOf,
    Worse,
    index_names,
    indices_along,
)
from pellucid.people.movement_indices import index_table
from pellucid.people.study.assessment_table import AssessmentTable
from pellucid.people.study.measured_study import MeasuredStudy, activities, measure
from pellucid.people.study.pointing import usable_records, with_rule
from pellucid.units import COORDINATES_BY_UNIT, parse_quantity
from pellucid_lab.pointing.predicted_indices import PREDICTED_INDICES

CONDITIONS = ("Ctrl", "FC")
PLACES = {
    "paragraph": lambda index: index.paragraph_place,
    "panels": lambda index: index.panel_place,
    "delays": lambda index: index.delay_place,
}


@cache
def one_person() -> MeasuredStudy:
    """Return what one person did with and without a robot, with EMG and targets that were not always held."""
    with tempfile.TemporaryDirectory() as folder:
        study = made_pointing.study(folder, participants=1, conditions=CONDITIONS, with_emg=True, repetitions=2)
        spec = study.table(AssessmentTable)
        records, _ = usable_records(study.recordings(), spec)
        emg, largest, _ = activities(records, spec, with_rule(spec))
        return measure(records, spec, with_rule(spec), emg, largest)


def conditions_with_values(index: Index) -> tuple[str, ...]:
    """Return the conditions in which an index has a value."""
    made = one_person()
    lasted = [type(each)(*vars(each).values()) for each in made.lasted]
    if index.needs_unsettled:
        lasted = [type(each)(**vars(each) | {"settled": i % 9 > 0}) for i, each in enumerate(lasted)]
    (person,) = {m.participant for m in made.movements}
    table = index_table(made.movements, index, [person], CONDITIONS, CONDITIONS[0], lasted)
    return () if table is None else table.conditions


def has_known_unit(index: Index) -> bool:
    """Whether study.toml could state a size in the unit of an index."""
    try:
        return bool(index.unit) and parse_quantity(f"1 {index.unit}", index.unit, index.name) == 1.0
    except StudyError:
        return False


def is_refused(margin: str, index: Index) -> bool:
    """Whether [assessment.margins] refuses a margin of an index."""
    try:
        AssessmentTable(control="Ctrl", margins={index.name: margin}).analysis.end_points(INDICES)
    except StudyError:
        return True
    return False


def faults() -> list[str]:
    """Return what is missing, a sentence for each fault."""
    found = [f"{index.name}: {fault}" for index in INDICES.values() for fault in faults_of_index(index)]
    for where, place in PLACES.items():
        taken = [place(index) for index in SHOWN_INDICES if place(index)]
        if sorted(taken) != list(range(1, len(taken) + 1)) or len(index_names(place)) != len(taken):
            found.append(f"{where}: places {sorted(taken)} are not each taken once")
    for what in ("words", "short"):
        texts = [getattr(index, what) for index in INDICES.values()]
        found += [f"{text!r}: two indices have it as their {what}" for text in {*texts} if texts.count(text) > 1]
    for index in PREDICTED_INDICES:
        same = index.own_change(np.full(3, 0.5), np.full(3, 0.5))
        if not index.words or np.ptp(same) != 0.0 or same.shape != (3,):
            found.append(f"{index.name}: a prediction has no words for it, or no change of each pair")
    if sum(index.leads for index in INDICES.values()) != 1:
        found.append("not exactly one index leads the headline")
    return found


def faults_of_index(index: Index) -> list[str]:
    """Return what is missing for one index."""
    found = []
    if not index.words or not index.short:
        found.append("has no words")
    if not has_known_unit(index):
        return [*found, "has no unit that is known"]
    if not isinstance(index.worse, Worse) or not isinstance(index.percent_of, PercentOf):
        return [*found, "does not say which change is worse, or what a percentage means"]
    valued = conditions_with_values(index)
    if not valued:
        return [*found, "nobody computes its value"]
    if (CONDITIONS[0] not in valued) != (index.needs_robot or index.over_control):
        found.append("does not say whether it needs a robot")
    if index.lasting and index.cut_off is CutOff.NO_VALUE:
        found.append("does not say what a movement that was cut off adds")
    has_share = index.percent_of is not PercentOf.NOTHING_AT_ALL and not index.needs_robot
    if is_refused("10 %", index) == has_share:
        found.append("a margin in % is refused, or taken, against what it says of percentages")
    if not is_refused(f"0.1 {index.unit}", index):
        point = AssessmentTable(control="Ctrl", margins={index.name: f"0.1 {index.unit}"}).analysis.end_points(INDICES)
        if (point[index.name].margin.low == -float("inf")) != (index.worse is Worse.IF_MORE):
            found.append("its margin does not lie on the side that is worse")
    else:
        found.append("a margin in its unit is refused")
    line = indices_along(COORDINATES_BY_UNIT["m"])[index.name]
    if "rad" in line.unit or "orque" in line.words + line.short:
        found.append("has no unit or words along a line")
    return found
