"""An assessment from files to a paragraph: known changes come out, and what is wrong with a study is told by name."""

import csv
import json
import re
from types import SimpleNamespace

import made_pointing
import numpy as np
import pytest
from typer.testing import CliRunner

from pellucid import cli
from pellucid._errors import IdentificationError, RecordingError, StudyError
from pellucid.people.movement_indices import affine
from pellucid.people.study.assessment_tables import RANK_TEST_WORDS, effect_table
from pellucid.people.study.paper import write_tables
from pellucid.people.study.primary_change import primary_change
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import assess as assess_with_all_studies
from pellucid.study.procedures.run import check
from pellucid.study.procedures.run import report as write_report
from pellucid.study.results import read_rows

pytestmark = pytest.mark.slow


def assess(study, studies=100):
    """Assess with few simulated studies: how many people are needed is asked of the whole study alone."""
    return assess_with_all_studies(study, studies=studies)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Six participants with EMG and markers, assessed."""
    study = made_pointing.study(tmp_path_factory.mktemp("whole"), with_emg=True, markers=True)
    return SimpleNamespace(study=study, found=assess_with_all_studies(study))


def value(found, name):
    return next(row.value for row in found.rows if row.id == f"pointing.{name}")


def test_changes_that_were_made_are_found(whole):
    found = whole.found
    assert found.conditions == tuple(made_pointing.SLOWER)
    assert found.participants == tuple(f"P{i}" for i in range(1, 7))
    assert found.movements == 6 * 4 * 20
    for condition, slower in list(made_pointing.SLOWER.items())[1:]:
        low = condition.lower()
        # A constant added to the duration does not scale, and paces vary by 3 % from condition to condition.
        assert value(found, f"transparency.duration.{low}") == pytest.approx(100.0 * (slower - 1.0), abs=4.0)
        assert value(found, f"transparency.vmax.{low}") == pytest.approx(100.0 * (1.0 / slower - 1.0), abs=4.0)
        # At 3 Hz control's faster movements lose more of their acceleration, and the others seem to cost less.
        cost = 100.0 * (made_pointing.YIELD[condition] - 1.0)
        assert value(found, f"assess.sensitivity.6hz.emgacc.{low}") == pytest.approx(cost, abs=3.0)
        assert 0.85 * cost < value(found, f"transparency.emgacc.{low}") < cost
        assert value(found, f"transparency.torque_rms.{low}") == pytest.approx(0.38, abs=0.02)
    assert value(found, "assess.duration.friedman.p_exact") < 0.001
    assert found.assessed["emgacc"].table.conditions == ("FC", "PCFr", "CLPC")
    assert found.assessed["emgacc"].comparison.friedman.degrees_of_freedom == 2
    assert "Ctrl" not in found.assessed["torque_rms"].table.conditions


def test_rows_have_ids_of_their_own_and_describe_the_same_table(whole):
    found = whole.found
    ids = [row.id for row in found.rows]
    assert len(set(ids)) == len(ids)
    assert {row.command for row in found.rows} == {"assess"}
    column = found.assessed["duration"].table.column("PCFr")
    assert value(found, "assess.duration.pcfr.mean") == pytest.approx(column.mean())
    assert value(found, "assess.duration.pcfr.sd") == pytest.approx(column.std(ddof=1))
    relative = column.mean() / found.assessed["duration"].table.column("Ctrl").mean() - 1.0
    assert value(found, "assess.duration.pcfr.change_of_mean") == pytest.approx(100.0 * relative)
    # What is told first is the mean of people's own changes, of ratios a geometric one.
    own = column / found.assessed["duration"].table.column("Ctrl")
    assert value(found, "transparency.duration.pcfr") == pytest.approx(100.0 * (np.exp(np.log(own).mean()) - 1.0))


def test_isochrony_is_a_straight_line_of_velocity_over_amplitude(whole):
    """Durations were made 0.45 + 0.45 A: mean velocity grows with A, and less than in proportion."""
    found = whole.found
    assert {(i.condition, i.direction) for i in found.isochrony} == {
        (c, d) for c in found.conditions for d in ("up", "down")
    }
    for each in found.isochrony:
        assert len(each.participants) == 6
        assert min(each.velocity_r2) > 0.85
        assert each.velocity_slope > 0.0
        assert each.velocity_intercept > 0.0
        assert [np.degrees(a) for a, _, _ in each.points] == pytest.approx(made_pointing.AMPLITUDES)
    control = next(i for i in found.isochrony if (i.condition, i.direction) == ("Ctrl", "up"))
    slowed = next(i for i in found.isochrony if (i.condition, i.direction) == ("PCFr", "up"))
    assert slowed.duration_intercept > control.duration_intercept


def test_a_straight_line_is_scipys():
    from scipy.stats import linregress

    rng = np.random.default_rng(0)
    x, y = rng.normal(size=9), rng.normal(size=9)
    known = linregress(x, y)
    assert affine(x, y) == pytest.approx((known.slope, known.intercept, known.rvalue**2))


def test_the_paragraph_says_what_was_found_and_what_was_not(whole):
    said = whole.found.paragraph
    assert "6 participants made 480 movements in 4 conditions (Ctrl, FC, PCFr, CLPC; control: Ctrl)" in said
    assert "Nemenyi's test distinguished Ctrl from PCFr (p = 0.0" in said
    assert "s in FC (+" in said
    assert "95 % CI" in said
    assert "A condition without a significant difference from Ctrl is not thereby equal to it" in said
    assert "test against control is 0.094" in said  # 3 comparisons, 2^-5 each


def test_another_filter_is_told(whole):
    found = whole.found
    words = {s.words for s in found.sensitivity}
    # No recording of control has an encoder that its markers could be compared with: what 10 ms would change is told.
    assert words == {"3 Hz", "1.5 Hz", "6 Hz", "12 Hz", "2.5 %", "10 %", "first rest", "10 ms"}
    assert {s.index for s in found.sensitivity if s.words == "10 ms"} == {"emgacc", "emg_level"}
    assert {"duration_median", "duration"} <= {s.index for s in found.sensitivity if s.words == "6 Hz"}
    by = {s.words: s for s in found.sensitivity if (s.index, s.condition) == ("acceleration", "PCFr")}
    assert by["6 Hz"].control > by["3 Hz"].control  # a 3 Hz filter lowers peaks


def test_participants_needed_grow_as_changes_shrink(whole):
    assert set(whole.found.needed_as_seen) == {"FC", "PCFr", "CLPC"}
    assert value(whole.found, "assess.needed_as_seen.pcfr") == whole.found.needed_as_seen["PCFr"]
    need = {each.change: each.participants for each in whole.found.needed if each.index == "duration"}
    assert need[0.05] > need[0.1] >= need[0.2] == 7  # fewer cannot pass a level divided by three
    generic = [each.participants for each in whole.found.needed if each.change is None]
    assert generic == sorted(generic, reverse=True)
    # A change of one standard deviation is as hard to find whatever the index.
    own = next(each for each in whole.found.needed if each.index == "vmax" and each.effect > 1.0)
    assert own.participants <= dict((e.effect, e.participants) for e in whole.found.needed if not e.index)[1.0]


def test_the_command_saves_its_rows_and_prints_one_screen_that_answers_and_leads_to_the_report(whole, monkeypatch):
    monkeypatch.setattr("pellucid.study.procedures.run.run", lambda study, name, **options: whole.found)
    result = CliRunner().invoke(cli.app, ["assess", str(whole.study.folder)], env={"COLUMNS": "80"})
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert sum(-(-len(line) // 80) for line in lines) <= 45
    told = primary_change(whole.found, "duration_median", "PCFr")
    first = " ".join(" ".join(lines[:6]).split())
    assert f"PCFr {told.value:+.1f} % (95 % CI {told.low:+.1f} to {told.high:+.1f} %)" in first
    answers = [line for line in lines if re.match(r" (Median dur|Peak vel|EMG per acc)", line)]
    assert len(answers) == 9
    assert all(line.rstrip().endswith(("differs", "not shown", *RANK_TEST_WORDS.values())) for line in answers)
    assert "-v prints" in result.stdout
    assert f"pellucid report {whole.study.folder}" in result.output
    assert tuple(read_rows(whole.study.results_path)) == whole.found.rows
    assert "Nemenyi's test" in str(whole.found)


def test_the_same_study_gives_the_same_rows_and_json_has_every_figure(tmp_path):
    study = small(tmp_path, with_emg=True)
    made = CliRunner().invoke(cli.app, ["assess", str(study.folder), "--json", "--studies", "100"])
    told = {row["id"] for row in json.loads(made.stdout)["figures"]}
    assert told == {row.id for row in read_rows(study.results_path)}
    assert "pointing.transparency.duration_median.pcfr" in told
    assert tuple(read_rows(study.results_path)) == assess(open_study(study.folder)).rows


def test_tables_are_written_as_a_paper_and_a_statistician_need_them(whole):
    folder = whole.study.folder / "tables"
    written = write_tables(folder, whole.found)
    assert {path.name for path in written} >= {"indices.csv", "indices.tex", "changes.tex", "participants_needed.csv"}
    with open(folder / "participants.csv", newline="", encoding="utf-8") as file:
        rows = [r for r in csv.DictReader(file) if r["index"] == "duration" and r["condition"] == "PCFr"]
    values = whole.found.assessed["duration"].table.column("PCFr")
    assert [float(r["value"]) for r in rows] == pytest.approx(values, rel=1e-6)
    with open(folder / "movements.csv", newline="", encoding="utf-8") as file:
        moved = list(csv.DictReader(file))
    assert len(moved) == whole.found.movements
    own = [float(r["duration"]) for r in moved if r["participant"] == "P1" and r["condition"] == "PCFr"]
    assert np.mean(own) == pytest.approx(values[0], rel=0.02)
    text = (folder / "indices.tex").read_text(encoding="utf-8")
    assert r"\begin{tabular}{lrrrrrrr}" in text
    assert r"$\pm$" in text
    assert text.isascii()
    for path in written:
        if path.suffix == ".tex":
            body = path.read_text(encoding="utf-8").split(r"\midrule")[1].split(r"\bottomrule")[0]
            cells = {line.count(" & ") for line in body.strip().splitlines()}
            assert len(cells) == 1, path


def test_the_report_shows_every_participant(whole):
    page = write_report(whole.study, whole.found).read_text(encoding="utf-8")
    for heading in ("Results", "Every participant", "Movements", "Isochrony", "Other filters"):
        assert heading in page
    assert page.count("<svg") == 5
    assert (whole.study.report_dir / "isochrony.svg").is_file()


def test_a_study_that_only_assesses_is_checked_and_says_what_to_do(tmp_path):
    study = small(tmp_path)
    checked = CliRunner().invoke(cli.app, ["check", str(study.folder)])
    assert checked.exit_code == 0
    assert "Next: pellucid assess" in checked.output
    result = CliRunner().invoke(cli.app, ["identify", str(study.folder)])
    assert "pellucid assess" in str(result.exception)


# --- what can be wrong --------------------------------------------------------------------------------------------


def small(folder, **options):
    return made_pointing.study(
        folder, **{"participants": 3, "conditions": ("Ctrl", "PCFr"), "repetitions": 1, **options}
    )


def test_a_participant_without_a_condition_is_left_out_and_named(tmp_path):
    found = assess(small(tmp_path, missing=(("P2", "PCFr"),)))
    assert found.participants == ("P1", "P3")
    assert found.without == {"P2": "no recording in PCFr"}
    assert any("P2 is excluded" in v.text and v.kind == "warning" for v in found.verdicts)
    assert "P2" in next(row.note for row in found.rows if row.id.endswith("assess.participants"))


def test_nobody_with_all_conditions_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="P1: no recording in PCFr"):
        assess(small(tmp_path, participants=2, missing=(("P1", "PCFr"), ("P2", "Ctrl"))))


def test_one_participant_is_described_and_not_tested(tmp_path):
    study = small(tmp_path, participants=1)
    found = assess(study)
    assert found.assessed["duration"].comparison.friedman is None
    assert "With one participant there is no test" in found.paragraph
    assert found.answer.reason == "with one participant, no test is possible"
    assert [part.reason for part in found.answer.parts] == [found.answer.reason] * len(found.answer.parts)
    assert "Record the next participant" in found.answer.following[0]
    assert any("A test needs more participants" in v.text for v in found.verdicts)
    assert value(found, "assess.duration.pcfr.mean") > value(found, "assess.duration.ctrl.mean")
    assert write_report(study, found).is_file()


def test_movements_without_a_clear_peak_are_refused_by_name(tmp_path):
    def stutter(person, condition, time, angle, target, emg):
        if (person, condition) == ("P2", "PCFr"):
            # Half of every movement a second later: two strokes of the same speed.
            angle = 0.5 * (angle + np.interp(time - 1.0, time, angle))
        return time, angle, target, emg

    study = small(tmp_path, change=stutter)
    with pytest.raises(RecordingError, match=r"P2_PCFr\.csv .*expected one clear peak of the speed"):
        assess(study)
    assert any("one clear peak" in f.message and f.severity == "refuse" for f in check(study))


def test_a_lost_marker_costs_the_movements_it_touches(tmp_path):
    def hide(person, condition, time, angle, target, emg):
        if (person, condition) == ("P1", "PCFr"):
            angle = angle.copy()
            angle[(time > 4.0) & (time < 9.0)] = np.nan
        return time, angle, target, emg

    found = assess(small(tmp_path, change=hide, markers=True))
    assert found.left_out["lost"] >= 1
    assert any("with gaps in the recorded position" in v.text for v in found.verdicts)
    assert any("missing in" in v.text and "P1_PCFr.csv" in v.text for v in found.verdicts)
    assert np.isfinite(found.assessed["duration"].table.values).all()


@pytest.mark.parametrize(
    ("late", "said"),
    [
        (1.5, r"P2_PCFr\.csv .*EMG .*: found EMG that fits the motion best 1\.\d+ s after it"),
        (500.0, "EMG from 500 s"),
    ],
)
def test_emg_on_another_clock_is_refused(tmp_path, late, said):
    def shift(person, condition, time, angle, target, emg):
        return time, angle, target, emg + (late if (person, condition) == ("P2", "PCFr") else 0.0)

    with pytest.raises(RecordingError, match=said):
        assess(small(tmp_path, participants=2, change=shift, with_emg=True))


def test_a_recording_with_too_many_gaps_is_left_out_by_name_and_its_participant_with_it(tmp_path):
    def hide(person, condition, time, angle, target, emg):
        if (person, condition) == ("P2", "Ctrl"):
            angle = np.where(time > 3.0, np.nan, angle)
        return time, angle, target, emg

    study = small(tmp_path, change=hide, markers=True)
    found = assess(study)
    assert found.participants == ("P1", "P3")
    assert found.without == {"P2": "none that can be used in Ctrl"}
    (told,) = [v.text for v in found.verdicts if v.kind == "warning" and "P2_Ctrl.csv" in v.text]
    assert "markers elbow and wrist: found missing samples in" in told
    assert "wrist lost in" in told
    assert "elbow lost in" not in told
    assert "the recording P2_Ctrl is excluded" in told
    assert "P2 excluded: none that can be used in Ctrl" in next(row.note for row in found.rows)
    (said,) = [f for f in check(study) if f.kind == "gap"]
    assert (said.severity, said.file) == ("cut", "P2_Ctrl.csv")
    # What is left is what the study would be without this participant.
    alone = assess(small(tmp_path / "without", missing=(("P2", "Ctrl"),), markers=True))
    assert (found.assessed["duration"].table.values == alone.assessed["duration"].table.values).all()


@pytest.mark.parametrize("markers", [False, True])
def test_a_recording_that_never_saw_the_angle_stops_nothing(tmp_path, markers):
    def hide(person, condition, time, angle, target, emg):
        return time, angle * (np.nan if (person, condition) == ("P1", "PCFr") else 1.0), target, emg

    study = small(tmp_path, change=hide, markers=markers)
    assert assess(study).participants == ("P2", "P3")
    assert [f.severity for f in check(study) if f.file == "P1_PCFr.csv"] == ["cut"]


def test_who_is_left_out_for_one_condition_alone_is_said(tmp_path):
    def hide(person, condition, time, angle, target, emg):
        spoilt = person in ("P1", "P3") and condition == "PCFr"
        return time, np.where(spoilt & (time > 3.0), np.nan, angle), target, emg

    found = assess(small(tmp_path, participants=5, change=hide))
    assert found.participants == ("P2", "P4", "P5")
    assert any("All 2 of 5 excluded participants lack PCFr" in v.text for v in found.verdicts)


def test_a_study_along_a_line_speaks_of_metres_and_newtons(tmp_path):
    """The rotary study with every radian a decimetre: the same times, everything else in m, mm and N."""
    rotary = assess(small(tmp_path / "rotary", repetitions=2))
    study = small(tmp_path / "line", repetitions=2)
    path = study.folder / "study.toml"
    text = path.read_text(encoding="utf-8").replace('motion = "rotary"', 'motion = "prismatic"')
    text = text.replace('joint = "elbow"\n', "").replace('lifts = "flexion"', 'lifts = "forwards"')
    text = text.replace('"N*m"', '"N"').replace('column = "target", unit = "deg"', f'column = "target", {LINE}')
    path.write_text(text.replace('column = "angle", unit = "deg"', f'column = "angle", {LINE}'), encoding="utf-8")
    study = open_study(study.folder)
    assert [f.message for f in check(study)] == []
    found = assess(study)
    units = {name: each.table.index.unit for name, each in found.assessed.items()}
    assert units["vmax"] == "m/s"
    assert units["acceleration"] == "m/s^2"
    assert units["end_absolute"] == "m"
    assert units["torque_rms"] == "N"
    assert found.assessed["vmax"].table.values == pytest.approx(0.1 * rotary.assessed["vmax"].table.values, rel=1e-5)
    assert found.assessed["duration"].table.values == pytest.approx(rotary.assessed["duration"].table.values, rel=1e-9)
    slopes = [[line.velocity_slope for line in each.isochrony] for each in (found, rotary)]
    assert slopes[0] == pytest.approx(slopes[1], rel=0.01)
    page = write_report(study, found).read_text(encoding="utf-8")
    told = [str(found), page, *(f"{row.unit} {row.note}" for row in found.rows)]
    told += [p.read_text(encoding="utf-8") for p in write_tables(tmp_path / "tables", found)]
    assert not [m[0] for text in told for m in re.finditer(ANGULAR, text)]
    assert "End-point error (mm)" in told[0]
    assert "Peak velocity (m/s)" in told[0]


ANGULAR = r".{0,40}(?:\brad\b|\bdeg\b|N·m|N\*m|\b[Tt]orque\b|upward).{0,40}"


@pytest.fixture(scope="module")
def restless(tmp_path_factory):
    """P2's arm swings about most targets under PCFr, until the next target comes."""

    def tremble(person, condition, time, angle, target, emg):
        if (person, condition) == ("P2", "PCFr"):
            angle = angle + np.where(time > 0.1 * time[-1], 0.09, 0.0) * np.sin(2.0 * np.pi * 0.7 * time)
        return time, angle, target, emg

    folder = tmp_path_factory.mktemp("restless")
    study = small(folder, change=tremble, repetitions=2)
    return SimpleNamespace(study=study, found=assess(study), calm=assess(small(folder / "calm", repetitions=2)))


