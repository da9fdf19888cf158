"""`compare`, `incident`, `plan` and the tiles of a session each end in one answer, which agrees with their figures."""

from dataclasses import replace

import numpy as np
import pytest
from test_incident_account import account

from pellucid.controllers.study.incident import IncidentAccount, account_table
from pellucid.controllers.study.incident_page import write_incident_page
from pellucid.live.session.running_indices import RunningVerdict
from pellucid.people.study.plan import _plan_answer
from pellucid.study.answer import Basis
from pellucid.study.procedures.compare import ComparedParameter, _answer, _half_widths, holm

CARDS = Basis(2, 2, "model card")
EXPERIMENTS = Basis(200, 200, "experiment", is_simulated=True)


def compared(differences, errors, values, level=0.95):
    """Rows of a comparison, as `compare` makes them."""
    difference, sd = np.asarray(differences, dtype=float), np.asarray(errors, dtype=float)
    from scipy.special import ndtr

    p = np.asarray(holm(2.0 * ndtr(-np.abs(difference / sd))))
    halves = _half_widths(sd, difference / sd, p, level)
    return tuple(
        ComparedParameter(f"p{i}", "N*m", a, a + d, s, d / s, float(pi), bool(pi < 1.0 - level), (d - h, d + h))
        for i, (a, d, s, pi, h) in enumerate(zip(values, difference, sd, p, halves, strict=True))
    )


@pytest.mark.parametrize("seed", range(40))
def test_an_interval_of_a_comparison_excludes_zero_exactly_where_its_test_finds_a_change(seed):
    rng = np.random.default_rng([50, seed])
    count = int(rng.integers(1, 8))
    errors = rng.uniform(0.01, 0.3, count)
    rows = compared(rng.normal(0.0, 3.0, count) * errors, errors, rng.uniform(0.5, 2.0, count))
    for row in rows:
        low, high = row.interval
        assert row.changed == (low > 0.0 or high < 0.0)
    answer = _answer(rows, 0.5, 0.95, ("A", "B"), CARDS)
    assert (answer.verdict == "yes") == any(row.changed for row in rows)
    assert (answer.reason == "") == (answer.verdict == "yes")
    assert all(row.name in answer.sentence for row in rows if row.changed)
    assert answer.next_command == "pellucid compare A B"


@pytest.mark.parametrize(
    ("error", "joint_p", "verdict", "reason"),
    [
        (0.01, 0.8, "no", "no parameter changed"),
        (0.01, 0.01, "cannot say", "changed together"),
        (0.6, 0.8, "cannot say", "smallest detectable change of every parameter exceeds 50 %"),
    ],
)
def test_a_comparison_that_would_have_missed_a_change_cannot_say(error, joint_p, verdict, reason):
    """It said that no parameter changed, however little the recordings showed."""
    rows = compared([0.2 * error, -0.1 * error], [error, error], [1.0, 1.0])
    answer = _answer(rows, joint_p, 0.95, ("A", "B"), CARDS)
    assert answer.verdict == verdict
    assert reason in answer.reason


@pytest.mark.parametrize(("kind", "verdict"), [("jump", "yes"), ("by hand", "yes"), ("healthy", "no")])
def test_an_incident_has_one_answer_on_page_json_and_terminal(kind, verdict, tmp_path):
    found = replace(account(kind), path="incident.bin")
    answer = found.answer
    assert answer.verdict == verdict
    assert (answer.reason == "") == (verdict == "yes")
    assert answer.next_command == "pellucid incident incident.bin --json"
    assert account_table(found)["answer"] == answer.table()
    page = write_incident_page(found, tmp_path).read_text(encoding="utf-8")
    assert f'class="badge">{answer.badge}<' in page
    shares = [number.value for number in answer.numbers]
    if found.acting is not None:
        assert shares == [found.acting.share]
    else:
        assert all(share < 1.0 for share in shares) or kind == "by hand"


def test_a_fault_whose_watch_was_not_beyond_is_not_explained(monkeypatch):
    found = account("jump")
    monkeypatch.setattr(IncidentAccount, "acting", None)
    assert found.answer.verdict == "cannot say"
    assert "no check of this fault" in found.answer.reason


def plan_rows(*needed, powers=()):
    names = ("none", "a quarter", "a half")
    return [(name, count, count, *powers[i : i + 1]) for i, (name, count) in enumerate(zip(names, needed, strict=True))]


def test_a_plan_says_whether_people_can_show_it():
    answer = _plan_answer(plan_rows(12, 18, ">128"), 0.9, None, EXPERIMENTS)
    assert (answer.verdict, [number.value for number in answer.numbers]) == ("yes", [12, 18])
    assert _plan_answer(plan_rows(">128", ">128", ">128"), 0.9, None, EXPERIMENTS).verdict == "no"


@pytest.mark.parametrize(("reached", "verdict"), [(93, "yes"), (90, "yes"), (71, "no")])
def test_a_plan_says_whether_the_number_decided_on_is_enough(reached, verdict):
    answer = _plan_answer(plan_rows(12, 18, 40, powers=(reached, 60, 20)), 0.9, 12, EXPERIMENTS)
    assert answer.verdict == verdict
    assert f"{reached} %" in answer.sentence


def test_a_plan_that_is_not_enough_ends_with_one_that_is():
    few = _plan_answer(plan_rows(16, 18, 40, powers=(71, 60, 20)), 0.9, 12, EXPERIMENTS).in_folder("people")
    assert few.next_command == "pellucid plan people --participants 16"
    enough = _plan_answer(plan_rows(12, 18, 40, powers=(93, 60, 20)), 0.9, 12, EXPERIMENTS).in_folder("people")
    assert "Record these people" in enough.following[0]
    none = _plan_answer(plan_rows(">128", ">128", ">128"), 0.9, None, EXPERIMENTS)
    assert "wider margins" in none.following[0]


@pytest.mark.parametrize(
    ("said", "verdict"),
    [
        ("transparent", "yes"),
        ("not transparent (post hoc)", "no"),
        ("cannot say yet", "cannot say"),
    ],
)
def test_a_tile_of_a_session_is_the_answer_of_its_condition(said, verdict):
    answer = RunningVerdict("full_control", said, 4, 3 if verdict == "cannot say" else None).answer
    assert answer.verdict == verdict
    assert answer.sentence.startswith(f"full control: {said}")
    assert (answer.reason == "") == (verdict == "yes")
    assert ("about 3 more people" in answer.sentence) == (verdict == "cannot say")
