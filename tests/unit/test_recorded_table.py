"""A stored table without rows keeps no sample of the table that it was made of."""

import numpy as np

from pellucid_lab.recorded_table import Column, StoredTable


def test_an_emptied_table_releases_the_samples():
    table = StoredTable.of((Column("time", "t", "s"), Column("position", "q", "rad")), np.zeros(1000), np.ones(1000))
    emptied = table.emptied
    assert emptied.columns == table.columns
    assert emptied.values.shape == (0, 2)
    assert emptied.values.base is None
