"""The answer of a certificate lists its conditions in one sentence, and says "cannot say" once."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from pellucid.people.analysis import EndPoint
from pellucid.people.certificate import LEFT_OUT_DOUBT, Certificate, certificate
from pellucid.people.comparison import compare_conditions, smallest_told_p
from pellucid.people.equivalence import Margin
from pellucid.people.indices import INDICES, leading_index
from pellucid.people.movement_indices import IndexTable
from pellucid.people.share_of_people import DEFAULT_RULE
from pellucid.people.study import assessment_answer
from pellucid.people.study.assessment_result import Assessed, Certified, Sensitivity
from pellucid.people.study.certified import _people_needed_beyond
from pellucid.people.study.certified_rows import _why_undecided, deciding_end_point
from pellucid.people.study.pointing import reason_words
from pellucid.people.study.primary_change import PrimaryChange
from pellucid.people.study.statements import _filter_verdicts, unsettled_text
from pellucid.people.survival import survival
from pellucid.study.answer import FOLDER, Answer, AnswerPart, Step, unanswered_message
from pellucid.study.pages.page import Page, write_page
from pellucid.study.pages.values import plain_text
from pellucid.units import COORDINATES_BY_UNIT

MEASURED = SimpleNamespace(is_simulated=False, rig_file="")
SIMULATED = SimpleNamespace(is_simulated=True, rig_file="lab/rig.toml")


def test_a_condition_of_which_nobody_can_say_gives_its_reason_alone(monkeypatch):
    """It ended in "cannot say: speed: cannot say (post hoc). The interval is too wide."."""
    said = {"speed": "cannot say (post hoc)", "full_accuracy": "not transparent"}
    certified = [
        SimpleNamespace(
            condition=name,
            certificate=SimpleNamespace(verdict=verdict, statement=verdict, post_hoc=False, said_of=lambda name: ""),
            end_points={},
        )
        for name, verdict in said.items()
    ]
    monkeypatch.setattr(assessment_answer, "certificate_reasons", lambda found: ["The interval is too wide."] * 2)
    monkeypatch.setattr(assessment_answer, "_recording_steps", lambda found, each: (Step("Record more movements"),))
    unused = {"_cut_text": "", "_order_step": (), "_exclusion_step": (), "_numbers": (), "_basis": None}
    for part, made in unused.items():
        monkeypatch.setattr(assessment_answer, part, lambda found, made=made: made)
    found = SimpleNamespace(certified=certified, control="balance", participants=("a", "b"))
    answer = assessment_answer.certificate_answer(found)
    assert answer.verdict == "cannot say"
    said = "speed: cannot say (post hoc); full_accuracy: not transparent. Compared with balance, 2 people."
    assert answer.said == said
    assert unanswered_message([answer]) == "cannot say: speed: The interval is too wide."


def test_the_certificate_does_not_name_itself_as_the_next_step():
    record = Step("Record more movements")
    answer = Answer("Is it transparent?", "yes", "yes", next=(assessment_answer.CERTIFICATE_STEP, record))
    following = assessment_answer.reviewed_answer(SimpleNamespace(answer=answer)).next
    assert [step.name for step in following] == ["paper", ""]
    assert following[1] == record


def test_the_basis_counts_the_movements_that_were_excluded():
    found = SimpleNamespace(
        participants=("a",), without={}, movements=778, left_out={"lost": 700, "still": 77}, order=None, certified=(),
        measured=(), exclusions=(),
    )  # fmt: skip
    why = "778 of 1,555 movements (777 excluded: 700 with gaps in the recorded position, 77 that did not reach half-"
    assert why in assessment_answer._basis(found).sentence
    allowed = SimpleNamespace(max_left_out=0.1, certificate=SimpleNamespace(post_hoc=()))
    found.certified, found.left_out, found.is_registered = (allowed,), {"lost": 777}, False
    why = "(777 excluded: with gaps in the recorded position; a claim of transparency allows at most 10 %)"
    assert why in assessment_answer._basis(found).sentence
    found.measured, found.along = (SimpleNamespace(cell=(None, "up")),), COORDINATES_BY_UNIT["m"]
    found.exclusions = ("movements back",)
    why = "(777 excluded: with gaps in the recorded position; stated rule: movements back; all in use go forwards; a"
    assert why in assessment_answer._basis(found).sentence
    found.certified = ()
    found.left_out = {}
    assert "numbers are of 778 movements" in assessment_answer._basis(found).sentence


@pytest.mark.parametrize(
    ("people", "needed", "said"),
    [
        (6, 13, "CLPC: record 7 more people, 13 in all"),
        (6, 45, "CLPC: record 39 more people, 45 in all"),
        (20, 21, "CLPC: record 1 more person, 21 in all"),
        (2, None, "CLPC: record 10 more people, 12 in all"),
    ],
)
def test_the_number_of_people_to_record_is_that_of_the_power_analysis(people, needed, said):
    """It was the smallest number for a claim, while the power analysis of the same page needed more."""
    (step,) = assessment_answer._recording_steps(MEASURED, [certified(people, needed)])
    assert step.text.startswith(said)


@pytest.mark.parametrize(("people", "needed"), [(6, None), (20, None), (20, 14)])
def test_where_no_number_of_people_decides_the_step_says_what_does(people, needed):
    """It asked for 12 people or more, of whom it said that no number would show it."""
    (step,) = assessment_answer._recording_steps(MEASURED, [certified(people, needed)])
    assert ("more people will not show it transparent" if needed is None else "it may change movement") in step.text
    assert "change the controller" in step.text.lower()
    assert "in all" not in step.text


def certified(people, needed, verdict=None):
    tests = {} if verdict is None else {"duration": SimpleNamespace(verdict=verdict, bounded=0)}
    points = dict.fromkeys(tests, SimpleNamespace(index=SimpleNamespace(short="Duration")))
    own = SimpleNamespace(end_points=tests, contradicted=lambda name: (), tested=lambda name: verdict)
    return SimpleNamespace(condition="CLPC", participants=people, needed=needed, certificate=own, end_points=points)


def test_conditions_that_need_the_same_share_a_step():
    one, other = certified(6, None), certified(6, None)
    other.condition = "PCFr"
    (step,) = assessment_answer._recording_steps(MEASURED, [one, other])
    assert step.text.startswith("CLPC, PCFr: more people")


def test_a_change_beyond_the_margin_that_may_be_chance_needs_more_people():
    """The step said that no number of people would show it transparent, which they are not to show."""
    each = certified(8, None, "beyond")
    each.needed_beyond = 24
    (step,) = assessment_answer._recording_steps(MEASURED, [each])
    assert step.text.startswith("CLPC: record 16 more people, 24 in all, to show in 9 of 10 studies that it is not")
    assert step.text.endswith("tested alone, duration would be beyond its margin already")
    each.needed_beyond = None
    (step,) = assessment_answer._recording_steps(MEASURED, [each])
    assert step.text.startswith("CLPC: no number of people up to 128 would show")


@pytest.mark.parametrize(
    ("people", "margins", "begins"),
    [
        (1, False, "Record the next participant"),
        (3, False, "To ask whether a condition is transparent (a claim needs 12 people at least), state the allowed"),
        (14, False, "To ask whether a condition is transparent, state the allowed change"),
    ],
)
def test_a_study_without_margins_is_told_what_a_claim_needs(people, margins, begins):
    found = SimpleNamespace(participants=("p",) * people, has_margins=margins, is_simulated=False)
    assert assessment_answer._margin_step(found).text.startswith(begins)


def changed(people=6, **more):
    return SimpleNamespace(
        participants=("p",) * people, has_margins=False, is_simulated=True, rig_file="lab/rig.toml",
        needed_as_seen={"PCFr": 40, "CLPC": None}, **more,
    )  # fmt: skip


def test_the_number_of_people_is_that_which_would_show_the_change_seen():
    """The page asked for 12 people, of whom its own table said that more than 96 would not show the change."""
    people, margins = assessment_answer._change_steps(changed(), ["PCFr", "CLPC"])
    needed = "seen here by the same tests, in 8 of 10 studies: PCFr about 40, CLPC more than 96"
    assert needed in people.text
    assert margins.name == "check"
    assert "12 people at least" in margins.text
    assert "PCFr more than 50" in assessment_answer._change_steps(changed(50), ["PCFr"])[0].text
    assert len(assessment_answer._change_steps(changed(), [])) == 1


def test_simulated_people_are_not_asked_to_be_recorded():
    step = replace(assessment_answer._more_people_step(changed(), ["PCFr"]), folder="my people")
    assert step.sentence.endswith(
        "Raise `count` in `[people]` of `'my people'/lab/rig.toml`, then run `pellucid simulate 'my people'` and "
        "`pellucid assess 'my people'`"
    )
    assert not step.command  # a terminal prints the command alone, which would make the same people again
    found = changed()
    found.rig_file = ""
    assert "Simulate more people" in assessment_answer._more_people_step(found, ["PCFr"]).text
    found.is_simulated = False
    assert "Record more people" in assessment_answer._more_people_step(found, ["PCFr"]).text


@pytest.mark.parametrize(("people", "needed"), [(2, None), (6, 13), (6, None), (20, 14)])
def test_a_certificate_of_simulated_people_asks_to_simulate(people, needed):
    """It asked to record people of whom there are none."""
    (step,) = assessment_answer._recording_steps(SIMULATED, [certified(people, needed)])
    assert "record" not in step.text.lower()
    assert "simulate" in step.text.lower()
    assert (f"(`count` in `[people]` of `{FOLDER}/lab/rig.toml`, then" in step.text) == (needed == 13 or people == 2)
    each = certified(8, None, "beyond")
    for each.needed_beyond in (24, 8, None):
        (step,) = assessment_answer._recording_steps(SIMULATED, [each])
        assert "record" not in step.text.lower()
    one = SimpleNamespace(participants=("p",), has_margins=True, **vars(SIMULATED))
    assert assessment_answer._margin_step(one).text.startswith("Simulate more people: margins are tested")


def compared(values, control="Ctrl"):
    names = ("Ctrl", "FC", "PCFr", "CLPC")
    table = IndexTable("duration_median", "rad", tuple(f"P{i}" for i in range(len(values))), names, np.array(values))
    return Assessed(table, compare_conditions(table.values, names, control))


def test_the_reason_names_the_test_and_what_few_people_allow():
    """It said that "no test" finds a difference (3 people, p = 0.148), of which test nobody knew."""
    found = SimpleNamespace(control="Ctrl")
    each = compared([[1.0, 2.0, 1.1, 0.9], [1.0, 3.0, 0.9, 1.2], [1.2, 1.1, 1.3, 1.0]])
    text = assessment_answer._undetected_text(found, each, 0.05)
    assert text.startswith("Friedman's test over the 4 conditions finds no difference in median duration (p = 0.")
    assert text.endswith("3 people)")
    two = compared([[1.0, 2.0, 1.1, 0.9], [1.0, 3.0, 0.9, 1.2]])
    text = assessment_answer._undetected_text(found, two, 0.05)
    assert text.endswith("With 2 people, the smallest possible p is 0.093")
    assert "signed-rank" not in text


def decided(verdict, said, beyond, alone=None):
    tests = {name: SimpleNamespace(verdict=(alone or said)[name], p_within=0.5) for name in said}
    own = SimpleNamespace(
        verdict=verdict, end_points=tests, said_of=said.get, beyond=beyond, p_beyond=beyond.get, alpha=0.05,
    )  # fmt: skip
    return SimpleNamespace(certificate=own, end_points=said)


def test_the_end_point_that_decides_a_condition_is_shown():
    """Its duration of +5.1 to +67.5 % stood beside a margin of 10 % and "not transparent": peak velocity decided."""
    both = {"duration_median": "beyond", "vmax": "beyond"}
    assert deciding_end_point(decided("not transparent", both, {"duration_median": 0.1, "vmax": 0.01})) == "vmax"
    assert deciding_end_point(decided("not transparent", both, {"duration_median": 0.04, "vmax": 0.01})) == (
        "duration_median"
    )
    one = {"duration_median": "within", "vmax": "undecided"}
    assert deciding_end_point(decided("cannot say", one, {})) == "vmax"
    none = {"duration_median": "undecided", "vmax": "undecided"}
    assert deciding_end_point(decided("cannot say", none, {}, {"duration_median": "undecided", "vmax": "beyond"})) == (
        "vmax"
    )


def test_the_basis_says_what_was_registered_and_in_which_orders():
    orders = {("a", "free"): 1.0, ("a", "worn"): 2.0, ("b", "free"): 2.0, ("b", "worn"): 1.0}
    found = SimpleNamespace(
        participants=("a", "b"), is_registered=True, order=SimpleNamespace(by_condition=orders),
        certified=[SimpleNamespace(certificate=SimpleNamespace(post_hoc=()))],
    )  # fmt: skip
    said = "The analysis was registered before the data; people had the conditions in 2 orders."
    assert assessment_answer._plan_text(found) == said
    found.is_registered, found.order = False, None
    said = "The analysis was not registered before the data; the order of conditions is not stated."
    assert assessment_answer._plan_text(found) == said
    found.certified = []
    assert assessment_answer._plan_text(found) == "The order of conditions is not stated."


def test_the_page_for_a_reviewer_names_a_paper_only_after_yes():
    answer = Answer("Is it transparent?", "no", "no", next=(Step("Change it"), assessment_answer.CERTIFICATE_STEP))
    following = assessment_answer.reviewed_answer(SimpleNamespace(answer=answer)).next
    assert [step.text for step in following] == ["Change it"]


def test_people_far_beyond_are_named_where_they_alone_lie_beyond():
    """The mean's interval reached into the margin, and nothing said why it would be beyond."""
    each = certified(8, None, "beyond")
    own = each.certificate
    own.alpha, own.rule, own.beyond, own.far = 0.05, DEFAULT_RULE, {"duration": 0.22}, {"duration": 0.075}
    for method in (Certificate.is_decided_by_people, Certificate.far_note):
        setattr(own, method.__name__, partial(method, own))
    own.end_points["duration"].share_test = lambda rule: SimpleNamespace(far=4, people=8, rule=rule)
    own.contradicted, own.lacks_people = lambda name: (), lambda name: False
    own.end_points["duration"].p_beyond, own.tested, own.p_beyond = 0.11, lambda name: "undecided", lambda name: 0.075
    said = _why_undecided(each, {"duration": "Duration", "vmax": "Peak velocity"}, ["Duration"])
    assert said.startswith("Tested alone, duration (4 of 8 people by more than 3 margins) would be beyond the margin.")
    assert "not significant after Holm's correction for 2 end points (p = 0.075" in said
    own.end_points["duration"].p_beyond = 0.01
    assert "3 margins" not in _why_undecided(each, {"duration": "Duration"}, ["Duration"])


