"""Certify the transparency of a condition: collect people's changes from recordings, and decide.

`study_changes` collects the data of each end point: values, bounds where movements were cut off, periods,
learning, lost and failed movements. `people.certificate.decide` decides. A mixed model of all movements with
covariates (`model_of`) is a sensitivity analysis.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ..._errors import StudyError
from ..analysis import Analysis, EndPoint
from ..certificate import (
    CANNOT_SAY,
    LEARNING_DOUBT,
    Certificate,
    LostCounts,
    PeoplesChanges,
    certificate_from_tests,
    decide,
    tested_changes,
)
from ..design_columns import DIRECTION_UP, MeasuredMovement
from ..equivalence import BEYOND_MARGIN, Equivalence, Margin, Method, equivalence
from ..indices import CutOff, Index
from ..learning import OrderedMovements, learning
from ..mixed_model import MIN_MOVEMENTS, MixedModel, failed_model, mixed_model
from ..movement_indices import IndexTable, index_table
from ..movement_noise import MovementNoise, movement_noise
from ..power import (
    CERTIFICATE_SIZES,
    MIN_FORECAST_PEOPLE,
    Active,
    find_equivalence_participants,
    find_fewest,
    lasting_bounds,
)
from ..session_periods import MIN_ORDERED_PEOPLE, adjustment
from ..uneven_losses import completed_values, excess_losses
from .assessment_result import Certified
from .measured_study import MeasuredStudy
from .movement_curves import Curves, compare_with_control
from .pointing import SessionOrder

if TYPE_CHECKING:
    from .assessment_result import AssessmentResult
    from .assessment_table import AssessmentTable

MAX_AMPLITUDE_LEVELS = 8
"""Largest number of amplitudes with a separate effect each. With more, the effect of amplitude is a straight line."""


def movements_of(
    whole: MeasuredStudy, point: EndPoint, conditions: Sequence[str], participants: Sequence[str], order: SessionOrder
) -> list[tuple[MeasuredMovement, float]]:
    """Return movements with their values in chronological order; none if the index has no values of single movements.

    Only cells that a participant has in all `conditions` are used.
    """
    of = "" if point.index.spread else point.index.of
    own = []
    for m in whole.movements:
        value = m.values.get(of, np.nan)
        there = m.condition in conditions and m.participant in participants
        if (
            there
            and np.isfinite(value)
            and point.index.direction in ("", m.cell[1])
            and (value > 0.0 or not point.logs)
        ):
            own.append((m, float(np.log(value)) if point.logs else float(value)))
    cells: dict[tuple, set] = {}
    for m, _ in own:
        cells.setdefault((m.participant, m.cell), set()).add(m.condition)
    own = [each for each in own if len(cells[each[0].participant, each[0].cell]) == len(conditions)]
    return sorted(own, key=lambda each: (order.within[each[0].recording], each[0].movement.start))


def model_of(
    whole: MeasuredStudy, point: EndPoint, condition: str, control: str | None, people: Sequence[str],
    order: SessionOrder,
) -> MixedModel:  # fmt: skip
    """Fit the mixed model of one end point to every movement of these `people`; `control` is None if it has none."""
    conditions = [condition] if control is None else [control, condition]
    own = movements_of(whole, point, conditions, people, order)
    if not own:
        return failed_model(len(people), 0, "the index has no values for single movements")
    if point.index.cut_off is not CutOff.NO_VALUE:
        cut = sum(
            not each.settled for each in whole.lasted if each.condition in conditions and each.participant in people
        )
        if cut:
            why = f"{cut} movements were cut off, so that their values are unknown"
            return failed_model(len(people), len(own), why)
    under = None if control is None else np.array([m.condition == condition for m, _ in own])
    who = np.array([m.participant for m, _ in own])
    if {(m.participant, m.condition) for m, _ in own} != {(p, c) for p in people for c in conditions}:
        return failed_model(len(people), len(own), "a participant lacks matching movements")
    return mixed_model(np.array([y for _, y in own]), who, under, _covariates(own, under, order))


def _covariates(
    own: Sequence[tuple[MeasuredMovement, float]], under: np.ndarray | None, order: SessionOrder
) -> dict[str, np.ndarray]:
    """Return the covariates, (n,) each: amplitude and trial, alone and times the condition, direction, and period."""
    made: dict[str, np.ndarray] = {}
    amplitude = [m.cell[0] for m, _ in own]
    levels = [] if None in amplitude else sorted(set(amplitude))
    if 1 < len(levels) <= MAX_AMPLITUDE_LEVELS:
        made |= {f"amplitude {level:g}": np.array([float(a == level) for a in amplitude]) for level in levels[1:]}
    elif levels[1:]:
        made["amplitude"] = np.array(amplitude, float)
    known = all(order.within[m.recording] >= 0 for m, _ in own)
    if known:
        made["trial"] = _trial(own)
    if under is not None:
        made |= {f"{name} x condition": (each - each.mean()) * (under - 0.5) for name, each in made.items()}
    made["direction"] = np.array([float(m.cell[1] == DIRECTION_UP) for m, _ in own])
    if order.period:
        made["period"] = np.array([float(order.period[m.recording]) for m, _ in own])
    return made


def _trial(own: Sequence[tuple[MeasuredMovement, float]]) -> np.ndarray:
    """Return the rank of each movement in its participant and condition, (n,), from 0 (first) to 1 (last)."""
    groups: dict[tuple[str, str], list[int]] = {}
    for i, (m, _) in enumerate(own):
        groups.setdefault((m.participant, m.condition), []).append(i)
    made = np.zeros(len(own))
    for rows in groups.values():
        made[rows] = np.arange(len(rows)) / max(len(rows) - 1, 1)
    return made


def of_model(model: MixedModel, point: EndPoint, alpha: float) -> Equivalence:
    """Test the model's change against the end point's margin, in the unit of participants' changes."""
    if not point.index.over_control:
        return model.equivalence(point.margin, alpha)
    # A change as a share of control is exp(difference of logarithms) - 1; the transformation does not affect tests.
    with np.errstate(divide="ignore"):
        ends = (float(np.log1p(max(end, -1.0))) for end in (point.margin.low, point.margin.high))
        made = model.equivalence(Margin(*ends), alpha)
    low, high = (float(np.expm1(end)) for end in made.interval)
    return replace(made, margin=point.margin, estimate=float(np.expm1(made.estimate)), interval=(low, high))


