"""Assess whether conditions change how people move: from a study's recordings to tables, tests and a paragraph."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..._errors import RecordingError
from ...files.fault import Fault
from ...files.recording import Recording
from ...study.procedures.procedure import CostedSteps, Progress, quiet
from ...study.study import Study
from ...study.study_place import RIG_FILE
from ...units import Coordinate
from ..analysis import Analysis
from ..comparison import compare_conditions
from ..design_columns import DIRECTION_UP, MeasuredMovement
from ..indices import INDICES, PERCENTAGE_POINTS, SHOWN_INDICES, CutOff, index_names, indices_along, leading_index
from ..movement_indices import index_table, isochrony
from ..movements import MovementRule
from ..power import (
    MIN_FORECAST_PEOPLE,
    STANDARDISED_CHANGES,
    lasting_medians,
    participants_for_effects,
    participants_needed,
)
from ..survival import survival
from .assessment_answer import assessment_answer
from .assessment_result import Assessed, AssessmentResult, Needed, Profile, Sensitivity, Settling
from .assessment_table import DEFAULT_STUDIES, AssessmentTable
from .assessment_tables import result_rows, tables
from .certified import certify_conditions
from .certified_rows import certificate_verdicts
from .measured_study import MeasuredStudy, activities, delay_notes, join_studies, measure, with_assumed_delays
from .movement_curves import Curves, participants_curves
from .paper import write_tables
from .pointing import (
    PointingRecord,
    SessionOrder,
    labelled_amplitudes,
    pointing_faults,
    recordings_with_condition,
    session_order,
    usable_records,
    with_rule,
)
from .primary_change import change_of_table
from .registered import registered_analysis
from .statements import headline, paragraph, verdicts

RANDOM_SEED = 1
"""Random seed of the bootstraps and of the simulated studies."""

PLANNED_CHANGE_SHARES = (0.05, 0.1, 0.2, 0.3)
"""Changes from control that these participants should detect, as shares."""


# Costs of steps are processor times measured on eight people who pointed [s].

MOVEMENTS_COST = 0.2
"""Cost of finding the movements of one person."""

PERSON_COST = 0.5
"""Cost of the indices of one person."""

NEEDED_COST = 1.0
"""Cost of simulating `DEFAULT_STUDIES` studies of the participants needed."""

CERTIFICATE_COST = 3.0
"""Cost of one condition's certificate, with the number of participants that it needs."""


def assess(
    study: Study, tell: Progress = quiet, *, studies: int = DEFAULT_STUDIES, executor: Any = None
) -> AssessmentResult:
    """Compare a study's conditions by the settings of its table."""
    table = study.table(AssessmentTable)
    tell("reading recordings", 0.0)
    return assess_recordings(
        study.name, study.recordings(), table, on_progress=tell, studies=studies, executor=executor,
        registered=registered_analysis(study), is_simulated=study.config.simulated is True, rig_file=_rig_file(study),
    )  # fmt: skip


def _rig_file(study: Study) -> str:
    """Return the file that says how many people are simulated; "" where nobody is, or there is none."""
    return RIG_FILE if study.config.simulated and (Path(study.folder) / RIG_FILE).is_file() else ""


