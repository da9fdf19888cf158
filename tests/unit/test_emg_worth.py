"""What EMG is worth: gains over angles alone, their intervals, and the answer that follows."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pellucid import PellucidError
from pellucid.emg.estimators.cross_validation import Score
from pellucid.emg.estimators.emg_worth import EmgWorth, worth_on_recording, worth_over_trials
from pellucid.emg.study.emg_torque.torque_findings import RecordingWorth, find_worth, is_answer_founded, worth_sentence

CYCLES = 12
SAMPLES_PER_CYCLE = 110
FS = 100.0


def walking_errors(rng, gain, *, cycles=CYCLES):
    """Return a torque of many cycles, and two predictions whose errors differ from cycle to cycle.

    Errors of one cycle belong together, as they do in walking: what is independent is a cycle, not a sample. The mean
    gain over infinitely many cycles is `gain`.
    """
    phase = np.linspace(0.0, 2.0 * np.pi, SAMPLES_PER_CYCLE, endpoint=False)
    torque, with_emg, alone = [], [], []
    for _ in range(cycles):
        shape = np.sin(phase) + 0.3 * np.sin(2.0 * phase)
        common, size = 0.25 * rng.standard_normal(), np.sqrt(2.0 * gain * np.var(shape) * rng.chisquare(4) / 4)
        torque.append(shape)
        with_emg.append(shape + common)
        alone.append(shape + common + size * np.cos(3.0 * phase + rng.uniform(0.0, 2.0 * np.pi)))
    return tuple(map(np.concatenate, (torque, with_emg, alone)))


@pytest.mark.parametrize("gain", [0.02, 0.15])
def test_intervals_hold_the_gain_of_infinitely_many_cycles(gain):
    rng = np.random.default_rng(20261126)
    held = [worth_on_recording(*walking_errors(rng, gain), FS) for _ in range(300)]
    share = np.mean([w.low <= gain <= w.high for w in held])
    assert 0.90 <= share <= 1.0
    # Were samples independent, intervals would be much narrower and hold far less often.
    naive = []
    for _ in range(300):
        torque, with_emg, alone = walking_errors(rng, gain)
        apart = ((torque - alone) ** 2 - (torque - with_emg) ** 2) / np.var(torque)
        naive.append(abs(apart.mean() - gain) <= 1.96 * apart.std() / np.sqrt(len(apart)))
    assert np.mean(naive) < share


def test_a_gain_that_is_sure_and_large_is_worth_it():
    torque, with_emg, alone = walking_errors(np.random.default_rng(2), 0.3, cycles=40)
    assert worth_on_recording(torque, with_emg, alone, FS).answer == "worth it"


def test_a_gain_that_is_surely_small_is_not_worth_it():
    torque, with_emg, alone = walking_errors(np.random.default_rng(3), 0.004, cycles=40)
    worth = worth_on_recording(torque, with_emg, alone, FS)
    assert worth.answer == "not worth it"
    assert worth.low > 0.0  # It is there, and does not matter


def test_a_map_with_emg_that_is_worse_is_not_worth_it():
    torque, with_emg, alone = walking_errors(np.random.default_rng(4), 0.3, cycles=40)
    worth = worth_on_recording(torque, alone, with_emg, FS)
    assert worth.gain < 0.0
    assert worth.answer == "not worth it"


@pytest.mark.parametrize(
    ("gain", "low", "high", "answer"),
    [
        (0.2, -0.1, 0.5, "cannot say"),
        (0.04, 0.01, 0.07, "cannot say"),
        (0.06, 0.01, 0.11, "worth it"),
        (0.01, -0.02, 0.04, "not worth it"),
    ],
)
def test_the_answer_follows_from_interval_and_margin(gain, low, high, answer):
    assert EmgWorth(gain, low, high, margin=0.05, blocks=9).answer == answer


def test_trials_give_students_interval_of_their_gains():
    worth = worth_over_trials([0.9, 0.8, 0.85, 0.95], [0.6, 0.6, 0.5, 0.7])
    assert worth.gain == pytest.approx(0.275)
    # Standard deviation .0645 of four gains, Student's quantile 3.1824 at three degrees of freedom.
    assert worth.high - worth.gain == pytest.approx(3.1824 * 0.0645497 / 2.0, rel=1e-4)
    assert worth.answer == "worth it"


def test_two_trials_have_no_interval():
    assert worth_over_trials([0.9, 0.8], [0.1, 0.2]).answer == "cannot say"


@pytest.mark.parametrize(("fitted", "lost", "is_founded"), [(2, 0, True), (2, 4, False), (3, 4, True), (1, 1, False)])
def test_nothing_is_claimed_of_what_few_trials_are_left(fitted, lost, is_founded):
    assert is_answer_founded(fitted, lost) is is_founded
    worth = EmgWorth(0.36, 0.30, 0.42, margin=0.05, blocks=9, is_founded=is_founded)
    assert worth.answer == ("worth it" if is_founded else "cannot say")
    said = worth_sentence([RecordingWorth("knee", "held", worth)])
    assert said.startswith("Fewer than 3 trials were fitted") is not is_founded
    assert ("EMG improves on joint angles alone for" in said and "whether" not in said) is is_founded


def test_pieces_of_a_recording_are_one_trial_of_an_interval():
    scores = {"a.1": 0.9, "a.2": 0.7, "b": 0.8, "c": 0.95}
    bare = {"a.1": 0.5, "a.2": 0.5, "b": 0.5, "c": 0.5}
    conditions = [SimpleNamespace(name=n, score=Score(1.0, r2), bare=Score(1.0, bare[n])) for n, r2 in scores.items()]
    chosen = SimpleNamespace(what="knee", by={"a.1": "ridge"}, by_condition=lambda: conditions)
    (found,) = find_worth([chosen], (), 0.05, {"a.1": "a", "a.2": "a"})
    assert found.worth == worth_over_trials([0.8, 0.8, 0.95], [0.5, 0.5, 0.5], 0.05)


def test_a_reference_that_does_not_change_is_refused():
    with pytest.raises(PellucidError, match="does not change"):
        worth_on_recording(np.ones(50), np.ones(50), np.zeros(50), FS)


def test_the_interval_carries_the_choice_of_both_maps():
    """Maps chosen without one of the tests gain more or less: the interval is as wide as that, and not narrower."""
    torque, with_emg, alone = walking_errors(np.random.default_rng(2), 0.3, cycles=40)
    fixed = worth_on_recording(torque, with_emg, alone, FS)
    same = worth_on_recording(torque, with_emg, alone, FS, other_choices=[(with_emg, alone)] * 4)
    assert (same.low, same.high) == pytest.approx((fixed.low, fixed.high))
    others = [(share * with_emg + (1.0 - share) * alone, alone) for share in (1.0, 0.6, 1.0, 0.3)]
    gains = [worth_on_recording(torque, *pair, FS).gain for pair in others]
    carried = worth_on_recording(torque, with_emg, alone, FS, other_choices=others)
    jackknife = np.sqrt(3.0 * np.var(gains))
    assert carried.high - carried.gain == pytest.approx(np.hypot(fixed.high - fixed.gain, 1.96 * jackknife))
