"""Nominal 95 % intervals hold the truth about 95 times in 100, whatever the noise, where the plant equals the model."""

import pytest

from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.demonstration.coverage import coverage


@pytest.mark.parametrize("colour", ["white", "coloured"])
def test_the_lowest_coverage_of_any_parameter(colour):
    found = coverage(bench_joint(), colour)
    assert found.repetitions == 200
    assert 90.0 <= found.lowest <= 99.0


def test_textbook_intervals_fail_where_residuals_are_coloured():
    assert coverage(bench_joint(), "coloured", repetitions=100).textbook < 80.0
