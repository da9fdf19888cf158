"""An estimator that runs finds channels that changed, goes on without them, and stops where nothing holds."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid.emg.estimators.cross_validation import score
from pellucid.emg.estimators.emg_session import WATCH_TIMES, add_channel_watch
from pellucid.emg.estimators.live_torque import LiveTorque
from pellucid.emg.estimators.torque_trial import TorqueTrial
from pellucid.emg.models.emg_estimator import (
    WATCH_DEFAULTS,
    EmgEstimatorCard,
    EstimatorChannel,
    EstimatorJoint,
    EstimatorTerm,
    read_estimator_card,
    write_estimator_card,
)

FS = 100.0
WEIGHTS = {"a": 30.0, "b": -25.0, "c": 8.0, "d": 0.5}
"""Torque of each channel [N m]; the last one hardly matters."""


def stride(seconds=12.0, seed=0, name="fitted"):
    """Steps of a joint: every envelope follows the phase, with strides that differ."""
    rng, time = np.random.default_rng(seed), np.arange(round(seconds * FS)) / FS
    phase = 2.0 * np.pi * time / 1.2
    envelopes = {}
    for k, muscle in enumerate(WEIGHTS):
        each = 1.0 + 0.05 * rng.standard_normal(int(seconds / 1.2) + 2)
        envelopes[muscle] = each[(time / 1.2).astype(int)] * (
            0.02 + 0.6 * np.maximum(0.0, np.sin(phase + 1.5 * k)) ** 2
        )
    torque = sum(w * envelopes[m] for m, w in WEIGHTS.items())
    return TorqueTrial(name, "knee", time, envelopes, {"knee": 0.5 * np.sin(phase)}, torque)


def card(trials, left_out_errors=None):
    channels = tuple(
        EstimatorChannel(m, 1.0, 0.0, 2.0 * max(float(t.envelopes[m].max()) for t in trials)) for m in WEIGHTS
    )
    terms = tuple(EstimatorTerm(w, f"emg.{m}") for m, w in WEIGHTS.items())
    joint = EstimatorJoint("knee", 0.0, 0.0, 0.0, 100.0, terms)
    made = EmgEstimatorCard("s", "emg_knee_ridge", channels, ("knee",), (), (joint,), 1.0 / FS, 12.0)
    return add_channel_watch(made, {"knee": trials}, left_out_errors)


def test_the_interval_follows_from_samples_that_were_left_out_of_the_fit():
    trials = [stride()]
    known, fitted = card(trials, {"knee": 2.5}), card(trials)
    assert known.watch.errors == (2.5,)
    assert replace(known, watch=replace(known.watch, errors=fitted.watch.errors)) == fitted
    first = {m: float(x[0]) for m, x in trials[0].envelopes.items()}
    made = LiveTorque(known).step(1.0, first, {"knee": float(trials[0].angles["knee"][0])})
    assert made.half_width["knee"] == pytest.approx(WATCH_DEFAULTS.band_quantile * 2.5 * made.widening)


@pytest.fixture(scope="module")
def watched():
    return card([stride()])


def run(card, trial, **instead):
    """Torque, fault and changed channels of each step, with some envelopes `instead`."""
    live, envelopes = LiveTorque(card), {**trial.envelopes, **instead}
    each = [
        live.step(1.0 + i / FS, {m: x[i] for m, x in envelopes.items()}, {"knee": trial.angles["knee"][i]})
        for i in range(len(trial))
    ]
    return np.array([e.torque["knee"] for e in each]), [e.fault for e in each], [set(e.changed) for e in each]


def test_fitted_recordings_pass_their_own_watch():
    slow, fast = stride(), stride(seed=1, name="fast")
    fast = replace(fast, envelopes={m: 2.0 * x for m, x in fast.envelopes.items()}, torque=2.0 * fast.torque)
    both = card([slow, fast])
    for trial in (slow, fast):
        torque, faults, _ = run(both, trial)
        assert set(faults[1:]) == {"none"}
        assert torque == pytest.approx(trial.torque)


def test_consequence_is_what_a_channel_costs(watched):
    fitted = stride()
    found = {c.name: w.consequence * w.square for c, w in zip(watched.channels, watched.watch.channels, strict=True)}
    wanted = {m: float(np.mean((w * fitted.envelopes[m]) ** 2) / np.var(fitted.torque)) for m, w in WEIGHTS.items()}
    assert found == pytest.approx(wanted)


@pytest.mark.parametrize("gain", [0.3, 1.5, 2.0, 4.0])
def test_a_gain_that_costs_torque_is_named_and_its_pattern_takes_its_place(watched, gain):
    trial = stride(16.0, seed=3)
    at = len(trial) // 4
    spoilt = np.where(np.arange(len(trial)) >= at, gain, 1.0) * trial.envelopes["a"]
    torque, faults, changed = run(watched, trial, a=spoilt)
    assert {"a"} == set().union(*changed)
    first = next(i for i, each in enumerate(changed) if each)
    assert at <= first < at + 5 * FS
    assert faults[first] == "changed"
    after = slice(first, None)
    plain = sum(w * (spoilt if m == "a" else trial.envelopes[m]) for m, w in WEIGHTS.items())
    assert score(trial.torque[after], torque[after]).r2 > 0.9 > score(trial.torque[after], plain[after]).r2


def test_a_change_without_consequence_is_left_alone(watched):
    trial = stride(seed=3)
    torque, faults, _ = run(watched, trial, d=4.0 * trial.envelopes["d"])
    assert set(faults) <= {"restarted", "none", "ceiling"}
    assert np.abs(torque - trial.torque).max() < 2.0


def test_two_exchanged_channels_are_both_named(watched):
    trial = stride(seed=4)
    _, faults, changed = run(watched, trial, a=trial.envelopes["b"], b=trial.envelopes["a"])
    assert changed[-1] == {"a", "b"}
    assert faults[-1] == "changed"


def test_another_effort_of_all_muscles_is_no_change_of_a_channel(watched):
    trial = stride(seed=5)
    torque, faults, changed = run(watched, trial, **{m: 1.6 * x for m, x in trial.envelopes.items()})
    assert set().union(*changed) == set()
    # Single channels lead the others for a part of a stride, in which the interval is wide.
    assert np.mean([fault not in ("restarted", "none") for fault in faults]) < 0.05
    assert torque == pytest.approx(1.6 * trial.torque)


def test_where_most_channels_changed_every_torque_is_zero(watched):
    trial = stride(seed=6)
    rng = np.random.default_rng(0)
    noise = {m: rng.uniform(0.0, 1.0, len(trial)) for m in "abc"}
    torque, faults, _ = run(watched, trial, **noise)
    assert faults[-1] == "unlike"
    assert torque[-1] == 0.0
    silent, faults, _ = run(watched, trial, **{m: 0.2 * x for m, x in trial.envelopes.items()})
    assert (faults[-1], silent[-1]) == ("unlike", 0.0)


def test_where_no_torque_holds_its_interval_has_no_end(watched):
    trial, live = stride(seed=6), LiveTorque(watched)
    quiet = [
        live.step(1.0 + i / FS, {m: 0.2 * x[i] for m, x in trial.envelopes.items()}, {"knee": q})
        for i, q in enumerate(trial.angles["knee"])
    ]
    assert quiet[-1].fault == "unlike"
    assert quiet[-1].half_width["knee"] == np.inf
    # The last answer once more has the last interval.
    again = live.step(1.0, {}, {"knee": 0.0})
    assert (again.fault, again.half_width["knee"]) == ("time", np.inf)
    live.reset()
    assert live.step(1.0, {}, {}).half_width["knee"] == np.inf


def test_a_movement_that_was_never_fitted_stops_it_and_the_fitted_one_lets_it_go_on(watched):
    trial = stride(20.0, seed=7)
    moved = np.where(np.arange(len(trial)) < 600, 2.0, 1.0) * trial.angles["knee"]
    torque, faults, _ = run(watched, replace(trial, angles={"knee": moved}))
    assert "unlike" in faults[:600]
    assert faults[-1] == "none"
    assert torque[-1] == pytest.approx(trial.torque[-1])


def test_a_channel_that_is_mended_is_heard_again(watched):
    trial = stride(30.0, seed=8)
    spoilt = np.where(np.arange(len(trial)) < 800, 2.0, 1.0) * trial.envelopes["a"]
    _, faults, changed = run(watched, trial, a=spoilt)
    assert changed[799] == {"a"}
    assert faults[-1] == "none"


def test_a_lost_channel_is_lost_and_no_change(watched):
    trial = stride(seed=9)
    lost = np.where(np.arange(len(trial)) > 300, np.nan, trial.envelopes["a"])
    _, faults, changed = run(watched, trial, a=lost)
    assert faults[-1] == "channel"
    assert changed[-1] == set()


def test_a_silent_or_dead_channel_is_replaced_by_its_pattern(watched):
    trial = stride(16.0, seed=9)
    late = np.arange(len(trial)) > 300
    for nothing in (np.nan, 0.0):
        torque, faults, _ = run(watched, trial, a=np.where(late, nothing, trial.envelopes["a"]))
        assert set(faults[800:]) == {"channel" if np.isnan(nothing) else "changed"}
        assert score(trial.torque[800:], torque[800:]).r2 > 0.9
        resting = sum(w * (0.0 * late if m == "a" else trial.envelopes[m]) for m, w in WEIGHTS.items())
        assert score(trial.torque[800:], resting[800:]).r2 < 0.6


def test_a_muscle_at_rest_is_no_evidence_of_repair(watched):
    trial, at = stride(30.0, seed=8), 810  # The movement stops where channel a is silent
    still = np.arange(len(trial)) >= at
    stopped = replace(
        trial, angles={"knee": np.where(still, trial.angles["knee"][at], trial.angles["knee"])},
        envelopes={m: np.where(still, x[at], x) for m, x in trial.envelopes.items()},
    )  # fmt: skip
    _, _, changed = run(watched, stopped, a=np.where(still, 1.0, 2.0) * stopped.envelopes["a"])
    assert changed[at - 1] == {"a"}
    assert changed[at + 600] == {"a"}
    # The same time of movement is evidence.
    _, _, changed = run(watched, trial, a=np.where(still, 1.0, 2.0) * trial.envelopes["a"])
    assert changed[-1] == set()


def test_the_interval_widens_by_degrees(watched):
    trial, widest = stride(12.0, seed=3), []
    for gain in (1.0, 1.15, 1.3):
        live, found = LiveTorque(watched), []
        for i in range(len(trial)):
            emg = {m: (gain if m == "a" else 1.0) * x[i] for m, x in trial.envelopes.items()}
            found.append(live.step(1.0 + i / FS, emg, {"knee": trial.angles["knee"][i]}))
        assert all(e.half_width["knee"] == e.widening * found[0].half_width["knee"] / found[0].widening for e in found)
        widest.append(max(e.widening for e in found[:300]))
    assert widest[0] < 1.1 < widest[1] < widest[2]


def test_card_is_read_back_with_its_watch(watched, tmp_path):
    again = read_estimator_card(write_estimator_card(tmp_path / "card.json", watched))
    assert again == watched
    assert again.watch.max_loss == WATCH_DEFAULTS.named_loss
    old = replace(watched, watch=None)
    assert read_estimator_card(write_estimator_card(tmp_path / "old.json", old)).watch is None
    trial = stride(seed=3)
    _, faults, _ = run(old, trial, a=2.0 * trial.envelopes["a"])
    assert set(faults) <= {"restarted", "none", "ceiling"}


def test_a_watch_of_another_cards_channels_is_refused(watched, tmp_path):
    wrong = replace(watched, watch=replace(watched.watch, channels=watched.watch.channels[:2]))
    with pytest.raises(Exception, match="found 2 channels and 1 angles, expected those of the card"):
        read_estimator_card(write_estimator_card(tmp_path / "card.json", wrong))


def test_too_few_samples_make_no_watch():
    short = stride(0.01 * (WATCH_TIMES.min_samples - 10))
    assert card([short]).watch is None


def unrelated(seconds=80.0, seed=0, name="fitted"):
    """Bursts of two muscles that do not depend on the movement: nothing in it tells which of them is active."""
    rng, time = np.random.default_rng(seed), np.arange(round(seconds * FS)) / FS
    knots = np.arange(0.0, seconds + 1.6, 0.8)
    drive = np.interp(time, knots, rng.uniform(-1.0, 1.0, len(knots)))
    envelopes = {"a": 0.02 + 0.4 * np.maximum(drive, 0.0), "b": 0.02 + 0.4 * np.maximum(-drive, 0.0)}
    envelopes = {m: x * (1.0 + 0.05 * rng.standard_normal(len(time))) for m, x in envelopes.items()}
    torque = sum(WEIGHTS[m] * x for m, x in envelopes.items()) + 0.3 * rng.standard_normal(len(time))
    angle = 0.8 + 0.5 * np.sin(2.0 * np.pi * 0.45 * time)
    return TorqueTrial(name, "knee", time, envelopes, {"knee": angle}, torque)


@pytest.fixture(scope="module")
def untold():
    """Card of two muscles whose patterns tell nothing."""
    return two_channel_card([unrelated(20.0, seed=i, name=f"fitted{i}") for i in range(4)])


def two_channel_card(trials):
    channels = tuple(EstimatorChannel(m, 1.0, 0.02, 2.0) for m in "ab")
    terms = tuple(EstimatorTerm(WEIGHTS[m], f"emg.{m}") for m in "ab")
    joint = EstimatorJoint("knee", 0.0, 0.0, 0.0, 100.0, terms)
    made = EmgEstimatorCard("s", "emg_knee_ridge", channels, ("knee",), (), (joint,), 1.0 / FS, 12.0)
    return add_channel_watch(made, {"knee": trials})


@pytest.mark.parametrize("muscle", ["a", "b"])
def test_a_silent_channel_is_named_whatever_the_movement_tells(untold, muscle):
    trial, at = unrelated(20.0, seed=11), 500
    late = np.arange(len(trial)) >= at
    _, faults, changed = run(untold, trial, **{muscle: np.where(late, 0.0, trial.envelopes[muscle])})
    assert not set().union(*changed[:at])
    assert all(muscle in each for each in changed[at + 3 * round(FS) :])
    assert "none" not in faults[at + 3 * round(FS) :]


def test_a_channel_that_stays_at_rest_while_the_others_work_is_named(untold):
    trial = unrelated(40.0, seed=12)
    _, faults, changed = run(untold, trial, a=np.full(len(trial), 0.02))
    assert "a" in changed[-1]
    assert "none" not in faults[round(20.0 * FS) :]


def test_envelopes_that_do_not_depend_on_the_movement_hardly_raise_a_false_alarm(untold):
    named, valid = [], []
    for seed in range(20, 30):
        _, faults, changed = run(untold, unrelated(60.0, seed=seed))
        named.append(bool(set().union(*changed)))
        valid.append(np.mean([fault in ("none", "restarted") for fault in faults]))
        assert "unlike" not in faults
    assert sum(named) <= 1
    assert np.mean(valid) > 0.95


def test_channels_that_no_pattern_tells_apart_are_named_in_the_card(untold, watched, tmp_path):
    assert untold.watch.alike == (("a", "b"),)
    assert watched.watch.alike == ()
    again = read_estimator_card(write_estimator_card(tmp_path / "card.json", untold))
    assert again == untold
