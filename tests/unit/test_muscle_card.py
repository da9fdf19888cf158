"""Calibrated muscles kept on a card and read again."""

from dataclasses import replace

import numpy as np
import pytest
from made_muscles import trial

from pellucid._errors import PellucidError
from pellucid.emg.estimators.hill import fit_hill
from pellucid.emg.models.hill import HillModel
from pellucid.emg.models.muscle import CARD_KIND, CalibratedMuscles, calibrated_muscles
from pellucid.models.parameter_card import ParameterCard, read_parameter_card, write_parameter_card


@pytest.fixture(scope="module")
def found():
    return fit_hill([trial(seconds=6.0)], weights=(0.02,))


def card(found):
    kept = CalibratedMuscles(found.fit.muscles, found.driven, {found.joint: found.fit.passive}, found.effort)
    return kept, ParameterCard(CARD_KIND, "made", "muscles_knee", (), settings=kept.settings())


def test_a_card_gives_the_same_muscles_and_their_torque(found, tmp_path):
    kept, made = card(found)
    again = calibrated_muscles(read_parameter_card(write_parameter_card(tmp_path / "muscles_knee.json", made)))
    assert again == kept
    assert again.joints == ("knee",)
    assert again.driven["vastus_intermedius"] == ("vastus_lateralis", "vastus_medialis")
    data = found.fit.problem.samples.data
    assert np.array_equal(HillModel(again.muscles).torque(data), HillModel(found.fit.muscles).torque(data))


def test_what_a_card_lacks_is_named(found):
    _, made = card(found)
    less = {key: value for key, value in made.settings.items() if key != "muscle.rectus_femoris.delay"}
    with pytest.raises(PellucidError, match=r"muscle\.rectus_femoris\.delay"):
        calibrated_muscles(replace(made, settings=less))
    with pytest.raises(PellucidError, match="found a card of hinge"):
        calibrated_muscles(replace(made, kind="hinge"))
