"""Lengths and moment arms of muscles from an OpenSim model, without OpenSim: points, moving points, joints, surfaces.

The leg of `tests/data/osim` was made up here; what it should give was computed with opensim 4.6 (`leg.json`).
"""

import json
from pathlib import Path

import numpy as np
import pytest

from pellucid._errors import PellucidError, RecordingError
from pellucid.emg.files.osim_paths import read_paths

DATA = Path(__file__).parents[1] / "data" / "osim"
LEG = json.loads((DATA / "leg.json").read_text(encoding="utf-8"))
ANGLES = {name: np.array(q) for name, q in LEG["angles"].items()}
# OpenSim 4.6 keeps a tangent point of the pass before where two surfaces are wrapped at once: its length is then none.
AT_ONCE = ("two",)
HIP, KNEE, ANKLE = "hip_flexion", "knee_angle", "ankle_angle"


@pytest.fixture(scope="module", params=["leg_3.osim", "leg_4.osim"])
def leg(request):
    return read_paths(DATA / request.param)


@pytest.mark.parametrize("name", [n for n in LEG["muscles"] if n not in AT_ONCE])
def test_lengths_and_arms_are_those_of_opensim(leg, name):
    length, arms = leg.muscle(name).length(leg.skeleton, ANGLES, LEG["along"])
    found = LEG["muscles"][name]
    assert np.abs(length - found["length"]).max() < 5e-6
    # OpenSim's helices are tangent to a tenth of a degree, these to rounding.
    assert np.abs(arms - found["arms"]).max() < 1e-4


@pytest.mark.parametrize("name", [n for n in LEG["muscles"] if not n.startswith("ellipsoid")])
def test_arms_are_the_exact_derivative_of_the_length(name):
    leg = read_paths(DATA / "leg_4.osim")
    _, arms = leg.muscle(name).length(leg.skeleton, ANGLES, LEG["along"])
    for arm, along in zip(arms, LEG["along"], strict=True):
        ends = [
            leg.muscle(name).length(leg.skeleton, {**ANGLES, along: ANGLES[along] + step})[0] for step in (-1e-6, 1e-6)
        ]
        assert np.abs(arm + (ends[1] - ends[0]) / 2e-6).max() < 1e-8


def test_a_muscle_knows_what_moves_it(leg):
    def moved(name):
        return leg.muscle(name).coordinates(leg.skeleton)

    assert moved("coupled") == (KNEE,), "the patella follows the knee"
    assert moved("moving") == (KNEE,)
    assert moved("on_foot") == (ANKLE,)
    assert moved("ranged") == (HIP, "hip_adduction", "slide", KNEE, ANKLE)


def test_what_is_not_followed_is_named(leg):
    with pytest.raises(PellucidError, match=r"muscle torus: wrap object ring: found a WrapTorus, which is not"):
        leg.muscle("torus").length(leg.skeleton, ANGLES)
    with pytest.raises(PellucidError, match=r'muscle axial: wrap object egg: found the method "axial"'):
        leg.muscle("axial").length(leg.skeleton, ANGLES)
    with pytest.raises(PellucidError, match=r"coordinate knee_angle_r: found none of that name in the model, expected"):
        leg.muscle("moving").length(leg.skeleton, {}, ["knee_angle_r"])
    with pytest.raises(PellucidError, match=r"coordinate beta: found it coupled to knee_angle"):
        leg.muscle("moving").length(leg.skeleton, {"beta": np.zeros(3)})
    with pytest.raises(RecordingError, match=r"leg_\d.osim: found the muscles moving, passing.*expected vaslat too"):
        leg.muscle("vaslat")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<location>0.045 -0.1 0.01</location>", "<location>45 -100 10</location>", r"100 m.*model in millimetres\?"),
        (">0 0.1 0.03<", ">0 5.7 20<", r"wrap object sided, <xyz_body_rotation>: found 20 rad.*in degrees\?"),
        ("</Model>", "", r"leg.osim: not readable as XML, truncated or damaged"),
        ("<coordinate>knee_angle</coordinate>", "<coordinate>knee</coordinate>", r'coordinate "knee", expected one of'),
        ("<wrap_object>egg<", "<wrap_object>eggs<", r'muscle ellipsoid: found the wrap object "eggs", expected one'),
        ("<body>patella<", "<body>kneecap<", r'muscle coupled, point b: found the frame "kneecap", expected a body'),
        ("<parent_body>shank<", "<parent_body>shin<", r'joint ankle: found the frame "shin"'),
        ('Version="30000"', 'Version="10905"', r'found the version "10905", expected one from 20000 on'),
        ("0.03 0.042 0.05", "0.03 0.042", r"point b, x_location: found 4 <x> and 3 <y>"),
        ("0.03 0.042 0.05", "0.03 long 0.05", r'x_location, <y>: found "0.03 long 0.05 0.055"'),
        ("SimmSpline", "GCVSpline", r"found a GCVSpline, which is not followed"),
        ("-2.1 -0.8", "-2.1", r'muscle passing, point b, <range>: found "-2.1", expected 2 numbers'),
        ('<?xml version="1.0" ?>', '<?xml version="1.0"?><!DOCTYPE m [<!ENTITY a "b">]>', r"found a document type"),
    ],
)
def test_faulty_models_are_refused_with_what_is_wrong(tmp_path, old, new, message):
    text = (DATA / "leg_3.osim").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "leg.osim"
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(RecordingError, match=message):
        read_paths(path)


def test_an_unknown_joint_is_refused_where_a_muscle_needs_it(tmp_path):
    text = (DATA / "leg_3.osim").read_text(encoding="utf-8")
    path = tmp_path / "leg.osim"
    path.write_text(text.replace("PinJoint", "EllipsoidJoint"), encoding="utf-8")
    leg = read_paths(path)
    assert len(leg.muscle("moving").length(leg.skeleton, ANGLES)[0]) == 12
    with pytest.raises(PellucidError, match=r"joint ankle: found a EllipsoidJoint, which is not supported, expected"):
        leg.muscle("on_foot").length(leg.skeleton, ANGLES)


def test_opensim_says_the_same():
    opensim = pytest.importorskip("opensim", reason='opensim is not there: pip install ".[opensim]"')
    opensim.Logger.setLevelString("error")
    model = opensim.Model(str(DATA / "leg_3.osim"))
    state = model.initSystem()
    coordinates, muscles = model.getCoordinateSet(), model.getMuscles()
    leg = read_paths(DATA / "leg_4.osim")
    for name in set(LEG["muscles"]) - set(AT_ONCE):
        length, arms = leg.muscle(name).length(leg.skeleton, ANGLES, LEG["along"])
        for i in range(len(length)):
            for coordinate, q in ANGLES.items():
                coordinates.get(coordinate).setValue(state, float(q[i]), False)
            model.assemble(state)
            model.realizePosition(state)
            assert abs(muscles.get(name).getLength(state) - length[i]) < 5e-6
            for k, along in enumerate(LEG["along"]):
                arm = muscles.get(name).computeMomentArm(state, coordinates.get(along))
                assert abs(arm - arms[k, i]) < 1e-4