def test_a_doubted_end_point_is_said_to_lie_where_its_test_found_it():
    """A duration of +27.6 % (-5.0 to +71.3 %) was said to lie within 10 %."""
    each = certified(6, None, "beyond")
    each.certificate.contradicted = lambda name: (SimpleNamespace(what=LEFT_OUT_DOUBT),)
    said = _why_undecided(each, {"duration": "Duration"}, ["Duration"])
    assert said.startswith("Duration is beyond its margin, but this is not shown with targets without a movement")
    step = Step("CLPC: find out why targets have no movement")
    assert assessment_answer._recording_steps(MEASURED, [each]) == (step,)


def test_the_headline_index_is_tried_by_other_rules_and_named():
    """"duration (significant except ...)" was the mean duration, and the median that headed the page was not tried."""
    tried = [
        Sensitivity(words, index, "PCFr", 1.0, 0.3, p)
        for index, by in {"duration_median": (0.2, 0.3), "duration": (0.2, 0.01)}.items()
        for words, p in zip(("3 Hz", "6 Hz"), by, strict=True)
    ]
    found = SimpleNamespace(sensitivity=tried, indices=INDICES, confidence=0.95, is_registered=False)
    (verdict,) = _filter_verdicts(found)
    assert verdict.do == "Report the results by all of them: no analysis was registered before the data."
    found.is_registered = True
    assert _filter_verdicts(found)[0].do == "Report the result by the registered analysis."
    assert "mean duration (significant only with a low-pass of 6 Hz)" in verdict.text
    assert verdict.text.endswith("Median duration is not significant with any of them.")
    assert leading_index().tries_rules