def test_movements_that_never_settle_are_told_and_counted_as_longer_than_seen(restless):
    found, calm = restless.found, restless.calm
    assert "unsettled" not in calm.assessed
    assert all(each.curve.cut == 0.0 for each in calm.settling)
    never = found.assessed["unsettled"].table
    assert never.column("Ctrl").max() == 0.0
    assert 0.3 < never.column("PCFr")[1] < 1.0
    assert never.column("PCFr")[[0, 2]].max() == 0.0
    cut = next(each.curve.cut for each in found.settling if each.condition == "PCFr")
    assert cut == pytest.approx(never.column("PCFr").mean(), abs=0.05)  # of movements, of people
    assert value(found, "assess.settling.pcfr.never") == pytest.approx(100.0 * cut)
    # A change of a share in % stands beside changes in % of control.
    assert primary_change(found, "unsettled", "PCFr").text.endswith(" percentage points")
    assert primary_change(found, "duration", "PCFr").text.endswith(" %")
    assert "Never settled (percentage points)" in [row[0] for row in effect_table(found).rows]
    assert "movements in PCFr, including excluded ones, had not settled when the next target came" in found.headline
    # One of three never settles: of a mean of people's changes a lower bound is known.
    change = value(found, "transparency.duration_median.pcfr")
    assert change > value(calm, "transparency.duration_median.pcfr") + 3.0
    assert f"PCFr at least +{change:.1f} %" in found.headline
    medians = found.assessed["duration_median"].table
    assert medians.column("PCFr")[1] > 1.3 * calm.assessed["duration_median"].table.column("PCFr")[1]
    page = write_report(restless.study, found).read_text(encoding="utf-8")
    assert "Not settled before the next target: Ctrl 0.0 %; PCFr" in page