def lost_movements(
    whole: MeasuredStudy, wanted: Mapping[str, EndPoint], curves: Iterable[str], pair: tuple[str, str],
    people: list[str],
) -> dict[str, LostCounts]:  # fmt: skip
    """Count the movements of both conditions that gave no value, for each end point and curve.

    Median durations include movements that were cut off and targets that were never reached. Other indices of duration
    include those that were cut off. A condition in which nobody has a value of an index is none that lost it.
    """

    def count(each: Iterable, condition: str) -> int:
        return sum(x.condition == condition and x.participant in people for x in each)

    found: dict[str, LostCounts] = {}
    for name in (*wanted, *curves):
        known: Sequence = whole.movements if name not in wanted else _with_values(whole.movements, wanted[name], pair)
        cut_off = wanted[name].index.cut_off if name in wanted else CutOff.NO_VALUE
        if cut_off is not CutOff.NO_VALUE:
            known = (*whole.lasted, *(whole.failed if cut_off is CutOff.AT_LEAST_SEEN else ()))
        found[name] = {}
        for condition in pair:
            total = count(whole.movements, condition) + sum(
                sum(whole.left_out[recording].values())
                for recording, (person, own) in whole.recorded.items()
                if own == condition and person in people
            )
            found[name][condition] = max(total - count(known, condition), 0), total
    return found


def people_with_losses(
    whole: MeasuredStudy, wanted: Mapping[str, EndPoint], pair: tuple[str, str], people: list[str]
) -> dict[str, np.ndarray]:
    """Return, by end point, which of the `people` lost a movement in one of both conditions, (n,)."""
    by_person = {person: lost_movements(whole, wanted, (), pair, [person]) for person in people}
    return {
        name: np.array([any(gone for gone, _ in by_person[person][name].values()) for person in people])
        for name in wanted
    }