def test_a_condition_has_one_form_of_its_name_on_the_first_screen(tmp_path):
    """"full accuracy: not transparent" stood above "full_accuracy: no"."""
    parts = tuple(AnswerPart(name, "no", "x") for name in ("full_accuracy", "speed"))
    page = Page("t", "k", answer=Answer("Is any?", "no", "full_accuracy: not transparent", parts=parts))
    html = write_page(tmp_path, page).read_text(encoding="utf-8")
    assert "full accuracy: <b>no" in html
    assert "full_accuracy" not in html


def test_the_people_who_would_show_a_change_beyond_its_margin_are_counted():
    """The step said "record more people" and not how many."""
    rng = np.random.default_rng(4)
    changes = {"duration": rng.normal(0.25, 0.18, 8), "vmax": rng.normal(0.0, 0.1, 8)}
    margins = dict.fromkeys(changes, Margin.of_ratio(0.1))
    found = certificate(changes, margins, estimand="pseudo-median")
    assert found.verdict == "cannot say"
    assert found.end_points["duration"].verdict == "beyond"
    assert 10 <= _people_needed_beyond(found) <= 20
    calm = certificate({name: 0.1 * values for name, values in changes.items()}, margins)
    assert _people_needed_beyond(calm) is None


def test_the_smallest_p_of_the_tests_against_control_is_that_of_equal_orders():
    for people, conditions in ((2, 4), (3, 4), (5, 3)):
        same = np.tile(np.arange(float(conditions)), (people, 1))
        names = tuple(map(str, range(conditions)))
        found = compare_conditions(same, names, "0")
        assert smallest_told_p(people, conditions) == pytest.approx(max(found.p_value, found.pair("0", names[-1])))


