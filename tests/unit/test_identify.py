"""The staged identification, on studies the virtual lab recorded: what it finds, says, writes and refuses."""

import json
import re
import shutil

import numpy as np
import pytest

from pellucid._errors import IdentificationError, PellucidError
from pellucid.joint.study.joint_result import rows_of
from pellucid.models.card import read_card
from pellucid.study.procedures.compare import compare
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, identify
from pellucid.study.results import read_rows
from pellucid_lab.bench.rig import bench_joint, matched
from pellucid_lab.study import write_study

SLOW = {"motion_range.velocity": 0.25, "motion_range.acceleration": 2.0, "drive.current_noise": 0.4}


@pytest.fixture(scope="module")
def virtual(tmp_path_factory):
    return write_study(tmp_path_factory.mktemp("lab") / "virtual", bench_joint(), name="virtual", seed=5)


@pytest.fixture(scope="module")
def fit(virtual):
    return identify(virtual, families=["symmetric", "load"])


def test_one_choice_names_family_and_estimator(fit):
    for name, family in fit.families.items():
        assert family.choice is (fit.choice if name == fit.best else None)
        assert bool(family.chosen) == (name == fit.best)
    assert {c.family for c in fit.choice.candidates} == set(fit.families)
    assert fit.headlined.estimate.method == fit.choice.method


def test_prediction_intervals_hold_on_a_plant_richer_than_the_model(fit):
    held = [p for p in fit.families["load"].predictions if p.split == "heldout"]
    assert len(held) == 2
    for prediction in held:
        assert 0.90 <= prediction.coverage <= 0.99


def test_load_friction_is_found_and_predicts_better_than_symmetric(fit):
    assert fit.best == "load"
    found = fit["load_friction"]
    assert found.trusted
    assert found.interval()[0] > 0.0
    assert found.value - 2.0 * found.statistical_error > 0.02
    assert fit.families["load"].heldout_effort_error < 0.8 * fit.families["symmetric"].heldout_effort_error


def test_every_method_runs_where_the_loop_is_known(fit):
    family = fit.families["symmetric"]
    assert set(family.others) == {"wls", "irls", "iv", "didim", "output_error"}
    assert all(estimate.converged for estimate in family.others.values())
    for simulation in family.simulations["ls"]:
        assert np.isfinite(simulation.rmse)


def test_progress_reaches_the_end(virtual):
    told = []
    identify(virtual, families=["symmetric"], thorough=False, on_progress=lambda text, share: told.append(share))
    assert told[0] == 0.0
    assert told[-1] == 1.0
    assert told == sorted(told)


def test_the_card_comes_back_as_it_was_written(virtual, fit):
    rows = fit.save(virtual)
    card = read_card(virtual.models_dir / "joint.json")
    assert card.family == fit.best
    chosen = fit.headlined.estimate
    assert (card.method, card.purpose) == (chosen.method, "torque")
    assert card.values == pytest.approx(chosen.array, rel=1e-15)
    assert np.array(card.covariance) == pytest.approx(chosen.covariance, rel=1e-12)
    model = card.model()
    assert model.vector(card.values) == pytest.approx(chosen.model.vector(card.values))
    reference = read_card(virtual.models_dir / f"joint.{fit.best}.json")
    assert reference.method == "ls"
    assert reference.values == pytest.approx(fit.families[fit.best].estimate.array, rel=1e-15)
    assert {row.id for row in read_rows(virtual.results_path)} == {row.id for row in rows}
    headline = {row.id: row for row in rows if row.id.startswith("virtual.headline.")}
    for p in chosen.parameters:
        row = headline[f"virtual.headline.{p.name}"]
        assert row.value == p.value
        assert f"method {chosen.method}; family {fit.best}; chosen for torque" in row.note
    assert headline["virtual.headline.heldout.effort_error"].value == fit.headlined.heldout_effort_error
    for row in rows:
        assert row.id.startswith("virtual.")
        assert row.command == "identify"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("not json", "not a model card"),
        ("[]", 'found no whole number "format"'),
        ('{"format": 99}', "a model card of format 99"),
        ('{"format": 1, "parameters": []}', "not a model card of format 1"),
    ],
)
def test_a_broken_card_is_refused(tmp_path, text, message):
    path = tmp_path / "card.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(PellucidError, match=message):
        read_card(path)


def test_a_missing_card_says_what_to_do(tmp_path):
    with pytest.raises(PellucidError, match="make it with: pellucid identify"):
        read_card(tmp_path / "models" / "joint.json")


def test_an_unknown_family_is_refused(virtual):
    with pytest.raises(IdentificationError, match="unknown friction family 'dahl'; known: symmetric"):
        identify(virtual, families=["dahl"])


