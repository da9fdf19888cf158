"""An experiment predicted: robots as they are drawn, studies of pairs, what is written, and what a screening finds."""

import re
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from html import unescape
from importlib import import_module

import numpy as np
import pytest
from typer.testing import CliRunner

from pellucid._errors import PellucidError, StudyError
from pellucid.cli import app
from pellucid.models.anthropometry import point_mass
from pellucid.people.comparison import compare_conditions
from pellucid.start_study import init
from pellucid.study.results import read_rows
from pellucid_lab.elbow.rig import able_elbow
from pellucid_lab.pointing import prediction, sensitivity
from pellucid_lab.pointing.conditions import identify_cards
from pellucid_lab.pointing.prediction import (
    INDICES,
    NOTHING_CARRIED,
    CarriedWeight,
    Prediction,
    RobotOutcome,
    draw_balanced_lifts,
    draw_robots,
    predict_effects,
)
from pellucid_lab.pointing.rig import elbow_participants
from pellucid_lab.pointing.sensitivity import CHANCE_FACTOR, list_factors, screen_factors
from pellucid_lab.predict import PREDICTION_FILE, predict

K = (-1.0, -1.9)


def fabricated(laws=("A", "B"), robots=5, people=7, models=1, seed=3):
    """Pairs whose indices are numbers alone."""
    rng = np.random.default_rng(seed)
    control = rng.uniform(0.8, 1.2, (models, people, len(INDICES)))
    worn = tuple(
        RobotOutcome(f"drawn-{i + 1}", i % models, 1.0, K, False,
             rng.uniform(1.0, 2.0, (len(laws), people, len(INDICES))),
             people * len(laws) * 10, 1.0, 1.0)
        for i in range(robots)
    )  # fmt: skip
    return Prediction(tuple(laws), tuple("mn"[:models]), control, worn, 10, 1.0)


@pytest.fixture(scope="module")
def cards():
    return identify_cards(able_elbow())


@pytest.fixture
def identified(cards, monkeypatch):
    """Every robot is taken for the committed one, which is identified already."""
    monkeypatch.setattr(prediction, "identify_cards", lambda robot, seed=1: cards)
    return {"controllers": {"CLPC": "clpc"}, "exponents": (K,), "movements": 4, "people": 2, "workers": 1}


def test_robots_have_every_friction_between_the_ends_and_the_rest_of_their_file():
    own = able_elbow()
    made = draw_robots(own, 8, friction=(0.2, 1.0), seed=4)
    levels = np.log([scale / 0.2 for scale, _ in made]) / np.log(5.0)
    assert sorted(np.floor(8.0 * levels)) == list(range(8))
    for scale, robot in made:
        for table, names in prediction.FRICTION_CONSTANTS.items():
            for name in names:
                assert robot[table][name] == pytest.approx(scale * own[table][name])
        low, high = own["drawn"]["transmission.load_motoring"]
        assert low <= robot["transmission"]["load_motoring"] <= high
    shares = [robot["transmission"]["load_motoring"] for _, robot in made]
    assert len({*shares, own["transmission"]["load_motoring"]}) == 9


@pytest.mark.parametrize("movements", [10, 12, 20, 4])
def test_amplitudes_are_as_frequent_as_they_can_be(movements):
    lifts = draw_balanced_lifts(elbow_participants(), movements, np.random.default_rng(1))
    counts = np.unique(lifts.round(6), return_counts=True)[1]
    assert len(lifts) == movements // 2
    assert counts.max() - counts.min() <= 1


def test_the_same_seed_predicts_the_same_wherever_it_is_done(identified):
    rigs = [elbow_participants(), replace(elbow_participants(), name="others")]
    one = predict_effects(rigs, robots=2, seed=5, **identified)
    with ThreadPoolExecutor(2) as pool:
        same = predict_effects(rigs, robots=2, seed=5, executor=pool, **identified)
    assert np.array_equal(one.values, same.values)
    assert np.array_equal(one.control, same.control)
    assert [w.model for w in one.worn] == [0, 1]
    assert one.models == ("elbow-participants", "others")
    assert one.movements == 2 * 2 * 4
    # Another robot and other people: nothing that hangs on the motion is alike.
    assert not np.any(one.values[0, ..., :4] == one.values[1, ..., :4])
    assert np.array_equal(one.of_model(1).values, one.values[1:])


