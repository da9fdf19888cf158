"""The look before any model: through study.toml, the virtual rigs and the page."""

import numpy as np
import pytest
from test_identify_transfer import HEAD

from pellucid._errors import StudyError
from pellucid.numerics.protocols.excitation import random_phase_multisine
from pellucid.numerics.protocols.protocol import protocol
from pellucid.orthosis.study.transfer_function.first_look import first_looks
from pellucid.orthosis.study.transfer_function.transfer_function_table import TransferFunctionTable
from pellucid.orthosis.transfer.best_linear_approximation import BestLinearApproximation
from pellucid.orthosis.transfer_function import TransferFunction
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, identify, report
from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.study import record_in_memory, write_study

SHORT = {"multisine.asked": True, "multisine.realisations": 3, "multisine.periods": 2, "multisine.resolution": 0.2}
"""A first look of a few seconds."""


def written(folder, cubic: float, *, period: str = 'period = "4 s"\n', kind="random_phase_multisine"):
    """Four realisations of a joint with a hardening spring, torque in; the third recording has a rest at its end."""
    folder.mkdir()
    motion = random_phase_multisine(
        50.0, low=0.25, high=5.0, resolution=0.25, rms=1.0, realisations=4, periods=3, settle=1, seed=3
    )
    text = HEAD + period
    joint = TransferFunction([20.0], [1.0, 4.0, 60.0])
    for m in range(4):
        u = motion.reference(m)
        time = np.arange(len(u)) / 50.0
        q = joint.simulate(time, u, hold="first", initial=[0.0, 0.0])
        q = q - cubic * q**3 + 1e-3 * np.random.default_rng(m).standard_normal(len(u))
        np.savetxt(folder / f"m{m}.csv", np.column_stack([time, u, q]), delimiter=",", header="t,u,q", comments="")
        text += f'[[recordings]]\nname = "m{m}"\nfile = "m{m}.csv"\nuse = "fit"\nprotocol = "{kind}"\n'
    (folder / "study.toml").write_text(text)
    return open_study(folder)


def test_a_bent_joint_is_told_before_it_is_fitted(tmp_path):
    study = written(tmp_path / "bent", 2.0)
    assert not [f for f in check(study) if f.severity == "refuse"]
    found = identify(study)
    look = found.looks["random_phase_multisine"]
    assert look.recordings == ("m0", "m1", "m2", "m3")
    assert isinstance(look.found, BestLinearApproximation)
    assert (look.found.periods, look.found.realisations) == (3, 4)
    first = found.verdicts[0].text
    said = "Before any model (random_phase_multisine): the best possible fit of a linear model from torque to position"
    assert first.startswith(said)
    values = {r.id: r.value for r in found.rows}
    head = "joint.transfer_function"
    assert values[f"{head}.distortion_to_noise.random_phase_multisine"] > 10.0
    assert values[f"{head}.distortion_p.random_phase_multisine"] < 1e-6
    # What is then fitted keeps to it.
    assert values[f"{head}.fit.m0"] < values[f"{head}.linear_below.random_phase_multisine"] + 1.0
    page = report(study, found).read_text(encoding="utf-8")
    assert "Before any model" in page
    assert "before-random_phase_multisine" in page
    assert "lines-random_phase_multisine" in page


def test_a_straight_joint_is_told_as_well(tmp_path):
    found = identify(written(tmp_path / "straight", 0.0))
    said = [v for v in found.verdicts if v.text.startswith("Before any model")]
    # The input is the reference, and no channel says when it settled.
    assert [v.kind for v in said] == ["note", "good"]
    assert "the first period is excluded" in said[0].text
    assert "no distortion beyond noise" in said[1].text


def test_without_a_period_both_are_one_level_and_that_is_said(tmp_path):
    found = identify(written(tmp_path / "free", 2.0, period=""))
    assert set(found.looks) == {"m0", "m1", "m2", "m3"}
    assert not any(look.periodic for look in found.looks.values())
    assert any("noise and distortion together" in v.text for v in found.verdicts)
    assert {r.id for r in found.rows} >= {f"joint.transfer_function.local_response.m{m}" for m in range(4)}


def test_a_wrong_period_is_told_and_the_rest_goes_on(tmp_path):
    found = identify(written(tmp_path / "wrong", 2.0, period='period = "3 s"\n'))
    assert set(found.looks) == {"m0", "m1", "m2", "m3"}
    assert any("noise and distortion are not separated" in v.text for v in found.verdicts)
    assert found.fits


@pytest.mark.parametrize("rig", [bench_joint, knee_orthosis])
def test_virtual_rigs_record_it_in_place_of_their_own_protocol(rig, tmp_path):
    joint = rig()
    usual = [t.name for t in joint.trials(1)]
    look = joint.changed(SHORT)
    trials = look.trials(1)
    assert [t.name for t in trials] == ["r1", "r2", "r3", "heldout"]
    assert "r1" not in usual
    config, recordings, _ = record_in_memory(look, trials[:3], seed=1)
    asked = TransferFunctionTable.model_validate(
        {"poles": 2, "period": "5 s", "reference": "reference", "input": config.transfer_function.input}
    )
    assert config.transfer_function == asked
    found, unseen = first_looks(recordings, asked)
    assert not unseen
    seen = found["random_phase_multisine"].found
    assert seen.closed_loop
    assert seen.realisations == 3
    assert seen.p_value < 1e-3  # Coulomb friction
    study = write_study(tmp_path / "s", look, name="look", seed=1, trials=trials[:2])
    assert "reference" in study.recordings()[0]
    assert not [f for f in check(study) if f.severity == "refuse"]


def test_the_command_writes_what_a_controller_plays(tmp_path):
    said = {"rate": 100.0, "low": 0.5, "high": 5.0, "resolution": 0.5, "rms": 0.2}
    motion, files = protocol("random_phase_multisine", tmp_path / "p", **said, centre=0.3, realisations=2)
    assert [f.name for f in files] == ["random_phase_multisine_1.csv", "random_phase_multisine_2.csv"]
    table = np.loadtxt(files[1], delimiter=",", skiprows=2)
    assert np.allclose(table[:, 0], np.arange(1000) / 100.0)
    assert np.allclose(table[:, 1], motion.reference(1, 0.3), atol=1e-8)
    with pytest.raises(Exception, match="known: random_phase_multisine"):
        protocol("walk", tmp_path, **said)
    with pytest.raises(Exception, match="found no rms"):
        protocol("random_phase_multisine", tmp_path, **said | {"rms": None})


def test_a_rig_without_end_is_refused():
    from pellucid_lab.known_rigs import parse_rig
    from pellucid_lab.shipped_rigs import shipped_rig

    text = shipped_rig("bench-joint").replace("realisations = 7", "realisations = 900")
    with pytest.raises(StudyError, match="realisations"):
        parse_rig(text, "x")
