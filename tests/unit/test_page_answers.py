"""A page answers first: badge, sentence and figure, what to do, then evidence that is folded, then notes by kind."""

import re
import shutil
from dataclasses import replace
from types import SimpleNamespace

import fabricate
import numpy as np
import pytest
from matplotlib.figure import Figure

from pellucid.arm.study.joint_answers import answer_joints
from pellucid.joint.fit.headline_choice import HeadlineChoice
from pellucid.joint.study import joint_answer as module
from pellucid.joint.study.joint_answer import crossed_error_of, error_interval_of
from pellucid.joint.study.joint_figures import friction, heldout, residuals
from pellucid.joint.study.joint_page import _simulated, answer_figure
from pellucid.joint.study.joint_page import page as joint_page
from pellucid.joint.study.joint_result import complete_result, rows_of
from pellucid.models.estimates import Verdict
from pellucid.study.answer import (
    FOLDER,
    REPEAT_TEXT,
    Answer,
    AnswerPart,
    Assumption,
    Basis,
    Step,
    answer_of_findings,
    needed_of_parts,
    verdict_of_parts,
    with_assumed,
)
from pellucid.study.drawing.drawing import Drawing, draw
from pellucid.study.pages.forest import Estimate, Row, Table, forest
from pellucid.study.pages.page import MAX_LEAD_CHARACTERS, Page, Section, without_drawing, write_page
from pellucid.study.pages.quantities import percent, typeset_sentence, value_and_half_interval
from pellucid.study.pages.values import Value, marked_up, plain_text
from pellucid.study.procedures.run import _one_page
from pellucid.study.procedures.study_page import study_page
from pellucid.study.recorded_motions import computed_effort

VALUE = re.compile(r'<data value="([^"]+)" data-id="([^"]+)">([^<]+)</data>')


def drawing(name="one", height=3.0):
    figure = Figure(figsize=(10.4, height))
    figure.subplots().plot([0.0, 1.0], [0.0, 1.0])
    return Drawing(name, figure, f"The figure {name}, which shows something to somebody.")


def answered(tmp_path, **changes):
    answer = Answer("Does it hold?", "yes", "It errs by 3 %.", next=(Step("Call", line="a b"),))
    made = Page("t", "k", answer=answer, figure=drawing())
    return write_page(tmp_path, replace(made, **changes)).read_text(encoding="utf-8")


def test_badge_sentence_and_figure_come_before_everything_else(tmp_path):
    text = answered(tmp_path, sections=(Section("a", "Evidence", ("More.",)),), verdicts=(("warning", "Mind this."),))
    order = ["Does it hold?", ">Yes</span>", "It errs by 3", 'id="fig-one"', "<code>a b</code>", "Mind this.", "More."]
    places = [text.index(part) for part in order]
    assert places == sorted(places)


def test_a_warning_is_no_next_step(tmp_path):
    text = answered(tmp_path, verdicts=(("warning", "Mind this."),))
    following = text.partition('id="next"')[2].partition("</div>")[0]
    assert "<code>a b</code>" in following
    assert "Mind this." not in following


def test_what_to_do_next_stands_on_the_first_screen(tmp_path):
    """It stood below the parameters and the warnings, 1,100 px from the top."""
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = shutil.which("chromium") or pytest.skip("no browser: chromium is not installed")
    answer = Answer(
        "Does it hold?", "no", "It errs by 3 % of the effort. " * 12, "another reason",
        tuple(AnswerPart(f"joint {i}", "no", "it errs") for i in range(8)), basis=Basis(3, 7),
        assumed=tuple(Assumption(f"key_{i}", "a default") for i in range(9)),
        next=(Step("Record again"), Step("Then repeat", line="pellucid try log.csv")),
    )  # fmt: skip
    table = Table(("a", "b"), tuple(Row((str(i), "c")) for i in range(12)))
    summary = (Section("parameters", "Parameters", tables=(table,)),)
    warnings = tuple(("warning", f"Mind this, number {i}.") for i in range(3))
    write_page(tmp_path, Page("t", "k", answer=answer, figure=drawing(height=6.0), summary=summary, verdicts=warnings))
    with playwright.sync_playwright() as browsers:
        browser = browsers.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto((tmp_path / "index.html").as_uri())
        ends = page.evaluate("[...document.querySelectorAll('.step')].map(one => one.getBoundingClientRect().bottom)")
        browser.close()
    assert len(ends) == 2
    assert max(ends) <= 900


