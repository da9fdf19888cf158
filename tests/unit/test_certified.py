"""Margins of study.toml against a study's indices: what passes, what fails, what cannot be said, what is refused."""

import re

import made_pointing
import numpy as np
import pytest

from pellucid._errors import StudyError
from pellucid.people.study.assessment_page import page, write_certificate
from pellucid.people.study.assessment_tables import description_table, range_table
from pellucid.people.study.certified_rows import (
    certificate_remarks,
    certificate_rows,
    certificate_sentences,
    certificate_table,
)
from pellucid.people.study.primary_change import primary_change
from pellucid.study.pages.values import plain_text
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import assess as assess_with_all_studies


def assess(study, studies=5):
    """Nothing here is of the people that the next study needs, which takes most of the time."""
    return assess_with_all_studies(study, studies=studies)


def with_margins(study, margins, curves="", change=lambda told: told):
    path = study.folder / "study.toml"
    told = re.sub(r"\n\[assessment\.(margins|curves)\][^[]*", "\n", path.read_text(encoding="utf-8"))
    estimand = "" if "estimand" in margins else 'estimand = "pseudo-median"\n'
    told = change(told) + "\n[assessment.margins]\n" + estimand + margins + "\n"
    path.write_text(told + (f"\n[assessment.curves]\n{curves}\n" if curves else ""), encoding="utf-8")
    return open_study(study.folder)


@pytest.fixture(scope="module")
def pointing(tmp_path_factory):
    return made_pointing.study(tmp_path_factory.mktemp("margins"), participants=12)


@pytest.mark.nightly
def test_wide_margins_hold_and_narrow_ones_fail(pointing):
    found = assess(with_margins(pointing, 'duration_median = "60 %"\nvmax = "60 %"\ntorque_rms = "0.6 N*m"'))
    said = {each.condition: each.certificate.verdict for each in found.certified}
    assert said == dict.fromkeys(("FC", "PCFr", "CLPC"), "transparent")
    slowest = max(made_pointing.SLOWER, key=made_pointing.SLOWER.get)
    found = assess(with_margins(pointing, 'duration_median = "2 %"\ntorque_rms = "0.6 N*m"'))
    of = {each.condition: each for each in found.certified}
    assert of[slowest].certificate.verdict == "not transparent"
    assert of[slowest].certificate.said_of("torque_rms") == "within"
    row = {r.id.partition(".certificate.")[2]: r for r in certificate_rows(found, None)}
    assert row[f"{slowest.lower()}.transparent"].value == 0.0
    # A ratio is shown as one: the change that was made.
    made = 100.0 * (made_pointing.SLOWER[slowest] - 1.0)
    assert row[f"{slowest.lower()}.duration_median.change"].value == pytest.approx(made, abs=4.0)
    assert row[f"{slowest.lower()}.duration_median.change"].unit == "%"
    assert row[f"{slowest.lower()}.torque_rms.high"].value == pytest.approx(0.38, abs=0.05)


@pytest.mark.parametrize(
    ("margins", "said"),
    [
        ('smoothness = "10 %"', "expected one of"),
        ('vmax = "10 deg"', "rad/s"),
        ('vmax = "-10 %"', "above 0"),
        ('sparc = "10 %"', "no natural zero"),
        ('torque_rms = "10 %"', "the control condition has no value"),
        ('emg_level = "10 %"', "Record the index"),
    ],
)
def test_a_margin_that_cannot_be_held_against_anything_is_told(pointing, margins, said):
    with pytest.raises(StudyError, match=said):
        assess(with_margins(pointing, margins))


ORDERS = ("Ctrl FC PCFr CLPC", "FC CLPC Ctrl PCFr", "PCFr Ctrl CLPC FC", "CLPC PCFr FC Ctrl")


def stated_order(told):
    def period(found):
        order = ORDERS[(int(found[1]) - 1) % 4].split()
        return f"{found[0]}\nperiod = {order.index(found[2]) + 1}"

    return re.sub(r'participant = "P(\d+)"\ncondition = "(\w+)"', period, told)


def stuck(person, condition, time, angle, target, muscle_time):
    """One person does not set out for the first target of FC."""
    if (person, condition) == ("P2", "FC"):
        steps = np.flatnonzero(np.diff(target)) + 1
        angle[steps[0] : steps[2]] = angle[steps[0]]
    return time, angle, target, muscle_time


