"""One analysis behind every door: arrays, tables, studies, plans and sessions give the same answer to the same data."""

import re
import tomllib
from dataclasses import replace
from types import SimpleNamespace

import made_pointing
import numpy as np
import pytest
from typer.testing import CliRunner

import pellucid as pl
from pellucid import cli
from pellucid.people.analysis import ANALYSIS_FILE, Analysis
from pellucid.people.design_columns import MeasuredMovement, MovementDuration
from pellucid.people.indices import SHOWN_INDICES
from pellucid.people.mixed_model import failed_model
from pellucid.people.movements import Movement, MovementRule
from pellucid.people.study import certified
from pellucid.people.study.assess import _assessed
from pellucid.people.study.assessment_page import page, reviewer_page
from pellucid.people.study.assessment_result import AssessmentResult
from pellucid.people.study.assessment_table import AssessmentTable
from pellucid.people.study.measured_study import MeasuredStudy
from pellucid.people.study.pointing import SessionOrder
from pellucid.study.procedures.registry import open_study
from pellucid.study.results import read_rows
from pellucid.units import COORDINATES_BY_UNIT

CONTROL, WORN = "free", "robot"
AMPLITUDES = (0.3, 0.6)


def random_study(seed):
    """A random study as the command measures it, and as a table: orders, losses, learning and lost people differ."""
    rng = np.random.default_rng([49, seed])
    people = [f"P{i}" for i in range(int(rng.integers(12, 19)))]
    ordered = bool(rng.uniform() < 0.6)
    spread, effect = rng.uniform(0.01, 0.06), rng.choice([0.0, 0.0, 0.05, 0.095, 0.2])
    period, course = ordered * rng.choice([0.0, 0.06, 0.12]), rng.choice([0.0, 0.0, 0.1])
    loss, absent = rng.choice([0.0, 0.04, 0.2]), int(rng.choice([0, 0, 1, 3]))
    movements, lasted, recorded, left_out, within, periods, by = [], [], {}, {}, {}, {}, {}
    rows = {name: [] for name in ("participant", "condition", "amplitude", "direction", "trial", "vmax")}
    rows |= {"period": []} if ordered else {}
    for i, person in enumerate(people):
        own, change = 0.1 * rng.standard_normal(), effect + spread * rng.standard_normal()
        for condition in (CONTROL, WORN):
            if condition == WORN and i < absent:
                continue
            name = f"{person}_{condition}"
            recorded[name], left_out[name], within[name] = (person, condition), {}, 0
            later = (condition == WORN) == (i % 3 < 2)
            periods[name] = 1 + later
            by[person, condition] = float(1 + later)
            for k in range(12):
                amplitude, way = AMPLITUDES[k // 2 % 2], 1 - 2 * (k % 2)
                gone = condition == WORN and rng.uniform() < loss
                log = own + (condition == WORN) * (change + course * (k / 11.0 - 0.5)) + period * later
                value = float("nan") if gone else 2.0 * amplitude * float(np.exp(log + 0.02 * rng.standard_normal()))
                cell = (round(float(np.degrees(amplitude)), 1), "up" if way > 0 else "down")
                for column, each in zip(rows, (person, condition, *cell, k, value, 1 + later), strict=False):
                    rows[column].append(each)
                if gone:
                    left_out[name]["lost"] = left_out[name].get("lost", 0) + 1
                    continue
                made = Movement(
                    first=0, last=9, start=float(k), duration=0.8, direction=way, amplitude=amplitude,
                    travel=amplitude, reach=amplitude, peak_velocity=value, mean_velocity=0.5 * value, peak_time=0.5,
                    peak_acceleration=1.0, lasted=0.8,
                )  # fmt: skip
                values = {"vmax": value, "duration": 0.8}
                movements.append(MeasuredMovement(person, condition, name, made, cell, values))
                lasted.append(MovementDuration(person, condition, cell, 0.8, True))
    whole = MeasuredStudy(MovementRule(), tuple(movements), left_out, {}, tuple(lasted), recorded=recorded)
    order = SessionOrder(periods, by, within) if ordered else SessionOrder({}, {}, within, "no order is stated")
    compared = tuple(people[absent:])
    return SimpleNamespace(people=people, compared=compared, ordered=ordered, whole=whole, order=order, rows=rows)


def by_command(study, spec, registered=None):
    """The certificate that the command finds of measured movements."""
    along = COORDINATES_BY_UNIT["rad"]
    names = [index.name for index in SHOWN_INDICES]
    assessed = _assessed(study.whole, study.compared, (CONTROL, WORN), spec, along, names)
    without = {person: "no recording" for person in study.people if person not in study.compared}
    made = AssessmentResult(
        study="study", headline="", tables=(), verdicts=(), rows=(), cards={}, checksums={}, confidence=0.95,
        control=CONTROL, conditions=(CONTROL, WORN), participants=study.compared, without=without, unit="rad",
        assessed=assessed,
    )  # fmt: skip
    return certified.certify_conditions(made, spec, study.whole, study.order, {}, registered=registered)[0].certificate


def told(found):
    """Everything that a certificate says of its end point."""
    own, shares = found.end_points["vmax"], found.share_test("vmax")
    doubts = [(d.what, d.p_value, d.without.estimate, d.without.p_within) for d in found.doubts.get("vmax", ())]
    numbers = [own.estimate, *own.interval, own.p_within, own.p_beyond, shares.p_within, shares.p_far]
    words = [found.verdict, found.said_of("vmax"), *sorted(what for what, *_ in doubts)]
    return words, [*numbers, *(x for _, *more in sorted(doubts) for x in more)]


def test_table_certificate_and_command_agree_in_twenty_random_studies(tmp_path, monkeypatch):
    # Neither the number of people for the next study nor the mixed model is part of a certificate.
    monkeypatch.setattr(certified, "SIMULATED_STUDY_COUNT", 1)
    monkeypatch.setattr(certified, "mixed_model", lambda y, who, *_: failed_model(len(who), len(y), "not fitted"))
    seen, kinds = [], set()
    for seed in range(20):
        study = random_study(seed)
        settings = {"estimand": "pseudo-median"} if seed % 3 == 0 else {}
        design = "AB/BA" if study.ordered else ""
        spec = AssessmentTable(control=CONTROL, margins={"vmax": "10 %"} | settings, design=design)
        file = tmp_path / ANALYSIS_FILE
        file.write_text(spec.analysis.to_toml(), encoding="utf-8")
        expected_words, expected = told(by_command(study, spec, Analysis.of(file)))
        mapping = {"control": CONTROL, "margins": {"vmax": "10 %"}, "design": design, **settings}
        doors = (
            pl.assess(study.rows, analysis=file).certificates[WORN],
            pl.certify(study.rows, analysis=mapping),
            pl.assess(study.rows, control=CONTROL, margins={"vmax": 0.10}, **settings).certificates[WORN],
        )
        for each in doors:
            words, numbers = told(each)
            assert words == expected_words
            np.testing.assert_allclose(numbers, expected, rtol=1e-9, atol=1e-12)
        seen.append(expected_words[0])
        kinds |= {*expected_words[2:]}
    assert {"transparent", "not transparent", "cannot say"} == set(seen)
    assert {"learning", "lost movements", "lost people"} <= kinds


def balanced(people=16, later=None, **columns):
    rng = np.random.default_rng(5)
    free = np.exp(0.1 * rng.standard_normal(people))
    worn = free * np.exp(0.02 * rng.standard_normal(people))
    names = [f"P{k}" for k in range(people)]
    return {"participant": names * 2, "condition": [CONTROL] * people + [WORN] * people,
            "duration": [*free, *worn], **columns}  # fmt: skip


STATED = {"control": CONTROL, "margins": {"duration": "10 %"}}


def test_a_column_of_sequences_says_what_a_column_of_periods_says():
    first = [k % 4 != 0 for k in range(16)]
    period = [1 if f else 2 for f in first] + [2 if f else 1 for f in first]
    by_period = pl.certify(balanced(session_number=period), analysis=STATED | {"period": "session_number"})
    for texts in (("free robot", "robot free"), ("AB", "BA"), ("free-robot", "robot-free")):
        column = [texts[0] if f else texts[1] for f in first] * 2
        own = pl.certify(balanced(seq=column), analysis=STATED | {"design": "AB/BA", "sequence": "seq"})
        assert own.end_points["duration"].estimate == by_period.end_points["duration"].estimate
        assert not own.end_points["duration"].fit.is_plain
    with pytest.raises(pl.PellucidError, match="column seq: found 'ABB' of P0, expected all of free, robot"):
        pl.certify(balanced(seq=["ABB"] * 32), analysis=STATED | {"sequence": "seq"})


@pytest.mark.parametrize(
    ("more", "columns", "said"),
    [
        ({"design": "AB/BA"}, {}, "found participants without a stated period .P0, P1, P2, .*, expected one for"),
        ({"design": "AB/BA"}, {"period": [1] * 16 + [2] * 16}, "found the same order of conditions for all"),
        ({"design": "AB/BA"}, {"period": [1] * 32}, "found two conditions of P0 in one period"),
        ({"design": "Williams"}, {"period": [1] * 16 + [2] * 16}, "expected three or more"),
        ({"design": "parallel sessions"}, {"period": [1] * 16 + [2] * 16}, "expected none with design"),
        ({"design": "crossed"}, {}, "expected parallel sessions, AB/BA or Williams"),
        ({"margin": {}}, {}, "found margin, expected margins, control"),
        ({"margins": {"duration": "2 s", "other": "2 s"}}, {"other": [1.0] * 32}, "the unit is not known"),
        ({"false_transparent": 0.7}, {}, "expected a level between 0 and 0.5"),
        ({"margins": {"duration": {"size": 1}}}, {}, "expected a table of margins"),
        ({"looks": "0.5"}, {}, "expected a list of numbers"),
        ({"exclusions": "nobody"}, {}, "expected a list of texts"),
        ({"curves": {"velocity": "15 %"}}, {}, "only recordings have curves"),
        ({"control": 5}, {}, "found control = 5, expected a text"),
        ({"max_left_out": "10 deg"}, {}, "max_left_out"),
        ({"looks": [0.5, 1.0]}, {}, "expected one of looks"),
    ],
)
def test_what_an_analysis_does_not_allow_is_refused(more, columns, said):
    with pytest.raises(pl.PellucidError, match=said):
        pl.certify(balanced(**columns), analysis=STATED | more)


def test_an_analysis_leaves_no_room_for_keywords():
    with pytest.raises(pl.PellucidError, match="found analysis and alpha"):
        pl.assess(balanced(), analysis=STATED, alpha=0.1)
    with pytest.raises(pl.PellucidError, match="found analysis and other keywords"):
        pl.certify(balanced(), analysis=STATED, estimand="pseudo-median")
    with pytest.raises(pl.PellucidError, match="found no readable file"):
        pl.assess(balanced(), analysis="nowhere.toml")


def test_excluding_people_cannot_make_a_claim():
    """Two of sixteen people are slowed by half. Without them the others would be called transparent."""
    table = balanced()
    for row in (16, 17):
        table["duration"][row] *= 1.5
    excluded = {"P0": "looked tired", "P1": "looked tired"}
    kept = {name: [x for i, x in enumerate(column) if i % 16 > 1] for name, column in table.items()}
    assert pl.certify(kept, analysis=STATED).verdict == "transparent"
    assert pl.certify(table, analysis=STATED).verdict != "transparent"
    assert pl.certify(table, analysis=STATED | {"excluded": excluded}).verdict == "cannot say"
    assert pl.certify(kept, analysis=STATED | {"excluded": excluded}).verdict == "cannot say"


def test_a_file_gives_back_the_analysis(tmp_path):
    spec = AssessmentTable(
        control=CONTROL, design="AB/BA", washout="30 min", exclusions=['people who "cannot" lift the arm'],
        margins={"vmax": "10 %", "end_absolute": "2 deg", "estimand": "mean and people", "people": "85 %",
                 "people_level": "5 %", "largest_carry_over": "0.5"},
        looks=(0.6, 1.0), look=1, curves={"velocity": "15 %"}, lowpass="6 Hz",
    )  # fmt: skip
    path = tmp_path / ANALYSIS_FILE
    # The look is where a study is, and nothing that is registered.
    with pytest.raises(pl.PellucidError, match="found look = None"):
        _ = Analysis.of({"looks": [0.6, 1.0]}).alpha
    text = spec.analysis.to_toml()
    path.write_text(text, encoding="utf-8")
    assert spec.analysis.deviations(Analysis.of(path)) == ()
    assert Analysis.of(path).to_toml() == text
    other = spec.model_copy(update={"lowpass": 3.0, "margins": {**spec.margins, "vmax": "12 %"}})
    assert other.analysis.deviations(Analysis.of(path)) == (
        "margins.vmax: registered 10 %, analysed 12 %", "movements.lowpass: registered 6.0, analysed 3.0",
    )  # fmt: skip


PLANNED = """name = "planned"
[rig]
joint = "elbow"
motion = "rotary"
[channels]
time = { column = "time", unit = "s" }
[assessment]
control = "Ctrl"
[assessment.margins]
duration_median = "10 %"
[assessment.spreads]
duration_median = "3 %"
"""


def test_a_plan_registers_the_analysis_until_there_are_recordings(tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(PLANNED, encoding="utf-8")

    def planned():
        done = CliRunner().invoke(cli.app, ["plan", str(tmp_path), "--studies", "100"])
        assert done.exit_code == 0, done.output
        return " ".join(done.output.split())

    assert "Registered the analysis in analysis.toml" in planned()
    assert Analysis.of(tmp_path).margins == {"duration_median": "10 %"}
    assert "registers this analysis" in planned()
    recording = '[[recordings]]\nname = "r"\nfile = "r.csv"\nparticipant = "A"\ncondition = "Ctrl"\n'
    (tmp_path / "r.csv").write_text("time\n0\n1\n", encoding="utf-8")
    file.write_text(PLANNED.replace("10 %", "20 %") + "[participants.A]\n" + recording, encoding="utf-8")
    assert "registered 10 %, analysed 20 %" in planned()
    assert Analysis.of(tmp_path).margins == {"duration_median": "10 %"}


def test_another_analysis_than_the_registered_one_is_post_hoc(tmp_path):
    study = made_pointing.study(tmp_path, participants=12, conditions=("Ctrl", "FC"), repetitions=1)
    path = tmp_path / "study.toml"
    text = path.read_text(encoding="utf-8") + '\n[assessment.margins]\nestimand = "pseudo-median"\nvmax = "60 %"\n'
    path.write_text(text, encoding="utf-8")
    study = open_study(tmp_path)
    spec = study.table(AssessmentTable)
    file = tmp_path / ANALYSIS_FILE

    def assessed():
        # As a user would: what was kept of the study is fresh only with the same registered analysis.
        done = CliRunner().invoke(cli.app, ["assess", str(tmp_path), "--studies", "100"])
        assert done.exit_code == 0, done.output
        rows = {row.id.partition(".certificate.fc.")[2]: row for row in read_rows(tmp_path / "results.json")}
        found = pl.assess(study, studies=5)
        return done.output, rows, found

    output, rows, found = assessed()
    assert found.certified[0].certificate.verdict == "transparent"
    assert "post_hoc" not in rows
    assert "no analysis.toml was registered" in str(reviewer_page(study, spec, found))
    file.write_text(spec.analysis.to_toml(), encoding="utf-8")
    output, rows, found = assessed()
    assert (rows["post_hoc"].value, rows["transparent"].note) == (0.0, "transparent")
    assert "post hoc" not in output.lower()
    file.write_text(spec.analysis.to_toml().replace("60 %", "5 %"), encoding="utf-8")
    output, rows, found = assessed()
    assert (rows["post_hoc"].value, rows["transparent"].note) == (1.0, "transparent (post hoc)")
    assert "FC: transparent (post hoc)" in re.sub(r"\s+", " ", output)
    assert found.headline.startswith("FC: transparent (post hoc), ")
    report, reviewed = page(study, found), reviewer_page(study, spec, found)
    assert "FC: transparent (post hoc), " in report.said
    assert "Post hoc" in report.answer.question
    assert reviewed.tiles[0].figure == "transparent (post hoc)"
    assert "margins.vmax: registered 5 %, analysed 60 %" in str(reviewed)


@pytest.mark.parametrize("design", ["", "AB/BA"])
def test_planned_power_is_the_share_of_certificates(design):
    """600 drawn studies, each certified as a table, against the plan: within three standard errors."""
    stated, n, count = STATED | {"design": design}, 14, 300
    rng = np.random.default_rng(8)
    later = np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
    said = 0
    for _ in range(count):
        changes = 0.02 + 0.05 * rng.standard_normal(n)
        table = {"duration": (np.ones(n), np.exp(changes))}
        found = pl.certify(table, {"duration": 0.10}, later=later if design else None)
        said += found.verdict == "transparent"
    power = pl.plan(stated, people=n, sd=0.05, effect=float(np.expm1(0.02)), learning=False, studies=2000)
    assert 0.1 < power < 0.9
    assert abs(power - said / count) < 3.0 * np.sqrt(power * (1.0 - power) * (1.0 / count + 1.0 / 2000))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"analysis": {"control": "free"}}, "found no margins"),
        ({"sd": {"other": 0.05}}, "found other, expected duration too"),
        ({"sd": "50 ms"}, "of the kind of its margin"),
        ({"sd": 0.0}, "above 0"),
        ({"correlation": 2.0}, "from 0 to 1"),
        ({"people": 1}, "expected at least 2"),
    ],
)
def test_a_plan_that_lacks_something_is_refused(given, said):
    asked = {"analysis": STATED, "people": 12, "sd": 0.05, "studies": 100} | given
    with pytest.raises(pl.PellucidError, match=said):
        pl.plan(asked.pop("analysis"), **asked)


