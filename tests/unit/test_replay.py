"""A joint played again from a command; one that diverges says so, and no warning leaks."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.joint.fit.replay import Machine, is_bounded, replay, simulate_recording
from pellucid.models.joint import joint_model
from pellucid.study.recorded_motions import motions_of


def unstable(viscous):
    """A joint that speeds itself up, so that its response leaves every number within a second."""
    model = joint_model("symmetric", motion="rotary", effort_unit="N*m", gravity="none")
    numbers = {"inertia": 0.05, "viscous": viscous}
    return model, np.array([numbers.get(symbol.name, 0.0) for symbol in model.symbols])


def test_a_response_that_diverges_leaks_no_warning(make_study):
    """Whether a sample is infinite before it is none hangs on the speed, and an infinite one times 0 warns."""
    study = make_study()
    motion = motions_of(study.recordings("fit"), study)[0]
    for viscous in np.linspace(-2.5, -40.0, 30):
        model, values = unstable(viscous)
        trace = replay(model, values, motion, Machine(), closed=False, differentiate="position")
        assert not is_bounded(trace.position)
        assert not is_bounded(trace.jacobians["position"])
        assert trace.jacobians["position"].shape == (len(motion.command), len(values))


def test_a_simulation_that_diverges_is_refused_by_name(make_study):
    study = make_study()
    motion = motions_of(study.recordings("fit"), study)[0]
    with pytest.raises(IdentificationError, match=f"'{motion.recording}': the simulated joint diverges"):
        simulate_recording(*unstable(-50.0), motion, Machine(), closed=False)


def test_a_motion_without_a_command_is_not_said_to_diverge(make_study):
    """A motion from arrays may have none; a joint driven by nothing was said to diverge."""
    study = make_study()
    motion = motions_of(study.recordings("fit"), study)[0]
    model, values = unstable(0.1)
    with pytest.raises(IdentificationError, match=f"'{motion.recording}': expected a command to simulate it"):
        simulate_recording(model, values, replace(motion, command=None), Machine(), closed=False)
    with pytest.raises(IdentificationError, match="expected a controller and a reference"):
        simulate_recording(model, values, motion, Machine(), closed=True)
