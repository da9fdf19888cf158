"""One result gives one answer: badge, sentence, numbers, interval, findings and commands never disagree.

The comparison is that of `python -m research.evidence pages`, which makes 200 results; here a few are made by default.
"""

import json
import re
import subprocess
import sys
from dataclasses import replace

import pytest
from research.evidence._answers import (
    compared_joint,
    contradictions,
    failing_next_commands,
    page_contradictions,
    write_joint,
)

from pellucid.start.proposal import QUESTION_ORDER
from pellucid.study.answer import (
    QUESTION_WORDS,
    Answer,
    Assumption,
    Basis,
    Step,
    spoilt,
    unanswered_message,
    with_assumed,
)
from pellucid.study.datasets.init import init
from pellucid.study.datasets.registry import names
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import run

FAST = {"joint": {"thorough": False}}
PLAIN = Answer("Does it hold, within 20 %?", "yes", "It errs by 3 %.", next=(Step("Make a controller", "export"),))


def compare(folder, seeds):
    made = [compared for seed in seeds if (compared := compared_joint(folder, seed)) is not None]
    assert {one.name: one.contradictions for one in made if one.contradictions} == {}
    return made


def test_simulated_joints_have_one_answer_each(tmp_path):
    made = compare(tmp_path, range(12))
    assert len({one.answer.verdict for one in made}) > 1


@pytest.mark.nightly
def test_two_hundred_simulated_joints_have_one_answer_each(tmp_path):
    made = compare(tmp_path, range(210))
    assert len(made) >= 200
    assert {one.answer.verdict for one in made} == {"yes", "no", "cannot say"}


@pytest.mark.nightly
@pytest.mark.parametrize("name", names())
def test_public_data_sets_have_one_answer_each(name, tmp_path, data_folder):
    study = init(tmp_path / name, name)
    found = run(study)
    found.save(study)
    assert list(contradictions(found)) == []


@pytest.mark.nightly
def test_the_command_ends_with_0_where_it_answers_and_its_next_commands_do(tmp_path):
    folders = [write_joint(tmp_path / f"joint{seed}", seed) for seed in range(6)]
    assert failing_next_commands(folders) == []


def test_a_yes_beside_a_larger_error_and_a_fitted_number_are_found_to_contradict(tmp_path):
    """The comparison itself can fail: an answer that was changed by hand contradicts what it rests on."""
    study = open_study(write_joint(tmp_path / "joint0", 0))
    found = run(study, "identify", **FAST)
    assert list(contradictions(found)) == []
    answer = found.answer
    (error, *rest) = answer.numbers
    worse = replace(answer, numbers=(replace(error, value=35.0), *rest))
    said = list(contradictions(replace(found, completed=worse)))
    assert any("yes, and the error is 35 %" in text for text in said)
    assert any("in its row" in text for text in said)
    fitted = replace(answer, numbers=(replace(error, id=f"{found.study}.headline.effort_error"), *rest))
    assert any("of what was fitted" in text or "in its row" in text for text in
               contradictions(replace(found, completed=fitted)))  # fmt: skip
    page = f'<p class="lead"><span class="badge">No</span> {answer.sentence}</p>'
    assert any("badge" in text for text in page_contradictions(found, page))


def test_a_default_that_scales_every_number_leaves_only_relative_numbers_to_say_yes():
    """A log in turns that was read as radians had a green yes without a word of the open question."""
    open_question = Assumption("position_unit", "rad", "In which unit?", is_scale=True)
    answer = with_assumed(PLAIN, (open_question, Assumption("worn", "no")))
    assert (answer.verdict, answer.is_answered) == ("cannot say", False)
    assert answer.sentence.startswith("No file states the scale of these figures; assumed: unit of the position = rad.")
    assert answer.based_on == ("Assumed, because no file states it: unit of the position = rad, robot worn = no.",)
    relative = with_assumed(replace(PLAIN, is_relative=True), (open_question,))
    assert (relative.badge, relative.is_answered) == ("Yes (scale not confirmed)", True)
    ending = "; no file states the scale of the parameters; assumed: unit of the position = rad"
    assert relative.sentence.endswith(ending)
    kept = with_assumed(PLAIN, (Assumption("worn", "no"),))
    assert kept.verdict == "yes"
    assert "worn = no" in kept.based_on[0]