def assess_recordings(
    name: str,
    recordings: Sequence[Recording],
    spec: AssessmentTable,
    *,
    on_progress: Progress | None = None,
    studies: int = DEFAULT_STUDIES,
    executor: Any = None,
    registered: Analysis | None = None,
    is_simulated: bool = False,
    rig_file: str = "",
) -> AssessmentResult:
    """Compare conditions of recordings, which need not be files; `spec` is the table [assessment].

    With another analysis than the `registered` one certificates are post hoc. `rig_file` is the file of the study's
    folder from which people are simulated, if it has one.
    """
    tell = on_progress or quiet
    used = recordings_with_condition(recordings)
    conditions = _conditions(used, spec.control)
    tell("finding movements", 0.02)
    records, gaps = usable_records(used, spec)
    unusable = {recording.name: gap.message for recording, gap in zip(_others(used, records), gaps, strict=True)}
    participants, absent, without = _participants(used, records, conditions, spec.analysis.excluded)
    records = [record for record in records if record.recording.participant in participants]
    used = [record.recording for record in records]
    along = _along(records)
    # Margins and conditions without a reference are refused before any computation.
    spec.analysis.end_points(indices_along(along))
    order = session_order(used)
    named = labelled_amplitudes(records)
    faults = [fault for record in records for fault in pointing_faults(record, spec, named)]
    _require_none_refused(faults)
    records, delays = with_assumed_delays(records)
    rules = _rules(records, spec)
    parts: dict[str, list[MeasuredStudy]] = {words: [] for words in rules}
    shifted: list[MeasuredStudy] = []
    curves: Curves = {}
    costs = {f"indices, {person}": PERSON_COST for person in participants}
    steps = CostedSteps(
        tell,
        {
            "finding movements": MOVEMENTS_COST * len(participants),
            **costs,
            "participants needed": NEEDED_COST * studies / DEFAULT_STUDIES,
            "certificates": CERTIFICATE_COST * (len(conditions) - 1) * bool(spec.margins),
        },
    )
    for person in participants:
        steps.begin(f"indices, {person}")
        own = [record for record in records if record.recording.participant == person]
        # EMG is processed for one person at a time, because that of a whole study may not fit into memory.
        emg, largest, clocks = activities(own, spec, with_rule(spec))
        _require_none_refused(clocks)
        faults += clocks
        for words, rule in rules.items():
            first = words == next(iter(rules))
            parts[words].append(measure(own, spec, rule, emg, largest, named=named, detailed=first))
            if first and spec.margins:
                curves |= participants_curves(own, parts[words][-1], emg, largest, spec)
        if delays.recordings and emg:
            moved = {n: a.later(delays.span) if n in delays.recordings else a for n, a in emg.items()}
            shifted.append(measure(own, spec, with_rule(spec), moved, largest, named=named, detailed=False))
            del moved
        # The next person needs the memory.
        del emg
        for record in own:
            record.forget()
    measured = {words: join_studies(each) for words, each in parts.items() if any(part.movements for part in each)}
    whole = next(iter(measured.values()))
    found = _assessed(whole, participants, conditions, spec, along, [index.name for index in SHOWN_INDICES])
    tried = index_names(lambda index: index.tries_rules)
    sensitivity = _sensitivity(measured, spec, participants, conditions, along, tried, order)
    if any(part.movements for part in shifted):
        words = f"{1e3 * delays.span:.0f} ms"
        sensitivity += _sensitivity(
            {words: join_studies(shifted)}, spec, participants, conditions, along,
            index_names(lambda index: index.delay_place), order,
        )  # fmt: skip
    steps.begin("participants needed")
    needed = _needed(found, spec, len(conditions) - 1, studies, executor)
    lines = isochrony(whole.movements, participants, conditions, along)
    profiles, profile_of = _profiles(whole, participants, conditions, along)
    left_out = Counter()
    for reasons in whole.left_out.values():
        left_out.update(reasons)
    made = AssessmentResult(
        write_tables=write_tables,
        study=name,
        headline="",
        tables=(),
        verdicts=(),
        rows=(),
        cards={},
        checksums={recording.name: recording.checksum for recording in used},
        confidence=spec.confidence,
        estimand=spec.analysis.estimand,
        order=order,
        has_margins=bool(spec.analysis.margins),
        is_registered=registered is not None,
        control=spec.control,
        conditions=conditions,
        participants=participants,
        without=without,
        absent=absent,
        unusable=unusable,
        unit=along.unit,
        movements=len(whole.movements),
        left_out=dict(left_out),
        assessed=found,
        isochrony=lines,
        sensitivity=sensitivity,
        needed=needed,
        needed_as_seen=_needed_as_seen(found, spec, studies, executor),
        is_simulated=is_simulated,
        rig_file=rig_file,
        exclusions=spec.exclusions,
        profiles=profiles,
        profile_of=profile_of,
        settling=_settling(whole, conditions),
        unreached=_unreached(whole, participants, conditions, spec.control),
        measured=whole.movements,
    )
    notes = [fault.message for fault in faults] + delay_notes(delays) + _without_index(found, participants, conditions)
    steps.begin("certificates")
    made = replace(made, certified=certify_conditions(made, spec, whole, order, curves, executor, registered))
    return _told(made, notes)


