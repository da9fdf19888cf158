"""Lengths and moment arms of published models from their files, against what OpenSim 4.6 computed of them."""

import csv

import numpy as np
import pytest

from pellucid.emg.files.osim_paths import read_paths
from pellucid.files.readers import read_columns


def columns(path):
    rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    return {key: np.array([float(r[key]) for r in rows]) for key in rows[0]}


@pytest.fixture(scope="module")
def gait2392(data_folder):
    path = data_folder / "gait2392_muscles" / "gait2392_thelen2003muscle.osim"
    if not path.is_file():
        pytest.skip(f"{path} is not here")
    return read_paths(path)


@pytest.mark.parametrize(("file", "hip"), [("knee_geometry_hip0.csv", 0.0), ("knee_geometry_hip90_seated.csv", 90.0)])
def test_gait2392_over_the_knee(data_folder, gait2392, file, hip):
    """13 muscles, 131 angles; the table has six digits."""
    table = columns(data_folder / "gait2392_muscles" / file)
    knee = np.radians(table["knee_angle_deg"])
    pose = {"hip_flexion_r": np.full_like(knee, np.radians(hip)), "knee_angle_r": knee}
    names = [name.removeprefix("len_") for name in table if name.startswith("len_")]
    assert len(names) == 13
    for name in names:
        length, (arm,) = gait2392.muscle(name).length(gait2392.skeleton, pose, ["knee_angle_r"])
        assert np.abs(length - table[f"len_{name}"]).max() < 6e-7, name
        assert np.abs(arm - table[f"ma_{name}"]).max() < 6e-7, name


def test_gait2392_while_walking(data_folder, gait2392):
    """All angles of the leg move; the origin's own copy of the model differs in nothing that matters here."""
    folder = data_folder / "lower_limb_walking"
    table, angles = columns(folder / "walk36_geometry.csv"), read_columns(folder / "ik.sto").values
    leg = ("hip_flexion_r", "hip_adduction_r", "hip_rotation_r", "knee_angle_r", "ankle_angle_r", "subtalar_angle_r")
    pose = {name: np.radians(angles[name][::20]) for name in leg if name in angles}
    for name in (key.removeprefix("length_") for key in table if key.startswith("length_")):
        along = ["knee_angle_r", "ankle_angle_r"]
        length, arms = gait2392.muscle(name).length(gait2392.skeleton, pose, along)
        assert np.abs(length - table[f"length_{name}"][::20]).max() < 1e-6, name
        for coordinate, arm in zip(("knee", "ankle"), arms, strict=True):
            assert np.abs(arm - table[f"moment_arm_{coordinate}_{name}"][::20]).max() < 1e-6, name
