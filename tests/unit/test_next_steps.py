"""What to do next improves an answer that is not yes, and names nothing that is done already."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pellucid.arm.study import tree_result
from pellucid.emg.study import muscle_channels
from pellucid.emg.study.emg_force.emg_force_table import EmgForceTable
from pellucid.emg.study.emg_force.find_emg_force import (
    EmgForceResult,
    force_answer,
    needed_people,
    summarise_people,
)
from pellucid.emg.study.emg_torque import calibrate
from pellucid.models.estimates import Verdict
from pellucid.orthosis.study.hinge import identify_hinge
from pellucid.orthosis.study.transfer_function import identify_transfer
from pellucid.people.study.statements import rule_words
from pellucid.study.answer import Answer, AnswerPart, Basis, Step, answer_of_parts, next_lines
from pellucid.study.procedures import complete_answer as module
from pellucid.study.procedures.findings import improving_steps
from pellucid.study.procedures.result import Result

RECORD = Step("Record more motion")


@pytest.mark.parametrize(("verdict", "name"), [("yes", "paper"), ("no", ""), ("cannot say", "")])
def test_a_paper_follows_only_a_good_result(verdict, name):
    """After "no", the only arrow of a report was to write a paper."""
    answer = answer_of_parts("Is it good?", "It is.", [AnswerPart("a", verdict, "why")], improve=(RECORD,))
    assert [step.name for step in answer.next] == [name]
    assert (answer.next == (RECORD,)) == (verdict != "yes")


def test_causes_and_advice_of_findings_say_what_improves_a_model():
    found = (
        Verdict("good", "It fits.", "Do nothing."),
        Verdict("warning", "It is warm.", "Let it warm up."),
        Verdict("note", "Backlash of 1 mrad explains 30 % of the residual: play in the gear?", finding="causes"),
    )
    texts = [step.sentence for step in improving_steps(found, RECORD)]
    assert texts == [
        "Look for this cause: Backlash of 1 mrad explains 30 % of the residual: play in the gear?", "Let it warm up.",
    ]  # fmt: skip
    assert improving_steps(found[:1], RECORD) == (RECORD,)


def test_only_analyses_without_a_result_are_named(monkeypatch):
    """Co-contraction named force, and force named co-contraction."""
    procedures = [SimpleNamespace(name=name, command=name) for name in ("onset", "cocontraction", "force", "synergies")]
    monkeypatch.setattr(module, "asked", lambda study: procedures)
    monkeypatch.setattr(Result, "kept", lambda study, each: object() if each.name == "cocontraction" else None)
    found = SimpleNamespace(command="force")
    assert list(module._without_result(None, found, ())) == ["synergies", "onset"]
    assert list(module._without_result(None, found, ("onset", "synergies"))) == []
    assert list(module._without_result(None, SimpleNamespace(command="other"), ())) == []


def test_advice_after_a_no_ends_with_the_command_that_repeats_the_analysis(monkeypatch):
    """A page said what to record, and no command followed."""
    monkeypatch.setattr(module, "asked", lambda study: [])
    found = SimpleNamespace(command="identify", flaw="")
    advice, export = Step("Record longer"), Step("Export a controller", "export")
    for verdict, steps, names in (
        ("no", (advice,), ["", "report", "identify"]),
        ("yes", (advice,), ["", "report"]),
        ("no", (advice, export), ["", "export", "report"]),
    ):
        answer = Answer("?", verdict, "It is so.", next=steps)
        assert [step.name for step in module._steps(None, found, answer, ())] == names


def test_a_page_does_not_name_other_analyses_twice():
    further, own = Step(module.FURTHER_TEXT, "emg force"), Step("Draw the page", "report")
    assert module.without_further(Answer("?", "yes", "It is.", next=(further, own))).next == (own,)


def test_a_terminal_prints_steps_in_words_up_to_the_first_command():
    steps = (Step("Record `a`"), Step("Check", "check", folder="s"), Step("Draw", "report", folder="s"))
    assert next_lines(steps) == ("Next: Record a.", "Next: pellucid check s")


def test_faults_of_several_recordings_are_found_once_for_all_procedures(monkeypatch):
    calls = []
    monkeypatch.setattr(muscle_channels, "per_trial_faults", lambda streams: [])
    monkeypatch.setattr(muscle_channels, "exchanged_faults", lambda streams: calls.append(streams) or ["exchanged"])
    study, streams = SimpleNamespace(found={}), [SimpleNamespace(name="a", path="a.csv", channels={"emg.x": 0, "q": 0})]
    for channels in ({"emg.x": 0, "q": 0}, {"emg.x": 0, "time": 0}):
        streams[0].channels = channels
        assert muscle_channels.session_faults(study, streams) == ["exchanged"]
    assert len(calls) == 1


def force_result(low, high, enveloped=()):
    rng = np.random.default_rng(1)
    table = EmgForceTable(agonists={"push": "triceps"})
    each = {f"P{i}": float(r) for i, r in enumerate(rng.uniform(low, high, 8))}
    found = (replace(summarise_people("push", "triceps", table, each), is_spoiled="triceps" in enveloped),)
    return EmgForceResult(
        study="s", headline="", tables=(), rows=(), verdicts=(), cards={}, checksums={}, found=found,
        enveloped=dict.fromkeys(enveloped, 4),
    )  # fmt: skip


def test_envelopes_in_the_place_of_raw_emg_are_named_where_they_prevent_an_answer():
    """A correlation with a spoilt envelope said no of the muscle."""
    answer = force_answer(force_result(0.1, 0.4, enveloped=("triceps", "biceps")))
    assert (answer.verdict, answer.reason) == ("cannot say", "triceps in push: an envelope, filtered as raw EMG")
    (step,) = answer.next
    assert step.text == (
        "Record raw EMG, or use these envelopes for co-contraction and force only and state unit 1 for them in "
        "study.toml: triceps (4 recordings)"
    )
    (check,) = force_answer(force_result(0.1, 0.4)).next
    assert "Check the electrodes of triceps" in check.text
    assert force_answer(force_result(0.9, 0.95)).next[0].name == "paper"


def test_an_interval_on_both_sides_of_the_bound_needs_more_people():
    """It advised more people, without their number."""
    result = force_result(0.3, 0.99)
    (step,) = force_answer(result).next
    needed = needed_people(result.found[0])
    assert step.text == f"Record more people, for a power of 80 %: {needed} in all for triceps"
    z, limit = np.arctanh(result.found[0].each), np.arctanh(0.5)
    rng, decided = np.random.default_rng(3), 0
    for _ in range(2000):
        own = np.tanh(rng.normal(z.mean(), z.std(ddof=1), needed))
        each = summarise_people("push", "triceps", EmgForceTable(agonists={"push": "triceps"}), dict(enumerate(own)))
        decided += each.low > 0.5 if z.mean() > limit else each.high < 0.5
    assert 0.78 < decided / 2000 < 0.86
    even = replace(result.found[0], each=tuple(np.tanh(np.linspace(limit - 0.4, limit + 0.4, 8))))
    assert needed_people(even) is None
    (step,) = force_answer(replace(result, found=(even,))).next
    assert step.text == "triceps: even 200 people would not give a clear answer; check the electrodes and the load cell"


def test_a_muscle_of_two_tasks_is_named_with_its_task():
    """The step named the muscle twice, and no task."""
    result = force_result(0.3, 0.99)
    both = (result.found[0], replace(result.found[0], task="lift"))
    (step,) = force_answer(replace(result, found=both)).next
    assert step.text.endswith(" in all for triceps in push, triceps in lift")


def test_too_few_trials_say_how_many_more_to_record():
    """It said "too few trials ... Fit 3 or more"."""
    chosen = SimpleNamespace(what="knee", conditions=2, fitted_coverage=None)
    found = SimpleNamespace(chosen={"knee": chosen}, sessions={})
    (said,) = calibrate._invalid_band_sentences(found)
    assert said == "The prediction band is based on too few fitted trials: knee, 2. Record 1 more trial."


@pytest.mark.parametrize(
    ("recordings", "trials", "said"),
    [
        (("a",), (), "one held-out recording"),
        (("a", "b"), (), "2 held-out recordings"),
        (("",), ("t1", "t2", "t3"), "3 trials by cross-validation"),
    ],
)
def test_the_data_of_a_torque_error_are_counted(recordings, trials, said):
    """It said "numbers are of held-out data"."""
    judged = [SimpleNamespace(recording=name, by_trial=dict.fromkeys(trials)) for name in recordings]
    result = SimpleNamespace(chosen=[SimpleNamespace(judged=judged)], checksums={})
    assert calibrate._judged_words(result) == said


def test_a_transfer_function_names_the_recordings_that_it_does_not_predict():
    def fit(inside):
        return SimpleNamespace(responses=[SimpleNamespace(fit=inside)])

    held = {"slow": SimpleNamespace(fit=40.0), "late": SimpleNamespace(fit=20.0)}
    fits = {"slow": fit(45.0), "late": fit(60.0)}
    found = SimpleNamespace(fits=fits, heldout=held, refused={}, unevaluated={}, notes={"slow": ("3 outliers",)})
    texts = [step.text for step in identify_transfer._improving(found, ["slow", "late"])]
    assert len(texts) == 2
    assert "poles" in texts[0]
    assert "slow" in texts[0]
    assert "late" not in texts[0]
    assert "late" in texts[1]

    # It advised more poles for a recording whose repeats fitted to 96 % with the same order.
    held |= {name: SimpleNamespace(fit=96.0) for name in "abc"}
    fits |= {name: fit(96.0) for name in "abc"}
    first, second = (step.text for step in identify_transfer._improving(found, ["slow", "late"]))
    assert first.startswith("Look at slow first: 3 of 5 recordings fit with the same order, up to 96 %.")
    assert "(excluded so far: slow: 3 outliers)" in first
    assert "poles" not in first
    assert second == texts[1]


def test_the_question_of_a_transfer_function_names_its_input_and_output():
    """It asked whether "the transfer functions predict held-out data"."""
    single = {"a": SimpleNamespace(responses=[SimpleNamespace(fit=90.0)])}
    found = SimpleNamespace(
        heldout={"a": SimpleNamespace(fit=88.0), "b": SimpleNamespace(fit=84.0)}, refused={}, unevaluated={},
        single=single, checksums={"a": "", "b": ""}, channels=("torque", "position"), units=("N*m", "rad"), fits=single,
    )  # fmt: skip
    answer = identify_transfer.transfer_answer(found)
    assert answer.question.startswith(
        "Do transfer functions from the torque (input) to the angle (output) predict the angle of held-out data"
    )
    assert "(84.0 to 88.0 %, median 86.0 %)" in answer.sentence


def test_the_question_of_a_hinge_names_what_measures_its_angle():
    """It asked "Is the angle of the hinge that of the reference?", of "the seconds after the calibration"."""
    trial = SimpleNamespace(name="a", scores={"offline": SimpleNamespace(rms=0.02)})
    answer = identify_hinge.hinge_answer(SimpleNamespace(trials=[trial], checksums={"a": ""}))
    assert answer.question == "Do two IMUs measure the hinge's angle within 5 deg RMS of the reference?"
    assert answer.basis.sentence.endswith("the seconds after the calibration, which were not fitted.")


def test_rules_for_movements_are_spelled_out():
    """It said "(not with 2.5 % and 10 %)"."""
    assert rule_words("2.5 %") == "a speed threshold of 2.5 %"
    assert rule_words("8 Hz") == "a low-pass of 8 Hz"
    assert rule_words("first rest") == "an end of movements at the first rest"


def test_a_result_without_a_question_of_its_own_is_improved_by_its_warnings():
    found = Result(
        study="s", headline="It is so.", tables=(), rows=(), cards={}, checksums={},
        verdicts=(Verdict("warning", "It is warm.", "Let it warm up."),),
    )  # fmt: skip
    assert [step.text for step in found.answer.next] == ["Let it warm up."]


@pytest.mark.parametrize(
    ("judged", "names", "said"),
    [
        ("heldout", ("a",), "one held-out recording"),
        ("heldout", ("a", "b"), "2 held-out recordings"),
        ("segments_out", (), "13 held-out segments (cross-validation)"),
        ("fitted", (), "fitted recordings"),
    ],
)
def test_the_data_of_a_robots_errors_are_counted(judged, names, said):
    """It said "numbers are of held-out recordings"."""
    traces = [SimpleNamespace(recording=name, use="validate") for name in names for _ in range(2)]
    assert tree_result._judged_words(SimpleNamespace(judged=judged, traces=traces, segments=13)) == said


@pytest.mark.parametrize(
    ("answers", "begins"),
    [
        ({"knee": "worth it"}, None),
        ({"knee": "not worth it", "ankle": "worth it"}, "Angles alone may do for knee: EMG adds nothing there. "),
        ({"knee": "cannot say"}, "EMG adds to angles where"),
    ],
)
def test_angles_alone_are_named_where_emg_adds_nothing(answers, begins):
    worth = [SimpleNamespace(what=what, worth=SimpleNamespace(answer=answer)) for what, answer in answers.items()]
    steps = calibrate._worth_steps(SimpleNamespace(worth=worth))
    assert [step.text.startswith(begins) for step in steps] == ([True] if begins else [])


@pytest.mark.parametrize(
    ("stated", "counted"),
    [(Basis(3, 3, judged="held-out data: the last 33 % of each recording"), 0), (Basis(3, 3, held_out=2), 1)],
)
def test_held_out_recordings_are_counted_where_the_numbers_are_of_them(monkeypatch, stated, counted):
    """The words "held-out data" of the last third of each recording were replaced by a number of recordings."""
    names = {"a": "fit", "b": "fit", "c": "validate"}
    study = SimpleNamespace(recordings=lambda: [SimpleNamespace(name=name, use=use) for name, use in names.items()])
    monkeypatch.setattr(module, "count_recordings", lambda study, used: Basis(len(used), len(names)))
    basis = module._counted(study, SimpleNamespace(checksums=dict.fromkeys(names, "")), stated, ())
    assert (basis.held_out, basis.judged) == (counted, stated.judged)
