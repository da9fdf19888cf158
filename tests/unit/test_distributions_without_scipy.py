"""Quantiles and tails are those of SciPy."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.special import chdtrc, ndtr, ndtri

from pellucid.numerics.distributions import chi_square_tail, normal_quantile, normal_share_below


@pytest.mark.parametrize("share", [1e-300, 1e-12, 0.025, 0.5, 0.95, 0.975, 1.0 - 1e-9])
def test_a_normal_quantile_is_scipys(share):
    assert normal_quantile(share) == pytest.approx(ndtri(share), rel=1e-13, abs=1e-16)


def test_a_normal_quantile_of_all_and_of_nothing_is_infinite():
    assert (normal_quantile(0.0), normal_quantile(1.0)) == (-np.inf, np.inf)
    assert np.isnan(normal_quantile(1.5))
    assert np.isnan(normal_quantile(float("nan")))


@pytest.mark.parametrize("degrees", [1, 2, 3, 4, 7, 20, 25, 100, 301])
def test_a_chi_square_tail_is_scipys(degrees):
    for value in (0.0, 1e-9, 0.3, 1.0, 5.0, 20.0, 100.0, 400.0, 1000.0):
        assert chi_square_tail(degrees, value) == pytest.approx(chdtrc(degrees, value), rel=1e-11, abs=1e-300)


@pytest.mark.parametrize("value", [-30.0, -3.0, -0.1, 0.0, 0.5, 4.0, 40.0])
def test_the_share_below_a_value_is_scipys(value):
    assert normal_share_below(value) == pytest.approx(ndtr(value), rel=1e-13)


def test_an_infinite_statistic_has_no_tail_and_an_unknown_one_none_that_is_known():
    assert chi_square_tail(20, float("inf")) == 0.0
    assert np.isnan(chi_square_tail(20, float("nan")))


def test_a_first_fit_loads_no_scipy():
    code = (
        "import sys, numpy as np, pellucid as pl\n"
        "t = np.arange(20_000) / 1000.0\n"
        "q = 0.5 * np.sin(0.8 * t) + 0.3 * np.sin(3.0 * t + 1.0)\n"
        "v = np.gradient(q, t)\n"
        "tau = 0.05 * np.gradient(v, t) + 1.5 * np.sin(q) + 0.3 * np.sign(v) + 0.08 * v\n"
        "tau += 0.01 * np.random.default_rng(1).standard_normal(len(t))\n"
        "pl.fit_joint(t, q, tau, lowpass=20.0, decimate=10)\n"
        "print(sorted(name for name in sys.modules if name.startswith('scipy.')))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
