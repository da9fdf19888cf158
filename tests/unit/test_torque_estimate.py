"""The torque from EMG during a session: the estimator and the watch are those of a calibration."""

import numpy as np
import pytest

from pellucid.emg.estimators.live_torque import LiveTorque
from pellucid.live.session import torque_estimate
from pellucid.live.session.torque_estimate import (
    JOINT,
    MAX_AGE_S,
    PERIOD_S,
    UNWATCHED_WORDS,
    TorqueEstimator,
    TorqueSamples,
    fit_estimate,
)

MUSCLES = ("a", "b", "c", "d")
STEP_S = 1.0 / 60.0
ROBOT_S, EMG_S = 0.002, 0.001
SPOILT_S = 10.0
SPOILS = {
    "gain": lambda x: 3.0 * x,
    "silent": lambda x: np.zeros_like(x),
}


def moved(seed, seconds=20.0):
    """Return robot's rows, EMG's times and envelopes of cyclic movements under a load that varies slowly."""
    rng = np.random.default_rng(seed)

    def at(t):
        phase = 2 * np.pi * 0.8 * t + 0.3 * np.sin(0.5 * t + seed)
        return 1.0 + 0.5 * np.sin(phase), np.cos(phase)

    time, emg_time = np.arange(0.0, seconds, ROBOT_S), np.arange(0.0, seconds, EMG_S)

    def envelopes(t):
        angle, rate = at(t)
        effort = 1.0 + 0.2 * np.sin(2 * np.pi * 0.11 * t + 2.0 * seed)
        bent = angle - 1.0
        drive = {"a": 0.5 + 0.4 * rate, "b": 0.4 + 0.5 * bent, "c": 0.5 - 0.4 * rate, "d": 0.6 - 0.6 * bent}
        return {m: 1e-4 * effort * np.maximum(x, 0.05) for m, x in drive.items()}

    signal = {m: x * (1 + 0.05 * rng.standard_normal(len(x))) for m, x in envelopes(emg_time).items()}
    true = envelopes(time)
    torque = 1e5 * (true["a"] + 0.7 * true["b"] - true["c"] - 0.8 * true["d"]) + 0.2 * rng.standard_normal(len(time))
    return np.column_stack([time, at(time)[0], torque]), emg_time, signal


def streamed(samples, robot, emg_time, envelopes, begin=0.0):
    """Yield the rows of each step of a session's loop."""
    for now in np.arange(0.0, robot[-1, 0], STEP_S):
        new = (robot[:, 0] > now - STEP_S) & (robot[:, 0] <= now)
        heard = (emg_time > now - STEP_S) & (emg_time <= now)
        shifted = robot[new] + [begin, 0.0, 0.0]
        yield samples.take(shifted, emg_time[heard] + begin, {m: x[heard] for m, x in envelopes.items()})


@pytest.fixture(scope="module")
def fitted():
    estimator, samples = TorqueEstimator(), TorqueSamples()
    for seed in range(3):
        rows = np.concatenate(list(streamed(samples, *moved(seed), begin=100.0 * (seed + 1))))
        is_new = estimator.add_trial(samples.muscles, rows)
        assert is_new is (seed > 0)
    return fit_estimate(*estimator.session_trials()), estimator, samples