@pytest.fixture(scope="module")
def ordered(tmp_path_factory):
    study = made_pointing.study(
        tmp_path_factory.mktemp("ordered"), participants=12, conditions=("Ctrl", "FC", "PCFr", "CLPC"), repetitions=1,
        change=stuck,
    )  # fmt: skip
    curves = 'velocity = "40 %"\ninteraction = "0.6 N*m"'
    return with_margins(study, 'duration_median = "40 %"\ntorque_rms = "0.6 N*m"', curves, stated_order)


def test_the_page_has_the_model_the_order_and_the_curves(ordered):
    found = assess(ordered)
    fc = next(each for each in found.certified if each.condition == "FC")
    own = {each.condition: each.certificate.doubts["duration_median"] for each in found.certified}
    assert {doubt.what for doubt in own["PCFr"]} == {"learning"}
    # Of eight movements there are no thirds; that is told.
    assert {doubt.what for doubt in own["FC"]} == {"left out"}
    assert any("fewer than 9" in text for text in fc.unknown)
    # The one that did not set out, there and back, counts as longer than any.
    assert fc.failed == {"Ctrl": (0, 120), "FC": (2, 120)}
    assert fc.certificate.tested("duration_median") == "within"
    assert [doubt.what for doubt in fc.certificate.contradicted("duration_median")] == ["left out"]
    assert "this is not shown with targets without a movement" in certificate_sentences(found)[0]
    assert {c.condition: c.certificate.verdict for c in found.certified if c is not fc} == {
        "PCFr": "transparent", "CLPC": "transparent",
    }  # fmt: skip
    assert fc.certificate.end_points["duration_median"].fit.degrees == 12 - 1 - 3  # four periods
    assert any("would overturn the verdict on" in text for text in certificate_remarks(found))
    # Eleven people's movements and 8 of the twelfth's; what was asked of the model is what people's values say.
    ranks, model = fc.certificate.end_points["duration_median"], fc.beside["mixed_model"]["duration_median"]
    assert model.method == "mixed_model"
    assert model.estimate == pytest.approx(ranks.estimate, abs=0.02)
    assert fc.certificate.curves["velocity curve"].verdict == "within"
    row = {r.id.partition(".certificate.fc.")[2]: r for r in certificate_rows(found, None)}
    assert row["duration_median.mixed_model.change"].value == pytest.approx(3.0, abs=4.0)
    assert row["duration_median.largest_carry_over"].value == 0.25
    assert row["curve.interaction.furthest"].value == pytest.approx(-0.4, abs=0.02)


def test_two_conditions_in_one_period_are_refused(ordered):
    margins = 'duration_median = "40 %"'
    with pytest.raises(StudyError, match="period = 1 of P1"):
        assess(with_margins(ordered, margins, change=lambda told: told.replace("period = 2", "period = 1", 1)))


def lost_markers(person, condition, time, angle, target, muscle_time):
    """Every fifth movement in FC passes where the cameras see nothing."""
    if condition == "FC":
        steps = np.flatnonzero(np.diff(target)) + 1
        for step in steps[::5]:
            angle[step + 40 : step + 80] = np.nan
    return time, angle, target, muscle_time


@pytest.fixture(scope="module")
def with_losses(tmp_path_factory):
    return made_pointing.study(
        tmp_path_factory.mktemp("losses"), participants=12, conditions=("Ctrl", "FC"), change=lost_markers
    )


WIDE = 'duration_median = "60 %"\nvmax = "60 %"\ntorque_rms = "0.6 N*m"'


def test_no_certificate_is_granted_where_many_movements_are_lost(with_losses):
    (fc,) = (found := assess(with_margins(with_losses, WIDE))).certified
    assert fc.certificate.verdict == "cannot say"
    assert fc.lost["vmax"] == {"Ctrl": (0, 240), "FC": (48, 240)}
    (said,) = certificate_sentences(found)
    assert "48 of 240 movements in FC" in said
    assert "more than the 10 % that max_left_out allows" in said
    row = {r.id.partition(".certificate.fc.")[2]: r for r in certificate_rows(found, None)}
    assert row["transparent"].value == 0.5
    assert row["vmax.left_out.fc"].value == pytest.approx(20.0)
    assert row["vmax.left_out.ctrl"].value == 0.0