def test_a_study_is_people_on_one_robot_and_its_effect_a_ratio_of_means():
    made = fabricated()
    everybody = made.studies(40, size=7, seed=1)
    of = INDICES.index("vmax")
    for robot, found in zip(everybody.robot, everybody.effect("vmax", "B"), strict=True):
        whole = np.mean(made.values[robot, 1, :, of]) / np.mean(made.control[0, :, of])
        assert found == pytest.approx(100.0 * (whole - 1.0))
    few = made.studies(500, size=3, seed=1)
    of = INDICES.index("antagonists")
    pairs = made.values[:, 0, :, of] / made.control[0, :, of]
    low, _, high = few.interval("antagonists", "A", 1.0)
    assert 100.0 * (np.min(np.sort(pairs)[:, :3].mean(axis=1)) - 1.0) <= low
    assert high <= 100.0 * (np.max(np.sort(pairs)[:, -3:].mean(axis=1)) - 1.0)
    # Nobody takes part twice.
    assert all(len(set(who)) == 3 for who in few.control[:, :, 0])
    narrow, wide = few.interval("duration", "A", 0.5), few.interval("duration", "A", 0.8)
    assert wide[0] < narrow[0] < narrow[1] == wide[1] < narrow[2] < wide[2]
    assert few.interval("unsettled", "A")[1] == pytest.approx(150.0, abs=20.0)


def test_a_load_is_predicted_carried_and_not_carried(identified):
    """A kilogram, in the hand or on the robot: whose law carries it, moves with less effort for the acceleration."""
    asked = identified | {"controllers": {"sensed": "force_sensor"}, "robots": 1, "seed": 2}
    rigs, effort = [elbow_participants()], INDICES.index("emg_per_acc")
    plain = predict_effects(rigs, **asked)
    assert plain.laws == ("sensed",)
    for carried in (CarriedWeight(held=point_mass(1.0, 0.3)), CarriedWeight(load=point_mass(1.0, 0.3))):
        made = predict_effects(rigs, carried=carried, **asked)
        assert made.laws == ("sensed", "sensed_not_carrying")
        with_law, without = made.values[0, :, :, effort]
        there = np.isfinite(with_law) & np.isfinite(without)  # a session that a gate stops has no index
        assert there.any()
        assert np.all((with_law < 0.9 * without)[there])
        # What is in the hand is there without a robot, too; what is on the robot is not.
        same = np.allclose(made.control, plain.control)
        assert same == (carried.held is None)


def test_a_share_of_the_limb_is_what_the_supporting_law_is_built_with():
    carried = CarriedWeight(support=0.6)
    assert carried.settings_of("support") == {"share": 0.6}
    assert carried.without("support") == {"share": 0.0}
    assert carried.settings_of("transparent") == {}
    assert str(carried) == "60 % of the forearm's weight supported"
    both = CarriedWeight(point_mass(1.0, 0.3), point_mass(0.5, 0.32))
    assert str(both) == "a load of 1 kg at 0.3 m on the robot and a load of 0.5 kg at 0.32 m in the hand"


def test_what_cannot_be_drawn_is_refused(identified):
    with pytest.raises(PellucidError, match="found 7 people, expected at least the 8"):
        fabricated().studies(size=8)
    with pytest.raises(PellucidError, match="found 1 robots for 2 models"):
        predict_effects([elbow_participants()] * 2, robots=1)
    with pytest.raises(PellucidError, match="found 5 movements, expected an even number"):
        predict_effects([elbow_participants()], **identified | {"movements": 5})