@pytest.mark.parametrize(
    ("said", "shown"), [("It errs by 3 %.", "Reason: No file is sound."), ("No file is sound: 3 of 3 fail.", "")]
)
def test_an_answer_other_than_yes_has_its_reason_once(tmp_path, said, shown):
    answer = Answer("Does it hold?", "cannot say", said, "no file is sound")
    page = Page("t", "k", answer=answer)
    assert page.unsaid_reason == shown
    text = write_page(tmp_path, page).read_text(encoding="utf-8").partition("<body>")[2]
    assert text.casefold().count("no file is sound") == 1
    assert not Page("t", "k", answer=replace(answer, verdict="yes")).unsaid_reason


def test_a_reason_that_is_cut_as_the_sentence_is_stands_once():
    """The first screen showed both, because only the sentence had been cut before the two were compared."""
    long = "; ".join(f"channel {i} (an envelope, not raw EMG)" for i in range(20))
    answer = Answer("May it be used?", "no", f"Unsound: {long}.", f"unsound: {long}")
    assert not Page("t", "k", answer=answer).unsaid_reason


def test_every_part_shows_the_number_of_its_verdict_once(tmp_path):
    """A second joint was "yes" without a number on the first screen."""
    parts = (
        AnswerPart("knee", "no", "11.5 N*m (R² 0.758), mean over 3 trials"),
        AnswerPart("ankle", "yes", "6.8 N*m (R² 0.948); required 0.8"),
        AnswerPart("hip", "cannot say", "no torque was recorded"),
        AnswerPart("EMG", "no", "gain in R² +0.02, 95 % interval 0 to +0.04; required gain 0.05"),
    )
    answer = Answer("Is it so?", "no", "It is not.", "knee: 11.5 N*m (R² 0.758), mean over 3 trials", parts)
    text = write_page(tmp_path, Page("t", "k", answer=answer)).read_text(encoding="utf-8").partition("<body>")[2]
    text = text.replace("\N{NO-BREAK SPACE}", " ")
    assert "ankle: <b>yes</b>, 6.8 N·m (R² 0.948)</li>" in text
    assert "hip: <b>cannot say</b></li>" in text
    assert "EMG: <b>no</b>, gain in R² +0.02, 95 % interval 0 to +0.04</li>" in text
    assert text.count("11.5 N·m") == 1


def test_what_does_not_fit_is_folded(tmp_path):
    table = Table(("a",), tuple(Row((str(i),)) for i in range(60)))
    sections = tuple(Section(f"s{i}", f"Part {i}", tables=(table,)) for i in range(3))
    text = answered(tmp_path, sections=(Section("first", "First", ("Short.",)), *sections))
    assert re.findall(r'<details class="section"( open)?>', text) == [" open", "", "", ""]


def test_notes_stand_last_by_kind_and_those_on_files_after_all_others(tmp_path):
    verdicts = (
        ("warning", "One."), ("warning", "Two."), ("warning", "Three."), ("warning", "Four."),
        ("note", "a.csv, channel time: found jitter"), ("note", "A remark."), ("good", "It holds."),
    )  # fmt: skip
    text = answered(tmp_path, verdicts=verdicts, sections=(Section("a", "Evidence", ("More.",)),))
    order = ["Three.", "More.", "Four.", "Remarks", "A remark.", "What is sound", "It holds.", "Notes on files"]
    order.append("a.csv")
    places = [text.index(part) for part in order]
    assert places == sorted(places)


def test_a_long_headline_goes_on_below_the_first_screen():
    made = Page("t", "k", "It errs by 3 %. " + "This sentence follows it and is rather long indeed. " * 8)
    assert len(made.lead) <= MAX_LEAD_CHARACTERS
    assert made.lead.endswith(".")
    assert f"{made.lead} {made.detail}".split() == made.headline.split()


def test_a_value_is_marked_with_the_id_of_its_row_through_every_sentence():
    value = Value("my_study.headline.heldout.effort_error", -0.0123, "−0.0123")
    text = typeset_sentence(f"an error of {value} N*m & more_words")
    assert plain_text(text) == "An error of −0.0123\xa0N·m & more words"
    found = VALUE.search(marked_up(text))
    assert found.groups() == ("-0.0123", value.id, "−0.0123")
    assert "&amp;" in marked_up(text)


