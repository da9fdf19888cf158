"""Sliding means in place of the low-pass: a published identification's filters."""

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.numerics.filters import sliding_mean
from pellucid.study.recorded_motions import filtering_of
from pellucid.study.study_file import Processing


@pytest.mark.parametrize("count", [1, 2, 7, 40, 100])
def test_a_sliding_mean_delays_nothing_and_keeps_a_straight_line(count):
    line = 1e6 + 0.25 * np.arange(500.0)
    inside = slice(count // 2, 500 - count // 2)
    np.testing.assert_allclose(sliding_mean(line, count)[inside], line[inside], rtol=1e-12)
    impulse = np.zeros((301, 2))
    impulse[150, 1] = 1.0
    answer = sliding_mean(impulse, count)
    np.testing.assert_allclose(answer, answer[::-1], atol=1e-14)
    np.testing.assert_allclose(answer.sum(axis=0), [0.0, 1.0], atol=1e-12)
    assert np.isclose(answer[150, 1], 1.0 / count)


def test_a_sliding_mean_passes_3_db_less_at_its_cut_off():
    t = np.arange(5000) / 1000.0
    for count in (40, 100):
        tone = np.sin(2.0 * np.pi * 0.443 / count * 1000.0 * t)
        assert np.abs(sliding_mean(tone, count)[1000:4000]).max() == pytest.approx(2**-0.5, abs=0.005)


@pytest.mark.parametrize("count", [0, 51])
def test_a_sliding_mean_of_too_many_samples_is_refused(count):
    with pytest.raises(
        ValueError, match=f"found a sliding mean over {count} samples, expected at least 1 and at most the 50"
    ):
        sliding_mean(np.zeros(50), count)


def test_sliding_means_are_refused_for_a_joint_without_a_carriage():
    with pytest.raises(RecordingError, match=r"found sliding_means = \[100, 40\], expected a lowpass"):
        filtering_of(Processing(lowpass="5 Hz", sliding_means=(100, 40)))


def test_a_mean_over_no_sample_is_refused():
    with pytest.raises(ValueError, match=r"found \[0, 40\], expected two numbers of samples"):
        Processing(sliding_means=(0, 40))
