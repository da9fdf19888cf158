"""A real muscle, fully active: the model's force over imposed length, its offset fitted on one of six amplitudes."""

import dataclasses
import re
import shutil

import numpy as np
import pytest

import pellucid
from pellucid._errors import IdentificationError
from pellucid.emg.study.isolated_muscle.isolated_muscle import _imposed, isolated_muscle
from pellucid.study import datasets
from pellucid.study.procedures.run import calibrate


@pytest.fixture(scope="module")
def study(data_folder, tmp_path_factory):
    return datasets.init(tmp_path_factory.mktemp("muscle") / "study", dataset="rat_soleus_hill")


@pytest.fixture(scope="module")
def found(study):
    return isolated_muscle(study)


def test_force_is_told_as_well_as_by_published_models(found):
    """They reach 3.3 to 8.9 % of the isometric force."""
    assert [t.use for t in found.trials] == ["fit"] + ["validate"] * 5
    assert found.mae_percent < 8.9
    assert found.mae_percent < 0.6 * found.rigid_mae_percent, "the tendon's strain matters"
    assert -3.5e-3 < found.offset < 0.0


def test_errors_grow_with_the_amplitude(found):
    errors = [t.mae_percent for t in found.trials]
    assert errors == sorted(errors)
    assert [t.amplitude for t in found.trials] == pytest.approx([5e-5, 1e-4, 2.5e-4, 5e-4, 1e-3, 2e-3])


def test_rows_say_what_was_fitted(found, study):
    rows = {r.id: r for r in found.rows(study)}
    assert rows["rat_soleus_hill.mae_percent"].value == found.mae_percent
    assert "trial1" in rows["rat_soleus_hill.mae_percent"].note
    assert rows["rat_soleus_hill.trial1.mae_percent"].split == "fitted"
    assert rows["rat_soleus_hill.trial6.mae_percent"].split == "heldout"


def test_numbers_name_their_amplitudes_and_their_origin(study):
    """A remark on six amplitudes stood beside a headline on five, and curves of figures were "measured"."""
    made = calibrate(study)
    assert made.answer.basis.sentence.startswith("Based on 6 recordings, digitised from published figures;")
    assert "over 5 held-out amplitudes is 7.63 %" in made.answer.said
    (remark,) = (v.text for v in made.verdicts if v.kind == "note" and "rigid" in v.text)
    assert remark.startswith("Over all 6 amplitudes, the fitted ones included, the mean error is 6.7 %, and 15.0 %")


def test_a_study_without_the_table_is_refused(study):
    bare = dataclasses.replace(study, config=study.config.model_copy(update={"isolated_muscle": None}))
    with pytest.raises(IdentificationError, match=r"\[isolated_muscle\]"):
        isolated_muscle(bare)


def edited(study, folder, pattern, text):
    """Return a copy of the study with every match of a pattern in study.toml replaced."""
    shutil.copytree(study.folder, folder)
    place = folder / "study.toml"
    place.write_text(re.sub(pattern, text, place.read_text(encoding="utf-8")), encoding="utf-8")
    return pellucid.open(folder)


AMPLITUDE, MILLIMETRES = r"(?m)^amplitude = .*$", 'unit = "mm"'


@pytest.mark.parametrize("unit", ["1", "m"])
def test_an_amplitude_scales_a_displacement_of_any_unit(study, found, tmp_path, unit):
    other = isolated_muscle(edited(study, tmp_path / "s", MILLIMETRES, f'unit = "{unit}"'))
    assert other.mae_percent == pytest.approx(found.mae_percent, rel=1e-12)


def test_a_displacement_without_an_amplitude_is_the_measured_length(study, found, tmp_path):
    """The file holds the displacement of the trial of 1 mm."""
    trials = isolated_muscle(edited(study, tmp_path / "s", AMPLITUDE, "")).trials
    assert {t.amplitude for t in trials} == {1e-3}


def test_a_displacement_that_stays_at_0_imposes_none(study):
    recording = study.recordings()[0]
    stream = recording.streams["displacement"]
    still = dataclasses.replace(stream.channels["displacement"], samples=np.zeros(len(stream)))
    stream = dataclasses.replace(stream, channels={**stream.channels, "displacement": still})
    _, imposed, amplitude = _imposed(dataclasses.replace(recording, streams={"displacement": stream}), study)
    assert not imposed.any()
    assert amplitude > 0.0


def test_a_displacement_without_unit_and_amplitude_is_refused(study, tmp_path):
    bare = edited(edited(study, tmp_path / "a", AMPLITUDE, ""), tmp_path / "b", MILLIMETRES, 'unit = "1"')
    with pytest.raises(IdentificationError, match="found the unit 1 and no amplitude"):
        isolated_muscle(bare)
