"""A repair is made for estimators whose torque it changes, and not for the others."""

from dataclasses import replace

import numpy as np
from made_muscles import trial

from pellucid.emg.estimators.cross_validation import apply_useful_repairs

FITTED = trial("fitted", seconds=4.0, seed=1)
NAMES = list(FITTED.envelopes)


def predictor(**weights):
    scale = float(np.std(FITTED.torque))
    return lambda t: scale * sum(w * t.envelopes[m] / np.std(FITTED.envelopes[m]) for m, w in weights.items())


def test_only_channels_that_matter_are_repaired():
    recorded = trial("judged", seconds=4.0, seed=2, heldout=True)
    much, little = NAMES[:2]
    repaired = replace(
        recorded, envelopes={**recorded.envelopes, **{m: 0.3 * recorded.envelopes[m] for m in (much, little)}}
    )
    made, muscles = apply_useful_repairs(predictor(**{much: 1.0, little: 0.05}), [FITTED], recorded, repaired)
    assert muscles == (much,)
    assert np.array_equal(made.envelopes[much], repaired.envelopes[much])
    assert np.array_equal(made.envelopes[little], recorded.envelopes[little])
    assert np.array_equal(made.torque, recorded.torque)


def test_an_estimator_that_does_not_use_the_channel_gets_the_trial_as_it_was_recorded():
    recorded = trial("judged", seconds=4.0, seed=2, heldout=True)
    repaired = replace(recorded, envelopes={**recorded.envelopes, NAMES[0]: 0.3 * recorded.envelopes[NAMES[0]]})
    made, muscles = apply_useful_repairs(predictor(**{NAMES[1]: 1.0}), [FITTED], recorded, repaired)
    assert made is recorded
    assert muscles == ()
    assert apply_useful_repairs(predictor(**{NAMES[0]: 1.0}), [FITTED], recorded, recorded) == (recorded, ())


def test_the_measured_torque_changes_nothing():
    recorded = trial("judged", seconds=4.0, seed=2, heldout=True)
    repaired = replace(recorded, envelopes={**recorded.envelopes, NAMES[0]: 0.3 * recorded.envelopes[NAMES[0]]})
    other = [replace(t, torque=-3.0 * t.torque) for t in (recorded, repaired)]
    predict = predictor(**{NAMES[0]: 1.0})
    assert (
        apply_useful_repairs(predict, [FITTED], *other)[1]
        == apply_useful_repairs(predict, [FITTED], recorded, repaired)[1]
    )
