"""Activations near EMG with which a torque follows: solved exactly, and judged by electrodes taken away."""

from dataclasses import replace

import made_muscles
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from pellucid._errors import PellucidError
from pellucid.emg.estimators.hill import fit_hill, minimise_bounded_quadratic
from pellucid.emg.estimators.unrecorded import (
    AssistanceWeights,
    EnvelopeFiller,
    SingleJointMuscles,
    choose_trust,
    find_removable_channels,
    make_assisted_muscles,
    score_filling_methods,
    torque_standard_deviations,
)
from pellucid.emg.study.activations.activations_page import page
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import activations

STUDY = """
name = "leg"
[rig]
joint = "leg"
motion = "rotary"
lifts = "extension"
[channels]
time = {{ column = "time", unit = "s" }}
angle.hip = {{ column = "hip", unit = "rad" }}
angle.knee = {{ column = "knee", unit = "rad" }}
moment.knee = {{ column = "moment", unit = "N*m" }}
{channels}
[emg_torque]
joints = ["knee"]
chain = "none"
[activations]
{more}
[[recordings]]
name = "first"
file = "first.csv"
use = "fit"
[[recordings]]
name = "second"
file = "second.csv"
use = "{use}"
"""


def drawings_of(page):
    """Return every drawing of a page by name: that of its answer and those of its sections."""
    found = [drawing for section in page.sections for drawing in section.drawings]
    return {drawing.name: drawing for drawing in (page.figure, *found)}


def grouped(seconds, *, seed=0, muscles=made_muscles.MUSCLES):
    """Envelopes of two synergies: extensors, flexors."""
    rng, time = np.random.default_rng(seed), np.arange(round(seconds * made_muscles.FS)) / made_muscles.FS
    active = []
    for shift in (0.0, 0.4):
        x = np.zeros(len(time))
        for centre in np.arange(0.3 + shift, seconds, 0.9) + rng.uniform(-0.1, 0.1):
            x += rng.uniform(0.3, 0.9) * np.exp(-(((time - centre) / 0.12) ** 2))
        active.append(x)
    weights = np.array([[0.6, 0.9, 0.8, 0.05, 0.1], [0.2, 0.0, 0.05, 0.9, 0.7]])[:, : len(muscles)]
    made = np.array(active).T @ weights + 0.01 * np.abs(rng.standard_normal((len(time), len(muscles))))
    return dict(zip(muscles, np.clip(made, 0.0, 1.0).T, strict=True))