def allowing(share):
    return lambda told: told.replace('control = "Ctrl"', f'control = "Ctrl"\nmax_left_out = {share}', 1)


def test_a_study_can_state_how_many_movements_may_be_lost(with_losses, tmp_path):
    study = made_pointing.study(tmp_path, participants=12, conditions=("Ctrl", "FC"), change=lost_markers)
    found = assess(with_margins(study, WIDE, change=allowing(0.25)))
    assert found.certified[0].certificate.verdict == "transparent"
    # What was lost is said even so.
    assert any("48 of 240 movements in FC" in text for text in certificate_remarks(found))


def test_a_claim_of_harm_stands_where_movements_are_lost(with_losses):
    margins = 'duration_median = "60 %"\ntorque_rms = "0.05 N*m"'
    (fc,) = assess(with_margins(with_losses, margins)).certified
    assert fc.certificate.verdict == "not transparent"
    assert fc.certificate.said_of("duration_median") == "undecided"


def test_movements_that_the_median_duration_counts_are_not_lost_to_it(ordered):
    (fc,) = (each for each in assess(ordered).certified if each.condition == "FC")
    assert fc.lost["duration_median"]["FC"] == (0, 120)
    assert fc.lost["torque_rms"]["FC"] == fc.lost["velocity curve"]["FC"] == (2, 120)


def test_the_sentence_says_what_was_assumed_of_people(pointing):
    by_ranks = certificate_sentences(assess(with_margins(pointing, WIDE)))[0]
    assert "at most 5 % of studies would claim otherwise" in by_ranks
    assert "provided that people's changes are spread symmetrically" in by_ranks
    assert "pseudo-median" in by_ranks
    assert "may lie beyond its margin if changes are skewed" in by_ranks
    assert "12 of 12 people are within the margin. In the population, at least " in by_ranks
    assert "beyond 3 margins, each with 90 % confidence" in by_ranks


@pytest.mark.parametrize("estimand", ["mean", "pseudo-median"])
def test_six_people_are_too_few(estimand, tmp_path):
    study = made_pointing.study(tmp_path, conditions=("Ctrl", "FC"), repetitions=1)
    found = assess(with_margins(study, f'estimand = "{estimand}"\nvmax = "60 %"'))
    (said,) = certificate_sentences(found)
    assert "cannot say. Too few participants: 6 took part" in said
    assert "26 % of studies of 6 people would contain none of them" in said
    assert found.certified[0].certificate.people_answer("vmax") == "too few"
    assert found.certified[0].certificate.tested("vmax") == "within"


@pytest.mark.parametrize(
    ("margins", "said"),
    [
        ('estimand = "median"', "expected one of mean, pseudo-median, mean and people"),
        ('estimand = "mean and people"', "expected a share"),
        ('people = "80 %"', "none otherwise"),
        ('people_level = "60 %"', "expected a level between 0 and 0.5"),
        ('largest_carry_over = "-1"', "expected a number of margins, 0 or more"),
    ],
)
def test_an_estimand_that_is_not_stated_whole_is_refused(pointing, margins, said):
    with pytest.raises(StudyError, match=said):
        with_margins(pointing, f"{margins}\n{WIDE}")


def test_a_test_that_does_not_hold_its_level_cannot_be_what_a_certificate_rests_on(pointing):
    def change(told):
        return told.replace('control = "Ctrl"', 'control = "Ctrl"\nequivalence = "mixed_model"', 1)

    with pytest.raises(StudyError, match="sensitivity analysis"):
        with_margins(pointing, WIDE, change=change)


@pytest.fixture(scope="module")
def of_twelve(tmp_path_factory):
    more = '[assessment.justification]\nvmax = "Less than people differ between days."\n'
    more += '[assessment.margins]\nvmax = "60 %"'
    return made_pointing.study(
        tmp_path_factory.mktemp("twelve"), participants=12, conditions=("Ctrl", "FC"), repetitions=1,
        more=more + '\nduration_median = "60 %"',
    )  # fmt: skip