def test_no_bayes_factor_is_larger_than_the_data_can_say():
    found = pl.certify({"d": (np.ones(30), np.exp(0.001 * np.random.default_rng(1).standard_normal(30)))}, {"d": 0.1})
    assert found.end_points["d"].bayes_factor == 1000.0


def test_movements_without_a_value_are_lost_for_the_command_too(monkeypatch):
    """Movements that were found, of which an index has no value, count as those that were not found."""
    monkeypatch.setattr(certified, "SIMULATED_STUDY_COUNT", 1)
    monkeypatch.setattr(certified, "mixed_model", lambda y, who, *_: failed_model(len(who), len(y), "not fitted"))
    spec = AssessmentTable(control=CONTROL, margins={"vmax": "10 %"})
    study = next(each for each in map(random_study, range(20)) if by_command(each, spec).verdict == "transparent")
    blank = [m.condition == WORN and i % 5 == 0 for i, m in enumerate(study.whole.movements)]
    movements = tuple(
        replace(m, values=m.values | {"vmax": float("nan")}) if gone else m
        for m, gone in zip(study.whole.movements, blank, strict=True)
    )
    study.whole = replace(study.whole, movements=movements)
    found = by_command(study, spec)
    assert found.verdict == "cannot say"
    assert "lost movements" in {doubt.what for doubt in found.contradicted("vmax")}


def test_a_registered_text_of_several_lines_and_a_name_with_blanks_are_read_again():
    """A rule of two lines made an analysis.toml that nothing could read."""
    stated = Analysis(control="free", margins={"my index": "10 %"}, exclusions=('fell "asleep"\nor left',))
    again = tomllib.loads(stated.to_toml())
    assert again["exclusions"] == ['fell "asleep"\nor left']
    assert again["margins"] == {"my index": "10 %"}
