"""Transfer functions of a real joint that renders an impedance: the records whose figures its authors' readers know."""

import numpy as np
import pytest

from pellucid._errors import DatasetError
from pellucid.study.datasets import init
from pellucid.study.procedures.run import check, identify
from pellucid.study.results import read_rows

GOOD = ("i_005_b_1_k_10_T_50_2", "i_005_b_1_k_10_T_100_2", "i_002_b_1_k_10_T_50")


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("modular") / "study"
    try:
        study = init(folder, dataset="modexo_joint")
    except DatasetError as error:
        pytest.skip(str(error))
    return study, identify(study)


@pytest.mark.parametrize("recording", GOOD)
def test_steps_of_torque_are_fitted(found, recording):
    assert found[1].fits[recording].responses[0].fit >= 93.0
    assert found[1].heldout[recording].fit >= 90.0


def test_the_static_gain_is_the_one_the_joint_was_told(found):
    """Its controller turns torque into angle by 0.31416 rad over k, in N*mm, whatever else it does."""
    for recording in GOOD:
        fit = found[1].fits[recording]
        assert fit.transfer_function.static_gain == pytest.approx(1e3 * 0.31416 / 10.0, rel=0.02)
        low, high = fit["stiffness"].interval()
        assert high - low < 0.1 * fit["stiffness"].value


def test_every_recording_is_reported(found):
    study, findings = found
    findings.save(study)
    rows = {r.id: r for r in read_rows(study.results_path)}
    for recording in study.recordings():
        row = rows[f"modexo_joint.transfer_function.fit.{recording.name}"]
        assert (row.value is not None and row.value <= 100.0) or row.note.startswith("not fitted")
    assert all((study.models_dir / f"{name}.json").is_file() for name in findings.cards)


def test_a_stale_beginning_is_left_out_and_told(found):
    study, findings = found
    stale = "rows of garbage: time that does not advance"
    assert any(stale in v.text and GOOD[0] in v.text for v in findings.verdicts)
    assert np.all(np.diff(findings.fits[GOOD[0]].responses[0].time) > 0.0)
    recording = study.recording(GOOD[0])
    assert any(f.kind == "garbage" and f.file == recording.path.name and stale in f.found for f in check(study))


def test_two_poles_too_many_are_told(found):
    """A record that is one slow step shows one pole; the second is held at what sampling can show, and said to be."""
    fit = found[1].fits["i_005_b_5_k_2_T_50"]
    assert any("faster than the sampling shows" in note for note in fit.notes)
    assert not fit["a1"].identifiable
