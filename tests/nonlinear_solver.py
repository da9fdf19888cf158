"""The fit of a joint with a carriage by SciPy's nonlinear least squares, as a check of the linear solver."""

import numpy as np
from scipy.optimize import least_squares


def least_squares_from_afar(matrix, target, lower, upper, **_):
    """Solve a bounded linear problem as a nonlinear one, from a start that knows nothing of it."""
    scale = np.linalg.norm(matrix, axis=0)
    unit, start = matrix / scale, np.where(np.isfinite(lower), 1.0, 0.0)
    found = least_squares(
        lambda p: unit @ p - target, start, bounds=(lower * scale, upper), xtol=1e-14, ftol=1e-14, gtol=1e-14,
        jac=lambda p: unit,
    )  # fmt: skip
    return found.x / scale


def nonlinearly(monkeypatch, method, motions, **settings):
    """Return what a published method finds with the nonlinear solver."""
    with monkeypatch.context() as patched:
        patched.setattr("pellucid.joint.slider.slider_fit.least_squares_within", least_squares_from_afar)
        return method(motions, **settings)
