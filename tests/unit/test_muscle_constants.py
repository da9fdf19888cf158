"""Constants of muscles from a model's file, under the study's own names."""

from types import SimpleNamespace

import pytest

from pellucid._errors import RecordingError
from pellucid.emg.study.emg_torque.emg_torque_table import EmgTorqueTable as EmgTorque
from pellucid.emg.study.emg_torque.study_muscles import read_muscle_constants, study_muscles

MODEL = """<?xml version="1.0"?><OpenSimDocument Version="40000"><Model name="leg"><ForceSet><objects>
<CoordinateActuator name="motor"><optimal_force>10</optimal_force></CoordinateActuator>
<Millard2012EquilibriumMuscle name="vaslat_l"><max_isometric_force>5148.7</max_isometric_force>
<optimal_fiber_length>0.0946</optimal_fiber_length><tendon_slack_length>0.21</tendon_slack_length>
<pennation_angle_at_optimal>0.25</pennation_angle_at_optimal></Millard2012EquilibriumMuscle>
<Schutte1993Muscle name="soleus_l"><max_isometric_force>3549</max_isometric_force>
<optimal_fiber_length>0.05</optimal_fiber_length><tendon_slack_length>0.25</tendon_slack_length>
<pennation_angle>0.43</pennation_angle></Schutte1993Muscle>
</objects></ForceSet></Model></OpenSimDocument>"""


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "leg.osim"
    path.write_text(MODEL)
    return path


def study(folder, **said):
    spec = EmgTorque(joints=("knee",), **said)
    inside = lambda file, where: folder / file  # noqa: E731
    return SimpleNamespace(inside=inside, table=lambda kind: spec, find_table=lambda kind: spec)


def test_muscles_of_a_model(model):
    found = read_muscle_constants(model)
    assert list(found) == ["vaslat_l", "soleus_l"]
    vastus = found["vaslat_l"]
    assert (vastus.largest_force, vastus.optimal_fibre_length) == (5148.7, 0.0946)
    assert (vastus.tendon_slack_length, vastus.pennation) == (0.21, 0.25)
    assert found["soleus_l"].pennation == 0.43


def test_a_study_has_its_own_names(model):
    said = {"muscle_file": "leg.osim", "muscle_names": {"vastus_lateralis": "vaslat_l"}}
    found = study_muscles(study(model.parent, **said))
    assert list(found) == ["vastus_lateralis"]
    assert found["vastus_lateralis"].name == "vaslat_l"
    assert list(study_muscles(study(model.parent, muscle_file="leg.osim"))) == ["vaslat_l", "soleus_l"]
    assert study_muscles(study(model.parent)) == {}
    said["muscle_names"] = {"rectus_femoris": "recfem_l"}
    with pytest.raises(RecordingError, match=r"leg.osim: found the muscles vaslat_l, soleus_l, expected recfem_l too"):
        study_muscles(study(model.parent, **said))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.0946", "short", r'muscle vaslat_l, <optimal_fiber_length>: found "short", expected a number'),
        ("<tendon_slack_length>0.21</tendon_slack_length>", "", r"<tendon_slack_length>: found none, expected"),
        ("OpenSimDocument", "Document", r"found <Document>, expected an <OpenSimDocument>"),
        ("max_isometric_force", "force", r"found no muscle, expected some with <max_isometric_force>"),
        ("</Model>", "", r"leg.osim: not readable as XML, truncated or damaged"),
    ],
)
def test_what_is_wrong_is_told(model, old, new, message):
    model.write_text(MODEL.replace(old, new))
    with pytest.raises(RecordingError, match=message):
        read_muscle_constants(model)


def test_another_file_is_told(tmp_path):
    with pytest.raises(RecordingError, match=r"found the ending \"\.csv\", expected \.osim"):
        read_muscle_constants(tmp_path / "muscles.csv")
    with pytest.raises(RecordingError, match="not readable"):
        read_muscle_constants(tmp_path / "none.osim")