def watched(fitted, spoil=None, channel="a"):
    """Return times since the change, estimates and changed channels of a trial that was not fitted."""
    found, estimator, samples = fitted
    estimator.use(found)
    robot, emg_time, envelopes = moved(11)
    if spoil is not None:
        envelopes[channel] = np.where(emg_time < SPOILT_S, envelopes[channel], spoil(envelopes[channel]))
    begin, made = 100.0 * (samples._next * PERIOD_S // 100.0 + 1), []
    for rows in streamed(samples, robot, emg_time, envelopes, begin):
        if len(rows):
            estimate = estimator.estimate(samples.muscles, rows)
            made.append((rows[-1, 0] - begin - SPOILT_S, estimate, estimator.changed))
    return made


@pytest.mark.parametrize("channel", ["a", "d"])
@pytest.mark.parametrize("spoil", SPOILS)
def test_a_changed_channel_is_named_and_widens_the_interval(fitted, spoil, channel):
    made = watched(fitted, SPOILS[spoil], channel)
    assert not any(changed for since, _, changed in made if since < 0.0)
    assert any(changed == (channel,) for since, _, changed in made if 0.0 < since < 2.0)
    before = np.median([e.half_width for since, e, _ in made if e is not None and -5.0 < since < 0.0])
    after = [np.inf if e is None else e.half_width for since, e, _ in made if 0.0 < since < 2.0]
    assert max(after) > 1.5 * before


def test_no_channel_of_an_unspoilt_trial_is_named(fitted):
    made = watched(fitted)
    assert not any(changed for _, _, changed in made)
    shown = [e for since, e, _ in made if since > 1.0 - SPOILT_S]
    assert all(e is not None for e in shown)
    assert fitted[0].error < 0.3 * fitted[0].error_of_mean
    assert max(e.half_width for e in shown) < 2.0 * 1.645 * fitted[0].error


def test_the_estimates_are_those_of_a_live_estimator_with_the_same_card(fitted):
    found, estimator, samples = fitted
    estimator.use(found)
    live = LiveTorque(found.card)
    robot, emg_time, envelopes = moved(12)
    envelopes["b"] = np.where(emg_time < SPOILT_S, envelopes["b"], 0.0)
    compared = 0
    for rows in streamed(samples, robot, emg_time, envelopes, 100.0 * (samples._next * PERIOD_S // 100.0 + 1)):
        if not len(rows):
            continue
        estimate = estimator.estimate(samples.muscles, rows)
        for time, angle, _, *levels in rows:
            expected = live.step(time, dict(zip(MUSCLES, levels, strict=True)), {JOINT: angle})
        assert estimator.changed == expected.changed
        if estimate is not None:
            assert (estimate.torque, estimate.half_width) == (expected.torque[JOINT], expected.half_width[JOINT])
            compared += 1
    assert compared > 500


def held(seed, seconds=30.0):
    """Return the same of long efforts and rests at one posture, whose torque follows EMG."""
    rng = np.random.default_rng(seed)
    time, emg_time = np.arange(0.0, seconds, ROBOT_S), np.arange(0.0, seconds, EMG_S)

    def effort(t):
        return 0.03 + 0.5 * np.clip(4.0 * np.sin(2 * np.pi * 0.05 * t + seed), 0.0, 1.0)

    noise = {m: 1 + 0.05 * rng.standard_normal(len(emg_time)) for m in MUSCLES}
    envelopes = {m: 1e-4 * effort(emg_time) * x for m, x in noise.items()}
    torque = 5.0 * effort(time) + 0.1 * rng.standard_normal(len(time))
    angle = 1.0 + 0.01 * np.sin(2 * np.pi * 0.3 * time + seed)
    return np.column_stack([time, angle, torque]), emg_time, envelopes


@pytest.mark.parametrize("words", ["", UNWATCHED_WORDS])
def test_a_torque_that_no_movement_tells_is_estimated(words, monkeypatch):
    """Rest looked unlike the efforts before it, so that a third of a held posture had no torque."""
    if words:  # as if its watch refused too much
        monkeypatch.setattr(torque_estimate, "MAX_REFUSED_SHARE", -1.0)
    estimator, samples = TorqueEstimator(), TorqueSamples()
    for seed in range(3):
        estimator.add_trial(samples.muscles, np.concatenate(list(streamed(samples, *held(seed), 100.0 * (seed + 1)))))
    estimator.use(fit_estimate(*estimator.session_trials()))
    parts = [rows for rows in streamed(samples, *held(11), 500.0) if len(rows)]
    made = [(rows[-1, 2], estimator.estimate(samples.muscles, rows)) for rows in parts]
    made = made[len(made) // 10 :]
    given = [(torque, each) for torque, each in made if each is not None]
    assert len(given) > 0.95 * len(made)
    assert np.mean([abs(torque - each.torque) <= each.half_width for torque, each in given]) > 0.8
    assert estimator.fault == words


@pytest.mark.parametrize("is_related", [True, False])
def test_an_estimate_that_loses_to_a_mean_is_not_given(is_related):
    rng, estimator = np.random.default_rng(2), TorqueEstimator()
    for trial in range(3):
        time = 10.0 * trial + PERIOD_S * np.arange(400)
        levels = rng.uniform(0.0, 1.0, (400, 2))
        # Without a relation, each trial has a torque of its own, which a regression takes for its features' work.
        torque = 10.0 * (levels[:, 0] - levels[:, 1])
        torque = torque if is_related else rng.normal(0.0, 5.0) + rng.normal(0.0, 2.0, 400)
        angle = rng.normal(0.0, 0.01, 400)
        rows = np.column_stack([time, angle, torque, levels])
        estimator.add_trial(("a", "b"), rows)
    estimator.use(fit_estimate(*estimator.session_trials()))
    assert estimator.is_useful is is_related
    rows[:, 0] += 10.0
    shown = [estimator.estimate(("a", "b"), rows[i : i + 1]) for i in range(100)]
    assert any(each is not None for each in shown) is is_related


@pytest.mark.parametrize("torque", [0.0, np.nan])
def test_trials_without_a_measured_torque_are_not_fitted(torque):
    rows = np.column_stack([PERIOD_S * np.arange(400), *np.random.default_rng(1).uniform(size=(4, 400))])
    rows[:, 2] = torque
    estimator = TorqueEstimator()
    assert not any(estimator.add_trial(("a", "b"), rows) for _ in range(3))


def test_a_trial_is_fitted_in_parts_without_missing_samples_and_pauses():
    rng = np.random.default_rng(1)
    rows = np.column_stack([PERIOD_S * np.arange(400), *rng.uniform(size=(4, 400))])
    rows[100, 3] = np.nan
    rows[220:, 0] += 3.0 * PERIOD_S
    rows[240, 1] = np.nan  # The part between the pause and this sample is too short
    estimator = TorqueEstimator()
    estimator.add_trial(("a", "b"), rows)
    made, _ = estimator.session_trials()
    parts = [rows[:100], rows[101:220], rows[241:]]
    assert [(t.time[0], t.time[-1], len(t)) for t in made] == [(p[0, 0], p[-1, 0], len(p)) for p in parts]


def test_there_is_no_estimate_where_a_sample_is_missing(fitted):
    found, estimator, samples = fitted
    estimator.use(found)
    rows = np.concatenate(list(streamed(samples, *moved(3, 2.0), begin=5000.0)))
    assert estimator.estimate(samples.muscles, rows) is not None
    for column in (1, 3):
        lacking = rows[-1:].copy()
        lacking[0, [0, column]] = lacking[0, 0] + PERIOD_S, np.nan
        assert estimator.estimate(samples.muscles, lacking) is None
        rows = lacking
    assert estimator.estimate(("a", "b"), rows[:, :5]) is None


def test_steps_wait_for_emg_but_not_for_long():
    samples = TorqueSamples()
    robot = np.column_stack([np.arange(10.0, 10.1, 0.01), np.arange(10), np.zeros(10)])
    samples.take(robot[:1], np.array([10.0]), {"a": np.array([1.0])})
    assert len(samples.take(robot, np.empty(0), {})) == 0
    rows = samples.take(robot[:0], np.array([10.05]), {"a": np.array([2.0])})
    assert rows[:, 0] == pytest.approx([10.02, 10.04])
    assert rows[:, 3] == pytest.approx([1.0, 1.0])
    late = np.array([[10.1 + 2.0 * MAX_AGE_S, 0.0, 0.0]])
    rows = samples.take(late, np.empty(0), {})
    assert rows[-1, 0] == pytest.approx(late[0, 0] - MAX_AGE_S, abs=PERIOD_S)
    assert np.isnan(rows[-1, 1:]).any()
