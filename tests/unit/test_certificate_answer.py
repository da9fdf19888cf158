"""The answer of a certificate lists its conditions in one sentence, and says "cannot say" once."""

from types import SimpleNamespace

from pellucid.people.study import assessment_answer
from pellucid.study.answer import Answer, Step, unanswered_message


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
    monkeypatch.setattr(assessment_answer, "_recording_step", lambda each: Step("Record more movements"))
    for part, made in {"_changes_text": "", "_numbers": (), "_basis": None}.items():
        monkeypatch.setattr(assessment_answer, part, lambda found, made=made: made)
    answer = assessment_answer.certificate_answer(SimpleNamespace(certified=certified))
    assert answer.verdict == "cannot say"
    assert answer.said.strip() == "speed: cannot say (post hoc); full accuracy: not transparent."
    assert unanswered_message([answer]) == "cannot say: speed: The interval is too wide."


def test_the_certificate_does_not_name_itself_as_the_next_step():
    record = Step("Record more movements")
    answer = Answer("Is it transparent?", "yes", "yes", next=(assessment_answer.CERTIFICATE_STEP, record))
    following = assessment_answer.reviewed_answer(SimpleNamespace(answer=answer)).next
    assert [step.name for step in following] == ["paper", ""]
    assert following[1] == record


def test_the_basis_counts_the_movements_that_were_excluded():
    found = SimpleNamespace(participants=("a",), without={}, movements=778, left_out={"marker": 700, "label": 77})
    assert "778 of 1,555 movements" in assessment_answer._basis(found).sentence
    found.left_out = {}
    assert "numbers are of 778 movements" in assessment_answer._basis(found).sentence
