"""Damage of every kind to a recording of every format is answered with its numbers or with a message.

`EACH` files of a format, the same every time; FUZZ=N says how many. ``research.evidence files`` runs commands on them.
"""

import os

import numpy as np
import pytest
from research.evidence._healthy import healthy
from research.evidence._mutations import damaged

from pellucid._errors import PellucidError
from pellucid.files.readers.read import read_columns, readers_by_ending

EACH = int(os.environ.get("FUZZ", "120"))


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    return list(healthy(tmp_path_factory.mktemp("healthy"), 200))


@pytest.mark.parametrize("ending", sorted(readers_by_ending()))
def test_every_reader_answers_whatever_it_is_given(tmp_path, studies, ending):
    own = [study for study in studies if study.name.rpartition("-")[0] == ending[1:]]
    assert own
    answered = refused = 0
    for study in own:
        source = study / "recordings" / f"sweep{ending}"
        content, path = source.read_bytes(), tmp_path / source.name
        assert len(read_columns(source).names) >= 3
        for seed in range(EACH // len(own)):
            path.write_bytes(damaged(content, np.random.default_rng([seed, *ending.encode()])))
            try:
                answered += all(x if isinstance(x, str) else x.ndim == 1 for x in read_columns(path).values.values())
            except PellucidError as error:
                refused += path.name in str(error)
    assert answered + refused == EACH // len(own) * len(own)
    assert refused
