"""Lengths of a model's muscles as polynomials, kept in the study."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.emg.estimators.torque_trial import MuscleSource
from pellucid.emg.files.muscle_polynomials import model_muscles, read_polynomials, write_polynomials
from pellucid.emg.files.osim_paths import read_paths
from pellucid.emg.models.muscle_geometry import fit_muscle_polynomial
from pellucid.emg.study.emg_torque.emg_torque_table import EmgTorqueTable
from pellucid.emg.study.emg_torque.study_muscles import read_muscle_constants, study_geometry, study_muscles

LEG = Path(__file__).parents[1] / "data" / "osim" / "leg_4.osim"
NAMES = {"vasti": "coupled", "rectus": "cylinder", "tibialis": "on_foot"}
COORDINATES = {"hip": "hip_flexion", "knee": "-knee_angle", "ankle": "ankle_angle"}


def study(folder, columns=None, **said):
    spec = EmgTorqueTable(joints=("knee",), **said)
    channels = {f"angle.{j}": SimpleNamespace(column=c, sign=1) for j, c in (columns or {}).items()}
    return SimpleNamespace(
        folder=folder, place=lambda name: folder / name, inside=lambda file, where: folder / file,
        config=SimpleNamespace(channels=channels), table=lambda kind: spec, find_table=lambda kind: spec,
    )  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "leg.osim").write_bytes(LEG.read_bytes())
    return tmp_path


@pytest.fixture(scope="module")
def muscles():
    return model_muscles(LEG, "0" * 64, COORDINATES, NAMES)


def test_a_polynomial_finds_a_polynomial():
    def path(angles):
        a, b = angles["hip"], angles["knee"]
        return 0.3 + 0.02 * a - 0.04 * b + 0.01 * a * b**2, np.array([-0.02 - 0.01 * b**2, 0.04 - 0.02 * a * b])

    found = fit_muscle_polynomial("rectus", {"hip": (-0.5, 1.0), "knee": (-2.0, 0.2)}, path)
    assert found.powers.sum(axis=1).max() == 3
    assert found.error.length < 1e-12
    assert found.error.arm_most < 1e-11
    pose = {"hip": np.array([-0.2, 0.7]), "knee": np.array([-1.5, 0.1])}
    length, arms = path(pose)
    assert found.length(pose) == pytest.approx(length, abs=1e-12)
    assert found.moment_arm("knee", pose) == pytest.approx(arms[1], abs=1e-12)
    assert found.range("knee") == pytest.approx((-2.0, 0.2))
    beyond = {"hip": np.array([0.0]), "knee": np.array([0.5])}
    edge = {"hip": np.array([0.0]), "knee": np.array([0.2])}
    assert found.length(beyond) == pytest.approx(found.length(edge) - 0.3 * found.moment_arm("knee", edge))


@pytest.mark.parametrize("name", NAMES)
def test_they_are_near_the_model(muscles, name):
    """As near as they say, and the arms are the exact derivative of the length."""
    polynomial, model = muscles.polynomials[name], read_paths(LEG)
    rng = np.random.default_rng(1)
    pose = {a: rng.uniform(*np.array(polynomial.range(a)) * 0.98, 200) for a in polynomial.angles}
    signs = muscles.signs
    truth = {COORDINATES[a].removeprefix("-"): signs[a] * q for a, q in pose.items()}
    length, arms = model.muscle(NAMES[name]).length(model.skeleton, truth, list(truth))
    missed = polynomial.length(pose) - length
    assert np.sqrt(np.mean(missed**2)) < 1.5 * polynomial.error.length + 1e-9
    # The cylinder lets a rectus go where hip and knee are bent beyond what people do; the file says so.
    assert (polynomial.error.length < 1e-4) == (name != "rectus")
    for angle, arm in zip(pose, arms, strict=True):
        own = polynomial.moment_arm(angle, pose)
        assert np.sqrt(np.mean((own - signs[angle] * arm) ** 2)) < 1.5 * polynomial.error.arm + 1e-9
        step = [polynomial.length({**pose, angle: pose[angle] + h}) for h in (-1e-6, 1e-6)]
        assert np.abs(own + (step[1] - step[0]) / 2e-6).max() < 1e-8
    assert muscles.held.get("hip_adduction", 0.0) == 0.0


def test_a_source_takes_them_in_the_studys_signs(muscles):
    source = MuscleSource({}, polynomials=muscles.polynomials, sign=-1.0)
    q = {"knee": np.linspace(0.1, 1.5, 5)}
    length, rate, arm = source.path("vasti", "knee", q, {"knee": np.ones(5)})
    assert length == pytest.approx(muscles.polynomials["vasti"].length(q))
    assert rate == pytest.approx(-arm)
    assert (arm < 0.0).all(), "an extensor pulls against flexion"


def test_a_study_keeps_them_and_needs_the_model_once(folder):
    said = {"muscle_names": NAMES, "coordinates": COORDINATES}
    made = study_geometry(study(folder, muscle_file="leg.osim", **said))
    kept = folder / "muscle_geometry.json"
    first = kept.read_bytes()
    table = json.loads(first)
    assert table["coordinates"]["knee"] == "-knee_angle"
    assert table["muscles"]["vasti"]["name_in_the_model"] == "coupled"
    again = read_polynomials(kept)
    for name, polynomial in made.polynomials.items():
        assert np.array_equal(again.polynomials[name].coefficients, polynomial.coefficients)
        assert again.polynomials[name].angles == polynomial.angles
    (folder / "leg.osim").unlink()
    with pytest.raises(RecordingError, match=r"no such file; its polynomials were kept: use muscle_file"):
        study_geometry(study(folder, muscle_file="leg.osim", **said))
    alone = study(folder, muscle_file="muscle_geometry.json", **said)
    assert study_geometry(alone).polynomials.keys() == made.polynomials.keys()
    assert study_muscles(alone)["vasti"].largest_force == 1000.0
    assert read_muscle_constants(kept)["coupled"].largest_force == 1000.0
    write_polynomials(kept, again)
    assert json.loads(kept.read_text())["muscles"]["vasti"] == table["muscles"]["vasti"]


def test_columns_called_as_the_coordinates_need_no_more_words(folder):
    names = {"muscle_file": "leg.osim", "muscle_names": {"vasti": "coupled"}}
    found = study_geometry(study(folder, {"knee": "knee_angle", "hip": "phi"}, **names))
    assert dict(found.coordinates) == {"knee": "knee_angle"}
    assert study_geometry(study(folder, {"knee": "angle"}, **names)) is None, "the generic leg, as before"


def test_what_is_not_there_or_not_followed_is_named(folder):
    with pytest.raises(RecordingError, match=r'found no coordinate "knee" of joint knee.*\[emg_torque.coordinates\]'):
        study_geometry(study(folder, muscle_file="leg.osim", coordinates={"knee": "knee"}))
    with pytest.raises(RecordingError, match=r'found no coordinate "beta" of joint knee that moves freely'):
        study_geometry(study(folder, muscle_file="leg.osim", coordinates={"knee": "beta"}))
    with pytest.raises(RecordingError, match=r"leg.osim, muscle torus: wrap object ring: found a WrapTorus"):
        model_muscles(folder / "leg.osim", "", {"knee": "knee_angle"}, {"ham": "torus"})
    with pytest.raises(RecordingError, match=r"found the muscles moving.*expected vaslat_r too"):
        model_muscles(folder / "leg.osim", "", {"knee": "knee_angle"}, {"vastus": "vaslat_r"})
    with pytest.raises(RecordingError, match=r"found no muscle across ankle_angle, expected some of coupled"):
        model_muscles(folder / "leg.osim", "", {"ankle": "ankle_angle"}, {"vasti": "coupled"})


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"kind": "muscle_geometry"', '"kind": "joint"', r'found no "kind": "muscle_geometry" of format 1'),
        ('"coefficients": [', '"coefficients": [1e400, ', "found .* coefficients and powers"),
        ('"half": [', '"half": [-', "found numbers that no muscle has"),
        ('"largest_force": 1000.0', '"largest_force": -1.0', "largest_force: found -1"),
        ('"middle"', '"centre"', "found no whole muscle_geometry"),
        ("}", "", "not readable as JSON, truncated or damaged"),
    ],
)
def test_a_damaged_file_is_refused(muscles, tmp_path, old, new, message):
    path = write_polynomials(tmp_path / "muscle_geometry.json", muscles)
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(RecordingError, match=message):
        read_polynomials(path)