def two_end_points(changes):
    """Return the certificate of one condition with a margin of 10 % for each end point."""
    found = certificate(changes, dict.fromkeys(changes, Margin.of_ratio(0.1)), estimand="pseudo-median")
    points = {name: EndPoint(name, "rad", "10 %", Margin.of_ratio(0.1), True) for name in changes}
    return Certified("full_accuracy", found, points, len(changes["duration"]), None)


def test_one_rule_decides_a_condition_and_gives_its_number():
    """An interval that reached into the margin stood beside "not transparent", decided by a count of people."""
    each = two_end_points({"duration": np.where(np.arange(12) < 6, 0.6, 0.0) + 0.01 * np.arange(12)})
    # The count decides where the noise of movements is known to be small.
    own = replace(each.certificate, beyond={"duration": 0.11}, far={"duration": 0.01})
    each = replace(each, certificate=own)
    assert own.verdict == "not transparent"
    assert own.is_decided_by_people("duration")
    assert not replace(own, beyond={"duration": 0.01}).is_decided_by_people("duration")
    found = SimpleNamespace(certified=(each,), control="balance", participants=("p",) * 12, settling=())
    said = assessment_answer._decisions_text(found)
    # "(−24.9 to +33.1 %; p = 0.075)" was read as a confidence interval.
    assert said.startswith(
        "full_accuracy: not transparent, 6 of 12 people changed mean duration by more than 3 margins (beyond −24.9 or "
        "+33.1 %; p"
    )
    assert "interval" not in said
    assert said.endswith("Compared with balance, 12 people, margin −9.1 to +10.0 %.")


