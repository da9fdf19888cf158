"""Channels against what they were when an estimator was fitted: what changed is named, and what did not is not."""

from dataclasses import replace

import numpy as np
import pytest
from made_walking import MUSCLES, TOPS, changed, walking

from pellucid._errors import IdentificationError
from pellucid.emg.estimators.emg_session import FittedSession, _ratio_words
from pellucid.emg.estimators.ridge import Ridge
from pellucid.emg.study.emg_torque.sessions import session_verdicts


@pytest.fixture(scope="module")
def session():
    return FittedSession.from_trials([walking(0, seconds=6.0)])


def at_paces(paces, seed=0):
    """Walking at several cadences: faster, each muscle works more by a factor of its own, and its floor rises."""
    rng = np.random.default_rng(seed)
    exponent = dict(zip(MUSCLES, rng.uniform(0.5, 5.0, len(MUSCLES)), strict=True))
    trials = []
    for i, pace in enumerate(paces):
        trial = walking(10 * seed + i, seconds=12.0 / pace, cadence=0.9 * pace)
        gain = {m: pace ** exponent[m] for m in MUSCLES}
        floor = {m: 0.3 * max(pace - 1.0, 0.0) * np.max(x) for m, x in trial.envelopes.items()}
        trials.append(changed(trial, **{m: gain[m] * (x + floor[m]) for m, x in trial.envelopes.items()}))
    return trials


PACES = [(1.0,), (0.8, 1.2), (0.8, 1.0, 1.2), (0.7, 1.6), (0.6, 1.0, 1.7)]


@pytest.mark.parametrize("paces", PACES, ids=str)
@pytest.mark.parametrize("seed", range(4))
def test_what_was_fitted_passes_the_comparison_with_itself(paces, seed):
    trials = at_paces(paces, seed)
    own = FittedSession.from_trials(trials)
    for trial in trials:
        found = own.compare(trial)
        assert found.changes == ()
        assert found.is_valid


def stretches(trial):
    """Parts of a trial of 5 to 6 s, one every second."""
    for end in range(500, len(trial) + 1, 100):
        part = slice(max(0, end - 600), end)
        envelopes = {m: x[part] for m, x in trial.envelopes.items()}
        angles = {j: q[part] for j, q in trial.angles.items()}
        yield replace(trial, time=trial.time[part], torque=trial.torque[part], envelopes=envelopes, angles=angles)


@pytest.mark.parametrize("paces", PACES, ids=str)
def test_every_stretch_of_what_was_fitted_passes_the_comparison(paces):
    trials = at_paces(paces, seed=5)
    own = FittedSession.from_trials(trials)
    for trial in trials:
        for stretch in stretches(trial):
            found = own.compare(stretch)
            assert (found.changes, found.is_valid) == ((), True)


@pytest.mark.parametrize("paces", PACES[1:], ids=str)
def test_every_stretch_of_a_trial_that_changes_its_pace_passes_the_comparison(paces):
    """The ranges of the whole trial are those of neither pace."""
    trials = at_paces(paces, seed=5)

    def joined(each):
        return {name: np.concatenate([each(t)[name] for t in trials]) for name in each(trials[0])}

    torque = np.concatenate([t.torque for t in trials])
    trial = replace(
        trials[0], time=np.arange(len(torque)) / trials[0].fs, torque=torque, envelopes=joined(lambda t: t.envelopes),
        angles=joined(lambda t: t.angles),
    )  # fmt: skip
    own = FittedSession.from_trials([trial])
    for stretch in stretches(trial):
        found = own.compare(stretch)
        assert (found.changes, found.is_valid) == ((), True)


@pytest.mark.parametrize("pace", [0.7, 0.9, 1.1])
def test_a_pace_between_those_fitted_is_the_same_session(pace):
    own = FittedSession.from_trials(at_paces((0.6, 1.0, 1.2), seed=1))
    (trial,) = at_paces((pace,), seed=1)
    found = own.compare(trial)
    assert found.changes == ()
    assert found.is_valid