def test_the_command_tells_intervals_and_keeps_them(tmp_path, monkeypatch):
    asked = {}

    def drawn(rigs, **settings):
        asked.update(settings, rigs=rigs)
        return fabricated(tuple(settings["controllers"]), models=len(rigs))

    monkeypatch.setattr(import_module("pellucid_lab.predict"), "predict_effects", drawn)
    for name in ("these", "those"):
        init(tmp_path / name, rig="elbow-participants")
    these, those = str(tmp_path / "these"), str(tmp_path / "those")
    told = CliRunner().invoke(app, ["predict", these, those, "--people", "7", "--robots", "5", "--controller", "fc"])
    text = (tmp_path / "these" / "lab" / "prediction" / "index.html").read_text(encoding="utf-8")
    assert text.index('class="badge"') < text.index("<svg") < text.index("<main>")
    named = set(re.findall(r'data-id="([^"]+)"', text))
    assert named
    assert named <= {row.id for row in read_rows(tmp_path / "these" / PREDICTION_FILE)}
    assert told.exit_code == 0, told.output
    # The terminal asked "May these figures be used?" where the page answered what the command is for.
    assert " ".join(told.output.split()).startswith("these: Would a study of 6 people show that these")
    # It said "35 robot-person pairs", and not how many studies.
    basis = "Based on 5 robots × 7 people, simulated; numbers are of 4,000 sampled studies, each of 6 people on one"
    assert basis in " ".join(told.output.split())
    assert told.output.splitlines()[-1] == "Next: pellucid init my-session --session elbow"
    assert "80 % of studies of 6 people" in told.output
    assert (asked["people"], asked["robots"], len(asked["rigs"])) == (7, 5, 2)
    rows = {row.id: row for row in read_rows(tmp_path / "these" / PREDICTION_FILE)}
    low, middle, high = (rows[f"these.predicted.vmax.fc{end}"].value for end in (".low", "", ".high"))
    assert low < middle < high
    assert {row.split for row in rows.values()} == {"simulated"}
    assert asked["carried"] == NOTHING_CARRIED
    assert "Carried:" not in text
    told = CliRunner().invoke(app, ["predict", these, "--people", "7", "--held", "0.5", "0.3", "--support", "0.6"])
    assert told.exit_code == 0, told.output
    assert tuple(asked["controllers"]) == ("transparent", "force_sensor", "support")
    assert asked["carried"] == CarriedWeight(None, point_mass(0.5, 0.3), 0.6)
    text = unescape((tmp_path / "these" / "lab" / "prediction" / "index.html").read_text(encoding="utf-8"))
    text = text.replace("\N{NO-BREAK SPACE}", " ").replace("\N{RIGHT SINGLE QUOTATION MARK}", "'")
    assert "Carried: a load of 0.5 kg at 0.3 m in the hand and 60 % of the forearm's weight supported" in text
    notes = {row.note for row in read_rows(tmp_path / "these" / PREDICTION_FILE) if ".vmax." in row.id}
    assert all("a load of 0.5 kg at 0.3 m in the hand" in note for note in notes)
    with pytest.raises(StudyError, match='found no controller "fcc"'):
        predict(these, controllers=["fcc"])
    init(tmp_path / "joint", rig="bench-joint")
    with pytest.raises(StudyError, match="found a rig of kind bench-joint, expected people who point"):
        predict(tmp_path / "joint")
    with pytest.raises(StudyError, match="no such file"):
        predict(tmp_path / "nowhere")


def test_the_answer_is_what_the_study_itself_would_show():
    """It said "yes" of controllers of which the study's own tests could not say: its interval left out no change."""
    made = fabricated(("FC", "PCFr"))
    studies = made.studies(300, size=6)
    shown = studies.shown("duration_median")
    i = INDICES.index("duration_median")
    for law, k in (("FC", 0), ("PCFr", 1)):
        told = []
        for control, worn in zip(studies.control[:, :, i], studies.worn[:, :, :, i], strict=True):
            found = compare_conditions(np.column_stack([control, *worn]), ("Ctrl", "FC", "PCFr"), "Ctrl")
            told.append(found.p_value is not None and found.p_value < 0.05 and found.pair("Ctrl", law) < 0.05)
        assert shown[law] == pytest.approx(np.mean(told))
        assert studies.laws[k] == law


