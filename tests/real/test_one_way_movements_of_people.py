"""People who point at a line: the same movements as the data's own program finds."""

import runpy

import numpy as np
import pytest

from pellucid.files.readers import read_columns
from pellucid_lab.pointing.one_way_movements import one_way_movements


@pytest.mark.nightly
def test_every_movement_is_that_of_the_data_s_own_program(data_folder):
    folder = data_folder / "human_pointing"
    if not (folder / "movements.py").is_file():
        pytest.skip("no recordings of human_pointing")
    theirs = runpy.run_path(str(folder / "movements.py"))["movements"]
    count = 0
    for path in sorted(folder.glob("P*.csv")):
        columns = read_columns(path)
        found = one_way_movements(columns.column(0, "time"), 1e-3 * columns.column(2, "place"))
        ours = np.array([(one.onset, one.end, 1e3 * one.place) for one in found]).reshape(-1, 3)
        np.testing.assert_allclose(ours, theirs(path), rtol=0.0, atol=1e-6, err_msg=path.name)
        count += len(found)
    assert count > 1500
