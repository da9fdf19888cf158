"""A curve that is broken where samples are not compared is drawn as segments between shaded stretches."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from pellucid.start.tried_log import TriedJoint
from pellucid.start.try_page import _efforts
from pellucid.study.drawing.drawing import SHADED_GAPS_WORDS, shade_gaps
from pellucid.study.pages.page import _fit_first_screen
from pellucid.study.pages.quantities import effort_label
from pellucid.study.procedures.result import HeldOutEffort


def spans(axis):
    """The stretches that are shaded on an axis, each from its left to its right end."""
    return [(box.get_x(), box.get_x() + box.get_width()) for box in axis.patches]


@pytest.mark.parametrize("seed", range(5))
def test_every_gap_is_shaded_from_its_last_sample_to_the_next(seed):
    rng = np.random.default_rng([50, seed])
    time = np.arange(1000) / 100.0
    starts = np.sort(rng.choice(np.arange(100, 900, 60), int(rng.integers(0, 6)), replace=False))
    kept = np.ones(1000, dtype=bool)
    for start in starts:
        kept[start : start + 30] = False
    axis = Figure().subplots()
    assert shade_gaps(axis, time[kept]) == bool(len(starts))
    expected = [(time[start - 1], time[start + 30]) for start in starts]
    np.testing.assert_allclose(spans(axis), np.reshape(expected, (-1, 2))[: len(starts)] if expected else [])


def joint(time):
    held = HeldOutEffort("", "V", time, np.sin(time), np.sin(time) + 0.1)
    return TriedJoint("joint", (), held)


def test_the_figure_of_a_try_names_its_effort_and_says_what_is_shaded():
    """The figure of a tried log was in scraps, without a word on why, and its axis was called "V"."""
    time = np.concatenate([np.arange(0.0, 1.0, 0.01), np.arange(1.5, 3.0, 0.01)])
    drawing = _efforts([joint(time)])
    axis = drawing.figure.axes[0]
    assert axis.get_ylabel() == "Voltage (V)" == effort_label("V")
    assert len(spans(axis)) == 1
    assert SHADED_GAPS_WORDS in drawing.caption
    assert SHADED_GAPS_WORDS not in _efforts([joint(np.arange(0.0, 1.0, 0.01))]).caption


def test_recordings_one_after_another_are_separated():
    once = np.arange(0.0, 1.0, 0.01)
    assert "Vertical lines separate recordings" in _efforts([joint(np.concatenate([once, once]))]).caption
    assert "Vertical lines" not in _efforts([joint(once)]).caption


@pytest.mark.parametrize(("height", "lowered"), [(3.0, 3.0), (5.4, 3.72), (12.0, 12.0)])
def test_the_figure_of_an_answer_keeps_the_size_of_its_letters(height, lowered):
    """A figure of three panels was drawn at six tenths of its size: its letters had 7 px."""
    figure = Figure(figsize=(10.4, height), layout="constrained")
    figure.subplots()
    _fit_first_screen(figure)
    assert figure.get_figheight() == pytest.approx(lowered, rel=1e-3)
