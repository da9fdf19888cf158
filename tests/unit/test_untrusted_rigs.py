"""A stranger's rig: whatever its file says, it is a rig or a message."""

import os

import numpy as np
import pytest
from research.evidence._mutations import damaged_toml

from pellucid._errors import PellucidError
from pellucid_lab.known_rigs import parse_rig
from pellucid_lab.shipped_rigs import shipped_rig

EACH = int(os.environ.get("FUZZ", "300"))
KINDS = (
    "bench-joint",
    "able-arm",
    "able-elbow",
    "elbow-participants",
    "elbow-people",
    "knee-orthosis",
    "knee-participants",
    "knee-seated",
)


@pytest.mark.parametrize("name", KINDS)
def test_every_rig_is_answered(name):
    text = shipped_rig(name)
    assert parse_rig(text, name).name
    read = refused = 0
    for seed in range(EACH // len(KINDS)):
        content = damaged_toml(text, np.random.default_rng([seed, *name.encode(), 5]))
        try:
            parse_rig(content.decode("utf-8", "replace"), name)
            read += 1
        except PellucidError as error:
            refused += name in str(error)
    assert read + refused == EACH // len(KINDS)
    assert read
    assert refused
