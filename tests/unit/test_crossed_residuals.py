"""Residuals of blocks that are predicted from all the others."""

import numpy as np
import pytest

from pellucid.joint.fit.friction_solver import (
    block_labels,
    rows_of_blocks,
    values_without_blocks,
    values_without_blocks_of_cuts,
)
from pellucid.numerics.regression import Solution


def solution(rng, rows):
    jacobian, weights = rng.standard_normal((rows, 3)), rng.uniform(0.5, 2.0, rows)
    return Solution(np.zeros(3), jacobian, rng.standard_normal(rows), weights, np.zeros(3, bool), 1, True)


@pytest.mark.parametrize("scattered", [False, True])
def test_values_without_a_block_are_those_of_a_fit_to_the_others(rng, scattered):
    labels = np.concatenate(block_labels([60, 41]))
    if scattered:
        labels = rng.permutation(labels)
    found = solution(rng, len(labels))
    for block, values in values_without_blocks(found, labels).items():
        left, w = labels != block, found.weights[:, None]
        expected = np.linalg.lstsq((found.jacobian * w)[left], (found.residual * w[:, 0])[left], rcond=None)[0]
        assert values == pytest.approx(expected, rel=1e-9)


def test_values_of_several_cuts_are_those_of_each_cut_alone(rng):
    found = solution(rng, 101)
    cuts = [np.concatenate(block_labels([60, 41])), np.arange(101) // 23, rng.permutation(np.arange(101) // 40)]
    for labels, together in zip(cuts, values_without_blocks_of_cuts(found, cuts), strict=True):
        alone = values_without_blocks(found, labels)
        assert together.keys() == alone.keys()
        for block, values in alone.items():
            assert together[block] == pytest.approx(values, rel=1e-9)


def test_rows_of_blocks_are_slices_where_they_follow_each_other(rng):
    labels = np.array([3, 3, 0, 0, 0, 7])
    assert dict(rows_of_blocks(labels)) == {0: slice(2, 5), 3: slice(0, 2), 7: slice(5, 6)}
    apart = dict(rows_of_blocks(np.array([1, 0, 1])))
    assert apart[1].tolist() == [True, False, True]
