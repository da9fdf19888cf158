"""Trials that no muscle made: refused by trial and channel, with the reason."""

from dataclasses import replace

import numpy as np
import pytest
from made_muscles import MUSCLES, trial

from pellucid._errors import IdentificationError, RecordingError
from pellucid.emg.estimators.hill import fit_hill
from pellucid.emg.estimators.muscle_trials import refuse_unfit_trials
from pellucid.emg.study.emg_torque.torque_findings import CalibrationFindings, find_applicable_estimators


def changed(made, muscle, change):
    return replace(made, envelopes={**made.envelopes, muscle: change(made.envelopes[muscle])})


def test_sound_trials_pass():
    refuse_unfit_trials([trial("a"), trial("b", seed=1)])


def test_one_maximum_for_each_trial_is_none_for_a_person():
    own = [trial(n, seed=i) for i, n in enumerate("abc")]
    own = [replace(t, envelopes={m: x / x.max() for m, x in t.envelopes.items()}) for t in own]
    with pytest.raises(RecordingError, match=r"trials a, b, c.*normalised by its own maximum"):
        fit_hill(own)


def test_the_same_maximum_within_one_file_is_no_fault():
    one = trial("a")
    one = replace(one, envelopes={m: x / x.max() for m, x in one.envelopes.items()})
    refuse_unfit_trials([one, replace(one, name="a_2")])


def test_negative_envelopes():
    with pytest.raises(RecordingError, match=r"trial a, channel emg.vastus_lateralis: found -.*below 0"):
        refuse_unfit_trials([changed(trial(), "vastus_lateralis", lambda x: x - 0.5)])


def test_an_undershoot_of_a_filter_is_no_fault():
    refuse_unfit_trials([changed(trial(), "vastus_lateralis", lambda x: x - 0.01)])


def test_an_angle_in_degrees():
    made = trial()
    made = replace(made, angles={**made.angles, "knee": np.degrees(made.angles["knee"])})
    with pytest.raises(RecordingError, match=r"channel angle.knee: found .* is it in degrees\?"):
        fit_hill([made])


def test_a_silent_muscle():
    with pytest.raises(RecordingError, match=r"channel emg.vastus_medialis: found at most .*electrode"):
        refuse_unfit_trials([changed(trial(), "vastus_medialis", lambda x: 1e-3 * x)])


def test_an_envelope_that_is_not_relative():
    with pytest.raises(RecordingError, match="relative to a maximal contraction"):
        refuse_unfit_trials([changed(trial(), "vastus_medialis", lambda x: 40.0 * x)])


def test_swapped_flexors_and_extensors():
    """Strong extensors at work while the torque flexes, and the other way round."""
    made = trial(muscles=("vastus_lateralis", "semimembranosus"), noise=0.0)
    time = made.time
    burst = np.clip(np.sin(2.0 * np.pi * 0.7 * time), 0.0, 1.0)
    other = np.clip(-np.sin(2.0 * np.pi * 0.7 * time), 0.0, 1.0)
    right = replace(
        made, envelopes={"vastus_lateralis": burst, "semimembranosus": other}, torque=20.0 * (burst - other)
    )
    refuse_unfit_trials([right])
    wrong = replace(right, envelopes={"vastus_lateralis": other, "semimembranosus": burst})
    with pytest.raises(RecordingError, match="flexor and extensor channels swapped"):
        refuse_unfit_trials([wrong])


def test_muscles_are_passed_over_where_nothing_is_known_of_them():
    found = CalibrationFindings()
    bare = replace(trial(), muscles=None)
    names = find_applicable_estimators([bare], "knee", found)
    assert "hill" not in names
    assert "ridge" in names
    assert "no lengths of muscles across the knee" in found.passed_over["knee"]


def test_an_artefact_of_one_person_does_not_refuse_the_others():
    found, spoilt = CalibrationFindings(), changed(trial(), "vastus_medialis", lambda x: 40.0 * x)
    with pytest.raises(RecordingError, match="relative to a maximal contraction"):
        find_applicable_estimators([spoilt], "A", found)
    names = find_applicable_estimators([spoilt], "A", found, is_one_of_several=True)
    assert "hill" not in names
    assert "ridge" in names
    assert "channel emg.vastus_medialis: found" in found.passed_over["A"]


def test_envelopes_in_volts_are_told():
    made = trial()
    volts = replace(made, muscles=replace(made.muscles, relative=False))
    with pytest.raises(IdentificationError, match=r'found envelopes in V.*protocol "mvc"'):
        fit_hill([volts])


def test_a_held_out_trial_is_never_fitted():
    with pytest.raises(IdentificationError, match="held-out trial b"):
        fit_hill([trial("b", heldout=True)])


def test_a_trial_without_muscles_beside_one_with_them_is_named():
    with pytest.raises(IdentificationError, match="trial b: found no lengths of muscles across the knee"):
        fit_hill([trial("a"), replace(trial("b", seed=1), muscles=None)])


def test_muscles_differ_between_trials():
    with pytest.raises(IdentificationError, match="the same muscles"):
        fit_hill([trial("a"), trial("b", muscles=MUSCLES[:3])])
