"""Calibrated muscles to an OpenSim model and to a CEINMS subject, and back: the same torque."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pellucid._errors import PellucidError, RecordingError
from pellucid.emg.files.muscle_constants import read_model, read_subject
from pellucid.emg.files.muscle_remark import (
    MuscleRemark,
    mean_curves,
    osim_numbers,
    read_calibrated,
    write_osim,
    write_subject,
)
from pellucid.emg.files.osim_paths import read_paths
from pellucid.emg.models.hill import HillData, HillModel, HillMuscle
from pellucid.emg.models.muscle import CARD_KIND, CalibratedMuscles
from pellucid.models.parameter_card import ParameterCard

LEG = Path(__file__).parents[1] / "data" / "osim" / "leg_4.osim"
NAMES = {"vasti": "coupled", "soleus--deep": "on_foot"}


@pytest.fixture(scope="module")
def kept():
    vasti = HillMuscle(
        "vasti", 0.0871234567890123, 0.2, 1234.5678, 0.0871, -1.7, 0.021, 0.034, 0.0456, 1.0 / 3.0, damping=0.05
    )
    soleus = HillMuscle("soleus--deep", 0.05, 0.25, 3549.0, 0.43, 0.0, 0.0, 0.02, 0.01, 1.1, damping=0.05)
    driven = {"vasti": ("vastus_lateralis", "vastus--medialis"), "soleus--deep": ("soleus",)}
    return CalibratedMuscles((vasti, soleus), driven, {"knee": (0.5, 1.25, 0.1), "ankle": (0.0, 0.0, 0.0)}, 0.6)


def torque(muscles):
    n = np.arange(300)
    excitation = np.array([0.5 + 0.4 * np.sin(0.05 * n + k) for k in range(2)])
    length = np.array([0.29 + 0.01 * np.sin(0.03 * n), 0.30 + 0.008 * np.cos(0.04 * n)])
    data = HillData(excitation, length, np.gradient(length, 0.01, axis=1), np.full((2, 300), 0.04), 0.01)
    return HillModel(muscles.muscles).torque(data)


def written(kind, kept, folder):
    if kind == "osim":
        return write_osim(folder / "made.osim", LEG, MuscleRemark(kept, NAMES))
    joints = {"knee_angle": ["vasti"], "ankle_angle": ["soleus--deep"]}
    return write_subject(folder / "made.xml", MuscleRemark(kept, NAMES, 0.01), joints)


@pytest.mark.parametrize("kind", ["osim", "ceinms"])
def test_a_file_gives_the_same_muscles_and_torque(kept, tmp_path, kind):
    again = read_calibrated(written(kind, kept, tmp_path))
    assert again == kept
    assert np.abs(torque(again) - torque(kept)).max() <= 1e-12 * np.abs(torque(kept)).max()


def test_nothing_else_of_a_model_changes(kept, tmp_path):
    path = written("osim", kept, tmp_path)
    old, new = LEG.read_text(encoding="utf-8").splitlines(), path.read_text(encoding="utf-8").splitlines()
    different = [
        (a, b) for a, b in zip(old, [line for line in new if "<!-- pellucid" not in line], strict=True) if a != b
    ]
    # A number that is the same stays the same text.
    assert {line.strip().partition(">")[0] for line, _ in different} <= {
        f"<{key}" for key in osim_numbers(kept.muscles[0])
    }
    assert len(different) <= 10
    constants = read_model(path)
    assert constants["coupled"].largest_force == pytest.approx(1234.5678 / 3.0)
    assert constants["moving"] == read_model(LEG)["moving"]
    before, after = read_paths(LEG), read_paths(path)
    q = {"knee_angle": np.array([-0.7])}
    assert (
        after.muscle("coupled").length(after.skeleton, q)[0] == before.muscle("coupled").length(before.skeleton, q)[0]
    )
    again = write_osim(tmp_path / "again.osim", path, MuscleRemark(kept, NAMES))
    assert again.read_bytes() == path.read_bytes(), "an exported model is a model, and holds one remark"


def test_a_number_changed_by_hand_is_believed(kept, tmp_path):
    path = written("osim", kept, tmp_path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(f">{kept.muscles[0].optimal_fibre_length!r}<", ">0.09<"), encoding="utf-8")
    assert read_calibrated(path).muscles[0] == replace(kept.muscles[0], optimal_fibre_length=0.09)
    path = written("ceinms", kept, tmp_path)
    path.write_text(path.read_text().replace("<shapeFactor>1.7<", "<shapeFactor>2.0<"))
    assert read_calibrated(path).muscles[0].shape == -2.0


def test_a_subject_is_one_that_ceinms_users_know(kept, tmp_path):
    subject = read_subject(written("ceinms", kept, tmp_path))
    assert subject.joints == {"knee_angle": ("coupled",), "ankle_angle": ("on_foot",)}
    assert subject.excitations["vastus_lateralis"] == ("coupled",)
    muscle = subject.muscles["coupled"]
    assert (muscle.strength, muscle.largest_force, muscle.shape) == (1.0 / 3.0, 1234.5678, 1.7)
    assert muscle.twitch == pytest.approx((-np.exp(-0.01 / 0.021), -np.exp(-0.01 / 0.034)))
    assert subject.damping == 0.05
    assert set(subject.curves) == {"activeForceLength", "passiveForceLength", "forceVelocity"}


def test_curves_are_the_cores(kept):
    found = mean_curves(kept.muscles)
    length, active = found["activeForceLength"]
    inside = (length >= 0.15) & (length <= 2.0)  # a shorter fibre's tendon is slack
    assert active[inside] == pytest.approx(np.exp(-((length[inside] - 1.0) ** 2) / 0.45), abs=1e-9)
    velocity, fast = found["forceVelocity"]
    assert fast[np.argmin(np.abs(velocity))] == pytest.approx(1.0)
    assert fast[velocity == -1.0] == pytest.approx(0.0, abs=1e-12)
    assert found["passiveForceLength"][1][length <= 1.0].max() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("kind", "old", "new", "message"),
    [
        ("osim", "</OpenSimDocument>", "", "not readable as XML, truncated or damaged"),
        (
            "osim",
            "<!-- pellucid calibrated",
            "<!-- somebody",
            "found 0 remarks of calibrated muscles, expected the one",
        ),
        ("osim", '"muscle.vasti.delay": 0.0456, ', "", r"damaged remark.*no setting muscle.vasti.delay"),
        ("osim", '"muscle.vasti.delay": 0.0456', '"muscle.vasti.delay": NaN', r"damaged remark.*not finite"),
        ("osim", 'name="coupled"', 'name="vasti"', "found no muscle coupled, expected it"),
        ("ceinms", "<name>coupled", "<name>other", "found the muscles coupled, expected some that"),
        ("ceinms", "<subject>", '<!DOCTYPE s [<!ENTITY a "b">]><subject>', "found a document type"),
    ],
)
def test_faulty_files_are_refused(kept, tmp_path, kind, old, new, message):
    path = written(kind, kept, tmp_path)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(RecordingError, match=message):
        read_calibrated(path)


def test_a_muscle_that_the_model_lacks_is_named(kept, tmp_path):
    with pytest.raises(RecordingError, match=r"expected vaslat_r too: state the model.s names.*muscle_names"):
        write_osim(tmp_path / "made.osim", LEG, MuscleRemark(kept, {**NAMES, "vasti": "vaslat_r"}))
    assert not (tmp_path / "made.osim").exists()


@pytest.fixture
def walking(tmp_path, kept):
    """A study with a model, calibrated."""
    from pellucid.models.parameter_card import write_parameter_card

    made = replace(
        kept, muscles=tuple(replace(m, name=n) for m, n in zip(kept.muscles, ("vasti", "soleus"), strict=True))
    )
    made = replace(made, driven={"vasti": ("vasti",), "soleus": ("soleus",)})
    (tmp_path / "leg.osim").write_bytes(LEG.read_bytes())
    time = np.arange(0.0, 4.0, 0.01)
    columns = ["time,knee_angle,ankle_angle,vasti,soleus,moment"]
    columns += [f"{t:.2f},{-40 + 30 * np.sin(t):.4f},{5 * np.cos(t):.4f},0.2,0.3,1.0" for t in time]
    (tmp_path / "walk.csv").write_text("\n".join(columns) + "\n")
    (tmp_path / "study.toml").write_text(
        'name = "walker"\n[rig]\njoint = "leg"\nmotion = "rotary"\nlifts = "extension"\n[channels]\n'
        'time = { column = "time", unit = "s" }\nangle.knee = { column = "knee_angle", unit = "deg" }\n'
        'angle.ankle = { column = "ankle_angle", unit = "deg" }\nemg.vasti = { column = "vasti", unit = "1" }\n'
        'emg.soleus = { column = "soleus", unit = "1" }\nmoment.knee = { column = "moment", unit = "N*m" }\n'
        '[emg_torque]\njoints = ["knee"]\nchain = "none"\nmuscle_file = "leg.osim"\n'
        'muscle_names = { vasti = "coupled", soleus = "on_foot" }\n[[recordings]]\nname = "walk"\nfile = "walk.csv"\n'
        'protocol = "walking"\n'
    )
    (tmp_path / "models").mkdir()
    card = ParameterCard(CARD_KIND, "walker", "muscles_together", (), settings=made.settings())
    write_parameter_card(tmp_path / "models" / "muscles_together.json", card)
    return tmp_path, made


def test_a_study_exports_by_command(walking):
    from typer.testing import CliRunner

    from pellucid.cli import app

    folder, made = walking
    for to, file in (("osim", "subject/walker.osim"), ("ceinms", "subject/walker.xml")):
        found = CliRunner().invoke(app, ["export", str(folder), "--to", to])
        assert found.exit_code == 0, found.output
        assert "2 calibrated muscles of the knee and ankle." in " ".join(found.output.split())
        assert read_calibrated(folder / file) == made
    assert read_subject(folder / "subject" / "walker.xml").joints["knee_angle"] == ("coupled",)


@pytest.mark.parametrize("to", ["osim", "ceinms"])
def test_a_file_that_no_export_of_the_study_wrote_stays(walking, tmp_path, to):
    import pellucid

    study = pellucid.open(walking[0])
    path = tmp_path / f"leg.{'osim' if to == 'osim' else 'xml'}"
    path.write_bytes(LEG.read_bytes())
    with pytest.raises(PellucidError, match="found a file that no export of walker wrote"):
        pellucid.export(study, to, path)
    assert path.read_bytes() == LEG.read_bytes()
    assert pellucid.export(study, to, path, overwrite=True) == path
    assert pellucid.export(study, to, path) == path  # its own
    other = replace(study, config=study.config.model_copy(update={"name": "runner"}))
    with pytest.raises(PellucidError, match="found a file that no export of runner wrote"):
        pellucid.export(other, to, path)


def test_what_an_export_of_muscles_needs_is_said(walking):
    import pellucid

    folder, _ = walking
    study = pellucid.open(folder)
    assert pellucid.export(study, "osim", folder / "own.osim") == folder / "own.osim"
    with pytest.raises(PellucidError, match=r'found to = "opensim", expected "c" .*or "osim" or "ceinms"'):
        pellucid.export(study, "opensim")
    with pytest.raises(PellucidError, match="found slider, expected none: muscles have none"):
        pellucid.export(study, "osim", slider=0.1)
    cards = folder / "models"
    for name in ("muscles_one", "muscles_two"):
        text = (cards / "muscles_together.json").read_text().replace("muscles_together", name)
        (cards / f"{name}.json").write_text(text)
    assert pellucid.export(study, "ceinms").name == "walker.xml"
    (cards / "muscles_together.json").unlink()
    with pytest.raises(
        PellucidError, match=r"found the cards muscles_one, muscles_two, expected one: say which by --card"
    ):
        pellucid.export(study, "ceinms")
    assert pellucid.export(study, "ceinms", card="muscles_two.json").name == "walker.xml"
    for name in ("muscles_one", "muscles_two"):
        (cards / f"{name}.json").unlink()
    with pytest.raises(PellucidError, match=r"found no card of muscles, expected one: pellucid calibrate"):
        pellucid.export(study, "ceinms")
