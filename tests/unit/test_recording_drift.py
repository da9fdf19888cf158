"""Joints whose parameters change between recordings: told with their sizes, held by intervals; steady ones are not."""

import numpy as np
import pytest
from research.evidence._foreign_joint import drawn_joint, recorded, written

import pellucid as pl

GAINS = (0.97, 1.0, 1.03)
"""Gains of the torque sensor in three recordings."""


@pytest.fixture(scope="module")
def recordings():
    rng = np.random.default_rng(4)
    joint = drawn_joint(rng)
    return joint, recorded([joint] * len(GAINS), rng, 16.0)


def identified(folder, tables):
    study = written(folder, {f"r{i}": ("fit", table) for i, table in enumerate(tables)})
    return pl.identify(study, families=["symmetric"], thorough=False)


def told(result):
    return [v.text for v in result.verdicts if v.finding == "recording_drift"]


def test_a_gain_that_was_set_anew_is_told_by_recording_and_held(recordings, tmp_path):
    joint, tables = recordings
    steady = identified(tmp_path / "steady", tables)
    assert not told(steady)
    changed = [table * [1.0, 1.0, gain] for table, gain in zip(tables, GAINS, strict=True)]
    result = identified(tmp_path / "changed", changed)
    (text,) = told(result)
    assert "(r0)" in text
    assert "(r2)" in text
    estimate = result.families["symmetric"].estimate
    between = estimate.between_recordings
    column = between.names.index("gravity")
    np.testing.assert_allclose(between.values[:, column], joint.gravity * np.array(GAINS), rtol=0.005)
    assert between.spread[column] == pytest.approx(0.03 * joint.gravity, rel=0.2)
    low, high = estimate["gravity"].interval()
    assert low <= GAINS[0] * joint.gravity
    assert GAINS[-1] * joint.gravity <= high
    before = steady.families["symmetric"].estimate["gravity"]
    assert before.standard_error < 0.2 * estimate["gravity"].standard_error


def test_one_recording_tells_nothing_between_recordings(recordings, tmp_path):
    result = identified(tmp_path, recordings[1][:1])
    assert result.families["symmetric"].estimate.between_recordings is None