@pytest.fixture(scope="module")
def joint(tmp_path_factory):
    """A joint's result, its page, and the page's text; drawn once for all tests."""
    folder, fit = tmp_path_factory.mktemp("joint"), fabricate.fit()
    made = joint_page(fabricate.study(folder / "bench", fit), fit)
    return SimpleNamespace(fit=fit, page=made, text=write_page(folder / "page", made).read_text(encoding="utf-8"))


def test_one_number_has_one_value_on_the_page_of_a_joint_and_in_its_results(joint):
    stored = {row.id: row.value for row in rows_of(joint.fit)}
    found = VALUE.findall(joint.text)
    assert len(found) > 2 * len(joint.fit.headlined.estimate.parameters)
    assert len({(name, shown) for _, name, shown in found}) == len({name for _, name, _ in found})
    for number, name, _ in found:
        assert float(number) == stored[name]


def test_an_effort_that_drives_the_simulation_has_no_error(joint):
    """A column of zeros stood where every simulation is in open loop."""
    family = joint.fit.simulated
    open_only = {
        method: [s for s in made if s.mode == "openloop"] for method, made in family.simulations.items()
    }
    assert "Force (%)" in _simulated(joint.fit, family).heads
    table = _simulated(joint.fit, replace(family, simulations=open_only))
    assert table.rows
    assert "Force (%)" not in table.heads


def test_tile_sentence_and_table_tell_the_chosen_estimators_error(joint):
    error = percent(joint.fit.headlined.heldout_effort_error)
    shown = [s for _, name, s in VALUE.findall(joint.text) if name.endswith("headline.heldout.effort_error")]
    assert len(shown) >= 2
    assert set(shown) == {error}


def test_a_joint_says_whether_it_predicts(joint, tmp_path):
    wrong = any(v.kind == "wrong" for v in joint.fit.verdicts)
    best = joint.fit.headlined
    good = best.heldout_effort_error <= 20.0 and best.heldout_r2 >= 0.8
    assert wrong or joint.page.answer.verdict == ("yes" if good else "no")
    assert "<animate" in joint.page.figure.svg
    fit = fabricate.fit(heldout=0, samples=400)
    page = joint_page(fabricate.study(tmp_path / "bench", fit), fit)
    assert (page.answer.verdict, page.answer.reason) == ("cannot say", "no recording was held out")
    assert "<animate" in page.figure.svg


def test_a_joint_without_a_held_out_recording_is_judged_on_stretches_left_out_in_turn():
    """They were not fitted either, so that the question is answered; the next step is to hold a recording out."""
    fit = replace(fabricate.fit(heldout=0, samples=400), crossed_error=(7.5, 0.97))
    answer = fit.answer
    assert (answer.verdict, answer.is_answered) == ("yes", True)
    assert "of segments of the fitted recordings (cross-validation) with an error of 7.50 %" in answer.sentence
    assert "use = " in answer.next[0].sentence
    assert replace(fit, crossed_error=(27.5, 0.97)).answer.verdict == "no"


def test_a_joint_names_the_recordings_beyond_the_bound():
    held = [SimpleNamespace(split="heldout", recording=f"r{i}", error=error) for i, error in enumerate((8.0, 29.3))]
    fit = SimpleNamespace(
        headlined=SimpleNamespace(predictions=held, heldout_effort_error=11.4, heldout_r2=0.98), best="load",
        effort_unit="N*m", verdicts=(), study="s", joint="servo", held_out=(), checksums={"r0": "", "r1": ""},
        families={"load": None}, computed="", error_interval=None,
    )  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "by_recording", lambda held: [[each] for each in held])
        patch.setattr(module, "pooled_error", lambda group: group[0].error)
        said = module.joint_answer(fit).sentence
    assert said.endswith("an error of 11.4 % over all of them (8.00 to 29.3 % by recording; above 20 %: r1).")


WIDE = Verdict(
    "warning", "Wide confidence intervals: load friction ± 90 % (0.35 ± 0.31).",
    "Record with and without a known mass.", finding="wide_interval",
)  # fmt: skip


