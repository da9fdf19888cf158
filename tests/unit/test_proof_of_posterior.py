"""The proof of posteriors counts what it says, and its cases are what they claim to be."""

import numpy as np
import pytest
from research.evidence.posterior import calibration_rows, coverage_rows, muscle, ranks

from pellucid.models.estimates import Parameter
from pellucid.numerics.posterior.posterior import DrawnParameter

pytestmark = pytest.mark.slow


def both(error, half=0.2, refused="", unsettled="", prior=0.1):
    fitted = Parameter("k", "1", 1.0 + error, half / 1.959964, refused=refused)
    draws = 1.0 + error + np.linspace(-2.0 * half, 2.0 * half, 401) / 0.95
    return fitted, DrawnParameter("k", "1", 1.0 + error, half, refused=unsettled, draws=draws, prior_share=prior), 1.0


def test_what_holds_and_what_is_refused_is_counted_of_either():
    found = [both(0.1), both(0.3), both(0.5), both(0.3, refused="all of it"), both(0.1, unsettled="too few", prior=0.9)]
    seen = {row.id.removeprefix("posterior.k."): row.value for row in coverage_rows("k", found, "")}
    assert seen["interval.held"] == pytest.approx(50.0)
    assert seen["interval.refused"] == pytest.approx(20.0)
    assert seen["held"] == pytest.approx(75.0)
    assert seen["refused"] == pytest.approx(20.0)
    assert seen["held_where_interval_refused"] == 100.0
    assert seen["told_by_prior"] == pytest.approx(20.0)
    assert seen["width_over_rmse"] == pytest.approx(0.4 / np.sqrt(np.mean(np.square([0.1, 0.3, 0.5, 0.3]))), rel=0.01)


def test_ranks_that_pile_up_are_seen():
    even = np.tile((np.arange(80) + 0.5)[:, None] / 80, (1, 4))
    seen = {row.id: row.value for row in calibration_rows(even)}
    assert seen["posterior.calibration.lowest_p_value"] > 0.99
    assert seen["posterior.calibration.free.held"] == pytest.approx(95.0)
    narrow = {row.id: row.value for row in calibration_rows(np.where(even < 0.5, 0.01, 0.99))}
    assert narrow["posterior.calibration.lowest_p_value"] < 1e-6
    assert narrow["posterior.calibration.free.held"] == 0.0


@pytest.mark.nightly
def test_one_truth_and_one_muscle():
    assert all(0.0 <= share <= 1.0 for share in ranks(3))
    fitted, drawn, offset = muscle(5)
    assert np.ptp(drawn.interval()) > 2.0 * np.ptp(fitted.interval()), "constants may be wrong"
    assert drawn.interval()[0] < offset < drawn.interval()[1]
