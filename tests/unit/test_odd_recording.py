"""The held-out recording that explains the error is named."""

from types import SimpleNamespace

import numpy as np

from pellucid.joint.study import joint_findings
from pellucid.models.joint import GRAVITY


def prediction(rng, name, mass=0.0, distance=0.25):
    """A recording that is predicted to 2 %, beside what a mass [kg] at a distance [m] adds."""
    t = np.arange(0.0, 20.0, 0.02)
    q, a = np.sin(1.3 * t), -1.69 * np.sin(1.3 * t) + 3.0 * np.sin(4.1 * t)
    predicted = 2.0 * np.sin(q) + 0.1 * a
    carried = mass * (distance**2 * a + GRAVITY * distance * np.sin(q))
    effort = predicted + carried + 0.03 * rng.standard_normal(len(t))
    error = 100.0 * np.linalg.norm(effort - predicted) / np.linalg.norm(effort)
    return SimpleNamespace(
        recording=name, split="heldout", time=t, position=q, acceleration=a, effort=effort, predicted=predicted,
        residual=effort - predicted, effort_error=error,
    )  # fmt: skip


def told(predictions):
    fit = SimpleNamespace(headline=SimpleNamespace(predictions=predictions), model=SimpleNamespace(effort_unit="N*m"))
    return list(joint_findings.report_odd_recording(SimpleNamespace(fit=fit, rotary=False)))


def test_one_file_of_five_that_differs_is_named(rng):
    (verdict,) = told([prediction(rng, f"r{i}", 0.5 * (i == 3)) for i in range(5)])
    assert "'r3' dominates the held-out error" in verdict.text


def test_recordings_that_are_alike_name_none(rng):
    assert told([prediction(rng, f"r{i}") for i in range(5)]) == []