def _require_none_refused(faults: Sequence[Fault]) -> None:
    refused = [fault.message for fault in faults if fault.severity == "refuse"]
    if refused:
        raise RecordingError("\n".join(refused))


def _told(made: AssessmentResult, notes: Sequence[str]) -> AssessmentResult:
    return replace(
        made,
        found_answer=assessment_answer(made),
        headline=headline(made),
        paragraph=paragraph(made),
        verdicts=(*certificate_verdicts(made), *verdicts(made, notes)),
        tables=tables(made),
        rows=result_rows(made),
    )


def _conditions(used: Sequence[Recording], control: str) -> tuple[str, ...]:
    """Return the conditions, control first, the others in the order of the recordings."""
    found = list(dict.fromkeys(recording.condition for recording in used))
    if control not in found:
        raise RecordingError(
            f'assess: found the conditions {", ".join(found) or "none"}, expected the control "{control}" among them'
        )
    if len(found) < 2:
        raise RecordingError(f'assess: found no condition but "{control}", expected another to compare with it')
    lower = Counter(condition.lower() for condition in found)
    if len(lower) < len(found):
        raise RecordingError(f"assess: found the conditions {', '.join(found)}, expected names that differ in letters")
    return (control, *(condition for condition in found if condition != control))


def _others(used: Sequence[Recording], records: Sequence[PointingRecord]) -> list[Recording]:
    kept = {id(record.recording) for record in records}
    return [recording for recording in used if id(recording) not in kept]


def _along(records: Sequence[PointingRecord]) -> Coordinate:
    """Return the coordinate of the movements, which must be the same in all recordings."""
    first = records[0]
    other = next((record for record in records if record.along != first.along), None)
    if other is not None:
        raise RecordingError(
            f"{other.where}, {other.source}: found {other.along.unit}, expected {first.along.unit} as in {first.where}"
        )
    return first.along


def _participants(
    used: Sequence[Recording],
    records: Sequence[PointingRecord],
    conditions: Sequence[str],
    excluded: Mapping[str, str],
) -> tuple[tuple[str, ...], dict[str, tuple[str, ...]], dict[str, str]]:
    """Return the participants with a usable recording in every condition who were not `excluded`.

    Returns also the conditions that the others lack, and the reasons for their exclusion.
    """
    people = tuple(dict.fromkeys(recording.participant for recording in used))
    there = {(r.recording.participant, r.recording.condition) for r in records}
    absent = {person: tuple(c for c in conditions if (person, c) not in there) for person in people}
    absent = {person: own for person, own in absent.items() if own}
    taken = {(r.participant, r.condition) for r in used}
    without = {}
    for person, own in absent.items():
        never, unseen = ([c for c in own if ((person, c) in taken) == seen] for seen in (False, True))
        said = [f"no recording in {', '.join(never)}"] if never else []
        without[person] = " and ".join([*said, *([f"none that can be used in {', '.join(unseen)}"] if unseen else [])])
    without |= {person: f"excluded: {why}" for person, why in excluded.items()}
    kept = tuple(person for person in people if person not in without)
    if not kept:
        said = "; ".join(f"{person}: {why}" for person, why in without.items())
        raise RecordingError(
            f"assess: found no participant with recordings in all of {', '.join(conditions)} ({said}), expected one or "
            "more"
        )
    return kept, absent, without


def _assessed(
    whole: MeasuredStudy,
    participants: Sequence[str],
    conditions: Sequence[str],
    spec: AssessmentTable,
    along: Coordinate,
    names: Sequence[str],
    *,
    together: bool = False,
) -> dict[str, Assessed]:
    """Return each index with its comparison of all conditions, and unless `together` with those with control."""
    found, indices = {}, indices_along(along)
    for name in names:
        table = index_table(whole.movements, indices[name], participants, conditions, spec.control, whole.lasted)
        if table is None:
            continue
        # Each index has its own random stream, so that leaving one out does not change another's interval.
        rng = np.random.default_rng([RANDOM_SEED, list(INDICES).index(name)])
        control = spec.control if spec.control in table.conditions and not together else None
        compared = compare_conditions(
            table.values, table.conditions, control, against_zero=table.index.over_control and not together,
            confidence=spec.confidence, rng=rng,
        )  # fmt: skip
        found[name] = Assessed(table, compared)
    return found


