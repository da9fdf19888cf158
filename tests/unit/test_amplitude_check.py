"""Labels that were mixed up are told from people who miss."""

import numpy as np
import pytest

from pellucid.people.emg_index import strays

LABELS = np.radians([12.0, 24.0, 36.0, 48.0, 60.0])


def made(seed, spread_deg, *, short=0.97, repetitions=10):
    """How far movements to five targets went [rad], and their labels."""
    rng = np.random.default_rng(seed)
    label = rng.permutation(np.repeat(LABELS, 2 * repetitions))
    return short * label + np.radians(spread_deg) * rng.standard_normal(len(label)), label


def test_who_hits_is_not_accused():
    found = strays(*made(1, 1.0), LABELS)
    assert not found.wrong.any()
    assert found.mislabelled == ""


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("spread", [4.0, 6.0, 8.0])
def test_who_misses_is_not_accused(seed, spread):
    found = strays(*made(seed, spread), LABELS)
    assert found.wrong.mean() > 0.05
    assert found.mislabelled == ""


def test_who_falls_short_everywhere_is_not_accused():
    found = strays(*made(3, 2.0, short=0.8), LABELS)
    assert found.wrong.mean() > 0.1
    assert found.mislabelled == ""


@pytest.mark.parametrize("seed", range(8))
def test_two_labels_that_were_swapped_are_found_by_name(seed):
    reach, label = made(seed, 1.5)
    swapped = label.copy()
    swapped[label == LABELS[0]], swapped[label == LABELS[3]] = LABELS[3], LABELS[0]
    assert "movements labelled 12 deg go 48 deg" in strays(reach, swapped, LABELS).mislabelled


@pytest.mark.parametrize("seed", range(8))
def test_labels_one_movement_late_are_found(seed):
    reach, label = made(seed, 1.5)
    said = strays(reach, np.roll(label, 2), LABELS).mislabelled
    assert "exactly as far as another label says" in said or "deg go" in said


def test_a_fifth_with_another_ones_label_is_found():
    reach, label = made(5, 1.0)
    rng = np.random.default_rng(5)
    at = rng.choice(len(label), 20, replace=False)
    label[at] = rng.permutation(label[at])
    assert "exactly as far as another label says" in strays(reach, label, LABELS).mislabelled


def test_random_amplitudes_are_compared_by_their_order():
    rng = np.random.default_rng(2)
    label = np.sort(rng.uniform(0.2, 1.0, 40))
    reach = label + 0.05 * rng.standard_normal(40)
    assert strays(reach, label, label).mislabelled == ""
    assert "rank correlation" in strays(rng.permutation(reach), label, label).mislabelled