@pytest.mark.parametrize("pace", [0.7, 1.0, 1.6])
def test_a_channel_that_changed_is_named_beside_several_paces(pace):
    own = FittedSession.from_trials(at_paces((0.7, 1.0, 1.6), seed=2))
    (trial,) = at_paces((pace,), seed=2)
    x = trial.envelopes
    spoilt = changed(trial, soleus=40.0 * x["soleus"])
    assert own.compare(spoilt).changed == ("soleus",)
    spoilt = changed(trial, tibialis=x["hamstring"], hamstring=x["tibialis"])
    assert set(own.compare(spoilt).changed) == {"tibialis", "hamstring"}


def test_a_channel_is_brought_back_to_the_trial_whose_other_channels_it_is_like():
    trials = at_paces((0.7, 1.6), seed=2)
    own = FittedSession.from_trials(trials)
    for trial in trials:
        x = trial.envelopes["soleus"]
        back = own.rescale(changed(trial, soleus=30.0 * x + 1.0), 6.0, ["soleus"]).envelopes["soleus"]
        np.testing.assert_allclose(np.ptp(back), np.ptp(x), rtol=0.5)


@pytest.mark.parametrize("seed", range(1, 9))
def test_another_minute_of_the_same_walking_is_the_same_session(session, seed):
    found = session.compare(walking(seed))
    assert found.changes == ()
    assert found.is_valid


@pytest.mark.parametrize("muscle", MUSCLES)
def test_a_floor_that_rose_is_named(session, muscle):
    trial = walking(1)
    x = trial.envelopes[muscle]
    found = session.compare(changed(trial, **{muscle: 2.6 * x + 0.6 * np.max(x)}))
    assert found.changed == (muscle,)
    assert {change.kind for change in found.changes} >= {"floor"}
    assert found.is_valid


def test_a_gain_is_named_where_the_others_stay(session):
    trial = walking(1)
    found = session.compare(changed(trial, vastus=5.0 * trial.envelopes["vastus"]))
    assert [(c.muscle, c.kind) for c in found.changes] == [("vastus", "level")]


@pytest.mark.parametrize(("ratio", "words"), [(0.3, "0.3"), (0.3332, "0.33"), (3.004, "3.004"), (6.0, "6")])
def test_a_range_beyond_its_limit_never_reads_as_within_it(ratio, words):
    """A range of 0.3 times was reported, where 0.3 to 3 times were expected."""
    assert _ratio_words(ratio) == words


def test_a_channel_that_is_held_at_zero_is_no_gain_and_is_not_rescaled(session):
    trial = walking(1)
    dead = changed(trial, vastus=0.0 * trial.envelopes["vastus"])
    found = session.compare(dead)
    assert [(c.muscle, c.kind, c.found) for c in found.changes] == [("vastus", "silent", "a constant envelope of 0")]
    assert not session.repair(dead, 3.0, found).envelopes["vastus"].any()
    advice = [verdict.do for rescaled in (False, True) for verdict in session_verdicts({"a": found}, rescaled)]
    assert advice == ["Attach the electrode and connect its cable; scaling cannot repair this."] * 2


def test_what_all_channels_changed_by_is_taken_off(session):
    trial = walking(1, strength=2.0)
    vastus = trial.envelopes["vastus"]
    assert session.compare(changed(trial, vastus=1.8 * vastus)).changes == ()
    assert session.compare(changed(trial, vastus=6.0 * vastus)).changed == ("vastus",)


@pytest.mark.parametrize("pair", [("soleus", "tibialis"), ("vastus", "rectus"), ("hamstring", "soleus")])
def test_two_channels_exchanged_are_both_named(session, pair):
    trial = walking(1)
    a, b = pair
    found = session.compare(changed(trial, **{a: trial.envelopes[b], b: trial.envelopes[a]}))
    assert set(found.changed) == set(pair)


def test_more_effort_is_no_electrode(session):
    found = session.compare(walking(1, strength=8.0))
    assert found.changes == ()
    assert found.has_other_effort
    assert not found.is_valid