def test_a_certificate_asks_in_plain_words():
    each = two_end_points({name: 0.01 * np.arange(12) for name in ("duration", "vmax")})
    found = SimpleNamespace(certified=(each,), control="no_robot")
    assert assessment_answer._certificate_question(found) == (
        'Do people move under "full accuracy" as under "no robot" (transparent), with changes of mean duration and '
        "peak velocity within −9.1 to +10.0 %?"
    )


def test_excluded_movements_and_an_unstated_order_have_a_step_each():
    """Half of the movements were excluded, and the only step was to record more people."""
    allowed = SimpleNamespace(max_left_out=0.1, end_points={}, certificate=SimpleNamespace())
    found = SimpleNamespace(
        certified=(allowed,), movements=778, left_out={"lost": 777}, measured=(), exclusions=(), is_simulated=False,
        order=None,
    )  # fmt: skip
    (excluded,), (order,) = assessment_answer._exclusion_step(found), assessment_answer._order_step(found)
    assert excluded.text == (
        "Only to claim transparency: record again so that at most 10 % of movements are excluded; here 777 of 1,555 "
        "are, with gaps in the recorded position"
    )
    assert order.text.startswith("State in which order each person had the conditions")
    found.exclusions = ("movements back to the start",)
    assert assessment_answer._exclusion_step(found)[0].text == (
        "Only to claim transparency: change the task or the stated rule so that at most 10 % of movements are "
        "excluded; here 777 of 1,555 are, and more data under the same rule do not help"
    )
    found.left_out, found.is_simulated = {"lost": 7}, True
    assert assessment_answer._exclusion_step(found) == assessment_answer._order_step(found) == ()