def edited(study, folder, *changes, suffix=""):
    """A copy of a study's study.toml beside the same recordings, with texts replaced."""
    text = (study.folder / "study.toml").read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    if "torque_constant" not in text:
        # The noise of the drive's sensor is in N*m, which a study without that constant has no use for.
        text = re.sub(r"\[rig\.instruments\.drive_sensor\]\n(?:.+\n)*", "", text)
    folder.mkdir()
    shutil.copytree(study.folder / "recordings", folder / "recordings")
    (folder / "study.toml").write_text(text + suffix, encoding="utf-8")
    return open_study(folder)


def test_a_reversed_current_is_named_by_identify_and_by_check(virtual, tmp_path):
    wrong = edited(
        virtual, tmp_path / "s", ('column = "current", unit = "A"', 'column = "current", unit = "A", sign = -1')
    )
    with pytest.raises(IdentificationError, match=r"set sign = -1 on channel 'current' or 'position' in study\.toml"):
        identify(wrong, families=["symmetric"])
    assert any("reversed" in fault.message for fault in check(wrong))


def test_check_finds_nothing_wrong_with_a_sound_study(virtual):
    assert [fault for fault in check(virtual) if fault.severity == "refuse"] == []


def test_a_moving_mass_bounds_the_inertia_and_the_note_says_so(virtual, tmp_path):
    study = edited(virtual, tmp_path / "s", ('motion = "rotary"', 'motion = "rotary"\nmoving_mass = "1.12 kg"'))
    found = identify(study, families=["symmetric"], thorough=False).families["symmetric"]
    assert found["inertia"].at_bound
    assert found["inertia"].value == pytest.approx((found["gravity"].value / 9.80665) ** 2 / 1.12, rel=1e-6)
    assert any("1.12 kg" in note for note in found.estimate.notes)


def test_without_a_torque_constant_results_stay_per_ampere(virtual, tmp_path, fit):
    study = edited(virtual, tmp_path / "s", ('torque_constant = "0.06 N*m/A"\n', ""))
    found = identify(study, families=["symmetric"], thorough=False)
    assert found.families["symmetric"]["inertia"].unit == "A*s^2/rad"
    ratio = fit.families["symmetric"]["inertia"].value / found.families["symmetric"]["inertia"].value
    assert ratio == pytest.approx(bench_joint().gain, rel=1e-9)
    assert any("per ampere" in verdict.text for verdict in found.verdicts)


def test_without_held_out_recordings_it_says_so(virtual, tmp_path):
    study = edited(virtual, tmp_path / "s", ('use = "validate"', 'use = "fit"'))
    found = identify(study, families=["symmetric"], thorough=False)
    assert np.isnan(found.families["symmetric"].heldout_effort_error)
    assert any("No recording is held out" in verdict.text for verdict in found.verdicts)
    rows = {row.id: row for row in rows_of(found)}
    assert "virtual.symmetric.heldout.r2" not in rows


def test_a_slow_recording_is_told_that_viscous_friction_does_not_show(tmp_path):
    joint = matched(bench_joint())
    slow = joint.changed(SLOW)
    study = write_study(tmp_path / "slow", slow, name="slow", seed=3)
    fitted = 'file = "recordings/multisine.csv"\nuse = '
    slow_only = edited(study, tmp_path / "s", (f'{fitted}"fit"', f'{fitted}"validate"'), ('"0.2 rad/s"', '"0.1 rad/s"'))
    found = identify(slow_only, families=["symmetric"], thorough=False)
    assert not found.families["symmetric"]["viscous"].identifiable
    assert any(v.text.startswith("viscous is not identifiable") for v in found.verdicts)


@pytest.mark.nightly
def test_two_recordings_of_one_joint_do_not_differ_and_a_worn_one_does(tmp_path):
    joint = bench_joint()
    worn = {f"joint.coulomb_{side}": 1.3 * joint["joint"][f"coulomb_{side}"] for side in ("positive", "negative")}
    folders = []
    for name, plant, seed in (("a", joint, 1), ("b", joint, 2), ("c", joint.changed(worn), 3)):
        study = write_study(tmp_path / name, plant, name=name, seed=seed)
        identify(study, families=["load"], thorough=False).save(study)
        folders.append(study.folder)
    same, worse = compare(folders[0], folders[1]), compare(folders[0], folders[2])
    assert not any(row.changed for row in same.rows)
    assert "No parameter changed" in same.verdicts[0].text
    assert {row.name for row in worse.rows if row.changed} >= {"coulomb"}
    assert any("coulomb changed from" in verdict.text for verdict in worse.verdicts)