def _without_index(found: Mapping[str, Assessed], participants: Sequence[str], conditions: Sequence[str]) -> list[str]:
    """State in words which participants lack an index that others have."""
    lacking: dict[tuple[str, ...], list[str]] = {}
    for each in found.values():
        absent = tuple(person for person in participants if person not in each.table.participants)
        if absent:
            lacking.setdefault(absent, []).append(each.table.index.short)
    return [
        f"{', '.join(absent)}: found no value of {', '.join(names)} in comparable movements of all "
        f"conditions ({', '.join(conditions)}); excluded from {'this index' if len(names) == 1 else 'these indices'}."
        for absent, names in lacking.items()
    ]


def _rules(records: Sequence[PointingRecord], spec: AssessmentTable) -> dict[str, MovementRule]:
    """Return the study's rule first, then the rules of the sensitivity analysis, grouped by filter."""
    rules = {}
    rates = [1.0 / float(np.median(np.diff(record.time))) for record in records]
    rules[f"{spec.lowpass:g} Hz"] = with_rule(spec)
    for share in sorted(set(spec.thresholds) - {spec.threshold}):
        rules[f"{100 * share:g} %"] = with_rule(spec, threshold=share)
    rules["first rest"] = with_rule(spec, ends="peak")
    for cutoff in sorted(set(spec.cutoffs) - {spec.lowpass}):
        if 2.0 * cutoff < 0.95 * min(rates):
            rules[f"{cutoff:g} Hz"] = with_rule(spec, lowpass=cutoff)
    return rules


def _sensitivity(
    measured: Mapping[str, MeasuredStudy],
    spec: AssessmentTable,
    participants: Sequence[str],
    conditions: Sequence[str],
    along: Coordinate,
    names: Sequence[str],
    order: SessionOrder,
) -> tuple[Sensitivity, ...]:
    unreached = {words: _unreached(whole, participants, conditions, spec.control) for words, whole in measured.items()}
    return tuple(
        _sensitive(words, each, condition, spec, conditions, order, unreached[words].get(condition, (False, False)))
        for words, whole in measured.items()
        for each in _assessed(whole, participants, conditions, spec, along, names, together=True).values()
        for condition in each.table.conditions
        if condition != spec.control
    )


def _sensitive(
    words: str, each: Assessed, condition: str, spec: AssessmentTable, conditions: Sequence[str], order: SessionOrder,
    unreached: tuple[bool, bool],
) -> Sensitivity:  # fmt: skip
    control = spec.control
    base = float(each.table.column(control).mean()) if control in each.table.conditions else float("nan")
    p = float("nan") if each.comparison.p_value is None else each.comparison.p_value
    sessions = order.sessions(each.table.participants, conditions, control, condition)
    found = change_of_table(each.table, condition, control, spec.analysis.estimand, sessions=sessions)
    change = float("nan") if found is None else found.value / (100.0 if found.unit in ("%", PERCENTAGE_POINTS) else 1.0)
    # A median that was not reached in the condition leaves a lower bound, in control none.
    above, below = unreached if each.table.index.cut_off is CutOff.AT_LEAST_SEEN else (False, False)
    return Sensitivity(words, each.name, condition, base, float("nan") if below else change, p, above and not below)


def _needed(
    found: Mapping[str, Assessed], spec: AssessmentTable, comparisons: int, studies: int, executor: Any
) -> tuple[Needed, ...]:
    wanted: list[tuple[str, float | None, float]] = [("", None, effect) for effect in STANDARDISED_CHANGES]
    for name in index_names(lambda index: index.is_planned):
        each = found.get(name)
        if each is None or len(each.table.participants) < 3 or not each.comparison.against_control:
            continue
        # The condition in which people differ most, so that the number suffices for all conditions.
        deviation = max(a.deviation for a in each.comparison.against_control)
        share = each.share_of_control(spec.control)
        if share is not None and deviation > 0.0:
            wanted += [(name, change, change * share / deviation) for change in PLANNED_CHANGE_SHARES]
    effects = [effect for _, _, effect in wanted]
    people = participants_for_effects(
        effects,
        comparisons=comparisons,
        alpha=1.0 - spec.confidence,
        studies=studies,
        seed=RANDOM_SEED,
        executor=executor,
    )
    return tuple(Needed(*each, n) for each, n in zip(wanted, people, strict=True))


