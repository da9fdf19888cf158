"""The core's elementary functions against NumPy's and mathematics' own identities."""

import numpy as np
import pytest

from pellucid import _core

ULPS = dict(exp=2, log=2, sin=2, cos=2, tanh=4)  # the core's stated error, and NumPy's own


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", sorted(ULPS))
def test_function_is_within_its_stated_error(name, dtype, rng):
    x = np.concatenate(
        [rng.uniform(-40, 40, 100_000), rng.uniform(-1, 1, 100_000), 10 ** rng.uniform(-30, 1.5, 100_000)]
    )
    x = (np.abs(x) if name == "log" else x).astype(dtype)
    got = getattr(_core.math, name)(x)
    exact = getattr(np, name)(x.astype(np.longdouble))
    assert got.dtype == dtype
    assert np.max(np.abs(got - exact) / np.spacing(np.abs(exact).astype(dtype))) < ULPS[name]


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_functions_are_total(dtype):
    x = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, np.finfo(dtype).tiny / 4, np.finfo(dtype).max], dtype)
    with np.errstate(all="ignore"):
        for name in ("exp", "log", "tanh"):
            np.testing.assert_allclose(
                getattr(_core.math, name)(x), getattr(np, name)(x), rtol=4 * np.finfo(dtype).eps, atol=0
            )
    assert np.isnan(_core.math.sin(x[:3])).all()
    assert np.isnan(_core.math.cos(x[[0, 1, 2, 6]])).all()
    assert _core.math.sin(x[3:6]).tolist() == x[3:6].tolist()
    assert np.signbit(_core.math.tanh(x[4]))


def test_shape_is_kept():
    assert _core.math.exp(np.zeros((2, 3, 4))).shape == (2, 3, 4)
    assert float(_core.math.exp(1.0)) == pytest.approx(np.e)
