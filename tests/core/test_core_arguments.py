"""Misuse ends in a ValueError that names the argument, the shape got and the shape expected."""

import re

import numpy as np
import numpy_reference as reference
import pytest

from pellucid import _core

P, X = reference.parameters(), np.zeros(5)
RUN = dict(reference=X, period=1e-3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: _core.inverse_dynamics(P[:12], X, X, X), "parameters: got shape (12,), expected (15,)"),
        (
            lambda: _core.inverse_dynamics(P, X, X[:4], X),
            "velocity: got shape (4,), expected (5,), as long as position",
        ),
        (lambda: _core.inverse_dynamics(P, X[None], X, X), "position: got shape (1, 5), expected (n,)"),
        (lambda: _core.inverse_dynamics(P, 0.0, 0.0, 0.0), "position: got shape (), expected (n,)"),
        (lambda: _core.inverse_dynamics(P, "abc", X, X), "position: expected real numbers"),
        (lambda: _core.inverse_dynamics(P, X + 1j, X, X), "position: expected real numbers, got complex128"),
        (lambda: _core.inverse_dynamics(P, [[1], [1, 2]], X, X), "position: expected an array of numbers"),
        (lambda: _core.inverse_dynamics(P, None, X, X), "position: expected real numbers"),
        (lambda: _core.inverse_dynamics_jacobian(P, X, X, X, [15]), "active: expected indices from 0 to 14"),
        (lambda: _core.inverse_dynamics_jacobian(P, X, X, X, [-1]), "active: expected indices from 0 to 14"),
        (lambda: _core.inverse_dynamics_jacobian(P, X, X, X, [0.5]), "active: expected integers"),
        (lambda: _core.inverse_dynamics_jacobian(P, X, X, X, 3), "active: got shape (), expected (k,)"),
        (lambda: _core.friction(P, X, X[:2]), "load: got shape (2,), expected (5,), as long as velocity"),
        (lambda: _core.load(P, X, X[:2]), "acceleration: got shape (2,)"),
        (lambda: _core.forward_dynamics(P, X, X, X[:2]), "effort: got shape (2,)"),
        (lambda: _core.simulate(P, reference=X, period=0.0), "period: expected a number of seconds above 0"),
        (lambda: _core.simulate(P, reference=X, period=np.nan), "period: expected a number of seconds above 0"),
        (lambda: _core.simulate(P, reference=X, period=[1.0]), "period: got shape (1,), expected a number"),
        (lambda: _core.simulate(P, substeps=0, **RUN), "substeps: expected a whole number from 1"),
        (lambda: _core.simulate(P, substeps=2.5, **RUN), "substeps: expected a whole number from 1"),
        (lambda: _core.simulate(P, substeps=10**30, **RUN), "substeps: expected a whole number from 1"),
        (lambda: _core.simulate(P, velocity_span=9, **RUN), "velocity_span: expected a whole number from 0 to 8"),
        (
            lambda: _core.simulate(P, loop="pid", **RUN),
            "loop: got 'pid', expected none, p, pi, pd, cascade or velocity_pi",
        ),
        (lambda: _core.simulate(P, kp=[1.0, 2.0], **RUN), "kp: got shape (2,), expected a number"),
        (
            lambda: _core.simulate(P, injected=X[:3], **RUN),
            "injected: got shape (3,), expected (5,), as long as reference",
        ),
        (lambda: _core.simulate(P, reference=X[None], period=1e-3), "reference: got shape (1, 5), expected (n,)"),
        (lambda: _core.simulate_batch(P, **RUN), "parameters: got shape (15,), expected (m, 15)"),
        (lambda: _core.simulate_batch(P[None], kp=[1.0, 2.0], **RUN), "kp: got shape (2,), expected a number or (1,)"),
        (
            lambda: _core.simulate_batch(P[None], injected=np.zeros((2, 5)), **RUN),
            "injected: got shape (2, 5), expected (1, 5)",
        ),
        (lambda: _core.simulate_batch(P[None], threads=0, **RUN), "threads: expected a whole number from 1"),
        (lambda: _core.math.exp("x"), "x: expected real numbers"),
    ],
)
def test_misuse(call, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: _core.simulate(P, period=1e-3), "simulate() needs the keyword 'reference'"),
        (lambda: _core.simulate(P, reference=X), "simulate() needs the keyword 'period'"),
        (lambda: _core.simulate(P, sustpes=2, **RUN), "simulate() does not know the keyword 'sustpes'"),
        (lambda: _core.simulate(P, threads=2, **RUN), "simulate() does not know the keyword 'threads'"),
        (lambda: _core.simulate_jacobian(P, **RUN), "simulate_jacobian() needs the keyword 'active'"),
    ],
)
def test_wrong_keywords(call, message):
    with pytest.raises(TypeError, match=re.escape(message)):
        call()


def test_whatever_numpy_takes(rng):
    x = rng.uniform(-1, 1, 40)
    wanted = _core.inverse_dynamics(P, x, x, x)
    frozen = x.copy()
    frozen.flags.writeable = False
    for same in (
        x.tolist(),
        frozen,
        np.repeat(x, 2)[::2],
        x.astype(">f8"),
        np.asfortranarray(np.stack([x, x], 1))[:, 0],
    ):
        np.testing.assert_array_equal(_core.inverse_dynamics(tuple(P), same, same, same), wanted)
    np.testing.assert_array_equal(
        _core.inverse_dynamics(P, [1, 2], [True, False], np.float32([0.5, 1])),
        _core.inverse_dynamics(P, [1.0, 2], [1.0, 0], [0.5, 1]),
    )


def test_nothing_to_do():
    empty = np.zeros(0)
    assert _core.inverse_dynamics(P, empty, empty, empty).shape == (0,)
    assert _core.inverse_dynamics_jacobian(P, empty, empty, empty, [0, 1])[1].shape == (0, 2)
    assert [out.shape for out in _core.simulate(P, reference=empty, period=1e-3)] == [(0,)] * 6


def test_results_are_the_callers_own():
    first = _core.simulate(P, **RUN)
    first[0][:] = 99
    assert (_core.simulate(P, **RUN)[0] != 99).all()
    assert first[0].flags.writeable
