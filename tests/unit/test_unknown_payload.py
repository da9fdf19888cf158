"""A payload that is not stated is found beside a joint that is known, with an interval, and never judged or fitted."""

import re
from dataclasses import replace

import numpy as np
import pytest
from research.evidence._foreign_joint import drawn_joint, recorded, written

import pellucid as pl
from pellucid._errors import PellucidError

MASS_KG, DISTANCE_M = 1.5, 0.25


@pytest.fixture(scope="module")
def tables():
    """Recordings of a joint that a plain integrator simulates: two without and one with a mass, one without again."""
    rng = np.random.default_rng(5)
    joint = replace(drawn_joint(rng), gravity=4.0, inertia=0.1, coulomb=0.3, viscous=0.1)
    heavy = joint.with_payload(MASS_KG, DISTANCE_M)
    return recorded([joint, joint, heavy, joint, joint], rng, 12.0)


@pytest.fixture(scope="module")
def bare(tables, tmp_path_factory):
    recordings = {"a": ("fit", tables[0]), "b": ("validate", tables[1])}
    return pl.identify(written(tmp_path_factory.mktemp("bare"), recordings), thorough=False, families=("symmetric",))


def found(folder, tables, entry, table):
    recordings = {"a": ("fit", tables[0]), "b": ("validate", tables[1]), "c": (entry, tables[table])}
    return pl.identify(written(folder, recordings), thorough=False, families=("symmetric",))


@pytest.mark.parametrize("use", ["fit", "validate"])
def test_an_unknown_payload_is_found_and_moves_no_other_number(tables, bare, tmp_path, use):
    result = found(tmp_path, tables, f"{use}\npayload = {{}}", 2)
    mass, distance = result["c.payload_mass"], result["c.payload_distance"]
    assert abs(mass.value - MASS_KG) <= 1.96 * mass.standard_error < 0.1 * MASS_KG
    assert abs(distance.value - DISTANCE_M) <= 1.96 * distance.standard_error < 0.1 * DISTANCE_M
    assert result["gravity"].value == bare["gravity"].value
    assert result.headlined.heldout_effort_error == bare.headlined.heldout_effort_error
    (verdict,) = [v for v in result.verdicts if v.finding == "unknown_payload"]
    assert "The payload of recording 'c' has a weight of" in verdict.text
    assert verdict.kind == "note"
    assert any(row.id == "foreign.payload.mass.c" for row in result.rows)


def test_a_stated_distance_leaves_the_mass_alone(tables, tmp_path):
    result = found(tmp_path, tables, f'fit\npayload = {{ distance = "{DISTANCE_M} m" }}', 2)
    mass = result["c.payload_mass"]
    assert mass.value == pytest.approx(MASS_KG, rel=0.01)
    assert result["c.payload_distance"].standard_error == 0.0


def test_no_payload_is_found_where_there_is_none(tables, tmp_path):
    result = found(tmp_path, tables, "fit\npayload = {}", 3)
    (verdict,) = [v for v in result.verdicts if v.finding == "unknown_payload"]
    assert verdict.kind == "warning"
    assert "The payload of recording 'c' is not identifiable" in verdict.text
    assert "c.payload_mass" not in result.estimates


def test_a_study_of_unknown_payloads_alone_is_refused(tables, tmp_path):
    with pytest.raises(PellucidError, match="without an unknown payload"):
        pl.identify(written(tmp_path, {"c": ("fit\npayload = {}", tables[2])}), thorough=False, families=("symmetric",))


@pytest.mark.parametrize("use", ["fit", "validate"])
def test_an_unstated_payload_in_one_file_is_the_tested_cause(tables, tmp_path, use):
    recordings = {"a": ("fit", tables[0]), "b": ("fit", tables[3])}
    recordings |= {"c": ("validate", tables[1]), "d": ("validate", tables[4]), "odd": (use, tables[2])}
    result = pl.identify(written(tmp_path, recordings), thorough=False, families=("symmetric",))
    told = [v for v in result.verdicts if "An unstated payload explains" in v.text]
    assert told
    assert all("'odd'" in v.text and "payload = {}" in v.do for v in told)
    mass = float(re.search(r": ([0-9.]+) ± [0-9.]+ kg", told[0].text)[1])
    assert mass == pytest.approx(MASS_KG, rel=0.1)


def test_a_change_of_friction_is_no_payload(tables, tmp_path):
    rubbed = tables[3].copy()
    rubbed[:, 2] += 0.5 * np.sign(np.gradient(rubbed[:, 1]))
    recordings = {"a": ("fit", tables[0]), "b": ("fit", tables[1]), "odd": ("fit", rubbed)}
    result = pl.identify(written(tmp_path, recordings), thorough=False, families=("symmetric",))
    assert not any("payload" in v.text for v in result.verdicts)
