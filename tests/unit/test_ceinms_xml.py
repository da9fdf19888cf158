"""CEINMS subjects are read, of either program, and what is wrong with one is told."""

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.emg.files.muscle_constants import read_subject

MUSCLE = """<mtu><name>vaslat_r</name>{twitch}<shapeFactor>-0.5</shapeFactor>
<optimalFiberLength>0.084</optimalFiberLength><pennationAngle>{pennation}</pennationAngle>
<tendonSlackLength>0.157</tendonSlackLength><maxIsometricForce>1871</maxIsometricForce>
<strengthCoefficient>{strength}</strengthCoefficient></mtu>"""
SUBJECT = """<?xml version="1.0"?><subject><mtuDefault><emDelay>0.015</emDelay><c1>-0.4</c1><c2>-0.6</c2>
<curve><name>activeForceLength</name><xPoints>0.5 1 1.5</xPoints><yPoints>0 1 {last}</yPoints></curve></mtuDefault>
<mtuSet>{muscle}</mtuSet>
<dofSet><dof><name>knee_angle_r</name><mtuNameSet>{moves}</mtuNameSet></dof></dofSet></subject>"""


def written(tmp_path, *, pennation="5", strength="1.3", twitch="", last="0", moves="vaslat_r"):
    path = tmp_path / "subject.xml"
    muscle = MUSCLE.format(pennation=pennation, strength=strength, twitch=twitch)
    path.write_text(SUBJECT.format(muscle=muscle, last=last, moves=moves))
    return path


def test_a_subject_of_ceinms(tmp_path):
    subject = read_subject(written(tmp_path))
    muscle = subject.muscles["vaslat_r"]
    assert (muscle.optimal_fibre_length, muscle.tendon_slack_length) == (0.084, 0.157)
    assert (muscle.largest_force, muscle.strength, muscle.shape) == (1871.0, 1.3, -0.5)
    assert muscle.pennation == pytest.approx(np.radians(5.0))
    assert muscle.twitch == (-0.4, -0.6)  # the defaults'
    assert subject.joints == {"knee_angle_r": ("vaslat_r",)}
    assert subject.excitations == {}
    assert subject.curves["activeForceLength"] == pytest.approx(np.array([[0.5, 1.0, 1.5], [0.0, 1.0, 0.0]]))
    assert subject.damping == 0.0
    own = read_subject(written(tmp_path, twitch="<C1>-0.1</C1><C2>-0.2</C2>")).muscles["vaslat_r"]
    assert own.twitch == (-0.1, -0.2)


def test_the_subject_of_the_walking_person(data_folder):
    subject = read_subject(data_folder / "lower_limb_walking" / "ceinms_rt_subjectCalibrated.xml")
    assert len(subject.muscles) == 92
    assert subject.joints["ankle_angle_r"] == ("tib_ant_r", "soleus_r", "med_gas_r", "lat_gas_r")
    assert subject.excitations["tib_ant_r"] == ("tib_ant_r",)
    assert subject.damping == 0.5
    assert set(subject.curves) == {"activeForceLength", "passiveForceLength", "forceVelocity"}
    soleus = subject.muscles["soleus_r"]
    assert soleus.optimal_fibre_length == pytest.approx(0.05, rel=0.3)
    assert 0.0 < soleus.pennation < 0.8


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"strength": ""}, r'muscle vaslat_r, <strengthCoefficient>: found "None", expected a number'),
        ({"strength": "much"}, r'<strengthCoefficient>: found "much", expected a number'),
        ({"pennation": "0.087"}, r"found no pennation angle above 0.087, which is as in radians; expected degrees"),
        ({"moves": "vaslat_r soleus_r"}, r"<dof> knee_angle_r: found the muscles soleus_r, expected some"),
        ({"last": "0 0"}, r"found a <curve> that is incomplete or has lists of different lengths"),
    ],
)
def test_what_is_wrong_is_told(tmp_path, wrong, message):
    with pytest.raises(RecordingError, match=message):
        read_subject(written(tmp_path, **wrong))


def test_a_file_that_is_no_subject_is_told(tmp_path):
    path = written(tmp_path)
    text = path.read_text()
    path.write_text(text[: len(text) // 2])
    with pytest.raises(RecordingError, match=r"subject.xml: not readable as XML, truncated or damaged"):
        read_subject(path)
    path.write_text("<calibration/>")
    with pytest.raises(RecordingError, match=r"found <calibration>, expected the <subject>"):
        read_subject(path)
    path.write_text(text.replace("<tendonSlackLength>0.157</tendonSlackLength>", ""))
    with pytest.raises(RecordingError, match=r"muscle vaslat_r: found no <tendonSlackLength>"):
        read_subject(path)
    path.write_text("<subject><mtuSet/></subject>")
    with pytest.raises(RecordingError, match="found no muscle"):
        read_subject(path)
    with pytest.raises(RecordingError, match="not readable"):
        read_subject(tmp_path / "none.xml")