def _needed_as_seen(
    found: Mapping[str, Assessed], spec: AssessmentTable, studies: int, executor: Any
) -> dict[str, int | None]:
    """Return with how many people the study's own tests tell each condition from control, if changes are as seen.

    They are those of the leading index, for a power of 80 %; none from fewer than three people.
    """
    each = found.get(leading_index().name)
    if each is None or spec.control not in each.table.conditions or len(each.table.participants) < MIN_FORECAST_PEOPLE:
        return {}
    control = each.table.conditions.index(spec.control)
    return {
        condition: participants_needed(
            each.table.values, test="nemenyi", control=control, compared=i, alpha=1.0 - spec.confidence,
            studies=studies, seed=RANDOM_SEED, executor=executor,
        )
        for i, condition in enumerate(each.table.conditions)
        if i != control
    }  # fmt: skip


def _profiles(
    whole: MeasuredStudy, participants: Sequence[str], conditions: Sequence[str], along: Coordinate
) -> tuple[tuple[Profile, ...], str]:
    """Return mean upward movements of the middle amplitude from their start, with equal weights of participants."""
    cells = {m.cell for m in whole.movements if m.cell[1] == DIRECTION_UP} or {m.cell for m in whole.movements}
    cell = sorted(cells, key=str)[0] if None in {c[0] for c in cells} else sorted(cells)[len(cells) // 2]
    chosen = [m for m in whole.movements if m.cell == cell]
    longest = 1.5 * max(
        (np.median([m.movement.duration for m in chosen if m.condition == c] or [0.0]) for c in conditions), default=0.0
    )
    time = np.linspace(-0.1 * longest, longest, 200)
    made = []
    for condition in conditions:
        people = []
        for person in participants:
            own = [m for m in chosen if (m.participant, m.condition) == (person, condition)]
            if own:
                people.append(np.mean([_about_start(whole, m, time) for m in own], axis=0))
        if people:
            made.append(Profile(condition, time, *np.mean(people, axis=0)))
    way = cell[1] if along.unit == "rad" else along.ways[cell[1]]
    movements_text = f"{cell[0]:g} {along.shown} {way}" if cell[0] is not None else f"movements {way}"
    return tuple(made), movements_text


def _settling(whole: MeasuredStudy, conditions: Sequence[str]) -> tuple[Settling, ...]:
    """Return the settling curves of all participants' movements together, by condition."""
    made = []
    for condition in conditions:
        own = [each for each in whole.lasted if each.condition == condition]
        if own:
            made.append(Settling(condition, survival([x.seconds for x in own], [x.settled for x in own])))
    return tuple(made)


def _unreached(
    whole: MeasuredStudy, participants: Sequence[str], conditions: Sequence[str], control: str
) -> dict[str, tuple[bool, bool]]:
    """Return, by condition, whether somebody's median duration was not reached: in the condition, and in control."""
    medians = lasting_medians(whole.lasted, participants, conditions, conditions)
    if medians is None:
        return {}
    lacking = dict(zip(conditions, (~medians[1].all(axis=0)).tolist(), strict=True))
    return {condition: (lacking[condition], lacking[control]) for condition in conditions if condition != control}


def _about_start(whole: MeasuredStudy, m: MeasuredMovement, time: np.ndarray) -> np.ndarray:
    motion = whole.motions[m.recording]
    at = m.movement.start + time
    angle = np.interp(at, motion.time, motion.angle) - motion.angle[m.movement.first]
    sign = m.movement.direction
    velocity = np.interp(at, motion.time, motion.velocity)
    return sign * np.array([angle, velocity, np.interp(at, motion.time, motion.acceleration)])
