"""Controllers ranked: the stated rule, who is told from the first, and a page on which every controller stands."""

import json
from dataclasses import replace
from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from pellucid._errors import PellucidError
from pellucid.cli import app
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid_lab.papers.knee.controllers import BODY_LAW_WORDS, CONTROLLER_WORDS
from pellucid_lab.ranking.law_certificate import certificate_words, certify_controller
from pellucid_lab.ranking.rank import rank, rank_task, rows_of
from pellucid_lab.ranking.ranking_page import ranking_answer, write_ranking
from pellucid_lab.ranking.strategies import (
    CONTROLLER_FIELDS,
    POINTING_TASK,
    RANKED_STRATEGIES,
    SIMPLE_RIVALS,
    SWING_TASK,
    WALKING_TASK,
    sensors_read,
    strategies_of_task,
)
from pellucid_lab.ranking.transparency_indices import TRANSPARENCY_INDICES
from pellucid_lab.ranking.tried import ControllerTrial, given_and_taken_power


def made_up(task, pairs=8, seed=1):
    """Torques of all controllers of a task, each a tenth above the one before it in the list, with noise."""
    rng = np.random.default_rng(seed)
    return [
        ControllerTrial(task, name, pair, 0.2 * 1.1**i * np.exp(0.05 * rng.standard_normal()), 0.01, 0.02, **(
            {"duration": 3.0, "peak_velocity": -2.0, "emg": 5.0, "fault_energy": 0.1 * pair,
             "indices": {index.name: 1.1**i + rng.uniform() for index in TRANSPARENCY_INDICES}} if task == POINTING_TASK
            else {"gain": 6.5, "delay": np.inf, "holds": pair > 0 if name == "body" else None}
        ))
        for i, name in enumerate(strategies_of_task(task)) for pair in range(pairs)
    ]  # fmt: skip


def test_every_controller_of_either_joint_is_ranked():
    # Amplification stands once at the elbow; the knee's plain modes are no controllers.
    assert set(strategies_of_task(POINTING_TASK)) >= set(ELBOW_CONTROLLERS) - {"without_friction"}
    assert (
        set(strategies_of_task(SWING_TASK))
        == set(strategies_of_task(WALKING_TASK))
        == {*CONTROLLER_WORDS, *BODY_LAW_WORDS}
    )
    assert all(sensors_read(task, name) for task in CONTROLLER_FIELDS for name in strategies_of_task(task))
    assert all(set(rivals) <= set(strategies_of_task(task)) for task, rivals in SIMPLE_RIVALS.items())


def test_a_strategy_has_words_and_no_name_of_a_constant():
    words = [word for one in RANKED_STRATEGIES for word in (one.name, *one.senses)]
    assert not [word for word in words if "_" in word]
    assert sensors_read(POINTING_TASK, "emg") == "encoder, EMG"


def test_the_order_is_that_of_mean_ranks_and_the_far_are_told_from_the_first():
    found = rank_task(POINTING_TASK, made_up(POINTING_TASK))
    assert list(found.controllers[:3]) == list(strategies_of_task(POINTING_TASK))[:3]
    assert found.ranks == pytest.approx(np.sort(found.ranks))
    assert found.test.p < 1e-6
    assert found.like_first[0]
    assert not found.like_first[-1]
    told = found.ranks - found.ranks[0] > found.critical
    assert list(~told) == list(found.like_first)
    assert found.over("unpowered")[:, found.controllers.index("unpowered")] == pytest.approx(1.0)


def test_under_whom_nobody_arrives_comes_last():
    tried = [
        ControllerTrial(
            POINTING_TASK, one.controller, one.pair, float("nan") if one.controller == "fc" else one.torque, 0.0, 0.0
        )
        for one in made_up(POINTING_TASK, pairs=2)
    ]
    assert rank_task(POINTING_TASK, tried).controllers[-1] == "fc"