def _with_values(
    movements: Sequence[MeasuredMovement], point: EndPoint, pair: tuple[str, str]
) -> list[MeasuredMovement]:
    """Return the movements that lack no value of an index: of another direction none is expected."""
    index = point.index
    recorded = {m.condition for m in movements if np.isfinite(m.values.get(index.of, np.nan))} & {*pair}
    return [
        m for m in movements
        if m.condition not in recorded
        or index.direction not in ("", m.cell[1])
        or np.isfinite(m.values.get(index.of, np.nan))
        or index.of_curve is not None
    ]  # fmt: skip


def study_changes(
    whole: MeasuredStudy, wanted: Mapping[str, EndPoint], tables: Mapping[str, IndexTable], conditions: Sequence[str],
    condition: str, people: list[str], order: SessionOrder, analysis: Analysis,
) -> dict[str, PeoplesChanges]:  # fmt: skip
    """Return what recordings say of the changes of `people` in each end point under one condition.

    `conditions` are all, control first; `tables` hold people's values by end point.
    """
    control = conditions[0]
    pair = control, condition
    lost, losers = lost_movements(whole, wanted, (), pair, people), people_with_losses(whole, wanted, pair, people)
    made = {}
    for name, point in wanted.items():
        base = control_of(tables[name], control)
        seen = _differences(tables[name], point, condition, control, people)
        sessions = None
        if base is not None:
            sessions = analysis.sessions(order.by_condition, people, conditions, condition)
        compared = [condition] if base is None else [base, condition]
        trend = learning(_ordered(movements_of(whole, point, compared, people, order), order), people, compared)
        at_end = None
        if trend is not None:
            at_end = (1.0 + seen) * np.exp(trend[1]) - 1.0 if point.index.over_control else seen + trend[1]
        failed = None
        gone = {each.condition for each in whole.failed if each.participant in people} & {*pair}
        if point.index.cut_off is CutOff.AT_LEAST_SEEN and gone:
            every = whole.lasted + whole.failed
            failed = lasting_bounds(every, people, conditions, *pair, point.differences)
        made[name] = PeoplesChanges(
            point.margin, seen, _bounds(whole, point, seen, conditions, condition, people), sessions,
            None if trend is None else trend[0], at_end, failed, lost[name], losers[name],
            noise=_noise(whole, point, condition, base, people, order),
            completed=_completed(whole, point, conditions, condition, people, lost[name]),
        )  # fmt: skip
    return made


def _completed(
    whole: MeasuredStudy, point: EndPoint, conditions: Sequence[str], condition: str, people: list[str],
    lost: LostCounts,
) -> tuple[np.ndarray, np.ndarray] | None:  # fmt: skip
    """Return people's changes, (n,) each, with the excess losses of one condition counted as extreme values.

    None without such losses, and for an index without values of single movements.
    """
    index, control = point.index, conditions[0]
    excess = excess_losses(lost, (control, condition))
    if excess is None or index.spread or index.of_curve is not None:
        return None
    own: Sequence = whole.lasted if index.lasting else whole.movements
    keys = [(m.participant, m.condition, m.cell) for m in own]
    values = np.array([m.seconds if index.lasting else m.values.get(index.of, np.nan) for m in own])

    def changes(upwards: bool) -> np.ndarray:
        made = completed_values(values, keys, *excess, upwards=upwards).tolist()
        if index.lasting:
            lasted = [replace(m, seconds=value) for m, value in zip(own, made, strict=True)]
            table = index_table([], index, people, conditions, control, lasted)
        else:
            moved = [replace(m, values={**m.values, index.of: value}) for m, value in zip(own, made, strict=True)]
            table = index_table(moved, index, people, conditions, control, ())
        if table is None or any(person not in table.participants for person in people):
            return np.full(len(people), np.nan)
        return _differences(table, point, condition, control, people)

    both = changes(False), changes(True)
    return both if np.isfinite(both).all() else None


