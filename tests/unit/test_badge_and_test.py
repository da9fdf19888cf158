"""Simulated studies with margins and without: badge, headline, certificate and tables never contradict each other."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

import pellucid as pl
from pellucid.live.session.running_indices import RunningIndices
from pellucid.people.certificate import CANNOT_SAY, FAIL, PASS
from pellucid.people.design_columns import MeasuredMovement, MovementDuration
from pellucid.people.equivalence import BEYOND_MARGIN, UNDECIDED, WITHIN_MARGIN
from pellucid.people.indices import SHOWN_INDICES
from pellucid.people.mixed_model import failed_model
from pellucid.people.movement_indices import IndexTable
from pellucid.people.movements import Movement, MovementRule
from pellucid.people.study import assessment_page, certified
from pellucid.people.study.assess import _assessed, _told
from pellucid.people.study.assessment_result import Assessed, AssessmentResult
from pellucid.people.study.assessment_table import AssessmentTable
from pellucid.people.study.assessment_tables import RANK_TEST_WORDS, change_table, summary_table
from pellucid.people.study.measured_study import MeasuredStudy
from pellucid.people.study.pointing import SessionOrder
from pellucid.study.procedures.print_result import print_to_text
from pellucid.units import COORDINATES_BY_UNIT

MARGIN = 0.10
"""Margin of both indices of the simulated studies, as a share of control."""

PEOPLE = (8, 9, 11, 12, 13, 14, 16, 20, 28, 40)
"""Numbers of people; the mean of fewer than 12 is never said to lie within."""

FOUND = ("differs", RANK_TEST_WORDS[True])
"""What the table of changes says where a test finds a difference, as the interval does or not."""

CONTROL, WORN = "Free", ("Robot", "Other")
AMPLITUDES = (0.3, 0.6)
INDICES = ("duration_median", "vmax")


@dataclass(frozen=True)
class Simulated:
    """One simulated study and how it was made."""

    people: int
    spread: float  # standard deviation of people's changes, in margins
    effect: float  # true change of both indices, in margins
    found: AssessmentResult
    rows: dict


def simulate(seed, margins=True):
    """A study in which a robot changes durations by `effect` margins, and peak velocities as much the other way."""
    rng = np.random.default_rng([23, seed])
    people = [f"P{i}" for i in range(int(rng.choice(PEOPLE)))]
    conditions = (CONTROL, *WORN[: int(rng.integers(1, 3))])
    spread, effect = float(rng.uniform(0.2, 1.0)), float(rng.choice([0.0, 0.0, 0.5, 1.0, 1.5, 2.5]))
    estimand = str(rng.choice(["mean", "pseudo-median"]))
    movements, lasted, recorded = [], [], {}
    for person in people:
        own = np.exp(0.1 * rng.standard_normal())
        for condition in conditions:
            recorded[f"{person}_{condition}"] = person, condition
            change = 0.0 if condition == CONTROL else MARGIN * (effect + spread * rng.standard_normal())
            for k, amplitude in enumerate(AMPLITUDES * 3):
                gain = own * np.exp(change + 0.01 * rng.standard_normal())
                values = {"duration": (0.4 + 0.6 * amplitude) * gain, "vmax": 2.0 * amplitude / gain}
                cell = (round(float(np.degrees(amplitude)), 1), "up")
                made = Movement(
                    first=100 * k, last=100 * k + 50, start=float(k), duration=values["duration"], direction=1,
                    amplitude=amplitude, travel=amplitude, reach=amplitude, peak_velocity=values["vmax"],
                    mean_velocity=0.5 * values["vmax"], peak_time=0.5, peak_acceleration=1.0,
                    lasted=values["duration"],
                )  # fmt: skip
                movements.append(MeasuredMovement(person, condition, f"{person}_{condition}", made, cell, values))
                lasted.append(MovementDuration(person, condition, cell, values["duration"], True))
    whole = MeasuredStudy(MovementRule(), tuple(movements), {name: {} for name in recorded}, {}, tuple(lasted),
                          recorded=recorded)  # fmt: skip
    stated = {**dict.fromkeys(INDICES, f"{100 * MARGIN:g} %"), "estimand": estimand} if margins else {}
    spec = AssessmentTable(control=CONTROL, margins=stated)
    along = COORDINATES_BY_UNIT["rad"]
    assessed = _assessed(whole, people, conditions, spec, along, [index.name for index in SHOWN_INDICES])
    order = SessionOrder({}, {}, dict.fromkeys(recorded, 0), "the order of conditions is not stated")
    made = AssessmentResult(
        study="study", headline="", tables=(), verdicts=(), rows=(), cards={}, checksums={}, confidence=0.95,
        estimand=spec.analysis.estimand, control=CONTROL, conditions=conditions, participants=tuple(people), unit="rad",
        movements=len(movements), assessed=assessed, measured=whole.movements,
    )  # fmt: skip
    if margins:
        made = made.__class__(**{**vars(made), "certified": certified.certify_conditions(made, spec, whole, order, {})})
    names = ("participant", "condition", "amplitude", "trial", "vmax")
    rows = {name: [] for name in names}
    for m in movements:
        row = (m.participant, m.condition, m.movement.amplitude, m.movement.start, m.values["vmax"])
        for name, value in zip(names, row, strict=True):
            rows[name].append(value)
    return Simulated(len(people), spread, effect, _told(made, ()), rows)


def require_no_contradiction(study):
    """Require that everything that a report says of a certified study is one and the same."""
    found = study.found
    said = {each.condition: each.certificate.verdict for each in found.certified}
    badge = found.answer
    verdicts = {PASS: "yes", FAIL: "no", CANNOT_SAY: "cannot say"}
    expected = "yes" if PASS in said.values() else "no" if set(said.values()) == {FAIL} else "cannot say"
    assert badge.verdict == expected
    assert {part.name: part.verdict for part in badge.parts} == {name: verdicts[word] for name, word in said.items()}
    for condition, word in said.items():
        assert f"{condition}: {word}. " in badge.sentence
    assert badge.is_answered or "people" in badge.next[0].sentence
    text = print_to_text(found)
    rows = {row.id: row for row in found.rows}
    shown = {(row[0], row[1]): row[3] for row in change_table(found).rows}
    for each in found.certified:
        own, verdict = each.certificate, each.certificate.verdict
        assert badge.sentence.count(f"{each.condition}: {verdict}. ") == 1
        assert any(v.text.startswith(f"{each.condition}: {verdict}.") for v in found.verdicts)
        value = rows[f"study.certificate.{each.condition.lower()}.transparent"].value
        assert value == {PASS: 1.0, FAIL: 0.0, CANNOT_SAY: 0.5}[verdict]
        words = {name: own.said_of(name) for name in INDICES}
        assert (verdict == PASS) == (set(words.values()) == {WITHIN_MARGIN})
        assert (verdict == FAIL) == (BEYOND_MARGIN in words.values())
        for name, word in words.items():
            short = found.indices[name].short
            expected = {WITHIN_MARGIN: "within margin", BEYOND_MARGIN: "beyond margin", UNDECIDED: "undecided"}[word]
            assert shown[short, each.condition] == expected
            point = own.end_points[name]
            assert not (point.p_within <= own.alpha and point.p_beyond <= own.alpha)
            low, high = point.interval
            if word == WITHIN_MARGIN:
                assert point.margin.low <= low <= high <= point.margin.high
            if word == BEYOND_MARGIN:
                assert low >= point.margin.high or high <= point.margin.low
    if set(said.values()) == {PASS}:
        assert "cannot say" not in text.lower()
        assert "not transparent" not in text.lower()
        assert "is not thereby equal" not in found.paragraph or len(found.assessed) > len(INDICES)
    if set(said.values()) == {FAIL}:
        assert not re.search(r"(?<!not )\btransparent\b", text)
    return said


def same_by_array(study):
    """The verdicts that `pl.assess` gives of a table of the same movements, by condition and for peak velocity."""
    estimand = study.found.estimand
    table = pl.assess(study.rows, control=CONTROL, indices=["vmax"], margins={"vmax": MARGIN}, estimand=estimand)
    for each in study.found.certified:
        own, other = each.certificate.end_points["vmax"], table.certificates[each.condition].end_points["vmax"]
        assert (own.p_within, own.p_beyond) == pytest.approx((other.p_within, other.p_beyond), abs=1e-12)
        verdict = table.certificates[each.condition].verdict
        assert f"{each.condition}: {verdict}" in str(table)
        assert ("cannot say" in str(table)) == (CANNOT_SAY in {c.verdict for c in table.certificates.values()})


def require_tests_agree_without_margins(study):
    """Without margins the badge asks whether the leading index differs, as its test says."""
    found = study.found
    answer = found.answer
    told = [row for row in change_table(found).rows if row[0] == found.indices["duration_median"].short]
    assert answer.verdict == ("yes" if any(row[3] in FOUND for row in told) else "cannot say")
    for short, condition, _, word in change_table(found).rows:
        if word in FOUND:  # whatever the leading index says, a condition that differs is named
            words = next(each.table.index.words for each in found.assessed.values() if each.table.index.short == short)
            assert condition in answer.sentence
            assert words.lower() in answer.sentence.lower()
    assert "cannot say" not in str(change_table(found).rows)
    marked = {row[0].partition(" (")[0]: row[2:] for row in summary_table(found).rows}
    for short, condition, _, word in change_table(found).rows:
        at = found.conditions.index(condition) - 1
        assert marked[short][at].endswith("*") == (word in FOUND)
    for each in found.assessed.values():
        if each.table.index.paragraph_place and not each.table.index.over_control:
            p = each.comparison.p_value
            if p is not None and p >= 0.05:
                assert not any(each.differs(c, CONTROL, 0.05) for c in each.comparison.pairwise)


def run(seeds):
    seen = []
    for seed in seeds:
        study = simulate(seed)
        seen += require_no_contradiction(study).values()
        same_by_array(study)
    return seen


@pytest.fixture
def quick(monkeypatch):
    """Leave out what takes most of the time and says nothing of badge or test: plan, mixed model and figures."""
    monkeypatch.setattr(certified, "find_equivalence_participants", lambda *_, **__: 24)
    monkeypatch.setattr(certified, "model_of", lambda *_: failed_model(0, 0, "not fitted"))
    monkeypatch.setattr(assessment_page, "draw", lambda *_: None)


@pytest.mark.nightly
def test_badge_and_test_agree_in_forty_studies(quick):
    seen = run(range(40))
    assert {PASS, FAIL, CANNOT_SAY} <= set(seen)


def test_badge_and_test_agree_without_margins(quick):
    seen = set()
    for seed in range(40):
        study = simulate(seed, margins=False)
        require_tests_agree_without_margins(study)
        seen |= {row[3] for row in change_table(study.found).rows}
    assert seen == {*FOUND, "not shown"}


@pytest.mark.nightly
def test_badge_and_test_agree_in_two_hundred_studies():
    seen = run(range(200))
    assert min(seen.count(verdict) for verdict in (PASS, FAIL, CANNOT_SAY)) >= 20


def test_a_condition_differs_only_if_both_tests_say_so():
    """Of five people who are all slower Nemenyi's approximate p is 0.025, and Friedman's, counted exactly, 0.0625."""
    values = np.column_stack([np.linspace(1.0, 1.4, 5), np.linspace(1.1, 1.5, 5)])
    each = Assessed(
        IndexTable("vmax", "rad", tuple("ABCDE"), (CONTROL, "Robot"), values),
        pl.compare_conditions(values, [CONTROL, "Robot"], CONTROL),
    )
    assert each.comparison.pair(CONTROL, "Robot") < 0.05 < each.comparison.friedman.p
    assert each.differs("Robot", CONTROL, 0.05) is False
    assert each.differs("Robot", CONTROL, 0.07) is True
    assert each.differs(CONTROL, CONTROL, 0.05) is None


@pytest.mark.parametrize("estimand", ["mean", "pseudo-median"])
def test_a_session_says_of_an_estimand_what_its_certificate_does(estimand):
    """A session asks the certificate with the estimand of the study, not with another one."""
    # One person in eighty is much slower: ranks do not see by how much.
    changes = np.append(np.random.default_rng(1).normal(0.0, 0.01, 79), 3.0)
    people = [f"P{i}" for i in range(80)]
    spec = AssessmentTable(control=CONTROL, margins={"vmax": "10 %", "estimand": estimand})
    indices = RunningIndices(spec)
    point = spec.analysis.end_points(indices._indices)
    values = np.exp(np.column_stack([0.0 * changes, changes]))
    table = IndexTable("vmax", "rad", tuple(people), (CONTROL, "Robot"), values)
    indices._table = lambda *_: table
    made = Movement(first=0, last=9, start=0.0, duration=1.0, direction=1, amplitude=0.3, travel=0.3, reach=0.3,
                    peak_velocity=1.0, mean_velocity=0.5, peak_time=0.5, peak_acceleration=1.0, lasted=1.0)  # fmt: skip
    somebody = MeasuredMovement("somebody", CONTROL, "r", made, (17.2, "up"), {"vmax": 1.0})
    part = MeasuredStudy(MovementRule(), (somebody,), {}, {})
    said = indices._verdict("Robot", point, [part], people).said
    assert said == {"mean": "cannot say yet", "pseudo-median": "transparent"}[estimand]
    indices.registered = replace(spec.analysis, false_transparent=0.01)
    said = indices._verdict("Robot", point, [part], people).said
    assert said == {"mean": "cannot say yet", "pseudo-median": "transparent (post hoc)"}[estimand]
