"""Isometric tests as laboratories record them: raw EMG, a joint held by a dynamometer, %MVC, maximal contractions."""

import numpy as np
import pytest
from made_emg import FS, raw_emg

import pellucid
from pellucid._errors import IdentificationError, RecordingError, StudyError
from pellucid.models.parameter_card import read_parameter_card
from pellucid.procedures.emg_torque.trial_sources import moment_trials
from pellucid.procedures.registry import open_study
from pellucid.procedures.run import check

STUDY = """
name = "isometric"

[rig]
joint = "knee"
motion = "rotary"
lifts = "extension"

[channels]
time = { rate = "2048 Hz" }
emg.vastus_lateralis = { column = "VL", unit = "mV" }
emg.biceps_femoris = { column = "BF", unit = "mV" }
angle.knee = { value = "-60 deg" }
moment.knee = { column = "torque", unit = "%MVC" }

[emg_torque]
joints = ["knee"]
chain = "hill"
"""
RECORDINGS = """
[[recordings]]
name = "mvc"
file = "mvc.csv"
protocol = "mvc"

[[recordings]]
name = "ramps"
file = "ramps.csv"

[[recordings]]
name = "others"
file = "others.csv"
use = "validate"
channels.angle.knee = { value = "-90 deg" }
"""


def contraction(effort, rng):
    """Raw EMG [mV] and torque [%MVC] of an effort (n,)."""
    vastus, biceps = (1e3 * raw_emg(gain * (0.01 + x), rng) for gain, x in ((4e-4, effort), (2e-4, 0.2 * effort)))
    return np.column_stack([vastus, biceps, 100.0 * effort])


def ramp(seconds, tops, rng):
    time = np.arange(0.0, seconds, 1.0 / FS)
    return contraction(np.interp(time, np.linspace(0.0, seconds, len(tops)), tops), rng)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder, rng = tmp_path_factory.mktemp("isometric"), np.random.default_rng(5)
    made = {
        "mvc": ramp(4.0, (0, 1, 1, 0), rng),
        "ramps": ramp(12.0, (0, 0.6, 0.1, 0.8, 0), rng),
        "others": ramp(8.0, (0, 0.4, 0.7, 0), rng),
    }
    for name, table in made.items():
        np.savetxt(folder / f"{name}.csv", table, fmt="%.5f", delimiter=",", header="VL,BF,torque", comments="")
    return folder


def study(files, text=STUDY, recordings=RECORDINGS):
    (files / "study.toml").write_text(text + recordings, encoding="utf-8")
    return open_study(files)


def test_a_constant_angle_and_shares_of_a_maximal_contraction(files):
    made = study(files)
    assert [f.message for f in check(made) if f.severity == "refuse"] == []
    ramps, others = moment_trials(made, "knee")
    assert (ramps.unit, others.heldout) == ("MVC", True)
    assert ramps.fs == pytest.approx(102.4, rel=0.01)
    assert np.ptp(ramps.angles["knee"]) == 0.0
    assert ramps.angles["knee"][0] == pytest.approx(np.radians(-60.0))
    assert others.angles["knee"][0] == pytest.approx(np.radians(-90.0))
    assert np.max(ramps.torque) == pytest.approx(0.8, rel=0.02)
    # Relative to the maximal contraction, which is fitted nowhere.
    assert np.max(ramps.envelopes["vastus_lateralis"]) == pytest.approx(0.8, abs=0.2)


@pytest.mark.parametrize(
    ("asked", "top"), [('normalise = "largest"', 1.0), ('normalise = "none"', 4e-4), ('normalise = "mvc"', 0.8)]
)
def test_a_normalisation_that_is_asked_for(files, asked, top):
    ramps, _ = moment_trials(study(files, f"{STUDY}{asked}\n"), "knee")
    assert 0.6 * top < np.max(ramps.envelopes["vastus_lateralis"]) < 1.3 * top


def test_a_normalisation_of_a_chain_that_has_none_needs_its_recording(files):
    text = STUDY.replace('chain = "hill"', 'chain = "knee"\nnormalise = "mvc"')
    ramps, _ = moment_trials(study(files, text), "knee")
    assert 0.5 < np.max(ramps.envelopes["vastus_lateralis"]) < 1.1
    without = study(files, text, RECORDINGS.replace('protocol = "mvc"', 'protocol = "rest"'))
    with pytest.raises(IdentificationError, match='found no recording with the protocol "mvc"'):
        moment_trials(without, "knee")


def test_a_largest_moment_gives_muscles_their_newtons(files):
    made = study(files, f'{STUDY}\n[emg_torque.largest_moment]\nknee = "200 N*m"\n')
    ramps, _ = moment_trials(made, "knee")
    assert ramps.unit == "N*m"
    assert np.max(ramps.torque) == pytest.approx(160.0, rel=0.02)


def test_units_that_do_not_agree_and_constants_that_are_none_are_refused(files):
    both = RECORDINGS + '\nchannels.moment.knee = { column = "torque", unit = "N*m" }\n'
    both = both.replace('channels.angle.knee = { value = "-90 deg" }\n\nchannels', "channels")
    with pytest.raises(RecordingError, match="found the unit N\\*m, expected MVC as in the recording ramps"):
        moment_trials(study(files, recordings=both), "knee")
    with pytest.raises(StudyError, match='expected a number and its unit, such as "60 deg"'):
        study(files, STUDY.replace('"-60 deg"', '"bent"'))
    with pytest.raises(StudyError, match="found value beside unit, expected it alone"):
        study(files, STUDY.replace('{ value = "-60 deg" }', '{ value = "-60 deg", unit = "deg" }'))
    with pytest.raises(StudyError, match='found the unit "%MVC", expected "rad"'):
        study(files, STUDY.replace('"-60 deg"', '"-60 %MVC"'))


def test_an_electrode_that_came_loose_is_named_by_check(files):
    table = np.loadtxt(files / "others.csv", delimiter=",", skiprows=1)
    table[:, 0] += 1.5 * np.std(table[:, 0]) * np.sin(2.0 * np.pi * 50.0 * np.arange(len(table)) / FS)
    np.savetxt(files / "loose.csv", table, fmt="%.5f", delimiter=",", header="VL,BF,torque", comments="")
    named = check(study(files, recordings=RECORDINGS.replace("others.csv", "loose.csv")))
    told = [f for f in named if f.kind == "changed_channel"]
    assert {f.channel for f in told} == {"emg.vastus_lateralis"}
    assert any("% of the power at the mains' frequencies, expected about" in f.message for f in told)


@pytest.mark.slow
@pytest.mark.slow
def test_what_is_calibrated_says_its_unit_and_what_envelopes_are_relative_to(files):
    made = study(files)
    found = pellucid.calibrate(made)
    assert "MVC" in found.headline
    assert any("relative to the largest of each muscle in maximal contractions: mvc" in v.text for v in found.verdicts)
    assert any("in shares of a maximal contraction" in v.text for v in found.verdicts)
    ridge = next(r for r in found.rows if r.id == "isometric.knee.ridge.rmse")
    assert ridge.unit == "MVC"
    assert ridge.value < 0.2
    found.save(made)
    card = read_parameter_card(made.models_dir / "torque_map_knee.json")
    assert {p.unit for p in card.parameters if p.name == "offset"} == {"MVC"}
    assert "Error (MVC)" in pellucid.report(made, found).read_text(encoding="utf-8")
    # Another angle than the one that was held.
    assert found.headline.startswith("No estimate holds on others")