def _noise(
    whole: MeasuredStudy, point: EndPoint, condition: str, base: str | None, people: list[str], order: SessionOrder
) -> MovementNoise | None:
    """Return the noise of people's changes by single movements; `base` is the control, None if there is none."""
    index, compared = point.index, [condition] if base is None else [base, condition]
    if index.lasting:
        own: Sequence = [each for each in whole.lasted if each.condition in compared]
    else:
        own = [m for m in whole.movements if m.condition in compared and _is_of(m, index)]
        own = sorted(own, key=lambda m: (order.within.get(m.recording, -1), m.movement.start))

    def change_of(rows: np.ndarray) -> dict[str, float]:
        part = [own[i] for i in rows]
        lasted = part if index.lasting else ()
        table = index_table([] if index.lasting else part, index, people, compared, compared[0], lasted)
        if table is None or condition not in table.conditions:
            return {}
        there = list(table.participants)
        with np.errstate(divide="ignore", invalid="ignore"):
            return dict(zip(there, _differences(table, point, condition, compared[0], there), strict=True))

    return movement_noise([(m.participant, m.condition, m.cell) for m in own], people, compared, change_of)


def _is_of(movement: MeasuredMovement, index: Index) -> bool:
    """Return whether a movement has a value of an index, in its direction."""
    return bool(np.isfinite(movement.values.get(index.of, np.nan))) and index.direction in ("", movement.cell[1])


def _ordered(own: Sequence[tuple[MeasuredMovement, float]], order: SessionOrder) -> OrderedMovements:
    """Return movements, which are in chronological order, for `learning`."""
    movements = [m for m, _ in own]
    places = [float(i) if order.within[m.recording] >= 0 else np.nan for i, m in enumerate(movements)]
    return OrderedMovements(
        [m.participant for m in movements], [m.condition for m in movements], [m.cell for m in movements],
        np.array([value for _, value in own]), np.array(places) if own else None,
    )  # fmt: skip


def _bounds(
    whole: MeasuredStudy, point: EndPoint, seen: np.ndarray, conditions: Sequence[str], condition: str,
    people: list[str],
) -> tuple[np.ndarray, np.ndarray] | None:  # fmt: skip
    """Return the bounds of people's changes where movements were cut off; None if their changes are known."""
    pair = conditions[0], condition
    if point.index.cut_off is CutOff.AT_LEAST_SEEN:
        return lasting_bounds(whole.lasted, people, conditions, *pair, point.differences)
    if point.index.cut_off is not CutOff.SEEN_DURATION:
        return None
    # A mean that includes a movement without a seen end has no upper bound.
    cut = {(each.participant, each.condition) for each in whole.lasted if not each.settled}
    base, own = (np.array([(person, c) in cut for person in people]) for c in pair)
    return np.where(base, -inf, seen), np.where(own, inf, seen)


def _unknown(
    changes: Mapping[str, PeoplesChanges], whole: MeasuredStudy, wanted: Mapping[str, EndPoint],
    tables: Mapping[str, IndexTable], pair: tuple[str, str], people: list[str], order: SessionOrder,
) -> tuple[str, ...]:  # fmt: skip
    """Return sentences on what cannot be tested."""
    unknown = []
    if not order.period:
        unknown.append(
            f"{order.unknown}: the effects of period and carry-over cannot be separated from those of conditions."
        )
    for name, own in changes.items():
        if order.period and adjustment(len(people), own.sessions, known=own.is_known).is_plain:
            unknown.append(
                f"With {len(people)} participants the effect of the period is not estimated."
                if len(people) < MIN_ORDERED_PEOPLE
                else f"The effect of the period is not estimated for {wanted[name].index.short}: some movements were "
                "cut off, so that only bounds of the changes are known."
                if not own.is_known
                else f"All participants had {pair[0]} and {pair[1]} in the same order and interval: the effect of the "
                "period cannot be separated from that of the condition."
            )
        base = control_of(tables[name], pair[0])
        compared = [pair[1]] if base is None else list(pair)
        if own.drift is None and movements_of(whole, wanted[name], compared, people, order):
            unknown.append(
                f"Learning was not tested: a participant has fewer than {MIN_MOVEMENTS} movements of a condition, or "
                "several recordings of it without a stated order (period, repetition)."
            )
    return tuple(dict.fromkeys(unknown))