def test_durations_are_medians_wherever_they_stand_first(restless):
    found = restless.found
    assert found.headline.startswith("Median duration against Ctrl, 3 people: PCFr")
    assert "The mean median duration was" in found.paragraph
    assert "Mean duration was" not in found.paragraph
    assert "When so many movements had ended" in str(found)


LINE = 'unit = "mm", scale = 1.7453292519943295'  # Degrees of a radian that is a decimetre


def test_where_everybody_lacks_something_nothing_is_compared(tmp_path):
    def hide(person, condition, time, angle, target, emg):
        return time, np.where((condition == "PCFr") & (time > 3.0), np.nan, angle), target, emg

    with pytest.raises(RecordingError, match="P1: none that can be used in PCFr; P2"):
        assess(small(tmp_path, change=hide))


def test_a_simulation_on_a_cluster_is_the_same(tmp_path):
    distributed = pytest.importorskip("distributed")
    study = small(tmp_path)
    with distributed.LocalCluster(n_workers=1, processes=False, dashboard_address=None, silence_logs=50) as made:
        options = ["--studies", "200", "--scheduler", made.scheduler_address]
        result = CliRunner().invoke(cli.app, ["assess", str(study.folder), *options])
    # No test tells so few people apart, so that nobody can say.
    assert result.exit_code == 1, result.output
    needed = {row.id: row.value for row in read_rows(study.results_path) if ".needed." in row.id}
    assert needed == {row.id: row.value for row in assess(study, studies=200).rows if ".needed." in row.id}
    assert (study.folder / "tables" / "participants_by_effect.csv").is_file()


