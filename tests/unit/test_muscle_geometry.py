"""Lengths and moment arms: the anatomical model's facts, and work that agrees."""

import csv

import numpy as np
import pytest

from pellucid.emg.models.muscle_geometry import muscle_table

TABLE = muscle_table()
NAMES = tuple(TABLE.geometry)


def random_pose(geometry, rng, n=200, beyond=0.0):
    spans = {a: geometry.range(a) for a in geometry.angles}
    return {a: rng.uniform(low - beyond, high + beyond, n) for a, (low, high) in spans.items()}


def test_constants_are_the_models():
    """As `gait2392_thelen2003muscle.osim` has them."""
    for name, force, optimal, slack, pennation in (
        ("rectus_femoris", 1169.0, 0.114, 0.310, 0.08726646),
        ("vastus_medialis", 1294.0, 0.089, 0.126, 0.08726646),
        ("vastus_intermedius", 1365.0, 0.087, 0.136, 0.05235988),
        ("vastus_lateralis", 1871.0, 0.084, 0.157, 0.08726646),
    ):
        m = TABLE.constants[name]
        found = (m.max_isometric_force, m.optimal_fibre_length, m.tendon_slack_length, m.pennation)
        assert found == pytest.approx((force, optimal, slack, pennation), rel=1e-6)
    assert TABLE.source.startswith("OpenSim gait2392")
    assert "CC BY 3.0" in TABLE.licence


def test_fibres_where_the_leg_hangs():
    """l/l_o at -85 degrees; the hip decides for the rectus femoris."""
    for name, hip, expected in (
        ("vastus_medialis", 85.0, 1.18),
        ("vastus_intermedius", 85.0, 1.22),
        ("vastus_lateralis", 85.0, 1.22),
        ("rectus_femoris", 85.0, 0.81),
        ("rectus_femoris", 0.0, 1.45),
    ):
        m = TABLE.constants[name]
        length = TABLE.geometry[name].length({"hip": np.radians([hip]), "knee": np.radians([-85.0])})[0]
        fibre = np.hypot(length - m.tendon_slack_length, m.optimal_fibre_length * np.sin(m.pennation))
        assert fibre / m.optimal_fibre_length == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("name", NAMES)
def test_moment_arms_are_the_derivative_of_length(name, rng):
    geometry = TABLE.geometry[name]
    pose = random_pose(geometry, rng, beyond=0.2)
    rates = {a: rng.standard_normal(200) for a in geometry.angles}
    h = 1e-6
    moved = {s: {a: q + s * h * rates[a] for a, q in pose.items()} for s in (-1, 1)}
    numeric = (geometry.length(moved[1]) - geometry.length(moved[-1])) / (2 * h)
    np.testing.assert_allclose(geometry.rate(pose, rates), numeric, atol=2e-7)
    for joint in geometry.angles:
        alone = {s: pose | {joint: pose[joint] + s * h} for s in (-1, 1)}
        slope = (geometry.length(alone[1]) - geometry.length(alone[-1])) / (2 * h)
        np.testing.assert_allclose(geometry.moment_arm(joint, pose), -slope, atol=2e-7)


def test_a_joint_that_is_not_crossed_has_no_arm():
    assert TABLE.geometry["soleus"].moment_arm("knee", {"ankle": np.zeros(3)}).tolist() == [0.0] * 3


def test_length_goes_on_straight_beyond_the_table():
    geometry = TABLE.geometry["vastus_lateralis"]
    low, high = geometry.range("knee")
    for end, away in ((low, -1.0), (high, 1.0)):
        beyond = geometry.length({"knee": end + away * np.array([0.0, 0.2, 0.4])})
        assert beyond[2] - beyond[1] == pytest.approx(beyond[1] - beyond[0], rel=1e-9)


def test_an_unknown_model_is_named():
    with pytest.raises(ValueError, match="gait2392"):
        muscle_table("gait9999")


LABELS = {
    "rectus_femoris": "rect_fem_r", "vastus_medialis": "vas_med_r", "vastus_intermedius": "vas_int_r",
    "vastus_lateralis": "vas_lat_r", "biceps_femoris_long": "bifemlh_r", "biceps_femoris_short": "bifemsh_r",
    "semimembranosus": "semimem_r", "semitendinosus": "semiten_r", "gastrocnemius_medialis": "med_gas_r",
    "gastrocnemius_lateralis": "lat_gas_r", "soleus": "soleus_r", "tibialis_anterior": "tib_ant_r",
}  # fmt: skip


def columns(path):
    if not path.is_file():
        pytest.skip(f"{path} is not here")
    rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    return {key: np.array([float(r[key]) for r in rows]) for key in rows[0]}


@pytest.mark.parametrize(("file", "hip"), [("knee_geometry_hip0.csv", 0.0), ("knee_geometry_hip90_seated.csv", 90.0)])
def test_lengths_are_those_of_opensim(data_folder, file, hip):
    table = columns(data_folder / "gait2392_muscles" / file)
    knee = np.radians(table["knee_angle_deg"])
    pose = {"hip": np.full_like(knee, np.radians(hip)), "knee": knee, "ankle": np.zeros_like(knee)}
    for name, label in LABELS.items():
        if f"len_{label}" not in table:
            continue
        geometry = TABLE.geometry[name]
        assert np.abs(geometry.length(pose) - table[f"len_{label}"]).max() < 2e-4, name
        # A via point that begins to act makes the model's own arm jump; a spline goes through.
        arm = geometry.moment_arm("knee", pose) - table[f"ma_{label}"]
        assert np.sqrt(np.mean(arm**2)) < 8e-4, name


def test_walking_turns_the_hip_and_the_foot_too(data_folder):
    """Angles that the table takes for 0 cost millimetres of length, and hardly any moment arm."""
    from pellucid.files.readers import read_columns

    folder = data_folder / "lower_limb_walking"
    table = columns(folder / "walk36_geometry.csv")
    angles = read_columns(folder / "ik.sto").values
    coordinates = {"hip": "hip_flexion_r", "knee": "knee_angle_r", "ankle": "ankle_angle_r"}
    pose = {a: np.radians(angles[c]) for a, c in coordinates.items()}
    for name, label in LABELS.items():
        geometry = TABLE.geometry[name]
        error = geometry.length(pose) - table[f"length_{label}"]
        assert np.abs(error).max() < (2e-5 if geometry.angles == ("knee",) else 4.4e-3), name
        assert abs(error.mean()) < 1.1e-3, name
        for joint in ("knee", "ankle"):
            arm = geometry.moment_arm(joint, pose) - table[f"moment_arm_{joint}_{label}"]
            assert np.sqrt(np.mean(arm**2)) < 7e-4, (name, joint)