def test_the_next_step_is_a_whole_command_with_the_number_of_people_that_shows_it(tmp_path, monkeypatch):
    """It said "Predict studies of more than 6 people (--participants)", and to record people after a no."""
    made = fabricated(("FC", "CLPC"), people=12)
    i, rng = INDICES.index("duration_median"), np.random.default_rng(5)
    for one in made.worn:
        # FC slows people by about their scatter, CLPC does not.
        one.values[0, :, i] = made.control[0, :, i] + rng.normal(0.1, 0.1, 12)
        one.values[1, :, i] = made.control[0, :, i] + rng.normal(0.0, 0.1, 12)
    monkeypatch.setattr(import_module("pellucid_lab.predict"), "predict_effects", lambda rigs, **settings: made)
    for name in ("these", "those"):
        init(tmp_path / name, rig="elbow-participants")
    these, those = tmp_path / "these", tmp_path / "those"
    found = predict(these, those, robots=5, participants=4, controllers=["fc", "clpc"], seed=3)
    need = found.needed["FC"]
    assert found.answer.verdict == "no"
    assert need > 4
    shown = made.studies(2000, size=need, repeats_people=True).shown("duration_median")["FC"]
    assert shown == pytest.approx(0.8, abs=0.1)
    (step,) = found.answer.next
    assert step.text.startswith(f"People with whom 8 of 10 studies would show it: FC about {need}, CLPC ")
    least = min(n for n in found.needed.values() if n is not None)
    assert step.command == (
        f"pellucid predict {these} {those} --robots 5 --seed 3 --controller fc "
        f"--controller clpc --people {max(12, least)} --participants {least}"
    )
    rows = {row.id: row.value for row in read_rows(these / PREDICTION_FILE)}
    assert rows["these.predicted.duration_median.fc.people_needed"] == need
    (step,) = replace(found, needed={"FC": None, "CLPC": None}).make_answer().next
    assert "FC more than 96, CLPC more than 96. Record a pilot study, because" in step.text


def test_screening_finds_what_an_effect_hangs_on(monkeypatch):
    factors = list_factors(elbow_participants())
    names = [f.name for f in factors]
    told = []

    def effects(rig, factors, point, cards, *others):
        told.append(cards)
        matters, squared = point[names.index("stiffness")], point[names.index("friction")]
        # Nobody's movement ends where both are largest.
        lost = np.nan if matters == squared == 1.0 else 0.0
        return np.array([[7.0 * matters - 2.0 * squared, lost, matters * squared]])

    monkeypatch.setattr(sensitivity, "_effects", effects)
    monkeypatch.setattr(sensitivity, "identify_cards", lambda robot: robot["transmission"]["coulomb_positive"])
    found = screen_factors(elbow_participants(), trajectories=6, controllers={"CLPC": "clpc"}, workers=1, seed=2)
    first = found.strengths_of("CLPC", "duration_median")
    assert list(first)[:2] == ["stiffness", "friction"]
    assert first["stiffness"] == pytest.approx(7.0)
    assert first["friction"] == pytest.approx(2.0)
    assert first[CHANCE_FACTOR] == 0.0
    assert found.direction[0, 0, names.index("friction")] == pytest.approx(-2.0)
    # What hangs on another factor scatters, what does not does not.
    assert found.scatter[0, 0, names.index("stiffness")] == pytest.approx(0.0, abs=1e-9)
    assert found.scatter[0, 2, names.index("stiffness")] > 0.0
    assert found.complete[0, 0] == 6
    assert found.complete[0, 1] < 6
    assert found.runs == 6 * (len(factors) + 1) == len(told)
    assert len(set(told)) <= sensitivity.GRID_LEVEL_COUNT


def test_a_law_without_equation_8_does_not_hang_on_its_exponents(cards):
    rig = elbow_participants()
    factors = list_factors(rig)
    at = np.full(len(factors), 1.0 / 3.0)
    run = (cards, 1, 4, {"CLPC": "clpc", "FC": "fc"}, 1)
    before = sensitivity._effects(rig, factors, at, *run)
    moved = at.copy()
    for name in ("k upwards", "k downwards"):
        moved[[f.name for f in factors].index(name)] = 1.0
    after = sensitivity._effects(rig, factors, moved, *run)
    assert np.array_equal(before[0], after[0])
    assert np.all(before[1] != after[1])
    assert np.all(np.isfinite(before))


def test_ranges_are_those_of_people_or_half_to_double():
    rig = elbow_participants()
    differ = rig.changed({"muscles.stiffness_spread": 0.25})
    by_name = {f.name: f for f in list_factors(differ)}
    assert by_name["stiffness"].spread
    assert (by_name["stiffness"].at(0.0), by_name["stiffness"].at(1.0)) == pytest.approx((3.63, 6.89), abs=0.01)
    own = {f.name: f for f in list_factors(rig)}["stiffness"]
    assert [own.at(u) for u in (0.0, 0.5, 1.0)] == pytest.approx([2.5, 5.0, 10.0])


def test_without_salib_the_error_says_what_to_install(monkeypatch):
    for name in ("SALib", "SALib.analyze", "SALib.sample"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(PellucidError, match="pip install"):
        screen_factors(elbow_participants())