def test_a_movement_beyond_the_fitted_ones_does_not_hold(session):
    found = session.compare(walking(1, cadence=2.0))
    assert found.own_correlation == {}  # no pattern is asked of a movement that was not seen
    assert found.outside_share > 0.5
    assert not found.is_valid


def test_a_few_seconds_bring_a_channel_back(session):
    trial = walking(1)
    spoilt = changed(trial, soleus=2.6 * trial.envelopes["soleus"] + 0.06)
    back = session.rescale(spoilt, 3.0, ["soleus"]).envelopes
    assert np.max(np.abs(back["soleus"] - trial.envelopes["soleus"])) < 0.3 * TOPS[0]
    assert all(back[m] is trial.envelopes[m] for m in MUSCLES if m != "soleus")


def test_another_muscle_s_signal_in_a_channel_is_named_with_the_muscle(session):
    trial = walking(1)
    copy = 0.5 * trial.envelopes["vastus"]
    found = session.compare(changed(trial, hamstring=copy))
    assert [(c.muscle, c.kind, c.other) for c in found.changes if c.kind == "crosstalk"] == [
        ("hamstring", "crosstalk", "vastus")
    ]
    assert set(found.changed) == {"hamstring"}


def test_what_changed_is_mended_by_what_it_is(session):
    trial = walking(1)
    x = trial.envelopes
    spoilt = changed(trial, soleus=2.6 * x["soleus"] + 0.06, vastus=x["hamstring"], hamstring=x["vastus"])
    back = session.repair(spoilt, 3.0, session.compare(spoilt)).envelopes
    assert back["vastus"] is x["vastus"]
    assert back["hamstring"] is x["hamstring"]
    assert np.max(np.abs(back["soleus"] - x["soleus"])) < 0.3 * TOPS[0]
    copied = changed(trial, hamstring=0.5 * x["vastus"])
    told = session.repair(copied, 3.0, session.compare(copied)).envelopes["hamstring"]
    assert np.corrcoef(told, x["hamstring"])[0, 1] > np.corrcoef(copied.envelopes["hamstring"], x["hamstring"])[0, 1]


def test_what_the_others_tell_takes_a_channel_s_place():
    rng = np.random.default_rng(3)
    trial = walking(0)
    # Two heads of one muscle, as far as envelopes tell.
    trial = changed(trial, rectus=0.5 * trial.envelopes["vastus"] + 1e-4 * rng.uniform(size=len(trial)))
    own = FittedSession.from_trials([trial])
    other = changed(walking(2))
    other = changed(other, rectus=0.5 * other.envelopes["vastus"])
    without = own.predict_channels(changed(other, rectus=np.ones(len(other))), ["rectus"]).envelopes["rectus"]
    np.testing.assert_allclose(without, other.envelopes["rectus"], atol=0.1 * np.max(other.envelopes["rectus"]))
    with pytest.raises(IdentificationError, match="found no unchanged channel"):
        own.predict_channels(other, MUSCLES)


def test_trials_with_other_muscles_are_refused():
    trial = walking(0)
    fewer = replace(trial, envelopes={"soleus": trial.envelopes["soleus"]})
    with pytest.raises(IdentificationError, match="same muscles and angles"):
        FittedSession.from_trials([trial, fewer])


def test_patterns_of_several_channels_share_one_decomposition():
    rng = np.random.default_rng(3)
    motion = rng.standard_normal((400, 6)) @ rng.standard_normal((6, 6))
    envelopes = rng.random((400, 4)) + 0.2 * motion[:, :1] ** 2
    for penalty in (0.0, 10.0):
        ridge = Ridge(penalty, tuple(range(6)))
        together = ridge.fit_each(motion, envelopes)
        for pattern, column in zip(together, envelopes.T, strict=True):
            alone = Ridge(penalty, tuple(range(6))).fit(motion, column)
            assert pattern.offset_ == pytest.approx(alone.offset_, rel=1e-12)
            np.testing.assert_allclose(pattern.predict(motion), alone.predict(motion), rtol=1e-9, atol=1e-11)
    with pytest.raises(IdentificationError, match="expected 400 finite numbers"):
        ridge.fit_each(motion, envelopes[:-1])