PLANNED_POWER = 0.9
"""Power for which the number of participants is planned."""

SIMULATED_STUDY_COUNT = 1000
"""Number of simulated studies behind the planned number of participants."""

RESAMPLED_STUDY_COUNT = 200
"""Number of studies of each size whose people are drawn from those of the study."""

RESAMPLING_SEED = 7
"""Seed of these draws."""


def certify_conditions(
    found: AssessmentResult,
    spec: AssessmentTable,
    whole: MeasuredStudy,
    order: SessionOrder,
    curves: Curves,
    executor: Any = None,
    registered: Analysis | None = None,
) -> tuple[Certified, ...]:
    """Certify every condition but control. `spec` is [assessment], `registered` the registered analysis.

    Nothing is returned if no margins are stated, or if one participant alone can be compared.
    """
    wanted = spec.analysis.end_points(found.indices)
    if not wanted:
        if spec.curves:
            raise StudyError("[assessment.curves]: found margins of curves alone, expected [assessment.margins] too")
        return ()
    if len(found.participants) < 2:
        # A session is assessed after its first participant: indices are then told, and nothing is tested.
        return ()
    made = []
    for condition in found.conditions:
        if condition != found.control:
            lacking = [
                n for n in wanted if n not in found.assessed or condition not in found.assessed[n].table.conditions
            ]
            if lacking:
                raise StudyError(
                    f"[assessment.margins]: found no {', '.join(lacking)} in {condition}, expected every index with a "
                    "margin. Record the index, or remove its margin before you look at the data"
                )
            made.append(_certify(found, spec, wanted, condition, whole, order, curves, executor, registered))
    return tuple(made)


def _certify(
    found: AssessmentResult,
    spec: AssessmentTable,
    wanted: Mapping[str, EndPoint],
    condition: str,
    whole: MeasuredStudy,
    order: SessionOrder,
    curves: Curves,
    executor: Any,
    registered: Analysis | None,
) -> Certified:
    analysis, pair = spec.analysis, (found.control, condition)
    tables = {name: found.assessed[name].table for name in wanted}
    people = [p for p in found.participants if all(p in table.participants for table in tables.values())]
    if len(people) < 2:
        raise StudyError(
            f"[assessment.margins], {condition}: found {len(people)} participants with all of {', '.join(wanted)}, "
            "expected two or more"
        )
    changes = study_changes(whole, wanted, tables, found.conditions, condition, people, order, analysis)
    shown = compare_with_control(curves, people, condition, found.control, spec.curves, found.along, analysis.alpha)
    with_margins = {f"{c.quantity} curve": c.comparison for c in shown if c.stated}
    lost_of_curves = lost_movements(whole, {}, with_margins, pair, people)
    lost_people = tuple(p for p in (*found.participants, *found.without) if p not in people)
    joint = decide(
        analysis, changes, lost_people=len(lost_people), curves=with_margins, lost_of_curves=lost_of_curves,
        registered=registered, points=wanted,
    )  # fmt: skip
    another = "signed_rank" if analysis.method == "skew_robust" else "skew_robust"
    other = {name: tested_changes(own, analysis, another) for name, own in changes.items()}
    models = {name: model_of(whole, point, condition, control_of(tables[name], found.control), people, order)
              for name, point in wanted.items()}  # fmt: skip
    # An index without values of single movements has no mixed model, only participants' values.
    fitted = {name: of_model(models[name], point, analysis.alpha) for name, point in wanted.items()
              if models[name].movements}  # fmt: skip
    beside = {another: other, **({"mixed_model": fitted} if fitted else {})}
    trends = {
        name: (float(np.median(own.drift)), doubt.p_value)
        for name, own in changes.items()
        for doubt in joint.doubts.get(name, ())
        if own.drift is not None and doubt.what == LEARNING_DOUBT
    }
    return Certified(
        condition, joint, wanted, len(people),
        people_needed(wanted, joint, changes, analysis, order, executor=executor), analysis.estimand,
        tuple(people), models, beside, trends, _unknown(changes, whole, wanted, tables, pair, people, order),
        _failed(whole, pair, people), shown, {**{n: own.lost for n, own in changes.items()}, **lost_of_curves},
        analysis.max_left_out, lost_people, _people_needed_beyond(joint),
    )  # fmt: skip