def predicting(errors=(5.0, 5.0, 5.0), held=10.0, **changes):
    """Return a made-up fit whose model predicts, with its `errors` [%] in the held-out recordings."""
    fit = fabricate.fit(heldout=len(errors), samples=400, effort_unit=changes.pop("effort_unit", None))
    family, single = fit.families[fit.best], {f"trial_{i + 1}": error for i, error in enumerate(errors)}
    made = tuple(
        replace(p, predicted=(1.0 + 0.01 * single.get(p.recording, 5.0)) * p.effort) for p in family.predictions
    )
    family = replace(family, predictions=made, heldout_effort_error=held, heldout_r2=0.96, fitted_effort_error=9.46)
    return replace(fit, families={**fit.families, fit.best: family}, **changes)


def test_what_a_controller_lacks_is_recorded_before_it_is_exported():
    """The next step after yes was the controller, although load friction was known to ± 90 %."""
    record, export = predicting(verdicts=(WIDE,)).answer.next
    assert record.sentence == (
        "Before a controller is used, record with and without a known mass (wide confidence intervals: load "
        "friction ± 90 %)."
    )
    assert export.name == "export"
    assert predicting(verdicts=(replace(WIDE, kind="note"),)).answer.next == (export,)


def test_a_recording_beyond_the_bound_is_named_before_a_controller():
    answer = predicting((5.0, 30.0, 5.0)).answer
    assert answer.verdict == "yes"
    assert answer.next[0].text.startswith("Find what differs in trial_2 (30.0 %, held out): a payload")
    assert "(5.00 to 30.0 % by recording; above 20 %: trial_2)" in answer.sentence
    assert "(5.00 to 15.0 % by recording, worst trial_2)" in predicting((5.0, 15.0)).answer.sentence
    assert "(5.00 to 6.00 % by recording)" in predicting((5.0, 6.0)).answer.sentence


def test_the_error_of_a_single_held_out_recording_has_an_interval_and_asks_for_another_recording():
    """Yes stood for a number whose interval no page had, and the only step was the controller."""
    fit = predicting((5.0,))
    family, rng = fit.families[fit.best], np.random.default_rng(2)
    noisy = [replace(p, predicted=p.effort + 0.1 * rng.standard_normal(len(p.effort))) for p in family.predictions]
    fit = replace(fit, families={fit.best: replace(family, predictions=tuple(noisy))})
    answer = replace(fit, error_interval=error_interval_of(fit)).answer
    (low, high), value = answer.numbers[0].interval, answer.numbers[0].value
    assert low < value < high
    assert f"error of {percent(value)} % (95 % CI {percent(low)} to {percent(high)} %, R² " in answer.sentence
    first, second = answer.next
    assert first.text == "Record a second recording to hold out: the verdict rests on a single one"
    assert second.name == "export"


def test_a_bound_that_the_interval_covers_is_said_to_be_uncertain():
    """Yes, 20.0 %, was as certain as 5 %."""
    fit = predicting((5.0,), 17.0)
    answer = replace(fit, error_interval=(14.0, 21.0)).answer
    assert "(95 % CI 14.0 to 21.0 %, R² 0.960), just within 20 % and uncertain" in answer.sentence
    assert answer.badge == "Yes (uncertain)"
    unscaled = with_assumed(answer, (Assumption("units", "rad", is_scale=True),))
    assert unscaled.badge == "Yes (uncertain, scale not confirmed)"
    assert [step.text for step in answer.next if step.name == "export"] == [
        "Export a controller once the confidence interval of the error ends at or below 20 %"
    ]
    answer = replace(fit, error_interval=(14.0, 19.0)).answer
    assert "just within" not in answer.sentence
    assert answer.badge == "Yes"


def test_a_long_recording_that_was_fitted_in_pieces_has_an_interval():
    """It had none: predictions are of recordings, and cross-validated residuals of their pieces."""
    fit = fabricate.fit(heldout=0, samples=400)
    family, rng = fit.families[fit.best], np.random.default_rng(3)
    fitted = family.predictions[:1]
    residual = 0.1 * rng.standard_normal(len(fitted[0].effort))
    whole, cut = (
        replace(fit, families={fit.best: replace(family, predictions=fitted, crossed=crossed)})
        for crossed in ((residual,), tuple(np.array_split(residual, 3)))
    )
    assert error_interval_of(whole) == error_interval_of(cut) is not None
    assert crossed_error_of(whole) == crossed_error_of(cut)


