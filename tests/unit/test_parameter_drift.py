"""A joint whose torque sensor drifts: told with its size, held by the interval; a steady joint drifts by nothing."""

from types import SimpleNamespace

import numpy as np
import pytest
from research.evidence._foreign_joint import drawn_joint, recorded, written

import pellucid as pl
from pellucid.joint.fit.recording_agreement import find_parameter_drift, shares_of_time
from pellucid.numerics.regression import Solution, Stack


@pytest.fixture(scope="module")
def recording():
    rng = np.random.default_rng(3)
    joint = drawn_joint(rng)
    return joint, recorded([joint], rng, 16.0)[0]


def identified(folder, table):
    return pl.identify(written(folder, {"a": ("fit", table)}), families=["symmetric"], thorough=False)


def drift_verdicts(result):
    return [v.text for v in result.verdicts if v.finding == "parameter_drift"]


def test_a_gain_that_drifts_by_two_percent_is_told_and_gravity_is_held(recording, tmp_path):
    joint, table = recording
    steady = identified(tmp_path / "steady", table)
    assert not drift_verdicts(steady)
    drifting = table.copy()
    drifting[:, 2] *= 1.0 + 0.02 * table[:, 0] / table[-1, 0]
    found = identified(tmp_path / "drifting", drifting)
    (text,) = drift_verdicts(found)
    assert "gravity by +" in text
    assert "a drifting gain" in text
    gravity = found.families["symmetric"].estimate["gravity"]
    drift = found.families["symmetric"].estimate.drift
    share = drift.change[drift.names.index("gravity")] / gravity.value
    assert share == pytest.approx(0.02, abs=0.003)
    low, high = gravity.interval()
    assert low <= joint.gravity <= 1.02 * joint.gravity <= high
    without = steady.families["symmetric"].estimate["gravity"]
    assert without.standard_error < 0.2 * gravity.standard_error


def test_too_few_rows_and_a_parameter_without_effect_tell_no_drift():
    rng = np.random.default_rng(4)

    def solution(n):
        w = np.column_stack([rng.standard_normal(n), np.zeros(n)])
        return Solution(np.zeros(2), w, rng.standard_normal(n), np.ones(n), np.zeros(2, bool), 1, True)

    def data(n):
        time = np.linspace(0.0, 10.0, n)
        motion = SimpleNamespace(time=time, states=time[:, None], velocity=np.ones(n), recording="a")
        return SimpleNamespace(motions=[motion], lengths=[n])

    assert find_parameter_drift(["a", "b"], solution(60), data(60)) is None
    found = find_parameter_drift(["a", "b"], solution(1000), data(1000))
    assert not found.is_told.any()
    assert found.standard_error[1] == np.inf
    assert np.all(found.covariance == 0.0)


def test_a_chirp_tells_no_drift():
    """Viscous friction "changed by -74 %" along a chirp, whose speeds alone changed."""
    time = np.linspace(0.0, 10.0, 1000)

    def share(speed):
        motion = SimpleNamespace(time=time, states=time[:, None], velocity=speed, recording="a")
        return shares_of_time(Stack((motion,), (time,)))

    assert share(np.sin(3.0 * time)) == pytest.approx(time / 10.0 - 0.5)
    assert not share(np.sin(3.0 * time) * (0.2 + time)).any()
