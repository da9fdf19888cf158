"""A prediction beside the paper: what agrees with print counts, what says nothing or the wrong thing does not."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pellucid_lab.papers.able.predicted import ScoredPrediction, friction_drawn, predicted_rows, printed_exponents
from pellucid_lab.papers.able.predicted_sections import predicted_sections
from pellucid_lab.papers.figure import Figures
from pellucid_lab.papers.printed import printed
from pellucid_lab.pointing.prediction import INDICES, Prediction, RobotOutcome
from pellucid_lab.pointing.rig import elbow_participants

LAWS = ("FC", "PCFr", "CLPC")


@cache
def paper():
    return printed("able")


def scored(ratios, spread, seed=1):
    """Pairs whose duration, peak velocity and EMG/Acc are so many times control under each law."""
    rng = np.random.default_rng(seed)
    free = np.ones((1, 6, len(INDICES)))
    worn = []
    for i in range(20):
        values = np.ones((3, 6, len(INDICES)))
        off = np.exp(spread * rng.standard_normal((3, 6, 1)) + spread * rng.standard_normal((3, 1, 1)))
        for name, times in ratios.items():
            values[:, :, INDICES.index(name)] = np.array(times)[:, None]
        worn.append(RobotOutcome(f"drawn-{i}", 0, 0.5, (-1.0, -1.9), False, values * off, 100, 1.0, 1.0))
    made = Prediction(LAWS, ("these",), free, tuple(worn), 12, 1.0)
    return ScoredPrediction(made, made.studies(400, size=6), paper())


def as_printed():
    tables = {"duration": "duration", "vmax": "velocity"}
    times = {
        index: [paper().tables[t][law.lower()]["mean"].value / paper().tables[t]["ctrl"]["mean"].value for law in LAWS]
        for index, t in tables.items()
    }
    return {**times, "duration_median": times["duration"], "emg_per_acc": [1.0, 1.4, 1.8]}


def test_what_is_as_printed_is_inside_and_in_order():
    found = scored(as_printed(), 0.02)
    assert found.inside == 1.0
    assert found.order == 1.0
    assert found.whole_orders == ("duration", "vmax", "emg_order")
    assert found.interval_score() < 0.5 * found.interval_score(no_change=True)
    likely = {f.name: f for f in found.findings}
    assert likely["fc_longer_least"].studies > 0.95
    assert likely["emg_order"].pairs > 0.95
    assert np.isnan(likely["duration_as_tested"].pairs)


def test_what_is_wrong_is_outside_and_out_of_order():
    ratios = {name: times[::-1] for name, times in as_printed().items()}
    found = scored(ratios, 0.01)
    assert found.inside <= 3 / 9
    assert found.order <= 2 / 9
    assert found.interval_score() > 20.0
    assert {f.name: f for f in found.findings}["fc_longer_least"].studies == 0.0


def test_wide_intervals_hold_everything_and_score_badly():
    narrow, wide = scored(as_printed(), 0.02), scored(as_printed(), 0.5)
    assert wide.inside >= 8 / 9
    assert wide.interval_score() > 5.0 * narrow.interval_score()


def test_durations_are_tested_as_the_paper_tested_them():
    """Its own rank sums, 9, 9, 21 and 21 of six people, tell PCFr and CLPC from control and FC not."""
    slower = {"duration": [1.0, 1.2, 1.2], "vmax": [1.0] * 3, "emg_per_acc": [1.0, 1.1, 1.2]}
    found = {f.name: f.studies for f in scored(slower, 0.0).findings}
    assert found["duration_as_tested"] > 0.9
    slower["duration"] = [1.2, 1.2, 1.2]
    assert {f.name: f.studies for f in scored(slower, 0.0).findings}["duration_as_tested"] < 0.1


def test_rows_and_page_say_the_same():
    found = scored(as_printed(), 0.05)
    rows = Figures(predicted_rows(found, None))
    assert rows["able.predicted.duration.fc"].published == pytest.approx(2.4, abs=0.01)
    assert rows["able.predicted.emg_order.clpc"].published == 18.0
    assert rows["able.predicted.inside"].ours == found.inside
    (section,) = predicted_sections(found, None, rows)
    inside = sum(row.cells[-1] == "inside" for row in section.tables[0].rows)
    assert inside == round(9 * found.inside)
    assert "SALib" in section.notes[0]


def test_models_of_people_are_judged_apart():
    """People of one model predict what is printed, those of the other the contrary: half of the draws each."""
    good, bad = as_printed(), {name: times[::-1] for name, times in as_printed().items()}
    one, other = scored(good, 0.02).prediction, scored(bad, 0.02).prediction
    worn = (*one.worn, *(replace(w, model=1) for w in other.worn))
    made = replace(one, models=("these", "those"), control=np.concatenate([one.control] * 2), worn=worn)
    found = ScoredPrediction(made, made.studies(400, size=6), paper())
    assert found.of_models["these"].inside == 1.0
    assert found.of_models["those"].inside < 0.5
    assert found.interval_score() > found.of_models["these"].interval_score()
    rows = Figures(predicted_rows(found, None))
    assert rows["able.predicted.inside.those"].ours == found.of_models["those"].inside
    (section,) = predicted_sections(found, None, rows)
    assert section.folded[0][0] == "By these alone: 9 of 9 inside"


def test_robots_and_exponents_come_from_print():
    low, high = friction_drawn(elbow_participants(), paper())
    assert 1.0 / low == pytest.approx(5.9, abs=0.1)
    assert high == 1.0
    assert printed_exponents(paper()) == (-1.0, -1.9)
