"""Walking in the virtual orthosis: the path, recorded or generated, and laws of the body that follow it."""

import numpy as np
import pytest

from pellucid._errors import DatasetError
from pellucid.controllers.coupling import Coupling
from pellucid_lab.knee import gait
from pellucid_lab.knee.protocol import walking_trial
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.knee.trial import run_trial
from pellucid_lab.papers.knee.body_laws import BodyLaw, body_law, law_with_oscillator, residuals_beyond_law
from pellucid_lab.papers.knee.swings import rms_mismatch_and_torque

# As one drawn wearer was identified.
COUPLING = Coupling(
    orthosis_inertia=0.0473, orthosis_viscous=0.0108, orthosis_gravity=1.55, coulomb=0.0283, limb_inertia=0.40,
    limb_viscous=0.0, limb_gravity=10.5, strap_stiffness=24.0, strap_damping=0.72, actuator_frequency=55.7,
    actuator_damping=0.197, delay=0.002, actuator_inertia=0.055, actuator_viscous=0.1, actuator_coulomb=2.45,
    actuator_leak=1.76,
)  # fmt: skip


def generated_walking(monkeypatch):
    def absent():
        raise DatasetError("not here")

    monkeypatch.setattr(gait, "recorded_walking", absent)


def test_generated_walking_flexes_as_textbooks_say(monkeypatch):
    generated_walking(monkeypatch)
    path, source = gait.walking(500.0, 20.0, np.random.default_rng(1))
    late = path[1500:]
    assert source == "generated"
    assert len(path) == 10_000
    assert 0.95 < late.max() < 1.2
    assert -0.05 < late.min() < 0.2
    # As many strides as fit, a peak each.
    high = late > 0.9
    assert np.sum(high[1:] & ~high[:-1]) == pytest.approx(len(late) * 0.002 / gait.STRIDE_DURATION_S, abs=1.0)
    assert path[:5] == pytest.approx(path[0], abs=1e-4)


def test_recorded_walking_is_somebodys():
    try:
        gait.recorded_walking()
    except DatasetError as missing:
        pytest.skip(str(missing))
    path, source = gait.walking(500.0, 12.0, np.random.default_rng(2))
    assert source == "recorded on a treadmill"
    assert 1.0 < path[1500:].max() < 1.3


def test_an_oscillator_knows_a_gait_that_a_model_alone_is_late_for(monkeypatch):
    generated_walking(monkeypatch)
    rig = knee_orthosis()
    path, _ = gait.walking(1.0 / rig.period, 9.0, np.random.default_rng(3))
    trial = walking_trial(rig, "walking", rig.subjects["S2"], path)
    shares = {"gravity": 0.5, "friction": 0.6, "inertia": 0.9}
    torque = {}
    for name, law in {
        "body": body_law(COUPLING, rig.period, **shares),
        "oscillator": law_with_oscillator(COUPLING, rig.period, share=1.0, lead=0.02, **shares),
    }.items():
        controller = BodyLaw(law)
        torque[name] = rms_mismatch_and_torque(
            run_trial(rig, trial, rng=np.random.default_rng(4), controller=controller)
        )[1]
        assert controller.fault == "none"
    assert torque["oscillator"] < 0.9 * torque["body"]


def test_what_is_left_to_learn_is_what_the_law_does_not_carry():
    law = body_law(COUPLING, 0.002, gravity=1.0, friction=0.0, inertia=0.0)
    t = np.arange(5000) * 0.002
    q = 0.6 * np.sin(3.0 * t)
    v, a = 1.8 * np.cos(3.0 * t), -5.4 * np.sin(3.0 * t)
    inertia, gravity = law.values["inertia"], law.values["gravity_sine"]
    command = inertia * a + gravity * np.sin(q) + 0.7 * v
    (left,) = residuals_beyond_law(law, [(q, command)], 500.0)
    assert left.torque == pytest.approx(0.7 * left.velocity, abs=0.02)
