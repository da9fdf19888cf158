"""Held-out files may hold anything: no fitted number of any procedure moves, and nothing is refused for their sake."""

import numpy as np
import pytest
from made_arm import arm_study
from research.evidence._replaced import REPLACEMENTS, compare_replacements
from test_activations import leg  # noqa: F401
from test_activations import study as leg_study
from test_identify_transfer import study_of as transfer_study
from test_identify_transfer import table
from test_onset import study as onset_study
from test_synergies import study as synergies_study

import pellucid as pl
from pellucid.arm.fit.fit_tree import identify_tree
from pellucid.joint.study.aligned_motions import aligned_motions
from pellucid.numerics.motion import JudgedDataInFitError
from pellucid.numerics.regression import stack
from pellucid.study.procedures.registry import open_study

FITTED_TWICE = """
[[recordings]]
name = "other"
file = "recordings/other.csv"
use = "fit"
[[recordings]]
name = "judged"
file = "recordings/judged.csv"
use = "validate"
"""


def swing(rng, speed, n=2400, fs=200.0):
    """Columns t, q, i of a pendulum with dry, viscous and a little load friction, and noise."""
    t = np.arange(n) / fs
    q, v, a = np.zeros(n), np.zeros(n), np.zeros(n)
    for amplitude, frequency, phase in [(0.5, 0.4, 0.0), (0.3, 1.1, 0.7), (0.1, 2.3, 1.9)]:
        w = 2.0 * np.pi * frequency * speed
        q += amplitude * np.sin(w * t + phase)
        v += amplitude * w * np.cos(w * t + phase)
        a -= amplitude * w**2 * np.sin(w * t + phase)
    load = 0.05 * a + 1.5 * np.sin(q)
    torque = load + 0.1 * v + (0.2 + 0.05 * np.abs(load)) * np.tanh(v / 0.05) + 0.02 * rng.standard_normal(n)
    return {"t": t, "q": q + 1e-4 * rng.standard_normal(n), "i": torque / 2.0}


WHOLE_AND_REST = [
    ("another machine",),
    pytest.param(tuple(name for name in REPLACEMENTS if name != "another machine"), marks=pytest.mark.nightly),
]
"""The replacement that changes most is tried in every run, the others nightly."""


def assert_nothing_moves(study, names=tuple(REPLACEMENTS), **options):
    for found in compare_replacements(study, names, **options):
        assert not found.refused, (found.name, found.refused)
        assert not found.moved, (found.name, len(found.moved), found.moved[:5])


@pytest.fixture
def joint(make_study, rng):
    study = make_study(swing(rng, 1.0), append=FITTED_TWICE)
    for name, speed in (("other", 0.7), ("judged", 1.2)):
        table = swing(rng, speed)
        np.savetxt(
            study.folder / f"recordings/{name}.csv", np.column_stack(list(table.values())), delimiter=",",
            header=",".join(table), comments="", fmt="%.9g",
        )  # fmt: skip
    return open_study(study.folder)


@pytest.mark.slow
@pytest.mark.parametrize("names", WHOLE_AND_REST)
def test_a_joint(joint, names):
    assert_nothing_moves(joint, names, joint={"families": ["symmetric", "load"]})


@pytest.mark.slow
@pytest.mark.parametrize("names", WHOLE_AND_REST)
def test_a_robot(tmp_path, names):
    assert_nothing_moves(open_study(arm_study(tmp_path / "arm", payload=1.2)), names)


def test_a_transfer_function(tmp_path):
    assert_nothing_moves(transfer_study(tmp_path / "s", {"a": ("fit", table(0)), "c": ("validate", table(2))}))


@pytest.mark.parametrize("names", WHOLE_AND_REST)
def test_synergies(tmp_path, names):
    assert_nothing_moves(synergies_study(tmp_path / "s", people=("P1",)), names)


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("procedure", ["activations", pytest.param("emg_torque", marks=pytest.mark.nightly)])
def test_torque_from_emg_and_activations(tmp_path, leg, procedure):  # noqa: F811
    assert_nothing_moves(leg_study(tmp_path / "leg", leg), ("effort times three",), procedure=procedure)


def test_onsets(tmp_path):
    study = onset_study(tmp_path / "s")
    text = (study.folder / "study.toml").read_text(encoding="utf-8")
    rows = (study.folder / "trial.csv").read_text(encoding="utf-8").splitlines()
    (study.folder / "judged.csv").write_text("\n".join(rows[:-500]), encoding="utf-8")
    more = '[[recordings]]\nname = "judged"\nfile = "judged.csv"\nuse = "validate"\n'
    (study.folder / "study.toml").write_text(text + more, encoding="utf-8")
    assert_nothing_moves(open_study(study.folder), ("effort times three", "time reversed"))


def test_held_out_motions_are_of_a_type_that_no_regression_takes(joint, tmp_path):
    motions = aligned_motions(joint)
    assert len(stack([m for m in motions if m.split == "fitted"]).motions) == 2
    with pytest.raises(JudgedDataInFitError, match=r"found held-out data \(judged\), expected fitted recordings only"):
        stack(motions)
    from pellucid.arm.study.recorded_tree import recorded_tree

    robot, motions = recorded_tree(pl.open(arm_study(tmp_path / "arm")))
    with pytest.raises(JudgedDataInFitError, match="identify_tree: found held-out data"):
        identify_tree(robot, motions)
