"""Motions of four joints: read from cells of cells, put together smoothly, or generated."""

import numpy as np
import pytest
from scipy.io import savemat

from pellucid._errors import DatasetError
from pellucid.files.readers.read import read_columns
from pellucid.study import datasets
from pellucid_lab.arm.human_motion import JOINTS, generated_motion, people, recorded_motion


def test_matrices_in_cells_of_cells_are_columns_named_by_their_place(tmp_path):
    tasks = np.empty((2, 2), object)
    for i, (row, column) in enumerate(np.ndindex(2, 2)):
        inner = np.empty(3, object)
        for k in range(3):
            # Motions of one length are a matrix of three dimensions to NumPy, of several no matrix at all.
            inner[k] = 100.0 * i + k + np.outer(np.arange(4.0), np.ones(7 + (k if row else 0)))
        tasks[row, column] = inner
    savemat(tmp_path / "cells.mat", {"tasks": tasks, "plain": np.arange(3.0)})
    found = read_columns(tmp_path / "cells.mat").values
    assert len(found) == 2 * 2 * 3 * 4 + 1
    assert set(found) >= {"plain", "tasks.0.0.0.0", "tasks.1.1.2.3"}
    np.testing.assert_array_equal(found["tasks.1.0.2.3"], np.full(9, 205.0))
    np.testing.assert_array_equal(found["tasks.0.1.0.1"], np.full(7, 101.0))


def test_people_move_as_they_were_recorded(data_folder):
    who = people()
    assert len(who) == 5
    motions = [m for m in datasets.recorded_motions(JOINTS) if m.person == who[0] and m.repetition == 1]
    assert [sum(m.task == task for m in motions) for task in range(1, 7)] == [6, 6, 6, 8, 2, 2]
    motion = recorded_motion(who[0], 1000.0, tasks=(1, 5))
    assert motion.position.shape[1] == 4
    # Raising the hand to the board lifts the arm, the hand at the mouth bends the elbow: signs are as named.
    first = next(m for m in motions if m.task == 1)
    lifted = np.degrees(first.angles[-1] - first.angles[0])
    assert lifted[0] > 10.0
    assert lifted[1] > 40.0
    mouth = next(m for m in motions if m.task == 5)
    assert np.degrees(mouth.angles[-1, 3]) > 115.0
    # To the other shoulder an upper arm turns inwards.
    shoulder = next(m for m in motions if m.task == 6)
    assert shoulder.angles[-1, 2] - shoulder.angles[0, 2] > 0.5
    # Smooth, at rest at both ends, and through the recorded postures.
    assert np.abs(motion.velocity[[0, -1]]).max() < 0.02
    assert np.abs(motion.acceleration).max() < 40.0
    assert np.abs(np.diff(motion.acceleration, axis=0)).max() < 1.0
    nearest = np.abs(motion.position - mouth.angles[-1]).max(axis=1).min()
    assert nearest < 0.05


def test_without_recordings_it_is_said_how_to_get_them(monkeypatch, tmp_path):
    monkeypatch.setenv("PELLUCID_DATA", str(tmp_path))
    monkeypatch.setenv("PELLUCID_CACHE", str(tmp_path))
    with pytest.raises(DatasetError, match="pellucid datasets fetch"):
        people()
    with pytest.raises(DatasetError, match="found no data set, expected joints among abduction"):
        datasets.recorded_motions(("tail",))
    made = generated_motion(3, 500.0, 12.0)
    assert made.position.shape == (6000, 4)
    assert np.abs(made.velocity[[0, -1]]).max() < 1e-9
    assert 1.0 < np.abs(made.velocity).max() < 6.0
    np.testing.assert_array_equal(made.position, generated_motion(3, 500.0, 12.0).position)


def test_motions_are_no_study(tmp_path):
    (name,) = datasets.motion_names()
    assert name not in datasets.names()
    with pytest.raises(DatasetError, match="people's motions and no study"):
        datasets.init(tmp_path / "new", dataset=name)