def control_of(table: IndexTable, control: str) -> str | None:
    """Return the control that an end point is compared with; None if it has none."""
    return control if control in table.conditions or table.index.over_control else None


def people_needed(
    points: Mapping[str, EndPoint], joint: Certificate, changes: Mapping[str, PeoplesChanges], analysis: Analysis,
    order: SessionOrder, *, studies: int = SIMULATED_STUDY_COUNT, executor: Any = None,
) -> int | None:  # fmt: skip
    """Return with how many people a robot that changes nothing is shown to be transparent in 9 of 10 studies.

    None from fewer than three people, and where the largest number that is tried would not be enough.
    """
    tests = joint.end_points
    # The effects of periods are none of how much people differ.
    seen = [changes[name].seen if tests[name].bounded else tests[name].differences for name in points]
    if len(seen[0]) < MIN_FORECAST_PEOPLE:
        return None
    active = Active.of(
        analysis, order=bool(order.period),
        learning=any(doubt.what == LEARNING_DOUBT for own in joint.doubts.values() for doubt in own),
        noise=[tests[name].share_test().noise_share for name in points],
    )  # fmt: skip
    # An index without control, such as a torque, is planned about its own mean.
    change = [float(d.mean()) if point.margin.low == -inf else 0.0
              for d, point in zip(seen, points.values(), strict=True)]  # fmt: skip
    return find_equivalence_participants(
        np.atleast_2d(np.cov(np.array(seen))), [point.margin for point in points.values()], power=PLANNED_POWER,
        change=change, alpha=joint.alpha, active=active, studies=studies, executor=executor,
    )  # fmt: skip


def _people_needed_beyond(joint: Certificate) -> int | None:
    """Return with how many people a change beyond its margin would be significant, if changes are as they were seen.

    None where no end point tested alone is beyond its margin, or more people than were tried are needed. People are
    drawn with replacement from those of this study.
    """
    alone = [name for name, own in joint.end_points.items() if own.verdict == BEYOND_MARGIN]
    if joint.verdict != CANNOT_SAY or not alone or joint.end_points[alone[0]].pairs < MIN_FORECAST_PEOPLE:
        return None

    def share(count: int) -> float:
        rng = np.random.default_rng([RESAMPLING_SEED, count])
        return float(np.mean([_is_beyond(joint, rng, count) for _ in range(RESAMPLED_STUDY_COUNT)]))

    now = joint.end_points[alone[0]].pairs
    sizes = [size for size in CERTIFICATE_SIZES if size > now]
    return find_fewest(sizes, lambda count: share(count) >= PLANNED_POWER, now)


def _is_beyond(joint: Certificate, rng: np.random.Generator, count: int) -> bool:
    """Return whether an end point of a study of `count` people, drawn from those of this one, is beyond its margin."""
    pairs = min(own.pairs for own in joint.end_points.values())
    rows = rng.integers(pairs, size=count)
    tests = {}
    for name, own in joint.end_points.items():
        tests[name] = equivalence(
            own.differences[rows], own.margin, upper=own.highest[rows] if own.bounded else None, alpha=own.alpha,
            method=cast("Method", own.method),
        )  # fmt: skip
    drawn = certificate_from_tests(tests, joint.alpha, rule=joint.rule)
    return any(drawn.tested(name) == BEYOND_MARGIN for name in tests)


def _failed(whole: MeasuredStudy, pair: tuple[str, str], people: list[str]) -> dict[str, tuple[int, int]]:
    def count(each: tuple, condition: str) -> int:
        return sum(x.condition == condition and x.participant in people for x in each)

    return {c: (count(whole.failed, c), count(whole.failed, c) + count(whole.lasted, c)) for c in pair}


def _differences(
    table: IndexTable, point: EndPoint, condition: str, control: str, people: Sequence[str]
) -> np.ndarray:
    rows = [table.participants.index(person) for person in people]
    own = table.column(condition)[rows]
    there = control in table.conditions and not table.index.over_control
    return point.differences(own, table.column(control)[rows] if there else None)