def test_a_drift_of_emgs_clock_is_taken_back_and_told(tmp_path):
    fast = 2e-3

    def stretch(person, condition, time, angle, target, emg):
        return time, angle, target, emg * (1.0 + (fast if (person, condition) == ("P1", "PCFr") else 0.0))

    options = {"participants": 1, "repetitions": 6, "with_emg": True}
    found = assess(small(tmp_path / "drifts", change=stretch, **options))
    known = assess(small(tmp_path / "keeps", **options))
    (said,) = [v.text for v in found.verdicts if "the clocks drift" in v.text]
    assert "P1_PCFr_emg.csv" in said
    assert abs(float(said.split("drift by ")[1].split(" ")[0]) + 1e6 * fast) < 0.1 * 1e6 * fast
    ours, theirs = (f.assessed["emg_level"].table.values for f in (found, known))
    assert ours == pytest.approx(theirs, rel=0.02)


def test_emg_at_a_rate_that_was_not_recorded_is_refused(tmp_path):
    def stretch(person, condition, time, angle, target, emg):
        return time, angle, target, emg * (1.015 if (person, condition) == ("P1", "PCFr") else 1.0)

    with pytest.raises(RecordingError, match=r"P1_PCFr_emg\.csv.*the clocks drift by -1\d{4} .*expected the same rate"):
        assess(small(tmp_path, participants=1, repetitions=6, change=stretch, with_emg=True))


