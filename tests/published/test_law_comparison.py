"""Laws compared on robots that none was chosen on."""

import numpy as np
import pytest

from pellucid.controllers.elbow_controllers import BEST_CONTROLLER, BEST_SENSED_CONTROLLER
from pellucid_lab.elbow.rig import able_elbow, drawn_rigs
from pellucid_lab.papers.able import law_comparison
from pellucid_lab.papers.able.law_comparison import (
    COMPARED_CONTROLLERS,
    FC_WITH_OTHER_INERTIA,
    UNPOWERED_ROBOT,
    LawOnRobot,
    comparison_rows,
    try_laws,
    tuning_robots,
)
from pellucid_lab.pointing.rig import elbow_participants
from pellucid_lab.strap_options import without_strap_options

CORRECTED = ("without_friction", "transparent", "emg", "oscillator", "dithered", "force_sensor", "disturbance_observer",
             "residual", "amplification_2", "amplification_4", "amplification_10")  # fmt: skip


def test_no_robot_is_both_chosen_on_and_tried_on():
    chosen = [robot.tables for robot in tuning_robots()]
    assert all(robot.tables not in chosen for robot in drawn_rigs(able_elbow()))


QUICK_LAWS = ("fc", "pcfr", "transparent", "dithered", "force_sensor", "residual", "amplification_4")
"""Laws that are tried every time; the others at night."""


@pytest.mark.parametrize(
    ("changes", "best", "best_sensed", "laws"),
    [
        pytest.param(without_strap_options(), 0.70, 0.60, COMPARED_CONTROLLERS, marks=pytest.mark.nightly),
        pytest.param({}, 0.75, 0.63, COMPARED_CONTROLLERS, marks=pytest.mark.nightly),
        pytest.param({}, 0.75, 0.63, QUICK_LAWS, marks=pytest.mark.nightly),
    ],  # measured: 0.63 and 0.54; with straps as they are 0.70 and 0.58
    ids=["a spring and a damper", "straps as they are", "some laws"],
)
def test_the_best_laws_leave_far_less_torque_and_nothing_drives_or_cycles(
    changes, best, best_sensed, laws, monkeypatch
):
    monkeypatch.setattr(law_comparison, "COMPARED_CONTROLLERS", {name: COMPARED_CONTROLLERS[name] for name in laws})
    monkeypatch.setattr(law_comparison, "elbow_participants", lambda r: elbow_participants(r).strapped(changes))
    # One person under FC hunts by chance: .34 to .45 N m from seed to seed. So three people, each twice, as by default.
    found = try_laws(drawn_rigs(able_elbow(), 1)[0], seed=5)
    assert set(found) == {*laws, UNPOWERED_ROBOT, *FC_WITH_OTHER_INERTIA}
    torque = found["fc"].torque
    assert found[BEST_CONTROLLER].torque < best * torque
    assert found[BEST_SENSED_CONTROLLER].torque < best_sensed * torque
    assert found["transparent"].torque < torque < found["pcfr"].torque < found[UNPOWERED_ROBOT].torque
    assert found["fc"].given > 0.1
    # What drives is equation 8 with the robot's own inertia: without it FC hardly does, with the paper's J it brakes.
    assert found["fc_table2_inertia"].given < found["fc_no_inertia"].given < 0.2 * found["fc"].given
    assert all(found[law].given < 0.0 for law in {*CORRECTED} & {*laws})
    assert all(one.resting == 0.0 for name, one in found.items() if name != "dithered")
    assert 0.0 < found["dithered"].resting < 0.05  # its own dither
    assert sum(one.faults for one in found.values()) == 0


def test_rows_tell_the_middle_of_torque_and_the_worst_of_the_rest():
    laws = (*COMPARED_CONTROLLERS, UNPOWERED_ROBOT, *FC_WITH_OTHER_INERTIA)
    found = {name: tuple(LawOnRobot(t, -t, 0.0, 0) for t in (0.2, 0.4, 0.3)) for name in laws}
    found["fc"] = tuple(LawOnRobot(t, t, 0.0, 1) for t in (0.4, 0.4, 0.4))
    rows = {row.id: row for row in comparison_rows(found)}
    assert rows["transparency.torque.best_over_fc"].ours == pytest.approx(0.75)
    pcfr = rows["transparency.torque.pcfr_over_fc"]
    assert (pcfr.lower, pcfr.upper) == (0.5, 1.0)
    assert "transparency.torque.fc_over_fc" not in rows
    assert rows["transparency.given.pcfr"].ours == pytest.approx(-0.2)
    assert rows["transparency.faults"].ours == 3
    assert np.isfinite([row.ours for row in rows.values()]).all()
