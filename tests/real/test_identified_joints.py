"""The three public joints, from init to results.json."""

import json
import shutil

import numpy as np
import pytest
import scipy.io

from pellucid.joint.study.joint_result import rows_of
from pellucid.study.datasets import init
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import identify


def figures(fit):
    return {row.id: row.value for row in rows_of(fit)}


def test_emps_open_loop_follows_the_measured_position(emps_fit):
    found = figures(emps_fit)
    assert found["emps.directional.openloop.identification.rmse_mm"] <= 2.65
    assert found["emps.directional.openloop.pulses.rmse_mm"] < 15.0


def test_a_better_friction_model_predicts_the_pulses_better(emps_fit):
    assert emps_fit.families["directional"].heldout_effort_error < emps_fit.families["symmetric"].heldout_effort_error


def test_closed_loop_methods_agree_with_least_squares_on_the_inertia(emps_fit):
    fit = emps_fit.families["symmetric"]
    for method in ("wls", "irls", "iv", "didim", "output_error"):
        assert fit.others[method]["inertia"].value == pytest.approx(fit["inertia"].value, rel=0.02), method


def test_sydney(tmp_path, data_folder):
    study = init(tmp_path / "s", dataset="sydney_pendulum")
    found = figures(identify(study, families=["symmetric"], thorough=False))
    assert 0.222 <= found["sydney_pendulum.symmetric.inertia"] <= 0.248
    assert 16.0 <= found["sydney_pendulum.symmetric.gravity"] <= 17.6
    assert found["sydney_pendulum.symmetric.r2"] >= 0.98
    assert found["sydney_pendulum.symmetric.heldout.r2"] >= 0.93


@pytest.mark.parametrize("purpose", ["torque", "simulation"])
@pytest.mark.parametrize("name", ["sydney_pendulum", "bam_servo"])
def test_the_headline_is_no_worse_than_an_estimator_beside_it(tmp_path, data_folder, name, purpose):
    study = init(tmp_path / "s", dataset=name)
    path = study.folder / "study.toml"
    text = path.read_text(encoding="utf-8").replace('purpose = "torque"', "")
    path.write_text(text.replace("[model]", f'[model]\npurpose = "{purpose}"', 1), encoding="utf-8")
    found = identify(open_study(study.folder), families=["symmetric", "load"])
    rows, method = figures(found), found.headlined.estimate.method
    ending = {"torque": "effort_rmse", "simulation": "rmse_deg"}[purpose]
    head = f"{name}.headline.blocks_out."
    errors = {k.removeprefix(head).split(".")[0]: v for k, v in rows.items() if k.startswith(head) and ending in k}
    assert len(errors) > 3
    assert errors[method] <= min(errors.values()) / 0.95
    if purpose == "simulation":
        assert method == "output_error"
        own = rows[f"{name}.{found.best}.output_error.inertia"]
        assert rows[f"{name}.headline.inertia"] == own


def test_bam_load_dependence_shows_on_held_out_trajectories(tmp_path, data_folder):
    study = init(tmp_path / "b", dataset="bam_xl330")
    found = figures(identify(study, families=["symmetric", "load"]))
    assert found["bam_xl330.load.heldout.effort_error"] < found["bam_xl330.symmetric.heldout.effort_error"]
    assert np.isfinite(found["bam_xl330.load.heldout.angle_mae_deg"])


def test_the_servo_that_ships_is_told_from_its_fitted_recordings_alone(tmp_path):
    """A weak spring that is not believed must not leave its share of the misfit to friction."""
    found = identify(init(tmp_path / "servo", dataset="bam_servo"))
    assert found.headlined.family == "load"
    assert found.headlined.heldout_effort_error < 15.0


def test_names_of_files_and_columns_do_not_matter(tmp_path, data_folder):
    """The same recording under another study name, file name and column names gives the same figures."""
    original = init(tmp_path / "a", dataset="emps")
    copy = tmp_path / "b"
    shutil.copytree(original.folder, copy)
    renamed = {"t": "clock", "qm": "alpha", "qg": "beta", "vir": "gamma", "pulses_N": "delta"}
    text = (copy / "study.toml").read_text(encoding="utf-8").replace('name = "emps"', 'name = "slide7"')
    for old, new in renamed.items():
        text = text.replace(f'column = "{old}"', f'column = "{new}"')
    for i, old in enumerate(("DATA_EMPS_PULSES.mat", "DATA_EMPS.mat")):
        content = scipy.io.loadmat(copy / "recordings" / old)
        content = {renamed.get(k, k): v for k, v in content.items() if not k.startswith("__")}
        (copy / "recordings" / old).unlink()
        scipy.io.savemat(copy / "recordings" / f"run{i}.mat", content)
        text = text.replace(f"recordings/{old}", f"recordings/run{i}.mat")
    (copy / "study.toml").write_text(text, encoding="utf-8")
    ours = figures(identify(original, families=["symmetric", "directional"]))
    theirs = figures(identify(open_study(copy), families=["symmetric", "directional"]))
    assert {k.removeprefix("emps."): v for k, v in ours.items()} == {
        k.removeprefix("slide7."): v for k, v in theirs.items()
    }
    assert len(ours) > 40


def test_identifying_twice_gives_the_same_bits_and_replaces_its_own_rows(tmp_path, data_folder):
    study = init(tmp_path / "s", dataset="sydney_pendulum")
    identify(study, families=["symmetric"], thorough=False).save(study)
    first = study.results_path.read_text(encoding="utf-8")
    identify(study, families=["symmetric"], thorough=False).save(study)
    assert study.results_path.read_text(encoding="utf-8") == first
    assert json.loads(first)["figures"]