def test_the_first_step_is_the_one_that_leads_to_an_answer(monkeypatch):
    """Recording again with fewer exclusions, which only a claim of transparency needs, was the first step."""
    each = two_end_points({name: 0.01 * np.arange(12) for name in ("duration", "vmax")})
    each = replace(each, certificate=replace(each.certificate, beyond={"duration": 0.2, "vmax": 0.2}))
    steps = {"_recording_steps": "people", "_order_step": "order", "_exclusion_step": "exclusions"}
    for name, text in steps.items():
        monkeypatch.setattr(assessment_answer, name, lambda *given, text=text: (Step(text),))
    for name in ("_decisions_text", "_certificate_question"):
        monkeypatch.setattr(assessment_answer, name, lambda found: "")
    for name in ("_numbers", "certificate_reasons"):
        monkeypatch.setattr(assessment_answer, name, lambda found: ("",))
    monkeypatch.setattr(assessment_answer, "_basis", lambda found: None)
    following = assessment_answer.certificate_answer(SimpleNamespace(certified=(each,))).next
    assert [step.text for step in following][:3] == ["people", "order", "exclusions"]


def test_movements_that_had_not_settled_are_counted_apart_from_excluded_ones():
    """"Never settled: 13.3 %" stood next to "3 excluded: not finished when the next target came"."""
    curves = {"FC": survival(np.ones(30), np.arange(30) > 3), "Ctrl": survival(np.ones(30), np.ones(30))}
    settling = [SimpleNamespace(condition=name, curve=curve) for name, curve in curves.items()]
    found = SimpleNamespace(settling=settling, left_out={})
    said = "had not settled when the next target came; they count as longer than seen (Kaplan-Meier)"
    assert unsettled_text(found) == f"4 of 30 movements in FC {said}"
    found.left_out = {"unfinished": 3}
    assert unsettled_text(found) == f"4 of 30 movements in FC, including excluded ones, {said}"
    assert reason_words("unfinished") == "too fast at their last sample to have an end point"
    assert unsettled_text(SimpleNamespace(settling=settling[1:], left_out={})) == ""


def test_a_change_of_which_only_a_bound_is_known_says_why(monkeypatch):
    """It said "95 % CI not known"."""
    change = PrimaryChange(422.0, np.nan, np.nan, "%", True)
    monkeypatch.setattr(assessment_answer, "known_changes", lambda found, name: {"FC": change})
    each = compared([[1.0, 2.0, 1.1, 0.9], [1.0, 3.0, 0.9, 1.2]])
    found = SimpleNamespace(
        assessed={leading_index().name: each}, confidence=0.95, study="s", control="Ctrl", participants=("a", "b"),
        settling=(),
    )  # fmt: skip
    said = plain_text(assessment_answer._changes_text(found))
    assert "FC at least +422 % (lower bound: some movements had not settled)" in said