def test_a_recording_with_a_number_keeps_its_name():
    """The answer named "lift and drop kp100", the step lift_and_drop_kp100."""
    assert typeset_sentence("Above: lift_and_drop_kp100, stick_slip") == "Above: lift_and_drop_kp100, stick slip"


def test_an_effort_that_is_computed_is_not_said_to_be_measured():
    """A drive's voltage was recorded, and its torque was "measured"."""
    assert computed_effort(["torque"], "N*m") == computed_effort(["current"], "A") == ""
    source = computed_effort(["voltage"], "N*m")
    basis = replace(predicting(computed=source).answer.basis, is_simulated=False)
    assert "measured (torque computed from the drive's voltage)" in basis.sentence
    drawn = answer_figure(predicting(computed=source))
    assert "its effort: torque computed from the drive's voltage" in drawn.caption
    assert "measured" not in drawn.caption


def test_a_simulated_effort_is_not_said_to_be_measured():
    fit = replace(predicting(computed="torque computed from the drive's current"), is_simulated=True)
    for figure in (residuals(fit, fit.headlined), friction(fit)):
        assert "simulated" in figure.caption
        assert "measured" not in figure.caption
    drawn = answer_figure(fit)
    words = [text.get_text() for axis in drawn.figure.axes for text in axis.texts]
    assert "measured" not in " ".join((drawn.caption, *words))
    assert "simulated" in drawn.caption


def test_an_error_near_the_bound_says_so_and_asks_for_another_recording():
    """Yes stood for 19.95 % of 20 %, twice the error of the fit, of a single held-out part."""
    close = predicting((5.0,), 19.96).answer
    assert "error of 20.0 % (R² 0.960), just within 20 %; on the fitted data 9.46 %" in close.sentence
    assert close.next[0].text.startswith("Record a second recording to hold out")
    assert "just within" not in predicting((5.0,)).answer.sentence


def test_a_drive_of_unknown_constant_asks_for_a_known_payload():
    unknown = Verdict("note", "The drive constant is unknown.", "Add a recording.", finding="drive_constant")
    answer = predicting(verdicts=(unknown,), effort_unit="V").answer
    assert "record with a known payload too: until then, all parameters are per volt" in answer.next[0].text


def test_no_line_breaks_between_a_number_and_its_unit():
    said = typeset_sentence(f"An error of {Value('a.b', 0.254, '0.254')} % and {Value('a.c', 2.0, '2')} N*m in 2 s.")
    assert plain_text(said) == "An error of 0.254\xa0% and 2\xa0N·m in 2\xa0s."
    assert typeset_sentence("Run `try a 2 s` on 4 samples.") == "Run `try a 2 s` on 4 samples."


@pytest.mark.parametrize(("kind", "verdict"), [("wrong", "cannot say"), ("warning", "cannot say"), ("note", "yes")])
def test_findings_answer_where_a_procedure_does_not(kind, verdict):
    section = Section("a", "A", drawings=(drawing("first"), drawing("second")))
    answer = answer_of_findings("It is so.", [(kind, "This was found.")])
    made = study_page("s: x", answer, (), (section,), (Verdict(kind, "This was found."),))
    assert made.answer.verdict == verdict
    assert made.answer.reason == ("" if verdict == "yes" else "This was found.")
    assert made.figure.name == "first"
    assert [d.name for d in made.sections[0].drawings] == ["second"]


def test_several_procedures_give_one_answer_and_a_section_for_each_other_one(tmp_path):
    pages = [
        study_page(
            f"s: {what}",
            answer_of_findings(f"{what} is so.", ()),
            (),
            (Section(what, what, ("x",), drawings=(drawing(),)),),
        )
        for what in ("one", "two")
    ]
    made = _one_page(pages)
    assert made.said == "One is so."
    assert "Two is so." in made.sections[0].paragraphs[0]
    html = write_page(tmp_path, made).read_text(encoding="utf-8")
    places = [html.index(part) for part in ("One is so.", "Two is so.", "<figure", "<main>")]
    assert places == sorted(places)  # the second answer stood in a folded section alone
    names = [d.name for d in made.drawings]
    assert len(names) == len(set(names)) == 2


