"""A real muscle, fully active: the model's force over imposed length, its offset fitted on one of six amplitudes."""

import dataclasses

import pytest

from pellucid._errors import IdentificationError
from pellucid.emg.study.isolated_muscle.isolated_muscle import isolated_muscle
from pellucid.study import datasets


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


def test_a_study_without_the_table_is_refused(study):
    bare = dataclasses.replace(study, config=study.config.model_copy(update={"isolated_muscle": None}))
    with pytest.raises(IdentificationError, match=r"\[isolated_muscle\]"):
        isolated_muscle(bare)
