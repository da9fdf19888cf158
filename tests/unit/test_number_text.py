"""Text of numbers: what the core writes is what C's formats write."""

import numpy as np
import pytest

from pellucid import _core


@pytest.mark.parametrize("decimals", range(16))
def test_every_number_is_rounded_as_python_rounds_it(rng, decimals):
    halves = np.arange(-40, 41) / 8.0
    near = np.concatenate([halves + k * 2.0**-52 for k in (-4, -1, 0, 1, 4)])
    many = rng.standard_normal(3000) * 10.0 ** rng.integers(-12, 18, 3000)
    ties = (rng.integers(-(10**6), 10**6, 2000) + 0.5) / 10.0**decimals
    odd = [0.0, -0.0, 1e-310, 5e-324, -1e-9, 1e300, -1e22, 2.0**53, 0.1, 2.675, 1e15, 999999999999999.9]
    values = np.concatenate([near, many, ties, odd, [np.inf, -np.inf]])
    lines = _core.number_rows(values[:, None], [decimals]).decode().split("\n")[:-1]
    expected = [f"{value:.{decimals}f}" for value in values.tolist()]
    assert lines == [text if decimals or float(text) != 0.0 else "0" for text in expected]


def test_columns_have_their_own_decimals_and_missing_samples_are_empty():
    rows = [[1.0, np.nan, -0.04], [np.nan, 2.5, 3.0]]
    assert _core.number_rows(rows, [0, 2, 1]) == b"1,,-0.0\n,2.50,3.0\n"
    assert _core.number_rows(np.zeros((0, 3)), [0, 2, 1]) == b""


@pytest.mark.parametrize(
    ("values", "decimals", "said"),
    [
        ([1.0], [0], "expected \\(n, m\\)"),
        ([[1.0, 2.0]], [0], "one for each column"),
        ([[1.0]], [16], "from 0 to 15"),
        ([[1.0]], [-1], "from 0 to 15"),
        ([[1.0]], [0.5], "from 0 to 15"),
        ([[1.0]], [np.nan], "from 0 to 15"),
    ],
)
def test_what_is_no_table_is_refused(values, decimals, said):
    with pytest.raises(ValueError, match=said):
        _core.number_rows(values, decimals)