@pytest.fixture(scope="module")
def leg():
    """Two trials of muscles in groups, the second to judge, and their calibration."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(made_muscles, "envelopes", grouped)
        first = made_muscles.trial("first", seed=1)
        second = made_muscles.trial("second", seed=2, heldout=True)
    return SingleJointMuscles(fit_hill([first], weights=(0.01,))), {"knee": first}, {"knee": second}


def study(folder, leg, *, more="", use="validate"):
    folder.mkdir()
    for across in leg[1:]:
        trial = next(iter(across.values()))
        columns = {"time": trial.time, **trial.angles, "moment": trial.torque, **trial.envelopes}
        np.savetxt(
            folder / f"{trial.name}.csv", np.column_stack(list(columns.values())), delimiter=",",
            header=",".join(columns), comments="", fmt="%.6g",
        )  # fmt: skip
    channels = "\n".join(f'emg.{m} = {{ column = "{m}", unit = "1" }}' for m in made_muscles.MUSCLES)
    (folder / "study.toml").write_text(STUDY.format(channels=channels, more=more, use=use), encoding="utf-8")
    return open_study(folder)


def moved_by(across, torque):
    return {joint: replace(trial, torque=trial.torque + torque) for joint, trial in across.items()}


@pytest.mark.parametrize("joints", [1, 2])
def test_each_sample_is_solved_as_bounded_least_squares_would(joints):
    rng, muscles, count = np.random.default_rng(joints), 6, 60
    gain, wanted = 30.0 * rng.standard_normal((joints, muscles, count)), 40.0 * rng.standard_normal((joints, count))
    centre, weight = rng.random((muscles, count)), rng.uniform(0.01, 3.0, muscles)
    scale = rng.uniform(5.0, 20.0, joints)
    found = minimise_bounded_quadratic(gain, wanted, centre, weight, scale)
    for i in range(count):
        rows = np.vstack([gain[:, :, i] / scale[:, None], np.diag(np.sqrt(weight))])
        right = np.concatenate([wanted[:, i] / scale, np.sqrt(weight) * centre[:, i]])
        assert found[:, i] == pytest.approx(lsq_linear(rows, right, (0.0, 1.0), tol=1e-12).x, abs=1e-6)


def test_trust_leads_from_the_torque_to_the_emg(leg):
    fitted, first, second = leg
    muscles, own = make_assisted_muscles(fitted, moved_by(second, 5.0), torque_standard_deviations([first]))
    moved, missed = [], []
    for trust in (1e-3, 1.0, 1e6):
        a = muscles.find_activations(trust=trust, effort=1.0)
        assert a.min() >= 0.0
        assert a.max() <= 1.0
        moved.append(float(np.abs(a - muscles.recorded)[:, own].max()))
        missed.append(float(np.sqrt(np.mean((muscles.torque(a)[0, own] - second["knee"].torque - 5.0) ** 2))))
    assert moved[0] > moved[1] > moved[2]
    assert moved[2] < 1e-4
    assert missed[0] < missed[1] < missed[2]


def test_the_force_at_once_is_the_force_of_the_muscle(leg):
    fitted, first, second = leg
    muscles, own = make_assisted_muscles(fitted, second, torque_standard_deviations([first]))
    assert muscles.torque(muscles.recorded)[0, own] == pytest.approx(fitted.predict(second)["knee"], abs=1e-6)


def test_synergies_and_a_linear_map_fill_in_what_moves_in_groups(leg):
    fitted, first, second = leg
    found = score_filling_methods(fitted, [first], [second], AssistanceWeights(30.0, 3.0))
    r2 = {way: np.median([e.r2 for e in found if e.way == way]) for way in ("synergies", "linear", "static", "rest")}
    assert r2["synergies"] > 0.8
    assert r2["linear"] > 0.8
    assert max(r2["static"], r2["rest"]) < r2["synergies"]
    assert all((each.torque is None) == (each.way in ("synergies_assisted", "assisted", "static")) for each in found)
    with pytest.raises(PellucidError, match="held-out trial among the fitted"):
        score_filling_methods(fitted, [second], [first], AssistanceWeights(30.0, 3.0))


def test_an_electrode_taken_away_is_not_looked_at(leg):
    fitted, first, second = leg
    knee = second["knee"]
    spoilt = {"knee": replace(knee, envelopes={**knee.envelopes, "vastus_lateralis": np.ones(len(knee))})}
    for way in ("synergies", "linear", "pattern", "rest"):
        made = [
            EnvelopeFiller([first]).fill_in(t, ("vastus_lateralis",), way)["knee"].envelopes for t in (second, spoilt)
        ]
        assert np.array_equal(made[0]["vastus_lateralis"], made[1]["vastus_lateralis"])
    _, lost = find_removable_channels(fitted, second)["vastus_lateralis"]
    assert {list(fitted.driven)[i] for i in lost} == {"vastus_lateralis", "vastus_intermedius"}
    told = [
        make_assisted_muscles(fitted, t, torque_standard_deviations([first]))[0].find_activations(
            lost, trust=10.0, effort=1.0
        )
        for t in (second, spoilt)
    ]
    assert told[0] == pytest.approx(told[1])


def test_the_trust_is_chosen_from_what_is_fitted(leg):
    fitted, first, _ = leg
    assert choose_trust(fitted, [first]).chosen


def test_a_study_has_activations_tables_and_a_page(tmp_path, leg):
    opened = study(tmp_path / "leg", leg, more="trust = 30\neffort = 3")
    found = activations(opened)
    rows = {row.id: row for row in found.rows}
    # The recording is held out; its note says that the method was told the torque.
    assert rows["leg.knee.second.assisted.r2"].split == "heldout"
    assert "not a test" in rows["leg.knee.second.assisted.r2"].note
    assert rows["leg.knee.second.emg_driven.r2"].split == "heldout"
    assert not rows["leg.knee.second.emg_driven.r2"].note
    assert rows["leg.knee.left_out.synergies.r2"].value > 0.8
    assert any("not a test" in verdict.said for verdict in found.verdicts)
    found.save(opened)
    table = np.loadtxt(opened.folder / "tables" / "activations_knee_second.csv", delimiter=",", skiprows=1)
    assert table.shape[0] == len(leg[2]["knee"])
    drawn = drawings_of(page(opened, found))
    assert set(drawn) == {"ways_1", "taken_away_1", "activations_1"}


def test_a_lost_electrode_is_filled_in(tmp_path, leg):
    opened = study(tmp_path / "leg", leg, more='trust = 30\neffort = 3\nlost = ["semimembranosus"]')
    found = activations(opened)
    assert "semimembranosus" in found.recordings[0].filled
    assert not any(each.channel == "semimembranosus" for _, each in found.left_out)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"more": 'trust = 30\neffort = 3\nlost = ["soleus"]'}, "expected soleus there"),
        ({"more": "trust = 30"}, "expected both or neither"),
        ({"more": "trust = -1\neffort = 3"}, "greater than 0"),
    ],
)
def test_what_cannot_be_answered_is_refused(tmp_path, leg, options, said):
    with pytest.raises(PellucidError, match=said):
        activations(study(tmp_path / "leg", leg, **options))


def test_nothing_to_judge_is_refused(tmp_path, leg):
    opened = study(tmp_path / "leg", leg)
    text = (opened.folder / "study.toml").read_text().rpartition("[[recordings]]")[0]
    (opened.folder / "study.toml").write_text(text, encoding="utf-8")
    with pytest.raises(PellucidError, match="expected one to fit and one held out"):
        activations(open_study(opened.folder))


def walking_leg(folder):
    """A study of knee and ankle, whose torques one set of muscles made."""
    folder.mkdir()
    for name, seed in (("first", 1), ("second", 2)):
        across = made_muscles.across(name, seconds=5.0, seed=seed, noise=0.5)
        trial = across["knee"]
        columns = {"time": trial.time, **trial.angles, **{f"moment_{j}": t.torque for j, t in across.items()}}
        columns |= trial.envelopes
        np.savetxt(
            folder / f"{name}.csv", np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns),
            comments="", fmt="%.6g",
        )  # fmt: skip
    channels = [f'emg.{m} = {{ column = "{m}", unit = "1" }}' for m in made_muscles.LEG]
    channels += ['angle.ankle = { column = "ankle", unit = "rad" }']
    channels += ['moment.ankle = { column = "moment_ankle", unit = "N*m" }']
    text = STUDY.format(channels="\n".join(channels), more="trust = 30\neffort = 3", use="validate")
    text = text.replace('column = "moment"', 'column = "moment_knee"').replace('["knee"]', '["knee", "ankle"]')
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return open_study(folder)


def test_muscles_of_two_joints_are_one_calibration(tmp_path):
    opened = walking_leg(tmp_path / "leg")
    found = activations(opened)
    rows = {row.id: row for row in found.rows}
    for joint in ("knee", "ankle"):
        assert rows[f"leg.together.{joint}.second.emg_driven.r2"].value > 0.95
        assert rows[f"leg.together.{joint}.second.emg_driven.r2"].split == "heldout"
    (one,) = found.recordings
    assert one.muscles.count("gastrocnemius_medialis") == 1
    assert {each.channel for _, each in found.left_out} >= {"soleus", "gastrocnemius_medialis", "vastus_lateralis"}
    told = next(e for _, e in found.left_out if e.channel == "gastrocnemius_medialis" and e.torque is not None)
    assert set(told.torque) == {"knee", "ankle"}
    found.save(opened)
    heads = (opened.folder / "tables" / "activations_together_second.csv").read_text().partition("\n")[0].split(",")
    assert heads[1:7] == [f"{x}_{j}_Nm" for j in ("knee", "ankle") for x in ("torque", "emg_driven", "assisted")]
    drawn = drawings_of(page(opened, found))
    assert set(drawn) == {"ways_1", "taken_away_1", "activations_1"}