def test_one_pair_is_ordered_and_tells_nobody_apart():
    found = rank_task(SWING_TASK, made_up(SWING_TASK, pairs=1))
    assert found.test is None
    assert found.like_first.all()


def test_energy_is_told_by_its_direction():
    power = np.array([2.0, -1.0, 0.0, -3.0])
    assert given_and_taken_power(power, 2.0) == (0.5, 1.0)


def test_the_page_has_every_controller_and_the_worst_of_what_is_safe(tmp_path):
    tasks = [rank_task(task, made_up(task)) for task in CONTROLLER_FIELDS]
    text = write_ranking(tmp_path, tasks, 8, 1).read_text(encoding="utf-8")
    text = unescape(text)
    assert all(one.name in text for task in CONTROLLER_FIELDS for one in strategies_of_task(task).values())
    assert "beyond search" in text
    assert "M4F instructions" not in text  # a column without a value is left out
    assert all(index.words in text and index.source in text for index in TRANSPARENCY_INDICES)
    assert "Its weakness" in text
    rows = {row.id: row for task in tasks for row in rows_of(task)}
    assert rows["ranking.elbow_pointing.fc.fault_energy"].value == pytest.approx(0.7)
    assert rows["ranking.knee_swings.body.holds"].value == 0.0
    assert rows["ranking.knee_swings.body.gain"].value == 6.5
    json.dumps([row.value for row in rows.values()])


def test_the_command_names_a_controller_as_its_answer_and_its_options_do(monkeypatch, tmp_path):
    tasks = [rank_task(POINTING_TASK, made_up(POINTING_TASK))]
    made = SimpleNamespace(tasks=tasks, answer=ranking_answer(tasks, 8), laws=(), page=tmp_path / "index.html", seed=1)
    monkeypatch.setattr("pellucid_lab.ranking.rank.rank", lambda *args, **options: made)
    said = " ".join(CliRunner().invoke(app, ["rank"]).output.split())
    first = tasks[0].controllers[0]
    assert f"{first} {strategies_of_task(POINTING_TASK)[first].name}"[:30] in said
    assert f"with {first} (" in said
    assert any("docs/how-to/bring-your-own-controller.md" in step.text for step in made.answer.next)


def test_no_pairs_are_refused(tmp_path):
    with pytest.raises(PellucidError, match="found 0 pairs and seed 1, expected 1 or more"):
        rank(tmp_path, pairs=0)


def test_a_controller_is_certified_by_what_people_do_and_by_twelve_of_them():
    rng = np.random.default_rng(5)

    def worn(count, slower=0.0):
        return [
            ControllerTrial(POINTING_TASK, "fc", i, 0.3, 0.0, 0.0, duration=slower + d, peak_velocity=v)
            for i, (d, v) in enumerate(rng.normal(0.0, 2.0, (count, 2)))
        ]

    assert certificate_words(worn(12)) == "transparent"
    assert certificate_words(worn(7)) == "cannot say: too few, 7 of 12 people"
    assert certificate_words(worn(1)) == "cannot say: one person"
    assert certify_controller(worn(1)) is None
    assert certificate_words(worn(12, slower=30.0)) == "not transparent"
    assert certificate_words(worn(12, slower=10.0)) == "cannot say"
    never = worn(12)
    never[3] = replace(never[3], duration=float("nan"))
    assert certificate_words(never) == "cannot say"
    assert certify_controller([ControllerTrial(SWING_TASK, "body", 0, 0.3, 0.0, 0.0)]) is None
    tried = [replace(one, duration=0.5 * one.pair) for one in made_up(POINTING_TASK, pairs=12)]
    found = rank_task(POINTING_TASK, tried)
    rows = {row.id: row for row in rows_of(found)}
    assert rows["ranking.elbow_pointing.fc.certificate"].value == 1.0
    assert "duration +2.7 %" in rows["ranking.elbow_pointing.fc.certificate"].note
