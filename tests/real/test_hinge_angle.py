"""Two IMUs across a real hinge, against optics."""

import numpy as np
import pytest
from scipy.io import loadmat

from pellucid.orthosis.study.hinge.identify_hinge import identify_hinge
from pellucid.study.datasets import init


@pytest.fixture(scope="module")
def found(data_folder, tmp_path_factory):
    study = init(tmp_path_factory.mktemp("hinge") / "study", dataset="dfjimu_two_imu_joint")
    return identify_hinge(study), study


def test_the_angle_is_within_one_and_a_half_degrees(found):
    rows = {row.id.rsplit(".", 1)[-1]: row for row in found[0].rows if ".rmse_deg." in row.id}
    assert set(rows) == {"1D_01", "1D_02", "1D_04"}
    assert max(row.value for row in rows.values()) <= 1.5
    assert {row.split for row in rows.values()} == {"heldout"}


def test_only_the_stretch_in_which_a_body_was_lost_is_not_judged(found):
    excluded = {trial.name: trial.reference.excluded_between() for trial in found[0].trials}
    assert excluded["1D_02"] == excluded["1D_04"] == ()
    ((start, stop),) = excluded["1D_01"]
    assert start == pytest.approx(14.85, abs=0.04)
    assert stop == pytest.approx(15.05, abs=0.04)


def test_the_centre_is_where_the_files_say(found):
    """Their levers point from sensor to centre; along the axis nothing can be told."""
    findings, study = found
    for trial in findings.trials:
        data = loadmat(study.recording(trial.name).path, simplify_cells=True)["data"]
        for arm, axis, lever in zip(trial.hinge.arms, trial.hinge.axes, (data["r_12"], data["r_21"]), strict=True):
            off = arm + lever
            off = off - axis * (axis @ off)
            assert np.linalg.norm(off) < 0.01


def test_gyroscopes_alone_are_far_worse(found):
    for trial in found[0].trials:
        assert trial.scores["gyroscopes"].rms > 2.0 * trial.scores["offline"].rms
