"""Channels watched while they are recorded: the same words as of a recording, from the past alone."""

import numpy as np
import pytest
from made_walking import FS, changed, walking

from pellucid._errors import RecordingError
from pellucid.emg.estimators.emg_session import WATCH_TIMES, FittedSession, SessionWatch


@pytest.fixture(scope="module")
def session():
    return FittedSession.from_trials([walking(0, seconds=6.0)])


def played(watch, trial):
    """What is said after every sample."""
    said = []
    for i in range(len(trial)):
        envelopes = {m: x[i] for m, x in trial.envelopes.items()}
        said.append(watch.step(envelopes, {j: q[i] for j, q in trial.angles.items()}))
    return said


def test_the_words_are_those_of_the_recording(session):
    trial = walking(1, seconds=9.0)
    trial = changed(trial, soleus=2.6 * trial.envelopes["soleus"] + 0.06)
    watch = SessionWatch(session, tuple(trial.angles), FS, seconds=10.0)
    said = played(watch, trial)
    assert said[round(WATCH_TIMES.min_seconds * FS) - 2] == ()
    assert said[-1] == session.compare(trial).changes
    assert watch.last_comparison.is_valid
    assert {c.muscle for c in said[-1]} == {"soleus"}


def test_only_the_last_seconds_count_and_samples_without_a_number_do_not(session):
    first, then = walking(1, seconds=8.0), walking(2, seconds=9.0)
    first = changed(first, vastus=6.0 * first.envelopes["vastus"])
    watch = SessionWatch(session, tuple(first.angles), FS)
    assert {c.kind for c in played(watch, first)[-1]} == {"level"}
    lost = {m: np.nan for m in first.envelopes}
    assert watch.step(lost, {j: 0.0 for j in first.angles}) == watch.changes != ()
    assert played(watch, then)[-1] == ()
    watch.reset()
    assert watch.last_comparison is None


def test_misuse_is_refused(session):
    with pytest.raises(RecordingError, match="expected a rate above 0"):
        SessionWatch(session, ("knee", "ankle"), 0.0)
    with pytest.raises(RecordingError, match="expected 2 as in what was fitted"):
        SessionWatch(session, ("knee",), FS)
