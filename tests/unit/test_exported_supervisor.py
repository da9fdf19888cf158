"""The supervisor that leaves the house is the one that the virtual lab measures."""

from pathlib import Path

import pytest
from research.evidence import _exported_equal
from research.evidence._exported_equal import compare_knee_laws, compare_supervisors

from pellucid._errors import PellucidError
from pellucid.controllers.export.c_folder import read_constants
from pellucid.controllers.export.controller_values import ControllerValues
from pellucid.controllers.supervised import supervised
from pellucid_lab.safety.worn_knee import LAWS as KNEE_LAWS
from pellucid_lab.safety.worn_robot import LAWS


def test_every_number_of_every_law_is_the_measured_one():
    count, differing = compare_supervisors()
    assert differing == []
    assert count == len(LAWS) + len(KNEE_LAWS)


def test_the_law_of_a_knee_is_the_exported_one_wherever_it_is_worn():
    """Lab, ranking and certificate wore a stronger one, whose loop knew the orthosis's inertia."""
    assert compare_knee_laws() == []


def test_an_export_that_forgets_instruments_or_body_is_found(monkeypatch):
    """So was every export before ``[rig.instruments]``: the comparison would have told."""
    monkeypatch.setattr(ControllerValues, "supervised", property(lambda values: supervised(values.control_law)))
    monkeypatch.setattr(_exported_equal, "LAWS", ("fc", "force_sensor"))
    count, differing = compare_supervisors()
    assert count == 4
    for law, lacking in (("fc", "body_inertia"), ("force_sensor", "force_range"), ("worn", "drive_expected")):
        assert lacking in {name for name_of_law, name, *_ in differing if name_of_law == law}
    assert {"drive_expected", "test_least"} <= {name for law, name, *_ in differing if law == "force_sensor"}


def test_a_file_that_is_no_export_s_is_refused(tmp_path):
    with pytest.raises(PellucidError, match=r"pellucid_constants\.h: not readable"):
        read_constants(tmp_path)
    path = Path(tmp_path) / "pellucid_constants.h"
    path.write_text("    1.0f, /* period [s] */\n", encoding="utf-8")
    with pytest.raises(PellucidError, match="found no raw_speed_limit"):
        read_constants(tmp_path)
    path.write_text("    1.0f, /* period [s] */\n    1.0f, /* period [s] */\n", encoding="utf-8")
    with pytest.raises(PellucidError, match="period: found it twice"):
        read_constants(tmp_path)