def test_one_change_is_one_number_everywhere(of_twelve):
    """Headline, tile, text, table, row and certificate tell the same change; others are called sensitivity analyses."""
    found = assess(of_twelve)
    rows = {row.id: row for row in found.rows}
    shown = page(of_twelve, found)
    for name, tile in (("duration_median", "Median duration, FC"), ("vmax", "Peak velocity, FC")):
        change = primary_change(found, name, "FC")
        told = change.text
        certified = next(row for row in certificate_table(found).rows if row[1] == found.indices[name].short)
        assert certified[2] == told
        (said,) = certificate_sentences(found)
        assert "nearest to its margin is " in said
        assert ("duration" in said) != ("peak velocity" in said)
        figure = plain_text(next(t.figure for t in shown.tiles if t.what == tile))
        assert figure.replace("\N{MINUS SIGN}", "-") == told.removesuffix(" %")
        assert f"({told}, 95 % CI" in found.paragraph
        assert rows[f"pointing.transparency.{name}.fc"].value == pytest.approx(change.value, rel=1e-12)
        assert rows[f"pointing.certificate.fc.{name}.change"].value == pytest.approx(change.value, rel=1e-12)
        table = description_table(found, found.assessed[name])
        assert table.rows[1][table.heads.index("Change %")].replace("\N{MINUS SIGN}", "-") == told.removesuffix(" %")
        if name == "vmax":
            short = found.indices[name].short
            chosen = next(row for row in range_table(found).rows if row[0] == short)
            assert float(chosen[2].replace("\N{MINUS SIGN}", "-")) == pytest.approx(change.value, abs=0.06)
        others = [row for row in found.rows if row.id.endswith(f"{name}.fc.change_of_mean")]
        assert all(row.note.startswith("sensitivity analysis") for row in others)
    assert told in found.headline or primary_change(found, "duration_median", "FC").text in found.headline


def test_a_reviewer_gets_all_that_was_stated_and_left_out(of_twelve):
    path = write_certificate(of_twelve)
    text = path.read_text(encoding="utf-8")
    for part in ("Less than people differ between days.", "none stated", "There were no exclusions", "SHA-256",
                 "mean of people", "% beyond 3 margins", "pellucid certificate", "Sensitivity"):  # fmt: skip
        assert part in text
    badge = text.index('class="badge"')
    assert badge < text.index('id="fig-certificate"') < text.index("<main>")
    assert text.count('id="fig-certificate"') == 1
    assert write_certificate(of_twelve).read_bytes() == path.read_bytes()


def test_people_who_are_lost_leave_only_bounds(tmp_path):
    """Two of sixteen lack the robot: of a mean nothing is known then, the pseudo-median of the others has bounds, but
    both may lie far beyond."""
    study = made_pointing.study(
        tmp_path, participants=16, conditions=("Ctrl", "FC"), repetitions=1, missing=(("P3", "FC"), ("P7", "FC")),
    )  # fmt: skip
    (mean,) = assess(with_margins(study, 'estimand = "mean"\nvmax = "60 %"')).certified
    assert mean.lost_people == ("P3", "P7")
    assert mean.certificate.verdict == "cannot say"
    (said,) = certificate_sentences(found := assess(with_margins(study, 'vmax = "60 %"')))
    (lost,) = found.certified[0].certificate.contradicted("vmax")
    assert (lost.what, lost.without.verdict) == ("lost people", "within")
    assert "because too many participants are missing" in said


def overshooting(height, settled):
    """A change of the angle: every movement of `settled` condition is the same but overshoots and comes back late."""

    def change(person, condition, time, angle, target, muscle_time):
        if condition == settled:
            steps = np.flatnonzero(np.diff(target)) + 1
            for at in steps:
                size = height * (target[at] - target[at - 1])
                late = time - time[at] - 0.3
                pulse = made_pointing.minimum_jerk((late - 0.3) / 0.4) - made_pointing.minimum_jerk((late - 0.7) / 0.7)
                angle = angle + size * pulse
        return time, angle, target, muscle_time

    return change


def test_who_overshoots_and_corrects_backwards_is_slower(tmp_path):
    """The way to the target lasts as long as without the robot; the time to rest is half as long again."""
    study = made_pointing.study(
        tmp_path, participants=8, conditions=("Ctrl", "FC"), repetitions=1, change=overshooting(0.12, "FC")
    )
    found = assess(with_margins(study, 'duration_median = "15 %"'), studies=5)
    (certified,) = found.certified
    assert certified.certificate.verdict == "not transparent"
    assert primary_change(found, "duration_median", "FC").value > 40.0
    ends = [m.values["end_absolute"] for m in found.measured if m.condition == "FC"]
    assert np.median(ends) < np.radians(1.0)  # the end is where the correction ended
