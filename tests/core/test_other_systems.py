"""The core and an exported controller compile for systems that are not here."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "unit"))

import pellucid

pytestmark = pytest.mark.nightly


def test_the_core_and_a_controller_compile_for_three_systems(tmp_path):
    pytest.importorskip("ziglang", reason="not installed: ziglang")
    from research.evidence._targets import TARGETS, failures
    from test_export import made_study

    study = made_study(tmp_path)
    controller = pellucid.export(study, "c", tmp_path / "c")
    assert len(TARGETS) >= 3
    for target in TARGETS:
        assert failures(controller, tmp_path, target) == []