def test_who_misses_targets_with_a_robot_is_assessed(tmp_path):
    def miss(person, condition, time, angle, target, emg):
        if condition == "PCFr":
            # The arm stays up to 10 degrees off where it was to be, another way after every movement.
            steps = np.flatnonzero(np.diff(target)) + 1
            off = np.random.default_rng(3).uniform(-0.17, 0.17, len(steps))
            late = np.searchsorted(steps + 60, np.arange(len(time)), side="right")
            drawn = np.concatenate(([0.0], off))[late]
            n = 41
            angle = angle + np.convolve(np.pad(drawn, n // 2, mode="edge"), np.hanning(n + 2)[1:-1] / 21.0, "valid")
        return time, angle, target, emg

    found = assess(small(tmp_path, change=miss, repetitions=2))
    assert any("movements that missed by" in v.text for v in found.verdicts)
    error, spread = (found.assessed[name].table for name in ("end_absolute", "end_spread"))
    assert error.column("PCFr").min() > 2.0 * error.column("Ctrl").max()
    assert spread.column("PCFr").min() > 2.0 * spread.column("Ctrl").max()
    assert "Mean absolute end-point error was" in found.paragraph


@pytest.mark.parametrize("trembling", ["PCFr", "Ctrl"])
def test_who_cannot_hold_a_robot_still_is_assessed_and_who_never_rests_without_one_is_not(tmp_path, trembling):
    def tremble(person, condition, time, angle, target, emg):
        if (person, condition) == ("P2", trembling):
            # For most of the record the arm swings at 0.7 Hz about where it is.
            angle = angle + np.where(time > 0.1 * time[-1], 0.09, 0.0) * np.sin(2.0 * np.pi * 0.7 * time)
        return time, angle, target, emg

    study = small(tmp_path, change=tremble, repetitions=2)
    if trembling == "Ctrl":
        with pytest.raises(RecordingError, match=r"P2_Ctrl\.csv .*position: found .*expected a rest after it"):
            assess(study)
        return
    found = assess(study)
    assert found.left_out["unfinished"] > 5
    assert found.participants == ("P1", "P2", "P3")
    told = "too fast at their last sample to have an end point"
    assert any(told in v.text and "P2_PCFr.csv" in v.text for v in found.verdicts)


def test_where_a_target_is_zero_does_not_matter(tmp_path):
    def lift(person, condition, time, angle, target, emg):
        return time, angle + (0.1 if person == "P2" else 0.0), target, emg

    ours, theirs = (
        assess(small(tmp_path / name, change=change)).assessed["end_error"].table.values
        for name, change in (("lifted", lift), ("plain", None))
    )
    assert ours == pytest.approx(theirs, abs=1e-6)


def test_who_lacks_an_index_is_named(tmp_path):
    study = small(tmp_path, with_emg=True)
    path = tmp_path / "study.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('streams = { emg = "recordings/P2_PCFr_emg.csv" }\n', ""), encoding="utf-8")
    found = assess(open_study(study.folder))
    assert found.assessed["emg_level"].table.participants == ("P1", "P3")
    assert found.assessed["duration"].table.participants == ("P1", "P2", "P3")
    assert any("P2: found no value of EMG level, EMG per acceleration" in v.text for v in found.verdicts)


def test_amplitudes_that_are_mislabelled_are_refused(tmp_path):
    def swap(person, condition, time, angle, target, emg):
        if (person, condition) == ("P3", "Ctrl"):
            lift = target - made_pointing.REST
            twelve, thirty_six = (np.isclose(lift, np.radians(a)) for a in (12.0, 36.0))
            target = target.copy()
            target[twelve], target[thirty_six] = (
                made_pointing.REST + np.radians(36.0),
                made_pointing.REST + np.radians(12.0),
            )
        return time, angle, target, emg

    with pytest.raises(RecordingError, match=r"P3_Ctrl\.csv .*labelled (12 deg go 36|36 deg go 12) deg"):
        assess(small(tmp_path, change=swap))


def test_an_angle_of_another_scale_is_refused(tmp_path):
    def double(person, condition, time, angle, target, emg):
        return time, 2.0 * angle if person == "P1" else angle, target, emg

    with pytest.raises(RecordingError, match="2 times as large as their labels"):
        assess(small(tmp_path, change=double))


def test_without_a_target_rests_divide_and_amplitudes_are_as_labelled_by_the_recording(tmp_path):
    study = small(tmp_path)
    text = (tmp_path / "study.toml").read_text(encoding="utf-8")
    (tmp_path / "study.toml").write_text(
        text.replace('target = { column = "target", unit = "deg" }\n', ""), encoding="utf-8"
    )
    found = assess(open_study(tmp_path))
    known = assess(study)
    assert found.movements == known.movements
    assert found.isochrony == ()
    ours, theirs = (f.assessed["duration"].table.values for f in (found, known))
    assert ours == pytest.approx(theirs, rel=0.02)


def test_a_study_without_the_table_or_the_control_is_refused(tmp_path):
    small(tmp_path / "a")
    path = tmp_path / "a" / "study.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('control = "Ctrl"', 'control = "None"'), encoding="utf-8")
    with pytest.raises(StudyError, match='found "None", expected a condition of the recordings: Ctrl, PCFr'):
        open_study(tmp_path / "a")
    path.write_text(text.replace('[assessment]\ncontrol = "Ctrl"', '[rig.drive]\nkind = "torque"'), encoding="utf-8")
    with pytest.raises(IdentificationError, match=r"no table \[assessment\]"):
        assess(open_study(tmp_path / "a"))


def test_muscles_that_were_not_recorded_are_named(tmp_path):
    small(tmp_path, participants=2, with_emg=True)
    path = tmp_path / "study.toml"
    text = path.read_text(encoding="utf-8").replace('agonists = ["biceps", ', 'agonists = ["brachialis", ')
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=r"expected emg\.brachialis too"):
        assess(open_study(tmp_path))
