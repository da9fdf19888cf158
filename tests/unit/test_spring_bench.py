"""A spring on the bench, such as a locked series-elastic element: said to be one, whatever model is fitted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import pellucid as pl
from pellucid.joint.fit.discrepancy import Discrepancy
from pellucid.joint.study import joint_findings
from pellucid.models.estimates import Parameter

STIFFNESS, GAIN = 30.0, 2.0  # N*m/rad; of the study's drive [N*m/A]
NO_GRAVITY = ("[processing]", '[model]\ngravity = "none"\n\n[processing]')


def spring(rng: np.random.Generator) -> dict[str, np.ndarray]:
    t = np.arange(4000) / 200.0
    waves = ((0.12, 0.3, 0.0), (0.06, 0.9, 1.0), (0.02, 2.1, 2.0))
    q = sum(a * np.sin(2.0 * np.pi * f * t + phase) for a, f, phase in waves)
    v = np.gradient(q, t)
    torque = STIFFNESS * q + 0.3 * v + 0.1 * np.tanh(v / 0.01) + 0.03 * rng.standard_normal(len(t))
    return {"t": t, "q": q, "i": torque / GAIN}


@pytest.mark.parametrize("change", [(), (NO_GRAVITY,)])
def test_a_locked_spring_is_said_to_be_one(make_study, rng, change):
    result = pl.identify(make_study(spring(rng), *change), families=["symmetric"], thorough=False)
    (verdict,) = [v for v in result.verdicts if v.finding == "spring_bench"]
    assert verdict.kind == "warning"
    stiffness = float(verdict.text.split("a spring of ")[1].split()[0])
    assert stiffness == pytest.approx(STIFFNESS, rel=0.01)


def test_a_rough_inertia_of_a_locked_spring_is_said_to_be_rough():
    """An inertia of 4.7 ± 2.2 kg*m^2 stood in the table without a word."""
    names = ("inertia", "gravity")
    rough = Parameter("inertia", "kg*m^2", 4.7, 1.12, influence=0.01, statistical_error=1.1)
    sharp = Parameter("gravity", "N*m", 30.0, 0.5, influence=0.03)
    spring_moves_it = Discrepancy(names, np.eye(2), ("a spring in the drive", ""), {}, np.zeros((2, 2)))
    for statistical, why in ((1.1, "the motion excites it too little"), (0.1, "a spring in the drive could bias it")):
        parameters = (replace(rough, statistical_error=statistical), sharp)
        estimate = SimpleNamespace(parameters=parameters, discrepancy=spring_moves_it)
        case = SimpleNamespace(level=0.95, fit=SimpleNamespace(headline=SimpleNamespace(estimate=estimate)))
        (verdict,) = joint_findings.report_wide_interval(case)
        assert verdict.kind == "warning"
        assert verdict.text == f"Wide confidence intervals: inertia ± 47 % (4.7 ± 2.2 kg·m²; {why})."


def test_a_pendulum_is_no_spring(make_study):
    result = pl.identify(make_study(), families=["symmetric"], thorough=False)
    assert not [v for v in result.verdicts if v.finding == "spring_bench"]