def test_different_joints_are_not_compared(virtual, tmp_path, fit):
    fit.save(virtual)
    card = json.loads((virtual.models_dir / "joint.json").read_text(encoding="utf-8"))
    other = tmp_path / "other.json"
    slide = {"motion": "prismatic", "effort_unit": "N", "parameters": [], "covariance": [], "statistical": []}
    other.write_text(json.dumps(card | slide), encoding="utf-8")
    with pytest.raises(IdentificationError, match="motion is 'rotary' in the first and 'prismatic' in the second"):
        compare(virtual.models_dir / "joint.json", other)


@pytest.mark.nightly
@pytest.mark.slow
def test_two_payloads_give_the_drive_constant_of_a_study(tmp_path):
    """Recorded bare and with 1.5 kg at 0.2 m: the study then knows its torque per ampere, with an interval."""
    mass, distance = 1.5, 0.2
    joint = matched(bench_joint())
    more = {"inertia": mass * distance**2, "gravity_sine": mass * 9.80665 * distance}
    loaded = joint.changed({f"joint.{name}": joint["joint"][name] + value for name, value in more.items()})
    folder = tmp_path / "bare"
    study = write_study(folder, joint, name="bare", seed=1)
    other = write_study(tmp_path / "loaded", loaded, name="loaded", seed=2)
    (folder / "recordings" / "loaded.csv").write_bytes((other.folder / "recordings" / "multisine.csv").read_bytes())
    entry = (
        '\n[[recordings]]\nname = "loaded"\nfile = "recordings/loaded.csv"\nuse = "fit"\n'
        f'payload = {{ mass = "{mass} kg", distance = "{distance} m" }}\n'
    )
    known = edited(study, tmp_path / "known", suffix=entry)
    bare = identify(study, families=["symmetric"], thorough=False).families["symmetric"]
    both = identify(known, families=["symmetric"]).families["symmetric"]
    for p, q in zip(bare.estimate.parameters, both.estimate.parameters, strict=True):
        assert p.value == pytest.approx(q.value, abs=3.0 * np.hypot(p.standard_error, q.standard_error)), p.name
    loaded_loop = [s for s in both.simulations["ls"] if s.recording == "loaded" and s.mode == "closed_loop"]
    assert loaded_loop[0].errors["effort"] < 5.0
    unknown = edited(study, tmp_path / "s", ('torque_constant = "0.06 N*m/A"\n', ""), suffix=entry)
    found = identify(unknown, families=["symmetric"], thorough=False)
    low, high = found.drive_constant.interval()
    assert low < joint.gain < high
    assert high - low < 0.1 * joint.gain
    rows = {row.id: row for row in rows_of(found)}
    assert rows["bare.drive.constant"].unit == "N*m/A"
    assert any("The drive gives" in verdict.text for verdict in found.verdicts)
    for stated, said in (("0.06", ""), ("0.12", "imply 0.05988 instead"), ("60", "between A and mA")):
        wrong = edited(study, tmp_path / f"of{stated}", ('"0.06 N*m/A"', f'"{stated} N*m/A"'), suffix=entry)
        verdicts = identify(wrong, families=["symmetric"], thorough=False).verdicts
        told = [v for v in verdicts if v.finding in ("drive_constant", "contradicting_recordings")]
        assert [v.finding for v in told[:1]] == (["drive_constant"] if said else [])
        assert said in "".join(v.do for v in told)


def test_one_payload_throughout_is_part_of_the_joint_and_the_verdict_says_why(virtual, tmp_path):
    study = edited(
        virtual,
        tmp_path / "s",
        ('torque_constant = "0.06 N*m/A"\n', ""),
        ('use = "fit"', 'use = "fit"\npayload = { mass = "1 kg", distance = "0.1 m" }'),
    )
    found = identify(study, families=["symmetric"], thorough=False)
    assert found.drive_constant is None
    assert any("at least two different payloads" in verdict.text for verdict in found.verdicts)


def test_a_joint_without_inertia_is_not_simulated_and_the_verdicts_say_so(virtual, tmp_path):
    """Too slow and too noisy: the inertia comes out at its bound, zero, and a simulation would divide by it."""
    still = matched(bench_joint()).changed(SLOW)
    study = write_study(tmp_path / "still", still, name="still", seed=3)
    fitted = 'file = "recordings/multisine.csv"\nuse = '
    slow = edited(study, tmp_path / "s", (f'{fitted}"fit"', f'{fitted}"validate"'), ('"0.2 rad/s"', '"0.1 rad/s"'))
    found = identify(slow, families=["symmetric"])
    assert found.families["symmetric"]["inertia"].value == 0.0
    assert "simulation of multisine" in found.families["symmetric"].failures
    assert any("the simulated joint diverges" in verdict.text for verdict in found.verdicts)
    rows = {row.id for row in found.save(slow)}
    assert "still.symmetric.inertia" in rows
    assert not any(".openloop.multisine" in row for row in rows)
