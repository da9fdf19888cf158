"""The three steps on motions made by hand: what is missing is called by its own name."""

import re

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.joint.slider.slider_fit import STEP_PROTOCOLS, SliderMotion, all_at_once, static_set, three_steps

PLACES = (0.12, 0.18, 0.24)
INERTIA = "a0 and a1 and a2"


def motion(protocol, slider, *, acceleration=1.0, position=1.0):
    """A slow sine on a steady climb and descent, its parts scaled by hand; the effort is any."""
    time = np.arange(2000) / 100.0
    velocity = np.where(time < 10.0, 0.3, -0.3)
    return SliderMotion(
        recording=f"{protocol}_{slider}",
        protocol=protocol,
        split="fitted",
        slider=slider,
        fs=100.0,
        position=position * (np.cumsum(velocity) / 100.0 - 1.0),
        velocity=velocity * (1.0 + 0.2 * np.sin(3.0 * time)),
        acceleration=acceleration * np.sin(5.0 * time),
        effort=np.sin(time),
        lowpass=5.0,
        order=4,
        scored=np.ones(len(time), bool),
    )


@pytest.mark.parametrize(
    ("dissociated", "idle"), [(False, INERTIA), (True, "a0_up and a1_up and a2_up and a0_down and a1_down and a2_down")]
)
def test_sweeps_that_do_not_accelerate(dissociated, idle):
    made = [motion(p, x, acceleration=0.1 if p == STEP_PROTOCOLS[0] else 0.0) for p in STEP_PROTOCOLS for x in PLACES]
    with pytest.raises(IdentificationError, match=rf"swept sines: {idle} cannot be identified"):
        three_steps(made, dissociated=dissociated)


def test_constant_velocities_along_gravity():
    made = [motion(p, x, acceleration=0.1, position=0.0) for p in STEP_PROTOCOLS for x in PLACES]
    with pytest.raises(IdentificationError) as said:
        three_steps(made, dissociated=True)
    idle = "moment_slope_up and moment_up and moment_slope_down and moment_down"
    assert re.match(rf"constant velocities: {idle} cannot be identified", str(said.value))


def test_all_at_once_without_acceleration():
    made = [motion("fourier", x, acceleration=0.0) for x in PLACES]
    with pytest.raises(IdentificationError, match=f"all at once: {INERTIA} cannot be identified"):
        all_at_once(made, dissociated=False)


def test_too_few_holds():
    with pytest.raises(IdentificationError, match="found 0 holds"):
        static_set([motion("static", 0.12)])