def test_several_models_say_how_many_a_yes_needs():
    """Three of four recordings gave yes in one study and eight of eleven gave no in another, without a rule."""
    parts = [AnswerPart("a", "yes", "3 %"), AnswerPart("b", "no", "30 %")]
    assert needed_of_parts(parts) == "; yes needs all 2"
    assert needed_of_parts(parts[:1]) == ""


def test_a_section_left_empty_is_dropped():
    kept = without_drawing((Section("a", "A", drawings=(drawing(),)), Section("b", "B", ("x",))), "one")
    assert [section.id for section in kept] == ["b"]


def test_a_refused_interval_is_told_by_no_number():
    fit = fabricate.fit()
    parameter = fit.headlined.estimate.parameters[0]
    assert "±" in value_and_half_interval(parameter, 0.95)
    assert "±" not in value_and_half_interval(parameter, 0.95, refused="too little motion")
    assert "not identifiable" in value_and_half_interval(parameter, 0.95, refused="too little motion")


def test_a_forest_writes_the_numbers_under_their_ids():
    estimates = [Estimate("a", 1.0, 0.5, 1.5, text="1.00", id="s.a"), Estimate("b", 2.0, np.nan, np.nan)]
    made = draw(forest, estimates, "changes", "Change (%)", caption="Two changes and one interval.", margin=(-1.0, 1.0))
    assert 'data-id="s.a"' in made.inline()


@pytest.mark.parametrize(
    ("judged", "errors", "kinds", "verdict"),
    [
        ("heldout", (5.0, 12.0), ("note",), "yes"),
        ("heldout", (5.0, 25.0), (), "no"),
        ("heldout", (5.0, 12.0), ("wrong",), "cannot say"),
        ("fitted", (5.0, 12.0), (), "cannot say"),
    ],
)
def test_a_robot_is_judged_by_its_worst_joint_where_it_was_not_fitted(judged, errors, kinds, verdict):
    wrong = [kind for kind in kinds if kind == "wrong"]
    answers = answer_joints(("a", "b"), errors if judged == "heldout" else None, "held-out data", (1.0, 1.0), wrong)
    assert verdict_of_parts(answers) == verdict


@pytest.mark.parametrize(
    ("method", "said"),
    [("ls", "by least squares"), ("irls", "by least squares (the headline is by robust least squares)")],
)
def test_the_table_of_families_says_by_which_estimator_it_is(tmp_path, method, said):
    found = fabricate.fit(families=("symmetric", "load"))
    best = found.families[found.best]
    choice = HeadlineChoice(found.best, method)
    chosen = replace(best, choice=choice, chosen=best.predictions)
    found = replace(found, families={**found.families, found.best: chosen}, choice=choice)
    tables = complete_result(fabricate.study(tmp_path, found), found).tables
    (title,) = [table.title for table in tables if "amilies" in table.title]
    assert title == f"Friction families, by their errors of the effort {said}"


def test_the_steps_of_all_answers_stand_together_each_once():
    record = Step("Record raw EMG")
    answers = [Answer("Is it?", "no", "no", next=(record, Step(text))) for text in ("Attach", "Ask more people")]
    again = Step(REPEAT_TEXT, "emg onset", folder="s")
    one, other = (replace(each, next=(*each.next, again)) for each in answers)
    made = Page("t", "k", answer=one, others=(other,))
    steps = ("Record raw EMG.", "Attach.", "Ask more people.", "Then repeat the analysis: `pellucid emg onset s`.")
    assert made.following == steps


def test_a_step_names_the_folder_that_was_given():
    step = Step(f"Raise `count` in `{FOLDER}/lab/rig.toml`", folder="my study")
    assert step.sentence == "Raise `count` in `'my study'/lab/rig.toml`."


def test_numbers_of_errors_near_zero_stand_beside_the_names_of_the_families():
    fitted = {"symmetric": 0.247, "directional": 0.3, "combined": 2.8}
    families = {
        name: SimpleNamespace(family=name, fitted_effort_error=error, heldout_effort_error=1.1 * error + 0.5)
        for name, error in fitted.items()
    }
    figure = heldout(SimpleNamespace(families=families, best="symmetric")).figure
    figure.canvas.draw()
    (axis,) = figure.axes
    assert min(text.get_window_extent().x0 for text in axis.texts) > axis.get_window_extent().x0
    assert min(axis.get_xticks()) >= 0.0
