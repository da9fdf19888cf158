"""A spring on the bench, such as a locked series-elastic element: said to be one, whatever model is fitted."""

import numpy as np
import pytest

import pellucid as pl

STIFFNESS, GAIN = 30.0, 2.0  # N*m/rad; of the study's drive [N*m/A]
NO_GRAVITY = ("[processing]", '[model]\ngravity = "none"\n\n[processing]')


def spring(rng: np.random.Generator) -> dict[str, np.ndarray]:
    t = np.arange(4000) / 200.0
    waves = ((0.12, 0.3, 0.0), (0.06, 0.9, 1.0), (0.02, 2.1, 2.0))
    q = sum(a * np.sin(2.0 * np.pi * f * t + phase) for a, f, phase in waves)
    v = np.gradient(q, t)
    torque = STIFFNESS * q + 0.3 * v + 0.1 * np.tanh(v / 0.01) + 0.03 * rng.standard_normal(len(t))
    return {"t": t, "q": q, "i": torque / GAIN}


@pytest.mark.parametrize(("change", "kind"), [((), "warning"), ((NO_GRAVITY,), "wrong")])
def test_a_locked_spring_is_said_to_be_one(make_study, rng, change, kind):
    result = pl.identify(make_study(spring(rng), *change), families=["symmetric"], thorough=False)
    (verdict,) = [v for v in result.verdicts if v.finding == "spring_bench"]
    assert verdict.kind == kind
    stiffness = float(verdict.text.split("a spring of ")[1].split()[0])
    assert stiffness == pytest.approx(STIFFNESS, rel=0.01)


def test_a_pendulum_is_no_spring(make_study):
    result = pl.identify(make_study(), families=["symmetric"], thorough=False)
    assert not [v for v in result.verdicts if v.finding == "spring_bench"]
