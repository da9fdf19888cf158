"""What is done with a wheel to see that it works, wherever it is installed."""

FIT = """
import numpy as np, pellucid as pl
from pellucid import _core
assert _core.__file__.endswith(("abi3.so", "_core.pyd")), _core.__file__
t = np.arange(0.0, 10.0, 1e-3)
q = 0.5 * np.sin(2.5 * t) + 0.2 * np.sin(6.9 * t)
v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
fit = pl.fit_joint(t, q, 0.05 * a + 1.5 * np.sin(q) + 0.08 * v + 0.3 * np.sign(v), friction="symmetric", lowpass=20.0)
assert abs(fit["inertia"].value - 0.05) < 0.005, fit
"""
"""A joint is fitted by the module with the stable ABI."""

CORE_TESTS = [f"tests/core/test_core_{name}.py" for name in ("functions", "joint", "jacobian", "biquad", "arguments")]
"""Tests that call every kind of function and class of the module, and need no extra."""
