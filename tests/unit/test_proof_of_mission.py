"""The proof of what the papers want: leads of detectors, and loads on virtual robots."""

import numpy as np
import pytest
from research.evidence._lead import RATE_HZ, Stretch, best_shift, compare_detectors, rows_of
from research.evidence._lead_control import LateEmg
from research.evidence._loads import ratio_interval

from pellucid.models.anthropometry import point_mass
from pellucid.models.joint import GRAVITY
from pellucid_lab.elbow.rig import able_elbow, with_fastened_load


def stretch(rng, *, emg_ahead, motion_ahead):
    """Thirty bursts at drawn times; two signals that come so many samples before the moment."""
    n = 6000
    moment = np.zeros(n)
    for begin in 200 * np.arange(30) + rng.integers(20, 100, 30):
        moment[begin : begin + 60] = np.sin(np.linspace(0.0, np.pi, 60))

    def signal(ahead):
        return np.column_stack([np.roll(moment, -ahead), np.zeros(n)]) + 0.01 * rng.standard_normal((n, 2))

    return Stretch(100.0 * moment, signal(emg_ahead), signal(motion_ahead))


@pytest.mark.parametrize(("emg_ahead", "motion_ahead"), [(10, 0), (3, 8)])
def test_a_lead_is_found_and_has_its_sign(rng, emg_ahead, motion_ahead):
    fitted, judged = (stretch(rng, emg_ahead=emg_ahead, motion_ahead=motion_ahead) for _ in range(2))
    found = compare_detectors([fitted], [judged])
    expected = (emg_ahead - motion_ahead) / RATE_HZ
    assert np.nanmedian(found.motion - found.emg) == pytest.approx(expected, abs=0.015)
    assert np.isnan(found.emg).sum() <= 1
    assert max(compare_detectors([fitted], [fitted]).false_alarms) <= 0.05 * 30
    rows = {row.id: row.value for row in rows_of("walking", [found])}
    assert rows["mission.lead.walking.motion.low"] <= rows["mission.lead.walking.motion"]
    assert rows["mission.lead.walking.motion"] == pytest.approx(1e3 * expected, abs=15.0)


def test_a_fastened_load_adds_its_weight_and_inertia_about_the_axis():
    robot = able_elbow()
    loaded = with_fastened_load(robot, point_mass(1.5, 0.3))
    assert loaded.gravity(0.2)[0] - robot.gravity(0.2)[0] == pytest.approx(1.5 * 0.3 * GRAVITY)
    assert loaded.gravity(0.2)[1] == pytest.approx(robot.gravity(0.2)[1])
    assert loaded.inertia(0.2) - robot.inertia(0.2) == pytest.approx(1.5 * 0.09)


def test_the_interval_of_a_ratio_contains_it():
    ratio, low, high = ratio_interval([1.0, 2.0, 3.0], [2.0, 4.0, 5.0])
    assert ratio == pytest.approx(6.0 / 11.0)
    assert low <= ratio <= high


def test_the_shift_of_a_force_behind_an_envelope_is_found(rng):
    envelope = np.convolve(rng.standard_normal(1500), np.ones(12) / 12.0, "same")
    lead, size = best_shift(envelope, np.roll(envelope, 17) + 0.05 * rng.standard_normal(1500))
    assert lead == pytest.approx(0.17)
    assert size > 0.9


def test_late_emg_reaches_a_controller_as_many_periods_later():
    heard = []

    class Listener:
        fault = "none"

        def step(self, time, position, torque, emg=()):
            heard.append(list(emg))
            return 0.0

    late = LateEmg(Listener(), 2)
    for k in range(4):
        late.step(0.0, 0.0, 0.0, [(float(k), 0.0)])
    assert heard == [[], [], [(0.0, 0.0)], [(1.0, 0.0)]]
