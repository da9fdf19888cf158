"""Laws worn while walking: the rows and the section of `reproduce knee`, and one wearer's walk."""

import numpy as np
import pytest

from pellucid.controllers.worn import watched_worn
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.papers.knee.paper import KneePaper
from pellucid_lab.papers.knee.walking import (
    EXTENDED_LAWS,
    FREE_FOOT,
    LAW_WORDS,
    SITTING_CONDITION,
    WalkedRow,
    evaluate_walker,
    walking_rows,
    walking_section,
    watched_walking,
)
from pellucid_lab.safety.worn_knee import draw_worn_knee

CONDITIONS = (SITTING_CONDITION, "3.6", "5.4")


def made_rows():
    """Two wearers under whom zero impedance leaves 2 and 4 N*m, and every law half and a quarter of it."""
    rows = [
        WalkedRow(law, name, condition, size * (1.0 if law == "zero_impedance" else share), fault=fault)
        for name, size, share in (("D1", 2.0, 0.5), ("D2", 4.0, 0.25))
        for condition in CONDITIONS
        for law in LAW_WORDS
        if not (law in EXTENDED_LAWS and condition == SITTING_CONDITION)
        for fault in ("velocity" if (name, condition, law) == ("D2", "5.4", "residual") else "none",)
    ]
    return [*rows, WalkedRow("residual", "D1", FREE_FOOT, 1.0)]


def test_rows_are_shares_of_zero_impedance_by_wearer():
    rows = {row.id: row for row in walking_rows(made_rows())}
    plain, residual = rows["knee.walking.3.6.zero_impedance"], rows["knee.walking.3.6.residual"]
    assert (plain.ours, plain.lower, plain.upper, plain.unit) == (3.0, 2.0, 4.0, "N*m")
    assert (residual.ours, residual.lower, residual.upper, residual.unit) == (0.375, 0.25, 0.5, "1")
    assert "stopped by its gate: 0 of 2" in residual.note
    assert "stopped by its gate: 1 of 2" in rows["knee.walking.5.4.residual"].note
    assert "knee.walking.sitting.residual_thigh_sensor" not in rows
    assert not any("free_foot" in name for name in rows)
    assert {KneePaper().split(name) for name in rows} == {"simulated"}
    assert walking_rows(()) == []


def test_the_section_tells_shares_and_stops_by_speed():
    section = walking_section(made_rows())
    (table,) = section.tables
    assert table.heads == ("", "sitting", "3.6 km/h", "5.4 km/h")
    cells = {row.cells[0]: row.cells[1:] for row in table.rows}
    assert cells["zero impedance (N·m)"] == ("3.00 (2.00 to 4.00)",) * 3
    assert cells["residual compensator"][2] == "0.38 (0.25 to 0.50), 1 stopped"
    assert cells["body by model, thigh's motion carried"][0] == "–"


def test_limits_for_walking_allow_the_power_of_both_limits_and_change_nothing_else():
    law = draw_worn_knee(301).known.control_law()
    usual, walking = watched_worn(law).supervision, watched_walking(law).supervision
    both = law.values["effort_limit"] * law.values["velocity_limit"]
    assert {name: value for name, value in walking.items() if value != usual[name]} == {"power_limit": both}
    assert usual["power_limit"] == 0.5 * both


@pytest.mark.nightly  # identifies a wearer
def test_a_wearer_walks_under_laws_that_were_built_sitting(monkeypatch, tmp_path):
    monkeypatch.setenv("PELLUCID_DATA", str(tmp_path))
    rows = evaluate_walker(
        knee_orthosis(), "D8300", speeds=("3.6",), duration=6.0,
        laws=("zero_impedance", "residual", "residual_thigh_sensor", "residual_foot_switch"),
    )  # fmt: skip
    found = {(row.law, row.condition): row for row in rows}
    assert set(found) == {
        ("zero_impedance", SITTING_CONDITION), ("residual", SITTING_CONDITION),
        ("zero_impedance", "3.6"), ("residual", "3.6"),
        ("residual_thigh_sensor", "3.6"), ("residual_foot_switch", "3.6"), ("residual", FREE_FOOT),
    }  # fmt: skip
    assert all(np.isfinite(row.torque) and row.torque > 0.1 for row in rows)
    assert found["residual", SITTING_CONDITION].torque < 0.6 * found["zero_impedance", SITTING_CONDITION].torque
    assert np.isfinite(found["residual", "3.6"].stance + found["residual", "3.6"].error)