def test_a_study_repeats_the_defaults_that_nobody_confirmed(tmp_path):
    folder = write_joint(tmp_path / "joint0", 0)
    path = folder / "study.toml"
    text = path.read_text(encoding="utf-8")
    plain = run(open_study(folder), "identify", **FAST)
    assert plain.answer.verdict == "yes"
    table = '[[assumed]]\nkey = "position_unit"\ntaken = "rad"\nquestion = "In which unit?"\nscale = true\n'
    path.write_text(text.replace("[rig]", f"{table}[rig]", 1), encoding="utf-8")
    found = run(open_study(folder), "identify", **FAST)
    assert found.answer.badge == "Yes (scale not confirmed)"
    assert "unit of the position = rad" in str(found)
    assert found.answer.next[0].name == "check"
    assert found.rows == plain.rows


def test_a_finding_that_the_figures_are_wrong_comes_first_and_ends_with_a_reason():
    answer = spoilt(PLAIN, "the fit failed")
    assert answer.sentence == (
        "Correct this first: the fit failed. Until then, the results do not describe the recordings. It errs by 3 %."
    )
    assert unanswered_message([PLAIN, answer]) == "cannot say: the fit failed."
    assert unanswered_message([PLAIN]) == ""


@pytest.mark.parametrize(
    ("basis", "said"),
    [
        (Basis(3, 7), "Based on 3 of 7 recordings, measured or simulated (not stated)."),
        (Basis(7, 7, judged="held-out segments", is_simulated=True),
         "Based on 7 recordings, simulated; numbers are of held-out segments."),
        (Basis(7, 7, judged="2 held-out recordings", is_simulated=False, held_out=2),
         "Based on 7 recordings, measured; numbers are of held-out data: 2 of 7 recordings."),
        (Basis(1, 1, parts=2, held_out=1),
         "Based on 1 recording in 2 parts, measured or simulated (not stated); numbers are of held-out data: 1 of 2 "
         "parts."),
        (Basis(38, 40, is_simulated=False, people=10), "Based on 38 of 40 recordings of 10 people, measured."),
        (Basis(2, 2, is_simulated=False, people=1), "Based on 2 recordings of 1 person, measured."),
        (Basis(1, 1, "participant", is_simulated=False), "Based on 1 participant, measured."),
        (Basis(2, 2, "model card", is_simulated=None), "Based on 2 model cards."),
    ],
)  # fmt: skip
def test_what_an_answer_is_based_on_counts_what_was_used(basis, said):
    assert basis.sentence == said


def test_results_json_keeps_the_answer_with_the_real_folder(tmp_path):
    study = open_study(write_joint(tmp_path / "joint 0", 0))
    found = run(study, "identify", **FAST)
    found.save(study)
    (told,) = json.loads(study.results_path.read_text(encoding="utf-8"))["answers"]
    assert (told["command"], told["procedure"], told["verdict"]) == ("identify", "joint", found.answer.verdict)
    command = next(step["command"] for step in told["next"] if step["command"])
    assert command == f"pellucid report '{study.folder}'"
    assert told["based_on"]["is_simulated"] is True


def test_the_command_says_in_one_line_why_it_cannot_say(tmp_path):
    folder = write_joint(tmp_path / "joint3", 3)  # its torque is noise
    done = subprocess.run([sys.executable, "-m", "pellucid", "identify", folder], capture_output=True, text=True)
    assert done.returncode == 1
    assert re.fullmatch(r"pellucid: cannot say: the fit failed: .*\.", done.stderr.splitlines()[-1])
    assert (folder / "results.json").is_file()
    assert "Next: pellucid check" in done.stdout


def test_every_question_has_plain_words():
    """An answer said "assumed: gear_turns = 1"."""
    assert set(QUESTION_WORDS) == set(QUESTION_ORDER)
