"""A hinge found from two made-up IMUs whose truth is known, and its angle followed without drift."""

import numpy as np
import pytest
from inertial_motion import turned_hinge

from pellucid._errors import PellucidError
from pellucid.orthosis.imu.hinge import find_hinge, hinge_angle
from pellucid.orthosis.imu.imu_angle import Inertial


def first_seconds(made, stop=10.0):
    return find_hinge(made.proximal.between(0.0, stop), made.distal.between(0.0, stop))


def error(found, made, axes):
    sense = np.sign(axes[0] @ made.axes[0])
    off = sense * found.angle - made.angle
    return off - np.mean(off[: len(off) // 3])


def test_without_noise_axis_centre_and_angle_are_right():
    made = turned_hinge()
    hinge = first_seconds(made)
    sense = np.sign(hinge.axes[0] @ made.axes[0])
    np.testing.assert_allclose(sense * hinge.axes, made.axes, atol=2e-3)
    np.testing.assert_allclose(hinge.arms, made.arms, atol=2e-3)
    for offline in (True, False):
        found = hinge_angle(made.proximal, made.distal, hinge, offline=offline)
        assert np.max(np.abs(error(found, made, hinge.axes)[200:])) < np.radians(0.3)


def test_offsets_and_noise_do_not_make_the_angle_drift(rng):
    made = turned_hinge(rng, seconds=60.0, noise=0.01, offset=0.02)
    hinge = first_seconds(made)
    assert hinge.rested
    late = slice(4000, None)
    offline = error(hinge_angle(made.proximal, made.distal, hinge), made, hinge.axes)[late]
    causal = error(hinge_angle(made.proximal, made.distal, hinge, offline=False), made, hinge.axes)[late]
    gyroscopes = error(hinge_angle(made.proximal, made.distal, hinge, directions=False), made, hinge.axes)[late]
    rms = [float(np.degrees(np.sqrt(np.mean(each**2)))) for each in (offline, causal, gyroscopes)]
    assert rms[0] < 0.5
    assert rms[0] <= rms[1] < 1.0
    assert rms[2] > 2.0 * rms[0]


@pytest.mark.nightly
def test_errors_of_axes_lie_within_their_standard_errors():
    """Tilts of the axis over its own standard errors, 12 draws: neither hopeful nor timid by a factor of 3."""
    ratios = []
    for seed in range(12):
        made = turned_hinge(np.random.default_rng(seed), fs=50.0, seconds=10.0, noise=0.02)
        hinge = first_seconds(made)
        sense = np.sign(hinge.axes[0] @ made.axes[0])
        tilt = np.linalg.norm(np.cross(sense * hinge.axes[0], made.axes[0]))
        ratios.append(tilt / np.linalg.norm(hinge.standard_errors[:2]))
    assert 1.0 / 3.0 < np.sqrt(np.mean(np.square(ratios))) < 3.0


def test_a_causal_angle_does_not_know_later_samples(rng):
    made = turned_hinge(rng, noise=0.01)
    hinge = first_seconds(made)
    whole = hinge_angle(made.proximal, made.distal, hinge, offline=False)
    cut = hinge_angle(made.proximal.between(0.0, 15.0), made.distal.between(0.0, 15.0), hinge, offline=False)
    np.testing.assert_allclose(whole.angle[: len(cut.angle)], cut.angle, atol=1e-9)


def test_a_joint_that_hardly_moves_is_refused(rng):
    time = np.arange(1000) / 100.0
    still = [Inertial(time, 0.01 * rng.standard_normal((1000, 3)), np.tile([0, 0, 9.81], (1000, 1))) for _ in range(2)]
    with pytest.raises(PellucidError, match="hinge: the joint turns at"):
        find_hinge(*still)


def test_imus_of_different_length_are_refused():
    made = turned_hinge(seconds=12.0)
    with pytest.raises(PellucidError, match="equal numbers from both"):
        find_hinge(made.proximal, made.distal.between(0.0, 10.0))
